"""Trapezoidal map of pieces that meet only at their ends, with its search DAG.

Randomised incremental construction [DeBerg2008, chapter 6]: pieces are inserted one after the other. Each cuts the
trapezoids it runs through, and their leaves in the search DAG become inner nodes.

Notation: a *point* is an id. Points come sorted by x, then by y, which is the order along x after a shear by an
infinite small amount; so comparing ids compares points exactly, and a vertical piece is one that leans a little.
A *piece* runs from its lesser to its greater point. The last two pieces are the bottom and the top of the box, whose
corners are the first two and the last two points. ``ends`` (pieces, 8) int32 holds px, py, qx, qy, P, Q and fills
half a cache line. Coordinates are whole grid steps, at most LIMIT = 2^25 in size; a place that is looked up is on a
grid SUB = 2^8 times finer. An orientation is then at most 2 * 2^26 * 2^34 = 2^61 in size: int64 holds it exactly.

trap (n, 9) int32: TOP, BOTTOM pieces; LEFT, RIGHT points; UL, LL, UR, LR neighbours, -1 where none; its LEAF.
    An upper neighbour shares the top piece, a lower one the bottom piece.
node (n, 4) int32: KIND, item, first, second child. A leaf names its trapezoid. An x-node names a point: first is left
    of it. A y-node names a piece: first is above it. Node 0 is the root.
"""

from __future__ import annotations

import numpy as np
from numba import njit

