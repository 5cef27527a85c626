"""Places of a surface that are one connected piece of it within a ball."""

from __future__ import annotations

import numpy as np
from numba import njit

from geometry.kernels.nearest import triangle2


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def one_piece(neighbours, corners, starts, goals, centres, radius, out):
    """out[i]: whether triangle goals[i] is reached from starts[i] over neighbours that a ball round centres[i] meets.

    neighbours : (k, 3) int64, neighbours of each triangle across its edges, -1 where there is none
    corners : (k, 3, 3) float64, mm; radius : mm
    """
    seen = np.full(len(corners), -1, np.int64)
    stack = np.empty(len(corners), np.int64)
    for i in range(len(starts)):
        out[i] = starts[i] == goals[i]
        seen[starts[i]] = i
        stack[0], depth = starts[i], 1
        while depth > 0 and not out[i]:
            depth -= 1
            here = stack[depth]
            for side in range(3):
                there = neighbours[here, side]
                if there < 0 or seen[there] == i:
                    continue
                seen[there] = i
                if there == goals[i]:
                    out[i] = True
                    break
                if triangle2(centres[i, 0], centres[i, 1], centres[i, 2], corners[there]) <= radius * radius:
                    stack[depth] = there
                    depth += 1
