"""report.json: the plan and its proof."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel
from schemas.zones import Share, ZoneFacts, Zones


class Inputs(ReportModel):
    """Hashes of what went in."""

    part_sha256: str
    setup_sha256: str
    stock_sha256: Annotated[str | None, Field(description="Of the file of a step blank.")] = None


class ScallopFacts(ReportModel):
    """Residual material over a zone, mm along the normal."""

    requested: float
    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class PlannedZone(ZoneFacts):
    """A zone with the figures of its passes and of the proof."""

    passes: Annotated[int | None, Field(description="Cutting passes of the finishing strategy between links.")] = None
    cutting_length_mm: Annotated[float | None, Field(description="Of all its workingsteps.")] = None
    machining_time_s: Annotated[float | None, Field(description="Of all its workingsteps.")] = None
    step: Annotated[str | None, Field(description="The first of `steps`.")] = None
    steps: Annotated[list[str], Field(description="Its finishing workingsteps in machining order: none where nothing "
                                                  "could be planned, a further one where stock of another zone was in "
                                                  "the way of the first, and one a band of depth where thin walls are "
                                                  "cut in turn.")] = []
    scallop_mm: ScallopFacts | None = None
    gouge_mm: float | None = None
    coverage: Share | None = None


class Engaged(ReportModel):
    """How much of the front half of a cutter is in stock, deg: at most, and on 99 % of its way in stock."""

    max: float | None = None
    p99: float | None = None


class ToolUse(ReportModel):
    """How a tool is used by the plan."""

    id: str
    minutes_in_cut: Annotated[float | None, Field(description="Of moves that take stock, as simulated.")] = None
    metres_in_cut: Annotated[float | None, Field(description="Of its cutting passes, as planned.")] = None
    life_min: float | None = None
    cutters: Annotated[int | None, Field(description="How many of them the program asks for.")] = None
    slenderness: Annotated[float | None, Field(description="Neck length over neck diameter, of a tool without a neck "
                                                           "stickout over diameter.")] = None
    deflection_mm: Annotated[float | None, Field(
        description="Of the tip, the most of its steps, at their feeds, as estimated; null: it has none, or the "
                    "material has no specific cutting force.")] = None
    engagement_deg: Engaged | None = None


class LeftOver(ReportModel):
    """Stock left over the allowance at the samples of a face, mm along the normal; cut deeper counts 0."""

    p50: float | None = None
    p99: float | None = None
    max: float | None = None


class FaceDeviation(ReportModel):
    """What the proof measured on one face, over the samples that were to be judged."""

    face: Annotated[str, Field(examples=["F12"])]
    area_mm2: Annotated[float, Field(description="Judged area of the face.")]
    residual_mm: LeftOver
    gouge_mm: Annotated[float, Field(description="Deepest cut into the part at a sample of the face.")]
    uncut_mm2: Annotated[float, Field(description="Area no feed move ever reached that stands higher than the budget "
                                                  "allows.")]
    coverage: Annotated[Share, Field(description="Area within the budget / judged area.")]


class MachinedPart(ReportModel):
    """machined.stl: the stock as all programs leave it, in the coordinates of the program."""

    file: str
    access: Annotated[str, Field(description="Access direction whose coordinates the mesh has, of several the first; "
                                             "on a 5-axis machine they are those of the setup frame.")]
    volume_mm3: Annotated[float, Field(description="What stands, in the window where one was asked for.")]
    step_mm: Annotated[float, Field(description="Distance of the nodes; wider than asked for where that would take "
                                                "over 24 million.")]
    error_mm: Annotated[float, Field(description="No corner of the mesh is farther from what the tools leave. What is "
                                                 "thinner may be missing.")]
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
    """Where the machining time goes, as simulated."""

    in_cut_s: Annotated[float, Field(description="Of moves that take stock.")]
    in_air_s: Annotated[float, Field(description="The rest: rapids, ways in, across and out, dwells.")]
    rapid_s: Annotated[float, Field(description="Of rapids, part of in_air_s.")]
    retracts: Annotated[int, Field(description="Times a rapid follows on a feed move.")]
    tool_changes: Annotated[int, Field(description="Within programs.")]


class Caution(ReportModel):
    """What a machinist is to be told although it is no finding."""

    kind: Annotated[str, Field(description="limited: the setup asks a tool for more than it or the machine allows. "
                                           "dry: it cuts without coolant at figures for it. "
                                           "deflection: a tool bends too far at its full feed. thin_wall: a wall "
                                           "is high for its thickness; measured is height over thickness. support: "
                                           "thin walls are finished without stock beside them near by; measured is how "
                                           "far they are free, in times their thickness. tool_life: a "
                                           "tool takes more than one cutter, or more than one for a run. "
                                           "center_cutting: a tool that does not cut to its centre goes down into "
                                           "stock. upright: a tool is asked to lean on a zone and does not, or not for "
                                           "half of what it cuts there; measured is how much is cut upright, mm.")]
    subjects: Annotated[list[str], Field(description="Ids of tools, steps, walls.")]
    message: str
    measured: Annotated[float | None, Field(description="In the unit the message says, as limit.")] = None
    limit: float | None = None
    remedy: str
    at_mm: Annotated[list[float] | None, Field(description="Where, setup frame.")] = None


class Report(Zones):
    """report.json."""

    state: Literal["proved", "unproved"]
    complete: Annotated[bool, Field(description="The remainder is empty.")]
    labels: dict[str, str] = {}
    inputs: Inputs
    zones: list[PlannedZone]  # type: ignore[assignment]
    steps: list[Any]
    findings: Annotated[list[Any], Field(description="What the proof found; empty in a proved job.")]
    coverage: Annotated[Share | None, Field(description="Area proved within the budget / machinable area.")] = None
    reach_coverage: Annotated[Share | None, Field(description="The same / the area some tool can reach.")] = None
    machining_time_s: float | None = None
    time: TimeSpent | None = None
    warnings: Annotated[list[Caution], Field(description="Also as sentences in part.warnings.")] = []
    tools: list[ToolUse]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures by face, by face number, as all programs "
                                                                "leave it.")] = []
    machined: Annotated[MachinedPart | None, Field(description="The machined part, where it was asked for.")] = None
    files: list[ReportFile]
    version: str


class Verification(ReportModel):
    """The proof of a program, also a foreign one."""

    state: Literal["proved", "unproved"]
    findings: list[Any]
    deviation: Annotated[list[FaceDeviation], Field(description="Figures by face, by face number.")] = []
    machined: Annotated[MachinedPart | None, Field(description="The machined part, where it was asked for.")] = None
    files: list[ReportFile] = []
