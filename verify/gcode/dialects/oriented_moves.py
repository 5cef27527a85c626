"""Directions of the latest moves, and straight moves that turn the tool axis to a vector or along a great circle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from verify.assumptions import Assumed, AssumedKind
from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.orientation import angles_of, great_circle, needed, ways_differ
from verify.gcode.dialects.stated_places import StatedPlaces, digits
from verify.kinematics import Kinematics

STRAIGHT = 1e-9
"""mm, the shortest move that has a direction."""


class OrientedMoves(StatedPlaces):
    """A control that keeps the tip while it turns the tool.

    tcp    : whether tool centre point control is on; relative : whether coordinates are incremental
    circle : whether the tool axis turns along great circles, None where the program does not say
    heading : end of the latest move, (3,) mm, and its direction there, where that is no straight move
    vector_words, tcp_word : names for messages
    """

    vector_words, tcp_word = "a tool vector", ""
    tcp = relative = False

    def __init__(self) -> None:
        super().__init__()
        self.circle: bool | None = None
        self.heading: tuple[list[float], list[float]] | None = None
        self._places: list[list[float]] = []

    def tip_turned(self, machine: Kinematics, was: Sequence[float], turn: Sequence[float]) -> None:
        """As ``DialectReader.tip_turned``."""
        self._leave_way(machine, was, turn, "even turns of the rotary axes")

    def _leave_way(self, machine: Kinematics, was: Sequence[float], turn: Sequence[float], read: str) -> None:
        """A block turns the axes, (2,) deg; ``read`` is how, taken for granted where the program leaves it open."""
        if self.tcp and (words := self.open_way()) and ways_differ(machine, was, turn):
            self.leave_open(Assumed(
                AssumedKind.AXIS_WAY, f"{read}, first in line {self.machine.log.line}", "where machine data say "
                "otherwise, the tool swings another way between the ends of the block, through part or fixture", words))

    def open_way(self) -> str:
        """Words that would state how the tool axis turns between two ends, where the program leaves it open; or ''."""
        return ""

    def note_place(self) -> None:
        """Keep the latest two places, for the direction of a straight move."""
        place = self.machine.s.position
        if not self._places or place is not self._places[-1]:
            self._places = [*self._places[-1:], place]

    def direction(self, word: str) -> tuple[list[float], list[float]]:
        """Start of the block, (3,) mm, and the direction in which the move before it arrived there.

        Raises
        ------
        BlockError
            No move came before.
        """
        start = self.known(word)
        if self.heading is not None and math.dist(self.heading[0], start) < 1e-6:
            return start, self.heading[1]
        self.note_place()
        if len(self._places) == 2 and not any(math.isnan(v) for v in self._places[0]):
            last = self._places[0] if self.frame is None else self.frame.back(self._places[0])
            way = [a - b for a, b in zip(start, last, strict=True)]
            if math.hypot(*way) > STRAIGHT:
                return start, way
        raise BlockError(f"{word} continues a move, and no move came before it")

    def oriented(self, motion: str, words: Mapping[str, str], feed: str, vector: Sequence[float] | None,
                 angles: Mapping[str, float]) -> list[str]:
        """Blocks of a straight move whose tool axis turns to a vector, or along a great circle to angles.

        motion : G0 or G1; words : X, Y, Z of the end, absolute; feed : the F word, or ''
        vector : (3,) dimensionless, tool axis in the coordinates of the control, or None
        angles : deg, of the rotary words

        Raises
        ------
        BlockError
            Nothing keeps the tip, or the coordinates are incremental.
        """
        machine = needed(self.machine.machine, self.vector_words if vector is not None else "a great circle")
        if not self.tcp:
            raise BlockError(f"{self.vector_words} without tool centre point control ({self.tcp_word})")
        if self.relative:
            raise BlockError(f"{self.vector_words} in incremental coordinates (G91)")
        now = list(self.machine.s.turn)
        if vector is not None:
            if not math.hypot(*vector) > 1e-6:
                raise BlockError(f"{self.vector_words} of length 0")
            axis = np.array(vector) if self.frame is None else self.frame.matrix @ np.array(vector)
            end = angles_of(machine, axis.tolist(), now, limits=machine.limits)
        else:
            end = [angles.get(k, t) for k, t in zip(machine.letters, now, strict=True)]
            axis = machine.axis(np.radians([end]))[0]
        start = self.here()
        places = {k: start["XYZ".index(k)] for k in words}
        pieces = [(1.0, end)]
        if self.circle is not False:
            self._leave_way(machine, now, end, "great circles of the tool axis")
        if self.circle is not False and end != now and not any(math.isnan(v) for v in places.values()):
            pieces = great_circle(machine, now, end, axis.tolist(), stated=vector is None)
        self.machine.log.room(len(pieces))
        out = []
        for n, (share, turn) in enumerate(pieces):
            last = n == len(pieces) - 1
            way = words if last else {k: digits((p + share * (float(words[k]) * self.unit - p)) / self.unit)
                                      for k, p in places.items()} if share else {}
            turns = [f"{k}{digits(t)}" for k, t in zip(machine.letters, turn, strict=True)]
            out.append(" ".join([motion, *(f"{k}{w}" for k, w in way.items()), *turns,
                                 *([feed] if feed and not n else [])]))
        return out


__all__ = ["STRAIGHT", "OrientedMoves"]
