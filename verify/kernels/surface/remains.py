"""How far places of the surface are from the material that a program leaves.

What is left is the part without the volumes that cutting parts sweep. A cube is settled by its middle c and the radius
rho of the ball round it: one sweep holds all of it where the signed distance of c to that sweep is at most -rho, and
none of it is part where c is outside the mesh by rho or more. Where c is left, a ball round it is left too: that bounds
the distance from above, and cubes farther off are passed over. Other cubes are parted into eight, the nearest first
[Land1960]. Of the sweeps these eight look only through those that may be the nearest somewhere in the cube: a signed
distance changes by no more than the way between places. A cube that nothing settles counts as gone when its side is
below ``LEAST_SIDE`` or ``FILM`` of its distance. So a distance is too small by rounding at most. It is too large by
``CLOSE`` or ``SHARE`` of it, or where all that is left nearer is thinner than such a cube.

A side of a tool that runs along a face of the part, from within, would have cubes parted all over that face: half of
each is outside the part, and half in the sweep. Where the part meets a cube in one plane only, its half of the cube is
convex, and so is the distance to a sweep. So that half is gone where its corners are.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.cutter_sizes import sizes_of
from geometry.kernels.nearest import nearest_row
from geometry.kernels.options import KERNEL
from geometry.kernels.ray import first_hit
from verify.kernels.pose import PIECE, fill_piece, near_segment2, pieces, view
from verify.kernels.profile import carried
from verify.kernels.tables import AxisArrays, MoveArrays

CLOSE, SHARE = 1e-4, 0.01  # mm, and of the distance: what the result may be too large by
LEAST_SIDE, FILM = 1e-4, 0.03  # mm, and of its distance: side of a cube that is not parted
LISTS, FEW = 6, 4  # times the count of sweeps: room for their lists; a list that is not shortened
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
            if carried(qx, qy, qz, dx, dy, dz, sizes_of(cutters, k)) <= far + axes.bow:
                tool[at] = k
                at += 1
    return out[:at], tool[:at]


@njit(**KERNEL)
def _carried(x, y, z, row, k, cutters):
    """Signed distance of a point to one sweep."""
    qx, qy, qz, dx, dy, dz = view(row, x, y, z)
    return carried(qx, qy, qz, dx, dy, dz, sizes_of(cutters, k))


@njit(**KERNEL)
def _swept(x, y, z, enough, rows, tool, cutters, listed, away):
    """Least signed distance of a point to the sweeps ``listed`` (k,); the search ends at ``enough`` or below.

    away : (k,) float64, their signed distances, overwritten as far as the search goes
    """
    least = np.inf
    for i in range(len(listed)):
        j = listed[i]
        d = _carried(x, y, z, rows[j], tool[j], cutters)
        away[i] = d
        if d < least:
            least = d
            if least <= enough:
                break
    return least


@njit(**KERNEL)
def _deepest(x, y, z, rows, tool, cutters, listed):
    """Row of the sweep with the least signed distance to a point, of those ``listed`` (k,)."""
    least, found = np.inf, -1
    for j in listed:
        d = _carried(x, y, z, rows[j], tool[j], cutters)
        if d < least:
            least, found = d, j
    return found


@njit(**KERNEL)
def _apart(t, x, y, z, half):
    """Whether a facet (3, 3) is known not to meet a cube: a side of the cube or the facet's plane parts them."""
    for c, m in ((0, x), (1, y), (2, z)):
        if min(t[0, c], t[1, c], t[2, c]) > m + half or max(t[0, c], t[1, c], t[2, c]) < m - half:
            return True
    ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    vx, vy, vz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return abs((x - t[0, 0]) * nx + (y - t[0, 1]) * ny + (z - t[0, 2]) * nz) > half * (abs(nx) + abs(ny) + abs(nz))


@njit(**KERNEL)
def _one_plane(tree: TreeArrays, x, y, z, half, a, normal, slack, stack):
    """Whether all facets that may meet the cube round a point lie within ``slack`` mm of the plane through a."""
    stack[0], depth = 0, 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        low, high = tree.lower[node], tree.upper[node]
        if (low[0] > x + half or high[0] < x - half or low[1] > y + half or high[1] < y - half
                or low[2] > z + half or high[2] < z - half):
            continue
        c = tree.child[node]
        if c >= 0:
            stack[depth], stack[depth + 1] = c, c + 1
            depth += 2
            continue
        for k in range(tree.first[node], tree.first[node] + tree.size[node]):
            t = tree.corners[k]
            if _apart(t, x, y, z, half):
                continue
            for i in range(3):
                off = ((t[i, 0] - a[0]) * normal[0] + (t[i, 1] - a[1]) * normal[1] + (t[i, 2] - a[2]) * normal[2])
                if abs(off) > slack:
                    return False
    return True


