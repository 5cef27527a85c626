"""Are two programs the same to the part? Move for move, so that the proof of one is the proof of the other.

Compared is what a reading gives: where the tip goes, how the tool stands, rapid or feed, how long a feed move takes,
the tool, its speed, the coolant, dwells, and what is unknown of a way; how the machine is left where a tool is changed,
where somebody is waited for, and at the end; and what is taken for granted. Moves that go nowhere are left out on both
sides, for controls differ in how they say "home". How far a path is left is compared where both programs bound it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InternalError, ProgramError
from geometry.mesh import F64
from geometry.part import Part
from geometry.toolbody import ToolBody
from verify.dialects import CONTROLS
from verify.model import NcProgram, ProofSetup
from verify.program import Pause, Program
from verify.progress import Report, Stages, silent
from verify.sequence import read_all

TIP = 1e-3
"""mm between two tips that are one."""
AXIS = 1e-6
"""Between unit vectors of two tool axes that are one."""
RATE = 1e-9
"""Between two feeds that are one, as a share."""


def difference(proved: Program, other: Program) -> str:
    """What the second program does otherwise than the first, in words with lines of both; '' where nothing.

    Neither program is simulated. Remarks of the second that the first has not are a difference too.
    """
    had = {r.message for r in proved.remarks}
    for remark in other.remarks:
        if remark.message not in had:
            return f"line {remark.line} of {other.name}: {remark.message}"
    if proved.dwell != other.dwell:
        return f"{other.name} waits {other.dwell:g} s, {proved.name} {proved.dwell:g} s"
    if taken := [word for word in other.assumed if word not in proved.assumed]:
        return f"{other.name} does not say {', '.join(taken)} before its first move"
    if other.unbounded and other.dialect in CONTROLS and CONTROLS[other.dialect].bounds_path:
        return f"{other.name} does not bound what the control leaves the path by"
    if not (other.unbounded or proved.unbounded) and other.blend > proved.blend + 1e-12:
        return (f"{other.name} lets the control leave the path by {other.blend:g} mm, {proved.name} by "
                f"{proved.blend:g} mm")
    mine, yours = _moving(proved), _moving(other)
    n = min(len(mine), len(yours))
    compared = _compared(proved, other, mine[:n], yours[:n])
    off = np.flatnonzero(np.any([unlike for _, unlike in compared], axis=0))
    if len(off):
        k = int(off[0])
        return (f"line {other.line[yours[k]]} of {other.name} and line {proved.line[mine[k]]} of {proved.name} "
                f"differ in {', '.join(what for what, unlike in compared if unlike[k])}")
    if len(mine) != len(yours):
        more = proved if len(mine) > n else other
        row = int((mine if len(mine) > n else yours)[n])
        return f"line {more.line[row]} of {more.name} has no counterpart"
    return _careless(proved) or _careless(other) or _paused(proved, other, mine, yours)


def _careless(p: Program) -> str:
    """Where a program changes a tool, or ends, as none that is written here does; '' where nowhere.

    A fresh cutter is put in by hand: on every control the spindle is away from the part then.
    """
    control, changes = CONTROLS.get(p.dialect), 0
    for pause in p.pauses:
        least = 0 if pause.what in ("M0", "M1") else None if control is None else control.home_from
        if least is not None and (changes >= least or pause.what != "tool change"):
            if not pause.home:
                return f"line {pause.line} of {p.name}: {pause.what}, and the spindle was not sent home before"
            if control is not None and control.gives_up_length and pause.counted:
                return f"line {pause.line} of {p.name}: {pause.what}, and the length offset is not off"
        changes += pause.what == "tool change"
    return ""


def _paused(proved: Program, other: Program, mine: NDArray[np.int64], yours: NDArray[np.int64]) -> str:
    """The first pause that the programs do not make alike, after the same of the moves given; '' where none."""
    def told(pause: Pause, moving: NDArray[np.int64]) -> tuple[object, ...]:
        tool = pause.tool if pause.what == "tool change" else 0
        return (pause.what, tool, int(np.searchsorted(moving, pause.moves)), pause.speed, pause.coolant, pause.tcp,
                pause.relative)

    # LinuxCNC puts the old tool away to take a fresh one by the same number
    first, second = ([x for x in p.pauses if x.what != "tool change" or x.tool] for p in (proved, other))
    for a, b in zip(first, second, strict=False):
        if told(a, mine) != told(b, yours):
            return (f"line {b.line} of {other.name} ({b.what}) and line {a.line} of {proved.name} ({a.what}) differ in "
                    "what is left running, or in where they stand")
    if len(first) != len(second):
        more, rest = (proved, first) if len(first) > len(second) else (other, second)
        pause = rest[min(len(first), len(second))]
        return f"line {pause.line} of {more.name} ({pause.what}) has no counterpart"
    return ""


def _moving(p: Program) -> NDArray[np.int64]:
    """Rows that go somewhere, or whose way there is not known."""
    moves = (p.start != p.end).any(axis=1)
    if p.poses is not None:
        moves |= (p.poses.start_turn != p.poses.end_turn).any(axis=1)
    moves[p.unknown[:, 0]] = True
    return np.flatnonzero(moves)


def _compared(a: Program, b: Program, i: NDArray[np.int64],
              j: NDArray[np.int64]) -> list[tuple[str, NDArray[np.bool_]]]:
    """What is compared, and for which pairs of rows it differs."""
    def far(one: F64, other: F64, limit: float) -> NDArray[np.bool_]:
        return np.asarray(~(np.linalg.norm(one[i] - other[j], axis=1) <= limit))

    def unlike(one: F64, other: F64) -> NDArray[np.bool_]:
        x, y = one[i], other[j]
        return np.asarray(~((np.abs(x - y) <= RATE * np.abs(x)) | (np.isnan(x) & np.isnan(y))))

    out = [("rapid or feed", a.kind[i] != b.kind[j]), ("the tool", a.tool[i] != b.tool[j]),
           ("where the move begins", far(a.start, b.start, TIP)), ("where the move ends", far(a.end, b.end, TIP)),
           ("what is known of the way", _unknown(a)[i] != _unknown(b)[j])]
    for what, one, other in (("the tool axis before the move", _axes(a, True), _axes(b, True)),
                             ("the tool axis after the move", _axes(a, False), _axes(b, False))):
        out.append((what, far(one, other, AXIS)))
    if a.poses is not None and b.poses is not None:
        out.append(("where the rotary axes stand", far(a.poses.end_turn, b.poses.end_turn, AXIS)))
    # what a block takes is rounded with its places
    slack = 1e-9 + TIP / np.maximum(np.nan_to_num(a.feed[i], nan=1.0), 1.0)
    took = ~((np.abs(a.minutes[i] - b.minutes[j]) <= slack) | (np.isnan(a.minutes[i]) & np.isnan(b.minutes[j])))
    return [*out, ("the feed", unlike(a.feed, b.feed)), ("the time they take", took),
            ("the speed of the spindle", unlike(a.speed, b.speed)), ("the coolant", a.coolant[i] != b.coolant[j])]


def _unknown(p: Program) -> NDArray[np.int64]:
    out = np.zeros(len(p), np.int64)
    out[p.unknown[:, 0]] = p.unknown[:, 1]
    return out


def _axes(p: Program, at_start: bool) -> F64:
    if p.poses is None:
        return np.tile([0.0, 0.0, 1.0], (len(p), 1))
    return p.poses.start_axis if at_start else p.poses.end_axis


def carried(proved: NcProgram, twins: Sequence[NcProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
            report: Report = silent) -> list[str]:
    """Carry the proof of a program over to others that shall be the same.

    proved  : a program without a finding;  twins : the others, in the same frame
    part, tools, setup : of the proof, as ``verify.prove.prove`` takes them
    report  : called with the share done, 0 to 1

    Returns what should be known of the readings of the others and is no difference.

    Raises
    ------
    InternalError
        Code programs_differ: one of them does otherwise, or cannot be read; the message names both lines.
    """
    if not twins:
        return []
    stages, share, notes = Stages(report), 1.0 / (len(twins) + 1), []
    (first,) = read_all([proved], part, tools, setup, 0, stages.span(0.0, share))
    for k, twin in enumerate(twins, 1):
        try:
            (other,) = read_all([twin], part, tools, setup, 0, stages.span(k * share, (k + 1) * share))
            told = difference(first.program, other.program)
        except ProgramError as refusal:
            told = refusal.message
        if told:
            raise InternalError(f"{twin.name} is not the program that was proved: {told}", code="programs_differ",
                                subjects=(proved.name, twin.name), measured=told,
                                remedy="please report it with part and setup; nothing is delivered")
        notes += [f"{twin.name}: {note}" for note in other.program.notes]
    return notes


__all__ = ["AXIS", "TIP", "carried", "difference"]
