"""First hits of rays on a mesh."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.kernels import ray as kernels
from geometry.mesh import F64, I32
from geometry.mesh_queries.bvh import TriangleTree


def first_hits(tree: TriangleTree, origins: ArrayLike, directions: ArrayLike, t_min: float = 0.0,
               t_max: float = np.inf) -> tuple[F64, I32]:
    """First triangle that each ray meets, from either side [Moller1997].

    tree       : TriangleTree
    origins    : (n, 3) float64, mm, frame of the mesh
    directions : (n, 3) float64, dimensionless, or (3,) for all rays, frame of the mesh; not zero. t counts in their
                 lengths
    t_min      : float, nearer hits do not count (an offset for rays that start on the mesh)
    t_max      : float, farther hits do not count

    Returns
    -------
    t        : (n,) float64, mm for unit vectors; inf where nothing is met
    triangle : (n,) int32, index; -1 where nothing is met

    Raises
    ------
    GeometryError
        Code 'bad_array': another shape, a value that is not finite, or a direction of zero. The subjects name which.

    Notes
    -----
    Triangles count 1e-10 of their size beyond their edges, so a ray cannot slip through a shared edge.
    """
    start = finite_points(origins, 3, "origins")
    way = np.asarray(directions, dtype=np.float64)
    if way.shape == (3,):
        way = np.broadcast_to(way, start.shape)
    way = finite_points(way, 3, "directions")
    if way.shape != start.shape:
        raise GeometryError(f"{len(start)} origins need as many directions, got {len(way)}", code="bad_array",
                            subjects=("directions",), measured=len(way), limit=len(start))
    if len(way) and not way.any(axis=1).all():
        row = int(np.flatnonzero(~way.any(axis=1))[0])
        raise GeometryError(f"directions[{row}] is zero", code="bad_array", subjects=(f"directions[{row}]",))
    n = len(start)
    t, triangle = np.empty(n), np.empty(n, np.int32)
    if numba.get_num_threads() == 1:
        kernels.hit_range(tree.arrays, start, way, float(t_min), float(t_max), 0, n, t, triangle)
    else:
        kernels.hits_parallel(tree.arrays, start, way, float(t_min), float(t_max), t, triangle)
    return t, triangle
