"""Channels: the voids between facing walls, and how narrow each becomes.

From samples of every side a ray leaves along the outward normal; connections, fillets and slivers are left out of
the mesh it meets. The first hit decides what the side faces. A pair of walls (or one wall with itself) has a
channel when the side area that faces the other adds up to ``FACING_SHARE`` of half the smaller one's side area.
The shortest ray is then refined on the triangles around it. Rays start and end on the exact surface with its normal
there, as patches through the mesh nodes give it (``zones.smooth``): facets alone are half a facet wrong at borders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.bvh import TriangleTree
from geometry.mesh import F64, TriangleMesh
from geometry.sampling import sample_surface
from zones.facegraph import FaceGraph, cast
from zones.footprints import cap_footprints
from zones.smooth import SmoothFaces

FACING_DOT = -0.3
FACING_SHARE = 0.02
SAMPLES_PER_WALL = 3000
# Local refinement: starts, random points a round, rounds, and how much the neighbourhood shrinks when the best is well
# inside it (nearer than INNER of its radius); otherwise it only moves, along a slanting border for example.
STARTS, POINTS, ROUNDS, SHRINK, INNER = 4, 160, 12, 0.4, 0.5
# Triangles are looked up once within this multiple of the first radius.
AROUND = 4.0
NEAREST, RIM_SAMPLES, TRIANGLES = 200, 600, 300
# Points stay these shares of a triangle away from its corners and edges, so that rays do not leave through a border.
INSETS = (1e-3, 1e-5)
ALONG_RIM = np.array([-1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0])


@dataclass(frozen=True)
class Facing:
    """Two walls that see each other.

    walls   : places in the list of walls, first <= second
    gap_min : mm
    at      : point on a side of the first wall, mm
    area    : mm² of side area on both that faces the other
    """

    walls: tuple[int, int]
    gap_min: float
    at: tuple[float, float, float]
    area: float


@dataclass(frozen=True, eq=False)
class Start:
    """A short ray: its length (mm), the wall it leaves and the one it meets, its triangle and point."""

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

    sides    : per wall its 0-based side faces
    left_out : (n,) bool, faces that rays pass through (connections, fillets, slivers)
    Returns Facing per pair, in order of the pair.
    """
    if not sides:
        return []
    field = _Field(graph, sides, left_out)
    return field.facings()


