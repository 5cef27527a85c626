"""A tool as a body of revolution: its shape only.

Heights are measured from the tip upwards along the axis::

        |  holder segments  |      stickout and above, stacked
        +-----+       +-----+
              | shank |            neck_length .. stickout
              +-+   +-+
                | n |              flute_length .. neck_length   (neck)
               +-----+
               |  c  |             0 .. flute_length             (cutting part)
                \\___/             ball: corner_radius = diameter/2, flat: 0, bull: between
                 \\ /              cone: tip_diameter wide at the tip, diameter wide at cone_height

The side of a tapered mill leans outwards by ``taper``, the tangent of its angle to the axis. It touches the corner at
height r (1 - sin), where the cutting part is R - r (1 - cos) wide in radius, and ends with the flutes. ``diameter`` is
that of its end: of the ball, or of the flat with the corner radius on both sides.

A circle segment mill has two arcs under an upright side (``geometry.arc_pair``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from geometry.arc_pair import ArcPair


@dataclass(frozen=True)
class HolderFrustum:
    """A frustum of the holder: diameters at its lower and upper end and its length, mm."""

    diameter: float
    diameter_top: float
    length: float


@dataclass(frozen=True)
class ToolBody:
    """One tool assembly; all lengths mm, measured from the tip.

    id            : as in the setup, for example 'T1'
    number        : T and H word of the program
    diameter      : of the cutting part; of a tapered mill that of its end
    corner_radius : diameter/2 for a ball, 0 for a flat, between for a bull nose
    flute_length  : tip to the end of the cutting part
    neck_diameter, neck_length : the relieved part; neck_length is tip to shank
    shank_diameter, stickout   : stickout is tip to holder nose
    holder        : segments stacked upwards from the holder nose
    named         : 'drill', 'tap', 'chamfer' or 'thread_mill'; '' for a mill, whose kind the corner radius tells
    form          : 'lens' or 'barrel' for a circle segment mill, else ''
    tip_diameter  : of the flat at the tip of a cone or a barrel, 0 for a point or a ball
    cone_height   : height of the cone over the tip, 0 for an end without a cone
    taper         : tangent of the angle between the side and the axis, 0 for an upright side
    profile_radius, profile_taper : of a circle segment mill the radius of its large arc, and the tangent of the angle
                    between the axis and the upper end of that arc
    """

    id: str
    number: int
    diameter: float
    corner_radius: float
    flute_length: float
    neck_diameter: float
    neck_length: float
    shank_diameter: float
    stickout: float
    holder: tuple[HolderFrustum, ...] = ()
    named: str = ""
    tip_diameter: float = 0.0
    cone_height: float = 0.0
    taper: float = 0.0
    form: str = ""
    profile_radius: float = 0.0
    profile_taper: float = 0.0

    @property
    def radius(self) -> float:
        """Radius of the cutting part, mm; of a tapered mill that of its end."""
        return 0.5 * self.diameter

    @property
    def end(self) -> str:
        """Its name or form where it has one, else the shape by the corner radius: 'ball', 'flat' or 'bull'."""
        if self.named or self.form:
            return self.named or self.form
        if self.corner_radius <= 0.0:
            return "flat"
        return "ball" if self.corner_radius >= self.radius - 1e-12 else "bull"

    @property
    def kind(self) -> str:
        """As ``end``, with 'tapered_' before it where the side leans."""
        return f"tapered_{self.end}" if self.taper > 0.0 else self.end

    @property
    def taper_deg(self) -> float:
        """Angle between the axis and the side, or the upper end of the large arc of a barrel, deg."""
        return math.degrees(math.atan(max(self.taper, self.profile_taper)))

    @cached_property
    def arcs(self) -> ArcPair | None:
        """The two arcs of a circle segment mill; None for other tools."""
        if self.form == "lens":
            return ArcPair.lens(self.radius, self.profile_radius, self.corner_radius)
        if self.form == "barrel":
            return ArcPair.barrel(self.radius, self.profile_radius, self.corner_radius, self.profile_taper,
                                  0.5 * self.tip_diameter)
        return None

    @property
    def flat_radius(self) -> float:
        """Radius of the flat end, mm; 0 for a ball or a lens."""
        if self.arcs is not None:
            return self.arcs.flat
        return 0.5 * self.tip_diameter if self.cone_height > 0.0 else max(self.radius - self.corner_radius, 0.0)

    @property
    def tip_curvature(self) -> float:
        """Radius of the arc beside the flat end, or at the tip, mm: of a lens its large arc; 0 for a sharp edge."""
        return self.arcs.low if self.arcs is not None else self.corner_radius

    @property
    def end_height(self) -> float:
        """Height of the rounded end over the tip, mm: the corner radius, or where the arcs end."""
        return self.corner_radius if self.arcs is None else self.arcs.high

    @property
    def dull_radius(self) -> float:
        """Radius within which the end leans by less than 30 degrees, mm: there it digs rather than cuts."""
        return self.radius - 0.5 * self.corner_radius if self.arcs is None else self.arcs.at_sine(0.5)[0]

    @property
    def corner_end(self) -> tuple[float, float]:
        """Where the corner ends and the side begins: distance from the axis and height over the tip, mm."""
        if self.arcs is not None:
            return self.arcs.wide, self.arcs.high
        long = math.hypot(1.0, self.taper)
        return self.radius - self.corner_radius * (1.0 - 1.0 / long), self.corner_radius * (1.0 - self.taper / long)

    @property
    def widest_radius(self) -> float:
        """Largest radius of the cutting part, mm: of a tapered mill at the end of its flutes."""
        wide, high = self.corner_end
        return wide + self.taper * max(self.flute_length - high, 0.0)

    def cutting_profile(self, chords: int) -> list[tuple[float, float]]:
        """Outline of the cutting part from the axis at the tip to the end of the flutes: radius and height, mm.

        chords : number of chords of a round corner
        """
        if self.cone_height > 0.0:
            return [(0.0, 0.0), (self.radius - self.corner_width, 0.0), (self.radius, self.cone_height),
                    (self.radius, self.flute_length)]
        if self.arcs is not None:
            return [*self.arcs.chords(chords), (self.radius, self.flute_length)]
        c, flat = self.corner_radius, self.radius - self.corner_radius
        turn = 0.5 * math.pi - math.atan(self.taper)
        arc = [(flat + c * math.sin(turn * k / chords), c - c * math.cos(turn * k / chords))
               for k in range(chords + 1)] if c > 0.0 else [(self.radius, 0.0)]
        return [(0.0, 0.0), *arc, (self.widest_radius, self.flute_length)]

    @property
    def corner_width(self) -> float:
        """How much wider the side is than the flat end, in radius, mm."""
        if self.arcs is not None or self.cone_height > 0.0:
            return self.radius - self.flat_radius
        return min(self.corner_radius, self.radius)

    @property
    def along_axis_only(self) -> bool:
        """Whether the tool cuts along its axis only: a drill or a tap."""
        return self.named in ("drill", "tap")

    @property
    def cuts_down(self) -> bool:
        """Whether the tool may cut straight down into full stock: a drill, or a chamfer mill with a point."""
        return self.named == "drill" or (self.named == "chamfer" and self.tip_diameter <= 0.0)

    def neck_clearance(self, wanted: float) -> float:
        """Radial clearance at the neck, mm: ``wanted``, or half the relief where that is less."""
        relief = self.widest_radius - 0.5 * self.neck_diameter
        return wanted if relief >= wanted else 0.5 * max(relief, 0.0)
