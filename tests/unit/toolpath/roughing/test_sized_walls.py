"""Walls that are finished: where a rim is left out."""

from __future__ import annotations

import numpy as np

from tests.hand_parts import tool
from toolpath.passes.pass_family import FinishTarget
from toolpath.roughing.sized_walls import SizedWalls
from zones.lattice import Lattice

BODY = tool(2.0, 0.0)


def wall(low, high, leaning=0.0):
    """Samples of the plane x = 0 from y = 0 to 10, normals along x, tilted by ``leaning`` towards the access."""
    y, z = np.meshgrid(np.arange(0.1, 10.0, 0.2), np.arange(low + 0.1, high, 0.2))
    points = np.column_stack([np.zeros(y.size), y.ravel(), z.ravel()])
    normal = np.array([np.sqrt(1.0 - leaning**2), 0.0, leaning])
    return FinishTarget(points, np.tile(normal, (len(points), 1)), points, 0.2)


def lattice():
    return Lattice.over(np.array([[-3.0, -3.0], [3.0, 13.0]]), 0.5, 0.1)


def at(mask, x, y):
    j, i = lattice().cells(np.array([[x, y]]))
    return bool(mask[j[0], i[0]])


def test_a_wall_counts_beside_it_where_it_is_finished_all_over():
    target = wall(0.0, 6.0)
    done = target.points[:, 1] < 5.0
    sized = SizedWalls.of(BODY, [(target, done)]).along(lattice(), 1.0, 5.0)
    assert at(sized, 1.0, 2.0)  # a radius off the wall
    assert not at(sized, 1.0, 8.0)  # not finished
    assert not at(sized, 1.0, 4.8)  # the tool comes too near to what is not
    assert not at(sized, 2.5, 2.0) and not at(sized, -1.0, 2.0)


def test_one_place_that_is_left_stands_against_all_that_is_finished():
    target = wall(0.0, 6.0)
    done = np.ones(len(target.points), bool)
    done[np.argmin(np.linalg.norm(target.points - [0.0, 5.0, 3.0], axis=1))] = False
    sized = SizedWalls.of(BODY, [(target, done)]).along(lattice(), 1.0, 5.0)
    assert not at(sized, 1.0, 5.0) and at(sized, 1.0, 2.0) and at(sized, 1.0, 8.0)
    assert at(SizedWalls.of(BODY, [(target, done)]).along(lattice(), 3.5, 5.5), 1.0, 5.0)


def test_a_wall_that_is_not_known_to_its_full_height_does_not_count():
    target = wall(0.0, 3.0)
    sized = SizedWalls.of(BODY, [(target, np.ones(len(target.points), bool))])
    assert at(sized.along(lattice(), 0.0, 3.0), 1.0, 5.0)
    assert not at(sized.along(lattice(), 0.0, 6.0), 1.0, 5.0)


def test_a_leaning_face_is_no_wall():
    target = wall(0.0, 6.0, leaning=0.5)
    sized = SizedWalls.of(BODY, [(target, np.ones(len(target.points), bool))])
    assert not sized.along(lattice(), 1.0, 5.0).any()
    assert not SizedWalls.of(BODY, []).along(lattice(), 1.0, 5.0).any()
