"""Boundaries of the free region F(z) = {H <= z} of a tool at one tip height.

Notation
    B        (ny, nx) bool   node is blocked (H > z)
    edge id  2*(i*nx + j)    lattice edge from node (i, j) to (i, j+1); +1: to (i+1, j)
    segment  inside one lattice cell, from the edge it enters by to the edge it leaves by, with the free
             side on its LEFT; walking a contour that way is climb milling for a right-hand cutter

Marching squares fixes the topology on the nodes. The place of every crossing on its lattice edge is how far the exact
cutter gets from the free node, and chords are refined by the same question until they follow the true boundary within
the tolerance. At a saddle the blocked corners count as joined, which is the safe reading. Every point returned is free.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.drop import BLOCK_TOLERANCE, Bull, blocked_by
from geometry.kernels.push import stop_at
from geometry.kernels.tapered import Tapered
from geometry.kernels.two_arcs import TwoArcs
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
NOTHING = -1
NOT_CUTTING = -2
STOPS = 12  # of one triangle after the other on a way
BISECTIONS = 9  # of a way that shank or holder end
OFF = 2e-4  # mm, distance of a place from that where the tool is stopped, so that chords between places are free
MAX_PER_CHORD = 2 ** HALVINGS


class TipLimits(NamedTuple):
    """What keeps the tip of one tool up, beside the obstacles themselves; access frame.

    noncut       : (ny, nx) float64, mm, tip limit of shank and holder
    x0, y0, step : float, mm, ``LatticeFrame`` of ``noncut``
    shape        : the cutting part, grown by the allowance, a shape of ``geometry.kernels.revolved``
    allowance    : float, mm, material that stays on the part
    rows         : (k, 9) float64, mm, outline of the cutting part, as in ``geometry.kernels.outline``
    """

    noncut: NDArray[np.float64]
    x0: float
    y0: float
    step: float
    shape: Bull | Tapered | TwoArcs
    allowance: float
    rows: NDArray[np.float64]


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
    room, count = 1024, 0
    edges = np.empty((room, 2), np.int64)  # by which a segment enters its cell, and by which it leaves
    mixed = np.empty(nx - 1, np.bool_)
    for i in range(ny - 1):
        low, high, taken = blocked[i], blocked[i + 1], active[i]
        for j in range(nx - 1):
            mixed[j] = taken[j] & ((low[j] != low[j + 1]) | (low[j] != high[j]) | (low[j] != high[j + 1]))
        for j in range(nx - 1):
            if not mixed[j]:
                continue
            code = 1 * blocked[i, j] + 2 * blocked[i, j + 1] + 4 * blocked[i + 1, j + 1] + 8 * blocked[i + 1, j]
            for k in (0, 2):
                if segments[code, k] >= 0:
                    if count == room:
                        room *= 2
                        more = np.empty((room, 2), np.int64)
                        more[:count] = edges
                        edges = more
                    edges[count, 0] = _side_id(segments[code, k], i, j, nx)
                    edges[count, 1] = _side_id(segments[code, k + 1], i, j, nx)
                    count += 1
    first = np.sort(edges[:count, 0])  # no edge is entered by twice
    follow = np.empty(count, np.int64)  # row of the edge that comes behind each, or its number less -1 at an open end
    entered = np.zeros(count, np.bool_)
    rows = np.searchsorted(first, edges[:count, 1])
    here = np.searchsorted(first, edges[:count, 0])
    for k in range(count):
        if rows[k] < count and first[rows[k]] == edges[k, 1]:
            follow[here[k]] = rows[k]
            entered[rows[k]] = True
        else:
            follow[here[k]] = -1 - edges[k, 1]
    ids = np.empty(2 * count + 2, np.int64)
    starts = np.empty(count + 2, np.int64)
    closed = np.zeros(count + 1, np.bool_)
    done = np.zeros(count, np.bool_)
    n, chains = 0, 0
    for sweep in range(2):
        for e in range(count):
            if done[e] or (sweep == 0 and entered[e]):
                continue
            starts[chains] = n
            at = e
            while True:
                ids[n] = first[at]
                n += 1
                done[at] = True
                at = follow[at]
                if at < 0:
                    ids[n] = -1 - at
                    n += 1
                    break
                if at == e:
                    closed[chains] = True
                    break
            chains += 1
    starts[chains] = n
    return ids[:n], starts[: chains + 1], closed[:chains]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _blocker(tree, limits, x, y, z, guess):
    """What keeps the assembly from standing with its tip at (x, y, z): a triangle by its place in leaf order,
    NOT_CUTTING for shank and holder, NOTHING.

    guess : triangle that is asked first, a negative number for none
    """
    if noncut_at(limits.noncut, LatticeFrame(limits.x0, limits.y0, limits.step), x, y) > z:
        return NOT_CUTTING
    return blocked_by(tree, limits.shape, x, y, z - limits.allowance, guess)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _free_until(tree, limits, x, y, dx, dy, z, blocked, guess):
    """How far the assembly gets from a free place along a unit direction towards a blocked place, mm; free there.

    guess : triangle that may stop it, a negative number for none

    Returns the way, and the triangle that stops it or a negative number.

    The triangle that blocks a place stops the tool at another one, nearer, which is the next to look at.
    """
    way, level, slot = blocked, z - limits.allowance + BLOCK_TOLERANCE, guess
    for _ in range(STOPS):
        if slot >= 0:
            stop = stop_at(tree, slot, limits.rows, x, y, level, dx, dy)
            if 0.0 < stop < way:
                way = max(stop - OFF, 0.5 * stop)
            elif slot != guess:
                break
        last, slot = slot, _blocker(tree, limits, x + way * dx, y + way * dy, z, NOTHING)
        if slot == NOTHING:
            return way, last
        if slot == last or slot == NOT_CUTTING:
            break
    free = 0.0
    for _ in range(BISECTIONS):  # shank or holder end the way, or a touch is a glancing one
        middle = 0.5 * (free + way)
        if _blocker(tree, limits, x + middle * dx, y + middle * dy, z, slot) == NOTHING:
            free = middle
        else:
            way = middle
    return free, NOTHING


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def place_crossings(tree: TreeArrays, limits: TipLimits, ids, blocked, frame: LatticeFrame, z, out):
    """Place (n, 2) of the crossing on every edge, on its free side: as far as the tool gets from the free node."""
    nx = blocked.shape[1]
    x0, y0, step = frame
    slot = NOTHING
    for k in range(len(ids)):
        node, up = ids[k] // 2, ids[k] % 2
        i, j = node // nx, node % nx
        forth = 1.0
        if blocked[i, j]:
            i, j, forth = i + up, j + 1 - up, -1.0
        dx, dy = forth * (1 - up), forth * up
        x, y = x0 + step * j, y0 + step * i
        way, slot = _free_until(tree, limits, x, y, dx, dy, z, step, slot)
        out[k, 0], out[k, 1] = x + way * dx, y + way * dy


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _true_place(tree, limits, px, py, qx, qy, z, tol, reach, guess):
    """Where the boundary is beside the middle of a chord: (x, y, moved), and what is there, as in ``_blocker``."""
    mx, my = 0.5 * (px + qx), 0.5 * (py + qy)
    dx, dy = qx - px, qy - py
    length = np.sqrt(dx * dx + dy * dy)
    if length < 4.0 * tol:
        return mx, my, False, guess
    nx, ny = -dy / length, dx / length
    slot = _blocker(tree, limits, mx, my, z, guess)
    if slot != NOTHING:
        free = tol
        while True:
            last, slot = slot, _blocker(tree, limits, mx + free * nx, my + free * ny, z, slot)
            if slot == NOTHING:
                break
            free *= 2.0
            if free > reach:
                return mx, my, False, slot
        blocked = free
    else:
        free, ahead = 0.0, tol
        while True:
            last = _blocker(tree, limits, mx - ahead * nx, my - ahead * ny, z, guess)
            if last != NOTHING:
                break
            free, ahead = ahead, 2.0 * ahead
            if ahead > reach:
                return mx, my, False, guess
        if free == 0.0:
            return mx, my, False, last
        free, blocked = -free, ahead - free
    way, last = _free_until(tree, limits, mx + free * nx, my + free * ny, -nx, -ny, z, blocked, last)
    off = free - way
    return mx + off * nx, my + off * ny, True, last


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def refine(tree: TreeArrays, limits: TipLimits, points, follows, z, tol, reach, out, count):
    """Points put in on every chord that leaves the true boundary by more than tol.

    points  : (n, 2); follows : (n,) the point each is joined to, -1 for none
    out     : (n, MAX_PER_CHORD, 2), count : (n,): the point itself and those put in behind it, in order
    """
    ends = np.empty((HALVINGS + 1, 4))
    depth = np.empty(HALVINGS + 1, np.int64)
    slot = NOTHING
    for k in range(len(points)):
        out[k, 0, 0], out[k, 0, 1] = points[k, 0], points[k, 1]
        count[k] = 1
        if follows[k] < 0:
            continue
        ends[0, 0], ends[0, 1] = points[k, 0], points[k, 1]
        ends[0, 2], ends[0, 3] = points[follows[k], 0], points[follows[k], 1]
        depth[0] = 0
        top, m = 0, 0
        while top >= 0:
            px, py, qx, qy = ends[top, 0], ends[top, 1], ends[top, 2], ends[top, 3]
            level = depth[top]
            mx, my, moved = px, py, False
            if level < HALVINGS:
                mx, my, moved, slot = _true_place(tree, limits, px, py, qx, qy, z, tol, reach, slot)
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
def chords_free(tree: TreeArrays, limits: TipLimits, points, z, spacing, ok):
    """ok[k]: the straight move from point k to k+1 at height z stays free, tested every ``spacing`` mm."""
    for k in range(len(points) - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        length = np.sqrt(dx * dx + dy * dy)
        n = int(length / spacing) + 1
        ok[k] = True
        for s in range(1, n):
            x, y = points[k, 0] + dx * s / n, points[k, 1] + dy * s / n
            if _blocker(tree, limits, x, y, z, NOTHING) != NOTHING:
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
