"""Deflection of the tip of a tool under its cut, and a feed that keeps it within its limit.

Notation
    F, E, I : force, N; modulus, N/mm2; second moment pi d^4 / 64, mm4
    z       : height above the tip, mm
    kc, mc  : specific cutting force of a chip of 1 mm by 1 mm, N/mm2, and its exponent
    a, ae   : depth and width of cut, mm
    b       : length of the edge in the cut, mm
    fz, h   : feed per tooth and thickness of the chip, mm
    phi     : engaged angle, rad

Formulas, sources and omissions: docs/theory/feeds.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from geometry.cutting_mechanics import cutting_force, engaged_angle
from geometry.tool_body import ToolBody

MIN_SHARE, MIN_CHIP = 0.2, 0.002
"""Least share to which a feed is reduced, and least feed per tooth, of the diameter; the greater counts. Below it,
edges rub and the tool wears without cutting."""
THINNEST = 1.0 / 3.0
"""Of a depth, to which it is reduced where a tool bends too far at its least chip."""
MAX_BENT_TIMES = 4.0
"""Times its limit that a tool bends at its least chip, at most, at whatever depth. Where walls meet at an acute angle
more stands in its way than beside them, up to twice the force; the proof refuses ten times the limit."""
LAYER_LIMIT = 0.05
"""mm, largest deflection of a tool in layers, unless ``BENT_SHARE`` of the stock they leave is less."""
BENT_SHARE = 0.55
LEFT_SHARE, LEFT_STEPS, MIN_LEFT = 0.04, 0.5, 0.06
"""Stock that layers leave for the finish: share of the deepest layer, lattice steps, and mm; the greatest counts."""
MIN_FEED = 0.1
"""mm/min."""
HALVINGS = 20


@dataclass(frozen=True)
class DeflectionEstimate:
    """Deflection of a tool under a cut.

    full       : mm, at the feed of material and tool
    limit      : mm
    share      : dimensionless, share of that feed at which the tool moves
    deflection : mm, at that share
    fixed      : the setup gives the feed, which is not reduced
    """

    full: float
    limit: float
    share: float
    deflection: float
    fixed: bool = False


@dataclass(frozen=True)
class DeflectionModel:
    """Stiffness of a tool and cutting force of a material.

    compliance : mm/N, of the tip
    kc, mc     : of the material
    limit      : mm, largest deflection of the tip
    flutes     : count of teeth
    rpm        : of the spindle, 1/min
    finishing  : only the force square to the cut surface counts
    fixed      : the setup gives the feed, which is not reduced
    ways_fixed : the same for ways down
    """

    tool: ToolBody
    compliance: float
    kc: float
    mc: float
    limit: float
    flutes: int
    rpm: float
    finishing: bool = False
    fixed: bool = False
    ways_fixed: bool = False

    def under(self, feed: float, depth: float, width: float) -> DeflectionEstimate:
        """Deflection under a cut at a feed, mm/min, and the share to which the feed is reduced [Kienzle1952]
        [Timoshenko1955].

        depth, width : mm, of the cut

        The force grows with feed^(1 - mc), so the share is (limit / full)^(1 / (1 - mc)), at least ``least_share``.
        """
        full, share = self.deflection(feed, depth, width), 1.0
        if full > self.limit and not self.fixed:
            share = max(self.least_share(feed), (self.limit / full) ** (1.0 / (1.0 - self.mc)))
        return DeflectionEstimate(full, self.limit, share, full * share ** (1.0 - self.mc), self.fixed)

    def deflection(self, feed: float, depth: float, width: float) -> float:
        """Deflection under a cut, mm. feed : mm/min; depth, width : mm, of the cut."""
        force = cutting_force(self.kc, self.mc, feed / (self.flutes * self.rpm), depth, width, self.tool, self.flutes)
        if self.finishing:
            force *= math.sin(min(engaged_angle(self.tool, depth, width), 0.5 * math.pi))
        return force * self.compliance

    def least_share(self, feed: float) -> float:
        """Least share to which a feed, mm/min, is reduced; 1 where it gives no more than the least chip itself."""
        least = MIN_CHIP * self.tool.diameter * self.flutes * self.rpm
        return min(1.0, max(MIN_SHARE, least / feed))

    def bearable(self, feed: float, depth: float, width: float) -> float:
        """The largest depth at which a cut with the least chip does not bend the tool too far, mm.

        feed         : mm/min, of which ``least_share`` is taken
        depth, width : mm; the result is no more than this depth. It is no less than ``THINNEST`` of it, unless that
                       bends the tool ``MAX_BENT_TIMES`` times as far as its limit

        Too far is past the limit, and past what ``MIN_SHARE`` of the feed does at the full depth. A stiffer tool has
        less of both. Thinner cuts at more feed bend it as far and take as much time, since the force grows with the
        feed less than in proportion, and their chips are none too thin.
        """
        least, most = self.least_share(feed) * feed, MAX_BENT_TIMES * self.limit
        limit = min(max(self.limit, self.deflection(MIN_SHARE * feed, depth, width)), most)
        if self.fixed or self.deflection(least, depth, width) <= limit:
            return depth
        low, high = THINNEST * depth, depth
        if self.deflection(least, low, width) > most:
            low, high, limit = 0.0, low, most
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.deflection(least, middle, width) <= limit else (low, middle)
        return low


def left_by_layers(step_down: float, spacing: float) -> float:
    """Stock that layers leave on a wall for its finish, mm.

    step_down : mm, deepest layer
    spacing   : mm, of the lattice
    """
    return max(LEFT_SHARE * step_down, LEFT_STEPS * spacing, MIN_LEFT)


__all__ = ["BENT_SHARE", "LAYER_LIMIT", "MIN_CHIP", "MIN_FEED", "MIN_SHARE", "MAX_BENT_TIMES", "THINNEST",
           "DeflectionEstimate", "DeflectionModel", "left_by_layers"]
