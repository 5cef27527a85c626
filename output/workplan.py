"""The workplan that every writer turns into text: plain values, tool tip, setup frame, mm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from geometry.mesh import F64, TriangleMesh
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from output.inverse_kinematics import RotaryMachine
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep

FIRST_NUMBER = 1000
"""Of the first program of a job."""


@dataclass(frozen=True, eq=False)
class StockBox:
    """Bounding box of the stock, mm: lower and upper corner (3,)."""

    lower: F64
    upper: F64


class Ap238(StrEnum):
    """What an AP238 file is for.

    CC1            : tool paths, conformance class 1
    CC2            : class 2, with part and stock as shapes and the strategies of the operations
    INTEGRATED_CNC : as CC1, for readers of the first edition, which know the schema by another name
    """

    CC1 = "cc1"
    CC2 = "cc2"
    INTEGRATED_CNC = "integrated_cnc"


@dataclass(frozen=True, eq=False)
class StockCylinder:
    """A round blank: middle of its lower end (3,), mm, the way to the upper one (3,), unit, radius and height, mm."""

    base: F64
    axis: F64
    radius: float
    height: float


@dataclass(frozen=True)
class Assembly:
    """What a tool is besides a shape: spindle face to tip, mm; number of teeth; minutes in cut its cutter lasts."""

    gauge_length: float
    teeth: int | None = None
    life: float | None = None


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
    figures         : header lines for the figures of the proof, ``output.gcode.proof_header``
    restart         : every step begins as after a tool change, so that a program can be started at each of them
    stock_words     : what kind of blank it is, where it is no box: ``stock`` is then a box round it
    cylinder        : the blank where it is one, or None; stock_mesh : where it is a mesh, or None
    part_mesh       : the part, faces by number, or None where nobody wants it written
    assemblies      : by T number; surfaces : by face number, in the frame of the plan, where strategies follow them
    ap238           : what the AP238 file is for
    coolant         : whether it runs while a tool cuts
    number, number_words : of the program, where a control tells programs apart by numbers, and what is said beside it
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
    figures: tuple[str, ...] = ()
    clamping: Clamping | None = None
    restart: bool = False
    stock_words: str = ""
    cylinder: StockCylinder | None = None
    stock_mesh: TriangleMesh | None = None
    part_mesh: TriangleMesh | None = None
    assemblies: Mapping[int, Assembly] = field(default_factory=dict)
    surfaces: Mapping[int, NurbsSurface] = field(default_factory=dict)
    ap238: Ap238 = Ap238.CC1
    coolant: bool = True
    number: int = FIRST_NUMBER
    number_words: str = ""

    def assembly(self, tool: ToolBody) -> Assembly:
        """What is known of a tool; without more, it is as long as shank and holder stick out of the spindle."""
        known = self.assemblies.get(tool.number)
        return known or Assembly(tool.stickout + sum(h.length for h in tool.holder))


__all__ = ["FIRST_NUMBER", "Ap238", "Assembly", "Clamping", "Frame", "TrajectoryKind", "StockBox", "StockCylinder",
           "Trajectory", "Workingstep", "Workplan"]
