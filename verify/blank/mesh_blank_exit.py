"""Distances along straight lines out of a blank that is a grown mesh."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits

CLOSE = 1e-6  # mm: a place this near to the surface counts as on it
MAX_STEPS = 200


def way_out_of_mesh(tree: TriangleTree, points: F64, directions: F64, beyond: float, reach: float) -> F64:
    """Distance along directions to the first exit from a closed mesh grown by ``beyond``, at most ``reach``.

    tree       : TriangleTree, of a closed mesh with its normals outwards, mm
    points     : (n, 3) float64, mm, setup frame
    directions : (n, 3) float64, unit, setup frame
    beyond, reach : float, mm, 0 or more

    Returns (n,) float64, mm: 0 where a point is outside from the start.

    Notes
    -----
    A place is inside the mesh where its ray meets the first facet from behind. Inside, a step goes to that facet and
    ``beyond`` further: a ball of that radius round the hit belongs to the grown mesh. Outside, a step is ``beyond``
    less the distance to the mesh, so it never passes the surface (sphere tracing [Hart1996]). The search stops within
    1e-6 mm. A line that grazes the surface for 200 steps gets ``reach``: the result is never too small.
    """
    out, normals = np.zeros(len(points)), tree.mesh.normals
    active = np.arange(len(points))
    for _ in range(MAX_STEPS):
        if not len(active):
            break
        at, way = points[active] + out[active, None] * directions[active], directions[active]
        ahead, row = first_hits(tree, at, way, t_min=CLOSE)
        inside = row >= 0
        inside[inside] = np.einsum("ij,ij->i", normals[row[inside]], way[inside]) > 0.0
        further = np.where(inside, ahead + beyond, 0.0)
        outside = np.flatnonzero(~inside)
        further[outside] = np.maximum(beyond - nearest(tree, at[outside], beyond + CLOSE)[0], 0.0)
        out[active] += further
        active = active[(further > CLOSE) & (out[active] < reach)]
    out[active] = reach
    return np.minimum(out, reach)
