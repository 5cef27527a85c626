"""True depths of gouges, also under samples of the exact surface that stand over their facets."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from tests.hand_parts import box_mesh, dome, slope_field, tool
from verify.moves import Moves
from verify.surface.guard_points import (
    DEEP_A_MOVE,
    DEEP_APART,
    closer_points,
    closer_seeds,
    first_points,
    gouge_depths,
    guard_samples,
    path_points,
    wide_samples,
    worth_a_look,
)

RADIUS = 15.0
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def _on_sphere(off: float):
    """Places ``off`` mm over the middle of the cells of the dome's facets, with the sphere's normals."""
    g = np.linspace(-4.9, 4.9, 50)
    x, y = (a.ravel() for a in np.meshgrid(g, g))
    n = np.column_stack([x, y, np.sqrt(RADIUS**2 - x**2 - y**2)]) / RADIUS
    return n * (RADIUS + off) - [0.0, 0.0, RADIUS], n


def about_z(angle):
    return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("off", [0.0, -0.0006])
def test_a_gouge_under_the_exact_surface_is_as_deep_as_it_is(off):
    points, normals = _on_sphere(off)
    depth = gouge_depths(TriangleTree(dome(RADIUS)), points, normals, np.full(len(points), 0.01))
    np.testing.assert_allclose(depth, 0.01, atol=1e-3)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ray_from_rim_to_rim_over_a_hollow_is_out_of_the_part(side):
    """Both rims are as high and what it meets opposite may be the wall there, as if it had been inside all the way."""
    nodes = np.linspace(-6.0, 6.0, 25)
    tree = TriangleTree(slope_field(lambda x, y: y * y / 12.0 + x * x / 40.0, n=24))
    x = np.random.default_rng(1).uniform(-4.0, 4.0, 500)
    points = np.column_stack([x, np.full(500, 6.0 * side), 3.0 + np.interp(x, nodes, nodes**2 / 40.0)])
    normals = np.tile([0.0, side, 0.0], (500, 1))
    assert gouge_depths(tree, points, normals, np.full(500, 20.0)).max() < 1e-3
    depth = gouge_depths(tree, points - [0.0, 0.0, 4.0], normals, np.full(500, 0.5))
    np.testing.assert_allclose(depth, 0.5, atol=5e-3)


def test_a_gouge_along_the_bisector_of_an_edge_is_as_deep_as_under_both_faces():
    """Both faces are as near all the way: rounding decided where their chords cross, at times beyond the cut."""
    box, rng = box_mesh([-10, -10, 0], [10, 10, 6]), np.random.default_rng(5)
    for angle in rng.uniform(0.0, 6.3, 100):
        turn = about_z(angle)
        tree = TriangleTree(TriangleMesh(box.vertices @ turn.T, box.faces))
        for side in (np.linalg.matrix_power(QUARTER, k) for k in range(4)):
            places = np.column_stack([np.full(100, 10.0), rng.uniform(-9.0, 9.0, 100), np.full(100, 6.0)])
            normals = np.tile(np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0) @ side.T @ turn.T, (100, 1))
            along = rng.uniform(0.01, 1.0, 100)
            np.testing.assert_allclose(gouge_depths(tree, places @ side.T @ turn.T, normals, along),
                                       along / np.sqrt(2.0), rtol=5e-3, atol=1e-4)


@pytest.mark.parametrize("lost", ["a facet of the top", "the top", "nothing"])
def test_a_hole_in_the_mesh_hides_no_gouge(lost):
    """Meshes with a few edges open are read with a warning; what is cut under the hole is as deep as elsewhere."""
    box = box_mesh([0, 0, 0], [20, 20, 10])
    top = np.flatnonzero(box.normals[:, 2] > 0.9)
    gone = {"a facet of the top": top[:1], "the top": top, "nothing": top[:0]}[lost]
    tree = TriangleTree(TriangleMesh(box.vertices, np.delete(box.faces, gone, axis=0)))
    points = np.array([[20.0, 5.0, 5.0], [20.0, 10.0, 5.0], [20.0, 15.0, 5.0]])
    depth = gouge_depths(tree, points, np.tile([1.0, 0.0, 0.0], (3, 1)), np.ones(3))
    np.testing.assert_allclose(depth, 1.0, atol=0.01)


def test_places_round_the_lowest_samples_are_looked_at_closely():
    """Every place of the surface near a seed has one within 0.015 mm; where no seed is there is none."""
    tree = TriangleTree(dome(RADIUS))
    points, _ = _on_sphere(0.0)
    seeds = points[:700]
    places, normals, row = closer_points(tree, seeds)
    assert np.abs(np.einsum("ij,ij->i", places - tree.mesh.triangles[row].mean(axis=1), normals)).max() < 1e-9
    rng = np.random.default_rng(2)
    _, _, there = nearest(tree, seeds + rng.uniform(-0.06, 0.06, seeds.shape))
    assert cKDTree(places).query(there)[0].max() < 0.015
    assert cKDTree(places).query(points[-100:])[0].min() > 0.3
    assert [len(part) for part in closer_points(tree, points[:0])] == [0, 0, 0]


def test_no_number_of_places_uses_up_the_closer_looks():
    """Samples within the tolerance are looked at all, however many there are; of gouges the deepest of each move."""
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.uniform(0, 30, (30_000, 3)) * [1, 1, 0], rng.uniform(50, 80, (40, 3)) * [1, 1, 0]])
    residual = np.concatenate([rng.uniform(-0.31, -0.3, 30_000), rng.uniform(-0.03, -0.011, 40)])
    mover = np.concatenate([rng.integers(20, size=30_000), np.full(40, 99)]).astype(np.int32)
    doubtful, deep = closer_seeds(points, residual, mover, 0.05)
    assert len(doubtful) == 40 and cKDTree(doubtful).query(points[30_000:])[0].max() == 0.0
    assert 20 < len(deep) <= 20 * DEEP_A_MOVE
    lowest = [points[mover == m][residual[mover == m].argmin()] for m in range(20)]
    assert cKDTree(deep).query(np.array(lowest))[0].max() < DEEP_APART * 3**0.5
    doubtful, deep = closer_seeds(points, residual / 30.0, mover, 0.05)
    cells = np.unique(np.floor(points / 0.15).astype(np.int64), axis=0)
    assert len(doubtful) == len(cells) and not len(deep)


def test_a_first_look_tells_where_a_closer_one_is_needed():
    tree = TriangleTree(dome(RADIUS))
    seeds = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, -0.17]])
    places, _, row = first_points(tree, seeds)
    assert len(places) == len(row) == 18 and cKDTree(places[:9]).query(seeds[:1])[0].max() < 1.1e-3
    assert np.linalg.norm(places[9:] - seeds[1], axis=1).max() < 0.15
    even, odd = np.full(9, -0.008), np.array([*[-0.004] * 8, -0.008])
    assert worth_a_look(np.concatenate([even, odd, even - 0.003]), 0.01).tolist() == [False, True, True]


@pytest.mark.parametrize("diameter", [0.04, 0.12, 1.0])
def test_the_path_of_a_fine_tool_is_looked_at_wherever_it_is(diameter):
    """A pit and a groove in the dome: the surface over the middle of both is looked at."""
    tree, body = TriangleTree(dome(RADIUS)), tool(diameter, 0.0, neck=30.0)
    start = np.array([[1.234, 2.345, 1.0], [-3.0, 1.0, -0.4]])
    end = np.array([[1.234, 2.345, -0.5], [-1.0, 1.0, -0.3]])
    moves = Moves(start, end, np.ones(2, np.bool_), np.zeros(2, np.int32))
    places = np.concatenate([p for p, _ in path_points(tree, moves, [body], 0.01)])
    mouth = nearest(tree, np.array([[1.234, 2.345, -0.236]]))[2]
    assert cKDTree(places).query(mouth)[0].max() < 0.25 * diameter
    assert np.abs(nearest(tree, places)[0]).max() < 1e-9
    assert not list(path_points(tree, moves, [tool(6.0, 3.0)], 0.01))
    assert not list(path_points(tree, moves.only(np.zeros(2, np.bool_)), [body], 0.01))


def test_the_depth_of_a_stretch_is_the_largest_distance_on_it():
    """Against readings every thousandth of a stretch, of rays that cross the dome every way."""
    mesh = dome(RADIUS)
    tree, rng = TriangleTree(mesh), np.random.default_rng(5)
    row = rng.integers(len(mesh.faces), size=300)
    points, normals = mesh.triangles[row].mean(axis=1), rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals *= np.sign(np.einsum("ij,ij->i", normals, mesh.normals[row]))[:, None]
    along = rng.choice([0.01, 0.3, 4.0, 60.0], 300)
    through, _ = first_hits(tree, points, -normals, t_min=1e-4)
    stretch = np.minimum(along, through)
    there = points[:, None] - stretch[:, None, None] * np.linspace(0, 1, 1001)[:, None] * normals[:, None]
    want = nearest(tree, there.reshape(-1, 3))[0].reshape(300, -1).max(axis=1)
    got = gouge_depths(tree, points, normals, along)
    assert want.max() > 1.0 and (got <= want + stretch / 2000 + 1e-9).all()
    assert (got >= want - np.maximum(1e-4, 0.005 * want) - 1e-9).all()


@pytest.mark.parametrize("lean", [0.0, 0.3, 0.7854, 1.2])
def test_a_dimple_anywhere_is_deep_enough_at_some_sample(lean):
    """A ball of 1 mm pressed 0.03 mm into a leaning face at 2,000 places: a sample there sees 0.4 of 0.01 mm."""
    turn = np.array([[np.cos(lean), 0, np.sin(lean)], [0, 1, 0], [-np.sin(lean), 0, np.cos(lean)]])
    flat = np.array([[-10, -10, 0], [10, -10, 0], [10, 10, 0], [-10, 10, 0]], float) @ turn.T
    mesh = TriangleMesh(flat, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))
    samples = guard_samples(mesh).points
    rng = np.random.default_rng(1)
    tips = np.column_stack([rng.uniform(-9, 9, (2000, 2)), np.full(2000, -0.03)]) @ turn.T
    reach = np.sqrt(0.5**2 - 0.47**2)
    far, _ = cKDTree(samples).query(tips + 0.03 * turn[:, 2])
    assert far.max() < reach
    # how much of the ball is under the face where the nearest sample is
    depth = np.sqrt(0.5**2 - far**2) - 0.47
    assert depth.min() > 0.004


def test_it_is_said_where_samples_lie_wider_apart_than_usual():
    flat = np.array([[0, 0, 0], [300, 0, 0], [300, 200, 0], [0, 200, 0]], float)
    mesh = TriangleMesh(flat, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))
    (told,) = wide_samples(mesh)
    assert told.what == "between_samples" and told.value == pytest.approx(0.245, abs=0.001)
    assert len(guard_samples(mesh)) == pytest.approx(1e6, rel=0.01)
    assert wide_samples(dome(RADIUS)) == []
