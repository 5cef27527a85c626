"""Channels in plan: strips that rays sweep from one wall to the next.

From points along each side of a wall, cut at mid height, level rays go out. They pass through connections, fillets and
slivers. A run of neighbouring rays that meet one other wall is a strip of a channel. Its first and last ray are its
ends, and the middles of its rays form the centre line. Where a connection, or a hole no longer than the width of the
channel, interrupts a wall, the strip continues straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from zones.model import Channel, Decomposition
from zones.plan_view.wall_sections import SideCurve

CLEAR = 0.02  # mm off the surface: start of a ray or a look-up, so that it does not fall on the border itself
PITCH = 0.4  # mm between rays along a trace
ENDS = 8  # halvings of the pitch between the last ray of a strip and the first ray outside it
FACING = -0.3  # n1·n2 below: two sides face each other
FACING_SHARE = 0.2  # of a side that faces channels, below which it is an outside
NEIGHBOURS = 12  # nearest rays that decide the side of a point
SAME_SIDE = 0.5  # n1·n2 above: a point and a ray are on one side


@dataclass(frozen=True, eq=False)
class ChannelStrip:
    """A run of rays from one wall to another: starts and feet, (k, 2) float64, mm, k >= 2."""

    channel: str
    start: F64
    foot: F64

    @property
    def centre_line(self) -> F64:
        """(k, 2) float64, mm, plan view of the access frame: middles of the rays."""
        return np.asarray(0.5 * (self.start + self.foot))

    @property
    def area(self) -> shapely.Geometry:
        """Area that the rays sweep, as quadrilaterals between neighbours; a crossed one counts as two triangles."""
        a, b, c, d = self.start[:-1], self.start[1:], self.foot[1:], self.foot[:-1]
        ring = np.stack([a, b, c, d, a], axis=1)
        return shapely.union_all(shapely.make_valid(shapely.polygons(ring)))


@dataclass(frozen=True, eq=False)
class SideRays:
    """The rays of one side of a wall: starts and normals, (k, 2), and the channel of each ('' for none)."""

    start: F64
    normal: F64
    named: list[str]
    strips: list[ChannelStrip]

    @property
    def faced(self) -> dict[str, float]:
        """Share of the side that faces each channel."""
        return {n: self.named.count(n) / len(self.named) for n in sorted({s.channel for s in self.strips})}

    def spread_names(self, closed: bool) -> list[str]:
        """Channel of each ray; a ray without one gets the nearest along the side. All '' on an outside."""
        if sum(self.faced.values()) < FACING_SHARE:
            return [""] * len(self.named)
        known = np.array([k for k, n in enumerate(self.named) if n])
        away = np.abs(np.arange(len(self.named))[:, None] - known)
        if closed:
            away = np.minimum(away, len(self.named) - away)
        return [self.named[k] for k in known[away.argmin(axis=1)]]


@dataclass(frozen=True, eq=False)
class RayIndex:
    """Starts (k, 2) and normals (k, 2) of the rays of all sides, their wall and channel (rows, -1 for none)."""

    start: F64
    normal: F64
    wall: NDArray[np.int64]
    channel: NDArray[np.int64]

    @staticmethod
    def of(decomposition: Decomposition, curves: Sequence[SideCurve], sides: Sequence[SideRays],
           names: Sequence[str]) -> RayIndex:
        walls = [w.id for w in decomposition.walls]
        named = [n for c, s in zip(curves, sides, strict=True) for n in s.spread_names(c.closed)]
        wall = [walls.index(c.wall) for c, s in zip(curves, sides, strict=True) for _ in s.named]
        return RayIndex(np.concatenate([np.zeros((0, 2)), *(s.start for s in sides)]),
                        np.concatenate([np.zeros((0, 2)), *(s.normal for s in sides)]),
                        np.array(wall, dtype=np.int64),
                        np.array([names.index(n) if n else -1 for n in named], dtype=np.int64))

    def nearest(self, at: F64, side: F64, wall: NDArray[np.int64]) -> NDArray[np.int64]:
        """Channel of the nearest ray of the same wall that leaves to the same side, (n,) int64, index, -1 for none.

        at, side : (n, 2) float64, mm and dimensionless, in plan of the first access's frame
        wall     : (n,) int64, index of the wall
        """
        if not len(self.wall):
            return np.full(len(at), -1, np.int64)
        near = self.index.nearest(wall, at, NEIGHBOURS)
        same = (np.einsum("nkj,nj->nk", self.normal[near], side) > SAME_SIDE) & (near >= 0)
        pick = near[np.arange(len(at)), same.argmax(axis=1)]
        return np.where(same.any(axis=1), self.channel[pick], -1)

    @cached_property
    def index(self) -> KeyedPoints:
        """The starts by wall."""
        return KeyedPoints(self.wall, self.start)


def side_rays(part: Part, decomposition: Decomposition, curves: Sequence[SideCurve],
              shadows: Sequence[shapely.Geometry]) -> list[SideRays]:
    """Rays of every side with the channels they cross."""
    d = decomposition
    through = {f for c in d.connections for f in c.faces} | {f.number for f in part.faces if f.sliver}
    through |= {f for f, role in d.face_role.items() if role == "fillet"}
    keep = ~np.isin(part.mesh.face_ids, sorted(through))
    mesh = TriangleMesh(part.mesh.vertices, part.mesh.faces[keep], part.mesh.face_ids[keep])
    tree = TriangleTree(mesh)
    owner = {f: w.id for w in d.walls for f in w.sides}
    channel = {frozenset(c.walls): c for c in d.channels}
    skin = 1e-6 * float(np.linalg.norm(part.bounds[1] - part.bounds[0]))
    holes = shapely.union_all(list(shadows)).buffer(CLEAR)
    look = _Look(mesh, tree, owner, channel, max(skin, CLEAR))
    return [_side(curve, look, holes) for curve in curves]


@dataclass(frozen=True, eq=False)
class _Look:
    """Obstacles of level rays: mesh and tree, walls by face, channels by walls, start distance of rays in mm."""

    mesh: TriangleMesh
    tree: TriangleTree
    owner: dict[int, str]
    channel: dict[frozenset[str], Channel]
    skin: float

    def along(self, wall: str, start: F64, normal: F64, z: float) -> tuple[list[str], F64]:
        """Channel of each ray of a wall, '' for none, and its length (n,) mm, 0 where it meets nothing.

        start, normal : (n, 2) float64, mm and unit
        """
        way = np.column_stack([normal, np.zeros(len(start))])
        far, hit = first_hits(self.tree, np.column_stack([start, np.full(len(start), z)]), way, self.skin)
        facing = np.einsum("ij,ij->i", self.mesh.normals[hit], way) < FACING
        met = ["" if h < 0 or not ok else self.owner.get(int(self.mesh.face_ids[h]), "")
               for h, ok in zip(np.asarray(hit).tolist(), facing.tolist(), strict=True)]
        named = [self.channel[p].id if m and (p := frozenset((wall, m))) in self.channel else "" for m in met]
        return named, np.where(np.isfinite(far), far, 0.0)


def _side(curve: SideCurve, look: _Look, holes: shapely.Geometry) -> SideRays:
    start, normal = spread(curve.points, curve.closed, PITCH)
    if len(start) < 2:
        return SideRays(start, normal, [""] * len(start), [])
    inset = start.copy()
    if not curve.closed:  # a ray from the very end of a side grazes the end of the opposite side
        inset[0] += CLEAR * np.array([normal[0, 1], -normal[0, 0]])
        inset[-1] -= CLEAR * np.array([normal[-1, 1], -normal[-1, 0]])
    named, length = look.along(curve.wall, inset, normal, curve.z)
    seen = list(named)
    _bridge(named, length, shapely.contains_xy(holes, start[:, 0], start[:, 1]), curve.closed)
    runs = [run for run in runs_of(named, curve.closed) if len(run) > 1]
    ends = _ends(curve, look, start, normal, named, seen, runs)
    strips = []
    for run, (first, last) in zip(runs, ends, strict=True):
        base = np.vstack([first[:, :2], start[run], last[:, :2]])
        foot = np.vstack([first[:, 2:], start[run] + length[run, None] * normal[run], last[:, 2:]])
        strips.append(ChannelStrip(named[run[0]], base, foot))
    return SideRays(start, normal, named, strips)


def _ends(curve: SideCurve, look: _Look, start: F64, normal: F64, named: Sequence[str], seen: Sequence[str],
          runs: Sequence[Sequence[int]]) -> list[tuple[F64, F64]]:
    """Last ray before and after each run that still meets its wall, (0 or 1, 4) float64: start and foot, mm.

    Between the last ray of a run and the next ray the border is halved ENDS times, so that the end of a strip does not
    depend on the starts of the rays. An end of the curve, or a ray named after its neighbours, does not change.

    named, seen : channel of each ray after and before ``_bridge``
    """
    n = len(start)
    cuts = [(r, side, inner, inner + step) for r, run in enumerate(runs)
            for side, inner, step in ((0, run[0], -1), (1, run[-1], 1))
            if run[0] != run[-1] and seen[inner] == named[inner] and (curve.closed or 0 <= inner + step < n)]
    out = [[np.zeros((0, 4)), np.zeros((0, 4))] for _ in runs]
    inner, outer = np.array([c[2] for c in cuts]), np.array([c[3] % n for c in cuts])
    want = [seen[k] for k in inner.tolist()]
    low, high = np.zeros(len(cuts)), np.ones(len(cuts))
    best = np.zeros((len(cuts), 4))
    for _ in range(ENDS if cuts else 0):
        t = 0.5 * (low + high)
        at = start[inner] + t[:, None] * (start[outer] - start[inner])
        way = normal[inner] + t[:, None] * (normal[outer] - normal[inner])
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        found, length = look.along(curve.wall, at, way, curve.z)
        ok = np.array([a == b for a, b in zip(found, want, strict=True)])
        best[ok] = np.column_stack([at, at + length[:, None] * way])[ok]
        low, high = np.where(ok, t, low), np.where(ok, high, t)
    for k, (r, side, _, _) in enumerate(cuts):
        if low[k] > 0.0:
            out[r][side] = best[k:k + 1]
    return [(a, b) for a, b in out]


def _bridge(names: list[str], length: F64, hole: NDArray[np.bool_], closed: bool) -> None:
    """Name rays that no wall stopped after the strip on both sides of them, in place; lengths are interpolated.

    names, length (mm) : of the rays in order; hole : (n,) bool, rays that leave a wall where a connection ends at it
    """
    n = len(names)
    hits = [k for k in range(n) if names[k]]
    pairs = list(pairwise(hits)) + ([(hits[-1], hits[0] + n)] if closed and len(hits) > 1 else [])
    for a, b in pairs:
        between = [k % n for k in range(a + 1, b)]
        ends = length[a], length[b % n]
        if between and names[a] == names[b % n] and (hole[between].all() or len(between) * PITCH <= max(ends)):
            for j, k in enumerate(between, start=1):
                names[k] = names[a]
                length[k] = ends[0] + (ends[1] - ends[0]) * j / (len(between) + 1)


def runs_of(names: Sequence[str], closed: bool) -> list[list[int]]:
    """Runs of equal names that are not empty, in order, and across the end where the curve is closed."""
    runs: list[list[int]] = []
    for k, name in enumerate(names):
        if name and runs and runs[-1][-1] == k - 1 and names[runs[-1][-1]] == name:
            runs[-1].append(k)
        elif name:
            runs.append([k])
    if closed and runs and names[0] and names[0] == names[-1]:
        if len(runs) == 1:
            runs[0] = [*runs[0], 0]
        else:
            runs[0] = [*runs.pop(), *runs[0]]
    return runs


def spread(points: F64, closed: bool, pitch: float) -> tuple[F64, F64]:
    """Evenly spaced points along a polyline and the unit normals to its left.

    points : (n, 2) float64, mm, in plan of the first access's frame; the last joins the first where ``closed``

    Returns points, (k, 2) float64, mm, and normals, (k, 2) float64, dimensionless, in the same frame.
    """
    line = np.vstack([points, points[:1]]) if closed else points
    step = np.diff(line, axis=0)
    length = np.linalg.norm(step, axis=1)
    keep = length > 0
    line, step, length = line[np.append(keep, True)], step[keep], length[keep]
    if not len(length):
        return np.zeros((0, 2)), np.zeros((0, 2))
    at = np.concatenate([[0.0], np.cumsum(length)])
    count = max(2, int(np.ceil(at[-1] / pitch)) + 1)
    s = np.linspace(0.0, at[-1], count, endpoint=not closed)
    k = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(length) - 1)
    tangent = step[k] / length[k, None]
    return (np.asarray(line[k] + (s - at[k])[:, None] * tangent),
            np.column_stack([-tangent[:, 1], tangent[:, 0]]))
