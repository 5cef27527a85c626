"""Bands of depth, so that high thin walls are finished on both sides before the stock beside them goes deeper.

Every tool takes off and finishes what lies above a plane before any goes below it, so that stock stands on both sides
of a wall close under what is cut of it. Without high thin walls there is no plane, and each tool goes down at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from toolpath.counterexamples import HighWall
from zones.machinable_area import AreaForm
from zones.zoning.zones import ZoneArea

LEAST_DEPTH = 2.0
"""Times the thickness: no band is lower, however large the corner of a tool is that goes below it."""


def largest_corner(zones: Iterable[ZoneArea]) -> float:
    """mm, corner radius of the tools that finish walls, half the diameter of a ball, at most.

    As far below its contact with an upright wall the tip of a tool is.
    """
    return max((z.tool.corner_radius for z in zones if z.form is AreaForm.STEEP), default=0.0)


def planes(walls: Iterable[HighWall], corner: float, ratio: float) -> tuple[float, ...]:
    """Heights of contact that all tools finish down to before any goes below, mm, descending; none without walls.

    corner : mm, as ``largest_corner``: stock is taken off so far below each plane
    ratio  : times its thickness that a wall is to be free for at most

    Notes
    -----
    Evenly spaced from the highest top to the lowest foot, no more than ratio t - corner apart, t the least thickness:
    when a band is finished the highest place of it has stock on both sides no farther below it than ratio t.
    """
    high = list(walls)
    if not high:
        return ()
    thin = min(w.thickness for w in high)
    depth = max(ratio * thin - corner, LEAST_DEPTH * thin)
    top, bottom = max(w.top for w in high), min(w.bottom for w in high)
    count = math.ceil((top - bottom) / depth - 1e-9)
    return tuple(top - k * (top - bottom) / count for k in range(1, count))


__all__ = ["HighWall", "largest_corner", "planes"]
