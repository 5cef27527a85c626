"""Reads the program of a verification before its part: a program that cannot be read is refused within seconds.

This module imports nothing that is compiled, so that the refusal comes at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from geometry.errors import SetupError
from schemas.machine import Machine
from schemas.setup import Setup
from service.from_wire import (
    change_in_frame,
    check_spindle_tool,
    gauge_lengths,
    gauges_given,
    machine_kinematics,
    tool_bodies,
)
from service.verification.rotary_sense import assumed_sense, check_gauges, check_sense, sense_in_header
from verify.assumptions import Assumed, AssumedKind
from verify.gcode.dialects import candidates, likeliest, others
from verify.kinematics import Kinematics
from verify.model import NcProgram
from verify.program.move_kinds import FEED
from verify.program.program import Program
from verify.program_reading import read_on, read_one
from verify.stepnc.part21 import is_exchange_file


@dataclass(frozen=True, eq=False)
class ProgramFirst:
    """A program that was read.

    nc     : its text, name and dialect
    read   : Program, its moves in its own frame
    access : id of the access in whose frame it is read; None: that of the job
    spindle_tool : T number in the spindle before its first line; 0 for none
    kinematics : rotary axes that it was read for; None on a machine of three axes
    assumed : what neither setup nor program states about how it is read
    whole  : the program read on through an end before its last lines; None where nothing follows its end
    """

    nc: NcProgram
    read: Program
    access: str | None
    spindle_tool: int
    kinematics: Kinematics | None = None
    assumed: tuple[Assumed, ...] = ()
    whole: Program | None = None


def read_first(setup: Setup, text: str, *, access: str | None = None, spindle_tool: int = 0,
               dialect: str | None = None, ending: str = "") -> ProgramFirst:
    """Read a program with the tools and the machine of a setup.

    access, spindle_tool, dialect, ending : as ``service.pipeline.verify_program``

    Raises
    ------
    SetupError
        ``no_such_access``, ``no_such_tool``, ``rotary_sense_open``, ``no_gauge_length``.
    ProgramError, VerificationError
        The program cannot be read, as ``verify.program_reading.read_one``.
    """
    known = {a.id: a for a in setup.access}
    if access is not None and access not in known:
        raise SetupError(f"the setup has no access {access}; it has {', '.join(known)}", code="no_such_access",
                         subjects=(access,), remedy="name one of them, or leave it out for the first")
    check_spindle_tool(setup, spindle_tool)
    own = known[access] if access is not None else setup.access[0]
    level = (access is None and machine_kinematics(setup.machine) is not None) or _up(own.direction)
    may = candidates(text, ending) if dialect is None else [dialect]
    nc = NcProgram("program", text, dialect=dialect or likeliest(may, setup.machine.dialects))
    tools, machine = tool_bodies(setup), machine_kinematics(setup.machine)
    gauges, assumed = gauge_lengths(setup.tools, tools), list[Assumed]()
    teeth = {body.number: t.flutes for t, body in zip(setup.tools, tools, strict=True)}

    def reading(of: Kinematics | None, program: NcProgram = nc, longer: Mapping[int, float] | None = None) -> Program:
        return read_one(program, tools, work_offset=own.work_offset, gouge_tolerance=setup.quality.gouge_tolerance_mm,
                        kinematics=of, gauge_length={**gauges, **(longer or {})}, spindle_tool=spindle_tool,
                        change=change_in_frame(setup.machine.change_position, level=level),
                        gauge_given=gauges_given(setup.tools), teeth=teeth,
                        max_feed=setup.machine.max_feed_mm_min)

    if dialect is None and not is_exchange_file(text):
        assumed.extend(_assumed_dialect(nc.dialect, others(may, _stated_dialects(setup))))
    turned = machine if setup.machine.iso_axes is None and not is_exchange_file(text) else None
    stated = None if turned is None else sense_in_header(text, turned)
    read = reading(stated or machine)
    if turned is not None and stated is None:
        check_sense(read, turned, reading)
    elif stated is not None and read.poses is not None:
        assumed.append(assumed_sense(stated, "as the program says"))
    if machine is not None and machine.tilts_head and not is_exchange_file(text):
        bare = {body.number: gauges[body.number] + 1.0 for t, body in zip(setup.tools, tools, strict=True)
                if not t.gauge_given}
        check_gauges(read, bare, lambda: reading(stated or machine, longer=bare))
    if setup.machine.coolant == "flood" and not read.cools and (read.kind == FEED).any():
        assumed.append(Assumed(AssumedKind.COOLANT, "off", "machine.coolant is flood and the program has no word for "
                               "it: cutting data for coolant do not hold, and chips may stay",
                               "program M8 or M9, or state machine.coolant off"))
    whole = read_on(nc, read, lambda program: reading(stated or machine, program))
    return ProgramFirst(nc, read, access, spindle_tool, stated or machine, tuple(assumed), whole)


def _up(direction: Sequence[float]) -> bool:
    """Whether a direction is +Z, so that the frame of its access is the setup frame."""
    return not any(direction[:2]) and direction[2] > 0


def _stated_dialects(setup: Setup) -> list[str]:
    """The controls that the setup states; the default counts as none."""
    return [] if setup.machine.dialects == Machine().dialects else setup.machine.dialects


def _assumed_dialect(taken: str, others: tuple[str, ...]) -> Iterator[Assumed]:
    if others:
        yield Assumed(AssumedKind.DIALECT, taken, f"the program may be for {' or '.join(others)}, which read some "
                      "words otherwise", "name the control by verify --dialect or by the ending of the file (.ngc), "
                      "or state another one in machine.dialects")


__all__ = ["ProgramFirst", "read_first"]
