"""Drilling cycles written out as rapids and feeds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

RAPID, FEED = 0, 1
PECK_LIFT = 0.25
MOVES_A_PECK = 3
MOVES_A_HOLE = 4


@dataclass(frozen=True)
class Hole:
    """One hole along Z.

    clear  : mm, the R plane
    bottom : mm, depth of the tip
    back   : mm, height left to afterwards
    peck   : mm a peck takes, > 0; the whole depth for G81 and G82
    lift   : whether each peck goes back to ``clear`` (G83) or lifts 0.25 mm to break the chip
    """

    clear: float
    bottom: float
    back: float
    peck: float
    lift: bool

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


def hole_moves(hole: Hole, start: list[float], x: float, y: float) -> Iterator[tuple[list[float], int]]:
    """Targets (x, y, z) in mm and kinds of the moves from ``start`` over the hole, down, and back."""
    top = start[2]
    if hole.clear > top:
        top = hole.clear
        yield [start[0], start[1], top], RAPID
    yield [x, y, top], RAPID
    yield [x, y, hole.clear], RAPID
    pecks = int(hole.pecks)
    for k in range(1, pecks + 1):
        depth = max(hole.clear - k * hole.peck, hole.bottom) if k < pecks else hole.bottom
        yield [x, y, depth], FEED
        if k == pecks:
            break
        yield [x, y, hole.clear if hole.lift else depth + PECK_LIFT], RAPID
        if hole.lift:
            yield [x, y, min(depth + PECK_LIFT, hole.clear)], RAPID
    yield [x, y, hole.back], RAPID
