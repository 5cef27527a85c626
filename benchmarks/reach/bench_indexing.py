"""What further fixed tool axes win: area in zones upright and with the axes found, how many, and seconds.

Run from the root of the checkout: ``python benchmarks/reach/bench_indexing.py [NAME ...] [--public DIR]``. Names are
those of ``parts_table.py``; without any the demo, a strut impeller and, where its folder is given, the KJ66 wheel.
Each part is taken once on a machine that keeps the accesses of its setup and once on one that looks for more (table
A/C, A -30 to 110 degrees). Areas are in mm², for what is machinable differs: with rotary axes it is all that can be
turned to.
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
from service.from_wire import read_setup  # noqa: E402
from service.report.report import accesses_of  # noqa: E402
from service.stages.preparation import Prepared, prepare  # noqa: E402

MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}


def silent(_stage: str, _fraction: float) -> None:
    """No progress."""


def prepared(job: Job, orientations: str) -> tuple[Prepared, float]:
    """A part up to its zones, and the seconds that took."""
    given = read_setup(job.setup).model_dump(mode="json", exclude_unset=True)
    given["machine"] = {**MACHINE, "orientations": orientations}
    start = time.perf_counter()
    ready = prepare(job.part, Setup.model_validate(given), silent)
    return ready, time.perf_counter() - start


def taken(ready: Prepared) -> float:
    """mm² of samples in zones."""
    return float(ready.samples.area[ready.zoning.taken].sum())


def main() -> None:
    """Print a row a part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--public", type=Path)
    args = parser.parse_args()
    names = args.names or ["demo:0", "impeller:4", *(["kj66"] if args.public else [])]
    print("| part | upright mm² | of | s | with found axes mm² | of | axes found, A C deg | s |\n|" + "---|" * 8)
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            job = public_job(name, args.public) if name in PUBLIC else family_job(name, Path(folder))
            if job is None:
                continue
            one, seconds = prepared(job, "given")
            two, more = prepared(job, "find")
            cells: list[Any] = [name, f"{taken(one):.1f}", f"{one.samples.area.sum():.1f}", f"{seconds:.1f}",
                                f"{taken(two):.1f}", f"{two.samples.area.sum():.1f}", _axes(two), f"{more:.1f}"]
            print("| " + " | ".join(cells) + " |", flush=True)


def _axes(ready: Prepared) -> str:
    return "; ".join(" ".join(f"{v:g}" for v in a["rotary_deg"]) for a in accesses_of(ready) if a["found"]) or "none"


if __name__ == "__main__":
    main()
