"""How far a body of revolution gets along a horizontal direction: the push, twin of the drop.

The body is an ``Outline``, upright, and goes on upwards as a cylinder without end. Threads and bytes are as in
``geometry.mesh_queries.drop``. Theory: docs/theory/drop.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.kernels import push as kernels
from geometry.mesh import F64, I32
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.curve_order import in_order
from geometry.mesh_queries.drop import one_thread
from geometry.mesh_queries.revolved_outline import Outline


@dataclass(frozen=True, eq=False)
class PushContacts:
    """Stops with the triangle and point of each contact, in the frame of the mesh.

    distance : (n,) float64, mm, from the given tip along the direction; +inf where nothing is in the way
    triangle : (n,) int32, triangle of the mesh that is touched; -1 where none
    point    : (n, 3) float64, mm, where it is touched; NaN where nothing is
    """

    distance: F64
    triangle: I32
    point: F64


def push_stops(tree: TriangleTree, tips: ArrayLike, direction: ArrayLike, outline: Outline) -> F64:
    """How far a body that comes from far away gets along a direction until it first touches the mesh.

    tree      : TriangleTree
    tips      : (n, 3) float64, mm, frame of the mesh, a point of each way; the body's tip passes through it
    direction : (2,) float64, dimensionless, frame of the mesh, of any length above 0
    outline   : Outline

    Returns
    -------
    (n,) float64, mm
        From the given tip on; negative where the body has to stop before it, +inf where nothing is in the way. Exact
        for mesh and outline to 1e-9 mm over the sine of the angle between the direction and what is touched.

    Raises
    ------
    GeometryError
        The tips differ from the description above, or the direction is zero or not finite; the subjects name which.
    """
    points, (dx, dy) = finite_points(tips, 3, "tips"), _unit(direction)
    out = np.empty(len(points))

    def call(at: F64, stops: Any) -> None:
        if one_thread(len(at)):
            kernels.push_range(tree.arrays, at, dx, dy, outline.stack, 0, len(at), stops)
        else:
            kernels.push_many_parallel(tree.arrays, at, dx, dy, outline.stack, stops)

    in_order(call, points, len(tree), out)
    return out


def push_contacts(tree: TriangleTree, tips: ArrayLike, direction: ArrayLike, outline: Outline) -> PushContacts:
    """``push_stops`` with the triangle and the point that end each way; parameters as there.

    tips      : (n, 3) float64, mm, frame of the mesh
    direction : (2,) float64, dimensionless, frame of the mesh

    Raises
    ------
    GeometryError
        As ``push_stops``.
    """
    points, (dx, dy) = finite_points(tips, 3, "tips"), _unit(direction)
    n = len(points)
    stop, triangle, contact = np.empty(n), np.empty(n, np.int32), np.empty((n, 3))
    kernels.contact_range(tree.arrays, points, dx, dy, outline.stack, 0, n, stop, triangle, contact)
    return PushContacts(stop, triangle, contact)


def _unit(direction: ArrayLike) -> tuple[float, float]:
    d = np.asarray(direction, dtype=np.float64)
    if d.shape == (2,) and np.isfinite(d).all() and d.any():
        d = d / np.abs(d).max()  # so that no square under- or overflows
        x, y = (d / np.hypot(*d)).tolist()
        return x, y
    raise GeometryError(f"a direction is two finite numbers, not both 0, got {d.tolist()}", code="bad_direction",
                        subjects=("direction",), measured=d.tolist(), remedy="give (x, y) of the direction")
