"""Dividing facets into small ones, walking borders, thinning polylines.

Notation
    A facet with apex P (opposite its shortest side), left end L and right end R, counter-clockwise P, L, R. Rows run
    from the left side to the right side; row 0 is the apex alone, the last row is the shortest side.
    data row of a node: x, y, z (mm), u, v, and the normal (3); all are linear over a facet.
    side: (number of the edge, 1 when it is walked from its lower node to its higher one, else 0).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
COLUMNS = 8


@njit(**KERNEL)
def _apex_of(length: F64, sides: I64, t: int) -> int:
    """Corner opposite the shortest side of facet t: sides (t, 3) edge numbers, side k from corner k to k + 1."""
    best, corner = np.inf, 0
    for k in range(3):
        if length[sides[t, k]] < best:
            best, corner = length[sides[t, k]], (k + 2) % 3
    return corner


@njit(**KERNEL)
def _side_node(corners: I64, sides: I64, parts: I64, first: I64, t: int, k: int, i: int) -> int:
    """Node number of point i on side k of facet t, walked from corner k to corner k + 1."""
    a, b = corners[t, k], corners[t, (k + 1) % 3]
    e = sides[t, k]
    if i == 0:
        return a
    if i == parts[e]:
        return b
    return first[e] + (i if a < b else parts[e] - i) - 1


@njit(**KERNEL)
def _row_ends(corners: I64, sides: I64, parts: I64, first: I64, t: int, apex: int, j: int) -> tuple[int, int, int]:
    """Number of rows of facet t, and the node numbers at the left and right end of row j."""
    left, right = apex, (apex + 2) % 3
    nl, nr = parts[sides[t, left]], parts[sides[t, right]]
    rows = min(nl, nr)
    i = (2 * j * nl + rows) // (2 * rows)
    k = (2 * j * nr + rows) // (2 * rows)
    return (rows, _side_node(corners, sides, parts, first, t, left, i),
            _side_node(corners, sides, parts, first, t, right, nr - k))


@njit(**KERNEL)
def _row_parts(data: F64, a: int, b: int, pitch: float) -> int:
    """Parts that a row between nodes a and b is cut into so that none is longer than ``pitch`` (mm)."""
    d = 0.0
    for c in range(3):
        d += (data[b, c] - data[a, c]) ** 2
    return max(1, int(math.ceil(math.sqrt(d) / pitch)))


@njit(**KERNEL)
def count_division(corners: I64, sides: I64, parts: I64, length: F64, first: I64, data: F64,
                   pitch: float) -> tuple[I64, I64]:
    """Count of inner nodes and small facets of each facet.

    corners       : (t, 3) int64, index of the nodes
    sides         : (t, 3) int64, index of the edges
    parts, first  : (e,) int64, parts of each edge (count) and index of its first inner node
    length        : (e,) float64, mm, of each edge
    data          : (n, 8) float64, mm and, for the parameters, as the surface has them: node rows in the frame of the
                    part, edge nodes included
    pitch         : mm

    Returns (t,) inner nodes and (t,) facets, int64, count.
    """
    m = len(corners)
    inner, small = np.zeros(m, np.int64), np.zeros(m, np.int64)
    for t in range(m):
        apex = _apex_of(length, sides, t)
        base = parts[sides[t, (apex + 1) % 3]]
        rows, _, _ = _row_ends(corners, sides, parts, first, t, apex, 0)
        before = 0
        for j in range(1, rows + 1):
            here = base
            if j < rows:
                _, a, b = _row_ends(corners, sides, parts, first, t, apex, j)
                here = _row_parts(data, a, b, pitch)
                inner[t] += here - 1
            small[t] += before + here
            before = here
        small[t] += abs(parts[sides[t, apex]] - parts[sides[t, (apex + 2) % 3]])
    return inner, small


@njit(**KERNEL)
def divide(corners: I64, sides: I64, parts: I64, length: F64, first: I64, data: F64, pitch: float, node_at: I64,
           facet_at: I64, out: I64) -> None:
    """Fill in the inner nodes (rows of ``data`` from node_at[t] on) and the small facets (``out`` from facet_at[t]).

    corners           : (t, 3) int64, index of the nodes
    sides             : (t, 3) int64, index of the edges
    parts, first      : (e,) int64, parts of each edge (count) and index of its first inner node
    length            : (e,) float64, mm, of each edge
    data              : (n, 8) float64, mm, node rows as in ``count_division``; the inner nodes are filled in
    pitch             : mm
    node_at, facet_at : (t,) int64, index of the first inner node and the first small facet of each facet
    out               : (q, 3) int64, index of the nodes of the small facets

    Two facets that share a side get the same nodes there, since the nodes of a side depend on the side alone.
    """
    for t in range(len(corners)):
        apex = _apex_of(length, sides, t)
        left, right, bottom = apex, (apex + 2) % 3, (apex + 1) % 3
        node, facet = node_at[t], facet_at[t]
        rows, a, b = _row_ends(corners, sides, parts, first, t, apex, 0)
        upper = np.array([a])
        for j in range(1, rows + 1):
            _, a, b = _row_ends(corners, sides, parts, first, t, apex, j)
            if j == rows:
                k = parts[sides[t, bottom]]
                lower = np.empty(k + 1, np.int64)
                for i in range(k + 1):
                    lower[i] = _side_node(corners, sides, parts, first, t, bottom, i)
            else:
                k = _row_parts(data, a, b, pitch)
                lower = np.empty(k + 1, np.int64)
                lower[0], lower[k] = a, b
                for i in range(1, k):
                    for c in range(COLUMNS):
                        data[node, c] = data[a, c] + (data[b, c] - data[a, c]) * (i / k)
                    lower[i] = node
                    node += 1
            facet = _strip(upper, lower, out, facet)
            facet = _side_extras(corners, sides, parts, first, t, left, j, rows, out, facet, True, facet_at[t])
            facet = _side_extras(corners, sides, parts, first, t, right, j, rows, out, facet, False, facet_at[t])
            upper = lower


@njit(**KERNEL)
def _strip(upper: I64, lower: I64, out: I64, facet: int) -> int:
    """Facets between two rows; returns the number of the next facet."""
    ku, kl = len(upper) - 1, len(lower) - 1
    i = m = 0
    while i < ku or m < kl:
        out[facet, 0], out[facet, 1] = upper[i], lower[m]
        if m == kl or (i < ku and (2 * i + 1) * kl < (2 * m + 1) * ku):
            i += 1
            out[facet, 2] = upper[i]
        else:
            m += 1
            out[facet, 2] = lower[m]
        facet += 1
    return facet


@njit(**KERNEL)
def _side_extras(corners: I64, sides: I64, parts: I64, first: I64, t: int, side: int, j: int, rows: int, out: I64,
                 facet: int, is_left: bool, start: int) -> int:
    """Split the facet of the last strip that lies on a side where that side has nodes between row j - 1 and row j."""
    n = parts[sides[t, side]]
    lo = (2 * (j - 1) * n + rows) // (2 * rows)
    hi = (2 * j * n + rows) // (2 * rows)
    for i in range(lo + 1, hi):
        if is_left:
            above = _side_node(corners, sides, parts, first, t, side, i - 1)
            middle = _side_node(corners, sides, parts, first, t, side, i)
            below = _side_node(corners, sides, parts, first, t, side, hi)
            a, b = above, below
        else:
            above = _side_node(corners, sides, parts, first, t, side, n - i + 1)
            middle = _side_node(corners, sides, parts, first, t, side, n - i)
            below = _side_node(corners, sides, parts, first, t, side, n - hi)
            a, b = below, above
        for q in range(facet - 1, start - 1, -1):
            found = -1
            for c in range(3):
                if out[q, c] == a and out[q, (c + 1) % 3] == b:
                    found = c
            if found >= 0:
                for c in range(3):
                    out[facet, c] = out[q, c]
                out[q, (found + 1) % 3] = middle
                out[facet, found] = middle
                facet += 1
                break
    return facet


@njit(**KERNEL)
def trace(corners: I64, twin: I64, group: I64, loop_nodes: I64, loop_sides: I64, loop_at: I64) -> int:
    """Border loops of every group of facets, the group on the left.

    corners   : (t, 3) int64, index of nodes in the frame of the sheet; side 3 t + k runs from corner k to corner k + 1
    twin      : (3 t,) int64, index of the same side of the other facet, -1 at the rim
    group     : (t,) int64, index of the group of each facet
    loop_nodes, loop_sides : (3 t,) int64, out, index of the start node and the side of each border side, loop by loop
    loop_at   : (3 t + 1,) int64, out, index of the start of each loop; one past the end after the last

    Returns the number of loops. Where a group touches itself in a node, the walk stays in its own fan of facets.
    """
    sides = 3 * len(corners)
    done = np.zeros(sides, np.bool_)
    count = at = 0
    loop_at[0] = 0
    for s in range(sides):
        if done[s] or not _is_border(twin, group, s):
            continue
        here = s
        while not done[here]:
            done[here] = True
            loop_nodes[at], loop_sides[at] = corners[here // 3, here % 3], here
            at += 1
            here = here // 3 * 3 + (here + 1) % 3
            while not _is_border(twin, group, here):
                other = twin[here]
                here = other // 3 * 3 + (other + 1) % 3
        count += 1
        loop_at[count] = at
    return count


@njit(**KERNEL)
def _is_border(twin: I64, group: I64, s: int) -> bool:
    return twin[s] < 0 or group[twin[s] // 3] != group[s // 3]


@njit(**KERNEL)
def thin(points: F64, tolerance: float, keep: NDArray[np.bool_]) -> None:
    """Thin an open polyline [Douglas1973].

    points : (k, 5) float64, mm: x, y, z and u, v scaled to mm. A point is dropped when both its parts are within
    ``tolerance`` of one place of the chord. keep : (k,) bool, out; the ends stay
    """
    k = len(points)
    keep[0] = keep[k - 1] = True
    stack = np.empty((k + 1, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, k - 1
    top = 1
    while top:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        worst, at = tolerance, -1
        span = 0.0
        for c in range(3):
            span += (points[b, c] - points[a, c]) ** 2
        for i in range(a + 1, b):
            s = 0.0
            for c in range(3):
                s += (points[i, c] - points[a, c]) * (points[b, c] - points[a, c])
            s = min(max(s / span, 0.0), 1.0) if span > 0 else 0.0
            space = plane = 0.0
            for c in range(5):
                d = (points[i, c] - points[a, c] - s * (points[b, c] - points[a, c])) ** 2
                if c < 3:
                    space += d
                else:
                    plane += d
            d = math.sqrt(max(space, plane))
            if d > worst:
                worst, at = d, i
        if at >= 0:
            keep[at] = True
            stack[top, 0], stack[top, 1] = a, at
            stack[top + 1, 0], stack[top + 1, 1] = at, b
            top += 2
