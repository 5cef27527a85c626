"""The planner's picture of the stock: a height over the plan, lowered pass by pass.

It decides where something is left to cut and where a tool may come down in air. It errs only in time, never in
safety: the proof reads the finished program with a model of its own (``verify``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.drop import drop_grid
from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.kernels.stock import overlaps, stamp
from zones.reach import Lattice

SURE_RIM = 0.7  # lattice steps: half a cell diagonal
AIR_TOLERANCE = 0.01  # mm


class StockMap:
    """Top of the stock over a lattice.

    lattice : Lattice
    top     : (ny, nx) float64, mm; -inf where there is none
    """

    def __init__(self, lattice: Lattice, top: F64) -> None:
        self.lattice, self.top = lattice, np.ascontiguousarray(top)

    @classmethod
    def around(cls, tree: TriangleTree, bounds: F64, offset: float, step: float) -> StockMap:
        """Stock that stands ``offset`` mm off the part everywhere: the envelope of balls on its surface."""
        lat = Lattice.over(bounds, offset + 3 * step, step)
        r = max(offset, 1e-3)
        return cls(lat, drop_grid(tree, lat.x0, lat.y0, step, lat.nx, lat.ny, r, r) + r)

    @classmethod
    def box(cls, lower: F64, upper: F64, step: float) -> StockMap:
        """A block between two corners (3,), mm."""
        lat = Lattice.over(np.array([lower, upper]), 3 * step, step)
        x = lat.x0 + step * np.arange(lat.nx)
        y = lat.y0 + step * np.arange(lat.ny)
        inside = ((y >= lower[1]) & (y <= upper[1]))[:, None] & ((x >= lower[0]) & (x <= upper[0]))[None, :]
        return cls(lat, np.where(inside, upper[2], -np.inf))

    def cut(self, points: F64, tool: ToolBody) -> None:
        """Take away what the cutting part sweeps along a polyline of tips (n, 3), mm."""
        lat = self.lattice
        stamp(self.top, lat.x0, lat.y0, lat.step, np.ascontiguousarray(points), tool.radius, tool.corner_radius)

    def overlap(self, tips: F64, tool: ToolBody, rim: float = -0.8) -> F64:
        """(n,) float64, mm: how far stock stands above the cutter's bottom at tips (n, 3); <= 0 is air.

        rim : lattice steps added to the radius looked at; -0.8 overlooks the walls a cutter touches, 0.7 sees
              everything that may be there
        """
        out = np.empty(len(tips))
        lat = self.lattice
        overlaps(self.top, lat.x0, lat.y0, lat.step, np.ascontiguousarray(tips), tool.radius, tool.corner_radius,
                 rim * lat.step, out)
        return out

    def in_air(self, tips: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """(n,) bool: the cutting part is sure to touch neither stock nor part at tips (n, 3), mm."""
        return np.asarray(self.overlap(tips, tool, SURE_RIM) <= AIR_TOLERANCE)

    @property
    def highest(self) -> float:
        """Highest point of the stock, mm; -inf where there is none."""
        return float(self.top.max()) if self.top.size else float("-inf")
