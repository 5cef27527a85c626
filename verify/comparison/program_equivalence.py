"""Compares two programs move for move: where they are equivalent, the proof of one is the proof of the other.

Compared are, from the readings of both: tip, tool axis, rapid or feed, time of a feed move, tool, spindle speed,
coolant, dwells, and unknown starts of moves; the state of the machine at tool changes, stops and the end; and assumed
words. Moves of length 0 are left out on both sides, since controls write "home" differently. The allowed deviation from
the path is compared where both programs bound it.

An arc is read as chords. Two controls may round the words of the same arc differently, so that one reading has a chord
more. Such a block is compared as a whole, its chords as lines in space.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InternalError, ProgramError
from geometry.mesh import F64
from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.checks.program_sequence import read_all
from verify.gcode.dialects import CONTROLS
from verify.model import NcProgram, ProofSetup
from verify.program.arc_chords import CHORD
from verify.program.program import Pause, Program
from verify.progress import Report, StageProgress, silent

TIP = 1e-3
"""mm, largest distance of two tips that count as equal."""
AXIS = 1e-6
"""Largest difference of two unit tool axes that count as equal."""
RATE = 1e-9
"""Largest relative difference of two feeds that count as equal."""


def difference(proved: Program, other: Program) -> str:
    """The first difference of two programs, in words with lines of both; '' where they are equivalent.

    Neither program is simulated. A remark on the second program that the first does not have is a difference too.
    """
    had = {r.message for r in proved.remarks}
    for remark in other.remarks:
        if remark.message not in had:
            return f"line {remark.line} of {other.name}: {remark.message}"
    if proved.dwell != other.dwell:
        return f"{other.name} dwells {other.dwell:g} s, {proved.name} {proved.dwell:g} s"
    if taken := [word for word in other.assumed if word not in proved.assumed]:
        return f"{other.name} does not state {', '.join(taken)} before its first move"
    if left := [a for a in other.open if a not in proved.open]:
        return f"{other.name} leaves it to the control whether {left[0].value}"
    if other.unbounded and other.dialect in CONTROLS and CONTROLS[other.dialect].bounds_path:
        return f"{other.name} does not bound the deviation from the path"
    if not (other.unbounded or proved.unbounded) and other.leaves > proved.leaves + 1e-12:
        return (f"{other.name} lets the control leave the path by {other.leaves:g} mm, {proved.name} by "
                f"{proved.leaves:g} mm")
    mine, yours = _evened(proved, other, _moving(proved), _moving(other))
    n = min(len(mine), len(yours))
    mine, yours = mine[:n + 1], yours[:n + 1]
    compared = _compared(proved, other, mine[:n], yours[:n])
    off = np.flatnonzero(np.any([unlike for _, unlike in compared], axis=0))
    if len(off):
        k = int(off[0])
        return (f"line {other.line[yours[k, 0]]} of {other.name} and line {proved.line[mine[k, 0]]} of {proved.name} "
                f"differ in {', '.join(what for what, unlike in compared if unlike[k])}")
    if len(mine) != len(yours):
        more = proved if len(mine) > n else other
        row = int((mine if len(mine) > n else yours)[n, 0])
        return f"line {more.line[row]} of {more.name} has no counterpart"
    return _careless(proved) or _careless(other) or _paused(proved, other, mine[:, 0], yours[:, 0])


def _careless(p: Program) -> str:
    """First tool change, stop or end at which the spindle is not home, or length that is counted twice, in words; ''
    where there is none.

    Our own programs send the spindle home there, since the operator inserts a new cutter by hand. On LinuxCNC they
    empty the spindle before they stop for a fresh cutter, because the control does not load a tool that it holds.
    """
    control, changes = CONTROLS.get(p.dialect), 0
    for pause in p.pauses:
        first_home = 0 if pause.event in ("M0", "M1") else None if control is None else control.home_from
        if first_home is not None and (changes >= first_home or pause.event != "tool change"):
            if not pause.home:
                return f"line {pause.line} of {p.name}: {pause.event} while the spindle is not home"
            if control is not None and control.gives_up_length and pause.counted:
                return f"line {pause.line} of {p.name}: {pause.event} while the length offset is on"
        if pause.event == "M0" and control is None and pause.tool:
            return f"line {pause.line} of {p.name}: M0 for a fresh cutter while T{pause.tool} is in the spindle"
        changes += pause.event == "tool change"
    if p.kept_on:
        return f"line {p.kept_on[0]} of {p.name} turns tool centre point control on while it is on"
    return ""


def _paused(proved: Program, other: Program, mine: NDArray[np.int64], yours: NDArray[np.int64]) -> str:
    """The first pause that differs in state or place among the given moves, in words; '' where none does."""
    def state_at(pause: Pause, moving: NDArray[np.int64]) -> tuple[object, ...]:
        tool = pause.tool if pause.event == "tool change" else 0
        return (pause.event, tool, int(np.searchsorted(moving, pause.moves)), pause.speed, pause.coolant, pause.tcp,
                pause.relative)

    # LinuxCNC unloads the old tool to load a new one of the same number
    first, second = ([x for x in p.pauses if x.event != "tool change" or x.tool] for p in (proved, other))
    for a, b in zip(first, second, strict=False):
        if state_at(a, mine) != state_at(b, yours):
            return (f"line {b.line} of {other.name} ({b.event}) and line {a.line} of {proved.name} ({a.event}) differ "
                    "in spindle, coolant, modes or place")
    if len(first) != len(second):
        more, rest = (proved, first) if len(first) > len(second) else (other, second)
        pause = rest[min(len(first), len(second))]
        return f"line {pause.line} of {more.name} ({pause.event}) has no counterpart"
    return ""


def _moving(p: Program) -> NDArray[np.int64]:
    """Rows of moves that are not of length 0, or whose start is unknown."""
    moves = (p.start != p.end).any(axis=1)
    if p.poses is not None:
        moves |= (p.poses.start_turn != p.poses.end_turn).any(axis=1)
    moves[p.unknown[:, 0]] = True
    return np.flatnonzero(moves)


def _evened(a: Program, b: Program, i: NDArray[np.int64],
            j: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last row, (n, 2), of each compared move in both programs.

    Each row is a move; a block with a different number of rows in the two programs is one move.
    """
    begins, counts = zip(*(_blocks(p, rows) for p, rows in ((a, i), (b, j))), strict=True)
    out = []
    n = min(len(counts[0]), len(counts[1]))
    odd = np.zeros(max(len(counts[0]), len(counts[1])), np.bool_)
    odd[:n] = (counts[0][:n] != counts[1][:n]) & (counts[0][:n] > 1) & (counts[1][:n] > 1)
    for rows, begin, count in zip((i, j), begins, counts, strict=True):
        one = odd[:len(count)]
        block = np.repeat(np.arange(len(count)), count)
        keep = ~one[block]
        keep[begin[one]] = True
        last = rows.copy()
        last[begin[one]] = rows[(begin + count - 1)[one]]
        out.append(np.column_stack([rows, last])[keep])
    return out[0], out[1]


