"""Trapezoidal map: seconds of noding and building, look-up depth and time, against n ln n and ln n.

Run from the root of the checkout: ``python benchmarks/kernels/bench_trapezoids.py [--quick]``. One process, one
thread, wall clock, the best of several runs (n = 1e3 many, n = 1e5 few). "kernel" is ``build_map`` alone, in the
order the product uses; "shuffled" the same in a plain random permutation; "map" everything from the noding to the
numbered trapezoids.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from tests.noded_segments import take_noded  # noqa: E402
from zones.kernels.trapezoid import DONE, build_map  # noqa: E402
from zones.plan_view.snap_rounding import node_segments  # noqa: E402
from zones.plan_view.trapezoidal_map import TrapezoidMap, insertion_order  # noqa: E402

LOOK_UPS = 10_000
RUNS = {1_000: 40, 10_000: 10, 100_000: 5}


def short(n: int, rng: np.random.Generator) -> np.ndarray:
    """One segment in each cell of a square lattice of 1 mm; none meet."""
    side = int(np.ceil(np.sqrt(n)))
    cell = np.column_stack([np.arange(n) % side, np.arange(n) // side])[:, None] * 1.0
    return cell + rng.uniform(0.02, 0.98, (n, 2, 2))


def long(n: int, rng: np.random.Generator) -> np.ndarray:
    """Long, nearly parallel segments over random stretches of 1 m, each in a slanting band of its own; none meet."""
    x = rng.uniform(0.0, 1000.0, (n, 2))
    y = (np.arange(n)[:, None] + rng.uniform(0.1, 0.9, (n, 2))) * 0.1
    return np.stack([x, y + 0.3 * x], axis=2)


def best_of(call: Callable[[int], object], runs: int) -> float:
    """Shortest of several runs, s; the call gets the number of the run."""
    times = []
    for k in range(runs):
        start = time.perf_counter()
        call(k)
        times.append(time.perf_counter() - start)
    return min(times)


def kernel_seconds(plan: TrapezoidMap, runs: int, brio: bool) -> float:
    """Shortest ``build_map``, s, over as many seeds; brio: the order of the product, else a plain permutation."""
    n = len(plan.pieces) - 2
    best = np.inf
    for seed in range(runs):
        order = insertion_order(plan.points, plan.pieces[:n], seed) if brio else \
            np.random.default_rng(seed).permutation(n)
        pieces = np.concatenate([plan.pieces[:n][order], plan.pieces[n:]])
        start = time.perf_counter()
        state = build_map(plan.points, pieces)[0]
        best = min(best, time.perf_counter() - start)
        if state != DONE:
            raise SystemExit("the pieces meet")
    return best


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="without n = 1e5")
    quick = parser.parse_args().quick
    rng = np.random.default_rng(1)
    TrapezoidMap.of(short(10, rng)).locate([[0.0, 0.0]])  # compile before the first is timed
    print("s; rate: ns of kernel time over n ln n, ratio to n = 1000; depth over ln n of 1e4 look-ups; ns a look-up")
    print(f"{'segments':9} {'n':>7} {'noding':>8} {'kernel':>8} {'shuffled':>8} {'map':>8} {'faces':>8} {'rate':>6} "
          f"{'ratio':>6} {'shuf.':>6} {'mean':>6} {'longest':>7} {'look-up':>7}")
    for name, make in (("short", short), ("long", long)):
        first: tuple[float, float] | None = None
        for n, runs in RUNS.items():
            if quick and n > 10_000:
                continue
            segments = make(n, rng)
            noding = best_of(lambda k: node_segments(segments, 1e-3), 1 if n > 10_000 else 3)  # noqa: B023
            noded = take_noded(segments, 1e-3)
            whole = best_of(lambda k: TrapezoidMap.of_noding(noded, seed=k), runs)  # noqa: B023
            plan = TrapezoidMap.of_noding(noded)
            kernel, shuffled = kernel_seconds(plan, runs, True), kernel_seconds(plan, runs, False)
            faces = best_of(lambda k: plan.faces(), 3)  # noqa: B023
            low, high = plan.points[0] * 1e-3, plan.points[-1] * 1e-3
            points = rng.uniform(low, high, (LOOK_UPS, 2))
            depth = plan.look_up(points)[1]
            look_up = best_of(lambda k: plan.locate(points), 5) / LOOK_UPS * 1e9  # noqa: B023
            size = n * np.log(n)
            first = first or (kernel, shuffled)
            ratio = [t / size / (f / (1000 * np.log(1000))) for t, f in zip((kernel, shuffled), first, strict=True)]
            print(f"{name:9} {n:7d} {noding:8.4f} {kernel:8.4f} {shuffled:8.4f} {whole:8.4f} {faces:8.4f} "
                  f"{kernel / size * 1e9:6.1f} {ratio[0]:6.2f} {ratio[1]:6.2f} {depth.mean() / np.log(n):6.2f} "
                  f"{depth.max() / np.log(n):7.2f} {look_up:7.0f}", flush=True)


if __name__ == "__main__":
    main()
