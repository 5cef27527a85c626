"""zones.json: what the decomposition of a part found."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.tools import Tool

Share = Annotated[float, Field(ge=0, le=1)]
Level = Literal["simple", "medium", "high"]


class PartFacts(ReportModel):
    """The part as it was read."""

    faces: Annotated[int, Field(ge=1, description="Number of B-rep faces.")]
    volume_mm3: float
    bbox_mm: Annotated[list[list[float]], Field(min_length=2, max_length=2,
                                                description="Lower and upper corner in the setup frame, mm.")]


class WallFacts(ReportModel):
    """One wall."""

    id: Annotated[str, Field(examples=["W4"])]


class ConnectionFacts(ReportModel):
    """Material that bridges a channel; one wall id twice = two stretches of one wall."""

    id: Annotated[str, Field(examples=["C2"])]
    walls: Annotated[list[str], Field(min_length=2)]


class ChannelFacts(ReportModel):
    """The void between two facing walls."""

    id: Annotated[str, Field(examples=["H1"])]
    walls: list[str]
    gap_min_mm: Annotated[float, Field(description="Least outward ray distance between the walls' sides, connections "
                                                   "and their fillets left out, mm.")]


class AccessFacts(ReportModel):
    """A tool axis that zones are cut along."""

    id: Annotated[str, Field(examples=["A1", "I1"])]
    axis: Annotated[list[float], Field(min_length=3, max_length=3, description="Tip to spindle, setup frame, unit.")]
    found: Annotated[bool, Field(description="Looked for by the planner on a 5-axis machine; else of the setup.")]
    rotary_deg: Annotated[list[float] | None, Field(
        description="How tilting and turning axis stand for it, but for whole turns; null on a 3-axis machine.")]


class Rejection(ReportModel):
    """A strategy or tool that was considered and not taken."""

    reason: str
    strategy: str | None = None
    tool: str | None = None
    value: Any = None
    limit: Any = None


class SideProfile(ReportModel):
    """Profile of one side of a wall in plan."""

    wall: Annotated[str, Field(examples=["W1"])]
    profile: Annotated[str | None, Field(description="C1 to C10; null: straight.")] = None
    level: Level
    margin: Annotated[float, Field(ge=0, le=1, description="Least relative change of a measure that would change the "
                                                           "type.")]


class ApproachCone(ReportModel):
    """A circular cone of tool axes by each of which the tool gets to all of a zone."""

    axis: Annotated[list[float], Field(min_length=3, max_length=3, description="Tip to spindle, setup frame.")]
    half_angle_deg: float
    resolution_deg: Annotated[float, Field(description="How far the half angle may be off.")]


class Patch(ReportModel):
    """What a zone holds of a face, as a trimmed face."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: float
    whole: Annotated[bool, Field(description="The zone holds all of the face.")]
    loops: Annotated[int, Field(description="Borders: the outer one and the holes.")]


class ZoneFacts(ReportModel):
    """A machinable zone with its tool, axis and depth; the figures of passes and proof stand only in a report."""

    id: Annotated[str, Field(examples=["Z3"])]
    kind: Annotated[Literal["SCZ", "SCZI"] | None, Field(description="Split computable zone; SCZI: on, under or over "
                                                                    "a connection.")] = None
    profile: Annotated[str | None, Field(description="Profile type C1 to C10 of the most complex side; null: straight, "
                                                     "or no wall.")] = None
    level: Annotated[Level | None, Field(description="Complexity of the profile; null: no wall.")] = None
    profiles: Annotated[list[SideProfile], Field(description="The sides of walls the zone lies on.")] = []
    open: Annotated[bool | None, Field(description="Passes can leave the zone sideways at their level.")] = None
    region: Annotated[str | None, Field(examples=["H1", "H1.2", "H1 over C2", "W1", "C2", "top", "floor",
                                                  "free"])] = None
    merged: Annotated[list[str], Field(description="Cells over or under connections that were joined to it.")] = []
    form: Literal["level", "shallow", "steep"] | None = None
    faces: list[Any] = []
    patches: Annotated[list[Patch], Field(description="The same as trimmed faces.")] = []
    access: str | None = None
    tool: str | None = None
    axis: Annotated[list[float] | None, Field(description="Tool axis in the setup frame.")] = None
    approach: ApproachCone | None = None
    depth_mm: Annotated[list[float] | None, Field(description="Top and bottom along the axis, mm.")] = None
    cutting_plane_mm: Annotated[float | None, Field(description="Height along the axis below which the tool is not "
                                                                "asked.")] = None
    area_mm2: float | None = None
    strategy: str | None = None
    rejected: list[Rejection] = []


