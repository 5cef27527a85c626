"""A level taken off from the air inwards: the limit is kept move by move, nothing is left, and the tool stays down."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import RAMP, box_mesh, field_of, joined, tool
from toolpath.lines import dense
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.roughing.engagement_limited_clearing import Clearing
from toolpath.stock.cut_history import Depths
from toolpath.stock.engagement import CLOSE, LOOK, angles
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import CutDirection, TrajectoryKind

ALLOWANCE, Z = 0.2, 5.0
MOST = math.radians(120.0)


class Watched(Linker):
    """A linker that asks how much of the cutter is in stock on every pass, just before it is gone."""

    def __post_init__(self):
        super().__post_init__()
        go, self.worst, self.eased = self.go.feed, 0.0, False

        def feed(motion, points, feed):
            if motion is TrajectoryKind.CUT and not self.eased:
                way = dense(points, LOOK * self.field.tool.radius)
                self.worst = max(self.worst, float(angles(self.stock, way, self.field.tool).max()))
            go(motion, points, feed)

        self.go.feed = feed

    def add(self, line, tolerance=None, *, eased=False):
        self.eased = eased
        return super().add(line, tolerance, eased=eased)


def cleared(mesh, lower, upper, area, cut_direction=CutDirection.CLIMB):
    field = field_of(mesh, tool(4.0, 0.0))
    stock = StockMap.box(TriangleTree(mesh), np.array(lower, float), np.array(upper, float), 0.1)
    motions = Motions(800, 200, 3000, 10000, 12.0, 10.0, RAMP, 1.6, 0.001)
    link = Watched(field, stock, motions, Depths(stock.lattice), engaged=MOST)
    lat = field.lattice
    y, x = np.meshgrid(lat.y0 + lat.step * np.arange(lat.ny), lat.x0 + lat.step * np.arange(lat.nx), indexing="ij")
    Clearing(link, Z, area(x, y), ALLOWANCE, 1.6, cut_direction, 0.05, 0.005).walk()
    return link


def channel(**how):
    """8 mm wide along X, open at both ends."""
    mesh = joined(box_mesh([0, 0, -2], [24, 4, 6]), box_mesh([0, 12, -2], [24, 16, 6]),
                  box_mesh([0, 4, -2], [24, 12, 0]))
    return cleared(mesh, [0, 0, -2], [24, 16, 6.5], lambda x, y: (x > 0) & (x < 24) & (y > 6) & (y < 10), **how)


def pocket(**how):
    """14 x 10 mm, closed all round."""
    mesh = joined(box_mesh([0, 0, -2], [24, 5, 6]), box_mesh([0, 15, -2], [24, 20, 6]),
                  box_mesh([0, 5, -2], [5, 15, 6]), box_mesh([19, 5, -2], [24, 15, 6]),
                  box_mesh([5, 5, -2], [19, 15, 0]))
    return cleared(mesh, [0, 0, -2], [24, 20, 6.5], lambda x, y: (x > 7) & (x < 17) & (y > 7) & (y < 13), **how)


def left_over(link, x, y):
    """Highest stock over the level in a box of the plan, mm."""
    lat = link.stock.lattice
    i = slice(int((y[0] - lat.y0) / lat.step) + 1, int((y[1] - lat.y0) / lat.step))
    j = slice(int((x[0] - lat.x0) / lat.step) + 1, int((x[1] - lat.x0) / lat.step))
    return float(link.stock.top[i, j].max()) - Z


@pytest.mark.parametrize("how", [{"cut_direction": way} for way in CutDirection], ids=list(CutDirection))
def test_a_channel_is_emptied_under_the_limit_with_the_tool_down(how):
    link = channel(**how)
    assert 0.0 < link.worst <= MOST + CLOSE
    # rings after it take the rest along the walls
    assert left_over(link, (1.0, 23.0), (4.9, 11.1)) < 0.01
    lifts = sum(t.motion is TrajectoryKind.LIFT for t in link.trajectories)
    assert lifts <= 4 and not link.skipped  # both mouths are ways in


@pytest.mark.parametrize("climb", [True, False])
def test_climbing_has_the_stock_on_its_right(climb):
    """A front that comes from the mouth at X 0 has it at greater X, so the tool goes towards greater Y.

    On the level itself: skims above it go to and fro and have no side.
    """
    ways = []
    for t in channel(cut_direction=CutDirection.CLIMB if climb else CutDirection.CONVENTIONAL).trajectories:
        level = (np.abs(t.points[:, 2] - Z) < 1e-9).all()
        if t.motion is TrajectoryKind.CUT and level and 5.0 < t.points[:, 1].mean() < 11.0:
            inwards = 1.0 if t.points[:, 0].mean() < 12.0 else -1.0
            ways.append(inwards * float(t.points[-1, 1] - t.points[0, 1]))
    long = [w for w in ways if abs(w) > 2.0]
    assert len(long) > 8 and all((w > 0.0) == climb for w in long)


def test_a_closed_pocket_is_opened_by_a_helix():
    link = pocket()
    assert 0.0 < link.worst <= MOST + CLOSE and not link.skipped
    # rings after it take what is left beside walls where ways end, no more than a line's distance, and in corners
    assert left_over(link, (5.2 + 1.6, 18.8 - 1.6), (8.0, 12.0)) < 0.01
    assert left_over(link, (8.0, 15.5), (5.2 + 1.0, 14.8 - 1.0)) < 0.01
    first = next(t for t in link.trajectories if t.motion is TrajectoryKind.CUT)
    turns = np.unwrap(np.arctan2(*(first.points[:, 1::-1] - first.points[:, 1::-1].mean(axis=0)).T))
    drop = np.diff(first.points[:, 2])
    assert abs(turns[-1] - turns[0]) > 10.0 * 2.0 * math.pi and (drop <= 1e-9).all()
