"""Tool motion of a STEP-NC file of either form: moves of the tip with axis, feed, speed and cutter.

The readers of both forms report paths, tools and stops to a ``MotionRecorder`` in order. ``moves`` gives the motion as
plain values and ``program`` as a program for the proof. STEP-NC gives the tool axis on the part and not the angles of
rotary axes; for the limits of a machine the axes take the angles that turn least from move to move.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import ProgramError
from geometry.mesh import F64, I32
from verify.kinematics import Kinematics
from verify.program.move_kinds import FEED, RAPID
from verify.program.move_log import MAX_MOVES
from verify.program.program import Poses, Program, Remark, StopPoint, TravelPlane
from verify.program.turn_subdivision import MAX_TURN

SAME_PLACE, SAME_AXIS = 2e-4, 2e-6  # mm and of unit vectors, between the start of a path and the end of the last one
MIN_FEED, MAX_FEED = 1e-3, 1e7  # mm/min: F words of the supported controls have three decimals at most
MAX_SPEED = 1e7  # 1/min
MAX_DWELL = 1e7  # s
HALF_TURN = math.pi - 1e-4  # rad: such a turn of the tool axis has no definite direction
EVERY = 7  # X, Y and Z of ``Program.unknown``
TURNED = 8
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class CutterRecord:
    """A tool as a file describes it; None where the file gives no value.

    number        : T number, from the start of the id
    name          : the id in the file
    kind          : 'ball', 'bull' or 'flat', of a tapered mill with 'tapered_' before it
    diameter, corner_radius, flute_length, assembly_length : mm; the diameter of a tapered mill is that of its end
    instance      : number of its instance
    offsets       : mm, lengths from the spindle to the cutting edges
    taper         : deg, between side and axis; 0 for an upright side
    words         : text of the file on the tool, which has the profile of a circle segment mill
    """

    number: int | None
    name: str
    kind: str
    diameter: float
    corner_radius: float
    flute_length: float | None
    assembly_length: float | None
    instance: int
    offsets: tuple[float, ...] = ()
    taper: float = 0.0
    words: str = ""


@dataclass(frozen=True, eq=False)
class CutterMoves:
    """Straight moves of the tool tip in the setup frame.

    start, end : (m, 3) float64, mm; start_axis, end_axis : (m, 3) float64, unit, tip to spindle
    rapid      : (m,) bool; feed : (m,) float64, mm/min, nan for rapids; speed : (m,) float64, 1/min, clockwise positive
    coolant    : (m,) bool
    cutter     : (m,) int32, index, place in ``cutters``
    line       : (m,) int32, index, 1-based line of the end in the file
    arrival    : (m,) bool, the control chooses the path to this place: start equals end
    cutters    : the tools of the file
    """

    start: F64
    end: F64
    start_axis: F64
    end_axis: F64
    rapid: NDArray[np.bool_]
    feed: F64
    speed: F64
    coolant: NDArray[np.bool_]
    cutter: I32
    line: I32
    arrival: NDArray[np.bool_]
    cutters: tuple[CutterRecord, ...]


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Moves of one path: tips, axes where they are not Z, common values, and lines.

    shared : rapid, feed, speed, cutter, arrival, coolant
    """

    start: F64
    end: F64
    axes: tuple[F64, F64] | None
    shared: tuple[float, ...]
    line: I32


