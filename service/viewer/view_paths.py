"""The track of the tool for a page: moves of the simulated programs with times, in two levels of detail.

The reader of the proof reads the programs once more, so the page shows what was proved, with links and tool changes. An
unproved job gives no program away: its track lies on a grid and is thinned by ``COARSE``, as fine as the pictures of
such a job. Its times are whole seconds, and it has no feeds, speeds or lines.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from service.viewer.view_file import Chunk, Column
from verify.checks.program_sequence import FramedProgram
from verify.gcode.reader import FEED
from verify.model import NcProgram
from verify.program.move_times import minutes_of

GRID, FINE, ROUGH = 0.001, 0.002, 0.1  # mm: grid of places, and error of a drawn track in the two levels
COARSE = 0.25  # mm, grid and thinning of an unproved track
START, RAPID, CUT = 0, 1, 2  # kinds of a row: a track begins here, or the kind of the move that ends here
AXIS_UNIT = 32_000
STEP_WORD = re.compile(r"^\s*[;(]\s*(?:-\s*)?(S\d+)\b")
I64 = NDArray[np.int64]
BOOL = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Stand:
    """Position of a tool at a moment of the job.

    seconds : s, from the start of the job
    step    : row of the steps
    tip     : (3,) float64, mm, setup frame
    axis    : (3,) float64, dimensionless, setup frame, unit, from the tip to the spindle
    """

    seconds: float
    step: int
    tip: F64
    axis: F64


@dataclass(frozen=True, eq=False)
class ToolTrack:
    """All moves of a job one after the other, setup frame.

    start, end   : (m, 3) float64, mm, setup frame, tip
    axis         : (m, 3) float64, dimensionless, setup frame, unit, from the tip to the spindle, at the end
    feed         : (m,) bool, whether the move is a feed move
    begun, ended : (m,) float64, s, from the start of the job
    line, tool   : (m,) int64, index: line and T number in the program
    program      : (m,) int64, index: place of the program in ``names``
    step         : (m,) int64, index: row of ``steps``
    steps        : workingsteps of the moves, in order
    names        : of the programs
    """

    start: F64
    end: F64
    axis: F64
    feed: BOOL
    begun: F64
    ended: F64
    line: I64
    tool: I64
    program: I64
    step: I64
    steps: tuple[dict[str, Any], ...]
    names: tuple[str, ...]

    def stand(self, program: str, line: int, place: Sequence[float] | None, deep: float = 0.0) -> Stand | None:
        """Position of the tool on a line, nearest to a place; None where there is no such line.

        place : (3,) mm, setup frame; None: where the line begins
        deep  : mm that the tool stands beyond the place, along its axis
        """
        if program not in self.names or line < 1:
            return None
        rows = np.flatnonzero((self.line == line) & (self.program == self.names.index(program)))
        if not len(rows):
            return None
        near, part = 0, 0.0
        if place is not None:
            way, to = self.end[rows] - self.start[rows], np.asarray(place) - deep * self.axis[rows]
            size = np.maximum((way * way).sum(axis=1), 1e-12)
            share = np.clip(((to - self.start[rows]) * way).sum(axis=1) / size, 0.0, 1.0)
            near = int(np.argmin(np.linalg.norm(self.start[rows] + share[:, None] * way - to, axis=1)))
            part = float(share[near])
        row = int(rows[near])
        tip = self.start[row] + part * (self.end[row] - self.start[row])
        return Stand(float(self.begun[row] + part * (self.ended[row] - self.begun[row])), int(self.step[row]), tip,
                     self.axis[row])


def track_of(readings: Sequence[FramedProgram], programs: Sequence[NcProgram], rotation: F64,
           planned: Sequence[dict[str, Any]] = ()) -> ToolTrack:
    """The track of the tool through programs.

    readings : of the programs, as ``verify.checks.program_sequence.read_all`` gives them
    rotation : (3, 3) float64, dimensionless, from the setup frame to that of the proof
    planned  : steps of the report, whose ids stand in comments of the programs; without them each tool is a step
    """
    known = {s["id"]: s for s in planned}
    steps: list[dict[str, Any]] = []
    parts, clock = [], 0.0
    for k, (reading, given) in enumerate(zip(readings, programs, strict=True)):
        p = reading.program
        took = 60.0 * minutes_of(p, reading.setup)
        ended = clock + np.cumsum(took)
        clock = float(ended[-1]) if len(ended) else clock
        step = _steps(p.line.astype(np.int64), p.tool.astype(np.int64), given, known, steps)
        parts.append((reading.here(p.start) @ rotation, reading.here(p.end) @ rotation, _axes(reading) @ rotation,
                      p.kind == FEED, ended - took, ended, p.line.astype(np.int64), p.tool.astype(np.int64),
                      np.full(len(p), k, np.int64), step))
    if not parts:
        none, no = np.zeros((0, 3)), np.zeros(0, np.int64)
        return ToolTrack(none, none, none, np.zeros(0, np.bool_), np.zeros(0), np.zeros(0), no, no, no, no, (), ())
    start, end, axis, feed, begun, ended, line, tool, program, step = map(np.concatenate, zip(*parts, strict=True))
    there = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
    return ToolTrack(start[there], end[there], axis[there], feed[there], begun[there], ended[there], line[there],
                     tool[there], program[there], step[there], tuple(steps), tuple(p.name for p in programs))


def _axes(r: FramedProgram) -> F64:
    p = r.program
    return r.here(np.tile([0.0, 0.0, 1.0], (len(p), 1)) if p.poses is None else p.poses.end_axis)


def _steps(line: I64, tool: I64, given: NcProgram, known: dict[str, dict[str, Any]],
           steps: list[dict[str, Any]]) -> I64:
    """Row of ``steps`` for every move of a program, (m,) int64, index; adds the steps of the program to ``steps``."""
    first = len(steps)
    marks: list[tuple[int, str]] = []
    for number, text in enumerate(given.text.split("\n"), 1) if known else ():
        found = STEP_WORD.match(text)
        if found and found[1] in known and (not marks or marks[-1][1] != found[1]):
            marks.append((number, found[1]))
    if marks:
        for _, name in marks:
            s = known[name]
            steps.append({"id": name, "zone": s["zone"], "operation": s["operation"], "strategy": s["strategy"],
                          "program": given.name})
        return np.maximum(np.searchsorted([m[0] for m in marks], line, side="right") - 1, 0) + first
    change = np.concatenate([[0], np.cumsum(tool[1:] != tool[:-1])]) if len(tool) else np.zeros(0, np.int64)
    for number in tool[np.concatenate([[0], np.flatnonzero(np.diff(tool)) + 1])].tolist() if len(tool) else ():
        steps.append({"id": f"T{number}", "zone": None, "operation": "", "strategy": "", "program": given.name})
    return np.asarray(change + first, np.int64)


def path_chunks(track: ToolTrack, low: F64, *,
                open_: bool) -> tuple[list[Chunk], list[Chunk], list[dict[str, Any]], float]:
    """The track as chunks, step by step: rough, fine; the steps with tool, times and axis; and the grid, mm.

    low   : (3,) float64, mm, setup frame, zero of the grid
    open_ : whether the program may be shown; else there is the rough level only
    """
    grid, rough = (GRID, ROUGH) if open_ else (COARSE, COARSE)
    first, then, steps = [], [], []
    for k, words in enumerate(track.steps):
        rows = np.flatnonzero(track.step == k)
        if not len(rows):
            steps.append({**words, "tool": 0, "start_s": 0.0, "end_s": 0.0, "axis": [0.0, 0.0, 1.0]})
            continue
        turned = bool(np.ptp(track.axis[rows], axis=0).max() > 1e-6)
        axis = None if turned else [round(v, 6) + 0.0 for v in track.axis[rows[0]].tolist()]
        digits = 3 if open_ else 0
        steps.append({**words, "tool": int(track.tool[rows[0]]), "start_s": round(float(track.begun[rows[0]]), digits),
                      "end_s": round(float(track.ended[rows[-1]]), digits), "axis": axis})
        line = _Line(track, rows)
        first.append(_chunk(line.thinned(rough), k, 0, low, grid, open_, turned))
        if open_:
            then.append(_chunk(line.thinned(FINE, by_line=True), k, 1, low, grid, open_, turned))
    return first, then, steps, grid


class _Line:
    """The moves of a step as rows: places, kinds, times, axes and lines of the program."""

    def __init__(self, track: ToolTrack, rows: I64) -> None:
        start, end = track.start[rows], track.end[rows]
        broken = np.ones(len(rows), np.bool_)
        broken[1:] = np.abs(start[1:] - end[:-1]).max(axis=1) > 1e-6
        at = np.arange(len(rows)) + np.cumsum(broken)  # where the end of each move goes
        size = len(rows) + int(broken.sum())
        self.kind = np.zeros(size, np.int64)
        self.kind[at] = np.where(track.feed[rows], CUT, RAPID)
        self.place, self.axis = np.zeros((size, 3)), np.zeros((size, 3))
        self.time, self.line = np.zeros(size), np.zeros(size, np.int64)
        for to, move, places, times in ((at, np.arange(len(rows)), end, track.ended[rows]),
                                        (at[broken] - 1, np.flatnonzero(broken), start[broken],
                                         track.begun[rows][broken])):
            self.place[to], self.time[to] = places, times
            self.axis[to], self.line[to] = track.axis[rows[move]], track.line[rows[move]]

    def thinned(self, tolerance: float, *, by_line: bool = False) -> tuple[F64, I64, F64, F64, I64]:
        """Rows that are kept where the track may be off by a tolerance, mm.

        by_line : keep the end of each line of the program. Feeds change from line to line, on straight tracks too. So
                  the page shows the tool where the program has it at a second, and the right line
        """
        keep = thinned(self.place, self.kind, tolerance, np.linalg.norm(np.diff(self.axis, axis=0), axis=1),
                       self.line if by_line else None)
        return self.place[keep], self.kind[keep], self.time[keep], self.axis[keep], self.line[keep]


def thinned(place: F64, kind: I64, tolerance: float, turned: F64 | None = None, line: I64 | None = None) -> I64:
    """Rows of a polyline that are kept: every row left out lies within the tolerance of the remaining polyline.

    place     : (n, 3) float64, mm, any frame
    kind      : (n,) int64, index: kind of the move to each row; rows where it changes stay
    tolerance : mm
    turned    : (n - 1,) float64, rad, turn of the tool up to the next row; such rows stay
    line      : (n,) int64, index: line of the program; the last row of each stays

    Returns (k,) int64, index: the rows.

    Notes
    -----
    Each round leaves out every second row that lies within the tolerance less the error of its neighbours, until no
    row is left out. Errors of the rounds add up: a row left out in one round lies within e of a segment whose ends lie
    within d of the next polyline, so it lies within d + e of that.
    """
    rows = np.arange(len(place))
    off = np.zeros(max(len(place) - 1, 0))  # of the segment behind each row
    fixed = np.ones(len(place), np.bool_)
    fixed[1:-1] = (kind[1:-1] != kind[2:]) | (kind[1:-1] == START)
    if turned is not None and len(place) > 2:
        fixed[1:-1] |= (turned[:-1] > 1e-6) | (turned[1:] > 1e-6)
    if line is not None:
        fixed[:-1] |= line[:-1] != line[1:]
    while len(rows) > 2:
        before = len(rows)
        for parity in (0, 1):
            middle = np.arange(1 + parity, len(rows) - 1, 2)
            if not len(middle):
                continue
            a, b, c = place[rows[middle - 1]], place[rows[middle]], place[rows[middle + 1]]
            way = c - a
            size = np.maximum((way * way).sum(axis=1), 1e-18)
            share = np.clip(((b - a) * way).sum(axis=1) / size, 0.0, 1.0)
            far = np.linalg.norm(b - a - share[:, None] * way, axis=1)
            far += np.maximum(off[middle - 1], off[middle])
            gone = middle[(far <= tolerance) & ~fixed[rows[middle]]]
            off[gone - 1] = far[np.searchsorted(middle, gone)]
            stay = np.ones(len(rows), np.bool_)
            stay[gone] = False
            off = off[stay[:-1]] if len(off) else off
            rows = rows[stay]
        if before - len(rows) < 0.02 * before:
            break
    return rows


def _chunk(rows: tuple[F64, I64, F64, F64, I64], step: int, lod: int, low: F64, grid: float, open_: bool,
           turned: bool) -> Chunk:
    place, kind, time, axis, line = rows
    columns = {"place": Column(np.rint((place - low) / grid), 4, "steps"), "kind": Column(kind, 1)}
    if open_:
        columns["time"] = Column(np.rint(1000.0 * time), 4, "steps")
        columns["line"] = Column(line, 4, "steps")
    else:
        columns["time"] = Column(1000.0 * np.rint(time), 4, "steps")
    if turned:
        columns["axis"] = Column(np.rint(AXIS_UNIT * axis), 4, "steps")
    return Chunk("path", {"step": step, "lod": lod}, columns)


__all__ = ["Stand", "ToolTrack", "path_chunks", "thinned", "track_of"]
