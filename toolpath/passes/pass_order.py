"""The order in which a tool cuts lines."""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64
from toolpath.lines import Line


def nearest_order(lines: list[Line], at: F64 | None, either: bool) -> list[Line]:
    """Lines in order of machining: each time the one with the nearest start.

    at     : (2,) or (3,) float64, mm, access frame, where the tool is; None lets the first line begin
    either : open lines may be cut in both directions; closed ones begin at their nearest point in any case
    """
    left = list(lines)
    out: list[Line] = []
    here = at
    while left:
        if here is None:
            best, flip, start = 0, False, 0
        else:
            best, flip, start, least = 0, False, 0, math.inf
            for k, line in enumerate(left):
                if line.closed:
                    d2 = ((line.points[:, :2] - here[:2]) ** 2).sum(axis=1)
                    j = int(np.argmin(d2))
                    if d2[j] < least:
                        best, flip, start, least = k, False, j, float(d2[j])
                    continue
                for back in (False, True) if either else (False,):
                    d = float(((line.points[-1 if back else 0, :2] - here[:2]) ** 2).sum())
                    if d < least:
                        best, flip, start, least = k, back, 0, d
        line = left.pop(best)
        if flip:
            line = line.reversed()
        if line.closed and start:
            loop = line.points[:-1]
            line = Line(np.vstack([loop[start:], loop[:start + 1]]), True)
        out.append(line)
        here = line.points[-1]
    return out
