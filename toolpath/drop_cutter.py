"""Drop-cutter: the lowest tip heights of a cutter over a mesh."""

from __future__ import annotations

from numpy.typing import ArrayLike

from geometry.bvh import TriangleTree
from geometry.drop import drop_tips
from geometry.mesh import F64, TriangleMesh
from geometry.turned import drop_turned
from toolpath.cutter import Cutter


def drop_cutter(mesh: TriangleMesh | TriangleTree, cutter: Cutter, xy: ArrayLike) -> F64:
    """Lowest tip height at which the cutter leaves the mesh untouched.

    mesh   : TriangleMesh, or a TriangleTree over it where it is used again
    cutter : Cutter, upright (+z)
    xy     : (n, 2) float64, mm, places of the cutter axis

    Returns
    -------
    (n,) float64, mm
        Tip heights, exact for the mesh to 1e-10 mm; -inf where nothing lies below the cutter.

    Raises
    ------
    GeometryError
        ``xy`` is not (n, 2) finite numbers, or the mesh has a vertex that is not finite.
    TypeError
        ``mesh`` or ``cutter`` is something else.

    Examples
    --------
    >>> from geometry.mesh import TriangleMesh
    >>> floor = TriangleMesh([[0, 0, 2], [10, 0, 2], [0, 10, 2]], [[0, 1, 2]])
    >>> drop_cutter(floor, Cutter.ball(diameter=3, length=9), [[2, 2], [50, 50]])
    array([  2., -inf])
    """
    if not isinstance(cutter, Cutter):
        raise TypeError(f"cutter must be a Cutter, got {type(cutter).__name__}")
    if isinstance(mesh, TriangleMesh):
        tree = TriangleTree(mesh)
    elif isinstance(mesh, TriangleTree):
        tree = mesh
    else:
        raise TypeError(f"mesh must be a TriangleMesh or a TriangleTree, got {type(mesh).__name__}")
    if cutter.outline is not None:
        return drop_turned(tree, xy, cutter.outline)
    return drop_tips(tree, xy, cutter.radius, cutter.corner_radius)
