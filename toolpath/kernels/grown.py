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

    Along the rows each run of set nodes grows at both ends; down the columns a window counts what is set in it. The
    time does not depend on ``reach``.
    """
    ny, nx = mask.shape
    along = np.zeros((ny, nx), np.uint8)
    for i in range(ny):
        row, grown = mask[i], along[i]
        j, filled = 0, 0
        while j < nx:
            if not row[j]:
                j += 1
                continue
            first = max(j - reach, filled)
            while j < nx and row[j]:
                j += 1
            filled = min(j + reach, nx)
            for k in range(first, filled):
                grown[k] = 1
    count = np.zeros(nx, np.int32)
    for i in range(min(reach, ny)):
        for j in range(nx):
            count[j] += along[i, j]
    for i in range(ny):
        if i + reach < ny:
            for j in range(nx):
                count[j] += along[i + reach, j]
        if i > reach:
            for j in range(nx):
                count[j] -= along[i - reach - 1, j]
        for j in range(nx):
            out[i, j] = count[j] > 0
