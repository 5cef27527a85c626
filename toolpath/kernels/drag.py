"""The tip path of a tool dragged over a part along a line in plan, cut finer until it keeps a chord.

Notation
    limit    lowest tip height over a place: that of the cutting part, or of shank and holder where that is higher
    s, z     length along the way, and limit there
    corners  (m,) lengths of the corners of the way
    piece    from one place to the next; its quarters are looked at, and it is cut there where they leave its chord
Pieces are independent: they are cut depth first, and the places are those of any other order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.drop import drop_tip
from geometry.kernels.options import KERNEL
from zones.kernels.lattice import LatticeFrame, noncut_at

DEEP = 40  # times that a piece is cut in four; far more than its length allows


class TipLimit(NamedTuple):
    """The limit as plain arrays.

    tree      : TreeArrays of the obstacles; radius, corner : mm, of the cutting part, grown by the allowance
    allowance : mm
    noncut    : (ny, nx) float64, mm, tip limit of shank and holder; frame : LatticeFrame of its nodes
    """

    tree: TreeArrays
    radius: float
    corner: float
    allowance: float
    noncut: NDArray[np.float64]
    frame: LatticeFrame


@njit(**KERNEL)
def place_on(way, corners, s):
    """Place at length s along a way (m, 2)."""
    last = corners.shape[0] - 1
    if last < 1:
        return way[0, 0], way[0, 1]
    k = min(max(np.searchsorted(corners, s, side="right") - 1, 0), last - 1)
    length = corners[k + 1] - corners[k]
    share = (s - corners[k]) / (length if length > 0.0 else 1.0)
    return way[k, 0] + share * (way[k + 1, 0] - way[k, 0]), way[k, 1] + share * (way[k + 1, 1] - way[k, 1])


@njit(**KERNEL)
def limit_on(limit, way, corners, s):
    """Limit at length s along a way."""
    x, y = place_on(way, corners, s)
    tip = drop_tip(limit.tree, x, y, limit.radius, limit.corner) + limit.allowance
    return max(tip, noncut_at(limit.noncut, limit.frame, x, y))


@njit(**KERNEL)
def _leaves(s0, z0, s1, z1, high, tolerance, steepest):
    """Whether a piece has to be cut at its quarters, given the limit ``high`` (3,) there."""
    run, rise = s1 - s0, z1 - z0
    keeps, some = abs(rise) <= steepest * run, math.isfinite(z0) or math.isfinite(z1)
    for q in range(3):
        keeps = keeps and abs(high[q] - (z0 + rise * (0.25 * (q + 1)))) <= tolerance
        some = some or math.isfinite(high[q])
    return not keeps and some


@njit(**KERNEL)
def dragged(limit, way, corners, at, tolerance, smallest, steepest):
    """Places along a way (m, 2) and the limit at each, two arrays (n,); ``at`` (k,) are the places to start from.

    tolerance : mm, the path keeps to its chords; smallest : mm, no shorter piece is cut
    steepest  : mm of rise for each mm of way; a piece that rises more is cut too
    """
    count, room = 1, max(2 * at.shape[0], 16)
    places, heights = np.empty(room), np.empty(room)
    places[0], heights[0] = at[0], limit_on(limit, way, corners, at[0])
    ends, tops, high = np.empty(4 * DEEP), np.empty(4 * DEEP), np.empty(3)
    for k in range(1, at.shape[0]):
        ends[0], tops[0] = at[k], limit_on(limit, way, corners, at[k])
        depth = 1
        while depth > 0:
            s0, z0, s1, z1 = places[count - 1], heights[count - 1], ends[depth - 1], tops[depth - 1]
            run = s1 - s0
            cut = False
            if run > smallest and depth < 4 * DEEP - 3:
                for q in range(3):
                    high[q] = limit_on(limit, way, corners, s0 + run * (0.25 * (q + 1)))
                cut = _leaves(s0, z0, s1, z1, high, tolerance, steepest)
            if cut:  # the quarters go on the pile, the nearest on top
                for q in (2, 1, 0):
                    ends[depth], tops[depth] = s0 + run * (0.25 * (q + 1)), high[q]
                    depth += 1
                continue
            if count == room:
                room *= 2
                more, rise = np.empty(room), np.empty(room)
                for j in range(count):
                    more[j], rise[j] = places[j], heights[j]
                places, heights = more, rise
            places[count], heights[count] = s1, z1
            count += 1
            depth -= 1
    return places[:count].copy(), heights[:count].copy()
