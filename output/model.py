"""The workplan that every writer turns into text: plain values, tool tip, setup frame, mm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from output.kinematics import RotaryMachine
from toolpath.motion import Motion, Trajectory, Workingstep


@dataclass(frozen=True, eq=False)
class StockBox:
    """Bounding box of the stock, mm: lower and upper corner (3,)."""

    lower: F64
    upper: F64


@dataclass(frozen=True, eq=False)
class Frame:
    """The frame of an access in which steps are planned.

    rotation  : (3, 3) float64, rows are its axes in the setup frame; Z is the tool axis
    clearance : mm, its Z above which rapids across are free
    """

    rotation: F64
    clearance: float


@dataclass(frozen=True, eq=False)
class Clamping:
    """A part held once on a machine that turns it, or the tool, from one access to the next.

    machine : its rotary axes; frames : by id of the access
    centre  : (3,) float64, mm, setup frame
    radius  : mm; part, stock and fixtures, and the room rapids keep to them, lie in the ball of this radius round it
    gauges  : mm, spindle face to tip, by T number
    """

    machine: RotaryMachine
    frames: Mapping[str, Frame]
    centre: F64
    radius: float
    gauges: Mapping[int, float]


@dataclass(frozen=True, eq=False)
class Workplan:
    """A job for one access direction, or for one clamping: everything a writer needs.

    clearance_plane : z in mm above which rapids in XY are free
    clamping        : of a machine with rotary axes: steps are in the frame of their access; None: all in the setup's
    labels          : passed through to headers
    comments        : header lines for the machinist (ASCII, no parentheses)
    restart         : every step begins as after a tool change, so that a program can be started at each of them
    """

    name: str
    steps: tuple[Workingstep, ...]
    tools: tuple[ToolBody, ...]
    clearance_plane: float
    work_offset: str
    stock: StockBox
    material: str
    part_sha256: str
    setup_sha256: str
    version: str
    labels: dict[str, str] = field(default_factory=dict)
    comments: tuple[str, ...] = ()
    clamping: Clamping | None = None
    restart: bool = False


__all__ = ["Clamping", "Frame", "Motion", "StockBox", "Trajectory", "Workingstep", "Workplan"]
