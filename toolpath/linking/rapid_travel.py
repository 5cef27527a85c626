"""How a tool gets from pass to pass: up, across and down, and where in air as fast as links go.

It goes straight over what is between, or by the clearance plane where that is sooner. Rapids move Z alone between that
plane and a height clear of the stock, or XY alone at the plane; below that height every move is a feed move, as no
rapid keeps its clearance beside a wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field as fresh

import numpy as np
from scipy.ndimage import maximum_filter1d

from geometry.mesh import F64
from toolpath.feeds.feed_scheduling import GUARD
from toolpath.lines import dense, stretch
from toolpath.stock.stock_map import AIR_TOLERANCE, SURE_RIM, StockMap
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

IN_FRONT = 0.1  # of the diameter, and no more than ``MAX_IN_FRONT``, above the start of a cut: approaches slow down
MAX_IN_FRONT = 0.5  # mm
OVER = 0.1  # mm above what stands between, on the way across
QUICK_SHARE = 0.06  # of the diameter: a feed for less than that is not worth a word


@dataclass
class Motions:
    """Feeds and heights of a step, mm and mm/min.

    plunge_feed : straight down, and how fast a way down along a pass goes down; front_feed : in cut at most, where the
    whole front of the cutter is in stock that no limit of the engaged angle counts
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

