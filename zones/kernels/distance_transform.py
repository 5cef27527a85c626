"""Distance of the nodes of a lattice from the nearest blocked node, and which that is [Meijster2000].

Notation
    b(i, k)  the row of the blocked node of column k nearest to row i
    f_k(j)   (j - k)^2 + (i - b(i, k))^2: squared distance in steps of node (i, j) from that node

The least f_k(j) over the columns k is the squared distance of the node. Two of these parabolas cross once, so along a
row each column that counts rules one run of nodes. All numbers are integers, so the result is exact.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def nearest_blocked(free, step, far, near):
    """Fills the distances from the nearest blocked node and its row and column; at least one node is blocked.

    free : (ny, nx) bool
    step : mm
    far  : (ny, nx) float64, out, mm; 0 at blocked nodes
    near : (2, ny, nx) int32, out; of several at the same distance any one
    """
    ny, nx = free.shape
    rows = near[0]
    _along_columns(free, rows)
    height = np.empty(nx, np.int64)
    ruler, begin = np.empty(nx, np.int64), np.empty(nx, np.int64)
    held = np.empty(nx, np.int32)
    for i in range(ny):
        count = 0
        for k in range(nx):
            held[k] = rows[i, k]
            if held[k] < 0:
                continue
            up = i - held[k]
            height[k] = up * up
            start = 0
            while count > 0:
                q = ruler[count - 1]
                # the first column where f_k is less than f_q
                start = (k * k - q * q + height[k] - height[q]) // (2 * (k - q)) + 1
                if start > begin[count - 1]:
                    break
                count -= 1
            if count == 0:
                start = 0
            if start < nx:
                ruler[count], begin[count] = k, start
                count += 1
        for m in range(count):
            q = ruler[m]
            end = begin[m + 1] if m + 1 < count else nx
            for j in range(begin[m], end):
                far[i, j] = step * math.sqrt(float((j - q) * (j - q) + height[q]))
                near[0, i, j], near[1, i, j] = held[q], q


@njit(**KERNEL)
def _along_columns(free, rows):
    """Fills rows (ny, nx) int32 with b(i, k), -1 where a column has no blocked node."""
    ny, nx = free.shape
    for i in range(ny):
        for j in range(nx):
            if not free[i, j]:
                rows[i, j] = i
            elif i > 0:
                rows[i, j] = rows[i - 1, j]
            else:
                rows[i, j] = -1
    for i in range(ny - 2, -1, -1):
        for j in range(nx):
            below = rows[i + 1, j]
            if below >= 0 and (rows[i, j] < 0 or below - i < i - rows[i, j]):
                rows[i, j] = below
