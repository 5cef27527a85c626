"""The direction of feed with the shortest way over a surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolpath.passes.pass_family import Dragged, FinishTarget, Promise, Swath
from toolpath.passes.side_step import lay_out

COARSER = 3.0  # passes of the search lie about this many times farther apart than those of the plan
CANDIDATES = tuple(math.radians(a) for a in range(0, 180, 30))
FEWEST = 60  # samples that make a search worthwhile


@dataclass(frozen=True)
class Candidate:
    """A direction that was tried: angle from x, rad; passes, pieces and way of its coarse layout, mm."""

    angle: float
    passes: int
    pieces: int
    way: float


def searched(dragged: Dragged, target: FinishTarget, promise: Promise,
             angles: Sequence[float] = CANDIDATES) -> list[Candidate]:
    """Coarse layouts in several directions, the shortest first.

    Scallops grow with the square of the side step, so the search allows ``COARSER`` squared times the scallop. That
    keeps the order of directions at a small part of the time. Among equal ways the first angle wins.
    """
    if len(target.points) < FEWEST:
        return [Candidate(angles[0], 0, 0, 0.0)]
    thin = COARSER**2
    keep = np.random.default_rng(0).permutation(len(target.points))[:max(FEWEST, int(len(target.points) / thin))]
    few = FinishTarget(target.points[keep], target.normals[keep], target.tips[keep], COARSER * target.spacing)
    easy = replace(promise, scallop=thin * promise.scallop, chord=thin * promise.chord)
    found = []
    for angle in angles:
        passes = lay_out(Swath(dragged, few, easy, angle), subdivide=False)
        lines = sum(len(p.lines) for p in passes)
        way = sum(p.length for p in passes) + promise.link * lines
        found.append(Candidate(angle, len(passes), lines, round(way, 6)))
    return sorted(found, key=lambda c: c.way)


def best_direction(dragged: Dragged, target: FinishTarget, promise: Promise) -> float:
    """Angle of the feed from x with the shortest way, rad."""
    return searched(dragged, target, promise)[0].angle
