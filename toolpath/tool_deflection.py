"""How far the tip of a tool bends under what it cuts, and a feed at which it bends no more than it may.

Notation: F force N, E modulus N/mm2, I = pi d^4 / 64 second moment mm4, z heights above the tip mm; kc specific cutting
force of a chip of 1 mm by 1 mm, N/mm2, mc its exponent; a depth, ae width of cut, b length of the edge in it, fz feed
per tooth, h thickness of the chip, all mm; phi engaged angle, rad. Formulas, sources and what is left out:
docs/theory/feeds.md.
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
"""A feed is not eased to less than this share of itself: below, edges rub and the tool wears for nothing."""
LAYER_LIMIT = 0.05
"""mm, most that a tool may bend in layers, where half of what they leave is not less."""
LEFT_SHARE, LEFT_STEPS = 0.1, 1.5
"""What layers leave for the finish: of the deepest layer, and of the lattice step; the greater."""
MIN_FEED = 0.1
"""mm/min."""


@dataclass(frozen=True)
class DeflectionEstimate:
    """What a cut bends a tool by.

    full  : mm, at the feed of material and tool; limit : mm, that it may
    share : of that feed at which the tool goes; deflection : mm, at it
    fixed : the feed is the setup's own and was not eased
    """

    full: float
    limit: float
    share: float
    deflection: float
    fixed: bool = False


@dataclass(frozen=True)
class DeflectionModel:
    """A tool that cuts a material, as far as its bending goes.

    compliance : mm/N, of the tip
    kc, mc     : of the material
    limit      : mm, that the tip may bend
    flutes     : number of teeth; rpm : of the spindle, 1/min
    finishing  : only what of the force stands square to the cut surface counts
    fixed      : its feed is the setup's own and not eased; ways_fixed : that of ways down
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
        """What a cut of a depth and a width, mm, bends the tool by at a feed, mm/min, and how far that is eased."""
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
    """mm/N at the tip of a tool held at the nose of its holder, under a force at the tip square to its axis.

    Cylinders end to end: flutes as a bar of ``CORE`` of the diameter, neck, shank. The moment at the height z is F z,
    so that tip / F = sum (z1^3 - z0^3) / (3 E I) over the cylinders from z0 to z1.
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
    """Rad, of a side cut at the effective diameter D: cos(phi) = 1 - 2 ae / D; pi in a slot; depth and width in mm.

    >>> round(math.degrees(engaged_angle(ToolBody("T1", 1, 10.0, 0.0, 20.0, 10.0, 20.0, 10.0, 40.0), 5.0, 2.5)), 9)
    60.0
    """
    wide = effective_diameter(tool.diameter, tool.corner_radius, depth)
    return math.acos(max(-1.0, 1.0 - 2.0 * width / wide)) if wide > 0.0 else math.pi


def cutting_force(kc: float, mc: float, per_tooth: float, depth: float, width: float, tool: ToolBody,
                  flutes: int) -> float:
    """Cutting force of a milling tool, N: that of all teeth in the cut, of one at least.

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
    """mm that layers leave on a wall for its finish; step_down : mm, deepest layer; spacing : mm, of the lattice."""
    return max(LEFT_SHARE * step_down, LEFT_STEPS * spacing)


__all__ = ["CARBIDE", "CORE", "LAYER_LIMIT", "MIN_FEED", "MIN_SHARE", "DeflectionEstimate", "DeflectionModel", "compliance",
           "cutting_force", "effective_diameter", "engaged_angle", "left_by_layers"]
