"""Drop heights against opencamlib: ball, flat, bull and tapered on five meshes, every larger difference judged.

Run from the root of the checkout: ``python benchmarks/kernels/bench_heights.py [--seconds S] [--points N]``. Ours
runs on all points; the peer on as many of them, from the first on, as it gets through in S seconds a line (it says
how many). Where the two differ by more than 1e-6 mm, the height of the lower one is put to the test without either
kernel: does some point of the mesh stand inside the cutter there? For ours the point is looked for in every triangle
under the cutter.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from geometry.mesh import TriangleMesh  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.mesh_queries.revolved_outline import Outline, heights  # noqa: E402
from toolpath.cutter.cutter import Cutter  # noqa: E402
from toolpath.drop_cutter import drop_contacts, drop_cutter  # noqa: E402

from surfaces import convex, impeller, slivers, walls, wavy  # noqa: E402 isort:skip

MESHES = {"smooth": lambda: convex(80), "walls": walls, "slivers": slivers, "impeller": impeller,
          "a million": lambda: wavy(708, 50.0)}
CUTTERS = {"ball": Cutter.ball(diameter=6.0, length=30.0), "flat": Cutter.flat(diameter=6.0, length=30.0),
           "bull": Cutter.bull(diameter=6.0, corner_radius=1.0, length=30.0),
           "tapered": Cutter.tapered(diameter=6.0, tip_diameter=1.0, angle_deg=5.0, length=30.0)}
SAME = 1e-6  # mm
EMPTY = -1000.0
CHUNK = 50


def peer_heights(mesh: TriangleMesh, name: str, xy: np.ndarray, seconds: float) -> np.ndarray:
    """Heights by opencamlib, from the first point on, as many as it gets through in time."""
    import opencamlib as ocl

    surface = ocl.STLSurf()
    for t in mesh.triangles.tolist():
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*p) for p in t)))
    cutter = {"ball": lambda: ocl.BallCutter(6.0, 100.0), "flat": lambda: ocl.CylCutter(6.0, 100.0),
              "bull": lambda: ocl.BullCutter(6.0, 1.0, 100.0),
              "tapered": lambda: ocl.BallConeCutter(1.0, 6.0, math.radians(5.0))}[name]()
    out: list[float] = []
    start, chunk = time.perf_counter(), CHUNK
    while len(out) < len(xy) and time.perf_counter() - start < seconds:
        batch = ocl.BatchDropCutter()  # does not keep the cutter alive: the name above does
        batch.setSTL(surface)
        batch.setCutter(cutter)
        began = time.perf_counter()
        for x, y in xy[len(out):len(out) + chunk].tolist():
            batch.appendPoint(ocl.CLPoint(x, y, EMPTY))
        batch.run()
        out += [p.z for p in batch.getCLPoints()]
        # its tree is built anew for each batch
        left = seconds - (time.perf_counter() - start)
        chunk = max(CHUNK, int(0.8 * left / (time.perf_counter() - began) * chunk))
    return np.array(out)


def lift(outline: Outline, p: np.ndarray, x: float, y: float) -> np.ndarray:
    """What points (..., 3) ask for, by the heights of the outline alone."""
    stack, rho = outline.stack, np.hypot(p[..., 0] - x, p[..., 1] - y)
    best = np.full(rho.shape, -np.inf)
    for k, up in enumerate(stack.offset):
        rows = stack.rows[stack.first[k]:stack.first[k + 1]]
        f = np.where(rho < rows[-1, 1], p[..., 2] - heights(rows, np.minimum(rho, rows[-1, 1])) - up, -np.inf)
        best = np.maximum(best, f)
    return best


def searched(triangles: np.ndarray, outline: Outline, x: float, y: float) -> float:
    """Highest point of a mesh against the outline, by grids over each triangle that shrink round their best."""
    r = outline.radius
    lo, hi = triangles.min(axis=1), triangles.max(axis=1)
    t = triangles[(lo[:, 0] < x + r) & (hi[:, 0] > x - r) & (lo[:, 1] < y + r) & (hi[:, 1] > y - r)]
    g = np.linspace(0.0, 1.0, 13)
    a, b = (w.ravel() for w in np.meshgrid(g, g, indexing="ij"))
    middle, size, best = np.full((len(t), 2), 0.5), 1.0, np.full(len(t), -np.inf)
    for _ in range(40):
        u = np.clip(middle[:, :1] + (a - 0.5) * size, 0.0, 1.0)
        v = np.minimum(np.clip(middle[:, 1:] + (b - 0.5) * size, 0.0, 1.0), 1.0 - u)
        p = t[:, None, 0] + u[..., None] * (t[:, 1] - t[:, 0])[:, None] + v[..., None] * (t[:, 2] - t[:, 0])[:, None]
        f = lift(outline, p, x, y)
        k, row = f.argmax(axis=1), np.arange(len(t))
        better = f[row, k] >= best
        best = np.maximum(best, f[row, k])
        middle[better] = np.stack([u[row, k], v[row, k]], axis=1)[better]
        size *= 0.6
    return float(best.max(initial=-np.inf))


def on_mesh(mesh: TriangleMesh, triangle: int, p: np.ndarray) -> bool:
    """Whether a point lies on a triangle to 1e-9 mm: no farther from its three corners' hull."""
    t = mesh.triangles[triangle]
    w = np.linalg.lstsq(np.vstack([t.T, np.ones(3)]), np.append(p, 1.0), rcond=None)[0].clip(0.0)
    near = np.linalg.norm((w / w.sum()) @ t - p) < 1e-9
    edges = [(t[i], t[i - 1] - t[i]) for i in range(3)]
    return bool(near or any(np.linalg.norm(a + min(max((p - a) @ e / max(e @ e, 1e-300), 0.0), 1.0) * e - p) < 1e-9
                            for a, e in edges))


