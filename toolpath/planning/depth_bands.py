"""Bands of depth: high thin walls are finished on both sides before the stock beside them goes deeper.

Every tool roughs and finishes what lies above a plane before any goes below it. So stock stands on both sides of a wall
close under the cut. Without high thin walls there is no plane, and each tool goes down at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from toolpath.counterexamples import HighWall
from zones.machinable_area import AreaForm
from zones.zoning.zones import ZoneArea

MIN_DEPTH = 2.0
"""Least height of a band in thicknesses, however large the corner radius of a tool below it."""


def largest_corner(zones: Iterable[ZoneArea]) -> float:
    """Largest height of the rounded end, mm, of the tools that finish walls; half the diameter of a ball.

    The tip of a tool lies that far below its contact with an upright wall.
    """
    return max((z.tool.end_height for z in zones if z.form is AreaForm.STEEP), default=0.0)


def planes(walls: Iterable[HighWall], corner: float, ratio: float) -> tuple[float, ...]:
    """Heights of contact that all tools finish down to before any goes below, mm, descending; none without walls.

    corner : mm, as ``largest_corner``: stock is removed that far below each plane
    ratio  : largest free height of a wall, in thicknesses [Xometry2016]

    Notes
    -----
    Evenly spaced from the highest top to the lowest foot, at most ratio t - corner apart, t the least thickness. When a
    band is finished, stock stands on both sides no farther than ratio t below its highest place.
    """
    high = list(walls)
    if not high:
        return ()
    thin = min(w.thickness for w in high)
    depth = max(ratio * thin - corner, MIN_DEPTH * thin)
    top, bottom = max(w.top for w in high), min(w.bottom for w in high)
    count = math.ceil((top - bottom) / depth - 1e-9)
    return tuple(top - k * (top - bottom) / count for k in range(1, count))


__all__ = ["HighWall", "largest_corner", "planes"]
