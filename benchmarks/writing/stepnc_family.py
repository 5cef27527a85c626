"""Files of real jobs before readers of others: small parts planned on 3 axes, 3+2 and 5, seed by seed.

    .venv/bin/python benchmarks/writing/stepnc_family.py [--recipe small] [--seeds 0:3] [--machines 3-axis 3+2 5-axis]
        [--scallop MM] [--minutes 60] [--limit 900]

A part is drawn, planned and proved, and both its STEP-NC files are held against their schemas by
../shared/stepnc/p21check.py with --rules --roots; jobs that are not proved have none, and say so. Recipe small is a
plate of 16 by 14 mm with one wall, its thickness, height and lean drawn from the seed, which takes seconds; the others
are those of the family (docs/family.md; with two walls and one connection where they let one choose), which take
minutes: 'family' goes round its smaller ones with the seed, and --scallop plans them coarser than their setup says,
with a chordal tolerance of CHORDS, for it is the files that are looked at. Programs go to LinuxCNC's interpreter
(../shared/tools/gcode_check.sh), whole and cut to begin at each of their labels. The three forms of AP238 go round
with the seeds, and every other seed has arcs. The chain itself has read the files back and held them against the
program before they are there (docs/stepnc.md). Each job has a process of its own and --limit seconds; a row is
printed as it is known, and no job begins once the minutes are spent.
"""

from __future__ import annotations

import argparse
import fcntl
import inspect
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402

from examples.family.recipes import RECIPES, make_part  # noqa: E402
from geometry.errors import CamError  # noqa: E402
from service import pipeline  # noqa: E402
from service.from_wire import parse_setup  # noqa: E402

CHECK = ROOT.parent / "shared" / "stepnc" / "p21check.py"
GCODE = ROOT.parent / "shared" / "tools" / "gcode_check.sh"
SCHEMAS = {"cc1": "ap238e3_aim_lf.exp", "cc2": "ap238e3_aim_lf.exp", "integrated_cnc": "ap238e1_aim_lf.exp"}
FIVE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-100, 100], [-720, 720]]}
FAMILY = ("random", "leaning_pair", "narrow", "wavy", "mixed_linear")
CHORDS = 0.005  # mm, of coarser plans
LABEL = re.compile(r"^N\d+$", re.MULTILINE)
MACHINES: dict[str, dict[str, Any]] = {
    "3-axis": {}, "3+2": {**FIVE, "simultaneous": False}, "5-axis": {**FIVE, "simultaneous": True}}


def checked(path: Path, schema: str) -> str:
    """'ok' where the checker exits with 0 and has no warning, else what it says first."""
    done = subprocess.run([sys.executable, str(CHECK), "--schema", str(CHECK.parent / "schemas" / schema), "--rules",
                           "--roots", str(path)], capture_output=True, text=True)
    bad = [line for line in done.stdout.splitlines() if ": W " in line or ": E " in line]
    roots = [line for line in done.stdout.splitlines() if "unreferenced:" in line]
    if schema.startswith("iso") and not all(line.endswith("unreferenced: PROJECT x1 (e.g. #1)") for line in roots):
        bad.append(roots[0])
    return "ok" if done.returncode == 0 and not bad else f"exit {done.returncode}: {bad[0] if bad else '?'}"


def from_labels(text: str) -> list[str]:
    """The programs a machinist cuts out of one of LinuxCNC to start at its labels, one for each."""
    return ["%\n" + text[m.start():] for m in LABEL.finditer(text)]


def interpreted(path: Path, tcp: bool) -> str:
    """'ok' where LinuxCNC's interpreter takes a program, else what it says last.

    One at a time on a machine: two interpreters share memory, and one in ten of them ends with a bus error.
    """
    with (Path(tempfile.gettempdir()) / "zonemill-rs274.lock").open("w") as alone:
        fcntl.flock(alone, fcntl.LOCK_EX)
        done = subprocess.run(["bash", str(GCODE), *(["--tcp"] if tcp else []), str(path)], capture_output=True,
                              text=True)
    said = (done.stdout + done.stderr).strip().splitlines()
    why = next((line for line in said if line.startswith("REJECTED")), said[-1] if said else "?")
    return "ok" if done.returncode == 0 else f"exit {done.returncode}: {why}"


