"""Rays and the hierarchy itself against slow twins."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_grid, drop_tips
from geometry.mesh_queries.rays import first_hits
from tests.oracle.drop_shapes import SHAPES, box, smooth
from tests.oracle.naive_drop import first_hit


@pytest.mark.parametrize("shape", ["smooth", "walls", "soup"])
def test_first_hit_is_the_naive_one(shape):
    mesh = SHAPES[shape]()
    rng = np.random.default_rng(1)
    origins = rng.random((50, 3)) * [20, 20, 12]
    ways = rng.normal(size=(50, 3))
    t, triangle = first_hits(TriangleTree(mesh), origins, ways, 0.05, 12.0)
    for i in range(50):
        expected, number = first_hit(mesh, origins[i], ways[i], 0.05, 12.0)
        assert t[i] == pytest.approx(expected, abs=1e-9) and (triangle[i] < 0) == (number < 0)
    assert (triangle >= 0).any() and (triangle < 0).any()


def test_rays_along_the_axes_meet_walls_and_slip_through_no_seam():
    tree = TriangleTree(box((0, 0, 0), (4, 3, 2)))
    g = np.linspace(0.0, 3.0, 61)
    origins = np.stack([np.full(61, 2.0), g, np.linspace(0.0, 2.0, 61)], 1)
    for way, distance in (((1, 0, 0), 2.0), ((-1, 0, 0), 2.0), ((0.5, 0, 0), 4.0)):
        t, triangle = first_hits(tree, origins, np.array(way, float), 1e-9)
        np.testing.assert_allclose(t[1:-1], distance, atol=1e-12)
        assert (triangle[1:-1] >= 0).all()


def test_every_ray_from_inside_a_closed_mesh_meets_it_even_at_its_vertices():
    mesh = box((0, 0, 0), (1, 1, 1))
    tree = TriangleTree(mesh)
    rng = np.random.default_rng(2)
    inside = np.array([0.3, 0.4, 0.6])
    w = rng.random((2000, 1))
    edge = rng.integers(0, 12, 2000), rng.integers(0, 3, 2000)
    corners = mesh.triangles
    targets = (1 - w) * corners[edge] + w * corners[edge[0], (edge[1] + 1) % 3]
    targets = np.concatenate([mesh.vertices, targets])
    t, triangle = first_hits(tree, np.broadcast_to(inside, targets.shape), targets - inside)
    np.testing.assert_allclose(t, 1.0, atol=1e-9)
    assert (triangle >= 0).all()


def test_offset_passes_over_the_start():
    tree = TriangleTree(box((0, 0, 0), (1, 1, 1)))
    start = np.array([[0.0, 0.5, 0.4]])
    assert first_hits(tree, start, [[1.0, 0, 0]])[0][0] == pytest.approx(0.0, abs=1e-12)
    assert first_hits(tree, start, [[1.0, 0, 0]], 1e-6)[0][0] == pytest.approx(1.0, abs=1e-12)
    assert first_hits(tree, start, [[1.0, 0, 0]], 1e-6, 0.9)[1][0] == -1


def test_heights_are_those_of_rays_from_above():
    tree = TriangleTree(smooth())
    xy = np.random.default_rng(3).random((500, 2)) * 22 - 1
    t, triangle = first_hits(tree, np.column_stack([xy, np.full(500, 50.0)]), np.array([0, 0, -1.0]))
    z = drop_tips(tree, xy, 0.0, 0.0)
    np.testing.assert_array_equal(np.isinf(z), triangle < 0)
    np.testing.assert_allclose(z[triangle >= 0], 50.0 - t[triangle >= 0], atol=1e-12)
    grid = drop_grid(tree, 0.0, 0.0, 2.0, 11, 11, 0.0, 0.0)  # nodes of the mesh's own lattice and its borders
    assert np.isfinite(grid).all()


def test_wrong_rays_are_named():
    tree = TriangleTree(smooth())
    with pytest.raises(GeometryError, match=r"directions\[1\]"):
        first_hits(tree, np.zeros((2, 3)), [[1.0, 0, 0], [0, 0, 0]])
    with pytest.raises(GeometryError, match="directions"):
        first_hits(tree, np.zeros((2, 3)), np.ones((3, 3)))
    with pytest.raises(GeometryError, match="origins"):
        first_hits(tree, np.zeros((2, 2)), np.ones((2, 3)))


@pytest.mark.parametrize("shape", [*SHAPES, "piled"])
def test_hierarchy_holds_every_triangle_once_and_covers_it(shape):
    if shape == "piled":  # all centres equal: no plane can part them
        mesh = TriangleMesh(np.tile([[0.0, 0, 0], [1, 0, 0], [0, 1, 1]], (50, 1)), np.arange(150).reshape(50, 3))
    else:
        mesh = SHAPES[shape]()
    a = TriangleTree(mesh).arrays
    assert sorted(a.order) == list(range(len(mesh.faces)))
    np.testing.assert_array_equal(a.corners, mesh.triangles[a.order])
    leaves = a.child < 0
    assert a.size[leaves].sum() == len(mesh.faces) and (a.size[leaves] > 0).all() and (a.size[~leaves] == 0).all()
    for node in np.flatnonzero(leaves):
        points = a.corners[a.first[node]:a.first[node] + a.size[node]].reshape(-1, 3)
        while node >= 0:
            assert (points >= a.lower[node]).all() and (points <= a.upper[node]).all()
            x_lo, x_hi, y_lo, y_hi, top, sx, sy, c, sine, slant = a.column[node]
            assert [sine * slant, slant] == pytest.approx([np.hypot(sx, sy), np.sqrt(1 + sx * sx + sy * sy)], rel=1e-9)
            assert [x_lo, y_lo] == list(a.lower[node, :2]) and [x_hi, y_hi, top] == list(a.upper[node])
            assert (points[:, 2] <= points[:, 0] * sx + points[:, 1] * sy + c + 1e-9).all()
            parent = a.parent[node]
            assert parent < 0 or node in (a.child[parent], a.child[parent] + 1)
            node = parent
