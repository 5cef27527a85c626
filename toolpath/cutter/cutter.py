"""The cutting part of a tool by its milling name: ball, flat, bull nose, tapered, barrel or any outline.

Frame of the tool: the tip is the origin, Z points along the axis to the spindle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from geometry.errors import SetupError
from geometry.kernels.drop import Bull, bull_of
from geometry.kernels.outline import Stack
from geometry.mesh_queries.revolved_outline import Outline, OutlineArc, OutlineLine
from geometry.tool_body import ToolBody


@dataclass(frozen=True)
class Cutter:
    """A cutter, or a whole assembly, of revolution; the tip is its lowest point.

    diameter      : float, mm, > 0, the widest
    corner_radius : float, mm: diameter/2 for a ball, 0 for a flat, between for a bull nose; of other shapes 0
    length        : float, mm, > 0, of the cutting part; above it the drop counts the same cylinder without end
    outline       : Outline of any other shape; None for ball, flat and bull nose

    Raises
    ------
    SetupError
        A length is not positive and finite, or the corner radius is beyond half the diameter.
    """

    diameter: float
    corner_radius: float
    length: float
    outline: Outline | None = None

    def __post_init__(self) -> None:
        for name in ("diameter", "length"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise SetupError(f"the {name} of a cutter must be above 0 mm, got {value}", code="bad_cutter",
                                 subjects=(name,), measured=value, limit=0.0)
        if not 0.0 <= self.corner_radius <= self.radius:
            raise SetupError(f"a corner radius of {self.corner_radius} mm does not fit a cutter of "
                             f"{self.diameter} mm", code="bad_cutter", subjects=("corner_radius",),
                             measured=self.corner_radius, limit=self.radius)

    @classmethod
    def ball(cls, *, diameter: float, length: float) -> Cutter:
        """A ball-end cutter.

        diameter, length : float, mm
        """
        return cls(diameter, 0.5 * diameter, length)

    @classmethod
    def flat(cls, *, diameter: float, length: float) -> Cutter:
        """A flat-end cutter with sharp corners.

        diameter, length : float, mm
        """
        return cls(diameter, 0.0, length)

    @classmethod
    def bull(cls, *, diameter: float, length: float, corner_radius: float) -> Cutter:
        """A bull-nose cutter.

        diameter, length, corner_radius : float, mm
        """
        return cls(diameter, corner_radius, length)

    @classmethod
    def tapered(cls, *, diameter: float, tip_diameter: float, angle_deg: float, length: float) -> Cutter:
        """A tapered ball: a ball of ``tip_diameter`` and a tangent cone up to ``diameter``.

        diameter, tip_diameter, length : float, mm
        angle_deg                      : float, deg, between the side of the cone and the axis, above 0 and below 90

        Raises
        ------
        SetupError
            The angle is out of range, or the tip is not narrower than the cutter.
        """
        if not 0.0 < angle_deg < 90.0:
            raise SetupError(f"the half angle of a tapered cutter must lie between 0 and 90 degrees, got {angle_deg}",
                             code="bad_cutter", subjects=("angle_deg",), measured=angle_deg, limit=[0.0, 90.0])
        r, half = 0.5 * tip_diameter, math.radians(angle_deg)
        at, top = r * math.cos(half), 0.5 * diameter
        if not 0.0 < at < top:
            raise SetupError(f"a ball of {tip_diameter} mm is not narrower than a cutter of {diameter} mm",
                             code="bad_cutter", subjects=("tip_diameter",), measured=tip_diameter, limit=diameter)
        z = r * (1.0 - math.sin(half))
        return cls(diameter, 0.0, length,
                   Outline((OutlineArc(at, z, (0.0, r)), OutlineLine(top, z + (top - at) / math.tan(half)))))

    @classmethod
    def barrel(cls, *, diameter: float, tip_diameter: float, side_radius: float, length: float) -> Cutter:
        """A barrel: a ball of ``tip_diameter`` and a tangent side of ``side_radius``, widest at ``diameter``.

        The side is widest where the cylinder above begins. tip_diameter < diameter < 2 side_radius.

        diameter, tip_diameter, side_radius, length : float, mm

        Raises
        ------
        SetupError
            The three sizes do not fit together.
        """
        r, widest = 0.5 * tip_diameter, 0.5 * diameter
        if not 0.0 < r < widest < side_radius:
            raise SetupError(f"a barrel of {diameter} mm with a tip of {tip_diameter} mm and a side radius of "
                             f"{side_radius} mm does not close", code="bad_cutter", subjects=("side_radius",),
                             measured=[tip_diameter, diameter, side_radius],
                             limit="tip diameter < diameter < 2 side radius")
        c = widest - side_radius
        level = r + math.sqrt((side_radius - r) ** 2 - c * c)
        k = side_radius / (side_radius - r)
        join = (c - k * c, level + k * (r - level))
        return cls(diameter, 0.0, length, Outline((OutlineArc(*join, (0.0, r)), OutlineArc(widest, level, (c, level)))))

    @classmethod
    def turned(cls, outline: Outline, *, length: float) -> Cutter:
        """A cutter of any outline; length : mm, of the cutting part."""
        return cls(2.0 * outline.radius, 0.0, length, outline)

    @classmethod
    def assembly(cls, tool: ToolBody) -> Cutter:
        """Cutting part, shank and holder of a tool as one body without clearances, and the neck where it is wider."""
        r, d = tool.corner_radius, 0.5 * tool.diameter - tool.corner_radius
        pieces: list[OutlineArc | OutlineLine] = [OutlineLine(d, 0.0)] if d > 0.0 else []
        if r > 0.0:
            pieces.append(OutlineArc(d + r, r, (d, r)))
        pieces.append(OutlineLine(d + r, max(r, tool.flute_length)))
        z = tool.flute_length
        for radius, top in ((0.5 * tool.neck_diameter, tool.neck_length), (0.5 * tool.shank_diameter, tool.stickout)):
            pieces += [OutlineLine(radius, z), OutlineLine(radius, top)]
            z = top
        for s in tool.holder:
            pieces += [OutlineLine(0.5 * s.diameter, z), OutlineLine(0.5 * s.diameter_top, z + s.length)]
            z += s.length
        return cls.turned(Outline(tuple(pieces)), length=tool.flute_length)

    @classmethod
    def of(cls, tool: ToolBody) -> Cutter:
        """The cutting part of a tool assembly; of a tapered mill its end under an upright side."""
        if tool.arcs is not None:
            return cls.turned(Outline.two_arcs(tool.arcs), length=tool.flute_length)
        return cls(tool.diameter, tool.corner_radius, tool.flute_length)

    @property
    def radius(self) -> float:
        """Half the diameter, mm."""
        return 0.5 * self.diameter

    @property
    def shape(self) -> Bull | Stack:
        """The cutter as compiled loops take it, a shape of ``geometry.kernels.revolved.tip_over``."""
        return bull_of.py_func(self.radius, self.corner_radius) if self.outline is None else self.outline.stack
