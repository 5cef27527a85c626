"""A program as moves, before anything is known of the part: a program that cannot be read is refused first."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

from geometry.errors import CamError
from geometry.tool_body import ToolBody
from verify.gcode.program_text import cleaned
from verify.gcode.reader import Program, read_program
from verify.kinematics import Kinematics
from verify.model import NcProgram
from verify.program.arc_chords import CHORD
from verify.progress import Report, silent
from verify.stepnc.part21 import is_exchange_file

_STOPS = r"M0*(?:2|30)(?![0-9.])|^\s*%\s*$"
_ENDS = {"siemens": rf"{_STOPS}|(?<![A-Z_0-9$\"])(?:M17|RET|GOTOS)(?![A-Z_0-9=(])",
         "heidenhain": rf"{_STOPS}|END PGM.*"}
_M99 = rf"{_STOPS}|M99(?![0-9.])"  # of the other controls
MAX_ENDS = 8  # ends within one text that are read through
BLEND = 0.001  # mm, deviation that G64 may allow; the error bound includes it
BLEND_SHARE = 0.1  # of the gouge tolerance: allowed instead where that is more
CHORD_SHARE, FINEST_CHORD = 0.25, 2e-4  # of the gouge tolerance, and mm: chords of arcs under a fine one


def read_one(nc: NcProgram, tools: Sequence[ToolBody], *, work_offset: str = "G54", gouge_tolerance: float = 0.01,
             kinematics: Kinematics | None = None, gauge_length: Mapping[int, float] | None = None,
             spindle_tool: int = 0, report: Report = silent, change: Sequence[float] | None = None,
             gauge_given: Collection[int] = (), teeth: Mapping[int, int] | None = None,
             max_feed: float | None = None) -> Program:
    """Read one program, NC text or STEP-NC, in its own frame.

    work_offset     : of the setup; that of the program counts where it has one
    gouge_tolerance : mm
    gauge_given     : T numbers of the tools whose gauge length was measured
    kinematics, gauge_length, spindle_tool, report, change, teeth, max_feed : as ``verify.gcode.reader.read_program``

    Raises
    ------
    ProgramError, VerificationError
        As ``verify.gcode.reader.read_program`` and ``verify.stepnc.reader.read_stepnc``.
    """
    if is_exchange_file(nc.text):
        from verify.stepnc.reader import read_stepnc  # its tables take a tenth of a second to import

        stated = {n: g for n, g in (gauge_length or {}).items() if n in gauge_given}
        return read_stepnc(nc.text, name=nc.name, tools=tools, kinematics=kinematics, lengths=stated, report=report)
    return read_program(
        nc.text, name=nc.name, tools=frozenset(t.number for t in tools), work_offset=nc.work_offset or work_offset,
        blend_limit=max(BLEND, BLEND_SHARE * gouge_tolerance), kinematics=kinematics,
        gauge_length=gauge_length, spindle_tool=spindle_tool, report=report, dialect=nc.dialect,
        radii={t.number: t.radius for t in tools}, names={t.id: t.number for t in tools}, change=change,
        teeth=teeth, max_feed=max_feed,
        lengths={t.number: gauge_length[t.number] for t in tools if gauge_length and t.number in gauge_length
                 and (t.holder or t.number in gauge_given)}, measured=gauge_given,
        chord=min(CHORD, max(CHORD_SHARE * gouge_tolerance, FINEST_CHORD)))


def read_on(nc: NcProgram, read: Program, reading: Callable[[NcProgram], Program]) -> Program | None:
    """The program read on through ends that stand before its last lines.

    read    : the program as it runs; reading : reads another text in the same way

    Returns None where no lines follow an end, or where they cannot be read so.
    """
    whole, lines = read, cleaned(nc.text).split("\n")
    ends = re.compile(_ENDS.get(nc.dialect, _M99), re.IGNORECASE)
    for _ in range(MAX_ENDS):
        if not whole.cut_off:
            break
        end = ends.search(lines[whole.cut_off - 1])
        if end is None:
            return None
        lines[whole.cut_off - 1] = ends.sub("", lines[whole.cut_off - 1])
        last = next(k for k in range(len(lines), 0, -1) if lines[k - 1].strip() not in ("", "%"))
        for text in (lines, [*lines[:last], end[0]]):  # the last lines may have an end of their own, or none
            try:
                whole = reading(replace(nc, text="\n".join(text)))
                break
            except CamError:
                continue
        else:
            return None
    return None if whole is read or len(whole) <= len(read) else whole
