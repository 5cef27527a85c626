"""The cluster: PostgreSQL, a Dask scheduler and a worker of its own, as docker-compose.yml starts them."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from service.server import background, settings_with

ROOT = Path(__file__).resolve().parents[2]
FAKES = Path(__file__).parent / "fakes"

pytestmark = pytest.mark.slow


def _free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _programs():
    """Folder of PostgreSQL's server programs, None when it is not installed."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    return folders[-1] if folders else None


def _until_open(port, process):
    deadline = time.monotonic() + 40
    while time.monotonic() < deadline and process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return
        except OSError:
            time.sleep(0.1)
    pytest.fail(f"nothing listens on port {port}")


@pytest.fixture
def postgres(tmp_path):
    pytest.importorskip("psycopg", reason="psycopg is not installed")
    programs = _programs()
    if programs is None:
        pytest.skip("PostgreSQL is not installed")
    # PostgreSQL refuses to run as root, and nobody cannot enter pytest's folders.
    folder = Path(subprocess.check_output(["mktemp", "-d"], text=True).strip())
    user = "nobody" if os.geteuid() == 0 else None
    if user:
        shutil.chown(folder, user)
    port = _free_port()
    made = subprocess.run([programs / "initdb", "-D", folder / "db", "-A", "trust", "-U", "zonemill"], user=user,
                          capture_output=True, text=True, cwd=folder)
    assert made.returncode == 0, made.stderr
    server = subprocess.Popen([programs / "postgres", "-D", folder / "db", "-p", str(port), "-k", folder, "-h",
                               "127.0.0.1"], user=user, cwd=folder, stderr=subprocess.DEVNULL)
    _until_open(port, server)
    time.sleep(1.0)
    yield f"postgresql+psycopg://zonemill@127.0.0.1:{port}/postgres"
    server.send_signal(signal.SIGINT)  # fast shutdown: connections of the pool are dropped
    server.wait(timeout=20)
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def scheduler(postgres, fake_path):
    """Address of a scheduler with one worker of one thread."""
    port = _free_port()
    dask = [sys.executable, "-m", "dask"]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{FAKES}"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT, "env": environment}
    first = subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
                             **quiet)
    _until_open(port, first)
    second = subprocess.Popen([*dask, "worker", f"tcp://127.0.0.1:{port}", "--no-nanny", "--nthreads", "1",
                               "--memory-limit", "0", "--no-dashboard"], **quiet)
    yield f"tcp://127.0.0.1:{port}"
    for process in (second, first):
        process.kill()
        process.wait()


def test_a_job_runs_on_the_cluster_and_is_cancelled_there(postgres, scheduler, tmp_path, post, finish):
    settings = settings_with({"data_dir": tmp_path / "data", "port": 0, "database_url": postgres,
                              "scheduler": scheduler})
    with background(settings, "fake_chain") as url, httpx.Client(base_url=url, trust_env=False) as client:
        deadline = time.monotonic() + 40
        while client.get("/readyz").status_code != 200 and time.monotonic() < deadline:
            time.sleep(0.2)
        job = finish(client, post(client, "", key="k").json())
        assert (job["state"], job["attempt"]) == ("proved", 1)
        assert post(client, "", key="k").json()["id"] == job["id"]
        assert finish(client, post(client, "segfault").json())["error"]["code"] == "job_crashed"
        asleep = finish(client, post(client, "sleep").json(), until=("queued",))
        time.sleep(2.0)
        waiting = post(client, "other").json()
        started = time.monotonic()
        assert client.delete(asleep["links"]["self"]).json()["state"] == "cancelled"
        finish(client, waiting, until=("queued",))
        assert time.monotonic() - started < 1.0
        assert finish(client, waiting)["state"] == "proved"
