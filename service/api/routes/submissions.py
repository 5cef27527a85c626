"""POST /v1/jobs, /v1/zones, /v1/verifications: each queues a job for all or part of the pipeline, and answers 202."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Request, Response, status
from starlette.concurrency import run_in_threadpool

from geometry.errors import ProgramError, SetupError, StepError
from schemas.jobs import Job
from service.api.principals import Submitter, submission_rate
from service.api.problems import responses
from service.api.uploads import DEADLINE_S, new_job, read_form
from service.errors import (
    KeyConflictError,
    MethodError,
    RateError,
    RequestError,
    ServiceError,
    TooLargeError,
    UnauthorizedError,
    UnavailableError,
)
from service.jobs.resources import job_resource, path_of

router = APIRouter(prefix="/v1", tags=["submissions"], dependencies=[Depends(submission_rate)])

IdempotencyKey = Annotated[str | None, Header(
    alias="Idempotency-Key", min_length=1, max_length=255,
    description="Optional. A repeat with the same key and content returns the same job. With other content the answer "
                "is 422.")]
ERRORS = responses(ServiceError, StepError, SetupError, ProgramError, RequestError, KeyConflictError, TooLargeError,
                   UnauthorizedError, RateError, MethodError, UnavailableError)
ACCEPTED: dict[int | str, dict[str, Any]] = {202: {
    "description": "The job; its path is in Location.",
    "headers": {"Location": {"description": "Path of the job.", "schema": {"type": "string"}}}}}


def multipart(with_program: bool) -> dict[str, Any]:
    """OpenAPI request body of a submission: ``setup`` is typed, so that clients build it from classes."""
    properties: dict[str, Any] = {
        "part": {"type": "string", "format": "binary", "description": "The STEP file (ISO 10303-21)."},
        "setup": {"$ref": "#/components/schemas/Setup"},
    }
    encoding = {"part": {"contentType": "model/step, application/step, application/octet-stream"},
                "setup": {"contentType": "application/json"}}
    if with_program:
        properties["program"] = {"type": "string", "format": "binary",
                                 "description": "The NC program or STEP-NC file. A program with words of Siemens or "
                                                "Heidenhain is read as such. Any other program is read for the first "
                                                "other control in machine.dialects of the setup, or else for linuxcnc; "
                                                "proof.assumed lists a dialect that nothing states. "
                                                "STEP-NC (AP238 or ISO 14649) is recognized by FILE_SCHEMA in its "
                                                "header."}
        encoding["program"] = {"contentType": "text/plain, model/step, application/octet-stream"}
    required = list(properties)
    properties["stock"] = {
        "type": "string", "format": "binary",
        "description": "The STEP file of the blank. Required if the setup has stock.kind 'step', otherwise not "
                       "allowed."}
    encoding["stock"] = {"contentType": "model/step, application/step, application/octet-stream"}
    if with_program:
        properties["spindle_tool"] = {
            "type": "integer", "minimum": 0, "maximum": 999999, "default": 0,
            "description": "T number of the tool that is in the spindle before the first line of the program; its "
                           "length offset is then active. 0: no tool."}
    properties["deadline_s"] = {
        "type": "number", "minimum": DEADLINE_S[0], "maximum": DEADLINE_S[1],
        "description": "Time limit for the whole job, in seconds from the request. A job that takes longer is stopped "
                       "and fails with deadline_exceeded. Not part of the content hash."}
    properties["webhook_url"] = {
        "type": "string", "format": "uri", "maxLength": 2000,
        "description": "The service sends a signed POST to this URL when the job has ended. It retries for about 20 "
                       "hours until the answer is 2xx or 410 (docs/service.md). The service must allow the origin of "
                       "the URL. Not part of the content hash."}
    schema = {"type": "object", "title": "VerificationSubmission" if with_program else "Submission",
              "properties": properties, "required": required, "additionalProperties": False}
    return {"requestBody": {"required": True, "content": {"multipart/form-data": {
        "schema": schema, "encoding": encoding}}}}


async def _submit(request: Request, response: Response, kind: str, principal: str, key: str | None) -> Job:
    engine = request.app.state.engine
    await run_in_threadpool(engine.check_room, principal, key)
    form = await read_form(request, with_program=kind == "verify")
    new = await run_in_threadpool(new_job, engine, kind, principal, key, form)
    row, fresh = await run_in_threadpool(engine.create, new)
    if fresh:
        request.app.state.metrics.submitted(kind)
    response.headers["Location"] = path_of(row)
    return job_resource(row)


@router.post("/jobs", status_code=status.HTTP_202_ACCEPTED, operation_id="createJob", summary="Plan and prove a part",
             responses=ACCEPTED | ERRORS, openapi_extra=multipart(False))
async def create_job(request: Request, response: Response, principal: Submitter, key: IdempotencyKey = None) -> Job:
    """Queue a plan with its proof: zones, tool paths, programs, simulation."""
    return await _submit(request, response, "plan", principal, key)


@router.post("/zones", status_code=status.HTTP_202_ACCEPTED, operation_id="createZones",
             summary="Quick check of a part", responses=ACCEPTED | ERRORS, openapi_extra=multipart(False))
async def create_zones(request: Request, response: Response, principal: Submitter,
                       key: IdempotencyKey = None) -> Job:
    """Queue a check without tool paths: zones, uncut area, and the tools that would cut it."""
    return await _submit(request, response, "zones", principal, key)


@router.post("/verifications", status_code=status.HTTP_202_ACCEPTED, operation_id="createVerification",
             summary="Prove a program", responses=ACCEPTED | ERRORS, openapi_extra=multipart(True))
async def create_verification(request: Request, response: Response, principal: Submitter,
                              key: IdempotencyKey = None) -> Job:
    """Queue the proof of a program against part and setup. The program may come from any CAM system."""
    return await _submit(request, response, "verify", principal, key)
