"""How far surface samples stay from a cutting part whose axis leans, and turns from pose to pose, and from its bodies.

A file of its own beside ``residual``: there the axis is Z and a move has closed forms, here it has a certified search.

Notation
    R, r, l : radius, corner radius and length of the cutting part, r <= l; a = R - r
    c, u    : tip and axis of a pose, tip to spindle; p : a sample; q = p - c
    h, rho  : q . u and |q - h u|, the sample's height above the tip and distance from the axis
    s, o    : the signed distance from p to the surface of the part, below 0 inside; its outward unit normal there

The part is convex: nose (torus, ball or disc) up to h = r, cylinder from there to h = l, closed by a disc. With
w = r - h and v = rho - a, without that disc s = hypot(max(v, 0), max(w, 0)) + min(max(v, w), 0) - r; the disc takes
the greater of s and h - l, or hypot(s, h - l) where both are above 0.

From pose to pose, t from 0 to 1, c goes straight by D and u turns on the great circle by theta at an even rate. In the
frame of the tool the sample goes x(t), with |x''| <= B = 2 theta |D| + theta^2 max |q| (what a turn does to a straight
way: Coriolis and centrifugal). A signed distance to a convex body is convex, s(y) >= s(x) + o . (y - x), so
    s(t) >= s(a) + s'(a) (t - a) - B (t - a)^2 / 2,      s' = o . x',
and on [a, b] both straight lines s(a) + (s'(a) - B (b - a) / 2) (t - a) and s(b) - (s'(b) + B (b - a) / 2) (b - t) lie
below s. Where they cross is the least s can be there. Intervals are split at the crossing until none can be lower by
more than TOLERANCE than the least s met so far, which is the s of a pose: the result is never too low and at most
TOLERANCE (and ON_AXIS) too high, however far the axis turns. Without a turn B = 0 and a corner of s is met in one step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes
from geometry.kernels.options import KERNEL
from toolpath.kernels.residual import SampleCells

TOLERANCE = 1e-6  # mm
ON_AXIS = 1e-7  # mm
HALF_DIAGONAL = 0.7072  # of a cell, rounded up
LEAST_SHARE = 0.1  # of an interval, cut off at a split: so it ends
DEPTH = 512  # of intervals in intervals; 0.9^200 of a part of a move is shorter than any TOLERANCE needs


@njit(**KERNEL, inline="always")
def _section(rho, h, radius, corner, flute):
    """s and the two parts of o, across the axis and along it, at a place of the half plane."""
    across, below = rho - (radius - corner), corner - h
    if across > 0.0 and below > 0.0:
        far = np.sqrt(across * across + below * below)
        s, o_rho, o_h = far - corner, across / far, -below / far
    elif across >= below:
        s, o_rho, o_h = across - corner, 1.0, 0.0
    else:
        s, o_rho, o_h = below - corner, 0.0, -1.0
    over = h - flute
    if over > 0.0 and s > 0.0:
        far = np.sqrt(s * s + over * over)
        return far, s / far, over / far
    if over > s:
        return over, 0.0, 1.0
    return s, o_rho, o_h


@njit(**KERNEL, inline="always")
def _at(px, py, pz, part, t, cosine, sine, radius, corner, flute):
    """s and s' of a sample at t of a part of a move; cosine, sine: of theta t."""
    dx, dy, dz, theta = part[3], part[4], part[5], part[12]
    qx, qy, qz = px - part[0] - t * dx, py - part[1] - t * dy, pz - part[2] - t * dz
    ux, uy, uz = (cosine * part[6] + sine * part[9], cosine * part[7] + sine * part[10],
                  cosine * part[8] + sine * part[11])
    turn = theta * (qx * (cosine * part[9] - sine * part[6]) + qy * (cosine * part[10] - sine * part[7])
                    + qz * (cosine * part[11] - sine * part[8]))  # q . u'
    h = qx * ux + qy * uy + qz * uz
    ex, ey, ez = qx - h * ux, qy - h * uy, qz - h * uz
    rho = np.sqrt(ex * ex + ey * ey + ez * ez)
    s, o_rho, o_h = _section(rho, h, radius, corner, flute)
    slope = o_h * (turn - dx * ux - dy * uy - dz * uz)
    if rho > ON_AXIS:  # nearer, e has no direction left in float64, and o = 0 across bounds s as well, but for rho
        slope -= o_rho * (dx * ex + dy * ey + dz * ez + h * turn) / rho
    return s, slope