class ComputableZone(ReportModel):
    """Main computable zone: what one tool can touch along one axis."""

    access: str
    tool: str
    area_mm2: Annotated[float, Field(description="With shank and holder clear.")]
    cutter_area_mm2: Annotated[float, Field(description="By the cutting part alone.")]


class CuttingPlane(ReportModel):
    """Where a tool, or an access, ends in a region."""

    access: str
    z_mm: Annotated[float, Field(description="Along the access direction.")]
    region: str
    tool: str | None = None
    reason: str


class Place(ReportModel):
    """What an entry holds of a face, and where."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: float
    box_mm: Annotated[list[list[float]], Field(min_length=2, max_length=2,
                                               description="Lower and upper corner in the setup frame, mm.")]


class Remainder(ReportModel):
    """Area that the setup cannot reach, why, and what would."""

    faces: list[Any]
    area_mm2: float
    reason: Annotated[str, Field(description="undercut, undercut behind connection C2, fixture, pass, shank, holder, "
                                             "gap, corner or sharp corner; see the glossary.")]
    would_need: Annotated[dict[str, Any], Field(
        description="The tool that would do: kind, diameter_mm, corner_radius_mm, neck_length_mm, shank_diameter_mm, "
                    "stickout_mm in sizes that are sold, like (the tool at hand whose holder it was measured with), "
                    "share (of the area it does). Or kind 'other access', 'other clamping' or 'other process'. Empty "
                    "where no tool is needed or none would do.")] = {}
    tool_at_hand: Annotated[str | None, Field(description="Reason pass: the tool of the setup that touches it; reason "
                                                          "fixture: the one that would without fixtures.")] = None
    why_left: Annotated[str | None, Field(description="Reason pass: why that tool was not used.")] = None
    patches: Annotated[list[Place], Field(description="Area by face, and where.")] = []


class ProposedTool(ReportModel):
    """A tool to add, lengths from the tip."""

    kind: str
    diameter_mm: float
    corner_radius_mm: float
    flute_length_mm: float
    neck_diameter_mm: float
    neck_length_mm: float
    shank_diameter_mm: float
    stickout_mm: float
    slenderness: Annotated[float, Field(description="Neck length over diameter.")]
    instead_of: Annotated[str | None, Field(description="Tool at hand with the same cutter.")] = None
    like: Annotated[str | None, Field(description="Tool at hand whose holder it was measured with.")] = None
    access: str
    area_mm2: Annotated[float, Field(
        description="Of the remainder, what zones with it hold; it is asked for nothing else.")]
    tool: Annotated[Tool | None, Field(description="The same as an entry for tools of the setup, complete.")] = None


class Proposal(ReportModel):
    """The fewest tools to add, and what they leave."""

    tools: list[ProposedTool]
    emptied_mm2: float
    stays_mm2: Annotated[dict[str, float], Field(description="By reason: undercut, fixture, sharp corner, slender, "
                                                             "pass, too little.")]


class Zones(ReportModel):
    """zones.json."""

    part: PartFacts
    walls: list[WallFacts]
    connections: list[ConnectionFacts]
    channels: list[ChannelFacts]
    accesses: list[AccessFacts]
    mcz: list[ComputableZone] = []
    cutting_planes: list[CuttingPlane] = []
    machinable_area_mm2: Annotated[float | None, Field(
        description="Of all faces asked for. In a dry check zones and remainder sum to it; in a report what is proved, "
                    "the findings and the remainder do.")] = None
    machinable_by_role_mm2: Annotated[dict[str, float], Field(
        description="The same by the role of the faces: wall, connection, floor, base, fillet, free.")] = {}
    zones: list[ZoneFacts]
    remainder: list[Remainder]
    proposal: Proposal | None = None
