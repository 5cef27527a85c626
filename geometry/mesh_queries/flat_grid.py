"""Lowest tip heights over a grid of points on a mesh with large level facets, as plates have them.

Steps
-----
1. The grid is cut into blocks of ``BLOCK`` x ``BLOCK`` points.
2. Blocks that a border of a level area comes near are measured point by point.
3. Every other block lies wholly over one level area, or over none. The facet under its middle says which.
4. Where nothing in reach of the block is higher than that area, the tip rests on it at all points of the block.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import LeaningSide, Side, drop_contacts, drop_grid, drop_tips

BLOCK = 16  # points along a side
LARGE = 1_000_000  # points: a smaller grid is measured point by point
EVEN = 1e-9  # mm, heights that are the same


def drop_over_flats(tree: TriangleTree, x0: float, y0: float, step: float, nx: int, ny: int, radius: float,
                    corner_radius: float, large: int = LARGE, side: Side | None = None) -> F64:
    """Lowest tip height over a grid of points, with few queries over level areas.

    x0, y0 : float, mm, the first point, frame of the mesh
    step   : float, mm, distance of neighbours
    nx, ny : int, number of points along x and y
    radius, corner_radius : float, mm, of the body, as in ``geometry.mesh_queries.drop.drop_tips``
    large  : int, number of points from which on areas are looked for
    side   : LeaningSide of a tapered mill, ArcPair of a circle segment mill, None for an upright side

    Returns
    -------
    (ny, nx) float64, mm
        As ``geometry.mesh_queries.drop.drop_grid`` gives them, to ``EVEN``.

    Raises
    ------
    GeometryError
        As ``geometry.mesh_queries.drop.drop_grid``.
    """
    if nx * ny < large:
        return drop_grid(tree, x0, y0, step, nx, ny, radius, corner_radius, side)
    across = BLOCK * step
    shape = (-(-ny // BLOCK), -(-nx // BLOCK))
    level, edges = _level_areas(tree.mesh)
    whole = ~_marked(edges, np.array([x0, y0]) - 0.5 * step, across, shape)
    row, column = np.nonzero(whole)
    middle = np.array([x0, y0]) + (np.column_stack([column, row]) + 0.5) * across - 0.5 * step
    under = drop_contacts(tree, middle, 0.0, 0.0)
    flat = (under.triangle >= 0) & level[under.triangle]
    row, column, middle, height = row[flat], column[flat], middle[flat], under.z[flat]
    widest = side.widest if isinstance(side, LeaningSide) else radius
    most = drop_tips(tree, middle, max(radius, widest) + across * np.sqrt(0.5), 0.0)
    flat = most <= height + EVEN
    heights = np.full(shape, np.nan)
    heights[row[flat], column[flat]] = most[flat]
    out = np.repeat(np.repeat(heights, BLOCK, axis=0), BLOCK, axis=1)[:ny, :nx].copy()
    j, i = np.nonzero(np.isnan(out))
    out[j, i] = drop_tips(tree, np.column_stack([x0 + i * step, y0 + j * step]), radius, corner_radius, side=side)
    return out


def _level_areas(mesh: TriangleMesh) -> tuple[NDArray[np.bool_], F64]:
    """(m,) bool, level facets that look up; and the borders of the areas they make, (k, 2, 2) float64, mm, in plan."""
    t = mesh.triangles
    level = (np.ptp(t[:, :, 2], axis=1) <= EVEN) & (mesh.normals[:, 2] > 0.5)
    f = mesh.faces[level]
    ends = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]).astype(np.int64)
    key = np.sort(ends, axis=1)
    _, group, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    return level, mesh.vertices[ends[count[group.reshape(-1)] != 2]][:, :, :2]


def _marked(edges: F64, low: F64, side: float, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Blocks (rows, columns) that an edge (k, 2, 2), mm, comes near: those it meets, and their neighbours."""
    steps = np.ceil(4.0 * np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / side).astype(np.int64) + 1
    of = np.repeat(np.arange(len(edges)), steps + 1)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)) / steps[of]
    at = np.floor((edges[of, 0] + share[:, None] * (edges[of, 1] - edges[of, 0]) - low) / side).astype(np.int64)
    near = np.zeros((shape[0] + 2, shape[1] + 2), np.bool_)
    inside = (at >= -1).all(axis=1) & (at[:, 0] <= shape[1]) & (at[:, 1] <= shape[0])
    near[at[inside, 1] + 1, at[inside, 0] + 1] = True
    return np.asarray(ndimage.binary_dilation(near, np.ones((3, 3)))[1:-1, 1:-1])


__all__ = ["drop_over_flats"]
