"""Widest paths in a graph: how long each node stays joined with a root when nodes drop out one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

INT = NDArray[np.int64]


def widest_paths(pairs: INT, width: INT, roots: NDArray[np.bool_]) -> INT:
    """The largest, over all paths from a root, of the least width on the path.

    pairs : (m, 2) int64, index, nodes that are joined, each pair once
    width : (n,) int64, dimensionless, of the nodes; that of a root does not count
    roots : (n,) bool

    Returns (n,) int64, dimensionless, the least int64 where no path leads to a root.

    Notes
    -----
    The paths of a maximum spanning tree are widest. One more node joins the roots, which stay to the end.
    """
    n = len(width)
    least, most = np.iinfo(np.int64).min, np.iinfo(np.int64).max
    own = np.where(roots, most, width)
    first = np.flatnonzero(roots)
    a = np.concatenate([pairs[:, 0], first])
    b = np.concatenate([pairs[:, 1], np.full(len(first), n)])
    levels, rank = np.unique(np.minimum(own[a], np.append(own, most)[b]), return_inverse=True)
    graph = coo_matrix((len(levels) - rank.reshape(-1).astype(np.float64), (a, b)), shape=(n + 1, n + 1))
    tree = minimum_spanning_tree(graph.tocsr())
    order, before = breadth_first_order(tree, n, directed=False)
    out = np.full(n + 1, least)
    out[n] = most
    for node in order[1:].tolist():
        out[node] = min(out[before[node]], own[node])
    return out[:n]


__all__ = ["widest_paths"]
