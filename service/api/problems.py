"""Turns every error into application/problem+json [RFC9457]: our errors, those of the framework, and bugs."""

from __future__ import annotations

from typing import Any

import structlog
from asgi_correlation_id import correlation_id
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from starlette.exceptions import HTTPException
from starlette.routing import compile_path

from geometry.errors import CamError, InternalError
from schemas.problem import PROBLEM_MEDIA_TYPE, Problem
from service.api.head_requests import is_stream
from service.errors import (
    ERROR_TABLE,
    ForbiddenError,
    MethodError,
    NotFoundError,
    RangeError,
    RateError,
    RequestError,
    ServiceError,
    TooLargeError,
    UnauthorizedError,
    UnavailableError,
    problem_document,
)
from service.from_wire import MAX_PROBLEMS_LISTED, sentence
from service.jobs.database import AWAY
from service.jobs.disk_space import STORAGE_FULL, is_full

log = structlog.get_logger(__name__)
BODY_LIMIT = "zonemill.body_limit"  # key of a request for the limit of its body, bytes


def too_large(limit: int) -> TooLargeError:
    """The error for a body above the limit, bytes."""
    return TooLargeError(f"the request body is larger than {limit / 1e6:g} MB", limit=limit,
                         remedy="send a smaller file, or raise ZONEMILL_MAX_BODY_MB for large files")


def problem_response(request: Request, error: CamError, headers: dict[str, str] | None = None) -> JSONResponse:
    """The response for an error, as a problem document [RFC9457]."""
    body = problem_document(error, request.url.path, correlation_id.get())
    extra = dict(headers or {})
    if isinstance(error, UnauthorizedError):
        extra["WWW-Authenticate"] = "Bearer"
    if isinstance(error, RateError | UnavailableError):
        extra["Retry-After"] = str(error.retry_after_s or 5)
    if isinstance(error, RangeError):
        extra["Content-Range"] = f"bytes */{error.limit}"
    return JSONResponse(body, body["status"], extra, PROBLEM_MEDIA_TYPE)


def install(app: FastAPI) -> None:
    """Register the handlers."""
    app.add_exception_handler(CamError, _ours)
    app.add_exception_handler(HTTPException, _framework)
    app.add_exception_handler(RequestValidationError, _validation)
    for kind in AWAY:
        app.add_exception_handler(kind, _database)
    app.add_exception_handler(OSError, _disk)
    app.add_exception_handler(UnicodeEncodeError, _half_a_character)
    app.add_exception_handler(Exception, _unexpected)


async def _ours(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, CamError)
    return problem_response(request, error)


async def _framework(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    text = str(error.detail)
    named: dict[int, CamError] = {
        401: UnauthorizedError(text, remedy="send Authorization: Bearer KEY"),
        404: NotFoundError(f"there is no resource at {request.url.path}", code="no_such_path",
                           remedy="GET /openapi.json lists the paths"),
        405: MethodError(f"{request.method} is not allowed at {request.url.path}",
                         remedy="the Allow header lists the allowed methods"),
        413: too_large(request.scope[BODY_LIMIT]),
    }
    # the framework answers 400 for a body that it cannot decode, 422 for any other bad body
    fallback = (RequestError(text, remedy="see the schema in /openapi.json") if error.status_code in (400, 422)
                else ServiceError(text, remedy="see the operations of this path in /openapi.json"))
    headers = dict(error.headers or {})
    if error.status_code == 405:
        headers["Allow"] = ", ".join(_offered(request))
    return problem_response(request, named.get(error.status_code, fallback), headers)


def _offered(request: Request) -> list[str]:
    """Methods of all routes at this path; the router itself lists only those of the first route that matches."""
    paths = request.app.openapi()["paths"]
    found = {method.upper() for template, item in paths.items() for method in item
             if compile_path(template)[0].match(request.url.path)}
    return sorted(found | ({"HEAD"} if "GET" in found and not is_stream(request.url.path) else set()))


async def _validation(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    problems = [{"at": ".".join(str(p) for p in e["loc"]), "problem": sentence(e["type"], e["msg"])}
                for e in error.errors()[:MAX_PROBLEMS_LISTED]]
    first = problems[0]
    return problem_response(request, RequestError(f"{first['at']}: {first['problem']}", measured=problems,
                                                  subjects=tuple(p["at"] for p in problems),
                                                  remedy="see the schema in /openapi.json"))


async def _database(request: Request, error: Exception) -> JSONResponse:
    """The database does not answer, or a disk is full: not a bug, and worth another try. The message may name hosts."""
    if isinstance(error, DBAPIError) and not isinstance(error, OperationalError | InterfaceError):
        return await _unexpected(request, error)
    log.error("the database does not answer", path=request.url.path, exc_info=error)
    return problem_response(request, UnavailableError("the database does not answer", code="database_unavailable",
                                                      retry_after_s=10, remedy="try again when /readyz reports ok"))


async def _disk(request: Request, error: Exception) -> JSONResponse:
    if not is_full(error):
        return await _unexpected(request, error)
    log.error("the disk is full", path=request.url.path)
    return problem_response(request, UnavailableError("a disk of the service is full",
                                                      code=STORAGE_FULL, retry_after_s=60,
                                                      remedy="try again when there is space"))


async def _half_a_character(request: Request, error: Exception) -> JSONResponse:
    """JSON can contain a lone surrogate, for which the validator has no error of its own."""
    return problem_response(request, RequestError("the request contains a lone surrogate, which is not a valid "
                                                  "character", code="bad_text", remedy="send text as UTF-8"))


async def _unexpected(request: Request, error: Exception) -> JSONResponse:
    log.exception("bug in a route", path=request.url.path, exc_info=error)
    return problem_response(request, InternalError("this is a bug in the service; the log has the details under this "
                                                   "request "
                                                   "id", code="bug", remedy="please report it with the request id"),
                            {"Connection": "close"})  # the server closes the connection after an error in a route


def responses(*kinds: type[CamError]) -> dict[int | str, dict[str, Any]]:
    """The ``responses=`` of a route that may raise these errors, for the OpenAPI document.

    A route that requires a key can also answer that a scope is missing, or that the database is not available.
    """
    found: dict[int | str, dict[str, Any]] = {}
    behind_a_key = (ForbiddenError, UnavailableError) if UnauthorizedError in kinds else ()
    for kind in dict.fromkeys((*kinds, *behind_a_key)):
        row = ERROR_TABLE[kind]
        entry = found.setdefault(int(row.status), {
            "description": row.title,
            "content": {PROBLEM_MEDIA_TYPE: {"schema": {"$ref": f"#/components/schemas/{Problem.__name__}"}}}})
        if row.title not in entry["description"]:
            entry["description"] += f"; {row.title[0].lower()}{row.title[1:]}"
    return found
