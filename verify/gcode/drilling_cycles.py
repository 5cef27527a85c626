"""Drilling cycles as rapids and feeds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from verify.program.move_kinds import FEED, RAPID

PECK_LIFT = 0.254
MOVES_A_PECK = 3
MOVES_A_HOLE = 5


class HoleExit(Enum):
    """How a cycle leaves the bottom: at once, feeding to the R plane (G85), or feeding all the way (G89)."""

    RAPID = 0
    FEED_TO_CLEAR = 1
    FEED = 2


@dataclass(frozen=True)
class Hole:
    """One hole along the axis perpendicular to the plane.

    clear  : mm, the R plane
    bottom : mm, height of the tip at the bottom
    back   : mm, height after the retract
    peck   : mm, depth of a peck, > 0; the whole depth for G81 and G82
    lift   : True: each peck retracts to ``clear`` (G83); False: it lifts 0.254 mm to break the chip
    out    : how the tool leaves the bottom
    """

    clear: float
    bottom: float
    back: float
    peck: float
    lift: bool
    out: HoleExit = HoleExit.RAPID

    @property
    def pecks(self) -> float:
        """Number of pecks, whole; inf where the quotient overflows."""
        depth = self.clear - self.bottom - 1e-9
        share = depth / self.peck if self.peck > 0 else math.inf
        return float(max(0, math.ceil(share))) if math.isfinite(share) else (math.inf if depth > 0 else 0.0)

    @property
    def moves(self) -> float:
        """Upper bound of the number of moves."""
        return MOVES_A_HOLE + MOVES_A_PECK * self.pecks


def hole_moves(hole: Hole, over: list[float], axis: int) -> Iterator[tuple[list[float], int]]:
    """Targets (x, y, z) in mm and kinds of the moves over the hole, down, and back.

    over : (3,) mm, place above the hole where the tip arrives; Fanuc and Haas may arrive below ``hole.clear``
    axis : 0, 1 or 2, the drilling axis

    Notes
    -----
    The order of moves is that of the canned cycles G81, G82, G83, G85, G86 and G89 of RS274/NGC [Kramer2000]; G73 is as
    in LinuxCNC.
    """
    def at(height: float) -> list[float]:
        return [height if k == axis else p for k, p in enumerate(over)]
    yield at(over[axis]), RAPID
    yield at(hole.clear), RAPID
    pecks = int(hole.pecks)
    for k in range(1, pecks + 1):
        depth = max(hole.clear - k * hole.peck, hole.bottom) if k < pecks else hole.bottom
        yield at(depth), FEED
        if k == pecks:
            break
        yield at(hole.clear if hole.lift else depth + PECK_LIFT), RAPID
        if hole.lift:
            yield at(min(depth + PECK_LIFT, hole.clear)), RAPID
    if hole.out is HoleExit.FEED_TO_CLEAR:
        yield at(hole.clear), FEED
    yield at(hole.back), FEED if hole.out is HoleExit.FEED else RAPID
