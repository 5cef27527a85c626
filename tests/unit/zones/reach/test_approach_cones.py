"""Approach of samples and cones of zones where the answer is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum
from tests.hand_parts import ball, dome, field_of, low_walls, terraces, tool
from zones.reach.approach_cones import approach, directions_over_hemisphere, resolution_of, zone_cone
from zones.reach.assembly import Clearances
from zones.reach.tip_field import touchable

LIFT = 0.001
CLEAR = Clearances(shank=0.2, holder=1.0)
UP = np.array([0.0, 0.0, 1.0])
HAIR = math.radians(0.15)
FINE = directions_over_hemisphere(6000)


def leaning(angles, azimuth=0.0):
    """Axes that lean by each angle (rad) from +Z towards an azimuth."""
    a = np.asarray(angles)
    return np.stack([np.sin(a) * math.cos(azimuth), np.sin(a) * math.sin(azimuth), np.cos(a)], axis=-1)


def plate(size=300.0):
    return terraces([-size, size], [-size, size], [[0.0]], base=-5.0)


def slot(gap, depth, length=400.0):
    """Two walls ``gap`` apart, along y, their tops at z = 0; the floor is ``depth`` below."""
    return terraces([-60, -gap / 2, gap / 2, 60], [-length, length], [[0.0, -depth, 0.0]], base=-depth - 3.0)


def test_directions_are_even_and_start_upright():
    for whole in (False, True):
        d = directions_over_hemisphere(150, whole=whole)
        assert d.shape == (150, 3) and (d[0] == UP).all()
        np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, atol=1e-15)
        assert (d[:, 2] > 0).all() if not whole else (d[:, 2] < 0).mean() == pytest.approx(0.5, abs=0.02)
        # a disc of the area each stands for has this radius; an even set leaves holes of less than twice that
        own = math.sqrt((4.0 if whole else 2.0) / 150)
        assert own < resolution_of(d) < 2.0 * own
        np.testing.assert_array_equal(d, directions_over_hemisphere(150, whole=whole))


def test_no_direction_is_farther_than_the_resolution():
    rng = np.random.default_rng(3)
    probe = rng.normal(size=(40_000, 3))
    probe /= np.linalg.norm(probe, axis=1)[:, None]
    for count, whole in ((60, True), (150, False), (12, False)):
        d = directions_over_hemisphere(count, whole=whole)
        probes = probe if whole else probe * np.sign(probe[:, 2:])
        farthest = math.acos(float((probes @ d.T).max(axis=1).min()))
        assert resolution_of(d) - 0.03 < farthest <= resolution_of(d) + 1e-9
    assert resolution_of([UP]) == pytest.approx(math.pi / 2)


def test_ball_alone_on_a_plane_comes_from_everywhere_above():
    tree = TriangleTree(plate())
    assert approach(tree, ball(3.0), CLEAR, [[0, 0, 0]], [UP], directions_over_hemisphere(300), LIFT).all()
    below = leaning([math.pi / 2 + 0.03, 2.5, math.pi])
    assert not approach(tree, ball(3.0), CLEAR, [[0, 0, 0]], [UP], below, LIFT).any()


@pytest.mark.parametrize(("neck", "shank", "stickout", "holder"), [
    (8.0, 6.0, 80.0, 0.0), (20.0, 3.0, 30.0, 24.0), (12.0, 6.0, 25.0, 30.0), (30.0, 4.0, 31.0, 50.0)])
def test_ball_on_a_plane_leans_until_shank_or_holder_touches(neck, shank, stickout, holder):
    """The rim of a disc of radius B that begins A above the ball's centre: A cos t - B sin t = -(R + lift)."""
    R = 1.5
    segments = (HolderFrustum(holder, holder, 20.0),) if holder else ()
    body = ball(2 * R, neck=neck, shank=shank, stickout=stickout, holder=segments)
    discs = [(neck, shank / 2 + 0.2)] if shank > 2 * R else []
    discs += [(stickout, holder / 2 + 1.0)] if holder else []
    limit = min(math.acos(-(R + LIFT) / math.hypot(h - R, b)) - math.atan2(b, h - R) for h, b in discs)
    assert limit < math.radians(85)
    tree = TriangleTree(plate())
    for azimuth in (0.0, 0.4, 2.0):
        way = leaning([0.0, 0.5 * limit, limit - HAIR, limit + HAIR, 0.5 * (limit + math.pi / 2)], azimuth)
        got = approach(tree, body, CLEAR, [[0, 0, 0]], [UP], way, LIFT)[0]
        assert got.tolist() == [True, True, True, False, False]
    got = approach(tree, body, CLEAR, [[0, 0, 0]], [UP], FINE, LIFT)
    cone = zone_cone(got, np.ones(1), FINE)
    assert abs(cone.half_angle - limit) <= cone.resolution < math.radians(2.0)
    assert math.acos(min(cone.axis[2], 1.0)) < cone.resolution and cone.share == 1.0


