"""From the wire to the plain values of the inner packages, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from geometry.errors import SetupError
from geometry.toolbody import HolderSegment, ToolBody
from schemas.setup import Placement, Setup
from schemas.tools import Tool

Library = Mapping[str, Mapping[str, Any]]


def parse_setup(data: bytes | str | Mapping[str, Any], library: Library | None = None) -> Setup:
    """Read a setup.

    data    : JSON text, or the object it stands for
    library : entries by shelf ('tools', 'machines', 'materials') for ``"lib:NAME"`` references

    Raises
    ------
    SetupError
        Code 'setup_not_json' or 'bad_setup'; ``measured`` lists every problem as {"at", "problem"}, ``subjects``
        the places.
    """
    if isinstance(data, bytes | str):
        try:
            data = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise SetupError(f"the setup is not JSON: {error}", code="setup_not_json",
                             remedy="send one JSON object as described by the Setup schema") from None
    try:
        return Setup.model_validate(data, context={"library": library or {}})
    except ValidationError as error:
        raise setup_error(error) from None


def read_setup(path: Path, library: Library | None = None) -> Setup:
    """Read a setup from a file; see ``parse_setup``.

    Raises
    ------
    SetupError
        The file cannot be read, or what it holds is no setup.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise SetupError(f"the setup file {path.name} cannot be read: {error.strerror}",
                         code="setup_unreadable") from None
    return parse_setup(text, library)


def problems_of(error: ValidationError, root: str = "setup") -> list[dict[str, str]]:
    """Every problem of a validation as {"at": place, "problem": sentence}, in the order of the document."""
    found = []
    for item in error.errors(include_url=False, include_context=False, include_input=False):
        at = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in item["loc"]).lstrip(".")
        if item["type"] == "extra_forbidden":
            text = "unknown field"
        elif at == "tools" and item["type"] in ("missing", "too_short"):
            text = "no tools are given; a setup needs at least one"
        else:
            text = item["msg"].removeprefix("Value error, ")
        found.append({"at": at or root, "problem": text})
    return found


def setup_error(error: ValidationError) -> SetupError:
    """The ``SetupError`` that says what a failed validation found."""
    problems = problems_of(error)
    first = problems[0]
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    prefix = "" if first["at"] == "setup" else f"{first['at']}: "
    return SetupError(f"{prefix}{first['problem']}{more}", code="bad_setup",
                      subjects=tuple(p["at"] for p in problems), measured=problems,
                      remedy="correct the fields named; lengths are mm, the schema is in openapi.yaml under Setup")


def tool_body(tool: Tool) -> ToolBody:
    """The shape of one tool; lengths mm from the tip."""
    number, flute, neck_d, neck_l, shank, stickout = (
        tool.number, tool.flute_length_mm, tool.neck_diameter_mm, tool.neck_length_mm, tool.shank_diameter_mm,
        tool.stickout_mm)
    if None in (number, flute, neck_d, neck_l, shank, stickout):
        raise SetupError(f"tool {tool.id} has not been completed by a Setup", subjects=(tool.id,))
    segments = tuple(HolderSegment(s.diameter_mm, s.diameter_top_mm or s.diameter_mm, s.length_mm)
                     for s in tool.holder)
    return ToolBody(tool.id, int(number or 0), tool.diameter_mm, tool.corner_radius_mm, float(flute or 0),
                    float(neck_d or 0), float(neck_l or 0), float(shank or 0), float(stickout or 0), segments)


def tool_bodies(setup: Setup) -> tuple[ToolBody, ...]:
    """The shapes of all tools, in the order of the setup."""
    return tuple(tool_body(t) for t in setup.tools)


def face_numbers(ids: list[str]) -> tuple[int, ...]:
    """Face numbers of face ids: ``["F12"]`` gives ``(12,)``."""
    return tuple(int(i[1:]) for i in ids)


def placement_frame(placement: Placement) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origin and axes of the setup frame in STEP coordinates.

    Returns
    -------
    origin : (3,) float64, mm
    axes   : (3, 3) float64, rows are the unit x, y and z axis of the setup frame, so a point p of the file
             stands at ``axes @ (p - origin)`` in the setup frame
    """
    z = np.array(placement.z_axis, dtype=np.float64)
    z /= np.linalg.norm(z)
    x = np.array(placement.x_axis, dtype=np.float64)
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.array(placement.origin_mm, dtype=np.float64), np.vstack([x, np.cross(z, x), z])
