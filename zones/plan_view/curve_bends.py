"""Bends of a curve in plan: how far it turns each way, independent of position, size and noise.

Notation
    s          share of the length of the curve, 0..1
    theta(s)   direction of the tangent, rad; falls where the curve turns right, that is where it bulges to the void
               on its left (an *up* bend)
    leg        stretch between a highest and the next lowest direction; its turn is the difference
    bridge     of a leg: the straight line over its mouth that rests on the legs on both sides
    height     of a leg: over its own chord or its bridge, the larger of the two, in heights of noise. The height of
               noise is 0.2 % of the size of the curve or six standard errors of this height, the larger of the two
    strength   of a leg: the lesser of its turn over 20 degrees and its height
Weak legs are removed one by one, the weakest first, and their neighbours join, as in a walk with hysteresis. The legs
left at strength 1 are the bends. The whole series is kept, since it gives the distance of the curve from another count.
A closed curve without a turn back, such as an oval, is one bend of a whole turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.mesh import F64
from geometry.surfaces.bspline import CONTROL_POINTS, SplineCurve, arc_length, even_errors, fit_even, resample

# Numbers of control points to try, the paper's ten first; samples of a polyline by its number of points.
COUNTS = (CONTROL_POINTS, 14, 20, 28, 40, 56, 80)
SAMPLES = ((400, 512), (200, 256), (100, 128), (0, 64))
STEPS = 1200
# A bend turns by at least this angle (rad) and has at least this height over its chord: in sizes of the curve, and in
# standard errors of independent noise. For a resampled polyline they are up to 1.4 times larger, so six are above four.
TURN, HEIGHT, ERRORS = float(np.radians(20.0)), 0.002, 6.0
# Distances below this share of the size of a curve count as zero in the choice of the number of control points.
FLOOR = 2e-4
# A walk around a ring starts in its second round and extends half a round beyond both ends.
ROUNDS = 4
# A bridge converges in six steps: on 1000 curves of all types, with and without noise, no leg needs more.
BRIDGE_STEPS = 8
# Legs that turn by less (rad) are removed together.
RIPPLE = float(np.radians(0.2))
# The middle half of the turn of a bend against the part between a twentieth from either end of it.
INNER, OUTER = (0.25, 0.75), (0.05, 0.95)
ARC_SHARE = 0.5 / 0.9


class BendSide(StrEnum):
    """Side to which a bend bulges."""

    UP = "up"
    """Towards the void, on the left of the walk: the curve turns right."""
    DOWN = "down"
    """Into the material: the curve turns left."""


@dataclass(frozen=True)
class CurveBend:
    """A stretch of a curve that turns one way.

    way        : Way
    turn       : rad, positive
    start, end : shares of the length, 0..1; ``end`` of a closed curve may lie beyond 1
    roundness  : length of the middle half of the turn over that of an arc; an arc has 1, a flat sine 0.84
    """

    way: BendSide
    turn: float
    start: float
    end: float
    roundness: float


@dataclass(frozen=True)
class BendLevel:
    """The bends left after the removal of all of strength ``least`` or below; the weakest of them has ``most``."""

    least: float
    most: float
    bends: tuple[CurveBend, ...]


@dataclass(frozen=True, eq=False)
class BendMeasures:
    """Measures that decide the profile type.

    closed : a ring
    levels : BendLevel by rising strength, from 0 to infinity; the last has no bend, or the one of a ring
    skew   : distance along the chord, in chords, of the centroid of the area between curve and chord from the middle;
             negative towards the start. 0 when closed
    turn   : rad, whole turn of the tangent, positive to the left
    spline : the measured curve
    """

    closed: bool
    levels: tuple[BendLevel, ...]
    skew: float
    turn: float
    spline: SplineCurve

    @property
    def counted(self) -> int:
        """Index of the level whose bends are those of the definition."""
        return next(i for i, v in enumerate(self.levels) if v.most >= 1.0)


def measure_bends(points: ArrayLike, closed: bool = False) -> BendMeasures:
    """Bends of a polyline, smoothed by a B-spline [Arivazhagan2020, equations 1 to 3].

    points : (n, 2) float64, mm, in plan of the access frame, walked with the void on the left
    closed : a ring; the last point is not repeated

    Returns
    -------
    BendMeasures
        Measures of the B-spline of order 5 with ten control points, or more where these explain the points better
        (Bayesian information criterion).

    Raises
    ------
    GeometryError
        Points of another shape, not finite, or without length.
    """
    p = finite_points(points, 2, "points")
    spline, noise, samples = smooth(p, closed)
    u = np.linspace(0.0, 1.0, STEPS + 1)
    p = spline.at(u)
    s, theta = _directions(spline, u)
    turn, size = float(theta[-1] - theta[0]), size_of(p, closed)
    errors = noise * even_errors(samples, len(spline.control), closed, STEPS)
    if closed:
        return BendMeasures(True, _levels(_ring(s, theta, p, HEIGHT * size, errors)), 0.0, turn, spline)
    legs = _Legs(s, theta, p, HEIGHT * size, errors, 0)
    return BendMeasures(False, _levels(legs), _skew(p), turn, spline)


def size_of(points: F64, closed: bool) -> float:
    """Size of a curve, the unit of its lengths: its chord, or a third of its length in rings and hooks.

    The larger of the two counts.

    points : (n, 2) float64, mm, in plan of the access frame
    closed : a ring
    Returns mm.
    """
    length = float(arc_length(points, closed)[-1])
    return max(0.0 if closed else float(np.linalg.norm(points[-1] - points[0])), length / np.pi)


def smooth(points: F64, closed: bool) -> tuple[SplineCurve, float, int]:
    """The B-spline that represents a polyline, with as few control points as the points need, ten at least.

    points : (n, 2) float64, mm, in plan of the access frame
    closed : a ring
    Returns the SplineCurve of order 5, with free ends, the standard deviation of its residuals along each axis, mm, and
    the number of fitted points. A ring that does not cross itself turns once, so a spline of a ring with another whole
    turn is taken only where every spline has one: noise at a tight end can bend a spline into a loop.
    Raises GeometryError for a polyline without length.
    """
    samples = next(m for least, m in SAMPLES if len(points) >= least)
    even = resample(points, samples, closed)
    floor = FLOOR * size_of(even, closed)
    u, once = np.linspace(0.0, 1.0, STEPS + 1), 2 * np.pi * np.sign(_area(even))
    best: tuple[tuple[bool, float], SplineCurve, float] | None = None
    for count in COUNTS:
        if count > samples // 2:
            break
        curve, left = fit_even(even, count, closed)
        theta = _directions(curve, u)[1] if closed else np.zeros(1)
        looped = closed and abs(float(theta[-1] - theta[0]) - once) > np.pi
        cost = looped, float(2 * samples * np.log(left**2 + floor**2) + 2 * count * np.log(2 * samples))
        if best is None or cost < best[0]:
            best = (cost, curve, left * float(np.sqrt(0.5 * samples / (samples - count))))
    assert best is not None
    return *best[1:], samples


def _area(ring: F64) -> float:
    x, y = (ring - ring[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _directions(spline: SplineCurve, u: F64) -> tuple[F64, F64]:
    d = spline.at(u, 1)
    speed = np.linalg.norm(d, axis=1)
    s = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return s / s[-1], np.unwrap(np.arctan2(d[:, 1], d[:, 0]))


def _skew(p: F64) -> float:
    chord = p[-1] - p[0]
    size = float(np.linalg.norm(chord))
    if size < 1e-6 * float(arc_length(p)[-1]):
        return 0.0
    e = chord / size
    x, y = (p - p[0]) @ e, (p - p[0]) @ np.array([-e[1], e[0]])
    weight = np.abs(0.5 * (y[1:] + y[:-1]) * np.diff(x))
    total = float(weight.sum())
    if total < 1e-12 * size**2:
        return 0.0
    return float((weight * 0.5 * (x[1:] + x[:-1])).sum() / total / size - 0.5)


@dataclass(frozen=True, eq=False)
class _Legs:
    """Share of length, direction (rad) and place (mm) along a curve.

    height : mm, least height of a bend
    errors : rows of ``even_errors``, mm; of a ring once round
    period : steps once round a ring, whose other arrays hold ``ROUNDS`` rounds; 0 for an open curve
    """

    s: F64
    theta: F64
    p: F64
    height: float
    errors: F64
    period: int

    def pivots(self) -> list[int]:
        """Where the direction turns back; of a ring from its second round on, as many highest as lowest."""
        if not self.period:
            return _pivots(self.theta.tolist(), RIPPLE)
        falling = self.theta if self.theta[-1] < self.theta[0] else -self.theta
        # From the end of the greatest turn back, so that the walk starts and ends on one of the extremes.
        rise = falling - np.minimum.accumulate(falling)
        first = int(np.argmax(rise)) % self.period + self.period
        found = [first + k for k in _pivots(falling[first:first + self.period + 1].tolist(), RIPPLE)][:-1]
        return found[:len(found) - len(found) % 2]

    def ends(self, pivots: list[int]) -> list[int]:
        """Pivots and the end of the last leg."""
        return [*pivots, pivots[0] + self.period] if self.period and pivots else pivots

    def strengths(self, pivots: list[int], known: dict[tuple[int, int, int, int], float]) -> list[float]:
        """Strength of every leg; ``known`` holds earlier results by the ends of the neighbouring legs."""
        ends = self.ends(pivots)
        around = [ends[0], *ends, ends[-1]]
        if self.period:
            around[0], around[-1] = ends[-2] - self.period, ends[1] + self.period
        out = []
        for leg in zip(around[:-3], around[1:-2], around[2:-1], around[3:], strict=True):
            if leg not in known:
                known[leg] = self._strength(*leg)
            out.append(known[leg])
        return out

    def _strength(self, first: int, i: int, j: int, last: int) -> float:
        """Strength of the leg from i to j, between legs from ``first`` to i and from j to ``last``."""
        turn = float(self.theta[j] - self.theta[i])
        enough, high = abs(turn) / TURN, self._height(i, j, i, j, turn)
        if high < enough:
            high = max(high, self._height(*self._bridge(first, i, j, last, turn), i, j, turn))
        return min(enough, high)

    def _bridge(self, first: int, i: int, j: int, last: int, turn: float) -> tuple[int, int]:
        """Places where the straight line over the mouth of a leg rests.

        A sharp bend is low over its own chord. Far along the neighbours may lie the far side of a lobe.
        """
        # At the places of contact the neighbours together have turned back by the turn of the leg, and neither by more.
        back = np.flatnonzero(np.abs(self.theta[first:i] - self.theta[i]) > abs(turn))
        ahead = np.flatnonzero(np.abs(self.theta[j:last] - self.theta[j]) > abs(turn))
        first = first + int(back[-1]) + 1 if len(back) else first
        last = j + int(ahead[0]) if len(ahead) else last
        a, b = i, j
        for _ in range(BRIDGE_STEPS):
            chord = self.p[b] - self.p[a]
            away = np.array([chord[1], -chord[0]]) if turn < 0 else np.array([-chord[1], chord[0]])
            rest = first + int(np.argmax(self.p[first:i + 1] @ away)), j + int(np.argmax(self.p[j:last + 1] @ away))
            if rest == (a, b):
                break
            a, b = rest
        return a, b

    def _height(self, a: int, b: int, i: int, j: int, turn: float) -> float:
        """How far the curve from i to j bulges over the chord from a to b, over that of noise."""
        chord, rest = self.p[b] - self.p[a], self.p[i:j + 1] - self.p[a]
        length = max(float(np.linalg.norm(chord)), 1e-12)
        left = (chord[0] * rest[:, 1] - chord[1] * rest[:, 0]) / length * (1 if turn < 0 else -1)
        top = int(np.argmax(left))
        # The height depends on three places of one curve; at an end its error is three times that in the middle.
        share = float(rest[top] @ chord) / length**2
        rows = len(self.errors)
        error = self.errors[(i + top) % rows] - (1 - share) * self.errors[a % rows] - share * self.errors[b % rows]
        return max(0.0, float(left[top])) / max(self.height, ERRORS * float(np.linalg.norm(error)))

    def without(self, pivots: list[int], leg: int) -> list[int]:
        """Pivots without a leg: its neighbours become one, or the end of an open curve moves in."""
        last = len(self.ends(pivots)) - 2
        if self.period:
            return [k for i, k in enumerate(pivots) if i not in (leg, (leg + 1) % len(pivots))]
        if 0 < leg < last:
            return pivots[:leg] + pivots[leg + 2:]
        return pivots[1:] if leg == 0 else pivots[:-1]

    def bends(self, pivots: list[int]) -> tuple[CurveBend, ...]:
        """One bend for every leg; a ring that never turns back is one bend."""
        ends = self.ends(pivots)
        if self.period and not pivots:
            ends = [self.period, 2 * self.period]
        legs = zip(ends[:-1], ends[1:], strict=True)
        return tuple(self._bend(i, j) for i, j in legs if self.theta[i] != self.theta[j])

    def _bend(self, i: int, j: int) -> CurveBend:
        turn = float(self.theta[j] - self.theta[i])
        rounds = float(np.floor(self.s[i]))
        roundness = _roundness(self.s[i:j + 1], self.theta[i:j + 1])
        way = BendSide.UP if turn < 0 else BendSide.DOWN
        return CurveBend(way, abs(turn), float(self.s[i]) - rounds, float(self.s[j]) - rounds, roundness)


def _ring(s: F64, theta: F64, p: F64, height: float, errors: F64) -> _Legs:
    """Several rounds of a closed curve whose last row repeats its first."""
    n, turn = len(s) - 1, theta[-1] - theta[0]
    rounds = np.repeat(np.arange(ROUNDS), n)
    shares, directions = np.tile(s[:-1], ROUNDS) + rounds, np.tile(theta[:-1], ROUNDS) + turn * rounds
    return _Legs(shares, directions, np.tile(p[:-1], (ROUNDS, 1)), height, errors[:-1], n)


def _levels(legs: _Legs) -> tuple[BendLevel, ...]:
    """The series of bends from all to none, or to the one bend of a ring that never turns back."""
    pivots = legs.pivots()
    out: list[BendLevel] = []
    known: dict[tuple[int, int, int, int], float] = {}
    least = 0.0
    while len(pivots) > 1:
        strength = legs.strengths(pivots, known)
        weakest = int(np.argmin(strength))
        if strength[weakest] > least:
            out.append(BendLevel(least, strength[weakest], legs.bends(pivots)))
            least = strength[weakest]
        pivots = legs.without(pivots, weakest)
    return (*out, BendLevel(least, np.inf, legs.bends(pivots[:0])))


def _pivots(theta: list[float], ripple: float) -> list[int]:
    """Places where the direction turns back by more than ``ripple`` (rad), and both ends."""
    out, low, high, way, last = [0], 0, 0, 0, len(theta) - 1
    for k, v in enumerate(theta):
        low, high = (k if v < theta[low] else low), (k if v > theta[high] else high)
        if way >= 0 and v < theta[high] - ripple:
            out.append(high)
            way, low = -1, k
        elif way <= 0 and v > theta[low] + ripple:
            out.append(low)
            way, high = 1, k
    out += [{-1: low, 0: 0, 1: high}[way], last]
    return [k for i, k in enumerate(out) if i == 0 or k > out[i - 1]]


def _roundness(s: F64, theta: F64) -> float:
    done = np.maximum.accumulate((theta - theta[0]) / (theta[-1] - theta[0]))
    inner, outer = (np.diff(np.interp(share, done, s))[0] for share in (INNER, OUTER))
    return float(inner / max(outer, 1e-12) / ARC_SHARE)


__all__ = ["CurveBend", "BendLevel", "BendMeasures", "BendSide", "measure_bends", "size_of", "smooth"]
