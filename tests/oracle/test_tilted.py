"""The tilted kernel against its obvious twin: turn the mesh, build its tree, ask the upright kernel."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from drop_shapes import CUTTERS, SHAPES, walls

from geometry.bvh import TriangleTree
from geometry.drop import blocked_many
from geometry.errors import GeometryError
from geometry.tilted import axis_frames, blocked_along

SPECIAL = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [1e-9, 0, -1], [1e-7, 1e-7, 1]]
HOLDER = (3.0, 0.0, 5.0)


def axes(n, seed):
    return np.vstack([np.random.default_rng(seed).normal(size=(n, 3)), SPECIAL])


def turned(mesh, frame):
    matrix = np.eye(4)
    matrix[:3, :3] = frame
    return mesh.transformed(matrix)


def test_frames_are_rotations_with_z_along_the_axis():
    way = axes(200, 1)
    frames = axis_frames(way)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.broadcast_to(np.eye(3), frames.shape), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-14)
    np.testing.assert_allclose(frames[:, 2], way / np.linalg.norm(way, axis=1)[:, None], atol=1e-15)
    np.testing.assert_array_equal(axis_frames([[0, 0, 3.0]])[0], np.eye(3))


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_blocked_is_what_the_turned_mesh_says(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    tree, frames = TriangleTree(mesh), axis_frames(axes(12, 3))
    rng = np.random.default_rng(2)
    blocked = 0
    for j, frame in enumerate(frames):
        there = turned(mesh, frame)
        lo, hi = there.bounds
        tips = lo - 1.0 + rng.random((40, 3)) * (hi - lo + 2.0)
        upright = TriangleTree(there)
        expected = blocked_many(upright, tips, radius, corner) | blocked_many(upright, tips + [0, 0, HOLDER[2]],
                                                                               HOLDER[0], HOLDER[1])
        got = blocked_along(tree, frames, np.full(40, j), tips, [(radius, corner, 0.0), HOLDER])
        np.testing.assert_array_equal(got, expected)
        blocked += int(expected.sum())
    assert 0.2 < blocked / (40 * len(frames)) < 0.9


@pytest.mark.parametrize("cutter", CUTTERS)
def test_the_limit_itself_is_found(cutter):
    """A hair above the height that just touches is free, a hair below is not."""
    from geometry.drop import drop_tips

    mesh, (radius, corner) = walls(), CUTTERS[cutter]
    tree, frames = TriangleTree(mesh), axis_frames(axes(10, 4))
    rng = np.random.default_rng(5)
    for j, frame in enumerate(frames):
        there = turned(mesh, frame)
        lo, hi = there.bounds[:, :2]
        xy = lo + rng.random((20, 2)) * (hi - lo)
        z = drop_tips(TriangleTree(there), xy, radius, corner)
        keep = np.isfinite(z)
        tips = np.column_stack([xy, z])[keep]
        which = np.full(len(tips), j)
        assert not blocked_along(tree, frames, which, tips + [0, 0, 1e-7], [(radius, corner, 0.0)]).any()
        assert blocked_along(tree, frames, which, tips - [0, 0, 1e-7], [(radius, corner, 0.0)]).all()


def test_threads_do_not_count_and_nothing_blocks_nothing():
    mesh = walls()
    tree, frames = TriangleTree(mesh), axis_frames(axes(20, 6))
    rng = np.random.default_rng(7)
    which = rng.integers(0, len(frames), 500)
    tips = mesh.bounds[0] + rng.random((500, 3)) * 15.0
    many = blocked_along(tree, frames, which, tips, [(1.0, 1.0, 0.0)])
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        np.testing.assert_array_equal(blocked_along(tree, frames, which, tips, [(1.0, 1.0, 0.0)]), many)
    finally:
        numba.set_num_threads(before)
    assert not blocked_along(tree, frames, which, tips, np.zeros((0, 3))).any()
    assert blocked_along(tree, frames, [], np.zeros((0, 3)), [(1.0, 1.0, 0.0)]).shape == (0,)


@pytest.mark.parametrize(("changes", "subject"), [
    ({"which": [9]}, "which"), ({"which": [0, 0]}, "which"), ({"tips": [[0, 0, np.nan]]}, "tips[0]"),
    ({"bodies": [(1.0, 2.0, 0.0)]}, "bodies"), ({"frames": np.eye(3)}, "frames"),
])
def test_wrong_arrays_are_refused(changes, subject):
    given = {"frames": axis_frames([[0, 0, 1]]), "which": [0], "tips": [[0, 0, 0]], "bodies": [(1.0, 1.0, 0.0)]}
    with pytest.raises(GeometryError) as error:
        blocked_along(TriangleTree(walls()), **{**given, **changes})
    assert error.value.subjects == (subject,)


def test_an_axis_without_length_is_refused():
    with pytest.raises(GeometryError, match="axes\\[1\\] is zero"):
        axis_frames([[0, 0, 1], [0, 0, 0]])
