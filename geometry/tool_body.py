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
"""

from __future__ import annotations

from dataclasses import dataclass


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
    diameter      : of the cutting part
    corner_radius : diameter/2 for a ball, 0 for a flat, between for a bull nose
    flute_length  : tip to the end of the cutting part
    neck_diameter, neck_length : the relieved part; neck_length is tip to shank
    shank_diameter, stickout   : stickout is tip to holder nose
    holder        : segments stacked upwards from the holder nose
    named         : 'drill', 'tap', 'chamfer' or 'thread_mill'; '' for a mill, whose kind the corner radius tells
    tip_diameter  : of the flat at the tip of a cone, 0 for a point
    cone_height   : height of the cone over the tip, 0 for an end without a cone
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

    @property
    def radius(self) -> float:
        """Radius of the cutting part, mm."""
        return 0.5 * self.diameter

    @property
    def kind(self) -> str:
        """Its name where it has one, else 'ball', 'flat' or 'bull' by the corner radius."""
        if self.named:
            return self.named
        if self.corner_radius <= 0.0:
            return "flat"
        return "ball" if self.corner_radius >= self.radius - 1e-12 else "bull"

    @property
    def corner_width(self) -> float:
        """How much wider the side is than the flat end, in radius, mm."""
        return self.radius - 0.5 * self.tip_diameter if self.cone_height > 0.0 else min(self.corner_radius, self.radius)

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
        relief = 0.5 * (self.diameter - self.neck_diameter)
        return wanted if relief >= wanted else 0.5 * max(relief, 0.0)
