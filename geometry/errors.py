"""The one error tree of the project.

    CamError
    ├── InputError            the part, the setup or the program is wrong by itself
    │   ├── StepError             not a STEP file, truncated, or without a usable solid
    │   ├── PartError             a readable shape that cannot be planned (open, several, size)
    │   ├── SetupError            tools, machine or tolerances contradict each other
    │   ├── ProgramError          an NC program cannot be read
    │   ├── LibraryError          a tool library cannot be read
    │   └── CapacityError         the job needs more than this machine has
    ├── GeometryError         a computation on valid input did not converge or overflowed
    ├── ResourceError         a child ran out of time or memory, or died of a signal
    ├── PlanningError         a plan could not be made although the input is valid
    ├── VerificationError     the proof itself could not be carried out
    ├── OutputError           a program or STEP-NC file could not be written
    ├── CancelledError        a user cancelled the job
    └── InternalError         a bug: an invariant of the project is broken

Every error holds a message, the subjects (ids of faces, tools or zones, or a point), the measured value, its limit and
a remedy.
"""

from __future__ import annotations

from typing import Any


class CamError(Exception):
    """Base of every error the project raises on purpose.

    code     : short stable identifier, snake_case; the HTTP problem type ends with it
    message  : one sentence for a person
    subjects : ids of the faces, tools or zones concerned, for example ("F12", "T3"), or points as "(x, y, z)"
    measured : measured value, a number with its unit in ``message``, or None
    limit    : largest or least value allowed, or None
    remedy   : what the user can do
    """

    default_code = "error"

    def __init__(
        self,
        message: str,
        *,
        code: str | None = None,
        subjects: tuple[str, ...] = (),
        measured: Any = None,
        limit: Any = None,
        remedy: str = "",
    ) -> None:
        super().__init__(message)
        self.code = code or self.default_code
        self.message = message
        self.subjects = tuple(subjects)
        self.measured = measured
        self.limit = limit
        self.remedy = remedy

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a report, a problem document or a pipe between processes."""
        return {
            "class": type(self).__name__,
            "code": self.code,
            "message": self.message,
            "subjects": list(self.subjects),
            "measured": self.measured,
            "limit": self.limit,
            "remedy": self.remedy,
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return (_rebuild, (type(self).__name__, self.as_dict()))


class InputError(CamError):
    """The user's input is wrong by itself."""

    default_code = "bad_input"


class StepError(InputError):
    """The file is no STEP file, is cut off, or holds no usable solid."""

    default_code = "bad_step"


class PartError(InputError):
    """The shape can be read, but not planned in this state."""

    default_code = "bad_part"


class SetupError(InputError):
    """Tools, machine, stock or tolerances contradict each other or the part."""

    default_code = "bad_setup"


class ProgramError(InputError):
    """An NC program that cannot be read; the subjects name the line."""

    default_code = "bad_program"


class LibraryError(InputError):
    """A tool library that cannot be read or written; the subjects name the entry."""

    default_code = "bad_library"


class CapacityError(InputError):
    """A job that needs more than this machine has in all, by its estimate."""

    default_code = "machine_too_small"


class GeometryError(CamError):
    """A computation on valid input did not converge."""

    default_code = "geometry_failed"


class ResourceError(CamError):
    """A child process ran out of time or memory, or was killed by a signal."""

    default_code = "out_of_resources"


class PlanningError(CamError):
    """No plan could be made although the input is valid."""

    default_code = "planning_failed"


class VerificationError(CamError):
    """The proof itself could not be carried out."""

    default_code = "verification_failed"


class OutputError(CamError):
    """A program or STEP-NC file could not be written."""

    default_code = "output_failed"


class CancelledError(CamError):
    """A user cancelled the job."""

    default_code = "cancelled"


class InternalError(CamError):
    """A bug: an invariant of the project is broken."""

    default_code = "internal_error"


ERROR_CLASSES: dict[str, type[CamError]] = {
    c.__name__: c
    for c in (
        CamError, InputError, StepError, PartError, SetupError, ProgramError, LibraryError, CapacityError,
        GeometryError, ResourceError, PlanningError, VerificationError, OutputError, CancelledError, InternalError,
    )
}


def error_from_dict(data: dict[str, Any]) -> CamError:
    """Build the error that ``as_dict`` described; an unknown class becomes InternalError."""
    cls = ERROR_CLASSES.get(data.get("class", ""), InternalError)
    return cls(
        data.get("message", ""),
        code=data.get("code"),
        subjects=tuple(data.get("subjects", ())),
        measured=data.get("measured"),
        limit=data.get("limit"),
        remedy=data.get("remedy", ""),
    )


def _rebuild(name: str, data: dict[str, Any]) -> CamError:
    return error_from_dict({**data, "class": name})
