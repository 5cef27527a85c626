"""Feeds that a machine can follow: no stretch of a feed shorter than the way that its changes need.

A change of feed takes time and way, because acceleration and jerk are limited, and each change costs a word and a mark
on the surface. Where the feed between two rapids changes often, a lower feed over several stretches is nearly as fast.
The feed of a place never rises, so no bound on load, ramp or deflection is touched. Lengths are mm, feeds mm/min.

Changes are those of ``geometry.move_timing``; the machine accelerates within the faster stretch.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.machine_rates import Rates
from geometry.mesh import F64
from geometry.move_timing import change_seconds, change_way, peak_speed
from toolpath.lines import SHORTEST, stretch
from toolpath.workingsteps import Trajectory, TrajectoryKind

LEAST = 0.26  # mm, shortest stretch of one feed: a quarter of a millimetre after rounding
PRICE = 0.08  # s, what a change may cost before it is left out
MAX_LEVELS = 48  # feeds considered between two rapids
ALIKE = 1e-7  # mm


@dataclass
class _Stretch:
    """A stretch of one feed: its length, mm, and its feed, mm/min."""

    length: float
    feed: float


def with_few_changes(trajectories: Sequence[Trajectory], rates: Rates) -> tuple[Trajectory, ...]:
    """The same way with fewer changes of feed, none of them closer together than ``LEAST``.

    trajectories : in sequence; rapids stay as they are, and feeds only fall
    rates        : of the machine

    Returns trajectories with the same points in the same order; some are parted where a feed changes.
    """
    out: list[Trajectory] = []
    run: list[Trajectory] = []
    for t in trajectories:
        if t.motion is TrajectoryKind.RAPID:
            out += _evened(run, rates)
            out.append(t)
            run = []
        else:
            run.append(t)
    return (*out, *_evened(run, rates))


def _evened(run: Sequence[Trajectory], rates: Rates) -> list[Trajectory]:
    """Feed moves between two rapids."""
    if len({t.feed for t in run}) < 2:
        return list(run)
    lengths = np.array([t.length for t in run])
    found = _cheapest(lengths, np.array([t.feed for t in run]), rates)
    return _applied(run, lengths, _long_enough(found, rates))


def _cheapest(lengths: F64, feeds: F64, rates: Rates) -> list[_Stretch]:
    """Feeds up to those given that take the least time, with ``PRICE`` and the time lost for each change.

    lengths : (n,) float64, mm
    feeds   : (n,) float64, mm/min

    Solved exactly from the first stretch to the last, for the feeds that occur. A change loses t (v1 - v0) / (2 v1)
    against the programmed feeds.
    """
    levels = np.unique(feeds)
    if len(levels) > MAX_LEVELS:
        levels = levels[np.unique(np.linspace(0, len(levels) - 1, MAX_LEVELS).astype(np.int64))]
    speed = levels / 60.0
    lost = np.array([[change_seconds(a, b, rates) * abs(a - b) / (2.0 * max(a, b)) for b in speed.tolist()]
                     for a in speed.tolist()])
    change = np.where(np.eye(len(levels), dtype=np.bool_), 0.0, lost + PRICE)
    seconds = np.where(levels <= feeds[:, None], lengths[:, None] / speed, np.inf)
    came = np.zeros(seconds.shape, dtype=np.int64)
    total = seconds[0]
    for k in range(1, len(feeds)):
        ways = total[:, None] + change
        came[k] = ways.argmin(axis=0)
        total = ways[came[k], np.arange(len(levels))] + seconds[k]
    chosen = [int(total.argmin())]
    for k in range(len(feeds) - 1, 0, -1):
        chosen.append(int(came[k, chosen[-1]]))
    return _joined([_Stretch(a, float(levels[k])) for a, k in zip(lengths.tolist(), reversed(chosen), strict=True)])


def _joined(parts: Sequence[_Stretch]) -> list[_Stretch]:
    """Neighbours of one feed as one stretch; those without length are left out."""
    out: list[_Stretch] = []
    for p in parts:
        if out and (out[-1].feed == p.feed or p.length <= ALIKE):
            out[-1].length += p.length
        else:
            out.append(replace(p))
    if len(out) > 1 and out[0].length <= ALIKE:
        out[1].length += out.pop(0).length
    return out


def _long_enough(parts: Sequence[_Stretch], rates: Rates) -> list[_Stretch]:
    """Stretches of at least ``LEAST``, the shortest corrected first.

    A stretch takes the feed of a slower neighbour, or is lengthened at the expense of a faster one, whichever takes
    less time.
    """
    chain = _Chain(parts)
    heap = [(p.length, k) for k, p in enumerate(chain.parts)]
    heapq.heapify(heap)
    while heap:
        length, k = heapq.heappop(heap)
        own = chain.parts[k]
        if length != own.length or not _too_short(own, chain.beside(k), rates):
            continue
        _correct(own, chain.beside(k))
        chain.join(k)
        for i in (chain.before[k], k, chain.after[k]):
            if i >= 0:
                heapq.heappush(heap, (chain.parts[i].length, i))
    return [p for p in chain.parts if p.length > 0.0]


class _Chain:
    """Stretches in order, of which neighbours of one feed are joined; those joined to another have length 0."""

    def __init__(self, parts: Sequence[_Stretch]) -> None:
        self.parts = list(parts)
        self.before = list(range(-1, len(parts) - 1))
        self.after = [*range(1, len(parts)), -1]

    def beside(self, k: int) -> list[_Stretch]:
        """The neighbours of a stretch."""
        return [self.parts[i] for i in (self.before[k], self.after[k]) if i >= 0]

    def join(self, k: int) -> None:
        """Join neighbours of the same feed, and those without length, to a stretch."""
        own = self.parts[k]
        for ways, back in ((self.before, self.after), (self.after, self.before)):
            while (i := ways[k]) >= 0 and (self.parts[i].feed == own.feed or self.parts[i].length <= ALIKE):
                own.length += self.parts[i].length
                self.parts[i].length = 0.0
                ways[k] = ways[i]
                if ways[k] >= 0:
                    back[ways[k]] = k


def _correct(own: _Stretch, beside: Sequence[_Stretch]) -> None:
    """Lower the feed of a stretch that is too short to that of a neighbour, or lengthen it."""
    slower = max((p.feed for p in beside if p.feed < own.feed), default=0.0)
    faster = min((p for p in beside if p.feed > own.feed), key=lambda p: p.feed, default=None)
    lacking = max(LEAST - own.length, 0.0)
    if faster is not None and lacking > 0.0 and (not slower or lacking * (1.0 / own.feed - 1.0 / faster.feed)
                                                 < own.length * (1.0 / slower - 1.0 / own.feed)):
        taken = min(lacking, faster.length)
        faster.length -= taken
        own.length += taken
    else:
        own.feed = slower


def _too_short(own: _Stretch, beside: Sequence[_Stretch], rates: Rates) -> bool:
    """Whether a stretch is shorter than ``LEAST``, or than the ways of its changes and saves no time worth them."""
    if not beside or own.length <= 0.0:
        return False
    if own.length < LEAST - ALIKE:
        return True
    slower = [p.feed / 60.0 for p in beside if p.feed < own.feed]
    speed = own.feed / 60.0
    ways = sum(change_way(v, speed, rates) for v in slower)
    if not slower or own.length >= ways:
        return False
    base = max(slower)
    saved = own.length / base - _peaked(own.length / len(slower), base, speed, rates) * len(slower)
    return saved < PRICE * len(slower)


def _peaked(length: float, base: float, most: float, rates: Rates) -> float:
    """Seconds from a speed up along a length, mm, as fast as the machine gets there; speeds in mm/s."""
    peak = peak_speed(length, base, most, rates)
    return change_seconds(base, peak, rates) + (length - change_way(base, peak, rates)) / peak


def _applied(run: Sequence[Trajectory], lengths: F64, parts: Sequence[_Stretch]) -> list[Trajectory]:
    """Trajectories with the feeds of stretches, parted where a feed changes within one."""
    ends = np.cumsum([p.length for p in parts])
    feeds = [p.feed for p in parts]
    out: list[Trajectory] = []
    begin = 0.0
    for t, length in zip(run, lengths.tolist(), strict=True):
        inside = np.flatnonzero((ends[:-1] > begin + ALIKE) & (ends[:-1] < begin + length - ALIKE))
        rises = np.array([feeds[k + 1] > feeds[k] for k in inside.tolist()], dtype=np.bool_)
        for low, high, points, axes in _parted(t, ends[inside] - begin, rises):
            first, last = (min(int(np.searchsorted(ends, begin + at)), len(feeds) - 1)
                           for at in (low + ALIKE, max(high - ALIKE, low + ALIKE)))
            out.append(replace(t, points=points, axes=axes, feed=min(t.feed, *feeds[first:last + 1])))
        begin += length
    return out


def _parted(t: Trajectory, places: F64, rises: NDArray[np.bool_]) -> list[tuple[float, float, F64, F64 | None]]:
    """A trajectory parted at places (m,) mm along it, (m,) bool where the feed rises: begin, end, points, and axes.

    One that turns is parted at its points. A part of a move down is not shorter than ``SHORTEST``, which keeps the
    slope of ramps (``toolpath.lines.parting``). The slower stretch gains by both.
    """
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(t.points, axis=0), axis=1))])
    if not len(places) or t.arcs:
        return [(0.0, float(s[-1]), t.points, t.axes)]
    k = np.clip(np.searchsorted(s, places), 1, len(s) - 1)
    beside = np.where(rises, k, k - 1)
    if t.axes is not None:
        corners = np.unique(np.concatenate([[0], beside, [len(s) - 1]]))
        return [(float(s[i]), float(s[j]), t.points[i:j + 1], t.axes[i:j + 1])
                for i, j in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True)]
    moved = np.where(rises, np.maximum(places, s[k - 1] + SHORTEST), np.minimum(places, s[k] - SHORTEST))
    roomy = np.minimum(moved - s[k - 1], s[k] - moved) > SHORTEST - ALIKE
    falls = t.points[k, 2] < t.points[k - 1, 2]
    at = np.where(falls, np.where(roomy, moved, s[beside]), places)
    bounds = np.unique(np.concatenate([[0.0], at, s[-1:]]))
    return [(low, high, stretch(t.points, s, low, high), None)
            for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)]


__all__ = ["LEAST", "PRICE", "with_few_changes"]
