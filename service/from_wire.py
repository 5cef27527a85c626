"""From the wire to the plain values of the inner packages, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from geometry.errors import CamError, OutputError, SetupError
from geometry.tool_body import HolderFrustum, ToolBody
from output.inverse_kinematics import RotaryMachine, said_limits
from schemas.machine import Machine
from schemas.setup import Placement, Setup
from schemas.tools import Tool
from verify.kinematics import Kinematics

LOWEST_AXIS = -0.5  # Z of the unit tool axis: 30 degrees below level
OBJECT_WANTED = ("model_type", "model_attributes_type", "dict_type")
MOST_TOLD = 200  # problems of one setup, or of one request; a few megabytes can have a million
Library = Mapping[str, Mapping[str, Any]]


def parse_setup(data: bytes | str | Mapping[str, Any], library: Library | None = None) -> Setup:
    """Read a setup.

    data    : JSON text, or the object it stands for
    library : entries by shelf ('tools', 'machines', 'materials') for ``"lib:NAME"`` references

    Raises
    ------
    SetupError
        Code 'setup_not_json', 'repeated_key', 'bad_text', 'bad_setup' (``measured`` lists every problem, or the first
        ``MOST_TOLD``, as {"at", "problem"}, ``subjects`` the places), or as ``check_blank``.
    """
    if isinstance(data, bytes | str):
        try:
            data = json.loads(data, object_pairs_hook=_without_repeats)
        except (ValueError, RecursionError) as error:
            raise SetupError(f"the setup is not JSON: {error}", code="setup_not_json",
                             remedy="send one JSON object as described by the Setup schema") from None
    try:
        json.dumps(data, ensure_ascii=False, default=str).encode()
    except UnicodeEncodeError as error:
        raise SetupError("the setup holds half a character (a lone surrogate), which no text may", code="bad_text",
                         measured=ascii(error.object[max(0, error.start - 20):error.end + 20]),
                         remedy="write the text of the setup as UTF-8") from None
    try:
        setup = Setup.model_validate(data, context={"library": library or {}})
    except ValidationError as error:
        raise setup_error(error) from None
    check_blank(setup)
    return setup


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object whose names are all different; the usual reading, the last one counts, hides a mistake."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise SetupError(f"the name {json.dumps(name)} stands twice in one object of the setup",
                             code="repeated_key", subjects=(name,), measured=sum(n == name for n, _ in pairs), limit=1,
                             remedy="leave one of them out")
        found[name] = value
    return found


def of_blank(error: CamError) -> CamError:
    """The same error about the file of a blank: of the class and the code that it has about that of a part."""
    remedy = ("export the one body that is the blank to a file of its own" if error.code == "several_solids"
              else error.remedy)
    return type(error)(f"the blank: {error.message}", code=error.code, subjects=("stock.step_file", *error.subjects),
                       measured=error.measured, limit=error.limit, remedy=remedy)


def no_stock_file() -> SetupError:
    """The blank of a setup is a STEP file, and nobody says which."""
    return SetupError("the blank is a STEP file (stock.kind 'step') and none was given", code="no_stock_file",
                      subjects=("stock.step_file",), remedy="name it in stock.step_file, from the folder of the setup; "
                                                            "over HTTP send it as the part 'stock' of the form")


def check_blank(setup: Setup) -> None:
    """Refuse a blank grown from the part that leaves nothing to cut, or less than is to stay on the part.

    A box grown by 0 still holds stock in the pockets of the part; what fills a box wholly is found with the part.

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
        raise SetupError("nothing stands on the part that could be cut: stock.margin_mm and stock.uncertainty_mm are "
                         "both 0", code="no_stock", subjects=("stock.margin_mm", "stock.uncertainty_mm"),
                         measured=grown, limit=0.0, remedy="give a stock.margin_mm above 0, or the real blank as a box")
    if allowance > grown or (offset and allowance == grown):
        raise SetupError(f"quality.stock_allowance_mm {allowance:g} is not below the {grown:g} mm (margin_mm "
                         f"{stock.margin_mm:g} + uncertainty_mm {stock.uncertainty_mm:g}) of stock on the part",
                         code="allowance_beyond_stock",
                         subjects=("quality.stock_allowance_mm", "stock.margin_mm", "stock.uncertainty_mm"),
                         measured=allowance, limit=grown, remedy="leave less on the part, or give the blank a larger "
                                                                 "margin_mm")


