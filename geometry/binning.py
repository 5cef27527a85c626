"""Rows sorted by the number of their cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.kernels.sampling import sorted_by_key
from geometry.mesh import F64


def by_cell(key: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows in the order of their cells, in their own order within a cell.

    key   : (n,) int64, index of the cell of each row, 0 to ``count`` - 1
    count : of cells

    Returns (n,) int64, index of the rows, and (count + 1,) int64, where each cell begins among them.
    """
    order, first = np.empty(len(key), np.int64), np.empty(count + 1, np.int64)
    sorted_by_key(np.ascontiguousarray(key), order, first)
    return order, first


def limits_of(points: F64) -> tuple[F64, F64]:
    """Least and greatest coordinates of points.

    points : (n, d) float64, mm, any frame; n > 0

    Returns two (d,) float64, mm, same frame. Numpy takes ten times as long for all columns of a tall array at once.
    """
    columns = range(points.shape[1])
    return np.array([points[:, c].min() for c in columns]), np.array([points[:, c].max() for c in columns])


__all__ = ["by_cell", "limits_of"]
