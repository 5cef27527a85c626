"""The place of a mesh nearest to a point."""

from __future__ import annotations

import numpy as np

from geometry.kernels.nearest import nearest_triangles
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree


def nearest(tree: TriangleTree, points: F64, limit: float = np.inf) -> tuple[F64, np.ndarray, F64]:
    """Distances from points to a mesh, the nearest triangles, and the nearest places on them [Ericson2005].

    tree   : TriangleTree
    points : (n, 3) float64, mm, in the frame of the mesh
    limit  : mm; the search ends at this distance

    Returns
    -------
    distance : (n,) float64, mm, exact to rounding; inf where nothing is within the limit
    triangle : (n,) int64, index of the triangle of the mesh; -1 there
    place    : (n, 3) float64, mm, frame of the mesh; the point itself there
    """
    t = tree.arrays
    points = np.ascontiguousarray(points)
    out, row, feet = np.empty(len(points)), np.empty(len(points), np.int64), points.copy()
    nearest_triangles(t.lower, t.upper, t.child, t.first, t.size, t.corners, points, limit, out, row, feet)
    found = row >= 0
    triangle = np.full(len(points), -1, np.int64)
    triangle[found] = t.order[row[found]]
    return out, triangle, feet
