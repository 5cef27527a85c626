"""Passes on a matched end as motions: what they leave by the proof's measure, layers through stock, where they stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import RAMP, ball, box_mesh, joined, samples_of, slope_field, tool
from tests.unit.toolpath.five_axis.test_matched_passes import bowl, measured
from toolpath.five_axis.oriented_motion import LAYER, THICK, Surroundings, _leads, lowered, with_ways
from toolpath.five_axis.oriented_pass import enters
from toolpath.five_axis.oriented_piece import Piece
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import TrimmedFace
from toolpath.plan_settings import CutData, PlanSettings, RotaryAxes
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.strategies.curvature_matched import matched, suits
from toolpath.workingsteps import TrajectoryKind
from zones.reach.assembly import Clearances

SCALLOP, LIFT, FEED = 0.01, 0.003, 800.0
LOOP = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float)
BULL = tool(12.0, 1.0)
HOLLOW = slope_field(lambda x, y: x * x / 120.0 + y * y / 300.0, size=40.0, n=100)
SURFACE = bowl(60.0, 150.0)
FREE = RotaryAxes(lambda axes: np.ones(len(axes), bool), lambda tips, axes: (tips, axes, np.zeros(len(tips) - 1)),
               np.array([0.0, 0.0, 1.0]), -100.0)


def settings_of(turning=FREE):
    return PlanSettings(SCALLOP, 0.002, 0.0, LIFT, 20.0, 19.0, RAMP, turning=turning)


def found(mesh=HOLLOW, margin=1.0, allowance=0.0, turning=FREE, body=BULL, most=1e9, part=None):
    tree = TriangleTree(mesh)
    samples = samples_of(HOLLOW, 2.0, {2})
    target = FinishTarget(samples.points, samples.normals, samples.points, 0.7)
    if part is not None:
        rows = part(samples.points)
        target = FinishTarget(samples.points[rows], samples.normals[rows], samples.points[rows], 0.7)
    clear = Clearances()
    around = Surroundings(enters(tree, body, clear, allowance - LIFT), turning,
                          StockMap.around(tree, mesh.bounds, margin, 0.25), (), clear)
    cut = CutData(10_000, FEED, 200, 3000, 3.6)
    return matched([TrimmedFace(2, SURFACE, (LOOP,), 1600.0)], target, body, cut, settings_of(turning), around,
                   allowance, most), around


def cuts(runs):
    return [(t.points, t.axes) for run in runs.runs for t in run if t.motion is TrajectoryKind.CUT]


@pytest.fixture(scope="module")
def whole():
    """The hollow with 1 mm of stock on it."""
    return found()


def test_a_hollow_is_cut_to_the_scallop_and_no_deeper(whole):
    left = measured(SURFACE, BULL, cuts(whole[0]))
    assert left.max() <= SCALLOP and left.min() > -0.002


@pytest.mark.slow
def test_an_allowance_is_left_on_all_of_it():
    runs, _ = found(allowance=0.2)
    left = measured(SURFACE, BULL, cuts(runs)) - 0.2
    assert left.max() <= SCALLOP and left.min() > -0.002


def test_there_are_layers_where_more_stands_than_the_end_takes(whole):
    """A pass through 1 mm of stock is preceded by one that leaves no more than the end takes at once."""
    runs, around = whole
    thin, _ = found(margin=0.5)
    assert len(runs.runs) == 2 * len(thin.runs)
    way = np.column_stack([np.linspace(-10.0, 10.0, 41), np.zeros((41, 2))])
    axes = np.tile([np.sin(0.05), 0.0, np.cos(0.05)], (41, 1))
    fresh = StockMap.box(TriangleTree(box_mesh([-30, -30, -2], [30, 30, 0])), np.array([-30.0, -30, -2]),
                         np.array([30.0, 30, 2.5]), 0.25)
    piece = Piece(way, axes, axes, BULL.radius, on_end=True)
    layers = lowered(piece, BULL, replace(around, stock=fresh))
    assert layers[-1] is piece
    heights = [float((layer.tips[0] - way[0]) @ axes[0]) for layer in layers]
    step = LAYER * min(THICK, SKIN) * BULL.diameter
    np.testing.assert_allclose(np.diff(heights), -step, atol=1e-9)
    assert heights[0] >= 2.5 - SKIN * BULL.diameter - 0.5


def test_each_pass_comes_down_along_its_axis_the_last_skin_of_it_at_the_plunge_feed(whole):
    runs, _ = whole
    for run in runs.runs:
        kinds = [t.motion for t in run]
        assert kinds[0] is TrajectoryKind.APPROACH and kinds[-1] is TrajectoryKind.LIFT and TrajectoryKind.CUT in kinds
        ways = [t for t in run if t.motion is TrajectoryKind.APPROACH]
        for t in ways:
            gone = np.diff(t.points, axis=0)
            assert np.linalg.norm(np.cross(gone, t.axes[0]), axis=1).max() < 1e-6
        assert ways[-1].feed == 200.0
        assert np.linalg.norm(ways[-1].points[0] - ways[-1].points[-1]) >= SKIN * BULL.diameter or len(ways) == 1


@pytest.mark.slow
def test_a_pass_ends_at_what_stands_in_its_way():
    """A post on the hollow: no pose comes into it, and away from it the surface is cut all the same."""
    mesh = joined(HOLLOW, box_mesh([4, 4, -1], [9, 9, 30]))
    runs, around = found(mesh)
    poses = cuts(runs)
    for tips, axes in poses:
        assert not around.blocked(tips, axes, BULL).any()
    left = measured(SURFACE, BULL, poses)
    g = (np.arange(120) + 0.5) / 120 * 40.0 - 20.0
    x, y = np.meshgrid(g, g, indexing="ij")
    far = (np.hypot(x - 6.5, y - 6.5) > 25.0).ravel()
    near = ((np.abs(x - 6.5) < 2.0) & (np.abs(y - 6.5) < 2.0)).ravel()
    assert np.median(left[far]) <= SCALLOP  # the post is as far along x as along y: no matter which runs first
    assert left[near].min() > 0.5


@pytest.mark.slow
def test_only_what_is_wanted_is_walked(whole):
    runs, _ = found(part=lambda p: p[:, 0] > 8.0)
    tips = np.vstack([t for t, _ in cuts(runs)])
    assert len(runs.runs) < len(whole[0].runs) and tips[:, 0].min() > -8.0


def test_what_the_machine_cannot_take_is_left():
    stiff = replace(FREE, stands=lambda axes: np.zeros(len(axes), bool))
    runs, _ = found(turning=stiff)
    assert not runs.runs and runs.refused == ("F2: the tool is almost nowhere free with its end on the face",)


def test_slower_than_the_usual_passes_is_told_with_both_figures():
    runs, _ = found(most=1.0)
    assert not runs.runs and "s, the usual passes 1" in runs.refused[0]


def test_balls_have_no_end_to_match():
    assert suits(BULL) and suits(tool(6.0, 0.0)) and not suits(ball(6.0))


def come_down(corner, overlap):
    """How fast, beside a wall of stock 14 mm high, the tool comes down to a pass along x whose left side is in it by so
    much; None where there is no way in."""
    body, step = tool(12.0, corner), 0.15
    mesh = box_mesh([-20, -20, -2], [20, 20, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([-20.0, -20.0, -2.0]), np.array([20.0, 20.0, 0.3]), step)
    y = stock.lattice.y0 + step * np.arange(stock.lattice.ny)
    stock.top[y > 6.0 - overlap] = 14.0
    axes = np.tile([np.sin(0.05), 0.0, np.cos(0.05)], (41, 1))
    way = np.column_stack([np.linspace(-10.0, 10.0, 41), np.zeros((41, 2))]) + [0.0, 0.0, 0.02]
    around = Surroundings(lambda tips, a: np.zeros(len(tips), bool), FREE, stock, (), Clearances())
    cut = CutData(10_000, FEED, 200, 3000, 3.6)
    made = with_ways(Piece(way, axes, axes, 6.0, on_end=True), body, cut, settings_of(), around)
    if isinstance(made, str):
        return None
    low = [t.feed for t in made if t.motion is TrajectoryKind.APPROACH and t.points[:, 2].min() < 13.0 - corner]
    return max(low)


@pytest.mark.parametrize("corner", [0.0, 0.5, 1.0, 3.0])
def test_no_way_in_goes_through_stock_beside_it(corner):
    """A bull nose came down through 0.9 mm of a wall of stock at the link feed: its corner hid what stood beside it."""
    assert come_down(corner, -1.0) == 3000.0
    assert come_down(corner, 0.15) in (200.0, None)  # nearer than the map can tell
    for overlap in (0.5, 0.9):
        assert come_down(corner, overlap) is None


def test_a_pass_that_begins_on_the_spot_has_a_way_in():
    axes = np.array([[np.sin(a), 0.0, np.cos(a)] for a in (0.05, 0.08, 0.08)])
    piece = Piece(np.array([[0.0, 0, 1], [0, 0, 1], [4.0, 0, 1]]), axes, axes, 6.0, on_end=True)
    leads = _leads(piece, tool(12.0, 1.0), 1.44, 0.001)
    aside = [way[0] - piece.tips[0] for way, _, _ in leads]
    assert all(np.isfinite(a).all() and abs(a @ axes[0]) < 1e-9 for a in aside)
    assert aside[0][0] < -1.0 and not aside[-1].any()
    assert all((way[-1] == piece.tips[0]).all() for way, _, _ in leads)
