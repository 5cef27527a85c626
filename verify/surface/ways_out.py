"""The shortest way out of the stock that stands on a sample, sideways included.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64, I32
from verify.surface.asked_faces import Cutting
from verify.tool_axes import square_to

AROUND = 8  # directions round the normal, at each slope
SLOPES = (0.0, math.radians(45.0))  # over the tangent plane
ROUNDING = 1e-6  # mm: a ray starts this far off at least


def ways_out(points: F64, normals: F64, lift: float, most: float, cutting: Cutting) -> tuple[F64, I32]:
    """Length of the shortest way from samples through the stock to where a move has cut, or out of the blank.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part
    lift : mm, how far off the surface along the normal the ways begin; so much stock does not count
    most : mm; longer ways are not looked for

    Returns
    -------
    way   : (n,) float64, mm, inf where all ways are longer or meet the part
    mover : (n,) int32, index, the move that the shortest way leads to; -1 where none

    Notes
    -----
    Ways run along the normal and along 16 more directions, 8 in the tangent plane and 8 at 45 degrees. The true way is
    shorter: in the tangent plane, out of stock with a straight side, by at most 8 % (cos 22.5 degrees).
    """
    n = len(points)
    if not n:
        return np.zeros(0), np.zeros(0, np.int32)
    x = square_to(normals)
    y = np.cross(normals, x)
    turn = 2.0 * math.pi * np.arange(AROUND) / AROUND
    level = np.cos(turn)[:, None, None] * x + np.sin(turn)[:, None, None] * y
    ways = [normals[None], *(math.cos(s) * level + math.sin(s) * normals for s in SLOPES)]
    directions = np.concatenate(ways)
    start = np.broadcast_to(points + max(lift, ROUNDING) * normals, directions.shape)
    length, mover = cutting.way_through_stock(np.ascontiguousarray(start.reshape(-1, 3)),
                                              np.ascontiguousarray(directions.reshape(-1, 3)), most, ROUNDING)
    length, mover = length.reshape(-1, n), mover.reshape(-1, n)
    best = np.argmin(length, axis=0)
    return length[best, np.arange(n)], mover[best, np.arange(n)]
