"""What STEP-NC of a long job costs: processor seconds, megabytes at the peak, and size of the file, written and read.

    .venv/bin/python benchmarks/writing/bench_stepnc.py [POINTS]

A plan of so many points (a million without) is made, whose tool leans along every third pass; each form is written and
read in a process of its own, so that its peak is its own, above that of the same process before it began.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from output.stepnc.ap238 import stream_stepnc_aim  # noqa: E402
from output.stepnc.iso14649 import stream_stepnc_arm  # noqa: E402
from output.workplan import Workplan  # noqa: E402
from tests.synthetic_plan import clamped, long_plan  # noqa: E402
from toolpath.workingsteps import Trajectory, TrajectoryKind  # noqa: E402
from verify.kinematics import Kinematics  # noqa: E402
from verify.stepnc.reader import read_stepnc  # noqa: E402

FORMS = {"AP238": stream_stepnc_aim, "ISO 14649": stream_stepnc_arm}
ROWS = 300
STEPS = 50  # each a zone of its own, as jobs have them


def job(points: int, leaning: bool) -> Workplan:
    """A plan of STEPS steps with so many points in all."""
    (whole,) = long_plan(points, ROWS).steps
    ways, shares = whole.trajectories, np.linspace(0, len(whole.trajectories), STEPS + 1).astype(int)
    steps = [replace(whole, id=f"S{k + 1:03d}", name=f"S{k + 1:03d} Z{k + 1}", trajectories=ways[a:b])
             for k, (a, b) in enumerate(zip(shares[:-1], shares[1:], strict=True))]
    if not leaning:
        return replace(long_plan(1000, 2), steps=tuple(steps))
    return replace(clamped(), steps=tuple(replace(s, access="A1", trajectories=tuple(_swung(t) for t in s.trajectories))
                                          for s in steps))


def _swung(t: Trajectory) -> Trajectory:
    """A pass whose axis swings aside and back, upright at both ends."""
    if t.motion is not TrajectoryKind.CUT:
        return t
    share = np.linspace(0.0, 1.0, len(t.points))
    lean = 0.2 * np.sin(np.pi * share)
    return replace(t, axes=np.column_stack([np.sin(lean), np.zeros_like(lean), np.cos(lean)]))


def peak() -> float:
    """MB, the most this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measure(what: str, form: str, points: int, leaning: bool, path: Path) -> str:
    """One row, as words: seconds, MB before, MB at the peak, MB of the file, moves read."""
    moves = 0
    if what == "write":
        plan = job(points, leaning)
        before, started = peak(), time.process_time()
        with open(path, "w", encoding="ascii", newline="\n") as file:
            FORMS[form](plan, file.write)
    else:
        before, started = peak(), time.process_time()
        machine = Kinematics("table-table-AC", None) if leaning else None
        moves = len(read_stepnc(path.read_text(encoding="ascii"), kinematics=machine))
    seconds, size = time.process_time() - started, path.stat().st_size / 1e6
    return f"{seconds:.1f} {before:.0f} {peak():.0f} {size:.1f} {moves}"


def main() -> None:
    """Print the table."""
    if len(sys.argv) > 2:
        what, form, points, leaning, path = sys.argv[1:]
        print(measure(what, form, int(points), leaning == "True", Path(path)))
        return
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    print(f"{points} points, {STEPS} steps")
    print("| job | form | | s | MB before | MB at the peak | MB of the file | moves |\n" + "|---" * 8 + "|")
    with tempfile.TemporaryDirectory() as folder:
        for leaning in (False, True):
            for form in FORMS:
                path = Path(folder) / f"{form.split()[0]}{leaning}.stpnc"
                for what in ("write", "read"):
                    done = subprocess.run([sys.executable, __file__, what, form, str(points), str(leaning), str(path)],
                                          capture_output=True, text=True, check=True)
                    print(f"| {'5 axes' if leaning else '3 axes'} | {form} | {what} | "
                          + " | ".join(done.stdout.split()) + " |", flush=True)


if __name__ == "__main__":
    main()
