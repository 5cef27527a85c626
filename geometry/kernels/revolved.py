"""Loops for any convex body of revolution over a mesh; the kind of shape is resolved at compile time.

Notation
    shape   a named tuple of one kind: ``Bull`` (``geometry.kernels.drop``), ``Tapered`` (``geometry.kernels.tapered``),
            ``Turned`` (``geometry.kernels.outline``), or a ``Push`` of one of these (``geometry.kernels.push``)
    (x, y)  axis of the body in plan; points are taken relative to it
    rho, h  distance from the axis in plan, and height of the body's lower outline there: convex, not falling
    lift    tip height that a point requires: z - h(rho) in a drop. It is concave on a triangle. So where the contact of
            the plane lies inside the triangle, that is its maximum. Otherwise it lies on an edge that faces the
            contact.

The operations below the first rule are stubs. Each kind registers their bodies with ``for_shape``. When numba compiles
a loop, it takes the body of the kind at hand, so nothing is chosen at run time. A local variable must not have the name
of a compiled function.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from geometry.kernels.bvh import CAREFUL, EDGES_ONLY, SOUND, TreeArrays
from geometry.kernels.options import KERNEL

ROOT_STEPS = 60
NOTHING = -np.inf


def for_shape(operation: Any, kind: type) -> Any:
    """Decorator: the function below is the body of ``operation`` for shapes of one kind, a class of named tuples."""

    def register(body: Any) -> Any:
        @overload(operation, jit_options={"error_model": KERNEL["error_model"]}, strict=False)
        def choose(shape, *others):  # type: ignore[no-untyped-def]
            return body if getattr(shape, "instance_class", None) is kind else None

        return body

    return register


# ======================================================================================================================


def radius_of(shape):
    """R, mm: a point counts where rho < R."""
    raise NotImplementedError


def height_at(shape, rho):
    """h(rho) for rho <= R, mm."""
    raise NotImplementedError


def facet_contact(shape, nx, ny, nz):
    """Where the body touches a plane of upward unit normal: x and y off the axis, and h there."""
    raise NotImplementedError


def touches_widely(shape):
    """Whether the body may touch a plane along a line, so that all edges count where the contact is outside."""
    raise NotImplementedError


def tip_over(shape, tree, x, y):
    """Lowest tip height of the body over (x, y) at which it stays out of the mesh, mm; -inf where nothing is below."""
    raise NotImplementedError


def edge_bound(shape, z0, ez, length, u0, lo, hi, q):
    """Upper bound of the lift of an edge; infinity where the place itself costs as little."""
    raise NotImplementedError


def edge_place(shape, lo, hi, q, half, length, l2, ez):
    """Place u in [lo, hi] where (ez / length) u - h(sqrt(q^2 + u^2)) is largest, with h there.

    half^2 = R^2 - q^2; l2 is length^2 as it was before its root was taken.
    """
    raise NotImplementedError


def widened(shape, off):
    """The shape with a flat bottom wider by ``off`` mm in radius, and all above it as much farther out."""
    raise NotImplementedError


def node_bound(shape, node, x, y, best):
    """Upper bound of the lift of a node; -inf where it is certainly no higher than best."""
    raise NotImplementedError


def lift_of(shape, v, facet, x, y, best):
    """Lift that one triangle requires, and its contact point; a value up to ``best`` means no lift."""
    raise NotImplementedError


# ======================================================================================================================


@njit(**KERNEL)
def arc_angle(low, high, q, m, c, a):
    """Angle of an arc (rho = c + a sin phi) in [low, high] where an edge of slope m at distance q touches it.

    tan(phi) u / rho = m; the left side grows with phi, so the root is single and bracketed. The slope alone, a facet
    leaning like the edge, is a good start. Newton, halved when it leaves the bracket.
    """
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
    return theta


@njit(**KERNEL)
def edge_tip(shape, a, b, x, y, best):
    """Tip that the edge a-b allows and the place of the contact on it (0 at a, 1 at b); -inf: no lift."""
    if max(a[2], b[2]) <= best:
        return NOTHING, 0.0
    radius = radius_of(shape)
    ax, ay = a[0] - x, a[1] - y
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    l2 = ex * ex + ey * ey
    if l2 < 1e-24:
        t = 1.0 if ez > 0.0 else 0.0
        rho2 = (ax + t * ex) ** 2 + (ay + t * ey) ** 2
        if rho2 >= radius * radius:
            return NOTHING, 0.0
        return a[2] + t * ez - height_at(shape, math.sqrt(rho2)), t
    length = math.sqrt(l2)
    q = abs(ax * ey - ay * ex) / length
    if q >= radius:
        return NOTHING, 0.0
    half = math.sqrt((radius - q) * (radius + q))
    u0 = (ax * ex + ay * ey) / length
    lo, hi = max(u0, -half), min(u0 + length, half)
    if lo >= hi:
        return NOTHING, 0.0
    if edge_bound(shape, a[2], ez, length, u0, lo, hi, q) <= best:
        return NOTHING, 0.0
    u, h = edge_place(shape, lo, hi, q, half, length, l2, ez)
    t = min(max((u - u0) / length, 0.0), 1.0)
    return a[2] + t * ez - h, t


def triangle_tip(shape, v, facet, x, y, best):
    """``lift_of`` for a drop: the tip that one triangle allows, and its contact point."""
    p, q, s = v[0], v[1], v[2]
    nx, ny, nz, quality = facet[0], facet[1], facet[2], facet[4]
    w0 = w1 = w2 = -1.0
    if quality != EDGES_ONLY:
        cx, cy, h = facet_contact(shape, nx, ny, nz)
        cx += x
        cy += y
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
                    if rho < radius_of(shape):
                        h = min(h, height_at(shape, rho))
                return cz - h, cx, cy, cz
        if quality == CAREFUL or touches_widely(shape):
            w0 = w1 = w2 = -1.0
    tip, t, edge = NOTHING, 0.0, 0
    if w0 <= 0.0:
        tip, t = edge_tip(shape, q, s, x, y, best)
    if w1 <= 0.0:
        other, place = edge_tip(shape, s, p, x, y, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 1
    if w2 <= 0.0:
        other, place = edge_tip(shape, p, q, x, y, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 2
    a, b = (q, s) if edge == 0 else ((s, p) if edge == 1 else (p, q))
    return tip, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@njit(**KERNEL, inline="always")
def triangle_at(corners, i):
    """The corners of triangle i of the leaf order.

    Numbers, since a row of an array is an object: all threads would count up and down its uses in one place.
    """
    return ((corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]),
            (corners[i, 1, 0], corners[i, 1, 1], corners[i, 1, 2]),
            (corners[i, 2, 0], corners[i, 2, 1], corners[i, 2, 2]))


@njit(**KERNEL, inline="always")
def facet_at(facets, i):
    """``facet_row`` of triangle i of the leaf order, as numbers."""
    return facets[i, 0], facets[i, 1], facets[i, 2], facets[i, 3], facets[i, 4]


@njit(**KERNEL)
def walk(tree: TreeArrays, shape, x, y, start, first_only):
    """Highest lift above ``start``: lift, place in leaf order (-1: nothing lifts) and contact point.

    first_only stops at the first triangle that lifts at all. The child with the higher bound goes first. One bit a
    level in a 64-bit trail marks the siblings left to visit, so that no stack is needed.
    """
    best, slot, cx, cy, cz = start, -1, np.nan, np.nan, np.nan
    column, child, parent, corners, facets = tree.column, tree.child, tree.parent, tree.corners, tree.facets
    node = 0
    trail = np.uint64(0)
    one = np.uint64(1)
    if node_bound(shape, column[0], x, y, best) <= best:
        return best, slot, cx, cy, cz
    while True:
        inner = child[node]
        if inner >= 0:
            left = node_bound(shape, column[inner], x, y, best)
            right = node_bound(shape, column[inner + 1], x, y, best)
            if left > best or right > best:
                trail <<= one
                if left > best and right > best:
                    trail |= one
                node = inner if left >= right else inner + 1
                continue
        else:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                lift, px, py, pz = lift_of(shape, triangle_at(corners, i), facet_at(facets, i), x, y, best)
                if lift > best:
                    best, slot, cx, cy, cz = lift, i, px, py, pz
                    if first_only:
                        return best, slot, cx, cy, cz
        # Back to the nearest sibling that was left behind and may still lift.
        while True:
            if trail == 0:
                return best, slot, cx, cy, cz
            while trail & one == 0:
                trail >>= one
                node = parent[node]
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if node_bound(shape, column[node], x, y, best) > best:
                break
