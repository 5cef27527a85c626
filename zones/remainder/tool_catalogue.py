"""Sizes of tools on sale, and the lengths that a tool needs at a place.

Diameters and shanks are series of solid carbide mills in millimetres; lengths come in steps. The remainder and the
proposal take the sizes of tools to buy from here. Theory: docs/theory/tools.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_grid, drop_tips
from geometry.tool_body import ToolBody
from zones.lattice import Lattice
from zones.reach.assembly import Clearances, discs_of
from zones.reach.tip_field import LEVEL_TOLERANCE, LOOKUP_STEP

# mm, stout to thin; no proposal is thinner than the last
DIAMETERS = (40.0, 32.0, 25.0, 20.0, 16.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.2, 1.0, 0.8, 0.6, 0.5,
             0.4, 0.3, 0.2, 0.1)
# mm, for cutters up to the same diameter
SHANKS = (6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 25.0, 32.0, 40.0)
MAX_SLENDERNESS = 20.0  # neck length in diameters; no proposal is more slender
BULL_CORNER = 0.2  # corner radius of bull noses, in diameters
FLUTES = 3.0  # flute length in diameters, where the neck is as long
RELIEF = 0.05  # difference between the diameters of cutter and neck, in diameters
MIN_NECK = 1.0  # mm
NOSE_STEP = 0.8  # mm, grid of the heights that holders must clear


def catalogue(lengths: F64) -> F64:
    """Lengths on sale, none below the given ones: steps of 1 mm up to 20 mm, of 5 mm above.

    lengths : (k,) float64, mm

    Returns (k,) float64, mm.
    """
    step = np.where(lengths <= 20.0, 1.0, 5.0)
    return np.asarray(step * np.ceil(lengths / step - 1e-9))


def shank_of(diameter: float, at_hand: float) -> float:
    """Shank of a cutter to buy, mm: that of a tool at hand, unless such cutters are not sold on so thick a shank.

    >>> shank_of(2.5, 30.0), shank_of(2.5, 4.0), shank_of(16.0, 6.0)
    (6.0, 4.0, 16.0)
    """
    usual = next((s for s in SHANKS if s >= diameter), diameter)
    return max(diameter, min(at_hand, usual))


def sold(like: ToolBody, diameter: float, corner_radius: float) -> ToolBody:
    """A cutter of the series, mm, in the holder of a tool at hand, without its final lengths; its side is upright."""
    return replace(like, taper=0.0, form="", profile_radius=0.0, profile_taper=0.0, tip_diameter=0.0,
                   diameter=diameter, corner_radius=corner_radius, flute_length=FLUTES * diameter,
                   neck_diameter=(1.0 - RELIEF) * diameter, shank_diameter=shank_of(diameter, like.shank_diameter))


def nearest(tools: list[ToolBody], diameter: float) -> ToolBody:
    """The tool at hand with the nearest diameter (mm), by ratio."""
    return min(tools, key=lambda t: (abs(math.log(t.diameter / diameter)), t.id))


class Lengths:
    """Required lengths of necks and stickouts over obstacles.

    tree      : TriangleTree of part and fixtures, access frame
    bounds    : (2, 3) float64, mm, access frame, of the part
    clear     : Clearances
    allowance : mm, material left on the part; cusp : mm, height that passes may leave above that
    widest    : mm, diameter of the stoutest possible cutter
    """

    def __init__(self, tree: TriangleTree, bounds: F64, clear: Clearances, allowance: float, cusp: float,
                 widest: float) -> None:
        self.tree, self.clear, self.allowance, self.cusp = tree, clear, allowance, cusp
        self.lattice = Lattice.over(bounds, 0.5 * widest + 2 * NOSE_STEP, NOSE_STEP)
        self._heights: dict[float, F64] = {}

    def at(self, body: ToolBody, tips: F64, floor: tuple[float, float] = (0.0, 0.0)) -> F64:
        """Neck length and stickout that a tool needs, in catalogue steps, at least ``floor``.

        tips : (k, 3) float64, mm, access frame

        Returns (k, 2) float64, mm, along the axis of the tool frame.

        The visible length of a shank is at least its diameter. The search covers one cell of the shank and holder grid
        more than needed, so that the tool also passes that grid wherever its nodes lie.
        """
        spare = LOOKUP_STEP * math.sqrt(2.0)
        lift = self.allowance + self.cusp + 2 * LEVEL_TOLERANCE - tips[:, 2]
        wide = 0.5 * body.shank_diameter + self.clear.shank + self.allowance + spare
        neck = drop_tips(self.tree, tips[:, :2], wide, 0.0) + lift
        nose = np.full(len(tips), -np.inf)
        cells = self.lattice.cells(tips[:, :2])
        for d in discs_of(body, self.clear):
            if d.name == "holder":
                height = self._height(d.radius + self.allowance + spare + NOSE_STEP / math.sqrt(2.0))
                nose = np.maximum(nose, height[cells] + lift - (d.height - body.stickout))
        neck = np.maximum(catalogue(np.maximum(neck, MIN_NECK)), floor[0])
        return np.column_stack([neck, np.maximum(catalogue(np.maximum(nose, neck + body.shank_diameter)), floor[1])])

    def _height(self, radius: float) -> F64:
        """Highest obstacle within a radius of the nodes of the holder grid, mm."""
        if radius not in self._heights:
            g = self.lattice
            self._heights[radius] = drop_grid(self.tree, g.x0, g.y0, g.step, g.nx, g.ny, radius, 0.0)
        return self._heights[radius]
