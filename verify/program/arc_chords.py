"""Arcs and helices of a program as polylines.

Plane axes by G17/G18/G19: (X, Y), (Z, X), (Y, Z); G2 runs clockwise seen from the positive third axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from geometry.mesh import F64

CHORD = 1e-3
PLANE_AXES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}


class ArcError(ValueError):
    """An arc whose words contradict each other; the reader adds the line."""


class ArcTooLong(ArcError):
    """An arc that needs more points than allowed; ``points`` is their number."""

    def __init__(self, points: float) -> None:
        super().__init__(f"an arc of {points:.3g} points")
        self.points = points


def centre_from_radius(start: F64, end: F64, radius: float, clockwise: bool, axes: tuple[int, int, int]) -> F64:
    """Centre of an arc given by R, as in [Kramer2000]; a negative radius means the longer arc.

    start, end : (3,) float64, mm, coordinates of X, Y, Z
    radius     : mm
    axes       : axes of the plane and the third axis, as ``PLANE_AXES``

    Returns (2,) float64, mm, coordinates along the axes of the plane.

    Raises
    ------
    ArcError
        Both ends coincide, or are more than 2 R + 0.01 mm apart.
    """
    a, b = start[list(axes[:2])], end[list(axes[:2])]
    chord = b - a
    d = float(np.hypot(*chord))
    if d < 1e-9:
        raise ArcError("an arc given by R needs two different ends")
    if d > 2 * abs(radius) + 0.01:
        raise ArcError(f"radius {abs(radius):g} mm cannot span {d:g} mm")
    height = math.sqrt(max(radius * radius - d * d / 4, 0.0))
    side = 1.0 if clockwise == (radius < 0) else -1.0
    return np.asarray(0.5 * (a + b) + side * height * np.array([-chord[1], chord[0]]) / d)


def arc_points(start: F64, end: F64, centre: F64, clockwise: bool, axes: tuple[int, int, int], turns: int = 1,
               chord: float = CHORD, max_points: int = 200_000) -> F64:
    """Points of an arc or helix after its start.

    start, end : (3,) float64, mm, coordinates of X, Y, Z
    centre     : (2,) float64, mm, coordinates along the axes of the plane
    turns      : the P word: full turns begun
    chord      : mm, largest distance of the polyline from the arc; the points lie on the arc
    max_points : largest number of points

    Returns (k, 3) float64, mm, the last row equal to ``end``. Equal ends in the plane make a full circle.

    Raises
    ------
    ArcError
        The two radii differ by more than 0.01 mm and 0.1 %, or by 0.5 mm.
    ArcTooLong
        The arc needs more than ``max_points``; no memory is used before.

    Notes
    -----
    Sense, helix and turns are those of RS274/NGC [Kramer2000]. A chord of the angle a leaves a circle of radius r by
    r (1 - cos(a / 2)).
    """
    i, j, _ = axes
    sweep, middle = arc_sweep(start, end, centre, clockwise, axes, turns), (float(centre[0]), float(centre[1]))
    return swept_points(start.tolist(), end.tolist(), middle, sweep, axes, chord, max_points)


def arc_sweep(start: F64, end: F64, centre: F64, clockwise: bool, axes: tuple[int, int, int], turns: int = 1) -> float:
    """Signed angle of an arc, rad, counterclockwise positive.

    start, end, centre : (3,), (3,) and (2,) float64, mm, in the frame and plane of those of ``arc_points``
    clockwise, axes, turns : as those of ``arc_points``

    Raises
    ------
    ArcError
        The two radii differ by more than 0.01 mm and 0.1 %, or by 0.5 mm.
    """
    i, j, _ = axes
    u, v = start[[i, j]] - centre, end[[i, j]] - centre
    r0, r1 = float(np.hypot(*u)), float(np.hypot(*v))
    if r0 < 1e-9:
        raise ArcError("the centre of the arc lies on its start")
    if abs(r0 - r1) > min(max(0.01, 1e-3 * r0), 0.5):
        raise ArcError(f"start and end of the arc lie on circles of different radii, {r0:g} and {r1:g} mm "
                       f"({abs(r0 - r1):.4g} mm apart)")
    a0 = math.atan2(u[1], u[0])
    sweep = math.atan2(v[1], v[0]) - a0
    sweep = -((-sweep) % math.tau) if clockwise else sweep % math.tau
    if abs(sweep) < 1e-9 or abs(abs(sweep) - math.tau) < 1e-9:
        same = float(np.hypot(*(end[[i, j]] - start[[i, j]]))) < 1e-6
        sweep = (-math.tau if clockwise else math.tau) if same else sweep
    return sweep + (turns - 1) * (-math.tau if clockwise else math.tau)


def swept_points(start: Sequence[float], end: Sequence[float], centre: tuple[float, float], sweep: float,
                 axes: tuple[int, int, int], chord: float = CHORD, max_points: int = 200_000) -> F64:
    """Points of an arc or helix of a known angle after its start.

    start, end, centre : as those of ``arc_points``, as sequences
    sweep      : rad, signed, counterclockwise positive
    chord, max_points : as those of ``arc_points``

    Returns (k, 3) float64, mm, frame of ``start``, the last row equal to ``end``.

    Raises
    ------
    ArcTooLong
        The arc needs more than ``max_points``; no memory is used before.
    """
    i, j, k = axes
    u, v = (start[i] - centre[0], start[j] - centre[1]), (end[i] - centre[0], end[j] - centre[1])
    r0, r1 = float(np.hypot(*u)), float(np.hypot(*v))
    a0 = math.atan2(u[1], u[0])
    # 4 asin(sqrt(c / 2r)) is 2 acos(1 - c / r) without its loss of digits on large radii
    step = 4 * math.asin(math.sqrt(min(chord / max(r0, r1), 0.5) / 2))
    n = max(1, math.ceil(abs(sweep) / step))
    if n > max_points:
        raise ArcTooLong(n)
    f = np.arange(1, n + 1) / n
    radius = r0 + (r1 - r0) * f
    out = np.empty((n, 3))
    out[:, i] = centre[0] + radius * np.cos(a0 + sweep * f)
    out[:, j] = centre[1] + radius * np.sin(a0 + sweep * f)
    out[:, k] = start[k] + (end[k] - start[k]) * f
    out[-1] = end
    return out
