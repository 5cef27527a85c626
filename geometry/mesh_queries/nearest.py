"""The place of a mesh nearest to a point."""

from __future__ import annotations

import numpy as np

from geometry.kernels.nearest import nearest_triangles
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree


def nearest(tree: TriangleTree, points: F64, most: float = np.inf) -> tuple[F64, np.ndarray, F64]:
    """Distances from points to a mesh, the triangles that are nearest, and the places on them.

    tree   : TriangleTree
    points : (n, 3) float64, mm, in the frame of the mesh
    most   : mm; what is farther is not looked for

    Returns
    -------
    (n,) float64, mm, exact to rounding, (n,) int64 triangles of the mesh and (n, 3) float64 points of them; inf, -1
    and the points themselves where nothing is that near
    """
    t = tree.arrays
    points = np.ascontiguousarray(points)
    out, row, feet = np.empty(len(points)), np.empty(len(points), np.int64), points.copy()
    nearest_triangles(t.lower, t.upper, t.child, t.first, t.size, t.corners, points, most, out, row, feet)
    found = row >= 0
    triangle = np.full(len(points), -1, np.int64)
    triangle[found] = t.order[row[found]]
    return out, triangle, feet
