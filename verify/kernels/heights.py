"""Vertical lines through stock: raising them to the blank, lowering them by a cutter.

Notation
    (x, y), top : one line and the height up to which it is solid
    A, D        : tip at the start of the move and its displacement, tip(s) = A + s D
    rho(s)      : distance in plan from the line to the tool axis
    R, r, a     : radius, width of the corner, R - r; ``grow`` widens the profile radially
    cone        : height of a straight corner, 0 for a round one
    b           : where the side of a tapered mill begins, or the flat end in front of a cone: there the slope is that
                  of a straight line from, and before it that of an arc
Heights on the lines are exact; what stands wholly between two lines is not seen. The profile is convex and, but for the
edges of cones, smooth, so its lowest place along a move is where its slope is that of the move: a closed form on a ball
and on a cone, 40 halvings (1e-12 of the way) on the corner of a bull nose and on the arcs of a circle segment mill.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes, corner_end, slope_of, widened
from verify.kernels.segment import arc_bottom, arc_width, lowest_on_arcs

INF = np.inf


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _bottom_with_side(rho, over, cutter):
    """As ``bottom``, of a cone or a tapered or circle segment mill, ``over`` mm beyond its flat end."""
    r = cutter.round
    if cutter.up > 0.0:
        return arc_bottom(rho, cutter)
    if r <= 0.0:
        return over * cutter.cone / cutter.corner
    wide, high = corner_end(cutter)
    return high + (rho - wide) / cutter.taper if rho >= wide else r - math.sqrt(max(r * r - over * over, 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def bottom(rho, cutter: CutterSizes):
    """Height of the cutting profile over the tip at distance rho from the axis, which may be beyond its radius."""
    r = cutter.corner
    over = max(rho - (cutter.radius - r), 0.0)
    if cutter.cone > 0.0:
        return _bottom_with_side(rho, over, cutter)
    return r - math.sqrt(max(r * r - over * over, 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def edge_radius(over, cutter: CutterSizes):
    """Radius of the profile ``over`` mm above the tip, over >= 0."""
    radius, r, cone = cutter.radius, cutter.corner, cutter.cone
    if over >= (cone if cone > 0.0 else r):
        return radius
    if cone > 0.0:
        if cutter.up > 0.0:
            return arc_width(over, cutter)
        if cutter.round <= 0.0:
            return radius - r + over * r / cone
        wide, high = corner_end(cutter)
        if over >= high:
            return wide + (over - high) * cutter.taper
        return radius - r + math.sqrt(max(over * (2.0 * cutter.round - over), 0.0))
    return radius - r + math.sqrt(max(over * (2.0 * r - over), 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _rho(s, wx, wy, dx, dy):
    ux, uy = wx - s * dx, wy - s * dy
    return math.sqrt(ux * ux + uy * uy)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lowest_on_cone(dz, plan, s0, miss2, b, slope):
    """Where s dz + slope max(rho(s) - b, 0) is lowest over all s, dz not 0.

    With u the way past the nearest place, rho = sqrt(miss² + u²): the slope is 0 where slope u / rho = -dz / plan. On
    the flat end it is that of dz, so the lowest place is no nearer than the rim of the flat.
    """
    g = -dz / (plan * slope)
    if abs(g) >= 1.0:
        return INF if g > 0.0 else -INF
    u = max(abs(g) * math.sqrt(miss2 / (1.0 - g * g)), math.sqrt(max(b * b - miss2, 0.0)))
    return s0 + (u if g > 0.0 else -u) / plan


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lowest_on_ball(dz, plan, s0, miss2, s1, s2, r):
    """Where on [s1, s2] a ball of radius r over the line is lowest."""
    w = math.sqrt(max(r * r - miss2, 0.0))
    return min(max(s0 - w * dz / math.sqrt(plan * plan + dz * dz) / plan, s1), s2)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lowest_on_torus(wx, wy, dx, dy, dz, s1, s2, a, r):
    """Where on [s1, s2] a flat of radius a with a torus round it is lowest over the line."""
    lo, hi = s1, s2
    for _ in range(40):
        s = 0.5 * (lo + hi)
        rho = _rho(s, wx, wy, dx, dy)
        slope = dz
        if rho > a:
            over = min(rho - a, r * (1.0 - 1e-12))
            slope -= over / math.sqrt(r * r - over * over) * ((wx - s * dx) * dx + (wy - s * dy) * dy) / rho
        if slope > 0.0:
            hi = s
        else:
            lo = s
    return 0.5 * (lo + hi)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lowest_with_side(wx, wy, dx, dy, dz, plan, s0, miss2, s1, s2, cutter):
    """As ``_lowest_s``, of a cone or a tapered or circle segment mill.

    A tapered mill is smooth where its side begins: it is lowest on the side, or nearer than that on its corner.
    """
    if cutter.up > 0.0:
        return lowest_on_arcs(wx, wy, dx, dy, dz, s1, s2, cutter)
    a, r = cutter.radius - cutter.corner, cutter.round
    if r <= 0.0:
        return min(max(_lowest_on_cone(dz, plan, s0, miss2, a, 1.0 / slope_of(cutter)), s1), s2)
    b, g = corner_end(cutter)[0], -dz * cutter.taper / plan
    if abs(g) >= 1.0 or g * g * miss2 >= (1.0 - g * g) * max(b * b - miss2, 0.0):
        return min(max(_lowest_on_cone(dz, plan, s0, miss2, b, 1.0 / cutter.taper), s1), s2)
    if a <= 1e-12:
        return _lowest_on_ball(dz, plan, s0, miss2, s1, s2, r)
    half = math.sqrt(b * b - miss2) / plan  # while the corner is over the line
    return min(max(_lowest_on_torus(wx, wy, dx, dy, dz, s0 - half, s0 + half, a, r), s1), s2)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lowest_s(wx, wy, dx, dy, dz, s0, miss2, s1, s2, cutter):
    """Where on [s1, s2] the profile over the line is lowest (a convex function of s)."""
    if dz == 0.0:
        return min(max(s0, s1), s2)
    a, r = cutter.radius - cutter.corner, cutter.corner
    if r <= 0.0:
        return s1 if dz > 0.0 else s2
    plan = math.sqrt(dx * dx + dy * dy)
    if cutter.cone > 0.0:
        return _lowest_with_side(wx, wy, dx, dy, dz, plan, s0, miss2, s1, s2, cutter)
    if a <= 1e-12:
        return _lowest_on_ball(dz, plan, s0, miss2, s1, s2, r)
    return _lowest_on_torus(wx, wy, dx, dy, dz, s1, s2, a, r)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def lowest(x, y, ax, ay, az, dx, dy, dz, cutter: CutterSizes, grow):
    """Least height over (x, y) of a cutting profile carried along the move, and the s of its first touch.

    Returns (inf, 0) where the move passes by.
    """
    return lowest_within(x, y, ax, ay, az, dx, dy, dz, cutter.radius + grow, widened(cutter, grow))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def lowest_within(x, y, ax, ay, az, dx, dy, dz, wide, cutter: CutterSizes):
    """As ``lowest``, of what of a profile is no farther out than ``wide``."""
    wx, wy = x - ax, y - ay
    plan2 = dx * dx + dy * dy
    if plan2 < 1e-18:
        rho = math.sqrt(wx * wx + wy * wy)
        return (min(az, az + dz) + bottom(rho, cutter), 0.0) if rho <= wide else (INF, 0.0)
    s0 = (wx * dx + wy * dy) / plan2
    miss2 = wx * wx + wy * wy - s0 * s0 * plan2
    if miss2 > wide * wide:
        return INF, 0.0
    plan = math.sqrt(plan2)
    half = math.sqrt(wide * wide - max(miss2, 0.0)) / plan
    s1, s2 = max(0.0, s0 - half), min(1.0, s0 + half)
    if s1 > s2:
        return INF, 0.0
    s = _lowest_s(wx, wy, dx, dy, dz, s0, max(miss2, 0.0), s1, s2, cutter)
    return az + s * dz + bottom(_rho(s, wx, wy, dx, dy), cutter), s1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _within(s, wx, wy, dx, dy, dz, over, cutter):
    """How deep a line is in a cutting part at s: the shorter of the way aside and the way over its end.

    Aside, a line as high as that leaves a tapered or circle segment mill where its side is as wide.
    """
    rho = _rho(s, wx, wy, dx, dy)
    top = over - s * dz
    wide = edge_radius(max(top, 0.0), cutter) if cutter.taper > 0.0 or cutter.up > 0.0 else cutter.radius
    return min(wide - rho, top - bottom(min(rho, cutter.radius), cutter))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def entered(wx, wy, over, dx, dy, dz, cutter: CutterSizes):
    """How deep a line is in a cutting part carried along a move, mm: the shorter way out, aside or over its end.

    (wx, wy) is the line seen from the tool at the start of the move, ``over`` its top over the tip there. Aside is
    concave in s, and so is the way over the end, which is convex below: the deepest is searched while the line is
    under the tool. Negative where it never is.
    """
    plan2, radius = dx * dx + dy * dy, cutter.radius
    s1, s2 = 0.0, 1.0
    if plan2 < 1e-18:
        if _rho(0.0, wx, wy, dx, dy) > radius:
            return -1.0
    else:
        s0 = (wx * dx + wy * dy) / plan2
        half2 = (radius * radius - (wx * wx + wy * wy - s0 * s0 * plan2)) / plan2
        if half2 < 0.0:
            return -1.0
        s1, s2 = max(0.0, s0 - math.sqrt(half2)), min(1.0, s0 + math.sqrt(half2))
        if s1 > s2:
            return -1.0
    for _ in range(60):
        u, v = s1 + 0.381966 * (s2 - s1), s2 - 0.381966 * (s2 - s1)
        if _within(u, wx, wy, dx, dy, dz, over, cutter) > _within(v, wx, wy, dx, dy, dz, over, cutter):
            s2 = v
        else:
            s1 = u
    return _within(0.5 * (s1 + s2), wx, wy, dx, dy, dz, over, cutter)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _cells(lo, hi, origin, step, first, stop):
    """Lines whose coordinate lies in [lo, hi], cut to first..stop-1."""
    return (max(first, math.ceil((lo - origin) / step - 0.5)), min(stop - 1, math.floor((hi - origin) / step - 0.5)))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _raise_facet(height, i0, i1, origin, step, p, q, s, reach):
    """Raise lines to the upper side of one triangle shifted by ``reach`` along its normal."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = s[0] - p[0], s[1] - p[1], s[2] - p[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if nz <= 1e-9 * length or length == 0.0:
        return
    ox, oy, oz = p[0] + reach * nx / length, p[1] + reach * ny / length, p[2] + reach * nz / length
    a0, a1 = _cells(ox + min(0.0, ux, vx), ox + max(0.0, ux, vx), origin[0], step, i0, i1)
    b0, b1 = _cells(oy + min(0.0, uy, vy), oy + max(0.0, uy, vy), origin[1], step, 0, height.shape[1])
    for i in range(a0, a1 + 1):
        x = origin[0] + (i + 0.5) * step - ox
        for j in range(b0, b1 + 1):
            y = origin[1] + (j + 0.5) * step - oy
            f, g = (x * vy - y * vx) / nz, (ux * y - uy * x) / nz
            if f >= -1e-9 and g >= -1e-9 and f + g <= 1.0 + 1e-9:
                height[i, j] = max(height[i, j], oz + f * uz + g * vz)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _raise_edge(height, i0, i1, origin, step, p, q, reach):
    """Raise lines to the upper side of a sphere of radius ``reach`` carried along one edge."""
    dx, dy, dz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    plan2 = dx * dx + dy * dy
    top = max(p[2], q[2]) + reach
    a0, a1 = _cells(min(p[0], q[0]) - reach, max(p[0], q[0]) + reach, origin[0], step, i0, i1)
    b0, b1 = _cells(min(p[1], q[1]) - reach, max(p[1], q[1]) + reach, origin[1], step, 0, height.shape[1])
    for i in range(a0, a1 + 1):
        wx = origin[0] + (i + 0.5) * step - p[0]
        for j in range(b0, b1 + 1):
            if height[i, j] >= top:
                continue
            wy = origin[1] + (j + 0.5) * step - p[1]
            s = 0.0 if dz < 0.0 else 1.0
            if plan2 > 1e-18:
                s0 = (wx * dx + wy * dy) / plan2
                w2 = reach * reach - (wx * wx + wy * wy - s0 * s0 * plan2)
                if w2 < 0.0:
                    continue
                s = s0 + math.sqrt(w2) * dz / math.sqrt(plan2 * (plan2 + dz * dz))
                s = min(max(s, 0.0), 1.0)
            rho = _rho(s, wx, wy, dx, dy)
            if rho <= reach:
                height[i, j] = max(height[i, j], p[2] + s * dz + math.sqrt(reach * reach - rho * rho))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def raise_offset(height, i0, i1, origin, step, vertices, faces, edges, reach):
    """Raise the lines of rows i0..i1-1 to the top of a mesh grown by ``reach``: exact on every line.

    height (nx, ny) float64 in place; line (i, j) stands at origin + ((i, j) + 0.5) step.
    """
    for k in range(len(faces)):
        _raise_facet(height, i0, i1, origin, step, vertices[faces[k, 0]], vertices[faces[k, 1]],
                     vertices[faces[k, 2]], reach)
    if reach > 0.0:
        for k in range(len(edges)):
            _raise_edge(height, i0, i1, origin, step, vertices[edges[k, 0]], vertices[edges[k, 1]], reach)
