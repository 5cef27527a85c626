"""Passes of a leaning tool as motions: what the stock lets through, and how fast tip and flank go."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, box_mesh, tool
from toolpath.five_axis.oriented_motion import (
    MIN_PACE,
    Surroundings,
    _begun_level,
    _descends,
    _steady,
    loaded,
    paced,
    with_ways,
)
from toolpath.five_axis.oriented_piece import Piece
from toolpath.plan_settings import CutData, PlanSettings, RotaryAxes
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.workingsteps import TrajectoryKind
from zones.reach.assembly import Clearances, Disc

STEP, TOP = 0.1, 12.0
PART = box_mesh([0, 0, -2], [30, 30, 0])
LEAN = np.array([[0.2, 0.0, np.sqrt(0.96)]])


def block(low, high):
    """Stock between two corners on a part that lies under it."""
    stock = StockMap.box(TriangleTree(PART), np.array([0.0, 0.0, -2.0]), np.array([30.0, 30.0, 0.0]), STEP)
    x = stock.lattice.x0 + STEP * np.arange(stock.lattice.nx)
    y = stock.lattice.y0 + STEP * np.arange(stock.lattice.ny)
    stands = ((y[:, None] >= low[1]) & (y[:, None] <= high[1])) & ((x >= low[0]) & (x <= high[0]))
    stock.top[stands] = high[2]
    stock.cover[stands] = high[2]
    return stock


def asked(stock, tip, axis, body, thick, discs=()):
    return bool(loaded(stock, np.array([tip]), axis, body, discs, Clearances(), thick)[0])


@pytest.mark.parametrize("body", [tool(6.0, 1.0, neck=20.0, stickout=30.0), ball(6.0, neck=20.0, stickout=30.0)],
                         ids=["bull", "ball"])
def test_the_flank_is_let_through_up_to_what_it_may_take_and_no_farther(body):
    stock = block((14.0, 5.0), (15.0, 25.0, 8.0))
    upright = np.array([[0.0, 0.0, 1.0]])
    for deep, want in ((0.2, False), (0.45, False), (0.8, True), (1.5, True)):
        assert asked(stock, [15.0 + 3.0 - deep, 15.0, 0.5], upright, body, 0.6) is want
    assert not asked(stock, [18.2, 15.0, 0.5], upright, body, 0.0)
    assert asked(stock, [17.7, 15.0, 0.5], upright, body, 0.0)


@pytest.mark.parametrize("corner", [0.0, 1.0, 3.0])
def test_stock_under_the_nose_counts(corner):
    """A slab under the tool, whose end is in it: more than it may take is told, whatever the end."""
    body = tool(6.0, corner, neck=20.0, stickout=30.0)
    stock = block((0.0, 0.0), (30.0, 30.0, 3.0))
    assert asked(stock, [15.0, 15.0, 2.0], LEAN, body, 0.6)
    assert not asked(stock, [15.0, 15.0, 3.8], LEAN, body, 0.6)


@pytest.mark.parametrize("corner", [0.0, 1.0, 3.0])
def test_under_the_end_no_more_than_the_skin_of_a_way_down_is_let_through(corner):
    body, upright = tool(6.0, corner, neck=20.0, stickout=30.0), np.array([[0.0, 0.0, 1.0]])
    stock = block((0.0, 0.0), (30.0, 30.0, 3.0))
    for deep, want in ((0.40, False), (0.55, True)):  # the skin is 0.48, the flank may take 0.6
        assert asked(stock, [15.0, 15.0, 3.0 - deep], upright, body, 0.6) is want


def test_neck_shank_and_holder_meet_no_stock_at_all():
    upright = np.array([[0.0, 0.0, 1.0]])
    body = tool(6.0, 1.0, neck=20.0, stickout=24.0)  # 5.7 neck from 12 up
    high = block((14.0, 5.0), (15.0, 25.0, 16.0))
    for gap, want in ((0.02, False), (-0.3, True)):
        assert asked(high, [15.0 + 3.0 + gap, 15.0, 0.5], upright, body, 0.9) is want, gap
    low = block((14.0, 5.0), (15.0, 25.0, 10.0))  # below the end of the flutes
    assert not asked(low, [15.0 + 3.0 - 0.3, 15.0, 0.5], upright, body, 0.9)
    holder = (Disc("holder", 10.0, 24.0),)
    assert asked(block((6.0, 5.0), (8.0, 25.0, 26.0)), [17.0, 15.0, 0.5], upright, body, 0.9, holder)
    assert not asked(block((6.0, 5.0), (8.0, 25.0, 24.0)), [17.0, 15.0, 0.5], upright, body, 0.9, holder)


def test_no_pose_is_asked_without_an_error():
    """A pass that is in the part wherever it is raised to has none left: seed 15 of the five-axis sweep ended there."""
    stock = block((0.0, 0.0), (30.0, 30.0, 3.0))
    none = loaded(stock, np.zeros((0, 3)), np.zeros((0, 3)), tool(6.0, 1.0), (), Clearances(), 0.6)
    assert none.shape == (0,) and none.dtype == np.bool_


def test_a_lattice_too_coarse_to_tell_lets_nothing_through():
    assert asked(block((0.0, 0.0), (1.0, 1.0, 1.0)), [15.0, 15.0, 5.0], LEAN, tool(0.6, 0.1), 0.06)


def test_a_leaning_ball_takes_off_all_that_is_in_it_and_no_more():
    """Against the capsule its nose sweeps, over random places: the lowest of it is known however the ball leans."""
    body = ball(6.0, neck=20.0, stickout=30.0)
    stock = block((5.0, 5.0), (25.0, 25.0, 3.0))
    tips = np.array([[12.0, 7.5, 1.0], [12.0, 22.5, 1.0]])
    stock.cut_leaning(tips, np.repeat(LEAN, 2, axis=0), body)
    x, y, z = tips[0] + body.radius * LEAN[0]
    gx = stock.lattice.x0 + STEP * np.arange(stock.lattice.nx)
    row = int(round((15.0 - stock.lattice.y0) / STEP))
    near = np.abs(gx - x) < 2.0
    lowest = z - np.sqrt(body.radius**2 - (gx[near] - x) ** 2)
    cusp = 0.002  # poses are taken off two lattice steps apart: STEP² / 2 r
    assert (lowest < 3.0).all()
    np.testing.assert_array_less(stock.top[row, near] - lowest, cusp)
    np.testing.assert_array_less(lowest - 1e-9, stock.top[row, near])
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(5.0, 25.0, (40_000, 2)), rng.uniform(0.0, 3.0, 40_000)])
    centre = np.array([x, y, z])
    beside = points - centre
    beside[:, 1] = np.where(points[:, 1] < y, points[:, 1] - y, np.maximum(points[:, 1] - 22.5, 0.0))
    along = beside @ LEAN[0]
    off = np.linalg.norm(beside - along[:, None] * LEAN[0], axis=1)
    inside = np.where(along > 0.0, off < body.radius, np.linalg.norm(beside, axis=1) < body.radius)
    stands = stock.cover[stock.lattice.cells(points)] >= points[:, 2]
    assert inside.sum() > 1000 and stands[~inside].all()


def test_a_leaning_ball_takes_nothing_off_above_short_flutes():
    """A ball with flutes up to its widest place, and a slim neck: leaning flat, most of its lower side cuts nothing."""
    body = replace(ball(6.0, neck=20.0, stickout=30.0), flute_length=3.2, neck_diameter=2.0)
    axes = np.tile([np.sin(np.radians(75.0)), 0.0, np.cos(np.radians(75.0))], (2, 1))
    tips = np.array([[12.0, 7.5, 3.2], [12.0, 22.5, 3.2]])
    centre = tips[0] + body.radius * axes[0]
    stock = block((5.0, 5.0), (25.0, 25.0, 3.0))
    stock.cut_leaning(tips, axes, body)
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(10.0, 20.0, 20_000), np.full(20_000, 15.0), rng.uniform(0.0, 3.0, 20_000)])
    beside = points - [centre[0], 15.0, centre[2]]
    unfluted = (beside @ axes[0] > body.flute_length - body.radius) & (np.linalg.norm(beside, axis=1) < body.radius)
    assert unfluted.sum() > 1000
    assert (stock.top[stock.lattice.cells(points)] >= points[:, 2])[unfluted].all()


def test_what_a_leaning_flank_takes_off_the_stock_is_gone_and_no_more():
    """Against the cutting part itself, moved along a line of which two poses are given: columns over random places."""
    body = tool(6.0, 1.0, neck=20.0, stickout=30.0)
    stock = block((5.0, 5.0), (25.0, 25.0, 8.0))
    before = stock.cover.copy()
    stock.cut_leaning(np.array([[12.0, 7.5, -0.5], [12.0, 22.5, -0.5]]), np.repeat(LEAN, 2, axis=0), body)
    assert (stock.cover <= before).all() and (stock.cover < before).sum() > 5000
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(5.0, 25.0, (40_000, 2)), rng.uniform(0.0, 8.0, 40_000)])
    rel = points - [12.0, 0.0, -0.5]
    rel[:, 1] = np.where(points[:, 1] < 7.5, points[:, 1] - 7.5, np.maximum(points[:, 1] - 22.5, 0.0))
    high = rel @ LEAN[0]
    off = np.linalg.norm(rel - high[:, None] * LEAN[0], axis=1)
    nose = np.hypot(np.maximum(off - 2.0, 0.0), 1.0 - np.minimum(high, 1.0)) < 1.0
    inside = (off < 3.0) & nose & (high < body.flute_length)
    stands = stock.cover[stock.lattice.cells(points)] >= points[:, 2]
    assert stands[~inside].all()  # nothing is said to be gone that the tool has not been in
    deep = (off < 2.6) & (high > 1.5) & (high < body.flute_length - 0.5)
    column = np.array([8.0 - p[2] for p in points])
    top = (points + column[:, None] * [0.0, 0.0, 1.0]) - [12.0, 0.0, -0.5]
    top[:, 1] = rel[:, 1]
    up = top @ LEAN[0]
    open_above = (np.linalg.norm(top - up[:, None] * LEAN[0], axis=1) < 2.6) & (up < body.flute_length - 0.5)
    assert (deep & open_above).sum() > 500 and not stands[deep & open_above].any()


def test_no_place_of_the_flank_goes_faster_than_the_feed():
    """Round a cone inside, the upper end of the flank goes five times as far as the tip."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    out = np.stack([np.cos(turn), np.sin(turn), np.zeros(181)], -1)
    low, high = 1.2 * out, 6.0 * out + [0.0, 0.0, 10.0]
    axes = (high - low) / np.linalg.norm(high - low, axis=1)[:, None]
    reach = float(np.linalg.norm(high[0] - low[0]))
    feeds = paced(low, axes, reach, 1000.0, np.zeros(180))
    np.testing.assert_allclose(feeds, 200.0, rtol=1e-6)
    slow = paced(low, axes, reach, 1000.0, np.full(180, 1e-3))
    np.testing.assert_allclose(slow, np.linalg.norm(np.diff(low, axis=0), axis=1) / 1e-3, rtol=1e-6)
    assert paced(low * [0.01, 0.01, 1.0], axes, reach, 1000.0, np.zeros(180)) is None
    straight = np.column_stack([np.linspace(0.0, 10.0, 5), np.zeros((5, 2))])
    np.testing.assert_allclose(paced(straight, np.repeat(LEAN, 5, axis=0), 9.0, 800.0, np.zeros(4)), 800.0)
    assert MIN_PACE < 0.2


