"""Finished five-axis programs on the whole LinuxCNC controller: do its joints go as far as ours, and does it complain?

Run from the root of the checkout: ``python benchmarks/five_axis/five_axis_control.py [NAME ...] [--out DIR]
[--override N]``. Names are those of ``MACHINES``; without any all are taken. On each a bar between two walls is
planned and proved, roughed with a flat end mill and finished with a ball, upright and from one further axis. Each
program then runs, as it was written, on ``shared/tools/linuxcnc_run.sh`` beside the checkout: in real time, feeds N
times as fast (4).

Ours is what the reader of the proof (``verify``) makes of the program: tip and rotary axes of every move, put into
joints by ``verify.kinematics`` at 17 places a move, and zero, where the controller starts. With tool centre point
control LinuxCNC has the formulas of the machine itself; programs of joints it runs as they are, so there the run shows
that it takes them, inside its travel, and the proof that they cut the part.

What may differ, and why:

- outwards BOUND, mm and deg: G64 P0.001 lets the controller round a corner by 0.001, and its positions are printed to
  0.001. Only formulas other than ours, or words read otherwise, take an axis further; a wrong pivot or sense does.
- inwards as much, but from what is held for LOOK seconds: the script looks at the joints every 20 ms at best, and the
  controller tells where they are every 10 ms, so a corner that is only touched goes unseen. Held is worked out from
  the program at the speeds it asks for, as if axes needed no time to speed up: no machine is there for less time.

The joints must also end where ours do. Exit code 1 where any of this fails, a job is not proved, or the controller
tells an error or does not get to the end; 2 where there is no controller.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402
from scipy.ndimage import minimum_filter1d  # noqa: E402

from geometry.mesh import F64  # noqa: E402
from schemas.setup import Setup  # noqa: E402
from service import pipeline  # noqa: E402
from service.from_wire import machine_kinematics, parse_setup  # noqa: E402
from service.stages.job_inputs import JobInputs  # noqa: E402
from verify.gcode.reader import read_program  # noqa: E402
from verify.program.program import Program  # noqa: E402

CONTROLLER = ROOT.parent / "shared" / "tools" / "linuxcnc_run.sh"
HOLDER = [{"diameter_mm": 20, "length_mm": 30}]
TOOLS = [{"id": "T1", "kind": "flat", "flutes": 2, "diameter_mm": 4, "flute_length_mm": 14, "shank_diameter_mm": 6,
          "stickout_mm": 30, "gauge_length_mm": 60, "holder": HOLDER},
         {"id": "T2", "kind": "ball", "flutes": 2, "diameter_mm": 3, "flute_length_mm": 8, "neck_diameter_mm": 2.8,
          "neck_length_mm": 22, "shank_diameter_mm": 6, "stickout_mm": 34, "gauge_length_mm": 64,
          "holder": HOLDER}]
SETUP = {"tools": TOOLS, "quality": {"scallop_height_mm": 0.2, "chordal_tolerance_mm": 0.02},
         "material": "AlMgSi1 6082", "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.1}}
ZERO = [0.0, 0.0, 0.0]  # where all rotary axes of the controller lie
MACHINES: dict[str, dict[str, Any]] = {
    "table-AC": {"kinematics": "table-table-AC", "pivots_mm": [ZERO, ZERO]},
    "table-BC": {"kinematics": "table-table-BC", "pivots_mm": [ZERO, ZERO]},
    "table-AC-joints": {"kinematics": "table-table-AC", "pivots_mm": [[0, 3, -60], [2, 1, 0]], "tcp": False},
    "head-BC-joints": {"kinematics": "head-head-BC", "pivots_mm": [[0, 0, 90]], "tcp": False},
}
ROTARY = [[-30, 110], [-360, 360]]  # deg; the controller has 120 and 36000
FASTEST, TURNS = 500.0, 360.0  # mm/s and deg/s of the controller
MINUTE = 60.0
BOUND = 0.002  # mm and deg
LOOK = 0.05  # s, no two looks of the controller's script are further apart, with as much again for a busy computer
TICK = 0.001  # s
SHARES = np.linspace(0.0, 1.0, 17)
LIMIT = 900  # s
HEAD = ("machine", "state", "lines", "s", "axis", "ours", "held", "controller", "differs", "verdict")


@dataclass(frozen=True, eq=False)
class Reach:
    """How far five axes go, linear ones first, mm and deg.

    least, most : (5,) float64, by every move
    low, high   : (5,) float64, held for LOOK seconds
    end         : (5,) float64, where they stand in the end
    """

    least: F64
    most: F64
    low: F64
    high: F64
    end: F64


def write_bar(path: Path) -> None:
    """STEP of two walls 2 mm thick, 11 high and 6 apart on a base, with a bar across at half height."""
    def box(x: float, y: float, z: float, at: tuple[float, float, float]) -> cq.Workplane:
        return cq.Workplane().box(x, y, z, centered=(True, True, False)).translate(at)

    shape = box(18, 14, 2, (0, 0, 0)).union(box(14, 2, 11, (0, -4, 2))).union(box(14, 2, 11, (0, 4, 2)))
    cq.exporters.export(shape.union(box(3, 8, 2, (0, 0, 7))), str(path))


def setup_of(name: str) -> Setup:
    """The setup of the bar on one of MACHINES."""
    return parse_setup(json.dumps(SETUP | {"machine": {"kind": "5-axis", "rotary_deg": ROTARY} | MACHINES[name]}))


def reach_of(setup: Setup, text: str, faster: float) -> tuple[Reach, Program]:
    """How far the axes go by our reading of a program.

    faster : feeds are run as many times as fast as they are written
    """
    machine, gauges = machine_kinematics(setup.machine), JobInputs.of(setup).gauge_lengths
    assert machine is not None
    p = read_program(text, kinematics=machine, gauge_length=gauges)
    assert p.poses is not None
    gauge = np.array([gauges[t] for t in p.tool.tolist()])
    rows = []
    for share in SHARES:
        turn = (1.0 - share) * p.poses.start_turn + share * p.poses.end_turn
        tip = (1.0 - share) * p.start + share * p.end
        rows.append(np.column_stack([machine.joints(tip, turn, gauge), np.degrees(turn)]))
    places = np.stack(rows, axis=1)
    steps = np.diff(places[:, [0, -1]], axis=1)[:, 0]
    length = np.minimum(np.linalg.norm(steps[:, :3], axis=1), np.linalg.norm(p.end - p.start, axis=1))
    least = np.maximum(length / FASTEST, np.abs(steps[:, 3:]).max(axis=1) / TURNS)
    seconds = np.fmax(least, MINUTE * p.minutes / faster)
    times = (np.cumsum(seconds) - seconds)[:, None] + SHARES * seconds[:, None]
    low, high = held(times.ravel(), places.reshape(-1, 5))
    every = np.vstack([np.zeros(5), places.reshape(-1, 5)])
    return Reach(every.min(axis=0), every.max(axis=0), low, high, places[-1, -1]), p


def held(times: F64, places: F64) -> tuple[F64, F64]:
    """Least and greatest that each axis goes to, or beyond, for LOOK seconds on end.

    times  : (n,) float64, s, never falling
    places : (n, 5) float64, mm and deg, straight between

    Returns (5,) and (5,) float64.
    """
    grid = np.arange(0.0, times[-1], TICK)
    size = round(LOOK / TICK)
    on_grid = [np.interp(grid, times, column) for column in places.T]
    return (np.array([-minimum_filter1d(-c, size).max() for c in on_grid]),
            np.array([minimum_filter1d(c, size).max() for c in on_grid]))


def run(program: Path, kins: str, faster: float) -> dict[str, Any]:
    """What the controller says of a program; ends this process with code 2 where it does not start."""
    done = subprocess.run(["bash", str(CONTROLLER), "--kins", kins, "--override", f"{faster:g}", "--limit", str(LIMIT),
                           str(program)], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        print(f"the controller does not start: {done.stdout}{done.stderr}", file=sys.stderr)
        sys.exit(2)
    answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def table(name: str, folder: Path, faster: float) -> tuple[list[list[str]], bool]:
    """Plan, prove and run the bar on one machine: rows of the table, and whether all is as it should be."""
    setup, out, kind = setup_of(name), folder / name, MACHINES[name]["kinematics"]
    write_bar(folder / "bar.step")
    state = pipeline.plan(folder / "bar.step", setup, out, lambda _stage, _share: None)["state"]
    if state != "proved":
        return [[name, state, *["-"] * (len(HEAD) - 2)]], False
    program = out / "program.linuxcnc.ngc"
    ours, read = reach_of(setup, program.read_text(), faster)
    said = run(program, f"xyz{kind[-2:].lower()}", faster)
    least, most, end = (np.array(said[key]) for key in ("joint_min", "joint_max", "end"))
    end = np.delete(end, 4 if kind[-2] == "A" else 3)
    fits = ((least > ours.least - BOUND) & (least < ours.low + BOUND) & (most < ours.most + BOUND)
            & (most > ours.high - BOUND) & (np.abs(end - ours.end) < BOUND))
    differs = np.maximum(np.abs(least - ours.least), np.abs(most - ours.most))
    runs = said["finished"] and not said["errors"] and said["last_line"] == read.line.max()
    said_of_it = "runs" if runs else f"line {said['last_line']} of {read.line.max()}: " + "; ".join(said["errors"])
    rows = [[name, state, str(read.lines), f"{said['seconds']:.0f}", "all", "", "", "", f"{differs.max():.4f}",
             said_of_it]]
    for k, letter in enumerate("XYZ" + kind[-2:]):
        spans = [f"{lo:.4f} to {hi:.4f}" for lo, hi in ((ours.least[k], ours.most[k]), (ours.low[k], ours.high[k]))]
        rows.append([name, "", "", "", letter, *spans, f"{least[k]:.3f} to {most[k]:.3f}", f"{differs[k]:.4f}",
                     "fits" if fits[k] else "does not fit"])
    return rows, bool(runs and fits.all())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="of " + ", ".join(MACHINES))
    parser.add_argument("--out", type=Path, help="folder for the files of each job; left out: they are thrown away")
    parser.add_argument("--override", type=float, default=4.0, help="how many times as fast feeds are run, 1 to 100")
    args = parser.parse_args()
    if unknown := [n for n in args.names if n not in MACHINES]:
        parser.error(f"no such machine: {', '.join(unknown)}")
    if not CONTROLLER.exists():
        print(f"{CONTROLLER} is not there", file=sys.stderr)
        sys.exit(2)
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    good = True
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.out or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for name in args.names or MACHINES:
            rows, fits = table(name, folder, args.override)
            print("\n".join("| " + " | ".join(row) + " |" for row in rows), flush=True)
            good = good and fits
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
