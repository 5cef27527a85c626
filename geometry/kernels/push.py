"""How far a convex body of revolution gets along a horizontal direction until it touches a mesh.

Notation
    d, n       unit direction of the push, and the horizontal one to its left
    tip        where the body stands at s = 0, its lowest point
    w          height of a point over the tip
    rho(w)     largest radius of the body at w > 0, the inverse of the outline h; R from h(R) on, no body at w <= 0
    s(p)       p.d - sqrt(rho(w)^2 - (p.n)^2), p taken from the tip's axis: the place at which the body meets p
    stop       the least s over the points p of the mesh with w > 0 and |p.n| < rho(w)
The body is convex, so the root is concave and s convex on a triangle. Where the outline leans as the triangle's plane
does is the plane's own contact; inside the triangle it is the answer. Otherwise the least s lies on an edge. s grows
not with height along a vertical facet, and a level one has its least at its rim: both count as their edges, and so do
facets that look away from the body or lean over it. The loops are those of ``geometry.kernels.revolved``, which look
for the highest lift: here lift = -s.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from geometry.kernels import revolved
from geometry.kernels.options import KERNEL
from geometry.kernels.outline import ARC, CENTRE, H0, H1, LEVEL, RHO0, RHO1, SIN0, touch
from geometry.kernels.revolved import NOTHING, facet_at, for_shape, lift_of, triangle_at, walk

HALVINGS = 50
THIN = 1e-5  # height over longest side of a triangle below which its normal is rough
FACING = 1e-3  # n.d of a facet below which its place along d is rough
SAME = 1e-9  # difference of sines below which a facet leans like a cone


class Push(NamedTuple):
    """A shape: one body of a stack on its way.

    rows   : (k, 9) float64     pieces of the outline, as in ``geometry.kernels.outline``
    level  : float, mm          height of the body's lowest point
    dx, dy : float              unit direction
    """

    rows: NDArray[np.float64]
    level: float
    dx: float
    dy: float


@njit(**KERNEL)
def width(rows, w):
    """rho(w), mm, for w >= 0; at 0 what it tends to from above."""
    for k in range(rows.shape[0]):
        if w <= rows[k, H1] and rows[k, H1] > rows[k, H0]:
            if rows[k, ARC] > 0.0:
                t = rows[k, LEVEL] - w
                return rows[k, CENTRE] + math.sqrt(max((rows[k, ARC] - t) * (rows[k, ARC] + t), 0.0))
            return rows[k, RHO0] + (w - rows[k, H0]) * ((rows[k, RHO1] - rows[k, RHO0]) / (rows[k, H1] - rows[k, H0]))
    return rows[rows.shape[0] - 1, RHO1]


@njit(**KERNEL)
def _lift(rows, w, n, along, edge_of_body):
    """-s of one point at w >= 0; a point on the side of the body counts where others inside lead up to it."""
    rho = width(rows, max(w, 0.0))
    room = (rho - abs(n)) * (rho + abs(n))
    if room < 0.0 or (room == 0.0 and not edge_of_body):
        return NOTHING
    return math.sqrt(room) - along


@njit(**KERNEL)
def _level_place(bend, top, ed, tm):
    """Where ed t - sqrt(G(t)) is level, for G(t) = top + bend (t - tm)^2; NaN where nowhere."""
    below = ed * ed - bend
    if bend == 0.0 or below <= 0.0:
        return np.nan
    room = -bend * top / below
    if room <= 0.0:
        return np.nan
    return tm + ed * math.sqrt(room) / bend


@njit(**KERNEL)
def _on_line(rho, slope, n0, en, ed):
    """Place of the least s on a cone or cylinder: radius rho + slope t, aside n0 + en t, along ed t; NaN where none."""
    bend = (slope - en) * (slope + en)
    tilt = rho * slope - n0 * en
    if abs(bend) <= 1e-14 * (slope * slope + en * en):  # G is straight
        if tilt == 0.0 or ed == 0.0:
            return np.nan
        return ((tilt / ed) ** 2 - (rho - n0) * (rho + n0)) / (2.0 * tilt)
    tm = -tilt / bend
    r, n = rho + slope * tm, n0 + en * tm
    return _level_place(bend, (r - n) * (r + n), ed, tm)


@njit(**KERNEL)
def _on_sphere(a, down, ez, n0, en, ed):
    """Place of the least s on a sphere of radius a whose centre is ``down`` above the edge's beginning."""
    bend = -(ez * ez + en * en)
    if bend == 0.0:
        return np.nan
    tm = (n0 * en - down * ez) / bend
    q = math.sqrt((down - ez * tm) ** 2 + (n0 + en * tm) ** 2)
    return _level_place(bend, (a - q) * (a + q), ed, tm)


