"""Lowest height of a body of revolution over a mesh: drop, blocked, contact and grids.

The cutter stands upright (+z), tip down. Its body is a disc-bottomed shape of ``radius`` and ``corner_radius`` (ball:
equal, flat: 0, bull nose: between) under an endless cylinder. The side of a tapered mill (``LeaningSide``) leans
outwards first. The two arcs of a circle segment mill (``ArcPair``) take the place of the corner; ``radius`` is then
where they end, and ``corner_radius`` does not count. A tip height is the lowest at which the body does not enter the
mesh; -inf where nothing is below. Theory: docs/theory/drop.md.

Arrays are split over numba's threads where it has several. Where it has one (``NUMBA_NUM_THREADS=1`` or
``numba.set_num_threads(1)``), the threading layer is not touched, so such calls may come from several
Python threads at once. The bytes are the same either way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.arc_pair import ArcPair
from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.kernels import drop as kernels
from geometry.kernels.drop import Bull, bull_of
from geometry.kernels.tapered import Tapered, tapered_of
from geometry.kernels.two_arcs import TwoArcs, two_arcs_of
from geometry.mesh import F64, I32
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.curve_order import in_order
from geometry.tool_body import ToolBody

Shape = Bull | Tapered | TwoArcs

FEW = 4000  # fewer queries do not pay for a second thread


class LeaningSide(NamedTuple):
    """The side of a tapered mill.

    taper  : float, above 0, tangent of its angle to the axis
    widest : float, mm, largest radius, where it ends
    """

    taper: float
    widest: float


Side = LeaningSide | ArcPair
"""What ends of other kinds than ball, flat and bull nose have beside their radii."""


def drop_shape(radius: float, corner_radius: float, side: Side | None = None) -> Shape:
    """The body as compiled loops take it.

    radius        : float, mm, of the cutter, or of the end of a tapered one
    corner_radius : float, mm
    side          : LeaningSide of a tapered mill, ArcPair of a circle segment mill, None for an upright side
    """
    if side is None:
        return bull_of.py_func(float(radius), float(corner_radius))
    if isinstance(side, ArcPair):
        a = side
        return two_arcs_of(*map(float, (a.flat, a.low, a.out, a.up, a.bow, a.wide, a.high)))
    return tapered_of(float(radius), float(corner_radius), float(side.taper), float(side.widest))


@lru_cache(maxsize=256)
def cutter_shape(tool: ToolBody) -> Shape:
    """The cutting part of a tool as compiled loops take it."""
    side = LeaningSide(tool.taper, tool.widest_radius) if tool.taper > 0.0 else tool.arcs
    return drop_shape(tool.radius, tool.corner_radius, side)


@dataclass(frozen=True, eq=False)
class DropContacts:
    """Tip heights with the triangle and point that hold each tip up, in the frame of the mesh.

    z        : (n,) float64, mm, tip heights; -inf where nothing is below
    triangle : (n,) int32, triangle of the mesh that is touched; -1 where none
    point    : (n, 3) float64, mm, where it is touched; NaN where nothing is
    """

    z: F64
    triangle: I32
    point: F64


def drop_tips(tree: TriangleTree, xy: ArrayLike, radius: float, corner_radius: float, out: F64 | None = None,
              side: Side | None = None) -> F64:
    """Lowest tip height over each point: contact with vertices, edges and facets [Yau2004].

    tree          : TriangleTree
    xy            : (n, 2) float64, mm, places of the axis in the frame of the mesh
    radius        : float, mm, >= 0; 0 gives the height of the mesh itself
    corner_radius : float, mm, 0 <= corner_radius <= radius
    out           : (n,) float64, mm, to write into; new when None
    side          : LeaningSide of a tapered mill, whose end has the radius, ArcPair of a circle segment mill; None for
                    an upright side

    Returns
    -------
    (n,) float64, mm
        Exact for the mesh to rounding, 1e-10 mm; -inf where nothing is below.

    Raises
    ------
    GeometryError
        Points or radii differ from the description above; the subjects name them.
    """
    points = finite_points(xy, 2, "xy")
    _check_radii(radius, corner_radius)
    result = np.empty(len(points)) if out is None else out
    if result.shape != (len(points),) or result.dtype != np.float64:
        raise GeometryError(f"out must be ({len(points)},) float64, got {result.shape} {result.dtype}",
                            code="bad_array", subjects=("out",))
    shape = drop_shape(radius, corner_radius, side)

    def call(at: F64, tips: Any) -> None:
        if one_thread(len(at)):
            kernels.drop_range(tree.arrays, at, shape, 0, len(at), tips)
        else:
            kernels.drop_many_parallel(tree.arrays, at, shape, tips)

    in_order(call, points, len(tree), result)
    return result


def drop_along(tree: TriangleTree, xy: ArrayLike, radius: float, corner_radius: float,
               side: Side | None = None) -> F64:
    """``drop_tips`` over places that follow each other as on a path, with less work the closer they are.

    xy : (n, 2) float64, mm, places of the axis in the frame of the mesh; other parameters as there

    Returns
    -------
    (n,) float64, mm
        As ``drop_tips``, to rounding.

    Raises
    ------
    GeometryError
        As ``drop_tips``.
    """
    points = finite_points(xy, 2, "xy")
    _check_radii(radius, corner_radius)
    out = np.empty(len(points))
    kernels.drop_along(tree.arrays, points, drop_shape(radius, corner_radius, side), out)
    return out


def drop_contacts(tree: TriangleTree, xy: ArrayLike, radius: float, corner_radius: float,
                  side: Side | None = None) -> DropContacts:
    """``drop_tips`` with the triangle and the point that hold each tip up; parameters as there.

    xy : (n, 2) float64, mm, places of the axis in the frame of the mesh

    Where several triangles share the contact (an edge, a vertex), the result names one of them, always the same
    one for the same mesh.

    Raises
    ------
    GeometryError
        As ``drop_tips``.
    """
    points = finite_points(xy, 2, "xy")
    _check_radii(radius, corner_radius)
    n = len(points)
    z, triangle, contact = np.empty(n), np.empty(n, np.int32), np.empty((n, 3))
    kernels.contact_range(tree.arrays, points, drop_shape(radius, corner_radius, side), 0, n, z, triangle, contact)
    return DropContacts(z, triangle, contact)


def blocked_many(tree: TriangleTree, tips: ArrayLike, radius: float, corner_radius: float,
                 side: Side | None = None) -> NDArray[np.bool_]:
    """Whether the body enters the mesh with its tip at each point.

    tips : (n, 3) float64, mm, frame of the mesh; the other parameters are those of ``drop_tips``

    Returns
    -------
    (n,) bool
        True where the lowest free tip is more than 1e-9 mm above the given one.

    Raises
    ------
    GeometryError
        As ``drop_tips``.
    """
    points = finite_points(tips, 3, "tips")
    _check_radii(radius, corner_radius)
    out = np.empty(len(points), np.bool_)
    shape = drop_shape(radius, corner_radius, side)

    def call(at: F64, blocked: Any) -> None:
        if one_thread(len(at)):
            kernels.blocked_range(tree.arrays, at, shape, 0, len(at), blocked)
        else:
            kernels.blocked_many_parallel(tree.arrays, at, shape, blocked)

    in_order(call, points, len(tree), out)
    return out


def drop_grid(tree: TriangleTree, x0: float, y0: float, step: float, nx: int, ny: int, radius: float,
              corner_radius: float, side: Side | None = None) -> F64:
    """Lowest tip height over a grid of points.

    x0, y0 : float, mm, the first point
    step   : float, mm, > 0, distance of neighbours
    nx, ny : int, number of points along x and y
    side   : LeaningSide of a tapered mill, ArcPair of a circle segment mill, None for an upright side

    Returns
    -------
    (ny, nx) float64, mm
        Element [j, i] is the tip over (x0 + i step, y0 + j step), as ``drop_tips`` gives it; frame of the mesh.

    Raises
    ------
    GeometryError
        Code 'bad_grid': a corner is not finite, or the step or a count is not positive. The errors of ``drop_tips``.
    """
    _check_radii(radius, corner_radius)
    if not (np.isfinite([x0, y0]).all() and np.isfinite(step) and step > 0.0) or nx < 0 or ny < 0:
        raise GeometryError(f"a grid needs finite corners, a positive step and counts, got {x0}, {y0}, {step}, "
                            f"{nx}, {ny}", code="bad_grid", subjects=("grid",))
    out = np.empty((int(ny), int(nx)))
    args: tuple[Any, ...] = (tree.arrays, float(x0), float(y0), float(step),
                             drop_shape(radius, corner_radius, side))
    if one_thread(nx * ny):
        kernels.grid_rows(*args, 0, len(out), out)  # type: ignore[call-arg]
    else:
        kernels.grid_parallel(*args, out)  # type: ignore[call-arg]
    return out


def one_thread(queries: int) -> bool:
    """Whether the work stays on this thread: numba has one, or the queries do not pay for another."""
    return queries < FEW or bool(numba.get_num_threads() == 1)


def _check_radii(radius: float, corner_radius: float) -> None:
    if not (np.isfinite(radius) and 0.0 <= corner_radius <= radius):
        raise GeometryError(f"need 0 <= corner radius <= radius, got {corner_radius} and {radius} mm",
                            code="bad_cutter", subjects=("radius",), measured=corner_radius, limit=radius)
