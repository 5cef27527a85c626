"""The height above part, stock and fixtures, and approaches from there. Arrays are float64, mm, setup frame."""

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
    """Height that part, stock and fixtures do not exceed before the first cut, mm.

    bounds : (2, 3) float64, mm, setup frame, of the part
    """
    return _top_along(UP, bounds, setup)


def _top_along(axis: F64, bounds: F64, setup: ProofSetup) -> float:
    """Largest coordinate along a direction, (3,), of the boxes round part, blank and fixtures, mm."""
    boxes = [bounds, stock_bounds(bounds, setup), *(np.asarray(f, dtype=np.float64) for f in setup.fixtures)]
    return max(float(np.where(axis > 0, b[1] * axis, b[0] * axis).sum()) for b in boxes)


def from_above(program: Program, height: float) -> Program:
    """The program with every descent of unknown start height begun at ``height`` mm, or higher.

    Start, home and tool change are above everything, so the tool comes from there. The descent is simulated like any
    other move. ``way_findings`` reports the other unknown starts.
    """
    start, minutes = program.start.copy(), program.minutes.copy()
    for move, axes in program.unknown.tolist():
        if axes == Z_AXIS and (start[move, :2] == program.end[move, :2]).all():
            start[move, 2] = max(height, program.end[move, 2])
            minutes[move] = (start[move, 2] - program.end[move, 2]) / program.feed[move]
    return replace(program, start=start, minutes=minutes)
