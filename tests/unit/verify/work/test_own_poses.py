"""Poses of a program's own tools, moved on to places that they left; against closed forms."""

import math

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from tests.hand_parts import ball, tool
from verify.moves import Moves
from verify.tool_axes import ToolAxes
from verify.work.own_poses import poses_at, slid_poses

SIDEWAYS = np.array([[0.0, -1.0, 0.0]])
SLOT = ToolBody("T1", 1, 8.0, 0.0, 1.0, 3.0, 20.0, 8.0, 30.0)


def moves(*tips, axes=None):
    at = np.array(tips, float)
    n = len(at) - 1
    return Moves(at[:-1], at[1:], np.ones(n, np.bool_), np.zeros(n, np.int32), axes)


def turned(angle):
    """Axes that stand still, ``angle`` degrees from Z towards -Y."""
    a = math.radians(angle)
    one = np.array([[0.0, -math.sin(a), math.cos(a)]])
    return ToolAxes(one, np.array([[1.0, 0.0, 0.0]]), np.zeros(1))


def at(points, ways, left, way_of, tools, allowance=0.0):
    n = len(points)
    ways = np.array(ways, float)
    return poses_at(np.array(points, float), ways, ways, np.array(left, float), np.zeros(n, np.int32), way_of, tools,
                    allowance)


@pytest.mark.parametrize("allowance", [0.0, 0.3])
def test_the_side_of_a_slot_cutter_goes_on_to_the_wall(allowance):
    """Its side ran 1 mm in front of the wall y = 0, so its axis comes to y = -4 less the allowance."""
    got = at([[5.0, 0.0, 3.4]], [[0.0, -1.0, 0.0]], [1.0], moves((-8, -5, 3), (24, -5, 3)), [SLOT], allowance)
    assert got.row.tolist() == [0] and got.tool.tolist() == [0]
    assert got.tips[0] == pytest.approx([5.0, -4.0 - allowance, 3.0], abs=0.01)
    assert got.shift[0] == pytest.approx([0.0, 1.0 - allowance, 0.0])


def test_the_upper_end_of_the_flutes_goes_on_to_a_ceiling():
    got = at([[5.0, -3.0, 4.2]], [[0.0, 0.0, -1.0]], [0.2], moves((-8, -5, 3), (24, -5, 3)), [SLOT])
    assert got.shift[0] == pytest.approx([0.0, 0.0, 0.2]) and got.tips[0, 2] == pytest.approx(3.2)


def test_a_ball_goes_on_along_a_leaning_way():
    way = np.array([0.0, 0.6, 0.8])
    place = np.array([2.0, 0.0, 5.0])
    centre = place + (0.25 + 2.0) * way
    got = at([place], [way], [0.25], moves(centre - [2, 0, 2.0], centre - [-2, 0, 2.0]), [ball(4.0)])
    assert got.tips[0] + [0, 0, 2.0] == pytest.approx(place + 2.0 * way, abs=0.02)


def test_what_no_pose_is_made_of():
    way = moves((-8, -5, 3), (24, -5, 3))
    assert not len(at([[5.0, 0.0, 3.4]], [[0.0, -1.0, 0.0]], [math.inf], way, [SLOT]))
    assert not len(at([[5.0, 8.0, 3.4]], [[0.0, -1.0, 0.0]], [9.0], way, [SLOT])), "wider than the tool"
    assert not len(at([[5.0, 0.0, 3.4]], [[0.0, -1.0, 0.0]], [0.5], way, [SLOT])), "another move left it"
    nobody = np.array([-1], np.int32)
    assert not len(poses_at(np.zeros((1, 3)), SIDEWAYS, SIDEWAYS, np.ones(1), nobody, way, [SLOT], 0.0))


def test_a_side_that_leans_too_little_turns_about_what_it_touches():
    """The wall leans 20 degrees, the axis 19: the second pose leans as the wall, the third stands higher on it."""
    lean, mill = math.radians(20.0), tool(4.0, 0.0)
    normal = np.array([0.0, -math.cos(lean), -math.sin(lean)])
    a = math.radians(19.0)
    axis, out = np.array([0.0, -math.sin(a), math.cos(a)]), np.array([0.0, math.cos(a), math.sin(a)])
    touch = np.array([5.0, 6.0, 3.0])
    tip = touch - 2.0 * out - 3.0 * axis
    along = moves(tip - [20, 0, 0], tip + [20, 0, 0], axes=turned(19.0))
    got = at([touch - 0.05 * normal], [normal], [0.05], along, [mill])
    assert got.row.tolist() == [0, 0, 0]
    for k in (1, 2):
        assert np.degrees(math.acos(got.axes[k] @ axis)) == pytest.approx(1.0, abs=1e-3)
        assert got.axes[k] @ normal == pytest.approx(0.0, abs=1e-6)
        side = (touch - 0.05 * normal - got.tips[k]) @ -normal  # from the axis to the place
        assert side == pytest.approx(2.0, abs=0.001)
    assert (got.tips[2] - got.tips[1]) @ got.axes[1] > 0.0
    assert len(at([touch - 0.05 * normal], [normal], [0.05], moves(tip - [20, 0, 0], tip + [20, 0, 0]), [mill])) <= 1


def test_a_tool_slides_to_another_place_of_a_wall_and_keeps_its_height_there():
    """A slot cutter 1 mm high touched the wall y = 0 at x = 0, z = 3.4: at x = 7, z = 3.9 it touches as it stands."""
    touched = at([[0.0, 0.0, 3.4]], [[0.0, -1.0, 0.0]], [0.0], moves((-8, -4, 3), (24, -4, 3)), [SLOT])
    got = slid_poses(np.array([[7.0, 0.0, 3.9]]), np.array([[0.0, -1.0, 0.0]]), touched, np.array([[0.0, 0.0, 3.4]]),
                     np.array([[0.0, -1.0, 0.0]]), [SLOT])
    assert got.tips[0] == pytest.approx([7.0, -4.0, 3.0], abs=0.02)
    assert got.shift[0] == pytest.approx([7.0, 0.0, 0.0], abs=1e-9)
    beyond = slid_poses(np.array([[7.0, 0.0, 4.5]]), np.array([[0.0, -1.0, 0.0]]), touched, np.array([[0.0, 0.0, 3.4]]),
                        np.array([[0.0, -1.0, 0.0]]), [SLOT])
    assert beyond.tips[0] == pytest.approx([7.0, -4.0, 4.1], abs=0.02), "higher than the flutes: it rises"


def test_a_tool_goes_round_its_axis_as_the_normal_does():
    """In a round groove of 10 mm, a quarter round from where it touched."""
    touched = at([[10.0, 0.0, 3.4]], [[-1.0, 0.0, 0.0]], [0.0], moves((6, -1, 3), (6, 1, 3)), [SLOT])
    got = slid_poses(np.array([[0.0, 10.0, 3.4]]), np.array([[0.0, -1.0, 0.0]]), touched, np.array([[10.0, 0.0, 3.4]]),
                     np.array([[-1.0, 0.0, 0.0]]), [SLOT])
    assert got.tips[0] == pytest.approx([0.0, 6.0, 3.0], abs=0.02)
