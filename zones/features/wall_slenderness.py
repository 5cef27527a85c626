"""Slender walls, high for their thickness: they deflect under the cutter and vibrate [Xometry2016].

The search looks at places of a side where an inward ray along the normal is short. There an upright plane, square to
the wall, cuts its faces. One connected piece of that cut is the profile. Its height runs from the lowest to the highest
place, and its thickness is the median of inward rays all along its sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from geometry.sampling import sample_surface
from zones.model import Wall

SAMPLES = 600  # on the sides of a wall
MAX_PLACES = 24  # places of a wall with a profile
PROFILE_RAYS = 40  # over the height of a profile
SKIN_SHARE = 1e-6  # of the size of the part: depth below a surface at which rays start


@dataclass(frozen=True)
class Slender:
    """The place where a wall is highest for its thickness.

    thickness, height : mm, of its profile there; at : a place on a side of it, mm
    """

    wall: str
    thickness: float
    height: float
    at: tuple[float, float, float]

    @property
    def ratio(self) -> float:
        """Height over thickness."""
        return self.height / self.thickness


def slender_walls(part: Part, tree: TriangleTree, walls: Sequence[Wall], ratio: float) -> list[Slender]:
    """Walls with a place more than ``ratio`` times as high as thick, each once, at its worst place [Xometry2016].

    part, tree : in the frame of the walls, +Z along the access

    Returns list of Slender in the order of the walls. Support at the ends of a wall or by a connection is ignored.
    """
    found = [_worst(_WallMesh(part, tree, w), ratio) for w in walls]
    return [s for s in found if s is not None]


class _WallMesh:
    """The triangles of a wall, and rays into it."""

    def __init__(self, part: Part, tree: TriangleTree, wall: Wall) -> None:
        self.wall, self.tree, self.mesh = wall, tree, part.mesh
        self.own = np.isin(part.mesh.face_ids, wall.faces)
        self.all = np.flatnonzero(self.own)
        self.sides = np.flatnonzero(np.isin(part.mesh.face_ids, wall.sides))
        self.skin = SKIN_SHARE * float(np.linalg.norm(part.bounds[1] - part.bounds[0]))

    def thickness(self, points: F64, normals: F64) -> F64:
        """(n,) mm, thickness behind places (n, 3) along inward normals; inf where the ray leaves by another face."""
        far, hit = first_hits(self.tree, points, -normals, t_min=self.skin)
        return np.where((hit >= 0) & self.own[np.maximum(hit, 0)], far, np.inf)

    def profile(self, at: F64, along: F64, seed: int) -> tuple[F64, F64, NDArray[np.int64]]:
        """Cut of the wall by a plane, the piece with triangle ``seed``: ends (m, 3) of segments, mm, and triangles.

        at, along : (3,) a place of the plane, mm, and its unit normal
        """
        corners = self.mesh.faces[self.all].astype(np.int64)
        side = ((self.mesh.vertices - at) @ along >= 0.0)[corners]
        crossed = np.flatnonzero(side.any(axis=1) & ~side.all(axis=1))
        corners, side = corners[crossed], side[crossed]
        edges = [(0, 1), (1, 2), (2, 0)]
        cut = np.stack([side[:, a] != side[:, b] for a, b in edges], axis=1)
        first = np.argmax(cut, axis=1)
        second = 2 - np.argmax(cut[:, ::-1], axis=1)
        count = len(self.mesh.vertices)
        keys, points = [], []
        for which in (first, second):
            a = corners[np.arange(len(corners)), which]
            b = corners[np.arange(len(corners)), (which + 1) % 3]
            low, high = np.minimum(a, b), np.maximum(a, b)
            p, q = self.mesh.vertices[low], self.mesh.vertices[high]
            d, e = (p - at) @ along, (q - at) @ along
            share = d / np.where(d == e, 1.0, d - e)
            keys.append(low * count + high)
            points.append(p + share[:, None] * (q - p))
        piece = _connected(keys[0], keys[1])
        triangles = self.all[crossed]
        here = np.flatnonzero(triangles == seed)
        mine = piece == piece[here[0]] if len(here) else np.zeros(len(piece), np.bool_)
        return points[0][mine], points[1][mine], triangles[mine]


def _connected(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) label of each of m segments between nodes a and b, (m,): connected segments share a label."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    nodes, inverse = np.unique(np.concatenate([a, b]), return_inverse=True)
    i, j = inverse[:len(a)], inverse[len(a):]
    graph = coo_matrix((np.ones(len(a)), (i, j)), shape=(len(nodes), len(nodes)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)[i]


def _worst(mesh: _WallMesh, ratio: float) -> Slender | None:
    wall, high = mesh.wall, mesh.wall.z_top - mesh.wall.z_bottom
    area = float(mesh.mesh.areas[mesh.sides].sum())
    if not (area > 0.0 and high > 0.0):
        return None
    samples = sample_surface(mesh.mesh, SAMPLES / area, triangles=mesh.sides)
    behind = mesh.thickness(samples.points, samples.normals)
    thin = np.flatnonzero(behind * ratio < high)
    order = thin[np.argsort(behind[thin], kind="stable")]
    picked = order[np.unique(np.linspace(0, max(len(order) - 1, 0), min(len(order), MAX_PLACES)).astype(int))]
    best: Slender | None = None
    for k in picked.tolist():
        found = _at(mesh, samples.points[k], samples.normals[k], int(samples.triangle[k]))
        if found is not None and found.ratio > max(ratio, 0.0 if best is None else best.ratio):
            best = Slender(wall.id, found.thickness, found.height, found.at)
    return best


def _at(mesh: _WallMesh, at: F64, normal: F64, triangle: int) -> Slender | None:
    """The profile at a place of a side."""
    along = np.array([-normal[1], normal[0], 0.0])
    length = float(np.linalg.norm(along))
    if length < 1e-6:
        return None
    start, end, owner = mesh.profile(at, along / length, triangle)
    on_side = np.isin(owner, mesh.sides)
    if not on_side.any():
        return None
    z = np.concatenate([start[:, 2], end[:, 2]])
    points, share, of = _spread(start[on_side], end[on_side], float(np.ptp(z)) / PROFILE_RAYS)
    thickness = _median(mesh.thickness(points, mesh.mesh.normals[owner[on_side][of]]), share)
    if not (np.isfinite(thickness) and thickness > 0.0):
        return None
    x, y, up = (float(v) for v in at)
    return Slender(mesh.wall.id, thickness, float(z.max() - z.min()), (x, y, up))


def _spread(start: F64, end: F64, pitch: float) -> tuple[F64, F64, NDArray[np.int64]]:
    """Places (k, 3) on segments (m, 3), at most ``pitch`` mm apart, the length each represents, and its segment."""
    length = np.linalg.norm(end - start, axis=1)
    count = np.maximum(1, np.ceil(length / max(pitch, 1e-9))).astype(np.int64)
    of = np.repeat(np.arange(len(start)), count)
    within = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    share = (within + 0.5) / count[of]
    return start[of] + share[:, None] * (end - start)[of], (length / count)[of], of


def _median(values: F64, weights: F64) -> float:
    """The weighted median."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][int(np.searchsorted(total, 0.5 * total[-1]))])


__all__ = ["Slender", "slender_walls"]
