"""What mills touch on the ways of their own program: slots as wide as the mill."""

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from service.verification.own_ways import MillWays, touched_on_ways
from tests.hand_parts import prism, terraces, tool
from zones.reach.assembly import Clearances

CLEAR = Clearances(0.0, 0.0, 0.0, 0.0)
UP = np.array([0.0, 0.0, 1.0])
SLOT = TriangleTree(terraces([0, 6, 10, 16], [0, 12], [[6.0, 3.0, 6.0]], 0.0))  # 4 wide, floor at 3, along Y


def ways(*tips):
    at = np.array(tips, float)
    return MillWays(at[:-1], at[1:], np.tile(UP, (len(at) - 1, 1)))


HIGH = ways((8.0, -3.0, 4.5), (8.0, 15.0, 4.5))
PLACES = np.array([[7.0, 6.0, 3.0], [8.0, 1.0, 3.0], [9.9, 6.3, 3.0], [6.0, 5.0, 3.5], [3.0, 6.0, 6.0]])


@pytest.mark.parametrize("diameter, touched", [(4.0, True), (3.96, True), (4.008, True), (4.1, False)])
def test_a_mill_comes_down_a_slot_of_its_own_width(diameter, touched):
    got = touched_on_ways(SLOT, PLACES, tool(diameter, 0.0), HIGH, UP, CLEAR, 0.01, 0.0)
    assert got[:2].tolist() == [touched] * 2
    assert got[3] == (touched and diameter > 3.97)  # the wall, within the lift
    assert not got[4]  # the top beside the slot: the mill never goes there


def test_only_ways_of_the_mill_count():
    beside = ways((8.2, -3.0, 4.5), (8.2, 15.0, 4.5))
    assert not touched_on_ways(SLOT, PLACES, tool(4.0, 0.0), beside, UP, CLEAR, 0.01, 0.0).any()
    part_of_it = ways((8.0, -3.0, 4.5), (8.0, 2.0, 4.5))
    assert touched_on_ways(SLOT, PLACES, tool(4.0, 0.0), part_of_it, UP, CLEAR, 0.01, 0.0).tolist() == [
        False, True, False, False, False]
    leaning = MillWays(HIGH.start, HIGH.end, np.array([[0.6, 0.0, 0.8]]))
    assert not touched_on_ways(SLOT, PLACES, tool(4.0, 0.0), leaning, UP, CLEAR, 0.01, 0.0).any()


def test_a_ball_comes_down_a_groove_of_its_own_radius_and_an_allowance_stays():
    n = 24
    arc = [(2.0 * math.cos(a), 6.0 + 2.0 * math.sin(a)) for a in np.linspace(math.pi, 2.0 * math.pi, n + 1)]
    outline = [(-6.0, 6.0), (-6.0, 0.0), (6.0, 0.0), (6.0, 6.0), *arc[::-1]]
    fan = [(0, 1, len(outline) - 1)] + [(1, k, k - 1)[::-1] for k in range(len(outline) - 1, 4 + n // 2, -1)]
    fan += [(1, 2, 4 + n // 2)] + [(2, k, k - 1)[::-1] for k in range(4 + n // 2, 4, -1)] + [(2, 3, 4)]
    groove = TriangleTree(prism(outline, fan, 12.0).mesh)
    low = np.array([[0.0, 6.0, 4.0], [1.4, 5.0, 6.0 - math.sqrt(4.0 - 1.4**2)]])
    upper = ways((0.0, 1.0, 4.5), (0.0, 11.0, 4.5))
    assert touched_on_ways(groove, low, tool(4.0, 2.0), upper, UP, CLEAR, 0.02, 0.0).all()
    assert touched_on_ways(groove, low, tool(4.0, 2.0), upper, UP, CLEAR, 0.02, 0.1).all()
    assert not touched_on_ways(groove, low, tool(4.6, 2.3), upper, UP, CLEAR, 0.02, 0.0).any()
