"""The twin's own reading of the programs of the fault table: nothing of ``verify``, and no more words than they use.

Places stay what the program says (tip or joints) with both rotary angles beside them; ``Way.poses`` turns them into
tips and axes as densely as asked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.fault_case import to_tip, tool_axis
from geometry.mesh import F64

_WORD = re.compile(r"([A-Z])([+-]?[0-9.]+)")
_PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
LEVER = 12.0  # mm over the tip at which the way of a turning tool is counted


@dataclass(frozen=True, eq=False)
class Poses:
    """Tools as they stand: tips (n, 3) mm, axes (n, 3) unit, move (n,) row of the Way."""

    tip: F64
    axis: F64
    move: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Way:
    """All moves: start, end (m, 5) x, y, z in mm and A, C in deg as programmed.

    arc    : (m, 8) both plane axes, centre and radii at both ends in mm, first angle and sweep in rad, or nan
    centre : (m,) bool, x, y, z are the tip; feed (m,) bool; tool, line : (m,) int
    refused : lines that make no sense, such as an arc whose ends lie on two circles
    """

    start: F64
    end: F64
    arc: F64
    centre: NDArray[np.bool_]
    feed: NDArray[np.bool_]
    tool: NDArray[np.int64]
    line: NDArray[np.int64]
    refused: tuple[int, ...]

    def rows(self, lines: Collection[int] | None = None, *, feed: bool | None = None,
             tool: int | None = None) -> NDArray[np.int64]:
        """Rows of the moves on some lines, of one kind, of one tool."""
        keep = np.ones(len(self.line), bool) if lines is None else np.isin(self.line, list(lines))
        keep &= True if feed is None else self.feed == feed
        keep &= True if tool is None else self.tool == tool
        return np.flatnonzero(keep)

    def poses(self, rows: NDArray[np.int64], step: float) -> Poses:
        """Poses along moves (k,) indices, no further apart than ``step`` mm, both ends included."""
        return self.at(*self.spread(rows, step))

    def spread(self, rows: NDArray[np.int64], step: float) -> tuple[NDArray[np.int64], F64]:
        """Rows (n,) and shares (n,) 0..1 of places along moves (k,) indices, ``step`` mm apart or less."""
        span, arc = self.end[rows] - self.start[rows], self.arc[rows]
        way = np.linalg.norm(span[:, :3], axis=1) + np.nan_to_num(np.abs(arc[:, 4] * arc[:, 7]))
        way += np.radians(np.abs(span[:, 3:])).sum(axis=1) * LEVER
        n = np.maximum(np.ceil(way / step).astype(int), 1) + 1
        row = np.repeat(np.arange(len(rows)), n)
        return rows[row], (np.arange(len(row)) - np.repeat(np.cumsum(n) - n, n)) / np.repeat(n - 1, n)

    def at(self, rows: NDArray[np.int64], share: F64) -> Poses:
        """Poses at shares (n,) of moves (n,) indices."""
        at = self.start[rows] + share[:, None] * (self.end[rows] - self.start[rows])
        bent = np.flatnonzero(~np.isnan(self.arc[rows, 0]))
        i, j, x, y, r0, r1, a, sweep = self.arc[rows[bent]].T
        r, angle = r0 + share[bent] * (r1 - r0), a + share[bent] * sweep
        at[bent, i.astype(int)], at[bent, j.astype(int)] = x + r * np.cos(angle), y + r * np.sin(angle)
        turn = np.radians(at[:, 3:])
        tip = np.where(self.centre[rows, None] | ~turn.any(axis=1)[:, None], at[:, :3], to_tip(at[:, :3], turn))
        return Poses(tip, tool_axis(turn), rows)


def read_way(text: str) -> Way:
    """The moves of a program."""
    now = _Now()
    for number, line in enumerate(text.split("\n"), 1):
        now.line(number, line)
    table = np.array(now.rows, float).reshape(-1, 22)
    return Way(table[:, :5], table[:, 5:10], table[:, 14:], table[:, 10] > 0, table[:, 11] > 0,
               table[:, 12].astype(int), table[:, 13].astype(int), tuple(now.refused))


class _Now:
    """What holds while a program is read."""

    def __init__(self) -> None:
        self.at: list[float] = [math.nan, math.nan, math.nan, 0.0, 0.0]
        self.scale, self.plane, self.motion, self.tool, self.centre = 1.0, 17, 0, 0, False
        self.rows: list[list[float]] = []
        self.refused: list[int] = []

    def line(self, number: int, text: str) -> None:
        """Take one line."""
        words = [(letter, float(value)) for letter, value in _WORD.findall(text.split("(")[0])]
        values = dict(words)
        for letter, value in words:
            self._mode(letter, value)
        if "T" in values:
            self.tool, self.at[2] = int(values["T"]), math.nan
        target = list(self.at)
        for k, letter in enumerate("XYZ"):
            if letter in values:
                target[k] = values[letter] * self.scale
        for k, letter in enumerate("AC"):
            target[3 + k] = values.get(letter, target[3 + k])
        if not values.keys() & set("XYZAC"):
            return
        if self.motion in (2, 3):
            self._arc(number, target, values)
        else:
            self._straight(number, target)

    def _mode(self, letter: str, value: float) -> None:
        if letter == "G":
            if value in (0, 1, 2, 3):
                self.motion = int(value)
            elif value in (17, 18, 19):
                self.plane = int(value)
            elif value in (20, 21):
                self.scale = 25.4 if value == 20 else 1.0
            elif value in (43, 43.4, 49):
                self.centre = value == 43.4

    def _straight(self, number: int, target: list[float], arc: tuple[float, ...] = (math.nan,) * 8) -> None:
        known = [t if math.isnan(a) else a for a, t in zip(self.at, target, strict=True)]
        if math.isnan(self.at[2]) and not math.isnan(target[2]):
            known[2] = max(target[2], 60.0)  # a tool comes from above
        if not any(map(math.isnan, target)):
            self.rows.append([*known, *target, self.centre, self.motion != 0, self.tool, number, *arc])
        self.at = target

    def _arc(self, number: int, target: list[float], values: dict[str, float]) -> None:
        i, j, _ = _PLANES[self.plane]
        names = ("IJK"[i], "IJK"[j])
        stray = set("IJK") & values.keys() - set(names)
        centre = [self.at[k] + values.get(n, 0.0) * self.scale for k, n in zip((i, j), names, strict=True)]
        u, v = ([p[i] - centre[0], p[j] - centre[1]] for p in (self.at, target))
        r0, r1 = math.hypot(*u), math.hypot(*v)
        if any(values[n] for n in stray) or abs(r0 - r1) > max(0.01, 1e-3 * r0) or r0 < 1e-9:
            self.refused.append(number)
            self.at = target
            return
        a = math.atan2(u[1], u[0])
        sweep = (math.atan2(v[1], v[0]) - a) % math.tau
        if self.motion == 2:
            sweep -= math.tau if sweep > 1e-9 else 0.0
        if abs(sweep) < 1e-9:
            sweep = math.tau if self.motion == 3 else -math.tau
        self._straight(number, target, (i, j, *centre, r0, r1, a, sweep))
