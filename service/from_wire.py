"""Converts wire models into the plain values of the inner packages, and does nothing else."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from geometry.errors import CamError, OutputError, SetupError
from geometry.setup_frame import SetupFrame
from geometry.tool_body import HolderFrustum, ToolBody
from output.inverse_kinematics import RotaryMachine, program_limits
from schemas.machine import Machine
from schemas.setup import Quality, Setup
from schemas.tools import BUILT_KINDS, SEGMENT_KINDS, VERIFIED_KINDS, Tool
from verify.kinematics import Kinematics

LOWEST_AXIS = -0.5  # Z of the unit tool axis: 30 degrees below level
OBJECT_WANTED = ("model_type", "model_attributes_type", "dict_type")
MAX_PROBLEMS_LISTED = 200  # of one setup or request; a few megabytes can contain a million
Library = Mapping[str, Mapping[str, Any]]


def parse_setup(data: bytes | str | Mapping[str, Any], library: Library | None = None) -> Setup:
    """Read a setup.

    data    : JSON text, or a parsed JSON object
    library : entries by shelf ('tools', 'machines', 'materials') for ``"lib:NAME"`` references

    Raises
    ------
    SetupError
        Code 'setup_not_json', 'repeated_key', 'bad_text', 'bad_setup' (``measured`` lists the problems, at most the
        first
        ``MAX_PROBLEMS_LISTED``, as {"at", "problem"}, ``subjects`` the places), or as ``check_blank``.
    """
    if isinstance(data, bytes | str):
        try:
            data = json.loads(data, object_pairs_hook=_without_repeats)
        except (ValueError, RecursionError) as error:
            raise SetupError(f"the setup is not JSON: {error}", code="setup_not_json",
                             remedy="send one JSON object that fits the schema Setup") from None
    try:
        json.dumps(data, ensure_ascii=False, default=str).encode()
    except UnicodeEncodeError as error:
        raise SetupError("the setup contains a lone surrogate, which is not a valid character", code="bad_text",
                         measured=ascii(error.object[max(0, error.start - 20):error.end + 20]),
                         remedy="send the text of the setup as UTF-8") from None
    try:
        setup = Setup.model_validate(data, context={"library": library or {}})
    except ValidationError as error:
        raise setup_error(error) from None
    check_blank(setup)
    return setup


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object with distinct names; the default parser hides a repeated name, which is a mistake."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise SetupError(f"the name {json.dumps(name)} occurs twice in one object of the setup",
                             code="repeated_key", subjects=(name,), measured=sum(n == name for n, _ in pairs), limit=1,
                             remedy="leave out one of them")
        found[name] = value
    return found


def blank_error(error: CamError) -> CamError:
    """An error of the part's STEP file, turned into the same error of the blank's file: same class, same code."""
    remedy = ("export the blank as a single body into a separate file" if error.code == "several_solids"
              else error.remedy)
    return type(error)(f"the blank: {error.message}", code=error.code, subjects=("stock.step_file", *error.subjects),
                       measured=error.measured, limit=error.limit, remedy=remedy)


def no_stock_file() -> SetupError:
    """Error: the blank is a STEP file, and no file is given."""
    return SetupError("stock.kind is 'step', but no STEP file of the blank is given", code="no_stock_file",
                      subjects=("stock.step_file",), remedy="set stock.step_file to a path relative to the setup; over "
                                                            "HTTP send the file as part 'stock' of the form")


def check_blank(setup: Setup) -> None:
    """Refuse a blank that leaves nothing to cut, or less than the allowance.

    A box enlarged by 0 still has stock in the pockets of the part. A part that fills the box wholly is found later.

    Raises
    ------
    SetupError
        Code 'no_stock' or 'allowance_beyond_stock'.
    """
    stock, allowance = setup.stock, setup.quality.stock_allowance_mm
    if stock.box_mm is not None or stock.cylinder_mm is not None or stock.kind == "step":
        return
    grown = stock.margin_mm + stock.uncertainty_mm
    offset = stock.kind == "part_offset"
    if offset and grown <= 0:
        raise SetupError("there is no stock to cut: stock.margin_mm and "
                         "stock.uncertainty_mm are both 0", code="no_stock",
                         subjects=("stock.margin_mm", "stock.uncertainty_mm"),
                         measured=grown, limit=0.0, remedy="set stock.margin_mm above 0, or give the real blank as a "
                                                           "box")
    if allowance > grown or (offset and allowance == grown):
        raise SetupError(f"quality.stock_allowance_mm {allowance:g} is not below the {grown:g} mm (margin_mm "
                         f"{stock.margin_mm:g} + uncertainty_mm {stock.uncertainty_mm:g}) of stock on the part",
                         code="allowance_beyond_stock",
                         subjects=("quality.stock_allowance_mm", "stock.margin_mm", "stock.uncertainty_mm"),
                         measured=allowance, limit=grown, remedy="reduce stock_allowance_mm, or increase "
                                                                 "stock.margin_mm")


def check_plannable(setup: Setup) -> None:
    """Refuse tools that jobs do not plan, and accesses that the machine cannot reach.

    Raises
    ------
    SetupError
        Code 'verify_only_tool', 'dogleg_rapids', 'no_gauge_length', 'no_inverse_time', 'no_rotary_zero',
        'access_out_of_reach', 'access_from_below', 'two_clampings'; as ``rotary_machine``.
    """
    others = [t for t in setup.tools if t.kind in VERIFIED_KINDS]
    if others:
        raise SetupError(f"jobs do not plan {', '.join(f'{t.id} ({t.kind})' for t in others)}; such tools are for "
                         "programs to be verified", code="verify_only_tool", subjects=tuple(t.id for t in others),
                         measured=[t.kind for t in others], limit=list(BUILT_KINDS),
                         remedy="leave these tools out of the setup of a job; zonemill verify and POST "
                                "/v1/verifications take them")
    machine = rotary_machine(setup.machine)
    if machine is not None:
        _check_turning(setup, machine)


def _check_turning(setup: Setup, machine: RotaryMachine) -> None:
    """Checks for a machine with rotary axes: rapids, lengths, limits, accesses, and a single clamping."""
    if setup.machine.rapid_motion == "dogleg" and (machine.tilts_head or machine.pivots is None):
        why = "a head that leans takes several linear axes up its tool" if machine.tilts_head else \
            "the way of a turn depends on the pivots"
        raise SetupError(f"on this machine each axis of a rapid moves at its own speed, and {why}",
                         code="dogleg_rapids", subjects=("machine.rapid_motion", "machine.pivots_mm"),
                         measured="dogleg", limit="linear",
                         remedy="set the control to linear rapids and set machine.rapid_motion 'linear'"
                                + ("" if machine.tilts_head else ", or give machine.pivots_mm"))
    if machine.tilts_head and not machine.tcp:
        bare = [t.id for t in setup.tools if not t.gauge_given]
        if bare:
            raise SetupError(f"tools {', '.join(bare)}: the head tilts the tool and the program contains joint "
                             "positions, so every tip depends on the length "
                             "from the spindle face", code="no_gauge_length",
                             subjects=tuple(bare), remedy="give the measured gauge_length_mm, tip to spindle face")
    if "heidenhain" in setup.machine.dialects and not machine.tcp and setup.machine.simultaneous:
        raise SetupError("a program of joint positions needs an inverse-time feed for cuts that turn an axis, and "
                         "heidenhain has none", code="no_inverse_time",
                         subjects=("machine.dialects", "machine.tcp"), measured=setup.machine.dialects,
                         remedy="set machine.tcp true so that the control keeps the tip (M128), or set "
                                "machine.simultaneous false")
    for letter, limits in zip(machine.letters, setup.machine.rotary_deg or (), strict=False):
        if not limits[0] <= 0.0 <= limits[1]:
            raise SetupError(f"machine.rotary_deg of {letter}, {limits[0]:g} to {limits[1]:g}, does not contain 0, the "
                             "angle of the setup frame and of tool changes", code="no_rotary_zero",
                             subjects=("machine.rotary_deg",), measured=limits, limit=0.0,
                             remedy="count the angle from the position in which the part stands as in the setup frame")
    for access in setup.access:
        axis = np.array([access.direction], dtype=np.float64)
        axis /= np.linalg.norm(axis)
        if not machine.stands(axis)[0]:
            both = np.degrees(machine.words(machine.turns(axis)[0])).round(3).tolist()
            raise SetupError(f"access {access.id}, tool axis {access.direction}, is outside the limits of the rotary "
                             "axes",
                             code="access_out_of_reach", subjects=(access.id, "machine.rotary_deg"), measured=both,
                             limit=setup.machine.rotary_deg,
                             remedy=f"{machine.letters} would need one of these angles; give another direction, or "
                                    "turn the setup frame by placement")
        if axis[0, 2] < LOWEST_AXIS:
            raise SetupError(f"access {access.id}, tool axis {access.direction}, points from below, where the table is",
                             code="access_from_below", subjects=(access.id,), measured=float(axis[0, 2]),
                             limit=LOWEST_AXIS, remedy="turn the part over in a separate clamping")
        if access.work_offset != setup.access[0].work_offset:
            raise SetupError(f"access {access.id} has work offset {access.work_offset} and {setup.access[0].id} has "
                             f"{setup.access[0].work_offset}; on a machine with rotary axes the part is clamped once",
                             code="two_clampings", subjects=(access.id,), measured=access.work_offset,
                             limit=setup.access[0].work_offset,
                             remedy="give all accesses the same work offset, or plan each clamping as a separate job")


def check_spindle_tool(setup: Setup, number: int) -> None:
    """Refuse a spindle tool that the setup lacks; 0 is none.

    Raises
    ------
    SetupError
        Code 'no_such_tool'.
    """
    known = sorted(t.number or 0 for t in setup.tools)
    if number != 0 and number not in known:
        raise SetupError(f"the setup has no tool T{number} for the spindle; it has "
                         f"{', '.join(f'T{n}' for n in known)}", code="no_such_tool", subjects=("spindle_tool",),
                         measured=number, limit=known, remedy="use one of them, or leave it out")


def machine_kinematics(machine: Machine) -> Kinematics | None:
    """Rotary axes of a machine as the proof needs them; None on a 3-axis machine."""
    if machine.kinematics is None:
        return None
    pivots = machine.pivots_mm
    return Kinematics(machine.kinematics, None if pivots is None else tuple((x, y, z) for x, y, z in pivots),
                      _sense(machine), None if machine.rotary_deg is None else _pair(machine.rotary_deg))


def _pair(limits: Sequence[Sequence[float]]) -> tuple[tuple[float, float], tuple[float, float]]:
    (low, high), (least, most) = limits
    return (low, high), (least, most)


def _sense(machine: Machine) -> tuple[int, int]:
    """For the tilting and the turning axis: 1 where a positive angle turns the table right-handed, else -1."""
    tilting = (machine.kinematics or "AC")[-2]
    named = machine.iso_axes or []
    return -1 if tilting in named else 1, -1 if "C" in named else 1


def rotary_machine(machine: Machine) -> RotaryMachine | None:
    """Rotary axes of a machine as the writers need them; None on a 3-axis machine.

    Raises
    ------
    SetupError
        Code 'no_pivots': the control does not keep the tip, and the setup has no pivots.
    """
    if machine.kinematics is None:
        return None
    pivots = None if machine.pivots_mm is None else tuple((x, y, z) for x, y, z in machine.pivots_mm)
    try:
        limits, sense = rotary_limits(machine), _sense(machine)
        return RotaryMachine(machine.kinematics, pivots, None if limits is None else program_limits(limits, sense),
                             machine.tcp, sense)
    except OutputError as refusal:
        raise SetupError(refusal.message, code=refusal.code, subjects=refusal.subjects,
                         remedy=refusal.remedy) from None


def rotary_limits(machine: Machine) -> NDArray[np.float64] | None:
    """Limits of the rotary axes in angles of programs.

    Returns (2, 2) float64, rad, least and greatest angle of the tilting and the turning axis, machine coordinates; None
    without limits.
    """
    return None if machine.rotary_deg is None else np.radians(machine.rotary_deg)


def read_setup(path: Path, library: Library | None = None) -> Setup:
    """Read a setup from a file; see ``parse_setup``.

    Raises
    ------
    SetupError
        The file cannot be read, or is not a setup.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise SetupError(f"the setup file {path.name} cannot be read: {error.strerror}",
                         code="setup_unreadable", remedy="check the path and the permissions") from None
    return parse_setup(text, library)