@njit(**KERNEL)
def _on_torus(c, a, down, ez, n0, en, ed, low, high):
    """Place of the least s on an arc round (c, level), by halving: s is convex, and so are the places that count."""
    for _ in range(HALVINGS):
        t = 0.5 * (low + high)
        cosine = min(max((down - t * ez) / a, -1.0), 1.0)
        sine = math.sqrt((1.0 - cosine) * (1.0 + cosine))
        rho, n = c + a * sine, n0 + t * en
        room = (rho - n) * (rho + n)
        if room > 0.0:  # the sign of ds/dt
            right = sine * (ed * math.sqrt(room) + n * en) < rho * cosine * ez
        else:  # towards where the body is wider than the place is aside
            right = cosine * ez > math.copysign(en, n * en) * sine
        if right:
            low = t
        else:
            high = t
    return 0.5 * (low + high)


@njit(**KERNEL)
def _edge(shape, a, b, x, y, best):
    """Lift that the edge a-b asks for and the place of the contact on it (0 at a, 1 at b); -inf: not more than best."""
    if b[2] < a[2]:
        lift, t = _rising(shape, b, a, x, y, best)
        return lift, 1.0 - t
    return _rising(shape, a, b, x, y, best)


@njit(**KERNEL)
def _rising(shape, a, b, x, y, best):
    rows, dx, dy = shape.rows, shape.dx, shape.dy
    w0, ez = a[2] - shape.level, b[2] - a[2]
    if not w0 + ez > 0.0:
        return NOTHING, 0.0
    ax, ay, ex, ey = a[0] - x, a[1] - y, b[0] - a[0], b[1] - a[1]
    along, ed = ax * dx + ay * dy, ex * dx + ey * dy
    n0, en = ay * dx - ax * dy, ey * dx - ex * dy
    widest = width(rows, w0 + ez)
    least = min(n0, n0 + en)
    near = max(least, -max(n0, n0 + en), 0.0)
    if near >= widest or math.sqrt((widest - near) * (widest + near)) - min(along, along + ed) <= best:
        return NOTHING, 0.0
    lift, place = NOTHING, 0.0
    last = rows.shape[0] - 1
    for k in range(rows.shape[0] + 1):
        upper = rows[k, H1] if k <= last else np.inf
        lower = rows[k, H0] if k <= last else rows[last, H1]
        if upper <= lower or w0 > upper or w0 + ez < lower:
            continue
        low = max((lower - w0) / ez, 0.0) if w0 < lower else 0.0
        high = min((upper - w0) / ez, 1.0) if w0 + ez > upper else 1.0
        if k > last:
            t = _on_line(rows[last, RHO1], 0.0, n0, en, ed)
        elif rows[k, ARC] > 0.0 and rows[k, CENTRE] == 0.0:
            t = _on_sphere(rows[k, ARC], rows[k, LEVEL] - w0, ez, n0, en, ed)
        elif rows[k, ARC] > 0.0:
            t = _on_torus(rows[k, CENTRE], rows[k, ARC], rows[k, LEVEL] - w0, ez, n0, en, ed, low, high)
        else:
            slope = (rows[k, RHO1] - rows[k, RHO0]) / (rows[k, H1] - rows[k, H0])
            t = _on_line(rows[k, RHO0] + (w0 - rows[k, H0]) * slope, slope * ez, n0, en, ed)
        middle = 0.5 * (low + high)
        inside = _lift(rows, w0 + middle * ez, n0 + middle * en, 0.0, False) > NOTHING
        for u in (low, high, t):
            if low <= u <= high:
                other = _lift(rows, w0 + u * ez, n0 + u * en, along + u * ed, inside)
                if other > lift:
                    lift, place = other, u
    return lift, place


@njit(**KERNEL)
def _leans_alike(rows, sine):
    """Whether a facet leans like a cone of the outline, or like the cylinder above it: touched along a line."""
    if sine > 1.0 - SAME:
        return True
    for k in range(rows.shape[0]):
        if rows[k, ARC] <= 0.0 and abs(rows[k, SIN0] - sine) <= SAME:
            return True
    return False


