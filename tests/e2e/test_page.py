"""The page in a browser: from the form to the picture, a finding, the slider, a section, on a desk and on a phone.

``web/tests/drive.mjs`` does what a person does; here is what it needs: a service, a part, a folder with findings.
"""

import http.client
import json
import os
import shutil
import socket
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import uvicorn

from service.api.server import background, settings_with
from service.commands.view_command import folder_app
from service.viewer.static_files import FOLDER
from tests.e2e.test_withheld import FAKES, SETUP, call, part  # noqa: F401

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.timeout(600), pytest.mark.network]


def node() -> str | None:
    """The Node that built the page: that of the system, or of the wheel that make web puts into .venv."""
    return shutil.which("node") or shutil.which("node", path=str(ROOT / ".venv" / "bin"))


def browser() -> str | None:
    """Debian's Chromium, or what CHROMIUM names."""
    return os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")


def driven(script, *argv):
    """What a script of ``web/tests`` says of the page, run by Node; skips, with the reason, what is not there."""
    if not (FOLDER / "index.html").is_file():
        pytest.skip("the page is not built: make web")
    if node() is None or not (ROOT / "web" / "node_modules" / "playwright-core").is_dir():
        pytest.skip("no Node with playwright-core here: make web")
    if browser() is None:
        pytest.skip("no Chromium here: apt-get install chromium, or set CHROMIUM")
    done = subprocess.run([node(), str(ROOT / "web" / "tests" / script), *(str(a) for a in argv)], capture_output=True,
                          text=True, timeout=400, cwd=ROOT / "web", env={**os.environ, "CHROMIUM": browser()})
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.strip().splitlines()[-1])


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Run the driver; returns what it says. Pictures are kept where ZONEMILL_SHOTS says."""
    shots = Path(os.environ.get("ZONEMILL_SHOTS") or tmp_path_factory.mktemp("shots"))
    shots.mkdir(parents=True, exist_ok=True)

    def run(what, url, *more):
        argv = [what, url, *more]
        if what != "key":
            argv.insert(2 if what == "look" else len(argv), shots)
        return driven("drive.mjs", *argv)

    return run


@contextmanager
def shown(folder):
    """The page of a folder of results, as ``zonemill view`` serves it."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(folder_app(folder), log_level="error", access_log=False))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.02)
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/v1/jobs/folder/view"
    finally:
        server.should_exit = True
        thread.join(timeout=10)


@pytest.fixture(scope="module")
def unproved(part, tmp_path_factory):  # noqa: F811
    """A folder with a planted gouge."""
    from service.stages import programs

    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FAKES))
        patch.setattr(programs, "write_program", programs.write_program)
        import gouging_chain

        patch.setattr(programs, "write_program", gouging_chain.gouging)
        folder = tmp_path_factory.mktemp("unproved")
        assert call(part, folder).exit_code == 3
    return folder / "out"


def test_a_first_job_without_json(drive, part, tmp_path):  # noqa: F811
    (tmp_path / "setup.json").write_text(json.dumps(SETUP))
    given = {"host": "127.0.0.1", "port": 0, "data_dir": tmp_path / "data", "poll_s": 0.05}
    with background(settings_with(given)) as url:
        said = drive("upload", f"{url}/", part, tmp_path / "setup.json")
    assert said["progress"] >= 2 and int(said["bytes"]) > 2000


def test_a_key_is_asked_for_and_kept_in_the_tab_alone(drive, tmp_path):
    from service.jobs.api_keys import KeyStore
    from service.jobs.database import connect

    given = settings_with({"host": "127.0.0.1", "port": 0, "data_dir": tmp_path / "data", "auth": "keys"})
    with background(given) as url:
        secret, _ = KeyStore(connect(given.url)).make("shop", ["read", "submit"])
        said = drive("key", f"{url}/", secret)
    assert said["session"] == ["zonemill-key"]


def test_tools_of_a_library_come_into_the_form(drive, tmp_path):
    table = tmp_path / "tools.csv"
    table.write_text("id,kind,diameter,flutes,flute length,shank diameter,stickout,taper angle,corner radius\n"
                     "EM-1,flat,0.25,3,0.75,0.25,1.5,,0\nEM-2,tapered_ball,0.125,2,0.5,0.25,1.5,3.8,\n"
                     "EM-3,lollipop mill,0.25,2,0.5,0.25,1.5,,\n")
    given = {"host": "127.0.0.1", "port": 0, "data_dir": tmp_path / "data", "poll_s": 0.05}
    with background(settings_with(given)) as url:
        said = drive("library", f"{url}/", table)
    assert (said["kinds"], said["diameter"]) == (["flat", "tapered_ball"], 6.35)
    assert len(said["rows"]) == 3 and "lollipop mill" in said["rows"][2] and "left out" in said["rows"][2]


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=["desk", "phone"])
@pytest.mark.slow
def test_a_finding_the_slider_and_a_section(drive, unproved, size):
    with shown(unproved) as url:
        said = drive("look", url, *size)
    assert said["jumped"].startswith("gouge: T1 cuts 0.5") and "T1" in said["clock"]


def test_a_folder_is_shown_to_this_machine_alone_and_without_its_program(unproved):
    with shown(unproved) as url:
        host = url.split("/")[2]

        def get(path, name=host):
            connection = http.client.HTTPConnection(host, timeout=10)
            connection.request("GET", path, headers={"Host": name})
            answer = connection.getresponse()
            return answer.status, answer.read()

        status, body = get("/v1/jobs/folder")
        assert status == 200 and json.loads(body)["state"] == "unproved"
        names = [f["name"] for f in json.loads(get("/v1/jobs/folder/files")[1])["items"]]
        assert "view.bin" in names and not [n for n in names if n.startswith("program") or n.endswith(".stpnc")]
        assert get("/v1/jobs/folder/files/view.bin")[1][:7] == b"ZMVIEW1"
        for path in ("/v1/jobs/folder/files/program.linuxcnc.ngc", "/v1/jobs/folder/files/..%2Freport.json",
                     "/v1/jobs/folder/files/%2Fetc%2Fpasswd", "/assets/..%2F..%2Fapp.py"):
            assert get(path)[0] == 404, path
        assert get("/v1/jobs/folder", name="example.org")[0] == 403


def test_a_folder_without_results_says_what_is_missing(tmp_path):
    from typer.testing import CliRunner

    from service.cli import app

    got = CliRunner().invoke(app, ["view", str(tmp_path), "--no-browser"])
    assert got.exit_code == 2 and "view.bin" in got.stderr and "--out" in got.stderr
