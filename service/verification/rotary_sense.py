"""What decides where a tool stands on the part, where the setup does not state it.

That is the sense of the rotary axes of a table, which the program may state, and the gauge lengths of tools under a
head that tilts. A wrong guess moves the tool aside, so neither is taken for granted in a program of others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from geometry.errors import CamError, SetupError
from verify.assumptions import Assumed, AssumedKind
from verify.kinematics import Kinematics
from verify.program.program import Program

SAME = 1e-6  # mm and of unit vectors: places and axes of two readings that are the same
_STATED = re.compile(r"Table axes:((?:,? [ABC] (?:right-handed|ISO 841))+)", re.IGNORECASE)


def sense_in_header(text: str, machine: Kinematics) -> Kinematics | None:
    """The machine with the sense that the header of a program of ours states; None where it states none.

    >>> sense_in_header("(Table axes: A right-handed, C ISO 841)", Kinematics("table-table-AC")).sense
    (1, -1)
    """
    found = _STATED.search(text)
    if found is None:
        return None
    words = dict(w.strip().split(" ", 1) for w in found[1].upper().split(","))
    if set(words) != set(machine.table_letters):
        return None
    tilting, turning = (-1 if words.get(letter) == "ISO 841" else 1 for letter in machine.letters)
    return replace(machine, sense=(tilting, turning))


def assumed_sense(machine: Kinematics, by: str) -> Assumed:
    """The entry of a report for a sense that the setup leaves open; ``by`` names who has chosen it."""
    words = [f"{letter} right-handed" if sense > 0 else f"{letter} ISO 841"
             for letter, sense in zip(machine.letters, machine.sense, strict=True) if letter in machine.table_letters]
    return Assumed(AssumedKind.ROTARY_SENSE, f"{', '.join(words)} ({by})",
                   "on a machine that counts an axis the other way the part tilts to the other side",
                   "state machine.iso_axes")


def check_sense(read: Program, machine: Kinematics, again: Callable[[Kinematics], Program]) -> None:
    """Refuse a program whose moves depend on the sense of a table axis that neither setup nor program states.

    read  : the program as ``machine`` has it
    again : reads it for another machine

    Raises
    ------
    SetupError
        Code rotary_sense_open; the measured value names the axes.
    """
    if read.poses is None:
        return
    asked = []
    for k, letter in enumerate(machine.letters):
        if letter not in machine.table_letters:
            continue
        tilting, turning = (-s if k == j else s for j, s in enumerate(machine.sense))
        try:
            other = again(replace(machine, sense=(tilting, turning)))
        except CamError:
            asked.append(letter)
            continue
        if not _same(read, other):
            asked.append(letter)
    if asked:
        names = " and ".join(asked)
        raise SetupError(f"the program turns {names} of the table, and the setup does not state which way a positive "
                         "angle turns the table: right-handed, or left-handed as ISO 841 counts it",
                         code="rotary_sense_open", subjects=("machine.iso_axes",), measured=asked,
                         remedy="set machine.iso_axes to the letters that follow ISO 841, [] for none; the manual of "
                                "the machine or a move in MDI shows it")


def check_gauges(read: Program, bare: Collection[int], again: Callable[[], Program]) -> None:
    """Refuse a program whose moves depend on gauge lengths that the setup does not state.

    read  : the program with the lengths that the setup has, or its defaults for them
    bare  : T numbers of the tools whose gauge length is a default
    again : reads it with other lengths of these tools

    Raises
    ------
    SetupError
        Code no_gauge_length; the subjects are the tools.
    """
    used = sorted(set(np.unique(read.tool).tolist()) & set(bare))
    if read.poses is None or not used or _same(read, again()):
        return
    names = tuple(f"T{n}" for n in used)
    raise SetupError(f"the head tilts {' and '.join(names)} without tool centre point control, so every tip depends on "
                     "the length from the spindle face, which the setup does not state", code="no_gauge_length",
                     subjects=names, remedy="give the measured gauge_length_mm, tip to spindle face")


def _same(a: Program, b: Program) -> bool:
    """Whether two readings move tip and tool axis alike."""
    if len(a) != len(b) or (a.poses is None) != (b.poses is None):
        return False
    pairs = [(a.start, b.start), (a.end, b.end)]
    if a.poses is not None and b.poses is not None:
        pairs += [(a.poses.start_axis, b.poses.start_axis), (a.poses.end_axis, b.poses.end_axis)]
    return all(np.allclose(x, y, rtol=0.0, atol=SAME, equal_nan=True) for x, y in pairs)


__all__ = ["assumed_sense", "check_gauges", "check_sense", "sense_in_header"]