@njit(**KERNEL)
def _corners_gone(x, y, z, half, a, normal, slack, row, k, cutters):
    """Whether a sweep holds, but for ``slack`` mm, the half of a cube behind the plane through a."""
    height = np.empty(8)
    for i in range(8):
        cx, cy, cz = x + (half if i & 1 else -half), y + (half if i & 2 else -half), z + (half if i & 4 else -half)
        height[i] = (cx - a[0]) * normal[0] + (cy - a[1]) * normal[1] + (cz - a[2]) * normal[2]
        if height[i] <= 0.0 and _carried(cx, cy, cz, row, k, cutters) > slack:
            return False
    for i in range(8):
        for bit in (1, 2, 4):
            j = i | bit
            if j == i or (height[i] <= 0.0) == (height[j] <= 0.0):
                continue
            f = height[i] / (height[i] - height[j])  # where the edge from i to j meets the plane
            cx = x + (half if i & 1 else -half) + (2.0 * half * f if bit == 1 else 0.0)
            cy = y + (half if i & 2 else -half) + (2.0 * half * f if bit == 2 else 0.0)
            cz = z + (half if i & 4 else -half) + (2.0 * half * f if bit == 4 else 0.0)
            if _carried(cx, cy, cz, row, k, cutters) > slack:
                return False
    return True


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
    cubes      : (CUBES, 6) float64, overwritten: middle, half a side, and the part of ``lists`` that is looked through;
                 stack : (128,) int64, overwritten
    """
    best = np.inf
    lists, aside = np.empty(LISTS * len(rows), np.int64), np.empty(len(rows))
    lists[:len(rows)] = np.arange(len(rows))
    cubes[0, 0], cubes[0, 1], cubes[0, 2], cubes[0, 3], cubes[0, 4], cubes[0, 5] = px, py, pz, within, 0.0, len(rows)
    depth = 1
    while depth > 0:
        depth -= 1
        x, y, z, half = cubes[depth, 0], cubes[depth, 1], cubes[depth, 2], cubes[depth, 3]
        begin, end = int(cubes[depth, 4]), int(cubes[depth, 5])
        gap = _cube_gap(px, py, pz, x, y, z, half)
        limit = within if best > within else best - max(CLOSE, SHARE * best)
        if gap > limit:
            continue
        rho = math.sqrt(3.0) * half
        swept = _swept(x, y, z, -rho, rows, tool, cutters, lists[begin:end], aside)
        if swept <= -rho:
            continue
        d2, facet = nearest_row(tree.lower, tree.upper, tree.child, tree.first, tree.size, tree.corners, x, y, z,
                                np.inf, stack)
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
        film = max(LEAST_SIDE, FILM * gap)
        if 2.0 * half <= film or depth + 8 > len(cubes):
            continue
        if swept <= 0.5 * film + rho and off < rho:
            a = tree.corners[facet, 0]
            n = np.cross(tree.corners[facet, 1] - a, tree.corners[facet, 2] - a)
            size = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
            if size > 0.0:
                n /= size
                if _one_plane(tree, x, y, z, half, a, n, 0.25 * film, stack):
                    d = 0.5 * half
                    j = _deepest(x - d * n[0], y - d * n[1], z - d * n[2], rows, tool, cutters, lists[begin:end])
                    if j >= 0 and _corners_gone(x, y, z, half, a, n, 0.25 * film, rows[j], tool[j], cutters):
                        continue
        if end - begin > FEW and 2 * end - begin <= len(lists):  # behind its own list, which its neighbours keep
            nearest, count = end, 0
            for i in range(end - begin):
                if aside[i] <= swept + 2.0 * rho + CLOSE:
                    if aside[i] == swept:
                        nearest = end + count
                    lists[end + count] = lists[begin + i]
                    count += 1
            lists[end], lists[nearest] = lists[nearest], lists[end]  # the nearest is looked at first
            begin, end = end, end + count
        # eight children, the nearest last, so that it comes first
        quarter = 0.5 * half
        sx, sy, sz = (1.0 if px > x else -1.0), (1.0 if py > y else -1.0), (1.0 if pz > z else -1.0)
        for c in range(8):
            i = 7 - c
            cubes[depth, 0] = x + quarter * (-sx if i & 1 else sx)
            cubes[depth, 1] = y + quarter * (-sy if i & 2 else sy)
            cubes[depth, 2] = z + quarter * (-sz if i & 4 else sz)
            cubes[depth, 3], cubes[depth, 4], cubes[depth, 5] = quarter, begin, end
            depth += 1
    return best if best <= within else np.inf


@njit(**KERNEL)
def distances_left(points, within, tree: TreeArrays, normals, moves: MoveArrays, axes: AxisArrays, cutters, reach,
                   chosen, enough, out):
    """out[i] = ``distance_left`` of points[i] within within[i], inf where nothing is left there.

    points : (n, 3) float64, mm, setup frame; within, enough : (n,) float64, mm
    chosen : (c,) int64, index, feed moves that may come near
    """
    near, cubes, stack = np.empty(len(chosen), np.int64), np.empty((CUBES, 6)), np.empty(128, np.int64)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        far = math.sqrt(3.0) * within[i]
        count = near_moves(x, y, z, far, moves, axes, reach, chosen, near)
        rows, tool = fill_pieces(near, count, moves, axes, cutters, reach, x, y, z, far)
        out[i] = distance_left(x, y, z, within[i], tree, normals, rows, tool, cutters, enough[i], cubes, stack)
