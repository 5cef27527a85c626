"""Ways in, across and out, on a plate under a block of stock."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.move_timing import leg_seconds
from output.program_grid import to_grid
from tests.hand_parts import RAMP, ball, box_mesh, field_of, joined, tool
from toolpath.counterexamples import BARRED, CARE, NONE, Counterexamples
from toolpath.feeds.feed_scheduling import GUARD, Pace
from toolpath.lines import Line, dense, legs
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import OVER, Motions
from toolpath.linking.ways_in import FLUTE_SHARE
from toolpath.passes.pass_order import nearest_order
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.workingsteps import TrajectoryKind
from verify.checks.repeated_passes import WINDOW

TOP = 4.0


def stand(stock, beyond, height, before=np.inf):
    """Let stock stand to a height between two places along X."""
    x = stock.lattice.x0 + stock.lattice.step * np.arange(stock.lattice.nx)
    top = np.where((x > beyond) & (x < before), height, stock.top)
    stock.become(StockMap(stock.lattice, top, top.copy(), stock.part))


def linker(body=None, top=TOP, post=False, step_down=1.0, found=NONE):
    """A plate 30 x 30 with its top at 0, stock up to ``top``, a post in the middle if asked for."""
    mesh = box_mesh([0, 0, -2], [30, 30, 0])
    if post:
        mesh = joined(mesh, box_mesh([13, 13, 0], [17, 17, 3]))
    field = field_of(mesh, body or ball(4.0))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, top]), 0.15)
    return Linker(field, stock, Motions(800, 200, 3000, 10000, 8.0, 6.0, RAMP, step_down, 0.001), Depths(stock.lattice),
                  found)


def straight(x0, x1, y, z):
    return Line(np.array([[x0, y, z], [x1, y, z]], float), False)


def loop(r, z, centre=(15.0, 15.0), n=90):
    a = np.linspace(0, 2 * np.pi, n + 1)
    return Line(np.column_stack([centre[0] + r * np.cos(a), centre[1] + r * np.sin(a), np.full(n + 1, z)]), True)


def steepest_cut(link):
    """Steepest descent of the cutting moves, rad."""
    worst = 0.0
    for t in link.trajectories:
        if t.motion is TrajectoryKind.CUT:
            d = np.diff(t.points, axis=0)
            worst = max(worst, float(np.arctan2(-d[:, 2], np.hypot(d[:, 0], d[:, 1])).max()))
    return worst


def motions(link):
    return [t.motion for t in link.trajectories]


def test_in_air_the_tool_comes_straight_down():
    link = linker(top=-1.0)
    assert link.add(straight(5, 20, 10, 1.0))
    assert motions(link) == [TrajectoryKind.RAPID, TrajectoryKind.RAPID, TrajectoryKind.APPROACH,
                             TrajectoryKind.APPROACH, TrajectoryKind.CUT]
    assert link.trajectories[-1].points.tolist() == [[5, 10, 1], [20, 10, 1]]
    feeds = [t.feed for t in link.trajectories if t.motion is TrajectoryKind.APPROACH]
    assert feeds == [3000, 800]  # nothing stands where it comes down


def test_from_outside_the_stock_it_comes_in_level():
    link = linker()
    assert link.add(straight(1.0, 20, 10, 3.2))
    cut = link.trajectories[-1]
    assert cut.motion is TrajectoryKind.CUT and len(cut.points) == 2
    first = next(t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH)
    assert (first.points[:, 0] < -2.0).all()  # beside the block


def test_rings_of_layer_after_layer_are_gone_down_to_where_the_tool_has_been():
    """The hole is as wide as the tool, so nothing in it counts as air; but the tool stood there a layer before."""
    link = linker()
    tops, moves = [], []
    for z in (2.4, 1.6, 0.8):
        for hole in ((8.0, 8.0), (22.0, 22.0)):
            assert link.add(loop(0.5, z, hole))
            cut = link.trajectories[-1].points
            tops.append(cut[0, 2])
            moves.extend(np.round(np.hstack([cut[:-1], cut[1:]]), 6).tolist())
    assert min(tops[:2]) >= TOP
    assert np.allclose(tops[2:], [2.5, 2.5, 1.7, 1.7], atol=0.01)  # every ramp begins a tenth above what it comes to
    assert len({tuple(m) for m in moves}) == len(moves)  # no way is run twice


def test_a_way_down_is_not_gone_again_as_far_as_a_line_before_went_the_same():
    """A line that parts from this one only after the first moves of the way down, and a tool that cut it."""
    x = np.linspace(8.0, 22.0, 29)
    line = Line(np.column_stack([x, 13.0 + 0.05 * (x - 15.0) ** 2, np.full(29, 2.0)]), False)
    first, again = linker(), linker()
    assert first.add(line)
    whole = first.trajectories[-1].points
    again.depths.cut(whole[:7])
    assert again.add(line)
    np.testing.assert_array_equal(again.trajectories[-1].points, whole[6:])
    assert steepest_cut(again) <= RAMP
    down = [t.points for t in again.trajectories if t.motion is TrajectoryKind.APPROACH][-1]
    np.testing.assert_array_equal(down[-1], whole[6])


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


@pytest.mark.parametrize("length", [3.0, 12.0, 24.0])
def test_an_open_line_in_stock_is_ramped_to_and_fro(length):
    link = linker(step_down=0.5)
    line = straight(15 - length / 2, 15 + length / 2, 15, 1.5)
    assert link.add(line)
    cut = link.trajectories[-1].points
    assert steepest_cut(link) <= RAMP
    assert cut[0, 2] >= TOP  # begins above the stock
    assert (cut[-2:] == line.points).all()  # and ends with the whole pass at depth
    assert (cut[:, 1] == 15).all() and cut[:, 0].min() >= line.points[0, 0] - 1e-9


def digging(cut, along):
    """What each steep descent of a polyline takes below all that was walked before, mm, and the way of the other moves.

    Looked at every 0.05 mm of ``along`` (n,), mm, on which a point of the polyline lies in plan.
    """
    places = np.linspace(along.min(), along.max(), int(np.ptp(along) / 0.05) + 2)
    lowest, dug, aside = np.full(len(places), np.inf), [], 0.0
    for k in range(1, len(cut)):
        low, high = sorted(along[k - 1:k + 1])
        here = np.flatnonzero((places >= low) & (places <= high))
        order = k - 1 + np.argsort(along[k - 1:k + 1])
        z = np.interp(places[here], along[order], cut[order, 2])
        run = float(np.hypot(*(cut[k] - cut[k - 1])[:2]))
        if cut[k - 1, 2] - cut[k, 2] > np.tan(RAMP) * run:
            dug.append(float(np.maximum(lowest[here] - z, 0.0).max(initial=0.0)))
        else:
            aside += run
        lowest[here] = np.minimum(lowest[here], z)
    return np.array(dug), aside


@pytest.mark.parametrize("rise", [0.3, 0.8, 2.0])
@pytest.mark.parametrize("length", [3.0, 12.0])
def test_to_and_fro_along_a_leaning_line_the_way_back_takes_no_more_than_a_skin(length, rise):
    """The way back goes downhill: it takes all that the ramp lost since the tool went up there."""
    link = linker(step_down=0.5)
    x = 15.0 + 0.5 * length * np.array([-1.0, 1.0])
    line = Line(np.column_stack([x, [15.0, 15.0], [1.5, 1.5 + rise]]), False)
    assert link.add(line)
    cuts = [t.points for t in link.trajectories if t.motion is TrajectoryKind.CUT]
    cut = np.vstack([cuts[0], *(c[1:] for c in cuts[1:])])
    assert (cut[-2:] == line.points).all() and cut[0, 2] >= TOP
    dug, aside = digging(cut, cut[:, 0])
    assert dug.max(initial=0.0) <= SKIN * ball(4.0).diameter
    assert dug.sum() <= np.tan(RAMP) * aside  # and the ways between work it off


@pytest.mark.parametrize("down", [0.5, 0.8])
@pytest.mark.parametrize("radius", [0.6, 4.0])
def test_a_loop_that_leans_is_ramped_a_skin_a_turn_and_no_more_than_it_works_off(radius, down):
    """It goes down over a share of its way, 0.4 mm to a mm of radius, and up over the rest."""
    link = linker(step_down=0.5)
    flat = loop(radius, 2.0)
    share = np.linspace(0.0, 1.0, 91)
    z = 2.0 + 0.4 * radius * np.minimum((1.0 - share / down).clip(0.0) + (share - down).clip(0.0) / (1.0 - down), 1.0)
    assert link.add(Line(np.column_stack([flat.points[:, :2], z]), True))
    cut = link.trajectories[-1].points
    turn = np.unwrap(np.arctan2(cut[:, 1] - 15.0, cut[:, 0] - 15.0))
    assert (np.diff(turn) >= -1e-9).all()
    turns = (turn - turn[0]) / (2.0 * np.pi)
    lost = np.nanmax(cut[:, 2] - np.interp(turns + 1.0, turns, cut[:, 2], right=np.nan))
    assert 0.0 < lost <= SKIN * ball(4.0).diameter + 1e-9
    assert lost <= np.tan(RAMP) * (1.0 - down) * 2.0 * np.pi * radius


@pytest.mark.parametrize("radius", [1.0, 4.0, 9.0])
def test_a_loop_in_stock_is_ramped_round_and_closed_at_depth(radius):
    link = linker(step_down=0.5)
    line = loop(radius, 2.0)
    assert link.add(line)
    cut = link.trajectories[-1].points
    assert steepest_cut(link) <= RAMP and cut[0, 2] >= TOP
    deep = cut[np.abs(cut[:, 2] - 2.0) < 1e-9]
    run = float(np.linalg.norm(np.diff(deep, axis=0), axis=1).sum())
    assert run >= 0.995 * line.length  # a whole turn at depth, after the ramp
    assert (np.hypot(cut[:, 0] - 15, cut[:, 1] - 15) <= radius + 1e-9).all()


def test_a_spot_too_short_for_a_ramp_is_left_out_and_kept():
    link = linker()
    line = straight(15, 15.01, 15, 1.0)
    assert not link.add(line)
    assert [s.points.tolist() for s in link.skipped] == [line.points.tolist()]
    assert link.trajectories == [] and link.passes == 0


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


def test_the_next_pass_beside_is_reached_without_a_lift():
    link = linker()
    link.add(straight(-1, 25, 10, 3.0))
    link.add(Line(straight(-1, 25, 12, 3.0).points[::-1], False))
    assert motions(link)[-2:] == [TrajectoryKind.CONNECT, TrajectoryKind.CUT]
    assert motions(link).count(TrajectoryKind.RAPID) == 2


def test_a_deeper_level_is_reached_down_a_ramp_along_the_pass():
    link = linker(tool(4.0, 0.0), step_down=1.0)
    link.add(loop(4, 3.2))
    before = len(link.trajectories)
    link.add(loop(4, 2.4))
    new = link.trajectories[before:]
    assert all(t.motion is not TrajectoryKind.RAPID for t in new)
    assert steepest_cut(link) <= RAMP
    assert new[-1].points[0, 2] == pytest.approx(3.2) and new[-1].points[-1, 2] == pytest.approx(2.4)


def test_a_deeper_level_is_reached_beside_the_pass_where_that_is_in_air():
    """The pass before was come to from outside the stock: there the tool goes down, as fast as links go, and in."""
    link = linker(tool(4.0, 0.0), step_down=1.0)
    link.add(loop(8, 3.2))
    before = len(link.trajectories)
    link.add(loop(8, 2.4))
    new = link.trajectories[before:]
    assert [t.motion for t in new] == [TrajectoryKind.CONNECT] * 2 + [TrajectoryKind.CUT]
    assert [t.feed for t in new] == [3000, 800, 800]
    down = new[0].points
    assert down[0, 2] == 3.2 and down[-1, 2] == 2.4 and steepest_cut(link) < 1e-9
    outside = down[np.flatnonzero(np.diff(down[:, 2]) < 0.0)[0]]
    assert not (np.abs(outside[:2] - 15.0) < 15.0 + 2.0).all()  # clear of the stock where it goes down
    assert np.hypot(*(down[-1, :2] - outside[:2])) > 0.0 and new[-1].points[0, 2] == 2.4


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


def test_finish_ends_at_the_clearance_plane_with_feed_below_the_rapid_floor():
    link = linker()
    link.add(straight(5, 20, 10, 3.2))
    done = link.finish()
    assert done[-2].motion is TrajectoryKind.LIFT and done[-2].points[-1, 2] == 6.0
    assert done[-1].motion is TrajectoryKind.RAPID and done[-1].points[-1, 2] == 8.0
    assert len(link.finish()) == len(done)
    for a, b in zip(done[:-1], done[1:], strict=True):
        assert (a.points[-1] == b.points[0]).all()


def test_order_goes_to_the_nearest_start():
    lines = [straight(0, 1, y, 0) for y in (5.0, 1.0, 3.0)]
    got = nearest_order(lines, np.array([0.0, 0, 9]), False)
    assert [p.points[0, 1] for p in got] == [1, 3, 5]
    assert all((p.points[0, 0], p.points[-1, 0]) == (0, 1) for p in got)  # climb is kept
    free = nearest_order(lines, np.array([0.0, 0, 9]), True)
    assert [p.points[0, 0] for p in free] == [0, 1, 0]  # to and fro
    assert nearest_order([], None, True) == []


def test_a_loop_begins_at_its_nearest_point_and_keeps_its_sense():
    line = loop(5.0, 0.0)
    (got,) = nearest_order([line], np.array([15.0, 30.0, 0]), True)
    assert got.closed and got.points[0, :2] == pytest.approx([15, 20], abs=0.4)
    assert (got.points[0] == got.points[-1]).all() and got.length == pytest.approx(line.length)

    def area(p):
        return 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]))
    assert math.copysign(1, area(got.points)) == math.copysign(1, area(line.points))


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


def test_where_the_tool_dug_ramps_are_at_most_half_as_steep():
    body = ball(4.0)
    usual = linker(body, top=3.0)
    careful = linker(body, top=3.0, found=Counterexamples({body.id: np.array([[15.0, 10.0, 1.0]])}))
    assert usual.add(straight(6, 24, 10, 1.0)) and careful.add(straight(6, 24, 10, 1.0))
    assert np.tan(steepest_cut(careful)) <= CARE * np.tan(RAMP) < np.tan(steepest_cut(usual))


@pytest.mark.parametrize("known", [0, 3, 4, 9])
def test_straight_on_no_way_down_is_gone_again(known):
    """Ten moves of it run twice were what the proof found with seed 103 of the sweep."""
    x = np.linspace(8.0, 22.0, 29)
    points = np.column_stack([x, np.full(29, 10.0), np.full(29, 2.0)])
    link = linker(top=3.0)
    link.go.at = np.array([7.0, 10.0, 2.6])
    link.stock.cut(np.array([[3.0, 10.0, 2.6], [7.0, 10.0, 2.6]]), link.field.tool)
    entry, ramp, joined = link.ways.straight_on(points, False)
    assert joined and len(ramp) > len(points) + 9 and ramp[0, 2] == pytest.approx(2.6)
    link.depths.cut(ramp[:known + 1])
    assert (link.ways.straight_on(points, False) is None) == (known > 3)


def test_straight_on_a_pass_may_end_on_what_is_known():
    """What overlaps there is no way down: for it the tool need not go up to the clearance plane."""
    x = np.linspace(8.0, 22.0, 29)
    points = np.column_stack([x, np.full(29, 10.0), np.full(29, 2.0)])
    link = linker(top=3.0)
    link.go.at = np.array([7.0, 10.0, 2.6])
    link.stock.cut(np.array([[3.0, 10.0, 2.6], [7.0, 10.0, 2.6]]), link.field.tool)
    link.depths.cut(points[-4:])
    assert link.ways.straight_on(points, False) is not None


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


def test_a_way_down_begins_after_the_last_move_that_was_made_before():
    """Two passes one below the other, whose ways down to and fro fall together in the middle: seed 69 of the sweep."""
    link = linker(ball(1.5), top=3.0)
    points = np.column_stack([np.linspace(10.0, 11.0, 5), np.full(5, 10.0), np.full(5, 1.0)])
    whole = link.ways.ramped(points, False)
    assert whole is not None and len(whole[1]) > 40
    first, last = 2, 4  # where it is no lower than what is seen there, or a way would begin just above it
    link.depths.cut(whole[1][first:last + 1])
    entry, ramp, _ = link.ways.ramped(points, False)
    np.testing.assert_allclose(ramp, whole[1][last:])
    np.testing.assert_allclose(entry[-1], whole[1][last])


def test_in_a_gap_it_only_just_fits_a_tool_comes_down_where_it_has_been():
    """A well whose walls are to be taken off by 0.2: the first ring goes down round and round, the next ones not."""
    mesh = box_mesh([0, 0, -2], [30, 30, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 8.0]), 0.15)
    motions_ = Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 1.0, 0.001)
    link = Linker(field_of(mesh, tool(4.0, 0.0)), stock, motions_, Depths(stock.lattice))
    assert link.add(loop(0.6, 1.0))
    link.keep_down([])
    before = len(link.trajectories)
    assert link.add(loop(0.8, 1.0))
    new = link.trajectories[before:]
    cuts = [t.points for t in new if t.motion is TrajectoryKind.CUT]
    # 30 down the ramp
    assert sum(t.length for t in new if t.motion is TrajectoryKind.CUT) < 15.0 * loop(0.8, 1.0).length
    heights = [8.0, *(float(p[-1, 2]) for p in cuts)]  # and no more than a layer and a half at once
    assert heights[-1] == 1.0 and max(np.diff(heights[::-1])) <= 1.5
    link.keep_down([])
    before = len(link.trajectories)
    assert link.add(loop(0.8, 0.6))  # deeper than it has been: down along the pass from just above there
    new = link.trajectories[before:]
    assert max(t.points[0, 2] for t in new if t.motion is TrajectoryKind.CUT) < 1.3
    assert steepest_cut(link) <= RAMP
    link.stock.become(StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 8.0]), 0.15))
    before = len(link.trajectories)
    link._stepped(loop(0.8, 0.6).points, True)  # what still shows where it has been is out of its reach
    assert len(link.trajectories) == before


def test_the_last_bit_of_a_way_down_is_slow_where_something_stands_there():
    """Slivers that may stand between the nodes, thin enough for the end to take, and none."""
    for skin, feed in ((0.0, 800), (0.05, 200)):
        link = linker(tool(4.0, 0.0), top=1.0)
        link.stock.become(StockMap(link.stock.lattice, link.stock.top, link.stock.cover + skin, link.stock.part))
        link.add(straight(5, 25, 10, 1.0))
        down = [t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH
                and t.points[-1, 2] < t.points[0, 2]]
        assert down[-1].feed == feed


def test_no_way_in_leads_through_a_wall_from_where_the_tool_has_been():
    """It is thin, and no higher over the pass than stock may be; on its other side the tool has been deeper."""
    mesh = joined(box_mesh([0, 0, -2], [30, 30, 0]), box_mesh([5, 14.8, 0], [25, 15.2, 2.0]))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 2.0]), 0.15)
    link = Linker(field_of(mesh, tool(6.0, 0.0)), stock, Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 1.0, 0.001),
                  Depths(stock.lattice))
    for y in (11.7, 18.3):
        link.depths.cut(straight(10, 20, y, 0.5).points)
    for x, y in ((15.0, 18.3), (15.0, 18.35)):
        for q in link.ways._been_beside(np.array([x, y, 1.0])):
            assert q[1] > 15.2
    assert not link.ways._leads_onto(np.array([15.0, 11.7, 1.0]), np.array([15.0, 18.3, 1.0]))
    assert not link.ways._leads_onto(np.array([15.0, 15.0, 1.0]), np.array([15.0, 18.3, 1.0]))


def test_a_way_down_goes_down_no_faster_than_straight_down_it_may():
    link = linker(step_down=0.5)
    link.motions.plunge_feed = 10.0
    assert link.add(straight(13, 17, 15, TOP - 0.5))
    down = [t for t in link.trajectories if t.motion is TrajectoryKind.CUT and np.diff(t.points[:, 2]).min() < -1e-9]
    assert down
    for t in down:
        way = np.diff(t.points, axis=0)
        assert (-way[:, 2] / np.linalg.norm(way, axis=1)).max() * t.feed == pytest.approx(10.0)
    assert [t.feed for t in link.trajectories if t.motion is TrajectoryKind.CUT][-1] == 800


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
