"""Jobs, their files and pages of them, as the HTTP interface shows them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from schemas.base import ReportModel
from schemas.machine import Machine
from schemas.materials import Material
from schemas.problem import Problem
from schemas.tools import Tool

JobKind = Literal["plan", "zones", "verify"]
JobState = Literal["queued", "running", "proved", "unproved", "done", "failed", "cancelled"]
FINAL_STATES = ("proved", "unproved", "done", "failed", "cancelled")


class JobLinks(ReportModel):
    """Paths of what belongs to a job; null where the kind of job has no such thing."""

    self: str
    events: str
    zones: str | None = None
    report: str | None = None
    files: str | None = None
    view: Annotated[str | None, Field(description="The page of the job, for people.")] = None


class JobSummary(ReportModel):
    """What the report says in figures; a release gate needs no more."""

    complete: Annotated[bool | None, Field(description="Nothing is in the remainder; null for a verification.")] = None
    coverage: Annotated[float | None, Field(description="Share of the machinable area that is proved.")] = None
    reach_coverage: Annotated[float | None, Field(description="The same of what some tool and axis can reach.")] = None
    findings: Annotated[int, Field(ge=0, description="How many findings the proof has.")] = 0
    machining_time_s: float | None = None


class JobLibraryEntry(ReportModel):
    """A version of a library entry that a job used."""

    shelf: Literal["tools", "machines", "materials"]
    name: str
    version: Annotated[int, Field(ge=1)]
    shared: bool = False


class JobWebhook(ReportModel):
    """How the webhook of a job fares."""

    url: str
    state: Annotated[Literal["pending", "delivered", "given_up"], Field(
        description="pending until the job has ended and the receiver has answered 2xx.")]
    attempts: Annotated[int, Field(ge=0)] = 0
    next_attempt_at: Annotated[str | None, Field(description="UTC, ISO 8601; null where none is planned.")] = None
    problem: Annotated[str | None, Field(description="What went wrong at the last attempt.")] = None


class JobResumed(ReportModel):
    """What an attempt took over from those before; the result is the same to the byte."""

    plans: Annotated[int, Field(ge=0, description="Accesses that were planned already, counted again for each plan of "
                                                  "the job.")] = 0
    steps: Annotated[int, Field(ge=0, description="Workingsteps of plans that were still under way.")] = 0
    proofs: Annotated[int, Field(ge=0, description="Proofs that were there already.")] = 0


class Job(ReportModel):
    """One job."""

    id: Annotated[str, Field(description="Id of the job.", examples=["j0192f0c4a1b27c3d8e9f0a1b2c3d4e5f"])]
    kind: Annotated[JobKind, Field(description="plan: the whole chain; zones: dry check; verify: proof of a program.")]
    state: Annotated[JobState, Field(description="queued and running come first; all others are final. done ends a "
                                                 "zones job, which proves nothing.")]
    stage: Annotated[str, Field(description="What it is doing, for people.", examples=["finishing"])]
    progress: Annotated[float, Field(ge=0, le=1, description="Share done, 0 to 1; never goes back while an attempt "
                                                             "runs.")]
    attempt: Annotated[int, Field(ge=0, description="How often it was started.")]
    resumed: Annotated[JobResumed | None, Field(description="What the newest attempt took over from those before; null "
                                                            "where it began anew.")] = None
    content_sha256: Annotated[str, Field(description="Hash of part and canonical setup (and blank, program).")]
    part_sha256: Annotated[str, Field(description="Hash of the part's bytes.")]
    setup_sha256: Annotated[str, Field(description="Hash of the canonical setup.")]
    stock_sha256: Annotated[str | None, Field(description="Hash of the bytes of the blank's file; null where it is "
                                                          "none.")] = None
    labels: dict[str, str] = {}
    created_at: Annotated[str, Field(description="UTC, ISO 8601.", examples=["2026-01-31T12:00:00Z"])]
    started_at: Annotated[str | None, Field(description="Start of its newest attempt, UTC, ISO 8601; null before "
                                                        "the first.")] = None
    deadline_at: Annotated[str | None, Field(description="When it has to have ended, UTC, ISO 8601; null where no "
                                                         "deadline_s was given.")] = None
    finished_at: Annotated[str | None, Field(description="UTC, ISO 8601; null while not final.")] = None
    expired_at: Annotated[str | None, Field(description="When its files were let go of, UTC, ISO 8601; null while "
                                                        "they are kept.")] = None
    summary: Annotated[JobSummary | None, Field(description="Of a plan or verification that was proved or not.")] = None
    library: Annotated[list[JobLibraryEntry], Field(description="What its setup referred to, as of its posting.")] = []
    webhook: Annotated[JobWebhook | None, Field(description="Null where no webhook_url was given.")] = None
    error: Annotated[Problem | None, Field(description="Why it failed.")] = None
    links: JobLinks


class JobPage(ReportModel):
    """A page of jobs, newest first."""

    items: list[Job]
    next_cursor: Annotated[str | None, Field(description="Give it as ?cursor= for the next page; null at the "
                                                         "end.")] = None


class JobFile(ReportModel):
    """One file of a job."""

    name: str
    size_bytes: Annotated[int, Field(ge=0)]
    sha256: str
    media_type: str
    href: str


class JobFiles(ReportModel):
    """The files of a job. Programs and STEP-NC stand here only when the job is proved."""

    items: list[JobFile]
    withheld: Annotated[str | None, Field(description="Why programs are missing, null when nothing is.")] = None


class JobEvent(ReportModel):
    """What one server-sent event carries as data."""

    id: str
    state: JobState
    stage: str
    progress: Annotated[float, Field(ge=0, le=1)]
    resumed: Annotated[JobResumed | SkipJsonSchema[None], Field(
        description="As in the job; left out where an attempt began anew.",
        json_schema_extra=lambda schema: schema.pop("default"))] = None


class LibraryEntry(ReportModel):
    """What every entry of a library says of itself."""

    name: str
    version: Annotated[int | None, Field(ge=1, description="A setup may say lib:NAME@VERSION; null for built-in "
                                                           "ones.")] = None
    shared: Annotated[bool, Field(description="It belongs to all principals.")] = False
    created_at: Annotated[str | None, Field(description="When this version was written, UTC, ISO 8601.")] = None


class ToolEntry(LibraryEntry):
    """A tool of the library; a setup refers to it as "lib:NAME"."""

    entry: Tool


class MachineEntry(LibraryEntry):
    """A machine of the library."""

    entry: Machine


class MaterialEntry(LibraryEntry):
    """A material of the library, or a built-in one."""

    entry: Material
    built_in: Annotated[bool, Field(description="Built-in materials are used by their name alone and cannot be "
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
    checks: dict[str, str] = {}
