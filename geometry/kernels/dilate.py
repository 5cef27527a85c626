"""Maximum of a height field over a disc.

Notation
    w[k]   half length, in cells, of the chord of the disc in the rows +k and -k; falls with k
    D^n    maximum over n cells to the left and to the right in a row
The result of a row is the maximum over k of D^w[k] (rows j - k and j + k). Since D^a D^b = D^(a + b) and D
passes through a maximum, it is built from k = 0 outwards: row = max(D^(w[k-1] - w[k]) row, rows of k), and
D^w[last] at the end. That is w[0] steps of one cell and one maximum a chord: O(diameter) for each cell.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def _widen(row, spare, times):
    """D^times of a row, in ``row``; ``spare`` is room for one."""
    n = row.shape[0]
    if n < 2:
        return
    for _ in range(min(times, n)):
        for i in range(n - 1):
            spare[i] = row[i] if row[i] > row[i + 1] else row[i + 1]
        row[0] = spare[0]
        for i in range(1, n - 1):
            row[i] = spare[i - 1] if spare[i - 1] > spare[i] else spare[i]
        row[n - 1] = spare[n - 2]


@njit(**KERNEL)
def _raise_to(row, other):
    for i in range(row.shape[0]):
        row[i] = other[i] if other[i] > row[i] else row[i]


@njit(**KERNEL)
def dilate_row(height, half, j, row, spare):
    """Row j of the dilated field; ``half`` (K,) int64 holds w[0 .. K - 1]."""
    ny = height.shape[0]
    row[:] = height[j]
    for k in range(1, half.shape[0]):
        _widen(row, spare, half[k - 1] - half[k])
        if j - k >= 0:
            _raise_to(row, height[j - k])
        if j + k < ny:
            _raise_to(row, height[j + k])
    _widen(row, spare, half[-1])


@njit(**KERNEL)
def dilate_rows(height, half, out):
    """``dilate_row`` for every row."""
    spare = np.empty(height.shape[1])
    for j in range(height.shape[0]):
        dilate_row(height, half, j, out[j], spare)


@njit(**KERNEL, parallel=True)
def dilate_parallel(height, half, out):
    """``dilate_rows`` on the threads numba has."""
    for j in prange(height.shape[0]):
        dilate_row(height, half, j, out[j], np.empty(height.shape[1]))
