"""NC text to moves of the tool tip: a 3-axis LinuxCNC / Fanuc reader of its own.

A program is read line by line by one modal machine. The common line, one straight move in modal
coordinates, is taken by one regular expression; everything else goes through the full block (``words``).
What the reader does not know it names with its line (``ProgramError``): nothing is skipped in silence.
What it understands but a machinist should not run (length offset off, another work offset, spindle
standing, path blending beyond the tolerance, a word no code takes) becomes a ``Remark`` and the reading goes on.

Assumptions: home (G53 Z0, G28, G30), a tool change and the start of a program are above everything; the axes
left unknown are known again once programmed. A rapid is one straight line. Before the first G20 the unit is mm.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection

import numpy as np

from geometry.errors import ProgramError
from verify.arcs import PLANE_AXES, ArcError, ArcTooLong, arc_points, centre_from_radius
from verify.cycles import FEED, RAPID, Hole, hole_moves
from verify.log import MAX_ERRORS, MOST_MOVES_A_BLOCK, Log
from verify.program import NAN, Program, Remark, State
from verify.words import (
    CYCLES,
    MOTION_CODES,
    STRAIGHT,
    WORK_OFFSETS,
    Block,
    BlockError,
    parse_block,
    used_letters,
    whole,
)

INCH = 25.4
BLEND_LIMIT = 0.01


class Reader:
    """One reading of one program; use ``read_program``."""

    def __init__(self, name: str, tools: Collection[int] | None, work_offset: str, blend_limit: float) -> None:
        self.tools, self.work_offset, self.blend_limit = tools, work_offset, blend_limit
        self.s = State()
        self.log = Log(name)
        self.dwell = 0.0
        self.incremental_line = 0
        self.incremental_after_cuts = self.incremental_moved = self.cut_absolute = False

    # ---------------------------------------------------------------- text

    def read(self, text: str) -> Program:
        """Moves and remarks of ``text``; raises as ``read_program`` says."""
        log, lines = self.log, text.split("\n")
        percents = self._scan(lines)
        if not self.s.ended and percents < 2:
            log.error(f"{log.name} does not end with M2, M30 or a closing %: it may be cut off", len(lines))
        log.raise_errors()
        if self.s.relative and self.incremental_after_cuts and self.incremental_moved:
            log.remark("incremental", "the program turns to incremental coordinates (G91) after cuts in absolute ones "
                       "and never turns back", line=self.incremental_line)
        table = log.table()
        return Program(log.name, np.ascontiguousarray(table[:, 0:3]), np.ascontiguousarray(table[:, 3:6]),
                       table[:, 6].astype(np.int8), np.ascontiguousarray(table[:, 7]), table[:, 8].astype(np.int32),
                       table[:, 9].astype(np.int32), self.dwell, len(lines), log.remarks())

    def _scan(self, lines: list[str]) -> int:
        """Run every line; the fast path serves plain straight moves, and only in the plain modal state."""
        s, log, fast, rows, full = self.s, self.log, STRAIGHT, self.log.rows, Log.full
        percents = 0
        plain = begun = False
        for number, raw in enumerate(lines, 1):
            if plain and (m := fast(raw)):
                g, x, y, z, f = m.groups()
                if g is not None:
                    s.motion = float(g)
                if s.motion == 1 or s.motion == 0:
                    if f is not None:
                        s.feed = float(f)
                    if x is None and y is None and z is None:
                        continue
                    px, py, pz = s.position
                    ex = px if x is None else float(x)
                    ey = py if y is None else float(y)
                    ez = pz if z is None else float(z)
                    s.position = [ex, ey, ez]
                    if len(rows) >= full:
                        log.flush()
                    if s.motion == 0:
                        rows.append((px, py, pz, ex, ey, ez, RAPID, NAN, s.tool, number))
                        continue
                    if s.feed > 0:
                        rows.append((px, py, pz, ex, ey, ez, FEED, s.feed, s.tool, number))
                        continue
                    s.position = [px, py, pz]
            log.line = number
            text = raw.strip()
            if text == "%":
                percents += 1
                if percents == 1 and begun:
                    log.error("a % in the middle of the program, which does not begin with one")
                if percents == 2:
                    break
                continue
            if text:
                begun = True
                self._block(text)
            if s.ended or len(log.errors) >= MAX_ERRORS:
                break
            plain = self._is_plain()
        return percents

    def _is_plain(self) -> bool:
        """Whether a straight move needs nothing but its numbers now."""
        s = self.s
        return (not s.relative and s.scale == 1.0 and s.feed_mode == 94 and s.turning and s.tool > 0
                and s.offset == s.tool and s.work_offset == self.work_offset
                and not any(math.isnan(v) for v in s.position))

    # ---------------------------------------------------------------- one block

    def _block(self, text: str) -> None:
        """Run one block. Order as on the control: speed, tool, spindle, modes, feed, motion, end."""
        before = len(self.log.errors)
        try:
            block = parse_block(text)
            self._run(block)
        except BlockError as problem:
            return self.log.error(str(problem))
        if block.deleted:
            self.log.remark("block_delete", "a block with / depends on a switch of the machine; it is taken as run")
        if len(self.log.errors) == before:
            self._name_unused(block)
        if 2 in block.ms or 30 in block.ms:
            self.s.ended = True
        return None

    def _run(self, block: Block) -> None:
        s, values = self.s, block.values
        if "S" in values:
            s.speed = values["S"]
            if s.speed < 0:
                self.log.remark("speed", f"S{s.speed:g} is no spindle speed", self.log.line)
        if "T" in values:
            self._select(int(values["T"]))
        self._spindle(block.ms)
        for g in sorted(block.codes, key=lambda g: g != 80):  # beside a motion word G80 only ends the cycle before it
            self._mode(g, values)
        if 64 in block.codes:
            self._blending(values)
        if "F" in values:
            s.feed = values["F"] * (1.0 if s.feed_mode == 93 else s.scale)
        self._move(block)

    def _name_unused(self, block: Block) -> None:
        s = self.s
        moves = not {28, 30, 53} & set(block.codes) and (not {"X", "Y", "Z"}.isdisjoint(block.values)
                                                         or s.motion in (2, 3))
        used = used_letters(block, s.motion, moves)
        idle = [f"{letter}{number:g}" for letter, number in block.values.items() if letter not in used]
        if idle:
            self.log.remark("unused", f"no code of this block takes {', '.join(idle)}", self.log.line)

    def _select(self, number: int) -> None:
        if self.tools is not None and number not in self.tools and number != 0:
            self.log.error(f"T{number} is not in the tool table")
        self.s.selected = number

    def _spindle(self, ms: list[int]) -> None:
        s = self.s
        if 6 in ms:
            if s.selected != s.tool:
                s.position[2] = NAN
            s.tool, s.spindle = s.selected, False
        if 3 in ms or 4 in ms:
            s.spindle = True
        if 4 in ms:
            self.log.remark("m4", "M4 turns the spindle backwards")
        if 5 in ms:  # LinuxCNC stops the spindle before the motion of the block
            s.spindle = False

    def _mode(self, g: float, values: dict[str, float]) -> None:
        """Apply one G word that sets a state."""
        s = self.s
        if g in MOTION_CODES:
            self._motion(g)
        elif g in (17, 18, 19):
            s.plane = int(g)
        elif g in (20, 21):
            self._unit(int(g))
        elif g in (90, 91):
            self._distance(g == 91)
        elif g in (90.1, 91.1):
            s.centre_absolute = g == 90.1
        elif g in (93, 94, 95):
            s.feed_mode = int(g)
            s.feed = NAN
        elif g in (98, 99):
            s.retract_to_r = g == 99
        elif g == 43:
            self._length_offset(values)
        elif g == 49:
            s.offset = None
        elif g in WORK_OFFSETS:
            s.work_offset = WORK_OFFSETS[g]
            if s.work_offset != self.work_offset:
                self.log.remark("work_offset", f"{s.work_offset} is not the work offset of the setup "
                                f"({self.work_offset})", s.work_offset)

    def _motion(self, g: float) -> None:
        """A cycle begun anew keeps nothing of the one before."""
        s = self.s
        if s.motion not in CYCLES:
            s.cycle = {}
        s.motion = g

    def _unit(self, g: int) -> None:
        s = self.s
        scale = INCH if g == 20 else 1.0
        if scale != s.scale and (self.log.moved or any(v == v for v in s.position)):
            self.log.remark("unit", f"G{g} changes the unit in the middle of the program", self.log.line)
        s.scale = scale

    def _distance(self, relative: bool) -> None:
        """Enter or leave incremental coordinates.

        Incremental moves are simulated exactly, and a program that states a place and then runs in G91 is right.
        A G91 after cuts in absolute coordinates which no G90 follows is a slip far more often than meant, and what
        it breaks may show hundreds of lines later: ``read`` puts a remark on its line. One that is turned back
        needs none, its moves are known.
        """
        s = self.s
        if relative == s.relative:
            return
        feeds = self.log.take_feeds()
        if relative:
            self.cut_absolute |= feeds
            self.incremental_line, self.incremental_after_cuts = self.log.line, self.cut_absolute
            self.incremental_moved = False
        s.relative = relative

    def _length_offset(self, values: dict[str, float]) -> None:
        s = self.s
        s.offset = int(values["H"]) if "H" in values else s.tool
        if s.offset != s.tool:
            self.log.remark("length_offset", f"length offset H{s.offset} with tool T{s.tool} in the spindle",
                            self.log.line)

    def _blending(self, values: dict[str, float]) -> None:
        """G64: the control may leave the path by P (0 and none: without bound) and by Q of its own line fitting."""
        limit = self.blend_limit
        p, q = values.get("P", 0.0) * self.s.scale, values.get("Q", 0.0) * self.s.scale
        if p == 0:
            self.log.remark("blending", f"G64 without a P above 0 lets the control leave the path by any amount (limit "
                            f"P{limit:g} mm)", self.log.line)
        elif not 0 < p <= limit + 1e-12:
            self.log.remark("blending", f"G64 P{values['P']:g} lets the control leave the path by {p:g} mm (limit "
                            f"{limit:g} mm)", self.log.line)
        if not 0 <= q <= limit + 1e-12:
            self.log.remark("line_fitting", f"G64 Q{values['Q']:g} lets the control leave the path by {q:g} mm (limit "
                            f"{limit:g} mm)", self.log.line)

    # ---------------------------------------------------------------- motion

    def _move(self, block: Block) -> None:
        s, values = self.s, block.values
        axes = [values.get(a) for a in "XYZ"]
        if 4 in block.codes:
            return self._wait(axes, values)
        if not {28, 30, 53}.isdisjoint(block.codes):
            return self._machine_move(53 in block.codes, axes)
        full_circle = s.motion in (2, 3) and not values.keys().isdisjoint("IJK")
        if all(a is None for a in axes) and not full_circle:
            return None
        if s.motion is None or s.motion == 80:
            return self.log.error("coordinates without a motion word")
        self.incremental_moved = True
        if s.motion in CYCLES:
            return self._cycle(axes, values)
        target = self._target(axes)
        if s.motion == 0:
            return self._line_to(target, RAPID, NAN)
        feed = self._feed(values)
        if feed is None:
            return None
        self._check_cutting(target)
        if s.motion == 1:
            return self._line_to(target, FEED, self._rate(feed, [s.position, target]))
        return self._arc(target, values, feed)

    def _wait(self, axes: list[float | None], values: dict[str, float]) -> None:
        if "P" not in values:
            return self.log.error("G4 needs P")
        if values["P"] < 0:
            return self.log.error(f"G4 P{values['P']:g} waits a negative time")
        if any(a is not None for a in axes):
            return self.log.error("coordinates in a block with G4: some controls move, some wait")
        self.dwell += values["P"]
        return None

    def _target(self, axes: list[float | None]) -> list[float]:
        s = self.s
        if s.relative:
            for letter, a, p in zip("XYZ", axes, s.position, strict=True):
                if a and math.isnan(p):
                    self.log.remark("incremental_unknown", f"an incremental move ({letter}{a:g}, G91 of line "
                                    f"{self.incremental_line}) from a place the program has not stated")
        return [p if a is None else (p + a * s.scale if s.relative else a * s.scale)
                for a, p in zip(axes, s.position, strict=True)]

    def _machine_move(self, absolute: bool, axes: list[float | None]) -> None:
        """G28 and G30 pass a programmed point, then the axes named (all without any) are unknown; so after G53.

        Only home is known to lie above everything: another Z of G53 is remarked, and so is a way in X or Y to a
        place of the machine's own before Z is home.
        """
        s = self.s
        named = [a is not None for a in axes]
        if absolute:
            if s.motion != 0:
                return self.log.error("G53 needs G0: the proof cannot see a feed move in machine coordinates")
            if axes[2]:
                self.log.remark("machine_height", f"G53 Z{axes[2]:g} goes to a height the proof does not know; only "
                                "Z0, home, is taken to be above everything", self.log.line)
            if s.relative and any(named):
                self.log.remark("machine_relative", "G53 in incremental coordinates (G91), which controls read "
                                "differently", self.log.line)
        elif any(named):
            self._line_to(self._target(axes), RAPID, NAN)
        else:
            named = [True] * 3
        if (named[0] or named[1]) and not math.isnan(s.position[2]):
            self.log.remark("machine_way", f"X or Y goes to a place of the machine's own from Z{s.position[2]:g}, a "
                            "way the proof cannot see: send Z home first", self.log.line)
        s.position = [NAN if n else p for n, p in zip(named, s.position, strict=True)]
        s.parked |= named[0] or named[1]
        return None

    def _feed(self, values: dict[str, float]) -> float | None:
        s = self.s
        feed = values.get("F", NAN) if s.feed_mode == 93 else s.feed
        if not feed > 0:
            self.log.error("inverse time feed (G93) needs F on every line" if s.feed_mode == 93
                           else "a feed move without a feed (F)")
            return None
        if s.feed_mode == 95:
            if not s.speed > 0:
                self.log.error("feed per turn (G95) without a spindle speed")
                return None
            return feed * s.speed
        return feed

    def _rate(self, feed: float, points: list[list[float]]) -> float:
        """mm/min of a move along ``points``; inverse time divides the whole length by its minutes."""
        if self.s.feed_mode != 93:
            return feed
        return feed * sum(math.dist(a, b) for a, b in itertools.pairwise(points))

    def _check_cutting(self, target: list[float]) -> None:
        s, remark = self.s, self.log.remark
        if s.tool == 0:
            remark("no_tool", "a feed move without a tool in the spindle (no T and M6 before)")
        if s.offset is None:
            remark("offset_off", f"a feed move with the length offset off (no G43 H{s.tool})", s.tool)
        elif s.offset != s.tool:
            remark("offset_stale", f"a feed move with length offset H{s.offset} and tool T{s.tool}", (s.offset, s.tool))
        if not s.turning:
            why = "no M3" if not s.spindle else "no S given" if math.isnan(s.speed) else f"S{s.speed:g}"
            remark("spindle", f"a feed move with the spindle standing ({why})", (s.tool, why))
        if any(math.isnan(v) for v in target):
            remark("unknown", "a feed move from a place the program has not stated")

    def _line_to(self, target: list[float], kind: int, feed: float) -> None:
        s = self.s
        start = [t if math.isnan(p) else p for p, t in zip(s.position, target, strict=True)]
        was, s.position = s.position, target
        level = target[2] == target[2] and was[2] != target[2]
        if kind == RAPID and s.offset is None and s.tool > 0 and level:
            self.log.remark("rapid_offset", f"Z moves with the length offset off (no G43 H{s.tool})", s.tool)
        known = not any(math.isnan(v) for v in target)
        if s.parked and level and not known:
            self.log.remark("parked", "Z comes down where the machine's own coordinates left X or Y: state X and Y "
                            "first", self.log.line)
        s.parked &= math.isnan(target[0]) or math.isnan(target[1])
        if known:
            if len(self.log.rows) >= Log.full:
                self.log.flush()
            self.log.rows.append((*start, *target, kind, feed, s.tool, self.log.line))  # type: ignore[arg-type]

    def _arc(self, target: list[float], values: dict[str, float], feed: float) -> None:
        s, error = self.s, self.log.error
        if any(math.isnan(v) for v in s.position):
            return error("an arc from a place the program has not stated")
        axes = PLANE_AXES[s.plane]
        start, end = np.array(s.position), np.array(target)
        letters = ["IJK"[axes[0]], "IJK"[axes[1]]]
        turns = whole(values, "P", 1)
        try:
            if "R" in values:
                centre = centre_from_radius(start, end, values["R"] * s.scale, s.motion == 2, axes)
            elif any(c in values for c in letters):
                offset = np.array([values.get(c, 0.0) * s.scale for c in letters])
                if s.centre_absolute and not all(c in values for c in letters):
                    return error(f"absolute arc centres (G90.1) need both {letters[0]} and {letters[1]}")
                centre = offset if s.centre_absolute else start[list(axes[:2])] + offset
            else:
                return error(f"an arc without its centre ({letters[0]}, {letters[1]}) or R in plane G{s.plane}")
            if values.get("IJK"[axes[2]], 0.0) != 0 and "R" not in values:
                return error(f"the word {'IJK'[axes[2]]} has no meaning in plane G{s.plane}")
            points = arc_points(start, end, centre, s.motion == 2, axes, turns, most=MOST_MOVES_A_BLOCK).tolist()
        except ArcTooLong as problem:
            return self.log.room(problem.points)
        except ArcError as problem:
            return error(str(problem))
        self.log.room(len(points))
        rate = self._rate(feed, [s.position, *points])
        for p in points:
            self._line_to(p, FEED, rate)
        return None

    def _cycle(self, axes: list[float | None], values: dict[str, float]) -> None:
        """G81, G82, G83, G73 in the XY plane, written out as rapids and feeds."""
        s, error = self.s, self.log.error
        if s.plane != 17:
            return error(f"a drilling cycle in plane G{s.plane}")
        s.cycle.update({k: values[k] for k in "RQP" if k in values})
        if axes[2] is not None:
            s.cycle["Z"] = axes[2]
        missing = [k for k in ("Z", "R", *(("Q",) if s.motion in (73, 83) else ())) if k not in s.cycle]
        if missing:
            return error(f"a drilling cycle without {', '.join(missing)}")
        if math.isnan(s.position[2]):
            return error("a drilling cycle from a height the program has not stated")
        if s.cycle.get("P", 0.0) < 0:
            return error(f"P{s.cycle['P']:g} waits a negative time")
        feed = self._feed(values)
        repeats = whole(values, "L" if "L" in values else "K", 1)
        if feed is None:
            return None
        for _ in range(repeats):
            hole = self._hole()
            if hole is None:
                return None
            self.log.room(repeats * hole.moves)
            at = self._target([axes[0], axes[1], None])
            self._check_cutting(at)
            for point, kind in hole_moves(hole, s.position, at[0], at[1]):
                self._line_to(point, kind, feed if kind == FEED else NAN)
            self.dwell += 0.0 if s.motion == 81 else s.cycle.get("P", 0.0)
        return None

    def _hole(self) -> Hole | None:
        """The hole of the cycle in force from the present height."""
        s = self.s
        top = s.position[2]
        clear = s.cycle["R"] * s.scale + (top if s.relative else 0.0)
        bottom = s.cycle["Z"] * s.scale + (clear if s.relative else 0.0)
        if bottom > clear:
            self.log.error("the drilling depth Z lies above R")
            return None
        pecking = s.motion in (73, 83)
        peck = abs(s.cycle["Q"]) * s.scale if pecking else max(clear - bottom, 1e-9)
        if peck <= 0 and clear > bottom:
            self.log.error("a drilling cycle with Q0 never ends")
            return None
        return Hole(clear, bottom, clear if s.retract_to_r else max(top, clear), peck, s.motion == 83)


def read_program(text: str, *, name: str = "program", tools: Collection[int] | None = None,
                 work_offset: str = "G54", blend_limit: float = BLEND_LIMIT) -> Program:
    """Read a 3-axis program.

    text        : the program
    tools       : T numbers of the tool table; any number is accepted when None
    work_offset : the one of the setup, for example 'G54'
    blend_limit : mm, what path blending (G64 P, Q) may leave the path by without a remark

    Returns
    -------
    Program
        Tip moves in mm; arcs within 1e-3 mm of their circle.

    Raises
    ------
    ProgramError
        With every line that cannot be read: unknown words, two words of one modal group, a feed move without a
        feed, an arc without a centre or whose ends lie on two circles, a tool that is not in the table, a program
        that breaks off.
    VerificationError
        Code program_too_long: a block of more than 200 000 moves, or a program of more than 5 000 000.
    """
    if "\x00" in text:
        raise ProgramError(f"{name} is not a text file", remedy="send the NC program as text")
    return Reader(name, tools, work_offset, blend_limit).read(text)


__all__ = ["FEED", "RAPID", "Program", "Reader", "Remark", "read_program"]
