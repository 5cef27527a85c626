"""STEP-NC of a proved job: written, read back and held against the program before any of it counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from geometry.errors import InputError, InternalError
from geometry.part import Part
from geometry.toolbody import ToolBody
from output.model import Workplan
from output.stepnc_aim import stream_stepnc_aim
from output.stepnc_arm import stream_stepnc_arm
from service.delivery import Files
from service.sides import Program
from verify.agree import check_agreement
from verify.model import NcProgram, ProofSetup
from verify.sequence import read_all

Stream = Callable[[Workplan, Callable[[str], object]], None]
FORMS: tuple[tuple[str, str, Stream], ...] = (
    ("stepnc", "stpnc", stream_stepnc_aim), ("stepnc-arm", "arm.stpnc", stream_stepnc_arm))
"""Kind and ending of the files of both forms, and what writes them."""


def stepnc_files(programs: Sequence[Program], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
                 out: Path) -> Files:
    """Both forms of STEP-NC of proved programs, as files beside their place in a folder.

    programs : each without a finding
    part, tools, setup : of the proof, as ``verify.prove.prove`` takes them

    Raises
    ------
    InternalError
        Code stepnc_differs, stepnc_unreadable: what was written is not read back as the program; no file stays.
    OutputError
        As the writers.
    """
    files: Files = {}
    try:
        for program in programs:
            (proved,) = read_all([program.given()], part, tools, setup, 0, _silent)
            for kind, ending, stream in FORMS:
                name = program.file_name("job", ending)
                path = out / f"{name}.part"
                files[name] = kind, "", None, path
                with open(path, "w", encoding="ascii", newline="\n") as file:
                    stream(program.work, file.write)
                given = NcProgram(name, path.read_text(encoding="ascii"), program.turn, program.work.work_offset)
                (read,) = read_all([given], part, tools, setup, 0, _silent)
                if remarks := read.program.remarks:
                    raise InternalError(f"{name} is not read back without a remark: {remarks[0].message}",
                                        code="stepnc_unreadable", subjects=(name,), measured=remarks[0].line,
                                        remedy="please report it with part and setup; nothing is delivered")
                check_agreement(proved.program, read.program)
    except BaseException as problem:
        for *_, written in files.values():
            with suppress(OSError):
                Path(str(written)).unlink(missing_ok=True)
        if isinstance(problem, InputError):  # of ours, not of the user's
            raise InternalError(f"what was written is not read back: {problem.message}", code="stepnc_unreadable",
                                subjects=problem.subjects, measured=problem.measured, limit=problem.limit,
                                remedy="please report it with part and setup; nothing is delivered") from None
        raise
    return files


def _silent(_share: float) -> None:
    """Nobody is told how far it is."""


__all__ = ["FORMS", "stepnc_files"]
