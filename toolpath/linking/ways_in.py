"""Ways into a pass, from where the tool is or from above.

The linker tries them in this order.

1. From the end of a pass straight on to the next one, where the level move between them is free and removes no more
   than a layer. Down to a deeper level the tool goes in air, there or beside its start, or along the pass itself, never
   steeper than the ramp angle.
2. Down in air over the start of the pass, or over a free place beside it that is in air or that the tool has reached
   before, and in from there.
3. Down a ramp along the pass, round a closed one from where least stock is touched, back and forth on an open one. Its
   top is in air or just above an earlier cut, or a free place close beside it is.
4. Instead of a ramp longer than an open pass: down in air over its end, and back along it to its start.

A pass along a wall begins and ends on an arc (``toolpath.linking.lead_arcs``) where the tool is free on it and clear of
stock at its far end; ways 1 and 2 lead to that end. Where the engaged angle has a limit
(``toolpath.stock.engagement``) ways in keep it.

Places are tips in mm, access frame.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.lines import Line, dense
from toolpath.linking.lead_arcs import arcs_along
from toolpath.linking.ramp_entry import ROUNDING, digs_down, head_of, ramped_part, steepest_ramp, way_down
from toolpath.linking.rapid_travel import Travel
from toolpath.scallop_budget import LEAD_SHARE
from toolpath.stock.cut_history import Depths
from toolpath.stock.engagement import UNBOUNDED, within
from toolpath.stock.stock_map import SKIN, SURE_RIM
from zones.reach.tip_field import LEVEL_TOLERANCE

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

Way = tuple[F64, F64, bool]
"""The way to the start of a cut (k, 3), mm, the cut (n, 3), mm, and whether the tool goes there without lifting."""


@dataclass
class WaysIn:
    """Finds ways into passes.

    go      : Travel, the tool in the stock of the step
    depths  : Depths of the tool
    gone    : Depths, ways back in air
    engaged : rad, largest engaged angle of the front of the cutter
    """

    go: Travel
    depths: Depths
    gone: Depths
    engaged: float = UNBOUNDED

    def __post_init__(self) -> None:
        self.field, self.stock = self.go.field, self.go.stock
        self.motions, self.found = self.go.motions, self.go.found

    def onto(self, points: F64, closed: bool) -> tuple[F64, F64]:
        """An arc onto a pass, and the pass, begun where the arc ends.

        points : (n, 3) float64, mm, access frame, of the pass

        Returns (k, 3) and (n, 3) float64, mm, access frame; k = 0 where there is no arc.
        """
        length = Line(points, closed).length
        starts = sorted({0, *(len(points) * np.arange(1, BEGINNINGS) // BEGINNINGS).tolist()}) if closed else [0]
        for first in starts:
            begun = np.vstack([points[first:-1], points[:first + 1]]) if first else points
            arc = self.arc(begun[0], begun[1] - begun[0], length, onto=True)
            if arc is not None:
                return arc, begun
        return np.empty((0, 3)), points

    def arc(self, at: F64, way: F64, length: float, *, onto: bool) -> F64 | None:
        """A level arc onto a place of a pass, or off it.

        at, way : (3,) float64, mm, access frame, the place, and the way on which the pass continues there
        length  : mm, of the pass

        Returns (k, 3) float64, mm, access frame. None where the tool is not free on any arc, is barred there, has too
        much stock on it, or was there before.
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

    def straight_on(self, points: F64, closed: bool) -> Way | None:
        """From where the tool is across to the start of a pass; None where there is no such way.

        points : (n, 3) float64, mm, access frame, of the pass
        """
        if self.go.at is None:
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
        sooner = 2.0 * (z - start[2]) / (steepest_ramp(m.ramp_angle, 1.0) * m.feed)
        for q in itertools.chain(self.air_beside(points), self._been_beside(start) if self._shallow(points) else ()):
            way = np.array([here, [*here[:2], z], [*q[:2], z], q])
            way = way[np.r_[True, np.linalg.norm(np.diff(way, axis=0), axis=1) > 1e-9]]
            length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
            if length / m.link_feed + float(np.linalg.norm(start - q)) / m.feed > sooner:
                continue
            if (self.go.nothing_stands(way) and self.go.free_move(here[:2], q[:2], z)
                    and int((self.gone.were_cut(way) | self.depths.were_cut(way)).sum()) <= MAX_AGAIN):
                return np.vstack([way[1:], start])
        return None

    def from_air(self, points: F64) -> Way | None:
        """Down in air over the start of a pass, or beside it; None where there is no such place.

        points : (n, 3) float64, mm, access frame, of the pass
        """
        start = points[0]
        if bool(self.stock.in_air(start[None, :], self.field.tool)[0]):
            return start[None, :], points, False
        q = next(self.air_beside(points), None)
        if q is None and self._shallow(points):
            q = next(self._been_beside(start), None)
        return None if q is None else (np.vstack([q, start]), points, False)

    def air_beside(self, points: F64) -> Iterator[F64]:
        """Places in air, as high as the start of a pass, that lead onto it straight; nearest first.

        points : (n, 3) float64, mm, access frame, of the pass

        Yields (3,) float64, mm, access frame.
        """
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
        for x, y, _ in self.been(start)[:MAX_BEEN]:
            q = np.array([x, y, start[2]])
            if self._shallow(dense(np.vstack([q, start]), LOOK_EVERY * self.field.tool.radius)):
                if self._leads_onto(q, start):
                    yield q

    def been(self, start: F64) -> F64:
        """Places close to the start of a cut that the tool has reached before, as deep or deeper.

        start : (3,) float64, mm, access frame

        Returns (n, 3) float64, mm, access frame.
        """
        been = self.depths.near(start[:2], BEEN_NEAR * self.field.tool.diameter)
        return been[been[:, 2] <= start[2]]

    def _shallow(self, points: F64) -> bool:
        """Whether no more than a layer stands over tips (n, 3), mm, skins on the walls beside them included."""
        return self._stands_over(points) <= MAX_OVER * self.motions.step_down

    def _stands_over(self, points: F64) -> float:
        """Most stock over tips (n, 3), mm, skins on the walls beside them included."""
        return float(self.stock.overlap(points, self.field.tool, LOOK_RIM).max())

    def _under_stock(self, points: F64) -> float:
        """Share of a polyline of tips (n, 3), mm, in plan, that has stock right over the tip."""
        along = dense(points, LOOK_EVERY * self.field.tool.radius)
        over = self.stock.overlap(along, self.field.tool, 1.0 - self.field.tool.radius / self.stock.lattice.step) > 0.0
        length = np.hypot(*np.diff(along[:, :2], axis=0).T)
        return float(length[over[:-1] | over[1:]].sum() / max(float(length.sum()), 1e-12))

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

    def ramped(self, points: F64, closed: bool) -> Way | None:
        """Down a ramp along a pass; None where none keeps clear.

        points : (n, 3) float64, mm, access frame, of the pass
        """
        tool = self.field.tool
        touched = self.stock.overlap(points, tool, TOUCH_RIM)
        if closed:
            first = int(np.argmin(touched[:-1]))
            points = np.vstack([points[first:-1], points[:first + 1]])
            touched = np.roll(touched[:-1], -first)
        seen = max(self._stands_over(points), float(touched[0]))
        highest = max(float(self.stock.overlap(points[:1], tool, SURE_RIM)[0]),
                      float(self.stock.under_end(points[:1], tool)[0]))
        # where the tool has been before nothing is left that it could take; an open line is gone down along its head
        slope = steepest_ramp(self.motions.ramp_angle, 1.0)
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

    def down(self, points: F64, closed: bool) -> Way | None:
        """Down along a pass, on a ramp or from its other end, whichever is shorter; None where there is neither.

        points : (n, 3) float64, mm, access frame, of the pass
        """
        ramp, length = self.ramped(points, closed), Line(points, closed).length
        if closed or ramp is not None and Line(ramp[1], False).length <= 2.0 * length:
            return ramp
        return self._back_along(points) or ramp

    def _back_along(self, points: F64) -> Way | None:
        """Down in air over the end of an open pass, or beside it, and back along the pass to its start.

        points : (n, 3) float64, mm, access frame, of the pass

        On the way back the tool loses a skin at most. None where it would go down steeper than a ramp through more
        than that, or where the way breaks the limit of the engaged angle.
        """
        tool = self.field.tool
        care = self.found.care(tool, points)
        slope, skin = steepest_ramp(self.motions.ramp_angle, care), care * SKIN * tool.diameter
        back = np.ascontiguousarray(points[::-1])
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(back[:, :2], axis=0).T))])
        lift = min(skin, slope * float(s[-1])) * (1.0 - s / max(float(s[-1]), 1e-12))
        back = back + np.column_stack([np.zeros((len(back), 2)), lift])
        drop, run = -np.diff(back[:, 2]), np.diff(s)
        for k in np.flatnonzero(drop > slope * run * (1.0 + 1e-9) + ROUNDING):
            over = self.stock.overlap(dense(back[k:k + 2], LOOK_EVERY * tool.radius), tool, LOOK_RIM, lower_bound=0.0)
            if float(over.max()) > skin:
                return None
        if not self._lane(dense(back, LOOK_EVERY * tool.radius), MAX_OVER * self.motions.step_down):
            return None
        way = self.from_air(back)
        return None if way is None else (way[0], np.vstack([back, points[1:]]), False)

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
        """Down a ramp along a pass; None where it is too short, breaks the limit of the engaged angle, or plunges.

        Where it goes down steeper than a ramp, the stock over it must not stand higher than its top: its first way
        down would take all of that at once.
        """
        tool = self.field.tool
        care = self.found.care(tool, points)
        slope, stands = steepest_ramp(self.motions.ramp_angle, care), 1.0
        if digs_down(points, closed, over, slope):
            part = ramped_part(points, closed, over, slope)
            if self._stands_over(part) > over:
                return None
            stands = self._under_stock(part)
        ramp = way_down(points, closed, over, tool, self.motions.ramp_angle, care, stands)
        if ramp is None or not within(self.stock, ramp[:len(ramp) - len(points) + 1], tool, self.engaged, self.found):
            return None
        return ramp

    def _known_down(self, ramp: F64, points: F64) -> NDArray[np.bool_]:
        """Moves of the way down of a ramp, without the pass (n, 3) after it, that the tool has cut before."""
        return self.depths.were_cut(ramp[:len(ramp) - len(points) + 1])