def judged(mesh: TriangleMesh, outline: Outline, xy: np.ndarray, ours: np.ndarray, theirs: np.ndarray,
           points: np.ndarray, triangle: np.ndarray, most: int = 200) -> Counter[str]:
    """Verdicts on what differs: at most ``most`` of the points at which the peer is higher, all the others."""
    verdicts: Counter[str] = Counter()
    for k in np.flatnonzero(ours > theirs + SAME):
        p = points[k]
        inner = p + 1e-10 * np.array([xy[k, 0] - p[0], xy[k, 1] - p[1], 0.0])  # at the rim: from just inside
        stands = float(lift(outline, inner[None], *xy[k])[0]) > theirs[k] + 0.5 * (ours[k] - theirs[k])
        verdicts["peer enters the mesh" if stands and on_mesh(mesh, triangle[k], p) else "OURS TOO HIGH?"] += 1
    higher = np.flatnonzero(theirs > ours + SAME)
    for k in higher[:most]:
        found = searched(mesh.triangles, outline, *xy[k])
        verdicts["OURS ENTERS" if found > ours[k] + 0.1 * (theirs[k] - ours[k]) else "peer higher than needed"] += 1
    if len(higher) > most:
        verdicts["peer higher, not judged"] = len(higher) - most
    return verdicts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="for the peer, a line")
    parser.add_argument("--points", type=int, default=100_000)
    chosen = parser.parse_args()
    try:
        import opencamlib  # noqa: F401
    except ImportError:
        print("opencamlib is not installed: nothing to compare with")
        return
    print(f"{'mesh':10} {'facets':>8} {'cutter':8} {'points':>7} {'µs':>6} {'peer on':>7} {'max diff mm':>11} "
          f"{'> 1e-6':>6}  verdicts")
    for mesh_name, made in MESHES.items():
        mesh = made()
        tree = TriangleTree(mesh)
        lo, hi = mesh.bounds[:, :2]
        xy = lo - 2.0 + np.random.default_rng(11).random((chosen.points, 2)) * (hi - lo + 4.0)
        for name, cutter in CUTTERS.items():
            drop_cutter(tree, cutter, xy[:10])
            start = time.perf_counter()
            tips = np.maximum(drop_cutter(tree, cutter, xy), EMPTY)
            took = (time.perf_counter() - start) / len(xy) * 1e6
            theirs = peer_heights(mesh, name, xy, chosen.seconds)
            n = len(theirs)
            ours, got = tips[:n], drop_contacts(tree, cutter, xy[:n])
            outline = cutter.outline or Outline.bull(cutter.radius, cutter.corner_radius)
            verdicts = judged(mesh, outline, xy, ours, theirs, got.point, got.triangle)
            diff = np.abs(ours - theirs)
            words = ", ".join(f"{v} {k}" for k, v in sorted(verdicts.items()))
            print(f"{mesh_name:10} {len(mesh.faces):8d} {name:8} {len(xy):7d} {took:6.2f} {n:7d} {diff.max():11.1e} "
                  f"{(diff > SAME).sum():6d}  {words}", flush=True)


if __name__ == "__main__":
    main()
