"""Which part of the front of a cutter is in the planner's stock.

The front is the half circle ahead of the way of a tip, in sectors from its right (0) to its left. A node of the stock
counts where it stands higher over the cutter than ``skin``. It stands for a strip one step wide, and meets the edge at
the angles off the way of both sides of that, as seen from where the profile meets its height; beside the flank the
last one stands for all up to the side of the edge.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from geometry.kernels.drop import Bull
from geometry.kernels.revolved import for_shape, radius_of
from geometry.kernels.tapered import Tapered
from geometry.kernels.two_arcs import TwoArcs
from toolpath.kernels.stock import bottom_at

SECTORS = 36
"""Of the half circle: an angle is known to a 36th of it."""


EDGES = np.sin(math.pi * (np.arange(SECTORS + 1) / SECTORS - 0.5))
BINS = 512
FIRST = np.searchsorted(EDGES[1:-1], 2.0 * np.arange(BINS) / BINS - 1.0, side="right")
"""Sector of the least sine of each bin; bins share the sines from -1 to 1 evenly."""
ALL = (1 << SECTORS) - 1


def side_begins(shape):
    """Height over the tip at which the corner ends, mm."""
    raise NotImplementedError


def width_at(shape, height):
    """Radius of the cutting part at a height over its tip, mm."""
    raise NotImplementedError


@for_shape(side_begins, Bull)
def _bull_side(shape):
    return shape.corner


@for_shape(side_begins, Tapered)
def _tapered_side(shape):
    return shape.high


@for_shape(side_begins, TwoArcs)
def _arcs_side(shape):
    return shape.top


@for_shape(width_at, Bull)
def _bull_width(shape, height):
    if height < shape.corner:
        return shape.flat + math.sqrt(max(height * (2.0 * shape.corner - height), 0.0))
    return shape.radius


@for_shape(width_at, Tapered)
def _tapered_width(shape, height):
    if height < shape.high:
        return shape.flat + math.sqrt(max(height * (2.0 * shape.corner - height), 0.0))
    return min(shape.join + (height - shape.high) / shape.grade, shape.radius)


@for_shape(width_at, TwoArcs)
def _arcs_width(shape, height):
    if height >= shape.top:
        return shape.radius
    if height <= shape.high:
        return shape.flat + math.sqrt(max(height * (2.0 * shape.low - height), 0.0))
    below = shape.up - height
    return shape.out + math.sqrt(max(shape.bow * shape.bow - below * below, 0.0))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _sector(sine):
    """Sector of an angle off the way by its sine; the sines at the ends of the half circle and beyond have the last."""
    if sine <= -1.0:
        return 0
    if sine >= 1.0:
        return SECTORS - 1
    at = FIRST[int(0.5 * (sine + 1.0) * BINS)]
    while at < SECTORS - 1 and sine >= EDGES[at + 1]:
        at += 1
    return at


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _sectors(k, top, x0, y0, step, tips, ways, shape, skin, bits):
    """The sectors of tip k in stock, as bits, into ``bits`` (n,) int64; parameters as in ``sectors``."""
    ny, nx = top.shape
    radius, corner_end = radius_of(shape), side_begins(shape)
    x, y, z = tips[k]
    i0, i1 = max(int(math.ceil((y - radius - y0) / step)), 0), min(int((y + radius - y0) / step), ny - 1)
    j0, j1 = max(int(math.ceil((x - radius - x0) / step)), 0), min(int((x + radius - x0) / step), nx - 1)
    for i in range(i0, i1 + 1):
        if bits[k] == ALL:
            break
        # of the row, what is within the radius and no more than a step behind, and a node more on both sides
        wy = y0 + step * i - y
        right = math.sqrt(max(radius * radius - wy * wy, 0.0))
        left, ahead = -right, -step - ways[k, 1] * wy
        if ways[k, 0] > 1e-3:
            left = max(left, ahead / ways[k, 0])
        elif ways[k, 0] < -1e-3:
            right = min(right, ahead / ways[k, 0])
        if left > right + step:
            continue
        for j in range(max(j0, int((x + left - x0) / step) - 1), min(j1, int((x + right - x0) / step) + 2) + 1):
            over = top[i, j] - z
            if over <= skin:
                continue
            wx, wy = x0 + step * j - x, y0 + step * i - y
            if ways[k, 0] * wx + ways[k, 1] * wy < -step:
                continue
            rho = math.sqrt(wx * wx + wy * wy)
            if rho > radius or over - bottom_at(shape, rho) <= skin:
                continue
            edge = width_at(shape, over)
            side = ways[k, 0] * wy - ways[k, 1] * wx
            low, high = _sector((side - 0.5 * step) / edge), _sector((side + 0.5 * step) / edge)
            if over >= corner_end and side + step > edge:
                high = SECTORS - 1
            if over >= corner_end and side - step < -edge:
                low = 0
            bits[k] |= (np.int64(2) << high) - (np.int64(1) << low)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True, parallel=True)
def sectors_parallel(top, x0, y0, step, tips, ways, shape, skin, bits):
    """``sectors`` on the threads numba has."""
    for k in prange(len(tips)):
        _sectors(k, top, x0, y0, step, tips, ways, shape, skin, bits)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def sectors(top, x0, y0, step, tips, ways, shape, skin, bits):
    """Sectors in stock, as bits, at tips (n, 3), mm, on their ways (n, 2), unit, into ``bits`` (n,) int64, zeros.

    top  : (ny, nx) mm, at nodes ``step`` mm apart from (x0, y0) on
    skin : mm of stock over the cutter that is not counted
    """
    for k in range(len(tips)):
        _sectors(k, top, x0, y0, step, tips, ways, shape, skin, bits)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def joined(bits, tips, window, out):
    """Angles, rad, of the sectors met over ``window`` mm of way before each tip and there, into ``out`` (n,).

    bits : (n,) int64, of ``sectors``; tips : (n, 3) mm
    """
    for k in range(len(tips)):
        joint, way, m = bits[k], 0.0, k
        while m > 0 and joint != 0:
            way += math.sqrt((tips[m, 0] - tips[m - 1, 0]) ** 2 + (tips[m, 1] - tips[m - 1, 1]) ** 2)
            if way > window:
                break
            m -= 1
            joint |= bits[m]
        count = 0
        while joint != 0:
            joint &= joint - 1
            count += 1
        out[k] = count * math.pi / SECTORS
