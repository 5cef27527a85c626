"""Flat places of the surface: what single moves leave on them whole, and how deep moves go below them.

Notation as in ``sweep`` and ``rays``. A place is a square round a sample c, in the plane through c square
to its normal n; u and v are unit vectors along its sides, e and f coordinates along them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import CutterSizes, sizes_of, slope_of
from verify.kernels.rays import TOUCH, CellArrays, gap, new_left, plan_distance
from verify.kernels.segment import touching_place
from verify.kernels.tables import F64, MoveArrays

BOOL = NDArray[np.bool_]
LEVEL = 1e-9  # component of a unit normal: less is none


class PlaceArrays(NamedTuple):
    """Flat places, sorted by the cells of a grid, setup frame; the last four change in place.

    points, normals : (n, 3) float64, mm and unit, out of the material
    u, v            : (n, 3) float64, unit, along the sides
    half            : (n,) float64, mm, half a side of each
    limit           : (n,) float64, mm that may be left
    whole           : (n,) bool, one move leaves no more than the limit at all four corners, and so between them
    depth           : (n,) float64, mm below the plane, the most that a move which passes the place reaches
    inside          : (n,) float64, mm, the same of moves whose deepest point stands over the place
    foot            : (n, 2) float64, mm along u and v, that point seen from c
    """

    points: F64
    normals: F64
    u: F64
    v: F64
    half: F64
    limit: F64
    whole: BOOL
    depth: F64
    inside: F64
    foot: F64


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def deepest_point(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter: CutterSizes):
    """How far the swept cutting part reaches beyond the plane through the origin with normal n, and where.

    q : the plane's point as seen from the tip at the start of the move, so the tip is at -q

    Returns the depth, mm, and the deepest point (3,), mm; on a vertical line of such points the one nearest in height.
    """
    aside = math.sqrt(nx * nx + ny * ny)
    best, px, py, pz = -1e300, 0.0, 0.0, 0.0
    for k in range(2):
        x, y, z = k * dx - qx, k * dy - qy, k * dz - qz
        if nz < -LEVEL:
            out, height = cutter.radius, z + cutter.length
        elif nz > LEVEL and cutter.up > 0.0:
            out, height = touching_place(aside, nz, cutter)
            height += z
        elif nz > LEVEL and cutter.cone > 0.0:
            # the arc or the edge under the cone, or the upper end of the cone
            out, height = cutter.radius - cutter.corner + cutter.round * aside, z + cutter.round * (1.0 - nz)
            if slope_of(cutter) * aside > nz:
                out, height = cutter.radius, z + cutter.cone
        elif nz > LEVEL:
            out, height = cutter.radius - cutter.corner * (1.0 - aside), z + cutter.corner * (1.0 - nz)
        else:
            low = z + (cutter.cone if cutter.cone > 0.0 else cutter.corner)
            out, height = cutter.radius, min(max(0.0, low), z + cutter.length)
        if aside > LEVEL:
            x, y = x - out * nx / aside, y - out * ny / aside
        depth = -(nx * x + ny * y + nz * height)
        if depth > best:
            best, px, py, pz = depth, x, y, height
    return best, px, py, pz


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def judge_tile(tile, cells: CellArrays, places: PlaceArrays, moves: MoveArrays, cutters):
    """Work all feed moves through the places of the cell columns x0..x1-1, y0..y1-1 of a tile (x0, x1, y0, y1).

    cutters : (k, 9) float64, mm, rows of ``CutterSizes``
    """
    cx0, cx1, cy0, cy1 = tile
    origin, size, shape, first = cells
    points, normals, u, v, half, limit, whole, deep, inside, foot = places
    starts, ends, feeds, tool = moves
    pad = 0.0
    for cx in range(cx0, cx1):
        for cy in range(cy0, cy1):
            row = (cx * shape[1] + cy) * shape[2]
            for i in range(first[row], first[row + shape[2]]):
                pad = max(pad, math.sqrt(2.0) * half[i] + max(limit[i], 0.0) + TOUCH)
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        ax, ay, az = starts[m, 0], starts[m, 1], starts[m, 2]
        dx, dy, dz = ends[m, 0] - ax, ends[m, 1] - ay, ends[m, 2] - az
        cutter = sizes_of(cutters, tool[m])
        radius, length = cutter.radius, cutter.length
        reach = radius + pad
        x0 = max(cx0, math.floor((min(ax, ax + dx) - reach - origin[0]) / size))
        x1 = min(cx1 - 1, math.floor((max(ax, ax + dx) + reach - origin[0]) / size))
        y0 = max(cy0, math.floor((min(ay, ay + dy) - reach - origin[1]) / size))
        y1 = min(cy1 - 1, math.floor((max(ay, ay + dy) + reach - origin[1]) / size))
        if x0 > x1 or y0 > y1:
            continue
        z0 = max(0, math.floor((min(az, az + dz) - pad - origin[2]) / size))
        z1 = min(shape[2] - 1, math.floor((max(az, az + dz) + length + pad - origin[2]) / size))
        if z0 > z1:
            continue
        plan2 = dx * dx + dy * dy
        around = 0.5 * math.sqrt(2.0) * size + radius + pad
        for cx in range(x0, x1 + 1):
            for cy in range(y0, y1 + 1):
                row = (cx * shape[1] + cy) * shape[2]
                a, b = first[row + z0], first[row + z1 + 1]
                if a == b:
                    continue
                px, py = origin[0] + (cx + 0.5) * size, origin[1] + (cy + 0.5) * size
                if plan_distance(px - ax, py - ay, dx, dy, plan2) > around:
                    continue
                for i in range(a, b):
                    qx, qy, qz = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
                    nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
                    wide, most = math.sqrt(2.0) * half[i], max(limit[i], 0.0) + TOUCH
                    aside = math.sqrt(max(1.0 - nz * nz, 0.0))
                    if plan_distance(qx, qy, dx, dy, plan2) > radius + wide + most * aside:
                        continue
                    tall = wide * aside + most * abs(nz)
                    if qz + tall < min(0.0, dz) or qz - tall > max(0.0, dz) + length:
                        continue
                    depth, wx, wy, wz = deepest_point(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter)
                    deep[i] = max(deep[i], depth)
                    if depth > inside[i]:
                        e = wx * u[i, 0] + wy * u[i, 1] + wz * u[i, 2]
                        f = wx * v[i, 0] + wy * v[i, 1] + wz * v[i, 2]
                        if abs(e) <= half[i] and abs(f) <= half[i]:
                            inside[i], foot[i, 0], foot[i, 1] = depth, e, f
                    if whole[i] or gap(qx, qy, qz, dx, dy, dz, plan2, cutter) > most:
                        continue
                    good = True
                    for k in range(4):
                        e = half[i] if k < 2 else -half[i]
                        f = half[i] if k % 2 else -half[i]
                        t = new_left(qx + e * u[i, 0] + f * v[i, 0], qy + e * u[i, 1] + f * v[i, 1],
                                     qz + e * u[i, 2] + f * v[i, 2], nx, ny, nz, dx, dy, dz, plan2, cutter,
                                     limit[i] + TOUCH)
                        if not t < limit[i] + TOUCH:
                            good = False
                            break
                    whole[i] = good
