"""Parts and places that the tests of several strategies use."""

from __future__ import annotations

import numpy as np

from tests.hand_parts import samples_of
from zones.reach.tip_field import touchable

CHORD = 0.003
WALLS = [((5.0, 2.0), (7.0, 12.0)), ((15.0, 2.0), (17.0, 12.0))]  # plan of ``walls()``, whose plate is at z = 3


def kind(body):
    return body.kind


def reached(field, mesh, keep, density=12.0):
    """Points and admissible tips of the samples that ``keep`` picks and the tool touches."""
    s = samples_of(mesh, density)
    s = s.subset(keep(s))
    _, by_tool, tips = touchable(field, s.points, s.normals, 0.002)
    return s.points[by_tool], tips[by_tool]


def from_walls(xy):
    """Distance (n,) mm in plan from ``WALLS``."""
    off = [np.hypot(*np.maximum(np.maximum(np.array(lo) - xy, xy - np.array(hi)), 0.0).T) for lo, hi in WALLS]
    return np.min(off, axis=0)


def underside(rho, body):
    """Height (n,) of the bottom of a cutter above its tip, mm; infinite outside its radius."""
    u = np.maximum(rho - (body.radius - body.corner_radius), 0.0)
    rise = body.corner_radius - np.sqrt(np.maximum(body.corner_radius**2 - u * u, 0.0))
    return np.where(rho <= body.radius, rise, np.inf)
