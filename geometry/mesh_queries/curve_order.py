"""Order of queries along a curve that fills the plane, so that neighbours follow each other.

Neighbouring queries visit the same nodes of the hierarchy. Scattered queries wait for memory where the hierarchy is
larger than the cache. Along a space-filling curve most nodes are in the cache already. Queries are independent, so the
order changes no byte of the answers.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64

MANY = 2048  # queries from which on sorting pays
LARGE = 10_000  # triangles from which on the hierarchy does not fit the nearest cache
BITS = 10  # of each coordinate on the curve
NEAR = 8.0  # steps between successive queries, in spacings of as many on a lattice, up to which they are in order


def along_curve(xy: F64, triangles: int) -> NDArray[np.intp] | None:
    """Order of points along a Morton curve [Morton1966], None where sorting does not pay.

    xy        : (n, 2) float64, mm, finite, x and y in the frame of the mesh
    triangles : int, count of the triangles of the mesh

    Returns (n,) intp, index of each point in the new order.
    """
    n = len(xy)
    if n < MANY or triangles < LARGE:
        return None
    lo = xy.min(axis=0)
    extent = float((xy.max(axis=0) - lo).max())
    if not extent > 0.0 or float(np.abs(np.diff(xy, axis=0)).mean()) <= NEAR * extent / np.sqrt(n):
        return None
    cell = ((xy - lo) * ((1 << BITS) / extent)).astype(np.uint32).clip(max=(1 << BITS) - 1)
    return np.asarray(np.argsort(_spread(cell[:, 0]) | (_spread(cell[:, 1]) << np.uint32(1)), kind="stable"))


def in_order(call: Callable[[F64, NDArray[np.generic]], None], points: F64, triangles: int,
             out: NDArray[np.generic]) -> None:
    """Answer queries in the order of the curve: ``call(points, out)`` fills one row of out for each point.

    call      : takes (n, 2) float64 or wider, mm, frame of the mesh, and one like ``out``, (n,) of any dtype and unit
    points    : (n, 2) float64 or wider, mm, frame of the mesh, x and y first
    triangles : int, count of the triangles of the mesh
    out       : (n,) of any dtype and unit that ``call`` writes, filled here
    """
    order = along_curve(points[:, :2], triangles)
    if order is None:
        call(points, out)
        return
    answers = np.empty_like(out)
    call(np.ascontiguousarray(points[order]), answers)
    out[order] = answers


def _spread(v: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Bits of numbers below 2^16 with a zero after each."""
    v = (v | (v << np.uint32(8))) & np.uint32(0x00FF00FF)
    v = (v | (v << np.uint32(4))) & np.uint32(0x0F0F0F0F)
    v = (v | (v << np.uint32(2))) & np.uint32(0x33333333)
    return np.asarray((v | (v << np.uint32(1))) & np.uint32(0x55555555))
