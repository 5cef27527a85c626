"""A level of stock cleared from the air inwards, with a limit on the engaged angle.

Borders of the cleared area (``toolpath.roughing.inward_fronts``) are cut one after the other; each takes a strip of
what the one before left. They begin along one wall and end along the other, so the tool never goes straight ahead into
stock. Where a line would exceed the limit, lines between are cut first. A line begins where the one before began, or
aslant where that returns to its beginning. Between two lines the tool goes back in air. A helix opens places that no
way leads to from the air. The stock left beside walls where lines end is thinner than the distance between lines; rings
(``strategies.depth_layers``) remove it. Places are tips in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import Line, dense, pieces_where, thinned
from toolpath.linking.linker import Linker
from toolpath.linking.ramp_entry import RAMP_SHARE
from toolpath.passes.contours import moves_free
from toolpath.roughing.inward_fronts import NARROW, Inwards
from toolpath.stock.engagement import LOOK, SKIN_SHARE, SURE, over_limit
from toolpath.workingsteps import CutDirection

FINER = 4  # halvings of the distance between lines where the engaged angle exceeds the limit
ASLANT = 2.0  # distances between lines: how far off a line begins on the one before
BACK = 0.1  # radii off the stock at which the tool goes back
NEAR = 1.6  # distances between lines: a piece of the line before that lies this near comes first
WIDE = 0.9  # radii: largest helix, so that no core is left
TURN = math.radians(10.0)  # between points of a helix
ABOVE = 0.1  # mm over what stands, where a helix begins


@dataclass(frozen=True, eq=False)
class _Piece:
    """A border of the cleared area when the front is ``when`` mm from the air, and the pieces that come before it."""

    line: Line
    when: float
    after: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Clearing:
    """One level to be cleared.

    linker    : Linker; its limit of the engaged angle holds
    z         : mm, tip height of the level
    area      : (ny, nx) bool on the lattice, where stock is removed
    allowance : mm left beside walls
    side_step : mm between lines
    cut_direction : CutDirection of the lines
    worth     : mm of stock over the cutter that justify a pass
    thin      : mm, tolerance of thinning
    """

    linker: Linker
    z: float
    area: NDArray[np.bool_]
    allowance: float
    side_step: float
    cut_direction: CutDirection
    worth: float
    thin: float

    def walk(self) -> None:
        """Clear the area that is reached from the air, then what helices open."""
        for _ in range(2):
            ways = Inwards.over(self.linker.field, self.linker.stock, self.z, self.area, self.allowance, self.worth)
            if ways is None:
                return
            self._inwards(ways)
            shut = [(middle, room) for middle, room in ways.shut() if room > NARROW * self._tool.radius]
            if not any([self._opened(middle, room) for middle, room in shut]):
                return

    @property
    def _tool(self) -> ToolBody:
        return self.linker.field.tool

    def _opened(self, middle: F64, room: float) -> bool:
        """Whether a helix round a place (3,), mm, got down to the level; room : mm there."""
        radius = min(room, WIDE * self._tool.radius)
        stock = self.linker.stock
        over = float(stock.overlap(np.array([middle]), self._tool, radius / stock.lattice.step)[0])
        if not (math.isfinite(over) and over > self.worth):
            return False
        round_way = 2.0 * math.pi * radius
        # a turn takes no more than a skin, which counts as no engagement, for it has the whole cutter in stock
        slope = min(math.tan(self.linker.motions.ramp_angle) * RAMP_SHARE,
                    SURE * SKIN_SHARE * self._tool.radius / round_way)
        turns = (over + ABOVE) / (round_way * slope)
        turn = np.arange(0.0, 2.0 * math.pi * (turns + 1.0) + TURN, TURN)
        height = np.maximum(over + ABOVE - radius * slope * turn, 0.0)
        sense = -1.0 if self.cut_direction.climbs else 1.0
        helix = middle + np.column_stack([radius * np.cos(turn), -sense * radius * np.sin(turn), height])
        return self.linker.add(Line(helix, False), self.thin, eased=True)

    def _inwards(self, ways: Inwards) -> None:
        """Cut the borders, each after those before it: one beside the last where there is any, else the nearest."""
        pieces = self._pieces(ways)
        followers: list[list[int]] = [[] for _ in pieces]
        waits = [len(p.after) for p in pieces]
        for k, p in enumerate(pieces):
            for before in p.after:
                followers[before].append(k)
        ready = [k for k, n in enumerate(waits) if n == 0]
        last: int | None = None
        while ready:
            own = [k for k in ready if last in pieces[k].after] or ready
            here = self.linker.at
            k = own[0] if here is None else min(own, key=lambda k: float(
                np.hypot(*(pieces[k].line.points[0] - here)[:2])))
            ready.remove(k)
            self._piece(ways, pieces[k].line, pieces[k].when, self.side_step, FINER)
            for after in followers[k]:
                waits[after] -= 1
                if waits[after] == 0:
                    ready.append(after)
            last = k

    def _pieces(self, ways: Inwards) -> list[_Piece]:
        out: list[_Piece] = []
        before: list[int] = []
        last = ways.last - 0.5 * self.linker.field.lattice.step
        for when in np.arange(self.side_step, last + self.side_step, self.side_step):
            when = min(float(when), last)
            trees = [(k, cKDTree(out[k].line.points[:, :2])) for k in before]
            before = []
            for line in ways.lines(when):
                for piece in self._in_stock(line):
                    at = piece.points[:, :2]
                    after = tuple(k for k, tree in trees if float(tree.query(at)[0].min()) < NEAR * self.side_step)
                    before.append(len(out))
                    out.append(_Piece(piece, when, after))
        return out

    def _in_stock(self, line: Line) -> list[Line]:
        r = self._tool.radius
        wanted = self.linker.stock.overlap(line.points, self._tool, lower_bound=0.0) > self.worth
        return pieces_where(line, wanted, 0.6 * r, 3.0 * r)

    def _piece(self, ways: Inwards, line: Line, when: float, step: float, finer: int) -> None:
        """Cut a line, and before it lines between it and the cleared area where the engaged angle would exceed the
        limit.

        when : mm, of the line; step : mm, since the one before
        """
        places = dense(line.points, LOOK * self._tool.radius)
        over = over_limit(self.linker.stock, places, self._tool, self.linker.engaged)
        if over.any() and finer:
            bad = cKDTree(places[over, :2])
            for between in ways.lines(when - 0.5 * step):
                near = bad.query(between.points[:, :2])[0] < step + 0.5 * self._tool.radius
                for piece in pieces_where(between, near, 0.5 * self._tool.radius, self._tool.radius):
                    for part in self._in_stock(piece):
                        self._piece(ways, part, when - 0.5 * step, 0.5 * step, finer - 1)
        line = self._begun(ways, line, when - step)
        if self.linker.at is not None and self.linker.at[2] == self.z:
            self.linker.keep_down(self._ways_back(ways, when - step, line.points[0]))
        self.linker.add(line, self.thin)

    def _begun(self, ways: Inwards, line: Line, gone: float) -> Line:
        """A line in its cut direction, from where the border at ``gone`` begins or passes by."""
        here, flip = self.linker.at, not self.cut_direction.climbs
        if self.cut_direction.both_ways and here is not None:
            ends = np.hypot(*(line.points[[0, -1], :2] - here[:2]).T)
            flip = bool(ends[1] < ends[0])
        points = line.points[::-1] if flip else line.points
        before = [b.points for b in ways.lines(gone)]
        if not before:
            return Line(points, line.closed)
        if line.closed:
            points = dense(points, LOOK * self._tool.radius)[:-1]
            k = 0 if here is None else int(np.argmin(np.hypot(*(points[:, :2] - here[:2]).T)))
            points = np.vstack([points[k:], points[:k + 1]])
            along = np.cumsum(np.hypot(*np.diff(points[::-1, :2], axis=0).T))
            start = points[-2 - int(np.searchsorted(along, ASLANT * self.side_step).clip(0, len(along) - 1))]
            ends = np.vstack(before)
        else:
            start = points[0]
            ends = np.vstack([b[[-1 if flip else 0]] for b in before])
        off = np.hypot(*(ends[:, :2] - start[:2]).T)
        k = int(np.argmin(off))
        led = np.vstack([ends[k], points])
        if off[k] > ASLANT * self.side_step or not moves_free(ways.field, led[:2]).all():
            return Line(points, line.closed)
        return Line(led, False)

    def _ways_back(self, ways: Inwards, gone: float, to: F64) -> Iterator[F64]:
        """Ways in air from where the tool is to a place (3,), mm: straight, or along what it just left."""
        here = self.linker.at
        assert here is not None
        yield np.array([here, to])
        for when in (gone - BACK * self._tool.radius, gone - 0.5 * self.side_step):
            for line in ways.lines(when):
                points = line.points
                a, b = (int(np.argmin(np.hypot(*(points[:, :2] - p[:2]).T))) for p in (here, to))
                if a != b:
                    part = points[a:b + 1] if a < b else points[b:a + 1][::-1]
                    yield np.vstack([here, thinned(part, 0.5 * BACK * self._tool.radius), to])