class _Field:
    """The mesh without what rays pass through, and the sides of the walls on it."""

    def __init__(self, graph: FaceGraph, sides: list[np.ndarray], left_out: np.ndarray) -> None:
        keep = ~left_out[graph.face_of]
        full, uv = graph.mesh, graph.part.uv
        owner = np.full(graph.n + 1, -1)
        for wall, faces in enumerate(sides):
            owner[faces] = wall
        caps = cap_footprints(graph, left_out, owner[:-1] >= 0)
        self.mesh = _with_triangles(TriangleMesh(full.vertices, full.faces[keep], full.face_ids[keep]), caps,
                                    graph.n + 1)
        self.tree = TriangleTree(self.mesh)
        self.skin = graph.skin
        self.owner = owner[self.mesh.face_ids.astype(np.int64) - 1]
        self.smooth = SmoothFaces(self.mesh, None if uv is None else uv[keep], np.flatnonzero(self.owner >= 0),
                                  max(graph.part.chord, graph.part.deviation))
        self.on_rim = np.zeros(len(self.mesh.vertices), bool)
        for faces in sides:
            self.on_rim[_rim_nodes(graph, faces)] = True
        self.side_area = np.array([graph.area[f].sum() for f in sides])
        self.count = len(sides)
        self.patches: dict[int, tuple[np.ndarray, F64, F64]] = {}

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
        facing = dot < FACING_DOT
        rows, dot, back = rows[facing], dot[facing], back[facing]
        # The planes that touch the exact surface at both ends, instead of the facets.
        off = (foot - met)[facing] - (start - points)[rows]
        length, wall = np.full(len(points), np.inf), np.full(len(points), -1)
        length[rows] = distance[rows] + np.einsum("ij,ij->i", off, back) / dot
        wall[rows] = self.owner[hit[rows]]
        feet = points.copy()
        feet[rows] = start[rows] + length[rows, None] * normal[rows]
        return length, wall, feet

    def starts(self, wall: int, area: float) -> tuple[F64, np.ndarray, F64]:
        """Points to look from: evenly spread samples, and points just inside the borders of the sides.

        Returns (n, 3) points, (n,) triangles and (n,) mm² each stands for, zero on the borders.
        """
        triangles = np.flatnonzero(self.owner == wall)
        s = sample_surface(self.mesh, SAMPLES_PER_WALL / area, seed=29, triangles=triangles)
        rim = triangles[self.on_rim[self.mesh.faces[triangles]].any(axis=1)]
        rim = rim[_regular(len(rim), RIM_SAMPLES)]
        t = self.mesh.triangles[rim]
        corners = (t + INSETS[0] * (t.mean(axis=1, keepdims=True) - t)).reshape(-1, 3)
        points, owner = np.concatenate([s.points, corners]), np.concatenate([s.triangle, np.repeat(rim, 3)])
        return points, owner, np.concatenate([s.area, np.zeros(len(corners))])

    def facings(self) -> list[Facing]:
        area: dict[tuple[int, int], float] = {}
        best: dict[tuple[int, int], list[Start]] = {}
        for wall in range(self.count):
            if self.side_area[wall] <= 0:
                continue
            points, triangle, weight = self.starts(wall, self.side_area[wall])
            distance, met, _ = self.look(points, triangle)
            for other in np.unique(met[met >= 0]).tolist():
                rows = np.flatnonzero(met == other)
                pair = (min(wall, other), max(wall, other))
                area[pair] = area.get(pair, 0.0) + float(weight[rows].sum())
                near = rows[np.argsort(distance[rows], kind="stable")][:NEAREST]
                best.setdefault(pair, []).extend(
                    Start(float(distance[i]), wall, other, int(triangle[i]), points[i]) for i in near)
        out = []
        for pair in sorted(area):
            if area[pair] >= FACING_SHARE * 0.5 * min(self.side_area[pair[0]], self.side_area[pair[1]]):
                gap, at = self._refine(pair, sorted(best[pair], key=lambda f: f.distance))
                out.append(Facing(pair, gap, at, area[pair]))
        return out

    def _refine(self, pair: tuple[int, int], found: list[Start]) -> tuple[float, tuple[float, float, float]]:
        """Least ray length near the best samples, and the point on the first wall there."""
        chosen: list[Start] = []
        result: tuple[float, F64, F64, int] = (np.inf, np.zeros(3), np.zeros(3), pair[0])
        for start in found:
            if len(chosen) >= STARTS or start.distance > 1.2 * found[0].distance:
                break
            pitch = float(np.sqrt(self.side_area[start.wall] / SAMPLES_PER_WALL))
            if any(start.near(c, 4.0 * pitch) for c in chosen):
                continue
            chosen.append(start)
            distance, point, foot = self._descend(start, 3.0 * pitch)
            if distance < result[0]:
                result = (distance, point, foot, start.wall)
        x, y, z = (float(c) for c in (result[1] if result[3] == pair[0] else result[2]))
        return float(result[0]), (x, y, z)

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
            # a regular choice where there are many; later rounds see them all
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
        if start.wall not in self.patches:
            side = np.flatnonzero(self.owner == start.wall)
            t = self.mesh.triangles[side]
            self.patches[start.wall] = (side, t.min(axis=1), t.max(axis=1))
        side, low, high = self.patches[start.wall]
        rows = np.arange(len(side))
        for k in range(3):
            rows = rows[(low[rows, k] <= centre[k] + reach) & (high[rows, k] >= centre[k] - reach)]
        rows = rows[self.mesh.normals[side[rows]] @ self.mesh.normals[start.triangle] > 0]
        return side[rows], low[rows], high[rows]


def _regular(count: int, most: int) -> np.ndarray:
    """Indices of at most so many of a row, spread evenly."""
    return np.arange(count) if count <= most else np.linspace(0, count - 1, most).astype(np.int64)


def _with_triangles(mesh: TriangleMesh, more: F64, number: int) -> TriangleMesh:
    """The mesh with triangles (k, 3, 3) of one more face after its own."""
    corner = np.arange(3 * len(more), dtype=np.int32).reshape(-1, 3) + np.int32(len(mesh.vertices))
    return TriangleMesh(np.concatenate([mesh.vertices, more.reshape(-1, 3)]), np.concatenate([mesh.faces, corner]),
                        np.concatenate([mesh.face_ids, np.full(len(more), number, mesh.face_ids.dtype)]))


def _rim_nodes(graph: FaceGraph, faces: np.ndarray) -> np.ndarray:
    """Mesh vertices on the B-rep edges of faces."""
    nodes = [k.nodes for f in faces for k in graph.at[int(f)]]
    return np.unique(np.concatenate(nodes)) if nodes else np.zeros(0, np.int64)


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
    """Points beside edges with both ends on the rim ((n, 3) bool), round the place nearest to a centre, and rows."""
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
    """Points projected into the plane of each triangle, kept where they fall inside it: (k, 3), rows of t."""
    e1, e2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    g11, g12, g22 = ((a * b).sum(axis=1)[:, None] for a, b in ((e1, e1), (e1, e2), (e2, e2)))
    det = np.maximum(g11 * g22 - g12 * g12, 1e-300)
    w1 = e1 @ points.T - (e1 * t[:, 0]).sum(axis=1)[:, None]
    w2 = e2 @ points.T - (e2 * t[:, 0]).sum(axis=1)[:, None]
    b1, b2 = (w1 * g22 - w2 * g12) / det, (w2 * g11 - w1 * g12) / det
    i, j = np.nonzero((b1 > INSETS[0]) & (b2 > INSETS[0]) & (b1 + b2 < 1 - INSETS[0]))
    return np.asarray(t[i, 0] + b1[i, j, None] * e1[i] + b2[i, j, None] * e2[i]), i
