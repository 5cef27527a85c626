"""Lowest tip height of a cutter of revolution over a mesh, and whether a tip is blocked.

Notation
    (x, y)   axis of the cutter in plan; all points below are taken relative to it
    R, r, d  radius, corner radius, and d = R - r, the radius of the flat bottom
    rho      distance of a point from the axis in plan
    h(rho)   profile: 0 up to d, then r - sqrt(r^2 - (rho - d)^2) up to R; a wall without end above it
    tip      max over the points p of the mesh with rho < R of f(p) = z(p) - h(rho(p))
f is concave on each triangle, since z is linear and h convex. So where the plane's own contact lies inside
the triangle it is the answer; otherwise the maximum lies on an edge that faces the contact. A point at
exactly rho = R touches the side of the cutter and lifts nothing. At R = 0 the tip is the height of the mesh.

Traversal: a node cannot lift the tip above its bound, the maximum over the node's box of the node's covering
plane (or top z) less a paraboloid that lies below h. The child with the higher bound goes first; what is left
behind is one bit a level in a 64-bit trail, so that no stack is needed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from geometry.kernels.bvh import CAREFUL, EDGES_ONLY, SOUND, TreeArrays
from geometry.kernels.options import KERNEL

BLOCK_TOLERANCE = 1e-9  # mm: a lift below this does not block
ROOT_STEPS = 60
RIM = 0.98  # tangents of h are taken no farther out than this part of the corner radius
NOTHING = -np.inf


@njit(**KERNEL, inline="always")
def _profile(rho: float, r: float, d: float) -> float:
    """h(rho) for rho <= R."""
    t = rho - d
    if t <= 0.0:
        return 0.0
    if t >= r:
        return r
    return r - math.sqrt((r - t) * (r + t))


@njit(**KERNEL)
def _bull_edge(lo, hi, q, m, R, r, d):
    """Place u in [lo, hi] where m u - h(sqrt(q^2 + u^2)) is largest, with the profile's height there.

    m >= 0 is the slope of the edge, q its distance from the axis. The condition h' u / rho = m is solved in
    theta, the angle of the profile's normal (rho = d + r sin theta, h' = tan theta): its left side grows with
    theta from 0 to infinity, so the root is single and bracketed. Newton, halved when it leaves the bracket.
    """
    start = max(lo, 0.0)
    if hi <= start:
        return hi, _profile(math.sqrt(q * q + hi * hi), r, d)
    rho = math.sqrt(q * q + start * start)
    low = 0.0
    if rho > d:
        low = math.asin(min((rho - d) / r, 1.0))
        if math.sin(low) * start >= m * math.cos(low) * rho:
            return start, _profile(rho, r, d)
    elif m == 0.0:
        return start, 0.0
    rho = math.sqrt(q * q + hi * hi)
    if rho <= d:
        return hi, 0.0
    high = math.asin(min((rho - d) / r, 1.0))
    if math.sin(high) * hi <= m * math.cos(high) * rho:
        return hi, _profile(rho, r, d)
    # The slope alone (a facet leaning like the edge) is a good start.
    theta = min(max(math.atan(m), low), high)
    if theta <= low or theta >= high:
        theta = 0.5 * (low + high)
    u = start
    for _ in range(ROOT_STEPS):
        s, c = math.sin(theta), math.cos(theta)
        rho = d + r * s
        u = math.sqrt(max((rho - q) * (rho + q), 0.0))
        g = s * u - m * c * rho
        if g > 0.0:
            high = theta
        else:
            low = theta
        step = 0.5 * (low + high) - theta
        if u > 0.0:
            slope = c * u + s * rho * r * c / u + m * (s * rho - r * c * c)
            if slope > 0.0:
                newton = -g / slope
                if low < theta + newton < high:
                    step = newton
        theta += step
        if abs(step) < 1e-11:
            break
    s = math.sin(theta)
    rho = d + r * s
    u = min(max(math.sqrt(max((rho - q) * (rho + q), 0.0)), start), hi)
    if s < 0.7:
        return u, _profile(math.sqrt(q * q + u * u), r, d)
    return u, r - r * math.cos(theta)


@njit(**KERNEL)
def _edge_bound(z0, ez, length, u0, lo, hi, q, r, d):
    """No point of the edge lifts a bull nose above this: ``_bound`` for a line, and no root to find."""
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


@njit(**KERNEL)
def _edge(a, b, x, y, R, r, d, best):
    """Tip that the edge a-b allows and the place of the contact on it (0 at a, 1 at b); -inf: no lift."""
    if max(a[2], b[2]) <= best:
        return NOTHING, 0.0
    ax, ay = a[0] - x, a[1] - y
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    l2 = ex * ex + ey * ey
    if l2 < 1e-24:
        t = 1.0 if ez > 0.0 else 0.0
        rho2 = (ax + t * ex) ** 2 + (ay + t * ey) ** 2
        if rho2 >= R * R:
            return NOTHING, 0.0
        return a[2] + t * ez - _profile(math.sqrt(rho2), r, d), t
    length = math.sqrt(l2)
    q = abs(ax * ey - ay * ex) / length
    if q >= R:
        return NOTHING, 0.0
    half = math.sqrt((R - q) * (R + q))
    u0 = (ax * ex + ay * ey) / length
    u1 = u0 + length
    lo, hi = max(u0, -half), min(u1, half)
    if lo >= hi:
        return NOTHING, 0.0
    if r <= 0.0:
        u = hi if ez > 0.0 else lo
        height = 0.0
    elif d <= 0.0:
        slant = math.sqrt(l2 + ez * ez)
        u = half * (ez / slant)
        if u < lo:
            u = lo
            height = R - math.sqrt(max((half - u) * (half + u), 0.0))
        elif u > hi:
            u = hi
            height = R - math.sqrt(max((half - u) * (half + u), 0.0))
        else:
            height = R - half * (length / slant)
    elif _edge_bound(a[2], ez, length, u0, lo, hi, q, r, d) <= best:
        return NOTHING, 0.0
    elif ez >= 0.0:
        u, height = _bull_edge(lo, hi, q, ez / length, R, r, d)
    else:
        u, height = _bull_edge(-hi, -lo, q, -ez / length, R, r, d)
        u = -u
    t = min(max((u - u0) / length, 0.0), 1.0)
    return a[2] + t * ez - height, t


@njit(**KERNEL)
def _triangle(v, facet, x, y, R, r, d, best):
    """Tip that one triangle allows, and its contact point; at most ``best`` means no lift."""
    p, q, s = v[0], v[1], v[2]
    nx, ny, nz, quality = facet[0], facet[1], facet[2], facet[4]
    w0 = w1 = w2 = -1.0
    if quality != EDGES_ONLY:
        cx, cy = -r * nx, -r * ny
        if d > 0.0:
            lean = math.sqrt(nx * nx + ny * ny)
            if lean > 1e-14:
                cx -= d * (nx / lean)
                cy -= d * (ny / lean)
        height = r * (1.0 - nz)
        cx += x
        cy += y
        px, py, qx, qy, sx, sy = p[0] - cx, p[1] - cy, q[0] - cx, q[1] - cy, s[0] - cx, s[1] - cy
        if quality == SOUND and p[2] + (nx * px + ny * py) / nz - height <= best:
            return NOTHING, 0.0, 0.0, 0.0
        side = facet[3]
        w0, w1, w2 = side * (qx * sy - sx * qy), side * (sx * py - px * sy), side * (px * qy - qx * py)
        if w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
            total = w0 + w1 + w2
            if total > 0.0:
                w0, w1, w2 = w0 / total, w1 / total, w2 / total
                cz = w0 * p[2] + w1 * q[2] + w2 * s[2]
                if quality == CAREFUL:
                    # The normal is rough: take the profile at the point itself, which is never too high.
                    cx = w0 * p[0] + w1 * q[0] + w2 * s[0]
                    cy = w0 * p[1] + w1 * q[1] + w2 * s[1]
                    rho = math.sqrt((cx - x) ** 2 + (cy - y) ** 2)
                    if rho < R:
                        height = min(height, _profile(rho, r, d))
                return cz - height, cx, cy, cz
        if quality == CAREFUL:
            w0 = w1 = w2 = -1.0
    tip, t, edge = NOTHING, 0.0, 0
    if w0 <= 0.0:
        tip, t = _edge(q, s, x, y, R, r, d, best)
    if w1 <= 0.0:
        other, place = _edge(s, p, x, y, R, r, d, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 1
    if w2 <= 0.0:
        other, place = _edge(p, q, x, y, R, r, d, max(best, tip))
        if other > tip:
            tip, t, edge = other, place, 2
    a, b = (q, s) if edge == 0 else ((s, p) if edge == 1 else (p, q))
    return tip, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@njit(**KERNEL)
def _bound(node, x, y, R, r, d, best):
    """No point of the node lifts the tip above this; -inf where that is clear to be no higher than best.

    As a function of w = rho^2, h is convex, so h(rho) >= h(rho0) + k/2 (w - rho0^2) with k = h'(rho0) / rho0:
    a paraboloid below the cutter, whatever its kind. Less that, the covering plane has its maximum over the
    box where each coordinate has its own. rho0 is where the plane itself would touch (k = tan / rho0, for a
    flat end the multiplier of rho <= R), or the nearest point of the box if that is farther out.
    """
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


@njit(**KERNEL)
def descend(tree: TreeArrays, x, y, radius, corner_radius, start, first_only):
    """Highest lift above ``start``: tip, place in leaf order (-1: nothing lifts) and contact point.

    first_only stops at the first triangle that lifts at all.
    """
    r = min(corner_radius, radius)
    d = radius - r
    # Within a millionth of a nanometre for any cutter, and nothing underflows.
    if d <= 1e-12 * radius:
        r, d = radius, 0.0
    elif r <= 1e-12 * radius:
        r, d = 0.0, radius
    best, slot, cx, cy, cz = start, -1, np.nan, np.nan, np.nan
    column, child, parent = tree.column, tree.child, tree.parent
    node = 0
    trail = np.uint64(0)
    one = np.uint64(1)
    if _bound(column[0], x, y, radius, r, d, best) <= best:
        return best, slot, cx, cy, cz
    while True:
        inner = child[node]
        if inner >= 0:
            left = _bound(column[inner], x, y, radius, r, d, best)
            right = _bound(column[inner + 1], x, y, radius, r, d, best)
            if left > best or right > best:
                trail <<= one
                if left > best and right > best:
                    trail |= one
                node = inner if left >= right else inner + 1
                continue
        else:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                tip, px, py, pz = _triangle(tree.corners[i], tree.facets[i], x, y, radius, r, d, best)
                if tip > best:
                    best, slot, cx, cy, cz = tip, i, px, py, pz
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
            if _bound(column[node], x, y, radius, r, d, best) > best:
                break


@njit(**KERNEL)
def drop_tip(tree: TreeArrays, x, y, radius, corner_radius):
    """Lowest tip height over (x, y) that leaves the mesh untouched, mm; -inf where nothing is below."""
    return descend(tree, x, y, radius, corner_radius, NOTHING, False)[0]


@njit(**KERNEL)
def drop_tip_below(tree: TreeArrays, x, y, radius, corner_radius, z_start):
    """The larger of z_start and ``drop_tip``: cheap where z_start is close to the answer."""
    return descend(tree, x, y, radius, corner_radius, z_start, False)[0]


@njit(**KERNEL)
def is_blocked(tree: TreeArrays, x, y, z, radius, corner_radius):
    """Whether some triangle would lift the tip from z by more than 1e-9 mm."""
    return descend(tree, x, y, radius, corner_radius, z + BLOCK_TOLERANCE, True)[1] >= 0


@njit(**KERNEL)
def drop_tip_contact(tree: TreeArrays, x, y, radius, corner_radius):
    """``drop_tip`` with the triangle of the mesh (-1: none) and the contact point (NaN: none)."""
    tip, slot, cx, cy, cz = descend(tree, x, y, radius, corner_radius, NOTHING, False)
    return tip, (tree.order[slot] if slot >= 0 else -1), cx, cy, cz


@njit(**KERNEL)
def drop_range(tree, xy, radius, corner_radius, lo, hi, out):
    """``drop_tip`` for the points lo .. hi - 1 of xy (n, 2)."""
    for i in range(lo, hi):
        out[i] = drop_tip(tree, xy[i, 0], xy[i, 1], radius, corner_radius)


@njit(**KERNEL)
def blocked_range(tree, tips, radius, corner_radius, lo, hi, out):
    """``is_blocked`` for the tips lo .. hi - 1 of tips (n, 3)."""
    for i in range(lo, hi):
        out[i] = is_blocked(tree, tips[i, 0], tips[i, 1], tips[i, 2], radius, corner_radius)


@njit(**KERNEL)
def contact_range(tree, xy, radius, corner_radius, lo, hi, out, triangle, contact):
    """``drop_tip_contact`` for the points lo .. hi - 1 of xy (n, 2)."""
    for i in range(lo, hi):
        tip, number, cx, cy, cz = drop_tip_contact(tree, xy[i, 0], xy[i, 1], radius, corner_radius)
        out[i], triangle[i] = tip, number
        contact[i, 0], contact[i, 1], contact[i, 2] = cx, cy, cz


@njit(**KERNEL)
def grid_rows(tree, x0, y0, step, radius, corner_radius, lo, hi, out):
    """``drop_tip`` over (x0 + column * step, y0 + row * step) for the rows lo .. hi - 1 of out (ny, nx)."""
    for j in range(lo, hi):
        for i in range(out.shape[1]):
            out[j, i] = drop_tip(tree, x0 + i * step, y0 + j * step, radius, corner_radius)


@njit(**KERNEL, parallel=True)
def drop_many_parallel(tree, xy, radius, corner_radius, out):
    """``drop_range`` over all points, on the threads numba has; the same bytes on any number of them."""
    for i in prange(xy.shape[0]):
        out[i] = drop_tip(tree, xy[i, 0], xy[i, 1], radius, corner_radius)


@njit(**KERNEL, parallel=True)
def blocked_many_parallel(tree, tips, radius, corner_radius, out):
    """``blocked_range`` over all tips, on the threads numba has."""
    for i in prange(tips.shape[0]):
        out[i] = is_blocked(tree, tips[i, 0], tips[i, 1], tips[i, 2], radius, corner_radius)


@njit(**KERNEL, parallel=True)
def grid_parallel(tree, x0, y0, step, radius, corner_radius, out):
    """``grid_rows`` over all rows, on the threads numba has."""
    for j in prange(out.shape[0]):
        grid_rows(tree, x0, y0, step, radius, corner_radius, j, j + 1, out)