@njit(**KERNEL)
def _put(stack, n, a, s_a, slope_a, b, s_b, slope_b):
    """One number at a time: numba checks the shape of a row at run time, with a message it compiles for seconds."""
    stack[n, 0], stack[n, 1], stack[n, 2] = a, s_a, slope_a
    stack[n, 3], stack[n, 4], stack[n, 5] = b, s_b, slope_b


@njit(**KERNEL)
def _least(px, py, pz, part, bend, mid, mid_slope, radius, corner, flute, best, stack):
    """The least of ``best`` and of s along a part of a move, to TOLERANCE; bend: B; mid, mid_slope: s, s' at 1/2."""
    theta = part[12]
    first, first_slope = _at(px, py, pz, part, 0.0, 1.0, 0.0, radius, corner, flute)
    last, last_slope = _at(px, py, pz, part, 1.0, np.cos(theta), np.sin(theta), radius, corner, flute)
    best = min(best, first, mid, last)
    _put(stack, 0, 0.0, first, first_slope, 0.5, mid, mid_slope)
    _put(stack, 1, 0.5, mid, mid_slope, 1.0, last, last_slope)
    n = 2
    while n > 0:
        n -= 1
        a, s_a, slope_a, b, s_b, slope_b = stack[n]
        length = b - a
        down, up = slope_a - 0.5 * bend * length, slope_b + 0.5 * bend * length
        if down >= 0.0 or up <= 0.0:
            continue  # least at an end
        cross = (s_b - s_a - up * length) / (down - up)
        if s_a + down * cross >= best - TOLERANCE:
            continue
        t = a + min(max(cross, LEAST_SHARE * length), (1.0 - LEAST_SHARE) * length)
        s, slope = _at(px, py, pz, part, t, np.cos(theta * t), np.sin(theta * t), radius, corner, flute)
        best = min(best, s)
        _put(stack, n, a, s_a, slope_a, t, s, slope)
        _put(stack, n + 1, t, s, slope, b, s_b, slope_b)
        n += 2
    return best


@njit(**KERNEL)
def _turn(u, v, across):
    """Angle from axis u to axis v, rad; ``across`` (3,) is filled with the way of the turn at u, unit, or with 0."""
    dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    for k in range(3):
        across[k] = v[k] - dot * u[k]
    sine = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    for k in range(3):
        across[k] = across[k] / sine if sine > 0.0 else 0.0
    return np.arctan2(sine, dot)


@njit(**KERNEL)
def _set_part(part, tip, way, axis, across, theta, j, parts):
    """Fill part (13,) with c, D, u, the way of the turn at u, and theta, of the j-th of some parts of a move."""
    cosine, sine = np.cos(theta * j / parts), np.sin(theta * j / parts)
    for k in range(3):
        part[k] = tip[k] + way[k] * j / parts
        part[3 + k] = way[k] / parts
        part[6 + k] = cosine * axis[k] + sine * across[k]
        part[9 + k] = cosine * across[k] - sine * axis[k]
    part[12] = theta / parts


@njit(**KERNEL, inline="always")
def _off(x, y, ax, ay, bx, by):
    """Distance from (x, y) to a segment in plan."""
    dx, dy = bx - ax, by - ay
    d2 = dx * dx + dy * dy
    t = min(max(((x - ax) * dx + (y - ay) * dy) / d2, 0.0), 1.0) if d2 > 0.0 else 0.0
    return np.sqrt((x - ax - t * dx) ** 2 + (y - ay - t * dy) ** 2)