def test_no_feed_is_written_that_the_axes_cannot_keep_up_with():
    """C swings by 70 degrees beside the pole while the tip goes 0.8 um: at 0.1 mm/min it would turn 8,750 deg/min, and
    has 7,200. And where the tip stands, F would be deg/min."""
    tips = np.array([[0.0, 0.0, 0.0], [0.25, 0.0, 0.0], [0.2508, 0.0, 0.0], [0.5, 0.0, 0.0]])
    axes, swings = np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([0.0, 70.0 / 7200.0, 0.0])
    assert paced(tips, axes, 9.0, 800.0, swings) is None
    feeds = paced(tips * 10.0, axes, 9.0, 800.0, swings)
    assert feeds == pytest.approx([800.0, 0.008 / swings[1], 800.0])
    turned = axes.copy()
    turned[2:] = [np.sin(0.01), 0.0, np.cos(0.01)]
    assert paced(tips[[0, 1, 1, 3]], turned, 9.0, 800.0, np.zeros(3)) is None
    assert paced(tips[[0, 1, 1, 3]], axes, 9.0, 800.0, np.zeros(3)) is not None  # a pose twice is no block


def test_blocks_of_about_one_feed_are_one_motion():
    assert _steady(np.array([100.0, 95.0, 99.0])) == [(0, 3)]
    assert _steady(np.array([100.0, 95.0, 30.0, 29.0, 100.0])) == [(0, 2), (2, 4), (4, 5)]


