"""zones.json: the decomposition of a part into zones."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.tools import Tool

Share = Annotated[float, Field(ge=0, le=1)]
Level = Literal["simple", "medium", "high"]


class PartFacts(ReportModel):
    """The part as read."""

    faces: Annotated[int, Field(ge=1, description="Number of B-rep faces.")]
    volume_mm3: float
    bbox_mm: Annotated[list[list[float]], Field(min_length=2, max_length=2,
                                                description="Lower and upper corner in the setup frame, mm.")]


class WallFacts(ReportModel):
    """One wall."""

    id: Annotated[str, Field(examples=["W4"])]


class ConnectionFacts(ReportModel):
    """Material that bridges a channel. One wall id twice means two stretches of one wall."""

    id: Annotated[str, Field(examples=["C2"])]
    walls: Annotated[list[str], Field(min_length=2)]


class ChannelFacts(ReportModel):
    """The space between two facing walls."""

    id: Annotated[str, Field(examples=["H1"])]
    walls: list[str]
    gap_min_mm: Annotated[float, Field(description="Smallest distance between the sides of the walls, mm, along "
                                                   "outward rays, without connections and their fillets.")]


class AccessFacts(ReportModel):
    """A tool axis along which zones are cut."""

    id: Annotated[str, Field(examples=["A1", "I1"])]
    axis: Annotated[list[float], Field(
        min_length=3, max_length=3, description="Unit vector from tip to spindle, setup frame.")]
    found: Annotated[bool, Field(description="true: the planner found this axis on a 5-axis machine. false: the setup "
                                             "gave it.")]
    rotary_deg: Annotated[list[float] | None, Field(
        description="Angles of the tilting and the turning axis, deg. The program may add whole turns. null on a "
                    "3-axis machine.")]


class Rejection(ReportModel):
    """A strategy or tool that was considered and rejected."""

    reason: Annotated[str, Field(description="Why it was rejected, in words.")]
    strategy: str | None = None
    tool: str | None = None
    value: Annotated[Any, Field(description="Value that decided, in the unit named in reason.")] = None
    limit: Annotated[Any, Field(description="Value of the choice that was made instead, or the allowed value.")] = None


class SideProfile(ReportModel):
    """Profile of one side of a wall, in plan view."""

    wall: Annotated[str, Field(examples=["W1"])]
    profile: Annotated[str | None, Field(description="C1 to C10; null: straight.")] = None
    level: Level
    margin: Annotated[float, Field(
        ge=0, le=1, description="How far the shape is from another type: the smallest relative change of a measured "
                                "size that would change the type.")]


class ApproachCone(ReportModel):
    """A circular cone of tool axes. Along each of them the tool reaches at least 98 % of the zone."""

    axis: Annotated[list[float], Field(min_length=3, max_length=3, description="Tip to spindle, setup frame.")]
    half_angle_deg: float
    resolution_deg: Annotated[float, Field(description="Uncertainty of the half angle, deg.")]


class Patch(ReportModel):
    """The part of a face that belongs to a zone, as a trimmed face."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: float
    whole: Annotated[bool, Field(description="The whole face belongs to the zone.")]
    loops: Annotated[int, Field(description="Borders: the outer one, then the holes.")]


class ZoneFacts(ReportModel):
    """A machinable zone with its tool, axis and depth. report.json adds the figures of passes and proof."""

    id: Annotated[str, Field(examples=["Z3"])]
    kind: Annotated[Literal["SCZ", "SCZI"] | None, Field(
        description="SCZI: a zone on, under or over a connection. SCZ: any other zone.")] = None
    profile: Annotated[str | None, Field(description="Profile type C1 to C10 of the most complex side; null: straight, "
                                                     "or no wall.")] = None
    level: Annotated[Level | None, Field(
        description="Complexity of the profile; null: no wall. The form level is something else.")] = None
    profiles: Annotated[list[SideProfile], Field(description="Profiles of the wall sides in this zone.")] = []
    open: Annotated[bool | None, Field(
        description="true: from nearly all of the zone the tool can leave the part sideways, at the height of the "
                    "pass. false: walls or connections are in the way.")] = None
    region: Annotated[str | None, Field(
        description="Region of the part: a channel (H), wall (W) or connection (C), with 'over', 'under' or a piece "
                    "number; or top, floor, "
                    "free.", examples=["H1", "H1.2", "H1 over C2", "W1", "C2", "top", "floor", "free"])] = None
    merged: Annotated[list[str], Field(
        description="Regions over or under connections that are part of this zone.")] = []
    form: Annotated[Literal["level", "shallow", "steep"] | None, Field(
        description="level: a plane perpendicular to the axis. shallow: inclined by less than 45 degrees. steep: 45 "
                    "degrees and more.")] = None
    faces: list[Any] = []
    patches: Annotated[list[Patch], Field(description="The same area as trimmed faces.")] = []
    access: Annotated[str | None, Field(description="Id of the access along which the zone is cut.")] = None
    tool: Annotated[str | None, Field(description="Id of the tool that finishes the zone.")] = None
    axis: Annotated[list[float] | None, Field(description="Tool axis in the setup frame.")] = None
    approach: Annotated[ApproachCone | None, Field(
        description="Tool axes along which the tool reaches nearly all of the zone; null: the axis of the zone itself "
                    "reaches less.")] = None
    depth_mm: Annotated[list[float] | None, Field(description="Top and bottom along the axis, mm.")] = None
    cutting_plane_mm: Annotated[float | None, Field(
        description="Height along the axis, mm, below which the tool is not used.")] = None
    area_mm2: float | None = None
    strategy: Annotated[str | None, Field(
        description="Strategy that finishes the zone. In zones.json, and where no pass is planned, it is the usual one "
                    "of the form.")] = None
    rejected: Annotated[list[Rejection], Field(
        description="Tools and strategies that were considered and rejected.")] = []


