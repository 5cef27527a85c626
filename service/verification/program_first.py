"""Reads the program of a verification before its part: a program that cannot be read is refused within seconds.

This module imports nothing that is compiled, so that the refusal comes at once.
"""

from __future__ import annotations

from dataclasses import dataclass

from geometry.errors import SetupError
from schemas.setup import Setup
from service.from_wire import check_spindle_tool, gauge_lengths, machine_kinematics, tool_bodies
from verify.gcode.dialects import dialect_of
from verify.model import NcProgram
from verify.program.program import Program
from verify.program_reading import read_one


@dataclass(frozen=True, eq=False)
class ProgramFirst:
    """A program that was read.

    nc     : its text, name and dialect
    read   : Program, its moves in its own frame
    access : id of the access in whose frame it is read; None: that of the job
    spindle_tool : T number in the spindle before its first line; 0 for none
    """

    nc: NcProgram
    read: Program
    access: str | None
    spindle_tool: int


def read_first(setup: Setup, text: str, *, access: str | None = None, spindle_tool: int = 0,
               dialect: str | None = None, ending: str = "") -> ProgramFirst:
    """Read a program with the tools and the machine of a setup.

    access, spindle_tool, dialect, ending : as ``service.pipeline.verify_program``

    Raises
    ------
    SetupError
        ``no_such_access``, ``no_such_tool``.
    ProgramError, VerificationError
        The program cannot be read, as ``verify.program_reading.read_one``.
    """
    known = {a.id: a for a in setup.access}
    if access is not None and access not in known:
        raise SetupError(f"the setup has no access {access}; it has {', '.join(known)}", code="no_such_access",
                         subjects=(access,), remedy="name one of them, or leave it out for the first")
    check_spindle_tool(setup, spindle_tool)
    own = known[access] if access is not None else setup.access[0]
    nc = NcProgram("program", text, dialect=dialect or dialect_of(text, ending, setup.machine.dialects))
    tools = tool_bodies(setup)
    read = read_one(nc, tools, work_offset=own.work_offset, gouge_tolerance=setup.quality.gouge_tolerance_mm,
                    kinematics=machine_kinematics(setup.machine), gauge_length=gauge_lengths(setup.tools, tools),
                    spindle_tool=spindle_tool)
    return ProgramFirst(nc, read, access, spindle_tool)


__all__ = ["ProgramFirst", "read_first"]
