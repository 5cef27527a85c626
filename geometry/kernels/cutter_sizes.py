"""Sizes of the cutting part of a tool, as kernels take them in one argument."""

from __future__ import annotations

from typing import NamedTuple


class CutterSizes(NamedTuple):
    """A cutting part, in the frame of the tool: tip at the origin, axis Z towards the spindle.

    radius : float, mm
    corner : float, mm, corner radius: the radius for a ball, 0 for a flat end
    length : float, mm, flute length; the cutting part ends so high above the tip
    """

    radius: float
    corner: float
    length: float
