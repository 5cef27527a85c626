"""Time and way of a change of speed, at limits of acceleration and jerk.

Notation
    v0, v1 : slower and faster speed of a change, mm/s; dv their difference
    a, j   : acceleration, mm/s², and jerk, mm/s³
    t      : s, duration of a change
"""

from __future__ import annotations

import math

JERK = 20000.0  # mm/s³, of a machining centre; shop practice


def change_seconds(slow: float, fast: float, acceleration: float) -> float:
    """Duration of a change between two speeds, at the limits of acceleration and jerk.

    slow, fast   : mm/s
    acceleration : mm/s²

    Returns s.

    Notes
    -----
    t = 2 sqrt(dv / j) while the acceleration stays below a, that is for dv <= a² / j, else dv / a + a / j.
    """
    dv = abs(fast - slow)
    if dv <= acceleration ** 2 / JERK:
        return 2.0 * math.sqrt(dv / JERK)
    return dv / acceleration + acceleration / JERK


def change_way(slow: float, fast: float, acceleration: float) -> float:
    """Way of a change between two speeds: (v0 + v1) / 2 t.

    slow, fast   : mm/s
    acceleration : mm/s²

    Returns mm.
    """
    return 0.5 * (slow + fast) * change_seconds(slow, fast, acceleration)


def peak_speed(length: float, base: float, most: float, acceleration: float) -> float:
    """Speed that the machine reaches from another one along a length, ``most`` at most.

    length       : mm
    base, most   : mm/s
    acceleration : mm/s²

    Returns mm/s.
    """
    if change_way(base, most, acceleration) <= length:
        return most
    low, high = base, most
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if change_way(base, middle, acceleration) <= length else (low, middle)
    return low


def leg_seconds(length: float, speed: float, acceleration: float) -> float:
    """Time of a straight move from standstill to standstill.

    length       : mm
    speed        : mm/s, at most
    acceleration : mm/s²

    Returns s.
    """
    if length <= 0.0:
        return 0.0
    peak = peak_speed(0.5 * length, 0.0, speed, acceleration)
    return 2.0 * change_seconds(0.0, peak, acceleration) + (length - 2.0 * change_way(0.0, peak, acceleration)) / peak


__all__ = ["JERK", "change_seconds", "change_way", "leg_seconds", "peak_speed"]
