"""Parallel projection of the setup frame onto a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64


@dataclass(frozen=True, eq=False)
class Camera:
    """Looks along ``-toward``; right-handed rows (right, up, toward) and a scale.

    basis  : (3, 3) float64, unit rows right, up, toward the viewer
    centre : (3,) float64, mm, the point in the middle of the picture
    scale  : pixels per mm
    size   : width and height, pixels
    """

    basis: F64
    centre: F64
    scale: float
    size: tuple[int, int]

    @classmethod
    def fit(cls, points: F64, size: tuple[int, int], *, azimuth: float, elevation: float,
            margin: float = 0.08) -> Camera:
        """The camera that shows all points.

        points             : (n, 3) float64, mm, setup frame
        azimuth, elevation : rad, direction of the viewer, from +X and from the XY plane
        margin             : share of the picture left free on each side
        """
        ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
        basis = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
        q = np.asarray(points, dtype=np.float64) @ basis.T
        low, high = q.min(axis=0), q.max(axis=0)
        span = np.maximum(high - low, 1e-9)
        scale = (1.0 - 2.0 * margin) * float(min(size[0] / span[0], size[1] / span[1]))
        return cls(basis, 0.5 * (low + high) @ basis, scale, size)

    def screen(self, points: F64) -> F64:
        """Points as pixels to the right, pixels down, pixels towards the viewer.

        points : (..., 3) float64, mm, setup frame

        Returns (..., 3) float64, pixels.
        """
        q = (np.asarray(points, dtype=np.float64) - self.centre) @ self.basis.T * self.scale
        return q * [1.0, -1.0, 1.0] + [0.5 * self.size[0], 0.5 * self.size[1], 0.0]

    def places(self, screen: F64) -> F64:
        """The inverse of ``screen``.

        screen : (..., 3) float64, pixels

        Returns (..., 3) float64, mm, setup frame.
        """
        q = (np.asarray(screen, dtype=np.float64) - [0.5 * self.size[0], 0.5 * self.size[1], 0.0]) * [1.0, -1.0, 1.0]
        return q / self.scale @ self.basis + self.centre
