"""The whole chain on a list of parts, one row each, as a markdown table.

Run from the root of the checkout: ``python benchmarks/jobs/parts_table.py [NAME ...] [--out DIR] [--public DIR]``.
Without names all parts are taken: the demo, five of the family, and four public parts whose files are looked for in the
folder given by ``--public`` (left out with a word where absent). Counts of walls and connections stand beside the
truth of the generator; coverage beside the brute-force reach of ``brute_reach``; programs and STEP-NC of proved jobs
go through the outside judges where those are found beside the checkout.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

SHARED = ROOT.parent / "shared"
FAMILY = ("demo:0", "narrow:1", "leaning_pair:2", "three_walls:3", "impeller:4", "wavy:5")
PUBLIC = {"kj66": ("imp_kj66_compressor_wheel.step", "kj66_compressor_wheel.json"),
          "propeller": ("blade_seed_propeller.stp", "seed_propeller.json"),
          "ftc10": ("wall_nist_ftc_10_wavy.stp", "nist_ftc_10.json"),
          "diecast": ("shell_diecast_ap242.stp", "diecast_shell.json")}
SCHEMAS = {"job.stpnc": "ap238e3_aim_lf.exp", "job.arm.stpnc": "iso14649_milling.exp"}
HEAD = ("part", "walls", "connections", "zones", "state", "coverage", "brute", "of reach", "remainder mm²", "gouge mm",
        "p99 / asked mm", "seconds by stage", "p21check", "gcode_check")


@dataclass
class Job:
    """One part with its setup on disk, and the truth where it is known."""

    name: str
    part: Path
    setup: Path
    truth: dict[str, Any] = field(default_factory=dict)


class Stages:
    """Seconds by stage, from the progress of the chain: by the clock, and of the processors.

    The latter counts every thread and what other processes have been waited for; on a machine that does other work as
    well it is the one to compare.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.busy: dict[str, float] = {}
        self._stage, self._since, self._used = "", time.perf_counter(), _processor_seconds()

    def __call__(self, stage: str, _fraction: float) -> None:
        if stage != self._stage:
            now, used = time.perf_counter(), _processor_seconds()
            if self._stage:
                self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
                self.busy[self._stage] = self.busy.get(self._stage, 0.0) + used - self._used
            self._stage, self._since, self._used = stage, now, used


def _processor_seconds() -> float:
    return sum(os.times()[:4])


def family_job(name: str, folder: Path) -> Job:
    """Write a part of the family, 'recipe:seed', into a folder."""
    from examples.demo import demo_setup
    from examples.family.recipes import make_part

    recipe, seed = name.split(":")
    made = make_part(int(seed), recipe)
    step, _, setup = made.write(folder)
    if recipe == "demo":
        setup.write_text(json.dumps(demo_setup(), indent=1) + "\n")
    return Job(name, step, setup, made.truth)


def public_job(name: str, folder: Path) -> Job | None:
    """One of the public parts, None where its file is not there."""
    part, setup = PUBLIC[name]
    if not (folder / part).exists():
        print(f"{name}: {part} is not in {folder}, left out", file=sys.stderr)
        return None
    return Job(name, folder / part, ROOT / "examples" / "setups" / setup)


def judged(folder: Path) -> tuple[str, str]:
    """What the schema checker says of both STEP-NC files, and LinuxCNC's interpreter of the program.

    Returns exit codes and the number of warnings, or '-' where a judge or the file is absent.
    """
    check, gcode = SHARED / "stepnc" / "p21check.py", SHARED / "tools" / "gcode_check.sh"
    said = []
    for name, schema in SCHEMAS.items():
        if not (check.exists() and (folder / name).exists()):
            said.append("-")
            continue
        done = subprocess.run([sys.executable, str(check), "--schema", str(check.parent / "schemas" / schema),
                               "--rules", str(folder / name)], capture_output=True, text=True)
        warnings = sum(": W " in line for line in done.stdout.splitlines())
        said.append(f"{done.returncode} ({warnings} W)")
    programs = sorted(folder.glob("program*.ngc"))
    codes = [str(subprocess.run(["bash", str(gcode), str(p)], capture_output=True).returncode) for p in programs] \
        if gcode.exists() else []
    return ", ".join(said), ", ".join(codes) or "-"