@for_shape(revolved.lift_of, Push)
def _triangle(shape, v, facet, x, y, best):
    rows, dx, dy = shape.rows, shape.dx, shape.dy
    p, q, s = v[0], v[1], v[2]
    if not max(p[2], q[2], s[2]) > shape.level:
        return NOTHING, 0.0, 0.0, 0.0
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = s[0] - p[0], s[1] - p[1], s[2] - p[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    if nz < 0.0:
        nx, ny, nz = -nx, -ny, -nz
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    wx, wy, wz = s[0] - q[0], s[1] - q[1], s[2] - q[2]
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
    facing = nx * dx + ny * dy
    w0 = w1 = w2 = -1.0
    lift, cx, cy, cz = NOTHING, 0.0, 0.0, 0.0
    if size > 1e-11 * longest and nz > 0.0 and facing < 0.0:
        nx, ny, nz, facing = nx / size, ny / size, nz / size, facing / size
        sound = size > THIN * longest and facing < -FACING
        lean = math.sqrt(nx * nx + ny * ny)
        rho, h = touch(rows, lean, nz)
        forth = -rho * (facing / lean)
        aside = rho * ((nx * dy - ny * dx) / lean)
        # the plane's contact as it stands at s = 0
        px, py, pz = x + forth * dx - aside * dy, y + forth * dy + aside * dx, shape.level + h
        if sound and -((p[0] - px) * nx + (p[1] - py) * ny + (p[2] - pz) * nz) / facing <= best:
            return NOTHING, 0.0, 0.0, 0.0
        # seen along d: aside to the right, up
        p0, p1 = (p[1] - y) * dx - (p[0] - x) * dy - aside, p[2] - pz
        q0, q1 = (q[1] - y) * dx - (q[0] - x) * dy - aside, q[2] - pz
        s0, s1 = (s[1] - y) * dx - (s[0] - x) * dy - aside, s[2] - pz
        w0, w1, w2 = q0 * s1 - s0 * q1, s0 * p1 - p0 * s1, p0 * q1 - q0 * p1
        total = w0 + w1 + w2
        side = 1.0 if total > 0.0 else -1.0
        w0, w1, w2 = side * w0, side * w1, side * w2
        if total != 0.0 and w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
            total = abs(total)
            a0, a1, a2 = w0 / total, w1 / total, w2 / total
            cx, cy = a0 * p[0] + a1 * q[0] + a2 * s[0], a0 * p[1] + a1 * q[1] + a2 * s[1]
            cz = a0 * p[2] + a1 * q[2] + a2 * s[2]
            along = (cx - x) * dx + (cy - y) * dy
            if sound:
                return forth - along, cx, cy, cz
            # The normal is rough: take the body at the point itself, which is never too far.
            lift = _lift(rows, cz - shape.level, (cy - y) * dx - (cx - x) * dy, along, False)
        if not sound or _leans_alike(rows, lean):
            w0 = w1 = w2 = -1.0
    for k in range(3):
        a, b, w = (q, s, w0) if k == 0 else ((s, p, w1) if k == 1 else (p, q, w2))
        if w <= 0.0:
            other, t = _edge(shape, a, b, x, y, max(best, lift))
            if other > lift:
                lift = other
                cx, cy, cz = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])
    return lift, cx, cy, cz


@for_shape(revolved.node_bound, Push)
def _bound(shape, node, x, y, best):
    """s is nowhere less than the box's least p.d less the root at its top and at its place nearest the way."""
    w = node[4] - shape.level
    if not w > 0.0:
        return NOTHING
    dx, dy = shape.dx, shape.dy
    x_lo, x_hi, y_lo, y_hi = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    along = min(dx * x_lo, dx * x_hi) + min(dy * y_lo, dy * y_hi)
    right = min(dx * y_lo, dx * y_hi) - max(dy * x_lo, dy * x_hi)
    left = max(dx * y_lo, dx * y_hi) - min(dy * x_lo, dy * x_hi)
    near = max(right, -left, 0.0)
    rho = width(shape.rows, w)
    if near >= rho:
        return NOTHING
    return math.sqrt((rho - near) * (rho + near)) - along


@njit(**KERNEL)
def stop_at(tree, slot, rows, x, y, z, dx, dy):
    """Stop of one body at one triangle, mm; inf where the body passes it.

    slot : place of the triangle in leaf order
    rows : (k, 9) float64, mm, outline of the body; its tip is at (x, y, z)
    """
    shape = Push(rows, z, dx, dy)
    return -lift_of(shape, triangle_at(tree.corners, slot), facet_at(tree.facets, slot), x, y, NOTHING)[0]


@njit(**KERNEL)
def _stop(tree, x, y, z, dx, dy, stack):
    """Stop of a stack of bodies, the place in leaf order that stops it and the contact point."""
    best, slot = NOTHING, -1
    px = py = pz = np.nan
    for b in range(stack.offset.shape[0]):
        shape = Push(stack.rows[stack.first[b] : stack.first[b + 1]], z + stack.offset[b], dx, dy)
        lift, s, cx, cy, cz = walk(tree, shape, x, y, best, False)
        if s >= 0:
            best, slot, px, py, pz = lift, s, cx, cy, cz
    return -best, slot, px, py, pz


@njit(**KERNEL)
def push_range(tree, tips, dx, dy, stack, lo, hi, out):
    """Stops of a stack of bodies from the tips lo .. hi - 1 of tips (n, 3)."""
    for i in range(lo, hi):
        out[i] = _stop(tree, tips[i, 0], tips[i, 1], tips[i, 2], dx, dy, stack)[0]


@njit(**KERNEL)
def contact_range(tree, tips, dx, dy, stack, lo, hi, out, triangle, contact):
    """``push_range`` with the triangle of the mesh (-1: none) and the contact point (NaN: none)."""
    for i in range(lo, hi):
        stop, slot, px, py, pz = _stop(tree, tips[i, 0], tips[i, 1], tips[i, 2], dx, dy, stack)
        out[i], triangle[i] = stop, (tree.order[slot] if slot >= 0 else -1)
        contact[i, 0], contact[i, 1], contact[i, 2] = px, py, pz


@njit(**KERNEL, parallel=True)
def push_many_parallel(tree, tips, dx, dy, stack, out):
    """``push_range`` over all tips, on the threads numba has; the same bytes on any number of them."""
    for i in prange(tips.shape[0]):
        out[i] = _stop(tree, tips[i, 0], tips[i, 1], tips[i, 2], dx, dy, stack)[0]
