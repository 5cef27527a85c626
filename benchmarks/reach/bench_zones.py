"""Seconds of ``zonemill zones`` against the number of faces, up to ten walls and sixteen connections.

Run from the root of the checkout: ``python benchmarks/reach/bench_zones.py [--out DIR]``. Parts of recipe ``random``
of the family, each the first seed that has as many connections as asked for; every part in a process of its own with
compiled kernels, as a user meets it, start-up and reading included, the better of two runs. Wall clock and processor
time of the process; the exponent is the slope of a straight line through log time against log faces.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from examples.family.recipes import FamilyPart, make_part  # noqa: E402

SIZES = ((2, 1), (3, 3), (4, 5), (6, 9), (8, 12), (10, 16))
SEEDS = 60


def part_with(walls: int, connections: int) -> FamilyPart:
    """The first part of the recipe with exactly so many walls and connections."""
    from examples.family.layout import LayoutError

    for seed in range(SEEDS):
        try:
            part = make_part(seed, "random", walls=walls, connections=connections)
        except LayoutError:
            continue
        if len(part.truth["connections"]) == connections:
            return part
    raise SystemExit(f"none of {SEEDS} seeds gives {walls} walls with {connections} connections")


def timed(step: Path, setup: Path) -> tuple[float, float, dict[str, Any]]:
    """Wall clock and processor seconds of one run, and the zones it gives."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([str(Path(sys.executable).with_name("zonemill")), "zones", str(step), "--setup", str(setup),
                           "--json"], capture_output=True, text=True)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(done.stderr)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, cpu, json.loads(done.stdout)


def main() -> None:
    """Print a line a part and the exponents."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=None, help="keep the parts here")
    args = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = args.out or Path(scratch)
        for walls, connections in SIZES:
            part = part_with(walls, connections)
            step, _, setup = part.write(folder / f"{walls}-{connections}")
            wall, cpu, zones = min((timed(step, setup) for _ in range(2)), key=lambda r: r[0])
            counts = len(zones["walls"]), len(zones["connections"]), len(zones["zones"])
            faces = zones["part"]["faces"]
            rows.append((faces, wall, cpu))
            print(f"{part.name:10} {walls:3} walls {connections:3} connections, found {counts[0]} and {counts[1]}, "
                  f"{faces:4} faces {counts[2]:3} zones  {wall:6.1f} s  {cpu:6.1f} s of processor", flush=True)
    table = np.log(np.array(rows))
    for name, column in (("wall clock", 1), ("processor", 2)):
        print(f"exponent over faces, {name}: {np.polyfit(table[:, 0], table[:, column], 1)[0]:.2f}")


if __name__ == "__main__":
    main()
