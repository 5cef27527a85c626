"""The order in which a tool cuts lines."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from toolpath.lines import Line


def nearest_order(lines: list[Line], at: F64 | None, either: bool) -> list[Line]:
    """Lines in order of machining: each time the one with the nearest start.

    at     : (2,) or (3,) float64, mm, access frame, where the tool is; None lets the first line begin
    either : open lines may be cut in both directions; closed ones begin at their nearest point in any case
    """
    ends = _Ends(lines, either)
    out: list[Line] = []
    here = at
    while len(out) < len(lines):
        k, j = (0, 0) if here is None else ends.nearest(here[:2])
        ends.use(k)
        line = lines[k]
        if line.closed:
            if j:
                loop = line.points[:-1]
                line = Line(np.vstack([loop[j:], loop[:j + 1]]), True)
        elif j:
            line = line.reversed()
        out.append(line)
        here = line.points[-1]
    return out


class _Ends:
    """Places at which lines may begin: the ends of open ones, all points of closed ones.

    Those of lines that are used are dropped once they are half of all.
    """

    def __init__(self, lines: list[Line], either: bool) -> None:
        places = [line.points[:, :2] if line.closed else line.points[[0, -1] if either else [0], :2] for line in lines]
        count = [len(p) for p in places]
        self.xy = np.concatenate([np.zeros((0, 2)), *places])
        self.line = np.repeat(np.arange(len(lines)), count)
        self.number = np.concatenate([np.zeros(0, np.int64), *(np.arange(n) for n in count)])
        self.free = np.ones(len(lines), np.bool_)
        self.dropped = 0

    def nearest(self, here: F64) -> tuple[int, int]:
        """The line with the place nearest to one in plan, mm, and the number of that place; the first of equals."""
        d2 = np.where(self.free[self.line], ((self.xy - here) ** 2).sum(axis=1), np.inf)
        row = int(np.argmin(d2))
        return int(self.line[row]), int(self.number[row])

    def use(self, k: int) -> None:
        """Line k begins no more."""
        self.free[k] = False
        self.dropped += int(np.searchsorted(self.line, k + 1) - np.searchsorted(self.line, k))
        if 2 * self.dropped > len(self.line):
            keep = self.free[self.line]
            self.xy, self.line, self.number, self.dropped = self.xy[keep], self.line[keep], self.number[keep], 0
