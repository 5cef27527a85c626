"""Sizes of the cutting part of a tool, as kernels take them in one argument."""

from __future__ import annotations

from typing import NamedTuple


class CutterSizes(NamedTuple):
    """A cutting part, in the frame of the tool: tip at the origin, axis Z towards the spindle.

    radius : float, mm
    corner : float, mm, width of the corner between the flat end and the side: the radius for a ball or a point, 0 for a
             flat end
    length : float, mm, flute length; the cutting part ends so high above the tip
    cone   : float, mm, height of a straight corner, so that the end is a cone; 0 for a round one, as high as wide
    round  : float, mm, radius of the arc between the flat end and a straight corner, tangent to both; 0 for an edge
    taper  : float, tangent of the angle between the axis and a straight corner that such an arc begins; else 0
    """

    radius: float
    corner: float
    length: float
    cone: float = 0.0
    round: float = 0.0
    taper: float = 0.0
