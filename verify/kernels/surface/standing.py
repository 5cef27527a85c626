"""Whether a tool of frusta takes in points where it stands."""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def _takes_in(px, py, pz, tip, axis, frusta):
    x, y, z = px - tip[0], py - tip[1], pz - tip[2]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
    for k in range(len(frusta)):
        z0, z1, r0, r1 = frusta[k, 0], frusta[k, 1], frusta[k, 2], frusta[k, 3]
        if z0 < h < z1 and rho < r0 + (r1 - r0) * (h - z0) / (z1 - z0):
            return True
    return False


@njit(**KERNEL)
def first_inside(points, frusta, tip, axis, hint):
    """Index of a point that the tool takes in, -1 for none.

    points : (n, 3) float64, mm; frusta : (k, 4) float64, mm: lower and upper end over the tip, and the radii there
    tip, axis : (3,) float64, mm and unit, frame of the points
    hint   : index of the point that is looked at first
    """
    low, high, wide = frusta[:, 0].min(), frusta[:, 1].max(), max(frusta[:, 2].max(), frusta[:, 3].max())
    if 0 <= hint < len(points) and _takes_in(points[hint, 0], points[hint, 1], points[hint, 2], tip, axis, frusta):
        return hint
    for i in range(len(points)):
        x, y, z = points[i, 0] - tip[0], points[i, 1] - tip[1], points[i, 2] - tip[2]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        if h <= low or h >= high or x * x + y * y + z * z - h * h >= wide * wide:
            continue
        if _takes_in(points[i, 0], points[i, 1], points[i, 2], tip, axis, frusta):
            return i
    return -1
