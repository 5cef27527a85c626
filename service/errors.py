"""Errors of the service itself, and the one table from error class to HTTP problem and exit code.

CamError
└── ServiceError          something about the request, not about part or plan
    ├── NotFoundError         no such job, file, entry or path
    ├── MethodError           the path exists, the method does not
    ├── UnauthorizedError     no key, or a wrong, revoked or expired one
    ├── ForbiddenError        the key is valid, but does not allow this
    ├── TooLargeError         the request body is larger than the limit
    ├── RequestError          the request is malformed: missing part, bad cursor
    ├── KeyConflictError      an Idempotency-Key used before with other content
    ├── NotReadyError         the job has no such result yet
    ├── GoneError             the files of the job have been deleted
    ├── RangeError            the file has no such range
    ├── WithheldError         programs of a job that is not proved
    ├── RateError             too many requests
    └── UnavailableError      database or engine cannot be reached
"""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from geometry import errors as cam
from geometry.errors import CamError


class ServiceError(CamError):
    """An error of the request. retry_after_s : seconds until another try, sent as the Retry-After header."""

    default_code = "bad_request"

    def __init__(self, message: str, *, retry_after_s: int | None = None, **details: Any) -> None:
        super().__init__(message, **details)
        self.retry_after_s = retry_after_s


class NotFoundError(ServiceError):
    """No such job, file, entry or path."""

    default_code = "not_found"


class MethodError(ServiceError):
    """The path exists, the method does not."""

    default_code = "method_not_allowed"


class UnauthorizedError(ServiceError):
    """No key, or a wrong, revoked or expired one."""

    default_code = "unauthorized"


class ForbiddenError(ServiceError):
    """The key is valid, but does not allow this."""

    default_code = "forbidden"


class TooLargeError(ServiceError):
    """The request body is larger than the limit."""

    default_code = "body_too_large"


class RequestError(ServiceError):
    """The request is malformed."""

    default_code = "malformed_request"


class KeyConflictError(ServiceError):
    """This Idempotency-Key was used before with other content."""

    default_code = "idempotency_key_reused"


class NotReadyError(ServiceError):
    """The job has no such result, or not yet."""

    default_code = "not_ready"


class GoneError(ServiceError):
    """The files of the job have been deleted."""

    default_code = "result_expired"


class RangeError(ServiceError):
    """The file has no such range."""

    default_code = "range_not_satisfiable"


class WithheldError(ServiceError):
    """Programs of a job that is not proved are withheld."""

    default_code = "program_withheld"


class RateError(ServiceError):
    """Too many requests."""

    default_code = "too_many_requests"


class UnavailableError(ServiceError):
    """The database or the engine cannot be reached."""

    default_code = "unavailable"


@dataclass(frozen=True)
class ErrorMapping:
    """External form of an error class: HTTP status, slug and title of the problem, exit code of the program."""

    status: HTTPStatus
    slug: str
    title: str
    exit_code: int


_S = HTTPStatus
ERROR_TABLE: dict[type[CamError], ErrorMapping] = {
    cam.CamError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "error", "Something went wrong", 1),
    cam.InputError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-input", "The input is wrong", 2),
    cam.StepError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-step", "The STEP file cannot be used", 2),
    cam.PartError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-part", "The part cannot be planned as it is", 2),
    cam.SetupError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-setup", "The setup is wrong", 2),
    cam.ProgramError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-program", "The NC program cannot be read", 2),
    cam.LibraryError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-library", "The tool library cannot be read", 2),
    cam.CapacityError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "too-large-job", "The job is too large for this machine",
                                    2),
    cam.GeometryError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "geometry-failed", "A computation did not converge", 1),
    cam.ResourceError: ErrorMapping(_S.SERVICE_UNAVAILABLE, "out-of-resources", "A limit was reached", 1),
    cam.PlanningError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "planning-failed", "No plan could be made", 1),
    cam.VerificationError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "verification-failed", "The proof stopped", 1),
    cam.OutputError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "output-failed", "A file could not be written", 1),
    cam.CancelledError: ErrorMapping(_S.CONFLICT, "cancelled", "The job was cancelled", 1),
    cam.InternalError: ErrorMapping(_S.INTERNAL_SERVER_ERROR, "internal-error", "A bug", 1),
    ServiceError: ErrorMapping(_S.BAD_REQUEST, "bad-request", "The request is wrong", 2),
    NotFoundError: ErrorMapping(_S.NOT_FOUND, "not-found", "Not found", 2),
    MethodError: ErrorMapping(_S.METHOD_NOT_ALLOWED, "method-not-allowed", "Method not allowed", 2),
    UnauthorizedError: ErrorMapping(_S.UNAUTHORIZED, "unauthorized", "A valid key is required", 2),
    ForbiddenError: ErrorMapping(_S.FORBIDDEN, "forbidden", "The key does not allow this", 2),
    TooLargeError: ErrorMapping(_S.REQUEST_ENTITY_TOO_LARGE, "too-large", "The request is too large", 2),
    RequestError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "bad-request", "The request is wrong", 2),
    KeyConflictError: ErrorMapping(_S.UNPROCESSABLE_ENTITY, "key-conflict",
                                   "The Idempotency-Key was used for other content", 2),
    NotReadyError: ErrorMapping(_S.CONFLICT, "not-ready", "The job has no such result", 2),
    GoneError: ErrorMapping(_S.GONE, "gone", "The files have been deleted", 2),
    RangeError: ErrorMapping(_S.REQUESTED_RANGE_NOT_SATISFIABLE, "range-not-satisfiable",
                             "The file has no such range", 2),
    WithheldError: ErrorMapping(_S.CONFLICT, "withheld", "Programs of an unproved job are withheld", 3),
    RateError: ErrorMapping(_S.TOO_MANY_REQUESTS, "too-many-requests", "Too many requests", 2),
    UnavailableError: ErrorMapping(_S.SERVICE_UNAVAILABLE, "unavailable", "The service is not ready", 1),
}
"""Every error class of the project; a test compares it with the class tree."""

EXIT_PROVED, EXIT_BUG, EXIT_INPUT, EXIT_UNPROVED = 0, 1, 2, 3


def error_mapping(error: CamError) -> ErrorMapping:
    """The row of the class of an error, or of its nearest base in the table."""
    return next(ERROR_TABLE[c] for c in type(error).__mro__ if c in ERROR_TABLE)


def problem_document(error: CamError, instance: str | None = None, request_id: str | None = None) -> dict[str, Any]:
    """The members of a problem document [RFC9457] for an error, as plain data."""
    row = error_mapping(error)
    return {
        "type": f"urn:zonemill:problem:{row.slug}:{error.code}", "title": row.title, "status": int(row.status),
        "detail": error.message, "instance": instance, "code": error.code, "subjects": list(error.subjects),
        "measured": error.measured, "limit": error.limit, "remedy": error.remedy, "request_id": request_id,
    }
