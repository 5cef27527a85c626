"""The height above which nothing stands, and approaches from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry.mesh import F64
from verify.blank.blank import stock_bounds
from verify.model import ProofSetup
from verify.program.program import Program

UP = np.array([0.0, 0.0, 1.0])
Z_AXIS = 4


def top_of_all(bounds: F64, setup: ProofSetup) -> float:
    """Height that neither part (bounds (2, 3), mm), stock nor fixtures exceed before the first cut, mm."""
    return _top_along(UP, bounds, setup)


def _top_along(axis: F64, bounds: F64, setup: ProofSetup) -> float:
    """How far along a direction (3,) the boxes round part, blank and fixtures reach, mm."""
    boxes = [bounds, stock_bounds(bounds, setup), *(np.asarray(f, dtype=np.float64) for f in setup.fixtures)]
    return max(float(np.where(axis > 0, b[1] * axis, b[0] * axis).sum()) for b in boxes)


def from_above(program: Program, height: float) -> Program:
    """The program with every descent that only lacks the height it starts from begun at ``height`` mm, or higher.

    Start, home and tool change are above everything, so that is where the tool comes from, and the way down is
    simulated like any other. Other unknown starts are left to ``way_findings``.
    """
    start, minutes = program.start.copy(), program.minutes.copy()
    for move, axes in program.unknown.tolist():
        if axes == Z_AXIS and (start[move, :2] == program.end[move, :2]).all():
            start[move, 2] = max(height, program.end[move, 2])
            minutes[move] = (start[move, 2] - program.end[move, 2]) / program.feed[move]
    return replace(program, start=start, minutes=minutes)
