"""Translates programs of other controls, block by block, into the words of the one reader.

``verify.gcode.reader`` runs one modal machine with the words of LinuxCNC. A control with other words has a file here
that translates its blocks. It refuses by name a word that it does not know or that could be read in two ways, and drops
only words without effect on a move. Lines keep their numbers.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence

from verify.gcode.block_words import BlockError
from verify.gcode.dialects.base import DialectReader, Machine
from verify.gcode.dialects.fanuc import FanucReader
from verify.gcode.dialects.haas import HaasReader
from verify.gcode.dialects.heidenhain.heidenhain import HeidenhainReader, is_conversational
from verify.gcode.dialects.siemens.siemens import SiemensReader, is_siemens
from verify.program.move_log import MAX_ERRORS, Log

LINUXCNC = "linuxcnc"
CONTROLS: dict[str, type[DialectReader]] = {
    "fanuc": FanucReader, "haas": HaasReader, "siemens": SiemensReader, "heidenhain": HeidenhainReader}
"""Readers by dialect; ``LINUXCNC`` needs none."""

OWN_SPEED_RAPIDS = frozenset({"fanuc", "haas"})
"""Controls on which each axis of a rapid moves at its own speed unless a parameter or setting says otherwise: Fanuc's
parameter 1401#1 (LRP), Haas's setting 335. LinuxCNC, Siemens and Heidenhain interpolate rapids."""

_IDLE = re.compile(r"\([^()]*\)|;.*|^\s*/?[NO:][0-9]+|[%\s]")
"""What is no word of a block."""

NEWS = " "
"""A block without words that keeps the next one off the fast path."""

DIALECTS = (LINUXCNC, *CONTROLS)
"""All dialects that can be read."""

ENDINGS = {"ngc": (LINUXCNC,), "mpf": ("siemens",), "spf": ("siemens",), "h": ("heidenhain",), "nc": ("fanuc", "haas")}
"""Extensions of file names, without the point and in lower case, and the dialects that use them."""


def translated_blocks(lines: Sequence[str], control: DialectReader, machine: Machine) -> Iterator[tuple[int, str]]:
    """Blocks with the numbers of their lines, from 1; a line that cannot be read becomes an error of the log.

    control : the reader of the words; machine : the reader that runs the blocks
    """
    log, frame = machine.log, control.frame
    try:
        for number, raw in control.order(lines, machine):
            log.line = number
            try:
                blocks = control.blocks(raw)
            except BlockError as problem:
                log.error(str(problem), problem.line or number, remedy=problem.remedy)
                if len(log.errors) >= MAX_ERRORS:
                    return
                continue
            if control.frame is not frame:
                frame = control.frame
                yield number, NEWS
            if control.notes or control.remarks or control.functions:
                _report(control, number, log)
            log.unbounded = control.unbounded
            if not blocks:
                log.passed.add(number)
            elements = machine.elements
            for block in blocks:
                yield block if isinstance(block, tuple) else (number, block)
            machine.idle += machine.elements == elements and bool(_IDLE.sub("", raw))
    except BlockError as problem:
        log.error(str(problem), log.line or 1, remedy=problem.remedy)


def _report(control: DialectReader, number: int, log: Log) -> None:
    """Pass on what a control notes and remarks on a line."""
    for note in control.notes:
        log.note(note)
    for remark in control.remarks:
        log.remark("control", remark, remark, number)
    for function in control.functions:
        log.functions.setdefault(function, number)
    control.functions.clear()
    control.notes.clear()
    control.remarks.clear()


def dialect_of(text: str, ending: str = "", wanted: Collection[str] = ()) -> str:
    """Dialect of a text: by its own marks, its file name, or the controls of the machine.

    ending : extension of the file name, without the point, '' where there is none
    wanted : controls of the machine, the likeliest first

    >>> dialect_of("0 BEGIN PGM PART MM")
    'heidenhain'
    >>> dialect_of("G54 ; zero\\nTRAORI")
    'siemens'
    >>> dialect_of("G21 G90", "nc", ["haas"]), dialect_of("G21 G90", "nc", ["linuxcnc"])
    ('haas', 'linuxcnc')
    """
    return likeliest(candidates(text, ending), wanted)


def likeliest(may: Sequence[str], wanted: Collection[str]) -> str:
    """The dialect to read a text in that ``candidates`` leaves these for; ``wanted`` as for ``dialect_of``.

    >>> likeliest(candidates("G21 G90", "nc"), ["siemens"]), likeliest(candidates("G21 G90", "ngc"), ["siemens"])
    ('siemens', 'linuxcnc')
    """
    left = _left(may, wanted)
    return left[0] if len(left) == 1 or not set(left).isdisjoint(wanted) else LINUXCNC


def _left(may: Sequence[str], wanted: Collection[str]) -> list[str]:
    """The dialects that nothing decides against, the likeliest first.

    A machine without any of ``may`` runs what it is for, unless the name of the file says otherwise.
    """
    named = [d for d in wanted if d in may]
    own = [d for d in wanted if d in ("siemens", "heidenhain")] if len(may) > 1 and LINUXCNC not in wanted else []
    return named or own or list(may)


def others(may: Sequence[str], wanted: Collection[str]) -> tuple[str, ...]:
    """The dialects besides ``likeliest`` that nothing decides against; arguments as there.

    >>> others(candidates("G21 G90", "nc"), ["haas"]), others(candidates("G21 G90", "ngc"), [])
    ((), ())
    >>> others(candidates("G21 G90", "nc"), []), others(candidates("G21 G90", "nc"), ["fanuc", "haas"])
    (('fanuc', 'haas'), ('haas',))
    >>> others(candidates("G21 G90", "nc"), ["siemens"]), others(candidates("G21 G90", ""), ["siemens"])
    (('fanuc', 'haas'), ())
    """
    taken = likeliest(may, wanted)
    named = may if taken not in may and LINUXCNC not in may else []  # by the name of the file
    return tuple(d for d in dict.fromkeys([*_left(may, wanted), *named]) if d != taken)


def candidates(text: str, ending: str) -> list[str]:
    """The dialects that marks and file name leave, the likeliest first; one search of the whole text."""
    text = text.removeprefix("\ufeff")
    if is_conversational(text):
        return ["heidenhain"]
    if is_siemens(text):
        return ["siemens"]
    may = ENDINGS.get(ending.lower().removeprefix("."), DIALECTS)
    # a text without their marks is not a Siemens or Heidenhain program, unless its name says so
    return [d for d in may if len(may) == 1 or d not in ("siemens", "heidenhain")]


__all__ = ["CONTROLS", "DIALECTS", "ENDINGS", "LINUXCNC", "OWN_SPEED_RAPIDS", "candidates", "dialect_of", "likeliest",
           "others", "translated_blocks"]
