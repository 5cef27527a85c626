"""What survives a crash and an orderly stop."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import psutil
import pytest

from service.jobs.job_child import JOB_MODULE
from tests.contract.servers import free_port
from tests.time_limits import in_time

ROOT = Path(__file__).resolve().parents[2]
FAKES = Path(__file__).parent / "fakes"


@pytest.fixture
def serve(tmp_path):
    """Start the service in a process; returns the process and a client."""
    started = []

    def start(attempts=3, *more, **variables):
        environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{FAKES}", **variables}
        process = subprocess.Popen([sys.executable, str(FAKES / "serve_fake.py"), str(tmp_path / "data"),
                                    str(attempts), *map(str, more)], stdout=subprocess.PIPE, text=True,
                                   env=environment, cwd=ROOT)
        started.append(process)
        return process, httpx.Client(base_url=process.stdout.readline().strip(), trust_env=False)

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


def _asleep(client, job):
    deadline = time.monotonic() + 120
    while client.get(job["links"]["self"]).json()["stage"] != "asleep" and time.monotonic() < deadline:
        time.sleep(0.05)


def _job_children(process):
    return [p for p in psutil.Process(process.pid).children(recursive=True) if JOB_MODULE in " ".join(p.cmdline())]


def test_a_killed_service_leaves_no_child_and_resumes_its_job(serve, post, finish):
    process, client = serve()
    job = post(client, "nap", key="k").json()
    _asleep(client, job)
    (child,) = _job_children(process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    gone, alive = psutil.wait_procs([child], timeout=2)
    assert not alive
    _, client = serve()
    assert post(client, "nap", key="k").json()["id"] == job["id"]
    job = finish(client, client.get(job["links"]["self"]).json())
    assert (job["state"], job["attempt"]) == ("proved", 2)
    assert client.get(job["links"]["report"]).json()["state"] == "proved"


@pytest.mark.slow
def test_a_job_that_takes_the_service_down_cannot_loop(serve, post, finish):
    process, client = serve(attempts=1)
    job = post(client, "sleep").json()
    _asleep(client, job)
    process.kill()
    process.wait()
    _, client = serve(attempts=1)
    job = finish(client, client.get(job["links"]["self"]).json())
    assert job["state"] == "failed" and job["error"]["code"] == "attempts_exhausted"


def test_an_orderly_stop_counts_no_attempt(make_client, post, finish):
    client = make_client()
    job = post(client, "nap").json()
    _asleep(client, job)
    client.__exit__(None, None, None)
    again = make_client()
    job = finish(again, again.get(job["links"]["self"]).json())
    assert (job["state"], job["attempt"]) == ("proved", 1)
    client.__enter__ = client.__exit__ = lambda *_: None


def test_two_services_cannot_share_a_data_folder(make_client, tmp_path):
    make_client()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "service.cli", "serve", "--port", "0", "--data", str(tmp_path / "data"), "--json"]
    got = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert got.returncode == 2 and json.loads(got.stdout)["code"] == "data_dir_in_use"


def _until_ready(client):
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        try:
            if client.get("/readyz").status_code == 200:
                return
        except httpx.TransportError:
            time.sleep(0.05)


def test_a_stop_in_the_night_ends_streams_and_loses_nothing(serve, post, finish):
    """SIGTERM to the service as ``zonemill serve`` runs it, with a job running, one waiting and a stream open."""
    process, client = serve(3, free_port())
    _until_ready(client)
    job, waiting = post(client, "nap", key="k").json(), post(client, "").json()
    _asleep(client, job)
    (child,) = _job_children(process)
    seen = []

    def follow():
        with client.stream("GET", job["links"]["events"]) as stream:
            seen.extend(stream.iter_text())

    thread = threading.Thread(target=follow)
    thread.start()
    time.sleep(0.5)
    started = time.monotonic()
    process.send_signal(signal.SIGTERM)
    process.wait(timeout=15)
    thread.join(timeout=5)
    assert in_time(time.monotonic() - started, 8) and not thread.is_alive() and not child.is_running()
    assert "event: progress" in "".join(seen) and "event: end" not in "".join(seen)
    _, client = serve(3)
    for each in (job, waiting):
        ended = finish(client, client.get(each["links"]["self"]).json())
        assert (ended["state"], ended["attempt"]) == ("proved", 1)


def test_a_child_is_told_no_setting_and_no_secret(serve, post, finish):
    secrets = {"ZONEMILL_WEBHOOK_SECRET": "s" * 40, "PGPASSWORD": "s", "AWS_SECRET_ACCESS_KEY": "s", "API_TOKEN": "s",
               "LANG": "C.UTF-8"}
    _, client = serve(3, **secrets)
    told = finish(client, post(client, "look about").json())["error"]["detail"].split()
    assert "PATH" in told and "LANG" in told and "PYTHONPATH" in told
    assert not set(told) & (set(secrets) - {"LANG"}) and not [k for k in told if k.startswith("ZONEMILL_")]
