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
SAME_DEPTH = 1e-9


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
    peck   : mm, depth of the first peck, > 0; the whole depth for G81 and G82
    lift   : True: each peck retracts to ``clear`` (G83); False: it lifts 0.254 mm to break the chip
    out    : how the tool leaves the bottom
    step   : mm by which each peck is shorter than the one before; least : mm, the shortest peck
    flush  : mm of pecks in a row, after which a peck without ``lift`` retracts to ``clear`` too
    """

    clear: float
    bottom: float
    back: float
    peck: float
    lift: bool
    out: HoleExit = HoleExit.RAPID
    step: float = 0.0
    least: float = 0.0
    flush: float = math.inf

    @property
    def pecks(self) -> float:
        """Upper bound of the number of pecks, whole; inf where no number of pecks reaches the bottom."""
        depth = self.clear - self.bottom - SAME_DEPTH
        if depth <= 0:
            return 0.0
        if self.peck <= 0:
            return math.inf
        if self.step > 0:
            b = self.peck + 0.5 * self.step  # n pecks reach n b - n^2 step / 2
            square = b * b - 2.0 * self.step * depth
            falling = 2.0 * depth / (b + math.sqrt(square)) if square >= 0 else math.inf
            if falling <= max(self.peck - self.least, 0.0) / self.step + 1.0:
                return math.ceil(falling) + 1.0
        shortest = min(self.peck, self.least) if self.step > 0 else self.peck
        if shortest <= 0:
            return math.inf
        share = depth / shortest
        return float(math.ceil(share)) if math.isfinite(share) else math.inf

    def depths(self) -> Iterator[float]:
        """Depths of the pecks, mm below ``clear``; the last one is that of the bottom. ``pecks`` must be finite."""
        whole, at, peck = self.clear - self.bottom, 0.0, self.peck
        if self.step <= 0 and self.least <= self.peck:
            count = int(self.pecks)
            yield from (k * peck for k in range(1, count))
            yield from [whole][:count]
            return
        while at < whole - SAME_DEPTH:
            at = at + peck if peck > 0 and at + peck < whole - SAME_DEPTH else whole
            yield at
            peck = max(peck - self.step, self.least)

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
    before, flushed = 0.0, 0.0
    for down in hole.depths():
        if before > 0:
            up = hole.clear - before
            out = hole.lift or before - flushed >= hole.flush - SAME_DEPTH
            yield at(hole.clear if out else up + PECK_LIFT), RAPID
            if out:
                flushed = before
                yield at(min(up + PECK_LIFT, hole.clear)), RAPID
        depth = hole.clear - down
        yield at(max(depth, hole.bottom) if down < hole.clear - hole.bottom else hole.bottom), FEED
        before = down
    if hole.out is HoleExit.FEED_TO_CLEAR:
        yield at(hole.clear), FEED
    yield at(hole.back), FEED if hole.out is HoleExit.FEED else RAPID
