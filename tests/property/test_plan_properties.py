"""What every plan keeps, on parts with walls, a corner, a dome and a valley."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum
from tests.hand_parts import (
    Case,
    ball,
    blocks,
    box_mesh,
    corner,
    dome,
    field_of,
    low_walls,
    plan_part,
    slope_field,
    terraces,
    tool,
    walls,
)
from tests.plan_checks import (
    PLUNGE_SHARE,
    body_intrusion,
    brute_residual,
    deepest_gouge,
    dense,
    gaps_between,
    rapid_faults,
    worst_meeting,
    worst_plunge,
)
from toolpath.workingsteps import CutDirection, TrajectoryKind
from zones.reach.tip_field import touchable


def valley():
    return slope_field(lambda x, y: 0.08 * x * x - 0.03 * y * y)


def held():
    """A ball whose shank and holder are wide and low enough to count beside the walls."""
    return ball(3.0, neck=3.0, shank=4.0, stickout=5.0, holder=(HolderFrustum(12, 20, 8),))


CASES = {
    "walls": lambda: plan_part(low_walls(), [ball(3.0)]),
    "walls from a block": lambda: plan_part(low_walls(), [tool(3.0, 0.0, "T1"), ball(2.5, "T2")], near_net=False),
    "walls with holder": lambda: plan_part(low_walls(), [held()]),
    "corner": lambda: plan_part(corner(), [ball(3.0), tool(4.0, 0.0, "T2")]),
    "dome": lambda: plan_part(dome(size=8.0), [ball(4.0)], near_net=False),
    "valley": lambda: plan_part(valley(), [ball(3.0)]),
    "valley by bull": lambda: plan_part(valley(), [tool(4.0, 1.0)], near_net=False),
    "walls with allowance": lambda: plan_part(low_walls(), [ball(3.0)], allowance=0.2),
    "walls conventional": lambda: plan_part(low_walls(), [ball(3.0)], cut_direction=CutDirection.CONVENTIONAL),
    "finishing only": lambda: plan_part(valley(), [ball(3.0)], roughing=False),
    "two high walls": lambda: plan_part(walls(), [ball(3.0)], near_net=False),
}
SLOW = {"two high walls", "finishing only"}
PLUNGES = {"corner", "dome", "valley"}


def names(everyday: set[str]) -> list:
    """All cases as parameters, those that are not for every day marked slow."""
    return [pytest.param(n, marks=() if n in everyday else pytest.mark.slow) for n in CASES]


@cache
def case(name: str) -> Case:
    return CASES[name]()


@pytest.mark.parametrize("name", names(set(CASES) - SLOW))
def test_no_feed_move_enters_the_part(name):
    c = case(name)
    assert c.moves(TrajectoryKind.CUT)
    # the chordal tolerance holds for the path; the lattice never does
    assert deepest_gouge(c, c.settings.chordal_tolerance, c.settings.stock_allowance) <= 1e-6


@pytest.mark.parametrize("name", names(set(CASES) - SLOW))
def test_trajectories_join_and_rapids_move_one_way_at_a_time(name):
    c = case(name)
    for step in c.plan.steps:
        assert gaps_between(step) < 1e-9
        assert rapid_faults(step, c.settings.clearance, c.settings.rapid_floor) == []
        first, last = step.trajectories[0], step.trajectories[-1]
        assert first.motion is TrajectoryKind.RAPID and last.points[-1, 2] == pytest.approx(c.settings.clearance)
        for t in step.trajectories:
            assert len(t.points) >= 2 and np.isfinite(t.points).all()
            assert t.motion is TrajectoryKind.RAPID or t.feed > 0


@pytest.mark.parametrize("name", names(PLUNGES))
def test_no_descent_steeper_than_the_ramp_takes_more_than_a_skin(name):
    worst, where = worst_plunge(case(name))
    assert worst <= PLUNGE_SHARE, where


@pytest.mark.parametrize("name", ["walls", "dome", "valley", "walls with holder"])
def test_the_scallop_left_is_within_the_request(name):
    # at samples of its own, wherever the tool can touch the part at all
    c = case(name)
    for z, p in zip(c.zones, c.plan.zones, strict=True):
        assert p.step is not None and len(p.left) <= 0.002 * len(z.samples) + 1
    fresh = sample_surface(c.part.mesh, 40.0, seed=99)
    fresh = fresh.subset(fresh.normals[:, 2] > -0.02)
    lift, body = 0.002, c.zones[0].tool
    fresh = fresh.subset(touchable(c.fields[body.id], fresh.points, fresh.normals, lift)[1])
    left = brute_residual(fresh.points, c.moves(TrajectoryKind.CUT))
    assert len(left) > 500 and left.min() >= -c.settings.chordal_tolerance
    assert left.max() <= c.settings.scallop_height  # between samples 0.2 mm apart, up to the border of the reach


def test_what_stock_of_another_zone_was_in_the_way_of_is_finished_after_that_zone():
    c = plan_part(low_walls(), [held()], roughing=False)
    finish = [s for s in c.plan.steps if s.zone]
    first, again = (s for s in finish if s.zone == "Z1")
    assert [s.zone for s in finish] == ["Z1", "Z2", "Z1"] and first.strategy == again.strategy == "zigzag"
    left = [brute_residual(c.samples.points[c.zones[0].samples], [
        (s.tool, t.points) for s in steps for t in s.trajectories if t.motion is TrajectoryKind.CUT])
        for steps in (finish[:1], finish)]
    assert left[0].max() > c.settings.scallop_height >= left[1].max()


@pytest.mark.slow
def test_stock_that_another_tool_takes_away_sends_the_first_one_back():
    longer = ball(3.0, "T2", neck=3.0, shank=3.0, stickout=25.0)
    c = plan_part(low_walls(), [held(), longer], roughing=False, near_net=False)
    finish = [(s.tool.id, s.zone) for s in c.plan.steps]
    zone, *_ = (z for z, n in Counter(z for _, z in finish).items() if n > 1)
    assert [t for t, z in finish if z == zone] == ["T1", "T1"] and finish[-1] == ("T1", zone)
    assert any(t == "T2" for t, _ in finish[:-1])
    assert all(not len(z.left) for z in c.plan.zones)
    assert deepest_gouge(c, c.settings.chordal_tolerance) <= 1e-6 and worst_meeting(c)[0] <= 0.0


def test_no_zone_is_gone_over_again_for_nothing():
    # places that no pass of this tool mends stay as they are
    c = plan_part(blocks(7), [held()])
    assert sum(len(z.left) for z in c.plan.zones) > 0
    finish = [s for s in c.plan.steps if s.zone]
    assert [s.zone for s in finish[:len(c.zones)]] == [z.id for z in c.zones]
    for again in finish[len(c.zones):]:
        zone, at = next(z for z in c.zones if z.id == again.zone), c.plan.steps.index(again)
        before, after = (brute_residual(c.samples.points[zone.samples], [
            (s.tool, t.points) for s in c.plan.steps[:n] for t in s.trajectories if t.motion is TrajectoryKind.CUT])
            for n in (at, at + 1))
        assert (before - after).max() > 1e-3


def hill(fixtures=()):
    """A hill whose flanks lean by up to 62 degrees on a block with free edges."""
    return plan_part(slope_field(lambda x, y: 6.0 * np.exp(-(x * x + y * y) / 8.0), n=80), [ball(3.0)], faces={2},
                     fixtures=fixtures)


def cut_by(c: Case, *strategies: str) -> list:
    return [(s.tool, t.points) for s in c.plan.steps if s.strategy in strategies for t in s.trajectories
            if t.motion is TrajectoryKind.CUT]


def test_steep_and_shallow_passes_overlap_where_they_meet():
    c = hill()
    fresh = sample_surface(c.part.mesh, 60.0, seed=99)
    fresh = fresh.subset(fresh.face == 2)
    fresh = fresh.subset(touchable(c.fields["T1"], fresh.points, fresh.normals, 0.002)[1])
    h = c.settings.scallop_height
    assert brute_residual(fresh.points, c.moves(TrajectoryKind.CUT)).max() <= h
    lean = np.degrees(np.arccos(fresh.normals[:, 2]))  # waterlines from 45 degrees on
    for strategies, low, high in ((("zigzag", "spiral"), 42.0, 52.0), (("waterline",), 42.0, 48.0)):
        near = (low < lean) & (lean < high)
        assert near.sum() > 400
        alone = brute_residual(fresh.points[near], cut_by(c, *strategies))
        assert (alone <= h).mean() > 0.99, strategies


def test_passes_run_over_the_edge_unless_something_stands_there():
    clamps = ((6.0, -2.0, -3.0), (9.0, 2.0, 3.0)), ((-2.0, 6.0, -3.0), (2.0, 9.0, 3.0))
    free, held = (np.vstack([p for _, p in cut_by(hill(f), "zigzag", "spiral")]) for f in ((), clamps))
    feed = int(np.argmax(np.ptp(free[:, :2], axis=0)))  # along x or along y, which are as good; edges at 6 mm
    assert free[:, feed].max() > 6.25 and free[:, feed].min() < -6.25
    for axis in (0, 1):
        beside = np.abs(held[:, 1 - axis]) < 2.0
        assert held[beside, axis].max() <= 4.501
    assert np.abs(held[:, :2]).max() > 6.25


def test_an_allowance_stays_on_the_part():
    c = case("walls with allowance")
    points = np.vstack([c.samples.points[z.samples] for z in c.zones])[::3]
    normals = np.vstack([c.samples.normals[z.samples] for z in c.zones])[::3]
    left = brute_residual(points + 0.2 * normals, c.moves(TrajectoryKind.CUT))
    assert np.quantile(left, 0.99) <= c.settings.scallop_height
    # and no cutter comes nearer to the part itself than the allowance
    assert brute_residual(points, c.moves(TrajectoryKind.CUT)).min() >= 0.2 - c.settings.chordal_tolerance


def turn_round_walls(c: Case) -> tuple[float, float]:
    """Length walked with material on the right and on the left beside upright walls in the finish, mm."""
    right = left = 0.0
    for s in c.plan.steps:
        if s.strategy != "waterline":
            continue
        for t in s.trajectories:
            if t.motion is not TrajectoryKind.CUT:
                continue
            a, b = t.points[:-1], t.points[1:]
            run = np.hypot(*(b - a)[:, :2].T)
            level = (np.abs(a[:, 2] - b[:, 2]) < 1e-9) & (run > 0.05)
            mid, way = 0.5 * (a + b)[level], (b - a)[level, :2] / run[level, None]
            aside = np.column_stack([way[:, 1], -way[:, 0]]) * 0.1
            for sign in (1, -1):
                at = mid[:, :2] + sign * aside
                hit = drop_tips(c.tree, at, s.tool.radius, s.tool.corner_radius) > mid[:, 2] + 1e-3
                if sign > 0:
                    right += float(run[level][hit].sum())
                else:
                    left += float(run[level][hit].sum())
    return right, left


def test_climb_keeps_the_wall_on_the_right_and_conventional_on_the_left():
    right, left = turn_round_walls(case("walls"))
    assert right > 100 and left < 0.01 * right
    right, left = turn_round_walls(case("walls conventional"))
    assert left > 100 and right < 0.01 * left


def test_conventional_also_turns_the_walls_round_floors_and_the_layers():
    def sense(c, strategy):
        """Signed length round the obstacle: > 0 material on the right."""
        total = 0.0
        for s in c.plan.steps:
            if s.strategy != strategy:
                continue
            for t in s.trajectories:
                if t.motion is not TrajectoryKind.CUT:
                    continue
                a, b = t.points[:-1], t.points[1:]
                run = np.hypot(*(b - a)[:, :2].T)
                keep = run > 0.05
                mid, way = 0.5 * (a + b)[keep], (b - a)[keep, :2] / run[keep, None]
                aside = np.column_stack([way[:, 1], -way[:, 0]]) * 0.3
                for sign in (1, -1):
                    hit = drop_tips(c.tree, mid[:, :2] + sign * aside, s.tool.radius, 0.0) > mid[:, 2] + 0.01
                    total += sign * float(run[keep][hit].sum())
        return total

    one = [plan_part(corner(), [tool(4.0, 0.0)], cut_direction=way)
           for way in (CutDirection.CLIMB, CutDirection.CONVENTIONAL)]
    for strategy in ("planar_floor", "depth_layers"):
        assert sense(one[0], strategy) > 5 and sense(one[1], strategy) < -5, strategy


def test_fixtures_are_kept_clear():
    clamp = ((5.5, 2.0, 2.0), (8.5, 6.0, 5.0))
    c = plan_part(low_walls(), [ball(2.0)], fixtures=(clamp,))
    tree = TriangleTree(box_mesh(*clamp))
    less = c.settings.chordal_tolerance
    for body, points in c.moves():
        p = dense(points, 0.05)
        limit = drop_tips(tree, p[:, :2], body.radius - less, body.radius - less) - less
        assert (limit <= p[:, 2] + 1e-6).all()


def test_shank_and_holder_stay_clear_of_the_walls():
    c = case("walls with holder")
    free = touchable(field_of(c.tree, ball(3.0)), c.samples.points, c.samples.normals, 0.002)[1].sum()
    assert sum(len(z.samples) for z in c.zones) < free  # the holder does cost reach here
    for body, points in c.moves():
        assert body_intrusion(c.tree, body, points, 0.2, 1.0) <= 1e-4


def test_a_wide_holder_keeps_off_a_high_block_also_from_beside_it():
    mesh = terraces([0, 4, 10], [0, 5], [[13, 2]])
    c = plan_part(mesh, [ball(4.0, stickout=8.0, holder=(HolderFrustum(30, 30, 30),))])
    assert c.moves(TrajectoryKind.CUT)
    for body, points in c.moves():
        assert body_intrusion(c.tree, body, points, 0.2, 1.0) <= 1e-4


def test_the_same_input_gives_the_same_plan():
    one, two = (plan_part(corner(), [ball(3.0), tool(4.0, 0.0, "T2")]) for _ in range(2))
    assert [s.name for s in one.plan.steps] == [s.name for s in two.plan.steps]
    for a, b in zip(one.moves(*TrajectoryKind), two.moves(*TrajectoryKind), strict=True):
        assert a[1].tobytes() == b[1].tobytes()
