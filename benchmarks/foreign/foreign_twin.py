"""Brute force beside the proof: one tool, stood at poses 5 µm apart along every move, and what it covers there.

Nothing of ``verify`` is used. A pose is a tip and a unit vector up the tool; between the ends of a move the tip and
both rotary angles go evenly, and the angles of a table-table-AC machine give the tool on the part by ``_up``. The tool
is (radius, ball, flutes): a cylinder from ``ball`` * radius to ``flutes`` over the tip, and for ball = 1 the sphere
below.
Other bodies are rows (z0, z1, r0, r1, clearance): frusta over the tip.

``envelope`` is the lowest point of the cutter over every node of a grid. ``upright`` runs tools along Z through a stock
of one height per node, in order; ``leaning`` runs tools of any axis through a stock of points. Both say by move whether
a rapid meets stock (2) or comes nearer than its clearance (1), and the same of neck, shank and holder in feed moves.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL

SPACING = 0.005  # mm between poses
WIDE = 10.0  # times as far apart the poses of neck, shank and holder
TOUCHING = 1e-3  # mm a rapid or a body may overlap
SIDE = 2e-3  # mm a lift may end beside its axis, as programs are rounded
SLOPE = math.tan(math.radians(3.0))  # the steepest ramp


@njit(**KERNEL)
def _up(a, c):
    return math.sin(a) * math.sin(c), math.sin(a) * math.cos(c), math.cos(a)


@njit(**KERNEL)
def _count(p, q, t0, t1, reach, spacing):
    """Steps between poses along one move: neither the tip nor the far end goes further than ``spacing``."""
    way = math.sqrt((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2)
    way += reach * (abs(t1[0] - t0[0]) + abs(t1[1] - t0[1]))
    return max(1, math.ceil(way / spacing))


@njit(**KERNEL)
def _pose(p, q, t0, t1, s):
    """Tip and axis at the share ``s`` of a move."""
    u = _up(t0[0] + s * (t1[0] - t0[0]), t0[1] + s * (t1[1] - t0[1]))
    return (p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2])), u


@njit(**KERNEL)
def _span(c, tip, u, z0, z1, wide, origin, h, n):
    """First and last node along one direction that a cylinder from z0 to z1 over the tip may hold."""
    aside = wide * math.sqrt(max(1.0 - u * u, 0.0))
    low, high = min(z0 * u, z1 * u) - aside, max(z0 * u, z1 * u) + aside
    return max(0, math.ceil((tip + low - origin[c]) / h)), min(n - 1, math.floor((tip + high - origin[c]) / h))


@njit(**KERNEL)
def _strip(x, y, u, wide, origin, h, j0, j1):
    """Nodes j0 to j1 of the row x mm from the tip that lie within ``wide`` of the tool seen from above; y is the tip's.
    """
    plan = math.hypot(u[0], u[1])
    if abs(u[0]) <= 0.02 * plan or plan < 1e-9:
        return j0, j1
    middle, half = y + x * u[1] / u[0], abs(wide * plan / u[0])
    return max(j0, math.ceil((middle - half - origin[1]) / h)), min(j1, math.floor((middle + half - origin[1]) / h))


@njit(**KERNEL)
def _interval(x, y, u, radius, z0, z1):
    """From and to which z over the tip the vertical line at (x, y) from it runs in a cylinder; from > to: nowhere."""
    b = x * u[0] + y * u[1]
    a, k, c = 1.0 - u[2] * u[2], b * u[2], x * x + y * y - b * b - radius * radius
    low, high = (z0 - b) / u[2], (z1 - b) / u[2]
    if a > 1e-14:
        root = k * k - a * c
        if root < 0.0:
            return np.inf, -np.inf
        root = math.sqrt(root)
        return max(low, (k - root) / a), min(high, (k + root) / a)
    return (low, high) if c <= 0.0 else (np.inf, -np.inf)


@njit(**KERNEL)
def _lowest(x, y, u, radius, start, length, ball, centre):
    """Lowest z over the tip where the vertical line at (x, y) from it runs in the cutter; inf where it does not."""
    low, high = _interval(x, y, u, radius, start, length)
    out = low if low <= high else np.inf
    if ball:
        dx, dy = x - centre * u[0], y - centre * u[1]
        rest = radius * radius - dx * dx - dy * dy
        if rest >= 0.0:
            out = min(out, centre * u[2] - math.sqrt(rest))
    return out


@njit(**KERNEL)
def envelope(out, origin, h, starts, ends, turns, feeds, tool, grow, spacing):
    """Lower ``out`` (nx, ny) float64, mm, to the lowest the cutter of any feed move comes over each node.

    origin : (2,) mm of node (0, 0), h mm apart; starts, ends : (m, 3) mm; turns : (m, 2, 2) rad, A and C at both ends;
    tool : (radius, ball, flutes), mm, leaning less than 90 degrees; grow : mm, the cutter made larger all round
    """
    radius, ball, length = tool[0] + grow, tool[1] > 0.0, tool[2] + grow
    start = tool[0] if ball else -grow
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        p, q, t0, t1 = starts[m], ends[m], turns[m, 0], turns[m, 1]
        n = _count(p, q, t0, t1, tool[2], spacing)
        for k in range(n + 1):
            tip, u = _pose(p, q, t0, t1, k / n)
            least = tip[2] + start * u[2] - radius * math.sqrt(max(1.0 - u[2] * u[2], 0.0))
            if ball:
                least = min(least, tip[2] + tool[0] * u[2] - radius)
            below = 0.0 if ball else start
            i0, i1 = _span(0, tip[0], u[0], below, length, radius, origin, h, out.shape[0])
            j0, j1 = _span(1, tip[1], u[1], below, length, radius, origin, h, out.shape[1])
            if ball:
                cx, cy = tip[0] + tool[0] * u[0], tip[1] + tool[0] * u[1]
                i0 = max(0, min(i0, math.ceil((cx - radius - origin[0]) / h)))
                j0 = max(0, min(j0, math.ceil((cy - radius - origin[1]) / h)))
                i1 = min(out.shape[0] - 1, max(i1, math.floor((cx + radius - origin[0]) / h)))
                j1 = min(out.shape[1] - 1, max(j1, math.floor((cy + radius - origin[1]) / h)))
            for i in range(i0, i1 + 1):
                x = origin[0] + i * h - tip[0]
                first, last = _strip(x, tip[1], u, radius, origin, h, j0, j1)
                for j in range(first, last + 1):
                    if out[i, j] > least:
                        z = tip[2] + _lowest(x, origin[1] + j * h - tip[1], u, radius, start, length, ball, tool[0])
                        out[i, j] = min(out[i, j], z)


@njit(**KERNEL)
def _under(r, row, ball):
    """Height over the tip at which a body (z0, z1, r0, r1) begins at the distance r of its axis; inf beyond it."""
    z0, z1, r0, r1 = row[0], row[1], row[2], row[3]
    if ball:
        return r1 - math.sqrt(r1 * r1 - r * r) if r <= r1 else np.inf
    if r <= r0:
        return z0
    return z0 + (z1 - z0) * (r - r0) / (r1 - r0) if r <= r1 else np.inf


@njit(**KERNEL)
def _meets(height, origin, h, p, q, row, ball, grow, spacing):
    """2 where an upright body on its way from p to q stands in stock, 1 where it does when grown sideways, else 0."""
    flat, out = np.zeros(2), 0
    wide = max(row[2], row[3]) + grow
    n = _count(p, q, flat, flat, 0.0, spacing)
    for k in range(n + 1):
        s = k / n
        x, y, z = p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2])
        for i in range(max(0, math.ceil((x - wide - origin[0]) / h)),
                       min(height.shape[0] - 1, math.floor((x + wide - origin[0]) / h)) + 1):
            for j in range(max(0, math.ceil((y - wide - origin[1]) / h)),
                           min(height.shape[1] - 1, math.floor((y + wide - origin[1]) / h)) + 1):
                over = height[i, j] - z - TOUCHING
                if over <= row[0]:
                    continue
                r = math.hypot(origin[0] + i * h - x, origin[1] + j * h - y)
                if over > _under(r, row, ball):
                    return 2
                if over > _under(max(r - grow, 0.0), row, ball):
                    out = 1
    return out


@njit(**KERNEL)
def _feed(height, origin, h, m, p, q, tool, end, spacing, before, stamp, under):
    """Cut one upright feed move; ``before`` keeps the heights of nodes stamped m, ``under`` is m where the end came."""
    flat = np.zeros(2)
    n = _count(p, q, flat, flat, 0.0, spacing)
    row = np.array([0.0, 0.0, tool[0], tool[0]])
    for k in range(n + 1):
        s = k / n
        x, y, z = p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), p[2] + s * (q[2] - p[2])
        for i in range(max(0, math.ceil((x - tool[0] - origin[0]) / h)),
                       min(height.shape[0] - 1, math.floor((x + tool[0] - origin[0]) / h)) + 1):
            for j in range(max(0, math.ceil((y - tool[0] - origin[1]) / h)),
                           min(height.shape[1] - 1, math.floor((y + tool[0] - origin[1]) / h)) + 1):
                top = before[i, j] if stamp[i, j] == m else height[i, j]
                if top <= z:
                    continue
                r = math.hypot(origin[0] + i * h - x, origin[1] + j * h - y)
                low = z + _under(r, row, tool[1] > 0.0)
                if height[i, j] <= low + 1e-9 and stamp[i, j] != m:
                    continue
                if height[i, j] > z + tool[2] + 1e-9:
                    continue
                if r <= end:
                    under[i, j] = m
                if low < height[i, j]:
                    if stamp[i, j] != m:
                        stamp[i, j], before[i, j] = m, height[i, j]
                    height[i, j] = low


@njit(**KERNEL)
def _near(c, p, q, wide, origin, h, n):
    low, high = min(p[c], q[c]) - wide, max(p[c], q[c]) + wide
    return max(0, math.ceil((low - origin[c]) / h)), min(n - 1, math.floor((high - origin[c]) / h))


class Marks(NamedTuple):
    """What each move does.

    rapid, body : (m,) int8, count, set to 1 or 2 where a rapid, or a body, meets something
    dug         : (m,) float64, mm, most that steep descents have open at a node after the move
    cut         : (m,) float64, mm³, what the move takes
    """

    rapid: NDArray[np.int8]
    body: NDArray[np.int8]
    dug: NDArray[np.float64]
    cut: NDArray[np.float64]


@njit(**KERNEL)
def upright(height, origin, h, starts, ends, feeds, tool, end, bodies, clearance, spacing, marks):
    """Run a tool along Z through ``height`` (nx, ny) float64, mm, in place.

    tool : (radius, ball, flutes), mm; end : mm, radius of the region that cuts straight down; bodies : (b, 5) mm
    clearance : mm round everything in a rapid that is no lift
    marks : Marks of the moves, filled in
    """
    rapid, body, dug, cut = marks
    shape = height.shape
    before, stamp, under = np.zeros(shape), np.full(shape, -1, np.int64), np.full(shape, -1, np.int64)
    open_, paid = np.zeros(shape), np.zeros(shape)
    earned, top = 0.0, height.max()
    for m in range(len(starts)):
        p, q = starts[m], ends[m]
        aside, rise = math.hypot(q[0] - p[0], q[1] - p[1]), q[2] - p[2]
        steep = feeds[m] and -rise > aside * SLOPE + 1e-9
        if not steep:
            earned += aside * SLOPE
        if min(p[2], q[2]) >= top:
            continue
        grow = 0.0 if aside == 0.0 and rise > 0.0 else clearance
        if feeds[m]:
            _feed(height, origin, h, m, p, q, tool, end, spacing, before, stamp, under)
            i0, i1 = _near(0, p, q, tool[0], origin, h, shape[0])
            j0, j1 = _near(1, p, q, tool[0], origin, h, shape[1])
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    if stamp[i, j] != m:
                        continue
                    gone = before[i, j] - height[i, j]
                    cut[m] += gone * h * h
                    if steep and under[i, j] == m:
                        open_[i, j] = max(open_[i, j] - (earned - paid[i, j]), 0.0) + gone
                        paid[i, j] = earned
                        dug[m] = max(dug[m], open_[i, j])
        else:
            row = np.array([0.0, tool[2], tool[0], tool[0], 0.0])
            rapid[m] = _meets(height, origin, h, p, q, row, tool[1] > 0.0, grow, spacing)
        for b in range(len(bodies)):
            if min(p[2], q[2]) + bodies[b, 0] >= top:
                continue
            if feeds[m]:
                body[m] = max(body[m], _meets(height, origin, h, p, q, bodies[b], False, bodies[b, 4], WIDE * spacing))
            else:
                rapid[m] = max(rapid[m], _meets(height, origin, h, p, q, bodies[b], False, grow, WIDE * spacing))
