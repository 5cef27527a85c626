"""The label of a surface as a function, and the places where it changes along a line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geometry.mesh import F64, I32
from geometry.trimming.facet_sheet import BOOL, I64

# points (k, 3) mm, unit normals (k, 3), face numbers (k,) -> labels (k,)
Label = Callable[[F64, F64, I32], I64]


class LabelQuery:
    """The label as a function of node rows; ``calls`` and ``points`` count calls and points."""

    def __init__(self, label: Label) -> None:
        self.label, self.calls, self.points = label, 0, 0

    def __call__(self, rows: F64, face: I32) -> I64:
        """Labels, (k,) int64, of node rows (k, 8) on faces (k,) int32, index."""
        if not len(rows):
            return np.zeros(0, np.int64)
        self.calls, self.points = self.calls + 1, self.points + len(rows)
        normal = rows[:, 5:]
        length = np.linalg.norm(normal, axis=1)
        unit = normal / np.where(length > 0, length, 1.0)[:, None]
        out = np.asarray(self.label(np.ascontiguousarray(rows[:, :3]), unit, face))
        if out.shape != (len(rows),):
            raise ValueError(f"a label function must return one label a point, ({len(rows)},), not {out.shape}")
        return out.astype(np.int64, copy=False)


def bisect(query: LabelQuery, start: F64, end: F64, face: I32, at_start: I64, at_end: I64, tolerance: float,
           stop_at_third: bool) -> tuple[F64, BOOL, I64]:
    """Places along straight lines at which the label changes.

    start, end       : (k, 8) float64, node rows, mm and parameters
    face             : (k,) int32, index, 1-based, of the face
    at_start, at_end : (k,) int64, index of the label at either end
    tolerance        : float, mm, length of the remaining interval
    stop_at_third    : stop at a label that neither end has; otherwise it counts as the label of the end

    Returns the fraction of the way, (k,) float64, dimensionless, where a third label was met, (k,) bool, and that
    label, (k,) int64, index.
    """
    low, high = np.zeros(len(start)), np.ones(len(start))
    length = np.linalg.norm(end[:, :3] - start[:, :3], axis=1)
    third, label = np.zeros(len(start), bool), np.zeros(len(start), np.int64)
    while True:
        live = np.flatnonzero(~third & ((high - low) * length > tolerance))
        if not len(live):
            return 0.5 * (low + high), third, label
        middle = 0.5 * (low[live] + high[live])
        here = query(start[live] + middle[:, None] * (end[live] - start[live]), face[live])
        same = here == at_start[live]
        low[live[same]], high[live[~same]] = middle[same], middle[~same]
        if stop_at_third:
            other = ~same & (here != at_end[live])
            rows = live[other]
            third[rows], label[rows], low[rows] = True, here[other], middle[other]