@njit(**KERNEL)
def _lower_part(points, cells, part, cutter, margin, least, stack):
    """Lower ``least`` by one part of a move.

    The tool halfway, thicker by half of what its places go, covers the shadow of all of it in plan. And since s and s'
    halfway bound s all along, most samples in that shadow are asked once only.
    """
    cell_start, cell_items, gx, gy, cell = cells.start, cells.items, cells.x0, cells.y0, cells.size
    ncx, ncy = cells.ncx, cells.ncy
    radius, corner, flute = cutter.radius, cutter.corner, cutter.length
    theta = part[12]
    cosine, sine = np.cos(0.5 * theta), np.sin(0.5 * theta)
    length = np.sqrt(part[3] ** 2 + part[4] ** 2 + part[5] ** 2)
    reach = radius + margin + 0.5 * (length + theta * flute)
    ax, ay, az = part[0] + 0.5 * part[3], part[1] + 0.5 * part[4], part[2] + 0.5 * part[5]
    bx, by = ax + flute * (cosine * part[6] + sine * part[9]), ay + flute * (cosine * part[7] + sine * part[10])
    j0 = int(max((min(ax, bx) - reach - gx) / cell, 0.0))
    j1 = int(min((max(ax, bx) + reach - gx) / cell, ncx - 1.0))
    i0 = int(max((min(ay, by) - reach - gy) / cell, 0.0))
    i1 = int(min((max(ay, by) + reach - gy) / cell, ncy - 1.0))
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            c = i * ncx + j
            if (cell_start[c] == cell_start[c + 1] or
                    _off(gx + (j + 0.5) * cell, gy + (i + 0.5) * cell, ax, ay, bx, by) > reach + HALF_DIAGONAL * cell):
                continue
            for n in range(cell_start[c], cell_start[c + 1]):
                p = cell_items[n]
                x, y, z = points[p, 0], points[p, 1], points[p, 2]
                best = min(least[p], margin)
                mid, slope = _at(x, y, z, part, 0.5, cosine, sine, radius, corner, flute)
                far = np.sqrt((x - ax) ** 2 + (y - ay) ** 2 + (z - az) ** 2) + 0.5 * length
                bend = theta * (2.0 * length + theta * far)
                if mid - 0.5 * abs(slope) - 0.125 * bend >= best - TOLERANCE:
                    continue
                found = _least(x, y, z, part, bend, mid, slope, radius, corner, flute, best, stack)
                if found < best:
                    least[p] = found


@njit(**KERNEL)
def lower_leaning(points, cells: SampleCells, tips, axes, cutter: CutterSizes, margin, least):
    """Lower least (n,) float64, mm, by the signed distance of samples to a cutting part that walks leaning.

    points (n, 3) float64, mm, are binned in square cells in plan. tips (m, 3) float64, mm; axes (m, 3) float64, unit,
    neighbours less than a right angle apart. margin: mm, distances beyond it change nothing, and neither do those that
    are less than ``least`` by no more than TOLERANCE.

    A move is taken in parts in which no place of the cutting part goes farther than a radius and a cell.
    """
    part, across, way = np.empty(13), np.empty(3), np.empty(3)
    stack = np.empty((DEPTH, 6))
    for k in range(len(tips) - 1):
        theta = _turn(axes[k], axes[k + 1], across)
        for m in range(3):
            way[m] = tips[k + 1, m] - tips[k, m]
        length = np.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
        parts = max(int(np.ceil((length + theta * cutter.length) / (cutter.radius + cells.size))), 1)
        for m in range(parts):
            _set_part(part, tips[k], way, axes[k], across, theta, m, parts)
            _lower_part(points, cells, part, cutter, margin, least, stack)


@njit(**KERNEL)
def near(tips, axes, points, rooms, bodies, out):
    """Set out[k] where a body at pose k is nearer to some point than its room.

    tips, axes    : (n, 3) float64, mm and unit, tip to spindle
    points, rooms : (m, 3) and (m,) float64, mm
    bodies        : (b, 3) float64, mm: radius, and from where to where above the tip
    out           : (n,) bool; what is set already is not asked
    """
    if not len(points) or not len(bodies):
        return
    lowest, widest = bodies[:, 1].min() - rooms.max(), bodies[:, 0].max() + rooms.max()
    for k in range(len(tips)):
        t, a = tips[k], axes[k]
        for i in range(len(points)):
            if out[k]:
                break
            x, y, z = points[i, 0] - t[0], points[i, 1] - t[1], points[i, 2] - t[2]
            h = x * a[0] + y * a[1] + z * a[2]
            if h < lowest:
                continue
            across = x * x + y * y + z * z - h * h
            if across >= widest * widest:
                continue
            rho = np.sqrt(max(across, 0.0))
            for b in range(len(bodies)):
                aside = max(rho - bodies[b, 0], 0.0)
                along = max(bodies[b, 1] - h, h - bodies[b, 2], 0.0)
                if aside * aside + along * along < rooms[i] * rooms[i]:
                    out[k] = True
                    break
