"""Straight moves, and moves whose cutter radius is compensated, written to the log.

Blocks count in programmed coordinates (mm, seen through the frames of ``verify.gcode.frames``); the state and the log
keep the tip in the setup frame. While compensation is on, ``State.position`` is the programmed place and ``actual`` the
place of the tool.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from verify.assumptions import Assumed, AssumedKind
from verify.gcode.block_words import BlockError
from verify.gcode.cutter_compensation import (
    FANUC_STYLE,
    LINUXCNC_STYLE,
    CompensationError,
    Contour,
    Element,
    Piece,
    Style,
)
from verify.gcode.dialects.base import DialectReader
from verify.gcode.frames import Frame, translation
from verify.gcode.work_offsets import Origins
from verify.program.arc_chords import CHORD, PLANE_AXES, swept_points
from verify.program.move_kinds import FEED, RAPID
from verify.program.move_log import MAX_MOVES_A_BLOCK
from verify.program.program import NAN, StopPoint

UNPLACED = "a rapid in Z alone, before X and Y are stated,"
ACCELERATION = 1e4
"""mm/s², the largest to the centre of an arc that a machine is taken to make."""
LEAN_ROOM = 10.0
"""Times the deviation that path blending may have: how far a tool axis off its way may take the rim of the tool."""
_UNSETTLED = "cutter radius compensation is on: end it with G40 first"


@dataclass(frozen=True)
class _Way:
    """What else a move of a contour has: kind, mm/min, (3,) mm where it starts and ends, as programmed.

    constant : whether the feed is that of the contour, not of the tool's centre
    """

    kind: int
    feed: float
    start: list[float]
    end: list[float]
    constant: bool = False


@dataclass(frozen=True)
class _Event:
    """Something to do between two moves, with its line."""

    line: int
    run: Callable[[], None]


class ContourMotion(Origins):
    """Straight moves and compensated contours.

    control : reader of the control's words, None for LinuxCNC
    radii   : mm by T number, radius of the tools of the setup (``OffsetTables`` keeps it)
    names   : T numbers by the ids of the tools of the setup
    actual  : (3,) mm, place of the tool where it is not the programmed one, None elsewhere
    chord   : mm, by which chords may leave their arcs
    max_feed : mm/min, of the machine, or None
    across  : whether the running block has a word of an axis of the plane
    elements, idle, counts, fine_line : as in ``verify.gcode.dialects.base.Machine``
    """

    counts = False
    fine_line = 0

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type]
        self.control: DialectReader | None = None
        self._open_tables()
        self.names: dict[str, int] = {}
        self.teeth: dict[int, int] = {}
        self.contour: Contour | None = None
        self.actual: list[float] | None = None
        self.across, self.chord = False, CHORD
        self.max_feed: float | None = None
        self.elements = self.idle = 0
        self._composed: tuple[tuple[object, ...], Frame | None] | None = None
        self._stated: tuple[Frame, list[float]] | None = None  # coordinates of a place that is not known whole

    def _zero_name(self, name: str) -> str:
        return name if self.control is None else self.control.zero_names.get(name, name)

    def _turned_tip(self, was: Sequence[float], kind: int) -> None:
        if self.control is None or self.machine is None:
            return
        self.control.tip_turned(self.machine, was, self.s.turn)
        off = self.radii.get(self.s.tool, 0.0) * math.sin(math.radians(min(self.control.lean, 90.0)))
        if kind == FEED and off > LEAN_ROOM * self.blend_limit:
            self.log.remark("lean", f"the control may turn the tool axis {self.control.lean:g} deg off its way here, "
                            f"which takes the rim of T{self.s.tool} {off:.3g} mm off (limit "
                            f"{LEAN_ROOM * self.blend_limit:g} mm): state a smaller tolerance of the tool axis",
                            self.s.tool)

    @property
    def _foreign(self) -> bool:
        return self.control is not None

    @property
    def style(self) -> Style:
        """How the control compensates a cutter radius."""
        return self.control.style if self.control is not None else LINUXCNC_STYLE

    def _frame(self) -> Frame | None:
        """From coordinates as the blocks have them, mm, to the setup frame; None where both are the same."""
        s, outer = self.s, None if self.control is None else self.control.frame
        if outer is None and s.frame is None:
            return None
        key = (outer, s.frame, *s.origin)
        if self._composed is None or self._composed[0] != key:
            own = outer if s.frame is None else s.frame if outer is None else outer @ s.frame
            zero = s.origin
            whole = translation(zero) @ own @ translation([-v for v in zero]) if any(zero) and own is not None else own
            self._composed = key, whole
        return self._composed[1]

    def _here(self) -> list[float]:
        """(3,) mm, the programmed place in the coordinates of the blocks."""
        frame = self._frame()
        if frame is None:
            return list(self.s.position)
        place = frame.back(self.s.position)
        if self._stated is not None and self._stated[0] is frame:
            place = [q if math.isnan(p) else p for p, q in zip(place, self._stated[1], strict=True)]
        return place

    def _compensation(self, word: float, values: dict[str, float]) -> None:
        """Run G40, G41, G42, G41.1 or G42.1."""
        s = self.s
        if word == 40:
            return self._end_contour()
        side = 1 if word in (41, 41.1) else -1
        radius = self._cutter_radius(word, values)
        if self.contour is not None:
            if side == s.side and radius == self.contour.radius and self.style is not LINUXCNC_STYLE:
                return None
            raise BlockError(f"G{word:g} while {_UNSETTLED}")
        if self.style is LINUXCNC_STYLE and s.plane == 19:
            raise BlockError("cutter radius compensation in plane G19")
        if s.tcp and s.tilted and not self._square():
            raise BlockError("cutter radius compensation with a tilted tool")
        if (frame := self._frame()) is not None:
            radius /= frame.scale_in(s.plane)
        s.side = side
        if radius == 0:  # the programmed path is the path of the tool
            return None
        if self.style is FANUC_STYLE:
            self.log.note("cutter radius compensation is read with an approach of type A and straight outside corners; "
                          "parameters or settings of the machine decide")
        where = self.actual or self._here()
        i, j, _ = PLANE_AXES[s.plane]
        self.contour = Contour(side * (1 if radius > 0 else -1), abs(radius), complex(where[i], where[j]))
        self.actual = list(where)
        return None

    def _square(self) -> bool:
        """Whether the tool stands square to the plane of the blocks."""
        s, frame = self.s, self._frame()
        if frame is None or self.machine is None:
            return False
        axis = self.machine.axis(np.radians([s.turn]))[0]
        normal = frame.matrix[:, PLANE_AXES[s.plane][2]]
        return bool(np.linalg.norm(axis - normal / np.linalg.norm(normal)) < 1e-6)

    def _cutter_radius(self, word: float, values: dict[str, float]) -> float:
        """mm, of the D word, which is the diameter itself in G41.1 and G42.1."""
        s = self.s
        if word in (41.1, 42.1):
            if "D" not in values:
                raise BlockError(f"G{word:g} needs D, the diameter of the tool")
            return values["D"] * s.scale / 2
        if "D" not in values and s.d is None and self.style is not LINUXCNC_STYLE:
            self.log.remark("no_radius_offset", f"G{word:g} without D: the control takes the D that it had before the "
                            "program, or none", s.tool)
        if "D" in values or s.d is None or self.style is LINUXCNC_STYLE:
            s.d = int(values["D"]) if "D" in values else s.tool
        written = self._written_radius(s.d, self.radii.get(s.tool))
        if written is not None:
            if self.control is not None:
                self.control.leave_open(Assumed(
                    AssumedKind.RADIUS_REGISTER, f"D{s.d} stands for a radius of {written:g} mm", "where the control "
                    "counts the register the other way, as radius or diameter, the tool is aside by half or all of it",
                    "setting 40 (Haas) or parameter 5004#2 (Fanuc): check it on the machine"))
            return written
        if s.d == 0 and "D" in values and self.style is not LINUXCNC_STYLE:
            return 0.0
        number = s.d if s.d in self.radii else s.tool
        if number not in self.radii:
            raise BlockError(f"G{word:g} needs the radius of T{number}, and the setup has no such tool",
                             "give the tool in the setup, or set the register with G10 L12")
        radius = self.radii[number]
        if number != s.tool or (s.d != s.tool and not self._own_register(s.d)):
            self.log.remark("radius_offset", f"cutter radius D{s.d} with tool T{s.tool} in the spindle", (s.d, s.tool))
        self.log.note(f"D{s.d} counts as the radius of T{number}, {radius:g} mm; a contour that is the path of the "
                      "tool's centre needs 0 there instead")
        return radius

    def _end_contour(self) -> None:
        """G40: the contour ends on its own normal; the next move leads to its programmed place."""
        self.s.side = 0
        if self.contour is None:
            return
        self._write_pieces(self.contour.close())
        self.contour = None
        if self.actual == self._here():
            self.actual = None

    def _settled(self, word: str) -> None:
        """Refuse a block that compensation does not go with."""
        if self.contour is not None:
            raise BlockError(f"{word} while {_UNSETTLED}")

    def _in_order(self, run: Callable[[], None]) -> None:
        """Do something after the moves before it are written."""
        if self.contour is None:
            return run()
        return self._write_pieces(self.contour.wait(_Event(self.log.line, run)))

    def _go(self, target: list[float], kind: int, feed: float, turn: list[float] | None = None,
            minutes: float = NAN) -> None:
        """A straight move of a block, compensated where that is on; arguments as those of ``_line_to``."""
        if self.contour is None:
            return self._line_to(target, kind, feed, turn, minutes)
        if turn is not None and turn != self.s.turn:
            raise BlockError(f"a rotary axis turns while {_UNSETTLED}")
        start = self._here()
        if any(math.isnan(v) for v in [*start, *target]):
            raise BlockError("cutter radius compensation at a place that the program has not stated")
        i, j, _ = PLANE_AXES[self.s.plane]
        a, b = complex(start[i], start[j]), complex(target[i], target[j])
        way = _Way(kind, feed, start, target)
        if a == b:
            pieces: Iterable[Piece | object] = self.contour.wait(_Event(self.log.line, lambda: self._along(way)))
        else:
            pieces = self._add(self.contour, Element(a, b, line=self.log.line, rapid=kind == RAPID, tag=way))
        self._write_pieces(pieces)
        self._stand_at(target)

    def _bow(self, target: list[float], centre: complex, sweep: float, feed: float) -> None:
        """An arc of a block while compensation is on, in its plane: centre, mm, and signed sweep, rad."""
        start, (i, j, _) = self._here(), PLANE_AXES[self.s.plane]
        if self.contour is None or any(math.isnan(v) for v in [*start, *target]):
            raise BlockError("cutter radius compensation at a place that the program has not stated")
        self._write_pieces(self._add(self.contour, Element(
            complex(start[i], start[j]), complex(target[i], target[j]), centre, sweep, self.log.line,
            tag=_Way(FEED, feed, start, target, self.control is not None and self.control.contour_feed))))
        self._stand_at(target)

    def _add(self, contour: Contour, element: Element) -> Iterable[Piece | object]:
        """The next element of the contour; it tells a corner that the control does not look ahead to."""
        ahead = math.inf if self.control is None else self.control.looks_ahead
        if self.idle > ahead and contour.bends(element, self.style):
            self.log.remark("looks_ahead", f"{self.idle} blocks without a move in the plane stand before this corner "
                            f"of a contour under G41 or G42: with more than {ahead:g} of them the control may not look "
                            "ahead to it, and cuts into the contour", self.log.line)
        self.elements, self.idle = self.elements + 1, 0
        return contour.add(element, self.style)

    def _stand_at(self, target: list[float]) -> None:
        frame = self._frame()
        self.s.position = target if frame is None else frame.out(target)

    def _along(self, way: _Way) -> None:
        """A move along the third axis: the tool keeps its place in the plane."""
        k = PLANE_AXES[self.s.plane][2]
        there = list(self.actual or way.end)
        there[k] = way.end[k]
        self._line_to(there, way.kind, way.feed)

    def _write_pieces(self, pieces: Iterable[Piece | object]) -> None:
        """Write pieces of the contour as moves with the lines of their elements."""
        programmed, line = self.s.position, self.log.line
        try:
            for piece in pieces:
                if isinstance(piece, _Event):
                    self.log.line = piece.line
                    piece.run()
                elif isinstance(piece, Piece):
                    self.log.line = piece.element.line
                    self._write_piece(piece)
        except CompensationError:  # what follows would be named for the same reason
            self.contour, self.actual = None, None
            raise
        finally:
            self.s.position, self.log.line = programmed, line

    def _write_piece(self, piece: Piece) -> None:
        way = piece.element.tag
        assert isinstance(way, _Way)
        i, j, k = PLANE_AXES[self.s.plane]
        start = list(self.actual or way.start)
        end = list(way.end)
        end[i], end[j] = piece.end.real, piece.end.imag
        if piece.link:
            end[k] = start[k]
        if piece.centre is None:
            return self._line_to(end, way.kind, way.feed)
        points = swept_points(start, end, (piece.centre.real, piece.centre.imag), piece.sweep, (i, j, k), self.chord,
                              MAX_MOVES_A_BLOCK).tolist()
        self.log.room(len(points))
        feed = way.feed
        if way.constant and not piece.link and self.s.feed_mode != 93:
            feed = self._centre_feed(feed, piece.element.radius, abs(piece.start - piece.centre))
        for p in points:
            self._line_to(p, way.kind, feed)
        return None

    def _centre_feed(self, feed: float, contour: float, path: float) -> float:
        """Feed of the tool's centre where that of the contour is ``feed``, mm/min, not less than that.

        contour, path : mm, radii of an arc and of the way of the centre beside it
        """
        fastest = min(60.0 * math.sqrt(ACCELERATION * path), math.inf if self.max_feed is None else self.max_feed)
        centre = max(feed, min(feed * path / max(contour, 1e-9), fastest))
        if centre > feed:
            self.log.note("F is the feed of the contour under G41 and G42 (CFC, as delivered): on outside arcs the "
                          "centre of the tool is faster; CFTCP makes it the feed of the centre")
        return centre

    def _line_to(self, target: list[float], kind: int, feed: float, turn: list[float] | None = None,
                 minutes: float = NAN) -> None:
        """Write a straight move from the place of the tool to ``target`` and turn the axes to ``turn``.

        target : (3,) mm, in the coordinates of the blocks
        kind, feed : as in ``Program``; turn : (2,) deg, or None; minutes : min, nan where the feed gives them
        """
        s, frame = self.s, self._frame()
        if self.actual is not None:
            s.position = list(self.actual) if frame is None else frame.out(self.actual)
            if self.contour is not None:
                self.actual = target
            elif self.style.holds and not self.across:
                return self._hold(target, kind, feed, turn, minutes, frame)
            else:
                self.actual = None
        unknown = frame is not None and any(map(math.isnan, target))
        self._stated = (frame, list(target)) if unknown and frame is not None else None
        return self._straight(target if frame is None else frame.out(target), kind, feed, turn, minutes)

    def _chords(self, points: Sequence[list[float]], feed: float, minutes: float) -> None:
        """Write the chords of an arc to ``points``, (3,) mm each, as ``_line_to`` writes each of them."""
        self._line_to(points[0], FEED, feed, None, minutes)
        if self.actual is not None or self._frame() is not None or any(map(math.isnan, points[-1])):
            for p in points[1:]:
                self._line_to(p, FEED, feed, None, minutes)
            return
        for was, p in itertools.pairwise(points):
            self._write(was, p, FEED, feed, 0, None, minutes)
        self.s.position = points[-1]

    def _hold(self, target: list[float], kind: int, feed: float, turn: list[float] | None, minutes: float,
              frame: Frame | None) -> None:
        """A move along the third axis after G40: the tool keeps its place in the plane until a word names one."""
        there, k = list(self.actual or target), PLANE_AXES[self.s.plane][2]
        there[k] = target[k]
        self._straight(there if frame is None else frame.out(there), kind, feed, turn, minutes)
        self.actual = there
        self._stand_at(target)

    def _straight(self, target: list[float], kind: int, feed: float, turn: list[float] | None,
                  minutes: float) -> None:
        """Move straight to ``target`` (3,) mm, setup frame, and turn the axes to ``turn`` (2,) deg, if given."""
        s = self.s
        start = [t if math.isnan(p) else p for p, t in zip(s.position, target, strict=True)]
        was, level = s.position, target[2] == target[2] and s.position[2] != target[2]
        if kind == RAPID and s.offset is None and s.tool > 0 and level:
            target = self._without_length(was, target)
        elif s.offset is not None and level and self.control is not None and self.control.dropped:
            self._remark_length()
        s.position = target
        if kind == RAPID and s.offset not in (None, s.tool) and s.tool > 0 and level and not target[2] > was[2]:
            self.log.remark("rapid_stale", f"Z comes down in a rapid with length offset H{s.offset} and tool T{s.tool}",
                            (s.offset, s.tool))
        known = not any(math.isnan(v) for v in target)
        if s.parked and level and not known:
            self.log.remark("parked", "Z comes down at an X or Y of machine coordinates: program X and Y first",
                            self.log.line)
        elif kind == RAPID and level and not known:
            x, y, z = target
            self.log.stops.append(StopPoint(self.log.line, UNPLACED, s.tool, (x, y, z), room=True))
        s.parked &= math.isnan(target[0]) or math.isnan(target[1])
        if known:
            s.lost = False
            if not self.log.moved:
                self._assume()
            axes = sum(1 << k for k, p in enumerate(was) if math.isnan(p))
            self._write(start, target, kind, feed, axes, turn, minutes)
        elif s.lost and (turn is not None and turn != s.turn or any(not math.isnan(v) for v in target)):
            self._no_tips()
        elif turn is not None:
            self._stand(turn)

    def _without_length(self, was: list[float], target: list[float]) -> list[float]:
        """Where the tip goes in a rapid with the length offset off: the spindle face goes to ``target`` (3,) mm.

        Only a tool of known length that goes up so, from a known height, does no harm.
        """
        s, hangs = self.s, self.hangs.get(self.s.tool)
        if hangs is None or s.relative or s.tilted or s.frame is not None or not target[2] - hangs >= was[2]:
            self._remark_length()
            return target
        self.log.note(f"line {self.log.line}: the length offset is off, so the spindle face goes to Z{target[2]:.6g} "
                      f"and the tip of T{s.tool} to Z{target[2] - hangs:.6g}")
        return [target[0], target[1], target[2] - hangs]

    def _no_length(self) -> str:
        """Why the length offset is off, in words."""
        dropped = self.control.dropped if self.control is not None else ""
        return f"no G43 H{self.s.tool}" + (f" behind {dropped}, which drops it" if dropped else "")

    def _remark_length(self) -> None:
        self.log.remark("rapid_offset", f"Z moves with the length offset off ({self._no_length()})", self.s.tool)

    def _leave(self, named: Sequence[bool]) -> None:
        """As in ``Rotary``; the place of the tool is unknown along the same axes."""
        super()._leave(named)
        if self.actual is not None:
            self.actual = [NAN if n else p for n, p in zip(named, self.actual, strict=True)]
            if self.actual[0] != self.actual[0] and self.actual[1] != self.actual[1]:
                self.actual = None


__all__ = ["ContourMotion"]
