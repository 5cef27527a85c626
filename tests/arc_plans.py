"""Plans with round passes, and the slow, obvious measure of how far a way is from another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from output.arc_fitting import fitted
from output.workplan import AccessFrame, Workplan
from tests.synthetic_plan import BALL, CLEAR, clamped, line, plan, step
from toolpath.lines import thinned
from toolpath.workingsteps import Trajectory, TrajectoryKind

HALF = 0.0025


def turn(radius: float, begin: float, end: float, rise: float = 0.0, centre=(10.0, 8.0, 4.0), thin: float = 0.5 * HALF):
    """An arc, or a helix, as it is planned: mm and rad, thinned by a quarter of the chordal tolerance."""
    a = np.linspace(begin, end, 4000)
    points = np.column_stack([centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a),
                              centre[2] + rise * np.linspace(0.0, 1.0, len(a))])
    return thinned(points, thin)


SHAPES = {
    "ring": turn(5.0, 0.3, 0.3 + 2 * np.pi),
    "ring to the right": turn(5.0, 1.0, 1.0 - 2 * np.pi),
    "helix": turn(4.0, 0.0, 9.0, -1.1),
    "steep helix": turn(4.0, 0.0, 3.0, -3.0),
    "corner": turn(0.2, 0.0, 1.5),
    "large": turn(300.0, 0.0, 0.1),
    "too large": turn(4000.0, 0.0, 0.02),
    "sine": np.column_stack([np.linspace(0, 30, 900), 2 * np.sin(np.linspace(0, 9, 900)), np.full(900, 4.0)]),
    "zigzag": np.array([[0.0, 0, 4], [5, 0, 4], [5, 0.3, 4], [0, 0.3, 4], [0, 0.6, 4], [5, 0.6, 4]]),
    "straight": np.column_stack([np.linspace(0, 20, 50), np.linspace(0, 7, 50), np.linspace(4, 6, 50)]),
    "hexagon": turn(5.0, 0.0, 2 * np.pi, thin=0.8),
}


def cutting(*ways, **changes) -> Workplan:
    """A plan whose steps go along these ways, each with a way down and up."""
    steps = []
    for k, way in enumerate(ways, 1):
        a, b = way[0], way[-1]
        top = [(a[0], a[1], CLEAR), (a[0], a[1], a[2] + 1.0)]
        moves = (line(TrajectoryKind.RAPID, *top), line(TrajectoryKind.APPROACH, top[1], tuple(a), feed=240.0),
                 Trajectory(TrajectoryKind.CUT, way, 600.0),
                 line(TrajectoryKind.LIFT, tuple(b), (b[0], b[1], b[2] + 1.0), feed=600.0),
                 line(TrajectoryKind.RAPID, (b[0], b[1], b[2] + 1.0), (b[0], b[1], CLEAR)))
        steps.append(replace(step(k, BALL, "waterline", trajectories=moves), chordal_tolerance=HALF))
    return plan(*steps, labels={"order": "4711"}, comments=(), **changes)


def round_plan() -> Workplan:
    """All shapes as arcs and lines."""
    return fitted(cutting(*SHAPES.values()), HALF)


def round_clamped() -> Workplan:
    """Steps of one clamping: upright twice, the first of them again leaning, and again upright."""
    base = clamped()
    ways = cutting(SHAPES["ring"], SHAPES["helix"], SHAPES["ring"], SHAPES["ring"]).steps
    steps = tuple(replace(s, access=a) for s, a in zip(ways, ("A1", "A1", "I1", "A1"), strict=True))
    turned = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    frames = {**base.clamping.frames, "A1": AccessFrame(turned, CLEAR)}
    return replace(base, steps=steps, clamping=replace(base.clamping, frames=frames))


def off(points: np.ndarray, way: np.ndarray) -> float:
    """mm, the farthest of points (n, 3) from a polyline (m, 3): every point against every piece."""
    a, d = way[:-1], np.diff(way, axis=0)
    size = np.maximum((d * d).sum(axis=1), 1e-30)
    worst = 0.0
    for p in points:
        share = np.clip(((p - a) * d).sum(axis=1) / size, 0.0, 1.0)[:, None]
        worst = max(worst, float(np.linalg.norm(p - a - share * d, axis=1).min()))
    return worst


def dense(way: np.ndarray, pieces: int = 7) -> np.ndarray:
    """A polyline (n, 3) with points between."""
    s = np.linspace(0.0, 1.0, pieces, endpoint=False)[:, None]
    return np.vstack([*(a + s * (b - a) for a, b in zip(way[:-1], way[1:], strict=True)), way[-1:]])