def test_ways_down_that_are_steep_and_deep_are_told():
    """Up 2 mm and down again over 20 mm of way; then a dip of 0.05 mm, as steep; the axis leans across the way."""
    x = np.arange(0.0, 60.0, 0.5)
    axis = np.array([0.0, 0.3, np.sqrt(0.91)])
    rise = np.interp(x, [5, 15, 20, 30, 40, 40.5, 41, 60], [0, 2, 2, 0, 0, -0.05, 0, 0])
    tips = np.column_stack([x, 0.0 * x, 0.0 * x]) + rise[:, None] * axis
    piece = Piece(tips, np.tile(axis, (len(x), 1)), tips, 8.0)
    told = _descends(piece, np.tan(np.radians(5.0)), 0.1)
    assert x[told].tolist() == x[(x >= 20.0) & (x <= 30.0)].tolist()
    assert not _descends(piece, np.tan(np.radians(12.0)), 0.1).any()  # 2 in 10 is 11.3 degrees
    assert x[_descends(piece, np.tan(np.radians(5.0)), 0.04)].tolist() == [*x[(x >= 20) & (x <= 30)], 40.0, 40.5]


def test_a_part_does_not_begin_or_end_going_down():
    """Over the brink of a valley, 11 degrees down into fresh stock: seed 103 of the sweep lost its job on 1.558 mm."""
    x = np.arange(0.0, 12.1, 0.5)
    z = np.interp(x, [0.0, 1.0, 7.0, 10.0, 12.0], [0.2, 0.0, 1.8, 1.8, 1.4])
    axes = np.tile([0.0, 0.0, 1.0], (len(x), 1))
    piece = Piece(np.column_stack([x, 0.0 * x, z]), axes, np.roll(axes, 1, axis=1), 5.0)
    kept = _begun_level(piece, np.tan(np.radians(5.0)), 0.5)
    assert kept is not None
    assert kept.tips[:, 0].tolist() == x[(x >= 1.0) & (x <= 10.0)].tolist()
    assert _begun_level(piece, np.tan(np.radians(12.0)), 0.5).tips.tolist() == piece.tips.tolist()
    assert _begun_level(piece, np.tan(np.radians(5.0)), 9.5) is None  # 6.3 and 3 mm are left of it
    assert _begun_level(piece.at(np.array([0.0, 1.0, 2.0])), np.tan(np.radians(5.0)), 0.5) is None


