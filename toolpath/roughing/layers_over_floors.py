"""Heights of depth layers over floors.

Layers are even between the top of the stock and the lowest tip. What they leave on a floor in between is cut at the
feed of its finish, in a slot by the whole width of the tool. So some floors end the even layers above them, and the
others have a layer of their own, whichever takes all layers together less time in the stock.

Places are in mm, access frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.plan_settings import CutData
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import STOCK_WORTH, layer_heights

LEFT = 0.25  # of a layer: what its finish takes off a floor in any case
MAX_FLOORS = 40  # the largest ones may end even layers
FEW = 8  # floors: of no more, heights above them are tried too
LAYER = 0.2  # of all cells: ways along walls, ways in and links of a layer, whatever its area
SLOWER = 0.35  # of a layer: what it costs to leave a floor as much as its finish takes
RAISED = (0.0, 0.5, 0.98)  # of what is left to a floor, how far above it layers may end
COLUMNS = 2**31  # in a row of cells, more than there can be


def left_to_floors(fine: CutData, tool: ToolBody, low: float, step: float) -> float:
    """Depth, mm, that the finish of a floor takes by the whole width of the tool without bending it too far.

    It is ``LEFT`` of a layer at least, and where nothing tells how far the tool bends.

    fine : of the finish; low : mm, what layers leave, which its feed is made for; step : mm, of the deepest layer
    """
    flat = 1.6 * tool.flat_radius
    bending, feed, least, most = fine.bending, fine.under(low, flat).feed, LEFT * step, step
    if bending is None:
        return least

    def bears(depth: float) -> bool:  # also where the setup gives the feed, which is never reduced
        return bending.deflection(feed, depth, tool.diameter) <= bending.limit

    if bears(most):
        return most
    while most - least > 0.01 * step:
        middle = 0.5 * (least + most)
        least, most = (middle, most) if bears(middle) else (least, middle)
    return least


def _tops(stock: StockMap, places: F64) -> F64:
    """(n,) float64, mm: top of the stock over places, (n, 3) float64, mm."""
    return np.asarray(stock.top[stock.lattice.cells(places[:, :2])], np.float64)


def _cells(places: F64, wide: float) -> NDArray[np.int64]:
    """(n,) int64, index: cells of the plan view, wide mm, that places (n, 3), mm, are in."""
    row, column = np.floor(places[:, :2].T / wide).astype(np.int64)
    return row * COLUMNS + column


@dataclass(frozen=True)
class Columns:
    """Stock over what a tool finishes, in cells of the plan view.

    low, high : (n,) float64, mm: lowest tip at a sample of each cell, and top of the stock over its samples
    step      : mm, of the deepest layer
    share     : of the usual feed in a layer as deep as that; in thinner ones the feed rises until it is the usual one
    """

    low: F64
    high: F64
    step: float
    share: float

    @classmethod
    def of(cls, tips: F64, stock: StockMap, wide: float, cut: CutData) -> Columns:
        """Those of a stock.

        tips : (n, 3) float64, mm, access frame, at samples; wide : mm, side of a cell; cut : CutData of the layers
        """
        _, of = np.unique(_cells(tips, wide), return_inverse=True)
        low, high = np.full(of.max(initial=-1) + 1, np.inf), np.full(of.max(initial=-1) + 1, -np.inf)
        np.minimum.at(low, of, tips[:, 2])
        np.maximum.at(high, of, _tops(stock, tips))
        return cls(low, high, cut.step_down, 1.0 if cut.bend is None else cut.bend.share)

    def price(self, thick: F64) -> F64:
        """Time in stock of a thickness as a part of that in the deepest layer, (n,) float64, dimensionless.

        thick : (n,) float64, mm
        """
        return np.where(thick > STOCK_WORTH, np.maximum(self.share, thick / self.step), 0.0)

    def met(self, upper: float, heights: Sequence[float]) -> float:
        """Time of layers, as a count of cells of the deepest one.

        upper, heights : mm, of the layer above them, and of theirs, descending
        """
        out = LAYER * len(self.low) * len(heights)
        for above, z in pairwise([upper, *heights]):
            out += float(self.price(np.where(self.low <= z, np.minimum(self.high, above) - z, 0.0)).sum())
        return out


@dataclass(frozen=True)
class Floors:
    """Floors, those less than ``apart`` mm below another one together with it.

    by_height : height, mm, of each, descending; tips (k, 3) float64, mm, above its samples by what layers leave there
    top       : (m,) float64, mm, highest stock over each
    cells     : (m,) int64, count of the cells of the plan view it fills
    apart     : mm, what may be left on a floor, more than layers leave
    """

    by_height: tuple[tuple[float, F64], ...]
    top: F64
    cells: NDArray[np.int64]
    apart: float

    @classmethod
    def of(cls, level: F64, stock: StockMap, wide: float, apart: float) -> Floors:
        """Those of some samples.

        level : (n, 3) float64, mm, access frame: tips above the samples of all floors by what layers leave there
        wide  : mm, side of a cell; apart : mm
        """
        level = level[np.argsort(-level[:, 2], kind="stable")]
        floors = []
        while len(level):
            mine = level[:, 2] > level[0, 2] - apart
            floors.append((float(level[0, 2]), level[mine]))
            level = level[~mine]
        return cls(tuple(floors), np.array([_tops(stock, t).max() for _, t in floors]),
                   np.array([len(np.unique(_cells(t, wide))) for _, t in floors], np.int64), apart)

    @property
    def heights(self) -> F64:
        """(m,) float64, mm, descending."""
        return np.array([z for z, _ in self.by_height])

    def left(self, heights: Sequence[float]) -> F64:
        """What layers leave on each floor between them, (m,) float64, mm; 0 elsewhere.

        heights : mm, of the top of the stock and of the layers, descending
        """
        rising, z = np.array(heights[::-1]), self.heights
        above = rising[np.minimum(np.searchsorted(rising, z - 1e-3), len(rising) - 1)]
        return np.where((z > rising[0]) & (z < rising[-1]), np.maximum(np.minimum(above, self.top) - z, 0.0), 0.0)

    def left_by(self, heights: Sequence[float]) -> list[tuple[float, F64]]:
        """Those of ``by_height`` that need a layer of their own: height and tips (k, 3) float64, mm, access frame.

        heights : mm, as in ``left``
        """
        return [floor for floor, left in zip(self.by_height, self.left(heights) > self.apart, strict=True) if left]


def even_between(top: float, bottom: float, columns: Columns, floors: Floors) -> list[float]:
    """Heights between which layers are even, mm, descending: the top of the stock, ends on floors, and the last layer.

    Of all choices of floors, or of places above them by what is left to their finish, that one is taken with which the
    layers take the least time. What is left to a finish counts as a part of a layer.
    """
    chosen = np.sort(np.argsort(-floors.cells, kind="stable")[:MAX_FLOORS])
    raised = np.add.outer(floors.heights[chosen], floors.apart * np.array(RAISED[:3 if len(chosen) <= FEW else 1]))
    ends = [top, *np.unique(raised[(raised > bottom) & (raised < top)])[::-1].tolist(), bottom]

    def between(upper: float, lower: float) -> float:
        heights = layer_heights(upper, lower, columns.step)
        left = floors.left([upper, *heights])
        own = np.where(left > floors.apart, columns.price(left), SLOWER * left / floors.apart)
        return columns.met(upper, heights) + float((floors.cells * own).sum())

    best: list[tuple[float, list[float]]] = [(0.0, [top])]
    for z in ends[1:]:
        best.append(min((cost + between(way[-1], z), [*way, z]) for cost, way in best))
    return best[-1][1]


__all__ = ["Columns", "Floors", "even_between", "left_to_floors"]
