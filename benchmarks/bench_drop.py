"""Drop and blocked queries: microseconds a point, and the ratio to opencamlib's BatchDropCutter.

Run from the root of the checkout: ``python benchmarks/bench_drop.py [--quick]``. Times are wall clock, the best
of several runs, in one process; the peer runs on the same points, fewer of them, with as many threads.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numba  # noqa: E402
import numpy as np  # noqa: E402

from geometry.bvh import TriangleTree  # noqa: E402
from geometry.drop import blocked_many, drop_tips  # noqa: E402
from geometry.mesh import TriangleMesh  # noqa: E402

CELLS = (20, 80, 400)
CUTTERS = {"ball R 3.175": (3.175, 3.175), "ball R 0.5": (0.5, 0.5), "flat R 3.175": (3.175, 0.0),
           "bull R 3.175 r 1": (3.175, 1.0)}
PEER_POINTS = {20: 4000, 80: 1000, 400: 60}


def surface(cells: int, size: float = 100.0) -> TriangleMesh:
    """A wavy field of size x size mm with 2 cells^2 facets."""
    g = np.linspace(0.0, size, cells + 1)
    x, y = np.meshgrid(g, g)
    z = 5.0 * np.sin(x / 12.0) + 4.0 * np.cos(y / 9.0) + 0.05 * x
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = [np.stack([i, i + 1, i + cells + 2], 1), np.stack([i, i + cells + 2, i + cells + 1], 1)]
    return TriangleMesh(np.stack([x, y, z], -1).reshape(-1, 3), np.concatenate(faces))


def best_of(call: Callable[[], object], runs: int = 5) -> float:
    """Shortest of several runs, s; one more before them warms up."""
    call()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def peer(mesh: TriangleMesh, radius: float, corner: float, xy: np.ndarray, threads: int) -> tuple[float, np.ndarray]:
    """Seconds and tip heights of opencamlib."""
    import opencamlib as ocl

    stl = ocl.STLSurf()
    for t in mesh.triangles.tolist():
        stl.addTriangle(ocl.Triangle(*(ocl.Point(*p) for p in t)))
    if corner == radius:
        cutter = ocl.BallCutter(2 * radius, 100.0)
    else:
        cutter = ocl.BullCutter(2 * radius, corner, 100.0) if corner else ocl.CylCutter(2 * radius, 100.0)
    batch = ocl.BatchDropCutter()
    batch.setSTL(stl)
    batch.setCutter(cutter)
    batch.setThreads(threads)
    for x, y in xy.tolist():
        batch.appendPoint(ocl.CLPoint(x, y, -1000.0))
    start = time.perf_counter()
    batch.run()
    return time.perf_counter() - start, np.array([p.z for p in batch.getCLPoints()])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="no peer, for a look at our own figures")
    quick = parser.parse_args().quick
    if not quick:
        try:
            import opencamlib  # noqa: F401
        except ImportError:
            print("opencamlib is not installed: no peer column")
            quick = True
    rng = np.random.default_rng(1)
    n = 20_000
    scattered = 2.0 + 96.0 * rng.random((n, 2))
    k = np.arange(n)
    path = np.column_stack([2.0 + (k % 500) * 0.19, 2.0 + (k // 500) * 2.4])
    print("µs a point; blocked: tip 1 mm below / at / 1 mm above the surface; peer and ratio on scattered points")
    print(f"{'facets':>7} {'cutter':17} {'threads':>7} {'scattered':>9} {'path':>6} {'blocked':>19} {'peer':>9} "
          f"{'ratio':>7} {'max diff mm':>11}")
    TriangleTree(surface(2))  # compile before the first build is timed
    for cells in CELLS:
        mesh = surface(cells)
        start = time.perf_counter()
        tree = TriangleTree(mesh)
        build = time.perf_counter() - start
        for name, (radius, corner) in CUTTERS.items():
            for threads in sorted({1, min(2, numba.config.NUMBA_NUM_THREADS)}):
                numba.set_num_threads(threads)
                tips = drop_tips(tree, scattered, radius, corner)
                ours = best_of(lambda: drop_tips(tree, scattered, radius, corner)) / n * 1e6  # noqa: B023
                along = best_of(lambda: drop_tips(tree, path, radius, corner)) / n * 1e6  # noqa: B023
                blocked = []
                for shift in (-1.0, 0.0, 1.0):
                    at = np.column_stack([scattered, tips + shift])
                    blocked.append(best_of(lambda: blocked_many(tree, at, radius, corner)) / n * 1e6)  # noqa: B023
                row = f"{len(mesh.faces):7d} {name:17} {threads:7d} {ours:9.2f} {along:6.2f} " + \
                    f"{' / '.join(f'{b:.2f}' for b in blocked):>19}"
                if not quick:
                    few = scattered[: PEER_POINTS[cells]]
                    seconds, z = peer(mesh, radius, corner, few, threads)
                    theirs = seconds / len(few) * 1e6
                    row += f" {theirs:9.1f} {theirs / ours:7.0f} {np.abs(tips[: len(few)] - z).max():11.1e}"
                print(row, flush=True)
        print(f"{len(mesh.faces):7d} hierarchy built in {build * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