def problems_of(error: ValidationError, root: str = "setup") -> list[dict[str, str]]:
    """Every problem of a validation as {"at": place, "problem": sentence}, in the order of the document."""
    found = []
    for item in error.errors(include_url=False, include_context=False, include_input=False):
        at = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in item["loc"]).lstrip(".")
        if at == "tools" and item["type"] in ("missing", "too_short"):
            text = "the setup has no tools; it needs at least one"
        elif not at and item["type"] in OBJECT_WANTED:
            text = f"the {root} must be a JSON object"
        else:
            text = sentence(item["type"], item["msg"])
        found.append({"at": at or root, "problem": text})
    return found


def sentence(kind: str, message: str) -> str:
    """The text of a validation problem in terms of JSON; ``kind`` and ``message`` come from the validation."""
    if kind == "extra_forbidden":
        return "unknown field"
    if kind in OBJECT_WANTED:
        return "this must be a JSON object"
    return message.removeprefix("Value error, ")


def setup_error(error: ValidationError) -> SetupError:
    """The ``SetupError`` of a failed validation."""
    problems = problems_of(error)
    first, more = problems[0], f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    problems = problems[:MAX_PROBLEMS_LISTED]
    prefix = "" if first["at"] == "setup" else f"{first['at']}: "
    return SetupError(f"{prefix}{first['problem']}{more}", code="bad_setup",
                      subjects=tuple(p["at"] for p in problems), measured=problems,
                      remedy="correct these fields; lengths are mm, the schema is Setup in openapi.yaml")


