"""What is left on the normal ray of every surface sample, tile by tile.

Notation as in ``sweep``. Samples lie sorted by the cells of a 3-D grid; one call works through all moves
for one block of cell columns, so blocks can run side by side and every sample still sees the moves in
program order: the result does not depend on the number of threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes, sizes_of
from verify.kernels.profile import leaning
from verify.kernels.sweep import capsule_start, cutter_interval
from verify.kernels.tables import F64, I32, I64, MoveArrays

TOUCH = 1e-6
CUT_ONCE = -1e300  # mm, no cut reaches below
SAME = 1e-8  # mm: a move that takes less than that off a ray has taken nothing, as the way back out of a plunge


class CellArrays(NamedTuple):
    """Cells of a 3-D grid of points, setup frame; cell (x, y, z) is row (x shape[1] + y) shape[2] + z.

    origin : (3,) float64, mm, lower corner
    size   : float, mm, side of a cell
    shape  : (3,) int64, count of cells
    first  : (cells + 1,) int64, index, first point of each cell
    """

    origin: F64
    size: float
    shape: I64
    first: I64


class SampleArrays(NamedTuple):
    """Samples of the surface and what is left on them, setup frame; the last two change in place.

    points   : (n, 3) float64, mm
    normals  : (n, 3) float64, unit, out of the material
    residual : (n,) float64, mm, along the normal
    mover    : (n,) int32, index, the move that left it
    """

    points: F64
    normals: F64
    residual: F64
    mover: I32


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def plan_distance(wx, wy, dx, dy, length2):
    """Distance in plan from (wx, wy) to the segment from the origin to d."""
    s = 0.0
    if length2 > 0.0:
        s = min(max((wx * dx + wy * dy) / length2, 0.0), 1.0)
    wx -= s * dx
    wy -= s * dy
    return math.sqrt(wx * wx + wy * wy)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def gap(x, y, z, dx, dy, dz, plan2, cutter: CutterSizes):
    """A lower bound of the distance from a point, seen from the tip, to the swept cutting part (negative inside)."""
    radius, corner, length = cutter.radius, cutter.corner, cutter.length
    plan = plan_distance(x, y, dx, dy, plan2)
    side = plan - radius
    low = min(0.0, dz)
    if cutter.cone > 0.0:
        # the distance to a standing one grows with that in plan and falls with the height: both at once
        return max(leaning(plan, z - low, cutter), z - max(0.0, dz) - length)
    if z >= low + corner:
        return max(side, z - max(0.0, dz) - length)
    if dz == 0.0 or corner < radius - 1e-12:
        # never nearer in plan than that, and never lower than the lowest tip: both at once
        over, drop = max(plan - (radius - corner), 0.0), low + corner - z
        return max(side, math.sqrt(over * over + drop * drop) - corner)
    z -= corner
    s = min(max((x * dx + y * dy + z * dz) / (plan2 + dz * dz), 0.0), 1.0)
    wx, wy, wz = x - s * dx, y - s * dy, z - s * dz
    return max(side, math.sqrt(wx * wx + wy * wy + wz * wz) - corner)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _flank_bound(wx, wy, nx, ny, dx, dy, plan2, radius):
    """A lower bound of t at which the ray can enter the upright sweep of the full radius (0 inside).

    Distance to a convex set is convex along the ray, so its tangent at t = 0 bounds the way to it.
    """
    s = 0.0
    if plan2 > 0.0:
        s = min(max((wx * dx + wy * dy) / plan2, 0.0), 1.0)
    wx -= s * dx
    wy -= s * dy
    rho = math.sqrt(wx * wx + wy * wy)
    if rho <= radius:
        return 0.0
    closing = -(wx * nx + wy * ny) / rho
    return (rho - radius) / closing if closing > 1e-12 else 1e300


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def new_left(qx, qy, qz, nx, ny, nz, dx, dy, dz, plan2, cutter: CutterSizes, left):
    """What a move leaves on a ray from q along n that had ``left`` on it; ``left`` itself where it takes nothing.

    q, n, D as in ``sweep``; plan2 = dx² + dy².
    """
    radius, corner, length = cutter.radius, cutter.corner, cutter.length
    ball = cutter.cone == 0.0 and corner >= radius - 1e-12
    if ball and qz < min(0.0, dz) + corner:
        # under every equator a ball is as far as its sphere: squares decide most pairs
        wx, wy, wz = qx, qy, qz - corner
        space2 = plan2 + dz * dz
        if space2 > 0.0:
            s = min(max((wx * dx + wy * dy + wz * dz) / space2, 0.0), 1.0)
            wx, wy, wz = wx - s * dx, wy - s * dy, wz - s * dz
        far = radius + max(left, 0.0) + TOUCH
        if wx * wx + wy * wy + wz * wz > far * far:
            return left
    else:
        if _flank_bound(qx, qy, nx, ny, dx, dy, plan2, radius) > max(left, 0.0) + TOUCH:
            return left
        if gap(qx, qy, qz, dx, dy, dz, plan2, cutter) > max(left, 0.0) + TOUCH:
            return left
    if ball and nz >= 0.0 and qz + nz * left < min(0.0, dz) + min(corner, length - corner):
        # the ray meets the ball below its equator first: one root decides nearly all pairs
        t = capsule_start(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, corner)
        if t >= left:
            return left
        if t >= 0.0:
            return t
    lo, hi = cutter_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter)
    return lo if lo <= hi and hi >= -TOUCH and lo < left else left


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def cut_tile(tile, cells: CellArrays, samples: SampleArrays, left, moves: MoveArrays, cutters, once):
    """Work all feed moves through the cell columns x0..x1-1, y0..y1-1 of a tile (x0, x1, y0, y1).

    samples : sorted by cell
    left    : (cells,) float64, mm, largest residual of each cell, changed in place
    cutters : (k, 9) float64, mm, rows of ``CutterSizes``
    once    : whether the first cut of a sample is the last: its residual is then ``CUT_ONCE``
    """
    cx0, cx1, cy0, cy1 = tile
    origin, size, shape, first = cells
    points, normals, residual, mover = samples
    starts, ends, feeds, tool = moves
    half = 0.5 * math.sqrt(2.0) * size
    pad = 0.0
    # lowest cell of each column that holds samples and the one after the highest: a surface fills few of them
    span = np.zeros((cx1 - cx0, cy1 - cy0, 2), np.int64)
    for cx in range(cx0, cx1):
        for cy in range(cy0, cy1):
            row = (cx * shape[1] + cy) * shape[2]
            low, high = shape[2], 0
            for k in range(shape[2]):
                if first[row + k] < first[row + k + 1]:
                    low, high = min(low, k), k + 1
                    pad = max(pad, left[row + k])
            span[cx - cx0, cy - cy0, 0], span[cx - cx0, cy - cy0, 1] = low, high
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        ax, ay, az = starts[m, 0], starts[m, 1], starts[m, 2]
        dx, dy, dz = ends[m, 0] - ax, ends[m, 1] - ay, ends[m, 2] - az
        cutter = sizes_of(cutters, tool[m])
        radius = cutter.radius
        reach = radius + pad
        x0 = max(cx0, math.floor((min(ax, ax + dx) - reach - origin[0]) / size))
        x1 = min(cx1 - 1, math.floor((max(ax, ax + dx) + reach - origin[0]) / size))
        y0 = max(cy0, math.floor((min(ay, ay + dy) - reach - origin[1]) / size))
        y1 = min(cy1 - 1, math.floor((max(ay, ay + dy) + reach - origin[1]) / size))
        if x0 > x1 or y0 > y1:
            continue
        z0 = max(0, math.floor((min(az, az + dz) - pad - origin[2]) / size))
        z1 = min(shape[2] - 1, math.floor((max(az, az + dz) + cutter.length + pad - origin[2]) / size))
        plan2 = dx * dx + dy * dy
        for cx in range(x0, x1 + 1):
            for cy in range(y0, y1 + 1):
                row = (cx * shape[1] + cy) * shape[2]
                low, high = max(z0, span[cx - cx0, cy - cy0, 0]), min(z1 + 1, span[cx - cx0, cy - cy0, 1])
                if low >= high:
                    continue
                px, py = origin[0] + (cx + 0.5) * size, origin[1] + (cy + 0.5) * size
                side = plan_distance(px - ax, py - ay, dx, dy, plan2) - half - radius
                if side > pad:
                    continue
                for c in range(row + low, row + high):
                    if first[c] == first[c + 1] or side > left[c] + TOUCH:
                        continue
                    pz = origin[2] + (c - row + 0.5) * size
                    if gap(px - ax, py - ay, pz - az, dx, dy, dz, plan2, cutter) \
                            > left[c] + 0.5 * math.sqrt(3.0) * size + TOUCH:
                        continue
                    most = 0.0
                    for i in range(first[c], first[c + 1]):
                        t = new_left(points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az, normals[i, 0],
                                     normals[i, 1], normals[i, 2], dx, dy, dz, plan2, cutter, residual[i])
                        if t < residual[i] - SAME:
                            residual[i], mover[i] = CUT_ONCE if once else t, m
                        most = max(most, residual[i])
                    left[c] = most
