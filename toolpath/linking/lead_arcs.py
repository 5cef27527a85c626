"""Lead arcs: a pass along a wall begins and ends on a quarter of a circle that touches the wall.

Where a tool stops on a wall it springs back and leaves a mark as deep as its deflection. On an arc its load changes
gradually, and it turns to the next pass off the wall. The circle lies square to the tool. With the unit tangent u of
the pass and the unit direction w off the wall, both square to the tool, the arc onto a place p is

    p + r ((1 - cos a) w - sin a u),    a from 90 degrees to 0

So the tool begins r off the wall and r before the pass, and reaches p along u. Its chords lie under the arc by at most
r (1 - cos (da / 2)). Places are in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from geometry.mesh import F64
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

SIZES = (0.12, 0.25, 0.5)  # radii in diameters of the tool: the smallest that gets it off the stock of the wall
MIN_RADIUS = 0.05  # mm
LEVEL_SHARE = 0.9  # level share of the length: a steeper upright pass has no arcs
BESIDE = 0.05  # mm off a pass, where the tool meets a wall along it


def radii(diameter: float, length: float) -> list[float]:
    """Radii of arcs to try, mm, for a pass of a length, mm: both arcs together are no longer than the pass."""
    sizes = (share * diameter for share in SIZES)
    return [r for r in sizes if r >= MIN_RADIUS and math.pi * r <= length]


def arc_onto(start: F64, ahead: F64, off: F64, radius: float, chord: float) -> F64:
    """A quarter of a circle onto the beginning of a pass.

    start  : (3,) float64, mm, access frame, beginning of the pass
    ahead  : (3,) float64, unit, access frame, along the pass there
    off    : (3,) float64, unit, access frame, square to that, away from the wall
    radius : mm
    chord  : mm, largest distance of its chords from it

    Returns
    -------
    (n, 3) float64, mm, access frame, from off the wall to ``start``
    """
    most = 2.0 * math.acos(max(1.0 - chord / radius, 0.0))
    a = np.linspace(0.5 * math.pi, 0.0, max(4, math.ceil(0.5 * math.pi / most)) + 1)[:, None]
    out = start + radius * ((1.0 - np.cos(a)) * off - np.sin(a) * ahead)
    out[-1] = start
    return np.ascontiguousarray(out)


def arcs_along(field: TipField, at: F64, way: F64, length: float, chord: float) -> Iterator[F64]:
    """Level arcs to try onto an end of a pass of an upright tool, the smallest first.

    field  : TipField; where a wall is beside the end, arcs lead off it, else to both sides
    at     : (3,) float64, mm, access frame, the end
    way    : (3,) float64, mm, access frame, along the pass there, away from the arc
    length : mm, of the pass
    chord  : mm, largest distance of chords from an arc

    Yields
    ------
    (n, 3) float64, mm, access frame, ending at ``at``; none where the pass goes up or down
    """
    run = float(np.hypot(*way[:2]))
    if run < LEVEL_SHARE * float(np.linalg.norm(way)) or run <= 0.0:
        return
    ahead = np.array([way[0], way[1], 0.0]) / run
    sides = np.array([[-ahead[1], ahead[0], 0.0], [ahead[1], -ahead[0], 0.0]])
    met = field.blocked_by_cutter(at + BESIDE * sides + [0.0, 0.0, LEVEL_TOLERANCE])
    for radius in radii(field.tool.diameter, length):
        for off in sides[~met]:
            yield arc_onto(at, ahead, off, radius, chord)