def check_plannable(setup: Setup) -> None:
    """Refuse accesses the machine cannot turn to.

    Raises
    ------
    SetupError
        Code 'dogleg_rapids', 'no_gauge_length', 'no_inverse_time', 'no_rotary_zero',
        'access_out_of_reach', 'access_from_below', 'two_clampings'; as ``rotary_machine``.
    """
    machine = rotary_machine(setup.machine)
    if machine is not None:
        _check_turning(setup, machine)


def _check_turning(setup: Setup, machine: RotaryMachine) -> None:
    """Refuse what a job that turns cannot be planned for: rapids, lengths, limits, accesses, a second clamping."""
    if setup.machine.rapid_motion == "dogleg":
        raise SetupError("a job that turns needs rapids along straight lines; on this machine each axis runs at its "
                         "own speed, so where the tool is while it turns cannot be known", code="dogleg_rapids",
                         subjects=("machine.rapid_motion",), measured="dogleg", limit="linear",
                         remedy="set the control to linear rapids and say machine.rapid_motion 'linear', or plan on "
                                "three axes")
    if machine.tilts_head and not machine.tcp:
        bare = [t.id for t in setup.tools if not t.gauge_given]
        if bare:
            raise SetupError(f"tools {', '.join(bare)}: the head swings the tool and the program is of joints, so "
                             "every tip depends on the length from the spindle face", code="no_gauge_length",
                             subjects=tuple(bare), remedy="give gauge_length_mm as measured, tip to spindle face")
    if "heidenhain" in setup.machine.dialects and not machine.tcp and setup.machine.simultaneous:
        raise SetupError("cuts that turn an axis need an inverse-time feed where the program is of joints, and "
                         "heidenhain has none", code="no_inverse_time",
                         subjects=("machine.dialects", "machine.tcp"), measured=setup.machine.dialects,
                         remedy="say machine.tcp true and let the control keep the tip (M128), or set "
                                "machine.simultaneous false")
    for letter, limits in zip(machine.letters, setup.machine.rotary_deg or (), strict=False):
        if not limits[0] <= 0.0 <= limits[1]:
            raise SetupError(f"machine.rotary_deg of {letter}, {limits[0]:g} to {limits[1]:g}, leaves out 0, where the "
                             "setup frame lies and tools are changed", code="no_rotary_zero",
                             subjects=("machine.rotary_deg",), measured=limits, limit=0.0,
                             remedy="count the angle from where the part stands as in the setup frame")
    for access in setup.access:
        axis = np.array([access.direction], dtype=np.float64)
        axis /= np.linalg.norm(axis)
        if not machine.stands(axis)[0]:
            both = np.degrees(machine.words(machine.turns(axis)[0])).round(3).tolist()
            raise SetupError(f"access {access.id}, tool axis {access.direction}, cannot be turned to",
                             code="access_out_of_reach", subjects=(access.id, "machine.rotary_deg"), measured=both,
                             limit=setup.machine.rotary_deg,
                             remedy=f"{machine.letters} would have to stand at one of these; give another direction, "
                                    "or turn the setup frame by placement")
        if axis[0, 2] < LOWEST_AXIS:
            raise SetupError(f"access {access.id}, tool axis {access.direction}, comes from below: there the table is",
                             code="access_from_below", subjects=(access.id,), measured=float(axis[0, 2]),
                             limit=LOWEST_AXIS, remedy="turn the part over in a clamping of its own")
        if access.work_offset != setup.access[0].work_offset:
            raise SetupError(f"access {access.id} has work offset {access.work_offset} and {setup.access[0].id} has "
                             f"{setup.access[0].work_offset}: a machine with rotary axes holds the part once",
                             code="two_clampings", subjects=(access.id,), measured=access.work_offset,
                             limit=setup.access[0].work_offset,
                             remedy="give all accesses one work offset, or plan each clamping as a job of its own")


