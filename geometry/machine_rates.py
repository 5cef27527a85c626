"""Rates of a machine. They stand apart from the kernels of move times, whose import takes half a second."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rates:
    """Rapid rate, acceleration and jerk of a machine.

    rapid        : mm/min
    acceleration : mm/s², in every direction
    rounding     : mm, largest distance by which the control may pass a corner; at 0 it stops at each corner
    jerk         : mm/s³, in every direction; math.inf where the acceleration changes at once
    """

    rapid: float
    acceleration: float
    rounding: float
    jerk: float = 20000.0


RATES = Rates(10000.0, 4905.0, 0.001)
"""Rates of a machine whose setup gives none: half of the acceleration of gravity, and the jerk of a machining centre
(shop practice)."""

__all__ = ["RATES", "Rates"]
