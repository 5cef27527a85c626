"""STEP-NC of either form as a program for the proof; the header of the file tells its form."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from geometry.errors import ProgramError
from geometry.tool_body import ToolBody
from verify.kinematics import Kinematics
from verify.program.program import Program, Remark
from verify.progress import Report, silent
from verify.stepnc import ap238, iso14649
from verify.stepnc.part21 import Part21File, is_exchange_file
from verify.stepnc.tool_motion import CutterMoves, CutterRecord, MotionRecorder

_PROFILE = re.compile(r"\b(lens|barrel) D[\d.]+ profile R([\d.]+)(?: ([\d.]+) deg)?")
SAME_SIZE = 1e-4  # mm, between sizes of a tool in the file and in the setup
SAME_ANGLE = 1e-3  # deg, between a taper in the file and in the setup
SAME_LENGTH = 1.0  # mm, between lengths from the spindle to the tip, which are measured at the machine

is_stepnc = is_exchange_file
"""Whether a text is STEP-NC and not NC code."""


def read_moves(text: str, *, name: str = "program") -> CutterMoves:
    """Tool motion of a STEP-NC file in the setup frame. Raises ProgramError as ``read_stepnc``."""
    return _recorder(text, name).moves()


def read_stepnc(text: str, *, name: str = "program", tools: Sequence[ToolBody] | None = None,
                kinematics: Kinematics | None = None, lengths: Mapping[int, float] | None = None,
                report: Report = silent) -> Program:
    """Read a STEP-NC file: AP238 [ISO10303-238] or ISO 14649 [ISO14649-10], by the FILE_SCHEMA of its header.

    tools      : tools of the setup. A tool of the file is matched by its number, or by its size where its id has no
                 number; other sizes give a remark. None: the numbers of the file are used.
    kinematics : rotary axes of the machine, or None
    lengths    : mm by T number, spindle face to tip, of the tools whose length the setup states; others give a remark
    report     : called with 0 to 1; an exception from it ends the reading

    Returns
    -------
    Program
        Tip moves in mm; lines are those of the points they end at.

    Raises
    ------
    ProgramError
        The text is not an exchange file or is incomplete; its schema is not one of STEP-NC; an instance (subjects:
        '#123') does not have the required form or moves the tool in an unknown way; a tool is not in the setup.
        Code program_too_long: more than 5 000 000 moves.
    """
    recorder = _recorder(text, name)
    report(0.9)
    numbers = []
    for place, cutter in enumerate(recorder.cutters):
        if tools is None:
            numbers.append(cutter.number if cutter.number is not None else place + 1)
        else:
            numbers.append(_known(recorder, cutter, tools))
            _compare_lengths(recorder, cutter, numbers[-1], (lengths or {}).get(numbers[-1]))
    program = recorder.program(numbers, kinematics)
    report(1.0)
    return program


def _recorder(text: str, name: str) -> MotionRecorder:
    file = Part21File(text.removeprefix("\ufeff"), name)
    recorder = MotionRecorder(name, file.lines)
    readers: list[tuple[frozenset[str], Callable[[Part21File, MotionRecorder], None]]] = [
        (iso14649.SCHEMAS, iso14649.read_iso14649), (ap238.SCHEMAS, ap238.read_ap238)]
    for schemas, read in readers:
        if schemas & set(file.schemas):
            try:
                read(file, recorder)
            except RecursionError:
                raise ProgramError(f"{name}: workplans or units contain themselves, or are nested too deeply",
                                   remedy="send a file without circular references") from None
            return recorder
    known = sorted(iso14649.SCHEMAS | ap238.SCHEMAS)
    raise ProgramError(f"{name} is a STEP file of schema {', '.join(file.schemas) or 'none'}, which is not STEP-NC",
                       subjects=("FILE_SCHEMA",), measured=list(file.schemas), limit=known,
                       remedy="send the program as NC code, AP238 or ISO 14649")


def _known(recorder: MotionRecorder, cutter: CutterRecord, tools: Sequence[ToolBody]) -> int:
    """T number of a tool of the file."""
    body = next((t for t in tools if t.number == cutter.number), None)
    if cutter.number is None:
        alike = [t for t in tools if not _differs(cutter, t)]
        if len(alike) == 1:
            recorder.notes.append(f"tool '{cutter.name}', #{cutter.instance}, has no number; its size matches "
                                  f"T{alike[0].number}")
            return alike[0].number
    if body is None:
        kind = cutter.kind.replace("_", " ")
        raise ProgramError(f"{recorder.name}, #{cutter.instance}: tool '{cutter.name}', {kind} of "
                           f"{cutter.diameter:g} mm, matches no tool of the setup, or several",
                           subjects=(f"#{cutter.instance}",), measured=cutter.number,
                           limit=sorted(t.number for t in tools),
                           remedy="begin the id of the tool with its number, and add that tool to the setup")
    if difference := _differs(cutter, body):
        recorder.remarks.append(Remark(0, f"T{body.number}, #{cutter.instance}, has {difference}: use the tool of the "
                                          "file in the setup"))
    return body.number


def _compare_lengths(recorder: MotionRecorder, cutter: CutterRecord, number: int, stated: float | None) -> None:
    """Find lengths of a tool of the file that contradict the one that the setup states: the tip would go elsewhere."""
    for word, there in [("assembly length", cutter.assembly_length), *(("tool offset", v) for v in cutter.offsets)]:
        if stated is not None and there is not None and abs(there - stated) > SAME_LENGTH:
            recorder.remarks.append(Remark(0, f"T{number}, #{cutter.instance}, has {word} {there:g} mm in the file and "
                                              f"gauge length {stated:g} mm in the setup: use one of both in file, "
                                              "setup and machine"))


def _differs(cutter: CutterRecord, body: ToolBody) -> str:
    """Differences between a tool of the file and one of the setup, in words; '' where there is none."""
    pairs = (("diameter", cutter.diameter, body.diameter), ("corner radius", cutter.corner_radius, body.corner_radius),
             ("flute length", cutter.flute_length, body.flute_length))
    found = [f"{word} {there:g} mm in the file and {here:g} mm in the setup" for word, there, here in pairs
             if there is not None and abs(there - here) > SAME_SIZE]
    if profile := _profile_differs(cutter, body):
        found.append(profile)
    elif not body.form and abs(cutter.taper - body.taper_deg) > SAME_ANGLE:
        found.append(f"taper {cutter.taper:g} deg in the file and {body.taper_deg:g} deg in the setup")
    return ", ".join(found)


def _profile_differs(cutter: CutterRecord, body: ToolBody) -> str:
    """Differences between the large arc of a tool in the words of the file and in the setup; '' where there is none."""
    stated = _PROFILE.search(cutter.words)
    there = (stated[1], float(stated[2]), float(stated[3] or 0.0)) if stated else ("", 0.0, 0.0)
    here = (body.form, body.profile_radius, body.taper_deg if body.form else 0.0)
    if there[0] == here[0] and abs(there[1] - here[1]) <= SAME_SIZE and abs(there[2] - here[2]) <= SAME_ANGLE:
        return ""
    texts = [f"{form} with profile R{radius:g}{f' and {angle:g} deg' if angle else ''}" if form else
             "no profile radius" for form, radius, angle in (there, here)]
    return f"{texts[0]} in the file and {texts[1]} in the setup"


__all__ = ["is_stepnc", "read_moves", "read_stepnc"]
