"""Channels: the voids between facing walls, and how narrow each becomes.

From samples of every side a ray leaves along the outward normal; connections, fillets and slivers are left out of
the mesh it meets. The first hit decides what the side faces. A pair of walls (or one wall with itself) has a
channel when the side area that faces the other adds up to ``FACING_SHARE`` of half the smaller one's side area.
The shortest ray is then refined on the triangles around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.bvh import TriangleTree
from geometry.mesh import F64, TriangleMesh
from geometry.sampling import sample_surface
from zones.facegraph import FaceGraph, cast

FACING_DOT = -0.3
FACING_SHARE = 0.02
SAMPLES_PER_WALL = 3000
# Local refinement: starts, points a round, rounds, and how much the neighbourhood shrinks each round.
STARTS, POINTS, ROUNDS, SHRINK = 4, 160, 7, 0.5
NEAREST, RIM_SAMPLES, FIT_FACETS, TRIANGLES = 200, 600, 16, 300
# Points stay this share of a triangle away from its corners, so that rays do not leave through a border.
INSET = 1e-3


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
        full = graph.mesh
        self.mesh = TriangleMesh(full.vertices, full.faces[keep], full.face_ids[keep])
        self.tree = TriangleTree(self.mesh)
        self.skin = graph.skin
        owner = np.full(graph.n, -1)
        for wall, faces in enumerate(sides):
            owner[faces] = wall
        self.owner = owner[self.mesh.face_ids.astype(np.int64) - 1]
        self.rim = [_rim_nodes(graph, f) for f in sides]
        self.side_area = np.array([graph.area[f].sum() for f in sides])
        self.count = len(sides)
        self.patches: dict[int, tuple[F64, F64, F64, np.ndarray]] = {}

    def look(self, points: F64, normals: F64) -> tuple[F64, np.ndarray]:
        """Outward ray length from points of sides, and the wall whose side is met (inf and -1: none)."""
        distance, hit = cast(self.tree, points, normals, self.skin)
        dot = np.einsum("ij,ij->i", self.mesh.normals[hit], normals)
        wall = np.where((hit >= 0) & (dot < FACING_DOT), self.owner[hit], -1)
        return np.where(wall >= 0, distance, np.inf), wall

    def starts(self, wall: int, area: float) -> tuple[F64, np.ndarray, F64]:
        """Points to look from: evenly spread samples, and points just inside the borders of the sides.

        Returns (n, 3) points, (n,) triangles and (n,) mm² each stands for, zero on the borders.
        """
        triangles = np.flatnonzero(self.owner == wall)
        s = sample_surface(self.mesh, SAMPLES_PER_WALL / area, seed=29, triangles=triangles)
        rim = triangles[np.isin(self.mesh.faces[triangles], self.rim[wall]).any(axis=1)]
        rim = rim[np.unique(np.linspace(0, max(len(rim) - 1, 0), RIM_SAMPLES).astype(int))] if len(rim) else rim
        t = self.mesh.triangles[rim]
        corners = (t + INSET * (t.mean(axis=1, keepdims=True) - t)).reshape(-1, 3)
        points, owner = np.concatenate([s.points, corners]), np.concatenate([s.triangle, np.repeat(rim, 3)])
        return points, owner, np.concatenate([s.area, np.zeros(len(corners))])

    def facings(self) -> list[Facing]:
        area: dict[tuple[int, int], float] = {}
        best: dict[tuple[int, int], list[Start]] = {}
        for wall in range(self.count):
            if self.side_area[wall] <= 0:
                continue
            points, triangle, weight = self.starts(wall, self.side_area[wall])
            distance, met = self.look(points, self.mesh.normals[triangle])
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
        """Search ever smaller neighbourhoods of a start on its own B-rep face: least length, point, foot."""
        low, high, middle, face = self._patch(int(self.mesh.face_ids[start.triangle]))
        best = (np.inf, start.point, start.point)
        for turn in range(ROUNDS):
            centre = best[1]
            close = np.flatnonzero(((low <= centre + radius) & (high >= centre - radius)).all(axis=1))
            # a regular choice where there are many; later rounds see them all
            close = close[np.unique(np.linspace(0, len(close) - 1, min(len(close), TRIANGLES)).astype(int))]
            points = np.concatenate([centre[None], _points_near(self.mesh, face[close], centre, radius, turn)])
            normals = _smooth_normals(self.mesh, face, middle, centre, points)
            distance, met = self.look(points, normals)
            distance = np.where(met == start.other, distance, np.inf)
            k = int(distance.argmin())
            if distance[k] < best[0]:
                best = (float(distance[k]), points[k], points[k] + distance[k] * normals[k])
            radius *= SHRINK
        return best if np.isfinite(best[0]) else (start.distance, start.point, start.point)

    def _patch(self, number: int) -> tuple[F64, F64, F64, np.ndarray]:
        """Boxes, centres and indices of the triangles of a B-rep face."""
        if number not in self.patches:
            face = np.flatnonzero(self.mesh.face_ids == number)
            t = self.mesh.triangles[face]
            middle = (t[:, 0] + t[:, 1] + t[:, 2]) / 3.0
            self.patches[number] = (t.min(axis=1), t.max(axis=1), middle, face)
        return self.patches[number]


def _rim_nodes(graph: FaceGraph, faces: np.ndarray) -> np.ndarray:
    """Mesh vertices on the B-rep edges of faces."""
    nodes = [k.nodes for f in faces for k in graph.at[int(f)]]
    return np.unique(np.concatenate(nodes)) if nodes else np.zeros(0, np.int64)


def _smooth_normals(mesh: TriangleMesh, face: np.ndarray, middle: F64, centre: F64, points: F64) -> F64:
    """Normals that vary linearly, fitted to the facets of one B-rep face round a centre.

    Facet normals are right in the middle of a facet only; at the border of a bent face they are half a facet off.
    Returns (n, 3) float64, unit, at points (n, 3).
    """
    square = ((middle - centre) ** 2).sum(axis=1)
    order = np.argpartition(square, FIT_FACETS)[:FIT_FACETS] if len(face) > FIT_FACETS else np.arange(len(face))
    near, weight = face[order], np.sqrt(mesh.areas[face[order]])
    offset = middle[order] - centre
    scale = max(float(np.abs(offset).max()), 1e-12)
    design = np.column_stack([np.ones(len(near)), offset / scale])
    fit = np.linalg.lstsq(design * weight[:, None], mesh.normals[near] * weight[:, None], rcond=1e-3)[0]
    out = np.column_stack([np.ones(len(points)), (points - centre) / scale]) @ fit
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None])


def _points_near(mesh: TriangleMesh, triangles: np.ndarray, centre: F64, radius: float, seed: int) -> F64:
    """Points on triangles within about a radius of a centre: corners (slightly inset) and a random spread."""
    if len(triangles) == 0:
        return np.zeros((0, 3))
    t = mesh.triangles[triangles]
    corner = (t + INSET * (t.mean(axis=1, keepdims=True) - t)).reshape(-1, 3)
    rng = np.random.default_rng(seed)
    pick = np.unique(np.linspace(0, len(t) - 1, min(len(t), 64)).astype(int))
    spread = _onto_triangles(t[pick], centre + radius * rng.uniform(-1.0, 1.0, (POINTS, 3)))
    points = np.concatenate([corner, spread])
    return np.asarray(points[np.linalg.norm(points - centre, axis=1) <= 1.8 * radius])


def _onto_triangles(t: F64, points: F64) -> F64:
    """Points projected into the plane of each triangle, kept where they fall inside it: (k, 3) float64."""
    e1, e2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    n = np.cross(e1, e2)
    square = np.einsum("ij,ij->i", n, n)
    good = square > 0
    t, e1, e2, n, square = t[good], e1[good], e2[good], n[good], square[good]
    w = points[None] - t[:, 0][:, None]
    b1 = np.einsum("ijk,ik->ij", np.cross(w, e2[:, None]), n) / square[:, None]
    b2 = np.einsum("ijk,ik->ij", np.cross(e1[:, None], w), n) / square[:, None]
    i, j = np.nonzero((b1 > INSET) & (b2 > INSET) & (b1 + b2 < 1 - INSET))
    return np.asarray(t[i, 0] + b1[i, j, None] * e1[i] + b2[i, j, None] * e2[i])
