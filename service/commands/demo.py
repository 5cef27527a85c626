"""``zonemill demo`` runs the first steps of a user over HTTP."""

from __future__ import annotations

import http.client
import json
import tempfile
import urllib.error
import urllib.request
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from geometry.errors import InternalError
from service.api.server import background, settings_with, wait_for_interrupt
from service.console import Progress, print_json, say
from service.delivery.result_files import clear_results
from service.errors import EXIT_BUG, EXIT_INPUT, EXIT_PROVED, EXIT_UNPROVED
from service.logs import configure


def run_demo(out: Path, *, keep: bool, chain: str = "service.pipeline") -> int:
    """Make the sample part, serve, post, follow, fetch; returns 0 only when the job is proved.

    out  : folder for the fetched files
    keep : continue to serve until Ctrl-C

    Raises
    ------
    InternalError
        The service refused a request of the demo.
    """
    from examples.demo import write_demo

    clear_results(out)
    with tempfile.TemporaryDirectory(prefix="zonemill-demo-") as folder:
        step, setup = (Path(p) for p in write_demo(Path(folder, "sample")))
        settings = settings_with({"host": "127.0.0.1", "port": 0, "data_dir": Path(folder, "data"), "auth": "auto"})
        configure("warning", settings.log_format)
        say("starting the service")
        with background(settings, chain) as url:
            say(f"serving on {url}")
            job = _post(url, step, setup)
            say(f"posted {step.name}: {url}{job['links']['self']}")
            job = _follow(url, job)
            names = _fetch(url, job, out)
            print_json({"state": job["state"], "job": url + job["links"]["self"],
                        "links": {k: url + v for k, v in job["links"].items() if v},
                        "files": [str(out / n) for n in names], "error": job["error"]})
            if names:
                say(f"to see the result: zonemill view {out}")
            if keep:
                say(f"serving on {url} until Ctrl-C; the page is {url}/")
                wait_for_interrupt()
    return exit_code(job)


def exit_code(job: dict[str, Any]) -> int:
    """Exit code of a job that has ended."""
    if job["state"] == "proved":
        return EXIT_PROVED
    if job["state"] == "unproved":
        return EXIT_UNPROVED
    return EXIT_INPUT if job["error"] and job["error"]["status"] == 422 else EXIT_BUG


def multipart(parts: list[tuple[str, str, str, bytes]]) -> tuple[bytes, str]:
    """Body and content type of a multipart form; parts are (name, file name, media type, bytes)."""
    mark = uuid.uuid4().hex
    body = b"".join(
        f'--{mark}\r\nContent-Disposition: form-data; name="{name}"; filename="{file}"\r\n'
        f"Content-Type: {media}\r\n\r\n".encode() + data + b"\r\n" for name, file, media, data in parts)
    return body + f"--{mark}--\r\n".encode(), f"multipart/form-data; boundary={mark}"


def _post(url: str, step: Path, setup: Path) -> dict[str, Any]:
    body, kind = multipart([("part", step.name, "model/step", step.read_bytes()),
                            ("setup", setup.name, "application/json", setup.read_bytes())])
    request = urllib.request.Request(f"{url}/v1/jobs", body, {"Content-Type": kind,
                                                              "Idempotency-Key": uuid.uuid4().hex})
    with _open(request) as answer:
        return dict(json.loads(answer.read()))


def _follow(url: str, job: dict[str, Any]) -> dict[str, Any]:
    progress = Progress()
    progress(job["stage"], job["progress"])
    try:
        with _open(urllib.request.Request(url + job["links"]["events"])) as stream:
            for event in _data_lines(stream):
                progress(event["stage"], event["progress"])
    finally:
        progress.close()
    with _open(urllib.request.Request(url + job["links"]["self"])) as answer:
        return dict(json.loads(answer.read()))


def _data_lines(stream: http.client.HTTPResponse) -> Iterator[dict[str, Any]]:
    for line in stream:
        if line.startswith(b"data:"):
            yield json.loads(line[5:])


def _fetch(url: str, job: dict[str, Any], out: Path) -> list[str]:
    """Fetch every file of the job and return their names; none where the job has no result."""
    if job["state"] not in ("proved", "unproved"):
        return []
    out.mkdir(parents=True, exist_ok=True)
    with _open(urllib.request.Request(url + job["links"]["files"])) as answer:
        items = json.loads(answer.read())["items"]
    for item in items:
        with _open(urllib.request.Request(url + item["href"])) as answer:
            (out / Path(item["name"]).name).write_bytes(answer.read())
    return [item["name"] for item in items]


def _open(request: urllib.request.Request) -> http.client.HTTPResponse:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # no proxy for loopback
    try:
        return opener.open(request, timeout=3600)  # type: ignore[no-any-return]
    except urllib.error.HTTPError as error:
        text = error.read().decode("utf-8", "replace")
        raise InternalError(f"the service answered {error.code} to {request.get_method()} {request.full_url}: {text}",
                            code="demo_failed") from None
