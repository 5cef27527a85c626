"""report.json: the plan and its proof."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.estimate import JobEstimate
from schemas.zones import Remainder, Share, ZoneFacts, Zones

Findings = Annotated[list[Any], Field(
    description="Findings of the proof, then those of the whole job; empty in state proved. kind: collision, gouge, "
                "allowance, excluded_face, rapid, plunge, load, rubbing, engagement, support, limit, program, "
                "residual or stock_left; of the whole job: nothing_cut, load or coverage. message: the finding in one "
                "sentence. program, line: place in the programs; line 0: no line causes it. zone, face: ids, or null. "
                "point: worst place, mm, setup frame, or null. tip: the tool tip there, or null. depth, limit: "
                "measured and allowed value, in the unit of message. near: true: nothing touches, and depth is the "
                "distance. count, area: number and area, mm2, of the merged places. A stock_left, only in a "
                "verification, also has height (mm, the same as depth) and lines (those that left the stock).")]


class Inputs(ReportModel):
    """Hashes of the inputs."""

    part_sha256: str
    setup_sha256: str
    stock_sha256: Annotated[str | None, Field(description="Hash of the STEP file of the blank.")] = None


class ScallopFacts(ReportModel):
    """Stock left above the allowance at the samples of a zone, mm along the normal.

    requested: quality.scallop_height_mm. p99: value that 99 % of the samples do not exceed.
    """

    requested: float
    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class PlannedZone(ZoneFacts):
    """A zone with the figures of its passes and of the proof."""

    passes: Annotated[int | None, Field(
        description="Number of cutting passes of the finish; a pass ends where a link begins.")] = None
    cutting_length_mm: Annotated[float | None, Field(description="Cutting length of all its workingsteps, mm.")] = None
    machining_time_s: Annotated[float | None, Field(description="Machining time of all its workingsteps, s.")] = None
    step: Annotated[str | None, Field(description="The first entry of steps; null: none.")] = None
    steps: Annotated[list[str], Field(
        description="Ids of its finishing workingsteps in machining order. Empty if none could be planned. A zone has "
                    "a second workingstep if stock of another zone blocked the first. Thin walls that are finished in "
                    "alternating bands of depth have one workingstep for each band.")] = []
    scallop_mm: Annotated[ScallopFacts | None, Field(
        description="Stock left over the allowance, at the samples of the zone.")] = None
    gouge_mm: Annotated[float | None, Field(
        description="Deepest cut into the part at a sample of the zone, mm.")] = None
    coverage: Annotated[Share | None, Field(
        description="Area within tolerance divided by the area of the zone.")] = None


class Engaged(ReportModel):
    """Engaged angle: how much of the front half of the cutter is in stock, deg.

    max: largest value. p99: value that 99 % of the path in stock does not exceed.
    """

    max: float | None = None
    p99: float | None = None


class ToolUse(ReportModel):
    """Use of a tool in the plan."""

    id: str
    minutes_in_cut: Annotated[float | None, Field(description="Minutes of moves that remove "
                                                              "stock, as simulated.")] = None
    metres_in_cut: Annotated[float | None, Field(description="Metres of its cutting passes, as planned.")] = None
    life_min: Annotated[float | None, Field(description="Tool life of the setup, minutes.")] = None
    cutters: Annotated[int | None, Field(
        description="Number of cutters that the plan uses: one, and one more for each stop for a fresh cutter. 0: the "
                    "tool has no workingstep.")] = None
    slenderness: Annotated[float | None, Field(
        description="Neck length over neck diameter; without a neck, stickout over diameter.")] = None
    deflection_mm: Annotated[float | None, Field(
        description="Largest estimated deflection of the tip in any workingstep of this tool, mm. null: the material "
                    "has no cutting force, or the tool has no workingstep.")] = None
    engagement_deg: Engaged | None = None


class LeftOver(ReportModel):
    """Stock left above the allowance at the samples of a face, mm along the normal. A deeper cut counts as 0."""

    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class FaceDeviation(ReportModel):
    """Measurements of the proof on one face, at the scored samples: those that coverage counts."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: Annotated[float, Field(description="Scored area of the face, mm2.")]
    residual_mm: LeftOver
    gouge_mm: Annotated[float, Field(description="Deepest cut into the part at a sample of the face, mm.")]
    uncut_mm2: Annotated[float, Field(description="Area, mm2, that no feed move reached and where too much stock is "
                                                  "left.")]
    coverage: Annotated[Share, Field(description="Area within tolerance divided by scored area.")]


