"""Masks on a lattice, grown."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def grow_square(mask: NDArray[np.bool_], reach: int, out: NDArray[np.bool_]) -> None:
    """Set the nodes that are at most ``reach`` rows and columns from a set node.

    mask : (ny, nx) bool; reach : nodes; out : (ny, nx) bool, out

    One run along the rows and one along the columns, forwards and backwards; the time does not depend on ``reach``.
    """
    ny, nx = mask.shape
    along = np.zeros((ny, nx), np.bool_)
    for i in range(ny):
        last = -reach - 1
        for j in range(nx):
            if mask[i, j]:
                last = j
            along[i, j] = j - last <= reach
        last = nx + reach
        for j in range(nx - 1, -1, -1):
            if mask[i, j]:
                last = j
            along[i, j] |= last - j <= reach
    below = np.full(nx, -reach - 1)
    for i in range(ny):
        for j in range(nx):
            if along[i, j]:
                below[j] = i
            out[i, j] = i - below[j] <= reach
    below[:] = ny + reach
    for i in range(ny - 1, -1, -1):
        for j in range(nx):
            if along[i, j]:
                below[j] = i
            out[i, j] |= below[j] - i <= reach
