"""Rotary words: angles of the axes, tool centre point control, and moves that turn the tool or the part.

With tool centre point control (G43.4, M428), X, Y, Z are the tip in the setup frame, and the tip goes straight while
the axes turn. Without it, X, Y, Z are the linear joints, and the tip of a turning block follows a curve that depends on
the pivots. In both cases every word of a block changes evenly from its start to its end. Turning blocks are split into
pieces (``verify.program.turn_subdivision``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from verify.kinematics import Kinematics
from verify.program.move_kinds import FEED, RAPID
from verify.program.move_log import Log
from verify.program.program import NAN, RotaryStart, State
from verify.program.turn_subdivision import axis_pieces, tip_pieces

TURNED = 8
"""Added to the unknown axes of a move whose rotary axes turn or stand off 0."""
_STILL = 1e-9  # mm: a block that moves X, Y, Z by less only turns


class Rotary:
    """State, log and rotary axes of one reading.

    machine : rotary axes of the machine, or None
    gauge   : mm by T number, spindle face to tip
    stated_axes : by letter of the rotary axes whose angle the program has stated, the number of moves before
    tip_told : whether a word says if the tip is controlled; by_axes : first line that moves turned axes before one does
    """

    def __init__(self, log: Log, machine: Kinematics | None, gauge: Mapping[int, float]) -> None:
        self.log, self.machine, self.gauge = log, machine, gauge
        self.rotary = machine.letters if machine else ""
        self.s = State()
        self.stated_axes: dict[str, int] = {}
        self.tip_told = False
        self.by_axes = 0

    def _turn(self, values: Mapping[str, float], *, absolute: bool = False) -> list[float] | None:
        """(2,) deg, angles of the axes after the rotary words of a block; None where it has none."""
        named = [letter in values for letter in self.rotary]
        if not any(named):
            return None
        relative = self.s.relative and not absolute
        if relative:
            self.log.ways_told.add(self.log.line)
        else:
            self._told(letter for letter in self.rotary if letter in values)
        return [t if not n else values[letter] + (t if relative else 0.0)
                for letter, n, t in zip(self.rotary, named, self.s.turn, strict=True)]

    def _told(self, letters: Iterable[str]) -> None:
        """The program states where these axes stand."""
        for letter in letters:
            self.stated_axes.setdefault(letter, self.log.count)

    def _starts(self) -> tuple[RotaryStart, ...]:
        """From which move on the angle of each rotary axis is stated, and where it ends."""
        return tuple(RotaryStart(letter, self.stated_axes.get(letter, self.log.count), turn)
                     for letter, turn in zip(self.rotary, self.s.turn, strict=False))

    def _stand(self, turn: list[float]) -> None:
        """Put the axes at ``turn`` without simulating the turn."""
        self.s.turn = turn
        self.log.turned.stand(self.log.count, turn)

    def _leave(self, named: Sequence[bool]) -> None:
        """Linear axes went to a fixed place of the machine; with the part or tool turned, X, Y and Z are unknown."""
        s = self.s
        s.sent |= named[2]
        s.lost &= not named[2]
        every = s.tcp and s.tilted and any(named)
        s.position = [NAN if n or every else p for n, p in zip(named, s.position, strict=True)]

    def _control(self, word: bool, switch: bool) -> None:
        """Set tool centre point control by G43.4 and by M428; with turned axes the same place gets other numbers."""
        s = self.s
        tip, was = self._tip(), s.tcp
        s.tcp_word, s.tcp_switch = word, switch
        if s.tcp == was or not s.tilted:
            return
        gauge = self._gauge()
        known = self.machine is not None and gauge is not None and not any(map(math.isnan, tip))
        if s.tcp or not known:
            s.lost |= not (s.tcp or any(map(math.isnan, tip)))
            s.sent &= not s.lost
            s.position = tip if s.tcp else [NAN] * 3
        elif self.machine is not None and gauge is not None:
            s.position = self.machine.joints(np.array([tip]), np.radians([s.turn]), gauge)[0].tolist()

    def _tip(self) -> list[float]:
        """(3,) mm, the tip in the setup frame; nan where it is not known."""
        s = self.s
        if s.tcp or not s.tilted:
            return list(s.position)
        gauge = self._gauge()
        if gauge is None or any(map(math.isnan, s.position)):
            return [NAN] * 3
        return self._tips([s.position], [s.turn], gauge)[0]

    def _tips(self, joints: Sequence[Sequence[float]], turns: Sequence[Sequence[float]],
              gauge: float) -> list[list[float]]:
        """Tips, mm, where the joints stand at ``joints``, mm, and the axes at ``turns``, deg."""
        if self.machine is None:
            return [list(j) for j in joints]
        found: list[list[float]] = self.machine.tip(np.array(joints), np.radians(turns), gauge).tolist()
        return found

    def _gauge(self) -> float | None:
        """mm from the spindle face to the tip, 0 where tips do not depend on it; None where tips cannot be computed."""
        if self.machine is None or self.machine.pivots is None:
            return None
        if not self.machine.tilts_head:
            return 0.0
        self.log.by_joints.add(self.s.tool)
        return self.gauge.get(self.s.tool)

    def _timing(self, feed: float, length: float, turn: list[float] | None) -> tuple[float, float]:
        """Rate, mm/min, and minutes of a feed block; minutes are nan where length and rate give them.

        feed   : mm/min, 1/min in inverse time (G93)
        length : mm of X, Y, Z as programmed
        turn   : (2,) deg, angles after the block, None where it turns no axis

        Inverse time gives the minutes directly. Otherwise the length of X, Y, Z decides, and the axes take as long.
        Where only axes turn, F is deg/min of both together and G20 does not scale it. LinuxCNC does the same.
        """
        s = self.s
        rate = feed * length if s.feed_mode == 93 else feed
        if turn is None or turn == s.turn or math.isnan(length):
            return rate, NAN
        if s.feed_mode == 93:
            return rate, 1.0 / feed
        if length > _STILL:
            return rate, length / feed
        return 0.0, math.dist(turn, s.turn) * s.scale / feed

    def _write(self, start: list[float], target: list[float], kind: int, feed: float, unknown: int,
               turn: list[float] | None, minutes: float) -> None:
        """Write one straight block.

        start, target : (3,) mm, X, Y, Z as programmed; ``unknown`` : axes whose start is not known
        feed, minutes : as ``_timing`` gives them; turn : (2,) deg, angles after the block, or None
        """
        s, log = self.s, self.log
        was, turning = s.turn, turn is not None and turn != s.turn
        if turn is not None:
            s.turn = turn
        if not turning and (s.tcp or not s.tilted):
            log.move(start, target, kind, feed, s.tool, unknown | TURNED if unknown and s.tilted else unknown)
            return
        if not (s.tcp or self.tip_told or self.by_axes):
            self.by_axes = log.line
        if turning and s.tcp:
            self._turned_tip(was, kind)
        gauge = 0.0 if s.tcp else self._gauge()
        if gauge is None:
            self._no_tips()
        elif unknown:
            self._stand(s.turn)
            end = target if s.tcp else self._tips([target], [s.turn], gauge)[0]
            log.move(start if s.tcp else end, end, kind, feed, s.tool, unknown | TURNED)
        elif not turning:
            tips = self._tips([start, target], [was, was], gauge)
            log.move(tips[0], tips[1], kind, feed, s.tool, 0)
        else:
            self._swing(start, target, kind, feed, was, minutes, gauge)

    def _tip_to(self, place: Sequence[str | None], turns: Sequence[str | None]) -> None:
        """A straight block of tip and angles, absolute, in mm and deg as written; tool centre point control is on."""
        s = self.s
        start, s.position = s.position, [p if w is None else float(w) for p, w in zip(s.position, place, strict=True)]
        turn = [t if w is None else float(w) for t, w in zip(s.turn, turns, strict=True)]
        self._told(letter for letter, w in zip(self.rotary, turns, strict=True) if w is not None)
        if s.motion == 0:
            self._write(start, s.position, RAPID, NAN, 0, turn, NAN)
        else:
            rate, minutes = self._timing(s.feed * s.override, math.dist(start, s.position), turn)
            self._write(start, s.position, FEED, rate, 0, turn, minutes)

    def _swing(self, start: list[float], target: list[float], kind: int, feed: float, was: list[float],
               minutes: float, gauge: float) -> None:
        """Write a block that turns an axis from ``was``, deg, to its present angle, in pieces."""
        s, log = self.s, self.log
        a, b = [math.radians(t) for t in was], [math.radians(t) for t in s.turn]
        n = axis_pieces(a, b)
        if not s.tcp and self.machine is not None:
            n = max(n, tip_pieces(self.machine, start, target, (b[0] - a[0], b[1] - a[1]), gauge))
        elif n == 1:
            log.turned.swing(log.count, was, s.turn, minutes)
            return log.move(start, target, kind, feed, s.tool, 0)
        log.room(n)
        points = [between(start, target, k / n) for k in range(n + 1)]
        turns = [between(was, s.turn, k / n) for k in range(n + 1)]
        if not s.tcp:
            points = self._tips(points, turns, gauge)
        for k in range(n):
            log.turned.swing(log.count, turns[k], turns[k + 1], minutes / n)
            log.move(points[k], points[k + 1], kind, feed, s.tool, 0)
        return None

    def _turned_tip(self, was: Sequence[float], kind: int) -> None:
        """A block of a kind has turned the axes from ``was``, (2,) deg, while the control keeps the tip."""

    def _no_tips(self) -> None:
        """Refuse a move of the joints whose tip cannot be computed."""
        s = self.s
        where = " ".join(f"{letter}{t:g}" for letter, t in zip(self.rotary, s.turn, strict=True))
        if self.machine is not None and self.machine.pivots is not None:
            return self.log.error(f"a move without tool centre point control at {where} needs the gauge length of "
                                  f"T{s.tool}", remedy="give the tool its gauge_length_mm")
        return self.log.error(f"a move without tool centre point control at {where} needs the pivots of the rotary "
                              "axes", remedy="give machine.pivots_mm, or run the program with G43.4 or M428")


def between(start: Sequence[float], end: Sequence[float], share: float) -> list[float]:
    """Interpolate between two lists of numbers (mm or deg) at a share from 0 to 1; 1 gives the end itself."""
    return list(end) if share == 1.0 else [a + (b - a) * share for a, b in zip(start, end, strict=True)]
