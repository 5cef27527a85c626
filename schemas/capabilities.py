"""Capabilities of a service, for clients that check before they post."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from schemas.base import ReportModel


class Dialect(ReportModel):
    """A control for which programs are written and read."""

    name: str
    extension: Annotated[str, Field(description="Extension of its program files, without the dot.")]


class Limits(ReportModel):
    """Limits of the service; null where there is none."""

    body_bytes: Annotated[int, Field(description="Largest request body, bytes.")]
    job_time_s: Annotated[float, Field(description="Time limit of one attempt, s.")]
    job_memory_bytes: Annotated[int, Field(description="Largest memory of one job, bytes.")]
    attempts: Annotated[int, Field(description="Largest number of starts of a job whose process is lost.")]
    submissions: Annotated[str, Field(description="Largest number of submissions of one principal in a period.",
                                      examples=["120/minute"])]
    queued: Annotated[int, Field(description="Largest number of waiting jobs.")]
    queued_each: Annotated[int, Field(description="Largest number of waiting jobs of one principal.")]
    deadline_s: Annotated[list[float], Field(
        min_length=2, max_length=2, description="Smallest and largest value of deadline_s.")]
    retention_days: Annotated[float | None, Field(description="Days that the files of a job are "
                                                              "kept after its end.")] = None


class Capabilities(ReportModel):
    """Capabilities of this service."""

    version: Annotated[str, Field(description="Version of zonemill.")]
    code: Annotated[str, Field(description="Hash of the sources that can change a result. The same content and the "
                                           "same code give the same bytes.")]
    kinds: Annotated[list[str], Field(description="Kinds of job.")]
    dialects: list[Dialect]
    stepnc: Annotated[list[str], Field(description="Forms of STEP-NC that the service writes and reads.")]
    tools: Annotated[list[str], Field(description="Kinds of tool that the service plans and verifies.")]
    machines: Annotated[list[str], Field(description="Values of machine.kind.")]
    kinematics: Annotated[list[str], Field(description="Values of machine.kinematics.")]
    stock: Annotated[list[str], Field(description="Values of stock.kind.")]
    materials: Annotated[list[str], Field(description="Built-in materials.")]
    webhooks: Annotated[bool, Field(description="Whether a submission may contain webhook_url.")]
    slots: Annotated[int, Field(description="Number of jobs that can run at the same time, at present.")]
    principal: Annotated[str, Field(description="Principal of the API key: the owner of its jobs and library entries.")]
    scopes: Annotated[list[str], Field(description="Scopes of the API key.")]
    limits: Limits
