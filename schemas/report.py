"""report.json: the plan and its proof."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.zones import Share, ZoneFacts, Zones


class Inputs(ReportModel):
    """Hashes of the inputs."""

    part_sha256: str
    setup_sha256: str
    stock_sha256: Annotated[str | None, Field(description="Of the file of a blank with kind step.")] = None


class ScallopFacts(ReportModel):
    """Residual height over a zone, mm along the normal."""

    requested: float
    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class PlannedZone(ZoneFacts):
    """A zone with the figures of its passes and of the proof."""

    passes: Annotated[int | None, Field(description="Number of cutting passes of the "
                                                    "finishing strategy between links.")] = None
    cutting_length_mm: Annotated[float | None, Field(description="Of all its workingsteps, mm.")] = None
    machining_time_s: Annotated[float | None, Field(description="Of all its workingsteps, s.")] = None
    step: Annotated[str | None, Field(description="The first of `steps`.")] = None
    steps: Annotated[list[str], Field(description="Its finishing workingsteps in machining order. Empty where none "
                                                  "could be planned. A further step follows where stock of another "
                                                  "zone was in the way of the first. Thin walls that are cut in turn "
                                                  "have one step for each band of depth.")] = []
    scallop_mm: ScallopFacts | None = None
    gouge_mm: float | None = None
    coverage: Share | None = None


class Engaged(ReportModel):
    """Engagement of the front half of a cutter in stock, deg.

    It has the largest value, and the value that 99 % of the path in stock does not exceed.
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
        description="Largest estimated deflection of the tip over its steps, mm, at their feeds. null: no force is "
                    "given for the material, or the tool has no step.")] = None
    engagement_deg: Engaged | None = None


class LeftOver(ReportModel):
    """Stock left above the allowance at the samples of a face, mm along the normal. A deeper cut counts as 0."""

    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class FaceDeviation(ReportModel):
    """Measurements of the proof on one face, over the judged samples."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: Annotated[float, Field(description="Judged area of the face, mm2.")]
    residual_mm: LeftOver
    gouge_mm: Annotated[float, Field(description="Deepest cut into the part at a sample of the face, mm.")]
    uncut_mm2: Annotated[float, Field(description="Area, mm2, that no feed move reached and that is higher than the "
                                                  "budget allows.")]
    coverage: Annotated[Share, Field(description="Area within the budget / judged area.")]


class MachinedPart(ReportModel):
    """machined.stl: the stock after all programs, in the coordinates of the program."""

    file: str
    access: Annotated[str, Field(description="Access whose coordinates the mesh has; the first where there are "
                                             "several. On a 5-axis machine the coordinates are those of the setup "
                                             "frame.")]
    volume_mm3: Annotated[float, Field(description="Volume of the remaining stock, mm3, inside the window where one "
                                                   "was requested.")]
    step_mm: Annotated[float, Field(description="Distance of the nodes, mm. It is wider than requested where that "
                                                "would need more than 24 million nodes.")]
    error_mm: Annotated[float, Field(description="Largest distance between the mesh and the machined surface, mm. "
                                                 "Thinner parts may be missing.")]
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
    """Shares of the machining time, as simulated."""

    in_cut_s: Annotated[float, Field(description="Moves that remove stock, s.")]
    in_air_s: Annotated[float, Field(description="All other moves, s: rapids, approaches, links, retracts, dwells.")]
    rapid_s: Annotated[float, Field(description="Rapids, s; part of in_air_s.")]
    retracts: Annotated[int, Field(description="How often a rapid follows a feed move.")]
    tool_changes: Annotated[int, Field(description="Within programs.")]


class Caution(ReportModel):
    """A warning for the machinist that is not a finding."""

    kind: Annotated[str, Field(description="limited: the setup requires more than the tool or the machine allows. dry: "
                                           "a tool cuts without coolant at cutting data for coolant. deflection: a "
                                           "tool bends too far at its full feed. thin_wall: a wall is high for its "
                                           "thickness; measured is height over thickness. support: thin walls are "
                                           "finished without stock beside them; measured is the free height in "
                                           "multiples of the thickness. tool_life: a tool needs more than one cutter, "
                                           "or one step outlasts a cutter. center_cutting: a tool that does not cut to "
                                           "its centre plunges into stock. upright: a tool should be tilted on a zone "
                                           "and is not, or not for half of the cut; measured is the length cut "
                                           "upright, mm.")]
    subjects: Annotated[list[str], Field(description="Ids of tools, steps or walls.")]
    message: str
    measured: Annotated[float | None, Field(description="In the unit of the message, like limit.")] = None
    limit: float | None = None
    remedy: str
    at_mm: Annotated[list[float] | None, Field(description="Place, setup frame, mm.")] = None


class Report(Zones):
    """report.json."""

    state: Literal["proved", "unproved"]
    complete: Annotated[bool, Field(description="True where the remainder is empty.")]
    labels: dict[str, str] = {}
    inputs: Inputs
    zones: list[PlannedZone]  # type: ignore[assignment]
    steps: list[Any]
    findings: Annotated[list[Any], Field(description="Findings of the proof; empty in a proved job.")]
    coverage: Annotated[Share | None, Field(description="Area proved within the budget / machinable area.")] = None
    reach_coverage: Annotated[Share | None, Field(description="The same area / area that some tool can reach.")] = None
    machining_time_s: float | None = None
    time: TimeSpent | None = None
    warnings: Annotated[list[Caution], Field(description="The same as sentences: part.warnings.")] = []
    tools: list[ToolUse]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures after all programs, by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(
        description="The machined part, where the setup or the request wants it.")] = None
    files: list[ReportFile]
    version: str


class Verification(ReportModel):
    """Proof of a program, which may come from another CAM system."""

    state: Literal["proved", "unproved"]
    findings: list[Any]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(description="The machined part, where the request wants it.")] = None
    files: list[ReportFile] = []
