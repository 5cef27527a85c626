"""Estimates of jobs beside what the jobs take: memory of all processes at the peak, and processor seconds.

    python benchmarks/jobs/estimates.py PART.step=SETUP.json [...] [--zones]

Each part is planned and proved by the command line in a process of its own, one after the other. With ``--zones`` it is
the dry check. The table in docs/scale.md was made so. Processor seconds of a busy machine are up to a fifth more than
those of an idle one.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from geometry.child_process import Family

ROOT = Path(__file__).resolve().parents[2]
SENTENCE = re.compile(r"estimate: (\d+) MB of memory, (\d+) s of processor")
EVERY_S = 0.5


def measured(part: str, setup: str, what: str, folder: Path) -> str:
    """One job: its line of the table."""
    command = [sys.executable, "-m", "service.cli", what, part, "--setup", setup]
    command += ["--out", str(folder / "out")] if what == "plan" else []
    with (folder / "said").open("w+") as said:
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said, cwd=ROOT)
        family, peak = Family(child.pid), 0
        while not (ended := os.wait4(child.pid, os.WNOHANG))[0]:
            peak = max(peak, family.resident())
            time.sleep(EVERY_S)
        said.seek(0)
        found = SENTENCE.search(said.read())
    seconds, memory = ended[2].ru_utime + ended[2].ru_stime, peak / 1e6
    if found is None:
        return f"| {Path(part).stem} | no estimate | {memory:.0f} | | | {seconds:.0f} | |"
    guess, time_s = int(found[1]), int(found[2])
    return (f"| {Path(part).stem} | {guess} | {memory:.0f} | {guess / memory - 1.0:+.0%} | {time_s} | {seconds:.0f} "
            f"| {time_s / seconds:.2f} |")


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("jobs", nargs="+", metavar="PART.step=SETUP.json")
    parser.add_argument("--zones", action="store_true")
    given = parser.parse_args()
    print("| part | estimate MB | measured MB | off | estimate s | measured s | ratio |\n|---|---|---|---|---|---|---|")
    for job in given.jobs:
        part, _, setup = job.partition("=")
        with tempfile.TemporaryDirectory() as folder:
            print(measured(part, setup, "zones" if given.zones else "plan", Path(folder)), flush=True)


if __name__ == "__main__":
    main()
