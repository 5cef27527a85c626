"""Seconds of short jobs that start from a loaded process, and of the same jobs in a new interpreter.

    python benchmarks/serving/start_of_jobs.py [--rounds 5]

Both kinds take turns in one run. ``unread`` is a program that cannot be read, ``small`` the small part of
``zonemill warm``, planned and proved. Each figure is the median of the rounds.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from examples.demo import write_small  # noqa: E402
from geometry.errors import CamError  # noqa: E402
from service.jobs.job_child import close_servers, preload  # noqa: E402
from service.jobs.supervisor import ProcessLimits, supervise  # noqa: E402

LOADING_S = 300.0
QUIET_S = 1.0


def timed(kind: str, step: Path, setup: str, folder: Path, preloaded: bool) -> tuple[float, float]:
    """Seconds to the first stage, and to the end, of one job."""
    for name in ("out", "kept", "scratch"):
        (folder / name).mkdir(parents=True)
    program = folder / "program.ngc"
    program.write_text("G21\nG1 X1 F100 Q(\nM2\n")
    request: dict[str, Any] = {
        "kind": "plan" if kind == "small" else "verify", "part": str(step), "setup": setup, "stock": None,
        "program": None if kind == "small" else str(program), "spindle_tool": 0, "out": str(folder / "out"),
        "kept": str(folder / "kept"), "chain": "service.pipeline"}
    seen: list[float] = []
    begun = time.perf_counter()
    try:
        supervise(request, ProcessLimits(600.0, 8_000_000_000, 1, 0.02, preloaded), folder / "scratch",
                  on_progress=lambda *_: seen.append(time.perf_counter()), on_resumed=lambda _: None,
                  on_estimate=lambda _: None, keep=lambda: True)
    except CamError as refusal:
        if kind == "small":
            raise
        assert refusal.code == "bad_program", refusal
    ended = time.perf_counter()
    return (seen or [ended])[0] - begun, ended - begun


def main() -> None:
    """Print one row for each kind of job."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        step, setup = write_small(folder)
        server = psutil.Process(preload(1).pid)
        if not preload(1).loaded(LOADING_S):
            raise SystemExit("the server did not load")
        used = -1.0
        while server.cpu_times().user != used:  # it loads kernels
            used = server.cpu_times().user
            time.sleep(QUIET_S)
        print(f"server: {server.memory_info().rss / 1e6:.0f} MB, {used:.1f} s of processor to load")
        print("| job | start | first stage s | whole s |\n|---|---|---|---|")
        for kind in ("unread", "small"):
            rows: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
            for turn in range(rounds):
                for preloaded in (False, True):
                    rows[preloaded].append(timed(kind, Path(step), Path(setup).read_text(),
                                                 folder / f"{kind}{turn}{preloaded}", preloaded))
            for preloaded, times in rows.items():
                first, whole = (statistics.median(column) for column in zip(*times, strict=True))
                print(f"| {kind} | {'forked' if preloaded else 'new interpreter'} | {first:.3f} | {whole:.3f} |")
    close_servers()


if __name__ == "__main__":
    main()
