"""What the service costs: start, idle memory, processor time of a job beside ``zonemill plan``, writes to the database.

``python benchmarks/serving/bench_service.py [--jobs 40]``; prints JSON, which ``scale.py`` takes. Times of
processors, not of the clock, where that is what counts, so that other load on the machine shows little. PostgreSQL is
started by itself; where it is not installed the figures of the cluster are left out.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psutil

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
from tests.contract.faults import FINAL, Alone, Client, Service, Site  # noqa: E402
from tests.contract.servers import free_port, postgres_server  # noqa: E402

SETUP: dict[str, Any] = {
    "tools": [{"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}],
    "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}


def step_part(folder: Path) -> Path:
    """A block of 16 x 12 x 4 mm with one step."""
    import cadquery as cq

    from tests.step_files import write_step

    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(
        cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    return write_step(shape, folder / "part.step")


def start_figures(folder: Path) -> dict[str, float]:
    """Embedded: from the start of the process to the first answer and to readiness, s; idle memory, MB."""
    port = free_port()
    began = time.monotonic()
    command = [sys.executable, "-m", "service.cli", "serve", "--port", str(port), "--data", str(folder / "idle")]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
    answered = ready = 0.0
    try:
        while not ready:
            try:
                code = httpx.get(f"http://127.0.0.1:{port}/readyz", trust_env=False).status_code
                answered = answered or time.monotonic() - began
                ready = time.monotonic() - began if code == 200 else 0.0
            except httpx.TransportError:
                pass
            time.sleep(0.01)
        watched = psutil.Process(process.pid)
        used = sum(watched.cpu_times()[:2])
        time.sleep(10.0)
        idle = sum(watched.cpu_times()[:2]) - used
        return {"first_answer_s": answered, "ready_s": ready, "start_cpu_s": used, "idle_cpu_share": idle / 10.0,
                "idle_mb": watched.memory_info().rss / 1e6}
    finally:
        process.terminate()
        process.wait()


def cpu_of(service: Service) -> dict[str, float]:
    """Processor time of each process and of the children it has waited for, s."""
    found: dict[str, float] = {}
    for k, kept in enumerate(service.checkpoint_store):
        times = psutil.Process(kept.process.pid).cpu_times()
        name = Path(kept.process.args[1]).stem if isinstance(kept.process.args, list) else str(k)
        label = kept.process.args[2] if name == "-m" and isinstance(kept.process.args, list) else "api"
        label = kept.process.args[3] if label == "dask" and isinstance(kept.process.args, list) else label
        found[label] = found.get(label, 0.0) + times.user + times.system
        found["children"] = found.get("children", 0.0) + times.children_user + times.children_system
    return found


def batch(service: Service, part: bytes, count: int, do: str, name: str,
          path: str = "/v1/zones") -> list[dict[str, Any]]:
    """Post so many jobs and wait for their ends; returns them."""
    client = Client(service, part, SETUP, name)
    posted = []
    for k in range(count):
        setup = {**SETUP, "labels": {"batch": name, "name": str(k), **({"do": do} if do else {})}}
        answer = client.ask("POST", path, files={"part": ("p.step", part), "setup": ("s", json.dumps(setup))})
        posted.append(answer.json())
    done = []
    for job in posted:
        while job["state"] not in FINAL:
            time.sleep(0.5)
            job = client.ask("GET", job["links"]["self"]).json()
        done.append(job)
    return done


def spent(service: Service, work: Callable[[], Any]) -> dict[str, float]:
    """Processor time of each process while ``work`` runs, s."""
    before = cpu_of(service)
    work()
    return {k: v - before[k] for k, v in cpu_of(service).items()}


def job_figures(folder: Path, part: Path) -> dict[str, float]:
    """Processor time of the small job by ``zonemill plan`` and by the embedded service, s."""
    setup = folder / "setup.json"
    setup.write_text(json.dumps(SETUP))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "service.cli", "plan", part, "--setup", setup, "--out", folder / "out"],
                   check=True, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall = time.monotonic() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    plan = after.ru_utime + after.ru_stime - used.ru_utime - used.ru_stime
    (folder / "embedded").mkdir()
    service = Alone(folder / "embedded", folder / "embedded" / "data")
    try:
        service.until_ready()
        began = time.monotonic()
        found = spent(service, lambda: batch(service, part.read_bytes(), 1, "", "one", "/v1/jobs"))
        return {"plan_cpu_s": plan, "plan_wall_s": wall, "service_child_cpu_s": found["children"],
                "service_own_cpu_s": found["api"], "service_wall_s": time.monotonic() - began}
    finally:
        service.close()


def cluster_figures(folder: Path, part: Path, count: int) -> dict[str, Any]:
    """Processor time and writes of a job on the cluster, by process, beyond what they take when idle."""
    import psycopg

    (folder / "cluster").mkdir()
    with postgres_server() as server:
        site = Site(folder / "cluster", folder / "cluster" / "data", server, ZONEMILL_LEASE_S="20")

        def written() -> dict[str, int]:
            where = f"host=127.0.0.1 port={server.port} user=zonemill dbname=postgres"
            with psycopg.connect(where, autocommit=True) as c:
                time.sleep(1.5)  # statistics are told once a second
                rows = c.execute("SELECT relname, n_tup_ins + n_tup_upd + n_tup_del FROM pg_stat_user_tables")
                rows = rows.fetchall()
                (commits,) = c.execute("SELECT xact_commit FROM pg_stat_database "
                                       "WHERE datname = 'postgres'").fetchone()
                return {**dict(rows), "commits": commits}

        def postgres_cpu() -> float:
            main = psutil.Process(server.server.pid)
            total = sum(main.cpu_times()[:4])  # that of children that have ended is in it
            for process in main.children():
                try:
                    total += sum(process.cpu_times()[:2])
                except psutil.NoSuchProcess:
                    pass
            return total

        try:
            site.until_ready()
            batch(site, part.read_bytes(), 2, "short nap", "warm")
            commits, database, began = written()["commits"], postgres_cpu(), time.monotonic()
            resting = spent(site, lambda: time.sleep(15.0))
            wall = time.monotonic() - began
            idle = {k: v / 15.0 for k, v in resting.items()}
            idle |= {"postgres": (postgres_cpu() - database) / wall, "commits": (written()["commits"] - commits) / wall}
            found: dict[str, Any] = {"idle_per_s": {k: round(v, 4) for k, v in idle.items()}}
            kinds = (("empty", "nothing", "/v1/zones", count), ("nap of 2 s", "nap", "/v1/zones", 4),
                     ("small plan", "", "/v1/jobs", 1))
            for name, do, path, many in kinds:
                rows, database, began = written(), postgres_cpu(), time.monotonic()
                jobs: list[dict[str, Any]] = []
                cpu = spent(site, lambda: jobs.extend(batch(site, part.read_bytes(), many, do, name, path)))  # noqa: B023
                wall = time.monotonic() - began
                new = written()
                cpu["postgres"] = postgres_cpu() - database
                found[name] = {
                    **{f"{k}_cpu_ms": round(1000 * (v - idle[k] * wall) / many, 1) for k, v in cpu.items()},
                    "rows_written": round(sum(new[k] - rows.get(k, 0) for k in new if k != "commits") / many, 1),
                    "commits_beyond_idle": round((new["commits"] - rows["commits"] - idle["commits"] * wall) / many, 1),
                    "wall_s": round(wall / many, 2), "states": sorted({j["state"] for j in jobs})}
            return found
        finally:
            site.close()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=40)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        part = step_part(folder)
        found: dict[str, Any] = {"start": start_figures(folder), "job": job_figures(folder, part)}
        print(json.dumps(found), file=sys.stderr, flush=True)
        try:
            found["cluster"] = cluster_figures(folder, part, given.jobs)
        except BaseException as reason:  # pytest's skip is one
            if type(reason).__name__ != "Skipped":
                raise
            print(f"no cluster: {reason}", file=sys.stderr)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
