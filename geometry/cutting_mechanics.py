"""Force on a milling tool in its cut, its deflection and the stress in it.

Notation
    F, E, I : force, N; modulus, N/mm2; second moment pi d^4 / 64, mm4
    z       : height above the tip, mm
    kc, mc  : specific cutting force of a chip of 1 mm by 1 mm, N/mm2, and its exponent
    a, ae   : depth and width of cut, mm
    b       : length of the edge in the cut, mm
    d, k    : diameter of a bar, mm, and how it grows with z
    fz, h   : feed per tooth and thickness of the chip, mm
    phi     : engaged angle, rad

Planner and proof use the same formulas; docs/theory/feeds.md has sources and omissions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from geometry.arc_pair import ArcPair
from geometry.mesh import F64
from geometry.tool_body import ToolBody

CARBIDE = 600e3
"""N/mm2, modulus of cemented carbide."""
STRENGTH, ROD, SIZE_EXPONENT = 4000.0, 3.3, 0.25
"""N/mm2, bending stress at which rods of cemented carbide break (transverse rupture strength, ISO 3327); the diameter
of such a rod, mm; and how the strength falls with the diameter: 3 / m for a Weibull modulus m of 12 [Weibull1951]."""
CHIP_SHARE = 0.2
"""Feed per tooth over the diameter that no cutter bears. High-feed mills reach 0.083 [HighFeed2026], router bits 0.064
[CutterShop2026]."""
CONES = 16
"""Into which the large arc of a barrel is divided."""
CORE = 0.8
"""Diameter of a solid bar as stiff as the flutes, of the diameter of the cutter."""


def compliance(tool: ToolBody, modulus: float = CARBIDE) -> float:
    """Deflection of the tip for each N of force, mm/N, for a tool held at the nose of its holder [Timoshenko1955].

    The force acts at the tip, square to the axis. The tool is a stepped bar: flutes as a bar of ``CORE`` of the
    diameter, neck, shank. The moment at the height z is F z, so tip / F = sum (z1^3 - z0^3) / (3 E I) over the
    cylinders from z0 to z1. Shear and the holder's compliance are left out.

    Flutes of a tapered mill are a cylinder up to the side and then a cone, d = e + k z. As (z / d)' = e / d^2, the
    integral of z^2 / d^4 over the cone is ((z1 / d1)^3 - (z0 / d0)^3) / (3 e). The large arc of a barrel is 16 cones.
    """
    total, low = 0.0, 0.0
    for top, narrow, wide in _bars(tool):
        if top > low:
            if narrow == wide:
                total += (top**3 - low**3) / (3.0 * modulus * math.pi * wide**4 / 64.0)
            else:
                at_tip = narrow - (wide - narrow) / (top - low) * low
                total += ((top / wide)**3 - (low / narrow)**3) / (3.0 * modulus * math.pi * at_tip / 64.0)
            low = top
    return total


def buckling(tool: ToolBody) -> float:
    """Thrust at which a tool held at the nose of its holder buckles while its tip is guided, N [Timoshenko1955].

    20.19 E I / L^2 of a bar fixed at one end and hinged at the other; E I / L^2 is L over three times the compliance.

    >>> round(buckling(ToolBody("T1", 1, 1.0, 0.0, 60.0, 1.0, 60.0, 1.0, 60.0)), 1)
    67.7
    """
    return 20.19 * tool.stickout / (3.0 * compliance(tool))


def strength(diameter: float) -> float:
    """Bending stress at which a round bar of cemented carbide breaks, N/mm2: larger bars have larger flaws.

    diameter : mm

    >>> strength(3.3), round(strength(8.0))
    (4000.0, 3206)
    """
    return STRENGTH * float((ROD / diameter) ** SIZE_EXPONENT)


def bending_stress(tool: ToolBody, force: float, depth: float) -> tuple[float, float]:
    """Bending stress in a tool held at the nose of its holder, and the strength there, N/mm2 [Timoshenko1955].

    force : N, square to the axis, spread evenly over the cut; depth : mm, of the cut

    The moment at the height z is F (z - a / 2), and the stress of a round bar 32 M / (pi d^3). It is greatest at the
    upper end of flutes, neck or shank; that of the largest share of the strength counts. Flutes count as a bar of
    ``CORE`` of the diameter. On a cone d = e + k z the share grows with (z - a / 2) / d^2.75 and may be greatest where
    d = 2.75 k (z - a / 2).

    >>> rod = ToolBody("T1", 1, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 35.0)
    >>> [round(x) for x in bending_stress(rod, 1000.0, 10.0)]
    [597, 3206]
    """
    worst, low, power = (0.0, STRENGTH), 0.0, 3.0 - SIZE_EXPONENT
    for top, narrow, wide in _bars(tool):
        if top > low:
            places, slope = [(top, wide)], (wide - narrow) / (top - low)
            if slope > 0.0:
                z = (narrow - slope * low + power * slope * 0.5 * depth) / ((power - 1.0) * slope)
                places += [(z, narrow + slope * (z - low))] if low < z < top else []
            for z, d in places:
                here = 32.0 * force * max(z - 0.5 * depth, 0.0) / (math.pi * d**3), strength(d)
                worst = max(worst, here, key=lambda pair: pair[0] / pair[1])
            low = top
    return worst


def _bars(tool: ToolBody) -> tuple[tuple[float, float, float], ...]:
    """Upper end and diameters at the lower and the upper end of the bars that a tool consists of, from the tip on,
    mm."""
    above = ((tool.neck_length, tool.neck_diameter, tool.neck_diameter),
             (tool.stickout, tool.shank_diameter, tool.shank_diameter))
    if tool.arcs is not None:
        return (*_arc_bars(tool.arcs, tool.flute_length), *above)
    if tool.taper <= 0.0:
        return ((tool.flute_length, CORE * tool.diameter, CORE * tool.diameter), *above)
    wide, high = tool.corner_end
    low, top = 2.0 * CORE * wide, 2.0 * CORE * tool.widest_radius
    return ((high, low, low), (tool.flute_length, low, top), *above)


def _arc_bars(arcs: ArcPair, flute: float) -> Iterator[tuple[float, float, float]]:
    """Bars of the flutes of a circle segment mill: the lower arc as a cylinder, the upper one as cones under its
    chords, and the side."""
    high = np.linspace(arcs.join_up, arcs.high, CONES + 1)
    wide = (2.0 * CORE * arcs.widths(high)).tolist()
    yield arcs.join_up, wide[0], wide[0]
    yield from zip(high[1:].tolist(), wide, wide[1:], strict=False)
    yield flute, wide[-1], wide[-1]


def effective_diameter(diameter: float, corner_radius: float, depth: float) -> float:
    """Diameter of a cutter at the height ``depth`` above its tip, all mm: D - 2 r + 2 sqrt(a (2 r - a)) in the corner.

    >>> round(effective_diameter(10.0, 5.0, 1.0), 9), effective_diameter(10.0, 0.0, 1.0)
    (6.0, 10.0)
    """
    if depth >= corner_radius:
        return diameter
    return diameter - 2.0 * corner_radius + 2.0 * math.sqrt(depth * (2.0 * corner_radius - depth))


def diameter_in_cut(tool: ToolBody, depth: float) -> float:
    """Diameter of a tool at the height ``depth`` above its tip, mm, as ``effective_diameter``; a tapered mill widens
    up to the end of its flutes.

    >>> cone = ToolBody("T1", 1, 2.0, 1.0, 11.0, 4.0, 11.0, 4.0, 40.0, taper=0.75)
    >>> [round(diameter_in_cut(cone, a), 9) for a in (0.2, 0.4, 4.4, 20.0)]
    [1.2, 1.6, 7.6, 17.5]
    """
    if tool.arcs is not None:
        return 2.0 * tool.arcs.width(depth)
    wide, high = tool.corner_end
    if tool.taper <= 0.0 or depth < high:
        return effective_diameter(tool.diameter, tool.corner_radius, depth)
    return 2.0 * (wide + tool.taper * (min(depth, tool.flute_length) - high))


def diameters_in_cut(tool: ToolBody, depth: F64) -> F64:
    """Diameter of a tool at n heights above its tip, as ``diameter_in_cut``.

    depth : (n,) float64, mm

    Returns (n,) float64, mm.
    """
    if tool.arcs is not None:
        return 2.0 * tool.arcs.widths(depth)
    r, (wide, high) = tool.corner_radius, tool.corner_end
    low = np.minimum(depth, high)
    in_corner = tool.diameter - 2.0 * r + 2.0 * np.sqrt(low * (2.0 * r - low))
    return np.where(depth >= high, 2.0 * wide + 2.0 * tool.taper * (np.minimum(depth, tool.flute_length) - high)
                    if tool.taper > 0.0 else tool.diameter, in_corner)


def engaged_angle(tool: ToolBody, depth: float, width: float) -> float:
    """Engaged angle of a side cut at the effective diameter D, rad: cos(phi) = 1 - 2 ae / D; pi in a slot
    [Altintas2012].

    depth, width : mm

    >>> round(math.degrees(engaged_angle(ToolBody("T1", 1, 10.0, 0.0, 20.0, 10.0, 20.0, 10.0, 40.0), 5.0, 2.5)), 9)
    60.0
    """
    wide = diameter_in_cut(tool, depth)
    return math.acos(max(-1.0, 1.0 - 2.0 * width / wide)) if wide > 0.0 else math.pi


def cutting_force(kc: float, mc: float, per_tooth: float, depth: float, width: float, tool: ToolBody,
                  flutes: int) -> float:
    """Cutting force of a milling tool, N: that of all teeth in the cut, of at least one [Kienzle1952].

    kc, mc                   : N/mm2 and its exponent
    per_tooth, depth, width  : mm

    F = max(1, z phi / (2 pi)) b h^(1 - mc) kc, where h = fz sin(kappa) (1 - cos(phi)) / phi is the mean thickness of
    the chip over the engaged angle, b the length of the edge up to the depth with its round corner as a chord, and
    sin(kappa) = a / b. The side of a tapered mill is as long as it leans.
    """
    if depth <= 0.0 or width <= 0.0:
        return 0.0
    edge = float(_edges(np.array(depth), tool))
    phi = engaged_angle(tool, depth, width)
    chip = per_tooth * depth / edge * (1.0 - math.cos(phi)) / phi
    return float(max(1.0, flutes * phi / (2.0 * math.pi)) * edge * chip ** (1.0 - mc) * kc)


def cutting_forces(kc: float, mc: float, per_tooth: F64, depth: F64, width: F64, tool: ToolBody, flutes: int) -> F64:
    """Cutting force of n cuts, as ``cutting_force`` [Kienzle1952].

    kc, mc                  : N/mm2 and its exponent
    per_tooth, depth, width : (n,) float64, mm; depths and widths above 0

    Returns (n,) float64, N.
    """
    edge, phi, chip = _chips(per_tooth, depth, width, tool)
    return np.asarray(np.maximum(1.0, flutes * phi / (2.0 * math.pi)) * edge * chip**(1.0 - mc) * kc)


def cutting_powers(kc: float, mc: float, per_tooth: F64, depth: F64, width: F64, feed: F64, tool: ToolBody) -> F64:
    """Power of n cuts: volume a minute times the specific cutting force of the mean chip [Kienzle1952].

    kc, mc                  : N/mm2 and its exponent
    per_tooth, depth, width : (n,) float64, mm, as ``cutting_forces``; feed : (n,) float64, mm/min

    Returns (n,) float64, kW, which is 1e6 N mm/s.

    >>> mill = ToolBody("T1", 1, 50.0, 0.0, 45.0, 50.0, 45.0, 50.0, 60.0)
    >>> one = np.ones(1)
    >>> round(float(cutting_powers(2640.0, 0.24, one, 30.0 * one, 40.0 * one, 4000.0 * one, mill)[0]))
    228
    """
    chip = _chips(per_tooth, depth, width, tool)[2]
    return np.asarray(depth * width * feed * kc * chip**(-mc) / 6e7)


def drill_loads(kc: float, mc: float, a_turn: float, drill: ToolBody, flutes: int) -> tuple[float, float]:
    """Torque and thrust of a drill in full stock, Nm and N [Kienzle1952].

    kc, mc : N/mm2 and its exponent; a_turn : mm, feed in a turn

    kc h^(-mc) f D^2 / 8, and half of kc h^(-mc) f D / 2 sin(kappa), with h = f / z sin(kappa) and kappa half of the
    point angle.
    """
    sine = math.sin(math.atan2(drill.radius, drill.cone_height))
    special = kc * (a_turn / flutes * sine)**(-mc)
    return special * a_turn * drill.diameter**2 / 8e3, 0.5 * special * a_turn * drill.radius * sine


def _chips(per_tooth: F64, depth: F64, width: F64, tool: ToolBody) -> tuple[F64, F64, F64]:
    """Length of the edge in the cut, mm, engaged angle, rad, and mean thickness of the chip, mm, of n cuts."""
    edge = _edges(depth, tool)
    phi = np.arccos(np.clip(1.0 - 2.0 * width / diameters_in_cut(tool, depth), -1.0, 1.0))
    return edge, phi, per_tooth * depth / edge * (1.0 - np.cos(phi)) / phi


def _edges(depth: F64, tool: ToolBody) -> F64:
    """Length of the edge up to heights over the tip, with round corners as chords, mm."""
    if tool.arcs is not None:
        return tool.arcs.edge_lengths(depth)
    r = tool.corner_radius
    low = np.minimum(depth, tool.corner_end[1])
    return np.asarray(np.hypot(low, np.sqrt(low * (2.0 * r - low))) + (depth - low) * math.hypot(1.0, tool.taper))


__all__ = ["CARBIDE", "CHIP_SHARE", "CORE", "bending_stress", "buckling", "compliance", "cutting_force",
           "cutting_forces", "cutting_powers", "diameter_in_cut", "diameters_in_cut", "drill_loads",
           "effective_diameter", "engaged_angle", "strength"]
