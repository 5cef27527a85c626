"""Programs for LinuxCNC, by the name they have had from the beginning; the others go by ``output.gcode.program_writer``."""

from __future__ import annotations

from output.gcode.dialects.base import Switches
from output.gcode.dialects.linuxcnc import LinuxCnc
from output.gcode.program_writer import path_tolerance, write_program
from output.workplan import Workplan

LINE = LinuxCnc.line
"""Longest line of a program, characters."""


def write_linuxcnc(plan: Workplan) -> str:
    """The program of one access direction, or of one clamping, for LinuxCNC; see ``output.gcode.program_writer.write_program``."""
    return write_program(plan, LinuxCnc(Switches()))


__all__ = ["LINE", "path_tolerance", "write_linuxcnc"]
