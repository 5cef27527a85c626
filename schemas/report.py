"""report.json: the plan and its proof."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.zones import Remainder, Share, ZoneFacts, Zones

Findings = Annotated[list[Any], Field(
    description="Findings of the proof, then those of the whole job; empty in state proved. kind: collision, gouge, "
                "rapid, plunge, rubbing, engagement, support, limit, program, residual or stock_left; of the whole "
                "job: nothing_cut or coverage. stock_left: only in a verification; it has height (mm, the same as "
                "depth) and lines (those that left the stock) as well. message: the finding in one sentence. program, "
                "line: place in the programs; "
                "line 0: no line causes it. zone, face: ids, or null. point: worst place, mm, setup frame, or null. "
                "tip: the tool tip there, or null. depth, limit: measured and allowed value, in the unit of message. "
                "near: true where nothing touches; depth is then the distance. count, area: number and area, mm2, of "
                "the merged places.")]


class Inputs(ReportModel):
    """Hashes of the inputs."""

    part_sha256: str
    setup_sha256: str
    stock_sha256: Annotated[str | None, Field(description="Hash of the STEP file of the blank.")] = None


class ScallopFacts(ReportModel):
    """Residual height over a zone, mm along the normal. p99: value that 99 % of the samples do not exceed."""

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
    step: Annotated[str | None, Field(description="First entry of steps; null where there is none.")] = None
    steps: Annotated[list[str], Field(
        description="Its finishing workingsteps in machining order. Empty where none could be planned. A zone has a "
                    "second step where stock of another zone blocked the first. Thin walls that are finished in "
                    "alternating bands of depth have one step for each band.")] = []
    scallop_mm: ScallopFacts | None = None
    gouge_mm: float | None = None
    coverage: Share | None = None


class Engaged(ReportModel):
    """Engagement of the front half of a cutter in stock, deg.

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
    life_min: float | None = None
    cutters: Annotated[int | None, Field(description="Number of cutters that the program requests.")] = None
    slenderness: Annotated[float | None, Field(description="Neck length over neck diameter; without a neck, stickout "
                                                           "over diameter.")] = None
    deflection_mm: Annotated[float | None, Field(
        description="Largest estimated deflection of the tip in any step of this tool, mm. null: no force is given for "
                    "the material, or the tool has no step.")] = None
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
    access: Annotated[str, Field(description="The mesh is in the coordinates of this access (the first, where there "
                                             "are several). On a 5-axis machine it is in the setup frame.")]
    volume_mm3: Annotated[float, Field(description="Volume of the remaining stock, mm3, inside the window where one "
                                                   "was requested.")]
    step_mm: Annotated[float, Field(description="Distance between mesh nodes, mm. It is wider than requested where "
                                                "that would need more than 24 million nodes.")]
    error_mm: Annotated[float, Field(description="Largest distance between the mesh and the machined surface, mm. "
                                                 "Details thinner than this may be missing.")]
    box_mm: Annotated[list[list[float]], Field(description="Lower and upper corner of the mesh.")]
    triangles: int


class ReportFile(ReportModel):
    """One file of the plan."""

    name: str
    kind: str
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


class Caution(ReportModel):
    """A warning for the machinist that is not a finding."""

    kind: Annotated[str, Field(description="limited: the setup requires more than the tool or the machine allows. dry: "
                                           "a tool cuts without coolant, with cutting data that assume coolant. "
                                           "deflection: a tool bends too far at its full feed. thin_wall: a wall is "
                                           "high for its thickness; measured is height over thickness. support: thin "
                                           "walls are finished without stock beside them; measured is the free height "
                                           "in multiples of the thickness. tool_life: a tool needs more than one "
                                           "cutter, or one step outlasts a cutter. center_cutting: a tool that does "
                                           "not cut to its centre plunges into stock. upright: a tool should be tilted "
                                           "on a zone and is not, or not for half of the cut; measured is the length "
                                           "cut upright, mm.")]
    subjects: Annotated[list[str], Field(description="Ids of tools, steps or walls.")]
    message: str
    measured: Annotated[float | None, Field(description="Measured value, in the unit named in message. limit has the "
                                                             "same unit.")] = None
    limit: float | None = None
    remedy: str
    at_mm: Annotated[list[float] | None, Field(description="Place, setup frame, mm.")] = None


class Report(Zones):
    """report.json: the plan and its proof."""

    state: Literal["proved", "unproved"]
    complete: Annotated[bool, Field(description="True where the remainder is empty.")]
    labels: dict[str, str] = {}
    inputs: Inputs
    zones: list[PlannedZone]  # type: ignore[assignment]
    steps: list[Any]
    findings: Findings
    coverage: Annotated[Share | None, Field(description="Proved area divided by machinable area.")] = None
    reach_coverage: Annotated[Share | None, Field(
        description="Proved area divided by the machinable area that some tool of the setup reaches.")] = None
    machining_time_s: float | None = None
    time: TimeSpent | None = None
    warnings: Annotated[list[Caution], Field(description="Warnings. part.warnings has the same as sentences.")] = []
    tools: list[ToolUse]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures after all programs, by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(
        description="The machined part, where the setup or the request wants it.")] = None
    files: list[ReportFile]
    version: str


class AskedFaces(ReportModel):
    """The faces that have to be within tolerance wherever the tools of the program can touch them."""

    by: Annotated[Literal["setup", "program", "nothing"], Field(
        description="setup: operations.faces names them. program: the program works on them; it removes stock along "
                    "their normals on a fifth of their area or more. nothing: operations.finishing is false.")]
    faces: Annotated[list[str], Field(examples=[["F3", "F12"]])]


class Verification(ReportModel):
    """Proof of a program, which may come from another CAM system."""

    state: Annotated[Literal["proved", "clean", "unproved"], Field(
        description="proved: no finding. clean: the program does no harm, but work is left undone; all findings are "
                    "stock_left or nothing_cut. unproved: any other finding.")]
    findings: Findings
    asked: AskedFaces | None = None
    remainder: Annotated[list[Remainder], Field(
        description="Area that is neither within tolerance nor a finding, one entry for each reason: what the tools of "
                    "the program cannot touch (undercut, fixture, shank, holder, corner, sharp corner), faces that the "
                    "program does not work on (not_in_program), and places within the error of the proof (pass).")] = []
    deviation: Annotated[list[FaceDeviation], Field(description="Figures by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(description="The machined part, where the request wants it.")] = None
    files: list[ReportFile] = []
