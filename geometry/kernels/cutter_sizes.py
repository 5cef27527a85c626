"""Sizes of the cutting part of a tool, as kernels take them in one argument."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from geometry.kernels.options import KERNEL


class CutterSizes(NamedTuple):
    """A cutting part, in the frame of the tool: tip at the origin, axis Z towards the spindle.

    radius : float, mm, largest radius; of a tapered mill at the end of its flutes
    corner : float, mm, width of the corner between the flat end and the side: the radius for a ball or a point, 0 for a
             flat end; of a tapered mill all that is wider than the flat end
    length : float, mm, flute length; the cutting part ends so high above the tip
    cone   : float, mm, height of a straight corner, so that the end is a cone; 0 for a round one, as high as wide. The
             side of a tapered mill is such a corner, as high as its flutes are long
    round  : float, mm, radius of the arc between the flat end and the side of a tapered mill, tangent to both; 0 for an
             edge
    taper  : float, dimensionless, tangent of the angle between the axis and the side of a tapered mill; else 0
    out, up, bow : float, mm, centre (distance from the axis, height) and radius of the upper arc of a circle segment
             mill, whose lower arc has the radius ``round``, and ends as high as ``cone``; ``up`` is 0 for other tools
    """

    radius: float
    corner: float
    length: float
    cone: float = 0.0
    round: float = 0.0
    taper: float = 0.0
    out: float = 0.0
    up: float = 0.0
    bow: float = 0.0


@njit(**KERNEL)
def sizes_of(cutters, k):
    """Row k of a table of sizes, (n, 9) float64, mm, as ``CutterSizes``."""
    return CutterSizes(cutters[k, 0], cutters[k, 1], cutters[k, 2], cutters[k, 3], cutters[k, 4], cutters[k, 5],
                       cutters[k, 6], cutters[k, 7], cutters[k, 8])


@njit(**KERNEL)
def widened(cutter, grow):
    """``CutterSizes`` of a cutting part with ``grow`` mm more radius everywhere, the shape of its corner as it was."""
    return CutterSizes(cutter.radius + grow, cutter.corner, cutter.length, cutter.cone, cutter.round, cutter.taper,
                       cutter.out + grow, cutter.up, cutter.bow)


@njit(**KERNEL)
def slope_of(cutter):
    """Tangent of the angle between the axis and a straight corner, dimensionless."""
    return cutter.taper if cutter.taper > 0.0 else cutter.corner / cutter.cone


@njit(**KERNEL)
def end_radius(cutter):
    """Radius of the end, mm: of a tapered mill as if its corner ended in an upright side."""
    return cutter.radius - cutter.corner + cutter.round if cutter.taper > 0.0 else cutter.radius


@njit(**KERNEL)
def corner_end(cutter):
    """Where the corner of a tapered mill ends and its side begins: distance from the axis and height, mm."""
    long = math.sqrt(1.0 + cutter.taper * cutter.taper)
    return (cutter.radius - cutter.corner + cutter.round / long, cutter.round * (1.0 - cutter.taper / long))


@njit(**KERNEL)
def side_height(cutter):
    """Height over the tip at which the corner ends and the side begins, mm."""
    if cutter.taper > 0.0:
        return corner_end(cutter)[1]
    return cutter.cone if cutter.cone > 0.0 else cutter.corner


@njit(**KERNEL)
def arcs_touch(cutter):
    """Where the two arcs of a circle segment mill touch: distance from the axis and height, mm."""
    flat, far = cutter.radius - cutter.corner, cutter.bow - cutter.round
    share = cutter.round / far
    return flat + (flat - cutter.out) * share, cutter.round + (cutter.round - cutter.up) * share
