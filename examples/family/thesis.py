"""The three test surfaces of [Jain2016], tables 4.2 to 4.4: 5 by 5 control points over 50 mm by 50 mm, order 4.

Row 0 of the tables for the concave and the convex surface has misprints (x = 37 for 37.5, and misplaced points). The
surfaces are symmetric, which shows the right values; corrected, their facets have the areas in the thesis. The table of
the freeform surface has two rows that look misprinted, 0 and 3. The right values are unknown, so it is used as printed.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from geometry.mesh import F64
from geometry.surfaces.nurbs import NurbsSurface

STEP = 12.5


class ThesisSurface(StrEnum):
    """The surfaces."""

    CONCAVE = "concave"
    CONVEX = "convex"
    FREEFORM = "freeform"


# Heights of P_ij: row i at y = 12.5 i, column j at x = 12.5 j.
_CONVEX = 15.0 + 2.5 * np.minimum(np.arange(5), 4 - np.arange(5))
_HEIGHTS = {
    ThesisSurface.CONVEX: np.add.outer(_CONVEX - 15.0, _CONVEX),
    ThesisSurface.CONCAVE: 40.0 - np.add.outer(_CONVEX - 15.0, _CONVEX),
    ThesisSurface.FREEFORM: np.add.outer(_CONVEX - 15.0, _CONVEX),
}
# As printed: the third and fourth point of row 0, and the first of row 3, which is also the first of row 4.
_PRINTED = {(0, 2): (37.5, 0.0, 17.5), (0, 3): (37.0, 0.0, 25.0), (3, 0): (0.0, 50.0, 15.0)}


def surface(kind: ThesisSurface | str) -> NurbsSurface:
    """One of the surfaces of [Jain2016], with its material below it.

    kind : ThesisSurface or its value

    Returns NurbsSurface, mm; u runs along y and v along x, both from 0 to 2.
    """
    return NurbsSurface.from_control_points(control_points(ThesisSurface(kind)), 4, side=-1)


def control_points(kind: ThesisSurface) -> F64:
    """The control points P_ij of [Jain2016], corrected as the module docstring says.

    Returns (5, 5, 3) float64, mm, part frame.
    """
    y, x = np.meshgrid(STEP * np.arange(5), STEP * np.arange(5), indexing="ij")
    points = np.stack([x, y, _HEIGHTS[kind]], axis=-1)
    if kind is ThesisSurface.FREEFORM:
        for place, printed in _PRINTED.items():
            points[place] = printed
    return points
