"""Tools that stand below overhangs with thin necks, against closed forms of a groove."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import prism
from verify.kernels.surface.standing import first_inside, settle
from verify.model import ProofSetup
from verify.work.standing_room import Cloud, Surroundings, fixture_sides, stands_free

# a block 0 <= x <= 10 with a groove 2 deep and 3 <= z <= 4 high in its side x = 10; 12 long in Y
GROOVE = [(0, 0), (10, 0), (10, 3), (8, 3), (8, 4), (10, 4), (10, 6), (0, 6)]
PART = prism(GROOVE, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 7), (4, 5, 6), (4, 6, 7)], 6.0)
SIDES = PART.mesh.triangles
SLOT = ToolBody("T1", 1, 8.0, 0.0, 1.0, 3.0, 20.0, 3.0, 30.0)
SETUP = ProofSetup(stock_kind="box", margin=0.0, uncertainty=0.0, rapid_feed=5000.0, clearance_neck=0.0,
                   clearance_shank=0.0, clearance_holder=0.0)
UP = np.array([[0.0, 0.0, 1.0]])


def free(x, z=3.0, tool=SLOT, shift=(0.0, 0.0, 0.0), setup=SETUP, sides=SIDES, slack=0.005):
    return bool(stands_free(Surroundings(sides), tool, setup, np.array([[x, 0.0, z]]), UP, np.array([shift]), slack)[0])


def test_the_groove_is_closed():
    assert PART.mesh.volume == pytest.approx(12.0 * (60.0 - 2.0))


@pytest.mark.parametrize(("x", "z", "stands"), [(12.0, 3.0, True), (11.998, 3.002, True), (11.98, 3.0, False),
                                               (12.0, 3.02, False), (12.0, 2.98, False), (14.5, 5.0, True)])
def test_a_slot_cutter_stands_in_its_groove(x, z, stands):
    assert free(x, z) is stands


def test_the_neck_must_be_free_too():
    assert free(12.0, tool=replace(SLOT, neck_diameter=3.9, shank_diameter=3.9))
    assert not free(12.0, tool=replace(SLOT, neck_diameter=4.1))
    assert not free(12.0, tool=replace(SLOT, neck_length=2.0, shank_diameter=6.0)), "the shank begins in the overhang"
    assert not free(12.0, tool=replace(SLOT, stickout=20.0, neck_length=2.5, holder=(HolderFrustum(20.0, 20.0, 20.0),),
                                       shank_diameter=4.5))


def test_the_way_there_counts():
    assert free(12.0, shift=(-1.0, 0.0, 0.0))
    assert not free(12.0, shift=(0.0, 0.0, -0.5)), "from above through the roof"


def test_fixtures_and_the_allowance_count():
    clamp = replace(SETUP, fixtures=(np.array([[14.0, -3.0, 5.0], [20.0, 3.0, 9.0]]),))
    with_clamp = np.concatenate([SIDES, fixture_sides(clamp)])
    assert len(fixture_sides(clamp)) == 12 and free(12.0, sides=with_clamp)
    low = replace(SETUP, fixtures=(np.array([[14.0, -3.0, 3.5], [20.0, 3.0, 9.0]]),))
    assert not free(12.0, sides=np.concatenate([SIDES, fixture_sides(low)]))
    allowed = replace(SETUP, stock_allowance=0.1)
    assert not free(12.0, setup=allowed)
    assert free(12.1, z=3.1, tool=replace(SLOT, flute_length=0.8), setup=allowed)


def test_no_pose_is_free_of_nothing():
    none = np.zeros((0, 3))
    assert stands_free(Surroundings(SIDES), SLOT, SETUP, none, none, none, 0.005).shape == (0,)


def test_points_in_groups_are_the_points_and_each_lies_in_its_ball():
    points = np.random.default_rng(3).uniform(-4.0, 4.0, (500, 3))
    cloud = Cloud.of(np.concatenate([points, points]))
    assert np.array_equal(np.unique(cloud.points, axis=0), np.unique(points, axis=0)) and len(cloud.points) == 500
    of = np.repeat(np.arange(len(cloud.balls)), np.diff(cloud.first))
    assert (np.linalg.norm(cloud.points - cloud.balls[of, :3], axis=1) <= cloud.balls[of, 3]).all()
    assert len(Cloud.of(np.zeros((0, 3))).balls) == 0


def test_a_tool_takes_in_a_point_where_one_by_one_says_so():
    """Against each frustum and each point by itself."""
    rng = np.random.default_rng(5)
    cloud = Cloud.of(rng.uniform(-6.0, 6.0, (300, 3)))
    for _ in range(200):
        tip, axis = rng.uniform(-8.0, 8.0, 3), rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        frusta = np.array([[0.0, 1.0, 0.5, 1.0], [1.0, 4.0, 0.4, 0.4], [4.0, 9.0, 1.0, 2.0]]) * rng.uniform(0.3, 1.0)
        d = cloud.points - tip
        high = d @ axis
        rho = np.linalg.norm(d - high[:, None] * axis, axis=1)
        inside = np.zeros(len(d), bool)
        for low, top, one, other in frusta:
            inside |= (high > low) & (high < top) & (rho < one + (other - one) * (high - low) / (top - low))
        found = first_inside(*cloud.groups, frusta, tip, axis, -1)
        assert inside[found] if inside.any() else found == -1


@pytest.mark.parametrize(("far", "settles"), [(0.25, True), (0.12, False)])
def test_a_tool_settles_between_two_walls_where_both_leave_it_room(far, settles):
    """A cylinder of radius 1 between walls that meet at a right angle: its axis may come to (1, 1) and no nearer.

    It must touch a place on the diagonal that is so far from the corner; at (1, 1) it comes within 0.414.
    """
    along = np.arange(0.0, 4.0, 0.02)
    up = np.zeros(len(along)) + 1.0
    walls = np.concatenate([np.column_stack([along, 0.0 * along, up]), np.column_stack([0.0 * along, along, up])])
    place = np.full(3, 0.5 * math.sqrt(2.0) * far)
    place[2] = 1.0
    tip, axis = np.array([0.9, 1.05, 0.0]), np.array([0.0, 0.0, 1.0])
    radius = math.sqrt(2.0) - far + (0.01 if settles else -0.05)
    frusta = np.array([[0.0, 2.0, 1.0, 1.0]])
    assert settle(*Cloud.of(walls).groups, frusta, tip, axis, place, radius, 0.3, 12) is settles
    if settles:
        assert tip[:2].min() > 0.999 and np.linalg.norm(tip[:2] - place[:2]) <= radius
