"""Look-ups of the coarse shank and holder limits.

Notation: grid (ny, nx) tip limits at nodes x0 + j*s, y0 + i*s; the nearest node decides, which is safe
because its limit was taken with the radius grown by half a cell diagonal. The outermost nodes speak for everything
beyond the grid.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_at(grid, row, x, y):
    """Tip limit of shank and holder at one place, mm."""
    j = int(np.floor((x - row[0]) / row[2] + 0.5))
    i = int(np.floor((y - row[1]) / row[2] + 0.5))
    return grid[min(max(i, 0), grid.shape[0] - 1), min(max(j, 0), grid.shape[1] - 1)]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_lookup(grid, row, xy):
    """``noncut_at`` for xy (n, 2)."""
    out = np.empty(len(xy))
    for k in range(len(xy)):
        out[k] = noncut_at(grid, row, xy[k, 0], xy[k, 1])
    return out


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_blocked(grid, row, tips):
    """Whether shank or holder are too low at tips (n, 3)."""
    out = np.empty(len(tips), np.bool_)
    for k in range(len(tips)):
        out[k] = noncut_at(grid, row, tips[k, 0], tips[k, 1]) > tips[k, 2] + 1e-9
    return out
