"""Passes that are linked, on a plate under a block of stock."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from output.program_grid import to_grid
from tests.hand_parts import RAMP, ball, box_mesh, field_of, tool
from tests.linked_plate import TOP, linker, loop, stand, straight
from toolpath.counterexamples import BARRED, Counterexamples
from toolpath.feeds.feed_scheduling import GUARD, Pace
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.linking.ways_in import FLUTE_SHARE
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind
from verify.checks.repeated_passes import WINDOW


def test_stock_that_stays_beside_a_wall_is_not_gone_over_layer_after_layer():
    """Stock higher than the flutes that nothing takes away: it was walked above once, and that is enough."""
    mesh = box_mesh([0, 0, -2], [30, 30, 0])
    body = replace(ball(2.0), flute_length=1.5)
    field = field_of(mesh, body)
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 8.0]), 0.15)
    stays = stock.cover.copy()
    stays[:, :] = -np.inf
    i, j = stock.lattice.cells(np.array([[15.0, 15.6]]))
    stays[i, j] = 8.0
    cut = stock.cut

    def leaves(points, tool):
        cut(points, tool)
        np.maximum(stock.cover, stays, out=stock.cover)

    stock.cut = leaves
    link = Linker(field, stock, Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 0.5, 0.001), Depths(stock.lattice))
    passes = []
    for z in (7.5, 7.0, 6.5, 6.0, 5.5, 5.0, 4.5, 4.0):
        before = link.passes
        assert link.add(straight(5, 25, 15, z))
        passes.append(link.passes - before)
    assert passes == [1] * 8


def test_what_is_cut_first_above_a_line_is_no_level_that_was_cut_before():
    """A ring 0.8 flute lengths below another: the ring above it is that one, to rounding."""
    body = replace(tool(4.0, 0.0), flute_length=3.0)
    link = linker(body)
    high = FLUTE_SHARE * body.flute_length
    for z in (3.3, 3.3 - 0.5 * high, 3.3 - high):
        assert link.add(loop(6.0, z - 1.5e-4, (15.03, 14.98)))
        link.stock.cover[:] = np.maximum(link.stock.cover, np.where(link.stock.part < 0.0, TOP, -np.inf))
    cuts = [t.points for t in link.trajectories if t.motion is TrajectoryKind.CUT]
    moves = [tuple(m) for p in map(to_grid, cuts) for m in np.hstack([p[:-1], p[1:]]).tolist()]
    assert len(moves) - len(set(moves)) < WINDOW and len(cuts) == 3


def test_a_line_is_left_out_where_the_stock_stands_in_the_way_of_the_shank():
    body = tool(4.0, 0.0, neck=5.0, shank=8.0)
    link = linker(body, top=9.0)
    link.stock.cut(np.array([[5.0, 15, 0.0], [25.0, 15, 0.0]]), tool(4.4, 0.0))
    line = straight(5, 25, 15, 0.5)
    assert not link.add(line)  # the slot is wide enough for the cutter, not for the shank
    assert link.trajectories == [] and sum(s.length for s in link.skipped) == pytest.approx(line.length)

    link = linker(body, top=9.0)
    link.stock.cut(np.array([[5.0, 15, 0.0], [25.0, 15, 0.0]]), tool(4.4, 0.0))
    link.stock.cut(np.array([[4.0, 15, 3.0], [12.0, 15, 3.0]]), tool(9.6, 0.0))
    assert not link.add(line)  # opened at one end: the shank gets in as far as it is open
    cut = np.vstack([t.points for t in link.trajectories if t.motion is TrajectoryKind.CUT])
    assert 5.0 <= cut[:, 0].min() < 5.5 and 11.5 < cut[:, 0].max() <= 12.7
    assert sum(s.length for s in link.skipped) == pytest.approx(13.0, abs=1.5)


def test_a_point_is_no_pass():
    link = linker()
    assert link.add(Line(np.array([[1.0, 1, 1], [1, 1, 1]]), False)) and link.passes == 0


def test_what_of_a_pass_is_in_air_is_gone_as_fast_as_a_link():
    """Stock over the right half: the way is the same, cut where it stands and a little before."""
    slow, fast = linker(top=-1.0), linker(top=-1.0)
    fast.pace = Pace(800, 3000, lambda depth, angle: 800, 1.0)
    for link in (slow, fast):
        stand(link.stock, 15.0, 1.5)
        assert link.add(straight(3, 27, 10, 1.0))
    ways = [[t for t in link.trajectories if t.motion in (TrajectoryKind.CUT, TrajectoryKind.CONNECT)]
            for link in (slow, fast)]
    assert [t.motion for t in ways[1]] == [TrajectoryKind.CONNECT, TrajectoryKind.CUT]
    assert [t.feed for t in ways[1]] == [3000, 800]
    np.testing.assert_allclose(np.vstack([ways[1][0].points, ways[1][1].points[1:]])[[0, -1]], ways[0][0].points)
    begin = ways[1][1].points[0, 0]
    rim = math.sqrt(4.0 - 1.5**2)  # of the ball where stock 0.5 above its tip meets it
    assert fast.depths.were_cut(ways[0][0].points).all()  # it is known as it was asked for
    lat = fast.stock.lattice
    first = next(x for x in lat.x0 + lat.step * np.arange(lat.nx) if x > 15.0)
    assert first - rim - 2.0 * GUARD * 4.0 < begin <= first - rim - 0.75 * GUARD * 4.0


def test_where_the_tool_is_barred_a_line_is_left_out():
    body = ball(4.0)
    link = linker(body, top=-1.0, found=Counterexamples(barred={body.id: np.array([[12.0, 10.0, 1.0]])}))
    assert not link.add(straight(5, 20, 10, 1.0))
    cuts = [t.points for t in link.trajectories if t.motion is TrajectoryKind.CUT]
    ends = sorted((float(p[:, 0].min()), float(p[:, 0].max())) for p in cuts)
    gap = BARRED * link.field.tool.radius
    assert len(ends) == 2 and ends[0][0] == 5.0 and ends[1][1] == 20.0
    assert ends[0][1] < 12.0 - gap < 12.0 + gap < ends[1][0] < 12.0 + gap + 1.5
    assert [float(np.ptp(p.points[:, 0])) > gap for p in link.skipped] == [True]
    assert link.add(straight(5, 20, 12, 1.0)) and link.passes == 3


def test_what_a_line_has_above_the_rapids_is_not_walked():
    """A pass that runs out over a table higher than the clearance plane: no way leads across there."""
    link = linker()
    up = Line(np.array([[5.0, 10.0, 1.0], [15.0, 10.0, 1.0], [25.0, 10.0, 11.0], [28.0, 10.0, 11.0]]), False)
    assert link.add(up) and link.add(straight(5, 20, 14, 1.0))
    cut = np.vstack([t.points for t in link.trajectories if t.motion is TrajectoryKind.CUT])
    floor = link.motions.rapid_floor
    assert cut[:, 2].max() <= floor and cut[cut[:, 1] == 10.0][:, 2].max() > floor - 0.5
    assert max(t.points[:, 2].max() for t in link.trajectories) <= link.motions.clearance
    assert not link.skipped


def test_what_was_walked_as_it_stands_is_not_walked_again_while_the_rest_is_in_the_way():
    """Stock stands in the way of the shank over half of a line that is asked for round after round."""
    body = replace(ball(2.0, neck=3.0), shank_diameter=6.0)
    link = linker(body, top=-1.0)
    stand(link.stock, 18.0, 8.0)
    assert not link.add(straight(5, 25, 10, 1.0))
    passes, skipped = link.passes, len(link.skipped)
    assert passes == 1 and skipped
    assert not link.add(straight(5, 25, 10, 1.0))
    assert link.passes == passes and len(link.skipped) > skipped
