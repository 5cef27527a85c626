"""Which part of a cutter is in stock, as bits of sectors all round it, and how much of its front that is.

The edge of a tool is a circle of 64 sectors, numbered from the X of a frame square to its axis (``verify.tool_axes``)
towards its Y. A place at signed distance b beside the way D, where the profile has radius rho at the height of the
stock, comes to the edge at the angle asin(b / rho) off D. Stock is known on lines or nodes a step apart, so each stands
for a strip as wide, and beside the flank the last one for all up to the side of the edge: a slot of a flat is never
taken for less. Of a round end the last places beside its way are no deeper in than ``LEAST_DEPTH``.

Sectors do not turn with the way, so those that were met on the way to a place can be put together with those met
there, whatever way each of the moves between went: how a path is cut into moves makes no difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import CutterSizes, side_height
from geometry.kernels.options import KERNEL
from verify.kernels.heights import edge_radius

SECTORS = 64
"""All round."""
FRONT = SECTORS // 2
"""Of them are in front of a way."""
LEAST_DEPTH = 0.05
"""Share of the tool radius that a cut must be deep to count: what a finishing pass skims is no engagement."""
WINDOW = 0.5
"""Share of the tool radius: way over which what a cutter meets is put together, as short moves meet few places."""
STRAIGHT = 0.25
"""Share of the tool radius: a way that goes on for less before it turns is looked at with what was before it."""
ONE_WAY = math.cos(math.radians(30.0))
"""Moves that turn off by more go another way."""


class EngagedArrays(NamedTuple):
    """Sectors of the cutter that met stock, by even parts of moves.

    first   : (m + 1,) int64, index, first part of each move
    sectors : (p,) int64, bits, frame of the sectors (``verify.tool_axes``); kernels add to them in place
    """

    first: NDArray[np.int64]
    sectors: NDArray[np.int64]


@njit(**KERNEL)
def _sector(angle):
    return int(math.floor(angle / (2.0 * math.pi) * SECTORS)) % SECTORS


@njit(**KERNEL)
def sector_bits(wx, wy, dx, dy, plan, over, cutter: CutterSizes, wide, twist):
    """Bits of the sectors in which a strip ``wide`` mm across meets the edge.

    (wx, wy) : of its middle off the tip; (dx, dy), plan : the way and its length; twist : rad, of this X and Y in the
    frame of the sectors; over : mm of stock over the tip there
    """
    b, edge = (dx * wy - dy * wx) / plan, edge_radius(over, cutter)
    if edge <= 0.0 or abs(b) > edge:
        return np.int64(0)
    ahead = math.atan2(dy, dx) + twist
    low, high = math.asin(max((b - 0.5 * wide) / edge, -1.0)), math.asin(min((b + 0.5 * wide) / edge, 1.0))
    if over >= side_height(cutter):  # no place beyond says where stock ends short of the side
        high = 0.5 * math.pi if b + wide > edge else high
        low = -0.5 * math.pi if b - wide < -edge else low
    bits, k, last = np.int64(0), _sector(ahead + low), _sector(ahead + high)
    for _ in range(SECTORS):
        bits |= np.int64(1) << k
        if k == last:
            break
        k = (k + 1) % SECTORS
    return bits


@njit(**KERNEL)
def _in_front(bits, heading):
    """How many sectors of the half circle ahead of a way are among some."""
    first, count = _sector(heading - 0.5 * math.pi + math.pi / SECTORS), 0
    for k in range(FRONT):
        if bits >> ((first + k) % SECTORS) & 1:
            count += 1
    return count


@njit(**KERNEL)
def _way(a, b):
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


@njit(**KERNEL)
def _heading(way, x, y):
    """Of a way (3,) in the frame x, y (3,): its angle, rad, and its length there."""
    a = way[0] * x[0] + way[1] * x[1] + way[2] * x[2]
    b = way[0] * y[0] + way[1] * y[1] + way[2] * y[2]
    return math.atan2(b, a), math.sqrt(a * a + b * b)


@njit(**KERNEL)
def window_angles(bits, starts, ends, x, y, tool, feeds, radius):
    """Engaged angle, rad, of every move: what of its front was met on it and on the way before it.

    bits   : (m,) int64 sectors of each move; starts, ends (m, 3) float64, mm; tool (m,) int32; feeds (m,) bool
    x, y   : (m, 3) float64, unit, the frame of the sectors at each move
    radius : (k,) float64, mm by tool

    Back to ``WINDOW`` radii of way; rapids and moves of another tool end it. The front is that of the move, and where
    it goes on that way for less than ``STRAIGHT`` radii, as stairs do, that of the way it has come besides: the greater
    of both. Returns (m,) float64, 0 where a move itself meets nothing.
    """
    count = len(bits)
    out, heading, plan, straight = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    for m in range(count):
        heading[m], plan[m] = _heading(_way(starts[m], ends[m]), x[m], y[m])
    begun, run = 0, 0.0
    for m in range(count + 1):
        joined = m < count and m > 0 and feeds[m] and feeds[m - 1] and tool[m] == tool[m - 1] and (
            plan[m] <= 1e-9 or math.cos(heading[m] - heading[m - 1]) >= ONE_WAY)
        if joined and plan[m] <= 1e-9:
            heading[m] = heading[m - 1]  # a move that goes nowhere turns no way
        if not joined:
            for i in range(begun, m):
                straight[i] = run
            begun, run = m, 0.0
        if m < count:
            run += plan[m]
    for m in range(count):
        if bits[m] == 0:
            continue
        r = radius[tool[m]]
        joint, way, i = bits[m], plan[m], m
        while i > 0 and way < WINDOW * r and feeds[i - 1] and tool[i - 1] == tool[m]:
            i -= 1
            joint |= bits[i]
            way += plan[i]
        most = _in_front(joint, heading[m])
        if straight[m] < STRAIGHT * r:
            come, far = _heading(_way(starts[i], ends[m]), x[m], y[m])
            if far > 1e-9:
                most = max(most, _in_front(joint, come))
        out[m] = most * math.pi / FRONT
    return out


@njit(**KERNEL)
def carried_frames(axis, x):
    """Turn the X of each move, x (m, 3), into that of the move before carried over to the axis of its own, (m, 3).

    So a tool that leans on evenly has a frame that does not jump.
    """
    for m in range(1, len(axis)):
        u = axis[m]
        if u[0] == axis[m - 1, 0] and u[1] == axis[m - 1, 1] and u[2] == axis[m - 1, 2]:
            x[m, 0], x[m, 1], x[m, 2] = x[m - 1, 0], x[m - 1, 1], x[m - 1, 2]
            continue
        up = u[0] * x[m - 1, 0] + u[1] * x[m - 1, 1] + u[2] * x[m - 1, 2]
        vx, vy, vz = x[m - 1, 0] - up * u[0], x[m - 1, 1] - up * u[1], x[m - 1, 2] - up * u[2]
        size = math.sqrt(vx * vx + vy * vy + vz * vz)
        if size > 0.1:
            x[m, 0], x[m, 1], x[m, 2] = vx / size, vy / size, vz / size
