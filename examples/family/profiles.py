"""The ten profile types of [Arivazhagan2020], drawn from control points by hand-set rules.

A profile is the plan curve of a wall: a B-spline of order 5 through ten control points, chord from (0, 0) to (1, 0).
Open profiles have open uniform knots. Closed ones have periodic uniform knots and run counter-clockwise. A *bend* is a
longest run of one sign of curvature that turns by 20 degrees or more. With the free space on the left, an *up* bend
bulges towards it and a *down* bend away from it. Labels follow from the control polygon, not from the shape of the
curve; ``clear`` only refuses curves near the border of a class.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.interpolate import BSpline

from examples.family.splines import F64

ORDER, POINTS = 5, 10
UP, DOWN = 1, -1
WANTED_TURN, STRAY_TURN = 32.0, 8.0
LEVEL_SKEW, CLEAR_SKEW = 0.04, 0.155
ROUND_BEND, UNEVEN_BEND = 0.42, 0.50

_HALF = {
    # left halves of symmetric polygons; the right halves mirror them
    "C1": [(0, 0), (0.036, 0.03), (0.108, 0.091), (0.223, 0.176), (0.403, 0.245)],
    "C2": [(0, 0), (0.03, 0.033), (0.102, 0.114), (0.266, 0.121), (0.393, -0.062)],
    "C3": [(0, 0), (0.017, 0.052), (0.158, 0.093), (0.294, -0.072), (0.435, 0.128)],
    "C9": [(0, 0), (0.144, -0.005), (0.169, -0.14), (0.387, -0.157), (0.404, -0.089)],
    "C10": [(0, 0), (0.11, 0.117), (0.24, -0.094), (0.344, 0.171), (0.456, 0.03)],
}
_LEFT_HEAVY = [(0, 0), (0.011, 0.09), (0.086, 0.28), (0.29, 0.11), (0.374, 0.066), (0.53, 0.174), (0.667, -0.098),
               (0.869, 0.075), (0.975, 0.017), (1, 0)]
_TWO_LOBES = [(1.0, -0.6), (1.5, 0.0), (0.9, 0.7), (0.2, -0.35), (-0.3, 1.2), (-1.2, 1.0), (-1.6, 0.0), (-1.2, -1.0),
              (-0.2, -0.9), (0.5, 0.05)]

BENDS: dict[str | None, tuple[int, ...]] = {
    None: (), "C1": (UP,), "C2": (UP, DOWN, UP), "C3": (UP, DOWN) * 2 + (UP,), "C4": (DOWN,),
    "C7": (UP, DOWN) * 2 + (UP,), "C8": (UP, DOWN) * 2 + (UP,), "C9": (UP, DOWN) * 2 + (UP,),
    "C10": (UP, DOWN) * 3 + (UP,),
}
"""Bends of each open type, in the direction with the free space on the left."""

OTHER_SIDE: dict[str | None, str | None] = {
    None: None, "C1": "C4", "C2": "C1", "C3": "C2", "C4": "C1", "C5": "C5", "C6": "C6", "C7": "C2", "C8": "C2",
    "C9": "C2", "C10": "C3", "oval": "C4",
}
"""Type as seen from the other side, set by hand: ups become downs, and the number of ups decides first."""

OPEN_TYPES: tuple[str | None, ...] = (None, "C1", "C2", "C3", "C4", "C7", "C8", "C9", "C10")
CLOSED_TYPES = ("C5", "C6", "oval")


@dataclass(frozen=True, eq=False)
class DrawnProfile:
    """A drawn plan curve of one of the types of [Arivazhagan2020].

    type    : 'C1' to 'C10', 'oval' (closed and convex: C1 from outside, C4 from inside), None for straight
    control : (10, 2) float64, control points in mm; the free space of the left side lies on +y
    closed  : whether the curve closes; the left side is then the inner one
    """

    type: str | None
    control: F64
    closed: bool = False

    @property
    def labels(self) -> tuple[str | None, str | None]:
        """Profile types of the left and the right side, None for straight."""
        if self.type == "oval":
            return "C4", "C1"
        return self.type, OTHER_SIDE[self.type]

    @property
    def curve(self) -> BSpline:
        """The curve, parameter 0 to 1."""
        return spline(self.control, self.closed)

    def at(self, centre: tuple[float, float], turn: float = 0.0) -> DrawnProfile:
        """The profile turned by ``turn`` rad about the origin, which then moves to ``centre`` (mm)."""
        c, s = np.cos(turn), np.sin(turn)
        return DrawnProfile(self.type, self.control @ np.array([[c, s], [-s, c]]) + centre, self.closed)


def spline(control: F64, closed: bool = False) -> BSpline:
    """B-spline of order 5 on ten control points, parameter 0 to 1 [DeBoor1978].

    control : (10, d) float64, mm
    closed  : periodic uniform knots instead of open uniform ones (five zeros, 1/6 to 5/6, five ones)
    """
    degree = ORDER - 1
    if closed:
        knots = np.arange(-degree, POINTS + degree + 1) / POINTS
        return BSpline(knots, np.vstack([control, control[:degree]]), degree)
    inner = np.arange(1, POINTS - degree) / (POINTS - degree)
    return BSpline(np.concatenate([np.zeros(ORDER), inner, np.ones(ORDER)]), control, degree)


def draw_open(rng: Generator, kind: str | None, chord: float) -> DrawnProfile:
    """An open profile of a type of [Arivazhagan2020], its chord centred on the origin along x.

    kind  : 'C1', 'C2', 'C3', 'C4', 'C7', 'C8', 'C9', 'C10' or None for straight (a bow of 6 degrees at most)
    chord : mm
    """
    rise = float(rng.uniform(0.9, 1.15))
    noise = rng.uniform(-1, 1, (POINTS, 2)) * (0.002, 0.004)
    noise[[0, -1]] = 0.0
    if kind is None:
        control = np.array(_mirrored(_HALF["C1"])) * (1.0, float(rng.uniform(-0.06, 0.06)))
        noise *= 0.0
    elif kind in ("C7", "C8"):
        control = np.array(_LEFT_HEAVY, float)
        rise = float(rng.uniform(0.97, 1.06))
        noise *= 0.5
    elif kind == "C4":
        control = np.array(_mirrored(_HALF["C1"])) * (1.0, -1.0)
    else:
        control = np.array(_mirrored(_HALF[kind]))
    if kind == "C9":
        rise, noise = float(rng.uniform(0.98, 1.1)), 0.4 * noise
    control = (control + noise) * (1.0, rise)
    if kind == "C8":
        control = control[::-1] * (-1.0, 1.0) + (1.0, 0.0)
    return DrawnProfile(kind, (control - (0.5, 0.0)) * chord)


def draw_hairpin(rng: Generator, chord: float) -> DrawnProfile:
    """A single up bend of 150 to 175 degrees, legs down, its chord (mm) centred on the origin."""
    half = [(0, 0), (0.0, 0.25), (-0.01, 0.6), (0.06, 1.0), (0.3, 1.28)]
    control = np.array(_mirrored(half)) * (1.0, float(rng.uniform(0.85, 1.2)))
    return DrawnProfile("C1", (control - (0.5, 0.0)) * chord)


def draw_closed(rng: Generator, kind: str, radius: float) -> DrawnProfile:
    """A closed profile of a type of [Arivazhagan2020] around the origin, counter-clockwise.

    kind   : 'C5' five lobes, 'C6' two lobes of different size, 'oval' convex
    radius : mm, roughly half the size of the curve
    """
    turn = np.arange(POINTS) * 2 * np.pi / POINTS
    if kind == "C6":
        control = np.array(_TWO_LOBES) * 0.72 * (1.0 + 0.02 * rng.uniform(-1, 1, (POINTS, 2)))
    elif kind == "C5":
        reach = 1.0 + float(rng.uniform(0.55, 0.61)) * (-1.0) ** np.arange(POINTS)
        control = np.column_stack([np.cos(turn), np.sin(turn)]) * reach[:, None]
        control = control * (1.0 + 0.008 * rng.uniform(-1, 1, (POINTS, 2)))
    else:
        control = np.column_stack([np.cos(turn), np.sin(turn)]) * (1.0, float(rng.uniform(0.72, 1.0))) * 1.06
    return DrawnProfile(kind, control * radius, closed=True).at((0.0, 0.0), float(rng.uniform(0, 2 * np.pi)))


def _mirrored(half: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return half + [(1.0 - x, y) for x, y in half[::-1]]


def bends(points: F64, closed: bool = False) -> list[tuple[float, float]]:
    """Runs of one sign of curvature along a dense polyline.

    points : (n, 2) float64, mm, plan coordinates, evenly spaced; a closed line does not repeat the end point

    Returns for each run its turn in degrees (> 0 to the right: up) and the variation of its curvature, standard
    deviation
    over mean.
    """
    p = np.vstack([points[-1:], points, points[:1]]) if closed else points
    e = np.diff(p, axis=0)
    turn = np.arctan2(e[:-1, 1] * e[1:, 0] - e[:-1, 0] * e[1:, 1], (e[:-1] * e[1:]).sum(axis=1))
    length = np.linalg.norm(e, axis=1)
    curvature = turn / (0.5 * (length[:-1] + length[1:]))
    cut = np.flatnonzero(np.sign(turn[1:]) != np.sign(turn[:-1])) + 1
    runs = np.split(np.arange(len(turn)), cut)
    if closed and len(runs) > 1 and np.sign(turn[0]) == np.sign(turn[-1]):
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]
    spread = [float(curvature[r].std() / max(abs(curvature[r].mean()), 1e-12)) for r in runs]
    return [(float(np.degrees(turn[r].sum())), v) for r, v in zip(runs, spread, strict=True)]


def skew(points: F64) -> float:
    """Asymmetry of the area between a curve and its chord.

    points : (n, 2) float64, mm, coordinates in plan

    Returns the distance of its centroid to the right of the middle, as a share of the chord.
    """
    e = points[-1] - points[0]
    chord = float(np.hypot(*e))
    q = (points - points[0]) / chord
    x, y = q @ (e / chord), q @ (np.array([-e[1], e[0]]) / chord)
    dx, middle, height = np.diff(x), 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
    return float((middle * height * dx).sum() / (height * dx).sum() - 0.5)


def clear(kind: str | None, points: F64, closed: bool) -> bool:
    """Whether a side curve shows the bends of its type, away from the borders of the class.

    kind   : type of the side, or 'oval'
    points : (n, 2) float64, mm, plan coordinates, the side with the free space on the left, evenly spaced
    """
    runs = [r for r in bends(points, closed) if abs(r[0]) > STRAY_TURN]
    if any(abs(turn) < WANTED_TURN for turn, _ in runs):
        return False
    signs = [UP if turn > 0 else DOWN for turn, _ in runs]
    if closed:
        return signs.count(UP) == {"C5": 5, "C6": 2, "C1": 1, "C4": 0}[str(kind)]
    if signs.count(UP) != BENDS[kind].count(UP) or (kind == "C4") != (signs == [DOWN]):
        return False
    if kind not in ("C3", "C7", "C8", "C9"):
        return True
    uneven = [v for turn, v in runs if turn > 0]
    if kind == "C9":
        return max(v for _, v in runs) < ROUND_BEND
    lean = skew(points)
    if kind == "C3":
        return abs(lean) <= LEVEL_SKEW and float(np.mean(uneven)) > UNEVEN_BEND
    return -lean >= CLEAR_SKEW if kind == "C7" else lean >= CLEAR_SKEW