@pytest.mark.parametrize(("gap", "depth"), [(4.0, 10.0), (8.0, 10.0), (3.2, 25.0)])
def test_floor_between_two_walls(gap, depth):
    """The axis clears the far wall's edge, (g/2, h - R) from the ball's centre, by R: g/2 cos a - (h - R) sin a = R."""
    R = 1.0
    tree = TriangleTree(slot(gap, depth))
    across, up = gap / 2, depth - R - LIFT
    limit = math.acos(R / math.hypot(across, up)) - math.atan2(up, across)
    point = [[0.0, 0.0, -depth]]
    way = np.vstack([leaning([limit - HAIR, limit + HAIR]), leaning([limit - HAIR, limit + HAIR], math.pi)])
    assert approach(tree, ball(2 * R), CLEAR, point, [UP], way, LIFT)[0].tolist() == [True, False, True, False]
    cone = zone_cone(approach(tree, ball(2 * R), CLEAR, point, [UP], FINE, LIFT), np.ones(1), FINE)
    assert abs(cone.half_angle - limit) <= cone.resolution
    assert abs(cone.axis[0]) < math.sin(2 * cone.resolution)


@pytest.mark.parametrize(("gap", "depth"), [(4.0, 6.0), (6.0, 12.0)])
def test_wall_between_two_walls(gap, depth):
    """From upright, where its own wall stops it, to the far edge: (g - R) cos a - h sin a = R from the centre."""
    R = 1.0
    tree = TriangleTree(slot(gap, depth + 10.0))
    across = gap - R - LIFT
    limit = math.acos(R / math.hypot(across, depth)) - math.atan2(depth, across)
    point, normal = [[-gap / 2, 0.0, -depth]], [[1.0, 0.0, 0.0]]
    got = approach(tree, ball(2 * R), CLEAR, point, normal, leaning([-HAIR, 0.0, limit - HAIR, limit + HAIR]), LIFT)
    assert got[0].tolist() == [False, True, True, False]
    cone = zone_cone(approach(tree, ball(2 * R), CLEAR, point, normal, FINE, LIFT), np.ones(1), FINE)
    assert abs(cone.half_angle - limit / 2) <= cone.resolution
    assert abs(math.asin(cone.axis[0]) - limit / 2) < 2 * cone.resolution


def test_top_of_a_dome_has_a_cone_near_the_half_space():
    mesh = dome(radius=15.0, size=12.0, n=40)
    tree = TriangleTree(mesh)
    d = directions_over_hemisphere(600)
    cone = zone_cone(approach(tree, ball(3.0), CLEAR, [[0.02, 0.01, 0.0]], [UP], d, 0.01), np.ones(1), d)
    assert cone.half_angle > math.pi / 2 - 2 * cone.resolution


@pytest.mark.parametrize("body", [
    ball(2.0, neck=2.5, shank=3.4, stickout=5.0, holder=(HolderFrustum(8, 14, 5), HolderFrustum(14, 14, 20))),
    tool(2.0, 0.0, neck=3.0, shank=4.0), tool(2.4, 0.4)], ids=["ball", "flat", "bull"])
def test_upright_it_is_what_reach_says_without_play(body):
    mesh = low_walls()
    s = sample_surface(mesh, 4.0, seed=2)
    for allowance in (0.0, 0.1):
        field = field_of(mesh, body, allowance, CLEAR)
        by_cutter, by_tool, _ = touchable(field, s.points, s.normals, LIFT, play=0.0)
        got = approach(field.tree, body, CLEAR, s.points, s.normals, [UP], LIFT, allowance)[:, 0]
        # on level places reach also tries a flat bottom towards free nodes near by
        level = s.normals[:, 2] > 1.0 - 1e-6
        assert not (by_tool & ~got & ~level).any() and not (got & ~by_cutter).any()
        assert (by_tool & ~got).sum() <= (0.02 * level.sum() if body.corner_radius < body.radius else 0)
        # shank and holder are looked up there with half a cell to spare, here they are exact
        assert (got & ~by_tool).mean() < (0.15 if body.shank_diameter > body.diameter else 1e-9)


@pytest.mark.parametrize("body", [tool(2.0, 0.0), tool(3.0, 0.0, neck=3.0, shank=4.0), tool(2.4, 0.4), ball(2.0)],
                         ids=["flat", "flat with a shank", "bull", "ball"])
