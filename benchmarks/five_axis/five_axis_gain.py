"""What rotary axes win on a part: coverage, metres and minutes upright, with fixed further axes, and all five moving.

Run from the root of the checkout: ``python benchmarks/five_axis/five_axis_gain.py [NAME ...] [--public DIR]``. Names
are those of ``parts_table.py``; without any the demo, a strut impeller and, where its folder is given, the KJ66
wheel. Each is planned and proved three times on a table A/C (A -30 to 110 degrees): with the accesses of its setup
alone, with further axes found, and with these and passes whose axis moves. The tools, the scallop and the proof are
the same.

Walls are the zones of form steep: their area, the way and the time of their finish. Areas are in mm² of what lies in
zones, for what is machinable differs. Roughing is told apart: it is not what is compared.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.jobs.parts_table import PUBLIC, Job, family_job, public_job  # noqa: E402
from schemas.setup import Setup  # noqa: E402
from service import pipeline  # noqa: E402
from service.from_wire import read_setup  # noqa: E402

MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}
KINDS: dict[str, dict[str, Any]] = {"upright": {"orientations": "given", "simultaneous": False},
                                    "3+2": {"simultaneous": False}, "five": {}}
HEAD = ("part", "axes", "state", "further", "zones mm²", "of reach", "left mm²", "walls mm²", "m", "min",
        "by flank mm²", "all finishing m", "min", "roughing min", "gouge mm", "s")


def silent(_stage: str, _share: float) -> None:
    """No progress."""


def row(name: str, kind: str, job: Job, out: Path) -> list[str]:
    """Plan and prove a part on one kind of machine."""
    given = read_setup(job.setup).model_dump(mode="json", exclude_unset=True)
    given["machine"] = {**MACHINE, **KINDS[kind]}
    begun = time.perf_counter()
    report = pipeline.plan(job.part, Setup.model_validate(given), out, silent)
    seconds = time.perf_counter() - begun
    steps: dict[str, dict[str, Any]] = {s["id"]: s for s in report["steps"]}
    zones = report["zones"]
    walls = [z for z in zones if z["form"] == "steep"]

    def way(some: list[dict[str, Any]]) -> list[str]:
        own = [steps[s] for z in some for s in z["steps"]]
        return [f"{1e-3 * sum(s['cutting_length_mm'] for s in own):.2f}",
                f"{sum(s['machining_time_s'] for s in own) / 60.0:.1f}"]

    def area(some: list[dict[str, Any]]) -> str:
        return f"{sum(z['area_mm2'] for z in some):.0f}"

    roughing = sum(s["machining_time_s"] for s in steps.values() if s["operation"] == "roughing")
    return [name, kind, report["state"], str(len({z["access"] for z in zones}) - 1), area(zones),
            f"{100.0 * report['reach_coverage']:.2f} %", f"{sum(x['area_mm2'] for x in report['remainder']):.0f}",
            area(walls), *way(walls), area([z for z in walls if z["strategy"] == "flank"]), *way(zones),
            f"{roughing / 60.0:.1f}", f"{report['gouge_max_mm']:.4f}", f"{seconds:.0f}"]


def main() -> None:
    """Print three rows a part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--public", type=Path)
    args = parser.parse_args()
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD), flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in args.names or ["demo:0", "impeller:4", *(["kj66"] if args.public else [])]:
            folder = Path(scratch)
            job = public_job(name, args.public) if name in PUBLIC else family_job(name, folder)
            if job is None:
                print(f"{name} is not there", file=sys.stderr)
                continue
            for kind in KINDS:
                print("| " + " | ".join(row(name, kind, job, folder / f"{name.replace(':', '-')}-{kind}")) + " |",
                      flush=True)


if __name__ == "__main__":
    main()
