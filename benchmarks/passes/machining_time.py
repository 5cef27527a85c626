"""How long a whole LinuxCNC controller takes for programs, and how long the proof says it does.

Run from the root of the checkout: ``python benchmarks/passes/machining_time.py [PROGRAM ...] [--jobs] [--override N]
[--kins KINS]``. Programs run on ``shared/tools/linuxcnc_run.sh`` beside the checkout in real time, feeds N times as
fast; without any PROGRAM the patterns below do, a minute together. ``--jobs`` plans and proves three whole jobs of
small parts from a box, on three axes, 3+2 and five, and runs their programs, ten minutes each at N = 1. Ours is
``verify.program.move_times`` with what that controller does: 500 mm/s, 5000 mm/s² at once and 360 deg/s. What it takes
for a program that hardly moves is taken off its time; the time it takes to change tools stays.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from verify.gcode.reader import read_program  # noqa: E402
from verify.kinematics import Kinematics  # noqa: E402
from verify.model import ProofSetup  # noqa: E402
from verify.program.move_times import minutes_of  # noqa: E402

CONTROLLER = ROOT.parent / "shared" / "tools" / "linuxcnc_run.sh"
BEGIN = "%\nG21 G17 G90 G94 G40 G49 G80 G64 P0.001\nG54\nT1 M6\nG43 H1\nG0 X0 Y0 Z5\nG1 Z0 F3000\n"
FASTEST, ACCELERATION, TURNS = 500.0, 5000.0, 360.0  # mm/s, mm/s², deg/s
FEED, LIMIT = 6000.0, 1200  # mm/min of the patterns; s


def patterns() -> dict[str, str]:
    """Programs by name, each with one thing that takes time."""
    def way(*turns: float, length: float, count: int) -> str:
        heading, at, lines = 0.0, np.zeros(2), []
        for k in range(count):
            heading += math.radians(turns[k % len(turns)])
            at += length * np.array([math.cos(heading), math.sin(heading)])
            lines.append(f"G1 X{at[0]:.4f} Y{at[1]:.4f} F{FEED:g}")
        return "\n".join(lines)

    made = {"nothing": "", "short moves straight on": way(0.0, length=0.05, count=4000),
            "corners of 90 deg, 1 mm": way(90.0, -90.0, length=1.0, count=300),
            "corners of 45 deg, 1 mm": way(45.0, -45.0, length=1.0, count=300),
            "corners of 15 deg, 0.3 mm": way(15.0, -15.0, length=0.3, count=1000),
            "corners of 3 deg, 0.3 mm": way(3.0, -3.0, length=0.3, count=1500),
            "round 10 mm, chords of 0.2": way(360.0 / 157, length=0.2, count=1570),
            "round 2 mm, chords of 0.1": way(360.0 / 62, length=0.1, count=1860),
            "to and fro, 3 mm": way(180.0, length=3.0, count=300),
            "rapid and feed by turns": "\n".join(f"G{k % 2} X{3 * (k + 1)} F{FEED:g}" for k in range(150))}
    return {name: f"{BEGIN}{lines}\nM2\n%\n" for name, lines in made.items()}


def jobs(folder: Path) -> dict[str, str]:
    """Programs of three whole jobs, by name."""
    from benchmarks.writing.stepnc_family import MACHINES, small
    from service import pipeline
    from service.from_wire import parse_setup

    made = {}
    for seed, machine in enumerate(MACHINES):
        part, setup = small(seed, folder)
        setup |= {"stock": {"kind": "box", "margin_mm": 0.6, "uncertainty_mm": 0.2}, "machine": MACHINES[machine]}
        report = pipeline.plan(part, parse_setup(setup), folder / machine, lambda _stage, _share: None)
        (program,) = (folder / machine).glob("program*.ngc")
        made[f"small:{seed} on {machine}, {len(report['steps'])} steps"] = program.read_text()
    return made


def on_the_controller(text: str, override: float, kins: str) -> float:
    """Seconds from the start to the end; ends this process with code 2 where the controller does not run it."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "in.ngc"
        path.write_text(text)
        path.chmod(0o644)
        done = subprocess.run(["bash", str(CONTROLLER), "--kins", kins, "--override", f"{override:g}", "--limit",
                               str(LIMIT), str(path)], capture_output=True, text=True)
    if done.returncode != 0:
        print(f"the controller did not run it: {done.stdout}{done.stderr}", file=sys.stderr)
        sys.exit(2)
    return float(json.loads(done.stdout.strip().splitlines()[-1])["seconds"])


def ours(text: str, override: float, kins: str) -> tuple[float, float]:
    """Seconds as the proof says, and at the feeds alone."""
    zero = np.zeros(3)
    machine = Kinematics(f"table-table-{kins[-2:].upper()}", (zero, zero))
    setup = ProofSetup(rapid_feed=60.0 * FASTEST, acceleration=ACCELERATION, jerk=math.inf,
                       rotary_rate=math.radians(60.0 * TURNS), kinematics=machine)
    program = read_program(text, kinematics=machine)
    program.minutes[:] = program.minutes / override
    even = np.where(np.isnan(program.minutes), np.linalg.norm(program.end - program.start, axis=1) / setup.rapid_feed,
                    program.minutes)
    return 60.0 * float(minutes_of(program, setup).sum()), 60.0 * float(even.sum())


def main() -> None:
    """Print a row a program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", type=Path)
    parser.add_argument("--jobs", action="store_true")
    parser.add_argument("--override", type=float, default=1.0)
    parser.add_argument("--kins", choices=("xyzac", "xyzbc"), default="xyzac")
    args = parser.parse_args()
    if not CONTROLLER.exists():
        print(f"{CONTROLLER} is not there", file=sys.stderr)
        sys.exit(2)
    made = patterns()
    start = on_the_controller(made.pop("nothing"), args.override, args.kins)
    if args.jobs:
        with tempfile.TemporaryDirectory() as folder:
            made = jobs(Path(folder))
    print("| program | at its feeds s | ours s | controller s | ours off |\n|---|---|---|---|---|", flush=True)
    for name, text in ({str(p): p.read_text() for p in args.programs} or made).items():
        took = on_the_controller(text, args.override, args.kins) - start
        said, even = ours(text, args.override, args.kins)
        print(f"| {name} | {even:.1f} | {said:.1f} | {took:.1f} | {100.0 * (said / took - 1.0):+.1f} % |", flush=True)


if __name__ == "__main__":
    main()
