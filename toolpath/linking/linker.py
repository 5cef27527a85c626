"""Links passes to one safe motion: ways in, ways between passes, ways out.

Stock that stands higher over a pass than the flutes reach is removed first, above the pass. In a gap that only just
fits the tool, it is removed layer by layer. Then the linker tries these ways in, in this order.

1. From the end of a pass straight on to the next one, where the level move between them is free and removes no more
   than a layer. Down to a deeper level the tool goes in air, there or beside its start, or along the pass itself, never
   steeper than the ramp angle.
2. Down in air over the start of the pass, or over a free place beside it that is in air or that the tool has reached
   before, and in from there.
3. Down a ramp along the pass, round a closed one from where least stock is touched, back and forth on an open one. Its
   top is in air or just above an earlier cut, or a free place close beside it is.

A pass with none of these is left out. A pass along a wall begins and ends on an arc (``toolpath.linking.lead_arcs``)
where the tool is free on it and clear of stock at its far end; ways 1 and 2 lead to that end.
``toolpath.linking.rapid_travel`` brings the tool to the beginning of ways 2 and 3. Where the engaged angle has a limit
(``toolpath.stock.engagement``) ways in keep it, and a pass that would exceed it is skimmed first.

Places are tips in mm, access frame.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from dataclasses import field as fresh

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.feeds.feed_scheduling import Pace, paced
from toolpath.lines import Line, dense, legs, pieces_where, thinned
from toolpath.linking.lead_arcs import arcs_along
from toolpath.linking.ramp_entry import RAMP_SHARE, head_of, way_down
from toolpath.linking.rapid_travel import Motions, Travel
from toolpath.scallop_budget import LEAD_SHARE
from toolpath.stock.cut_history import Depths, still_to_walk
from toolpath.stock.engagement import UNBOUNDED, skims, within
from toolpath.stock.stock_map import SURE_RIM, StockMap
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

FLUTE_SHARE = 0.8  # flute lengths: highest stock over a pass
LOOK_EVERY = 0.2  # radii: discs so far apart leave out 0.5 % of it between them
MAX_AGAIN = 3  # moves at the beginning of a way down that the tool has cut before
LOOK_RIM = -0.3  # stock lattice steps off the radius, where a ramp looks for the stock that it comes down through
TOUCH_RIM = -0.02  # the same for the place it comes down at: all but the wall it touches
MAX_OVER = 1.5  # layers: most stock over a pass, or over a lane onto one
BEEN_NEAR = 0.5  # diameters: how near a place lies that the tool has reached before, to come down beside a cut
MAX_BEEN = 6  # such places
BEGINNINGS = 4  # places round a closed pass at which an arc onto it is tried
COMPASS = np.array([[math.cos(a), math.sin(a)] for a in np.arange(8) * math.pi / 4])


@dataclass
class Linker:
    """Builds the trajectories of one step pass by pass and keeps the stock up to date.

    field   : TipField of the tool
    stock   : StockMap, lowered as passes are added
    motions : Motions
    skipped : lines left out: no safe way in, or stock in the way of shank or holder
    refused : count of those without a safe way in
    depths  : Depths of the tool, on the stock's lattice; those of earlier steps count
    found   : findings of a proof of an earlier plan
    pace    : Pace of passes that remove stock; None: one feed
    engaged : rad, largest engaged angle of the front of the cutter
    walls   : passes follow walls, and begin and end on arcs
    """

    field: TipField
    stock: StockMap
    motions: Motions
    depths: Depths
    found: Counterexamples = NONE
    pace: Pace | None = None
    engaged: float = UNBOUNDED
    walls: bool = False
    passes: int = 0
    skipped: list[Line] = fresh(default_factory=list)
    refused: int = 0

    def __post_init__(self) -> None:
        self.go = Travel(self.field, self.stock, self.motions, self.found)
        self.gone = Depths(self.stock.lattice)  # ways back in air

    @property
    def trajectories(self) -> list[Trajectory]:
        """Trajectories so far."""
        return self.go.trajectories

    @property
    def at(self) -> F64 | None:
        """Tip of the tool, (3,) float64, mm, access frame; None before its first move."""
        return self.go.at

    def add(self, line: Line, tolerance: float | None = None, *, eased: bool = False) -> bool:
        """Append one line as a cutting pass; False where it has no safe way in.

        Where stock stands higher over the line than the flutes reach, the tool first cuts above the line. Parts of a
        line are left out where stock stands in the way of shank or holder, and where the tool is barred. Parts above
        the height of rapids, and parts that were cut before, are not walked.

        eased : the line itself goes down gradually, as a helix does, and needs no skims
        """
        points = thinned(line.points, self.motions.tolerance if tolerance is None else tolerance)
        if len(points) < 2 or float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) < 1e-6:
            return True
        before = len(self.skipped)
        free = [q for p in self._under_rapids(Line(points, line.closed)) for q in self._unbarred(p)]
        for piece in [q for p in free for q in self._unwalked(p)]:
            if not (self._topped(piece) and (self._one(piece.points, piece.closed, eased=True) if eased
                                             else self._pass(piece.points, piece.closed))):
                self.skipped.append(piece)
                self.refused += 1
        return len(self.skipped) == before

    def _under_rapids(self, line: Line) -> list[Line]:
        """The parts of a line below the height of rapids.

        Higher up there is no stock, only things that the tool avoids, such as a table that rises over the clearance
        plane where the tool tilts.
        """
        if line.points[:, 2].max() <= self.motions.rapid_floor:
            return [line]
        way = Line(dense(line.points, LOOK_EVERY * self.field.tool.radius), line.closed)
        low = pieces_where(way, way.points[:, 2] <= self.motions.rapid_floor, 0.0, 0.0)
        return [Line(thinned(p.points, self.motions.tolerance), p.closed) for p in low if p.length > 1e-6]

    def _unwalked(self, line: Line) -> list[Line]:
        """The parts of a line that were not cut before, with a few moves of the rest on each side.

        A line that is blocked in part comes back round after round until the obstacle is gone.
        """
        return still_to_walk(line, ~self.depths.were_cut(line.points))

    def _unbarred(self, line: Line) -> list[Line]:
        """The parts of a line without obstacles; the rest is skipped."""
        room = LOOK_EVERY * self.field.tool.radius
        points = dense(line.points, room)
        barred = self.found.bars(self.field.tool, points)
        if not barred.any():
            return self._clear_of_bodies(line)
        line = Line(points, line.closed)
        self.skipped.extend(pieces_where(line, barred, 0.0, 0.0))
        free = [p for p in pieces_where(line, ~barred, 0.0, 0.0) if p.length > 2.0 * room]
        free = [Line(thinned(p.points, self.motions.tolerance), p.closed) for p in free]
        return [q for p in free for q in self._clear_of_bodies(p)]

    def _clear_of_bodies(self, line: Line) -> list[Line]:
        """The parts of a line along which shank and holder pass over the stock; the rest is skipped."""
        if not self.field.discs:
            return [line]
        points = dense(line.points, LOOK_EVERY * self.field.tool.radius)
        met = self.stock.meets_bodies(points, self.field.discs)
        if not met.any():
            return [line]
        self.skipped.extend(pieces_where(Line(points, line.closed), met, 0.0, 0.0))
        room = LOOK_EVERY * self.field.tool.radius  # a sample apart from what was met
        return [Line(thinned(p.points, self.motions.tolerance), p.closed)
                for p in pieces_where(Line(points, line.closed), ~met, -room, 0.0) if p.length > 2.0 * room]

    def _topped(self, line: Line) -> bool:
        """Remove what stands higher over a line than the flutes reach, from the top down."""
        tool = self.field.tool
        points = dense(line.points, LOOK_EVERY * tool.radius)
        over = self.stock.standing(points, tool)
        height = FLUTE_SHARE * tool.flute_length
        for k in range(int(max(float(over.max()), 0.0) / height), 0, -1):
            lifted = Line(points + np.array([0.0, 0.0, k * height]), line.closed)
            for rest in self._not_been(lifted, over > k * height):
                if not self._pass(rest.points, rest.closed):
                    return False
        return True

    def _not_been(self, line: Line, wanted: NDArray[np.bool_]) -> Iterator[Line]:
        """The wanted parts of a line, some way extended, where the tool has not been as deep.

        Where it has been it cannot reach the stock that the map still shows. It walks no move of an earlier level
        again, which a line above a pass may meet.

        wanted : (n,) bool, for the points of the line
        """
        radius = self.field.tool.radius
        for piece in pieces_where(line, wanted & ~self.depths.been(line.points), radius, 4.0 * radius):
            walk = thinned(piece.points, self.motions.tolerance)
            if len(walk) > 1:
                yield from self._unwalked(Line(walk, piece.closed))

    def _stepped(self, points: F64, closed: bool) -> None:
        """Remove layer by layer what stands over a line in a gap that the tool has been in and only just fits.

        Elsewhere a pass begins in air, or goes down along itself, which removes the stock over it gradually.
        """
        tool, step = self.field.tool, self.motions.step_down
        along = dense(points, LOOK_EVERY * tool.radius)
        over = self.stock.overlap(along, tool, LOOK_RIM)
        if (over.max() <= MAX_OVER * step or not len(self._been(points[0]))
                or bool(self.stock.in_air(points[:1], tool)[0]) or next(self._air_beside(points), None) is not None):
            return
        for k in range(int(over.max() / step), 0, -1):
            lifted = Line(along + np.array([0.0, 0.0, k * step]), closed)
            for rest in self._not_been(lifted, over > k * step):
                self._one(rest.points, rest.closed, unless_over=True)

    def _pass(self, points: F64, closed: bool) -> bool:
        """Cut a line, skimmed first where it would have too much of the cutter in stock; False where it is left out."""
        self._stepped(points, closed)
        if self._one(points, closed, unless_over=True):
            return True
        line, tool = Line(points, closed), self.field.tool
        for whole in (False, True) if self.engaged < UNBOUNDED else ():  # the whole, where only the way in is too much
            for skim in skims(self.stock, line, tool, self.engaged, self.found, whole=whole):
                way = Line(thinned(skim.points, self.motions.tolerance), skim.closed)
                if not all(self._one(rest.points, rest.closed, max_feed=self.motions.front_feed)
                           for rest in self._unwalked(way)):
                    return False
            if self._one(points, closed):
                return True
        return False

    def _one(self, points: F64, closed: bool, *, unless_over: bool = False, eased: bool = False,
             max_feed: float = math.inf) -> bool:
        """Cut a line as it is; False where no way leads in, or where ``unless_over`` is set and it exceeds the limit.

        eased    : it goes down all along, with the whole front in stock
        max_feed : mm/min
        """
        if unless_over and not within(self.stock, points, self.field.tool, self.engaged, self.found):
            return False
        arc = np.empty((0, 3))
        if self.walls and not eased:
            arc, points = self._onto(points, closed)
        if len(arc):
            led = np.vstack([arc, points[1:]])
            way: Linker.Way | None = self._straight_on(led, False) or (arc[:1], led, False)
        else:
            way = self._straight_on(points, closed) or self._from_air(points) or self._ramped(points, closed)
        if way is None:
            return False
        entry, cut, joined = way
        if joined:
            self._joined(np.vstack([self.go.here(), entry]))
        else:
            self.go.come_down(entry[0])
            if len(entry) > 1:
                self.go.feed(TrajectoryKind.APPROACH, entry, self.motions.feed)
        if np.linalg.norm(self.go.here() - cut[0]) > 1e-9:
            self.go.feed(TrajectoryKind.APPROACH, np.vstack([self.go.here(), cut[:1]]), self.motions.plunge_feed)
        if len(arc):
            self._led(TrajectoryKind.APPROACH, arc)
            cut = points
        down = len(cut) - 1 if eased else max(len(cut) - len(points), 0)  # moves of the way down
        max_feed = min(max_feed, self.motions.front_feed) if eased else max_feed
        head = min(max_feed, self._descent(cut[:down + 1]))
        if head < min(max_feed, self.motions.feed):
            self._paced(TrajectoryKind.CUT, cut[:down + 1], head)
            self._paced(TrajectoryKind.CUT, cut[down:], max_feed)
        else:
            self._paced(TrajectoryKind.CUT, cut, max_feed)
        self.depths.cut(cut)
        self.passes += 1
        if self.walls and not eased:
            length = Line(points, closed).length
            off = self._arc(cut[-1], cut[-2] - cut[-1], length, onto=False)  # a ring may have been begun elsewhere
            if off is not None:
                self._led(TrajectoryKind.LIFT, off)
        return True

    def _onto(self, points: F64, closed: bool) -> tuple[F64, F64]:
        """An arc (k, 3), mm, onto a pass (n, 3), k = 0 where there is none, and the pass, begun where the arc ends."""
        length = Line(points, closed).length
        starts = sorted({0, *(len(points) * np.arange(1, BEGINNINGS) // BEGINNINGS).tolist()}) if closed else [0]
        for first in starts:
            begun = np.vstack([points[first:-1], points[:first + 1]]) if first else points
            arc = self._arc(begun[0], begun[1] - begun[0], length, onto=True)
            if arc is not None:
                return arc, begun
        return np.empty((0, 3)), points

    def _arc(self, at: F64, way: F64, length: float, *, onto: bool) -> F64 | None:
        """A level arc (k, 3), mm, onto a place (3,) of a pass that continues along ``way``, or off it.

        length : mm, of the pass

        None where the tool is not free on any arc, is barred there, has too much stock on it, or was there before.
        """
        tool = self.field.tool

        def free(arc: F64) -> bool:
            if not bool(self.stock.in_air(arc[:1], tool)[0]):
                return False
            tips = dense(arc, 0.3 * self.field.lattice.step)
            return (self.go.free(tips) and not bool(self.found.bars(tool, tips).any())
                    and self._lane(tips, MAX_OVER * self.motions.step_down))

        for arc in arcs_along(self.field, at, way, length, LEAD_SHARE * self.motions.tolerance):
            walked = arc if onto else np.ascontiguousarray(arc[::-1])
            if int(self.depths.were_cut(walked).sum()) <= MAX_AGAIN and free(arc):
                return walked
        return None

    def _descent(self, points: F64) -> float:
        """Feed along a way down (n, 3), mm, at which its vertical part keeps to the plunge feed, mm/min."""
        way = np.diff(points, axis=0)
        drop, length = -way[:, 2], np.linalg.norm(way, axis=1)
        steepest = float((drop[length > 0.0] / length[length > 0.0]).max(initial=0.0))
        return self.motions.plunge_feed / steepest if steepest > 0.0 else math.inf

    def _paced(self, motion: TrajectoryKind, points: F64, max_feed: float = math.inf) -> None:
        """Follow a way (n, 3), mm, in stretches at feeds that fit the stock there, where a pace is given.

        This holds only where the way removes stock. A finish does not depend on what the stock's lattice shows, nor
        does a way down between passes. In stock the feed never exceeds ``max_feed`` mm/min.
        """
        if len(points) < 2:
            return
        slow = self.pace is None or motion is TrajectoryKind.CONNECT and bool((np.diff(points[:, 2]) < -1e-9).any())
        if self.pace is None or slow:
            self.go.feed(motion, points, min(self.motions.feed, max_feed))
            return
        for air, part, feed in paced(points, self.stock, self.field.tool, self.pace):
            self.go.feed(TrajectoryKind.CONNECT if air else motion, part, feed if air else min(feed, max_feed))

    def _joined(self, way: F64) -> None:
        """Follow a way (n, 3), mm, to the next pass at the feed of links as far as it is in air.

        Its first stretch, and one before stock, may touch stock that the lattice does not show. So may a stretch where
        the proof found too deep a cut.
        """
        for quick, part in self.go.parts(way, seen=True):
            if quick and self.go.too_deep(part):
                self.go.feed(TrajectoryKind.CONNECT, part, self.motions.feed)
            elif quick:
                self.go.feed(TrajectoryKind.CONNECT, part, self.motions.link_feed)
            else:
                self._paced(TrajectoryKind.CONNECT, part)

    def _led(self, motion: TrajectoryKind, arc: F64) -> None:
        """Follow an arc (n, 3), mm, on or off a pass: beside the wall at the feed of the pass, else at that of
        links."""
        for quick, part in self.go.parts(arc, seen=False):
            self.go.feed(motion, part, self.motions.link_feed if quick else self.motions.feed)
        self.depths.cut(arc)

    def keep_down(self, ways: Iterable[F64]) -> bool:
        """Follow the first of some ways that is free and in air, from where the tool is; else lift.

        A way counts only where it is sooner than the clearance plane, where the proof found no cut too deep on it, and
        where it has not been used before: a program that repeats the same moves without cutting looks as if it was
        pasted twice.

        ways : (n, 3) float64, mm, access frame, each

        Returns whether there was one.
        """
        for way in ways:
            steps = np.flatnonzero(np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9)
            if not len(steps):
                return True
            if self.motions.link_seconds(legs(way).tolist()) > self.motions.plane_seconds(way[0], way[-1]) \
                    or self.go.too_deep(way):
                continue
            known = self.gone.were_cut(way) | self.depths.were_cut(way)
            if int(known.sum()) > MAX_AGAIN:
                continue
            free = (self.go.free_move(way[k, :2], way[k + 1, :2], float(way[k:k + 2, 2].max())) for k in steps)
            if self.go.nothing_stands(way) and all(free):
                self.go.feed(TrajectoryKind.CONNECT, way[np.r_[0, steps + 1]], self.motions.link_feed)
                self.gone.cut(way)
                return True
        self.go.lift()
        return False

    def finish(self) -> tuple[Trajectory, ...]:
        """Lift to the clearance plane and return all trajectories."""
        self.go.lift()
        return tuple(self.trajectories)

    # -- ways in ----------------------------------------------------------------------------------------------

    Way = tuple[F64, F64, bool]

    def _straight_on(self, points: F64, closed: bool) -> Way | None:
        if self.at is None:
            return None
        here, start = self.go.here(), points[0]
        run = float(np.hypot(*(start - here)[:2]))
        if run > 4.0 * self.field.tool.radius + 1.0 or abs(start[2] - here[2]) > 2.0 * self.motions.step_down:
            return None
        z = max(here[2], start[2])
        if not self.go.free_move(here[:2], start[:2], z):
            return None
        n = max(2, int(run / 0.2) + 1)
        t = np.linspace(0.0, 1.0, n)[:, None]
        level = np.column_stack([here[:2] + t * (start[:2] - here[:2]), np.full(n, z)])
        if not self._lane(level, self.motions.step_down):
            return None
        over = z - start[2]
        if here[2] < z and not bool(self.stock.in_air(np.vstack([here, [*here[:2], z]]), self.field.tool).all()):
            return None
        entry = np.array([[*here[:2], z], [*start[:2], z]])
        entry = entry[np.r_[True, np.linalg.norm(np.diff(entry, axis=0), axis=1) > 1e-9]]
        if over <= 1e-9:
            return entry, points, True
        if bool(self.stock.in_air(start[None, :], self.field.tool)[0]):
            return np.vstack([entry, start]), points, True
        aside = self._down_aside(points, z)
        if aside is not None:
            return aside, points, True
        ramp = self._ramp(points, closed, over)
        if ramp is None or int(self._known_down(ramp, points).sum()) > MAX_AGAIN:
            return None  # the known part of a way down can be left out only where the tool comes from above
        return entry, ramp, True

    def _down_aside(self, points: F64, z: float) -> F64 | None:
        """From here across at height z, mm, to beside the start of a pass, down there in air, and onto it.

        A flat pass has a long way down along itself, which the tool follows twice. None where this way is longer, or
        where the tool is not free in air.
        """
        here, start, m = self.go.here(), points[0], self.motions
        sooner = 2.0 * (z - start[2]) / (math.tan(m.ramp_angle) * RAMP_SHARE * m.feed)
        for q in itertools.chain(self._air_beside(points), self._been_beside(start) if self._shallow(points) else ()):
            way = np.array([here, [*here[:2], z], [*q[:2], z], q])
            way = way[np.r_[True, np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9]]
            length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
            if length / m.link_feed + float(np.linalg.norm(start - q)) / m.feed > sooner:
                continue
            if (self.go.nothing_stands(way) and self.go.free_move(here[:2], q[:2], z)
                    and int((self.gone.were_cut(way) | self.depths.were_cut(way)).sum()) <= MAX_AGAIN):
                return np.vstack([way[1:], start])
        return None

    def _from_air(self, points: F64) -> Way | None:
        start = points[0]
        if bool(self.stock.in_air(start[None, :], self.field.tool)[0]):
            return start[None, :], points, False
        q = next(self._air_beside(points), None)
        if q is None and self._shallow(points):
            q = next(self._been_beside(start), None)
        return None if q is None else (np.vstack([q, start]), points, False)

    def _air_beside(self, points: F64) -> Iterator[F64]:
        """Places (3,) in air, as high as the start of a pass (n, 3), mm, that lead onto it straight; nearest first."""
        start, tool = points[0], self.field.tool
        ahead = points[1, :2] - start[:2]
        ahead = ahead / max(float(np.hypot(*ahead)), 1e-12)
        left = np.array([-ahead[1], ahead[0]])
        ways = [left, -ahead, (left - ahead) / math.sqrt(2), -left, (left + ahead) / math.sqrt(2)]
        for far in (2.5 * self.stock.lattice.step, *(np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0]) * tool.diameter)):
            for side in ways:
                q = np.array([*(start[:2] + far * side), start[2]])
                if bool(self.stock.in_air(q[None, :], tool)[0]) and self._leads_onto(q, start):
                    yield q

    def _been_beside(self, start: F64) -> Iterator[F64]:
        """Places (3,), mm, as high as a start of a cut, that the tool has reached before, straight beside it."""
        for x, y, _ in self._been(start)[:MAX_BEEN]:
            q = np.array([x, y, start[2]])
            if self._shallow(dense(np.vstack([q, start]), LOOK_EVERY * self.field.tool.radius)):
                if self._leads_onto(q, start):
                    yield q

    def _been(self, start: F64) -> F64:
        """Places (n, 3), mm, close to a start of a cut, that the tool has reached before, as deep or deeper."""
        been = self.depths.near(start[:2], BEEN_NEAR * self.field.tool.diameter)
        return been[been[:, 2] <= start[2]]

    def _shallow(self, points: F64) -> bool:
        """Whether no more than a layer stands over tips (n, 3), mm, skins on the walls beside them included."""
        return float(self.stock.overlap(points, self.field.tool, LOOK_RIM).max()) <= MAX_OVER * self.motions.step_down

    def _leads_onto(self, q: F64, start: F64) -> bool:
        """Whether the tool can go from a place straight across to a start of a cut as high, (3,) mm."""
        if not self.go.free_move(q[:2], start[:2], start[2]) or self.go.limit(q) > q[2] + LEVEL_TOLERANCE:
            return False
        t = np.linspace(0.0, 1.0, max(2, int(np.hypot(*(start - q)[:2]) / 0.2) + 1))[:, None]
        lane = q + t * (start - q)
        return not self.found.bars(self.field.tool, lane).any() and self._lane(lane, MAX_OVER * self.motions.step_down)

    def _lane(self, tips: F64, allowed: float) -> bool:
        """Whether a level lane of tips (n, 3), mm, has at most ``allowed`` mm of stock on it, none above the flutes,
        and keeps the limit of the engaged angle.
        """
        tool = self.field.tool
        return (float(self.stock.overlap(tips, tool, lower_bound=0.0).max()) <= allowed
                and float(self.stock.standing(tips, tool).max()) <= FLUTE_SHARE * tool.flute_length
                and within(self.stock, tips, tool, self.engaged, self.found))

    def _ramped(self, points: F64, closed: bool) -> Way | None:
        tool = self.field.tool
        touched = self.stock.overlap(points, tool, TOUCH_RIM)
        if closed:
            first = int(np.argmin(touched[:-1]))
            points = np.vstack([points[first:-1], points[:first + 1]])
            touched = np.roll(touched[:-1], -first)
        seen = max(float(self.stock.overlap(points, tool, LOOK_RIM).max()), float(touched[0]))
        highest = max(float(self.stock.overlap(points[:1], tool, SURE_RIM)[0]),
                      float(self.stock.under_end(points[:1], tool)[0]))
        # where the tool has been before nothing is left that it could take; an open line is gone down along its head
        slope = math.tan(self.motions.ramp_angle) * RAMP_SHARE
        head = points if closed else head_of(points, 0.5 * (seen + 0.1) / slope)
        above = max(float(self.depths.above(head).max()), 0.0)
        been = self.depths.near(points[0, :2], BEEN_NEAR * tool.diameter)[:, 2].min(initial=math.inf)
        beside = max(float(been - points[0, 2]), 0.0)
        if seen - beside > MAX_OVER * self.motions.step_down:
            beside = math.inf
        for most in (min(beside, above, seen), min(above, seen), seen, max(seen, self.motions.step_down), highest):
            over = most + 0.1
            ramp = self._ramp(points, closed, over) if math.isfinite(over) and over > 0.0 else None
            if ramp is not None:  # over a move it made before a tool stands free, so it begins after the last of these
                known = np.flatnonzero(self._known_down(ramp, points))
                ramp = ramp[int(known[-1]) + 1 if len(known) else 0:]
            entry = self._beside(ramp[0]) if ramp is not None else None
            if ramp is not None and entry is not None:
                return entry, ramp, False
        return None

    def _beside(self, top: F64) -> F64 | None:
        """Where to come down to the top of a ramp: there, or off the wall where no rim can be left.

        Where this tool has cut as deep nothing can be left, however close the stock stands all round.
        """
        tool = self.field.tool
        if self.depths.lowest(top) <= top[2] or bool(self.stock.in_air(top[None, :], tool)[0]):
            return top[None, :]
        for far in (0.06, 0.12, 0.25, 0.5, 1.0):
            ring = top + np.column_stack([far * COMPASS, np.zeros(len(COMPASS))])
            for k in np.flatnonzero(self.stock.in_air(ring, tool)):
                free = self.go.limit(ring[k]) <= top[2] + LEVEL_TOLERANCE
                if free and self.go.free_move(ring[k, :2], top[:2], top[2]):
                    return np.vstack([ring[k], top])
        q = next(self._been_beside(top), None)
        return None if q is None else np.vstack([q, top])

    def _ramp(self, points: F64, closed: bool, over: float) -> F64 | None:
        tool = self.field.tool
        ramp = way_down(points, closed, over, tool, self.motions.ramp_angle, self.found.care(tool, points))
        if ramp is None or not within(self.stock, ramp[:len(ramp) - len(points) + 1], tool, self.engaged, self.found):
            return None
        return ramp

    def _known_down(self, ramp: F64, points: F64) -> NDArray[np.bool_]:
        """Moves of the way down of a ramp, without the pass (n, 3) after it, that the tool has cut before."""
        return self.depths.were_cut(ramp[:len(ramp) - len(points) + 1])


