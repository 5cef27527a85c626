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

MIN_SHARE = 0.2
"""Least share to which a feed is reduced: below it, edges rub and the tool wears without cutting."""
LAYER_LIMIT = 0.05
"""mm, largest deflection of a tool in layers, unless ``BENT_SHARE`` of the stock they leave is less."""
BENT_SHARE = 0.55
LEFT_SHARE, LEFT_STEPS = 0.1, 1.3
"""Stock that layers leave for the finish: share of the deepest layer, and lattice steps; the greater counts."""
MIN_FEED = 0.1
"""mm/min."""


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

        The force grows with feed^(1 - mc), so the share is (limit / full)^(1 / (1 - mc)), at least ``MIN_SHARE``.
        """
        tool = self.tool
        force = cutting_force(self.kc, self.mc, feed / (self.flutes * self.rpm), depth, width, tool, self.flutes)
        if self.finishing:
            force *= math.sin(min(engaged_angle(tool, depth, width), 0.5 * math.pi))
        full = force * self.compliance
        share = 1.0
        if full > self.limit and not self.fixed:
            share = max(MIN_SHARE, (self.limit / full) ** (1.0 / (1.0 - self.mc)))
        return DeflectionEstimate(full, self.limit, share, full * share ** (1.0 - self.mc), self.fixed)


def left_by_layers(step_down: float, spacing: float) -> float:
    """Stock that layers leave on a wall for its finish, mm.

    step_down : mm, deepest layer
    spacing   : mm, of the lattice
    """
    return max(LEFT_SHARE * step_down, LEFT_STEPS * spacing)


__all__ = ["BENT_SHARE", "LAYER_LIMIT", "MIN_FEED", "MIN_SHARE", "DeflectionEstimate", "DeflectionModel",
           "left_by_layers"]
