"""Borders of the sides of walls, and the shortest rays there.

The shortest ray of a channel often begins on a border of a side or meets one. The search for it there runs along the
border, in one dimension. A ray that meets a border point q begins at the foot of the perpendicular from q on the other
side. So these rays are found backwards, from the nearest point of that side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64, TriangleMesh

# Largest number of first points on a border; number of the best points to refine; rounds; refinement of each round.
MAX_STARTS, CLOSER, TIMES, FINER = 3000, 6, 5, 8


Rays = Callable[[F64, np.ndarray], tuple[F64, F64, F64]]
"""From points (k, 3) and their triangles to lengths (inf: no ray), starts of the rays, and feet."""


@dataclass(frozen=True, eq=False)
class BorderPlaces:
    """Places along a border.

    piece : (k,) int64, index of the piece of the border
    t     : (k,) float64, dimensionless, 0 to 1 along the piece
    half  : (k,) float64, dimensionless, half the distance to the next place
    """

    piece: np.ndarray
    t: F64
    half: F64


@dataclass(frozen=True, eq=False)
class SideBorder:
    """The border of the sides of a wall, in the frame of the part.

    ends     : (m, 2, 3) float64, mm, its straight pieces between mesh nodes
    middle   : (m, 3) float64, mm, of the side triangle at each
    triangle : (m,) int, that triangle
    nodes    : (m, 2) int, mesh vertices at the ends
    """

    ends: F64
    middle: F64
    triangle: np.ndarray
    nodes: np.ndarray

    @classmethod
    def of(cls, mesh: TriangleMesh, side: np.ndarray) -> SideBorder:
        """The border of some triangles of a mesh: the edges that only one of them has.

        side : (k,) int64, index of the triangles
        """
        edges, _, alone = _edges(mesh.faces[side])
        at = side[alone % len(side)]
        return cls(mesh.vertices[edges[alone]], mesh.triangles[at].mean(axis=1), at, edges[alone])

    def places(self) -> BorderPlaces:
        """Evenly spread places, one or more on each piece."""
        lengths = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        count = np.maximum(np.ceil(MAX_STARTS * lengths / max(float(lengths.sum()), 1e-30)), 1.0).astype(np.int64)
        piece = np.repeat(np.arange(len(count)), count)
        half = 0.5 / count[piece]
        within = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
        return BorderPlaces(piece, (2.0 * within + 1.0) * half, half)

    def points(self, at: BorderPlaces, inset: float) -> F64:
        """(k, 3) float64, mm, frame of the mesh: the places, moved by a share of a triangle into the side."""
        a, b = self.ends[at.piece, 0], self.ends[at.piece, 1]
        p = a + at.t[:, None] * (b - a)
        return np.asarray(p + inset * (self.middle[at.piece] - p))

    def least(self, rays: Rays, at: BorderPlaces, length: F64, inset: float) -> tuple[float, F64, F64] | None:
        """The shortest ray at the border; None where there is none.

        at     : BorderPlaces of the first look
        length : (k,) float64, mm, lengths of the rays there, inf for no ray
        inset  : share of a triangle by which places are moved into the side

        Returns the length (mm), and start and foot, both (3,) float64, mm, frame of the mesh.
        """
        best: tuple[float, F64, F64] | None = None
        keep = CLOSER
        for _ in range(TIMES):
            order = np.argsort(length, kind="stable")[:keep]
            order = order[np.isfinite(length[order])]
            if len(order) == 0:
                break
            spread = np.linspace(-1.0, 1.0, 2 * FINER + 1)
            t = np.clip(at.t[order, None] + at.half[order, None] * spread, 0.0, 1.0).ravel()
            half = np.repeat(at.half[order] / FINER, len(spread))
            at = BorderPlaces(np.repeat(at.piece[order], len(spread)), t, half)
            length, start, foot = rays(self.points(at, inset), self.triangle[at.piece])
            k, keep = int(np.argmin(length)), 2
            if np.isfinite(length[k]) and (best is None or length[k] < best[0]):
                best = float(length[k]), start[k], foot[k]
        return best


def neighbours(faces: np.ndarray) -> np.ndarray:
    """The triangles across the edges 01, 12 and 20 of each triangle.

    faces : (k, 3) int64, index of the nodes of triangles; the frame of the mesh does not matter
    Returns (k, 3) int64, index in ``faces``; -1 where there is none.
    """
    edges, key, _ = _edges(faces)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order][1:] == key[order][:-1])
    a, b = order[same], order[same + 1]
    out, k = np.full(len(edges), -1, np.int64), len(faces)
    out[a], out[b] = b % k, a % k
    return np.ascontiguousarray(out.reshape(3, k).T)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges (3 k, 2) of triangles, edge 01 of all first; a number that equal edges share; the single edges."""
    f = faces.astype(np.int64)
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    number = edges.min(axis=1) * (int(edges.max(initial=0)) + 1) + edges.max(axis=1)
    _, first, key, count = np.unique(number, return_index=True, return_inverse=True, return_counts=True)
    return edges, key.ravel(), np.sort(first[count == 1])
