"""Side steps bracketed on the true measure: passes and what they leave, on the thesis's surfaces and on others.

Run from the root of the checkout: ``python benchmarks/passes/bench_scallop.py [--thesis] [--others N] [--parts
FOLDER]``; without a flag both tables. What is left is measured by ``verify.surface.removal``, which shares no code
with the planner's measure but the mesh: closed forms of straight moves on the normals of the exact surface, 0.05 mm
apart, borders included. Seconds are wall clock, one run, compiled kernels.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from benchmarks.passes.faceting import facet_deviation, steps_for_chord  # noqa: E402
from examples.family.thesis import surface as thesis_surface  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.step_import.face_surfaces import read_patches  # noqa: E402
from geometry.surfaces.nurbs import NurbsSurface  # noqa: E402
from geometry.tool_body import ToolBody  # noqa: E402
from toolpath.cutter.cutter import Cutter  # noqa: E402
from toolpath.drop_cutter import drop_cutter  # noqa: E402
from toolpath.passes.feed_direction import best_direction  # noqa: E402
from toolpath.passes.pass_family import Dragged, FinishTarget, Pass, Promise, Swath  # noqa: E402
from toolpath.passes.reach_border import beyond  # noqa: E402
from toolpath.passes.side_step import lay_out  # noqa: E402
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from zones.reach.assembly import Clearances
from zones.reach.tip_field import TipField

# Table A.1, uv 0.025: radius, scallop, then passes, tool positions and seconds on each surface
PAPER = {
    (1.5875, 0.035): {"concave": (211, 10761, 355.6), "convex": (189, 9639, 295.3), "freeform": (105, 5355, 180.6)},
    (3.175, 0.065): {"concave": (159, 8109, 615.5), "convex": (161, 8211, 268.2), "freeform": (63, 3213, 67.4)},
    (6.35, 0.130): {"concave": (83, 4233, 251.3), "convex": (83, 4233, 138.2), "freeform": (53, 2703, 35.4)},
}
SPACING = 0.05  # mm between the places that are judged
FINER = 5.0  # facets of the tree against those that are measured
APART = 0.1  # mm between samples on the other surfaces, as in a job
LIFT = 0.001  # mm within which a touch counts
COMB = 0.01  # mm between the places a brute-force search may put a pass
STEEPEST = 60.0  # degrees


@dataclass(frozen=True, eq=False)
class Case:
    """A surface seen from above, faceted, with the samples that passes are laid for."""

    surface: NurbsSurface
    tree: TriangleTree
    target: FinishTarget
    dragged: Dragged
    deviation: float


def samples_of(surface: NurbsSurface, spacing: float) -> tuple[F64, F64]:
    """Points and unit normals (n, 3), mm, on an even grid of parameters about ``spacing`` apart, borders included.

    A corner at which the surface has no normal (one of the freeform surface of the thesis) is left out.
    """
    low, high = surface.domain
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [low[0], high[1]], [high[0], high[1]]])
    coarse = [np.column_stack([np.linspace(a[0], b[0], 200), np.linspace(a[1], b[1], 200)])
              for a, b in ((corners[0], corners[1]), (corners[2], corners[3]), (corners[0], corners[2]),
                           (corners[1], corners[3]))]
    lengths = [np.linalg.norm(np.diff(surface.points(uv), axis=0), axis=1).sum() for uv in coarse]
    nu, nv = (max(2, math.ceil(max(pair) / spacing) + 1) for pair in (lengths[:2], lengths[2:]))
    uv = np.stack(np.meshgrid(np.linspace(low[0], high[0], nu), np.linspace(low[1], high[1], nv), indexing="ij"), -1)
    uv = uv.reshape(-1, 2)
    points, normals = surface.points(uv), surface.normals(uv)
    good = np.isfinite(normals).all(axis=1)
    return points[good], normals[good]


def case(surface: NurbsSurface, radius: float, scallop: float, chord: float, spacing: float) -> Case:
    """A surface made ready for a ball, samples ``spacing`` mm apart; facets within half of the chord."""
    # what facets are off falls with the square of their size: measured on larger ones, which takes seconds, not minutes
    large = steps_for_chord(surface, 0.5 * chord * FINER**2)
    deviation = facet_deviation(surface, surface.discretised(*large)).largest / FINER**2
    tree = TriangleTree(surface.discretised(large[0] / FINER, large[1] / FINER))
    points, normals = samples_of(surface, spacing)
    cutter = Cutter.ball(diameter=2.0 * radius, length=20.0)
    target = FinishTarget(points, normals, points + radius * normals - [0.0, 0.0, radius], spacing)
    return Case(surface, tree, target, Dragged(cutter, lambda xy: drop_cutter(tree, cutter, xy), tree), deviation)


def ball(radius: float) -> ToolBody:
    """A ball with a straight shank and no holder."""
    return ToolBody("T1", 1, 2.0 * radius, radius, 40.0, 2.0 * radius, 60.0, 2.0 * radius, 80.0)


def left_by(passes: list[Pass], radius: float, points: F64, normals: F64) -> F64:
    """What a ball leaves on normals (n, 3) after passes: (n,) mm, by the verifier."""
    lines = [line for p in passes for line in p.lines]
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    moves = Moves(start, end, np.ones(len(start), np.bool_), np.zeros(len(start), np.int32))
    return residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [ball(radius)])[0]


def thesis() -> None:
    """The three surfaces of the thesis, table A.1 beside ours."""
    print("thesis: ball on the exact surface, chord 0.0005 mm; paper's passes are of its own measure, feed along x")
    print(f"{'surface':9} {'R':>7} {'h':>6} {'passes':>6} {'points':>7} {'max left':>9} {'p99':>8} {'gouge':>8} "
          f"{'s':>5}   paper: {'passes':>6} {'points':>7} {'s':>6}")
    rows = [(r, h) for r, h in PAPER] + [(1.5875, 0.005)]
    for kind in ("concave", "convex", "freeform"):
        for radius, h in rows:
            c = case(thesis_surface(kind), radius, h, 0.0005, min(0.25, 0.35 * math.sqrt(8.0 * h * radius)))
            begin = time.perf_counter()
            promise = Promise(h - c.deviation, 0.0005, 0.3 * radius, 10.0)  # on the facets, to keep h on the surface
            passes = lay_out(Swath(c.dragged, c.target, promise, 0.0), subdivide=False)
            seconds = time.perf_counter() - begin
            points, normals = samples_of(c.surface, SPACING)
            left = left_by(passes, radius, points, normals)
            paper = PAPER.get((radius, h), {}).get(kind)
            told = f"{paper[0]:6d} {paper[1]:7d} {paper[2]:6.0f}" if paper else "   excessive below 0.035"
            print(f"{kind:9} {radius:7.4f} {h:6.3f} {len(passes):6d} {sum(len(q) for p in passes for q in p.lines):7d} "
                  f"{left.max():9.5f} {np.quantile(left, 0.99):8.5f} {-left.min():8.5f} {seconds:5.1f}          {told}",
                  flush=True)


def random_surface(seed: int) -> NurbsSurface:
    """A free-form surface over 24 mm by 24 mm whose steepest place leans by 20 to 60 degrees."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 8))
    g = np.linspace(0.0, 24.0, n)
    x, y = np.meshgrid(g, g, indexing="ij")
    z = rng.normal(size=(n, n))
    wanted = rng.uniform(20.0, STEEPEST)
    scale = 1.0
    for _ in range(20):
        s = NurbsSurface.from_control_points(np.stack([x, y, scale * z], -1), 4)
        normals = samples_of(s, 0.5)[1]
        lean = math.tan(math.acos(float(np.abs(normals[:, 2]).min())))
        scale *= math.tan(math.radians(wanted)) / max(lean, 1e-9)
    side = 1 if samples_of(s, 5.0)[1][0, 2] > 0.0 else -1
    return NurbsSurface.from_control_points(np.stack([x, y, scale * z], -1), 4, side=side)


