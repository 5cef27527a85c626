"""Does stock stand at one of the places on the shell of a tool, at one of many poses.

The places lie in boxes along the tool, boxes of boxes over them; the stock is a height over the plan with the highest
of squares of 2, 4, 8, ... nodes a side over it. A box whose lowest corner is above all that stands under it is left out
with everything in it: the answer is that of asking every place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL
from zones.kernels.lattice import LatticeFrame

F64 = NDArray[np.float64]

LEAF, BRANCH = 8, 4  # places of a box, boxes of a box above
CARE = 1e-9  # mm: what rounding may move a place out of its box
WIDE = 2  # squares a side, and one: so fine is the height looked at under a box
STACK = 256


class Ceilings(NamedTuple):
    """Heights of stock over a lattice, and the highest of ever larger squares of it, access frame.

    heights : (h,) float64, mm, of the lattice row by row, then of squares of 2, 4, 8, ... nodes a side
    begins  : (l,) int64, index, where each level begins in ``heights``
    ny, nx  : int, count of rows and columns of the lattice
    """

    heights: F64
    begins: NDArray[np.int64]
    ny: int
    nx: int


class PoseArrays(NamedTuple):
    """Poses of a tool, access frame.

    tips   : (n, 3) float64, mm
    axes   : (n, 3) float64, unit, tip to spindle
    first  : (n, 3) float64, unit, square to the axis
    second : (n, 3) float64, unit, square to the axis and to ``first``
    """

    tips: F64
    axes: F64
    first: F64
    second: F64


class ShellArrays(NamedTuple):
    """Places on a tool in boxes of boxes, as ``toolpath.stock.tool_shell.Shell`` makes them, frame of the tool.

    places : (n, 3) float64, mm
    boxes  : (b, 6) float64, mm, centre and half the sides
    levels : (l + 1,) int64, index, where the boxes of each level begin, and their count
    """

    places: F64
    boxes: F64
    levels: NDArray[np.int64]


@njit(**KERNEL)
def highest_of_four(fine, coarse):
    """Fill coarse (ny, nx) with the highest of each 2 by 2 nodes of fine."""
    ny, nx = fine.shape
    for i in range(len(coarse)):
        for j in range(coarse.shape[1]):
            high = fine[2 * i, 2 * j]
            if 2 * i + 1 < ny:
                high = max(high, fine[2 * i + 1, 2 * j])
            if 2 * j + 1 < nx:
                high = max(high, fine[2 * i, 2 * j + 1])
                if 2 * i + 1 < ny:
                    high = max(high, fine[2 * i + 1, 2 * j + 1])
            coarse[i, j] = high


@njit(**KERNEL)
def stands_above(ceilings: Ceilings, i0, i1, j0, j1, z):
    """Whether anything in rows i0 to i1 and columns j0 to j1 is higher than z; if not sure, yes."""
    heights, begins, ny, nx = ceilings
    i0, i1, j0, j1 = max(i0, 0), min(i1, ny - 1), max(j0, 0), min(j1, nx - 1)
    if i0 > i1 or j0 > j1:
        return False
    level = 0
    while (i1 >> level) - (i0 >> level) > WIDE or (j1 >> level) - (j0 >> level) > WIDE:
        level += 1
    columns = ((nx - 1) >> level) + 1
    for i in range(i0 >> level, (i1 >> level) + 1):
        for j in range(j0 >> level, (j1 >> level) + 1):
            if heights[begins[level] + i * columns + j] > z:
                return True
    return False


@njit(**KERNEL)
def stands_in(ceilings: Ceilings, frame: LatticeFrame, poses: PoseArrays, shell: ShellArrays, out):
    """Set out[k], (n,) bool, where the node nearest to a place of the shell at pose k is higher than the place."""
    heights, _, ny, nx = ceilings
    x0, y0, step = frame
    tips, axes, first, second = poses
    places, boxes, levels = shell
    stack_level, stack_box = np.empty(STACK, np.int64), np.empty(STACK, np.int64)
    top = len(levels) - 2
    for k in range(len(tips)):
        if out[k] or not len(places):
            continue
        t, a, u, v = tips[k], axes[k], first[k], second[k]
        n = 0
        for b in range(levels[top + 1] - levels[top] - 1, -1, -1):
            stack_level[n], stack_box[n] = top, b
            n += 1
        while n > 0 and not out[k]:
            n -= 1
            level, b = stack_level[n], stack_box[n]
            box = boxes[levels[level] + b]
            x = t[0] + box[0] * u[0] + box[1] * v[0] + box[2] * a[0]
            y = t[1] + box[0] * u[1] + box[1] * v[1] + box[2] * a[1]
            z = t[2] + box[0] * u[2] + box[1] * v[2] + box[2] * a[2]
            dx = abs(box[3] * u[0]) + abs(box[4] * v[0]) + abs(box[5] * a[0]) + CARE
            dy = abs(box[3] * u[1]) + abs(box[4] * v[1]) + abs(box[5] * a[1]) + CARE
            dz = abs(box[3] * u[2]) + abs(box[4] * v[2]) + abs(box[5] * a[2]) + CARE
            i0, i1 = int(np.rint((y - dy - y0) / step)), int(np.rint((y + dy - y0) / step))
            j0, j1 = int(np.rint((x - dx - x0) / step)), int(np.rint((x + dx - x0) / step))
            if not stands_above(ceilings, i0, i1, j0, j1, z - dz):
                continue
            if level > 0:
                for c in range(min((b + 1) * BRANCH, levels[level] - levels[level - 1]) - 1, b * BRANCH - 1, -1):
                    stack_level[n], stack_box[n] = level - 1, c
                    n += 1
                continue
            for q in range(b * LEAF, min((b + 1) * LEAF, len(places))):
                p = places[q]
                j = int(np.rint((t[0] + p[0] * u[0] + p[1] * v[0] + p[2] * a[0] - x0) / step))
                i = int(np.rint((t[1] + p[0] * u[1] + p[1] * v[1] + p[2] * a[1] - y0) / step))
                if 0 <= i < ny and 0 <= j < nx and heights[i * nx + j] > (
                        t[2] + p[0] * u[2] + p[1] * v[2] + p[2] * a[2]):
                    out[k] = True
                    break