class MotionRecorder:
    """Record of the motion so far, in mm, in the setup frame.

    name : of the file; lines : number of its lines
    coolant : whether it is on from here on; blend : mm, by which the control may leave the paths
    """

    def __init__(self, name: str, lines: int) -> None:
        self.name, self._lines = name, lines
        self.cutters: list[CutterRecord] = []
        self._chunks: list[_Chunk] = []
        self._count = 0
        self._here: F64 | None = None  # (6,) tip and axis
        self._tool: int | None = None
        self._line = 1
        self._stops: list[tuple[int, str, int, F64]] = []
        self._over: tuple[F64, F64, int] | None = None
        self._planes: dict[tuple[object, ...], TravelPlane] = {}
        self.dwell = self.blend = 0.0
        self.coolant = False
        self.notes: list[str] = []
        self.remarks: list[Remark] = []

    def take(self, cutter: CutterRecord, line: int) -> int:
        """Change to a tool where it is not in the spindle; returns its place among the cutters.

        Raises ProgramError where the program has too many moves, or its axis cannot turn so.
        """
        place = next((k for k, c in enumerate(self.cutters) if c.instance == cutter.instance), None)
        if place is None:
            place = len(self.cutters)
            self.cutters.append(cutter)
        if self._tool is not None and place != self._tool:
            self._change("tool change", line)
        self._tool = place
        return place

    def stop(self, event: str, line: int) -> None:
        """Record a stop of the program; afterwards the place of the tool is unknown.

        Raises ProgramError as ``take``.
        """
        self._change(event, line)

    def over(self, point: F64, normal: F64, line: int) -> None:
        """Approach the next path over a plane.

        point  : (3,) float64, mm, setup frame
        normal : (3,) float64, unit, setup frame
        """
        self._over = point, normal, line
        self.plane("security plane", point, normal, line)

    def plane(self, what: str, point: F64, normal: F64, line: int) -> None:
        """Record a plane to which the control may take the tool.

        what   : as ``TravelPlane`` has it
        point  : (3,) float64, mm, setup frame
        normal : (3,) float64, unit, setup frame
        """
        key = (what, *np.round(normal, 6).tolist(), round(float(point @ normal), 4))
        self._planes.setdefault(key, TravelPlane(line, what, _three(point), _three(normal)))

    def retract_to(self, point: F64, normal: F64, line: int) -> None:
        """Record the retract plane behind a path. One above the place of the tool is no way down.

        point  : (3,) float64, mm, setup frame
        normal : (3,) float64, unit, setup frame
        """
        if self._here is not None and float((point - self._here[:3]) @ normal) < -SAME_PLACE:
            self.plane("retract plane", point, normal, line)

    def follow(self, tips: F64, axes: F64 | None, *, rapid: bool, feed: float, speed: float, lines: F64) -> None:
        """Follow a path with the tool in the spindle.

        tips  : (n, 3) float64, mm, setup frame
        axes  : (n, 3) float64, unit, setup frame, or None where they are Z
        feed  : mm/min; speed : 1/min, clockwise positive
        lines : (n,) float64, index, 1-based lines of the file

        Raises ProgramError as ``take``.
        """
        there = np.empty((len(tips), 6))
        there[:, :3], there[:, 3:] = tips, UP if axes is None else axes
        self._line = int(lines[0])
        self._arrive(there[0], speed, float(lines[0]))
        row = (rapid, math.nan if rapid else feed, speed, float(self._tool if self._tool is not None else -1))
        self._add(there[:-1], there[1:], row, lines[1:], False)
        self._here, self._line = there[-1], int(lines[-1])

    def moves(self) -> CutterMoves:
        """All moves so far."""
        chunks = self._chunks
        count = np.array([len(c.start) for c in chunks], np.int64)
        start, end = (np.concatenate([np.zeros((0, 3)), *tips]) for tips in zip(
            *((c.start, c.end) for c in chunks), strict=True)) if chunks else (np.zeros((0, 3)), np.zeros((0, 3)))
        first = last = np.broadcast_to(np.array(UP), (len(start), 3))
        if any(c.axes is not None for c in chunks):
            first, last = (np.concatenate([np.tile(UP, (len(c.start), 1)) if c.axes is None else c.axes[k]
                                           for c in chunks]) for k in (0, 1))
        shared = np.repeat(np.array([c.shared for c in chunks]).reshape(-1, 6), count, axis=0)
        line = np.concatenate([np.zeros(0, np.int32), *(c.line for c in chunks)])
        return CutterMoves(start, end, first, last, shared[:, 0] > 0, shared[:, 1].copy(), shared[:, 2].copy(),
                           shared[:, 5] > 0, shared[:, 3].astype(np.int32), line, shared[:, 4] > 0, tuple(self.cutters))

    def program(self, numbers: Sequence[int], machine: Kinematics | None) -> Program:
        """The moves as a program.

        numbers : T number of each cutter
        machine : rotary axes of the machine, or None; then a tilted tool gets a remark
        """
        m, remarks, notes = self.moves(), list(self.remarks), list(self.notes)
        table = np.array([*numbers, 0], np.int32)
        tool = table[m.cutter]
        leaning = np.maximum(np.abs(m.end_axis - UP), np.abs(m.start_axis - UP)).max(axis=1) > SAME_AXIS
        poses = None
        if leaning.any():
            turns = np.zeros((len(tool), 2, 2))
            if machine is None:
                remarks.append(Remark(int(m.line[np.flatnonzero(leaning)[0]]),
                                      "the tool is tilted, and the machine has no rotary axes"))
            else:
                both = np.stack([m.start_axis, m.end_axis], axis=1).reshape(-1, 3)
                turns = least_turns(machine, both).reshape(-1, 2, 2)
                notes.append("STEP-NC does not give the angles of rotary axes; limits of the machine are checked for "
                             "the angles that turn least from move to move")
            poses = Poses(m.start_axis, m.end_axis, turns[:, 0], turns[:, 1])
        standing = np.flatnonzero(~m.rapid & ~(m.speed > 0))
        if len(standing):
            k = int(standing[0])
            remarks.append(Remark(int(m.line[k]), f"a feed move while the spindle of T{tool[k]} does not turn "
                                                  "clockwise; right-hand cutters need that"))
        unknown = [(int(k), EVERY + (TURNED if leaning[k] else 0)) for k in np.flatnonzero(m.arrival)]
        length = np.linalg.norm(m.end - m.start, axis=1)
        minutes = np.where(m.rapid, np.nan, length / np.where(m.rapid, 1.0, m.feed))
        speeds: dict[int, tuple[float, int]] = {}
        for number in np.unique(tool[m.speed > 0]).tolist():
            mine = np.flatnonzero(tool == number)
            k = int(mine[np.argmax(m.speed[mine])])
            speeds[number] = float(m.speed[k]), int(m.line[k])
        stops = tuple(StopPoint(line, event, int(table[place]), _three(at[:3]), _three(at[3:]))
                      for line, event, place, at in (*self._stops, *self._last()))
        return Program(
            name=self.name, start=m.start, end=m.end, kind=np.where(m.rapid, RAPID, FEED).astype(np.int8), feed=m.feed,
            tool=tool, line=m.line, dwell=self.dwell, speeds=speeds, lines=self._lines, remarks=tuple(remarks),
            unknown=np.array(unknown, np.int64).reshape(-1, 2), stops=stops, assumed=(), blend=self.blend,
            minutes=minutes, poses=poses, notes=tuple(notes), speed=np.maximum(m.speed, 0.0), coolant=m.coolant,
            changes=sum(event == "tool change" for _, event, _, _ in self._stops), planes=tuple(self._planes.values()))

    def _last(self) -> list[tuple[int, str, int, F64]]:
        if self._here is None or self._tool is None:
            return []
        return [(self._line, "end of the program", self._tool, self._here)]

    def _change(self, event: str, line: int) -> None:
        """Remove the tool: over the plane where one is given, or from its present place."""
        if self._over is not None and self._here is not None:
            self._lift(self._over)
        if self._here is not None and self._tool is not None:
            self._stops.append((line, event, self._tool, self._here))
        self._here = None

    def _lift(self, over: tuple[F64, F64, int]) -> None:
        """Retract to the plane."""
        point, normal, line = over
        here = self._here
        if here is None or (rise := float((point - here[:3]) @ normal)) <= 0.0:
            return
        up = here.copy()
        up[:3] += rise * normal
        self._rapid(here, up, line)
        self._here = up

    def _rapid(self, here: F64, there: F64, line: float, arrival: bool = False, speed: float = 0.0) -> None:
        row = (True, math.nan, speed, float(self._tool if self._tool is not None else -1))
        self._add(here[None], there[None], row, np.array([float(line)]), arrival)

    def _arrive(self, there: F64, speed: float, line: float) -> None:
        """Approach the start of a path from the present place of the tool."""
        over, here = self._over, self._here
        if here is not None and np.abs(there[:3] - here[:3]).max() <= SAME_PLACE \
                and np.abs(there[3:] - here[3:]).max() <= SAME_AXIS:
            self._over = None  # it is there already
            return
        if over is not None:
            self._lift(over)
            point, normal, _ = over
            rise = float((point - there[:3]) @ normal)
            above = there.copy()
            above[:3] += max(rise, 0.0) * normal
            self._rapid(above, above, line, True, speed)
            if rise > 0.0:
                self._rapid(above, there, line, False, speed)
        else:
            self._rapid(there, there, line, True, speed)
        self._over = None

    def _add(self, start: F64, end: F64, row: tuple[bool, float, float, float], lines: F64, arrival: bool) -> None:
        """Write moves (n, 6); large turns are split into pieces."""
        upright = bool((start[:, 3:] == UP).all() and (end[:, 3:] == UP).all())
        if not upright:
            start, end, lines = self._in_pieces(start, end, lines)
        self._count += len(start)
        if self._count > MAX_MOVES:
            raise ProgramError(f"{self.name} makes too many moves ({MAX_MOVES} allowed)", code="program_too_long",
                               measured=self._count, limit=MAX_MOVES, remedy="split the job")
        axes = None if upright else (start[:, 3:].copy(), end[:, 3:].copy())
        shared = (*(float(v) for v in row), float(arrival), float(self.coolant))
        self._chunks.append(_Chunk(start[:, :3].copy(), end[:, :3].copy(), axes, shared, lines.astype(np.int32)))

    def _in_pieces(self, start: F64, end: F64, lines: F64) -> tuple[F64, F64, F64]:
        """Moves (n, 6) with their lines (n,), in pieces where the tool axis turns far."""
        angle = np.arccos(np.clip((start[:, 3:] * end[:, 3:]).sum(axis=1), -1.0, 1.0))
        if (over := np.flatnonzero(angle > HALF_TURN)).size:
            at = int(lines[over[0]])
            raise ProgramError(f"{self.name}, line {at}: one move turns the tool axis by half a turn; its direction is "
                               "not defined", subjects=(f"line {at}",),
                               remedy="add points with axes between to the path")
        pieces = np.maximum(np.ceil(angle / MAX_TURN), 1.0).astype(np.int64)
        if (pieces > 1).any():
            which = np.repeat(np.arange(len(start)), pieces)
            step = np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
            start, end = (_between(start[which], end[which], (step + k) / pieces[which]) for k in (0, 1))
            lines = lines[which]
        return start, end, lines


