"""What must hold for the lowest tip over any mesh."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import FEW, blocked_many, drop_contacts, drop_grid, drop_tips
from geometry.mesh_queries.rays import first_hits

seeds = st.integers(0, 10_000)
radii = st.tuples(st.floats(0.05, 5.0), st.floats(0.0, 1.0)).map(lambda t: (t[0], t[0] * t[1]))


def _soup(seed, n=40):
    rng = np.random.default_rng(seed)
    points = rng.random((n, 1, 3)) * [20, 20, 8] + rng.normal(size=(n, 3, 3)) * rng.choice([0.2, 2.0], (n, 1, 1))
    mesh = TriangleMesh(points.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))
    return mesh, rng.random((60, 2)) * 24 - 2


@settings(max_examples=40, deadline=None)
@given(seeds, radii, st.tuples(*[st.floats(-500, 500)] * 3), st.floats(0, 6.3))
def test_moves_with_the_part(seed, cutter, shift, angle):
    mesh, xy = _soup(seed)
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0, shift[0]], [s, c, 0, shift[1]], [0, 0, 1, shift[2]], [0, 0, 0, 1]])
    here = drop_tips(TriangleTree(mesh), xy, *cutter)
    there = drop_tips(TriangleTree(mesh.transformed(matrix)), xy @ matrix[:2, :2].T + matrix[:2, 3], *cutter)
    # 1e-13 mm of rounding in plan may cost its square root on a contact at the rim: hence 1e-6.
    np.testing.assert_allclose(there - shift[2], here, rtol=0, atol=1e-6)
    held = np.isfinite(here)
    assert not held.any() or np.median(np.abs(there[held] - shift[2] - here[held])) < 1e-11


@settings(max_examples=40, deadline=None)
@given(seeds, radii)
def test_order_and_turn_of_the_triangles_do_not_count(seed, cutter):
    mesh, xy = _soup(seed)
    rng = np.random.default_rng(seed)
    faces = rng.permutation(mesh.faces)
    faces = np.stack([rng.permutation(f) for f in faces])
    here = drop_tips(TriangleTree(mesh), xy, *cutter)
    np.testing.assert_allclose(drop_tips(TriangleTree(TriangleMesh(mesh.vertices, faces)), xy, *cutter), here,
                               rtol=0, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0.05, 5.0), st.floats(0.0, 1.0), st.floats(0.05, 1.0))
def test_a_tool_inside_another_drops_at_least_as_deep(seed, radius, corner_part, shrink):
    mesh, xy = _soup(seed)
    tree = TriangleTree(mesh)
    flat = drop_tips(tree, xy, radius, 0.0)
    bull = drop_tips(tree, xy, radius, radius * corner_part)
    ball = drop_tips(tree, xy, radius, radius)
    thin = drop_tips(tree, xy, radius * shrink, radius * shrink * corner_part)
    thin_flat = drop_tips(tree, xy, radius * shrink, 0.0)
    assert (ball <= bull + 1e-9).all() and (bull <= flat + 1e-9).all() and (thin_flat <= flat + 1e-9).all()
    # A thinner cutter of the same shape scaled about its tip lies inside the thicker one.
    assert (thin <= bull + 1e-9).all()


@settings(max_examples=25, deadline=None)
@given(seeds, radii)
def test_more_material_never_lowers_the_tip(seed, cutter):
    mesh, xy = _soup(seed)
    half = TriangleMesh(mesh.vertices, mesh.faces[::2])
    assert (drop_tips(TriangleTree(half), xy, *cutter) <= drop_tips(TriangleTree(mesh), xy, *cutter) + 1e-9).all()


@pytest.mark.parametrize("cutter", [(1.6, 1.6), (1.5, 0.0), (2.0, 0.5)])
def test_one_and_two_threads_give_the_same_bytes(cutter):
    mesh, _ = _soup(7, 400)
    tree = TriangleTree(mesh)
    rng = np.random.default_rng(8)
    tips = rng.random((FEW + 1000, 3)) * [20, 20, 10]
    ways = rng.normal(size=(FEW + 1000, 3))

    def everything():
        t, hit = first_hits(tree, tips, ways)
        return [a.tobytes() for a in (drop_tips(tree, tips[:, :2], *cutter), blocked_many(tree, tips, *cutter),
                                      drop_grid(tree, 0.0, 0.0, 0.25, 80, 80, *cutter), t, hit,
                                      drop_contacts(tree, tips[:, :2], *cutter).point)]

    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = everything()
        numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
        assert everything() == one
    finally:
        numba.set_num_threads(before)