@dataclass
class Travel:
    """A tool on its way through the stock of a step, which it takes off wherever it goes.

    field        : TipField of the tool
    stock        : StockMap, lowered as the tool goes
    motions      : Motions
    trajectories : so far; at : (3,) mm, where the tool is, None before the first
    """

    field: TipField
    stock: StockMap
    motions: Motions
    trajectories: list[Trajectory] = fresh(default_factory=list)
    at: F64 | None = None

    def here(self) -> F64:
        """(3,) mm, where the tool is; it has to be somewhere."""
        assert self.at is not None
        return self.at

    def feed(self, motion: TrajectoryKind, points: F64, feed: float) -> None:
        """Go along points (n, 3), mm, from where the tool is, at a feed, mm/min, and take off what is met."""
        self.trajectories.append(Trajectory(motion, np.ascontiguousarray(points), feed))
        self.stock.cut(points, self.field.tool)
        self.at = points[-1]

    def rapid(self, points: F64) -> None:
        """Go along points (n, 3), mm, as a rapid; nothing is taken off."""
        self.trajectories.append(Trajectory(TrajectoryKind.RAPID, np.ascontiguousarray(points), 0.0))
        self.at = points[-1]

    def lift(self) -> None:
        """Up to the clearance plane, as a rapid from where no stock is beside the tool."""
        if self.at is None or self.at[2] >= self.motions.clearance - 1e-9:
            return
        x, y, z = self.at
        free = max(z, self.motions.rapid_floor)
        if free > z + 1e-9:
            self.feed(TrajectoryKind.LIFT, np.array([[x, y, z], [x, y, free]]), self.motions.link_feed)
        if self.motions.clearance > free + 1e-9:
            self.rapid(np.array([[x, y, free], [x, y, self.motions.clearance]]))

    def come_down(self, start: F64) -> None:
        """Get to a place (3,), mm, from above: straight over what is between, or by the clearance plane."""
        x, y, z = start
        way = self._across(start)
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
        """A way (n, 3) in air from where the tool is to just over a place to come down at, no higher than it has to be.

        Up over the stock and whatever else is between, straight across, and down: a feed way, taken where that is
        sooner than by the clearance plane. None where it is not, or where the tool is not free on it.
        """
        tool, m = self.field.tool, self.motions
        if self.at is None or self.at[2] >= m.rapid_floor:
            return None
        here, low = self.at, start[2] + self._in_front
        run = float(np.hypot(*(start - here)[:2]))
        level = max(float(here[2]), low)
        by_plane = self.by_plane(here, np.array([*start[:2], low]))
        if (2.0 * level - here[2] - low + run) / m.link_feed >= by_plane:
            return None
        n = max(2, int(run / (0.5 * self.stock.lattice.step)) + 1)
        t = np.linspace(0.0, 1.0, n)[:, None]
        lane = np.column_stack([here[:2] + t * (start - here)[:2], np.full(n, level)])
        level = max(level, float(self.field.tips(lane[:, :2]).max()))
        lane[:, 2] = level
        stands = np.maximum(self.stock.overlap(lane, tool, SURE_RIM, least=0.0),
                            self.stock.under_end(lane, tool, least=0.0))
        level += float(stands.max()) + OVER
        if (2.0 * level - here[2] - low + run) / m.link_feed >= by_plane or level >= m.rapid_floor:
            return None
        lane[:, 2] = level
        if not (self.free_move(here[:2], start[:2], level) and bool(self.stock.in_air(lane, tool).all())):
            return None
        way = np.array([here, [*here[:2], level], [*start[:2], level], [*start[:2], low]])
        return np.ascontiguousarray(way[np.r_[True, np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9]])

    def by_plane(self, here: F64, to: F64) -> float:
        """Minutes from a place to another, (3,) mm, up to the clearance plane, across and down."""
        m, run = self.motions, float(np.hypot(*(to - here)[:2]))
        return float((2.0 * m.rapid_floor - here[2] - to[2]) / m.link_feed
                     + (2.0 * (m.clearance - m.rapid_floor) + run) / m.rapid_feed)

    def _onto_feed(self, start: F64) -> float:
        """mm/min: the last of the way down to a place (3,), mm, that of the cut where nothing stands in its way."""
        at, tool = start[None, :], self.field.tool
        stands = max(float(self.stock.overlap(at, tool, SURE_RIM, least=0.0)[0]),
                     float(self.stock.under_end(at, tool, least=0.0)[0]))
        return self.motions.plunge_feed if stands > AIR_TOLERANCE else self.motions.feed

    @property
    def _in_front(self) -> float:
        return min(IN_FRONT * self.field.tool.diameter, MAX_IN_FRONT)

    def free_move(self, a: F64, b: F64, z: float) -> bool:
        """Whether the tool is free, as ``free`` has it, straight from a to b, (2,) mm, at height z, mm."""
        n = max(2, int(np.hypot(*(b - a)) / (0.3 * self.field.lattice.step)) + 1)
        t = np.linspace(0.0, 1.0, n)[:, None]
        return self.free(np.column_stack([a + t * (b - a), np.full(n, z)]))

    def free(self, tips: F64) -> bool:
        """Whether the tool meets no part and fixture, and its bodies no stock, at tips (n, 3), mm, close together."""
        tips = tips + [0.0, 0.0, LEVEL_TOLERANCE]
        if bool((self.field.blocked_by_cutter(tips) | self.field.blocked_by_body(tips)).any()):
            return False
        return not bool(self.stock.meets_bodies(tips, self.field.discs).any())

    def limit(self, tip: F64) -> float:
        """mm: how low the tip may go at a place (3,), mm, for the part and what stands fixed."""
        return float(self.field.tips(tip[None, :2])[0])

    def nothing_stands(self, way: F64) -> bool:
        """Whether no stock that the lattice shows is met along a way (n, 3), mm."""
        points = dense(way, 0.5 * self.stock.lattice.step)
        return float(self.stock.overlap(points, self.field.tool, least=0.0).max()) <= AIR_TOLERANCE

    def parts(self, way: F64, *, seen: bool) -> Iterator[tuple[bool, F64]]:
        """A way (n, 3), mm, in stretches, and whether each may be gone as fast as links go.

        A stretch may where no stock is at it that is wider than a step of the lattice, wherever it stands between the
        nodes. A shorter one than a share of the diameter is not worth a word.

        seen : also where the lattice shows none, some way behind the beginning and before the first that it shows
        """
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        if s[-1] <= 1e-9:
            return
        tool, step = self.field.tool, self.stock.lattice.step
        at = np.linspace(0.0, s[-1], math.ceil(2.0 * s[-1] / step) + 1)
        points = np.column_stack([np.interp(at, s, way[:, c]) for c in range(3)])
        stands = self.stock.overlap(points, tool, SURE_RIM, least=0.0) > AIR_TOLERANCE
        quick = ~maximum_filter1d(stands, 3, mode="nearest")
        if seen:
            guard = max(GUARD * tool.diameter, 2.0 * step)
            met = np.flatnonzero(self.stock.overlap(points, tool, least=0.0) > AIR_TOLERANCE)
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
