"""Engaged angle of a cutter in the planner's stock, and the skims before a pass that would exceed its limit.

The engaged angle is that of the front half of the cutter, 180 degrees in a slot. Stock no deeper than a twentieth of
the radius is skimmed and does not count (``verify.material.engagement`` counts alike, with a model of its own). A pass
that would exceed the limit is first skimmed from the top down, only there. Places are tips in mm, access frame.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.drop import cutter_shape, one_thread
from geometry.tool_body import ToolBody
from toolpath.counterexamples import NONE, Counterexamples
from toolpath.kernels.engaged import joined, sectors, sectors_parallel
from toolpath.lines import Line, dense, pieces_where
from toolpath.stock.stock_map import StockMap

UNBOUNDED = math.pi  # rad: the whole front half may be in stock
SKIN_SHARE = 0.05  # of the radius: stock that thin over the cutter is no engagement
SURE = 0.95  # of a skin: stock is known at nodes
CLOSE = 1e-6  # rad: angles are multiples of a sector, and a limit may be one
LOOK = 0.1  # radii between places at which the angle is computed
WINDOW = 0.5  # radii of way over which the places met are combined
BEYOND = 0.5  # radii that a skim extends beyond the place that exceeds the limit


def angles(stock: StockMap, points: F64, tool: ToolBody) -> F64:
    """Engaged angle along a line of tips in the stock as it stands, (n,) float64, rad.

    points : (n, 3) float64, mm, access frame

    It counts the places of stock met over half a radius of way. It is too large by at most the width of a node.
    """
    ways = np.diff(points[:, :2], axis=0)
    ways = np.vstack([ways, ways[-1:]])
    ways /= np.maximum(np.hypot(ways[:, 0], ways[:, 1]), 1e-12)[:, None]
    out, lat = np.empty(len(points)), stock.lattice
    met = np.zeros(len(points), np.int64)
    mark = sectors if one_thread(int(len(points) * (tool.radius / lat.step) ** 2)) else sectors_parallel
    tips = np.ascontiguousarray(points)
    mark(stock.top, lat.x0, lat.y0, lat.step, tips, np.ascontiguousarray(ways), cutter_shape(tool),
         SKIN_SHARE * tool.radius, met)
    joined(met, tips, WINDOW * tool.radius, out)
    return out


def over_limit(stock: StockMap, points: F64, tool: ToolBody, max_angle: float,
               found: Counterexamples = NONE) -> NDArray[np.bool_]:
    """Whether tips of a line exceed the limit of the engaged angle, (n,) bool.

    points    : (n, 3) float64, mm, access frame
    max_angle : rad
    found     : findings of a proof; its crowded places count wherever there is stock
    """
    if max_angle >= UNBOUNDED:
        return np.zeros(len(points), np.bool_)
    angle = angles(stock, points, tool)
    return np.asarray((angle > max_angle + CLOSE) | (found.crowds(tool, points) & (angle > 0.0)))


def within(stock: StockMap, points: F64, tool: ToolBody, max_angle: float, found: Counterexamples = NONE) -> bool:
    """Whether a line of tips keeps the limit of the engaged angle.

    points    : (n, 3) float64, mm, access frame
    max_angle : rad
    found     : as in ``over_limit``
    """
    if max_angle >= UNBOUNDED:
        return True
    return not over_limit(stock, dense(points, LOOK * tool.radius), tool, max_angle, found).any()


def skims(stock: StockMap, line: Line, tool: ToolBody, max_angle: float, found: Counterexamples = NONE, *,
          whole: bool = False) -> list[Line]:
    """Lines over a pass, from the top down, after which the pass keeps ``max_angle`` rad everywhere.

    They lie over each stretch that exceeds the limit, back and forth, since a skim has no side. None where the limit
    holds.

    whole : over the whole line, whether it keeps the limit or not
    """
    way = Line(dense(line.points, LOOK * tool.radius), line.closed)
    over = np.ones(len(way.points), np.bool_) if whole else over_limit(stock, way.points, tool, max_angle, found)
    deep, out = SURE * SKIN_SHARE * tool.radius, []
    for piece in pieces_where(way, over, BEYOND * tool.radius, tool.radius):
        count = int(float(stock.overlap(piece.points, tool, lower_bound=0.0).max()) / deep)
        for k in range(count, 0, -1):
            raised = Line(piece.points + np.array([0.0, 0.0, k * deep]), piece.closed)
            out.append(raised if k % 2 else raised.reversed())
    return out
