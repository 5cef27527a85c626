"""Speed of a control with look-ahead along straight moves, with limited acceleration and jerk.

Notation
    l, s  : length of a move, mm, and the programmed speed on it, mm/s
    a, j  : acceleration, mm/s², and jerk, mm/s³, the same in every direction; j may be infinite
    phi   : angle by which the way turns at a corner; 0 straight on, pi back
    d     : mm, largest distance by which the control may pass a corner
    r     : radius of the arc that the control runs at a corner, mm
    v, w  : speed, mm/s; dv the size of a change of it

A change of speed is an S-curve: the acceleration rises and falls at the jerk, and is 0 before and behind. It takes
t = 2 sqrt(dv / j) where the acceleration stays below a, that is for dv <= a² / j, else t = dv / a + a / j, and its way
is (v + w) / 2 t.

At a corner the control runs an arc that touches both moves. Of radius r it passes the corner by
r (1 / cos(phi / 2) - 1) and touches the moves r tan(phi / 2) before and behind it, which is half of either at most.
Along the arc v² = SQUARE_SHARE a r is the most. The acceleration square to the way rises from 0 to v² / r and falls
again while the arc is run, in the time r phi / v. At the jerk j that takes v² / r <= j r phi / (2 v), so
v³ <= j r² phi / 2. A corner between two that turn the same way by about as much is one of a curve: the acceleration
does not fall between them, and only the ends of the curve bound the jerk, v³ <= j r², with the radius of the curve.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

SQUARE_SHARE = math.sqrt(0.75)  # of the acceleration on an arc, square to the way: half of it is left along the way
ALIKE, SHARP = 3.0, 0.5  # radii of neighbours on a curve differ by that factor at most; cos of its sharpest corner
BINDS = 1e-4  # share by which a corner is slower than the moves beside it, to end a stretch of one speed
HALVINGS, NEWTON = 40, 8


@njit(**KERNEL)
def change_seconds(v, w, a, j):
    """Seconds from one speed to another."""
    dv = abs(w - v)
    if dv * j <= a * a:
        return 2.0 * math.sqrt(dv / j)
    return dv / a + a / j


@njit(**KERNEL)
def change_way(v, w, a, j):
    """Way from one speed to another, mm."""
    return 0.5 * (v + w) * change_seconds(v, w, a, j)


@njit(**KERNEL)
def reached(v, length, a, j):
    """Speed reached from v over a length, mm/s.

    Below the acceleration a it solves l = j x³ + 2 v x for x = sqrt(dv / j), by Newton from a bound above; else
    w² + w a² / j = v² - v a² / j + 2 a l.
    """
    base = a * a / j
    if length <= 0.0:
        return v
    if base > 0.0:
        x = (length / j) ** (1.0 / 3.0)
        if v > 0.0:
            x = min(x, 0.5 * length / v)
        for _ in range(NEWTON):
            x -= (j * x * x * x + 2.0 * v * x - length) / (3.0 * j * x * x + 2.0 * v)
        if j * x * x <= base:
            return v + j * x * x
    return 0.5 * (math.sqrt(base * base + 4.0 * (v * v - v * base + 2.0 * a * length)) - base)


@njit(**KERNEL)
def leg_seconds(v, w, most, length, a, j):
    """Seconds of a length from speed v to w, at ``most`` at most; v and w can be reached from each other on it."""
    if length <= 0.0:
        return 0.0
    low, high = max(v, w), max(most, max(v, w))
    if change_way(v, high, a, j) + change_way(high, w, a, j) > length:
        if change_way(v, low, a, j) + change_way(low, w, a, j) >= length:
            return length / (0.5 * (v + w))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if change_way(v, middle, a, j) + change_way(middle, w, a, j) <= length:
                low = middle
            else:
                high = middle
        high = low if low > 0.0 else high  # so short that no halving was slow enough: 1e-12 of ``most``
    even = length - change_way(v, high, a, j) - change_way(high, w, a, j)
    return change_seconds(v, high, a, j) + change_seconds(high, w, a, j) + max(even, 0.0) / high


@njit(**KERNEL)
def _corner(way, size, i, out):
    """The corner before move i: sine and cosine of half its angle, and the vector it turns about, into ``out`` (5,)."""
    cos = 0.0
    for k in range(3):
        cos += way[i - 1, k] * way[i, k]
        m, n = (k + 1) % 3, (k + 2) % 3
        out[2 + k] = (way[i - 1, m] * way[i, n] - way[i - 1, n] * way[i, m]) / (size[i - 1] * size[i])
    cos /= size[i - 1] * size[i]
    out[0], out[1] = math.sqrt(max(0.5 * (1.0 - cos), 0.0)), math.sqrt(max(0.5 * (1.0 + cos), 0.0))


@njit(**KERNEL)
def _caps(way, size, stop, curve, a, j, d, cap, round_):
    """Most speed at each corner, into ``cap`` (m + 1,), and whether the arc there takes half of a move, (m + 1,)."""
    m = len(way)
    turn, radius = np.zeros((m + 1, 5)), np.full(m + 1, np.inf)
    standing = np.zeros(m + 1, np.bool_)
    standing[0], standing[m] = True, True
    for i in range(1, m):
        standing[i] = stop[i] or size[i - 1] == 0.0 or size[i] == 0.0
        if not standing[i]:
            _corner(way, size, i, turn[i])
            if turn[i, 0] > 1e-9 * turn[i, 1]:
                radius[i] = 0.5 * min(size[i - 1], size[i]) * turn[i, 1] / turn[i, 0]
    for i in range(m + 1):
        cap[i], round_[i] = 0.0, False
        if standing[i]:
            continue
        cap[i] = np.inf
        sine, half = turn[i, 0], turn[i, 1]
        if math.isinf(radius[i]):
            continue
        if half <= 1e-9:
            cap[i] = 0.0
            continue
        wide = np.inf if curve[i] else d * half / max(1.0 - half, 1e-300)
        r = min(wide, radius[i])
        cap[i] = min(math.sqrt(SQUARE_SHARE * a * r), (j * r * r * math.atan2(sine, half)) ** (1.0 / 3.0))
        round_[i] = radius[i] <= wide
        bent = curve[i]
        if round_[i] and not bent and 1 < i < m - 1 and half * half - sine * sine > SHARP:
            bent = True
            for k in (i - 1, i + 1):
                along = turn[i, 2] * turn[k, 2] + turn[i, 3] * turn[k, 3] + turn[i, 4] * turn[k, 4]
                bent = bent and along > 0.0 and radius[i] < ALIKE * radius[k] and radius[k] < ALIKE * radius[i]
                r = min(r, radius[k])
        if bent:
            cap[i] = max(cap[i], min(math.sqrt(SQUARE_SHARE * a * r), (j * r * r) ** (1.0 / 3.0)))


@njit(**KERNEL)
def seconds_of_moves(way, speed, stop, curve, a, j, d, out):
    """Seconds (m,) of m moves run one behind the other from standstill to standstill, written to ``out``.

    way : (m, 3) mm; speed : (m,) mm/s; stop : (m,) bool, moves before which the control stands still
    curve : (m,) bool, moves that are chords of the curve the one before is one of: only half of either bounds the arc
    Moves of one speed that no corner slows are one stretch, whose time they share by their lengths.
    """
    m = len(way)
    size = np.empty(m)
    for i in range(m):
        size[i] = math.sqrt(way[i, 0] * way[i, 0] + way[i, 1] * way[i, 1] + way[i, 2] * way[i, 2])
    cap, round_, most = np.empty(m + 1), np.empty(m + 1, np.bool_), np.empty(m)
    _caps(way, size, stop, curve, a, j, d, cap, round_)
    for i in range(m):
        most[i] = speed[i]
        if round_[i] and round_[i + 1] and size[i] <= min(size[i - 1], size[i]) + min(size[i], size[i + 1]):
            most[i] = min(speed[i], max(cap[i], cap[i + 1]))  # arcs take at least half of the move
    first = np.empty(m + 1, np.int64)  # moves with which stretches begin
    count = 0
    for i in range(m):
        low = most[i] if i == 0 else min(most[i - 1], most[i])
        if i == 0 or cap[i] < (1.0 - BINDS) * low or abs(most[i] - most[i - 1]) > BINDS * low:
            first[count] = i
            count += 1
    first[count] = m
    length, at = np.zeros(count), np.zeros(count + 1)
    for k in range(count):
        for i in range(first[k], first[k + 1]):
            length[k] += size[i]
        if k:
            at[k] = min(cap[first[k]], min(most[first[k] - 1], most[first[k]]))
            at[k] = min(at[k], reached(at[k - 1], length[k - 1], a, j))
    for k in range(count - 1, 0, -1):
        at[k] = min(at[k], reached(at[k + 1], length[k], a, j))
    for k in range(count):
        seconds = leg_seconds(at[k], at[k + 1], most[first[k]], length[k], a, j)
        for i in range(first[k], first[k + 1]):
            out[i] = seconds * size[i] / length[k] if length[k] > 0.0 else 0.0
