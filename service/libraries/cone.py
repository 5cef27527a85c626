"""The two diameters of a tapered mill: of its end, as tools state it, and of the tip of its cone, as libraries do.

The corner circle of radius r has its centre at the radius d/2 - r, at the height r. The side of the cone leans by the
angle a and touches the circle, so it is r from the centre. At the height 0 its radius is

    d/2 - r + r (1 / cos a - tan a) = d/2 - r + r (1 - sin a) / cos a

and twice that is the diameter of the tip. For a ball, d = 2 r, it is 2 r (1 - sin a) / cos a.
"""

from __future__ import annotations

import math


def cone_tip_diameter(diameter: float, corner_radius: float, taper_deg: float) -> float:
    """Diameter, mm, at which the cone of a tapered mill would end without its rounding.

    diameter, corner_radius : mm, of the end of the tool: of its ball, or of the flat with the corners on both sides
    taper_deg               : deg, of one side to the axis

    >>> round(cone_tip_diameter(2.0, 1.0, 3.8), 3)
    1.872
    """
    return diameter - 2.0 * corner_radius * (1.0 - _share(taper_deg))


def end_diameter(tip_diameter: float, corner_radius: float, taper_deg: float) -> float:
    """Diameter, mm, of the end of a tapered mill from that of the tip of its cone; inverse of ``cone_tip_diameter``.

    >>> round(end_diameter(1.8716, 1.0, 3.8), 3)
    2.0
    """
    return tip_diameter + 2.0 * corner_radius * (1.0 - _share(taper_deg))


def _share(taper_deg: float) -> float:
    angle = math.radians(taper_deg)
    return (1.0 - math.sin(angle)) / math.cos(angle)
