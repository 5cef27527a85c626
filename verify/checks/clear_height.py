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
ROOM = 1.0  # mm: a way home has a length, wherever it begins


def top_of_all(bounds: F64, setup: ProofSetup) -> float:
    """Height that part, stock and fixtures do not exceed before the first cut, mm.

    bounds : (2, 3) float64, mm, setup frame, of the part
    """
    return _top_along(UP, bounds, setup)


def _top_along(axis: F64, bounds: F64, setup: ProofSetup) -> float:
    """Largest coordinate along a direction, (3,), of the boxes round part, blank and fixtures, mm."""
    boxes = [bounds, stock_bounds(bounds, setup), *(np.asarray(f, dtype=np.float64) for f in setup.fixtures)]
    return max(float(np.where(axis > 0, b[1] * axis, b[0] * axis).sum()) for b in boxes)


def lifted(program: Program, low: F64, bounds: F64, setup: ProofSetup) -> F64:
    """Where the moves of a program end, with every way home in Z followed until all of the tool is above everything.

    low    : (m,) float64, mm, lowest place of the tool on each move
    bounds : (2, 3) float64, mm, frame of the program, of the part

    Returns (m, 3) float64, mm, frame of the program.

    Notes
    -----
    Z of the machine is that of the setup where the head tilts, and the tool axis where the table does.
    """
    if not program.lifts:
        return program.end
    end = program.end.copy()
    heads = setup.kinematics is not None and setup.kinematics.tilts_head
    for row, along in program.lifts:
        up = UP if program.poses is None else program.poses.end_axis[row]
        lowest = float(end[row] @ up)
        if heads and not along:
            up, lowest = UP, float(low[row])
        end[row] += (max(_top_along(up, bounds, setup) - lowest, 0.0) + setup.clearance_rapid + ROOM) * up
    return end


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
