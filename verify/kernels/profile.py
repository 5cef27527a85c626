"""Signed distance of points to a cutting part, standing or carried along a straight line.

The profile over distance rho from the axis and height h from the tip is a rectangle grown by the corner radius r: flat
end a = R - r, side R, cut off at the flute length L. With ``cone`` above 0 the corner is straight: from (a, 0) to
(a + r, cone). Distances are exact but over the flutes, where the larger of the two ways is taken (a lower bound). A
standing cutting part is convex, so along a line the distance is convex in s.
"""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes
from geometry.kernels.options import KERNEL

GOLDEN = 0.3819660112501051
FINE = 1e-5


@njit(**KERNEL)
def _pointed(rho, h, a, r, cone):
    """Signed distance, mm, to a flat end, a cone and the endless cylinder over it; negative inside."""
    side = math.sqrt(r * r + cone * cone)
    x = rho - a
    aside, along = (x * cone - h * r) / side, (x * r + h * cone) / side
    if aside <= 0.0 and x <= r and h >= 0.0:
        return max(max(aside, x - r), -h)
    past = max(max(-along, along - side), 0.0)
    out2 = min(aside * aside + past * past, max(x, 0.0) ** 2 + h * h)
    return math.sqrt(min(out2, (x - r) ** 2 + min(h - cone, 0.0) ** 2))


@njit(**KERNEL)
def standing(rho, h, a, r, length, cone=0.0):
    """Signed distance, mm, of a point at distance rho from the axis and height h; negative inside."""
    if cone > 0.0:
        return max(_pointed(rho, h, a, r, cone), h - length)
    x, y = rho - a, r - h
    out = math.sqrt(max(x, 0.0) ** 2 + max(y, 0.0) ** 2) if x > 0.0 or y > 0.0 else max(x, y)
    return max(out - r, h - length)


@njit(**KERNEL)
def _at(s, qx, qy, qz, dx, dy, dz, a, r, length, cone):
    wx, wy = qx - s * dx, qy - s * dy
    return standing(math.sqrt(wx * wx + wy * wy), qz - s * dz, a, r, length, cone)


@njit(**KERNEL)
def beside(qx, qy, qz, dx, dy, dz, cutter: CutterSizes, v, grow, slack):
    """How wide, mm, a cutting part must be made all round to touch a ball of v.

    ``grow`` where even that takes in no more of it than ``slack``, which what lies under the tip may be.
    """
    a, r, length, cone = cutter.radius - cutter.corner, cutter.corner, cutter.length, cutter.cone
    if v - carried(qx, qy, qz, dx, dy, dz, a + grow, r, length, cone) <= slack:
        return grow
    free, hits = 0.0, grow
    for _ in range(20):
        wider = 0.5 * (free + hits)
        if v - carried(qx, qy, qz, dx, dy, dz, a + wider, r, length, cone) > slack:
            hits = wider
        else:
            free = wider
    return max(hits - slack, 0.0)


@njit(**KERNEL)
def carried(qx, qy, qz, dx, dy, dz, a, r, length, cone=0.0):
    """Least signed distance over 0 <= s <= 1 of a point q to a cutting part carried by s D; within 1e-5 mm."""
    plan2 = dx * dx + dy * dy
    s = 0.0
    if plan2 > 0.0:
        s = min(max((qx * dx + qy * dy) / plan2, 0.0), 1.0)
    if abs(dz) <= 1e-12:
        return _at(s, qx, qy, qz, dx, dy, dz, a, r, length, cone)
    h = qz - s * dz
    if cone > 0.0:
        # as below: where the way to the side is the greatest of all, no place of the move is nearer
        rho = math.sqrt((qx - s * dx) ** 2 + (qy - s * dy) ** 2)
        if plan2 > 0.0 and cone <= h and standing(rho, h, a, r, length, cone) <= rho - a - r:
            return rho - a - r
    elif plan2 > 0.0 and r <= h <= length:
        rho = math.sqrt((qx - s * dx) ** 2 + (qy - s * dy) ** 2)
        # beside the cylinder, and nearer to its side than to its ends: only rho counts there
        if rho - a >= r - h and rho - a - r >= h - length:
            return rho - a - r
    if a <= 1e-12 and cone == 0.0:
        z = qz - r
        s = min(max((qx * dx + qy * dy + z * dz) / (plan2 + dz * dz), 0.0), 1.0)
        if z - s * dz <= 0.0:
            wx, wy, wz = qx - s * dx, qy - s * dy, z - s * dz
            return math.sqrt(wx * wx + wy * wy + wz * wz) - r
    if plan2 == 0.0 and cone == 0.0 and r <= 0.5 * length:
        # straight along the axis: no height is better than the middle of the flutes
        s = min(max((qz - 0.5 * length) / dz, 0.0), 1.0)
        return _at(s, qx, qy, qz, dx, dy, dz, a, r, length, cone)
    lo, hi = 0.0, 1.0
    wide = math.sqrt(plan2 + dz * dz)
    u, v = GOLDEN, 1.0 - GOLDEN
    fu = _at(u, qx, qy, qz, dx, dy, dz, a, r, length, cone)
    fv = _at(v, qx, qy, qz, dx, dy, dz, a, r, length, cone)
    while (hi - lo) * wide > FINE:
        if fu > fv:
            lo, u, fu = u, v, fv
            v = hi - GOLDEN * (hi - lo)
            fv = _at(v, qx, qy, qz, dx, dy, dz, a, r, length, cone)
        else:
            hi, v, fv = v, u, fu
            u = lo + GOLDEN * (hi - lo)
            fu = _at(u, qx, qy, qz, dx, dy, dz, a, r, length, cone)
    return min(fu, fv)
