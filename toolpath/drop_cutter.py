"""Drop-cutter and push-cutter: where a cutter first touches a mesh, coming from above or along a horizontal direction.

Places are in mm, in the frame of the mesh with Z along the tool axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries import drop, outline_drop, push
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.revolved_outline import Outline
from toolpath.cutter.cutter import Cutter


@dataclass(frozen=True, eq=False)
class CutterContacts:
    """Where a cutter stops, and what it touches there.

    value    : (n,) float64, mm, result of ``drop_cutter`` or ``push_cutter``
    point    : (n, 3) float64, mm, frame of the mesh, cutter contact; NaN where nothing is touched
    triangle : (n,) int32, index, triangle of the mesh; -1 where nothing is touched
    face_id  : (n,) int32, index, its B-rep face as in ``TriangleMesh.face_ids``; -1 where nothing is touched
    """

    value: F64
    point: F64
    triangle: I32
    face_id: I32


def drop_cutter(mesh: TriangleMesh | TriangleTree, cutter: Cutter, xy: ArrayLike) -> F64:
    """Lowest tip height at which the cutter leaves the mesh untouched [Yau2004].

    mesh   : TriangleMesh, or a TriangleTree over it for repeated use
    cutter : Cutter, upright (+z)
    xy     : (n, 2) float64, mm, frame of the mesh, places of the cutter axis

    Returns
    -------
    (n,) float64, mm
        Tip heights, exact for the mesh to 1e-10 mm; -inf where nothing lies below the cutter.

    Raises
    ------
    GeometryError
        ``xy`` is not (n, 2) finite numbers, or the mesh has a vertex that is not finite.
    TypeError
        ``mesh`` or ``cutter`` has another type.

    Examples
    --------
    >>> from geometry.mesh import TriangleMesh
    >>> floor = TriangleMesh([[0, 0, 2], [10, 0, 2], [0, 10, 2]], [[0, 1, 2]])
    >>> drop_cutter(floor, Cutter.ball(diameter=3, length=9), [[2, 2], [50, 50]])
    array([  2., -inf])
    """
    tree = _tree(mesh, cutter)
    if cutter.outline is not None:
        return outline_drop.drop_turned(tree, xy, cutter.outline)
    return drop.drop_tips(tree, xy, cutter.radius, cutter.corner_radius)


def drop_contacts(mesh: TriangleMesh | TriangleTree, cutter: Cutter, xy: ArrayLike) -> CutterContacts:
    """``drop_cutter`` with the contact that holds each tip up.

    mesh   : TriangleMesh, or a TriangleTree over it for repeated use
    cutter : Cutter, upright (+z)
    xy     : (n, 2) float64, mm, frame of the mesh, places of the cutter axis

    Raises
    ------
    GeometryError
        As ``drop_cutter``.
    TypeError
        As ``drop_cutter``.
    """
    tree = _tree(mesh, cutter)
    if cutter.outline is not None:
        got = outline_drop.turned_contacts(tree, xy, cutter.outline)
    else:
        got = drop.drop_contacts(tree, xy, cutter.radius, cutter.corner_radius)
    return CutterContacts(got.z, got.point, got.triangle, _faces(tree, got.triangle))


def push_cutter(mesh: TriangleMesh | TriangleTree, cutter: Cutter, tips: ArrayLike, direction: ArrayLike) -> F64:
    """Distance that a cutter moves along a horizontal direction until it first touches the mesh, coming from far away.

    mesh      : TriangleMesh, or a TriangleTree over it for repeated use
    cutter    : Cutter, upright (+z)
    tips      : (n, 3) float64, mm, frame of the mesh, a point on the path of each tip
    direction : (2,) float64, dimensionless, frame of the mesh, of any length above 0

    Returns
    -------
    (n,) float64, mm
        From the given tip along the direction; negative where the cutter stops before it, +inf where nothing is in its
        path. Exact for the mesh to 1e-9 mm over the sine of the angle between the direction and the touched facet.

    Raises
    ------
    GeometryError
        ``tips`` is not (n, 3) finite numbers, the direction is zero or not finite, or a vertex of the mesh is not
        finite.
    TypeError
        ``mesh`` or ``cutter`` has another type.

    Examples
    --------
    >>> from geometry.mesh import TriangleMesh
    >>> wall = TriangleMesh([[9, -9, 0], [9, 9, 0], [9, 0, 8]], [[0, 1, 2]])
    >>> push_cutter(wall, Cutter.flat(diameter=4, length=9), [[0, 0, 1], [0, 40, 1]], [1, 0])
    array([ 7., inf])
    """
    tree = _tree(mesh, cutter)
    return push.push_stops(tree, tips, direction, _outline(cutter))


def push_contacts(mesh: TriangleMesh | TriangleTree, cutter: Cutter, tips: ArrayLike,
                  direction: ArrayLike) -> CutterContacts:
    """``push_cutter`` with the contact that ends each path.

    mesh      : TriangleMesh, or a TriangleTree over it for repeated use
    cutter    : Cutter, upright (+z)
    tips      : (n, 3) float64, mm, frame of the mesh, a point on the path of each tip
    direction : (2,) float64, dimensionless, frame of the mesh, of any length above 0

    Raises
    ------
    GeometryError
        As ``push_cutter``.
    TypeError
        As ``push_cutter``.
    """
    tree = _tree(mesh, cutter)
    got = push.push_contacts(tree, tips, direction, _outline(cutter))
    return CutterContacts(got.distance, got.point, got.triangle, _faces(tree, got.triangle))


def _tree(mesh: TriangleMesh | TriangleTree, cutter: Cutter) -> TriangleTree:
    if not isinstance(cutter, Cutter):
        raise TypeError(f"cutter must be a Cutter, got {type(cutter).__name__}")
    if isinstance(mesh, TriangleMesh):
        return TriangleTree(mesh)
    if isinstance(mesh, TriangleTree):
        return mesh
    raise TypeError(f"mesh must be a TriangleMesh or a TriangleTree, got {type(mesh).__name__}")


def _outline(cutter: Cutter) -> Outline:
    return cutter.outline if cutter.outline is not None else Outline.bull(cutter.radius, cutter.corner_radius)


def _faces(tree: TriangleTree, triangle: I32) -> I32:
    ids = np.append(tree.mesh.face_ids, np.int32(-1))  # the last for those that touch nothing
    return np.asarray(ids[triangle])
