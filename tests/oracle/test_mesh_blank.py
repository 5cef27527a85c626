"""Blanks that are meshes: heights, covers, distances and ways out, against a union of boxes asked point by point."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.errors import VerificationError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import box_mesh, terraces
from toolpath.stock.stock_map import StockMap
from verify.blank.blank import stands_over_air, stock_bounds, stock_on_normals
from verify.blank.mesh_blank_exit import way_out_of_mesh
from verify.material.stock_field import stock_field
from verify.material.stock_lines import blank
from verify.model import ProofSetup
from zones.reach.access_view import access_rotation

XS, YS, HEIGHTS = [0.0, 3.0, 5.0, 9.0], [0.0, 2.0, 6.0], [[2.0, 6.0, 3.0], [4.0, 1.0, 5.0]]
SHELL = terraces(XS, YS, HEIGHTS, base=-1.0)
BOXES = np.array([[[XS[i], YS[j], -1.0], [XS[i + 1], YS[j + 1], HEIGHTS[j][i]]] for i in range(3) for j in range(2)])
PART = box_mesh([4.0, 3.0, -0.5], [4.5, 3.5, 0.5])
DIRECTIONS = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0),
              *np.random.default_rng(5).normal(size=(4, 3)).tolist()]


def turned(mesh: TriangleMesh, rotation: np.ndarray) -> TriangleMesh:
    return mesh.transformed(np.block([[rotation, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]))


def away(points: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Distances of points (n, 3) from the union of the boxes, 0 inside: the least of those from each."""
    own = points @ rotation
    off = [np.linalg.norm(np.maximum(np.maximum(lo - own, own - hi), 0.0), axis=1) for lo, hi in BOXES]
    return np.min(off, axis=0)


def highest(x: float, y: float, rotation: np.ndarray, beyond: float, bounds: np.ndarray) -> tuple[float, float]:
    """Highest place of a comb on a vertical line that is in the grown boxes, -inf where none is, and its spacing."""
    z = np.linspace(bounds[0, 2] - beyond - 0.1, bounds[1, 2] + beyond + 0.1, 3001)
    there = away(np.column_stack([np.full_like(z, x), np.full_like(z, y), z]), rotation) <= beyond
    return (z[there].max() if there.any() else -np.inf), z[1] - z[0]


def proof_of(mesh: TriangleMesh, beyond: float) -> ProofSetup:
    return ProofSetup(stock_kind="step", stock_mesh=mesh, uncertainty=beyond)


@pytest.mark.parametrize("beyond", [0.0, 0.413])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_lines_of_the_proof_end_where_the_grown_mesh_does(direction, beyond):
    rotation = access_rotation(direction)
    mesh, part = turned(SHELL, rotation), turned(PART, rotation)
    field = blank(part, 0.2513, proof_of(mesh, beyond))
    rng, seen = np.random.default_rng(1), 0
    nx, ny = field.height.shape
    # the first lines stand on the very border of the blank's box: which side of it they are on is rounding
    for i, j in zip(rng.integers(1, nx, 120), rng.integers(1, ny, 120), strict=True):
        x, y = field.origin + (np.array([i, j]) + 0.5) * field.step
        true, comb = highest(x, y, rotation, beyond, mesh.bounds)
        top = field.height[i, j]
        if true > -np.inf:
            assert -1e-6 <= top - true <= comb + 1e-6
            seen += 1
        elif top > -1e29:  # thinner than the comb
            assert away(np.array([[x, y, top]]), rotation)[0] <= beyond + 1e-6
    assert seen > 40


@pytest.mark.parametrize("beyond", [0.0, 0.413])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_planners_map_is_as_high_at_its_nodes_and_covers_its_cells(direction, beyond):
    rotation = access_rotation(direction)
    mesh, part = turned(SHELL, rotation), turned(PART, rotation)
    stock = StockMap.around(TriangleTree(mesh), mesh.bounds, beyond, 0.3, TriangleTree(part))
    lat, rng, seen, slack = stock.lattice, np.random.default_rng(2), 0, 2.1e-3 if beyond == 0.0 else 1e-6
    for i, j in zip(rng.integers(0, lat.ny, 120), rng.integers(0, lat.nx, 120), strict=True):
        x, y = lat.x0 + lat.step * j, lat.y0 + lat.step * i
        true, comb = highest(x, y, rotation, beyond, mesh.bounds)
        if true > -np.inf:
            assert stock.top[i, j] >= true - 1e-6
            if beyond > 0.0:  # without, what is 0.001 mm beside the line counts as well: at an edge that is much
                assert stock.top[i, j] - true <= comb + slack
            seen += 1
        for dx, dy in rng.uniform(-0.5, 0.5, (5, 2)) * lat.step:
            assert stock.cover[i, j] >= highest(x + dx, y + dy, rotation, beyond, mesh.bounds)[0] - 1e-6
    assert seen > 40 and (stock.part <= stock.cover + 1e-9).all()


