"""Speed of a control with look-ahead along straight moves.

Notation
    l, s      : length of a move, mm, and the programmed speed on it, mm/s
    a         : acceleration, mm/s², the same in every direction
    phi       : angle by which the way turns at a corner; 0 straight on, pi back
    d         : mm, largest distance by which the control may pass a corner
    v         : speed at a corner, mm/s

At a corner the control runs an arc that touches both moves. Of radius r it passes the corner by
r (1 / cos(phi / 2) - 1) and touches the moves r tan(phi / 2) before and behind it, which is half of either at most.
Along the arc v² = SQUARE_SHARE a r is the most, so that half of the acceleration is left to change the speed with; for
chords of a curve, whose corners take half of each, r is its radius.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

SQUARE_SHARE, ARC_SHARE = math.sqrt(0.75), 0.5  # of the acceleration on an arc: square to the way and along it


@njit(**KERNEL)
def corner(before, behind, shorter, a, d):
    """The arc at a corner between unit vectors, of three numbers, along two moves, the shorter ``shorter`` mm long.

    Returns the most speed on it, mm/s, how much of each move it takes the place of, and half of its length, mm.
    """
    cos = before[0] * behind[0] + before[1] * behind[1] + before[2] * behind[2]
    half = math.sqrt(max(0.5 * (1.0 + cos), 0.0))  # cos(phi / 2)
    if half <= 1e-9:
        return 0.0, 0.0, 0.0
    sine = math.sqrt(max(0.5 * (1.0 - cos), 0.0))
    tan = sine / half
    if tan <= 1e-9 or half >= 1.0:
        return np.inf, 0.0, 0.0
    radius = min(d * half / (1.0 - half), 0.5 * shorter / tan)
    return math.sqrt(SQUARE_SHARE * a * radius), radius * tan, radius * math.atan2(sine, half)


@njit(**KERNEL)
def _direction(way, size, i):
    """Unit vector along move i."""
    return way[i, 0] / size[i], way[i, 1] / size[i], way[i, 2] / size[i]


@njit(**KERNEL)
def seconds_of_moves(way, speed, stop, curve, a, d, out):
    """Seconds (m,) of m moves run one behind the other from standstill to standstill, written to ``out``.

    way : (m, 3) mm; speed : (m,) mm/s; stop : (m,) bool, moves before which the control stands still
    curve : (m,) bool, moves that are chords of the curve the one before is one of: only half of either bounds the arc
    An arc counts to the moves before and behind it by halves.
    """
    m = len(way)
    size = np.empty(m)
    for i in range(m):
        size[i] = math.sqrt(way[i, 0] * way[i, 0] + way[i, 1] * way[i, 1] + way[i, 2] * way[i, 2])
    # by turns what is left straight of a move and the arc behind it: length, most speed, most change of it
    length, most, change = np.zeros(2 * m), np.zeros(2 * m), np.full(2 * m, a)
    for i in range(m):
        length[2 * i], most[2 * i] = size[i], speed[i]
    for i in range(m - 1):
        k = 2 * i + 1
        change[k] = ARC_SHARE * a
        if stop[i + 1] or size[i] == 0.0 or size[i + 1] == 0.0:
            continue
        v, taken, half = corner(_direction(way, size, i), _direction(way, size, i + 1), min(size[i], size[i + 1]), a,
                                np.inf if curve[i + 1] else d)
        length[k], most[k] = 2.0 * half, min(v, min(speed[i], speed[i + 1]))
        length[k - 1] -= taken
        length[k + 1] -= taken
    at = np.zeros(2 * m)  # speed before each piece; the last arc is none, before it the control stands
    for k in range(1, 2 * m - 1):
        length[k] = max(length[k], 0.0)
        at[k] = min(min(most[k - 1], most[k]), math.sqrt(at[k - 1] ** 2 + 2.0 * change[k - 1] * length[k - 1]))
    for k in range(2 * m - 2, -1, -1):
        at[k] = min(at[k], math.sqrt(at[k + 1] ** 2 + 2.0 * change[k] * length[k]))
    for i in range(m):
        out[i] = 0.0
    for k in range(2 * m - 1):
        if length[k] > 0.0:
            v, w, b = at[k], at[k + 1], change[k]
            peak = min(most[k], math.sqrt(b * length[k] + 0.5 * (v * v + w * w)))
            even = length[k] - (2.0 * peak * peak - v * v - w * w) / (2.0 * b)
            seconds = (2.0 * peak - v - w) / b + max(even, 0.0) / peak
            if k % 2 == 0:
                out[k // 2] += seconds
            else:
                out[k // 2] += 0.5 * seconds
                out[k // 2 + 1] += 0.5 * seconds
