"""Points in nested balls, to find those near a tool of any tilt. Coordinates are float64, mm, in the setup frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64

LEAF = 8
FAN = 8
CHUNK = LEAF * FAN**3
BITS = 16


@dataclass(frozen=True, eq=False)
class PointTree:
    """Points along a Z-order curve [Morton1966], in chunks of 4096, each a tree of balls of 512, 64 and 8 points.

    order : (n,) int64, index, numbers of the points along the curve
    balls : four (k, 4) float64 tables, centre and radius in mm of the balls of 8, 64, 512 and 4096 points in that
            order, whole chunks; radius -1 where a ball is empty
    """

    order: NDArray[np.int64]
    balls: tuple[F64, F64, F64, F64]

    @classmethod
    def build(cls, points: F64) -> PointTree:
        """Sort points along the curve of [Morton1966] and enclose them in balls.

        points : (n, 3) float64, mm, any frame; n may be 0
        """
        order = np.argsort(curve_keys(points), kind="stable")
        chunks = -(-len(points) // CHUNK)
        padded = np.full((chunks * CHUNK, 3), np.nan)
        padded[:len(points)] = points[order]
        return cls(order, tuple(_balls(padded, LEAF * FAN**level) for level in range(4)))  # type: ignore[arg-type]

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return len(self.balls[3])


def curve_keys(points: F64) -> NDArray[np.uint64]:
    """Places of points on a Z-order curve of 2^16 cells a side round them: interleaved bits [Morton1966].

    points : (n, 3) float64, mm, any frame

    Returns (n,) uint64, index.
    """
    if len(points) == 0:
        return np.zeros(0, np.uint64)
    lower = points.min(axis=0)
    size = max(float((points.max(axis=0) - lower).max()), 1e-9)
    cells = np.minimum((points - lower) / size * 2**BITS, 2**BITS - 1).astype(np.uint64)
    for shift, mask in ((16, 0x0000FF0000FF), (8, 0x00F00F00F00F), (4, 0x0C30C30C30C3), (2, 0x249249249249)):
        cells = (cells | (cells << np.uint64(shift))) & np.uint64(mask)
    return np.asarray(cells[:, 0] << np.uint64(2) | cells[:, 1] << np.uint64(1) | cells[:, 2])


def _balls(padded: F64, size: int) -> F64:
    groups = padded.reshape(-1, size, 3)
    out = np.full((len(groups), 4), -1.0)
    full = ~np.isnan(groups[:, 0, 0])
    own = groups[full]
    middle = 0.5 * (np.nanmin(own, axis=1) + np.nanmax(own, axis=1))
    out[full, :3] = middle
    out[full, 3] = np.sqrt(np.nanmax(((own - middle[:, None, :]) ** 2).sum(axis=2), axis=1))
    return out