def _between(start: F64, end: F64, share: F64) -> F64:
    out = start + share[:, None] * (end - start)
    out[:, 3:] /= np.linalg.norm(out[:, 3:], axis=1, keepdims=True)
    return np.where(share[:, None] >= 1.0, end, out)


def _three(values: F64) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def least_turns(machine: Kinematics, axes: F64) -> F64:
    """Angles of the rotary axes along a path that turn least from place to place, from 0 on.

    axes : (n, 3) float64, unit, tip to spindle, setup frame

    Returns (n, 2) float64, rad, the tilting axis first.
    """
    changed = np.ones(len(axes), np.bool_)
    changed[1:] = np.abs(np.diff(axes, axis=0)).max(axis=1) > 1e-12
    rows = axes[changed]
    tilt = np.arctan2(np.hypot(rows[:, 0], rows[:, 1]), rows[:, 2])
    zero = np.zeros(len(rows))
    spins = []
    for sign in (1.0, -1.0):
        level = machine.axis(np.column_stack([sign * tilt, zero]))
        spin = np.arctan2(rows[:, 1], rows[:, 0]) - np.arctan2(level[:, 1], level[:, 0])
        spins.append((spin if machine.turns_head else -spin).tolist())
    out, here, free = [], (0.0, 0.0), tilt < 1e-9
    for k, t in enumerate(tilt.tolist()):
        if free[k]:
            here = 0.0, here[1]
        else:
            choices = [(s * t, spins[j][k] + 2.0 * math.pi * round((here[1] - spins[j][k]) / (2.0 * math.pi)))
                       for j, s in enumerate((1.0, -1.0))]
            here = min(choices, key=lambda c: max(abs(c[0] - here[0]), abs(c[1] - here[1])))
        out.append(here)
    return np.array(out).reshape(-1, 2)[np.cumsum(changed) - 1]
