"""Errors on the wire: application/problem+json (RFC 9457)."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from schemas.base import ReportModel

PROBLEM_MEDIA_TYPE = "application/problem+json"


class Problem(ReportModel):
    """A problem document; the members after ``instance`` are this service's extensions."""

    type: Annotated[str, Field(description="Stable URI: urn:zonemill:problem:<class>:<code>.",
                               examples=["urn:zonemill:problem:bad-setup:bad_setup"])]
    title: Annotated[str, Field(description="Short name of the class of problem.", examples=["The setup is wrong"])]
    status: Annotated[int, Field(ge=400, le=599, description="HTTP status.")]
    detail: Annotated[str, Field(description="The problem in one sentence.")]
    instance: Annotated[str | None, Field(description="Path of the request or of the job.")] = None
    code: Annotated[str, Field(description="Last part of the type.", examples=["bad_setup"])]
    subjects: Annotated[list[str], Field(description="Ids or places concerned, such as F12, T3 or "
                                                     "tools[0].diameter_mm.")] = []
    measured: Annotated[Any, Field(description="Value that was found.")] = None
    limit: Annotated[Any, Field(description="Value or values that are allowed.")] = None
    remedy: Annotated[str, Field(description="How to solve the problem.")] = ""
    request_id: Annotated[str | None, Field(description="Id of the request, the same as in the log.")] = None
