"""Steps along a pass of a ball, each as long as the chord tolerance allows.

Notation
    P(s), n(s)   : contact and unit normal at the way s along the pass, cubic in each of even intervals
    C(s)         : P + r n, the centre of the ball
    dev(s; a, b) : distance of P(s) from the segment C(a) C(b), less r: below 0 the ball has cut in, above it left stock
    lat(s; a, b) : distance of C(s) from that segment square to n(s), and w what a way aside adds to the scallop there
    D(a, b)      : the greatest of |dev| and w lat on [a, b]
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

PLACES = 24  # looked at on a step before the greatest are closed in on
CLOSE = 0.97  # of the greatest seen: others that may be greater between places
GROWTH = 1.3
ENOUGH = 0.9985  # of the tolerance: a step that uses so much is long enough
TRIALS = 60
LEAST = 1e-3  # of a piece of the profile
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@njit(**KERNEL)
def _at(pieces, width, s, out):
    """Contact and normal at s; pieces (k, 6, 4), powers of the way into the piece from the third down."""
    k = min(max(int(s / width), 0), len(pieces) - 1)
    t = s - k * width
    for c in range(6):
        p = pieces[k, c]
        out[c] = ((p[0] * t + p[1]) * t + p[2]) * t + p[3]


@njit(**KERNEL)
def _off(pieces, width, s, a, d, length2, radius, aside, out):
    """The greater of |dev| and ``aside`` times lat at s, of a ball that goes from centre a by d."""
    _at(pieces, width, s, out)
    wx, wy, wz = out[0] - a[0], out[1] - a[1], out[2] - a[2]
    t = 0.0
    if length2 > 0.0:
        t = min(max((wx * d[0] + wy * d[1] + wz * d[2]) / length2, 0.0), 1.0)
    wx, wy, wz = wx - t * d[0], wy - t * d[1], wz - t * d[2]
    off = abs(math.sqrt(wx * wx + wy * wy + wz * wz) - radius)
    if aside > 0.0:
        up = (wx * out[3] + wy * out[4] + wz * out[5]) / (out[3] * out[3] + out[4] * out[4] + out[5] * out[5])
        wx, wy, wz = wx - up * out[3], wy - up * out[4], wz - up * out[5]
        off = max(off, aside * math.sqrt(wx * wx + wy * wy + wz * wz))
    return off


@njit(**KERNEL)
def greatest(pieces, width, s0, s1, radius, aside, seen, out):
    """D of the step from s0 to s1; seen (PLACES + 1,) and out (6,) are for its own use."""
    _at(pieces, width, s0, out)
    a = (out[0] + radius * out[3], out[1] + radius * out[4], out[2] + radius * out[5])
    _at(pieces, width, s1, out)
    d = (out[0] + radius * out[3] - a[0], out[1] + radius * out[4] - a[1], out[2] + radius * out[5] - a[2])
    length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    gap = (s1 - s0) / PLACES
    most = 0.0
    for i in range(PLACES + 1):
        seen[i] = _off(pieces, width, s0 + i * gap, a, d, length2, radius, aside, out)
        most = max(most, seen[i])
    best = most
    for i in range(1, PLACES):
        if seen[i] >= seen[i - 1] and seen[i] >= seen[i + 1] and seen[i] >= CLOSE * most:
            low, high = s0 + (i - 1) * gap, s0 + (i + 1) * gap
            for _ in range(24):
                u, v = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
                at_u = _off(pieces, width, u, a, d, length2, radius, aside, out)
                at_v = _off(pieces, width, v, a, d, length2, radius, aside, out)
                best = max(best, at_u, at_v)
                if at_u > at_v:
                    high = v
                else:
                    low = u
    return best


@njit(**KERNEL)
def _end_of_step(pieces, width, total, s, guess, radius, aside, tolerance, longest, seen, out):
    """Where the longest step from s ends: D is the tolerance there, less 0.15 % at most, or the step is the longest."""
    most = min(s + longest, total)
    low, at_low = s, 0.0
    high = min(s + guess, most)
    at_high = greatest(pieces, width, s, high, radius, aside, seen, out)
    while at_high <= tolerance:
        if high >= most or at_high >= ENOUGH * tolerance:
            return high
        low, at_low = high, at_high
        high = min(s + GROWTH * (high - s), most)
        at_high = greatest(pieces, width, s, high, radius, aside, seen, out)
    # D grows about as the square of the step
    for k in range(TRIALS):
        u, v = (low - s) ** 2, (high - s) ** 2
        share = (0.9993 * tolerance - at_low) / (at_high - at_low)
        mid = s + math.sqrt(u + min(max(share, 0.02), 0.98) * (v - u))
        if k % 3 == 2 or not low < mid < high:
            mid = 0.5 * (low + high)
        if not low < mid < high:
            break
        at = greatest(pieces, width, s, mid, radius, aside, seen, out)
        if at > tolerance:
            high, at_high = mid, at
        else:
            low, at_low = mid, at
            if at >= ENOUGH * tolerance:
                break
    return low if low > s else high


@njit(**KERNEL)
def forward(pieces, width, total, radius, aside, tolerance, longest, ends):
    """Ways at which the steps of a pass end, into ``ends``, the beginning first; returns how many, -1 where there are
    more than it holds, -2 where one is no step: shorter than LEAST of a piece.

    pieces : (k, 6, 4) float64; width : mm, of each; total : mm, of the pass; longest : mm;
    aside : what a way aside of 1 mm counts
    """
    seen, out = np.empty(PLACES + 1), np.empty(6)
    ends[0] = 0.0
    count, s, guess = 1, 0.0, min(longest, total)
    while s < total:
        if count == len(ends):
            return -1
        end = _end_of_step(pieces, width, total, s, guess, radius, aside, tolerance, longest, seen, out)
        if end - s < LEAST * width and end < total:
            return -2
        guess = max(end - s, 1e-9 * total)
        s = end
        ends[count] = s
        count += 1
    return count
