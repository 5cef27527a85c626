"""The cutting part of a tool under its milling names."""

from __future__ import annotations

import math
from dataclasses import dataclass

from geometry.errors import SetupError
from geometry.toolbody import ToolBody


@dataclass(frozen=True)
class Cutter:
    """Ball, flat or bull-nose cutter; the tip is its lowest point.

    diameter      : float, mm, > 0
    corner_radius : float, mm: diameter/2 for a ball, 0 for a flat, between for a bull nose
    length        : float, mm, > 0, of the cutting part; above it the drop counts the same cylinder without end

    Raises
    ------
    SetupError
        A length is not positive and finite, or the corner radius is beyond half the diameter.
    """

    diameter: float
    corner_radius: float
    length: float

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
        """A ball-end cutter, mm."""
        return cls(diameter, 0.5 * diameter, length)

    @classmethod
    def flat(cls, *, diameter: float, length: float) -> Cutter:
        """A flat-end cutter with sharp corners, mm."""
        return cls(diameter, 0.0, length)

    @classmethod
    def bull(cls, *, diameter: float, length: float, corner_radius: float) -> Cutter:
        """A bull-nose cutter, mm."""
        return cls(diameter, corner_radius, length)

    @classmethod
    def of(cls, tool: ToolBody) -> Cutter:
        """The cutting part of a tool assembly."""
        return cls(tool.diameter, tool.corner_radius, tool.flute_length)

    @property
    def radius(self) -> float:
        """Half the diameter, mm."""
        return 0.5 * self.diameter
