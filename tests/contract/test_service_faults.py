"""Things that happen at night, to a service with eight jobs in it: none is lost, none done twice, none stuck.

Each fault is a test of its own. Once in CI with one job of the real chain among paced ones; ``make soak`` repeats each
``FAULT_REPEAT`` times (20) with ``FAULT_REAL`` (8) of the eight real ones, and prints how long it took to recover:
``FAULT_REPEAT=5 make soak K=scheduler``.
"""

import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import time
from collections import Counter

import psutil
import pytest

from tests.contract.faults import FINAL, Alone, Client, Site, full_disk, small_disk, waiting
from tests.contract.servers import postgres_server
from tests.step_files import write_step

JOBS, PACED = 8, "short nap"
SETUP = {"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}],
         "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}


def kill_worker(site, nth, rng):
    """SIGKILL to a worker with a job in it."""
    site.workers[nth % 2].kill()


def kill_child(site, nth, rng):
    """SIGKILL to the process that computes a job: what a forkserver's children would be."""
    for child in site.children():
        try:
            return child.kill()
        except psutil.NoSuchProcess:
            continue  # it has just ended


def kill_scheduler(site, nth, rng):
    """SIGKILL to the scheduler; the workers end with it and are started again too."""
    site.scheduler.kill()


def kill_api(site, nth, rng):
    """SIGKILL to one API process, then to the other in the next round."""
    site.apis[nth % len(site.apis)].kill()


def restart_database(site, nth, rng):
    """PostgreSQL stopped in order, then at once, with recovery at the next start."""
    site.database.stop((signal.SIGINT, signal.SIGQUIT)[nth % 2])
    waiting(rng, 0.5, 4.0)
    site.database.start()


def fill_disk(site, nth, rng):
    """Not a byte left on the disk of the data folder."""
    empty = full_disk(site.data)
    waiting(rng, 1.0, 4.0)
    empty()


def set_clock(site, nth, rng):
    """The clock an hour ahead, then an hour back."""
    site.set_clock(3600 if nth % 2 == 0 else 0)


def cut_line(site, nth, rng):
    """The network between API and scheduler refuses, then swallows, for a moment or for longer than clients wait."""
    site.line.cut(silent=nth % 2 == 1)
    time.sleep(40.0 if nth % 8 in (2, 3) else rng.uniform(1.0, 8.0))
    site.line.mend()


CLUSTER = {"worker": kill_worker, "child": kill_child, "scheduler": kill_scheduler, "api": kill_api,
           "database": restart_database, "disk": fill_disk, "clock": set_clock, "network": cut_line}
EMBEDDED = {"service": kill_api, "embedded child": kill_child, "embedded disk": fill_disk}


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(
        cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "p.step").read_bytes()


@pytest.fixture(scope="module")
def alone(part, tmp_path_factory):
    """What the chain finds where nothing happens."""
    from service import pipeline
    from service.from_wire import parse_setup

    path = tmp_path_factory.mktemp("alone") / "p.step"
    path.write_bytes(part)
    return pipeline.zones_only(path, parse_setup(json.dumps(SETUP)), lambda *_: None)


@pytest.fixture
def disk(tmp_path):
    """A file system of 64 MB."""
    folder = tmp_path / "disk"
    if not small_disk(folder, 64):
        pytest.skip("mounting a small file system is not permitted")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


@pytest.fixture
def place(request, tmp_path):
    """Start the service that a fault wants: (fault) -> service."""
    opened = []

    def start(fault):
        data, more = tmp_path / "data", {}
        if "disk" in fault:
            data, more = request.getfixturevalue("disk") / "data", {"ZONEMILL_MIN_FREE_MB": "8"}
        if fault in EMBEDDED:
            opened.append(Alone(tmp_path, data, **more))
            return opened[-1]
        if fault == "clock" and shutil.which("cc") is None:
            pytest.skip("the clock that can be set wants a C compiler")
        opened.append(server := postgres_server())
        opened.append(Site(tmp_path, data, server.__enter__(), clocked=fault == "clock", **more))
        return opened[-1]

    yield start
    for each in reversed(opened):
        each.close() if hasattr(each, "close") else each.__exit__(None, None, None)


class Round:
    """Eight jobs, two of them running when it happens."""

    def __init__(self, service, part, alone, nth, real):
        self.service, self.alone, self.nth, self.real = service, alone, nth, real
        self.rng = random.Random(nth)
        self.client = Client(service, part, SETUP, f"r{nth:03d}x{self.rng.getrandbits(30):x}")

    def names(self):
        """(name, what it does) of each job; the real ones first, for they are to run when it happens."""
        return [(f"j{k}", "" if k < self.real else PACED) for k in range(JOBS)]

    def play(self, fault):
        """Post, let it happen, wait for all to end; returns how long the service took to be whole again, s."""
        for name, do in self.names():
            self.client.post(name, do)
        self.client.until_running(2)
        waiting(self.rng, 0.0, 1.5)
        hit = [i for i, job in self.client.look().items() if job["state"] == "running"]
        began = time.monotonic()
        fault(self.service, self.nth, self.rng)
        over = time.monotonic()
        whole, ended = self.client.until_ended(patience_s=400.0)
        return {"outage": over - began, "ready": whole - over, "hit": max([ended[i] - over for i in hit], default=0.0),
                "all": max(ended.values()) - over}

    def check(self):
        """All done, each once, and what they found is what is found where nothing happens."""
        client = self.client
        for name, do in self.names():
            job_id = client.post(name, do)  # a repeat is the same job, whatever happened
            job, = [client.ask("GET", f"/v1/jobs/{job_id}").json()]
            assert job["state"] == "done" and job["attempt"] <= self.service.attempts, job
            states = [seen["state"] for _, seen in client.seen[job_id]]
            assert sum(s in FINAL for s in states) == 1 and states[-1] == "done", states
            if not do:
                assert json.loads(client.result(job_id)) == json.loads(json.dumps(self.alone))
        found = client.ask("GET", f"/v1/jobs?limit=50&label=batch:{client.batch}").json()["items"]
        assert {j["id"] for j in found} == set(client.jobs.values()) and len(found) == JOBS
        return max(j["attempt"] for j in found)

    def check_mail(self):
        """Each job told its end once: what comes again, after a crash between answer and row, is the same message."""
        wanted, until = set(self.client.jobs.values()), time.monotonic() + 120
        while wanted - {job for _, job, _ in self.service.mailbox.got} and time.monotonic() < until:
            time.sleep(0.1)
        mine = [m for m in self.service.mailbox.got if m[1] in wanted]
        assert {job for _, job, _ in mine} == wanted and len(set(mine)) == JOBS, Counter(mine)
        return len(mine) - JOBS


def _play(service, part, alone, fault, repeat, real, seconds):
    act = {**CLUSTER, **EMBEDDED}[fault]
    service.until_ready()
    took, attempts, again, until = [], Counter(), 0, time.monotonic() + seconds
    for nth in range(repeat):
        if time.monotonic() > until:
            break
        turn = Round(service, part, alone, nth, real)
        took.append(turn.play(act))
        attempts[turn.check()] += 1
        again += turn.check_mail()
        last = {k: round(v, 1) for k, v in took[-1].items()}
        print(f"{fault} {nth + 1}: {last}", flush=True)
    assert len(took) == repeat, f"{len(took)} of {repeat} rounds in {seconds:.0f} s: give it FAULT_SECONDS"
    for what in ("outage", "ready", "hit", "all"):
        values = [t[what] for t in took]
        print(f"{fault}: {what} median {statistics.median(values):.1f} s, longest {max(values):.1f} s")
    print(f"{fault}: {len(took)} rounds of {JOBS} jobs, {real} real; most attempts of a job {dict(attempts)}; "
          f"webhooks sent again {again}", flush=True)


EVERY_DAY = ("worker", "api")  # the others are in the slow set


@pytest.mark.parametrize("fault", [pytest.param(f, marks=() if f in EVERY_DAY else pytest.mark.slow)
                                   for f in (*CLUSTER, *EMBEDDED)])
def test_nothing_is_lost_done_twice_or_stuck(place, part, alone, fault):
    _play(place(fault), part, alone, fault, 1, 1, 60)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("fault", [*CLUSTER, *EMBEDDED])
def test_nothing_is_lost_done_twice_or_stuck_again_and_again(place, part, alone, fault):
    _play(place(fault), part, alone, fault, int(os.environ.get("FAULT_REPEAT", "20")),
          int(os.environ.get("FAULT_REAL", "8")), float(os.environ.get("FAULT_SECONDS", "3600")))
