"""Places of square lattices on triangles, seen along the axes each triangle faces most; rows sorted by cell.

Notation
    h          : mm between the lines of the lattice, which lies square to the axis, shifted by ``SHIFT`` h from 0
    u, v       : the two coordinates across the axis, turned by the angle whose tangent is the golden section: what is
                 long and narrow on a part mostly lies along X, Y or Z, and there such a lattice leaves no wide gaps
Notation of graded lattices on flat faces, coarse inside and fine near the border
    h          : mm, side of a coarse cell, which is split into k x k fine ones, k odd, so that both share a middle
    flat       : (m, 3, 2) float64, mm, corners of triangles in the plane of the lattice
    near       : (p, q) bool, cells that are split, counted from cell (i0, j0)
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL

SHIFT = 0.381966  # of h: edges of parts stand on round numbers, and lattice lines should not
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
COSINE, SINE = 1.0 / math.sqrt(1.0 + GOLDEN**2), GOLDEN / math.sqrt(1.0 + GOLDEN**2)
OVER = 1e-9  # of h, by which triangles count beyond their edges
ALIKE = 0.9  # of the largest part of a normal: along such an axis a lattice is laid, too, so that none ends at a seam


@njit(**KERNEL)
def _across(t, u):
    """First and last v at which the line of this u crosses a triangle (3, 2); first > last where it passes by."""
    lo, hi = math.inf, -math.inf
    for k in range(3):
        p, q = t[k], t[(k + 1) % 3]
        if p[0] == q[0]:
            if p[0] == u:
                lo, hi = min(lo, p[1], q[1]), max(hi, p[1], q[1])
            continue
        s = (u - p[0]) / (q[0] - p[0])
        if 0.0 <= s <= 1.0:
            v = p[1] + s * (q[1] - p[1])
            lo, hi = min(lo, v), max(hi, v)
    return lo, hi


@njit(**KERNEL)
def lattice_places(triangles, normals, h, out, area, owner):
    """Write the places of the lattice on triangles (m, 3, 3) mm into out (n, 3), and their triangle into owner (n,).

    normals : (m, 3) unit; area (n,) mm², represented by each place. Nothing is written beyond n.

    Returns how many there are, which may exceed n.
    """
    count = 0
    turned = np.empty((3, 2))
    for m in range(len(triangles)):
        t, n = triangles[m], normals[m]
        least = ALIKE * max(abs(n[0]), abs(n[1]), abs(n[2]))
        laid = 0
        for axis in range(3):
            laid += abs(n[axis]) >= least
        for axis in range(3):
            if not 0.0 < least <= abs(n[axis]):
                continue
            a, b = (axis + 1) % 3, (axis + 2) % 3
            for k in range(3):
                turned[k, 0] = COSINE * t[k, a] + SINE * t[k, b]
                turned[k, 1] = COSINE * t[k, b] - SINE * t[k, a]
            low, high = min(turned[0, 0], turned[1, 0], turned[2, 0]), max(turned[0, 0], turned[1, 0], turned[2, 0])
            for i in range(math.ceil(low / h - SHIFT), math.floor(high / h - SHIFT) + 1):
                u = (i + SHIFT) * h
                lo, hi = _across(turned, u)
                if lo > hi:
                    continue
                for j in range(math.ceil(lo / h - SHIFT - OVER), math.floor(hi / h - SHIFT + OVER) + 1):
                    if count < len(out):
                        v = (j + SHIFT) * h
                        x, y = COSINE * u - SINE * v, SINE * u + COSINE * v
                        out[count, a], out[count, b] = x, y
                        out[count, axis] = t[0, axis] - (n[a] * (x - t[0, a]) + n[b] * (y - t[0, b])) / n[axis]
                        area[count], owner[count] = h * h / (abs(n[axis]) * laid), m
                    count += 1
    return count


@njit(**KERNEL)
def mark_near(places, h, within, i0, j0, near):
    """Mark the cells that come as near as ``within`` mm to a place.

    places : (n, 2) float64, mm; h : mm, side of a cell; i0, j0 : number of the first row and column of ``near``
    """
    reach = within / h
    for m in range(len(places)):
        x, y = places[m, 0] / h - i0, places[m, 1] / h - j0
        for a in range(max(math.floor(x - reach), 0), min(math.floor(x + reach) + 1, near.shape[0])):
            beside = max(a - x, x - a - 1.0, 0.0)
            for b in range(max(math.floor(y - reach), 0), min(math.floor(y + reach) + 1, near.shape[1])):
                if beside**2 + max(b - y, y - b - 1.0, 0.0)**2 <= reach**2:
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


@njit(**KERNEL)
def sorted_by_key(key: NDArray[np.int64], order: NDArray[np.int64], first: NDArray[np.int64]) -> None:
    """Sort rows by a key and find where each key begins.

    key   : (n,) int64, index, 0 to k - 1
    order : (n,) int64, index, out; rows by key, in their own order where keys are equal
    first : (k + 1,) int64, index, out; start of each key in ``order``
    """
    first[:] = 0
    for i in range(len(key)):
        first[key[i] + 1] += 1
    for k in range(1, len(first)):
        first[k] += first[k - 1]
    place = first[:-1].copy()
    for i in range(len(key)):
        k = key[i]
        order[place[k]] = i
        place[k] += 1