def tool_body(tool: Tool) -> ToolBody:
    """The shape of one tool; lengths mm from the tip.

    Raises
    ------
    SetupError
        incomplete_tool: the tool has not been validated in a Setup.
    """
    number, flute, neck_d, neck_l, shank, stickout = (
        tool.number, tool.flute_length_mm, tool.neck_diameter_mm, tool.neck_length_mm, tool.shank_diameter_mm,
        tool.stickout_mm)
    if None in (number, flute, neck_d, neck_l, shank, stickout):
        raise SetupError(f"tool {tool.id} has not been completed by a Setup", subjects=(tool.id,))
    segments = tuple(HolderFrustum(s.diameter_mm, s.diameter_top_mm or s.diameter_mm, s.length_mm)
                     for s in tool.holder)
    named, lean = tool.kind in VERIFIED_KINDS, math.tan(math.radians(tool.taper_angle_deg))
    return ToolBody(tool.id, int(number or 0), tool.diameter_mm, tool.corner_radius_mm, float(flute or 0),
                    float(neck_d or 0), float(neck_l or 0), float(shank or 0), float(stickout or 0), segments,
                    tool.kind if named else "", tool.tip_diameter_mm or 0.0, tool.cone_height if named else 0.0,
                    0.0 if tool.kind == "barrel" else lean, tool.kind if tool.kind in SEGMENT_KINDS else "",
                    tool.profile_radius_mm or 0.0, lean if tool.kind == "barrel" else 0.0)


