"""Channels: the voids between facing walls, and the least gap of each.

From samples of every side a ray leaves along the outward normal. The mesh for these rays has no connections, fillets
and slivers. The first hit decides what the side faces. A pair of walls (or one wall with itself) has a channel when the
side area that faces the other adds up to ``FACING_SHARE`` of half the smaller one's side area. The shortest ray is then
refined on the triangles around it, and along the borders of both sides (``zones.features.side_borders``).

Rays start and end on the exact surface with its normal there, which patches through the mesh nodes give
(``zones.features.smooth_surface``). Facets alone are half a facet wrong at borders.

A ray from a wall to itself does not count where start and foot lie on one piece of the side within a ball as wide as
the wall is thick: it crosses a notch or a corner of the side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.sampling import sample_surface
from zones.features.connection_caps import cap_footprints
from zones.features.face_graph import FaceGraph, cast
from zones.features.side_borders import BorderPlaces, SideBorder, neighbours
from zones.features.smooth_surface import SmoothSurface
from zones.kernels.nearby import one_piece

FACING_DOT = -0.3
FACING_SHARE = 0.02
# Samples of one wall. A side that is visible through a narrow opening, such as the gap over a wall between, is found
# only when a sample falls into the opening. A channel depends on 2 % of an area, known to 6 % with this many samples.
SAMPLES_PER_WALL = 12_000
# Local refinement: starts, random points a round, rounds, and shrinkage of the neighbourhood when the best point is
# nearer to its centre than INNER of its radius. Otherwise the neighbourhood only moves, along a slanting border for
# example.
STARTS, POINTS, ROUNDS, SHRINK, INNER = 4, 160, 12, 0.4, 0.5
# Distance of starts and radius of first neighbourhoods, in steps at which this many places cover the sides of a wall.
STEPS_PER_WALL = 3000
# The triangles come from one look-up within this multiple of the first radius.
AROUND = 4.0
NEAREST, TRIANGLES = 800, 300
# Points keep these shares of a triangle from its corners and edges, so that rays do not leave through a border.
INSETS = (1e-3, 1e-5)
# The foot of a perpendicular lies inside a side where, after this many corrections, the rest along the side is at most
# this share of the distance.
ASKEW, FOOT_TURNS = 2e-3, 8
SLOPES = 0.05, 1e3  # limits of the secant; outside, a step does not change
ALONG_RIM = np.array([-1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0])


@dataclass(frozen=True)
class Facing:
    """Two walls that face each other.

    walls   : index of both in the list of walls, first <= second
    gap_min : mm
    at      : point on a side of the first wall, mm, frame of the part
    area    : mm², side area of both walls that faces the other
    """

    walls: tuple[int, int]
    gap_min: float
    at: tuple[float, float, float]
    area: float


@dataclass(frozen=True, eq=False)
class Start:
    """A short ray: its length (mm), the wall it leaves, the wall it meets, its triangle and point."""

    distance: float
    wall: int
    other: int
    triangle: int
    point: F64

    def near(self, other: Start, distance: float) -> bool:
        """Whether another start lies on the same wall within a distance."""
        return self.wall == other.wall and float(np.linalg.norm(self.point - other.point)) < distance


def find_facings(graph: FaceGraph, sides: list[np.ndarray], left_out: np.ndarray) -> list[Facing]:
    """Pairs of walls with a channel between them.

    graph    : FaceGraph
    sides    : (k,) int64 for each wall, index of its side faces, 0-based
    left_out : (n,) bool, faces that rays pass through (connections, fillets, slivers)
    Returns Facing per pair, in order of the pair.
    """
    if not sides:
        return []
    field = _Field(graph, sides, left_out)
    return field.facings()


class _Side:
    """The side triangles of one wall, with cached look-ups.

    mesh      : TriangleMesh
    triangles : (k,) int, its side triangles, ascending
    """

    def __init__(self, mesh: TriangleMesh, triangles: np.ndarray) -> None:
        self.mesh, self.triangles = mesh, triangles
        self.area = float(mesh.areas[triangles].sum())
        self.border = SideBorder.of(mesh, triangles)
        self.rim = np.unique(self.border.nodes)

    @cached_property
    def corners(self) -> F64:
        """(k, 3, 3) float64, mm."""
        return np.ascontiguousarray(self.mesh.triangles[self.triangles])

    @cached_property
    def low(self) -> F64:
        """(k, 3) float64, mm: lower corners of the boxes of the triangles."""
        return np.asarray(self.corners.min(axis=1))

    @cached_property
    def high(self) -> F64:
        """(k, 3) float64, mm: their upper corners."""
        return np.asarray(self.corners.max(axis=1))

    @cached_property
    def tree(self) -> TriangleTree:
        """Hierarchy over the side triangles alone."""
        faces = self.mesh.faces[self.triangles]
        return TriangleTree(TriangleMesh(self.mesh.vertices, faces, self.mesh.face_ids[self.triangles]))

    @cached_property
    def beside(self) -> np.ndarray:
        """(k, 3) int64: neighbours across the edges, -1 at the border."""
        return neighbours(self.mesh.faces[self.triangles])


class _Field:
    """The mesh without the faces that rays pass through, and the sides of the walls on it."""

    def __init__(self, graph: FaceGraph, sides: list[np.ndarray], left_out: np.ndarray) -> None:
        keep = ~left_out[graph.face_of]
        full, uv = graph.mesh, graph.part.uv
        owner = np.full(graph.n + 1, -1)
        for wall, faces in enumerate(sides):
            owner[faces] = wall
        caps = cap_footprints(graph, left_out, owner[:-1] >= 0)
        self.mesh = _with_triangles(TriangleMesh(full.vertices, full.faces[keep], full.face_ids[keep]), caps,
                                    graph.n + 1)
        self.owner = owner[self.mesh.face_ids.astype(np.int64) - 1]
        self.tree = TriangleTree(self.mesh)
        self.skin = graph.skin
        self.smooth = SmoothSurface(self.mesh, None if uv is None else uv[keep], np.flatnonzero(self.owner >= 0),
                                  max(graph.part.chord, graph.part.deviation))
        self.count = len(sides)
        self.walls = [_Side(self.mesh, np.flatnonzero(self.owner == k)) for k in range(self.count)]
        self.on_rim = np.zeros(len(self.mesh.vertices), bool)
        for mine in self.walls:
            self.on_rim[mine.rim] = True
        self.thickness = [float(np.median(graph.inward[np.isin(graph.face, f)])) for f in sides]

    def look(self, points: F64, triangles: np.ndarray) -> tuple[F64, np.ndarray, F64]:
        """Outward rays from points of sides on the triangles they lie on.

        Returns their lengths between the exact surfaces (inf: none), the walls whose sides they meet (-1: none) and
        the feet, (n, 3).
        """
        start, normal = self.smooth.at(points, triangles)
        distance, hit = cast(self.tree, points, normal, self.skin)
        rows = np.flatnonzero(hit >= 0)
        rows = rows[self.owner[hit[rows]] >= 0]
        met = points[rows] + distance[rows, None] * normal[rows]
        foot, back = self.smooth.at(met, hit[rows])
        dot = np.einsum("ij,ij->i", back, normal[rows])
        facing = (dot < FACING_DOT) & ~self._local(start[rows], triangles[rows], met, hit[rows])
        rows, dot, back = rows[facing], dot[facing], back[facing]
        # The planes that touch the exact surface at both ends, instead of the facets.
        off = (foot - met)[facing] - (start - points)[rows]
        length, wall = np.full(len(points), np.inf), np.full(len(points), -1)
        length[rows] = distance[rows] + np.einsum("ij,ij->i", off, back) / dot
        wall[rows] = self.owner[hit[rows]]
        feet = points.copy()
        feet[rows] = start[rows] + length[rows, None] * normal[rows]
        return length, wall, feet

    def _local(self, points: F64, triangles: np.ndarray, feet: F64, hit: np.ndarray) -> np.ndarray:
        """Whether rays between two places of one wall only cross a notch or a corner of its side, (k,) bool."""
        out = np.zeros(len(points), bool)
        wall = self.owner[triangles]
        near = np.linalg.norm(feet - points, axis=1)
        for w in np.unique(wall[wall == self.owner[hit]]).tolist():
            rows = np.flatnonzero((wall == w) & (self.owner[hit] == w) & (near <= self.thickness[w]))
            if len(rows):
                side, found = self.walls[w], np.zeros(len(rows), bool)
                one_piece(side.beside, side.corners, np.searchsorted(side.triangles, triangles[rows]),
                          np.searchsorted(side.triangles, hit[rows]), points[rows], self.thickness[w], found)
                out[rows] = found
        return out

    def to_border(self, wall: int, other: int, limit: float) -> Callable[[F64, np.ndarray], tuple[F64, F64, F64]]:
        """The rays from a wall that meet given points of the border of another wall, found backwards.

        limit : mm, length at which the search ends
        """
        side = self.walls[wall]

        def rays(points: F64, triangles: np.ndarray) -> tuple[F64, F64, F64]:
            length, start, foot = np.full(len(points), np.inf), points.copy(), points.copy()
            _, at, near = nearest(side.tree, points, limit)
            rows = np.flatnonzero(at >= 0)
            foot[rows], back = self.smooth.at(points[rows], triangles[rows])
            place, here = at[rows], near[rows]
            step, before = np.ones(len(rows)), np.zeros((len(rows), 3))
            for turn in range(FOOT_TURNS):
                start[rows], normal = self.smooth.at(here, side.triangles[place])
                way = foot[rows] - start[rows]
                s = np.einsum("ij,ij->i", way, normal)
                along = way - s[:, None] * normal
                if turn < FOOT_TURNS - 1:
                    # at a foot on the facets the facet is square to the ray, not the surface
                    step = _secant(step, before, along)
                    _, place, here = nearest(side.tree, here + step[:, None] * along)
                    before = along
            place = side.triangles[place]
            good = (s > self.skin) & (np.linalg.norm(along, axis=1) <= ASKEW * s)
            good &= np.einsum("ij,ij->i", normal, back) < FACING_DOT
            good[good] &= ~self._local(start[rows[good]], place[good], foot[rows[good]], triangles[rows[good]])
            clear, hit = cast(self.tree, start[rows[good]], normal[good], self.skin)
            through = (hit >= 0) & (np.einsum("ij,ij->i", self.mesh.normals[hit], normal[good]) > 0)
            good[good] &= ~through & (clear >= (1.0 - ASKEW) * s[good] - self.smooth.tolerance)
            length[rows[good]] = s[good]
            return length, start, foot

        return rays

    def from_border(self, other: int) -> Callable[[F64, np.ndarray], tuple[F64, F64, F64]]:
        """The rays from points beside a border that meet a wall."""
        def rays(points: F64, triangles: np.ndarray) -> tuple[F64, F64, F64]:
            distance, met, feet = self.look(points, triangles)
            return np.where(met == other, distance, np.inf), points, feet

        return rays

    def facings(self) -> list[Facing]:
        """Pairs of walls that face each other, in order of the pair."""
        area: dict[tuple[int, int], float] = {}
        best: dict[tuple[int, int], list[Start]] = {}
        rim: dict[int, tuple[BorderPlaces, F64, np.ndarray]] = {}
        for wall, side in enumerate(self.walls):
            if side.area <= 0:
                continue
            s = sample_surface(self.mesh, SAMPLES_PER_WALL / side.area, seed=29, triangles=side.triangles)
            at = side.border.places()
            points = np.concatenate([s.points, side.border.points(at, INSETS[0])])
            triangle = np.concatenate([s.triangle, side.border.triangle[at.piece]])
            distance, met, _ = self.look(points, triangle)
            inner = len(s.points)
            rim[wall] = at, distance[inner:], met[inner:]
            for other in np.unique(met[met >= 0]).tolist():
                rows = np.flatnonzero(met == other)
                pair = (min(wall, other), max(wall, other))
                area[pair] = area.get(pair, 0.0) + float(s.area[rows[rows < inner]].sum())
                near = rows[np.argsort(distance[rows], kind="stable")][:NEAREST]
                best.setdefault(pair, []).extend(
                    Start(float(distance[i]), wall, other, int(triangle[i]), points[i]) for i in near)
        out = []
        for pair in sorted(area):
            if area[pair] >= FACING_SHARE * 0.5 * min(self.walls[pair[0]].area, self.walls[pair[1]].area):
                gap, at_first = self._least(pair, sorted(best[pair], key=lambda f: f.distance), rim)
                out.append(Facing(pair, gap, at_first, area[pair]))
        return out

    def _least(self, pair: tuple[int, int], found: list[Start],
               rim: dict[int, tuple[BorderPlaces, F64, np.ndarray]]) -> tuple[float, tuple[float, float, float]]:
        """Least ray length of a pair, inside and along the borders, and the point on the first wall there."""
        gap, point, foot, wall = self._refine(found)
        for a, b in dict.fromkeys((pair, pair[::-1])):
            for from_a in (True, False):
                # rays from the border of a to b, and rays from b that meet the border of a
                border = self.walls[a].border
                if from_a and a in rim:
                    at, length, met = rim[a]
                    rays, length, inset = self.from_border(b), np.where(met == b, length, np.inf), INSETS[1]
                else:
                    at, rays, inset = border.places(), self.to_border(b, a, gap), 0.0
                    length, _, _ = rays(border.points(at, inset), border.triangle[at.piece])
                better = border.least(rays, at, length, inset)
                if better is not None and better[0] < gap:
                    gap, point, foot = better
                    wall = a if from_a else b
        x, y, z = (float(c) for c in (point if wall == pair[0] else foot))
        return gap, (x, y, z)

    def _refine(self, found: list[Start]) -> tuple[float, F64, F64, int]:
        """Least ray length near the best samples, its start and foot, and the wall it leaves."""
        chosen: list[Start] = []
        result: tuple[float, F64, F64, int] = (np.inf, np.zeros(3), np.zeros(3), found[0].wall)
        for start in found:
            if len(chosen) >= STARTS or start.distance > 1.2 * found[0].distance:
                break
            pitch = float(np.sqrt(self.walls[start.wall].area / STEPS_PER_WALL))
            if any(start.near(c, 4.0 * pitch) for c in chosen):
                continue
            chosen.append(start)
            distance, point, foot = self._descend(start, 3.0 * pitch)
            if distance < result[0]:
                result = (distance, point, foot, start.wall)
        return result

    def _descend(self, start: Start, radius: float) -> tuple[float, F64, F64]:
        """Search ever smaller neighbourhoods of a start on the sides of its wall: least length, point, foot."""
        reach = AROUND * radius
        side, low, high, anchor = *self._side_near(start, start.point, reach), start.point
        best = (start.distance, start.point, start.point)
        points, triangles = start.point[None], np.array([start.triangle])
        for turn in range(ROUNDS):
            centre = best[1]
            if float(np.abs(centre - anchor).max()) > reach - radius:
                side, low, high, anchor = *self._side_near(start, centre, reach), centre
            close = side[((low <= centre + radius) & (high >= centre - radius)).all(axis=1)]
            # a regular choice of many triangles; later rounds use all
            close = close[_regular(len(close), TRIANGLES)]
            near = _points_near(self.mesh, close, self.on_rim, centre, radius, turn)
            points, triangles = np.concatenate([points[:1], near[0]]), np.concatenate([triangles[:1], near[1]])
            distance, met, feet = self.look(points, triangles)
            distance = np.where(met == start.other, distance, np.inf)
            k = int(distance.argmin())
            moved = 0.0
            if distance[k] <= best[0]:
                moved = float(np.linalg.norm(points[k] - centre))
                best = (float(distance[k]), points[k], feet[k])
                points, triangles = points[k:k + 1], triangles[k:k + 1]
            if moved < INNER * radius:
                radius *= SHRINK
        return best

    def _side_near(self, start: Start, centre: F64, reach: float) -> tuple[np.ndarray, F64, F64]:
        """Triangles of the sides of a wall within a box, on the side of the start, and their own boxes."""
        mine = self.walls[start.wall]
        side, low, high = mine.triangles, mine.low, mine.high
        rows = np.arange(len(side))
        for k in range(3):
            rows = rows[(low[rows, k] <= centre[k] + reach) & (high[rows, k] >= centre[k] - reach)]
        rows = rows[self.mesh.normals[side[rows]] @ self.mesh.normals[start.triangle] > 0]
        return side[rows], low[rows], high[rows]


def _secant(step: F64, before: F64, along: F64) -> F64:
    """Next steps towards a perpendicular foot, as multiples of the rest along a side.

    step : (n,) float64, the last steps; before, along : (n, 3) float64, mm, the rest before and after them

    On a side that bulges towards a point at distance s with radius r, a step over the whole rest turns the normal as
    well. It overshoots by s / r, and for s > r never converges. The secant through the last two gives 1 / (1 + s / r).
    """
    was = np.einsum("ij,ij->i", before, before)
    slope = (1.0 - np.einsum("ij,ij->i", before, along) / np.maximum(was, 1e-300)) / step
    sane = (was > 0.0) & (np.abs(slope) > SLOPES[0]) & (np.abs(slope) < SLOPES[1])
    return np.where(sane, 1.0 / np.where(sane, slope, 1.0), step)


def _regular(count: int, limit: int) -> np.ndarray:
    """At most ``limit`` indices below ``count``, spread evenly."""
    return np.arange(count) if count <= limit else np.linspace(0, count - 1, limit).astype(np.int64)


def _with_triangles(mesh: TriangleMesh, more: F64, number: int) -> TriangleMesh:
    """The mesh with triangles (k, 3, 3) of one more face after its own."""
    corner = np.arange(3 * len(more), dtype=np.int32).reshape(-1, 3) + np.int32(len(mesh.vertices))
    return TriangleMesh(np.concatenate([mesh.vertices, more.reshape(-1, 3)]), np.concatenate([mesh.faces, corner]),
                        np.concatenate([mesh.face_ids, np.full(len(more), number, mesh.face_ids.dtype)]))


def _points_near(mesh: TriangleMesh, triangles: np.ndarray, on_rim: np.ndarray, centre: F64, radius: float,
                 seed: int) -> tuple[F64, np.ndarray]:
    """Points on triangles within about a radius of a centre: corners, places along the rim, a random spread.

    Returns (k, 3) points and (k,) triangles.
    """
    if len(triangles) == 0:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    t = mesh.triangles[triangles]
    corner = (t + INSETS[0] * (t.mean(axis=1, keepdims=True) - t)).reshape(-1, 3)
    rng = np.random.default_rng(seed)
    pick = _regular(len(t), 64)
    spread, owner = _onto_triangles(t[pick], centre + radius * rng.uniform(-1.0, 1.0, (POINTS, 3)))
    rim, beside = _along_rim(t, on_rim[mesh.faces[triangles]], centre, radius)
    points = np.concatenate([corner, rim, spread])
    of = np.concatenate([np.repeat(triangles, 3), triangles[beside], triangles[pick][owner]])
    near = np.linalg.norm(points - centre, axis=1) <= 1.8 * radius
    return points[near], of[near]


def _along_rim(t: F64, rim: np.ndarray, centre: F64, radius: float) -> tuple[F64, np.ndarray]:
    """Points beside edges with both ends on the rim ((n, 3) bool), around the place nearest to a centre, and rows."""
    out, rows = [], []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        row = np.flatnonzero(rim[:, a] & rim[:, b])
        p, e = t[row, a], t[row, b] - t[row, a]
        length = np.maximum(np.linalg.norm(e, axis=1), 1e-30)
        at = np.clip(np.einsum("ij,ij->i", centre - p, e) / length**2, 0.0, 1.0)
        share = np.clip(at[:, None] + ALONG_RIM * (radius / length)[:, None], 0.0, 1.0)
        points = p[:, None] + share[..., None] * e[:, None]
        middle = t[row].mean(axis=1)[:, None]
        for inset in INSETS:
            out.append((points + inset * (middle - points)).reshape(-1, 3))
            rows.append(np.repeat(row, len(ALONG_RIM)))
    return np.concatenate(out), np.concatenate(rows)


def _onto_triangles(t: F64, points: F64) -> tuple[F64, np.ndarray]:
    """Points projected into the plane of each triangle where they fall inside it: (k, 3), and rows of t."""
    e1, e2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    g11, g12, g22 = ((a * b).sum(axis=1)[:, None] for a, b in ((e1, e1), (e1, e2), (e2, e2)))
    det = np.maximum(g11 * g22 - g12 * g12, 1e-300)
    w1 = e1 @ points.T - (e1 * t[:, 0]).sum(axis=1)[:, None]
    w2 = e2 @ points.T - (e2 * t[:, 0]).sum(axis=1)[:, None]
    b1, b2 = (w1 * g22 - w2 * g12) / det, (w2 * g11 - w1 * g12) / det
    i, j = np.nonzero((b1 > INSETS[0]) & (b2 > INSETS[0]) & (b1 + b2 < 1 - INSETS[0]))
    return np.asarray(t[i, 0] + b1[i, j, None] * e1[i] + b2[i, j, None] * e2[i]), i
