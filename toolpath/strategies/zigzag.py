"""Passes dragged over shallow area: straight ones back and forth or one way, or a spiral."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.cutter.cutter import Cutter
from toolpath.lines import Line, dense, pieces_where
from toolpath.passes.contours import serving
from toolpath.passes.dragged_path import limit_of
from toolpath.passes.feed_direction import best_direction
from toolpath.passes.pass_family import Dragged, FinishTarget, Pass, Promise, Swath
from toolpath.passes.side_step import lay_out
from toolpath.plan_settings import Pattern
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.spiral import Rings, spiralled
from zones.reach.tip_field import TipField

MIN_STEP = 0.02  # mm between passes of a round
WORTH_A_SPIRAL = 8  # least straight passes at which a spiral is tried
STEEP = 0.05  # mm per mm in plan, 3 degrees: a pass that goes down steeper may need raised copies of itself


@dataclass(frozen=True, eq=False)
class PassLayout:
    """Passes of an area, and the data to add more between them.

    pattern   : ZIGZAG, ONE_WAY or SPIRAL
    swath     : the area along the feed
    places    : (k,) float64, mm, where whole passes lie; distance from the border for a spiral
    lines     : in order of machining
    way       : mm, with the cost of links
    climb     : one way and spiral have the stock on the right, else on the left; zigzag has it on either side
    rejected  : longer patterns, with their way
    """

    pattern: Pattern
    swath: Swath
    places: F64
    lines: tuple[Line, ...]
    way: float
    climb: bool
    rejected: tuple[tuple[Pattern, float], ...] = ()

    @property
    def side_step(self) -> float:
        """Median distance between neighbouring whole passes in plan, mm; of a single one, the first guess."""
        usual = float(np.median(np.diff(self.places))) if len(self.places) > 1 else self.swath.guess
        return max(usual, MIN_STEP)

    def near(self, failing: NDArray[np.int64]) -> list[Line]:
        """The parts of the lines that serve some samples of the area: a side step round their tips.

        failing : (n,) int64, index of the samples
        """
        target, promise = self.swath.target, self.swath.promise
        return serving(self.lines, target.tips[failing, :2], self.side_step, target.spacing, promise.overrun,
                       promise.link)

    def between(self, k: int, failing: NDArray[np.int64]) -> list[Line]:
        """Lines of refining round k >= 1 along the feed, where samples still fail: the distance divided by 2^k.

        failing : (n,) int64, index of the samples
        """
        swath, step, parts = self.swath.subset(failing), self.side_step, 2 ** k
        if not len(swath.t):
            return []
        at = np.array([swath.t[0] - step, swath.t[-1] + step])
        if self.pattern is not Pattern.SPIRAL and len(self.places):
            at = np.concatenate([self.places[:1] - step, self.places, self.places[-1:] + step])
        # the area may have gaps across the passes: no two places are farther apart than a step there
        most = np.maximum(np.ceil(np.diff(at) / (1.5 * step)), 1.0)
        at = np.interp(np.arange(most.sum() + 1.0), np.concatenate([[0.0], np.cumsum(most)]), at)
        grid = np.interp(np.arange(parts * (len(at) - 1) + 1) / parts, np.arange(len(at)), at)
        made = [swath.pass_at(t, max(width, MIN_STEP))
                for t, width in zip(grid[1::2].tolist(), (0.5 * (grid[2::2] - grid[:-1:2])).tolist(), strict=True)]
        return one_way(made, self.climb) if self.pattern is Pattern.ONE_WAY else to_and_fro(made)


def laid(field: TipField, target: FinishTarget, promise: Promise, pattern: Pattern = Pattern.AUTO,
         climb: bool = True) -> PassLayout:
    """Passes over an area: in the best direction of feed, or as a spiral.

    field   : TipField
    target  : Target, tips with the allowance of the field
    promise : Promise
    pattern : Pattern
    climb   : as in ``PassLayout``
    """
    dragged = Dragged(Cutter.of(field.tool), field.tips, field.tree, field.allowance, limit_of(field))
    swath = Swath(dragged, target, promise, best_direction(dragged, target, promise))
    made = []
    if pattern is not Pattern.SPIRAL:
        passes = lay_out(swath)
        straight = one_way(passes, climb) if pattern is Pattern.ONE_WAY else to_and_fro(passes)
        kind = Pattern.ONE_WAY if pattern is Pattern.ONE_WAY else Pattern.ZIGZAG
        made.append(_layout(kind, swath, [p.at for p in passes if p.whole], straight, climb))
    if len(swath.t) and (pattern is Pattern.SPIRAL or (pattern is Pattern.AUTO and _of_a_piece(made[0]))):
        rings = Rings(dragged, target, promise)
        places = [p.at for p in lay_out(rings, subdivide=False)]
        turns = [Line(p, False) for p in spiralled(rings, places, climb)]
        if turns:
            made.append(_layout(Pattern.SPIRAL, swath, places, turns, climb))
    if not made:  # too small for a ring
        return laid(field, target, promise, Pattern.ZIGZAG, climb)
    made.sort(key=lambda m: m.way)
    return replace(made[0], rejected=tuple((m.pattern, m.way) for m in made[1:]))


def _of_a_piece(straight: PassLayout) -> bool:
    """Whether an area is large and whole enough for a spiral to be tried."""
    return WORTH_A_SPIRAL <= len(straight.places) and len(straight.lines) <= 2 * len(straight.places)


def _layout(pattern: Pattern, swath: Swath, places: list[float], lines: list[Line], climb: bool) -> PassLayout:
    way = sum(line.length for line in lines) + swath.promise.link * len(lines)
    return PassLayout(pattern, swath, np.array(places), tuple(lines), way, climb)


def to_and_fro(passes: list[Pass] | tuple[Pass, ...]) -> list[Line]:
    """Passes as lines in order across, every second one in the other direction."""
    out: list[Line] = []
    flip = False
    for p in passes:
        lines = [Line(q, False) for q in p.lines]
        out.extend([line.reversed() for line in reversed(lines)] if flip else lines)
        flip ^= bool(lines)
    return out


def one_way(passes: list[Pass] | tuple[Pass, ...], climb: bool) -> list[Line]:
    """Passes as lines in order across, all in one direction: against the feed for climb milling, else along it.

    The next pass, where the stock is, lies to the left of the feed.
    """
    lines = [Line(q, False) for p in passes for q in p.lines]
    return [line.reversed() for line in lines] if climb else lines


def skimmed(line: Line, stock: StockMap, tool: ToolBody, skin: float, slope: float, wall: bool = False) -> list[Line]:
    """A pass, preceded by raised copies of itself where going downhill would remove more than a skin at once.

    line  : Line; level ones are returned alone
    stock : StockMap as it stands
    skin  : mm, largest depth removed in a descent
    slope : mm per mm, of the ramp that the tool may descend for any length
    wall  : beside a wall the flank cuts stock at the side of the tool: only stock under the end counts, and only where
            the pass goes down

    Returns
    -------
    list of Line
        The layers of each piece from the top down; the pass itself is last.

    Notes
    -----
    Only sideways, level or rising moves work off a descent. Over a piece with a length s of such way each layer after
    the first adds ``slope`` times s. So a place where stock stands h above the pass is cut in n equal layers, n the
    least with h / n <= skin and, where it goes down, h - (n - 1) slope s <= skin. A piece that goes downhill for most
    of its way is cut uphill but for the pass itself where that needs fewer layers, on whichever side the stock then is.
    """
    rise = np.ptp(line.points[:, 2])
    if rise < 1e-6:
        return [line]
    points = dense(line.points, 0.3 * tool.radius)
    deep = _steep_stock(points, stock, tool, wall)
    out: list[Line] = []
    for piece in pieces_where(Line(points, False), deep > skin, tool.radius, 4.0 * tool.radius):
        way = dense(piece.points, 0.3 * tool.radius)
        over = _steep_stock(way, stock, tool, wall)
        back = np.maximum(over[::-1], _steep_stock(way[::-1], stock, tool, wall))
        layers, uphill = _layers(way, over, skin, slope), _layers(way[::-1], back, skin, slope)
        if uphill < layers:
            piece, over, layers = piece.reversed(), back, uphill
        out.extend(Line(piece.points + np.array([0.0, 0.0, k * float(over.max()) / layers]), False)
                   for k in range(layers - 1, 0, -1))
    return [*out, line]


def _layers(way: F64, over: F64, skin: float, slope: float) -> int:
    """Number of layers in which a way (n, 3) is cut, with ``over`` (n,) mm of stock on it."""
    move = np.diff(way, axis=0)
    aside = np.hypot(move[:, 0], move[:, 1])
    down = -move[:, 2] > slope * aside
    dug = float(np.maximum(over[:-1], over[1:])[down].max(initial=0.0))
    earned = slope * float(aside[~down].sum())
    return max(math.ceil(float(over.max()) / skin), 1 + math.ceil(max(dug - skin, 0.0) / max(earned, 1e-3)))


def _steep_stock(points: F64, stock: StockMap, tool: ToolBody, wall: bool) -> F64:
    """Height of stock above the cutter where the pass goes up or down, (n,) float64, mm; 0 elsewhere.

    On a wall it is the height above the end of the cutter, where the pass goes down.
    """
    move = np.diff(points, axis=0)
    rise = -move[:, 2] if wall else np.abs(move[:, 2])
    steep = rise > STEEP * np.hypot(move[:, 0], move[:, 1])
    steep = np.concatenate([steep, [False]]) | np.concatenate([[False], steep])
    over = stock.under_end(points, tool) if wall else stock.overlap(points, tool, -0.3)
    if tool.tip_curvature == 0.0:  # the edge of a flat cuts going down, and a short move takes no more than a rim
        over = np.maximum(over, stock.standing(points, tool))
    return np.where(np.isfinite(over) & steep, over, 0.0)
