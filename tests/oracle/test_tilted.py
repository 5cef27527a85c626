"""The tilted kernel against its obvious twin: turn the mesh, build its tree, ask the upright kernel."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import blocked_many
from geometry.mesh_queries.tilted_collision import axis_frames, blocked_along
from tests.oracle.drop_shapes import CUTTERS, SHAPES, walls

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
    from geometry.mesh_queries.drop import drop_tips

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


def strips():
    """A plate of needles a thousand times as long as wide, and one beside it that leans, cut the other way."""
    x = np.linspace(0.0, 8.0, 401)
    at = np.concatenate([np.column_stack([x, 0.0 * x, z + 0.0 * x]) for z in (0.0, 10.0, 20.0)])
    cells = (np.arange(400)[None, :] + 401 * np.arange(2)[:, None]).ravel()
    faces = np.concatenate([np.column_stack([cells, cells + 1, cells + 402]),
                            np.column_stack([cells, cells + 402, cells + 401])])
    lean = axis_frames([[0.5, 0.3, 1.0]])[0]
    return TriangleMesh(np.vstack([at, at[:, [2, 0, 1]] @ lean + [12.0, 3.0, -4.0]]),
                        np.vstack([faces, faces + len(at)]))


def questions(mesh, seed):
    """Frames and tips in the order passes ask them: fans of axes round one place, walks with axes that turn slowly, and
    places on the lattice of the mesh's own corners, where tool and facet meet exactly."""
    rng = np.random.default_rng(seed)
    lo, hi = mesh.bounds
    tips, ways = [], []
    for _ in range(12):
        middle, place = rng.normal(size=3), lo - 1.0 + rng.random(3) * (hi - lo + 2.0)
        ways.append(middle / np.linalg.norm(middle) + 0.4 * rng.normal(size=(60, 3)))
        tips.append(np.broadcast_to(place, (60, 3)))
        share = np.linspace(0.0, 1.0, 60)[:, None]
        ways.append(middle / np.linalg.norm(middle) + 0.8 * share * rng.normal(size=3))
        tips.append(place + share * rng.normal(size=3) * 4.0)
    corners = mesh.vertices[rng.integers(0, len(mesh.vertices), 240)]
    ways.append(np.array(SPECIAL, float)[rng.integers(0, 4, 240)])
    tips.append(corners + rng.integers(-2, 3, (240, 3)))
    frames = axis_frames(np.vstack(ways))
    return frames, np.einsum("kij,kj->ki", frames, np.vstack(tips))


@pytest.mark.parametrize("shape", [*SHAPES, pytest.param("strips", marks=pytest.mark.slow)])
def test_what_is_left_out_and_what_blocked_last_change_no_answer(shape):
    """Against a tree of a single leaf, every triangle of which is asked, each question alone; with any threads."""
    mesh = strips() if shape == "strips" else SHAPES[shape]()
    tree, plain = TriangleTree(mesh), TriangleTree(mesh, leaf_size=len(mesh.faces))
    for seed, bodies in enumerate(([(1.0, 1.0, 0.0), (2.0, 0.0, 6.0), (3.0, 0.0, 8.0)], [(2.0, 0.5, 0.0)],
                                   [(1.0, 0.0, 0.0), (4.0, 0.0, 2.0), (1.5, 0.0, 1.0)], [(0.0, 0.0, 0.0)])):
        frames, tips = questions(mesh, seed)
        n = len(tips)
        got = blocked_along(tree, frames, np.arange(n), tips, bodies)
        alone = [bool(blocked_along(plain, frames[j:j + 1], [0], tips[j:j + 1], bodies)[0]) for j in range(n)]
        np.testing.assert_array_equal(got, alone)
        mixed = np.random.default_rng(seed).permutation(n)
        np.testing.assert_array_equal(blocked_along(tree, frames, mixed, tips[mixed], bodies), got[mixed])
        before = numba.get_num_threads()
        try:
            for threads in {1, before}:
                numba.set_num_threads(threads)
                np.testing.assert_array_equal(blocked_along(tree, frames, np.arange(n), tips, bodies), got)
        finally:
            numba.set_num_threads(before)
    assert got.mean() < 0.9


@pytest.mark.parametrize("shape", [*SHAPES, "strips"])
def test_leaning_boxes_hold_their_triangles(shape):
    mesh = strips() if shape == "strips" else SHAPES[shape]()
    tree = TriangleTree(mesh)
    t, hulls = tree.arrays, tree.hulls
    ways = hulls[:, 3:12].reshape(-1, 3, 3)
    np.testing.assert_allclose(ways @ ways.transpose(0, 2, 1), np.broadcast_to(np.eye(3), ways.shape), atol=1e-11)
    for leaf in np.flatnonzero(t.child < 0).tolist():
        corners, node = t.corners[t.first[leaf]:t.first[leaf] + t.size[leaf]].reshape(-1, 3), leaf
        while node >= 0:
            off = corners - hulls[node, :3]
            assert (np.abs(off @ ways[node].T) <= hulls[node, 12:15] + 1e-9).all()
            assert (np.linalg.norm(off, axis=1) <= hulls[node, 15] + 1e-9).all()
            node = int(t.parent[node])


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
