"""Tools that stand below overhangs with thin necks, against closed forms of a groove."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import prism
from verify.model import ProofSetup
from verify.work.standing_room import Surroundings, fixture_sides, stands_free

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