def small(seed: int, folder: Path) -> tuple[Path, dict[str, Any]]:
    """A plate with a wall that leans, its files in a folder, and a setup."""
    rng = np.random.default_rng(seed)
    spans = (1.5, 3.0), (2.5, 4.5), (-12.0, 12.0), (0.0, 30.0)
    thick, high, lean, turn = (float(rng.uniform(*span)) for span in spans)
    wall = cq.Workplane().box(9.0, thick, high + 1.0, centered=(True, True, False)).rotate((0, 0, 0), (1, 0, 0), lean)
    wall = wall.rotate((0, 0, 0), (0, 0, 1), turn).translate((8.0, 7.0, 1.0))
    shape = cq.Workplane().box(16.0, 14.0, 2.0, centered=False).union(wall)
    path = folder / f"small-{seed}.step"
    cq.exporters.export(shape, str(path))
    common = {"neck_length_mm": 16, "shank_diameter_mm": 6, "stickout_mm": 28,
              "holder": [{"diameter_mm": 20, "length_mm": 30}]}
    tools = [{"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 9, "neck_diameter_mm": 3.8, **common},
             {"id": "T2", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 9, "neck_diameter_mm": 2.8, **common}]
    return path, {"tools": tools, "stock": {"margin_mm": 0.6, "uncertainty_mm": 0.2},
                  "quality": {"scallop_height_mm": 0.04, "chordal_tolerance_mm": 0.005}}


def drawn(recipe: str, seed: int, folder: Path) -> tuple[Path, dict[str, Any]]:
    """STEP file and setup of a part."""
    if recipe == "small":
        return small(seed, folder)
    recipe = FAMILY[seed % len(FAMILY)] if recipe == "family" else recipe
    takes = inspect.signature(RECIPES[recipe]).parameters
    wanted = {"walls": 2, "connections": 1} if "walls" in takes else {}
    part, _, setup = make_part(seed, recipe, **wanted).write(folder, reach=False)
    return Path(part), json.loads(Path(setup).read_text())


def row(recipe: str, seed: int, machine: str, scallop: float | None, folder: Path) -> str:
    """One job as the middle of its row of the table."""
    part, setup = drawn(recipe, seed, folder)
    form = list(SCHEMAS)[seed % len(SCHEMAS)]
    setup["machine"] = {**setup.get("machine", {}), **MACHINES[machine], "ap238": form, "arcs": seed % 2 == 1,
                        "restart_points": True}
    if scallop is not None:
        setup["quality"] = {**setup["quality"], "scallop_height_mm": scallop, "chordal_tolerance_mm": CHORDS}
    try:
        report = pipeline.plan(part, parse_setup(setup), folder / "out", lambda _stage, _share: None)
    except CamError as refusal:
        return f"{form} | {refusal.code} | | | | |"
    found = "".join(f", {count} {kind}" for kind, count in report["finding_counts"].items())
    return " | ".join([form, f"{report['state']}{found}", str(len(report["steps"])),
                       *heard(folder / "out", form, machine != "3-axis")])


def heard(folder: Path, form: str, tcp: bool) -> tuple[str, str, str]:
    """What readers of others say to the files of a job in a folder: of ISO 14649, of AP238 and of LinuxCNC.

    form : of AP238, in which its file is written; tcp : whether its programs turn

    'ok' and how much there is, 'none' where the job has no such file, else what is said first that is no praise.
    """
    out = []
    for pattern, schema in (("job*.arm.stpnc", "iso14649_milling.exp"), ("job*.stpnc", SCHEMAS[form])):
        files = [f for f in sorted(folder.glob(pattern)) if pattern.endswith("arm.stpnc")
                 or not f.name.endswith("arm.stpnc")]
        said = [checked(f, schema) for f in files]
        out.append(next((s for s in said if s != "ok"), f"ok {sum(f.stat().st_size for f in files) / 1e6:.1f} MB")
                   if files else "none")
    programs, said, cut = sorted(folder.glob("program*.linuxcnc.ngc")), [], folder / "cut.ngc"
    for program in programs:
        said.append(interpreted(program, tcp))
        for text in from_labels(program.read_text()):
            cut.write_text(text)
            said.append(interpreted(cut, tcp))
    labels = f"ok {len(programs)}, from {len(said) - len(programs)} labels"
    return out[0], out[1], next((s for s in said if s != "ok"), labels) if programs else "none"


def seeds_of(words: list[str]) -> list[int]:
    """Numbers and ranges: 3, 0:20."""
    out: list[int] = []
    for word in words:
        first, _, end = word.partition(":")
        out += range(int(first), int(end)) if end else [int(first)]
    return out


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--recipe", default="small", choices=["small", "family", *sorted(RECIPES)])
    ask.add_argument("--seeds", nargs="+", default=["0:3"], help="numbers and ranges, end left out")
    ask.add_argument("--machines", nargs="+", default=list(MACHINES), choices=list(MACHINES))
    ask.add_argument("--scallop", type=float)
    ask.add_argument("--minutes", type=float, default=60.0)
    ask.add_argument("--limit", type=float, default=900.0, help="s, for one job")
    ask.add_argument("--one", nargs=3, metavar=("SEED", "MACHINE", "FOLDER"), help=argparse.SUPPRESS)
    asked = ask.parse_args()
    if asked.one:
        print(row(asked.recipe, int(asked.one[0]), asked.one[1], asked.scallop, Path(asked.one[2])))
        return
    begun = time.monotonic()
    print("| seed | machine | AP238 as | state | steps | ISO 14649 | AP238 | LinuxCNC | s |\n|" + "---|" * 9)
    scallop = [] if asked.scallop is None else ["--scallop", str(asked.scallop)]
    for seed in seeds_of(asked.seeds):
        for machine in asked.machines:
            if time.monotonic() - begun > 60.0 * asked.minutes:
                return
            started = time.monotonic()
            with tempfile.TemporaryDirectory() as folder:
                call = [sys.executable, __file__, "--recipe", asked.recipe, *scallop, "--one", str(seed), machine,
                        folder]
                try:
                    done = subprocess.run(call, capture_output=True, text=True, timeout=asked.limit)
                    said = (done.stdout.strip() or done.stderr.strip() or "nothing said").splitlines()[-1]
                except subprocess.TimeoutExpired:
                    said = f"| over {asked.limit:g} s | | | | "
            print(f"| {seed} | {machine} | {said} | {time.monotonic() - started:.0f} |", flush=True)


if __name__ == "__main__":
    main()