def upright(surface: NurbsSurface) -> NurbsSurface | None:
    """A patch turned so that its mean normal is up; None where it leans more than STEEPEST or is small or large."""
    points, normals = samples_of(surface, 0.5)
    mean = normals.mean(axis=0)
    size = np.ptp(points, axis=0).max()
    if not 4.0 < size < 60.0 or np.linalg.norm(mean) < 0.5:
        return None
    z = mean / np.linalg.norm(mean)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    turn = np.eye(4)
    turn[:3, :3] = np.array([x, np.cross(z, x), z])
    turned = surface.moved(turn)
    lean = samples_of(turned, 0.5)[1][:, 2]
    return turned if lean.min() > math.cos(math.radians(STEEPEST)) else None


def reachable(c: Case) -> np.ndarray:
    """(n,) bool: samples the ball touches without entering the surface elsewhere, within LIFT."""
    return c.dragged.limit(np.ascontiguousarray(c.target.tips[:, :2])) <= c.target.tips[:, 2] + LIFT


def field_of(c: Case, radius: float) -> TipField:
    """Where the ball may go over the surface."""
    return TipField(c.tree, ball(radius), Clearances(), c.tree.mesh.bounds, 2.0 * radius, 0.1)


def fewest(c: Case, swath: Swath, radius: float, h: float, points: F64, normals: F64) -> int:
    """Least number of straight passes along a feed that keep h, by search over a comb of places (shortest path)."""
    tips = (points + radius * normals)[:, :2] @ swath.side
    order = np.argsort(tips)
    points, normals, tips = points[order], normals[order], tips[order]
    places = np.arange(tips[0] - 0.5 * radius, tips[-1] + 0.5 * radius, COMB)
    envelope: dict[int, object] = {}

    def over(k: int, a: int, b: int) -> F64:
        if k not in envelope:
            envelope[k] = swath.envelope(swath.pass_at(float(places[k]), 1.0))
        return envelope[k].along(points[a:b], normals[a:b])  # type: ignore[attr-defined]

    # what two passes leave grows with their distance: from each, the farthest next one, by halving
    count, at = 0, -1
    while True:
        lo, hi = at, len(places)
        first = int(np.searchsorted(tips, places[at])) if at >= 0 else 0
        if at >= 0 and float(over(at, first, len(tips)).max(initial=0.0)) <= h:
            return count
        while hi - lo > 1:
            mid = (lo + hi) // 2
            last = int(np.searchsorted(tips, places[mid]))
            left = over(mid, first, last)
            if at >= 0:
                left = np.minimum(left, over(at, first, last))
            lo, hi = (mid, hi) if float(left.max(initial=0.0)) <= h else (lo, mid)
        at, count = max(lo, at + 1), count + 1


