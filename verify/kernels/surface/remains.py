"""How far places of the surface are from the material that a program leaves.

What is left is the part without the volumes that cutting parts sweep. A cube is settled by its middle c and the radius
rho of the ball round it: one sweep holds all of it where the signed distance of c to that sweep is at most -rho, and
none of it is part where c is outside the mesh by rho or more. Where c is left, a ball round it is left too: that bounds
the distance from above, and cubes farther off are passed over. Other cubes are parted into eight, the nearest first
[Land1960]. A cube that nothing settles counts as gone when its side is below ``LEAST_SIDE`` or ``FILM`` of its
distance. So a distance is too small by rounding at most. It is too large by ``CLOSE`` or ``SHARE`` of it, or where all
that is left nearer is thinner than such a cube.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.nearest import nearest_row
from geometry.kernels.options import KERNEL
from geometry.kernels.ray import first_hit
from verify.kernels.pose import PIECE, fill_piece, near_segment2, pieces, view
from verify.kernels.profile import carried
from verify.kernels.tables import AxisArrays, MoveArrays

CLOSE, SHARE = 1e-4, 0.01  # mm, and of the distance: what the result may be too large by
LEAST_SIDE, FILM = 1e-4, 0.03  # mm, and of its distance: side of a cube that is not parted
CUBES = 8 * 40  # rows of the stack of cubes: a cube is parted 40 times at most
ASIDE = (0.3571 / 0.9998, 0.2833 / 0.9998, 0.8901 / 0.9998)  # no edge or face lies along it


@njit(**KERNEL)
def near_moves(x, y, z, far, moves: MoveArrays, axes: AxisArrays, reach, chosen, out):
    """Feed moves whose cutting part may come within ``far`` mm of a point; returns their count, rows in ``out``.

    chosen : (c,) int64, index, the moves to look through; out : (c,) int64
    """
    count = 0
    for j in range(len(chosen)):
        m = chosen[j]
        most = far + reach[moves.tool[m]] + axes.bow
        if near_segment2(x, y, z, moves.start[m], moves.end[m]) <= most * most:
            out[count] = m
            count += 1
    return count


@njit(**KERNEL)
def fill_pieces(chosen, count, moves: MoveArrays, axes: AxisArrays, cutters, reach, x, y, z, far):
    """Pieces of moves that come within ``far`` mm of a point.

    Returns (k, PIECE) float64 and (k,) int64, index, their rows of ``cutters``.
    """
    total = 0
    for j in range(count):
        m = chosen[j]
        length = math.sqrt((moves.end[m, 0] - moves.start[m, 0]) ** 2 + (moves.end[m, 1] - moves.start[m, 1]) ** 2
                           + (moves.end[m, 2] - moves.start[m, 2]) ** 2)
        total += pieces(axes.angle[m], length, reach[moves.tool[m]], axes.bow)
    out, tool = np.empty((total, PIECE)), np.empty(total, np.int64)
    at = 0
    for j in range(count):
        m, k = chosen[j], moves.tool[chosen[j]]
        length = math.sqrt((moves.end[m, 0] - moves.start[m, 0]) ** 2 + (moves.end[m, 1] - moves.start[m, 1]) ** 2
                           + (moves.end[m, 2] - moves.start[m, 2]) ** 2)
        n = pieces(axes.angle[m], length, reach[k], axes.bow)
        for part in range(n):
            fill_piece(out[at], moves.start[m], moves.end[m], axes.axis[m], axes.about[m], axes.angle[m], part, n)
            qx, qy, qz, dx, dy, dz = view(out[at], x, y, z)
            r = cutters[k, 1]
            if carried(qx, qy, qz, dx, dy, dz, cutters[k, 0] - r, r, cutters[k, 2], cutters[k, 3]) <= far + axes.bow:
                tool[at] = k
                at += 1
    return out[:at], tool[:at]


@njit(**KERNEL)
def _swept(x, y, z, enough, rows, tool, cutters):
    """Least signed distance of a point to the sweeps; the search ends at ``enough`` or below."""
    least = np.inf
    for j in range(len(rows)):
        k = tool[j]
        qx, qy, qz, dx, dy, dz = view(rows[j], x, y, z)
        r = cutters[k, 1]
        d = carried(qx, qy, qz, dx, dy, dz, cutters[k, 0] - r, r, cutters[k, 2], cutters[k, 3])
        if d < least:
            least = d
            if least <= enough:
                break
    return least


@njit(**KERNEL)
def _inside(tree: TreeArrays, normals, x, y, z):
    """Whether a point is in the part: one of two opposite oblique rays leaves it."""
    for sign in (1.0, -1.0):
        ax, ay, az = sign * ASIDE[0], sign * ASIDE[1], sign * ASIDE[2]
        _, hit = first_hit(tree, x, y, z, ax, ay, az, 0.0, np.inf)
        if hit >= 0 and normals[hit, 0] * ax + normals[hit, 1] * ay + normals[hit, 2] * az > 0.0:
            return True
    return False


@njit(**KERNEL)
def _cube_gap(px, py, pz, x, y, z, half):
    """Distance from p to a cube round (x, y, z)."""
    ax, ay, az = max(abs(px - x) - half, 0.0), max(abs(py - y) - half, 0.0), max(abs(pz - z) - half, 0.0)
    return math.sqrt(ax * ax + ay * ay + az * az)


@njit(**KERNEL)
def distance_left(px, py, pz, within, tree: TreeArrays, normals, rows, tool, cutters, enough, cubes, stack):
    """Distance in mm from a place to what is left of the part; inf where nothing is left within ``within`` mm.

    rows, tool : pieces of moves that come that near, from ``fill_pieces``
    enough     : mm; a distance below it need not be found any better
    cubes      : (CUBES, 4) float64, overwritten; stack : (128,) int64, overwritten
    """
    best = np.inf
    cubes[0, 0], cubes[0, 1], cubes[0, 2], cubes[0, 3] = px, py, pz, within
    depth = 1
    while depth > 0:
        depth -= 1
        x, y, z, half = cubes[depth, 0], cubes[depth, 1], cubes[depth, 2], cubes[depth, 3]
        gap = _cube_gap(px, py, pz, x, y, z, half)
        limit = within if best > within else best - max(CLOSE, SHARE * best)
        if gap > limit:
            continue
        rho = math.sqrt(3.0) * half
        swept = _swept(x, y, z, -rho, rows, tool, cutters)
        if swept <= -rho:
            continue
        d2, _ = nearest_row(tree.lower, tree.upper, tree.child, tree.first, tree.size, tree.corners, x, y, z, np.inf,
                            stack)
        off = math.sqrt(d2)
        inside = _inside(tree, normals, x, y, z)
        if not inside and off >= rho:
            continue
        away = math.sqrt((px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2)
        if inside and swept > 0.0:
            best = min(best, max(away - min(swept, off), 0.0))
            if best <= enough:
                return best
            if min(swept, off) >= rho:
                continue
        if 2.0 * half <= max(LEAST_SIDE, FILM * gap) or depth + 8 > len(cubes):
            continue
        # eight children, the nearest last, so that it comes first
        quarter = 0.5 * half
        sx, sy, sz = (1.0 if px > x else -1.0), (1.0 if py > y else -1.0), (1.0 if pz > z else -1.0)
        for c in range(8):
            i = 7 - c
            cubes[depth, 0] = x + quarter * (-sx if i & 1 else sx)
            cubes[depth, 1] = y + quarter * (-sy if i & 2 else sy)
            cubes[depth, 2] = z + quarter * (-sz if i & 4 else sz)
            cubes[depth, 3] = quarter
            depth += 1
    return best if best <= within else np.inf


@njit(**KERNEL)
def distances_left(points, within, tree: TreeArrays, normals, moves: MoveArrays, axes: AxisArrays, cutters, reach,
                   chosen, enough, out):
    """out[i] = ``distance_left`` of points[i] within within[i], inf where nothing is left there.

    points : (n, 3) float64, mm, setup frame; within : (n,) float64, mm
    chosen : (c,) int64, index, feed moves that may come near
    """
    near, cubes, stack = np.empty(len(chosen), np.int64), np.empty((CUBES, 4)), np.empty(128, np.int64)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        far = math.sqrt(3.0) * within[i]
        count = near_moves(x, y, z, far, moves, axes, reach, chosen, near)
        rows, tool = fill_pieces(near, count, moves, axes, cutters, reach, x, y, z, far)
        out[i] = distance_left(x, y, z, within[i], tree, normals, rows, tool, cutters, enough, cubes, stack)
