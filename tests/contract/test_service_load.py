"""Five hundred jobs wait, fifty clients ask and ten listen, for half an hour: what it costs, and that nothing leaks.

``LOAD_MINUTES=3 LOAD_JOBS=100 make soak K=load`` for a quick look.
"""

import json
import os
import queue
import statistics
import subprocess
import sys
import threading
import time

import httpx
import psutil
import pytest

from tests.contract.faults import FINAL, Client, Site
from tests.contract.servers import postgres_server
from tests.step_files import write_step

SETUP = {"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}],
         "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}
ALONE = """
import sys
from pathlib import Path
from service import pipeline
from schemas.setup import canonical_json
from service.from_wire import parse_setup
part, setup, out = map(Path, sys.argv[1:])
kept = canonical_json(parse_setup(setup.read_text())).decode()  # what a job keeps has all defaults filled in
pipeline.plan(part, parse_setup(kept), out, lambda *_: None)
"""
# Of what a process grows by, this much is its caches filling; a leak of 100 bytes an answer would be twice that.
ALLOWED_MB, ALLOWED = 15.0, 0.10


class Load:
    """Clients that ask and listen while jobs come and go."""

    def __init__(self, site, client, waiting):
        self.site, self.client, self.wanted = site, client, waiting
        self.stop, self.took, self.wrong = threading.Event(), queue.SimpleQueue(), queue.SimpleQueue()
        self.open: dict[str, str] = {}  # id -> state, of jobs that were posted
        self.ended_events = queue.SimpleQueue()
        self.memory: dict[str, list[tuple[float, float]]] = {}
        self.used: dict[str, float] = {}
        self.count = 0

    def poll(self, nth):
        """One client: a job, the list, a job ... twice a second."""
        with httpx.Client(base_url=self.site.urls[nth % 2], trust_env=False, timeout=30) as http:
            while not self.stop.is_set():
                known = list(self.open)
                path = f"/v1/jobs/{known[(nth * 37 + self.took.qsize()) % len(known)]}" if known and nth % 5 else (
                    "/v1/jobs?limit=20")
                began = time.monotonic()
                try:
                    answer = http.get(path)
                    self.took.put(time.monotonic() - began)
                    if answer.status_code != 200:
                        self.wrong.put((path, answer.status_code, answer.text[:200]))
                except httpx.HTTPError as error:
                    self.wrong.put((path, type(error).__name__, str(error)))
                self.stop.wait(0.5)

    def listen(self, nth):
        """One client that follows one job after the other to its end."""
        with httpx.Client(base_url=self.site.urls[nth % 2], trust_env=False, timeout=60) as http:
            while not self.stop.is_set():
                alive = [i for i, state in list(self.open.items()) if state not in FINAL]
                if not alive:
                    self.stop.wait(0.5)
                    continue
                try:
                    with http.stream("GET", f"/v1/jobs/{alive[nth % len(alive)]}/events") as stream:
                        for line in stream.iter_lines():
                            if line == "event: end":
                                self.ended_events.put(1)
                            if self.stop.is_set():
                                break
                except httpx.HTTPError as error:
                    self.wrong.put(("events", type(error).__name__, str(error)))

    def top_up(self, wanted):
        """Post until so many wait."""
        alive = sum(state not in FINAL for state in self.open.values())
        for _ in range(wanted - alive):
            self.open[self.client.post(f"j{self.count}", "short nap")] = "queued"
            self.count += 1

    def look(self):
        """States of all jobs, by the list's pages, and the memory of every process, MB."""
        cursor = ""
        while cursor is not None:
            page = self.client.ask("GET", f"/v1/jobs?limit=200&kind=zones{cursor and f'&cursor={cursor}'}").json()
            for job in page["items"]:
                self.open[job["id"]] = job["state"]
            cursor = page["next_cursor"]
        for name, kept in zip(("scheduler", "worker 1", "worker 2", "api 1", "api 2"), self.site.kept, strict=True):
            process = psutil.Process(kept.process.pid)
            self.memory.setdefault(name, []).append((time.monotonic(), process.memory_info().rss / 1e6))
            self.used[name] = sum(process.cpu_times()[:2])

    def run(self, seconds):
        """Load for so long, then until the queue is empty."""
        threads = [threading.Thread(target=self.poll, args=(k,), daemon=True) for k in range(50)]
        threads += [threading.Thread(target=self.listen, args=(k,), daemon=True) for k in range(10)]
        self.top_up(self.wanted)
        for thread in threads:
            thread.start()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(5.0)
            self.look()
            self.top_up(self.wanted // 5)
        while any(state not in FINAL for state in self.open.values()):
            time.sleep(5.0)
            self.look()
        self.stop.set()
        for thread in threads:
            thread.join(timeout=60)


def _plan(client, site, labels):
    """Post the real chain in full; returns the bytes of each of its files."""
    setup = {**SETUP, "labels": labels}
    answer = client.ask("POST", "/v1/jobs", files={"part": ("p.step", client.part), "setup": ("s", json.dumps(setup))})
    job = answer.json()
    while job["state"] not in FINAL:
        time.sleep(1.0)
        job = client.ask("GET", job["links"]["self"]).json()
    assert job["state"] == "proved", job
    files = client.ask("GET", job["links"]["files"]).json()["items"]
    return {f["name"]: client.ask("GET", f["href"]).content for f in files}


def _alone(part, folder, labels):
    """What the chain writes in a process of its own where nothing else runs; bytes by name."""
    (folder / "setup.json").write_text(json.dumps({**SETUP, "labels": labels}))
    (folder / "part.step").write_bytes(part)
    command = [sys.executable, "-c", ALONE, folder / "part.step", folder / "setup.json", folder / "out"]
    subprocess.run(command, check=True, env={**os.environ, "NUMBA_NUM_THREADS": "1"})
    return {p.name: p.read_bytes() for p in (folder / "out").iterdir()}


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_five_hundred_jobs_fifty_clients_and_ten_streams(tmp_path):
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(
        cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    part = write_step(shape, tmp_path / "p.step").read_bytes()
    minutes, jobs = float(os.environ.get("LOAD_MINUTES", "30")), int(os.environ.get("LOAD_JOBS", "500"))
    labels = [{"order": "first"}, {"order": "second"}]
    alone = []
    for k, each in enumerate(labels):
        folder = tmp_path / f"alone{k}"
        folder.mkdir()
        alone.append(_alone(part, folder, each))
    with postgres_server() as server:
        site = Site(tmp_path, tmp_path / "data", server, ZONEMILL_MAX_QUEUED_EACH="2000", ZONEMILL_MAX_QUEUED="2000",
                    ZONEMILL_LEASE_S="20")
        try:
            site.until_ready()
            client = Client(site, part, SETUP, "load")
            load = Load(site, client, jobs)
            found: list[dict[str, bytes]] = []
            real = threading.Thread(target=lambda: found.extend(
                _plan(Client(site, part, SETUP, "real"), site, each) for each in labels), daemon=True)
            real.start()
            began = time.monotonic()
            load.run(60 * minutes)
            lasted = time.monotonic() - began
            real.join(timeout=600)
            _tell(load, lasted)
            assert load.wrong.empty(), load.wrong.get()
            assert set(load.open.values()) == {"done"} and len(load.open) == load.count >= jobs
            for mine, theirs in zip(alone, found, strict=True):
                assert set(theirs) <= set(mine) and len(theirs) > 5
                assert [n for n in theirs if theirs[n] != mine[n]] == []
            for name, growth, median in _growth(load):
                assert growth < ALLOWED_MB + ALLOWED * median, (name, growth, median)
        finally:
            site.close()


def _growth(load):
    """(process, MB it grew by from the second quarter of the time to the last, median MB)."""
    for name, seen in load.memory.items():
        values = [mb for _, mb in seen]
        quarter = max(1, len(values) // 4)
        early = statistics.median(values[quarter:2 * quarter] or values)
        late = statistics.median(values[-quarter:])
        yield name, late - early, statistics.median(values)


def _tell(load, lasted):
    took = sorted(load.took.get() for _ in range(load.took.qsize()))
    print(f"\n{load.count} jobs, {lasted / 60:.1f} min, {load.ended_events.qsize()} ends told by streams")
    print(f"GET: {len(took)}, {len(took) / lasted:.0f}/s, median {1000 * took[len(took) // 2]:.0f} ms, "
          f"p99 {1000 * took[int(0.99 * len(took))]:.0f} ms, longest {1000 * took[-1]:.0f} ms")
    used = load.used["api 1"] + load.used["api 2"]
    print(f"API processes: {1000 * used / len(took):.1f} ms of processor for a GET, all they do counted in")
    for name, growth, median in _growth(load):
        print(f"{name}: {median:.0f} MB, from the second quarter to the last {growth:+.1f} MB")
