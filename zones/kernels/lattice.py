"""Where the nodes of a lattice lie, and look-ups of the coarse shank and holder limits.

Notation: grid (ny, nx) tip limits at the nodes of a lattice; the nearest node decides, which is safe
because its limit was taken with the radius grown by half a cell diagonal. The outermost nodes speak for everything
beyond the grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class LatticeFrame(NamedTuple):
    """Places of the nodes of a lattice in plan: node (i, j) lies at x0 + j step, y0 + i step, access frame.

    x0, y0 : float, mm, of node (0, 0)
    step   : float, mm, from node to node
    """

    x0: float
    y0: float
    step: float


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_at(grid, frame: LatticeFrame, x, y):
    """Tip limit of shank and holder at one place, mm."""
    j = int(np.floor((x - frame.x0) / frame.step + 0.5))
    i = int(np.floor((y - frame.y0) / frame.step + 0.5))
    return grid[min(max(i, 0), grid.shape[0] - 1), min(max(j, 0), grid.shape[1] - 1)]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_lookup(grid, frame: LatticeFrame, xy):
    """``noncut_at`` for xy (n, 2)."""
    out = np.empty(len(xy))
    for k in range(len(xy)):
        out[k] = noncut_at(grid, frame, xy[k, 0], xy[k, 1])
    return out


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def noncut_blocked(grid, frame: LatticeFrame, tips):
    """Whether shank or holder are too low at tips (n, 3)."""
    out = np.empty(len(tips), np.bool_)
    for k in range(len(tips)):
        out[k] = noncut_at(grid, frame, tips[k, 0], tips[k, 1]) > tips[k, 2] + 1e-9
    return out
