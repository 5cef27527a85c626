"""Zigzag passes that are skimmed where they go down too steeply."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, box_mesh, tool
from tests.plan_checks import dense
from tests.unit.toolpath.strategies.touched_places import kind, underside
from toolpath.lines import Line
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import zigzag


class Discs:
    """Stock in columns, lowered by the whole bottom of the cutter at tips every few hundredths of a millimetre."""

    def __init__(self, lo, hi, top, step=0.05):
        self.x, self.y = np.meshgrid(np.arange(lo[0], hi[0], step), np.arange(lo[1], hi[1], step))
        self.top = np.full(self.x.shape, float(top))

    def over(self, tip, body, rim):
        """How far stock stands above the bottom of the cutter inside its radius less ``rim``."""
        rho = np.hypot(self.x - tip[0], self.y - tip[1])
        return float((self.top - tip[2] - underside(rho, body))[rho <= body.radius - rim].max(initial=0.0))

    def cut(self, tip, body):
        rho = np.hypot(self.x - tip[0], self.y - tip[1])
        self.top = np.minimum(self.top, tip[2] + underside(rho, body))


def steepest_bites(lines, stock, body):
    """The most that stood over the steep moves of each line before it was walked, line by line, mm."""
    out = []
    for line in lines:
        p = dense(line.points, 0.04)
        move = np.diff(p, axis=0)
        steep = np.concatenate([[False], np.abs(move[:, 2]) > 0.06 * np.hypot(move[:, 0], move[:, 1])])
        out.append(max((stock.over(tip, body, 0.06) for tip in p[steep]), default=0.0))
        for tip in p:
            stock.cut(tip, body)
    return out


@pytest.mark.parametrize("body", [ball(2.0), tool(2.0, 0.4)], ids=kind)
def test_no_steep_part_of_a_skimmed_pass_takes_more_than_the_skin(body):
    mesh = box_mesh([0, 0, -2], [10, 4, 0])
    x = np.linspace(1.5, 8.5, 41)
    line = Line(np.column_stack([x, np.full(41, 2.0), 0.9 + 0.7 * np.cos(1.3 * x)]), False)
    skin, top = 0.25, 1.9
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([10.0, 4, top]), 0.1)
    got = zigzag.skimmed(line, stock, body, skin, 0.2)
    assert got[-1] is line and len(got) > 3
    # without them the pass itself would take much more
    (plain,) = steepest_bites([line], Discs([0, 0], [10, 4], top), body)
    assert plain > 3 * skin
    bites = steepest_bites(got, Discs([0, 0], [10, 4], top), body)
    # the looked-at places lie 0.3 radii apart on a slope of up to 0.9, the stock of the planner 0.1 mm
    assert max(bites) <= skin + 0.08
    assert all(np.diff([q.points[:, 2].max() for q in got]) < 1e-9)  # from the top down
    lifts = [q.points[:, 2] - np.interp(q.points[:, 0], x, line.points[:, 2]) for q in got]
    assert max(np.ptp(up) for up in lifts) < 0.03
    steps = -np.diff([up.mean() for up in lifts])
    assert np.ptp(steps) < 0.02 and 0.8 * skin < steps.max() <= skin


def open_depth(lines, x, top, slope):
    """The most that is open at x while lines along X are walked: what descents took less what other way worked off."""
    worst = debt = 0.0
    for line in lines:
        p = dense(line.points, 0.01)
        move = np.diff(p, axis=0)
        down = -move[:, 2] > slope * np.abs(move[:, 0])
        k = int(np.abs(0.5 * (p[1:, 0] + p[:-1, 0]) - x).argmin())
        height = float(p[k, 2])
        if down[k] and height < top:
            debt += top - height
        worst, top = max(worst, debt), min(top, height)
        debt = max(debt - slope * float(np.abs(move[~down, 0]).sum()), 0.0)
    return worst


@pytest.mark.parametrize(("run", "up"), [(2.0, 2.0), (30.0, 30.0), (20.0, 1.0), (20.0, 0.0), (3.0, 0.0)])
def test_what_descents_take_is_worked_off_by_way_that_does_not_go_down(run, up):
    """Valleys: down over ``run`` mm, up over ``up`` mm; the way down works nothing off, however long it is."""
    mesh = box_mesh([0, 0, -2], [70, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([70.0, 4, 4.0]), 0.1)
    body, skin, slope = tool(2.0, 0.4), 0.4, 0.05
    valley = [[3.0, 2, 3.6], [3.0 + run, 2, 1.4], *([[3.0 + run + up, 2, 3.6]] if up else [])]
    got = zigzag.skimmed(Line(np.array(valley), False), stock, body, skin, slope)
    assert got[-1].points.tolist() == valley
    assert max(open_depth(got, x, 4.0, slope) for x in (3.0 + 0.5 * run, 3.0 + 0.9 * run)) <= skin + 0.05
    # a skin each is enough on a long way, and for layers walked uphill
    assert len(got) > 8 if run == up == 2.0 else len(got) <= 2.6 / skin + 1


def test_a_level_pass_and_one_in_air_are_not_skimmed():
    mesh = box_mesh([0, 0, -2], [10, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([10.0, 4, 3.0]), 0.1)
    level = Line(np.array([[1.0, 2, 0.1], [9, 2, 0.1]]), False)
    assert zigzag.skimmed(level, stock, ball(2.0), 0.1, 0.05) == [level]
    above = Line(np.array([[1.0, 2, 5.0], [9, 2, 3.0]]), False)
    assert zigzag.skimmed(above, stock, ball(2.0), 0.1, 0.05) == [above]
    into = Line(np.array([[1.0, 2, 3.0], [9, 2, 1.0]]), False)
    assert len(zigzag.skimmed(into, stock, ball(2.0), 0.1, 0.05)) > 5


def test_beside_a_wall_only_what_is_under_the_end_of_a_pass_that_goes_down_is_skimmed():
    mesh = box_mesh([0, 0, -2], [40, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([40.0, 4, 3.0]), 0.1)
    down = np.array([[3.0, 2, 2.8], [33, 2, 0.6]])
    beside = down + [0.0, 3.4, 0.0]  # the ball of 4 mm goes along the block with 0.6 mm of its flank in it
    assert len(zigzag.skimmed(Line(beside, False), stock, ball(4.0), 0.3, 0.05, True)) == 1
    assert len(zigzag.skimmed(Line(beside, False), stock, ball(4.0), 0.3, 0.05)) > 1
    assert len(zigzag.skimmed(Line(down, False), stock, ball(4.0), 0.3, 0.05, True)) > 5
    assert len(zigzag.skimmed(Line(down[::-1], False), stock, ball(4.0), 0.3, 0.05, True)) == 1
