"""Number of pieces of a turning block, so that each goes straight and its axis along a great circle.

A path c on t = 0..1 whose second derivative is at most D lies within D h² / 8 of the straight, even segment between two
of its places that are h apart in t. So n = ceil(sqrt(D / (8 e))) pieces keep it within e; only bounds on D are needed.

Tool axis. It is a point on the unit sphere at the tilt u from the pole and at the angle v round it, both even in t:
u' = a, v' = b. Its acceleration on the sphere is (-b² sin u cos u, 2 a b cos u), no longer than
|b| cos u sqrt(b² sin² u + 4 a²). Great circles take the place of straight lines; over an arc l the deviation is
(1 / cos(l / 2) - 1) / (l² / 8) times as large, at most 1.003 where no piece turns an axis by more than ``MAX_TURN``.

Tip without tool centre point control. The joints move evenly. Each frame that turns at the rate w adds at most
2 w s + w² r to the second derivative of a point at distance r with speed s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from verify.kinematics import Kinematics

TURN = 2e-5
"""rad, largest deviation of a tool axis from the great circle of its piece."""
TIP = 0.5e-3
"""mm, largest deviation of a tip from the chord of its piece; the chords of an arc have as much again."""
MAX_TURN = 0.1
"""rad, largest turn of an axis in a piece: joints then stay within 1/800 of their radius between its ends."""
_CURVED = 1.01  # the 1.003 above, and terms of higher order on the sphere


def axis_pieces(start: Sequence[float], end: Sequence[float]) -> int:
    """Pieces that keep the tool axis within ``TURN`` of great circles [Shoemake1985].

    start, end : (2,) rad, tilt and turn where the block begins and ends

    Returns at least 1.
    """
    a, b = abs(end[0] - start[0]), abs(end[1] - start[1])
    if max(a, b) <= MAX_TURN and _CURVED * b * math.hypot(b, 2 * a) <= 8 * TURN:
        return 1  # for any tilt
    cosine, sine = _most_cosine(start[0], end[0]), _most_cosine(start[0] - math.pi / 2, end[0] - math.pi / 2)
    bend = b * cosine * math.hypot(b * sine, 2 * a)
    return max(1, math.ceil(max(a, b) / MAX_TURN), math.ceil(math.sqrt(_CURVED * bend / (8 * TURN))))


def tip_pieces(machine: Kinematics, start: Sequence[float], end: Sequence[float], turns: tuple[float, float],
               gauge: float) -> int:
    """Pieces that keep the tip within ``TIP`` of chords, where all joints move evenly.

    start, end : (3,) mm, the joints
    turns      : rad, turns of the tilting and the turning axis
    gauge      : mm, spindle face to tip

    Returns at least 1. Raises VerificationError (no_pivots) where no pivots are given.
    """
    pivots, speed = machine.points(), math.dist(start, end)
    a, b = abs(turns[0]), abs(turns[1])
    if machine.tilts_head:
        swivel = pivots[0][2] + gauge
        rate = a + (b if machine.turns_head else 0.0)
        speed, bend = speed + swivel * rate, swivel * rate * rate
        reach = max(math.dist(start, pivots[-1]), math.dist(end, pivots[-1])) + 2 * swivel
    else:
        radius = max(math.dist(start, pivots[0]), math.dist(end, pivots[0]))
        speed, bend = speed + a * radius, 2 * a * speed + a * a * radius
        reach = radius + math.dist(pivots[0], pivots[1])
    if not machine.turns_head:
        bend += 2 * b * speed + b * b * reach
    return max(1, math.ceil(math.sqrt(bend / (8 * TIP))))


def _most_cosine(start: float, end: float) -> float:
    """The largest |cos| between two angles, rad."""
    low, high = min(start, end), max(start, end)
    if math.floor(high / math.pi) >= math.ceil(low / math.pi):
        return 1.0
    return max(abs(math.cos(low)), abs(math.cos(high)))
