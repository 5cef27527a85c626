"""Ways from pass to pass: up, across and down, in air at the feed of links.

The tool moves straight over what stands between, or by the clearance plane where that is sooner. Rapids move Z alone
between that plane and a height clear of the stock, or XY alone at the plane. Below that height every move is a feed
move, since no rapid keeps its clearance beside a wall.

Arrays are float64; places are tips in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from dataclasses import field as fresh

import numpy as np
from scipy.ndimage import maximum_filter1d

from geometry.machine_rates import RATES, Rates
from geometry.mesh import F64
from geometry.move_timing import leg_seconds
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.feeds.feed_scheduling import GUARD
from toolpath.lines import dense, stretch
from toolpath.stock.stock_map import AIR_TOLERANCE, SURE_RIM, StockMap
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

IN_FRONT = 0.1  # diameters, ``MAX_IN_FRONT`` at most, above the start of a cut, where approaches slow down
MAX_IN_FRONT = 0.5  # mm
OVER = 0.1  # mm above obstacles on the way across
QUICK_SHARE = 0.06  # diameters: a shorter stretch gets no feed of its own


@dataclass
class Motions:
    """Feeds and heights of a step, mm and mm/min.

    plunge_feed : straight down, and vertical limit of a way down along a pass
    front_feed  : limit in cut where the whole front of the cutter is in stock that no engaged angle limits
    rates       : of the machine, for times
    """

    feed: float
    plunge_feed: float
    link_feed: float
    rapid_feed: float
    clearance: float
    rapid_floor: float
    ramp_angle: float
    step_down: float
    tolerance: float
    front_feed: float = math.inf
    rates: Rates = RATES

    def link_seconds(self, lengths: Sequence[float]) -> float:
        """Time of straight moves at the feed of links, with a stop at each corner.

        lengths : mm

        Returns s.
        """
        return sum(leg_seconds(a, self.link_feed / 60.0, self.rates) for a in lengths)

    def plane_seconds(self, here: F64, to: F64) -> float:
        """Time from a place to another by the clearance plane: up, across and down.

        Feed moves reach the height of rapids. The control stops where feed moves and rapids meet, and at corners.

        here, to : (3,) float64, mm, access frame

        Returns s.
        """
        lift = max(self.clearance - self.rapid_floor, 0.0)
        rapids = (lift, float(np.hypot(*(to - here)[:2])), lift)
        return self.link_seconds([self.rapid_floor - float(here[2]), self.rapid_floor - float(to[2])]) + sum(
            leg_seconds(a, self.rapid_feed / 60.0, self.rates) for a in rapids)


@dataclass
class Travel:
    """A tool on its way through the stock of a step, which it removes wherever it feeds.

    field        : TipField of the tool
    stock        : StockMap, lowered as the tool moves
    motions      : Motions
    found        : findings of a proof of an earlier plan
    trajectories : so far
    at           : (3,) float64, mm, access frame, tip of the tool; None before the first move
    loose        : mm, of the cuts that follow (``Trajectory.loose``)
    """

    field: TipField
    stock: StockMap
    motions: Motions
    found: Counterexamples = NONE
    trajectories: list[Trajectory] = fresh(default_factory=list)
    at: F64 | None = None
    loose: float = 0.0

    def here(self) -> F64:
        """Tip of the tool, (3,) float64, mm, access frame, after its first move."""
        assert self.at is not None
        return self.at

    def feed(self, motion: TrajectoryKind, points: F64, feed: float) -> None:
        """Feed along a way from where the tool is, and remove the stock on it.

        points : (n, 3) float64, mm, access frame
        feed   : mm/min
        """
        loose = self.loose if motion is TrajectoryKind.CUT else 0.0
        self.trajectories.append(Trajectory(motion, np.ascontiguousarray(points), feed, loose=loose))
        self.stock.cut(points, self.field.tool)
        self.at = points[-1]

    def rapid(self, points: F64) -> None:
        """Rapid along a way; nothing is removed.

        points : (n, 3) float64, mm, access frame
        """
        self.trajectories.append(Trajectory(TrajectoryKind.RAPID, np.ascontiguousarray(points), 0.0))
        self.at = points[-1]

    def lift(self) -> None:
        """Lift to the clearance plane, as a rapid from where no stock is beside the tool."""
        if self.at is None or self.at[2] >= self.motions.clearance - 1e-9:
            return
        x, y, z = self.at
        free = max(z, self.motions.rapid_floor)
        if free > z + 1e-9:
            self.feed(TrajectoryKind.LIFT, np.array([[x, y, z], [x, y, free]]), self.motions.link_feed)
        if self.motions.clearance > free + 1e-9:
            self.rapid(np.array([[x, y, free], [x, y, self.motions.clearance]]))

    def too_deep(self, way: F64) -> bool:
        """Whether a proof found a cut too deep near a way, where no stock that the lattice shows explains it.

        way : (n, 3) float64, mm, access frame
        """
        return self.found.care(self.field.tool, way) < 1.0

    def come_down(self, start: F64) -> None:
        """Reach a place from above: straight over what stands between, or by the clearance plane.

        start : (3,) float64, mm, access frame

        Past a cut that was too deep the tool goes by the clearance plane.
        """
        x, y, z = start
        way = self._across(start)
        if way is not None and self.too_deep(way):
            way = None
        if way is not None:
            self.feed(TrajectoryKind.CONNECT, way, self.motions.link_feed)
            self.feed(TrajectoryKind.APPROACH, np.array([way[-1], start]), self._onto_feed(start))
            return
        top = self.motions.clearance
        if self.at is None:
            self.at = np.array([x, y, top])
            self.rapid(np.array([[x, y, top], [x, y, top]]))
        else:
            self.lift()
            if np.hypot(*(self.here()[:2] - start[:2])) > 1e-9:
                self.rapid(np.array([self.here(), [x, y, top]]))
        free = min(max(z, self.motions.rapid_floor), top)
        if top > free + 1e-9:
            self.rapid(np.array([[x, y, top], [x, y, free]]))
        slow = min(z + self._in_front, free)
        if free > slow + 1e-9:
            self.feed(TrajectoryKind.APPROACH, np.array([[x, y, free], [x, y, slow]]), self.motions.link_feed)
        if slow > z + 1e-9:
            self.feed(TrajectoryKind.APPROACH, np.array([[x, y, slow], [x, y, z]]), self._onto_feed(start))

    def _across(self, start: F64) -> F64 | None:
        """A way (n, 3), mm, in air from the tool to just over a place to come down at, no higher than necessary.

        It rises over the stock and other obstacles, crosses straight, and descends, at a feed. None where the clearance
        plane is sooner, or where the tool is not free on it.
        """
        tool, m = self.field.tool, self.motions
        if self.at is None or self.at[2] >= m.rapid_floor:
            return None
        here, low = self.at, start[2] + self._in_front
        run = float(np.hypot(*(start - here)[:2]))
        level = max(float(here[2]), low)
        by_plane = m.plane_seconds(here, np.array([*start[:2], low]))
        if m.link_seconds([level - here[2], run, level - low]) >= by_plane:
            return None
        n = max(2, int(run / (0.5 * self.stock.lattice.step)) + 1)
        t = np.linspace(0.0, 1.0, n)[:, None]
        lane = np.column_stack([here[:2] + t * (start - here)[:2], np.full(n, level)])
        level = max(level, float(self.field.tips(lane[:, :2]).max()))
        lane[:, 2] = level
        stands = np.maximum(self.stock.overlap(lane, tool, SURE_RIM, lower_bound=0.0),
                            self.stock.under_end(lane, tool, lower_bound=0.0))
        level += float(stands.max()) + OVER
        if level >= m.rapid_floor or m.link_seconds([level - here[2], run, level - low]) >= by_plane:
            return None
        lane[:, 2] = level
        if not (self.free_move(here[:2], start[:2], level) and bool(self.stock.in_air(lane, tool).all())):
            return None
        way = np.array([here, [*here[:2], level], [*start[:2], level], [*start[:2], low]])
        return np.ascontiguousarray(way[np.r_[True, np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9]])

    def _onto_feed(self, start: F64) -> float:
        """Feed of the last part of the way down to a place (3,), mm: that of the cut where no stock stands there,
        mm/min."""
        at, tool = start[None, :], self.field.tool
        stands = max(float(self.stock.overlap(at, tool, SURE_RIM, lower_bound=0.0)[0]),
                     float(self.stock.under_end(at, tool, lower_bound=0.0)[0]))
        return self.motions.plunge_feed if stands > AIR_TOLERANCE else self.motions.feed

    @property
    def _in_front(self) -> float:
        return min(IN_FRONT * self.field.tool.diameter, MAX_IN_FRONT)

    def free_move(self, a: F64, b: F64, z: float) -> bool:
        """Whether the tool is ``free`` straight from a to b at height z, mm.

        a, b : (2,) float64, mm, access frame
        """
        n = max(2, int(np.hypot(*(b - a)) / (0.3 * self.field.lattice.step)) + 1)
        t = np.linspace(0.0, 1.0, n)[:, None]
        return self.free(np.column_stack([a + t * (b - a), np.full(n, z)]))

    def free(self, tips: F64) -> bool:
        """Whether the tool meets no part and fixture, and its bodies no stock.

        tips : (n, 3) float64, mm, access frame, close together
        """
        tips = tips + [0.0, 0.0, LEVEL_TOLERANCE]
        if bool((self.field.blocked_by_cutter(tips) | self.field.blocked_by_body(tips)).any()):
            return False
        return not bool(self.stock.meets_bodies(tips, self.field.discs).any())

    def limit(self, tip: F64) -> float:
        """Lowest height of the tip at a place, mm, given part and fixtures.

        tip : (3,) float64, mm, access frame
        """
        return float(self.field.tips(tip[None, :2])[0])

    def nothing_stands(self, way: F64) -> bool:
        """Whether a way meets no stock that the lattice shows.

        way : (n, 3) float64, mm, access frame
        """
        points = dense(way, 0.5 * self.stock.lattice.step)
        return float(self.stock.overlap(points, self.field.tool, lower_bound=0.0).max()) <= AIR_TOLERANCE

    def parts(self, way: F64, *, seen: bool) -> Iterator[tuple[bool, F64]]:
        """A way in stretches, each with whether it may be taken at the feed of links.

        A stretch may where no stock wider than a step of the lattice touches it, wherever that stands between the
        nodes. A stretch shorter than a share of the diameter does not count.

        way  : (n, 3) float64, mm, access frame
        seen : also where the lattice shows no stock, from some distance behind the beginning to some before the first
               stock

        Yields stretches with their points, (m, 3) float64, mm, access frame.
        """
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        if s[-1] <= 1e-9:
            return
        tool, step = self.field.tool, self.stock.lattice.step
        at = np.linspace(0.0, s[-1], math.ceil(2.0 * s[-1] / step) + 1)
        points = np.column_stack([np.interp(at, s, way[:, c]) for c in range(3)])
        stands = self.stock.overlap(points, tool, SURE_RIM, lower_bound=0.0) > AIR_TOLERANCE
        quick = ~maximum_filter1d(stands, 3, mode="nearest")
        if seen:
            guard = max(GUARD * tool.diameter, 2.0 * step)
            met = np.flatnonzero(self.stock.overlap(points, tool, lower_bound=0.0) > AIR_TOLERANCE)
            last = float(at[met[0]] if len(met) else s[-1]) - guard
            if s[-1] > 4.0 * guard and last > 2.0 * guard:
                quick |= (at >= guard) & (at <= last)
        between = quick[1:] & quick[:-1] & (self.motions.link_feed > self.motions.feed)
        ends, begun = [0, *(np.flatnonzero(np.diff(between)) + 1).tolist(), len(between)], 0.0
        for a, b in zip(ends[:-1], ends[1:], strict=True):
            if between[a] and at[b] - at[a] >= QUICK_SHARE * tool.diameter:
                if at[a] > begun:
                    yield False, stretch(way, s, begun, float(at[a]))
                yield True, stretch(way, s, float(at[a]), float(at[b]))
                begun = float(at[b])
        if begun < s[-1]:
            yield False, stretch(way, s, begun, float(s[-1]))
