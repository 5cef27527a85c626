"""Boundaries of the free region F(z) = {H <= z} of a tool at one tip height.

Notation
    B        (ny, nx) bool   node is blocked (H > z)
    edge id  2*(i*nx + j)    lattice edge from node (i, j) to (i, j+1); +1: to (i+1, j)
    segment  inside one lattice cell, from the edge it enters by to the edge it leaves by, with the free
             side on its LEFT; walking a contour that way is climb milling for a right-hand cutter

Marching squares fixes the topology on the nodes; the place of every crossing on its lattice edge is then found
by bisection against the exact cutter, and chords are refined by the same test until they follow the true
boundary within the tolerance. At a saddle the blocked corners count as joined, which is the safe reading.
Every point returned is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.drop import is_blocked
from zones.kernels.lattice import LatticeFrame, noncut_at

# For each of the 16 corner patterns (bit 0: (i,j), 1: (i,j+1), 2: (i+1,j+1), 3: (i+1,j) blocked) up to two
# segments as (from, to); sides 0 bottom, 1 right, 2 top, 3 left; -1: none.
SEGMENTS = np.array([
    [-1, -1, -1, -1], [3, 0, -1, -1], [0, 1, -1, -1], [3, 1, -1, -1],
    [1, 2, -1, -1], [1, 0, 3, 2], [0, 2, -1, -1], [3, 2, -1, -1],
    [2, 3, -1, -1], [2, 0, -1, -1], [0, 3, 2, 1], [2, 1, -1, -1],
    [1, 3, -1, -1], [1, 0, -1, -1], [0, 3, -1, -1], [-1, -1, -1, -1],
], dtype=np.int64)

HALVINGS = 5  # of a chord
MAX_PER_CHORD = 2 ** HALVINGS


class TipLimits(NamedTuple):
    """What keeps the tip of one tool up, beside the obstacles themselves; access frame.

    noncut       : (ny, nx) float64, mm, tip limit of shank and holder
    x0, y0, step : float, mm, ``LatticeFrame`` of ``noncut``
    radius       : float, mm, of the cutting part, grown by the allowance
    corner       : float, mm, its corner radius, grown by the allowance
    allowance    : float, mm, material that stays on the part
    """

    noncut: NDArray[np.float64]
    x0: float
    y0: float
    step: float
    radius: float
    corner: float
    allowance: float


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _side_id(side, i, j, nx):
    if side == 0:
        return 2 * (i * nx + j)
    if side == 1:
        return 2 * (i * nx + j + 1) + 1
    if side == 2:
        return 2 * ((i + 1) * nx + j)
    return 2 * (i * nx + j) + 1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def trace(blocked, active, segments):
    """Chains of edge ids: (ids, starts, closed); chain k is ids[starts[k]:starts[k+1]].

    Only cells whose lower left node is active take part, so a contour that leaves the active area becomes an
    open chain. A closed chain does not repeat its first id.
    """
    ny, nx = blocked.shape
    follow = np.full(2 * nx * ny, -1, np.int64)
    entered = np.zeros(2 * nx * ny, np.bool_)
    crossings = 0
    for i in range(ny - 1):
        for j in range(nx - 1):
            if not active[i, j]:
                continue
            code = (1 * blocked[i, j] + 2 * blocked[i, j + 1] + 4 * blocked[i + 1, j + 1] + 8 * blocked[i + 1, j])
            for k in (0, 2):
                if segments[code, k] >= 0:
                    a = _side_id(segments[code, k], i, j, nx)
                    b = _side_id(segments[code, k + 1], i, j, nx)
                    follow[a] = b
                    entered[b] = True
                    crossings += 1
    ids = np.empty(2 * crossings + 2, np.int64)
    starts = np.empty(crossings + 2, np.int64)
    closed = np.zeros(crossings + 1, np.bool_)
    n, chains = 0, 0
    for sweep in range(2):
        for e in range(len(follow)):
            if follow[e] < 0 or (sweep == 0 and entered[e]):
                continue
            starts[chains] = n
            at = e
            while True:
                ids[n] = at
                n += 1
                to = follow[at]
                follow[at] = -1
                if to < 0:
                    break
                if to == e:
                    closed[chains] = True
                    break
                at = to
            chains += 1
    starts[chains] = n
    return ids[:n], starts[: chains + 1], closed[:chains]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def stands_blocked(tree: TreeArrays, limits: TipLimits, x, y, z):
    """Whether the assembly cannot stand with its tip at (x, y, z)."""
    if noncut_at(limits.noncut, LatticeFrame(limits.x0, limits.y0, limits.step), x, y) > z:
        return True
    return is_blocked(tree, x, y, z - limits.allowance, limits.radius, limits.corner)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _bisect(tree, limits, fx, fy, bx, by, z, rounds):
    """Last free place between a free point f and a blocked point b."""
    for _ in range(rounds):
        mx, my = 0.5 * (fx + bx), 0.5 * (fy + by)
        if stands_blocked(tree, limits, mx, my, z):
            bx, by = mx, my
        else:
            fx, fy = mx, my
    return fx, fy


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _place(tree, limits, edge, blocked, frame, z, rounds):
    """Exact place of the crossing on one edge, on its free side."""
    nx = blocked.shape[1]
    x0, y0, step = frame
    node = edge // 2
    i, j = node // nx, node % nx
    i2, j2 = (i + 1, j) if edge % 2 else (i, j + 1)
    ax, ay = x0 + step * j, y0 + step * i
    bx, by = x0 + step * j2, y0 + step * i2
    if blocked[i, j]:
        ax, ay, bx, by = bx, by, ax, ay
    return _bisect(tree, limits, ax, ay, bx, by, z, rounds)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def place_crossings(tree: TreeArrays, limits: TipLimits, ids, blocked, frame: LatticeFrame, z, rounds, out):
    """Exact place (n, 2) of every crossing, on its free side."""
    for k in range(len(ids)):
        out[k, 0], out[k, 1] = _place(tree, limits, ids[k], blocked, frame, z, rounds)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _true_place(tree, limits, px, py, qx, qy, z, tol, reach):
    """Where the boundary really is beside the middle of a chord: (x, y, moved)."""
    mx, my = 0.5 * (px + qx), 0.5 * (py + qy)
    dx, dy = qx - px, qy - py
    length = np.sqrt(dx * dx + dy * dy)
    if length < 4.0 * tol:
        return mx, my, False
    nx, ny = -dy / length, dx / length
    if stands_blocked(tree, limits, mx, my, z):
        d = tol
        while d <= reach:
            fx, fy = mx + d * nx, my + d * ny
            if not stands_blocked(tree, limits, fx, fy, z):
                bx, by = mx + 0.5 * d * nx, my + 0.5 * d * ny
                if d <= tol:
                    bx, by = mx, my
                fx, fy = _bisect(tree, limits, fx, fy, bx, by, z, 6)
                return fx, fy, True
            d *= 2.0
        return mx, my, False
    bx, by = mx - tol * nx, my - tol * ny
    if stands_blocked(tree, limits, bx, by, z):
        return mx, my, False
    d = 2.0 * tol
    fx, fy = bx, by
    while d <= reach:
        bx, by = mx - d * nx, my - d * ny
        if stands_blocked(tree, limits, bx, by, z):
            fx, fy = _bisect(tree, limits, fx, fy, bx, by, z, 6)
            return fx, fy, True
        fx, fy = bx, by
        d *= 2.0
    return mx, my, False


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _refine_chord(tree, limits, points, follows, z, tol, reach, out, count, k):
    """``refine`` for the chord from point k."""
    out[k, 0, 0], out[k, 0, 1] = points[k, 0], points[k, 1]
    count[k] = 1
    if follows[k] < 0:
        return
    ends = np.empty((HALVINGS + 1, 4))
    depth = np.empty(HALVINGS + 1, np.int64)
    ends[0, 0], ends[0, 1] = points[k, 0], points[k, 1]
    ends[0, 2], ends[0, 3] = points[follows[k], 0], points[follows[k], 1]
    depth[0] = 0
    top, m = 0, 0
    while top >= 0:
        px, py, qx, qy = ends[top, 0], ends[top, 1], ends[top, 2], ends[top, 3]
        level = depth[top]
        mx, my, moved = px, py, False
        if level < HALVINGS:
            mx, my, moved = _true_place(tree, limits, px, py, qx, qy, z, tol, reach)
        if moved:
            ends[top, 0], ends[top, 1] = mx, my
            depth[top] = level + 1
            top += 1
            ends[top, 0], ends[top, 1], ends[top, 2], ends[top, 3] = px, py, mx, my
            depth[top] = level + 1
            continue
        top -= 1
        out[k, m, 0], out[k, m, 1] = px, py
        m += 1
    count[k] = m


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def refine(tree: TreeArrays, limits: TipLimits, points, follows, z, tol, reach, out, count):
    """Points put in on every chord that leaves the true boundary by more than tol.

    points  : (n, 2); follows : (n,) the point each is joined to, -1 for none
    out     : (n, MAX_PER_CHORD, 2), count : (n,): the point itself and those put in behind it, in order
    """
    for k in range(len(points)):
        _refine_chord(tree, limits, points, follows, z, tol, reach, out, count, k)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def chords_free(tree: TreeArrays, limits: TipLimits, points, z, spacing, ok):
    """ok[k]: the straight move from point k to k+1 at height z stays free, tested every ``spacing`` mm."""
    for k in range(len(points) - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        length = np.sqrt(dx * dx + dy * dy)
        n = int(length / spacing) + 1
        ok[k] = True
        for s in range(1, n):
            x, y = points[k, 0] + dx * s / n, points[k, 1] + dy * s / n
            if stands_blocked(tree, limits, x, y, z):
                ok[k] = False
                break


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def linear_crossings(ids, value, level, frame: LatticeFrame, out):
    """Places (n, 2) where a nodal field ``value`` passes ``level`` on each edge, by linear interpolation."""
    nx = value.shape[1]
    x0, y0, step = frame
    for k in range(len(ids)):
        node = ids[k] // 2
        i, j = node // nx, node % nx
        i2, j2 = (i + 1, j) if ids[k] % 2 else (i, j + 1)
        a, b = value[i, j], value[i2, j2]
        t = 0.5 if a == b else (level - a) / (b - a)
        t = min(max(t, 0.0), 1.0)
        out[k, 0] = x0 + step * (j + t * (j2 - j))
        out[k, 1] = y0 + step * (i + t * (i2 - i))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def thin(points, tol, keep):
    """Mark the points of a polyline (n, 3) to keep so that the rest lie within tol of it (Douglas-Peucker)."""
    n = len(points)
    keep[:] = False
    if n == 0:
        return
    keep[0] = True
    keep[n - 1] = True
    stack = np.empty((n + 2, 2), np.int64)
    top = 0
    stack[0, 0], stack[0, 1] = 0, n - 1
    while top >= 0:
        a, b = stack[top, 0], stack[top, 1]
        top -= 1
        if b - a < 2:
            continue
        ax, ay, az = points[a, 0], points[a, 1], points[a, 2]
        dx, dy, dz = points[b, 0] - ax, points[b, 1] - ay, points[b, 2] - az
        dd = dx * dx + dy * dy + dz * dz
        worst, at = -1.0, -1
        for k in range(a + 1, b):
            wx, wy, wz = points[k, 0] - ax, points[k, 1] - ay, points[k, 2] - az
            s = 0.0
            if dd > 0.0:
                s = min(max((wx * dx + wy * dy + wz * dz) / dd, 0.0), 1.0)
            ex, ey, ez = wx - s * dx, wy - s * dy, wz - s * dz
            e = ex * ex + ey * ey + ez * ez
            if e > worst:
                worst, at = e, k
        if worst > tol * tol:
            keep[at] = True
            top += 1
            stack[top, 0], stack[top, 1] = a, at
            top += 1
            stack[top, 0], stack[top, 1] = at, b
