"""Height of a mesh seen from above: the drop of a point.

Apart from ``geometry.mesh_queries.rays``, so that who asks for rays does not bring the drop kernel in.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_grid, drop_tips


def heights(tree: TriangleTree, xy: ArrayLike) -> F64:
    """Top z of the mesh over each point (n, 2), mm; -inf where there is nothing. Errors as ``drop_tips``."""
    return drop_tips(tree, xy, 0.0, 0.0)


def height_grid(tree: TriangleTree, x0: float, y0: float, step: float, nx: int, ny: int) -> F64:
    """Top z of the mesh over a grid of points.

    Element [j, i] of the (ny, nx) float64 result, mm, is the height at (x0 + i step, y0 + j step), -inf where
    there is nothing. Parameters and errors are those of ``drop_grid``. A facet steeper than 1e-9 rad from
    vertical counts as its edges only, which have no height over a point.
    """
    return drop_grid(tree, x0, y0, step, nx, ny, 0.0, 0.0)
