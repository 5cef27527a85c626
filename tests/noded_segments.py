"""Segments that need no noding, for tests of the trapezoidal map, and the segments that its pieces come from."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from zones.plan_view.snap_rounding import Noding, _sorted_pieces, on_grid
from zones.plan_view.trapezoidal_map import TrapezoidMap


def take_noded(segments: ArrayLike, grid: float) -> Noding:
    """Segments that meet only at their ends already, without change; the map checks it exactly.

    segments : (s, 2, 2) float64, mm, in plan, rounded to the grid; equal segments become one piece with several sources
    grid     : mm, > 0
    Returns a ``Noding``. Raises InputError like ``node_segments``.
    """
    rounded = on_grid(segments, grid)
    hot, at = np.unique(rounded.reshape(-1, 2), axis=0, return_inverse=True)
    pairs = np.sort(at.reshape(-1, 2), axis=1)
    some = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    return _sorted_pieces(grid, rounded, hot, pairs[some], some)


def sources_of(plan: TrapezoidMap, piece: int) -> list[int]:
    """Numbers of the input segments of a piece, ascending; none for the bottom and top of the box."""
    noding = plan.noding
    if piece >= len(noding.pieces):
        return []
    return noding.sources[noding.starts[piece]:noding.starts[piece + 1]].tolist()
