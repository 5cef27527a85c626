"""Distance of lattice nodes from the exact boundary of a free region.

Notation
    place    a point of the boundary on a lattice edge, as ``toolpath.kernels.contour`` finds it; chains of places, with
             the points put in between them, are the boundary
    b(p)     the blocked node nearest to a free node p, of a distance transform

The node beside b towards p is nearer to p than b, so it is free, and the edge between them holds a place. The boundary
nearest to p lies on the chain through that place. For a straight boundary at distance d from p, b is at most
sqrt(2 d step) beside the foot of p, where step is the spacing of the nodes; so much of the chain is looked at.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL

MORE = 3  # places looked at beyond the bound: the boundary bends, and chains hold more than one place a step


class Walls(NamedTuple):
    """The boundary of a free region.

    place         : (2 rows columns,) int64, of ``places_of``, for the lattice edges of a window, numbered as in
                    ``toolpath.kernels.contour``
    after, before : (n,) int64, place that follows and precedes each on its chain, -1 for none
    points        : (m, 2) float64, mm, places with the points put in behind each
    begins        : (n + 1,) int64, where the points of each place begin
    """

    place: NDArray[np.int64]
    after: NDArray[np.int64]
    before: NDArray[np.int64]
    points: NDArray[np.float64]
    begins: NDArray[np.int64]


class Bands(NamedTuple):
    """Distances from the nearest blocked node: round the first and ``lines`` - 1 more, each ``spacing`` on; all for 0.

    first, spacing : float, mm
    lines          : int
    below, above   : float, mm, what belongs to each of them
    """

    first: float
    spacing: float
    lines: int
    below: float
    above: float


EVERYWHERE = Bands(0.0, 1.0, 0, 0.0, 0.0)


@njit(**KERNEL)
def _to_piece(px, py, ax, ay, bx, by):
    """Squared distance of a point from a straight piece."""
    ux, uy = bx - ax, by - ay
    size = ux * ux + uy * uy
    t = 0.0
    if size > 0.0:
        t = min(max(((px - ax) * ux + (py - ay) * uy) / size, 0.0), 1.0)
    ex, ey = ax + t * ux - px, ay + t * uy - py
    return ex * ex + ey * ey


@njit(**KERNEL)
def _to_chain(px, py, start, reach, walls, least):
    """The less of ``least`` and the squared distance of a point from ``reach`` places on each side of a place."""
    after, before, points, begins = walls.after, walls.before, walls.points, walls.begins
    at = start
    for _ in range(reach):
        if before[at] < 0 or before[at] == start:
            break
        at = before[at]
    for _ in range(2 * reach + 1):
        following = after[at]
        last = begins[at + 1] - 1
        for k in range(begins[at], last):
            least = min(least, _to_piece(px, py, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1]))
        if following < 0:
            break
        k = begins[following]
        least = min(least, _to_piece(px, py, points[last, 0], points[last, 1], points[k, 0], points[k, 1]))
        at = following
    return least


@njit(**KERNEL)
def places_of(ids, window):
    """(2 rows columns,) int64: the place on each lattice edge of a window, -1 for none; parameters as below."""
    place = np.full(2 * window[2] * window[3], -1, np.int64)
    for k in range(len(ids)):
        place[ids[k]] = k
    return place


@njit(**KERNEL)
def _wanted(off, bands):
    """Whether a distance from the nearest blocked node is in one of the bands."""
    if bands.lines == 0:
        return True
    k = min(math.floor((off + bands.below - bands.first) / bands.spacing), bands.lines - 1.0)
    return k >= 0.0 and off <= bands.first + k * bands.spacing + bands.above


@njit(**KERNEL)
def _row(i, walls, window, off, nearest, asked, bands, frame, far):
    """One row of ``from_boundary``."""
    x0, y0, step = frame
    row, col, rows, cols = window
    for j in range(far.shape[1]):
        if not asked[i, j] or not _wanted(off[i, j], bands):
            continue
        bi, bj = nearest[0, i, j] - row, nearest[1, i, j] - col
        if not (0 <= bi < rows and 0 <= bj < cols):
            continue
        px, py = x0 + step * j, y0 + step * i
        node = bi * cols + bj
        reach = int(math.sqrt(2.0 * off[i, j] / step)) + MORE
        least = np.inf
        for side in range(4):  # right, up, left, down
            if side == 2 and bj == 0 or side == 3 and bi == 0:
                continue
            edge = 2 * node + (side & 1)
            if side == 2:
                edge -= 2
            elif side == 3:
                edge -= 2 * cols
            place = walls.place[edge]
            if place >= 0:
                least = _to_chain(px, py, place, reach, walls, least)
        if least < np.inf:
            far[i, j] = math.sqrt(least) if off[i, j] > 0.0 else -math.sqrt(least)


@njit(**KERNEL, parallel=True)
def from_boundary_parallel(walls, window, off, nearest, asked, bands, frame, far):
    """``from_boundary`` on the threads numba has; the same bytes on any number of them."""
    for i in prange(far.shape[0]):
        _row(i, walls, window, off, nearest, asked, bands, frame, far)


@njit(**KERNEL)
def from_boundary(walls, window, off, nearest, asked, bands, frame, far):
    """Fills in the distances of nodes from the boundary, mm, less than 0 for blocked nodes beside it.

    walls   : Walls
    window  : first row and column, count of rows and of columns
    off     : (ny, nx) float64, mm, distance of each node from the blocked node nearest to it
    nearest : (2, ny, nx) int32, row and column of the blocked node nearest to each node; its own for blocked ones
    asked   : (ny, nx) bool
    bands   : Bands; other nodes are left as they are
    frame   : LatticeFrame
    far     : (ny, nx) float64, out, mm
    """
    for i in range(far.shape[0]):
        _row(i, walls, window, off, nearest, asked, bands, frame, far)


@njit(**KERNEL)
def box_of(off, nearest, asked):
    """(4,) int64, least row and column, greatest row and column less than 0, of free nodes and those nearest to them.

    off, nearest, asked : as in ``from_boundary``

    All of it is 1 where no free node is asked for.
    """
    box = np.ones(4, np.int64)
    some = False
    for i in range(off.shape[0]):
        for j in range(off.shape[1]):
            if not asked[i, j] or not off[i, j] > 0.0:
                continue
            if not some:
                box[0], box[1], box[2], box[3] = i, j, -i, -j
                some = True
            row, col = np.int64(nearest[0, i, j]), np.int64(nearest[1, i, j])
            box[0], box[1] = min(box[0], i, row), min(box[1], j, col)
            box[2], box[3] = min(box[2], -i, -row), min(box[3], -j, -col)
    return box
