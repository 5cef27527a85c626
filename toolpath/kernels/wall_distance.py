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

import numpy as np
from numba import njit, prange

from geometry.kernels.options import KERNEL

MORE = 3  # places looked at beyond the bound: the boundary bends, and chains hold more than one place a step


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
def _to_chain(px, py, start, reach, after, before, points, begins, least):
    """The less of ``least`` and the squared distance of a point from ``reach`` places on each side of a place."""
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
def _row(i, place, after, before, points, begins, window, nearest, asked, frame, far):
    """One row of ``from_boundary``."""
    x0, y0, step = frame
    row, col, rows, cols = window
    for j in range(far.shape[1]):
        if not asked[i, j]:
            continue
        bi, bj = nearest[0, i, j] - row, nearest[1, i, j] - col
        if not (0 <= bi < rows and 0 <= bj < cols):
            continue
        px, py = x0 + step * j, y0 + step * i
        node = bi * cols + bj
        reach = int(math.sqrt(2.0 * far[i, j] / step)) + MORE
        least = np.inf
        for side in range(4):  # right, up, left, down
            if side == 2 and bj == 0 or side == 3 and bi == 0:
                continue
            edge = 2 * node + (side & 1)
            if side == 2:
                edge -= 2
            elif side == 3:
                edge -= 2 * cols
            if place[edge] >= 0:
                least = _to_chain(px, py, place[edge], reach, after, before, points, begins, least)
        if least < np.inf:
            far[i, j] = math.sqrt(least) if far[i, j] > 0.0 else -math.sqrt(least)


@njit(**KERNEL, parallel=True)
def from_boundary_parallel(place, after, before, points, begins, window, nearest, asked, frame, far):
    """``from_boundary`` on the threads numba has; the same bytes on any number of them."""
    for i in prange(far.shape[0]):
        _row(i, place, after, before, points, begins, window, nearest, asked, frame, far)


@njit(**KERNEL)
def from_boundary(place, after, before, points, begins, window, nearest, asked, frame, far):
    """Replaces the distances of the nodes asked for by those from the boundary, mm, less than 0 for blocked nodes.

    place         : (2 rows columns,) int64, of ``places_of``, for the lattice edges of the window, numbered as in
                    ``toolpath.kernels.contour``
    after, before : (n,) int64, place that follows and precedes each on its chain, -1 for none
    points        : (m, 2) float64, mm, places with the points put in behind each
    begins        : (n + 1,) int64, where the points of each place begin
    window        : first row and column, count of rows and of columns
    nearest       : (2, ny, nx) int32, row and column of the blocked node nearest to each node; its own for blocked ones
    asked         : (ny, nx) bool
    frame         : LatticeFrame
    far           : (ny, nx) float64, mm, distance of each node from the blocked node nearest to it
    """
    for i in range(far.shape[0]):
        _row(i, place, after, before, points, begins, window, nearest, asked, frame, far)
