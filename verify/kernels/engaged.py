"""Which part of the front of a cutter is in stock, as bits of sectors.

The front of a tool that moves along D is a half circle, 32 sectors from its left (0) to its right (31). A place at
signed distance b beside the way, where the profile has radius rho at the height of the stock, meets the cutting edge at
the angle asin(b / rho) off the feed. Stock is known on lines or nodes a step apart, so each stands for a strip as wide.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

SECTORS = 32
LEAST_DEPTH = 0.05
"""Share of the tool radius that a cut must be deep to count: what a finishing pass skims is no engagement."""


@njit(**KERNEL)
def _sector(sine):
    return max(0, min(int((0.5 - math.asin(min(max(sine, -1.0), 1.0)) / math.pi) * SECTORS), SECTORS - 1))


@njit(**KERNEL)
def sector_bits(wx, wy, dx, dy, plan, over, radius, corner, wide):
    """Bits of the sectors in which a strip ``wide`` mm across meets the edge.

    (wx, wy) : of its middle off the tip; (dx, dy), plan : the way and its length; over : mm of stock over the tip there
    """
    rho = radius
    if over < corner:
        rho = radius - corner + math.sqrt(max(over * (2.0 * corner - over), 0.0))
    b = (dx * wy - dy * wx) / plan
    if rho <= 0.0 or abs(b) > rho:
        return np.int64(0)
    first, last = _sector((b + 0.5 * wide) / rho), _sector((b - 0.5 * wide) / rho)
    return (np.int64(2) << last) - (np.int64(1) << first)


@njit(**KERNEL)
def window_angles(bits, length, tool, feeds, window):
    """Engaged angle, rad, of every move: sectors met on it and on the way before it, back to ``window`` mm.

    bits   : (m,) int64 sectors of each move; length (m,) float64, mm; tool (m,) int32; feeds (m,) bool
    window : (k,) float64, mm by tool

    Moves of another tool and rapids end the way before. Returns (m,) float64, 0 where a move itself meets nothing.
    """
    out = np.zeros(len(bits))
    for m in range(len(bits)):
        if bits[m] == 0:
            continue
        joint, way, i = bits[m], length[m], m - 1
        while i >= 0 and way < window[tool[m]] and feeds[i] and tool[i] == tool[m]:
            joint |= bits[i]
            way += length[i]
            i -= 1
        count = 0
        while joint:
            joint &= joint - 1
            count += 1
        out[m] = count * math.pi / SECTORS
    return out
