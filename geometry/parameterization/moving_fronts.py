"""Re-parameterisation by boundary interpolation [Sarkar2015, equations 2.6 to 2.16], with corrections.

Two fronts start at opposite sides and move towards each other. Each point moves partly along its normal, and more and
more straight at the other front. A front moves faster out of its notches and slower off its peaks, so it smooths out.

As printed, the fronts may fail to meet, leave the other two sides, and bunch up in valleys. Three changes prevent this:
the correction of the step fades to 1 as the fronts approach; the ends stay on the sides, with their shift shared along
the front; and after every step the points are spread evenly along the front.
"""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64
from geometry.parameterization.quad_grid import Quad, even

SHARPNESS, POWER = 1.0, 50.0
"""gamma of equation 2.13 and p of 2.15. From 0.5 to 1, and from 50 to 100, the grids look the same."""
_T = math.tanh(math.pi**2 / 12.0)


def interpolated(quad: Quad, power: float = POWER, sharpness: float = SHARPNESS) -> F64:
    """The grid of a region by fronts from its bottom and its top [Sarkar2015, equations 2.6 to 2.16].

    Returns (m, n, 2) float64, mm, in the plane of the region.
    """
    m, n = quad.shape
    q = (m - 1) // 2 if m % 2 else m // 2 - 1
    grid, x = quad.frame(), np.linspace(0.0, 1.0, n)[:, None]
    low, high = quad.bottom.copy(), quad.top.copy()
    for j in range(1, q + 1):
        near = j / q
        f = near ** (((1.0 - near) / j) ** (power / 100.0)) if near < 1.0 else 1.0
        beta = 1.0 - j / (2.0 * q)
        between = high - low
        gap = np.linalg.norm(between, axis=1)
        straight = between / np.maximum(gap, 1e-300)[:, None]
        up, down = correction(_angles(low, 1.0), sharpness), correction(_angles(high, -1.0), sharpness)
        parts = 2 * (q - j) + (2 if m % 2 else 3)
        low_next, high_next = (
            front + (_faded(own * beta + other * (1.0 - beta), f) * gap / parts)[:, None]
            * _heading(front, side, straight, f)
            for front, side, own, other in ((low, 1.0, up, down), (high, -1.0, down, up)))
        low = _held(low_next, quad.left[j], quad.right[j], x)
        high = _held(high_next, quad.left[m - 1 - j], quad.right[m - 1 - j], x)
        if m % 2 and j == q:
            low = high = 0.5 * (low + high)
        grid[j], grid[m - 1 - j] = low, high
    return grid


def correction(angle: F64, sharpness: float = SHARPNESS) -> F64:
    """Factor on the speed of a place of a front, 1 where the front is straight [Sarkar2015, equation 2.13].

    angle : (n,) float64, rad, 0 to 2 pi, between the two edges of the front on the side it moves to

    Returns (n,) float64, dimensionless.
    """
    base = -np.tanh(angle**3 / (12.0 * np.pi)) + (angle - np.pi) / np.pi * (0.4 - _T) + 1.0 + _T
    return np.asarray(base**sharpness)


def _faded(alpha: F64, f: float) -> F64:
    return 1.0 + (alpha - 1.0) * (1.0 - f)


def _angles(front: F64, side: float) -> F64:
    """(n,) rad, the included angle on the left (side 1) or the right (-1) of a front (n, 2), mm; pi at its ends."""
    ahead, back = front[2:] - front[1:-1], front[:-2] - front[1:-1]
    turn = np.arctan2(side * (ahead[:, 0] * back[:, 1] - ahead[:, 1] * back[:, 0]), (ahead * back).sum(axis=1))
    return np.concatenate([[np.pi], np.mod(turn, 2.0 * np.pi), [np.pi]])


def _heading(front: F64, side: float, straight: F64, f: float) -> F64:
    """(n, 2) unit: the normal of a front (n, 2), mm, turned into the way to the other one as f goes to 1 (2.14).

    straight : (n, 2) unit, from the lower front to the upper one
    """
    edges = np.diff(front, axis=0)
    edges = edges / np.maximum(np.linalg.norm(edges, axis=1), 1e-300)[:, None]
    along = np.concatenate([edges[:1], edges[:-1] + edges[1:], edges[-1:]])
    normal = side * np.column_stack([-along[:, 1], along[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    way = (1.0 - f) * normal + f * side * straight
    length = np.linalg.norm(way, axis=1)[:, None]
    return np.where(length > 1e-12, way / np.maximum(length, 1e-300), side * straight)


def _held(front: F64, start: F64, end: F64, x: F64) -> F64:
    """A front (n, 2), mm, with its ends moved to start and end (2,), the shift shared along it, and even spacing."""
    return even(front + (1.0 - x) * (start - front[0]) + x * (end - front[-1]), len(front))