class ComputableZone(ReportModel):
    """Main computable zone: the area that one tool can touch along one axis."""

    access: str
    tool: str
    area_mm2: Annotated[float, Field(description="Area that the tool touches while shank and holder stay clear.")]
    cutter_area_mm2: Annotated[float, Field(description="Area that the cutting part alone touches.")]


class CuttingPlane(ReportModel):
    """Height in a region below which a tool, or every tool of one access, does not cut."""

    access: str
    z_mm: Annotated[float, Field(description="Height along the access direction, mm.")]
    region: str
    tool: Annotated[str | None, Field(description="Id of the tool; null: every tool of the access.")] = None
    reason: Annotated[str, Field(
        description="neck: shank or holder would collide below. neck, moved above a connection. between A1 and A2: the "
                    "two accesses share the region.")]


class Place(ReportModel):
    """The part of a face that belongs to an entry, and its bounding box."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: float
    box_mm: Annotated[list[list[float]], Field(min_length=2, max_length=2,
                                               description="Lower and upper corner in the setup frame, mm.")]


class Remainder(ReportModel):
    """Area that stays uncut, the reason, and the tool or access that would cut it."""

    faces: list[Any]
    area_mm2: float
    reason: Annotated[str, Field(
        description="undercut: material of the part covers the area from every access. undercut behind connection C2: "
                    "that connection covers it. fixture: a fixture covers it or blocks the tools. pass: a tool reaches "
                    "it, but no pass cuts it. shank, holder: a cutter of the setup fits, but this body would collide. "
                    "gap, corner: only a thinner or sharper cutter fits. sharp corner: no rotating tool fits. "
                    "not_in_program: only in a verification; the program does not work on the face.")]
    would_need: Annotated[dict[str, Any], Field(
        description="The tool that would reach the area, in available sizes. It has kind, diameter_mm, "
                    "corner_radius_mm, neck_length_mm, shank_diameter_mm and stickout_mm, taper_angle_deg for a "
                    "tapered mill or barrel, and profile_radius_mm for a lens or barrel. like: the tool of the setup "
                    "with the same holder. share: share of the area that "
                    "it reaches. Or kind is 'other access', 'other clamping' or 'other process'; the last has "
                    "slenderness. access: only with several accesses. Empty if no tool is needed or none would reach "
                    "the area.")] = {}
    tool_at_hand: Annotated[str | None, Field(description="Reason pass: the tool of the setup that touches the area. "
                                                          "Reason fixture: the tool that would touch it without "
                                                          "fixtures.")] = None
    why_left: Annotated[str | None, Field(description="Reason pass: why that tool was not used.")] = None
    patches: Annotated[list[Place], Field(description="Area and bounding box for each face.")] = []


class ProposedTool(ReportModel):
    """A tool to add; lengths are from the tip."""

    kind: str
    diameter_mm: float
    corner_radius_mm: float
    taper_angle_deg: Annotated[float | None, Field(description="Angle between side and axis of a tapered mill, deg; "
                                                               "null for all other kinds.")] = None
    flute_length_mm: float
    neck_diameter_mm: float
    neck_length_mm: float
    shank_diameter_mm: float
    stickout_mm: float
    slenderness: Annotated[float, Field(
        description="Neck length over cutter diameter. The slenderness in tools of the report is over the neck "
                    "diameter.")]
    instead_of: Annotated[str | None, Field(description="Tool of the setup with the same cutter.")] = None
    like: Annotated[str | None, Field(description="Tool of the setup with the same holder.")] = None
    access: str
    area_mm2: Annotated[float, Field(
        description="Area of the remainder that zones with this tool cover, mm2. The tool is proposed for this area "
                    "only.")]
    tool: Annotated[Tool | None, Field(description="The same tool as an entry for tools of a setup.")] = None


class Proposal(ReportModel):
    """The fewest tools to add, and the area that remains with them."""

    tools: list[ProposedTool]
    emptied_mm2: Annotated[float, Field(description="Area of the remainder that the proposed tools cut, mm2.")]
    stays_mm2: Annotated[dict[str, float], Field(
        description="Area by reason, mm2. undercut, fixture, sharp corner, pass: as in remainder. slender: only a neck "
                    "longer than 20 diameters reaches it. too little: the area is too small to justify a tool.")]


class Zones(ReportModel):
    """zones.json: walls, connections, channels, zones and remainder."""

    part: PartFacts
    walls: list[WallFacts]
    connections: list[ConnectionFacts]
    channels: list[ChannelFacts]
    accesses: list[AccessFacts]
    mcz: list[ComputableZone] = []
    cutting_planes: list[CuttingPlane] = []
    machinable_area_mm2: Annotated[float | None, Field(
        description="Machinable area, mm2: the faces in operations.faces, or else those that an access sees. In "
                    "zones.json it is the sum of zones and remainder; in report.json it is the sum of proved area, "
                    "findings and remainder.")] = None
    machinable_by_role_mm2: Annotated[dict[str, float], Field(
        description="The same by the role of the faces. base: the body that carries the walls. floor: faces of it that "
                    "point up. free: any other face. Further roles: wall, connection, fillet.")] = {}
    zones: list[ZoneFacts]
    remainder: list[Remainder]
    proposal: Proposal | None = None
