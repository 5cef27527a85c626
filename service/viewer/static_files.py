"""The files of the page, from ``service/page``, which ``make web`` fills, and a message where they are missing.

The page is one document for every path; its script reads the path. It loads nothing from any other host and runs
no script that does not come as a file of its own, and the headers hold the browser to that.
"""

from __future__ import annotations

import gzip
import re
from functools import lru_cache
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

FOLDER = Path(__file__).resolve().parents[1] / "page"
MEDIA = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml",
         ".txt": "text/plain; charset=utf-8"}
NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*\.(js|css|svg|txt)")
POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
          "base-uri 'none'; form-action 'self'; frame-ancestors 'none'")
HEADERS = {"Content-Security-Policy": POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
           "Cross-Origin-Opener-Policy": "same-origin"}
NOT_BUILT = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>zonemill: the page is not built</title></head>
<body><h1>The page is not built here</h1>
<p>This service runs, but the files of its page were not made when it was installed.</p>
<p>Remedy: run <code>make web</code> in the folder of the project, and load this page again. No restart is needed.</p>
<p>Everything else works without it: <a href="/openapi.json">the HTTP interface</a>, or <code>zonemill plan</code>.</p>
</body></html>
"""


def page(folder: Path = FOLDER) -> Response:
    """The document of the page; status 503 with the remedy where it is not built."""
    index = folder / "index.html"
    headers = {**HEADERS, "Cache-Control": "no-cache"}
    if not index.is_file():
        return Response(NOT_BUILT, 503, headers, "text/html; charset=utf-8")
    return Response(index.read_bytes(), 200, headers, "text/html; charset=utf-8")


def asset(request: Request, name: str, folder: Path = FOLDER) -> Response:
    """A file of the page, packed where the browser accepts it. Its name holds its hash, so browsers may keep it."""
    path = folder / "assets" / name
    if not NAME.fullmatch(name) or not path.is_file():
        return Response("the page has no such file\n", 404, HEADERS, "text/plain; charset=utf-8")
    headers = {**HEADERS, "Cache-Control": "public, max-age=31536000, immutable", "Vary": "Accept-Encoding"}
    data = path.read_bytes()
    if "gzip" in request.headers.get("accept-encoding", ""):
        data, headers["Content-Encoding"] = _packed(data), "gzip"
    return Response(data, 200, headers, MEDIA[path.suffix])


@lru_cache(maxsize=16)
def _packed(data: bytes) -> bytes:
    return gzip.compress(data, 6, mtime=0)
