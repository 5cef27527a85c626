"""NC text to moves of the tool tip: a 3-axis LinuxCNC / Fanuc reader of its own.

A program is read line by line by one modal machine. The common line, one straight move in modal
coordinates, is taken by one regular expression; everything else goes through the full block.
What the reader does not know it names with its line (``ProgramError``): nothing is skipped in silence.
What it understands but a machinist should not run (length offset off, another work offset, spindle
standing) becomes a ``Remark`` and the reading goes on.

Assumptions: a machine-coordinate move (G53, G28, G30) and a tool change go to a place above everything;
the axes they leave unknown are known again once programmed. A rapid is one straight line.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.errors import ProgramError
from geometry.mesh import F64, I32
from verify.arcs import PLANE_AXES, ArcError, arc_points, centre_from_radius

RAPID, FEED = 0, 1
INCH = 25.4
MAX_ERRORS = 20
NAN = math.nan

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_FAST = re.compile(rf"(?:N\d+ ?)?(?:G0?([01]) ?)?(?:X({_NUMBER}) ?)?(?:Y({_NUMBER}) ?)?(?:Z({_NUMBER}) ?)?"
                   rf"(?:F({_NUMBER}) ?)?\r?").fullmatch
_WORD = re.compile(rf"([A-Z])({_NUMBER})")
_COMMENT = re.compile(r"\([^()]*\)")
_KNOWN_M = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30})
_OFFSETS = {54: "G54", 55: "G55", 56: "G56", 57: "G57", 58: "G58", 59: "G59", 59.1: "G59.1", 59.2: "G59.2",
            59.3: "G59.3"}
_CYCLES = frozenset({73, 81, 82, 83})
_IGNORED_G = frozenset({15, 40, 50, 61, 61.1, 64, 69})
_MOTION = frozenset({0, 1, 2, 3, 80}) | _CYCLES
_UNKNOWN_G_HINT = {
    10: "a changed offset table", 41: "cutter radius compensation", 42: "cutter radius compensation",
    43.4: "tool centre point control", 43.5: "tool centre point control", 52: "a shifted origin",
    65: "a macro call", 66: "a macro call", 68: "a rotated frame", 92: "a shifted origin",
}


@dataclass(frozen=True)
class Remark:
    """Something readable that should not be run: where and what."""

    line: int
    message: str


@dataclass(frozen=True, eq=False)
class Program:
    """A program as straight moves of the tool tip in the setup frame.

    name    : of the program
    start, end : (m, 3) float64, mm; an axis whose start is unknown starts where it ends
    kind    : (m,) int8, RAPID or FEED (arcs are FEED polylines within 1e-3 mm)
    feed    : (m,) float64, mm/min; nan for rapids
    tool    : (m,) int32, T number in the spindle, 0 for none
    line    : (m,) int32, 1-based line of the source
    dwell   : s of G4 and drilling dwells
    lines   : number of lines read
    remarks : what should not be run
    """

    name: str
    start: F64
    end: F64
    kind: NDArray[np.int8]
    feed: F64
    tool: I32
    line: I32
    dwell: float
    lines: int
    remarks: tuple[Remark, ...]

    def __len__(self) -> int:
        return len(self.start)


@dataclass
class _State:
    """Everything modal."""

    position: list[float] = field(default_factory=lambda: [NAN, NAN, NAN])
    motion: float | None = None
    plane: int = 17
    scale: float = 1.0
    relative: bool = False
    centre_absolute: bool = False
    feed_mode: int = 94
    feed: float = NAN
    speed: float = 0.0
    spindle: bool = False
    selected: int = 0
    tool: int = 0
    offset: int | None = None
    work_offset: str = "G54"
    retract_to_r: bool = False
    cycle: dict[str, float] = field(default_factory=dict)
    ended: bool = False


class Reader:
    """One reading of one program; use ``read_program``."""

    def __init__(self, name: str, tools: Collection[int] | None, work_offset: str) -> None:
        self.name, self.tools, self.work_offset = name, tools, work_offset
        self.s = _State()
        self.rows: list[tuple[float, float, float, float, float, float, int, float, int, int]] = []
        self.remarks: dict[tuple[str, object], Remark] = {}
        self.errors: list[tuple[int, str]] = []
        self.dwell = 0.0
        self.line = 0

    # ---------------------------------------------------------------- text

    def read(self, text: str) -> Program:
        lines = text.split("\n")
        percents = self._scan(lines)
        if not self.s.ended and percents < 2:
            self._error(f"{self.name} does not end with M2, M30 or a closing %: it may be cut off", len(lines))
        if self.errors:
            self._raise()
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 10)
        return Program(self.name, np.ascontiguousarray(table[:, 0:3]), np.ascontiguousarray(table[:, 3:6]),
                       table[:, 6].astype(np.int8), np.ascontiguousarray(table[:, 7]), table[:, 8].astype(np.int32),
                       table[:, 9].astype(np.int32), self.dwell, len(lines),
                       tuple(sorted(self.remarks.values(), key=lambda r: (r.line, r.message))))

    def _scan(self, lines: list[str]) -> int:
        """Run every line; the fast path serves plain straight moves, and only in the plain modal state."""
        s, fast, rows = self.s, _FAST, self.rows
        percents = 0
        plain = False
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
                    if s.motion == 0:
                        rows.append((px, py, pz, ex, ey, ez, RAPID, NAN, s.tool, number))
                        continue
                    if s.feed > 0:
                        rows.append((px, py, pz, ex, ey, ez, FEED, s.feed, s.tool, number))
                        continue
                    s.position = [px, py, pz]
            self.line = number
            text = raw.strip()
            if text == "%":
                percents += 1
                if percents == 2:
                    break
                continue
            if text:
                self._block(text)
            if s.ended:
                break
            plain = self._is_plain()
            if len(self.errors) >= MAX_ERRORS:
                break
        return percents

    def _is_plain(self) -> bool:
        """Whether a straight move needs nothing but its numbers now."""
        s = self.s
        return (not s.relative and s.scale == 1.0 and s.feed_mode == 94 and s.spindle and s.tool > 0
                and s.offset == s.tool and s.work_offset == self.work_offset
                and not any(math.isnan(v) for v in s.position))

    def _block(self, text: str) -> None:
        text = _COMMENT.sub(" ", text).split(";", 1)[0].upper()
        if "(" in text or ")" in text:
            return self._error("a comment is not closed")
        text = "".join(text.split())
        if not text:
            return None
        if text.startswith("/"):
            self._remark("block_delete", "a block with / depends on a switch of the machine; it is taken as run")
            text = text[1:]
        if text.startswith("O"):
            if re.fullmatch(r"O\d+", text):
                return None
            return self._error(f"cannot read the subroutine or macro word '{text[:40]}'")
        words = _WORD.findall(text)
        if "".join(a + b for a, b in words) != text:
            return self._error(f"cannot read '{text[:60]}'")
        self._run(words)
        return None

    def _error(self, message: str, line: int | None = None) -> None:
        self.errors.append((line or self.line, message))

    def _remark(self, key: str, message: str, detail: object = None) -> None:
        self.remarks.setdefault((key, detail), Remark(self.line, message))

    def _raise(self) -> None:
        line, message = self.errors[0]
        more = f" (and {len(self.errors) - 1} more)" if len(self.errors) > 1 else ""
        raise ProgramError(f"{self.name}, line {line}: {message}{more}",
                           subjects=tuple(f"line {n}" for n, _ in self.errors), measured=[m for _, m in self.errors],
                           remedy="correct the lines named, or leave out what a 3-axis reader does not know")

    # ---------------------------------------------------------------- one block

    def _run(self, words: list[tuple[str, str]]) -> None:
        codes: list[float] = []
        ms: list[int] = []
        values: dict[str, float] = {}
        for letter, text in words:
            number = float(text)
            if letter == "G":
                codes.append(round(number, 1))
            elif letter == "M":
                if number not in _KNOWN_M:
                    return self._error(f"unknown word M{text}")
                ms.append(int(number))
            elif letter in "NO":
                continue
            elif letter in "XYZIJKRPQLFSTHD":
                if letter in values:
                    return self._error(f"the word {letter} stands twice")
                values[letter] = number
            else:
                return self._error(f"unknown word {letter}{text}")
        if "S" in values:
            self.s.speed = values["S"]
        if "T" in values:
            self._select(int(values["T"]))
        self._spindle(ms)
        if not self._modal(codes, values):
            return None
        if "F" in values:
            self.s.feed = values["F"] * (1.0 if self.s.feed_mode == 93 else self.s.scale)
        self._move(codes, values)
        if 5 in ms:
            self.s.spindle = False
        if 2 in ms or 30 in ms:
            self.s.ended = True
        return None

    def _select(self, number: int) -> None:
        if self.tools is not None and number not in self.tools and number != 0:
            self._error(f"T{number} is not in the tool table")
        self.s.selected = number

    def _spindle(self, ms: list[int]) -> None:
        s = self.s
        if 6 in ms:
            if s.selected != s.tool:
                s.position[2] = NAN
            s.tool, s.spindle = s.selected, False
        if 3 in ms:
            s.spindle = True
        if 4 in ms:
            s.spindle = True
            self._remark("m4", "M4 turns the spindle backwards")

    def _modal(self, codes: list[float], values: dict[str, float]) -> bool:
        """Apply every G word that sets a state; False where the block cannot be run."""
        s = self.s
        for g in codes:
            if g in _MOTION:
                s.motion = g
                if g == 80:
                    s.cycle = {}
            elif g in (17, 18, 19):
                s.plane = int(g)
            elif g in (20, 21):
                s.scale = INCH if g == 20 else 1.0
            elif g in (90, 91):
                s.relative = g == 91
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
            elif g in _OFFSETS:
                s.work_offset = _OFFSETS[g]
                if s.work_offset != self.work_offset:
                    self._remark("work_offset", f"{s.work_offset} is not the work offset of the setup "
                                 f"({self.work_offset})", s.work_offset)
            elif g not in _IGNORED_G and g not in (4, 28, 30, 53):
                hint = _UNKNOWN_G_HINT.get(g)
                self._error(f"unknown word G{g:g}" + (f" ({hint})" if hint else ""))
                return False
        return True

    def _length_offset(self, values: dict[str, float]) -> None:
        s = self.s
        s.offset = int(values["H"]) if "H" in values else s.tool
        if s.offset != s.tool:
            self._remark("length_offset", f"length offset H{s.offset} with tool T{s.tool} in the spindle", self.line)

    # ---------------------------------------------------------------- motion

    def _move(self, codes: list[float], values: dict[str, float]) -> None:
        s = self.s
        axes = [values.get(a) for a in "XYZ"]
        if 4 in codes:
            if "P" not in values:
                return self._error("G4 needs P")
            self.dwell += values["P"]
            return None
        if 53 in codes or 28 in codes or 30 in codes:
            return self._machine_move(codes, axes)
        full_circle = s.motion in (2, 3) and not values.keys().isdisjoint("IJK")
        if all(a is None for a in axes) and not full_circle:
            return None
        if s.motion is None or s.motion == 80:
            return self._error("coordinates without a motion word")
        if s.motion in _CYCLES:
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

    def _target(self, axes: list[float | None]) -> list[float]:
        s = self.s
        return [p if a is None else (p + a * s.scale if s.relative else a * s.scale)
                for a, p in zip(axes, s.position, strict=True)]

    def _machine_move(self, codes: list[float], axes: list[float | None]) -> None:
        """G28 and G30 pass a programmed point, then the axes named (all without any) are unknown; so after G53."""
        s = self.s
        named = [a is not None for a in axes]
        if 53 in codes:
            if s.motion not in (0, 1):
                return self._error("G53 needs G0 or G1")
        elif any(named):
            self._line_to(self._target(axes), RAPID, NAN)
        else:
            named = [True] * 3
        s.position = [NAN if n else p for n, p in zip(named, s.position, strict=True)]
        return None

    def _feed(self, values: dict[str, float]) -> float | None:
        s = self.s
        feed = values.get("F", NAN) if s.feed_mode == 93 else s.feed
        if not feed > 0:
            self._error("inverse time feed (G93) needs F on every line" if s.feed_mode == 93
                        else "a feed move without a feed (F)")
            return None
        if s.feed_mode == 95:
            if s.speed <= 0:
                self._error("feed per turn (G95) without a spindle speed")
                return None
            return feed * s.speed
        return feed

    def _rate(self, feed: float, points: list[list[float]]) -> float:
        """mm/min of a move along ``points``; inverse time divides the whole length by its minutes."""
        if self.s.feed_mode != 93:
            return feed
        return feed * sum(math.dist(a, b) for a, b in itertools.pairwise(points))

    def _check_cutting(self, target: list[float]) -> None:
        s = self.s
        if s.tool == 0:
            self._remark("no_tool", "a feed move without a tool in the spindle (no T and M6 before)")
        if s.offset is None:
            self._remark("offset_off", f"a feed move with the length offset off (no G43 H{s.tool})", s.tool)
        elif s.offset != s.tool:
            self._remark("offset_stale", f"a feed move with length offset H{s.offset} and tool T{s.tool}",
                         (s.offset, s.tool))
        if not s.spindle:
            self._remark("spindle", "a feed move with the spindle standing", s.tool)
        if any(math.isnan(v) for v in target):
            self._remark("unknown", "a feed move from a place the program has not stated")

    def _line_to(self, target: list[float], kind: int, feed: float) -> None:
        s = self.s
        start = [t if math.isnan(p) else p for p, t in zip(s.position, target, strict=True)]
        was, s.position = s.position, target
        if kind == RAPID and s.offset is None and s.tool > 0 and target[2] == target[2] and was[2] != target[2]:
            self._remark("rapid_offset", f"Z moves with the length offset off (no G43 H{s.tool})", s.tool)
        if not any(math.isnan(v) for v in target):
            self.rows.append((*start, *target, kind, feed, s.tool, self.line))  # type: ignore[arg-type]

    def _arc(self, target: list[float], values: dict[str, float], feed: float) -> None:
        s = self.s
        if any(math.isnan(v) for v in s.position):
            return self._error("an arc from a place the program has not stated")
        axes = PLANE_AXES[s.plane]
        start, end = np.array(s.position), np.array(target)
        letters = ["IJK"[axes[0]], "IJK"[axes[1]]]
        try:
            if "R" in values:
                centre = centre_from_radius(start, end, values["R"] * s.scale, s.motion == 2, axes)
            elif any(c in values for c in letters):
                offset = np.array([values.get(c, 0.0) * s.scale for c in letters])
                if s.centre_absolute and not all(c in values for c in letters):
                    return self._error(f"absolute arc centres (G90.1) need both {letters[0]} and {letters[1]}")
                centre = offset if s.centre_absolute else start[list(axes[:2])] + offset
            else:
                return self._error(f"an arc without its centre ({letters[0]}, {letters[1]}) or R in plane G{s.plane}")
            if "IJK"[axes[2]] in values and values["IJK"[axes[2]]] != 0 and "R" not in values:
                return self._error(f"the word {'IJK'[axes[2]]} has no meaning in plane G{s.plane}")
            points = arc_points(start, end, centre, s.motion == 2, axes, max(1, int(values.get("P", 1)))).tolist()
        except ArcError as problem:
            return self._error(str(problem))
        rate = self._rate(feed, [s.position, *points])
        for p in points:
            self._line_to(p, FEED, rate)
        return None

    # ---------------------------------------------------------------- drilling cycles

    def _cycle(self, axes: list[float | None], values: dict[str, float]) -> None:
        """G81, G82, G83, G73 in the XY plane, written out as rapids and feeds."""
        s = self.s
        if s.plane != 17:
            return self._error(f"a drilling cycle in plane G{s.plane}")
        s.cycle.update({k: values[k] for k in "RQP" if k in values})
        if axes[2] is not None:
            s.cycle["Z"] = axes[2]
        missing = [k for k in ("Z", "R", *(("Q",) if s.motion in (73, 83) else ())) if k not in s.cycle]
        if missing:
            return self._error(f"a drilling cycle without {', '.join(missing)}")
        if any(math.isnan(v) for v in (s.position[2],)):
            return self._error("a drilling cycle from a height the program has not stated")
        feed = self._feed(values)
        if feed is None:
            return None
        for _ in range(max(1, int(values.get("L", values.get("K", 1))))):
            self._drill(self._target([axes[0], axes[1], None]), feed)
        return None

    def _drill(self, at: list[float], feed: float) -> None:
        s = self.s
        top = s.position[2]
        clear = top + s.cycle["R"] * s.scale if s.relative else s.cycle["R"] * s.scale
        bottom = clear + s.cycle["Z"] * s.scale if s.relative else s.cycle["Z"] * s.scale
        if bottom > clear:
            return self._error("the drilling depth Z lies above R")
        x, y = at[0], at[1]
        self._check_cutting(at)
        if clear > top:
            self._line_to([s.position[0], s.position[1], clear], RAPID, NAN)
        self._line_to([x, y, s.position[2]], RAPID, NAN)
        self._line_to([x, y, clear], RAPID, NAN)
        peck = abs(s.cycle.get("Q", 0.0)) * s.scale if s.motion in (73, 83) else clear - bottom
        if peck <= 0 and clear > bottom:
            return self._error("a drilling cycle with Q0 never ends")
        depth = clear
        while depth > bottom + 1e-9:
            depth = max(depth - peck, bottom)
            self._line_to([x, y, depth], FEED, feed)
            if depth > bottom + 1e-9:
                back = clear if s.motion == 83 else depth + 0.25
                self._line_to([x, y, back], RAPID, NAN)
                if s.motion == 83:
                    self._line_to([x, y, min(depth + 0.25, clear)], RAPID, NAN)
        if s.motion == 82:
            self.dwell += s.cycle.get("P", 0.0)
        self._line_to([x, y, clear if s.retract_to_r else max(top, clear)], RAPID, NAN)
        return None


def read_program(text: str, *, name: str = "program", tools: Collection[int] | None = None,
                 work_offset: str = "G54") -> Program:
    """Read a 3-axis program.

    text        : the program
    tools       : T numbers of the tool table; any number is accepted when None
    work_offset : the one of the setup, for example 'G54'

    Returns
    -------
    Program
        Tip moves in mm; arcs within 1e-3 mm of their circle.

    Raises
    ------
    ProgramError
        With every line that cannot be read: unknown words, a feed move without a feed, an arc without a
        centre or whose ends lie on two circles, a tool that is not in the table, a program that breaks off.
    """
    if "\x00" in text:
        raise ProgramError(f"{name} is not a text file", remedy="send the NC program as text")
    return Reader(name, tools, work_offset).read(text)
