"""Least height at which each node of a height field is connected to the outside."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def escape_heights(height, order):
    """(n, m) float64: the least z at which a node is joined to the border of the field within {height <= z}.

    height : (n, m) float64, mm, may hold inf; order : (n m,) int64, its nodes by height, lowest first

    Nodes enter from the lowest on and join their neighbours along rows and columns. Nodes that join the border get its
    height. Members of a set form a ring, so that each is visited once.
    """
    rows, cols = height.shape
    n = rows * cols
    flat = height.reshape(n)
    out = np.full(n, np.inf)
    parent, ring, size = np.arange(n + 1), np.arange(n + 1), np.ones(n + 1, np.int64)
    inside = np.zeros(n + 1, np.bool_)
    inside[n] = True  # the outside itself
    beside = np.empty(5, np.int64)
    for k in range(n):
        c = order[k]
        z = flat[c]
        if not z < np.inf:
            break
        inside[c] = True
        i, j = c // cols, c % cols
        count = 0
        if i > 0:
            beside[count] = c - cols
            count += 1
        if i < rows - 1:
            beside[count] = c + cols
            count += 1
        if j > 0:
            beside[count] = c - 1
            count += 1
        if j < cols - 1:
            beside[count] = c + 1
            count += 1
        if count < 4:
            beside[count] = n
            count += 1
        for t in range(count):
            if not inside[beside[t]]:
                continue
            a, b, free = _root(parent, c), _root(parent, beside[t]), _root(parent, n)
            if a == b:
                continue
            if a == free or b == free:
                lone = b if a == free else a
                m = lone
                while True:
                    out[m] = z
                    m = ring[m]
                    if m == lone:
                        break
            if size[a] < size[b]:
                a, b = b, a
            parent[b] = a
            size[a] += size[b]
            ring[a], ring[b] = ring[b], ring[a]
    return out.reshape((rows, cols))
