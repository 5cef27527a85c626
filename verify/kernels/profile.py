"""Signed distance of points to a cutting part, standing or carried along a straight line.

The profile over distance rho from the axis and height h from the tip is a rectangle grown by the corner radius r: flat
end a = R - r, side R, cut off at the flute length L. With ``cone`` above 0 the corner is straight, from (a, 0) to
(R, cone), and a tapered mill has an arc of radius r before it: that is a cone from (a, r) grown by r. A circle segment
mill has two arcs (``verify.kernels.segment``). Distances are exact but over the flutes, where the larger of the two
ways is taken (a lower bound). A standing cutting part is convex, so along a line the distance is convex in s.
"""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes, slope_of, widened
from geometry.kernels.options import KERNEL
from verify.kernels.segment import arc_gradient, on_lower_arc

GOLDEN = 0.3819660112501051
FINE = 1e-5


@njit(**KERNEL)
def leaning(rho, h, cutter: CutterSizes):
    """Signed distance, mm, to flat end, round corner and cone of a cutting part, and the endless cylinder over it.

    With x and y from the end of the flat at height r: under the cone and beside the flat the nearest place is on the
    arc; over the rim of the cone it is the rim or the cylinder. Inside, the distance is that to the nearest tangent.
    """
    if cutter.up > 0.0:
        return arc_gradient(rho, h, cutter)[0]
    m, r = slope_of(cutter), cutter.round
    x, y = rho - (cutter.radius - cutter.corner), h - r
    if x > 0.0 and m * x + y < 0.0:
        out = math.sqrt(x * x + y * y) - r
    else:
        out = max((x - m * y) / math.sqrt(1.0 + m * m), -y) - r
    past, low = rho - cutter.radius, h - cutter.cone
    if past > 0.0 and low < 0.0 and m * past + low > 0.0:
        return math.sqrt(past * past + low * low)
    return max(out, past)


@njit(**KERNEL)
def standing(rho, h, cutter: CutterSizes):
    """Signed distance, mm, of a point at distance rho from the axis and height h; negative inside."""
    if cutter.cone > 0.0:
        return max(leaning(rho, h, cutter), h - cutter.length)
    r = cutter.corner
    x, y = rho - (cutter.radius - r), r - h
    out = math.sqrt(max(x, 0.0) ** 2 + max(y, 0.0) ** 2) if x > 0.0 or y > 0.0 else max(x, y)
    return max(out - r, h - cutter.length)


@njit(**KERNEL)
def _at(s, qx, qy, qz, dx, dy, dz, cutter):
    wx, wy = qx - s * dx, qy - s * dy
    return standing(math.sqrt(wx * wx + wy * wy), qz - s * dz, cutter)


@njit(**KERNEL)
def beside(qx, qy, qz, dx, dy, dz, cutter: CutterSizes, v, grow, slack):
    """How wide, mm, a cutting part must be made all round to touch a ball of v.

    ``grow`` where even that takes in no more of it than ``slack``, which what lies under the tip may be.
    """
    if v - carried(qx, qy, qz, dx, dy, dz, widened(cutter, grow)) <= slack:
        return grow
    free, hits = 0.0, grow
    for _ in range(20):
        wider = 0.5 * (free + hits)
        if v - carried(qx, qy, qz, dx, dy, dz, widened(cutter, wider)) > slack:
            hits = wider
        else:
            free = wider
    return max(hits - slack, 0.0)


@njit(**KERNEL)
def _beside_cone(qx, qy, qz, dx, dy, dz, plan2, cutter):
    """Least distance to the cone alone where that is the least of all, else inf.

    With u the way in plan past the nearest place, rho = sqrt(miss² + u²): rho - m h is least where u / rho is
    -m dz / plan. Where the place met there is nearer to the cone than to its ends, a convex distance has its least
    value there.
    """
    m, plan = slope_of(cutter), math.sqrt(plan2)
    s = (qx * dx + qy * dy) / plan2
    miss2 = max(qx * qx + qy * qy - s * s * plan2, 0.0)
    g = m * dz / plan
    if abs(g) >= 1.0:
        s = 0.0 if g > 0.0 else 1.0
    else:
        s = min(max(s - g * math.sqrt(miss2 / (1.0 - g * g)) / plan, 0.0), 1.0)
    h = qz - s * dz
    rho = math.sqrt((qx - s * dx) ** 2 + (qy - s * dy) ** 2)
    x, y = rho - (cutter.radius - cutter.corner), h - cutter.round
    past, low = rho - cutter.radius, h - cutter.cone
    if m * x + y <= 0.0 or m * past + low >= 0.0:
        return math.inf
    out = (x - m * y) / math.sqrt(1.0 + m * m)
    return out - cutter.round if out > max(-y, past + cutter.round) and out - cutter.round > h - cutter.length \
        else math.inf


