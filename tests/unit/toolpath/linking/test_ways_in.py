"""Ways into passes, on a plate under a block of stock."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import RAMP, ball, box_mesh, field_of, joined, tool
from tests.linked_plate import TOP, linker, loop, motions, steepest_cut, straight
from toolpath.counterexamples import CARE, Counterexamples
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.ramp_entry import IN_CUT
from toolpath.linking.rapid_travel import Motions
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.workingsteps import TrajectoryKind


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


def digging(cut, along, top=np.inf):
    """What each steep descent of a polyline takes below all that was walked before, mm, and the way of the other moves.

    top : mm, of the stock before it
    Looked at every 0.05 mm of ``along`` (n,), mm, on which a point of the polyline lies in plan.
    """
    places = np.linspace(along.min(), along.max(), int(np.ptp(along) / 0.05) + 2)
    lowest, dug, aside = np.full(len(places), top), [], 0.0
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
    assert dug.sum() <= IN_CUT * np.tan(RAMP) * aside  # and the ways between work it off, half of them in air


def test_a_leaning_line_is_not_begun_at_an_earlier_cut_beside_it_with_stock_over_the_rest_of_it():
    """Its first way down goes steeper than a ramp: with a level line the same is a ramp into the stock."""
    link = linker(top=3.9, step_down=0.6)
    before = np.array([[12.0, 15.0, 2.9], [14.0, 15.0, 2.9]])
    link.stock.cut(before, link.field.tool)
    link.depths.cut(before)
    leaning = Line(np.array([[14.0, 15.0, 3.1], [17.0, 15.0, 3.0]]), False)
    cut = link.ways.ramped(leaning.points, False)[1]
    dug, _ = digging(cut, cut[:, 0], 3.9)
    assert dug.max(initial=0.0) <= SKIN * ball(4.0).diameter
    bare = np.sqrt(4.0 - 1.8**2)  # the hollow of the cut before is as wide as that at 3.1
    assert link.ways._under_stock(leaning.points) == pytest.approx(1.0 - bare / 3.0, abs=0.2)
    level = link.ways.ramped(straight(14.0, 17.0, 15.0, 3.1).points, False)[1]
    assert level[0, 2] == pytest.approx(3.2)  # a tenth above


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
    assert lost <= IN_CUT * np.tan(RAMP) * (1.0 - down) * 2.0 * np.pi * radius


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


@pytest.mark.parametrize(("length", "falls"), [(6.0, 0.0), (6.0, 0.5), (9.0, 0.8)])
def test_a_pass_that_ends_in_air_is_run_back_instead_of_a_longer_ramp(length, falls):
    """It begins inside the stock and ends beyond it; a ramp along it would be more than as long as the pass."""
    ways = linker(step_down=1.0).ways
    points = np.array([[length - 3.0, 15.0, TOP - 1.0 + falls], [-3.0, 15.0, TOP - 1.0]])
    ramp = ways.ramped(points, False)
    entry, cut, _ = ways.down(points, False)
    assert entry[0, 0] == -3.0 and (cut[0, :2] == points[1, :2]).all()  # it comes down beyond the stock
    assert (cut[-2:] == points).all()  # and ends with the whole pass in its own direction
    assert ramp is None or Line(ramp[1], False).length > Line(cut, False).length
    back = np.diff(cut[:-1], axis=0)
    assert (-back[:, 2] <= math.tan(RAMP) * np.hypot(back[:, 0], back[:, 1])).all()
    assert 0.0 < cut[0, 2] - points[1, 2] <= SKIN * 4.0


def test_a_pass_is_not_run_back_downhill_through_more_than_a_skin():
    ways = linker(step_down=1.0).ways
    rising = np.array([[3.0, 15.0, TOP - 1.5], [-3.0, 15.0, TOP - 0.5]])
    assert ways._back_along(rising) is None  # back it falls by 1 mm, up to 1.5 mm deep in the stock
    assert ways._back_along(rising + [0.0, 0.0, 1.7]) is not None  # and here in air
