"""Four-sided regions for re-parameterisations: smooth, moderate, severe, and one with a step in its top."""

from __future__ import annotations

import numpy as np

from geometry.parameterization.quad_grid import Quad


def region(bump: float, notch: float, step: float = 0.0, size: float = 1.0) -> tuple[np.ndarray, ...]:
    """Bottom, right, top, left of a region of about ``size`` mm: a bump into it from below, a notch in its top, curved
    sides, and a step down by ``step`` in its top."""
    t = np.linspace(0.0, 1.0, 801)

    def hill(at: float, wide: float) -> np.ndarray:
        h = np.exp(-(((t - at) / wide) ** 2))
        return h - h[0] * (1 - t) - h[-1] * t

    bottom = np.column_stack([t, bump * hill(0.5, 0.12)])
    top = np.column_stack([t, 1.0 + notch * hill(0.35, 0.1)])
    right, left = np.column_stack([1.0 + 0.06 * np.sin(np.pi * t), t]), np.column_stack([-0.06 * np.sin(np.pi * t), t])
    if step:
        after = t > 0.7
        top[after, 1] -= step
        top = np.insert(top, int(np.flatnonzero(after)[0]), [top[after][0, 0], top[~after][-1, 1]], axis=0)
        right = right * [1.0, 1.0 - step]
    return tuple(size * side for side in (bottom, right, top[::-1], left[::-1]))


def quad(name: str, n: int, m: int) -> Quad:
    """A smooth (A), moderate (M) or severe (B) region as sides of n and m places."""
    return Quad.of(region(**{"A": {"bump": 0.0, "notch": 0.05}, "M": {"bump": 0.2, "notch": -0.17},
                             "B": {"bump": 0.35, "notch": -0.28, "step": 0.12}}[name]), n, m)  # type: ignore[arg-type]
