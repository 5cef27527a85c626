"""Drop and blocked queries: microseconds a point, and the ratio to opencamlib's BatchDropCutter.

Run from the root of the checkout: ``python benchmarks/kernels/bench_drop.py [--quick] [--convex]``. Times are wall
clock, the best of several runs, in one process; the peer runs on the same points, fewer of them, with as many
threads. First the thesis' convex surface under a ball of R 3.175 at 251,001 points (--convex: that alone), then a
wavy field.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numba  # noqa: E402
import numpy as np  # noqa: E402

from geometry.mesh import TriangleMesh  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.mesh_queries.drop import blocked_many, drop_tips  # noqa: E402

from surfaces import convex, wavy  # noqa: E402 isort:skip

CELLS = (20, 80, 400)
CUTTERS = {"ball R 3.175": (3.175, 3.175), "ball R 0.5": (0.5, 0.5), "flat R 3.175": (3.175, 0.0),
           "bull R 3.175 r 1": (3.175, 1.0)}
BALL = 3.175
CONVEX = (20, 80, 400, 1000)
PEER_CONVEX = {20: 20_000, 80: 2000, 400: 100}
BREP_CAM = {80: 211.0, 400: 1232.0}  # µs a point
PEER_POINTS = {20: 4000, 80: 1000, 400: 60}


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


def lattice() -> np.ndarray:
    """251,001 points over the convex surface."""
    g = np.linspace(0.0, 50.0, 501)
    return np.stack(np.meshgrid(g, g), -1).reshape(-1, 2)


def memory_at(cells: int) -> float:
    """Most memory of a process that meshes the convex surface and drops on it, GiB."""
    code = ("import resource, bench_drop as b\n"
            f"b.drop_tips(b.TriangleTree(b.convex({cells})), b.lattice(), b.BALL, b.BALL)\n"
            "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)")
    run = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True,
                         check=True)
    return int(run.stdout) / 2**20


def on_convex(quick: bool) -> None:
    """The convex surface: ours on one thread and two, the peer, and what grows with the facets."""
    memory = memory_at(1000)  # before this process grows: a child begins with its parent's figure
    xy = lattice()
    shuffled = np.random.default_rng(0).permutation(xy)
    both = min(2, numba.config.NUMBA_NUM_THREADS)
    trees = {cells: TriangleTree(convex(cells)) for cells in CONVEX}
    # one turn of all meshes after the other, so that a busy machine is busy for all of them
    times = {key: np.inf for key in [(c, t, k) for c in CONVEX for t in {1, both} for k in range(2)]}
    for turn in range(4):
        for (cells, threads, kind), best in times.items():
            numba.set_num_threads(threads)
            start = time.perf_counter()
            drop_tips(trees[cells], (xy, shuffled)[kind], BALL, BALL)
            if turn:
                times[cells, threads, kind] = min(best, (time.perf_counter() - start) / len(xy) * 1e6)
    print(f"convex surface of the thesis, ball R {BALL}, {len(xy)} points in rows / shuffled, µs a point; "
          "BREP_cam 0.1.0 as measured once, one thread")
    print(f"{'facets':>8} {'1 thread':>13} {f'{both} threads':>13} {'peer':>9} {'ratio':>7} {'points':>6} "
          f"{'max diff mm':>11} {'BREP_cam':>8} {'ratio':>6}")
    for cells, tree in trees.items():
        one, two = ([times[cells, t, k] for k in range(2)] for t in (1, both))
        row = f"{len(tree):8d} {one[0]:6.2f}/{one[1]:6.2f} {two[0]:6.2f}/{two[1]:6.2f}"
        n = PEER_CONVEX.get(cells, 0)
        if n and not quick:
            numba.set_num_threads(both)
            few = shuffled[:n]
            seconds, z = peer(tree.mesh, BALL, BALL, few, both)
            theirs = seconds / n * 1e6
            diff = np.abs(drop_tips(tree, few, BALL, BALL) - z).max()
            row += f" {theirs:9.1f} {theirs / two[0]:7.0f} {n:6d} {diff:11.1e}"
        else:
            row += " " * 37
        if cells in BREP_CAM:
            row += f" {BREP_CAM[cells]:8.0f} {BREP_CAM[cells] / one[0]:6.0f}"
        print(row, flush=True)
    for kind, name in enumerate(("in rows", "shuffled")):
        a, b = times[400, 1, kind], times[20, 1, kind]
        print(f"320,000 facets over 800, one thread, {name}: {a / b:.2f}")
    print(f"most memory at 2,000,000 facets: {memory:.2f} GiB", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="no peer, for a look at our own figures")
    parser.add_argument("--convex", action="store_true", help="the convex surface alone")
    chosen = parser.parse_args()
    quick = chosen.quick
    if not quick:
        try:
            import opencamlib  # noqa: F401
        except ImportError:
            print("opencamlib is not installed: no peer column")
            quick = True
    on_convex(quick)
    if chosen.convex:
        return
    rng = np.random.default_rng(1)
    n = 20_000
    scattered = 2.0 + 96.0 * rng.random((n, 2))
    k = np.arange(n)
    path = np.column_stack([2.0 + (k % 500) * 0.19, 2.0 + (k // 500) * 2.4])
    print("µs a point; blocked: tip 1 mm below / at / 1 mm above the surface; peer and ratio on scattered points")
    print(f"{'facets':>7} {'cutter':17} {'threads':>7} {'scattered':>9} {'path':>6} {'blocked':>19} {'peer':>9} "
          f"{'ratio':>7} {'max diff mm':>11}")
    TriangleTree(wavy(2))  # compile before the first build is timed
    for cells in CELLS:
        mesh = wavy(cells)
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
