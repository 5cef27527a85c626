"""Lowest tip height of a cutter of revolution over a mesh, and whether a tip is blocked.

Notation
    (x, y)   axis of the cutter in plan; all points below are taken relative to it
    R, r, d  radius, corner radius, and d = R - r, the radius of the flat bottom
    rho      distance of a point from the axis in plan
    h(rho)   profile: 0 up to d, then r - sqrt(r^2 - (rho - d)^2) up to R; a wall without end above it
    tip      max over the points p of the mesh with rho < R of f(p) = z(p) - h(rho(p))
f is concave on each triangle, since z is linear and h convex. A point at exactly rho = R touches the side of the cutter
and lifts nothing. At R = 0 the tip is the height of the mesh. The loops are those of ``geometry.kernels.revolved``.

Bound: a node cannot lift the tip above the maximum over its box of its covering plane (or top z) less a paraboloid that
lies below h.

Over places close together the triangles that can hold the cutter up are found once, the list ``near``:
    floor    a height that the tip is nowhere below over these places
    shape    ``Bull``, or any other shape of ``geometry.kernels.revolved`` that can be ``widened``
    slot     a triangle, by its place in the leaf order; -1: none
    lift     tip height that one triangle requires
The lift of a triangle is concave over places of the axis: h is convex, and the lift is a maximum over the points of the
triangle. So between two places it is nowhere less than at the lower one, which gives the floor. Within a of a place no
triangle lifts the cutter (R, r) more than it lifts, over that place, the one with a flat wider by a, (R + a, r).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from geometry.kernels import revolved
from geometry.kernels.bvh import TreeArrays
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import (
    NOTHING,
    arc_angle,
    facet_at,
    for_shape,
    lift_of,
    node_bound,
    radius_of,
    triangle_at,
    triangle_tip,
    walk,
    widened,
)

BLOCK_TOLERANCE = 1e-9  # mm: a lift below this does not block
MOST = 96  # triangles near some places: where there are more, each place is looked up alone
SLACK = 1e-7  # mm: a lift at the rim of the cutter may err by this
WIDE = 0.25  # of the radius: places this close together are looked up at once
FEW = 3  # places that pay for a search
RIM = 0.98  # tangents of h are taken no farther out than this part of the corner radius


class Bull(NamedTuple):
    """A shape: ball (flat = 0), flat end (corner = 0) or bull nose; radius = corner + flat, mm."""

    radius: float
    corner: float
    flat: float


@njit(**KERNEL, inline="always")
def bull_of(radius, corner_radius):
    """Bull of a radius and a corner radius, mm; within 1e-12 of the radius it becomes a ball or a flat end."""
    r = min(corner_radius, radius)
    d = radius - r
    if d <= 1e-12 * radius:  # so nothing underflows
        r, d = radius, 0.0
    elif r <= 1e-12 * radius:
        r, d = 0.0, radius
    return Bull(radius, r, d)


@njit(**KERNEL, inline="always")
def profile(rho: float, r: float, d: float) -> float:
    """h(rho) for rho <= R."""
    t = rho - d
    if t <= 0.0:
        return 0.0
    if t >= r:
        return r
    return r - math.sqrt((r - t) * (r + t))


@njit(**KERNEL)
def bull_edge(lo, hi, q, m, r, d):
    """Place u in [lo, hi] where m u - h(sqrt(q^2 + u^2)) is largest, with the profile's height there.

    m >= 0 is the slope of the edge, q its distance from the axis. The condition h' u / rho = m is solved in
    theta, the angle of the profile's normal (rho = d + r sin theta, h' = tan theta).
    """
    start = max(lo, 0.0)
    if hi <= start:
        return hi, profile(math.sqrt(q * q + hi * hi), r, d)
    rho = math.sqrt(q * q + start * start)
    low = 0.0
    if rho > d:
        low = math.asin(min((rho - d) / r, 1.0))
        if math.sin(low) * start >= m * math.cos(low) * rho:
            return start, profile(rho, r, d)
    elif m == 0.0:
        return start, 0.0
    rho = math.sqrt(q * q + hi * hi)
    if rho <= d:
        return hi, 0.0
    high = math.asin(min((rho - d) / r, 1.0))
    if math.sin(high) * hi <= m * math.cos(high) * rho:
        return hi, profile(rho, r, d)
    theta = arc_angle(low, high, q, m, d, r)
    s = math.sin(theta)
    rho = d + r * s
    u = min(max(math.sqrt(max((rho - q) * (rho + q), 0.0)), start), hi)
    if s < 0.7:
        return u, profile(math.sqrt(q * q + u * u), r, d)
    return u, r - r * math.cos(theta)


@for_shape(revolved.radius_of, Bull)
def _radius(shape):
    return shape.radius


@for_shape(revolved.height_at, Bull)
def _height(shape, rho):
    return profile(rho, shape.corner, shape.flat)


@for_shape(revolved.touches_widely, Bull)
def _widely(shape):
    return False


@for_shape(revolved.widened, Bull)
def _widened(shape, off):
    return Bull(shape.radius + off, shape.corner, shape.flat + off)


@for_shape(revolved.facet_contact, Bull)
def _facet_contact(shape, nx, ny, nz):
    r, d = shape.corner, shape.flat
    cx, cy = -r * nx, -r * ny
    if d > 0.0:
        lean = math.sqrt(nx * nx + ny * ny)
        if lean > 1e-14:
            cx -= d * (nx / lean)
            cy -= d * (ny / lean)
    return cx, cy, r * (1.0 - nz)


for_shape(revolved.lift_of, Bull)(triangle_tip)


@for_shape(revolved.edge_bound, Bull)
def _edge_bound(shape, z0, ez, length, u0, lo, hi, q):
    """``_bound`` for a line, without a root to find; balls and flat ends need none."""
    r, d = shape.corner, shape.flat
    if r <= 0.0 or d <= 0.0:
        return np.inf
    m = ez / length
    near = lo if lo > 0.0 else (hi if hi < 0.0 else 0.0)
    near2 = q * q + near * near
    slant = math.sqrt(1.0 + m * m)
    t = min(r * abs(m) / slant, RIM * r)
    rho0 = d + t
    if near2 > rho0 * rho0:
        t = min(math.sqrt(near2) - d, RIM * r)
        rho0 = d + t
    root = math.sqrt((r - t) * (r + t))
    k = t / (root * rho0)
    u = hi if m > 0.0 else lo
    if k > 1e-12:
        u = min(max(m / k, lo), hi)
    return z0 + (u - u0) * m - (r - root) - 0.5 * k * (q * q + u * u - rho0 * rho0)


@for_shape(revolved.edge_place, Bull)
def _edge_place(shape, lo, hi, q, half, length, l2, ez):
    r, d = shape.corner, shape.flat
    if r <= 0.0:
        return (hi if ez > 0.0 else lo), 0.0
    if d <= 0.0:
        slant = math.sqrt(l2 + ez * ez)
        u = half * (ez / slant)
        if u < lo:
            return lo, r - math.sqrt(max((half - lo) * (half + lo), 0.0))
        if u > hi:
            return hi, r - math.sqrt(max((half - hi) * (half + hi), 0.0))
        return u, r - half * (length / slant)
    if ez >= 0.0:
        return bull_edge(lo, hi, q, ez / length, r, d)
    u, h = bull_edge(-hi, -lo, q, -ez / length, r, d)
    return -u, h


@for_shape(revolved.node_bound, Bull)
def _bound(shape, node, x, y, best):
    """As a function of w = rho^2, h is convex, so h(rho) >= h(rho0) + k/2 (w - rho0^2) with k = h'(rho0) / rho0:
    a paraboloid below the cutter, whatever its kind. Less that, the covering plane has its maximum over the
    box where each coordinate has its own. rho0 is where the plane itself would touch (k = tan / rho0, for a
    flat end the multiplier of rho <= R), or the nearest point of the box if that is farther out.
    """
    R, r, d = shape.radius, shape.corner, shape.flat
    if node[4] <= best:
        return NOTHING
    x_lo, x_hi, y_lo, y_hi = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    u = x_lo if x_lo > 0.0 else (x_hi if x_hi < 0.0 else 0.0)
    v = y_lo if y_lo > 0.0 else (y_hi if y_hi < 0.0 else 0.0)
    near2 = u * u + v * v
    if near2 > R * R:
        return NOTHING
    by_top = node[4]
    if d <= 0.0 and r > 0.0:
        by_top -= near2 / (2.0 * r)
        if by_top <= best:
            return NOTHING
    a, b, sine, slant = node[5], node[6], node[8], node[9]
    if R <= 0.0:
        return min(by_top, node[7] + a * x + b * y)
    rho0 = d + r * sine
    if near2 > rho0 * rho0 and r > 0.0:
        rho0 = math.sqrt(near2)
        t = min(rho0 - d, RIM * r)
        rho0 = d + t
        root = math.sqrt((r - t) * (r + t))
        k = t / (root * rho0)
        h0 = r - root
    else:
        k = slant / r if d <= 0.0 else sine * slant / rho0
        h0 = r - r / slant
    if not k > 1e-12:
        return by_top
    u, v = min(max(a / k, x_lo), x_hi), min(max(b / k, y_lo), y_hi)
    by_plane = node[7] + a * (x + u) + b * (y + v) - h0 - 0.5 * k * (u * u + v * v - rho0 * rho0)
    return min(by_top, by_plane)


@for_shape(revolved.tip_over, Bull)
def _tip_over(shape, tree, x, y):
    return walk(tree, shape, x, y, NOTHING, False)[0]


@njit(**KERNEL)
def drop_tip(tree: TreeArrays, shape, x, y):
    """Lowest tip height over (x, y) at which the body does not enter the mesh, mm; -inf where nothing is below."""
    return walk(tree, shape, x, y, NOTHING, False)[0]


@njit(**KERNEL)
def drop_tip_below(tree: TreeArrays, shape, x, y, z_start):
    """The larger of z_start and ``drop_tip``: cheap where z_start is close to the answer."""
    return walk(tree, shape, x, y, z_start, False)[0]


@njit(**KERNEL)
def is_blocked(tree: TreeArrays, shape, x, y, z):
    """Whether some triangle would lift the tip from z by more than 1e-9 mm."""
    return walk(tree, shape, x, y, z + BLOCK_TOLERANCE, True)[1] >= 0


@njit(**KERNEL)
def lift_at(shape, corners, facets, slot, x, y):
    """Lift of one triangle; -inf where it is none or too far away."""
    if slot < 0:
        return NOTHING
    return lift_of(shape, triangle_at(corners, slot), facet_at(facets, slot), x, y, NOTHING)[0]


@njit(**KERNEL)
def blocked_by(tree: TreeArrays, shape, x, y, z, guess):
    """A triangle, by its place in leaf order, that makes ``is_blocked`` true; -1 where none does.

    guess : a triangle to ask first, -1 for none
    """
    start = z + BLOCK_TOLERANCE
    if guess >= 0 and lift_at(shape, tree.corners, tree.facets, guess, x, y) > start:
        return guess
    return walk(tree, shape, x, y, start, True)[1]


@njit(**KERNEL)
def drop_tip_contact(tree: TreeArrays, shape, x, y):
    """``drop_tip`` with the triangle of the mesh (-1: none) and the contact point (NaN: none)."""
    tip, slot, cx, cy, cz = walk(tree, shape, x, y, NOTHING, False)
    return tip, (tree.order[slot] if slot >= 0 else -1), cx, cy, cz


@njit(**KERNEL)
def drop_range(tree, xy, shape, lo, hi, out):
    """``drop_tip`` for the points lo .. hi - 1 of xy (n, 2)."""
    for i in range(lo, hi):
        out[i] = drop_tip(tree, shape, xy[i, 0], xy[i, 1])


@njit(**KERNEL)
def blocked_range(tree, tips, shape, lo, hi, out):
    """``is_blocked`` for the tips lo .. hi - 1 of tips (n, 3)."""
    for i in range(lo, hi):
        out[i] = is_blocked(tree, shape, tips[i, 0], tips[i, 1], tips[i, 2])


@njit(**KERNEL)
def contact_range(tree, xy, shape, lo, hi, out, triangle, contact):
    """``drop_tip_contact`` for the points lo .. hi - 1 of xy (n, 2)."""
    for i in range(lo, hi):
        tip, number, cx, cy, cz = drop_tip_contact(tree, shape, xy[i, 0], xy[i, 1])
        out[i], triangle[i] = tip, number
        contact[i, 0], contact[i, 1], contact[i, 2] = cx, cy, cz


@njit(**KERNEL)
def grid_rows(tree, x0, y0, step, shape, lo, hi, out):
    """``drop_tip`` over (x0 + column * step, y0 + row * step) for the rows lo .. hi - 1 of out (ny, nx)."""
    for j in range(lo, hi):
        for i in range(out.shape[1]):
            out[j, i] = drop_tip(tree, shape, x0 + i * step, y0 + j * step)


@njit(**KERNEL, parallel=True)
def drop_many_parallel(tree, xy, shape, out):
    """``drop_range`` over all points, on the threads numba has; the same bytes on any number of them."""
    for i in prange(xy.shape[0]):
        out[i] = drop_tip(tree, shape, xy[i, 0], xy[i, 1])


@njit(**KERNEL, parallel=True)
def blocked_many_parallel(tree, tips, shape, out):
    """``blocked_range`` over all tips, on the threads numba has."""
    for i in prange(tips.shape[0]):
        out[i] = is_blocked(tree, shape, tips[i, 0], tips[i, 1], tips[i, 2])


@njit(**KERNEL, parallel=True)
def grid_parallel(tree, x0, y0, step, shape, out):
    """``grid_rows`` over all rows, on the threads numba has."""
    for j in prange(out.shape[0]):
        grid_rows(tree, x0, y0, step, shape, j, j + 1, out)


# ======================================================================================================================


@njit(**KERNEL)
def find_near(tree, shape, x, y, off, floor, near):
    """Triangles that lift the tip above ``floor`` somewhere within ``off`` of (x, y), into near; their count, -1 where
    near has no room for them."""
    off = off * (1.0 + 1e-9) + 1e-9
    wide = widened(shape, off)
    floor -= SLACK
    reach2 = radius_of(wide) ** 2
    column, child, parent, corners = tree.column, tree.child, tree.parent, tree.corners
    node, count = 0, 0
    trail = np.uint64(0)
    one = np.uint64(1)
    if node_bound(wide, column[0], x, y, floor) <= floor:
        return 0
    while True:
        inner = child[node]
        if inner >= 0:
            left = node_bound(wide, column[inner], x, y, floor) > floor
            right = node_bound(wide, column[inner + 1], x, y, floor) > floor
            if left or right:
                trail <<= one
                if left and right:
                    trail |= one
                node = inner if left else inner + 1
                continue
        else:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                p, q, s = triangle_at(corners, i)
                u = max(min(p[0], q[0], s[0]) - x, x - max(p[0], q[0], s[0]), 0.0)
                v = max(min(p[1], q[1], s[1]) - y, y - max(p[1], q[1], s[1]), 0.0)
                if max(p[2], q[2], s[2]) > floor and u * u + v * v < reach2:
                    if count == near.shape[0]:
                        return -1
                    near[count] = i
                    count += 1
        while True:
            if trail == 0:
                return count
            while trail & one == 0:
                trail >>= one
                node = parent[node]
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if node_bound(wide, column[node], x, y, floor) > floor:
                break


@njit(**KERNEL)
def highest_near(shape, corners, facets, near, count, x, y, best, held):
    """Tip over (x, y) and the triangle that holds it up, of the first ``count`` of near; best is the lift of held."""
    for k in range(count):
        i = near[k]
        if max(corners[i, 0, 2], corners[i, 1, 2], corners[i, 2, 2]) > best:
            lift = lift_of(shape, triangle_at(corners, i), facet_at(facets, i), x, y, best)[0]
            if lift > best:
                best, held = lift, i
    return best, held


@njit(**KERNEL, inline="always")
def tip_near(tree, shape, x, y, near, count, guess):
    """Tip over (x, y) and the triangle that holds it up: of the first ``count`` of near, or of all where count < 0.

    guess : a triangle that probably holds it, or -1; it is looked at first
    """
    tip = lift_at(shape, tree.corners, tree.facets, guess, x, y)
    held = guess if tip > NOTHING else -1
    if count >= 0:
        tip, held = highest_near(shape, tree.corners, tree.facets, near, count, x, y, tip, held)
    else:
        found = walk(tree, shape, x, y, tip, False)
        tip = found[0]
        if found[1] >= 0:
            held = found[1]
    return tip, held


@njit(**KERNEL)
def drop_along(tree, xy, shape, out):
    """Tips over places xy (n, 2) that follow each other, into out (n,)."""
    near = np.empty(MOST, np.int64)
    widest = WIDE * radius_of(shape)
    most, slot, i, hi = widest, -1, 0, xy.shape[0]
    while i < hi:
        x, y = xy[i, 0], xy[i, 1]
        tip, slot = tip_near(tree, shape, x, y, near, -1, slot)
        out[i] = tip
        i += 1
        floor, end = tip, i
        x_lo, x_hi, y_lo, y_hi = x, x, y, y
        while end < hi:
            u, v = xy[end, 0], xy[end, 1]
            a, b, c, d = min(x_lo, u), max(x_hi, u), min(y_lo, v), max(y_hi, v)
            if max(b - a, d - c) > most:
                break
            lift = lift_at(shape, tree.corners, tree.facets, slot, u, v)
            if not lift > tip - most:
                break
            x_lo, x_hi, y_lo, y_hi, floor = a, b, c, d, min(floor, lift)
            end += 1
        if end - i < FEW:
            continue
        off = 0.5 * math.sqrt((x_hi - x_lo) ** 2 + (y_hi - y_lo) ** 2)
        count = find_near(tree, shape, 0.5 * (x_lo + x_hi), 0.5 * (y_lo + y_hi), off, floor, near)
        if count < 0:
            most *= 0.5
            continue
        most = min(2.0 * most, widest)
        while i < end:
            out[i], slot = tip_near(tree, shape, xy[i, 0], xy[i, 1], near, count, slot)
            i += 1
