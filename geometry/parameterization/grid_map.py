"""A grid on a region of the parameters of a surface, as a smooth map of the unit square.

Notation
    xi, eta : coordinates of the unit square, eta across the passes; (u, v) : parameters of the surface
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import RectBivariateSpline

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.parameterization.quad_grid import corner_jacobians

FINER = 4  # places a cell, each way, at which the map is checked for folds
STRAIGHT = 0.05  # of the mean: largest flatness allowed at a corner of the square where the border goes straight on


@dataclass(frozen=True, eq=False)
class GridMap:
    """Bicubic splines through a grid: u and v over (eta, xi).

    low, high : (2,), xi and eta of the splines between which the unit square lies
    """

    u: RectBivariateSpline
    v: RectBivariateSpline
    low: tuple[float, float] = (0.0, 0.0)
    high: tuple[float, float] = (1.0, 1.0)

    @classmethod
    def of(cls, grid: F64) -> GridMap:
        """The map through a grid of parameters.

        grid : (m, n, 2) float64, dimensionless, (u, v) in the plane of the parameters; m and n at least 4,
               counterclockwise

        Raises
        ------
        GeometryError
            Code 'folded': the grid, or the spline between its places, turns over somewhere.
        """
        m, n = grid.shape[:2]
        eta, xi = np.linspace(0.0, 1.0, m), np.linspace(0.0, 1.0, n)
        out = cls(*(RectBivariateSpline(eta, xi, grid[:, :, c]) for c in (0, 1)))
        turn = corner_jacobians(grid)
        for j, i, c in ((0, 0, 0), (0, -1, 1), (-1, -1, 2), (-1, 0, 3)):
            turn[j, i, c] += STRAIGHT * np.abs(turn).mean()
        count = int((turn <= 0.0).any(axis=2).sum())
        if not count:
            a, b = np.meshgrid(np.linspace(0.0, 1.0, FINER * (n - 1) + 1), np.linspace(0.0, 1.0, FINER * (m - 1) + 1))
            along, across = out.tangents(a.ravel(), b.ravel())
            fine = (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]).reshape(a.shape)
            fine[[0, 0, -1, -1], [0, -1, 0, -1]] += STRAIGHT * np.abs(fine).mean()
            count = int((fine <= 0.0).sum())
        if count:
            raise GeometryError(f"a grid on a region folds at {count} places", code="folded", measured=count, limit=0,
                                remedy="blend it with another, lay the region into the square, or split it")
        return out

    def __call__(self, xi: F64, eta: F64) -> F64:
        """Parameters at places of the unit square: (p, 2) float64, (u, v), dimensionless; xi, eta : (p,) float64."""
        x, y = self._within(xi, eta)
        return np.column_stack([self.u.ev(y, x), self.v.ev(y, x)])

    def tangents(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Derivatives of the parameters of the surface.

        xi, eta : (p,) float64, dimensionless, places of the unit square

        Returns those along xi and those along eta, both (p, 2) float64, dimensionless, in the plane of (u, v).
        """
        x, y = self._within(xi, eta)
        wide, tall = (b - a for a, b in zip(self.low, self.high, strict=True))
        along = np.column_stack([self.u.ev(y, x, dy=1), self.v.ev(y, x, dy=1)])
        return wide * along, tall * np.column_stack([self.u.ev(y, x, dx=1), self.v.ev(y, x, dx=1)])

    def part(self, low: F64, high: F64) -> GridMap:
        """The part of this map between two corners, as a map of the whole unit square.

        low, high : (2,) float64, dimensionless, xi and eta of the two corners in the unit square
        """
        x, y = self._within(*np.stack([low, high], axis=1))
        return replace(self, low=(float(x[0]), float(y[0])), high=(float(x[1]), float(y[1])))

    def _within(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        (a, c), (b, d) = self.low, self.high
        return a + (b - a) * xi, c + (d - c) * eta
