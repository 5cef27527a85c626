"""Moves that were cut before, found by the cells in which they begin and end.

A move is noted twice, from each of its ends. Notes of a cell form a chain. A hash table with open addressing gives the
first note of a cell. Places are mm.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BITS = 2**21 - 1  # cells 2**21 apart share a number
SPREAD = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def cell_key(x, y, z):
    """Number of a cell by its three indices, float64 whole numbers."""
    return (np.int64(x) & BITS) << 42 | (np.int64(y) & BITS) << 21 | np.int64(z) & BITS


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _slot(cells, key):
    """Row of the table (s, 2) int64 that holds a cell, or the free one where it belongs; s is a power of 2."""
    size = np.uint64(len(cells))
    k = np.int64((np.uint64(key) * SPREAD >> np.uint64(17)) & (size - np.uint64(1)))
    while cells[k, 1] >= 0 and cells[k, 0] != key:
        k = (k + 1) & (len(cells) - 1)
    return k


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def note(e, first, last, points, size, ends, after, cells):
    """Note moves ``first`` to ``last - 1`` of points (n, 3); move k goes from point k to k + 1.

    e     : row of the first note
    size  : mm, of a cell
    ends  : (m, 6) float64, notes: an end of a move, and its other end
    after : (m,) int64, the next note of the same cell, -1 for none
    cells : (s, 2) int64, number of a cell and its first note, -1 where the row is free
    """
    for k in range(first, last):
        for side in range(2):
            for c in range(3):
                ends[e, c], ends[e, 3 + c] = points[k + side, c], points[k + 1 - side, c]
            chain(e, size, ends, after, cells)
            e += 1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def chain(e, size, ends, after, cells):
    """Put note ``e`` before the others of its cell; arguments as ``note``."""
    key = cell_key(np.floor(ends[e, 0] / size), np.floor(ends[e, 1] / size), np.floor(ends[e, 2] / size))
    k = _slot(cells, key)
    after[e] = cells[k, 1]
    cells[k, 0], cells[k, 1] = key, e


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def chain_all(count, size, ends, after, cells):
    """Put ``count`` notes into an empty table; arguments as ``note``."""
    for e in range(count):
        chain(e, size, ends, after, cells)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _passes_over(p, q, on, size, ends, after, cells):
    """Whether a noted move that ends within ``on`` of p (3,) passes over q (3,)."""
    for x in range(int(np.floor((p[0] - on) / size)), int(np.floor((p[0] + on) / size)) + 1):
        for y in range(int(np.floor((p[1] - on) / size)), int(np.floor((p[1] + on) / size)) + 1):
            for z in range(int(np.floor((p[2] - on) / size)), int(np.floor((p[2] + on) / size)) + 1):
                e = cells[_slot(cells, cell_key(x, y, z)), 1]
                while e >= 0:
                    off, length, along, there = 0.0, 0.0, 0.0, 0.0
                    for c in range(3):
                        way, to = ends[e, 3 + c] - p[c], q[c] - p[c]
                        off += (ends[e, c] - p[c]) ** 2
                        length += way * way
                        along += to * way
                        there += to * to
                    if off < on * on:
                        share = along / length if length > 0.0 else 0.0
                        aside = 0.0
                        for c in range(3):
                            aside += (q[c] - p[c] - share * (ends[e, 3 + c] - p[c])) ** 2
                        if 0.0 <= share * length <= length + on * np.sqrt(length) and aside < on * on:
                            return True
                    e = after[e]
    return False


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def fresh_moves(points, on, size, ends, after, cells, out):
    """Whether moves of points (n, 3) are no part of a noted move that shares an end with them, into out (n - 1,) bool.

    on : mm, places nearer are the same;  the others as ``note``
    """
    for k in range(len(out)):
        out[k] = not (_passes_over(points[k], points[k + 1], on, size, ends, after, cells)
                      or _passes_over(points[k + 1], points[k], on, size, ends, after, cells))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def repeated_moves(points, on, size, ends, after, cells, out):
    """Whether moves of points (n, 3) repeat earlier ones of the same points, into out (n - 1,) bool; all are noted.

    The others as ``fresh_moves``, with an empty table.
    """
    for k in range(len(out)):
        out[k] = (_passes_over(points[k], points[k + 1], on, size, ends, after, cells)
                  or _passes_over(points[k + 1], points[k], on, size, ends, after, cells))
        note(2 * k, k, k + 1, points, size, ends, after, cells)
