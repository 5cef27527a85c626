"""What drills, taps, chamfer and thread mills can touch: closed forms on blocks."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import SurfaceSamples
from geometry.tool_body import HolderFrustum, ToolBody
from service.verification.named_touch import AxisLines, NamedTouch, distance, lowest_tips
from tests.hand_parts import box_mesh
from zones.reach.assembly import Clearances

DRILL = ToolBody("T1", 1, 3.0, 0.0, 12.0, 3.0, 12.0, 3.0, 30.0, (), "drill", 0.0, 0.9)
CHAMFER = ToolBody("T2", 2, 6.0, 0.0, 2.5, 6.0, 2.5, 6.0, 30.0, (), "chamfer", 1.0, 2.5)
BLOCK = TriangleTree(box_mesh((-5, -5, -5), (5, 5, 0)))
CLEAR = Clearances(0.0, 0.0, 0.0, 0.0)
UP = np.array([[0.0, 0.0, 1.0]])


def samples(points, normals):
    points, normals = np.array(points, float), np.array(normals, float)
    n = len(points)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return SurfaceSamples(points, normals, np.ones(n), np.ones(n, np.int32), np.zeros(n, np.int32))


def test_the_distance_is_that_of_the_sampled_outline():
    line = np.concatenate([np.column_stack([np.linspace(0, 1.5, 3001), np.linspace(0, 0.9, 3001)]),
                           np.column_stack([np.full(6001, 1.5), np.linspace(0.9, 12.0, 6001)])])
    rho, h = np.random.default_rng(0).uniform([0, -2], [3, 6], (300, 2)).T
    far = np.hypot(rho[:, None] - line[:, 0], h[:, None] - line[:, 1]).min(axis=1)
    inside = (rho <= 1.5) & (h >= rho * 0.6)
    np.testing.assert_allclose(distance(DRILL, rho, h), np.where(inside, 0.0, far), atol=2e-3)


@pytest.mark.parametrize(("x", "grow", "tip"), [
    (0.0, 0.0, 0.0), (0.0, 0.4, 0.4),  # on the point
    (6.0, 0.0, -0.6),                  # beside the block the edge holds the cone 1 mm from the axis
    (7.0, 0.0, -math.inf), (6.6, 0.0, -math.inf), (6.6, 0.2, -0.4)])
def test_the_lowest_tip_over_and_beside_a_block(x, grow, tip):
    got = lowest_tips(BLOCK, np.array([[x, 0.0]]), DRILL, CLEAR, 0.0, grow)[0]
    if grow and x > 5:  # moved down by grow and wider by grow: radius 1.7 at 0.9, so 1.6 is 0.84 over the lower end
        tip = grow - (1.6 - grow) * 0.6
    assert got == pytest.approx(tip, abs=1e-9)


def test_a_holder_holds_a_drill_up():
    short = replace(DRILL, stickout=12.0, holder=(HolderFrustum(40.0, 40.0, 20.0),))
    assert lowest_tips(BLOCK, np.array([[7.0, 0.0]]), short, CLEAR, 0.0, 0.0)[0] == pytest.approx(-12.0)


def test_a_drill_touches_on_its_own_axes_only():
    lines = {1: AxisLines(np.array([[7.0, 0.0, 3.0]]), UP)}
    touch = NamedTouch(BLOCK, CLEAR, lines)
    beside = samples([[5, 0, -1], [5, 4, -1], [-5, 0, -1], [0, 0, 0]], [[1, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]])
    assert touch.reaches(beside, DRILL, UP, 0.51, 0.0).tolist() == [True, False, False, False]
    assert not touch.reaches(beside, DRILL, UP, 0.49, 0.0).any()
    assert not touch.reaches(beside, replace(DRILL, number=9), UP, 0.51, 0.0).any()
    assert not touch.reaches(beside, DRILL, np.array([[1.0, 0.0, 0.0]]), 0.51, 0.0).any()


@pytest.mark.parametrize(("body", "slope", "touched"), [
    (CHAMFER, 45.0, True), (CHAMFER, 44.6, True), (CHAMFER, 43.0, False), (CHAMFER, 0.0, False), (CHAMFER, 90.0, False),
    (replace(CHAMFER, named="thread_mill", cone_height=0.0), 0.0, True),
    (replace(CHAMFER, named="thread_mill", cone_height=0.0), 45.0, False)])
def test_cones_and_sides_touch_faces_as_steep_as_they_are(body, slope, touched):
    # a place on the upper edge, with any normal; the tool stands outside of the block
    turn = math.radians(slope)
    edge = samples([[5, 0, 0]], [[math.cos(turn), 0, math.sin(turn)]])
    assert NamedTouch(BLOCK, CLEAR, {}).reaches(edge, body, UP, 0.01, 0.0).tolist() == [touched]


def test_a_chamfer_mill_stays_out_where_its_tip_has_no_room():
    # the same place over a ledge: 0.5 mm under the edge nothing of the cone fits but its upper end
    ledge = TriangleTree(box_mesh((4.9, -5, -5), (20, 5, -2.2)))
    edge = samples([[5, 0, 0]], [[1, 0, 1]])
    assert NamedTouch(ledge, CLEAR, {}).reaches(edge, CHAMFER, UP, 0.01, 0.0).all()
    shelf = TriangleTree(box_mesh((4.9, -5, -5), (20, 5, -0.04)))
    assert not NamedTouch(shelf, CLEAR, {}).reaches(edge, CHAMFER, UP, 0.005, 0.0).any()
