"""Angles of the rotary axes and times of turning moves, kept apart from the rows of the log.

Most moves turn no axis and have no entry here. An entry holds from its move on: between two entries the axes stand
where the first one ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.mesh import F64
from verify.kinematics import Kinematics
from verify.program.program import Poses


class TurnLog:
    """Rotary moves of one reading; moves by their number in the program, angles in deg as programmed."""

    def __init__(self) -> None:
        self._entries: list[tuple[int, float, float, float, float]] = [(0, 0.0, 0.0, 0.0, 0.0)]
        self._minutes: list[tuple[int, float]] = []

    def stand(self, move: int, turn: Sequence[float]) -> None:
        """Record that the axes stand at ``turn`` (2,) deg from a move on."""
        self._entries.append((move, turn[0], turn[1], turn[0], turn[1]))

    def swing(self, move: int, start: Sequence[float], end: Sequence[float], minutes: float) -> None:
        """Record that a move turns the axes from ``start`` to ``end`` (2,) deg in ``minutes``, nan for a rapid."""
        self._entries.append((move, start[0], start[1], end[0], end[1]))
        self._minutes.append((move, minutes))

    def poses(self, moves: int, machine: Kinematics | None) -> Poses | None:
        """Poses of all moves of a program; None where no axis ever leaves 0.

        moves   : number of moves
        machine : rotary axes of the machine, or None
        """
        entries = np.array(self._entries)
        if machine is None:
            return None
        number = np.arange(moves)
        latest = np.searchsorted(entries[:, 0], number, side="right") - 1
        turning = entries[latest, 0] == number
        end = np.radians(entries[latest, 3:5])
        start = np.where(turning[:, None], np.radians(entries[latest, 1:3]), end)
        if not start.any() and not end.any():
            return None
        return Poses(machine.axis(start), machine.axis(end), start, end)

    def minutes(self, length: F64, feed: F64) -> F64:
        """(m,) float64, min: time of every move; nan for rapids.

        length : (m,) float64, mm, path of the tip
        feed   : (m,) float64, mm/min, nan for rapids; the recorded time replaces it where an axis turns
        """
        out = np.where(np.isnan(feed), np.nan, 0.0)
        with np.errstate(over="ignore"):  # a feed near 0 takes infinitely long
            np.divide(length, feed, out=out, where=(length > 0) & (feed != 0))
        if self._minutes:
            noted = np.array(self._minutes)
            out[noted[:, 0].astype(np.int64)] = noted[:, 1]
        return out
