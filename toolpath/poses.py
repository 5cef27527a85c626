"""Poses: tips with a tool axis each, and places between them.

Arrays are float64. Tips are in mm, axes dimensionless unit vectors from tip to spindle, both in the access frame.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64

Axes = Callable[[F64, F64, F64], F64]
"""Tool axes (k, 3), unit, at contacts (k, 3), mm, with normals and directions along the pass, (k, 3), both unit."""

Blocked = Callable[[F64, F64], NDArray[np.bool_]]
"""Whether a tool enters something, (k,) bool, with its tip at (k, 3), mm, and unit axes (k, 3)."""


def angles_between(axis: F64) -> F64:
    """Angles between neighbouring axes, (k - 1,) float64, rad.

    axis : (k, 3) float64, unit, access frame
    """
    cross = np.linalg.norm(np.cross(axis[1:], axis[:-1]), axis=1)
    return np.asarray(np.arctan2(cross, (axis[1:] * axis[:-1]).sum(axis=1)))


def places_along(tips: F64, axes: F64, reach: float, spacing: float) -> F64:
    """Poses with fractions between, (m,) float64, index, at most ``spacing`` mm apart at the tip and ``reach`` mm up
    the axis.

    tips, axes : (n, 3) float64, mm and unit, access frame
    """
    gone = np.maximum(*(np.linalg.norm(np.diff(tips + h * axes, axis=0), axis=1) for h in (0.0, reach)))
    counts = np.maximum(np.ceil(gone / spacing), 1).astype(int).tolist()
    return np.concatenate([[0.0], *(k + np.arange(1, n + 1) / n for k, n in enumerate(counts))])


def between(tips: F64, axes: F64, places: F64) -> tuple[F64, F64]:
    """Tips and axes at fractional poses: tips straight between poses, axes evenly on the great circle [Shoemake1985].

    tips, axes : (n, 3) float64, mm and unit, access frame
    places     : (m,) float64, index of poses with fractions, as ``places_along`` gives them

    Returns both as (m, 3) float64, mm and unit, access frame.
    """
    k = np.clip(places.astype(np.int64), 0, max(len(tips) - 2, 0))
    share = (places - k)[:, None]
    after = np.minimum(k + 1, len(tips) - 1)
    a, b = axes[k], axes[after]
    turn = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        before, beyond = (np.where(turn > 1e-6, np.sin(s * turn) / np.sin(turn), s) for s in (1.0 - share, share))
    axis = before * a + beyond * b
    return (1.0 - share) * tips[k] + share * tips[after], axis / np.linalg.norm(axis, axis=1, keepdims=True)