def tool_bodies(setup: Setup) -> tuple[ToolBody, ...]:
    """The shapes of all tools, in the order of the setup."""
    return tuple(tool_body(t) for t in setup.tools)


def gauge_lengths(tools: Sequence[Tool], bodies: Sequence[ToolBody]) -> dict[int, float]:
    """Distance from the spindle face to the tip, mm, by T number: stickout and holder where it is not given."""
    return {body.number: t.gauge_length_mm if t.gauge_length_mm is not None else
            body.stickout + sum(h.length for h in body.holder) for t, body in zip(tools, bodies, strict=True)}


def gauges_given(tools: Sequence[Tool]) -> frozenset[int]:
    """T numbers of the tools whose gauge length the setup states."""
    return frozenset(t.number for t in tools if t.gauge_given and t.number is not None)


def change_in_frame(change: Sequence[float] | None, *, level: bool) -> tuple[float, ...] | None:
    """Place of the spindle face at a tool change in the frame of a proof; nan in a frame that is not the setup frame.

    change : mm, setup frame, Z or X, Y and Z, or None
    level  : whether the frame of the proof is the setup frame

    In another frame the part is clamped anew, and the setup does not state where.

    >>> change_in_frame([100.0], level=True), change_in_frame([100.0], level=False)
    ((100.0,), (nan,))
    """
    return None if change is None else tuple(change) if level else (math.nan,) * len(change)


def face_numbers(ids: list[str]) -> tuple[int, ...]:
    """Face numbers of face ids: ``["F12"]`` gives ``(12,)``."""
    return tuple(int(i[1:]) for i in ids)


def material_name(setup: Setup) -> str:
    """Name of the material of a setup."""
    return str(getattr(setup.material, "name", None) or getattr(setup.material, "id", None) or "material")


def mesh_chord(quality: Quality) -> float:
    """Chord of the mesh, mm: its share of the scallop and of the gouge tolerance."""
    return float(np.clip(0.15 * quality.scallop_height_mm, 0.001, min(0.005, 0.4 * quality.gouge_tolerance_mm)))


def placement_of(setup: Setup) -> SetupFrame:
    """The setup frame in the coordinates of the file."""
    p = setup.placement
    return SetupFrame(origin=tuple(p.origin_mm), z_axis=tuple(p.z_axis), x_axis=tuple(p.x_axis))
