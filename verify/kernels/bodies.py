"""Neck, shank and holder against points of the part itself (exact, without the spacing of the stock lines).

Notation as in ``heights``; body and event rows as in ``stock``; the grid of points as in ``rays``.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from verify.kernels.frustum import Frustum, contact
from verify.kernels.rays import CellArrays, plan_distance
from verify.kernels.stock import _note, _worse, known_depth
from verify.kernels.tables import MoveArrays


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _body_cells(tile, cells, points, a, d, body, slack, best):
    """Find the points that one body takes in by more than ``slack`` along one move."""
    cx0, cx1, cy0, cy1 = tile
    origin, size, shape, first = cells
    z0, z1, r0, r1 = body[0], body[1], body[2], body[3]
    wide = max(r0, r1)
    x0 = max(cx0, math.floor((min(a[0], a[0] + d[0]) - wide - origin[0]) / size))
    x1 = min(cx1 - 1, math.floor((max(a[0], a[0] + d[0]) + wide - origin[0]) / size))
    y0 = max(cy0, math.floor((min(a[1], a[1] + d[1]) - wide - origin[1]) / size))
    y1 = min(cy1 - 1, math.floor((max(a[1], a[1] + d[1]) + wide - origin[1]) / size))
    low = max(0, math.floor((min(a[2], a[2] + d[2]) + z0 - origin[2]) / size))
    high = min(shape[2] - 1, math.floor((max(a[2], a[2] + d[2]) + z1 - origin[2]) / size))
    if high < low:
        return
    plan2 = d[0] * d[0] + d[1] * d[1]
    half = 0.5 * math.sqrt(2.0) * size
    for cx in range(x0, x1 + 1):
        for cy in range(y0, y1 + 1):
            row = (cx * shape[1] + cy) * shape[2]
            if first[row + low] == first[row + high + 1]:
                continue
            if plan_distance(origin[0] + (cx + 0.5) * size - a[0], origin[1] + (cy + 0.5) * size - a[1], d[0], d[1],
                             plan2) > wide + half:
                continue
            for i in range(first[row + low], first[row + high + 1]):
                depth = contact(points[i, 0] - a[0], points[i, 1] - a[1], points[i, 2] - a[2], d[0], d[1], d[2],
                                Frustum(z0, z1, r0, r1), body[4], slack, known_depth(best, int(body[5]), body[4]),
                                False)
                if depth > 0.0:
                    _worse(best, int(body[5]), depth, body[4], points[i, 0], points[i, 1], points[i, 2])


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def body_tile(tile, cells: CellArrays, points, moves: MoveArrays, radii, bodies, body_first, slack, events):
    """Events of all feed moves with the points in the cell columns of a tile (x0, x1, y0, y1); returns their number.

    points : (n, 3) float64, mm, sorted by cell; radii : (k,) float64, mm, of the cutting parts
    bodies : (b, 6) float64, mm; rows body_first[k]:body_first[k + 1] belong to tool k
    slack  : mm of overlap that a body no wider than the cutting part may have
    """
    best = np.zeros((16, 5))
    count = 0
    top = cells.origin[2] + cells.shape[2] * cells.size
    starts, ends, feeds, tool = moves
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        k = tool[m]
        for b in range(body_first[k], body_first[k + 1]):
            if min(starts[m, 2], ends[m, 2]) + bodies[b, 0] >= top:
                continue
            a = (starts[m, 0], starts[m, 1], starts[m, 2])
            d = (ends[m, 0] - a[0], ends[m, 1] - a[1], ends[m, 2] - a[2])
            loose = slack if max(bodies[b, 2], bodies[b, 3]) <= radii[k] + 1e-9 else 1e-3
            _body_cells(tile, cells, points, a, d, bodies[b], loose, best)
        count = _note(events, count, m, best)
    return count
