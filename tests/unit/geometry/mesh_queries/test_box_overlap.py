"""A box against a closed mesh: found however thin, wherever it stands, and only where they meet."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.box_overlap import is_inside, point_of_mesh_in_box


def block(lower, upper):
    """A block of twelve triangles, normals outwards."""
    lo, hi = np.array(lower, float), np.array(upper, float)
    corners = np.array([[(lo, hi)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    return TriangleMesh(corners, faces, np.ones(12, np.int32))


BLOCK = block([0, 0, 0], [30, 20, 10])


@pytest.mark.parametrize(("lower", "upper"), [
    ([10, 8, -5], [12, 9, 50]),  # through the middle of two large triangles, no vertex and no edge of theirs
    ([10, 8, 9.9], [10.001, 8.001, 9.95]),  # a hair below the top, wholly inside
    ([29.9, 19.9, 9.9], [40, 40, 40]),  # a corner
    ([-1, -1, -1], [31, 21, 11]),  # round the whole part
    ([-5, 5, 5], [0.001, 5.001, 5.001]),  # a needle through one face
])
def test_a_box_in_the_part_is_found_with_a_point_of_both(lower, upper):
    lower, upper = np.array(lower, float), np.array(upper, float)
    point = point_of_mesh_in_box(BLOCK, lower, upper)
    assert (point >= lower - 1e-9).all() and (point <= upper + 1e-9).all()
    assert (point >= -1e-9).all() and (point <= np.array([30, 20, 10]) + 1e-9).all()


@pytest.mark.parametrize(("lower", "upper"), [
    ([0, 0, 10.001], [30, 20, 12]), ([-5, -5, 0], [-0.001, 25, 10]), ([40, 40, 40], [41, 41, 41]),
    ([30.001, 0, 0], [31, 20, 10])])
def test_a_box_beside_the_part_is_not(lower, upper):
    assert point_of_mesh_in_box(BLOCK, np.array(lower, float), np.array(upper, float)) is None


def test_a_box_over_a_slope_needs_more_than_bounding_boxes():
    """A tilted triangle's bounding box covers the box, the triangle does not."""
    turn = np.array([[np.cos(0.6), 0, np.sin(0.6), 0], [0, 1, 0, 0], [-np.sin(0.6), 0, np.cos(0.6), 0], [0, 0, 0, 1]])
    tilted = BLOCK.transformed(turn)
    top = tilted.bounds[1]
    assert point_of_mesh_in_box(tilted, top - [0.5, 15, 0.5], top - [0.1, 5, 0.1]) is None
    centre = (turn[:3, :3] @ [15, 10, 5])
    assert point_of_mesh_in_box(tilted, centre - 0.1, centre + 0.1) == pytest.approx(centre)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[st.floats(-40, 40)] * 3), st.tuples(*[st.floats(0.01, 20)] * 3))
def test_a_block_and_a_box_meet_as_intervals_do(lower, size):
    lower = np.array(lower)
    upper = lower + np.array(size)
    gap = np.max([lower - BLOCK.bounds[1], BLOCK.bounds[0] - upper])
    if abs(gap) > 1e-6:
        assert (point_of_mesh_in_box(BLOCK, lower, upper) is not None) == (gap < 0)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[st.floats(-10, 40)] * 3))
def test_inside_is_inside(point):
    point = np.array(point)
    depth = min((point - BLOCK.bounds[0]).min(), (BLOCK.bounds[1] - point).min())
    if abs(depth) > 1e-6:
        assert is_inside(BLOCK, point) == (depth > 0)
