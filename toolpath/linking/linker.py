"""Links passes to one safe motion: ways in, ways between passes, ways out.

Stock that stands higher over a pass than the flutes reach is removed first, above the pass. In a gap that only just
fits the tool, it is removed layer by layer. ``toolpath.linking.ways_in`` finds the way into a pass; a pass without one
is left out. ``toolpath.linking.rapid_travel`` brings the tool to the beginning of that way. Where the engaged angle has
a limit (``toolpath.stock.engagement``) a pass that would exceed it is skimmed first.

Places are tips in mm, access frame.
"""

from __future__ import annotations

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
from toolpath.linking.rapid_travel import Motions, Travel
from toolpath.linking.ways_in import FLUTE_SHARE, LOOK_EVERY, LOOK_RIM, MAX_AGAIN, MAX_OVER, Way, WaysIn
from toolpath.stock.cut_history import Depths, still_to_walk
from toolpath.stock.engagement import UNBOUNDED, skims, within
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.reach.tip_field import TipField


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
        self.ways = WaysIn(self.go, self.depths, self.gone, self.engaged)

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
        if (over.max() <= MAX_OVER * step or not len(self.ways.been(points[0]))
                or bool(self.stock.in_air(points[:1], tool)[0])
                or next(self.ways.air_beside(points), None) is not None):
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
            arc, points = self.ways.onto(points, closed)
        if len(arc):
            led = np.vstack([arc, points[1:]])
            way: Way | None = self.ways.straight_on(led, False) or (arc[:1], led, False)
        else:
            way = (self.ways.straight_on(points, closed) or self.ways.from_air(points)
                   or self.ways.down(points, closed))
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
            # a ring may have been begun elsewhere
            off = self.ways.arc(cut[-1], cut[-2] - cut[-1], length, onto=False)
            if off is not None:
                self._led(TrajectoryKind.LIFT, off)
        return True

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
