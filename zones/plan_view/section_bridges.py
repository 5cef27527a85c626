"""Bridges of an interrupted side: a cubic that leaves both ends in their own directions.

A straight chord puts the turn of the stretch it replaces into its two corners, and an arc with corners is not round any
more (figures in docs/theory/profiles.md).
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64

# Where an end and the chord differ by more than this (rad), the bridge is the chord: such ends have no direction to
# continue. One point for each step of turn (rad).
MAX_TURN, STEP = 1.0, 0.05


def bridge(before: F64, after: F64, reach: float) -> F64:
    """Points between the end of one polyline and the start of the next.

    before, after : (n, 2) and (m, 2) float64, mm, in plan of the access frame, in walking order, two points or more;
                    the ends do not touch
    reach         : mm, length before an end over which its direction is taken

    Returns
    -------
    (k, 2) float64, mm, in plan
        Without both ends; no point where the ends lie in line or where the bridge is the chord. The error on a
        circle bridged over 90 degrees is 0.03 % of the chord and 0.1 degrees, besides the error of the nodes.
    """
    p, q = before[-1], after[0]
    chord = q - p
    far = float(np.linalg.norm(chord))
    leave, enter = -direction(before[::-1], reach), direction(after, reach)
    off = np.array([_angle(leave, chord), _angle(chord, enter)])
    if np.abs(off).max() > MAX_TURN:
        return np.zeros((0, 2))
    # With this speed the cubic follows an arc that turns by ``off`` at either end.
    speed = 2.0 * far / (1.0 + float(np.cos(off).mean()))
    steps = max(1, int(np.ceil(np.abs(off).sum() / STEP)))
    t = (np.arange(1, steps) / steps)[:, None]
    return np.asarray(p * (2 * t**3 - 3 * t**2 + 1) + q * (3 * t**2 - 2 * t**3)
                      + speed * (leave * (t**3 - 2 * t**2 + t) + enter * (t**3 - t**2)))


def direction(points: F64, reach: float) -> F64:
    """Unit direction at the first point of a polyline: that of the parabola nearest to its nodes within ``reach``.

    points : (n, 2) float64, mm, in plan of the access frame, two or more
    reach  : mm; at least three nodes count, where there are three

    Returns (2,) float64, dimensionless, in plan.
    """
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    s = np.cumsum(length)
    count = max(2, int(np.searchsorted(s, reach)) + 1)
    s, length, off = s[:count], length[:count], points[1:count + 1] - points[0]
    # Weights by length, so that crowded nodes count no more than others.
    weight = np.sqrt(length)[:, None]
    powers = np.column_stack([s, s * s])[:, :len(s)]
    slope = np.linalg.lstsq(weight * powers, weight * off, rcond=None)[0][0]
    return np.asarray(slope / max(float(np.linalg.norm(slope)), 1e-30))


def _angle(a: F64, b: F64) -> float:
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


__all__ = ["bridge", "direction"]
