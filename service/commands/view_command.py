"""``zonemill view DIR``: the web page of a job for a folder of results, for this machine only.

It answers the few paths that the page of one job uses, from the files of the folder. There is no job table, no engine
and no key. It listens on the loopback interface only and refuses requests that name another host, such as those that a
page of another site sends.
"""

from __future__ import annotations

import contextlib
import json
import socket
import webbrowser
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from geometry.errors import SetupError
from schemas.jobs import Job, JobFile, JobFiles, JobLinks
from service.console import say
from service.jobs.resources import file_sha256, is_program, media_type
from service.settings import is_loopback
from service.viewer.static_files import asset, page
from service.viewer.view_data import VIEW_NAME

HERE = "/v1/jobs/folder"


def folder_app(folder: Path) -> Starlette:
    """The application that shows a folder of results.

    Raises
    ------
    SetupError
        no_results: the folder has no report or no view.
    """
    files = {p.name: p for p in sorted(folder.glob("*")) if p.is_file() and not p.name.endswith(".part")}
    if VIEW_NAME not in files or "report.json" not in files:
        missing = [n for n in (VIEW_NAME, "report.json") if n not in files]
        raise SetupError(f"{folder} has no {' and no '.join(missing)}", code="no_results", subjects=tuple(missing),
                         remedy="give a folder that zonemill plan --out or zonemill verify --out has written; an "
                                "earlier version wrote other files, so run the command again")
    report = json.loads(files["report.json"].read_bytes())
    names = {f["name"] for f in report["files"]} | {"report.json", VIEW_NAME}
    shown = {n: p for n, p in files.items() if n in names and (report["state"] == "proved" or not is_program(n))}

    def job(_request: Request) -> Response:
        return JSONResponse(_job(folder, report, files["report.json"]).model_dump())

    def listed(_request: Request) -> Response:
        items = [JobFile(name=n, size_bytes=p.stat().st_size, sha256=file_sha256(p), media_type=media_type(n),
                         href=f"{HERE}/files/{n}") for n, p in shown.items()]
        return JSONResponse(JobFiles(items=items).model_dump())

    def one(request: Request) -> Response:
        path = shown.get(request.path_params["name"])
        if path is None:
            return JSONResponse({"title": "No such file", "status": 404,
                                 "detail": "there is no such file in the folder"}, 404)
        return FileResponse(path, media_type=media_type(path.name), filename=path.name,
                            headers={"ETag": f'"{file_sha256(path)}"', "X-Content-Type-Options": "nosniff",
                                     "Cache-Control": "no-cache"})

    routes = [Route("/", lambda _request: RedirectResponse(f"{HERE}/view")), Route(f"{HERE}/view", _page),
              Route("/assets/{name}", _asset), Route(HERE, job), Route(f"{HERE}/files", listed),
              Route(f"{HERE}/files/{{name}}", one)]
    app = Starlette(routes=routes)
    app.add_middleware(_ThisMachine)
    return app


def _page(_request: Request) -> Response:
    return page()


def _asset(request: Request) -> Response:
    return asset(request, request.path_params["name"])


class _ThisMachine:
    """Passes only requests whose Host is this machine."""

    def __init__(self, app: Any) -> None:
        self.app = app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer one request."""
        if scope["type"] == "http":
            host = Request(scope).url.hostname or ""
            if not is_loopback(host):
                await JSONResponse({"title": "Only for this machine", "status": 403, "detail": "call 127.0.0.1"},
                                   403)(scope, receive, send)
                return
        await self.app(scope, receive, send)


def _job(folder: Path, report: dict[str, Any], path: Path) -> Job:
    inputs = report.get("inputs", {})
    made = datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds").replace("+00:00", "Z")
    return Job(id="folder", kind="plan" if "zones" in report else "verify", state=report["state"], stage="done",
               progress=1.0, attempt=1, content_sha256="", part_sha256=inputs.get("part_sha256", ""),
               setup_sha256=inputs.get("setup_sha256", ""), labels={"part": folder.resolve().name,
                                                                    **report.get("labels", {})},
               created_at=made, finished_at=made, error=None,
               links=JobLinks(self=HERE, events=f"{HERE}/events", files=f"{HERE}/files", view=f"{HERE}/view"))


def show_folder(folder: Path, port: int, *, open_browser: bool) -> None:
    """Serve the page of a folder on 127.0.0.1 until Ctrl-C.

    port : 0 for any free port

    Raises
    ------
    SetupError
        no_results: the folder has no results; cannot_listen: the port is in use.
    """
    app = folder_app(folder)
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError as error:
        listener.close()
        raise SetupError(f"cannot listen on 127.0.0.1:{port}: {error.strerror}", code="cannot_listen",
                         remedy="use another --port; 0 is any free port") from None
    url = f"http://127.0.0.1:{listener.getsockname()[1]}{HERE}/view"
    say(f"{url} until Ctrl-C")
    if open_browser:
        webbrowser.open(url)
    with contextlib.suppress(KeyboardInterrupt):  # uvicorn raises it again once it has stopped
        uvicorn.Server(uvicorn.Config(app, log_level="error", access_log=False)).run(sockets=[listener])
