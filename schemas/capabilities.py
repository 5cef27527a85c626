"""What a service can do, for clients that ask before they post."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from schemas.base import ReportModel


class Dialect(ReportModel):
    """A control programs are written for and read from."""

    name: str
    extension: Annotated[str, Field(description="Of its program files, without the dot.")]


class Limits(ReportModel):
    """What is refused beyond; null where there is no limit."""

    body_bytes: Annotated[int, Field(description="Largest request body.")]
    job_time_s: Annotated[float, Field(description="Wall time of one attempt.")]
    job_memory_bytes: int
    attempts: Annotated[int, Field(description="How often a job is started when its process is lost.")]
    submissions: Annotated[str, Field(description="Most submissions of a principal.", examples=["120/minute"])]
    queued: Annotated[int, Field(description="Most jobs that wait.")]
    queued_each: Annotated[int, Field(description="Most jobs of one principal that wait.")]
    deadline_s: Annotated[list[float], Field(min_length=2, max_length=2, description="Least and greatest.")]
    retention_days: Annotated[float | None, Field(description="Files of a job are kept so long after its end.")] = None


class Capabilities(ReportModel):
    """What this service can do."""

    version: Annotated[str, Field(description="Of the product.")]
    code: Annotated[str, Field(description="Hash over the sources that can change a result: the same content and the "
                                           "same code give the same bytes.")]
    kinds: Annotated[list[str], Field(description="Kinds of job.")]
    dialects: list[Dialect]
    stepnc: Annotated[list[str], Field(description="Forms of STEP-NC that are written and read.")]
    tools: Annotated[list[str], Field(description="Kinds of tool that are planned with and verified.")]
    machines: Annotated[list[str], Field(description="Values of machine.kind.")]
    kinematics: Annotated[list[str], Field(description="Values of machine.kinematics.")]
    stock: Annotated[list[str], Field(description="Values of stock.kind.")]
    materials: Annotated[list[str], Field(description="Built-in materials.")]
    webhooks: Annotated[bool, Field(description="Whether a form may carry webhook_url.")]
    slots: Annotated[int, Field(description="Jobs that run at a time, as of now.")]
    principal: Annotated[str, Field(description="Who you are.")]
    scopes: Annotated[list[str], Field(description="What your key opens.")]
    limits: Limits
