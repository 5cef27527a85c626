"""Lowest tip height of any convex body of revolution over a mesh.

Notation
    (x, y)   axis of the body in plan; all points below are taken relative to it
    rho      distance of a point from the axis in plan
    h(rho)   lower outline of the body, 0 <= rho <= R: convex, not falling, of lines and arcs; a wall without end at R
    phi      angle of the outline, h' = tan phi; grows with rho, by a jump where two pieces meet in a corner
    tip      max over the points p of the mesh with rho < R of f(p) = z(p) - h(rho(p))
f is concave on each triangle, as in ``geometry.kernels.drop``: a triangle is touched where its plane leans as the
outline does, or on an edge that faces that place.

Rows of an outline, one for each piece: rho0, rho1, h0, h1, sin phi at its beginning and at its end, centre of the arc
(rho, z) and its radius, 0 for a line. A paraboloid row (k, c): c + k/2 rho^2 <= h(rho) for all rho <= R.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from geometry.kernels.bvh import CAREFUL, EDGES_ONLY, SOUND, TreeArrays
from geometry.kernels.options import KERNEL

ROOT_STEPS = 60
NOTHING = -np.inf
RHO0, RHO1, H0, H1, SIN0, SIN1, CENTRE, LEVEL, ARC = range(9)

F64 = NDArray[np.float64]


class Stack(NamedTuple):
    """Bodies over each other as plain arrays; njit functions take it as one argument.

    rows   : (n, 9) float64      pieces of all outlines, see above
    first  : (b + 1,) int64      rows of body k are first[k] .. first[k + 1] - 1
    bowls  : (b, m, 4) float64   paraboloids below each outline, one for each radius from 0 to R in even steps: k, c and
                                 steps a mm; in the last column the k from which on they are lowest against the outline
                                 at the rim, and by how much they have to be lowered there
    offset : (b,) float64, mm    height of each body's lowest point over the tip of the stack
    """

    rows: F64
    first: NDArray[np.int64]
    bowls: F64
    offset: F64


@njit(**KERNEL)
def height(rows, rho):
    """h(rho) for rho <= R, mm."""
    for k in range(rows.shape[0]):
        if rho <= rows[k, RHO1]:
            if rho <= rows[k, RHO0]:
                return rows[k, H0]
            if rows[k, ARC] > 0.0:
                t = rho - rows[k, CENTRE]
                return rows[k, LEVEL] - math.sqrt(max((rows[k, ARC] - t) * (rows[k, ARC] + t), 0.0))
            return rows[k, H0] + (rho - rows[k, RHO0]) * ((rows[k, H1] - rows[k, H0]) / (rows[k, RHO1] - rows[k, RHO0]))
    return rows[rows.shape[0] - 1, H1]


@njit(**KERNEL)
def touch(rows, sine, cosine):
    """Where the outline has an angle: rho and h, mm. On a line of just that angle its outer end."""
    for k in range(rows.shape[0]):
        if sine < rows[k, SIN0]:
            return rows[k, RHO0], rows[k, H0]
        if sine <= rows[k, SIN1]:
            if rows[k, ARC] > 0.0:
                return rows[k, CENTRE] + rows[k, ARC] * sine, rows[k, LEVEL] - rows[k, ARC] * cosine
            return rows[k, RHO1], rows[k, H1]
    return rows[rows.shape[0] - 1, RHO1], rows[rows.shape[0] - 1, H1]


@njit(**KERNEL)
def _steeper(sine, u, rho, m):
    """Whether tan phi * u / rho >= m: past the place where an edge of slope m touches."""
    if sine >= 1.0:
        return u > 0.0 or m <= 0.0
    return sine * u >= m * math.sqrt((1.0 - sine) * (1.0 + sine)) * rho


@njit(**KERNEL)
def _on_arc(s, q, m):
    """Place u where an edge of slope m > 0 at distance q touches an arc, with its height, by Newton in phi."""
    low, high = math.asin(min(s[SIN0], 1.0)), math.asin(min(s[SIN1], 1.0))
    if q > s[RHO0]:
        low = max(low, math.asin(min(max((q - s[CENTRE]) / s[ARC], 0.0), 1.0)))
    c, a = s[CENTRE], s[ARC]
    if c == 0.0:  # a sphere: the vertical plane through the edge cuts it in a circle
        half = math.sqrt(max((a - q) * (a + q), 0.0))
        slant = math.sqrt(1.0 + m * m)
        return half * (m / slant), s[LEVEL] - half / slant
    theta = min(max(math.atan(m), low), high)
    if theta <= low or theta >= high:
        theta = 0.5 * (low + high)
    for _ in range(ROOT_STEPS):
        sine, cosine = math.sin(theta), math.cos(theta)
        rho = c + a * sine
        u = math.sqrt(max((rho - q) * (rho + q), 0.0))
        g = sine * u - m * cosine * rho
        if g > 0.0:
            high = theta
        else:
            low = theta
        step = 0.5 * (low + high) - theta
        if u > 0.0:
            slope = cosine * u + sine * rho * a * cosine / u + m * (sine * rho - a * cosine * cosine)
            if slope > 0.0:
                newton = -g / slope
                if low < theta + newton < high:
                    step = newton
        theta += step
        if abs(step) < 1e-11:
            break
    rho = c + a * math.sin(theta)
    return math.sqrt(max((rho - q) * (rho + q), 0.0)), s[LEVEL] - a * math.cos(theta)


@njit(**KERNEL)
def _edge_place(rows, lo, hi, q, m):
    """Place u in [lo, hi] where m u - h(sqrt(q^2 + u^2)) is largest, with h there; slope m >= 0, distance q.

    tan(phi) u / rho grows with u, so the pieces are passed outwards until it reaches m.
    """
    start = max(lo, 0.0)
    if hi <= start:
        return hi, height(rows, math.sqrt(q * q + hi * hi))
    for k in range(rows.shape[0]):
        if rows[k, RHO1] <= q:
            continue
        end = math.sqrt((rows[k, RHO1] - q) * (rows[k, RHO1] + q))
        if end <= start:
            continue
        begin = math.sqrt(max((rows[k, RHO0] - q) * (rows[k, RHO0] + q), 0.0)) if rows[k, RHO0] > q else 0.0
        if begin >= hi:
            break
        if begin > start and _steeper(rows[k, SIN0], begin, rows[k, RHO0], m):
            return begin, rows[k, H0]
        if _steeper(rows[k, SIN1], end, rows[k, RHO1], m):
            if rows[k, ARC] > 0.0:
                u, h = _on_arc(rows[k], q, m)
            else:
                t = (rows[k, H1] - rows[k, H0]) / (rows[k, RHO1] - rows[k, RHO0])
                u = end if t <= m else m * q / math.sqrt((t - m) * (t + m))
                h = rows[k, H0] + (math.sqrt(q * q + u * u) - rows[k, RHO0]) * t
            if u < start or u < begin:
                u = max(start, begin)
                h = height(rows, math.sqrt(q * q + u * u))
            elif u > hi:
                u = hi
                h = height(rows, math.sqrt(q * q + u * u))
            return u, h
    return hi, height(rows, math.sqrt(q * q + hi * hi))


@njit(**KERNEL)
def _edge(a, b, x, y, rows, best):
    """Tip that the edge a-b allows and the place of the contact on it (0 at a, 1 at b); -inf: no lift."""
    if max(a[2], b[2]) <= best:
        return NOTHING, 0.0
    radius = rows[rows.shape[0] - 1, RHO1]
    ax, ay = a[0] - x, a[1] - y
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    l2 = ex * ex + ey * ey
    if l2 < 1e-24:
        t = 1.0 if ez > 0.0 else 0.0
        rho2 = (ax + t * ex) ** 2 + (ay + t * ey) ** 2
        if rho2 >= radius * radius:
            return NOTHING, 0.0
        return a[2] + t * ez - height(rows, math.sqrt(rho2)), t
    length = math.sqrt(l2)
    q = abs(ax * ey - ay * ex) / length
    if q >= radius:
        return NOTHING, 0.0
    half = math.sqrt((radius - q) * (radius + q))
    u0 = (ax * ex + ay * ey) / length
    lo, hi = max(u0, -half), min(u0 + length, half)
    if lo >= hi:
        return NOTHING, 0.0
    if ez >= 0.0:
        u, h = _edge_place(rows, lo, hi, q, ez / length)
    else:
        u, h = _edge_place(rows, -hi, -lo, q, -ez / length)
        u = -u
    t = min(max((u - u0) / length, 0.0), 1.0)
    return a[2] + t * ez - h, t


@njit(**KERNEL)
def _triangle(v, facet, x, y, rows, best):
    """Tip that one triangle allows, and its contact point; at most ``best`` means no lift."""
    p, q, s = v[0], v[1], v[2]
    nx, ny, nz, quality = facet[0], facet[1], facet[2], facet[4]
    w0 = w1 = w2 = -1.0
    if quality != EDGES_ONLY:
        lean = math.sqrt(nx * nx + ny * ny)
        rho, h = touch(rows, lean, nz)
        cx, cy = x, y
        if lean > 1e-14:
            cx -= rho * (nx / lean)
            cy -= rho * (ny / lean)
        px, py, qx, qy, sx, sy = p[0] - cx, p[1] - cy, q[0] - cx, q[1] - cy, s[0] - cx, s[1] - cy
        if quality == SOUND and p[2] + (nx * px + ny * py) / nz - h <= best:
            return NOTHING, 0.0, 0.0, 0.0
        side = facet[3]
        w0, w1, w2 = side * (qx * sy - sx * qy), side * (sx * py - px * sy), side * (px * qy - qx * py)
        if w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
            total = w0 + w1 + w2
            if total > 0.0:
                w0, w1, w2 = w0 / total, w1 / total, w2 / total
                cz = w0 * p[2] + w1 * q[2] + w2 * s[2]
                if quality == CAREFUL:
                    # The normal is rough: take the outline at the point itself, which is never too high.
                    cx = w0 * p[0] + w1 * q[0] + w2 * s[0]
                    cy = w0 * p[1] + w1 * q[1] + w2 * s[1]
                    rho = math.sqrt((cx - x) ** 2 + (cy - y) ** 2)
                    if rho < rows[rows.shape[0] - 1, RHO1]:
                        h = min(h, height(rows, rho))
                return cz - h, cx, cy, cz
        # a level facet is touched all over a flat bottom, a cone along a line: the edges have the rest of it
        w0 = w1 = w2 = -1.0
    tip, t, edge = NOTHING, 0.0, 0
    if w0 <= 0.0:
        tip, t = _edge(q, s, x, y, rows, best)
    if w1 <= 0.0:
        other, place = _edge(s, p, x, y, rows, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 1
    if w2 <= 0.0:
        other, place = _edge(p, q, x, y, rows, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 2
    a, b = (q, s) if edge == 0 else ((s, p) if edge == 1 else (p, q))
    return tip, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@njit(**KERNEL)
def _bound(node, x, y, rows, bowls, best):
    """No point of the node lifts the tip above this; -inf where that is clear to be no higher than best.

    h lies above each paraboloid of ``bowls``, so the node's top less the paraboloid at the nearest point of its box is
    a bound, and so is its covering plane less the paraboloid, largest where each coordinate has its own maximum.
    """
    if node[4] <= best:
        return NOTHING
    radius = rows[rows.shape[0] - 1, RHO1]
    x_lo, x_hi, y_lo, y_hi = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    u = x_lo if x_lo > 0.0 else (x_hi if x_hi < 0.0 else 0.0)
    v = y_lo if y_lo > 0.0 else (y_hi if y_hi < 0.0 else 0.0)
    near2 = u * u + v * v
    if near2 > radius * radius:
        return NOTHING
    top = node[4] - height(rows, math.sqrt(near2))
    if top <= best:
        return NOTHING
    a, b, sine, slant = node[5], node[6], node[8], node[9]
    rho, _ = touch(rows, sine, 1.0 / slant)
    rho = max(rho, math.sqrt(near2))
    if rho <= 0.0:
        return top
    # the paraboloid that leans there as the outline does; of those that meet it at the rim, the one that leans as the
    # plane does
    last = rows.shape[0] - 1
    if sine > rows[last, SIN1] and bowls[0, 3] < np.inf:
        bend = max(sine * slant / radius, bowls[0, 3])
        low = rows[last, H1] - 0.5 * bend * radius * radius - bowls[1, 3]
    else:
        i = min(int(rho * bowls[0, 2] + 0.5), bowls.shape[0] - 1)
        bend, low = bowls[i, 0], bowls[i, 1]
    u, v = min(max(a / bend, x_lo), x_hi), min(max(b / bend, y_lo), y_hi)
    return min(top, node[7] + a * (x + u) + b * (y + v) - low - 0.5 * bend * (u * u + v * v))


@njit(**KERNEL)
def descend(tree: TreeArrays, x, y, rows, bowls, start, first_only):
    """Highest lift above ``start``: tip, place in leaf order (-1: nothing lifts) and contact point.

    first_only stops at the first triangle that lifts at all. The way through the tree is that of the drop kernel.
    """
    best, slot, cx, cy, cz = start, -1, np.nan, np.nan, np.nan
    column, child, parent = tree.column, tree.child, tree.parent
    node = 0
    trail = np.uint64(0)
    one = np.uint64(1)
    if _bound(column[0], x, y, rows, bowls, best) <= best:
        return best, slot, cx, cy, cz
    while True:
        inner = child[node]
        if inner >= 0:
            left = _bound(column[inner], x, y, rows, bowls, best)
            right = _bound(column[inner + 1], x, y, rows, bowls, best)
            if left > best or right > best:
                trail <<= one
                if left > best and right > best:
                    trail |= one
                node = inner if left >= right else inner + 1
                continue
        else:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                tip, px, py, pz = _triangle(tree.corners[i], tree.facets[i], x, y, rows, best)
                if tip > best:
                    best, slot, cx, cy, cz = tip, i, px, py, pz
                    if first_only:
                        return best, slot, cx, cy, cz
        while True:
            if trail == 0:
                return best, slot, cx, cy, cz
            while trail & one == 0:
                trail >>= one
                node = parent[node]
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if _bound(column[node], x, y, rows, bowls, best) > best:
                break


@njit(**KERNEL)
def _lowest(tree, x, y, stack):
    """Tip of a stack of bodies, the place in leaf order that holds it up and the contact point."""
    best, slot = NOTHING, -1
    px = py = pz = np.nan
    for b in range(stack.offset.shape[0]):
        rows = stack.rows[stack.first[b] : stack.first[b + 1]]
        up = stack.offset[b]
        tip, s, cx, cy, cz = descend(tree, x, y, rows, stack.bowls[b], best + up, False)
        if s >= 0:
            best, slot, px, py, pz = tip - up, s, cx, cy, cz
    return best, slot, px, py, pz


@njit(**KERNEL)
def contact_range(tree, xy, stack, lo, hi, out, triangle, contact):
    """Tip of a stack of bodies over the points lo .. hi - 1 of xy (n, 2), with what holds it up."""
    for i in range(lo, hi):
        tip, slot, px, py, pz = _lowest(tree, xy[i, 0], xy[i, 1], stack)
        out[i], triangle[i] = tip, (tree.order[slot] if slot >= 0 else -1)
        contact[i, 0], contact[i, 1], contact[i, 2] = px, py, pz


@njit(**KERNEL)
def drop_range(tree, xy, stack, lo, hi, out):
    """Tips of a stack of bodies over the points lo .. hi - 1 of xy (n, 2)."""
    for i in range(lo, hi):
        out[i] = _lowest(tree, xy[i, 0], xy[i, 1], stack)[0]


@njit(**KERNEL, parallel=True)
def drop_many_parallel(tree, xy, stack, out):
    """``drop_range`` over all points, on the threads numba has; the same bytes on any number of them."""
    for i in prange(xy.shape[0]):
        out[i] = _lowest(tree, xy[i, 0], xy[i, 1], stack)[0]