class MachinedPart(ReportModel):
    """machined.stl: the stock after all programs, in the coordinates of the program."""

    file: str
    access: Annotated[str, Field(
        description="Access in whose coordinates the mesh is: the first of several. On a 5-axis machine the mesh is in "
                    "the setup frame.")]
    volume_mm3: Annotated[float, Field(description="Volume of the remaining stock, mm3, inside the window where one "
                                                   "was requested.")]
    step_mm: Annotated[float, Field(
        description="Distance between mesh nodes, mm. It is larger than requested if the mesh would need more than 24 "
                    "million nodes.")]
    error_mm: Annotated[float, Field(description="Largest distance between the mesh and the machined surface, mm. "
                                                 "Details thinner than this may be missing.")]
    box_mm: Annotated[list[list[float]], Field(description="Lower and upper corner of the mesh.")]
    triangles: int


class ReportFile(ReportModel):
    """One file of the plan."""

    name: str
    kind: Annotated[str, Field(
        description="program, stepnc (AP238), stepnc-arm (ISO 14649), zones, preview, deviation, machined, sheet or "
                    "view.")]
    access: str | None = None
    dialect: str | None = None
    sha256: str


class TimeSpent(ReportModel):
    """The simulated machining time by kind of move, with counts of retracts and tool changes."""

    in_cut_s: Annotated[float, Field(description="Moves that remove stock, s.")]
    in_air_s: Annotated[float, Field(description="All other moves, s: rapids, approaches, links, retracts, dwells.")]
    rapid_s: Annotated[float, Field(description="Rapids, s; part of in_air_s.")]
    retracts: Annotated[int, Field(description="How often a rapid follows a feed move.")]
    tool_changes: Annotated[int, Field(description="Number of tool changes within programs.")]
    link_feed_mm_min: Annotated[float | None, Field(
        description="Feed of links in air between the passes of a planned program, mm/min. null: a verified program, "
                    "which does not say which of its moves are links.")] = None


class Assumption(ReportModel):
    """Something that the proof takes for granted because neither setup nor program states it. It is no finding."""

    what: Annotated[str, Field(
        description="dialect, travel, max_rpm, rotary_sense, rotary_start, rotary_way, axis_way, modes_left, "
                    "tip_control, length_axis, length_register, radius_register, tap_diameter, gauge_length, "
                    "flute_length, holder, above_holder, table, loose_stock, other_solids, rapid_path, path_mode, "
                    "change_position, coolant, cutting_force or between_samples.",
        examples=["travel"])]
    value: Annotated[str | float, Field(description="What the proof takes it to be.", examples=["long enough"])]
    effect: Annotated[str, Field(description="What may go wrong on a machine where it is otherwise.")]
    remedy: Annotated[str, Field(description="The field of the setup, or the words of the program, that state it.")]


class ProofFacts(ReportModel):
    """Figures of the proof and what it takes for granted."""

    notes: list[str] = []
    assumed: Annotated[list[Assumption], Field(
        description="What the proof takes for granted, each once. Check it against the machine. A program header and "
                    "the setup sheet name the same.")] = []


