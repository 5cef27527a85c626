"""Ways out of a blank that is a mesh, grown all round, along straight lines."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits

CLOSE = 1e-6  # mm: as near as this to the surface is on it
MAX_STEPS = 200


def way_out_of_mesh(tree: TriangleTree, points: F64, directions: F64, beyond: float, reach: float) -> F64:
    """How far it is out of a closed mesh grown by ``beyond`` mm, the first time, along directions; not over ``reach``.

    tree       : TriangleTree, of a closed mesh with its normals outwards, mm
    points     : (n, 3) float64, mm; directions : (n, 3) float64, unit
    beyond, reach : float, mm, 0 or more

    Returns (n,) float64, mm: 0 where a point is out from the beginning.

    Notes
    -----
    A place is inside the mesh where the first facet ahead is seen from behind. Inside, the way goes on to that facet
    and as far as ``beyond`` it, for a ball round the place where it is met is part of what is grown; outside, by as
    much as the nearest place of the mesh is nearer than ``beyond``, which never passes the surface looked for (sphere
    tracing). Within 1e-6 mm it is taken for reached. A line that grazes it for 200 steps gets ``reach``: too much and
    never too little.
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
