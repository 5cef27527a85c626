"""Seconds and memory of whole jobs by stage, today's code beside an earlier commit in the same run.

    python benchmarks/jobs/jobs_before_after.py [JOB ...] [--before COMMIT] [--out out/bench_jobs] [--limit SECONDS]
        [--public DIR] [--table]

Each job runs in a process of its own, first with the earlier code, then with today's. The earlier code is a worktree of
its commit below the folder of results, with kernels that are compiled before the clock starts. Beside each job runs a
fixed mix of numpy, numba and Python, so that rows from different machines can be compared: its seconds are the
calibration of the row. The stages are those that the pipeline reports; ``start`` is everything before the first.
A row is a line of ``rows.jsonl`` in the folder, ``--table`` only prints the newest of each job and side.

Jobs: ``demo``, ``demo5`` (five axes), ``impeller`` (family, seed 4, from a box), ``plate`` (300 mm), ``large`` (0.5 m,
four small tools), and of the public parts ``kj66``, ``kj66-5``, ``ftc10``, ``diecast``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.jobs.parts_table import PUBLIC, SHARED  # noqa: E402

FIVE_AXES = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}
STAGES = ("start", "read", "zones", "plan", "prove", "report")
SMALL_TOOLS = [{"id": f"T{n}", "number": n, "kind": kind, "diameter_mm": d, "flutes": 2, "flute_length_mm": 3 * d,
                "neck_length_mm": 30.0, "neck_diameter_mm": d - 0.2, "shank_diameter_mm": 6.0, "stickout_mm": 40.0,
                "holder": [{"diameter_mm": 20.0, "length_mm": 40.0}]}
               for n, kind, d in ((1, "flat", 6.0), (2, "ball", 4.0), (3, "flat", 3.0), (4, "ball", 2.0))]
DRIVER = """
import json, resource, sys, time
begun = time.perf_counter()
from pathlib import Path
from service.from_wire import read_setup
from service.pipeline import plan
rows, last = {}, ["start", begun, time.process_time()]
def told(stage, share):
    if stage != last[0]:
        now, used = time.perf_counter(), time.process_time()
        there = rows.setdefault(last[0], [0.0, 0.0])
        there[0] += now - last[1]
        there[1] += used - last[2]
        last[:] = [stage, now, used]
