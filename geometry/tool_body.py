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

A circle segment mill has two arcs under an upright side (``ArcPair``). Both bulge outwards and touch without an edge.
The lower one touches the level of the tip at ``flat`` from the axis.
    lens   : a large arc round a point of the axis, then the corner, which touches the side; without corner a sharp rim
    barrel : a corner or a ball at the tip, then a large arc up to the diameter; there it leans by ``profile_taper``
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

MIN_ARC = 1e-6
"""mm, least radius of the lower arc of an end that is made smaller."""


@dataclass(frozen=True)
class HolderFrustum:
    """A frustum of the holder: diameters at its lower and upper end and its length, mm."""

    diameter: float
    diameter_top: float
    length: float


@dataclass(frozen=True)
class ArcPair:
    """The end of a circle segment mill in its half section: distances from the axis and heights over the tip, mm.

    flat           : radius of the flat at the tip, 0 for a point of the lower arc
    low            : radius of the lower arc, round (flat, low)
    out, up, bow   : centre and radius of the upper arc; of radius 0 it is a rim
    join, join_up  : where the arcs touch
    wide, high     : where the upper arc ends and the upright side begins
    """

    flat: float
    low: float
    out: float
    up: float
    bow: float
    join: float
    join_up: float
    wide: float
    high: float

    @classmethod
    def lens(cls, radius: float, profile_radius: float, corner_radius: float) -> ArcPair:
        """A large arc round a point of the axis and a corner that touches it and the side.

        radius         : mm, half the diameter
        profile_radius : mm, of the large arc, at least ``radius``
        corner_radius  : mm, at most ``radius``
        """
        out, far = radius - corner_radius, profile_radius - corner_radius
        up = profile_radius - math.sqrt(max(far * far - out * out, 0.0))
        share = profile_radius / far if far > 0.0 else 1.0
        return cls(0.0, profile_radius, out, up, corner_radius, out * share,
                   profile_radius - (profile_radius - up) * share, radius, up)

    @classmethod
    def barrel(cls, radius: float, profile_radius: float, corner_radius: float, taper: float, flat: float) -> ArcPair:
        """A corner round (flat, corner_radius) and a large arc that touches it and ends at the radius.

        radius, flat   : mm, half the diameter and radius of the flat at the tip
        profile_radius : mm, of the large arc
        corner_radius  : mm
        taper          : tangent of the angle between the axis and the large arc at its end

        The large arc ends above the place where it touches the corner, if ``barrel_fault`` finds nothing wrong.
        """
        long = math.hypot(1.0, taper)
        out, far = radius - profile_radius / long, profile_radius - corner_radius
        up = corner_radius + math.sqrt(max(far * far - (flat - out) ** 2, 0.0))
        share = corner_radius / far if far > 0.0 else 0.0
        return cls(flat, corner_radius, out, up, profile_radius, flat + (flat - out) * share,
                   corner_radius - (up - corner_radius) * share, radius, up - profile_radius * taper / long)

    def grown(self, by: float) -> ArcPair:
        """The arcs of the same end ``by`` mm farther out on all sides, from its own tip on.

        A barrel that leans at its end gets no less than that: the large arc goes on up to the larger diameter.
        """
        wide, low, bow = self.wide + by, max(self.low + by, MIN_ARC), self.bow + by
        if self.flat == 0.0 and self.low > self.bow:
            return ArcPair.lens(wide, low, max(bow, 0.0))
        up, rest = self.up + by, max(bow * bow - (wide - self.out) ** 2, 0.0)
        return replace(self, low=low, up=up, bow=bow, join=self.flat + low * self.join_sine,
                       join_up=low * (1.0 - math.sqrt(1.0 - self.join_sine**2)), wide=wide, high=up - math.sqrt(rest))

    def shifted(self, by: float) -> ArcPair:
        """The arcs ``by`` mm farther from the axis, beside a flat as much wider; by > -flat."""
        return replace(self, flat=self.flat + by, out=self.out + by, join=self.join + by, wide=self.wide + by)

    @property
    def join_sine(self) -> float:
        """Sine of the angle between the axis and the normal where the arcs touch."""
        return (self.flat - self.out) / (self.bow - self.low)

    @property
    def end_sine(self) -> float:
        """Sine of the angle between the axis and the normal where the upper arc ends."""
        return (self.wide - self.out) / self.bow if self.bow > 0.0 else 1.0

    def at_sine(self, sine: float) -> tuple[float, float]:
        """Where the normal of the outline has an angle to the axis: distance from it and height over the tip, mm.

        sine : of that angle, from 0 on
        """
        cosine = math.sqrt(max(1.0 - sine * sine, 0.0))
        if sine <= self.join_sine:
            return self.flat + self.low * sine, self.low * (1.0 - cosine)
        if sine <= self.end_sine:
            return self.out + self.bow * sine, self.up - self.bow * cosine
        return self.wide, self.high

    def height(self, rho: float) -> float:
        """Height of the end over the tip at a distance of at most ``wide`` from the axis, mm."""
        if rho <= self.flat:
            return 0.0
        if rho <= self.join:
            return self.low - math.sqrt(max(self.low**2 - (rho - self.flat) ** 2, 0.0))
        return self.up - math.sqrt(max(self.bow**2 - (rho - self.out) ** 2, 0.0))

    def width(self, over: float) -> float:
        """Distance from the axis at a height over the tip, mm."""
        if over >= self.high:
            return self.wide
        if over <= self.join_up:
            return self.flat + math.sqrt(max(over * (2.0 * self.low - over), 0.0))
        return self.out + math.sqrt(max(self.bow**2 - (self.up - over) ** 2, 0.0))


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
            return [*_arc_chords(self.arcs, chords), (self.radius, self.flute_length)]
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


def _arc_chords(arcs: ArcPair, chords: int) -> list[tuple[float, float]]:
    """Outline of the end of a circle segment mill from the axis at the tip on, with as many chords for each arc, mm."""
    out = [(0.0, 0.0)]
    for centre, radius, end in (((arcs.flat, arcs.low), arcs.low, (arcs.join, arcs.join_up)),
                                ((arcs.out, arcs.up), arcs.bow, (arcs.wide, arcs.high))):
        begin = (arcs.flat, 0.0) if len(out) == 1 else out[-1]
        first, last = (math.atan2(rho - centre[0], centre[1] - high) for rho, high in (begin, end))
        turns = [first + (last - first) * k / chords for k in range(1, chords)] if radius > 0.0 else []
        out += [begin, *((centre[0] + radius * math.sin(t), centre[1] - radius * math.cos(t)) for t in turns), end]
    return [p for k, p in enumerate(out) if k == 0 or p != out[k - 1]]
