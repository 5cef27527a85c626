"""Lowest tip height of any convex body of revolution over a mesh.

Notation
    (x, y)   axis of the body in plan; all points below are taken relative to it
    rho      distance of a point from the axis in plan
    h(rho)   lower outline of the body, 0 <= rho <= R: convex, not falling, of lines and arcs; a wall without end at R
    phi      angle of the outline, h' = tan phi; grows with rho, by a jump where two pieces meet in a corner
    tip      max over the points p of the mesh with rho < R of f(p) = z(p) - h(rho(p))
f is concave on each triangle: it is touched where its plane leans as the outline does, or on an edge. The loops are
those of ``geometry.kernels.revolved``.

Rows of an outline, one for each piece: rho0, rho1, h0, h1, sin phi at its beginning and at its end, centre of the arc
(rho, z) and its radius, 0 for a line. A paraboloid row (k, c): c + k/2 rho^2 <= h(rho) for all rho <= R.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from geometry.kernels import revolved
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import NOTHING, arc_angle, for_shape, triangle_tip, walk

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


class Turned(NamedTuple):
    """A shape: one body of a stack, its own part of ``Stack.rows`` and ``Stack.bowls``."""

    rows: F64
    bowls: F64


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
    theta = arc_angle(low, high, q, m, c, a)
    rho = c + a * math.sin(theta)
    return math.sqrt(max((rho - q) * (rho + q), 0.0)), s[LEVEL] - a * math.cos(theta)


@njit(**KERNEL)
def _place(rows, lo, hi, q, m):
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


@for_shape(revolved.radius_of, Turned)
def _radius(shape):
    return shape.rows[shape.rows.shape[0] - 1, RHO1]


@for_shape(revolved.height_at, Turned)
def _height(shape, rho):
    return height(shape.rows, rho)


@for_shape(revolved.touches_widely, Turned)
def _widely(shape):
    # a level facet is touched all over a flat bottom, a cone along a line: the edges have the rest of it
    return True


@for_shape(revolved.facet_contact, Turned)
def _facet_contact(shape, nx, ny, nz):
    lean = math.sqrt(nx * nx + ny * ny)
    rho, h = touch(shape.rows, lean, nz)
    if lean > 1e-14:
        return -rho * (nx / lean), -rho * (ny / lean), h
    return 0.0, 0.0, h


@for_shape(revolved.edge_bound, Turned)
def _edge_bound(shape, z0, ez, length, u0, lo, hi, q):
    return np.inf


@for_shape(revolved.edge_place, Turned)
def _edge_place(shape, lo, hi, q, half, length, l2, ez):
    if ez >= 0.0:
        return _place(shape.rows, lo, hi, q, ez / length)
    u, h = _place(shape.rows, -hi, -lo, q, -ez / length)
    return -u, h


for_shape(revolved.lift_of, Turned)(triangle_tip)


@for_shape(revolved.node_bound, Turned)
def _bound(shape, node, x, y, best):
    """h lies above each paraboloid of ``bowls``, so the covering plane less the paraboloid is a bound.

    It is largest where each coordinate has its own maximum. The top less h at the nearest point of the box is another.
    """
    rows, bowls = shape.rows, shape.bowls
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
def _lowest(tree, x, y, stack):
    """Tip of a stack of bodies, the place in leaf order that holds it up and the contact point."""
    best, slot = NOTHING, -1
    px = py = pz = np.nan
    for b in range(stack.offset.shape[0]):
        shape = Turned(stack.rows[stack.first[b] : stack.first[b + 1]], stack.bowls[b])
        up = stack.offset[b]
        tip, s, cx, cy, cz = walk(tree, shape, x, y, best + up, False)
        if s >= 0:
            best, slot, px, py, pz = tip - up, s, cx, cy, cz
    return best, slot, px, py, pz


@for_shape(revolved.tip_over, Stack)
def _tip_over(stack, tree, x, y):
    return _lowest(tree, x, y, stack)[0]


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
