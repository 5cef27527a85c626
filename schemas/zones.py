"""zones.json: what the decomposition of a part found."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from schemas.base import ReportModel

Share = Annotated[float, Field(ge=0, le=1)]


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


class Rejection(ReportModel):
    """A strategy or tool that was considered and not taken."""

    reason: str
    strategy: str | None = None
    tool: str | None = None
    value: Any = None
    limit: Any = None


class ZoneFacts(ReportModel):
    """A machinable zone with its tool, axis and depth; the figures of passes and proof stand only in a report."""

    id: Annotated[str, Field(examples=["Z3"])]
    kind: Annotated[Literal["SCZ", "SCZI"] | None, Field(description="Single-channel zone, without or with a "
                                                                    "connection.")] = None
    profile: str | None = None
    level: int | None = None
    open: bool | None = None
    faces: list[Any] = []
    access: str | None = None
    tool: str | None = None
    axis: list[float] | None = None
    depth_mm: Annotated[list[float] | None, Field(description="Top and bottom, mm.")] = None
    strategy: str | None = None
    rejected: list[Rejection] = []


class Remainder(ReportModel):
    """Area that the setup cannot reach, why, and what would."""

    faces: list[Any]
    area_mm2: float
    reason: str
    would_need: dict[str, Any] = {}


class Zones(ReportModel):
    """zones.json."""

    part: PartFacts
    walls: list[WallFacts]
    connections: list[ConnectionFacts]
    channels: list[ChannelFacts]
    zones: list[ZoneFacts]
    remainder: list[Remainder]
