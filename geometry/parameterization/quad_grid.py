"""Grids on four-sided regions of a plane: their boundaries, evenness and folds. All places lie in the plane, in mm.

Notation
    xi, eta  : coordinates of the unit square; grid[j, i] is the place (mm) at xi = i / (n - 1), eta = j / (m - 1)
    bottom, top : sides eta = 0 and 1, along xi; left, right : sides xi = 0 and 1, along eta
A region lies to the left of its bottom: the sides run round it counterclockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.errors import GeometryError
from geometry.mesh import F64

SAME = 1e-9  # of the size of a region: ends of sides within this distance are one corner


@dataclass(frozen=True, eq=False)
class Quad:
    """A region between four sides.

    bottom, top : (n, 2) float64, mm, from left to right; left, right : (m, 2) float64, mm, from bottom to top
    """

    bottom: F64
    top: F64
    left: F64
    right: F64

    @classmethod
    def of(cls, sides: tuple[F64, F64, F64, F64], n: int, m: int) -> Quad:
        """Sides of n and m places, evenly along their length.

        sides : bottom, right, top, left as polylines (k, 2) float64, mm, in one plane, each beginning where the one
                before ends

        Raises
        ------
        GeometryError
            Code 'bad_quad': a side does not begin where the one before it ends, or has no length.
        """
        size = max(float(np.ptp(s, axis=0).max()) for s in sides)
        for k, side in enumerate(sides):
            gap = float(np.linalg.norm(side[-1] - sides[(k + 1) % 4][0]))
            if gap > SAME * size or np.linalg.norm(np.diff(side, axis=0), axis=1).sum() <= SAME * size:
                raise GeometryError(f"side {k + 1} ends {gap:g} mm from where the next begins, or "
                                    "has no length", code="bad_quad", subjects=(f"side {k + 1}",), measured=gap,
                                    limit=SAME * size)
        bottom, right, top, left = (even(s, count) for s, count in zip(sides, (n, m, n, m), strict=True))
        top, left = top[::-1].copy(), left[::-1].copy()
        for a, b in ((left, bottom), (left[::-1], top), (right, bottom[::-1]), (right[::-1], top[::-1])):
            a[0] = b[0]
        return cls(bottom, top, left, right)

    @property
    def shape(self) -> tuple[int, int]:
        """Places along eta and along xi."""
        return len(self.left), len(self.bottom)

    def frame(self) -> F64:
        """(m, n, 2) float64, mm: a grid in the plane with its sides filled in and NaN inside."""
        out = np.full((*self.shape, 2), np.nan)
        out[0], out[-1], out[:, 0], out[:, -1] = self.bottom, self.top, self.left, self.right
        return out


def even(line: F64, count: int) -> F64:
    """(count, d) float64, mm: places at even distances along a polyline, its ends included.

    line : (k, d) float64, mm, any frame
    """
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, way[-1], count)
    out = np.column_stack([np.interp(at, way, column) for column in line.T])
    out[0], out[-1] = line[0], line[-1]
    return out


def coons(quad: Quad) -> F64:
    """(m, n, 2) float64, mm, in the plane: the linear blend of the sides, less that of the corners [Coons1967]."""
    m, n = quad.shape
    x, y = np.linspace(0, 1, n)[None, :, None], np.linspace(0, 1, m)[:, None, None]
    across = (1 - y) * quad.bottom + y * quad.top
    along = (1 - x) * quad.left[:, None] + x * quad.right[:, None]
    a, b, c, d = quad.bottom[0], quad.bottom[-1], quad.top[0], quad.top[-1]
    return np.asarray(across + along - ((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)))


def corner_jacobians(grid: F64) -> F64:
    """(m - 1, n - 1, 4) float64, mm²: cross products of the two sides of each cell at each of its corners.

    grid : (m, n, 2) float64, mm, in the plane
    """
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack([_cross(b - a, d - a), _cross(c - b, a - b), _cross(d - c, b - c), _cross(a - d, c - d)], axis=-1)


def folds(grid: F64) -> int:
    """Count of the cells with a corner at which they are turned over or flat.

    grid : (m, n, 2) float64, mm, in the plane
    """
    return int((corner_jacobians(grid) <= 0.0).any(axis=2).sum())


def areas(grid: F64) -> F64:
    """(m - 1, n - 1) float64, mm²: areas of the cells of a grid, (m, n, 2) float64, mm, in the plane."""
    return np.asarray(0.5 * _cross(grid[1:, 1:] - grid[:-1, :-1], grid[1:, :-1] - grid[:-1, 1:]))


def evenness(grid: F64) -> tuple[float, float]:
    """Largest over smallest area of a cell, and of the distance between neighbouring eta-curves; inf where it folds.

    grid : (m, n, 2) float64, mm, in the plane

    Returns two ratios, dimensionless.
    """
    if folds(grid):
        return np.inf, np.inf
    area, gap = areas(grid), np.linalg.norm(np.diff(grid, axis=0), axis=2)
    return float(area.max() / area.min()), float(gap.max() / gap.min())


def _cross(u: F64, v: F64) -> F64:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
