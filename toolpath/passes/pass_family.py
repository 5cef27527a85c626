"""Passes side by side over a target, and the material that two neighbours leave between them.

A pass is identified by its place t across. Two neighbours A and B answer for the samples whose touching tips lie
between A and B. There the lower of the two swept envelopes is measured along the normal, in every strip across the
passes at the sample it leaves highest. From there the crest between the two is searched, since samples miss it.

Arrays are float64. Places are in mm, normals dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from geometry.kernels.outline import ARC
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope
from toolpath.kernels.drag import TipLimit
from toolpath.passes.dragged_path import KINK, Limit, pieces
from toolpath.scallop_budget import TIPS_SHARE

I64 = NDArray[np.int64]

FLOOR = 0.02  # mm: passes are never closer
BEGIN = 0.992  # of the closed form on a plane: wide enough, and kept at the first trial
CLIMB = 2.0  # mm a pass may be above the tips it serves for each mm they are beside it


@dataclass(frozen=True)
class Dragged:
    """A cutter that is dragged over a part.

    cutter    : Cutter, for the material it leaves
    limit     : Limit, lowest tip over a place, of the whole assembly
    ground    : TriangleTree of the finished surface
    allowance : mm, material to be left on it
    arrays    : TipLimit, the same limit for compiled loops; None where it has no such form
    """

    cutter: Cutter
    limit: Limit
    ground: TriangleTree
    allowance: float = 0.0
    arrays: TipLimit | None = None

    def pieces(self, way: F64, step: float, tolerance: float) -> list[F64]:
        """The tip path along a way as unbroken pieces, as ``toolpath.passes.dragged_path.pieces``.

        way             : (m, 2) float64, mm, access frame, polyline in plan
        step, tolerance : mm

        Returns list of (n, 3) float64, mm, access frame.
        """
        return pieces(self.limit if self.arrays is None else self.arrays, way, step, tolerance)


@dataclass(frozen=True, eq=False)
class FinishTarget:
    """Samples to be finished, at which the residual is measured.

    points  : (n, 3) float64, mm, access frame
    normals : (n, 3) float64, unit, out of the material; n_z > 0 where passes are dragged
    tips    : (n, 3) float64, mm, an admissible tip that touches each
    spacing : mm, approximate distance between neighbours
    covers  : (n,) float64, mm: radius of the flat place that one move has to finish whole, 0 for the point alone; None:
              0 for all
    """

    points: F64
    normals: F64
    tips: F64
    spacing: float
    covers: F64 | None = None

    def subset(self, which: I64) -> FinishTarget:
        """Some of the samples.

        which : (m,) int64, index
        """
        return FinishTarget(self.points[which], self.normals[which], self.tips[which], self.spacing,
                            None if self.covers is None else self.covers[which])

    def joined(self, more: FinishTarget) -> FinishTarget:
        """These samples followed by others, with the same spacing."""
        covers = None
        if self.covers is not None or more.covers is not None:
            covers = np.concatenate([np.zeros(len(t.points)) if t.covers is None else t.covers for t in (self, more)])
        return FinishTarget(np.vstack([self.points, more.points]), np.vstack([self.normals, more.normals]),
                            np.vstack([self.tips, more.tips]), self.spacing, covers)


@dataclass(frozen=True)
class Promise:
    """Tolerances that passes keep, mm.

    scallop   : largest residual along the normal
    chord     : tolerance of the tip path
    overrun   : by how much passes run past the last tip they serve
    link      : way that one more piece costs, to weigh pieces against closer passes
    """

    scallop: float
    chord: float
    overrun: float
    link: float


@dataclass(frozen=True, eq=False)
class Pass:
    """One straight pass.

    at    : mm, its place across the passes
    lines : (n, 3) float64 polylines of tips, mm, along growing s
    whole : False for a piece at a narrow spot
    """

    at: float
    lines: tuple[F64, ...]
    whole: bool = True

    @property
    def length(self) -> float:
        """Length of all lines, mm."""
        return sum(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in self.lines)


class Family(ABC):
    """Passes side by side over a target: one at each place t across, samples in order of the place of their tip.

    dragged, target, promise : as above
    t      : (n,) float64, mm, place of each sample's tip; ascending, and so are the arrays below
    strips : (n,) int64, index, the strip across the passes that each sample lies in
    across : (n, 2) float64, unit, in plan, the way t grows at each sample
    """

    def __init__(self, dragged: Dragged, target: FinishTarget, promise: Promise, t: F64, strips: I64,
                 across: F64) -> None:
        self.dragged, self.target, self.promise = dragged, target, promise
        # a sample that a pass through its own tip leaves too high may not set the step of all passes
        lift = dragged.limit(np.ascontiguousarray(target.tips[:, :2])) - target.tips[:, 2]
        order = np.flatnonzero(lift * target.normals[:, 2] <= 0.5 * promise.scallop)
        order = order[np.argsort(t[order], kind="stable")]
        self.t, self.strips, self.across = t[order], strips[order], across[order]
        self.points, self.normals, self.tips = target.points[order], target.normals[order], target.tips[order]
        self.spacing = target.spacing
        self._seen: WeakKeyDictionary[Envelope, F64] = WeakKeyDictionary()

    @abstractmethod
    def pass_at(self, t: float, window: float, only: NDArray[np.bool_] | None = None) -> Pass:
        """The pass at t, over the tips within ``window`` mm of it.

        only : (n,) bool, samples whose tips count; None: all
        """

    @property
    def guess(self) -> float:
        """A first step, mm, which leaves about the scallop on a level plane."""
        cutter = self.dragged.cutter
        r = cutter.corner_radius if cutter.corner_radius > 0.0 else cutter.radius
        if cutter.outline is not None:
            arcs = cutter.outline.stack.rows[:, ARC]
            r = float(arcs[arcs > 0.0][:1].sum()) or r
        h = min(self.promise.scallop, r)
        return max(FLOOR, min(BEGIN * 2.0 * math.sqrt(max(2.0 * r * h - h * h, 0.0)), r))

    @property
    def step(self) -> float:
        """Longest piece of a path between two samples of the tip limit, mm.

        Notes
        -----
        An obstacle that stands out by c, the path's share of the chord, lifts the smallest circle of the cutter, radius
        r, over 2 sqrt(2 r c). The quarters of a piece lie that far apart.
        """
        cutter = self.dragged.cutter
        r = cutter.corner_radius if cutter.corner_radius > 0.0 else cutter.radius
        if cutter.outline is not None:
            arcs = cutter.outline.stack.rows[:, ARC]
            r = float(arcs[arcs > 0.0].min(initial=cutter.radius))
        return max(min(8.0 * math.sqrt(2.0 * r * TIPS_SHARE * KINK * self.promise.chord), 0.5 * r), 0.02)

    def between(self, a: float, b: float) -> slice:
        """Samples with a < t <= b."""
        i, j = np.searchsorted(self.t, [a, b], side="right").tolist()
        return slice(i, j)

    def left(self, here: slice | I64, *passes: Envelope) -> tuple[F64, I64]:
        """Residual of passes in each strip across: (k,) float64, mm, and the k strips, int64.

        here : slice or (m,) int64, index of the samples
        """
        points, normals, strips = self.points[here], self.normals[here], self.strips[here]
        if not len(points):
            return np.zeros(0), np.zeros(0, np.int64)
        up = np.minimum.reduce([self._over(e, here) for e in passes]) - points[:, 2]
        over = up * normals[:, 2]
        order = np.lexsort((over, strips))
        last = order[np.concatenate([np.diff(strips[order]) != 0, [True]])]
        points, normals = points[last], normals[last]
        worst = np.minimum.reduce([e.along(points, normals) for e in passes])
        if len(passes) == 2:
            # the search for a crest goes no farther from its sample than the samples lie apart
            worst = np.maximum(worst, passes[0].crests(passes[1], self.dragged.ground, points, normals,
                                                       self.across[here][last], 1.5 * self.spacing))
        return worst - self.dragged.allowance, strips[last]

    def _over(self, envelope: Envelope, here: slice | I64) -> F64:
        """Envelope over the samples ``here``, mm; kept, since every trial of a step needs the pass before it again."""
        seen = self._seen.get(envelope)
        if seen is None:
            seen = self._seen[envelope] = np.full(len(self.points), np.nan)
        which = np.arange(len(self.points))[here]
        new = which[np.isnan(seen[which])]
        seen[new] = envelope.heights(self.points[new, :2])
        return np.asarray(seen[which])

    def envelope(self, p: Pass) -> Envelope:
        """The swept envelope of a pass."""
        return Envelope(p.lines, self.dragged.cutter)


class Swath(Family):
    """Straight passes along one direction of feed.

    angle : rad, of the feed from x
    """

    def __init__(self, dragged: Dragged, target: FinishTarget, promise: Promise, angle: float) -> None:
        # the ends of a quarter turn are exact, so that passes along an axis stay on a line of the program
        c, s = round(math.cos(angle), 15), round(math.sin(angle), 15)
        self.angle, self.feed, self.side = angle, np.array([c, s]), np.array([-s, c])
        strips = np.floor((target.points[:, :2] @ self.feed) / strip_width(dragged, target)).astype(np.int64)
        across = np.broadcast_to(self.side, (len(target.points), 2))
        super().__init__(dragged, target, promise, target.tips[:, :2] @ self.side, strips, across)
        self.s = self.tips[:, :2] @ self.feed

    def subset(self, which: I64) -> Swath:
        """The same with some of the samples of the target.

        which : (m,) int64, index
        """
        return Swath(self.dragged, self.target.subset(which), self.promise, self.angle)

    def pass_at(self, t: float, window: float, only: NDArray[np.bool_] | None = None) -> Pass:
        """As in ``Family``.

        only : (n,) bool, samples whose tips count; None: all
        """
        i, j = np.searchsorted(self.t, [t - window, t + window]).tolist()
        mine = np.arange(i, j) if only is None else i + np.flatnonzero(only[i:j])
        mine = mine[np.argsort(self.s[mine], kind="stable")]
        lines = self._lines(t, self.s[mine], self.tips[mine, 2] + CLIMB * window) if len(mine) else ()
        return Pass(t, tuple(lines), only is None)

    def _lines(self, t: float, s: F64, highest: F64) -> Iterator[F64]:
        """The pass over tips at s (ascending); where it is above ``highest`` of them it is not at them."""
        over = self.promise.overrun
        join = max(self.dragged.cutter.radius, 3.0 * self.spacing)
        for i, j in _runs(s, join + 2.0 * over):
            way = t * self.side + np.array([[s[i] - over], [s[j - 1] + over]]) * self.feed
            for piece in self.dragged.pieces(way, self.step, self.promise.chord):
                along = piece[:, :2] @ self.feed
                k = np.arange(i, j)[(s[i:j] >= along[0] - self.spacing) & (s[i:j] <= along[-1] + self.spacing)]
                k = k[np.interp(s[k], along, piece[:, 2]) <= highest[k]]
                for a, b in _runs(s[k], join + 2.0 * over):
                    lo, hi = max(s[k[a]] - over, along[0]), min(s[k[b - 1]] + over, along[-1])
                    if hi > lo:
                        yield _clipped(piece, along, float(lo), float(hi))


def _runs(s: F64, gap: float) -> list[tuple[int, int]]:
    """Half-open ranges of ascending places (n,) with no gap wider than this between neighbours."""
    if not len(s):
        return []
    cuts = np.flatnonzero(np.diff(s) > gap) + 1
    return list(zip([0, *cuts.tolist()], [*cuts.tolist(), len(s)], strict=True))


def _clipped(path: F64, along: F64, lo: float, hi: float) -> F64:
    """The part of a path (n, 3) whose places ``along`` (n,), ascending, lie between two."""
    inside = path[(along > lo) & (along < hi)]
    ends = np.array([[np.interp(s, along, path[:, c]) for c in range(3)] for s in (lo, hi)])
    return np.vstack([ends[:1], inside, ends[1:]])


def strip_width(dragged: Dragged, target: FinishTarget) -> float:
    """Width of the strips in which the residual is measured, mm."""
    return max(1.5 * target.spacing, 0.1 * dragged.cutter.radius)
