"""/v1/jobs: one job, pages of jobs, cancel, zones, report and files."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import FileResponse, Response
from pydantic import Field

from schemas.jobs import Job, JobFiles, JobKind, JobPage, JobState
from schemas.report import Report, Verification
from schemas.zones import Zones
from service.api.principals import Principal, Submitter
from service.api.problems import responses
from service.api.range_requests import check_range
from service.errors import (
    GoneError,
    NotFoundError,
    NotReadyError,
    RangeError,
    RequestError,
    UnauthorizedError,
    WithheldError,
)
from service.jobs.resources import (
    decode_cursor,
    encode_cursor,
    file_sha256,
    find_file,
    job_resource,
    list_files,
    media_type,
    path_of,
    result_folder,
)

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

ONE = responses(UnauthorizedError, NotFoundError, RequestError)
SENT: dict[int | str, dict[str, Any]] = responses(RangeError) | {
    206: {"description": "The bytes that Range requests, if If-Range allows it."},
    304: {"description": "The client has this version already (If-None-Match)."}}
RESULT = responses(UnauthorizedError, NotFoundError, RequestError, NotReadyError, GoneError)


Labels = Annotated[list[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}:[^\x00-\x1f\x7f]{0,200}$")]],
                   Query(max_length=8, description="Label of the job as KEY:VALUE. Several labels must all match.",
                         examples=[["order:4711"]])]
From = Annotated[datetime | None, Query(description="Only jobs posted at or after this time; ISO 8601, UTC where no "
                                                    "time zone is given.")]
Until = Annotated[datetime | None, Query(description="Only jobs posted before this time; ISO 8601, UTC where no time "
                                                     "zone is given.")]


def _seconds(time: datetime | None) -> float | None:
    if time is None:
        return None
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()


@router.get("", operation_id="listJobs", summary="Your jobs, newest first", response_description="A page of jobs.",
            responses=responses(UnauthorizedError, RequestError))
def list_jobs(request: Request, principal: Principal, limit: Annotated[int, Query(ge=1, le=200)] = 50,
              cursor: Annotated[str | None, Query(max_length=100)] = None, state: JobState | None = None,
              kind: JobKind | None = None, label: Labels = [],  # noqa: B006
              created_from: From = None, created_to: Until = None) -> JobPage:
    """A page of jobs that match all filters. Pages do not shift when jobs are added."""
    before = decode_cursor(cursor) if cursor is not None else None
    rows = request.app.state.engine.jobs.page(
        principal, limit=limit + 1, before=before, state=state, kind=kind, since=_seconds(created_from),
        until=_seconds(created_to), labelled=[(k, v) for k, _, v in (text.partition(":") for text in label)])
    following = encode_cursor(rows[limit - 1]["id"]) if len(rows) > limit else None
    return JobPage(items=[job_resource(r) for r in rows[:limit]], next_cursor=following)


@router.get("/{job_id}", operation_id="getJob", summary="One job", response_description="The job.", responses=ONE)
def get_job(request: Request, principal: Principal, job_id: str) -> Job:
    """State, stage, progress and links."""
    return job_resource(request.app.state.engine.jobs.get(job_id, principal))


@router.delete("/{job_id}", operation_id="cancelJob", summary="Cancel a job",
               response_description="The job after the request.", responses=ONE)
def cancel_job(request: Request, principal: Submitter, job_id: str, purge: Annotated[bool, Query(
        description="Also delete the files of the job, even if the job ended earlier. Requests for them get 410 at "
                    "once. The service removes them within hours, unless another job has the same "
                    "files.")] = False) -> Job:
    """Cancel a job that has not ended. A job that has ended is returned unchanged."""
    jobs = request.app.state.engine.jobs
    jobs.get(job_id, principal)
    jobs.cancel(job_id)
    if purge:
        jobs.expire(job_id)
    return job_resource(jobs.get(job_id, principal))


@router.get("/{job_id}/zones", operation_id="getZones", summary="zones.json", response_description="The zones.",
            responses=RESULT | SENT, response_model=Zones)
def get_zones(request: Request, principal: Principal, job_id: str) -> Response:
    """Walls, connections, channels, zones and remainder.

    Raises
    ------
    NotFoundError
        There is no such job of the principal, or it has no zones yet.
    """
    return _document(request, principal, job_id, "zones.json")


@router.get("/{job_id}/report", operation_id="getReport", summary="report.json", response_description="The report.",
            responses=RESULT | SENT, response_model=Report | Verification)
def get_report(request: Request, principal: Principal, job_id: str) -> Response:
    """The plan and its proof; for a verification, its findings.

    Raises
    ------
    NotFoundError
        There is no such job of the principal, or it has no report yet.
    """
    return _document(request, principal, job_id, "report.json")


@router.get("/{job_id}/files", operation_id="listFiles", summary="Files of a job",
            response_description="The list of files.", responses=RESULT)
def get_files(request: Request, principal: Principal, job_id: str) -> JobFiles:
    """All files that can be downloaded."""
    row = request.app.state.engine.jobs.get(job_id, principal)
    return list_files(result_folder(request.app.state.engine.artifacts, row), row)


FILE_OK: dict[int | str, dict[str, Any]] = {200: {
    "description": "The file; ETag is its SHA-256.",
    "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}},
    206: {"description": "The bytes that Range requests, if If-Range allows it.",
          "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}}}


@router.get("/{job_id}/files/{name}", operation_id="getFile", summary="One file", response_class=FileResponse,
            responses=RESULT | SENT | FILE_OK | responses(NotReadyError, WithheldError))
def get_file(request: Request, principal: Principal, job_id: str, name: str) -> Response:
    """A file, or a part of it with Range. The answer is 409 for programs and STEP-NC of a job that is not proved."""
    row = request.app.state.engine.jobs.get(job_id, principal)
    path = find_file(result_folder(request.app.state.engine.artifacts, row), row, name)
    return _sent(request, path, media_type(name), filename=name)


def _is_known(request: Request, etag: str) -> bool:
    """Whether If-None-Match contains this entity tag, by the weak comparison (RFC 9110, 13.1.2)."""
    given = [t.strip().removeprefix("W/") for t in request.headers.get("if-none-match", "").split(",")]
    return etag in given or given == ["*"]


def _document(request: Request, principal: str, job_id: str, name: str) -> Response:
    """The bytes of a JSON result, as the job process wrote them."""
    engine = request.app.state.engine
    row = engine.jobs.get(job_id, principal)
    path = result_folder(engine.artifacts, row) / name
    if not path.is_file():
        raise NotFoundError(f"a job of kind {row['kind']} has no {name}", code="no_such_document", subjects=(name,),
                            remedy=f"GET {path_of(row)} names the documents of this job under links")
    return _sent(request, path, "application/json")


def _sent(request: Request, path: Path, media: str, filename: str | None = None) -> Response:
    """A file of a result: whole, in parts, or not at all where the client has it."""
    headers = {"ETag": f'"{file_sha256(path)}"', "X-Content-Type-Options": "nosniff"}
    if _is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    check_range(request, path.stat().st_size, headers["ETag"])
    return FileResponse(path, media_type=media, filename=filename, headers=headers)
