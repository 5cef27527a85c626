"""How wide a holder may be above the stickout of each tool: the nearest thing beside the axis, move by move.

Notation as in ``heights``. The lines are lowered as the moves go, so what counts is what stands at that time.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import sizes_of
from verify.kernels.frustum import Frustum, overlap
from verify.kernels.heights import _cells, lowest
from verify.kernels.tables import F64, MoveArrays

ENDLESS = 1e9  # mm, height of the cylinder that stands for the holder
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lower_lines(height, origin, step, a, d, cutter):
    """Lower the lines that the flutes reach on a move."""
    radius, length = cutter.radius, cutter.length
    a0, a1 = _cells(min(a[0], a[0] + d[0]) - radius, max(a[0], a[0] + d[0]) + radius, origin[0], step, 0,
                    height.shape[0])
    b0, b1 = _cells(min(a[1], a[1] + d[1]) - radius, max(a[1], a[1] + d[1]) + radius, origin[1], step, 0,
                    height.shape[1])
    floor = min(a[2], a[2] + d[2])
    for i in range(a0, a1 + 1):
        for j in range(b0, b1 + 1):
            if height[i, j] > floor:
                low, s = lowest(origin[0] + (i + 0.5) * step, origin[1] + (j + 0.5) * step, a[0], a[1], a[2], d[0],
                                d[1], d[2], cutter, 0.0)
                if low < height[i, j] <= a[2] + s * d[2] + length + 1e-9:
                    height[i, j] = low


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _off_box(s, a, d, box):
    """Distance in plan from the tip at s to a box."""
    x, y = a[0] + s * d[0], a[1] + s * d[1]
    return math.hypot(max(max(box[0, 0] - x, x - box[1, 0]), 0.0), max(max(box[0, 1] - y, y - box[1, 1]), 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def beside_box(a, d, stickout, box):
    """Least distance in plan from the axis to a box while the stickout is below its top, mm; inf where it never is."""
    s1, s2 = 0.0, 1.0
    room = box[1, 2] - stickout - a[2]  # the tip is below by s dz < room
    if abs(d[2]) < 1e-15:
        if room <= 0.0:
            return np.inf
    elif d[2] > 0.0:
        s2 = min(1.0, room / d[2])
    else:
        s1 = max(0.0, room / d[2])
    if s1 > s2:
        return np.inf
    least = min(_off_box(s1, a, d, box), _off_box(s2, a, d, box))
    for _ in range(40):  # convex in s
        u, v = s2 - GOLDEN * (s2 - s1), s1 + GOLDEN * (s2 - s1)
        at_u, at_v = _off_box(u, a, d, box), _off_box(v, a, d, box)
        least = min(least, at_u, at_v)
        if at_u < at_v:
            s2 = v
        else:
            s1 = u
    return least


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def free_widths(height: F64, origin: F64, step, moves: MoveArrays, cutters: F64, stickouts: F64, boxes: F64, least,
                where):
    """Narrow the free radius of each tool by all moves, and lower the lines, in place.

    height    : (nx, ny) float64, mm, setup frame, lines as ``LineArrays``
    origin    : (2,) float64, mm, setup frame; step : mm between lines
    cutters   : (k, 9) float64, mm, tool frame; stickouts : (k,) float64, mm, nan for a tool that is not asked for
    boxes     : (f, 2, 3) float64, mm, setup frame, fixtures
    least     : (k,) float64, mm, in: the largest radius asked for; out: the free radius
    where     : (k,) int64, index, out: the move that makes it the least; unchanged where none does
    """
    starts, ends, feeds, tool = moves
    top = -np.inf
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            top = max(top, height[i, j])
    for m in range(len(starts)):
        k = tool[m]
        a = (starts[m, 0], starts[m, 1], starts[m, 2])
        d = (ends[m, 0] - a[0], ends[m, 1] - a[1], ends[m, 2] - a[2])
        low = min(a[2], ends[m, 2])
        if feeds[m] and low < top:
            _lower_lines(height, origin, step, a, d, sizes_of(cutters, k))
        under = low + stickouts[k]
        if math.isnan(under):
            continue
        for f in range(len(boxes)):
            if boxes[f, 1, 2] > under:
                off = beside_box(a, d, stickouts[k], boxes[f])
                if off < least[k]:
                    least[k], where[k] = off, m
        if under >= top:
            continue
        wide = least[k]
        a0, a1 = _cells(min(a[0], ends[m, 0]) - wide, max(a[0], ends[m, 0]) + wide, origin[0], step, 0,
                        height.shape[0])
        b0, b1 = _cells(min(a[1], ends[m, 1]) - wide, max(a[1], ends[m, 1]) + wide, origin[1], step, 0,
                        height.shape[1])
        for i in range(a0, a1 + 1):
            for j in range(b0, b1 + 1):
                if height[i, j] > under:
                    body = Frustum(stickouts[k], ENDLESS, least[k], least[k])
                    depth = overlap(origin[0] + (i + 0.5) * step - a[0], origin[1] + (j + 0.5) * step - a[1],
                                    height[i, j] - a[2], d[0], d[1], d[2], body, True)
                    if depth > 0.0:
                        least[k], where[k] = max(least[k] - depth, 0.0), m
