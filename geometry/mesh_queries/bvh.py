"""Bounding volume hierarchy over a triangle mesh."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from geometry.errors import GeometryError
from geometry.kernels.bvh import LEAF_SIZE, TreeArrays, build_nodes, column_rows, facet_rows, hull_rows
from geometry.mesh import F64, TriangleMesh


class TriangleTree:
    """Hierarchy over the triangles of a mesh, built once and read by every kernel [MacDonald1990, Wald2007].

    mesh      : TriangleMesh, kept as ``.mesh``
    leaf_size : int, most triangles in a leaf

    ``.arrays`` is a ``TreeArrays`` named tuple that njit functions take as one argument. The tree depends on
    the mesh alone, so the same mesh gives the same bytes.

    Raises
    ------
    GeometryError
        A vertex is not finite; the subjects name the first.
    """

    def __init__(self, mesh: TriangleMesh, *, leaf_size: int = LEAF_SIZE) -> None:
        finite = np.isfinite(mesh.vertices).all(axis=1)
        if not finite.all():
            bad = int(np.flatnonzero(~finite)[0])
            raise GeometryError(f"vertex {bad} of the mesh is not finite", code="mesh_not_finite",
                                subjects=(f"vertex {bad}",), remedy="mesh the shape again")
        self.mesh = mesh
        self.arrays = _arrays(mesh, leaf_size)

    @cached_property
    def hulls(self) -> F64:
        """(k, 16) float64, mm, frame of the mesh: ``hull_rows`` of the nodes, for queries along many axes."""
        t = self.arrays
        return hull_rows(t.lower, t.upper, t.parent, t.first, t.size, t.corners)

    def __len__(self) -> int:
        return len(self.arrays.order)


def _arrays(mesh: TriangleMesh, leaf_size: int) -> TreeArrays:
    if len(mesh.faces) == 0:
        return _empty()
    triangles = mesh.vertices[mesh.faces]  # mesh.triangles would stay in memory
    *tables, order, nodes = build_nodes(triangles, leaf_size)
    lower, upper, child, parent, first, count = (table[:nodes].copy() for table in tables)
    corners = triangles[order]
    del triangles
    column = column_rows(lower, upper, child, parent, first, count, corners)
    return TreeArrays(lower, upper, column, child, parent, first, count, order, corners, facet_rows(corners))


def _empty() -> TreeArrays:
    """A root without triangles: every query misses it."""
    none = np.zeros(0, np.int32)
    column = np.array([[np.inf, -np.inf, np.inf, -np.inf, -np.inf, 0.0, 0.0, -np.inf, 0.0, 1.0]])
    return TreeArrays(np.full((1, 3), np.inf), np.full((1, 3), -np.inf), column, np.full(1, -1, np.int32),
                      np.full(1, -1, np.int32), np.zeros(1, np.int32), np.zeros(1, np.int32), none,
                      np.zeros((0, 3, 3)), np.zeros((0, 5)))