@pytest.mark.parametrize("mesh", [low_walls(), terraces([0, 3, 9, 12], [0, 3, 9, 12], [[5] * 3, [5, 2, 5], [5] * 3])],
                         ids=["walls", "pocket"])
def test_the_tips_of_reach_count_along_the_first_direction(mesh, body):
    """What reach aims a flat bottom at is not lost, so the axis an area was cut from reaches all of it."""
    s = sample_surface(mesh, 8.0, seed=2)
    for allowance in (0.0, 0.1):
        field = field_of(mesh, body, allowance, CLEAR)
        by_cutter, by_tool, tips = touchable(field, s.points, s.normals, LIFT)
        mine = s.subset(by_tool)
        got = approach(field.tree, body, CLEAR, mine.points, mine.normals, directions_over_hemisphere(40), LIFT,
                       allowance, tips[by_tool])
        assert len(mine) > 50 and got[:, 0].all()
        # a tip that is not free counts for nothing
        rest = s.subset(~by_cutter)
        low = np.column_stack([rest.points[:, :2], np.full(len(rest), -1.0)])
        plain, wrong = (approach(field.tree, body, CLEAR, rest.points, rest.normals, [UP], LIFT, allowance, t)
                        for t in (None, low))
        np.testing.assert_array_equal(plain, wrong)


def test_a_cone_that_holds_the_first_direction():
    d = directions_over_hemisphere(2000)
    spacing = resolution_of(d)
    # a cone of 0.5 rad whose axis leans by 0.3 holds +Z; one that leans by 0.6 does not
    for lean, half in ((0.3, 0.5), (0.6, 0.5)):
        good = d @ leaning(lean) > math.cos(half)
        good[0] = True
        free, held = (zone_cone(good[None], np.ones(1), d, holds_first=h) for h in (False, True))
        assert abs(free.half_angle - half) <= spacing
        assert math.acos(min(float(held.axis @ UP), 1.0)) <= held.half_angle + 1e-9
        assert held.half_angle <= free.half_angle + 1e-9
        assert (held.half_angle > half - 2 * spacing) == (lean < half)
    good[0] = False
    assert zone_cone(good[None], np.ones(1), d, holds_first=True) is None
    # nothing but the first: it is the cone
    lone = zone_cone((np.arange(len(d)) == 0)[None], np.ones(1), d, holds_first=True)
    assert lone.half_angle == 0.0 and (lone.axis == UP).all() and lone.share == 1.0


def test_a_level_place_under_a_flat_end_is_tried_off_the_axis():
    """0.3 mm beside a wall a flat end of 4 mm stands with its axis 2 mm away, whichever way the part lies."""
    mesh = terraces([0, 10, 20], [-10, 10], [[2.0, 8.0]])
    tree = TriangleTree(mesh)
    for x, able in ((9.7, True), (9.995, False)):
        got = approach(tree, tool(4.0, 0.0), CLEAR, [[x, 0.0, 2.0]], [UP], [UP], 0.002)
        assert bool(got[0, 0]) is able


def test_cone_of_a_band_of_directions():
    d = directions_over_hemisphere(4000)
    band = np.abs(d[:, 0]) < math.sin(0.3)
    cone = zone_cone(np.vstack([band, band]), np.array([1.0, 3.0]), d)
    assert abs(cone.half_angle - 0.3) <= cone.resolution and abs(cone.axis[0]) <= math.sin(cone.resolution)


def test_share_counts_area_and_nothing_reached_has_no_cone():
    d = directions_over_hemisphere(400)
    wide, narrow = d[:, 2] > math.cos(1.0), d[:, 2] > math.cos(0.4)
    reachable = np.vstack([wide, narrow])
    assert abs(zone_cone(reachable, np.array([99.0, 1.0]), d).half_angle - 1.0) <= resolution_of(d)
    both = zone_cone(reachable, np.array([90.0, 10.0]), d)
    assert abs(both.half_angle - 0.4) <= resolution_of(d) and both.share == 1.0
    assert zone_cone(np.zeros((2, 400), bool), np.ones(2), d) is None


def test_the_only_direction_is_a_narrow_cone():
    d = directions_over_hemisphere(200)
    only = np.zeros((1, 200), bool)
    only[0, 57] = True
    cone = zone_cone(only, np.ones(1), d)
    assert cone.axis @ d[57] > math.cos(cone.resolution)
    assert 0.0 <= cone.half_angle <= cone.resolution and cone.share == 1.0


def test_everything_open():
    d = directions_over_hemisphere(100)
    assert zone_cone(np.ones((1, 100), bool), np.ones(1), d).half_angle == pytest.approx(math.pi / 2)
    sphere = directions_over_hemisphere(100, whole=True)
    assert zone_cone(np.ones((1, 100), bool), np.ones(1), sphere).half_angle == math.pi