LIMIT = 1 << 25
SUB = 256
TOP, BOTTOM, LEFT, RIGHT, UL, LL, UR, LR, LEAF = range(9)
P, Q = 4, 5  # columns of ends
IS_LEAF, IS_POINT, IS_PIECE = range(3)
DONE, MEET, LOST = range(3)  # of build_map: built; two pieces cross, touch or lie on each other; a broken link
OUTSIDE = -1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def orientation(ends, t, x, y):
    """> 0 where (x, y) is left of piece t (above it), < 0 where right of it, 0 on its line."""
    px, py = np.int64(ends[t, 0]), np.int64(ends[t, 1])
    return (ends[t, 2] - px) * (y - py) - (ends[t, 3] - py) * (x - px)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _slot(trap, at, slot):
    """What a trapezoid holds, of the type that a computed number has: what takes it is compiled for one type only."""
    return np.int64(trap[at, slot])


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _runs_below(ends, s, t):
    """Whether s lies below t at both ends of their common stretch, but for a shared point; else they meet."""
    left, right = 1, 1
    if ends[s, P] > ends[t, P]:
        left = -orientation(ends, t, ends[s, 0], ends[s, 1])
    elif ends[s, P] < ends[t, P]:
        left = orientation(ends, s, ends[t, 0], ends[t, 1])
    if ends[s, Q] < ends[t, Q]:
        right = -orientation(ends, t, ends[s, 2], ends[s, 3])
    elif ends[s, Q] > ends[t, Q]:
        right = orientation(ends, s, ends[t, 2], ends[t, 3])
    elif ends[s, P] == ends[t, P]:
        return False
    return left > 0 and right > 0


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _start(node, ends, s):
    """(trapezoid in which piece s starts, piece it meets or -1)."""
    p = ends[s, P]
    x, y = ends[s, 0], ends[s, 1]
    i = 0
    while node[i, 0] != IS_LEAF:
        item = np.int64(node[i, 1])
        if node[i, 0] == IS_POINT:  # a piece that starts at the point itself runs to its right
            i = node[i, 3] if p >= item else node[i, 2]
            continue
        side = orientation(ends, item, x, y)
        if side == 0:
            if ends[item, P] == p:  # both start here: the steeper one is above
                side = orientation(ends, item, ends[s, 2], ends[s, 3])
            if side == 0:
                return -1, item
        i = node[i, 2] if side > 0 else node[i, 3]
    return node[i, 1], -1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _crossed(trap, node, ends, points, s, path):
    """Trapezoids that piece s runs through, into path: (how many, state, piece it meets or -1)."""
    at, met = _start(node, ends, s)
    if met >= 0:
        return 0, MEET, met
    count = 0
    while True:
        if at < 0:
            return count, LOST, -1
        if not _runs_below(ends, s, _slot(trap, at, TOP)):
            return count, MEET, trap[at, TOP]
        if not _runs_below(ends, _slot(trap, at, BOTTOM), s):
            return count, MEET, trap[at, BOTTOM]
        path[count] = at
        count += 1
        r = _slot(trap, at, RIGHT)
        if ends[s, Q] <= r:
            return count, DONE, -1
        side = orientation(ends, s, points[r, 0], points[r, 1])
        if side == 0:  # a point on the piece: return a piece that ends or starts there
            return count, MEET, _piece_at(ends, r)
        at = _slot(trap, at, LR if side > 0 else UR)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _piece_at(ends, point):
    """The first piece with this end."""
    for t in range(len(ends)):
        if ends[t, P] == point or ends[t, Q] == point:
            return t
    return -1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _new(trap, node, free, count, top, bottom, left, right):
    """A trapezoid without neighbours, with its leaf; count: (trapezoid slots used, nodes, free slots)."""
    if count[2] > 0:
        count[2] -= 1
        at = free[count[2]]
    else:
        at = count[0]
        count[0] += 1
    trap[at, TOP], trap[at, BOTTOM], trap[at, LEFT], trap[at, RIGHT] = top, bottom, left, right
    trap[at, UL:LEAF] = -1
    trap[at, LEAF] = count[1]
    node[count[1], 0], node[count[1], 1] = IS_LEAF, at
    count[1] += 1
    return at


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _join_top(trap, left, right):
    """Make two trapezoids neighbours across a wall under their common top; -1 is nobody."""
    if left >= 0:
        trap[left, UR] = right
    if right >= 0:
        trap[right, UL] = left


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _join_bottom(trap, left, right):
    """Make two trapezoids neighbours across a wall over their common bottom; -1 is nobody."""
    if left >= 0:
        trap[left, LR] = right
    if right >= 0:
        trap[right, LL] = left


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _branch(node, count, at, kind, item, first, second):
    """Turn node ``at`` into an inner one; a child of -1 is made here and its number returned."""
    made = -1
    if first < 0 or second < 0:
        made = count[1]
        count[1] += 1
    node[at, 0], node[at, 1] = kind, item
    node[at, 2] = first if first >= 0 else made
    node[at, 3] = second if second >= 0 else made
    return made


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _cut(trap, node, free, count, path, crossed, ends, points, s):
    """Cut the trapezoids of path by piece s; above and below s what had the same neighbour is one trapezoid."""
    p, q = np.int64(ends[s, P]), np.int64(ends[s, Q])
    d = path[0]
    upper = _new(trap, node, free, count, _slot(trap, d, TOP), s, p, q)
    lower = _new(trap, node, free, count, s, _slot(trap, d, BOTTOM), p, q)
    before, after = -1, -1
    if _slot(trap, d, LEFT) == p:
        _join_top(trap, _slot(trap, d, UL), upper)
        _join_bottom(trap, _slot(trap, d, LL), lower)
    else:
        before = _new(trap, node, free, count, _slot(trap, d, TOP), _slot(trap, d, BOTTOM), _slot(trap, d, LEFT), p)
        _join_top(trap, _slot(trap, d, UL), before)
        _join_bottom(trap, _slot(trap, d, LL), before)
        _join_top(trap, before, upper)
        _join_bottom(trap, before, lower)
    for j in range(crossed):
        d = path[j]
        r = _slot(trap, d, RIGHT)
        last = j == crossed - 1
        if last and r != q:
            after = _new(trap, node, free, count, _slot(trap, d, TOP), _slot(trap, d, BOTTOM), q, r)
        at = _slot(trap, d, LEAF)
        if j == 0 and before >= 0:
            at = _branch(node, count, at, IS_POINT, p, _slot(trap, before, LEAF), -1)
        if after >= 0:
            at = _branch(node, count, at, IS_POINT, q, -1, _slot(trap, after, LEAF))
        _branch(node, count, at, IS_PIECE, s, _slot(trap, upper, LEAF), _slot(trap, lower, LEAF))
        if last:
            break
        following = path[j + 1]
        if orientation(ends, s, points[r, 0], points[r, 1]) > 0:  # the wall of r now ends on s from above
            trap[upper, RIGHT] = r
            _join_top(trap, upper, _slot(trap, d, UR))
            fresh = _new(trap, node, free, count, _slot(trap, following, TOP), s, r, q)
            _join_top(trap, _slot(trap, following, UL), fresh)
            _join_bottom(trap, upper, fresh)
            upper = fresh
        else:
            trap[lower, RIGHT] = r
            _join_bottom(trap, lower, _slot(trap, d, LR))
            fresh = _new(trap, node, free, count, s, _slot(trap, following, BOTTOM), r, q)
            _join_bottom(trap, _slot(trap, following, LL), fresh)
            _join_top(trap, lower, fresh)
            lower = fresh
    if after >= 0:
        _join_top(trap, after, _slot(trap, d, UR))
        _join_bottom(trap, after, _slot(trap, d, LR))
        _join_top(trap, upper, after)
        _join_bottom(trap, lower, after)
    else:
        _join_top(trap, upper, _slot(trap, d, UR))
        _join_bottom(trap, lower, _slot(trap, d, LR))
    for j in range(crossed):
        trap[path[j], TOP] = -1
        free[count[2]] = path[j]
        count[2] += 1


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _rows(points, pieces):
    """(points as int32, ``ends``): narrow, and all of a piece in one place, for the time goes into cache misses."""
    narrow = points.astype(np.int32)
    ends = np.empty((len(pieces), 8), np.int32)
    for t in range(len(pieces)):
        p, q = pieces[t, 0], pieces[t, 1]
        ends[t, 0], ends[t, 1], ends[t, 2], ends[t, 3] = narrow[p, 0], narrow[p, 1], narrow[q, 0], narrow[q, 1]
        ends[t, P], ends[t, Q] = p, q
    return narrow, ends


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def build_map(points, pieces):
    """Insert the pieces (without the box) in the given order, which the caller has shuffled [DeBerg2008, chapter 6].

    points (m, 2) int64 sorted, pieces (n + 2, 2) int64.
    Returns (state, first piece, second piece, trap, node). Slots of trap with TOP = -1 are free. Where state is MEET,
    the two pieces cross, touch or overlap, and the rest has no meaning.
    """
    n = len(pieces) - 2
    narrow, ends = _rows(points, pieces)
    most = 3 * n + 1  # trapezoids at any time; while a piece is put in, old and new ones stand side by side
    trap = np.empty((2 * most + 2, 9), np.int32)
    free = np.empty(2 * most + 2, np.int32)
    path = np.empty(most + 1, np.int64)
    node = np.empty((10 * n + 16, 4), np.int32)
    count = np.zeros(3, np.int64)
    _new(trap, node, free, count, n + 1, n, 0, len(narrow) - 1)
    for s in range(n):
        crossed, state, met = _crossed(trap, node, ends, narrow, s, path)
        if state != DONE:
            return state, s, met, trap[:0], node[:0]
        if count[1] + 2 * crossed + 8 > len(node):
            wider = np.empty((2 * len(node) + 2 * crossed, 4), np.int32)
            for i in range(count[1]):
                for k in range(4):
                    wider[i, k] = node[i, k]
            node = wider
        _cut(trap, node, free, count, path, crossed, ends, narrow, s)
    return DONE, -1, -1, trap[: count[0]], node[: count[1]]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def find_trapezoids(node, points, pieces, places):
    """Trapezoid and depth (visited inner nodes) for places (k, 2) int64 on the grid SUB times finer than the points.

    A place is taken as moved up, and then right by much less. So one on a piece belongs above it, one on a vertical
    piece or under or over a point belongs right of it, and no trapezoid without width is ever the answer.
    Places out of the box, or on its right or top side, are OUTSIDE with depth 0.
    """
    found = np.full(len(places), OUTSIDE, np.int64)
    depth = np.zeros(len(places), np.int64)
    low, high = points[0] * SUB, points[len(points) - 1] * SUB
    for k in range(len(places)):
        x, y = places[k, 0], places[k, 1]
        if x < low[0] or y < low[1] or x >= high[0] or y >= high[1]:
            continue
        i = 0
        while node[i, 0] != IS_LEAF:
            item = node[i, 1]
            if node[i, 0] == IS_POINT:
                first = x < points[item, 0] * SUB
            else:
                p, q = pieces[item, 0], pieces[item, 1]
                px, py = points[p, 0], points[p, 1]
                first = (points[q, 0] - px) * (y - py * SUB) >= (points[q, 1] - py) * (x - px * SUB)
            i = node[i, 2] if first else node[i, 3]
            depth[k] += 1
        found[k] = node[i, 1]
    return found, depth
