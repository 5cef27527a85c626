"""Places of a square lattice on a flat face: coarse inside, fine near its border.

Notation
    h    : mm, side of a coarse cell; a cell is split into k x k fine ones, k odd, so that both have the same middle
    flat : (m, 3, 2) float64, mm, corners of triangles in the plane of the lattice
    near : (p, q) bool, cells that are split, counted from cell (i0, j0)
"""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.options import KERNEL
from geometry.kernels.sampling import OVER, _across


@njit(**KERNEL)
def mark_near(places, h, grow, i0, j0, near):
    """Mark the cells at most ``grow`` rows and columns from that of a place. places : (n, 2) float64, mm."""
    for m in range(len(places)):
        i, j = math.floor(places[m, 0] / h) - i0, math.floor(places[m, 1] / h) - j0
        for a in range(max(i - grow, 0), min(i + grow + 1, near.shape[0])):
            for b in range(max(j - grow, 0), min(j + grow + 1, near.shape[1])):
                near[a, b] = True


@njit(**KERNEL)
def graded_places(flat, h, k, i0, j0, near, out, coarse, owner):
    """Write the middle of every coarse cell and of every fine one in split cells that lies in a triangle.

    out : (n, 2) float64, mm; coarse (n,) bool; owner (n,) int32, index of the triangle. Nothing is written beyond n.

    Returns how many there are, which may exceed n.
    """
    count, middle, step = 0, k // 2, h / k
    for m in range(len(flat)):
        t = flat[m]
        low, high = min(t[0, 0], t[1, 0], t[2, 0]), max(t[0, 0], t[1, 0], t[2, 0])
        for a in range(math.ceil(low / step - 0.5), math.floor(high / step - 0.5) + 1):
            u = (a + 0.5) * step
            lo, hi = _across(t, u)
            if lo > hi:
                continue
            i, row = a // k, a % k
            for b in range(math.ceil(lo / step - 0.5 - OVER), math.floor(hi / step - 0.5 + OVER) + 1):
                j = b // k
                split = near[i - i0, j - j0]
                if not split and (row != middle or b % k != middle):
                    continue
                if count < len(out):
                    out[count, 0], out[count, 1] = u, (b + 0.5) * step
                    coarse[count], owner[count] = not split, m
                count += 1
    return count