def others(count: int, folder: Path | None) -> None:
    """Free-form surfaces: the promise, and on five of them the least number of passes a search finds."""
    print("others: ball R 2, h 0.01, chord 0.001, best direction searched; places the ball can touch")
    print(f"{'surface':22} {'steepest':>8} {'feed':>5} {'passes':>6} {'least':>5} {'max left':>9} {'p99':>8} "
          f"{'gouge':>8} {'facets off':>10} {'s':>5}")
    radius, h, chord = 2.0, 0.01, 0.001
    surfaces = [(f"random {seed}", random_surface(seed)) for seed in range(count)]
    if folder is not None:
        for name in ("propeller", "wheel", "ftc"):
            for path in sorted(p for p in folder.glob("**/*.st*p") if name in p.name.lower())[:1]:
                for number, patch in sorted(read_patches(path).items()):
                    turned = upright(patch.surface)
                    if turned is not None and patch.surface.orders != (2, 2) and sum(
                            s[0].startswith(path.stem[:12]) for s in surfaces) < 3:
                        surfaces.append((f"{path.stem[:12]} F{number}", turned))
    for k, (name, surface) in enumerate(surfaces):
        c = case(surface, radius, h, chord, APART)
        target = c.target.subset(np.flatnonzero(reachable(c)))
        if len(target.points) < 0.2 * len(c.target.points):
            print(f"{name:22} the ball touches {len(target.points)} of {len(c.target.points)} samples: left out")
            continue
        target = target.joined(beyond(field_of(c, radius), target, LIFT))
        promise = Promise(h - c.deviation, chord, 0.3 * radius, 10.0)  # as above
        begin = time.perf_counter()
        swath = Swath(c.dragged, target, promise, best_direction(c.dragged, target, promise))
        passes = lay_out(swath, subdivide=False)
        seconds = time.perf_counter() - begin
        points, normals = samples_of(surface, SPACING)
        tips = points + radius * normals - [0.0, 0.0, radius]
        free = c.dragged.limit(np.ascontiguousarray(tips[:, :2])) <= tips[:, 2] + LIFT
        points, normals = points[free], normals[free]
        left = left_by(passes, radius, points, normals)
        least = str(fewest(c, swath, radius, h, points, normals)) if k < 5 else ""
        steepest = np.degrees(np.arccos(normals[:, 2].min()))
        print(f"{name:22} {steepest:8.1f} {np.degrees(swath.angle):5.0f} {len(passes):6d} {least:>5} "
              f"{left.max():9.5f} {np.quantile(left, 0.99):8.5f} {-left.min():8.5f} {c.deviation:10.5f} {seconds:5.1f}",
              flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--thesis", action="store_true", help="only the thesis's surfaces")
    parser.add_argument("--others", type=int, default=None, metavar="N", help="only the others, N random ones")
    parser.add_argument("--parts", type=Path, default=None, help="folder with STEP parts, for faces of those")
    args = parser.parse_args()
    if args.others is None:
        thesis()
    if not args.thesis:
        others(16 if args.others is None else args.others, args.parts)


if __name__ == "__main__":
    main()
