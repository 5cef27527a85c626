"""A program as moves, before anything is known of the part: a program that cannot be read is refused first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from geometry.tool_body import ToolBody
from verify.gcode.reader import Program, read_program
from verify.kinematics import Kinematics
from verify.model import NcProgram
from verify.progress import Report, silent
from verify.stepnc.part21 import is_exchange_file

BLEND = 0.001  # mm, deviation that G64 may allow; the error bound includes it
BLEND_SHARE = 0.1  # of the gouge tolerance: allowed instead where that is more


def read_one(nc: NcProgram, tools: Sequence[ToolBody], *, work_offset: str = "G54", gouge_tolerance: float = 0.01,
             kinematics: Kinematics | None = None, gauge_length: Mapping[int, float] | None = None,
             spindle_tool: int = 0, report: Report = silent) -> Program:
    """Read one program, NC text or STEP-NC, in its own frame.

    work_offset     : of the setup; that of the program counts where it has one
    gouge_tolerance : mm
    kinematics, gauge_length, spindle_tool, report : as ``verify.gcode.reader.read_program``

    Raises
    ------
    ProgramError, VerificationError
        As ``verify.gcode.reader.read_program`` and ``verify.stepnc.reader.read_stepnc``.
    """
    if is_exchange_file(nc.text):
        from verify.stepnc.reader import read_stepnc  # its tables take a tenth of a second to import

        return read_stepnc(nc.text, name=nc.name, tools=tools, kinematics=kinematics, report=report)
    return read_program(
        nc.text, name=nc.name, tools=frozenset(t.number for t in tools), work_offset=nc.work_offset or work_offset,
        blend_limit=max(BLEND, BLEND_SHARE * gouge_tolerance), kinematics=kinematics,
        gauge_length=gauge_length, spindle_tool=spindle_tool, report=report, dialect=nc.dialect,
        radii={t.number: t.radius for t in tools}, names={t.id: t.number for t in tools})
