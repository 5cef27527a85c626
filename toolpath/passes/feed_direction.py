"""The direction of feed with the shortest way over a surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from heapq import heappop, heappush

import numpy as np

from toolpath.passes.pass_family import Dragged, FinishTarget, Promise, Swath
from toolpath.passes.side_step import one_by_one

COARSER = 3.0  # passes of the search lie about this many times farther apart than those of the plan
CANDIDATES = tuple(math.radians(a) for a in range(0, 180, 30))
FEWEST = 60  # samples that make a search worthwhile


def best_direction(dragged: Dragged, target: FinishTarget, promise: Promise,
                   angles: Sequence[float] = CANDIDATES) -> float:
    """Angle of the feed from x with the shortest way, rad, by coarse layouts.

    angles : rad, to choose from

    Notes
    -----
    Scallops grow with the square of the side step, so the search allows ``COARSER`` squared times the scallop. That
    keeps the order of directions at a small part of the time. Among equal ways the first angle wins.

    A way only grows with every pass. So the direction with the shortest way so far gets its next pass, and the first
    that is complete is the best: no other is laid out farther than that.
    """
    if len(target.points) < FEWEST:
        return angles[0]
    thin = COARSER**2
    keep = np.random.default_rng(0).permutation(len(target.points))[:max(FEWEST, int(len(target.points) / thin))]
    few = FinishTarget(target.points[keep], target.normals[keep], target.tips[keep], COARSER * target.spacing)
    easy = replace(promise, scallop=thin * promise.scallop, chord=thin * promise.chord)
    laid = [one_by_one(Swath(dragged, few, easy, angle), subdivide=False) for angle in angles]
    shortest = [(0.0, k) for k in range(len(angles))]
    ways = [0.0] * len(angles)
    while True:
        _, k = heappop(shortest)
        made = next(laid[k], None)
        if made is None:
            return angles[k]
        ways[k] += made.length + promise.link * len(made.lines)
        heappush(shortest, (round(ways[k], 6), k))
