"""Drop of any body of revolution over a mesh: tapered balls, barrels, whole assemblies.

The body is an ``Outline``, lines and arcs from the tip upwards. For balls, flat ends and bull noses alone
``geometry.mesh_queries.drop`` gives the same tips with less work. Threads and bytes are as there.
Theory: docs/theory/drop.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.kernels import outline as kernels
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.curve_order import in_order
from geometry.mesh_queries.drop import DropContacts, one_thread
from geometry.mesh_queries.revolved_outline import Outline


def drop_turned(tree: TriangleTree, xy: ArrayLike, outline: Outline) -> F64:
    """Lowest tip height of a body of revolution over each point [Yau2004].

    tree    : TriangleTree
    xy      : (n, 2) float64, mm, places of the axis in the frame of the mesh
    outline : Outline

    Returns
    -------
    (n,) float64, mm
        Exact for mesh and outline to 1e-9 mm; -inf where nothing is below.

    Raises
    ------
    GeometryError
        The points differ from the description above; the subjects name them.
    """
    points = finite_points(xy, 2, "xy")
    out = np.empty(len(points))

    def call(at: F64, tips: Any) -> None:
        if one_thread(len(at)):
            kernels.drop_range(tree.arrays, at, outline.stack, 0, len(at), tips)
        else:
            kernels.drop_many_parallel(tree.arrays, at, outline.stack, tips)

    in_order(call, points, len(tree), out)
    return out


def turned_contacts(tree: TriangleTree, xy: ArrayLike, outline: Outline) -> DropContacts:
    """``drop_turned`` with the triangle and the point that hold each tip up; parameters and errors as there.

    xy : (n, 2) float64, mm, places of the axis in the frame of the mesh
    """
    points = finite_points(xy, 2, "xy")
    n = len(points)
    z, triangle, contact = np.empty(n), np.empty(n, np.int32), np.empty((n, 3))
    kernels.contact_range(tree.arrays, points, outline.stack, 0, n, z, triangle, contact)
    return DropContacts(z, triangle, contact)
