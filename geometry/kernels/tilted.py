"""Whether a tool with any axis enters the mesh, asked of the one hierarchy that stands in the part's frame.

Notation
    turn    (3, 3) rotation from the frame of the mesh to the axis frame; its rows are the axis frame's x, y and z,
            the last one the tool axis
    body    a row of (k, 3): radius R, corner radius r, and the height of the body's lower end above the tip. Every body
            goes on upwards without end, as in ``geometry.kernels.drop``
    floor   lowest height, in the axis frame, at which a point can be inside some body: tip + least height
Nodes keep their boxes in the part's frame. In the axis frame such a box is held by the upright box round its eight
turned corners: centre turn c, half sides |turn| h. The node's covering plane turns with the part, and bounds as long as
it still faces upwards. Triangles of a leaf are turned corner by corner and handed to the exact primitives of the
upright drop, so the answer is as exact as there; only the pruning is looser.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from geometry.kernels.bvh import STACK, TreeArrays, facet_row
from geometry.kernels.drop import BLOCK_TOLERANCE, bull_of
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import lift_of, node_bound

FACING = 0.05  # covering planes steeper than this (n_z over n_xy) are not used, as in the tree itself


@njit(**KERNEL, inline="always")
def _turned(t, x, y, z):
    return (t[0, 0] * x + t[0, 1] * y + t[0, 2] * z, t[1, 0] * x + t[1, 1] * y + t[1, 2] * z,
            t[2, 0] * x + t[2, 1] * y + t[2, 2] * z)


@njit(**KERNEL)
def _may_enter(lower, upper, column, t, x, y, z, floor, widest, bodies):
    """Whether a node could hold a point inside some body; no only where that is certain."""
    hx, hy, hz = 0.5 * (upper[0] - lower[0]), 0.5 * (upper[1] - lower[1]), 0.5 * (upper[2] - lower[2])
    cx, cy, cz = _turned(t, lower[0] + hx, lower[1] + hy, lower[2] + hz)
    top = cz + abs(t[2, 0]) * hx + abs(t[2, 1]) * hy + abs(t[2, 2]) * hz
    if top <= floor:
        return False
    ex = abs(t[0, 0]) * hx + abs(t[0, 1]) * hy + abs(t[0, 2]) * hz
    ey = abs(t[1, 0]) * hx + abs(t[1, 1]) * hy + abs(t[1, 2]) * hz
    u, v = max(abs(cx - x) - ex, 0.0), max(abs(cy - y) - ey, 0.0)
    if u * u + v * v > widest * widest:
        return False
    a, b, c, sine, slant = 0.0, 0.0, np.inf, 0.0, 1.0
    if column[7] < np.inf:
        # the half space -a x - b y + z <= c, turned
        nx, ny, nz = _turned(t, -column[5], -column[6], 1.0)
        lean = math.sqrt(nx * nx + ny * ny)
        if nz > FACING * lean:
            a, b, c = -nx / nz, -ny / nz, column[7] / nz
            length = math.sqrt(lean * lean + nz * nz)
            sine, slant = lean / length, length / nz
    row = (cx - ex, cx + ex, cy - ey, cy + ey, top, a, b, c, sine, slant)
    for k in range(bodies.shape[0]):
        start = z + bodies[k, 2] + BLOCK_TOLERANCE
        if node_bound(bull_of(bodies[k, 0], bodies[k, 1]), row, x, y, start) > start:
            return True
    return False


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
def is_blocked_along(tree: TreeArrays, t, x, y, z, bodies, floor, widest, stack):
    """Whether some triangle lifts some body by more than 1e-9 mm along the axis.

    t (3, 3) turn, (x, y, z) tip in the axis frame, bodies (k, 3), stack (STACK,) int64 to work in.
    """
    if not _may_enter(tree.lower[0], tree.upper[0], tree.column[0], t, x, y, z, floor, widest, bodies):
        return False
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = stack[top]
        inner = tree.child[node]
        if inner < 0:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                if _enters(tree, i, t, x, y, z, floor, widest, bodies):
                    return True
            continue
        for child in range(inner, inner + 2):
            if _may_enter(tree.lower[child], tree.upper[child], tree.column[child], t, x, y, z, floor, widest, bodies):
                stack[top] = child
                top += 1
    return False


@njit(**KERNEL)
def _one(tree, turns, which, tips, bodies, least, widest, i):
    stack = np.empty(STACK, np.int64)
    z = tips[i, 2]
    return is_blocked_along(tree, turns[which[i]], tips[i, 0], tips[i, 1], z, bodies, z + least, widest, stack)


@njit(**KERNEL)
def along_range(tree, turns, which, tips, bodies, least, widest, lo, hi, out):
    """``is_blocked_along`` for the tips lo .. hi - 1 of tips (n, 3), each in the frame turns[which]."""
    for i in range(lo, hi):
        out[i] = _one(tree, turns, which, tips, bodies, least, widest, i)


@njit(**KERNEL, parallel=True)
def along_parallel(tree, turns, which, tips, bodies, least, widest, out):
    """``along_range`` over all tips, on the threads numba has; the same bytes on any number of them."""
    for i in prange(tips.shape[0]):
        out[i] = _one(tree, turns, which, tips, bodies, least, widest, i)
