"""The estimate of a job on the wire."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from schemas.base import ReportModel


class EstimateShare(ReportModel):
    """A share of an estimate."""

    what: Annotated[str, Field(description="What takes it, in words.", examples=["samples of the proof"])]
    count: Annotated[int, Field(ge=0, description="Number of items.")]
    memory_mb: Annotated[int, Field(ge=0, description="Memory of these items, MB.")]
    seconds: Annotated[float, Field(ge=0, description="Processor time of these items, s.")]


class JobEstimate(ReportModel):
    """Memory and time that a job is expected to take. It follows from part and setup alone, before anything is planned.
    """

    memory_mb: Annotated[int, Field(ge=0, description="Largest resident memory of all processes of the job, MB.")]
    seconds: Annotated[float, Field(ge=0, description="Processor time of all processes of the job, s. The time by the "
                                                      "clock is shorter if several cores are free, and longer if "
                                                      "other programs use them.")]
    basis: Annotated[list[EstimateShare], Field(description="The shares whose sum this is.")]
