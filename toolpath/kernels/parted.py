"""Price of a rectangle of a surface fed along its rows; notation of ``toolpath.five_axis.surface_partition``."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def price_rows(reach, length, a, b, c, d, lag):
    """Passes and mm of line of the places of columns a to b and rows c to d, and mm of its mean and shortest line.

    reach, length : (m, m) float64, as ``toolpath.five_axis.surface_partition.Feed``
    lag           : mm, by which a pass goes on over its end, where it is the neighbour that is cut
    """
    m = len(reach)
    total = 0.0
    for i in range(c, d):
        for j in range(a, b):
            total += length[i, j]
    share = (b - a) / m
    mean = total / ((d - c) * (b - a))
    stop = b + math.ceil(lag * m / mean) if lag * m < (m - b) * mean else m
    passes, way, shortest = 0.0, 0.0, np.inf
    for i in range(c, d):
        line, least = 0.0, np.inf
        for j in range(a, b):
            line += length[i, j]
        for j in range(a, stop):
            least = min(least, reach[i, j]) if reach[i, j] > 0.0 else 0.0
        line *= share / (b - a)
        each = 1.0 / (m * least) if least > 0.0 else np.inf
        passes += each
        way += each * line
        shortest = min(shortest, line)
    return passes, way, mean * share, shortest
