"""The cluster: PostgreSQL, a Dask scheduler, workers and API processes, as docker-compose.yml starts them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from service.api.server import background, settings_with
from tests.contract.servers import free_port, postgres_server, until_open
from tests.time_limits import in_time

ROOT = Path(__file__).resolve().parents[2]
FAKES = Path(__file__).parent / "fakes"

pytestmark = pytest.mark.slow


class Cluster:
    """A scheduler with workers of one thread, and API processes beside it."""

    def __init__(self, database, data):
        self.port, self.data = free_port(), data
        self.environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{FAKES}", "ZONEMILL_LEASE_S": "3",
                            "ZONEMILL_DATABASE_URL": database, "ZONEMILL_SCHEDULER": self.address}
        self.processes = []
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        until_open(self.port, self.scheduler)

    @property
    def address(self):
        return f"tcp://127.0.0.1:{self.port}"

    def _start(self, *words):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": ROOT, "env": self.environment}
        self.processes.append(subprocess.Popen([sys.executable, "-m", "dask", *words], **quiet))
        return self.processes[-1]

    def worker(self):
        return self._start("worker", self.address, "--no-nanny", "--nthreads", "1", "--memory-limit", "0",
                           "--no-dashboard")

    def api(self, chain="fake_chain"):
        """A process that serves; returns it with a client."""
        port = [] if chain == "fake_chain" else [str(free_port()), chain]
        command = [sys.executable, str(FAKES / "serve_fake.py"), str(self.data), "3", *port]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=self.environment, cwd=ROOT)
        self.processes.append(process)
        return process, httpx.Client(base_url=process.stdout.readline().strip(), trust_env=False, timeout=20)

    def close(self):
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(postgres, fake_path, tmp_path):
    found = Cluster(postgres, tmp_path / "data")
    yield found
    found.close()


def _until_ready(client):
    deadline = time.monotonic() + 120
    while client.get("/readyz").status_code != 200 and time.monotonic() < deadline:
        time.sleep(0.2)


def test_a_job_runs_on_the_cluster_and_is_cancelled_there(cluster, postgres, tmp_path, post, finish):
    cluster.worker()
    settings = settings_with({"data_dir": tmp_path / "data", "port": 0, "database_url": postgres,
                              "scheduler": cluster.address})
    with background(settings, "fake_chain") as url, httpx.Client(base_url=url, trust_env=False) as client:
        _until_ready(client)
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
        assert in_time(time.monotonic() - started, 1.0)
        assert finish(client, waiting)["state"] == "proved"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGQUIT])
def test_a_database_that_goes_and_comes_back_loses_no_job(fake_path, tmp_path, post, finish, how):
    """In order (SIGINT) and at once, without writing what it has in hand (SIGQUIT), while a job runs and one waits."""
    with postgres_server() as database:
        url = f"postgresql+psycopg://zonemill@127.0.0.1:{database.port}/postgres"
        settings = settings_with({"data_dir": tmp_path / "data", "port": 0, "database_url": url, "workers": 1,
                                  "lease_s": 4, "poll_s": 0.05})
        with background(settings, "fake_chain") as base, httpx.Client(base_url=base, trust_env=False) as client:
            running, waiting = post(client, "nap").json(), post(client, "").json()
            finish(client, running, until=("queued",))
            database.stop(how)
            answer = client.get(running["links"]["self"])
            assert answer.status_code == 503 and answer.json()["code"] == "database_unavailable"
            assert client.get("/readyz").json()["checks"]["database"] == "does not answer"
            assert client.get("/healthz").status_code == 200
            time.sleep(3.0)  # the job ends meanwhile
            database.start()
            _until_ready(client)
            for job in (running, waiting):
                ended = finish(client, client.get(job["links"]["self"]).json(), patience=120)
                assert (ended["state"], ended["attempt"]) == ("proved", 1)
            assert client.get("/readyz").status_code == 200


def test_two_apis_and_two_workers_lose_nothing_when_one_of_each_is_killed(cluster, post, finish):
    workers = [cluster.worker(), cluster.worker()]
    (first, here), (second, there) = cluster.api(), cluster.api()
    for client in (here, there):
        _until_ready(client)
    while here.get("/v1/capabilities").json()["slots"] < 2:
        time.sleep(0.1)
    jobs = [post((here, there)[k % 2], "nap", key=f"k{k}").json() for k in range(8)]
    assert post(there, "nap", key="k0").json()["id"] == jobs[0]["id"]  # what one took the other knows
    for job in jobs[:2]:
        finish(there, job, until=("queued",))
    workers[0].send_signal(signal.SIGKILL)
    time.sleep(1.0)
    first.send_signal(signal.SIGKILL)
    started = time.monotonic()
    ended = [finish(there, job, patience=120) for job in jobs]
    assert [j["state"] for j in ended] == ["proved"] * 8, ended
    assert max(j["attempt"] for j in ended) <= 3 and in_time(time.monotonic() - started, 60)
    assert second.poll() is None and there.get("/readyz").json()["checks"]["database"] == "ok"


def test_a_worker_that_is_told_to_stop_costs_its_job_no_attempt(cluster, post, finish):
    first = cluster.worker()
    (_, here), (_, there) = cluster.api(), cluster.api()
    for client in (here, there):  # the second takes the place of what the first told the worker
        _until_ready(client)
    job = post(here, "sleep", key="k").json()
    while here.get(job["links"]["self"]).json()["stage"] != "asleep":  # claimed is not begun
        time.sleep(0.1)
    other = cluster.worker()
    first.send_signal(signal.SIGTERM)
    assert first.wait(timeout=6) is not None  # not after the 20 s that the job takes
    ended = finish(there, job, patience=120)
    assert (ended["state"], ended["attempt"]) == ("proved", 1), ended
    assert other.poll() is None