@pytest.mark.parametrize("beyond", [0.0, 0.3])
def test_the_grid_of_the_proof_has_the_sign_and_the_distance_of_the_grown_mesh(beyond):
    rotation = access_rotation((0.3, -0.5, 0.8))
    mesh = turned(SHELL, rotation)
    field = stock_field(turned(PART, rotation), proof_of(mesh, beyond), 0.25)
    points = np.argwhere(np.ones(field.values.shape, bool)) * field.step + field.origin
    off, values = away(points, rotation), field.values.ravel()
    outside = off > 1e-6
    assert (values[outside & (off > beyond + 1e-5)] < 0.0).all() and (values[off < beyond - 1e-5] > 0.0).all()
    assert np.abs(values - np.clip(beyond - off, -field.step, field.step))[outside].max() < 1e-5
    assert (values[~outside] > -1e-6).all() and outside.sum() > 1000 < (~outside).sum()


@pytest.mark.parametrize("beyond", [0.0, 0.002, 0.5])
def test_ways_out_are_those_of_a_walk_in_small_steps(beyond):
    rotation = access_rotation((0.2, 0.4, 0.7))
    tree, rng = TriangleTree(turned(SHELL, rotation)), np.random.default_rng(4)
    points = rng.uniform([-0.4, -0.4, -1.4], [9.4, 6.4, 6.4], (300, 3)) @ rotation.T
    ways = rng.normal(size=(300, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    reach, step = 2.0, 5e-4
    far = way_out_of_mesh(tree, points, ways, beyond, reach)
    walked = np.full(300, reach)
    for t in np.arange(0.0, reach, step)[::-1]:
        walked[away(points + t * ways, rotation) > beyond + 1e-7] = t
    assert (far <= walked + 1e-5).all()
    # a walk steps over what is thinner than a step; nothing else may be missed
    late = walked - far > step + 1e-5
    there = away(points + (far[:, None] + 3e-6) * ways, rotation)
    assert (there[late] > beyond - 1e-5).all() and late.sum() <= 3
    assert (far == reach).sum() > 50 and (far == 0.0).sum() > 10


def test_places_on_the_blank_itself_are_out_by_what_it_may_be_larger():
    tree = TriangleTree(SHELL)
    at, up = np.array([[1.0, 1.0, 2.0], [1.0, 1.0, 1.0], [4.0, 4.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (3, 1))
    assert way_out_of_mesh(tree, at, up, 0.25, 9.0) == pytest.approx([0.25, 1.25, 1.25], abs=1e-5)
    aside = np.tile([1.0, 0.0, 0.0], (1, 1))  # along a wall of the higher box, which it leaves at the end
    assert way_out_of_mesh(tree, np.array([[3.5, 0.0, 5.0]]), aside, 0.25, 9.0) == pytest.approx([1.75], abs=1e-4)


def test_a_mesh_blank_has_bounds_stands_over_air_and_must_be_there():
    setup = proof_of(SHELL, 0.5)
    assert stock_bounds(PART.bounds, setup).tolist() == [[-0.5, -0.5, -1.5], [9.5, 6.5, 6.5]]
    assert stands_over_air(setup)
    out = stock_on_normals(np.array([[4.2, 1.0, 0.5]]), np.array([[0.0, 0.0, 1.0]]), PART.bounds, setup, 9.0)
    assert out == pytest.approx([6.0], abs=1e-5)
    with pytest.raises(VerificationError) as caught:
        stock_bounds(PART.bounds, ProofSetup(stock_kind="step"))
    assert caught.value.code == "no_stock_mesh"
