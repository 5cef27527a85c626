"""Whether a tool with any axis enters the mesh, by the one hierarchy in the frame of the part.

Notation
    turn    (3, 3) rotation from the frame of the mesh to the axis frame; its rows are the axis frame's x, y and z,
            the last one the tool axis
    body    a row of (k, 3): radius R, corner radius r, and the height of the body's lower end above the tip. Every body
            goes on upwards without end, as in ``geometry.kernels.drop``
    floor   lowest height, in the axis frame, at which a point can be inside some body: tip + least height
A body is its core, the disc of radius R - r at height r above its lower end and all above, grown by r on all sides. It
is convex, and the distance of a point from it takes two differences and a root. The walk skips a node where a plane
separates its oriented box from every body. Triangles of a leaf are turned corner by corner and go to the exact
primitives of the upright drop, so the answer is as exact as there.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from geometry.kernels.bvh import STACK, TreeArrays, facet_row
from geometry.kernels.drop import BLOCK_TOLERANCE, bull_of
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import lift_of

SLACK = 1e-7  # mm, more than rounding: nodes nearer than this to a body are opened
LOOKS = 4  # rounds from box to body and back; after them the box counts as entered
RUN = 64  # consecutive tips of one thread


@njit(**KERNEL, inline="always")
def _turned(t, x, y, z):
    return (t[0, 0] * x + t[0, 1] * y + t[0, 2] * z, t[1, 0] * x + t[1, 1] * y + t[1, 2] * z,
            t[2, 0] * x + t[2, 1] * y + t[2, 2] * z)


@njit(**KERNEL)
def _enters(tree, i, t, x, y, z, floor, widest, bodies):
    """Whether triangle i of the leaf order enters some body."""
    v = tree.corners[i]
    p, q, s = _turned(t, v[0, 0], v[0, 1], v[0, 2]), _turned(t, v[1, 0], v[1, 1], v[1, 2]), _turned(
        t, v[2, 0], v[2, 1], v[2, 2])
    if max(p[2], q[2], s[2]) <= floor:
        return False
    if (min(p[0], q[0], s[0]) - x > widest or x - max(p[0], q[0], s[0]) > widest
            or min(p[1], q[1], s[1]) - y > widest or y - max(p[1], q[1], s[1]) > widest):
        return False
    facet = facet_row(p, q, s)
    for k in range(bodies.shape[0]):
        start = z + bodies[k, 2] + BLOCK_TOLERANCE
        if lift_of(bull_of(bodies[k, 0], bodies[k, 1]), (p, q, s), facet, x, y, start)[0] > start:
            return True
    return False


@njit(**KERNEL)
def _off(hull, ux, uy, uz, px, py, pz, bodies):
    """Distance of the middle of a node's box from a body that may enter the box; infinite where certainly none does.

    hull (16,) of ``geometry.kernels.bvh.hull_rows``, (ux, uy, uz) tool axis and (px, py, pz) tip in the frame of the
    mesh. Box and body are both convex. First their balls and the plane of the slab are tried. Then the search
    alternates between the nearest points of box and body, and tries the plane across their connection.
    """
    x, y, z = hull[0] - px, hull[1] - py, hull[2] - pz
    s = x * ux + y * uy + z * uz
    rx, ry, rz = x - s * ux, y - s * uy, z - s * uz
    rho = math.sqrt(rx * rx + ry * ry + rz * rz)
    ball = hull[15] + SLACK
    local = False
    n = a = b = vn = va = vb = q = 0.0
    for k in range(bodies.shape[0]):
        if s + ball <= bodies[k, 2]:
            continue
        r = min(bodies[k, 1], bodies[k, 0])
        d, h = bodies[k, 0] - r, bodies[k, 2] + r
        e, f = max(rho - d, 0.0), max(h - s, 0.0)
        if e * e + f * f >= (r + ball) * (r + ball):
            continue
        if not local:
            n = hull[3] * ux + hull[4] * uy + hull[5] * uz
            a = hull[6] * ux + hull[7] * uy + hull[8] * uz
            b = hull[9] * ux + hull[10] * uy + hull[11] * uz
            vn = hull[3] * x + hull[4] * y + hull[5] * z
            va = hull[6] * x + hull[7] * y + hull[8] * z
            vb = hull[9] * x + hull[10] * y + hull[11] * z
            q = math.sqrt(max(1.0 - n * n, 0.0))
            local = True
        if n >= 0.0:
            if n * h - r - d * q >= vn + hull[12] + SLACK:
                continue
        elif n * h + r + d * q <= vn - hull[12] - SLACK:
            continue
        tn = ta = tb = 0.0  # the point of the box, from its middle
        parted = False
        for _ in range(LOOKS):
            wn, wa, wb = vn + tn, va + ta, vb + tb
            up = wn * n + wa * a + wb * b
            wn, wa, wb = wn - up * n, wa - up * a, wb - up * b
            away = math.sqrt(wn * wn + wa * wa + wb * wb)
            e, f = max(away - d, 0.0), max(h - up, 0.0)
            far = math.sqrt(e * e + f * f)
            gap = far - r
            if gap <= SLACK:
                break
            e, f = e / (far * away) if e > 0.0 else 0.0, f / far
            gn, ga, gb = e * wn - f * n, e * wa - f * a, e * wb - f * b  # out of the body, to this point
            if (gap - abs(gn) * hull[12] - gn * tn - abs(ga) * hull[13] - ga * ta - abs(gb) * hull[14] - gb * tb
                    >= SLACK):
                parted = True
                break
            tn = min(max(tn - gap * gn, -hull[12]), hull[12])
            ta = min(max(ta - gap * ga, -hull[13]), hull[13])
            tb = min(max(tb - gap * gb, -hull[14]), hull[14])
        if not parted:
            return max(rho - bodies[k, 0], bodies[k, 2] - s)
    return np.inf


@njit(**KERNEL)
def is_blocked_along(tree: TreeArrays, hulls, t, x, y, z, bodies, floor, widest, stack, last):
    """Some triangle, in leaf order, that lifts some body by more than 1e-9 mm along the axis; -1 where none does.

    hulls (k, 16) of the nodes, t (3, 3) turn, (x, y, z) tip in the axis frame, bodies (k, 3), stack (STACK,) int64 to
    work in, last a triangle to try first or -1.
    """
    if last >= 0 and _enters(tree, last, t, x, y, z, floor, widest, bodies):
        return last
    ux, uy, uz = t[2, 0], t[2, 1], t[2, 2]
    px = t[0, 0] * x + t[1, 0] * y + ux * z
    py = t[0, 1] * x + t[1, 1] * y + uy * z
    pz = t[0, 2] * x + t[1, 2] * y + uz * z
    if _off(hulls[0], ux, uy, uz, px, py, pz, bodies) == np.inf:
        return -1
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        inner = tree.child[node]
        if inner < 0:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                if _enters(tree, i, t, x, y, z, floor, widest, bodies):
                    return i
            continue
        left = _off(hulls[inner], ux, uy, uz, px, py, pz, bodies)
        right = _off(hulls[inner + 1], ux, uy, uz, px, py, pz, bodies)
        later = inner if left > right else inner + 1  # the node deeper in the tool goes first: it is likelier to block
        if max(left, right) < np.inf:
            stack[top] = later
            top += 1
        if min(left, right) < np.inf:
            stack[top] = inner + inner + 1 - later
            top += 1
    return -1


@njit(**KERNEL)
def along_range(tree, hulls, turns, which, tips, bodies, lowest, widest, lo, hi, out):
    """Whether the tool is blocked at the tips lo .. hi - 1 of tips (n, 3), each in the frame turns[which].

    The triangle that blocked the last tip is tried first, since it often blocks the neighbour; any blocking one
    suffices.
    """
    stack = np.empty(STACK, np.int64)
    last = -1
    for i in range(lo, hi):
        z = tips[i, 2]
        found = is_blocked_along(tree, hulls, turns[which[i]], tips[i, 0], tips[i, 1], z, bodies, z + lowest, widest,
                                 stack, last)
        out[i] = found >= 0
        last = found if found >= 0 else last


@njit(**KERNEL, parallel=True)
def along_parallel(tree, hulls, turns, which, tips, bodies, lowest, widest, out):
    """``along_range`` over all tips, on the threads numba has; the same bytes on any number of them."""
    n = tips.shape[0]
    for j in prange((n + RUN - 1) // RUN):
        along_range(tree, hulls, turns, which, tips, bodies, lowest, widest, j * RUN, min((j + 1) * RUN, n), out)