def _blocks(p: Program, rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First row of each block of the program among ``rows``, and its number of rows."""
    line = p.line[rows]
    begin = np.flatnonzero(np.append(True, line[1:] != line[:-1])) if len(rows) else np.zeros(0, np.int64)
    return begin, np.diff(np.append(begin, len(rows)))


def _compared(a: Program, b: Program, first: NDArray[np.int64],
              second: NDArray[np.int64]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Compared properties, and for each the pairs of moves that differ; moves by their first and last rows (n, 2)."""
    (i, il), (j, jl) = first.T, second.T

    def far(one: F64, other: F64, limit: float, *, at_start: bool = False) -> NDArray[np.bool_]:
        apart = one[i] - other[j] if at_start else one[il] - other[jl]
        return np.asarray(~(np.linalg.norm(apart, axis=1) <= limit))

    def unlike(one: F64, other: F64) -> NDArray[np.bool_]:
        x, y = one[i], other[j]
        return np.asarray(~((np.abs(x - y) <= RATE * np.abs(x)) | (np.isnan(x) & np.isnan(y))))

    out = [("rapid or feed", a.kind[i] != b.kind[j]), ("the tool", a.tool[i] != b.tool[j]),
           ("where the move begins", far(a.start, b.start, TIP, at_start=True)),
           ("where the move ends", far(a.end, b.end, TIP)), ("the path between", _wide(a, b, first, second)),
           ("which start coordinates are known", _unknown(a)[i] != _unknown(b)[j])]
    out += [("the tool axis before the move", far(_axes(a, True), _axes(b, True), AXIS, at_start=True)),
            ("the tool axis after the move", far(_axes(a, False), _axes(b, False), AXIS))]
    if a.poses is not None and b.poses is not None:
        out.append(("where the rotary axes stand", far(a.poses.end_turn, b.poses.end_turn, AXIS)))
    # the time of a block depends on its rounded coordinates
    slack = 1e-9 + TIP / np.maximum(np.nan_to_num(a.feed[i], nan=1.0), 1.0)
    mine, yours = (_minutes(p, rows) for p, rows in ((a, first), (b, second)))
    took = ~((np.abs(mine - yours) <= slack) | (np.isnan(mine) & np.isnan(yours)))
    return [*out, ("the feed", unlike(a.feed, b.feed)), ("the time they take", took),
            ("the speed of the spindle", unlike(a.speed, b.speed)), ("the coolant", a.coolant[i] != b.coolant[j])]


def _minutes(p: Program, rows: NDArray[np.int64]) -> F64:
    """Minutes of moves from their first to their last row (n, 2)."""
    out = p.minutes[rows[:, 0]]
    for k in np.flatnonzero(rows[:, 0] != rows[:, 1]).tolist():
        out[k] = p.minutes[rows[k, 0]:rows[k, 1] + 1].sum()
    return out


def _wide(a: Program, b: Program, first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the chords of moves of several rows are farther apart than chords may be from their arc."""
    out = np.zeros(len(first), np.bool_)
    for k in np.flatnonzero((first[:, 0] != first[:, 1]) | (second[:, 0] != second[:, 1])).tolist():
        one, other = (np.vstack([p.start[m], p.end[m:n + 1]]) for p, (m, n) in ((a, first[k]), (b, second[k])))
        out[k] = max(_off(one, other), _off(other, one)) > TIP + CHORD
    return out


def _off(points: F64, way: F64) -> float:
    """mm, largest distance of points (n, 3) from a polyline (m, 3)."""
    d = np.diff(way, axis=0)
    share = ((points[:, None] - way[:-1]) * d).sum(axis=2) / np.maximum((d * d).sum(axis=1), 1e-30)
    near = way[:-1] + np.clip(share, 0.0, 1.0)[:, :, None] * d
    return float(np.linalg.norm(points[:, None] - near, axis=2).min(axis=1).max())


def _unknown(p: Program) -> NDArray[np.int64]:
    out = np.zeros(len(p), np.int64)
    out[p.unknown[:, 0]] = p.unknown[:, 1]
    return out


def _axes(p: Program, at_start: bool) -> F64:
    if p.poses is None:
        return np.tile([0.0, 0.0, 1.0], (len(p), 1))
    return p.poses.start_axis if at_start else p.poses.end_axis


def carried(proved: NcProgram, twins: Sequence[NcProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
            report: Report = silent, known: Program | None = None) -> list[str]:
    """Carry the proof of a program over to equivalent programs.

    proved  : a program without a finding
    twins   : the other programs, in the same frame; one may be the same text with other comments
    part, tools, setup : of the proof, as ``verify.prove.prove`` takes them
    report  : called with the share done, 0 to 1
    known   : the proved program as the proof has read it; None: it is read here

    Returns the notes of the other readings.

    Raises
    ------
    InternalError
        Code programs_differ: one of them is not equivalent, or cannot be read; the message names both lines.
    """
    if not twins:
        return []
    stages, share, notes = StageProgress(report), 1.0 / (len(twins) + 1), []
    (first,) = read_all([proved], part, tools, setup, 0, stages.span(0.0, share), None if known is None else [known])
    for k, twin in enumerate(twins, 1):
        try:
            (other,) = read_all([twin], part, tools, setup, 0, stages.span(k * share, (k + 1) * share))
            problem = difference(first.program, other.program)
        except ProgramError as refusal:
            problem = refusal.message
        if problem:
            raise InternalError(f"{twin.name} is not the program that was proved: {problem}", code="programs_differ",
                                subjects=(proved.name, twin.name), measured=problem,
                                remedy="please report it with part and setup; nothing is delivered")
        if twin.dialect != proved.dialect:  # else the proof has noted them
            notes += [f"{twin.name}: {note}" for note in other.program.notes]
    return notes


__all__ = ["AXIS", "TIP", "carried", "difference"]
