"""Feeds along a pass that removes stock: that of links in air, and in stock a feed by depth and engaged angle.

The feed of a tool is made for the worst cut of a layer, a slot as deep as the layer. Most of a pass meets less: a ring
takes a strip from the side, a rim takes the allowance, a layer over a step takes next to nothing. Depth and engaged
angle come from the stock map and are rounded up. The slowest feed counts a short distance before and behind. Places are
tips in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import parting, stretch
from toolpath.stock.engagement import SKIN_SHARE, angles
from toolpath.stock.stock_map import AIR_TOLERANCE, SURE_RIM, StockMap

GUARD = 0.1  # diameters, two lattice steps at least: before and after stock the feed is that in stock
LOOKS = 4  # places looked at within the guard
DEPTHS = 8  # depths are rounded up to this part of a layer
ANGLE = math.radians(15.0)  # engaged angles are rounded up to a multiple
STEP = 1.25  # ratio between feeds, so that a program does not change F at every place


@dataclass(frozen=True)
class Pace:
    """Feeds of one tool in layers, mm/min.

    feed   : for the worst cut
    air    : where no stock stands
    under  : feed for a depth, mm, and an engaged angle, rad; ``feed`` is the minimum in cuts no deeper than a layer
    layer  : mm, depth of a layer
    hidden : where the stock map shows nothing, on passes that remove what the map does not show; None: that is air
    rim    : lattice steps by which the disc is larger in which the depth is looked for, as in ``StockMap.overlap``
    """

    feed: float
    air: float
    under: Callable[[float, float], float]
    layer: float
    hidden: float | None = None
    rim: float = -0.8


def paced(points: F64, stock: StockMap, tool: ToolBody, pace: Pace) -> list[tuple[bool, F64, float]]:
    """A pass in stretches: whether each is in air, its points, (m, 3) float64, mm, access frame, and its feed, mm/min.

    Where the stock map shows nothing along the whole pass, the pass removes what the map does not show. Where moves in
    air are no faster than those in stock, the pass stays whole. A pass with a feed for hidden stock has no stretch in
    air.

    points : (n, 3) float64, mm, access frame, tips
    """
    calm = pace.air if pace.hidden is None else pace.hidden
    if max(calm, pace.air) <= pace.feed:
        return [(False, points, pace.feed)]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    guard = max(GUARD * tool.diameter, 2.0 * stock.lattice.step)
    at = np.linspace(0.0, s[-1], max(2, math.ceil(LOOKS * s[-1] / guard) + 1))
    way = np.column_stack([np.interp(at, s, points[:, c]) for c in range(3)])
    busy = stock.overlap(way, tool, SURE_RIM, lower_bound=0.0) > AIR_TOLERANCE
    if not busy.any():
        return [(False, points, pace.feed if pace.hidden is None else pace.hidden)]
    feeds = np.full(len(at), calm)
    feeds[busy] = _in_stock(way, busy, stock, tool, pace)
    feeds = minimum_filter1d(feeds, 2 * LOOKS + 1, mode="nearest")
    # a stretch of higher feed shorter than the guard is left out
    feeds = maximum_filter1d(minimum_filter1d(feeds, LOOKS + 1, mode="nearest"), LOOKS + 1, mode="nearest")
    between = np.minimum(feeds[1:], feeds[:-1])
    near = maximum_filter1d(busy, 2 * LOOKS + 1, mode="nearest")  # stock may be cut as fast as moves in air go
    cuts = near[1:] | near[:-1] | (between < pace.air) | (pace.hidden is not None)
    ends = np.concatenate([[0], np.flatnonzero((np.diff(between) != 0.0) | (np.diff(cuts))) + 1, [len(between)]])
    bounds = parting(points, s, at[ends])
    kinds = np.searchsorted(at, 0.5 * (bounds[1:] + bounds[:-1]), side="right") - 1
    return [(not cuts[k], stretch(points, s, low, high), float(between[k]))
            for k, low, high in zip(kinds.tolist(), bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)]


def _in_stock(way: F64, busy: NDArray[np.bool_], stock: StockMap, tool: ToolBody, pace: Pace) -> NDArray[np.float64]:
    """Feeds at those of the tips (n, 3), mm, of a way that are in stock, (n,) bool: one for each, float64, mm/min.

    Where no angle is engaged the whole front may be in a skin, which does not count. Deeper stock that is not in front
    is missed by a row of nodes. It is no thicker than ``SURE_RIM`` of a step. A cutter that breaks through it has it in
    front over at most 2 arccos (1 - thickness / radius).
    """
    over = stock.overlap(way[busy], tool, pace.rim, lower_bound=0.0)
    depth = np.ceil(over / pace.layer * DEPTHS - 1e-9).astype(np.int64)
    turn = np.ceil(angles(stock, way, tool)[busy] / ANGLE - 1e-9).astype(np.int64)
    missed = 2.0 * math.acos(max(1.0 - SURE_RIM * stock.lattice.step / tool.radius, 0.0))
    deep = over > SKIN_SHARE * tool.radius
    turn[turn == 0] = np.where(deep, math.ceil(missed / ANGLE), round(math.pi / ANGLE))[turn == 0]
    turns = int(turn.max(initial=0)) + 1
    kinds, place = np.unique(depth * turns + turn, return_inverse=True)
    depths = kinds // turns
    known = np.array([pace.under(k // turns * pace.layer / DEPTHS, k % turns * ANGLE) for k in kinds.tolist()])
    if pace.hidden is None:  # a rim has its own bounds
        known = np.where(depths > DEPTHS, known, np.maximum(known, pace.feed))
    else:
        known = np.maximum(known, pace.feed)
    levels = np.floor(np.log(known / pace.feed) / math.log(STEP) + 1e-9)
    return np.minimum(pace.feed * STEP ** levels, max(pace.air, pace.feed))[place.reshape(-1)]