class Caution(ReportModel):
    """A warning for the machinist that is not a finding."""

    kind: Annotated[str, Field(
        description="limited: a speed or feed of the setup is above a limit of tool or machine. dry: a tool cuts "
                    "without coolant, but its cutting data assume coolant. deflection: a tool would bend too far at "
                    "its full feed. thin_wall: a wall is high for its thickness; measured is height over thickness. "
                    "support: thin walls are finished without support; measured is the free height in multiples of the "
                    "thickness. tool_life: a tool needs more than one cutter, or one workingstep outlasts a cutter. "
                    "center_cutting: a tool that does not cut to its centre ramps into stock. upright: a zone should "
                    "be cut with a tilted tool, but the tool is upright along more than half of the cut, or all of it. "
                    "Then measured is the length cut upright, mm. Of a verification: tool_data: the program exceeds "
                    "spindle speed, feed, plunge feed or life of the tool. chip_load, cutting_speed, plunge_feed: it "
                    "exceeds what the material recommends. depth_of_cut: depth times width of a cut, mm2. deflection: "
                    "mm that the tip would bend. power: kW that a cut needs. dwell: turns that a tool stands in "
                    "its cut. coolant: a tool that is to be cooled cuts dry.")]
    subjects: Annotated[list[str], Field(description="Ids of tools, workingsteps, zones or walls.")]
    message: str
    measured: Annotated[float | None, Field(description="Measured value, in the unit named in message. limit has the "
                                                             "same unit.")] = None
    limit: Annotated[float | None, Field(description="Allowed value; null: there is none.")] = None
    remedy: str
    at_mm: Annotated[list[float] | None, Field(description="Place, setup frame, mm.")] = None


class Report(Zones):
    """report.json: the plan and its proof."""

    state: Literal["proved", "unproved"]
    complete: Annotated[bool, Field(description="true: the remainder is empty.")]
    labels: dict[str, str] = {}
    inputs: Inputs
    estimate: Annotated[JobEstimate | None, Field(
        description="What the job was expected to take, before it was planned. Reports of older releases have "
                    "none.")] = None
    zones: list[PlannedZone]  # type: ignore[assignment]
    steps: Annotated[list[Any], Field(description="The workingsteps in machining order.")]
    findings: Findings
    coverage: Annotated[Share | None, Field(description="Proved area divided by machinable area.")] = None
    reach_coverage: Annotated[Share | None, Field(
        description="Proved area divided by the machinable area that some tool of the setup reaches.")] = None
    machining_time_s: Annotated[float | None, Field(description="Simulated machining time, s.")] = None
    time: TimeSpent | None = None
    proof: ProofFacts | None = None
    warnings: Annotated[list[Caution], Field(
        description="Warnings. part.warnings has the same as plain sentences.")] = []
    tools: list[ToolUse]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures after all programs, by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(
        description="The machined part. Only on the command line, with --mesh-step; null over HTTP.")] = None
    files: list[ReportFile]
    version: str


class AskedFaces(ReportModel):
    """The faces that have to be within tolerance wherever the tools of the program can touch them."""

    by: Annotated[Literal["setup", "program", "nothing"], Field(
        description="setup: operations.faces names them. program: the program works on them: it removes stock along "
                    "the normals of a fifth of their area or more. If no face has that much, they are all faces from "
                    "which it removes stock. nothing: operations.finishing is false.")]
    faces: Annotated[list[str], Field(examples=[["F3", "F12"]])]


class Verification(ReportModel):
    """Proof of a program, which may come from another CAM system."""

    state: Annotated[Literal["proved", "clean", "unproved"], Field(
        description="proved: no finding. clean: the program does no harm, but work is left undone; all findings are "
                    "stock_left or nothing_cut. unproved: any other finding.")]
    findings: Findings
    asked: Annotated[AskedFaces | None, Field(
        description="The asked faces: too much stock on them is a finding.")] = None
    remainder: Annotated[list[Remainder], Field(
        description="Area that is neither within tolerance nor a finding, one entry for each reason. undercut, "
                    "fixture, shank, holder, corner, sharp corner: the tools of the program cannot touch it. "
                    "not_in_program: the program does not work on the face. pass: places within the error of the "
                    "proof.")] = []
    proof: ProofFacts | None = None
    estimate: Annotated[JobEstimate | None, Field(
        description="What the verification was expected to take. Reports of older releases have none.")] = None
    warnings: Annotated[list[Caution], Field(
        description="Warnings: the program exceeds what tools and material recommend. They change no state.")] = []
    deviation: Annotated[list[FaceDeviation], Field(description="Figures by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(
        description="The machined part. Only on the command line, with --out; null over HTTP.")] = None
    files: list[ReportFile] = []
