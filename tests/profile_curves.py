"""Random curves of every profile type, drawn from control points (arcs for C9) by rules stated by hand.

The label of a curve is a fact about how its control points were laid: how many peaks, how high, whether they lie on
one convex line or round a centre. Where a rule needs a measure (skew), it is that of the control polygon. Nothing here
calls the classifier. Chord about 1 along +x, void on the left, that is on +y; closed curves run either way round.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from geometry.mesh import F64
from geometry.surfaces.bspline import SplineCurve

SAMPLES = 600
Drawn = tuple[F64, bool]


def centroid_off_middle(polygon: F64) -> float:
    """Centroid of the area between a polyline and its chord, along the chord, off the middle, in chords."""
    p = np.column_stack([np.interp(np.linspace(0, len(polygon) - 1, 800), np.arange(len(polygon)), polygon[:, k])
                         for k in range(2)])
    e = (p[-1] - p[0]) / np.linalg.norm(p[-1] - p[0])
    x, y = (p - p[0]) @ e, (p - p[0]) @ np.array([-e[1], e[0]])
    area = np.abs(0.5 * (y[1:] + y[:-1]) * np.diff(x))
    return float((area * 0.5 * (x[1:] + x[:-1])).sum() / area.sum() / np.linalg.norm(p[-1] - p[0]) - 0.5)


def _open(control: F64) -> Drawn:
    return SplineCurve(control).at(np.linspace(0, 1, SAMPLES)), False


def _ring(control: F64, rng: Generator) -> Drawn:
    p = SplineCurve(control, closed=True).at(np.linspace(0, 1, SAMPLES, endpoint=False))
    return (p if rng.random() < 0.5 else p[::-1]), True


def _convex(rng: Generator) -> F64:
    """Ten control points whose polygon only turns right, by 40 to 170 degrees in all."""
    share = rng.uniform(0.4, 1.6, 8)
    total = np.radians(rng.uniform(40, 170))
    heading = 0.5 * total - total * np.concatenate([[0.0], np.cumsum(share) / share.sum()])
    step = rng.uniform(0.7, 1.3, 9)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    p = np.vstack([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    return p / np.linalg.norm(p[-1] - p[0])


def _humps(rng: Generator, heights: F64, height: float) -> F64:
    """Two control points on every peak, one in every valley; x in even steps with jitter, height in chords."""
    y = [0.0]
    for h in heights:
        y += [h * rng.uniform(0.93, 1.07), h * rng.uniform(0.93, 1.07), rng.uniform(-0.2, 0.1) * heights.min()]
    y[-1] = 0.0
    x = np.arange(len(y)) + rng.uniform(-0.12, 0.12, len(y))
    return np.column_stack([(x - x[0]) / (x[-1] - x[0]), height * np.array(y)])


def single_up(rng: Generator) -> Drawn:
    """A convex arc, or in one case of three a bell with flanks."""
    if rng.random() < 1 / 3:
        y = np.array([0, 0, 0.1, 0.8, 1, 1, 0.8, 0.1, 0, 0]) * rng.uniform(0.12, 0.4)
        return _open(np.column_stack([np.linspace(0, 1, 10) + rng.uniform(-0.02, 0.02, 10), y]))
    return _open(_convex(rng))


def single_down(rng: Generator) -> Drawn:
    return _open(_convex(rng) * [1, -1])


def double_up(rng: Generator) -> Drawn:
    return _open(_humps(rng, rng.uniform(0.8, 1.2, 2), rng.uniform(0.14, 0.4)))


def triple_even(rng: Generator) -> Drawn:
    while True:
        c = _humps(rng, rng.uniform(0.9, 1.1, 3), rng.uniform(0.12, 0.35))
        if abs(centroid_off_middle(c)) < 0.05:
            return _open(c)


def _leaning(rng: Generator) -> F64:
    while True:
        c = _humps(rng, np.array([1.0, rng.uniform(0.5, 0.7), rng.uniform(0.3, 0.45)]), rng.uniform(0.25, 0.45))
        if centroid_off_middle(c) < -0.13:
            return c


def triple_left(rng: Generator) -> Drawn:
    return _open(_leaning(rng))


def triple_right(rng: Generator) -> Drawn:
    return _open((_leaning(rng) * [-1, 1])[::-1])


def triple_round(rng: Generator) -> Drawn:
    """Five arcs, tangent to each other: three up, two down with a radius of 0.1 to 1 times theirs."""
    while True:
        slope = np.radians(rng.uniform(25, 80))
        valley = rng.uniform(0.1, 1.0)
        heading, at, out = slope, np.zeros(2), [np.zeros(2)]
        for k in range(5):
            up = k % 2 == 0
            turn = (-1 if up else 1) * 2 * slope * rng.uniform(0.95, 1.05)
            steps = 300
            length = (rng.uniform(0.92, 1.08) if up else valley) * abs(turn) / steps
            for i in range(steps):
                a = heading + turn * (i + 0.5) / steps
                at = at + length * np.array([np.cos(a), np.sin(a)])
                out.append(at)
            heading += turn
        p = np.array(out)
        if abs(centroid_off_middle(p)) < 0.05:
            return p / np.linalg.norm(p[-1] - p[0]), False


def multiple(rng: Generator) -> Drawn:
    n = int(rng.integers(4, 8))
    return _open(_humps(rng, rng.uniform(0.8, 1.2, n), rng.uniform(0.4, 1.0) / n))


def five_closed(rng: Generator) -> Drawn:
    """Four control points a lobe: two outside, two inside."""
    a = rng.uniform(0.2, 0.4)
    r = np.tile([1 + a, 1 + a, 1 - a, 1 - a], 5) * rng.uniform(0.96, 1.04, 20)
    t = (np.arange(20) + rng.uniform(-0.1, 0.1, 20)) * 2 * np.pi / 20
    return _ring(np.column_stack([r * np.cos(t), r * np.sin(t)]), rng)


def two_closed(rng: Generator) -> Drawn:
    """Two lobes of sixteen control points round a centre, one up to 1.7 times as long, and a deep waist."""
    n = 16
    t = (np.arange(n) + rng.uniform(-0.08, 0.08, n)) * 2 * np.pi / n
    r = (1 + rng.uniform(0.6, 0.8) * np.cos(2 * t)) * (1 + rng.uniform(0, 0.25) * np.cos(t))
    return _ring(np.column_stack([r * np.cos(t), r * np.sin(t)]), rng)


DRAW: dict[str, Callable[[Generator], Drawn]] = {
    "C1": single_up, "C2": double_up, "C3": triple_even, "C4": single_down, "C5": five_closed, "C6": two_closed,
    "C7": triple_left, "C8": triple_right, "C9": triple_round, "C10": multiple,
}


def draw(kind: str, seed: int) -> Drawn:
    """A curve of a type: (600, 2) or more float64 points, and whether it is closed.

    kind : 'C1' .. 'C10'; seed : the same seed gives the same curve
    """
    return DRAW[kind](np.random.default_rng([seed, int(kind[1:])]))
