"""The end of a circle segment mill: two arcs under an upright side.

Both arcs bulge outwards and touch without an edge. The lower one touches the level of the tip at ``flat`` from the
axis::

    lens    a large arc round a point of the axis, then the corner, which touches the side; without corner a sharp rim
    barrel  a corner or a ball at the tip, then a large arc up to the diameter, where it may lean
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import F64

BISECTIONS = 50
MIN_ARC = 1e-6
"""mm, least radius of the lower arc of an end that is made smaller."""


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

        The arcs join where the radius is at least flat + corner_radius cos of that angle, and the large radius at least
        (radius - flat) / cos. Callers check that.
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

        sine : of that angle, from 0 to 1
        """
        rho, high = self.at_sines(np.array(sine))
        return float(rho), float(high)

    def at_sines(self, sine: F64) -> tuple[F64, F64]:
        """``at_sine`` of many angles.

        sine : (n,) float64, dimensionless

        Returns two (n,) float64, mm, in the half section.
        """
        cosine = np.sqrt(np.maximum(1.0 - sine * sine, 0.0))
        lower, upper = sine <= self.join_sine, sine <= self.end_sine
        rho = np.where(lower, self.flat + self.low * sine, np.where(upper, self.out + self.bow * sine, self.wide))
        high = np.where(lower, self.low * (1.0 - cosine), np.where(upper, self.up - self.bow * cosine, self.high))
        return rho, high

    def curvature(self, sine: F64) -> F64:
        """Radius of the arc that touches where the normal of the outline has an angle to the axis; 0 for a rim.

        sine : (n,) float64, dimensionless, of that angle

        Returns (n,) float64, mm, in the half section.
        """
        return np.where(sine <= self.join_sine, self.low, np.where(sine <= self.end_sine + 1e-9, self.bow, 0.0))

    def height(self, rho: float) -> float:
        """Height of the end over the tip at a distance of at most ``wide`` from the axis, mm."""
        if rho <= self.flat:
            return 0.0
        if rho <= self.join:
            return self.low - math.sqrt(max(self.low**2 - (rho - self.flat) ** 2, 0.0))
        return self.up - math.sqrt(max(self.bow**2 - (rho - self.out) ** 2, 0.0))

    def width(self, over: float) -> float:
        """Distance from the axis at a height over the tip, mm."""
        return float(self.widths(np.array(over)))

    def widths(self, over: F64) -> F64:
        """``width`` at many heights.

        over : (n,) float64, mm, from 0 on

        Returns (n,) float64, mm, in the half section.
        """
        lower = self.flat + np.sqrt(np.maximum(over * (2.0 * self.low - over), 0.0))
        upper = self.out + np.sqrt(np.maximum(self.bow**2 - (self.up - over) ** 2, 0.0))
        return np.where(over >= self.high, self.wide, np.where(over <= self.join_up, lower, upper))

    def edge_lengths(self, depth: F64) -> F64:
        """Length of the outline beside the flat up to a height over the tip, with each arc as a chord.

        depth : (n,) float64, mm, above 0

        Returns (n,) float64, mm, in the half section.
        """
        low, high = np.minimum(depth, self.join_up), np.clip(depth, self.join_up, self.high)
        return (np.hypot(low, self.widths(low) - self.flat)
                + np.hypot(high - self.join_up, self.widths(high) - self.widths(np.array(self.join_up)))
                + np.maximum(depth - self.high, 0.0))

    def passes_apart(self, sine: F64, cusp: float) -> F64:
        """Distance of passes along a plane that leave a cusp between them: the chord of the outline at that depth.

        sine : (n,) float64, dimensionless, of the angle between the axis and the normal of the plane
        cusp : mm, above 0

        Returns (n,) float64, mm: 2 sqrt(2 r h - h^2) where one arc of radius r makes the cusp; inf along an upright
        wall. Exact for the outline to 1e-9 of its length.
        """
        sine = np.clip(sine, 0.0, 1.0)
        cosine, contact = np.sqrt(1.0 - sine * sine), np.arcsin(sine)
        rho, up = self.at_sines(sine)

        def off(at: F64) -> tuple[F64, F64]:
            """How far the outline is from the plane where its normal has an angle to the axis, and how far along."""
            there, high = self.at_sines(np.abs(np.sin(at)))
            there = np.where(at < 0.0, -there, there)
            return (rho - there) * sine - (up - high) * cosine, (there - rho) * cosine + (high - up) * sine

        total = np.zeros_like(sine)
        for side in (-1.0, 1.0):
            near, far = contact.copy(), np.full_like(contact, side * 0.5 * math.pi)
            for _ in range(BISECTIONS):
                middle = 0.5 * (near + far)
                deep = off(middle)[0] > cusp
                near, far = np.where(deep, near, middle), np.where(deep, middle, far)
            depth, gone = off(near)
            # the rest lies on the flat end, or on the side above the arcs
            rest = np.maximum(cusp - depth, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                on_flat, on_side = (near > 0.0) & (far <= 0.0), off(far)[0] < cusp
                more = np.where(on_flat, np.minimum(rest * cosine / sine, 2.0 * self.flat * cosine),
                                np.where(on_side, rest * sine / cosine, 0.0))
            total += np.abs(gone) + np.where(rest > 1e-12, more, 0.0)
        return total

    def inner_balls(self, count: int, flute_length: float) -> list[tuple[float, float, float]]:
        """Rings of balls within a cutting part that touch its arcs: distance from the axis, height and radius, mm.

        count        : places on each arc, beside the one at the tip
        flute_length : mm, where the cutting part ends
        """
        upper = range(1, count + 1) if self.bow > 0.0 else ()
        out = []
        for sine in [0.0, *(k / count * self.join_sine for k in range(1, count + 1)),
                     *(self.join_sine + k / count * (self.end_sine - self.join_sine) for k in upper)]:
            (rho, high), cosine = self.at_sine(sine), math.sqrt(max(1.0 - sine * sine, 0.0))
            ball = min(self.low, self.bow if self.bow > 0.0 else self.low, 0.5 * self.wide,
                       max(flute_length - high, 0.0) / (1.0 + cosine),
                       max(self.wide - rho, 0.0) / (1.0 - sine) if sine < 1.0 - 1e-9 else math.inf)
            ball = min(ball, rho / sine) if sine > 0.0 else ball
            out.append((rho - ball * sine, high + ball * cosine, ball))
        return out

    def chords(self, count: int) -> list[tuple[float, float]]:
        """Outline from the axis at the tip to the side, with ``count`` chords for each arc: radius and height, mm."""
        out = [(0.0, 0.0)]
        for sines in ((0.0, self.join_sine), (self.join_sine, self.end_sine)):
            first, last = (math.asin(min(max(s, 0.0), 1.0)) for s in sines)
            radius, centre = (self.low, (self.flat, self.low)) if len(out) == 1 else (self.bow, (self.out, self.up))
            turns = [first + (last - first) * k / count for k in range(count + 1)]
            out += [(centre[0] + radius * math.sin(t), centre[1] - radius * math.cos(t)) for t in turns]
        return [p for k, p in enumerate(out) if k == 0 or math.dist(p, out[k - 1]) > 1e-12]
