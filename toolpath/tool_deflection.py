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

from geometry.tool_body import ToolBody

CARBIDE = 600e3
"""N/mm2, modulus of cemented carbide."""
CORE = 0.8
"""Diameter of a solid bar as stiff as the flutes, of the diameter of the cutter."""
MIN_SHARE = 0.2
"""Least share to which a feed is reduced: below it, edges rub and the tool wears without cutting."""
LAYER_LIMIT = 0.05
"""mm, largest deflection of a tool in layers, unless half of the stock they leave is less."""
LEFT_SHARE, LEFT_STEPS = 0.1, 1.5
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


def compliance(tool: ToolBody, modulus: float = CARBIDE) -> float:
    """Deflection of the tip for each N of force, mm/N, for a tool held at the nose of its holder [Timoshenko1955].

    The force acts at the tip, square to the axis. The tool is a stepped bar: flutes as a bar of ``CORE`` of the
    diameter, neck, shank. The moment at the height z is F z, so tip / F = sum (z1^3 - z0^3) / (3 E I) over the
    cylinders from z0 to z1. Shear and the holder's compliance are left out.
    """
    total, low = 0.0, 0.0
    for top, wide in ((tool.flute_length, CORE * tool.diameter), (tool.neck_length, tool.neck_diameter),
                      (tool.stickout, tool.shank_diameter)):
        if top > low:
            total += (top**3 - low**3) / (3.0 * modulus * math.pi * wide**4 / 64.0)
            low = top
    return total


def effective_diameter(diameter: float, corner_radius: float, depth: float) -> float:
    """Diameter of a cutter at the height ``depth`` above its tip, all mm: D - 2 r + 2 sqrt(a (2 r - a)) in the corner.

    >>> round(effective_diameter(10.0, 5.0, 1.0), 9), effective_diameter(10.0, 0.0, 1.0)
    (6.0, 10.0)
    """
    if depth >= corner_radius:
        return diameter
    return diameter - 2.0 * corner_radius + 2.0 * math.sqrt(depth * (2.0 * corner_radius - depth))


def engaged_angle(tool: ToolBody, depth: float, width: float) -> float:
    """Engaged angle of a side cut at the effective diameter D, rad: cos(phi) = 1 - 2 ae / D; pi in a slot
    [Altintas2012].

    depth, width : mm

    >>> round(math.degrees(engaged_angle(ToolBody("T1", 1, 10.0, 0.0, 20.0, 10.0, 20.0, 10.0, 40.0), 5.0, 2.5)), 9)
    60.0
    """
    wide = effective_diameter(tool.diameter, tool.corner_radius, depth)
    return math.acos(max(-1.0, 1.0 - 2.0 * width / wide)) if wide > 0.0 else math.pi


def cutting_force(kc: float, mc: float, per_tooth: float, depth: float, width: float, tool: ToolBody,
                  flutes: int) -> float:
    """Cutting force of a milling tool, N: that of all teeth in the cut, of at least one [Kienzle1952].

    kc, mc                   : N/mm2 and its exponent
    per_tooth, depth, width  : mm

    F = max(1, z phi / (2 pi)) b h^(1 - mc) kc, where h = fz sin(kappa) (1 - cos(phi)) / phi is the mean thickness of
    the chip over the engaged angle, b the length of the edge up to the depth with its round corner as a chord, and
    sin(kappa) = a / b.
    """
    if depth <= 0.0 or width <= 0.0:
        return 0.0
    r = tool.corner_radius
    low = min(depth, r)
    edge = math.hypot(low, math.sqrt(low * (2.0 * r - low))) + depth - low
    phi = engaged_angle(tool, depth, width)
    chip = per_tooth * depth / edge * (1.0 - math.cos(phi)) / phi
    return float(max(1.0, flutes * phi / (2.0 * math.pi)) * edge * chip ** (1.0 - mc) * kc)


def left_by_layers(step_down: float, spacing: float) -> float:
    """Stock that layers leave on a wall for its finish, mm.

    step_down : mm, deepest layer
    spacing   : mm, of the lattice
    """
    return max(LEFT_SHARE * step_down, LEFT_STEPS * spacing)


__all__ = ["CARBIDE", "CORE", "LAYER_LIMIT", "MIN_FEED", "MIN_SHARE", "DeflectionEstimate", "DeflectionModel",
           "compliance", "cutting_force", "effective_diameter", "engaged_angle", "left_by_layers"]
