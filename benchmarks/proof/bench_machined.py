"""What is left of simple blanks against closed forms: the error of the volume, of the surface, and of residuals.

Run from the root of the checkout: ``python benchmarks/proof/bench_machined.py [--steps H ...]``. The cases and their
formulas are those of ``tests/machined_cases.py``. A line of the first table is one case at one step between nodes,
over four places of the lattice: the root mean square of the error of the volume left and its largest share of the
stated bound, and how far the vertices of the surface are off the exact one. Slopes are fitted over the steps: 1
halves the error with the step, 2 quarters it. The second table is the error of residuals along exact normals, which
have no step.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from tests.convergence.test_machined import SHIFTS, near_cut, slope_of  # noqa: E402
from tests.machined_cases import CASES, Machined, wedge  # noqa: E402
from verify.surface.removal import residual_on_normals  # noqa: E402

ALL: dict[str, Callable[[], Machined]] = {**CASES, "wedge at 45 degrees": lambda: wedge(math.pi / 4)}


def solids(steps: list[float]) -> None:
    """Print the table of volumes and surfaces."""
    print(f"{'case':28s} {'step mm':>7} {'left mm³':>9} {'off mm³':>9} {'of bound':>8} {'surface mean mm':>15} "
          f"{'most/step':>9}")
    for case in (build() for build in ALL.values()):
        rows = []
        for step in steps:
            fields = [case.field(step, shift) for shift in SHIFTS]
            off = np.array([f.volume for f in fields]) - case.volume
            apart = [np.abs(case.distance(f.surface().vertices)) for f in fields]
            rows.append((float(np.sqrt((off**2).mean())), float(np.mean([a.mean() for a in apart]))))
            print(f"{case.name:28s} {step:7.3f} {case.volume:9.3f} {rows[-1][0]:9.4f} "
                  f"{np.abs(off).max() / case.volume_bound(step):8.2f} {rows[-1][1]:15.6f} "
                  f"{max(a.max() for a in apart) / step:9.2f}", flush=True)
        volume, mean = (slope_of(steps, [r[k] for r in rows]) for k in (0, 1))
        print(f"{case.name:28s} {'slope':>7} {'':9} {volume:9.2f} {'':8} {mean:15.2f}")


def heights(count: int) -> None:
    """Print the table of residuals."""
    print(f"\n{'case':28s} {'samples':>8} {'most off mm':>12} {'bound mm':>12}")
    for case in (build() for build in ALL.values()):
        p, off, normal = near_cut(case, count, np.random.default_rng(2))
        left, _ = residual_on_normals(p, normal, np.full(len(p), 5.0), case.moves, [case.tool])
        print(f"{case.name:28s} {len(p):8d} {np.abs(left - off).max():12.2e} {case.residual_bound:12.2e}")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=float, nargs="+", default=[0.8, 0.4, 0.2, 0.1])
    parser.add_argument("--samples", type=int, default=4000)
    chosen = parser.parse_args()
    solids(chosen.steps)
    heights(chosen.samples)


if __name__ == "__main__":
    main()
