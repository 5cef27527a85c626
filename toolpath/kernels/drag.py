"""The tip path of a tool dragged over a part along a line in plan, cut finer until it keeps a chord.

Notation
    limit    lowest tip height over a place: that of the cutting part, or of shank and holder where that is higher
    s, z     length along the way, and limit there
    tip      limit of the cutting part without the allowance; held : the triangle that holds it up
    corners  (m,) lengths of the corners of the way
    piece    from one place to the next; its quarters are looked at, and it is cut there where they leave its chord
Pieces are independent: they are cut depth first, and the places are those of any other order. The triangles that can
hold the tool up over a piece, or over a few short ones, are found once (``geometry.kernels.drop``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.drop import MOST, WIDE, Bull, find_near, lift_at, tip_near
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import radius_of
from geometry.kernels.tapered import Tapered
from geometry.kernels.two_arcs import TwoArcs
from zones.kernels.lattice import LatticeFrame, noncut_at

DEEP = 40  # times that a piece is cut in four; far more than its length allows


class TipLimit(NamedTuple):
    """The limit as plain arrays.

    tree      : TreeArrays of the obstacles
    shape     : the cutting part, grown by the allowance, a shape of ``geometry.kernels.revolved``
    allowance : mm
    noncut    : (ny, nx) float64, mm, tip limit of shank and holder; frame : LatticeFrame of its nodes
    """

    tree: TreeArrays
    shape: Bull | Tapered | TwoArcs
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


@njit(**KERNEL, inline="always")
def _look(limit, shape, way, corners, s, near, count, held):
    """Tip at length s along a way, what holds it up, and the limit; near and count as of ``tip_near``, held a guess."""
    x, y = place_on(way, corners, s)
    tip, held = tip_near(limit.tree, shape, x, y, near, count, held)
    return tip, held, max(tip + limit.allowance, noncut_at(limit.noncut, limit.frame, x, y))


@njit(**KERNEL)
def _ahead(limit, shape, way, corners, s, tip, held, at, k, near):
    """Triangles near the way from s to at[k], and on while it stays within a disc: their count and how far on; -1
    where that is not known from what holds the tip at s."""
    x, y = place_on(way, corners, s)
    x_lo, x_hi, y_lo, y_hi, floor, end = x, x, y, y, tip, s
    most = WIDE * radius_of(shape)
    for j in range(k, at.shape[0]):
        x, y = place_on(way, corners, at[j])
        lift = lift_at(shape, limit.tree.corners, limit.tree.facets, held, x, y)
        if not lift > tip - (at[j] - s) or (j > k and at[j] - s > most):
            break
        x_lo, x_hi, y_lo, y_hi = min(x_lo, x), max(x_hi, x), min(y_lo, y), max(y_hi, y)
        floor, end = min(floor, lift), at[j]
    if end == s:
        return -1, s
    off = 0.5 * math.sqrt((x_hi - x_lo) ** 2 + (y_hi - y_lo) ** 2)
    count = find_near(limit.tree, shape, 0.5 * (x_lo + x_hi), 0.5 * (y_lo + y_hi), off, floor, near)
    return count, end


@njit(**KERNEL)
def _between(limit, shape, way, corners, s0, tip0, held0, s1, tip1, held1, near):
    """Count of the triangles near a piece from s0 to s1, given the tips at its ends and what holds them up."""
    ax, ay = place_on(way, corners, s0)
    bx, by = place_on(way, corners, s1)
    floor = max(min(tip0, lift_at(shape, limit.tree.corners, limit.tree.facets, held0, bx, by)),
                min(tip1, lift_at(shape, limit.tree.corners, limit.tree.facets, held1, ax, ay)))
    off = 0.5 * math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    return find_near(limit.tree, shape, 0.5 * (ax + bx), 0.5 * (ay + by), off, floor, near)


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
    """Places along a way (m, 2) and the limit at each, two arrays (n,); ``at`` (k,) are the places to start from, the
    corners of the way among them.

    tolerance : mm, the path keeps to its chords; smallest : mm, no shorter piece is cut
    steepest  : mm of rise for each mm of way; a piece that rises more is cut too
    """
    shape = limit.shape
    near, known, upto = np.empty(MOST, np.int64), -1, -np.inf  # the list holds from the last place to ``upto``
    count, room = 1, max(2 * at.shape[0], 16)
    places, heights = np.empty(room), np.empty(room)
    tip, held, z = _look(limit, shape, way, corners, at[0], near, -1, -1)
    places[0], heights[0] = at[0], z
    # ends of the pieces that wait, the nearest on top
    ends, tops, tips, holds = np.empty(4 * DEEP), np.empty(4 * DEEP), np.empty(4 * DEEP), np.empty(4 * DEEP, np.int64)
    high, lows, by = np.empty(3), np.empty(3), np.empty(3, np.int64)
    for k in range(1, at.shape[0]):
        if at[k] > upto:
            known, upto = _ahead(limit, shape, way, corners, places[count - 1], tip, held, at, k, near)
        ends[0] = at[k]
        tips[0], holds[0], tops[0] = _look(limit, shape, way, corners, at[k], near, known, held)
        depth = 1
        while depth > 0:
            s0, z0, s1, z1 = places[count - 1], heights[count - 1], ends[depth - 1], tops[depth - 1]
            run = s1 - s0
            cut = False
            if run > smallest and depth < 4 * DEEP - 3:
                if known < 0 or s1 > upto:
                    known, upto = _between(limit, shape, way, corners, s0, tip, held, s1, tips[depth - 1],
                                           holds[depth - 1], near), s1
                guess = held
                for q in range(3):
                    s = s0 + run * (0.25 * (q + 1))
                    lows[q], guess, high[q] = _look(limit, shape, way, corners, s, near, known, guess)
                    by[q] = guess
                cut = _leaves(s0, z0, s1, z1, high, tolerance, steepest)
            if cut:
                for q in (2, 1, 0):
                    ends[depth], tops[depth], tips[depth] = s0 + run * (0.25 * (q + 1)), high[q], lows[q]
                    holds[depth] = by[q]
                    depth += 1
                continue
            if count == room:
                room *= 2
                more, rise = np.empty(room), np.empty(room)
                for j in range(count):
                    more[j], rise[j] = places[j], heights[j]
                places, heights = more, rise
            places[count], heights[count] = s1, z1
            tip, held = tips[depth - 1], holds[depth - 1]
            count += 1
            depth -= 1
    return places[:count].copy(), heights[:count].copy()


@njit(**KERNEL)
def _begun(way, step):
    """Lengths of the corners of a way (m, 2), and those to start from: the corners and even pieces of ``step`` at most,
    ascending."""
    m = way.shape[0]
    corners = np.empty(m)
    corners[0] = 0.0
    for k in range(1, m):
        dx, dy = way[k, 0] - way[k - 1, 0], way[k, 1] - way[k - 1, 1]
        corners[k] = corners[k - 1] + math.sqrt(dx * dx + dy * dy)
    total = corners[m - 1]
    more = max(1, int(math.ceil(total / step)))
    at = np.empty(m + more + 1)
    for k in range(m):
        at[k] = corners[k]
    for k in range(more):
        at[m + k] = k * (total / more)
    at[m + more] = total
    at.sort()
    count = 1
    for k in range(1, m + more + 1):
        if at[k] != at[count - 1]:
            at[count] = at[k]
            count += 1
    return corners, at[:count]


@njit(**KERNEL)
def followed(limit, way, step, tolerance, smallest, steepest):
    """The tip path along a way (m, 2), cut from pieces of ``step`` at most: points (n, 3), and whether no move may join
    points k and k + 1, (n - 1,). The rest as in ``dragged``."""
    corners, begun = _begun(way, step)
    at, z = dragged(limit, way, corners, begun, tolerance, smallest, steepest)
    points, broken = np.empty((at.shape[0], 3)), np.empty(at.shape[0] - 1, np.bool_)
    for k in range(at.shape[0]):
        points[k, 0], points[k, 1] = place_on(way, corners, at[k])
        points[k, 2] = z[k]
        if k:
            broken[k - 1] = not abs(z[k] - z[k - 1]) <= steepest * (at[k] - at[k - 1])
    return points, broken
