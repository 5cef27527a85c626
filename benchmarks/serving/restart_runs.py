"""Five-axis programs on the whole LinuxCNC controller, started at every step: does the tool go where ours says?

Run from the root of the checkout: ``python benchmarks/serving/restart_runs.py [NAME ...] [--out DIR] [--override N]
[--from-line]``. Names are those of ``JOBS``; without any all are taken. The axes move in the cuts of the twisted wall,
and between those of the others. Each is planned, proved and run whole on
``shared/tools/linuxcnc_run.sh`` beside the checkout, then once for each label of its program: cut to begin there, as a
machinist does, behind a few lines that leave the control as a broken-off run may have left it (``BEFORE``: the tip
kept, both rotary axes and the tool somewhere above the part, another zero and plane, feed in inverse time). With
--from-line the whole program is loaded and the control asked to run from the line of the label.

The script of the controller is run as a copy that keeps where the joints are, every 20 ms at best. Ours is the
program as the reader of the proof has it (``verify``), every move put into joints by ``verify.kinematics``, of those
that turn at 17 places, and straight between; on to machine zero, which it does not know, by Z 0. From the first place
above the part on:

- outwards: every look at the controller is within BOUND of ours in blocks that cut, mm and deg in one, as G64 P0.001
  lets it round a corner of the way of the tip by that much, and within CORNER in rapids, the room that turns keep
  outside the ball round the part: where a rapid goes over into one that turns, the axes begin to turn before the tip
  has arrived, which P does not bound. For the same reason blocks that turn while they cut may be TURNING off, at the
  feeds as written: where the rate of an axis jumps by 50 deg/s it needs 14 ms at the 3600 deg/s² of this machine, while
  the tip goes on: 0.08 deg where one block goes on as the other, 0.24 where the tip turns a corner as well. So may the
  blocks that begin within LAG after them: one of 0.1 mm takes 3 ms, and C was 0.007 deg behind three blocks on;
- inwards: of both ends of every leg of a cut the controller was seen as near as it goes in LOOK at the feed of the leg;
- it comes to the last line without an error, and ends where ours does.

Exit code 1 where any of it fails or a job is not proved, 2 where there is no controller.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

from benchmarks.five_axis.five_axis_control import CONTROLLER, setup_of, write_bar  # noqa: E402
from benchmarks.writing.stepnc_family import LABEL, from_labels  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from output.clamping_sequence import BALL_CLEARANCE  # noqa: E402
from schemas.setup import Setup  # noqa: E402
from service import pipeline  # noqa: E402
from service.from_wire import machine_kinematics, parse_setup  # noqa: E402
from service.stages.job_inputs import JobInputs  # noqa: E402
from verify.gcode.reader import RAPID, read_program  # noqa: E402

JOBS = {"bar on a table A/C": ("bar", "table-AC", 4.0), "bar on a table B/C": ("bar", "table-BC", 4.0),
        "twisted wall on a table A/C": ("wall", "table-AC", 1.0)}
FLANK = {"id": "T1", "kind": "bull", "corner_radius_mm": 1, "flutes": 3, "diameter_mm": 6, "flute_length_mm": 14,
         "neck_diameter_mm": 5.8, "neck_length_mm": 24, "shank_diameter_mm": 6, "stickout_mm": 40,
         "holder": [{"diameter_mm": 20, "length_mm": 30}]}
BEFORE = ["%", "G21 G17 G90 G94 G40 G49 G80 G54", "G53 G0 Z60.", "{tilt}25. C-70.", "M428", "G0 X20. Y-15. Z40.",
          "G55 G18 G91.1 G93"]
MINUTE = 60.0
BOUND, TURNING, CORNER = 0.002, 0.3, BALL_CLEARANCE  # mm and deg
LAG = 0.02  # s, in which an axis comes to where the program has it
FLAT = np.array([1.0, 1.0, 0.0, 1.0, 1.0])
GRAIN = 0.1  # mm and deg, legs are cut into for the search
SHARES = np.linspace(0.0, 1.0, 17)
LIMIT = 900  # s
LOOK = 0.1  # s, no two looks are further apart, with as much again for a busy computer
HEAD = ("job", "start", "s", "looks", "off in cuts, um", "in cuts that turn, um and mdeg", "in rapids, um and mdeg",
        "seen of the cut within, mm", "verdict")
KEPT = {"errs, notes = [], []": "errs, notes, track = [], [], []",
        "p = s.joint_actual_position": "p = s.joint_actual_position; track.append((s.motion_line, *p[:5]))",
        "json.dump(dict(finished": "json.dump(dict(track=track, finished"}
FROM = "c.auto(linuxcnc.AUTO_RUN, 0)"


@dataclass(frozen=True, eq=False)
class Way:
    """A program as ours from the first place that is known on.

    start, end : (n, 5) float64, mm and deg of the joints, where legs go from and to, in order
    speed : (n,) float64, mm and deg a second, of feed moves as they are written; nan of rapids
    lines : of feed moves;  turns : of those that turn, of the moves beside, and of those that begin within LAG after
    last : the last line with a move
    """

    start: F64
    end: F64
    speed: F64
    lines: frozenset[int]
    turns: frozenset[int]
    last: int


def job(name: str, folder: Path) -> tuple[Path, Setup]:
    """STEP file and setup of one of JOBS."""
    kind, machine, _ = JOBS[name]
    part, setup = folder / "part.step", setup_of(machine).model_dump()
    if kind == "bar":
        write_bar(part)
        return part, parse_setup(json.dumps(setup))
    base = cq.Workplane().box(24, 16, 3, centered=(True, True, False))
    low, high = [(-8, -2.5), (8, -2.5), (8, 2.5), (-8, 2.5)], [(-7.5, -1.4), (7.5, -1.1), (7.5, 0.6), (-7.5, 0.6)]
    wall = cq.Workplane().polyline(low).close().workplane(offset=7).polyline(high).close().loft(ruled=True)
    cq.exporters.export(base.union(wall.translate((0, 0, 3))), str(part))
    setup["tools"], setup["quality"] = [FLANK], {"scallop_height_mm": 0.03, "chordal_tolerance_mm": 0.01}
    setup["machine"]["orientations"] = "given"
    return part, parse_setup(json.dumps(setup))


def way_of(setup: Setup, text: str) -> Way:
    """A program as the proof reads it; ways to machine zero, which it has no words for, go by Z 0 of the joints."""
    machine, gauges = machine_kinematics(setup.machine), JobInputs.of(setup).gauge_lengths
    assert machine is not None
    p = read_program(text, kinematics=machine, gauge_length=gauges)
    level = np.zeros((len(p), 2))  # of the last steps alone, where the axes stay at 0
    begun, ended = (level, level) if p.poses is None else (p.poses.start_turn, p.poses.end_turn)
    turning = np.abs(ended - begun).max(axis=1) > 0.0
    places = []
    for share in SHARES:
        turn = (1.0 - share) * begun + share * ended
        gauge = np.array([gauges[t] for t in p.tool.tolist()])
        linear = machine.joints((1.0 - share) * p.start + share * p.end, turn, gauge)
        places.append(np.column_stack([linear, np.degrees(turn)]))
    unknown, first = set(p.unknown[:, 0].tolist()), 0
    while first in unknown:
        first += 1
    up = np.array([k for k, line in enumerate(text.splitlines(), 1) if line == "G53 G0 Z0."])
    start, end, speed = [], [], []
    for k in range(first, len(p)):
        if k > first and ((up > p.line[k - 1]) & (up <= p.line[k])).any():
            low, high = end[-1], places[0][k]
            between = [low, low * FLAT, high * FLAT, high]
            start, end, speed = start + between[:-1], end + between[1:], speed + [np.nan] * 3
        row = [places[s][k] for s in (range(len(SHARES)) if turning[k] else (0, -1))]
        length = np.linalg.norm(np.diff(row, axis=0), axis=1)
        start, end = start + row[:-1], end + row[1:]
        speed += (length * (len(row) - 1) / (MINUTE * p.minutes[k])).tolist()
    feeds = p.kind != RAPID
    turns = {n + k for n in p.line[feeds & turning].tolist() for k in (-1, 0, 1)}
    clock = np.append(0.0, MINUTE * np.nancumsum(p.minutes))
    for j in np.flatnonzero(feeds & turning):
        turns.update(p.line[j:np.searchsorted(clock, clock[j + 1] + LAG)].tolist())
    return Way(np.array(start), np.array(end), np.array(speed), frozenset(p.line[feeds].tolist()),
               frozenset(turns), int(p.line.max()))


def moved(way: Way, by: int) -> Way:
    """The same where its text stands so many lines further down."""
    lines, turns = (frozenset(n + by for n in old) for old in (way.lines, way.turns))
    return replace(way, lines=lines, turns=turns, last=way.last + by)


def off(looks: F64, way: Way) -> F64:
    """(n,) mm and deg: how far looks (n, 5) are from the legs of a way."""
    steps = way.end - way.start
    count = np.maximum(1, np.ceil(np.linalg.norm(steps, axis=1) / GRAIN).astype(int))
    owner = np.repeat(np.arange(len(steps)), count)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[owner]
    tree = cKDTree(way.start[owner] + share[:, None] * steps[owner])
    nearest, _ = tree.query(looks)
    least = np.empty(len(looks))
    for k, near in enumerate(tree.query_ball_point(looks, nearest + 0.5 * GRAIN + 1e-9)):
        of = np.unique(owner[near])
        a, d = way.start[of], steps[of]
        t = np.clip(((looks[k] - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-18), 0.0, 1.0)
        least[k] = np.linalg.norm(looks[k] - a - t[:, None] * d, axis=1).min()
    return least


def run(text: str, kins: str, faster: float, folder: Path, line: int = 0) -> dict[str, Any]:
    """What the controller says of a program, and its track; ends this process with code 2 where it does not start."""
    script = CONTROLLER.read_text()
    changes = KEPT | ({FROM: f"c.auto(linuxcnc.AUTO_RUN, {line})"} if line else {})
    for old, new in changes.items():
        if script.count(old) != 1:
            print(f"{CONTROLLER} has changed: '{old}' is not there once", file=sys.stderr)
            sys.exit(2)
        script = script.replace(old, new)
    (folder / "run.sh").write_text(script)
    (folder / "in.ngc").write_text(text)
    done = subprocess.run(["bash", str(folder / "run.sh"), "--kins", kins, "--override", f"{faster:g}", "--limit",
                           str(LIMIT), str(folder / "in.ngc")], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        print(f"the controller does not start: {done.stdout[-2000:]}{done.stderr}", file=sys.stderr)
        sys.exit(2)
    answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return answer


def judged(said: dict[str, Any], way: Way, faster: float) -> tuple[list[str], bool]:
    """Cells of a row, and whether all is as it should be."""
    lines, looks = np.split(np.array(said["track"]), [1], axis=1)
    there = np.flatnonzero(np.linalg.norm(looks - way.start[0], axis=1) < BOUND)
    runs = said["finished"] and not said["errors"] and said["last_line"] == way.last
    words = "runs" if runs else f"line {said['last_line']} of {way.last}: " + "; ".join(said["errors"])
    if not len(there):
        return [f"{said['seconds']:.0f}", str(len(looks)), "", "", "", "", f"{words}; never at the first place"], False
    out = off(looks[there[0]:], way)
    cut = ~np.isnan(way.speed)
    tree = cKDTree(looks[there[0]:])
    near = np.maximum(*(tree.query(ends[cut])[0] for ends in (way.start, way.end)))
    seen = near <= BOUND + LOOK * faster * way.speed[cut]
    ends = bool(np.linalg.norm(looks[-1] - way.end[-1]) < BOUND)
    if not ends:
        words += "; ends elsewhere"
    if not seen.all():
        words += f"; {int((~seen).sum())} places of cuts not seen"
    in_cut, in_turn = (np.isin(lines[there[0]:, 0].astype(int), list(n)) for n in (way.lines, way.turns))
    wide = out > np.select([in_cut & in_turn, in_cut], [TURNING, BOUND], CORNER)
    if wide.any():
        worst = int(np.flatnonzero(wide)[0])
        place = " ".join(f"{v:.4f}" for v in looks[there[0] + worst])
        words += f"; {int(wide.sum())} looks off the way, the first at line {int(lines[there[0] + worst, 0])}: {place}"
    good = bool(runs and ends and seen.all() and not wide.any())
    far = [f"{1000 * out[which].max(initial=0.0):.1f}" for which in (in_cut & ~in_turn, in_cut & in_turn, ~in_cut)]
    return [f"{said['seconds']:.0f}", str(len(looks)), *far, f"{near.max():.2f}", words], good


def table(name: str, folder: Path, faster: float, by_line: bool) -> bool:
    """Plan, prove and run one job; prints its rows and says whether all is as it should be."""
    folder.mkdir(parents=True, exist_ok=True)
    part, setup = job(name, folder)
    state = pipeline.plan(part, setup, folder / "out", lambda _stage, _share: None)["state"]
    if state != "proved":
        print(f"| {name} | {state} |" + " |" * (len(HEAD) - 2), flush=True)
        return False
    text = (folder / "out" / "program.linuxcnc.ngc").read_text()
    kins = f"xyz{(setup.machine.kinematics or '')[-2:].lower()}"
    tilt = kins[3].upper()
    lines = text.splitlines()
    labels = [k for k, line in enumerate(lines, 1) if LABEL.fullmatch(line)]
    starts = [("top", text, 0, way_of(setup, text))]
    for label, cut in zip(labels, from_labels(text), strict=True):
        before = "".join(f"{line.format(tilt=tilt)}\n" for line in BEFORE)
        part_way = way_of(setup, cut)
        if by_line:
            starts.append((lines[label - 1], text, label, moved(part_way, label - 2)))
        else:
            starts.append((lines[label - 1], before + cut.removeprefix("%\n"), 0, moved(part_way, len(BEFORE) - 1)))
    good = True
    for label, program, line, way in starts:
        cells, fine = judged(run(program, kins, faster, folder, line), way, faster)
        print("| " + " | ".join([name, label, *cells]) + " |", flush=True)
        good = good and fine
    return good


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("names", nargs="*", help="of " + ", ".join(JOBS))
    ask.add_argument("--out", type=Path, help="folder for the files of each job; left out: they are thrown away")
    ask.add_argument("--override", type=float, help="how many times as fast feeds are run, 1 to 100; left out: 4 where "
                                                     "the axes stand still in cuts")
    ask.add_argument("--from-line", action="store_true", help="the control starts the whole program at the line")
    asked = ask.parse_args()
    if unknown := [n for n in asked.names if n not in JOBS]:
        ask.error(f"no such job: {', '.join(unknown)}")
    if not CONTROLLER.exists():
        print(f"{CONTROLLER} is not there", file=sys.stderr)
        sys.exit(2)
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    good = True
    with tempfile.TemporaryDirectory() as scratch:
        for k, name in enumerate(asked.names or JOBS):
            faster = asked.override or JOBS[name][2]
            good = table(name, (asked.out or Path(scratch)) / f"job{k + 1}", faster, asked.from_line) and good
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
