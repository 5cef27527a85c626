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
def first_inside(points, first, balls, frusta, tip, axis, hint):
    """Index of a point that the tool takes in, -1 for none.

    points : (n, 3) float64, mm, grouped
    first  : (g + 1,) int64, index of the first point of each group, and n
    balls  : (g, 4) float64, mm: a ball round the points of each group, centre and radius
    frusta : (k, 4) float64, mm: lower and upper end over the tip, and the radii there
    tip, axis : (3,) float64, mm and unit, frame of the points
    hint   : index of the point that is looked at first
    """
    if 0 <= hint < len(points) and _takes_in(points[hint, 0], points[hint, 1], points[hint, 2], tip, axis, frusta):
        return hint
    for g in range(len(balls)):
        x, y, z, r = balls[g, 0] - tip[0], balls[g, 1] - tip[1], balls[g, 2] - tip[2], balls[g, 3]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
        low, high = len(frusta), 0  # the frusta that the ball may meet
        for k in range(len(frusta)):
            if frusta[k, 0] < h + r and frusta[k, 1] > h - r and rho < max(frusta[k, 2], frusta[k, 3]) + r:
                low, high = min(low, k), k + 1
        if low < high:
            met = frusta[low:high]
            for i in range(first[g], first[g + 1]):
                if _takes_in(points[i, 0], points[i, 1], points[i, 2], tip, axis, met):
                    return i
    return -1
