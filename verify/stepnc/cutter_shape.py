"""Shape of a milling cutter of STEP-NC: an end, and a side that may lean, as the seven sizes of APT describe it.

The side is a line at the taper to the axis. It meets the plane of the tip at half of the diameter that the file gives,
and the corner is a circle. A tapered mill of a setup has a side that touches its corner; what a file gives must be such
a shape, or it is a remark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

MAX_TAPER = 80.0
"""Largest angle between side and axis, deg. A wider cutter is a face or chamfer mill."""
SAME_SHAPE = 1e-4
"""mm, by which diameter, corner and taper of a file may contradict each other."""


@dataclass(frozen=True)
class CutterShape:
    """What a file gives of a tapered cutter.

    foot   : mm, diameter at which the side meets the plane of the tip
    corner : mm, radius of the corner
    centre : mm, distance of the middle of the corner from the axis; None: not given
    taper  : deg, between side and axis
    """

    foot: float
    corner: float
    centre: float | None
    taper: float

    @property
    def diameter(self) -> float:
        """Diameter of the end, mm: on both sides the corner beside its middle; where that is not given, by the side.

        >>> round(CutterShape(0.948965, 0.5, None, 3.0).diameter, 6), CutterShape(0.948965, 0.5, 0.0, 3.0).diameter
        (1.0, 1.0)
        """
        return 2.0 * (self._touching(0.5 * self.foot) if self.centre is None else self.centre + self.corner)

    @property
    def difference(self) -> float:
        """Distance between where the side meets the plane of the tip and where it would if it touched the corner, mm.

        >>> CutterShape(2.0, 0.0, 1.0, 10.0).difference, round(CutterShape(1.0, 0.5, 0.0, 3.0).difference, 4)
        (0.0, 0.0255)
        """
        return abs(self._touching(0.5 * self.foot) - 0.5 * self.diameter)

    def _touching(self, foot: float) -> float:
        """Radius of the end whose side touches the corner and meets the plane of the tip at the radius ``foot``, mm."""
        t = math.radians(self.taper)
        return foot + self.corner * (1.0 - (1.0 - math.sin(t)) / math.cos(t))


def contradiction(instance: int, shape: CutterShape) -> str:
    """The remark on a tool whose side does not touch its corner; ``instance`` is the number of the tool."""
    return (f"#{instance} has a diameter of {shape.foot:g} mm, a corner radius of {shape.corner:g} mm and a taper of "
            f"{shape.taper:g} deg, with which its side does not touch its corner: give the diameter at which the side "
            "meets the plane of the tip")


def shape_of(diameter: float, corner: float, taper: float = 0.0) -> str:
    """'ball', 'bull' or 'flat' by diameter and corner radius, mm; 'tapered_ball' and so on by a taper over 0."""
    end = "flat" if corner <= 0.0 else "ball" if corner >= 0.5 * diameter - 1e-6 else "bull"
    return f"tapered_{end}" if taper > 0.0 else end


__all__ = ["MAX_TAPER", "SAME_SHAPE", "CutterShape", "contradiction", "shape_of"]
