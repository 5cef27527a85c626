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
                                                  "could be planned, a second one where stock of another zone was in "
                                                  "the way of the first.")] = []
    scallop_mm: ScallopFacts | None = None
    gouge_mm: float | None = None
    coverage: Share | None = None


class ToolUse(ReportModel):
    """How a tool is used by the plan."""

    id: str
    minutes_in_cut: float | None = None
    slenderness: float | None = None
    deflection_mm: float | None = None


class ReportFile(ReportModel):
    """One file of the plan."""

    name: str
    kind: str
    access: str | None = None
    dialect: str | None = None
    sha256: str


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
    tools: list[ToolUse]
    files: list[ReportFile]
    version: str


class Verification(ReportModel):
    """The proof of a program, also a foreign one."""

    state: Literal["proved", "unproved"]
    findings: list[Any]