def check_spindle_tool(setup: Setup, number: int) -> None:
    """Refuse a tool in the spindle that the setup does not have; 0 is none.

    Raises
    ------
    SetupError
        Code 'no_such_tool'.
    """
    known = sorted(t.number or 0 for t in setup.tools)
    if number != 0 and number not in known:
        raise SetupError(f"the setup has no tool T{number} that could stand in the spindle; it has "
                         f"{', '.join(f'T{n}' for n in known)}", code="no_such_tool", subjects=("spindle_tool",),
                         measured=number, limit=known, remedy="name one of them, or leave it out")


def machine_kinematics(machine: Machine) -> Kinematics | None:
    """Rotary axes of a machine in the words of the proof; None on one of three axes."""
    if machine.kinematics is None:
        return None
    pivots = machine.pivots_mm
    return Kinematics(machine.kinematics, None if pivots is None else tuple((x, y, z) for x, y, z in pivots),
                      _sense(machine))


def _sense(machine: Machine) -> tuple[int, int]:
    """Whether the words of the tilting and the turning axis count as the table turns, 1, or the other way, -1."""
    tilting = (machine.kinematics or "AC")[-2]
    return -1 if tilting in machine.iso_axes else 1, -1 if "C" in machine.iso_axes else 1


def rotary_machine(machine: Machine) -> RotaryMachine | None:
    """Rotary axes of a machine in the words of the writers; None on one of three axes.

    Raises
    ------
    SetupError
        Code 'no_pivots': the control does not keep the tip, and nobody says where the rotary axes lie.
    """
    if machine.kinematics is None:
        return None
    pivots = None if machine.pivots_mm is None else tuple((x, y, z) for x, y, z in machine.pivots_mm)
    try:
        limits, sense = rotary_limits(machine), _sense(machine)
        return RotaryMachine(machine.kinematics, pivots, None if limits is None else said_limits(limits, sense),
                             machine.tcp, sense)
    except OutputError as refusal:
        raise SetupError(refusal.message, code=refusal.code, subjects=refusal.subjects,
                         remedy=refusal.remedy) from None


def rotary_limits(machine: Machine) -> NDArray[np.float64] | None:
    """(2, 2) float64, rad, least and greatest angle of the tilting and the turning axis, as programs say them; None
    where not limited."""
    return None if machine.rotary_deg is None else np.radians(machine.rotary_deg)


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
                         code="setup_unreadable", remedy="check the path and the permissions") from None
    return parse_setup(text, library)


def problems_of(error: ValidationError, root: str = "setup") -> list[dict[str, str]]:
    """Every problem of a validation as {"at": place, "problem": sentence}, in the order of the document."""
    found = []
    for item in error.errors(include_url=False, include_context=False, include_input=False):
        at = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in item["loc"]).lstrip(".")
        if at == "tools" and item["type"] in ("missing", "too_short"):
            text = "no tools are given; a setup needs at least one"
        elif not at and item["type"] in OBJECT_WANTED:
            text = f"the {root} is to be a JSON object"
        else:
            text = sentence(item["type"], item["msg"])
        found.append({"at": at or root, "problem": text})
    return found


def sentence(kind: str, message: str) -> str:
    """What a validation found, in the words of JSON; ``kind`` and ``message`` are those of the validation."""
    if kind == "extra_forbidden":
        return "unknown field"
    if kind in OBJECT_WANTED:
        return "this is to be a JSON object"
    return message.removeprefix("Value error, ")


def setup_error(error: ValidationError) -> SetupError:
    """The ``SetupError`` that says what a failed validation found."""
    problems = problems_of(error)
    first, more = problems[0], f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    problems = problems[:MOST_TOLD]
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
    segments = tuple(HolderFrustum(s.diameter_mm, s.diameter_top_mm or s.diameter_mm, s.length_mm)
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


def material_name(setup: Setup) -> str:
    """Name of the material of a setup."""
    return str(getattr(setup.material, "name", None) or getattr(setup.material, "id", None) or "material")
