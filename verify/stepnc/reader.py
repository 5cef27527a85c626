"""STEP-NC of either form as a program for the proof; which form it is stands in the header of the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from geometry.errors import ProgramError
from geometry.tool_body import ToolBody
from verify.kinematics import Kinematics
from verify.program.program import Program, Remark
from verify.progress import Report, silent
from verify.stepnc import ap238, iso14649
from verify.stepnc.part21 import Part21File, is_exchange_file
from verify.stepnc.tool_motion import CutterMoves, CutterRecord, MotionRecorder

SAME_SIZE = 1e-4  # mm, between sizes of a tool in the file and in the setup

is_stepnc = is_exchange_file
"""Whether a text is to be read as STEP-NC and not as NC code."""


def read_moves(text: str, *, name: str = "program") -> CutterMoves:
    """What a STEP-NC file makes the tool do, in the setup frame; errors as of ``read_stepnc``."""
    return _recorder(text, name).moves()


def read_stepnc(text: str, *, name: str = "program", tools: Sequence[ToolBody] | None = None,
                kinematics: Kinematics | None = None, report: Report = silent) -> Program:
    """Read a STEP-NC file, AP238 or ISO 14649 by the FILE_SCHEMA of its header.

    tools      : those of the setup: the file's are known by their number, where its ids have none by their size, and a
                 tool of other sizes is remarked; None: numbers are those of the file
    kinematics : the machine's rotary axes; None on one without any
    report     : called with 0 to 1; what it raises ends the reading

    Returns
    -------
    Program
        Tip moves in mm; lines are those of the points they end at.

    Raises
    ------
    ProgramError
        The text is no exchange file or breaks off, its schema is none of STEP-NC, an instance is not what its form
        wants of it (subjects: '#123'), moves the tool in a way that is not read, or a tool is none of the setup's.
    VerificationError
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
                raise ProgramError(f"{name}: workplans or units hold themselves, or are too many in each other",
                                   remedy="send a file whose references come to an end") from None
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
            recorder.notes.append(f"tool '{cutter.name}', #{cutter.instance}, has no number; by its size it is "
                                f"T{alike[0].number}")
            return alike[0].number
    if body is None:
        raise ProgramError(f"{recorder.name}, #{cutter.instance}: tool '{cutter.name}', {cutter.kind} of "
                           f"{cutter.diameter:g} mm, is none of the setup's, or of several sizes alike",
                           subjects=(f"#{cutter.instance}",), measured=cutter.number,
                           limit=sorted(t.number for t in tools),
                           remedy="let the id of the tool open with its number, and give the setup that tool")
    if difference := _differs(cutter, body):
        recorder.remarks.append(Remark(0, f"T{body.number}, #{cutter.instance}, has {difference}: set up the tool the file was "
                                        "made for"))
    return body.number


def _differs(cutter: CutterRecord, body: ToolBody) -> str:
    """Words for what a tool of the file has other than one of the setup; '' where they are alike."""
    pairs = (("diameter", cutter.diameter, body.diameter), ("corner radius", cutter.corner_radius, body.corner_radius),
             ("flute length", cutter.flute_length, body.flute_length))
    return ", ".join(f"{word} {there:g} mm in the file and {here:g} mm in the setup" for word, there, here in pairs
                     if there is not None and abs(there - here) > SAME_SIZE)


__all__ = ["is_stepnc", "read_moves", "read_stepnc"]