report = plan(Path(sys.argv[1]), read_setup(Path(sys.argv[2])), Path(sys.argv[3]), told)
told("", 1.0)
used = [sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
size = [resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
print(json.dumps({"state": report["state"], "coverage": report["coverage"], "minutes": report["machining_time_s"] / 60,
                  "findings": dict(report["finding_counts"]), "gouge": report["gouge_max_mm"],
                  "plans": 1 + sum("planned again" in n for n in report["proof"]["notes"]), "stages": rows,
                  "wall": time.perf_counter() - begun, "processor": sum(used), "mb": max(size) / 1024}))
"""
CALIBRATION = """
import time
import numpy as np
from numba import njit
@njit
def walk(n):
    total = 0.0
    for k in range(n):
        total += (k % 7) * 0.5 - total * 1e-9
    return total
walk(10)
rng = np.random.default_rng(0)
begun = time.process_time()
a = rng.random((700, 700))
for _ in range(6):
    a = np.sort(a @ a / 350.0, axis=0)
walk(200_000_000)
words = {}
for k in range(1_500_000):
    words[k % 5003] = words.get(k % 5003, 0) + len(str(k))
print(time.process_time() - begun)
"""


def written(name: str, folder: Path, public: Path) -> tuple[Path, Path] | None:
    """Part and setup of a job, written into a folder; None where the file of a public part is not there."""
    from examples.demo import demo_setup, write_demo
    from examples.family.recipes import make_part

    own, setup = folder / "setup.json", demo_setup()
    if name in ("demo", "demo5"):
        part, _ = write_demo(folder)
        if name == "demo5":
            setup["machine"] = FIVE_AXES
    elif name == "impeller":
        made = make_part(4, "impeller")
        part, setup = made.write(folder)[0], made.setup
        setup["stock"] = {"kind": "box", "margin_mm": 1.0, "uncertainty_mm": 0.5}
    elif name in ("plate", "large"):
        import cadquery as cq

        from benchmarks.jobs.plain_plates import TOOLS, plate

        part, setup = folder / f"{name}.step", {"tools": TOOLS if name == "plate" else SMALL_TOOLS}
        cq.exporters.export(plate(300.0) if name == "plate" else plate(500.0), str(part))
    else:
        file, given = PUBLIC[name.removesuffix("-5")]
        part = public / file
        if not part.exists():
            return None
        setup = json.loads((ROOT / "examples" / "setups" / given).read_text())
        if name.endswith("-5"):
            setup["machine"] = FIVE_AXES
    own.write_text(json.dumps(setup))
    return part, own


def earlier(commit: str, folder: Path) -> Path:
    """A worktree of a commit below ``folder``, with its kernels compiled."""
    tree = folder / f"code-{commit[:12]}"
    if not tree.exists():
        subprocess.run(["git", "-C", str(ROOT), "worktree", "add", "--detach", str(tree), commit], check=True,
                       capture_output=True)
    subprocess.run([sys.executable, "-m", "service.cli", "warm"], cwd=tree, env=_environment(tree), check=True,
                   capture_output=True)
    return tree


def run(tree: Path, part: Path, setup: Path, limit: float) -> dict[str, Any]:
    """One job with the code of a tree: its row, with the calibration beside it."""
    with tempfile.TemporaryDirectory() as scratch:
        calibrated = float(_output(["-c", CALIBRATION], tree, limit))
        try:
            return {**json.loads(_output(["-c", DRIVER, str(part), str(setup), scratch], tree, limit)),
                    "calibration": calibrated}
        except subprocess.TimeoutExpired:
            return {"state": f"over {limit:g} s", "calibration": calibrated}
        except subprocess.CalledProcessError as failed:
            return {"state": "error", "message": failed.stderr[-400:], "calibration": calibrated}


def _output(arguments: list[str], tree: Path, limit: float) -> str:
    """The last line that a Python process prints in a tree."""
    done = subprocess.run([sys.executable, *arguments], cwd=tree, env=_environment(tree), capture_output=True,
                          text=True, check=True, timeout=limit)
    return done.stdout.splitlines()[-1]


def _environment(tree: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(tree)}


def table(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Lines of a markdown table: the newest row of each job and side, with the ratio of the two walls."""
    newest = {(r["job"], r["side"]): r for r in rows}
    head = ["job", "code", "state", *(f"{s} s" for s in STAGES), "wall s", "processor s", "MB", "calibration s"]
    yield f"| {' | '.join(head)} |"
    yield "|" + "---|" * (len(STAGES) + 7)
    for job in dict.fromkeys(r["job"] for r in rows):
        for side in ("before", "now"):
            row = newest.get((job, side))
            if row is None:
                continue
            took = [f"{row['stages'][s][0]:.1f}" if s in row.get("stages", {}) else "-" for s in STAGES]
            ends = [f"{row[k]:.{d}f}" if k in row else "-" for k, d in (("wall", 1), ("processor", 1), ("mb", 0))]
            yield f"| {job} | {side} | {row['state']} | {' | '.join([*took, *ends])} | {row['calibration']:.2f} |"
        pair = [newest.get((job, side)) for side in ("before", "now")]
        if all(r is not None and "wall" in r for r in pair):
            was, now = (r for r in pair if r is not None)
            yield (f"| {job} | ratio | coverage {now['coverage'] - was['coverage']:+.4f}, machining time "
                   f"{now['minutes'] / was['minutes'] - 1.0:+.1%} | " + "| " * len(STAGES)
                   + f"{was['wall'] / now['wall']:.2f} | {was['processor'] / now['processor']:.2f} | "
                   f"{was['mb'] / now['mb']:.2f} | |")


def main() -> None:
    """Run the jobs and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("jobs", nargs="*", default=["demo", "demo5", "impeller", "plate"])
    parser.add_argument("--before", help="commit to compare with; none: today's code alone")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "bench_jobs")
    parser.add_argument("--public", type=Path, default=SHARED / "parts")
    parser.add_argument("--limit", type=float, default=3600.0)
    parser.add_argument("--table", action="store_true")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "rows.jsonl"
    sides = [("now", ROOT)]
    if args.before and not args.table:
        sides.insert(0, ("before", earlier(args.before, args.out.resolve())))
    for job in args.jobs if not args.table else ():
        with tempfile.TemporaryDirectory() as scratch:
            files = written(job, Path(scratch), args.public)
            if files is None:
                print(f"{job}: {PUBLIC[job.removesuffix('-5')][0]} is not in {args.public}: left out", file=sys.stderr)
                continue
            for side, tree in sides:
                row = {"job": job, "side": side, **run(tree, *files, args.limit), "at": round(time.time())}
                with kept.open("a") as out:
                    out.write(json.dumps(row) + "\n")
                print(f"{job} {side}: {row['state']} {row.get('wall', 0.0):.1f} s", file=sys.stderr, flush=True)
    if kept.exists():
        print("\n".join(table([json.loads(line) for line in kept.read_text().splitlines()])))


if __name__ == "__main__":
    main()
