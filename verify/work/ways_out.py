"""The shortest way out of the stock that stands on a sample, sideways included.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from verify.tool_axes import square_to
from verify.work.asked_faces import Cutting

AROUND = 8  # directions round the normal, at each slope
SLOPES = (0.0, math.radians(45.0))  # over the tangent plane
BELOW = 0.01  # cosine: a way farther than this against all tool axes is no way that a tool comes
PARALLEL = 0.999  # cosine: an axis nearer to the normal than this says nothing of the tangent plane
ROUNDING = 1e-6  # mm: a ray starts this far off at least


@dataclass(frozen=True, eq=False)
class WaysOut:
    """Shortest ways out of the stock on n samples.

    length    : (n,) float64, mm, inf where all are longer or meet the part
    direction : (n, 3) float64, unit, setup frame, of the shortest one
    mover     : (n,) int32, index, the move that it leads to; -1 where none
    """

    length: F64
    direction: F64
    mover: I32


def ways_out(points: F64, normals: F64, axes: F64, lift: float, most: float, cutting: Cutting,
             below: NDArray[np.bool_] | None = None) -> WaysOut:
    """The shortest ways that tools can come: from samples through the stock to a cut, or out of the blank.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part
    axes : (k, 3) float64, unit, setup frame, tip to spindle, axes of the tools, the most used first
    lift : mm, how far off the surface along the normal the ways begin; so much stock does not count
    most : mm; longer ways are not looked for
    below : (n,) bool, samples to which a tool comes below an overhang: ways to a cut against the axes count; None: none

    Returns WaysOut.

    Notes
    -----
    Ways run along the normal, along the first axis, and along 16 more directions, 8 in the tangent plane and 8 at 45
    degrees, one of them as near to the first axis as it goes. The true way is shorter: in the tangent plane, out of
    stock with a straight side, by at most 8 % (cos 22.5 degrees); along an upright wall, out of stock with a level top,
    by nothing. A way against all axes leads out where no tool comes from, as through the bottom of the blank; it is no
    height.
    """
    n = len(points)
    if not n:
        return WaysOut(np.zeros(0), np.zeros((0, 3)), np.zeros(0, np.int32))
    x = _towards(normals, axes[0])
    y = np.cross(normals, x)
    turn = 2.0 * math.pi * np.arange(AROUND) / AROUND
    level = np.cos(turn)[:, None, None] * x + np.sin(turn)[:, None, None] * y
    up = np.where(normals @ axes[0][:, None] > 0.0, axes[0], normals)
    ways = [normals[None], *(math.cos(s) * level + math.sin(s) * normals for s in SLOPES), up[None]]
    directions = np.concatenate(ways)
    start = np.broadcast_to(points + max(lift, ROUNDING) * normals, directions.shape)
    length, mover = cutting.way_through_stock(np.ascontiguousarray(start.reshape(-1, 3)),
                                              np.ascontiguousarray(directions.reshape(-1, 3)), most, ROUNDING)
    length, mover = length.reshape(-1, n), mover.reshape(-1, n)
    against = (directions @ axes.T).max(axis=2) < -BELOW
    against[0] = False  # the normal is the way of whatever touches the sample
    if below is not None:
        against &= ~below | (mover < 0)
    length[against] = np.inf
    best, row = np.argmin(length, axis=0), np.arange(n)
    return WaysOut(length[best, row], directions[best, row], mover[best, row])


def _towards(normals: F64, axis: F64) -> F64:
    """Unit vectors square to (n, 3) normals, nearest to ``axis``, (3,) unit; any where both are parallel."""
    out = square_to(normals)
    along = normals @ axis
    leaning = np.abs(along) < PARALLEL
    square = axis - along[leaning, None] * normals[leaning]
    out[leaning] = square / np.linalg.norm(square, axis=1)[:, None]
    return out
