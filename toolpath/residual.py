"""What passes leave at samples of a zone, so that the planner can put passes in where it is too much."""

from __future__ import annotations

import copy

import numpy as np

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.kernels.residual import LEVEL_PLANE, UPRIGHT, lower

LEAST_MARGIN = 0.02  # mm
UNTOUCHED = 1e3  # mm, residual of a sample no pass came near


class ResidualMap:
    """Residual material at samples, lowered pass by pass.

    points   : (n, 3) float64, mm; normals : (n, 3) float64 unit
    margin   : mm, a cutter farther than this counts as not having come near
    residual : (n,) float64, mm, distance to the nearest swept cutting part so far
    """

    def __init__(self, points: F64, normals: F64, cell: float = 0.6, margin: float = LEAST_MARGIN) -> None:
        self.points = np.ascontiguousarray(points)
        upright = np.abs(normals[:, 2]) < 0.5
        self.level = np.where(normals[:, 2] > 1.0 - 1e-6, LEVEL_PLANE, np.where(upright, UPRIGHT, 0))
        self.residual = np.full(len(points), UNTOUCHED)
        self.cell, self.margin = cell, max(margin, LEAST_MARGIN)
        lo = points[:, :2].min(axis=0) if len(points) else np.zeros(2)
        hi = points[:, :2].max(axis=0) if len(points) else np.zeros(2)
        self.origin = lo
        self.ncx, self.ncy = (np.floor((hi - lo) / cell).astype(int) + 1).tolist()
        key = np.zeros(0, np.int64)
        if len(points):
            c = np.floor((points[:, :2] - lo) / cell).astype(np.int64)
            key = c[:, 1] * self.ncx + c[:, 0]
        self.items = np.argsort(key, kind="stable")
        self.starts = np.searchsorted(key[self.items], np.arange(self.ncx * self.ncy + 1))

    def copied(self) -> ResidualMap:
        """The same, to be lowered on its own."""
        out = copy.copy(self)
        out.residual = self.residual.copy()
        return out

    def cut(self, path: F64, tool: ToolBody) -> None:
        """Lower the residual by one polyline of tips (m, 3), mm."""
        lower(self.points, self.level, self.starts, self.items, self.origin[0], self.origin[1], self.cell, self.ncx,
              self.ncy, np.ascontiguousarray(path), tool.flute_length, tool.radius, tool.corner_radius, self.margin,
              self.residual)
