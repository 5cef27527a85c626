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

    @property
    def radius(self) -> float:
        """Radius of the cutting part, mm."""
        return 0.5 * self.diameter

    @property
    def kind(self) -> str:
        """'ball', 'flat' or 'bull' by the corner radius."""
        if self.corner_radius <= 0.0:
            return "flat"
        return "ball" if self.corner_radius >= self.radius - 1e-12 else "bull"

    def neck_clearance(self, wanted: float) -> float:
        """Radial clearance at the neck, mm: ``wanted``, or half the relief where that is less."""
        relief = 0.5 * (self.diameter - self.neck_diameter)
        return wanted if relief >= wanted else 0.5 * max(relief, 0.0)
