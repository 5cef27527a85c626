"""A mesh cut by a horizontal plane: directed segments, the material on their right, linked into loops.

Notation
    up edge    the edge of a triangle that runs, counter-clockwise seen from outside, from below the plane to above it
    down edge  the edge that runs back; a walk from the up edge to the down edge has the void on the left
A vertex in the plane counts as above it, so every cut triangle has one edge of each kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree


@dataclass(frozen=True, eq=False)
class Slice:
    """Cut of a mesh by a horizontal plane.

    height    : mm
    start,end : (n, 2) float64, mm, in plan; the void is on the left of start -> end
    triangle  : (n, 3, 3) float64, mm, the cut triangles
    face      : (n,) int, B-rep face numbers
    following : (n,) int, the segment that starts where this one ends; -1 where the mesh is open
    """

    height: float
    start: F64
    end: F64
    triangle: F64
    face: np.ndarray
    following: np.ndarray

    @cached_property
    def tree(self) -> TriangleTree:
        """The cut triangles, for rays in the plane; a triangle there has the index of its segment here."""
        rows = np.arange(3 * len(self.face), dtype=np.int32).reshape(-1, 3)
        return TriangleTree(TriangleMesh(self.triangle.reshape(-1, 3), rows))

    @cached_property
    def loops(self) -> list[np.ndarray]:
        """Segments in walking order, (k,) int64, index, for each loop; open chains of a torn mesh come first."""
        following = self.following.tolist()
        has_before = np.zeros(len(following), bool)
        has_before[self.following[self.following >= 0]] = True
        seen = [False] * len(following)
        out = []
        for first in [*np.flatnonzero(~has_before).tolist(), *range(len(following))]:
            row, walk = first, []
            while row >= 0 and not seen[row]:
                seen[row] = True
                walk.append(row)
                row = following[row]
            if walk:
                out.append(np.array(walk))
        return out

    def holds(self, point: F64) -> bool:
        """Whether a point in plan lies in the material.

        point : (2,) float64, mm, in plan
        """
        (x, y), (x0, y0), (x1, y1) = point, self.start.T, self.end.T
        crossing = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            right = x0 + (y - y0) * (x1 - x0) / (y1 - y0) > x
        return bool(np.count_nonzero(crossing & right) % 2)


class Slicer:
    """A mesh prepared for cuts at many heights; it keeps the results.

    mesh : TriangleMesh, mm, closed and outward
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        z = mesh.vertices[:, 2]
        corners = [z[mesh.faces[:, k]] for k in range(3)]
        self.low = np.minimum(np.minimum(corners[0], corners[1]), corners[2])
        self.high = np.maximum(np.maximum(corners[0], corners[1]), corners[2])
        self.done: dict[float, Slice] = {}
        self.rows = np.sort(z)

    def clear_of_nodes(self, height: float, room: float) -> float:
        """The height within ``room`` (mm) of a given height that lies farthest from any node of the mesh, mm.

        Nodes of one row differ in height by rounding, and a plane through them zigzags between its neighbours.
        """
        low, high = np.searchsorted(self.rows, [height - room, height + room])
        marks = np.concatenate([[height - room], self.rows[low:high], [height + room]])
        widest = int(np.argmax(np.round(np.diff(marks) / room, 6)))
        return float(0.5 * (marks[widest] + marks[widest + 1]))

    def cut(self, height: float) -> Slice:
        """Cut with the plane z = height (mm).

        Returns Slice, exact but for rounding; segments without length are kept, since they link their neighbours.
        """
        if height not in self.done:
            self.done[height] = self._cut(height)
        return self.done[height]

    def _cut(self, height: float) -> Slice:
        rows = np.flatnonzero((self.low < height) & (self.high >= height))
        vertices, nodes = self.mesh.vertices, self.mesh.faces[rows].astype(np.int64)
        corner = vertices[nodes, 2] >= height
        following = np.roll(corner, -1, axis=1)
        up_edge = _edge(nodes, np.argmax(~corner & following, axis=1))
        down_edge = _edge(nodes, np.argmax(corner & ~following, axis=1))
        start, end = (_crossing(vertices, e, height) for e in (up_edge, down_edge))
        up_key, down_key = (e.min(axis=1) * len(vertices) + e.max(axis=1) for e in (up_edge, down_edge))
        order = np.argsort(up_key, kind="stable")
        place = np.minimum(np.searchsorted(up_key[order], down_key), max(len(rows) - 1, 0))
        linked = order[place] if len(rows) else np.zeros(0, np.int64)
        linked = np.where(up_key[linked] == down_key, linked, -1)
        face = self.mesh.face_ids[rows].astype(np.int64)
        return Slice(height, start, end, vertices[nodes], face, linked)


def _edge(nodes: np.ndarray, first: np.ndarray) -> np.ndarray:
    row = np.arange(len(nodes))
    return np.column_stack([nodes[row, first], nodes[row, (first + 1) % 3]])


def _crossing(vertices: F64, edge: np.ndarray, height: float) -> F64:
    # From the vertex with the lower number, so that both triangles of an edge get the same point bit for bit.
    p, q = vertices[edge.min(axis=1)], vertices[edge.max(axis=1)]
    t = (height - p[:, 2]) / (q[:, 2] - p[:, 2])
    return np.asarray(p[:, :2] + t[:, None] * (q - p)[:, :2])