def counted(found: int, truth: list[Any] | None) -> str:
    """A count, with the truth behind it where that is known: '3 of 3'."""
    return str(found) if truth is None else f"{found} of {len(truth)}"


def row(job: Job, report: dict[str, Any], brute: dict[str, Any] | None, seconds: dict[str, float],
        judges: tuple[str, str]) -> list[str]:
    """The cells of one part."""
    rest: Counter[str] = Counter()
    for item in report["remainder"]:
        rest[item["reason"]] += item["area_mm2"]
    scallops = [z["scallop_mm"] for z in report["zones"] if z["scallop_mm"]["p99"] is not None]
    kinds = ", ".join(f"{n} {k}" for k, n in sorted(report["finding_counts"].items()))
    ma = report["machinable_area_mm2"]
    by_brute = "-" if brute is None else " to ".join(
        f"{100 * brute[k]['area_mm2'] / ma:.2f} (± {100 * brute[k]['error']:.2f})" for k in ("touched", "clean")) + " %"
    p99, asked = max((s["p99"] for s in scallops), default=0.0), scallops[0]["requested"] if scallops else 0.0
    return [job.name, counted(len(report["walls"]), job.truth.get("walls")),
            counted(len(report["connections"]), job.truth.get("connections")), str(len(report["zones"])),
            report["state"] + (f": {kinds}" if kinds else ""), f"{100 * report['coverage']:.2f} %", by_brute,
            f"{100 * report['reach_coverage']:.2f} %",
            f"{sum(rest.values()):.0f}: " + ", ".join(f"{r} {a:.0f}" for r, a in rest.most_common()),
            f"{report['gouge_max_mm']:.4f}", f"{p99:.4f} / {asked:g}",
            " ".join(f"{k} {v:.0f}" for k, v in seconds.items()) + f", all {sum(seconds.values()):.0f}", *judges]


def run_job(job: Job, out: Path, with_brute: bool) -> list[str]:
    """Plan, prove, judge and compare one part."""
    from benchmarks.reach.brute_reach import reach_of_files
    from geometry.errors import CamError
    from service.from_wire import read_setup
    from service.pipeline import plan

    stages, folder = Stages(), out / job.name.replace(":", "-")
    try:
        report = plan(job.part, read_setup(job.setup), folder, stages)
    except CamError as error:
        return [job.name, *["-"] * 3, f"{error.code}: {error.message}", *["-"] * (len(HEAD) - 5)]
    (folder / "seconds.json").write_text(json.dumps(stages.seconds) + "\n")
    brute = reach_of_files(job.part, job.setup) if with_brute else None
    return row(job, report, brute, stages.seconds, judged(folder))


def isolated(name: str, args: argparse.Namespace) -> str:
    """The row of one part, made in a process of its own so that memory and compiled code of one do not help another."""
    command = [sys.executable, __file__, name, "--row", "--out", str(args.out), "--public", str(args.public)]
    done = subprocess.run(command + ["--no-brute"] * args.no_brute, stdout=subprocess.PIPE, text=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT)})
    if done.returncode == 0:
        return done.stdout.strip()
    return f"| {name} | ended with code {done.returncode} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="the chain on a list of parts as a markdown table")
    parser.add_argument("names", nargs="*", help=f"of {', '.join((*FAMILY, *PUBLIC))}; any recipe:seed will do")
    parser.add_argument("--out", type=Path, default=Path("out/parts"), help="folder for the files of each job")
    parser.add_argument("--public", type=Path, default=SHARED / "parts", help="folder of the public STEP files")
    parser.add_argument("--no-brute", action="store_true", help="leave the brute-force reach out")
    parser.add_argument("--row", action="store_true", help="one part in this process, the row alone")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    if args.row:
        name = args.names[0]
        job = public_job(name, args.public) if name in PUBLIC else family_job(name, args.out)
        if job is not None:
            print("| " + " | ".join(run_job(job, args.out, not args.no_brute)) + " |")
        return
    if unknown := [n for n in args.names if n not in PUBLIC and ":" not in n]:
        parser.error(f"no such part: {', '.join(unknown)}")
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    for name in args.names or (*FAMILY, *PUBLIC):
        if line := isolated(name, args):
            print(line, flush=True)


if __name__ == "__main__":
    main()
