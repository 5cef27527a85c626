"""The planner's stock: the top of the material over a plan lattice, lowered by every pass.

Notation: S (ny, nx) top z at nodes, or the most in the cell round each; a cutter with its tip at c reaches down
to c_z + h(rho) at distance rho, h(rho) = 0 for rho <= d, else r - sqrt(r^2 - (rho - d)^2), d = R - r; the side of a
tapered mill goes on as a line, and a circle segment mill has two arcs. ``shape`` is a ``Bull``, a ``Tapered`` or a
``TwoArcs``.
This is for deciding (is there something to cut, may the tool come down here); the proof has a model of its own.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from geometry.kernels.drop import Bull
from geometry.kernels.revolved import for_shape, radius_of
from geometry.kernels.tapered import Tapered
from geometry.kernels.two_arcs import TwoArcs
from zones.kernels.lattice import LatticeFrame

HALF_DIAGONAL = 0.7072  # of a cell, rounded up
LEAST_RISE = 0.02  # of a tool axis: one that lies lower takes nothing off a height over the plan


def bottom_at(shape, rho):
    """h(rho) for rho <= R, mm."""
    raise NotImplementedError


@for_shape(bottom_at, Bull)
def _bottom_of_bull(shape, rho):
    corner, u = shape.corner, rho - shape.flat
    if u <= 0.0:
        return 0.0
    return corner - np.sqrt(max(corner * corner - u * u, 0.0))


@for_shape(bottom_at, Tapered)
def _bottom_of_tapered(shape, rho):
    corner, u = shape.corner, rho - shape.flat
    if u <= 0.0:
        return 0.0
    if rho > shape.join:
        return shape.high + (rho - shape.join) * shape.grade
    return corner - np.sqrt(max(corner * corner - u * u, 0.0))


@for_shape(bottom_at, TwoArcs)
def _bottom_of_two_arcs(shape, rho):
    u, centre, radius = rho - shape.flat, shape.low, shape.low
    if u <= 0.0:
        return 0.0
    if rho > shape.join:
        u, centre, radius = rho - shape.out, shape.up, shape.bow
    return centre - np.sqrt(max(radius * radius - u * u, 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def stamp(top, cover, frame: LatticeFrame, points, shape):
    """Lower ``top`` and ``cover`` along a polyline of tips (n, 3).

    A cell of ``cover`` is lowered only by positions that clear the whole disc of its half diagonal, to what the
    farthest point of the disc is lowered to; positions lie on the polyline, so neither map ever falls too low.
    """
    for k in range(max(len(points) - 1, 1)):
        a, b = points[k], points[min(k + 1, len(points) - 1)]
        length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
        pieces = max(1, int(np.ceil(length / (0.7 * frame.step))))
        if a[2] == b[2]:
            _stamp_level(top, cover, frame, a, b, pieces, shape)
        else:
            for s in range(pieces + 1):
                t = s / pieces
                _stamp_place(top, cover, frame, a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]),
                             a[2] + t * (b[2] - a[2]), shape)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _stamp_place(top, cover, frame: LatticeFrame, x, y, z, shape):
    """``stamp`` for one position."""
    x0, y0, step = frame
    radius = radius_of(shape)
    ny, nx = top.shape
    half = HALF_DIAGONAL * step
    n_r = int(np.ceil(radius / step))
    jc, ic = int(np.rint((x - x0) / step)), int(np.rint((y - y0) / step))
    for i in range(max(ic - n_r, 0), min(ic + n_r + 1, ny)):
        for j in range(max(jc - n_r, 0), min(jc + n_r + 1, nx)):
            if cover[i, j] <= z:
                continue
            rho = np.sqrt((x0 + j * step - x) ** 2 + (y0 + i * step - y) ** 2)
            if rho > radius:
                continue
            top[i, j] = min(top[i, j], z + bottom_at(shape, rho))
            if rho + half <= radius:
                cover[i, j] = min(cover[i, j], z + bottom_at(shape, rho + half))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _stamp_level(top, cover, frame: LatticeFrame, a, b, pieces, shape):
    """``stamp`` for a level move from a to b: each node is lowered by the nearest of its ``pieces`` + 1 positions."""
    x0, y0, step = frame
    radius = radius_of(shape)
    ny, nx = top.shape
    half, z = HALF_DIAGONAL * step, a[2]
    dx, dy = b[0] - a[0], b[1] - a[1]
    d2 = dx * dx + dy * dy
    wide = radius + step
    for i in range(max(int(np.floor((min(a[1], b[1]) - wide - y0) / step)), 0),
                   min(int(np.ceil((max(a[1], b[1]) + wide - y0) / step)) + 1, ny)):
        y = y0 + i * step
        first, last = 0.0, 1.0  # share of the way that is as near as that to the row
        if abs(dy) > 1e-9:
            u, v = (y - wide - a[1]) / dy, (y + wide - a[1]) / dy
            first, last = max(min(u, v), 0.0), min(max(u, v), 1.0)
            if first > last:
                continue
        left, right = a[0] + min(first * dx, last * dx) - wide, a[0] + max(first * dx, last * dx) + wide
        for j in range(max(int(np.floor((left - x0) / step)), 0), min(int(np.ceil((right - x0) / step)) + 1, nx)):
            if cover[i, j] <= z:
                continue
            x = x0 + j * step
            s = 0
            if d2 > 0.0:
                s = int(min(max(((x - a[0]) * dx + (y - a[1]) * dy) / d2, 0.0), 1.0) * pieces)
            near = np.inf
            for m in range(s, min(s + 1, pieces) + 1):
                t = m / pieces
                near = min(near, (x - (a[0] + t * dx)) ** 2 + (y - (a[1] + t * dy)) ** 2)
            rho = np.sqrt(near)
            if rho > radius:
                continue
            top[i, j] = min(top[i, j], z + bottom_at(shape, rho))
            if rho + half <= radius:
                cover[i, j] = min(cover[i, j], z + bottom_at(shape, rho + half))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def mark_standing(top, part, z, rows, cols, out):
    """Set ``out`` in row rows[i] and column cols[j] where more than the part stands above height z at node (i, j).

    top, part  : (ny, nx) float64, mm
    z          : mm
    rows, cols : (ny,) and (nx,) int64, index
    """
    ny, nx = top.shape
    for i in range(ny):
        row = rows[i]
        for j in range(nx):
            if top[i, j] > max(part[i, j], z):
                out[row, cols[j]] = True


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _overlap(heights, pooled, side, frame: LatticeFrame, tip, shape, margin, half, least):
    """``overlaps`` at one tip."""
    x0, y0, step = frame
    radius = radius_of(shape)
    ny, nx = heights.shape
    rows, cols = pooled.shape
    inner = max(radius + margin, 0.35 * radius)
    n_r = int(np.ceil(inner / step))
    x, y, z = tip
    jc, ic = int(np.rint((x - x0) / step)), int(np.rint((y - y0) / step))
    i0, i1 = max(ic - n_r, 0), min(ic + n_r, ny - 1)
    j0, j1 = max(jc - n_r, 0), min(jc + n_r, nx - 1)
    worst = least
    if i1 >= i0 and j1 >= j0:
        for row in range(i0 // side, min(i1 // side, rows - 1) + 1):
            for col in range(j0 // side, min(j1 // side, cols - 1) + 1):
                if pooled[row, col] - z <= worst:  # the bottom is nowhere lower than the tip
                    continue
                highest = -np.inf
                for i in range(row * side, min((row + 1) * side, ny)):
                    dy = y0 + i * step - y
                    for j in range(col * side, min((col + 1) * side, nx)):
                        h = heights[i, j]
                        highest = max(highest, h)
                        if h - z <= worst:
                            continue
                        rho = np.sqrt((x0 + j * step - x) ** 2 + dy * dy)
                        if rho <= inner:
                            worst = max(worst, h - z - bottom_at(shape, min(rho - half, radius)))
                pooled[row, col] = highest
    return worst


@njit(cache=True, nogil=True, no_cfunc_wrapper=True, parallel=True)
def overlaps_parallel(heights, pooled, side, frame: LatticeFrame, tips, shape, margin, half, least, out):
    """``overlaps`` on the threads numba has. Those that lower a square lower it to the same height."""
    for k in prange(len(tips)):
        out[k] = _overlap(heights, pooled, side, frame, tips[k], shape, margin, half, least)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def overlaps(heights, pooled, side, frame: LatticeFrame, tips, shape, margin, half, least, out):
    """How far the stock stands above the cutter's bottom at tips (n, 3), mm: greatest over the disc; <= 0 is air.

    heights : (ny, nx) float64, of the stock at the nodes, or the most in the cells round them
    pooled  : no lower than the highest of each square of ``side`` nodes a side; lowered to it where it is looked at
    margin  : mm added to the radius of the disc that is looked at. Below zero it leaves out the rim, where a node
              cannot tell a wall the cutter touches from stock
    half    : mm round a node that its height stands for: 0 for a point, half a diagonal for a cell
    least   : mm; what is less comes out as this, and squares that hold no more are not looked at
    """
    for k in range(len(tips)):
        out[k] = _overlap(heights, pooled, side, frame, tips[k], shape, margin, half, least)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def standing(cover, part, frame: LatticeFrame, tips, radius, half, out):
    """How far stock stands above tips (n, 3), mm, in the cells that a cutter of this radius may touch.

    part : (ny, nx) float64, highest of the part in a cell; cells with part above the tip are left out: whatever else
           is in them stands beside a wall
    """
    x0, y0, step = frame
    ny, nx = cover.shape
    reach = radius + half
    n_r = int(np.ceil(reach / step))
    for k in range(len(tips)):
        x, y, z = tips[k]
        jc, ic = int(np.rint((x - x0) / step)), int(np.rint((y - y0) / step))
        worst = -np.inf
        for i in range(max(ic - n_r, 0), min(ic + n_r + 1, ny)):
            for j in range(max(jc - n_r, 0), min(jc + n_r + 1, nx)):
                over = cover[i, j] - z
                if over > worst and part[i, j] <= z:
                    if (x0 + j * step - x) ** 2 + (y0 + i * step - y) ** 2 <= reach * reach:
                        worst = over
        out[k] = worst


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def meets(top, pooled, side, frame: LatticeFrame, tips, height, radius, out):
    """Set out[k] where stock stands higher than ``height`` mm over tip k within ``radius`` mm of its axis.

    pooled : no lower than the highest of each square of ``side`` nodes a side; lowered to it where it is looked at
    """
    x0, y0, step = frame
    ny, nx = top.shape
    rows, cols = pooled.shape
    for k in range(len(tips)):
        if out[k]:
            continue
        x, y, under = tips[k, 0], tips[k, 1], tips[k, 2] + height
        i0 = max(int(np.floor((y - radius - y0) / step)) // side, 0)
        i1 = min(int(np.ceil((y + radius - y0) / step)) // side, rows - 1)
        j0 = max(int(np.floor((x - radius - x0) / step)) // side, 0)
        j1 = min(int(np.ceil((x + radius - x0) / step)) // side, cols - 1)
        for row in range(i0, i1 + 1):
            for col in range(j0, j1 + 1):
                if pooled[row, col] <= under or out[k]:
                    continue
                highest = -np.inf
                for i in range(row * side, min((row + 1) * side, ny)):
                    dy = y0 + i * step - y
                    for j in range(col * side, min((col + 1) * side, nx)):
                        highest = max(highest, top[i, j])
                        if top[i, j] > under and (x0 + j * step - x) ** 2 + dy * dy <= radius * radius:
                            out[k] = True
                pooled[row, col] = highest


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _gone(x, y, z, turns, tops, frames, rise):
    """Whether a place lies above one of the maps of ``sink``, or beside it."""
    for k in range(len(turns)):
        t = turns[k]
        px = t[0, 0] * x + t[0, 1] * y + t[0, 2] * z
        py = t[1, 0] * x + t[1, 1] * y + t[1, 2] * z
        pz = t[2, 0] * x + t[2, 1] * y + t[2, 2] * z
        j = int(np.rint((px - frames[k, 0]) / frames[k, 2]))
        i = int(np.rint((py - frames[k, 1]) / frames[k, 2]))
        if i < 0 or j < 0 or i >= tops.shape[1] or j >= tops.shape[2] or pz > tops[k, i, j] + rise:
            return True
    return False


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def sink(heights, known, frame: LatticeFrame, low, turns, tops, frames, rise):
    """Lower heights to where, on the way straight down, stock begins that other maps show too.

    heights : (ny, nx) mm, of the nodes, in this frame. A place that is gone is no more than a 16th of a step above one
              that is not; places are asked a step apart, and stock that lies between two of them is overlooked unless
              ``tops`` are spread by a step
    known   : (ny, nx) mm, what is as high as this stays
    low     : mm, where a way that meets nothing ends: nothing stands there then
    turns   : (k, 3, 3) rotations from this frame into those of the others
    tops    : (k, ny, nx) mm, heights of the others, -inf where one has no node; frames : (k, 3) x0, y0, step of each
    rise    : mm, over a height of another map up to which a place counts as stock
    """
    x0, y0, step = frame
    ny, nx = heights.shape
    for i in range(ny):
        for j in range(nx):
            if heights[i, j] == known[i, j] or not np.isfinite(heights[i, j]):
                continue
            x, y, z = x0 + j * step, y0 + i * step, heights[i, j]
            while z > low and _gone(x, y, z, turns, tops, frames, rise):
                z -= step
            if z <= low:
                heights[i, j] = -np.inf
            elif z < heights[i, j]:
                above, under = z + step, z
                for _ in range(4):
                    half = 0.5 * (above + under)
                    if _gone(x, y, half, turns, tops, frames, rise):
                        above = half
                    else:
                        under = half
                heights[i, j] = above


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def stamp_leaning(heights, frame: LatticeFrame, tips, axes, sides, radius, low, high, shrink):
    """Lower heights by the flank of a leaning tool standing at poses, pose after pose.

    tips, axes : (n, 3) mm and unit, up; sides : (n, 2) mm, half the extent in plan of each pose's flank, x and y, about
                 the middle of its axis
    radius     : mm; low, high : mm above the tip, between which the flank cuts
    shrink     : mm, by which the flank is made smaller all round, for heights of cells

    A column is lowered where the flank takes its top: from there down to where the flank leaves it.
    """
    x0, y0, step = frame
    ny, nx = heights.shape
    r = radius - shrink
    if r <= 0.0 or high - low <= 2.0 * shrink:
        return
    for k in range(len(tips)):
        tx, ty, tz = tips[k]
        ax, ay, az = axes[k]
        if az < LEAST_RISE:
            continue
        mx, my = tx + 0.5 * (low + high) * ax, ty + 0.5 * (low + high) * ay
        i0 = max(int(np.floor((my - sides[k, 1] - y0) / step)), 0)
        i1 = min(int(np.ceil((my + sides[k, 1] - y0) / step)), ny - 1)
        j0 = max(int(np.floor((mx - sides[k, 0] - x0) / step)), 0)
        j1 = min(int(np.ceil((mx + sides[k, 0] - x0) / step)), nx - 1)
        flat = 1.0 - az * az
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                z = heights[i, j] - tz
                dx, dy = x0 + j * step - tx, y0 + i * step - ty
                along = dx * ax + dy * ay
                under = (low + shrink - along) / az
                over = (high - shrink - along) / az
                c = dx * dx + dy * dy - along * along - r * r
                if flat > 1e-12:
                    room = az * az * along * along - flat * c
                    if room < 0.0:
                        continue
                    root = np.sqrt(room)
                    under = max(under, (az * along - root) / flat)
                    over = min(over, (az * along + root) / flat)
                elif c > 0.0:
                    continue
                if under < z <= over:
                    heights[i, j] = tz + under


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def stamp_balls(heights, frame: LatticeFrame, centres, radius, shrink):
    """Lower heights by balls, one after the other.

    centres : (n, 3) mm; radius : mm; shrink : mm, by which they are made smaller, for heights of cells

    A column is lowered where a ball takes its top: from there down to where the ball leaves it.
    """
    x0, y0, step = frame
    ny, nx = heights.shape
    r = radius - shrink
    if r <= 0.0:
        return
    for k in range(len(centres)):
        cx, cy, cz = centres[k]
        i0 = max(int(np.ceil((cy - r - y0) / step)), 0)
        i1 = min(int(np.floor((cy + r - y0) / step)), ny - 1)
        j0 = max(int(np.ceil((cx - r - x0) / step)), 0)
        j1 = min(int(np.floor((cx + r - x0) / step)), nx - 1)
        for i in range(i0, i1 + 1):
            dy = y0 + i * step - cy
            for j in range(j0, j1 + 1):
                dx = x0 + j * step - cx
                room = r * r - dx * dx - dy * dy
                if room <= 0.0:
                    continue
                half = np.sqrt(room)
                if cz - half < heights[i, j] <= cz + half:
                    heights[i, j] = cz - half
