"""Time that a machine takes for straight moves: feeds, rapids, and the acceleration between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.kernels.timing import seconds_of_moves
from geometry.mesh import F64


@dataclass(frozen=True)
class Rates:
    """Rapid rate and acceleration of a machine.

    rapid        : mm/min
    acceleration : mm/s², in every direction
    rounding     : mm, largest distance by which the control may pass a corner; at 0 it stops at each corner
    """

    rapid: float
    acceleration: float
    rounding: float


RATES = Rates(10000.0, 1000.0, 0.001)
"""Rates of a machine whose setup gives none."""


def move_seconds(way: F64, feed: F64, rates: Rates, stop: NDArray[np.bool_] | None = None,
                 curve: NDArray[np.bool_] | None = None) -> F64:
    """Seconds of moves run one behind the other, from standstill to standstill.

    way   : (m, 3) float64, mm, vector of each straight move in any frame
    feed  : (m,) float64, mm/min, > 0, at the rapid rate for rapids
    rates : Rates
    stop  : (m,) bool, moves before which the control stands still, as for a tool change; none when None
    curve : (m,) bool, moves that are chords of the same curve as the one before: there is no corner between; none when
            None

    Returns
    -------
    (m,) float64, s. A move without length takes no time and stops the control. The caller adds the time of a dwell or
    of a rotary axis that turns alone.

    Raises
    ------
    GeometryError
        A feed or an acceleration that is not positive (code 'bad_rate').

    Notes
    -----
    The control rounds corners on arcs (``geometry.kernels.timing``). Speed changes at the full acceleration at once (no
    jerk), and the look-ahead is unlimited. Theory, and figures against a controller: docs/theory/times.md.
    """
    ways, feeds = np.ascontiguousarray(way, dtype=np.float64), np.ascontiguousarray(feed, dtype=np.float64)
    worst = min(float(feeds.min(initial=np.inf)), rates.acceleration)
    if not worst > 0.0 or not np.isfinite(feeds).all():
        raise GeometryError(f"feeds and the acceleration must be above 0, but one is {worst:g}", code="bad_rate",
                            subjects=("feed",), measured=worst, limit=0.0, remedy="give each move a feed")
    stops, curves = (np.zeros(len(ways), np.bool_) if flag is None else np.ascontiguousarray(flag, dtype=np.bool_)
                     for flag in (stop, curve))
    out = np.zeros(len(ways))
    if len(ways):
        seconds_of_moves(ways, feeds / 60.0, stops, curves, rates.acceleration, rates.rounding, out)
    return out