@njit(**KERNEL)
def carried(qx, qy, qz, dx, dy, dz, cutter: CutterSizes):
    """Least signed distance over 0 <= s <= 1 of a point q to a cutting part carried by s D; within 1e-5 mm."""
    plan2 = dx * dx + dy * dy
    r, length, cone = cutter.corner, cutter.length, cutter.cone
    a = cutter.radius - r
    s = 0.0
    if plan2 > 0.0:
        s = min(max((qx * dx + qy * dy) / plan2, 0.0), 1.0)
    if abs(dz) <= 1e-12:
        return _at(s, qx, qy, qz, dx, dy, dz, cutter)
    h = qz - s * dz
    if cone > 0.0:
        # as below: where the way to the side is the greatest of all, no place of the move is nearer
        rho = math.sqrt((qx - s * dx) ** 2 + (qy - s * dy) ** 2)
        if plan2 > 0.0 and cone <= h and standing(rho, h, cutter) <= rho - cutter.radius:
            return rho - cutter.radius
        if cutter.taper > 0.0 and plan2 > 0.0:
            d = _beside_cone(qx, qy, qz, dx, dy, dz, plan2, cutter)
            if d < math.inf:
                return d
    elif plan2 > 0.0 and r <= h <= length:
        rho = math.sqrt((qx - s * dx) ** 2 + (qy - s * dy) ** 2)
        # beside the cylinder, and nearer to its side than to its ends: only rho counts there
        if rho - a >= r - h and rho - a - r >= h - length:
            return rho - a - r
    if a <= 1e-12 and (cone == 0.0 or cutter.round > 0.0):
        r = r if cone == 0.0 else cutter.round
        z = qz - r
        s = min(max((qx * dx + qy * dy + z * dz) / (plan2 + dz * dz), 0.0), 1.0)
        wx, wy, wz = qx - s * dx, qy - s * dy, z - s * dz
        # the nearest place is on the ball: under its equator, or where a cone begins
        if cutter.up > 0.0:
            # and no tangent of the rest is farther, as inside a lens
            on_ball = on_lower_arc(math.sqrt(wx * wx + wy * wy), -wz, cutter) and _at(
                s, qx, qy, qz, dx, dy, dz, cutter) <= math.sqrt(wx * wx + wy * wy + wz * wz) - r + 1e-12
        else:
            on_ball = (wz if cone == 0.0 else wz + cutter.taper * math.sqrt(wx * wx + wy * wy)) <= 0.0
        if on_ball:
            return math.sqrt(wx * wx + wy * wy + wz * wz) - r
    if plan2 == 0.0 and cone == 0.0 and r <= 0.5 * length:
        # straight along the axis: no height is better than the middle of the flutes
        s = min(max((qz - 0.5 * length) / dz, 0.0), 1.0)
        return _at(s, qx, qy, qz, dx, dy, dz, cutter)
    lo, hi = 0.0, 1.0
    wide = math.sqrt(plan2 + dz * dz)
    u, v = GOLDEN, 1.0 - GOLDEN
    fu = _at(u, qx, qy, qz, dx, dy, dz, cutter)
    fv = _at(v, qx, qy, qz, dx, dy, dz, cutter)
    while (hi - lo) * wide > FINE:
        if fu > fv:
            lo, u, fu = u, v, fv
            v = hi - GOLDEN * (hi - lo)
            fv = _at(v, qx, qy, qz, dx, dy, dz, cutter)
        else:
            hi, v, fv = v, u, fu
            u = lo + GOLDEN * (hi - lo)
            fu = _at(u, qx, qy, qz, dx, dy, dz, cutter)
    return min(fu, fv)
