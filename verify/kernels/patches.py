"""Flat places of the surface that one move finishes whole, or that some move may cut too deep.

Notation as in ``sweep`` and ``rays``. A place is the square of half side e round a sample c, in the plane through c
square to its normal n; u and v are unit vectors along its sides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import CutterSizes
from verify.kernels.rays import TOUCH, CellArrays, gap, new_left, plan_distance
from verify.kernels.tables import F64, MoveArrays

U8 = NDArray[np.uint8]

WHOLE = 1  # one move leaves no more than the limit at all four corners, and so everywhere between them
DEEP = 2  # the cutting part of some move that passes the place reaches deeper below the plane than allowed


class PlaceArrays(NamedTuple):
    """Flat places, sorted by the cells of a grid, setup frame; the last changes in place.

    points, normals : (n, 3) float64, mm and unit, out of the material
    u, v            : (n, 3) float64, unit, along the sides
    half            : (n,) float64, mm, e of each
    state           : (n,) uint8, WHOLE and DEEP
    """

    points: F64
    normals: F64
    u: F64
    v: F64
    half: F64
    state: U8


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def depth_below(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter: CutterSizes):
    """How far the swept cutting part reaches beyond the plane through the origin with normal n, nz >= 0.

    q : the plane's point as seen from the tip at the start of the move, so the tip is at -q
    """
    out, corner = -1e300, cutter.corner
    flat = (cutter.radius - corner) * math.sqrt(nx * nx + ny * ny)
    for k in range(2):
        x, y, z = k * dx - qx, k * dy - qy, k * dz - qz
        out = max(out, flat + corner - (nx * x + ny * y + max(nz, 0.0) * (z + corner)))
    return out


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def judge_tile(tile, cells: CellArrays, places: PlaceArrays, limit, deep, moves: MoveArrays, cutters):
    """Work all feed moves through the places of the cell columns x0..x1-1, y0..y1-1 of a tile (x0, x1, y0, y1).

    limit, deep : mm that may be left, and that may be cut
    cutters     : (k, 3) float64, mm: radius, corner radius, flute length
    """
    cx0, cx1, cy0, cy1 = tile
    origin, size, shape, first = cells
    points, normals, u, v, half, state = places
    starts, ends, feeds, tool = moves
    most = 0.0
    for cx in range(cx0, cx1):
        for cy in range(cy0, cy1):
            row = (cx * shape[1] + cy) * shape[2]
            for i in range(first[row], first[row + shape[2]]):
                most = max(most, half[i])
    most *= math.sqrt(2.0)
    pad = most + max(limit, 0.0) + TOUCH
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        ax, ay, az = starts[m, 0], starts[m, 1], starts[m, 2]
        dx, dy, dz = ends[m, 0] - ax, ends[m, 1] - ay, ends[m, 2] - az
        cutter = CutterSizes(cutters[tool[m], 0], cutters[tool[m], 1], cutters[tool[m], 2])
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
                    if state[i] == WHOLE | DEEP:
                        continue
                    qx, qy, qz = points[i, 0] - ax, points[i, 1] - ay, points[i, 2] - az
                    nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
                    wide = math.sqrt(2.0) * half[i]
                    if not state[i] & DEEP:
                        tall = wide * math.sqrt(max(1.0 - nz * nz, 0.0))
                        if (plan_distance(qx, qy, dx, dy, plan2) < radius + wide
                                and qz + tall > min(0.0, dz) and qz - tall < max(0.0, dz) + length
                                and depth_below(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter) > deep):
                            state[i] |= DEEP
                    if state[i] & WHOLE or gap(qx, qy, qz, dx, dy, dz, plan2, cutter) > limit + TOUCH:
                        continue
                    whole = True
                    for k in range(4):
                        e = half[i] if k < 2 else -half[i]
                        f = half[i] if k % 2 else -half[i]
                        t = new_left(qx + e * u[i, 0] + f * v[i, 0], qy + e * u[i, 1] + f * v[i, 1],
                                     qz + e * u[i, 2] + f * v[i, 2], nx, ny, nz, dx, dy, dz, plan2, cutter,
                                     limit + TOUCH)
                        if not t < limit + TOUCH:
                            whole = False
                            break
                    if whole:
                        state[i] |= WHOLE
