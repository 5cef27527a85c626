"""The tip path of a tool that is dragged over the part along a straight line in plan.

The line is sampled at ``step``; a piece is halved while the tip height in its middle leaves the chord by more
than ``tol``. Where the height jumps (the edge of a wall) halving ends at ``smallest`` and the path is broken
there: no move may join the two sides. The points returned lie on the tip limit H exactly, so they are free.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from geometry.kernels.drop import drop_tip
from zones.kernels.lattice import noncut_at


@njit(cache=True, nogil=True)
def tip_limit(tree, noncut, row, x, y, radius, corner, allowance):
    """H(x, y) of the whole assembly, mm."""
    return max(drop_tip(tree, x, y, radius, corner) + allowance, noncut_at(noncut, row, x, y))


@njit(cache=True, nogil=True)
def follow(tree, noncut, row, ax, ay, bx, by, radius, corner, allowance, step, tol, smallest, steepest):
    """Tip path (n, 3) from a to b and ``broken`` (n,): no move from point k to k+1.

    steepest : a piece of length ``smallest`` that rises more than this times its length is a jump
    """
    length = np.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    n = max(1, int(np.ceil(length / step)))
    size = 4 * n + 64
    out = np.empty((size, 3))
    broken = np.zeros(size, np.bool_)
    m = 0
    stack = np.empty((64, 4))
    z0 = tip_limit(tree, noncut, row, ax, ay, radius, corner, allowance)
    for k in range(n):
        t1 = (k + 1) / n
        z1 = tip_limit(tree, noncut, row, ax + (bx - ax) * t1, ay + (by - ay) * t1, radius, corner, allowance)
        top = 0
        stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = k / n, z0, t1, z1
        while top >= 0:
            ta, za, tb, zb = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
            top -= 1
            run = (tb - ta) * length
            split = False
            if run > smallest:
                tm = 0.5 * (ta + tb)
                zm = tip_limit(tree, noncut, row, ax + (bx - ax) * tm, ay + (by - ay) * tm, radius, corner, allowance)
                split = abs(zm - 0.5 * (za + zb)) > tol or abs(zb - za) > steepest * run
                # two kinks can cancel in the middle, not there and at both quarters
                for q in (0.25, 0.75):
                    if not split:
                        t = ta + q * (tb - ta)
                        z = tip_limit(tree, noncut, row, ax + (bx - ax) * t, ay + (by - ay) * t, radius, corner,
                                      allowance)
                        split = abs(z - (za + q * (zb - za))) > tol
                if split:
                    stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2], stack[top + 1, 3] = tm, zm, tb, zb
                    stack[top + 2, 0], stack[top + 2, 1], stack[top + 2, 2], stack[top + 2, 3] = ta, za, tm, zm
                    top += 2
            if split:
                continue
            if m + 2 >= size:
                grown = np.empty((2 * size, 3))
                grown[:m] = out[:m]
                flags = np.zeros(2 * size, np.bool_)
                flags[:m] = broken[:m]
                out, broken, size = grown, flags, 2 * size
            out[m, 0], out[m, 1], out[m, 2] = ax + (bx - ax) * ta, ay + (by - ay) * ta, za
            broken[m] = abs(zb - za) > steepest * run or not np.isfinite(za + zb)
            m += 1
        z0 = z1
    out[m, 0], out[m, 1], out[m, 2] = bx, by, z0
    return out[: m + 1].copy(), broken[: m + 1].copy()
