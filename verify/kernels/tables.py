"""Moves, tool axes, tools and limits of contact, as the kernels of the proof take them: each in one argument."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]


class MoveArrays(NamedTuple):
    """Straight moves of the tool tip in program order, setup frame.

    start : (m, 3) float64, mm
    end   : (m, 3) float64, mm
    feed  : (m,) bool, False for a rapid
    tool  : (m,) int32, index, row of the tables of tools
    """

    start: F64
    end: F64
    feed: Bool
    tool: I32


class AxisArrays(NamedTuple):
    """Tool axes of moves, setup frame; see ``verify.kernels.pose``.

    axis  : (m, 3) float64, unit, tip to spindle, at the start of each move
    about : (m, 3) float64, unit, square to ``axis``: the axis turns about it
    angle : (m,) float64, rad, turn over the move
    bow   : float, mm, error allowed where the axis turns
    """

    axis: F64
    about: F64
    angle: F64
    bow: float


class ToolArrays(NamedTuple):
    """Sizes of tools, frame of the tool: tip at the origin, axis Z.

    cutters : (k, 9) float64, mm, rows of ``CutterSizes``
    ends    : (k,) float64, mm, radius of the end that cuts straight down
    reach   : (k,) float64, mm, largest distance of each assembly from its tip
    bodies  : (b, 6) float64, mm, rows of necks, shanks and holders; see ``verify.kernels.stock``
    first   : (k + 1,) int64, index, rows first[k]:first[k + 1] belong to tool k
    """

    cutters: F64
    ends: F64
    reach: F64
    bodies: F64
    first: I64


class RapidArrays(NamedTuple):
    """What each move asks for as a rapid.

    free : (m,) bool, rapids that need no clearance
    room : (m,) float64, mm, distance that the whole tool keeps in every direction, also from what is below it; 0 for
           feed moves and free rapids. Aside, a rapid that is not free keeps ``ContactLimits.rapid``
    """

    free: Bool
    room: F64


class ContactLimits(NamedTuple):
    """What counts as a contact, mm.

    rapid  : float, clearance aside of everything in a rapid
    slack  : float, overlap with the part that the cutting part may have in a rapid
    beside : float, overlap that a body no wider than the cutting part may have beside its own cut
    """

    rapid: float
    slack: float
    beside: float
