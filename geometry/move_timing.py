"""Time that a machine takes for straight moves: feeds, rapids, and changes of speed at its acceleration and jerk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.kernels import timing as kernels
from geometry.machine_rates import Rates
from geometry.mesh import F64


def change_seconds(slow: float, fast: float, rates: Rates) -> float:
    """Duration of a change between two speeds, mm/s, at the limits of acceleration and jerk, s."""
    return float(kernels.change_seconds(slow, fast, rates.acceleration, rates.jerk))


def change_way(slow: float, fast: float, rates: Rates) -> float:
    """Way of a change between two speeds, mm/s, at the limits of acceleration and jerk, mm."""
    return float(kernels.change_way(slow, fast, rates.acceleration, rates.jerk))


def peak_speed(length: float, base: float, most: float, rates: Rates) -> float:
    """Speed that the machine reaches from another one along a length, ``most`` at most, mm/s.

    length     : mm
    base, most : mm/s
    """
    return min(float(kernels.reached(base, length, rates.acceleration, rates.jerk)), most)


def leg_seconds(length: float, speed: float, rates: Rates) -> float:
    """Time of a straight move from standstill to standstill, s; 0 without length.

    length : mm
    speed  : mm/s, at most
    """
    return float(kernels.leg_seconds(0.0, 0.0, speed, length, rates.acceleration, rates.jerk))


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
        A feed, an acceleration or a jerk that is not positive (code 'bad_rate').

    Notes
    -----
    The control rounds corners on arcs and changes speed on S-curves (``geometry.kernels.timing``). The look-ahead is
    unlimited. Theory, and figures against a controller: docs/theory/times.md.
    """
    ways, feeds = np.ascontiguousarray(way, dtype=np.float64), np.ascontiguousarray(feed, dtype=np.float64)
    worst = min(float(feeds.min(initial=np.inf)), rates.acceleration, rates.jerk)
    if not worst > 0.0 or not np.isfinite(feeds).all():
        raise GeometryError(f"feeds, acceleration and jerk must be above 0, but one is {worst:g}", code="bad_rate",
                            subjects=("feed",), measured=worst, limit=0.0, remedy="give each move a feed")
    stops, curves = (np.zeros(len(ways), np.bool_) if flag is None else np.ascontiguousarray(flag, dtype=np.bool_)
                     for flag in (stop, curve))
    out = np.zeros(len(ways))
    if len(ways):
        kernels.seconds_of_moves(ways, feeds / 60.0, stops, curves, rates.acceleration, rates.jerk, rates.rounding, out)
    return out
