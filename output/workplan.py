"""The workplan that every writer turns into text: plain values, tool tip, setup frame, mm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from geometry.mesh import F64, TriangleMesh
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from output.inverse_kinematics import RotaryMachine
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep

FIRST_NUMBER = 1000
"""Number of the first program of a job."""


@dataclass(frozen=True, eq=False)
class StockBox:
    """Bounding box of the stock: lower and upper corner, (3,) float64, mm, setup frame."""

    lower: F64
    upper: F64


class Ap238(StrEnum):
    """Purpose of an AP238 file.

    CC1            : tool paths, conformance class 1
    CC2            : class 2, with part and stock as shapes and the strategies of the operations
    INTEGRATED_CNC : as CC1, for readers of the first edition, which know the schema by another name
    """

    CC1 = "cc1"
    CC2 = "cc2"
    INTEGRATED_CNC = "integrated_cnc"


@dataclass(frozen=True, eq=False)
class StockCylinder:
    """A cylindrical blank.

    base   : (3,) float64, mm, setup frame, middle of the lower end
    axis   : (3,) float64, unit, from the lower end to the upper one
    radius, height : mm
    """

    base: F64
    axis: F64
    radius: float
    height: float


@dataclass(frozen=True)
class Assembly:
    """Data of a tool besides its shape.

    gauge_length : mm, spindle face to tip
    teeth        : number of teeth, None where it is unknown
    life         : min in cut that its cutter lasts, None where it is unknown
    """

    gauge_length: float
    teeth: int | None = None
    life: float | None = None


@dataclass(frozen=True, eq=False)
class AccessFrame:
    """The frame of an access, in which steps are planned.

    rotation  : (3, 3) float64, rows are its axes in the setup frame; Z is the tool axis
    clearance : mm, Z in this frame above which rapids in XY are free
    """

    rotation: F64
    clearance: float


@dataclass(frozen=True, eq=False)
class Clamping:
    """A part clamped once, on a machine that turns the part or the tool from one access to the next.

    machine : its rotary axes; frames : by id of the access
    centre  : (3,) float64, mm, setup frame
    radius  : mm; part, stock, fixtures and the clearance of rapids lie in this ball round ``centre``
    gauges  : mm, spindle face to tip, by T number
    step    : rad, largest turn of a rotary axis in one block of a rapid
    """

    machine: RotaryMachine
    frames: Mapping[str, AccessFrame]
    centre: F64
    radius: float
    gauges: Mapping[int, float]
    step: float = math.radians(2.0)


@dataclass(frozen=True, eq=False)
class Workplan:
    """A job for one access direction, or for one clamping: everything a writer needs.

    clearance_plane : mm, Z above which rapids in XY are free
    clamping        : on a machine with rotary axes; steps are then in the frame of their access. None: setup frame
    labels          : passed through to headers
    comments        : header lines for the machinist (ASCII, no parentheses)
    assumed         : header lines on what the proof takes for granted (ASCII)
    figures         : header lines for the figures of the proof, ``output.gcode.proof_header``
    restart         : a program can be started at each step
    stock_words     : kind of the blank where it is not a box; ``stock`` is then its bounding box
    cylinder        : the blank where it is a cylinder, or None; stock_mesh : where it is a mesh, or None
    part_mesh       : the part with its face numbers, or None where the file needs no part
    assemblies      : by T number; surfaces : by face number, in the frame of the plan, where strategies follow them
    ap238           : purpose of the AP238 file
    coolant         : whether coolant runs while a tool cuts
    number, number_words : number of the program, for controls that number programs, and the comment beside it
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
    assumed: tuple[str, ...] = ()
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
        """Assembly of a tool; by default the gauge length is stickout plus holder length."""
        known = self.assemblies.get(tool.number)
        return known or Assembly(tool.stickout + sum(h.length for h in tool.holder))


__all__ = ["FIRST_NUMBER", "Ap238", "Assembly", "Clamping", "AccessFrame", "TrajectoryKind", "StockBox",
           "StockCylinder", "Trajectory", "Workingstep", "Workplan"]