def test_axes_that_lie_are_left_and_cost_no_more_than_others():
    """Flat axes were followed through a kilometre of air: seed 3 of the five-axis sweep took 23 GB."""
    stock = block((0.0, 0.0), (30.0, 30.0, 3.0))
    flat = np.array([[1.0, 0.0, 0.0]])
    assert loaded(stock, np.array([[10.0, 15.0, 2.0]]), flat, tool(6.0, 1.0), (), Clearances(), 0.6)[0]
    free = RotaryAxes(lambda a: np.ones(len(a), bool), lambda t, a: None, np.array([0.0, 0.0, 1.0]), -1e3)
    around = Surroundings(lambda tips, axes: np.zeros(len(tips), bool), free, stock, (), Clearances())
    lean = np.array([[np.sqrt(1.0 - z * z), 0.0, z] for z in (0.05, 0.3)])
    assert around.blocked(np.full((2, 3), 40.0), lean, tool(6.0, 1.0)).tolist() == [True, False]


@pytest.mark.parametrize(("left", "cut"), [(0.0, True), (0.4, True), (0.7, False)])
def test_a_flank_pass_begins_on_a_floor_that_is_finished_later(left, cut):
    """The end takes a skin along the whole pass, and so it may on the way to it: on the demo part no flank pass began
    once layers left 0.27 mm on floors."""
    body, up = tool(6.0, 0.0, neck=20.0, stickout=30.0), np.array([0.0, 0.0, 1.0])
    stock = block((0.0, 0.0), (30.0, 30.0, left))
    free = RotaryAxes(lambda a: np.ones(len(a), bool), lambda t, a: (t, a, np.zeros(len(t) - 1)), up, -1e3)
    around = Surroundings(lambda tips, axes: tips[:, 1] < 15.0 - 1e-9, free, stock, (), Clearances())
    tips = np.column_stack([np.linspace(9.0, 21.0, 25), np.full(25, 15.0), np.full(25, 0.02)])
    piece = Piece(tips, np.tile(up, (25, 1)), np.tile([0.0, 1.0, 0.0], (25, 1)), 8.0)
    settings = PlanSettings(0.02, 0.004, 0.0, 0.002, 15.0, 14.0, np.radians(3.0))
    made = with_ways(piece, body, CutData(10_000, 800, 200, 3000, 1.8), settings, around)
    assert left < 0.5 * body.diameter and (left - 0.02 < SKIN * body.diameter) is cut
    if not cut:
        assert isinstance(made, str)
        return
    slow = [t for t in made if t.motion is TrajectoryKind.APPROACH and t.feed == 200]
    assert slow[0].points[0, 2] > left + 0.3  # the feed of a plunge begins above the stock
    assert any(t.motion is TrajectoryKind.CUT for t in made)
