"""Ways from pass to pass, on a plate under a block of stock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.move_timing import leg_seconds
from tests.hand_parts import RAMP, box_mesh, field_of, joined, tool
from tests.linked_plate import TOP, linker, motions, stand, straight
from toolpath.lines import Line, dense, legs
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import OVER, Motions
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind


def test_ways_through_air_to_a_pass_beside_are_as_fast_as_links_and_slow_before_stock():
    link = linker(tool(4.0, 0.0), top=3.0)
    link.add(straight(-5, 35, 10, 3.0))
    link.add(Line(straight(-5, 35, 18, 3.0).points[::-1], False))
    ways = [(t.feed, float(np.linalg.norm(np.diff(t.points, axis=0), axis=1).sum())) for t in link.trajectories
            if t.motion is TrajectoryKind.CONNECT]
    assert ways == [(3000, pytest.approx(8.0))]  # from beside the stock to beside it


def test_on_its_way_to_a_pass_the_tool_is_slow_where_the_lattice_may_not_show_what_stands():
    """Both passes end in a slot they cut themselves: nothing is seen at their ends, but walls are close."""
    link = linker(tool(4.0, 0.0), top=3.0)
    link.add(straight(-5, 25, 10, 2.0))
    link.add(straight(-5, 25, 18, 2.0))
    before = len(link.trajectories)
    link.add(Line(np.array([[25.0, 17.0, 2.0], [25.0, 11.0, 2.0]]), False))
    first = link.trajectories[before]
    assert first.motion is not TrajectoryKind.RAPID and first.feed == 800


def test_no_link_goes_through_a_wall():
    """It goes over it, no higher than it has to, and does not go up to the rapids."""
    link = linker(tool(2.0, 0.0), top=-1.0, post=True)
    link.add(straight(5, 11.5, 15, 1.0))
    link.add(straight(18.5, 25, 15, 1.0))
    assert motions(link).count(TrajectoryKind.RAPID) == 2  # only to where the first pass begins
    over = next(t for t in link.trajectories if t.motion is TrajectoryKind.CONNECT)
    assert over.feed == 3000 and 3.0 + OVER <= over.points[:, 2].max() < 3.5
    for t in link.trajectories:
        way = dense(t.points, 0.05)
        inside = (np.abs(way[:, :2] - 15) < 2.9).all(axis=1)
        assert (way[inside, 2] >= 3.0).all()


def test_over_what_stands_as_high_as_rapids_go_the_clearance_plane_is_the_way():
    mesh = joined(box_mesh([0, 0, -2], [30, 30, 0]), box_mesh([13, 13, 0], [17, 17, 5.95]))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, -1.0]), 0.15)
    link = Linker(field_of(mesh, tool(2.0, 0.0)), stock, Motions(800, 200, 3000, 10000, 8.0, 6.0, RAMP, 1.0, 0.001),
                  Depths(stock.lattice))
    link.add(straight(5, 11.5, 15, 1.0))
    link.add(straight(18.5, 25, 15, 1.0))
    assert TrajectoryKind.CONNECT not in motions(link) and motions(link).count(TrajectoryKind.RAPID) == 5


def test_what_stands_between_two_passes_is_gone_over_and_not_through():
    """The way across takes no stock, and is sooner than by the clearance plane."""
    link = linker(tool(2.0, 0.0), step_down=0.5)
    link.add(straight(-2, 6, 10, 1.0))
    before, stock = len(link.trajectories), link.stock.copied()
    link.add(straight(9.5, 20, 10, 1.0))
    over = link.trajectories[before]
    assert over.motion is TrajectoryKind.CONNECT and stock.above(1.0, stock.lattice).any()
    assert stock.overlap(dense(over.points, 0.05), link.field.tool).max() <= 0.01
    assert stock.in_air(dense(over.points[1:3], 0.05), link.field.tool).all()
    assert TOP < over.points[:, 2].max() < link.motions.rapid_floor
    lift = link.motions.clearance - 1.0
    assert np.linalg.norm(np.diff(over.points, axis=0), axis=1).sum() / 3000 < 2.0 * lift / 3000 + 3.5 / 10000


def test_a_shank_is_not_led_into_what_stands_beside_the_way_across():
    """Between two trenches 10 mm apart a rib of stock stands that the cutter gets over, and the shank does not."""
    body = replace(tool(2.0, 0.0, neck=3.0), shank_diameter=8.0)
    link = linker(body, top=0.5)
    stand(link.stock, -np.inf, -1.0)
    stand(link.stock, 12.0, 5.0, before=13.0)
    assert link.add(straight(2, 7, 10, 0.5)) and link.add(straight(18, 23, 10, 0.5))
    for t in link.trajectories:
        if t.motion is not TrajectoryKind.RAPID:
            assert not link.stock.meets_bodies(dense(t.points, 0.05), link.field.discs).any()


def test_finish_ends_at_the_clearance_plane_with_feed_below_the_rapid_floor():
    link = linker()
    link.add(straight(5, 20, 10, 3.2))
    done = link.finish()
    assert done[-2].motion is TrajectoryKind.LIFT and done[-2].points[-1, 2] == 6.0
    assert done[-1].motion is TrajectoryKind.RAPID and done[-1].points[-1, 2] == 8.0
    assert len(link.finish()) == len(done)
    for a, b in zip(done[:-1], done[1:], strict=True):
        assert (a.points[-1] == b.points[0]).all()


def test_the_last_bit_of_a_way_down_is_slow_where_something_stands_there():
    """Slivers that may stand between the nodes, thin enough for the end to take, and none."""
    for skin, feed in ((0.0, 800), (0.05, 200)):
        link = linker(tool(4.0, 0.0), top=1.0)
        link.stock.become(StockMap(link.stock.lattice, link.stock.top, link.stock.cover + skin, link.stock.part))
        link.add(straight(5, 25, 10, 1.0))
        down = [t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH
                and t.points[-1, 2] < t.points[0, 2]]
        assert down[-1].feed == feed


def test_back_in_air_the_tool_goes_the_same_way_but_once():
    link = linker(top=-1.0)
    assert link.add(straight(5, 20, 10, 1.0))
    a = np.linspace(0.0, 2.0 * np.pi, 20)
    way = np.vstack([[20.0, 10.0, 1.0], np.column_stack([19.5 + 0.5 * np.cos(a), 10 + 0.5 * np.sin(a), np.ones(20)])])
    assert link.keep_down([way]) and link.trajectories[-1].motion is TrajectoryKind.CONNECT
    assert not link.keep_down([way]) and link.trajectories[-1].motion is TrajectoryKind.RAPID
    assert link.add(straight(5, 20, 12, 1.0))
    long = np.column_stack([np.tile([20.0, 4.0], 20), np.linspace(12.0, 13.0, 40), np.ones(40)])
    assert not link.keep_down([long])  # by the clearance plane it is sooner


def test_the_clearance_plane_costs_the_stops_between_rapids_and_feed_moves():
    """30 mm apart: as the feeds go the plane would be 0.3 s sooner, but the machine stops four times more on it."""
    link = linker(top=-1.0)
    link.motions = replace(link.motions, clearance=12.0, rapid_floor=11.0)
    here, to = np.array([0.0, 15.0, 10.0]), np.array([30.0, 15.0, 10.0])
    m = link.motions
    assert 30.0 / m.link_feed > 2.0 / m.link_feed + 32.0 / m.rapid_feed + 0.3 / 60.0
    assert m.link_seconds([30.0]) < m.plane_seconds(here, to)
    assert m.link_seconds([90.0]) > m.plane_seconds(here, to + [60.0, 0.0, 0.0])
    alone = m.link_seconds([1.0]) + m.link_seconds([1.0]) + 2.0 * leg_seconds(1.0, 10000 / 60, m.rates)
    assert m.plane_seconds(here, to) == pytest.approx(alone + leg_seconds(30.0, 10000 / 60, m.rates))


def test_legs_end_at_corners():
    turn = np.linspace(0.0, 0.5 * np.pi, 10)
    arc = np.column_stack([5.0 * np.sin(turn), 5.0 * (1.0 - np.cos(turn)), np.zeros(10)])
    way = np.vstack([[-3.0, 0.0, 0.0], arc, [5.0, 5.0, 7.0], [5.0, 5.0, 7.0], [1.0, 5.0, 7.0]])
    assert legs(way) == pytest.approx([3.0 + 5.0 * 0.5 * np.pi, 7.0, 4.0], rel=2e-3)
    assert len(legs(way[:1])) == 0
