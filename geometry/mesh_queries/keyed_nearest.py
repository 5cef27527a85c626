"""Nearest points among those of the same key."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.binning import limits_of
from geometry.mesh import F64

AT_ONCE = 500_000  # points asked for in one call, whose results take as much memory as they
FEW = 10_000  # points whose answers take no longer than it takes to start two threads for them
APART = 4.0  # times the extent of the points: how far one key is from the next along the added axis


class KeyedPoints:
    """A hierarchy over points with one more axis, along which points of different keys lie far apart.

    key    : (n,) int64, index, any values
    points : (n, d) float64, mm, in one frame
    within : (k, d) float64, mm, points as far apart as what is asked about; None: ``points`` themselves
    """

    def __init__(self, key: NDArray[np.int64], points: F64, within: F64 | None = None) -> None:
        self.keys, place = np.unique(key, return_inverse=True)
        within = points if within is None else within
        low, high = limits_of(within) if len(within) else (np.zeros(1), np.zeros(1))
        span = float(np.linalg.norm(high - low))
        self.step = APART * span + 1.0
        self.reach = 0.5 * self.step
        self.tree = cKDTree(np.column_stack([points, self.step * place.reshape(-1)]))

    def nearest(self, key: NDArray[np.int64], points: F64, k: int = 1) -> NDArray[np.int64]:
        """Rows of the nearest points of the same key.

        key    : (m,) int64, index
        points : (m, d) float64, mm, same frame, not farther from the indexed points than twice the extent
        Returns (m, k) int64, index of the points, nearest first; -1 where the key has fewer.
        """
        out = np.full((len(points), k), -1, np.int64)
        if not len(self.keys) or not len(points):
            return out
        place = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
        known = np.flatnonzero(self.keys[place] == key)
        for first in range(0, len(known), AT_ONCE):
            asked = known[first:first + AT_ONCE]
            at = np.column_stack([points[asked], self.step * place[asked]])
            _, row = self.tree.query(at, k=list(range(1, k + 1)), distance_upper_bound=self.reach,
                                     workers=2 if len(at) > FEW else 1)
            out[asked] = np.where(row < self.tree.n, row, -1)
        return out
