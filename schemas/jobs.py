"""Jobs, their files and pages of jobs in the HTTP interface."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from schemas.base import ReportModel
from schemas.estimate import JobEstimate
from schemas.machine import Machine
from schemas.materials import Material
from schemas.problem import Problem
from schemas.tools import Tool

JobKind = Literal["plan", "zones", "verify"]
JobState = Literal["queued", "running", "proved", "clean", "unproved", "done", "failed", "cancelled"]
FINAL_STATES = ("proved", "clean", "unproved", "done", "failed", "cancelled")


class JobLinks(ReportModel):
    """Paths of the resources of a job; null where this kind of job has no such resource."""

    self: str
    events: str
    zones: str | None = None
    report: str | None = None
    files: str | None = None
    view: Annotated[str | None, Field(description="Web page of the job.")] = None


class JobSummary(ReportModel):
    """Figures of the report, enough for a release gate."""

    complete: Annotated[bool | None, Field(description="true: the remainder is empty. null for a verification.")] = None
    coverage: Annotated[float | None, Field(description="Proved area divided by machinable area.")] = None
    reach_coverage: Annotated[float | None, Field(
        description="Proved area divided by the machinable area that some tool of the setup reaches.")] = None
    findings: Annotated[int, Field(ge=0, description="Number of findings of the proof.")] = 0
    machining_time_s: Annotated[float | None, Field(description="Simulated machining time, s.")] = None


class JobLibraryEntry(ReportModel):
    """Version of a library entry that a job used."""

    shelf: Annotated[Literal["tools", "machines", "materials"], Field(
        description="Library from which the entry comes.")]
    name: str
    version: Annotated[int, Field(ge=1)]
    shared: bool = False


class JobWebhook(ReportModel):
    """State of the webhook of a job."""

    url: str
    state: Annotated[Literal["pending", "delivered", "given_up"], Field(
        description="pending: not delivered yet. delivered: the receiver answered 2xx. given_up: no more attempts.")]
    attempts: Annotated[int, Field(ge=0, description="Number of attempts so far.")] = 0
    next_attempt_at: Annotated[str | None, Field(description="UTC, ISO 8601; null where no attempt is planned.")] = None
    problem: Annotated[str | None, Field(description="Error of the last attempt.")] = None


class JobResumed(ReportModel):
    """Results that an attempt took over from earlier attempts. The final result is the same, byte for byte."""

    plans: Annotated[int, Field(ge=0, description="Number of access plans taken over. A job that is planned several "
                                                  "times counts each plan.")] = 0
    steps: Annotated[int, Field(ge=0, description="Number of workingsteps taken over from unfinished plans.")] = 0
    proofs: Annotated[int, Field(ge=0, description="Number of proofs taken over.")] = 0


class Job(ReportModel):
    """One job."""

    id: Annotated[str, Field(description="Id of the job.", examples=["j0192f0c4a1b27c3d8e9f0a1b2c3d4e5f"])]
    kind: Annotated[JobKind, Field(description="plan: plan and proof; zones: quick check without tool paths; verify: "
                                               "proof of a given program.")]
    state: Annotated[JobState, Field(description="queued and running come first; all other states are final. done ends "
                                                 "a zones job, which has no proof. clean ends a verification "
                                                 "only: the program does no harm, but work is left undone.")]
    stage: Annotated[str, Field(description="Current stage, in words.", examples=["finishing"])]
    progress: Annotated[float, Field(
        ge=0, le=1, description="Share done, 0 to 1. It never decreases during an attempt. A new attempt starts from "
                                "0.")]
    attempt: Annotated[int, Field(ge=0, description="Number of starts of the job so far.")]
    resumed: Annotated[JobResumed | None, Field(
        description="Results that the newest attempt took over from earlier attempts; null: none.")] = None
    estimate: Annotated[JobEstimate | None, Field(
        description="What the job is expected to take; null until its part is read.")] = None
    content_sha256: Annotated[str, Field(
        description="Hash of part and canonical setup. If there are a blank, a program and spindle_tool, it covers "
                    "them too.")]
    part_sha256: Annotated[str, Field(description="Hash of the bytes of the part.")]
    setup_sha256: Annotated[str, Field(description="Hash of the canonical setup.")]
    stock_sha256: Annotated[str | None, Field(
        description="Hash of the bytes of the STEP file of the blank; null: there is none.")] = None
    labels: Annotated[dict[str, str], Field(description="Labels of the setup.")] = {}
    created_at: Annotated[str, Field(description="UTC, ISO 8601.", examples=["2026-01-31T12:00:00Z"])]
    started_at: Annotated[str | None, Field(description="Start of the newest attempt, UTC, ISO 8601; null before the "
                                                        "first.")] = None
    deadline_at: Annotated[str | None, Field(description="Time by which the job must end, UTC, ISO 8601; null without "
                                                         "deadline_s.")] = None
    finished_at: Annotated[str | None, Field(description="UTC, ISO 8601; null until the state is final.")] = None
    expired_at: Annotated[str | None, Field(description="Time when its files were deleted, UTC, ISO 8601; null while "
                                                        "they are kept.")] = None
    summary: Annotated[JobSummary | None, Field(
        description="Figures of a plan or verification in state proved, clean or unproved; null otherwise.")] = None
    library: Annotated[list[JobLibraryEntry], Field(
        description="Library entries that the setup used, in the versions at the time of the request.")] = []
    webhook: Annotated[JobWebhook | None, Field(description="null where the submission had no webhook_url.")] = None
    error: Annotated[Problem | None, Field(description="Why the job failed; null if it did not fail.")] = None
    links: JobLinks


class JobPage(ReportModel):
    """A page of jobs, newest first."""

    items: list[Job]
    next_cursor: Annotated[str | None, Field(description="Value of ?cursor= for the next page; null "
                                                         "on the last page.")] = None


class JobFile(ReportModel):
    """One file of a job."""

    name: str
    size_bytes: Annotated[int, Field(ge=0)]
    sha256: str
    media_type: str
    href: Annotated[str, Field(description="Path for the download.")]


class JobFiles(ReportModel):
    """The files of a job. Programs and STEP-NC are listed only when the job is proved."""

    items: list[JobFile]
    withheld: Annotated[str | None, Field(description="Why programs are missing; null: none is missing.")] = None


class JobEvent(ReportModel):
    """Data of one server-sent event."""

    id: str
    state: JobState
    stage: str
    progress: Annotated[float, Field(ge=0, le=1)]
    estimate: Annotated[JobEstimate | SkipJsonSchema[None], Field(
        description="As in the job; absent until the part is read.",
        json_schema_extra=lambda schema: schema.pop("default"))] = None
    resumed: Annotated[JobResumed | SkipJsonSchema[None], Field(
        description="As in the job; absent if the attempt took nothing "
                    "over.", json_schema_extra=lambda schema: schema.pop("default"))] = None


class LibraryEntry(ReportModel):
    """Fields of every library entry."""

    name: str
    version: Annotated[int | None, Field(
        ge=1, description="Version of the entry; a setup may refer to lib:NAME@VERSION. null for built-in "
                          "entries.")] = None
    shared: Annotated[bool, Field(description="true: all principals can use the entry.")] = False
    created_at: Annotated[str | None, Field(description="Time when this version was written, UTC, ISO 8601.")] = None


class ToolEntry(LibraryEntry):
    """A tool of the library. A setup refers to it as "lib:NAME"."""

    entry: Tool


class MachineEntry(LibraryEntry):
    """A machine of the library."""

    entry: Machine


class MaterialEntry(LibraryEntry):
    """A material of the library, or a built-in one."""

    entry: Material
    built_in: Annotated[bool, Field(
        description="true: a built-in material. A setup refers to it by its name alone, and it cannot be "
                    "changed.")] = False


class ToolList(ReportModel):
    """All tools of the library."""

    items: list[ToolEntry]


class MachineList(ReportModel):
    """All machines of the library."""

    items: list[MachineEntry]


class MaterialList(ReportModel):
    """All materials, built-in ones first."""

    items: list[MaterialEntry]


class Health(ReportModel):
    """Answer of /healthz and /readyz."""

    status: Annotated[Literal["ok", "unready"], Field(description="ok, or unready with the reason in checks.")]
    checks: Annotated[dict[str, str], Field(description="Result of each check: ok or the error.")] = {}
