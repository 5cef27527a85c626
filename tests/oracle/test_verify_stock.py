"""Stock lines, bodies and distances against slow obvious twins."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from geometry.kernels.nearest import triangle2
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from tests.pocket_case import TOOL, block
from verify.blank.blank import stock_on_normals
from verify.kernels.heights import lowest
from verify.material.stock_lines import blank, run_stock
from verify.material.stock_pass import descents, end_radii
from verify.model import ProofSetup, StockKind
from verify.moves import Moves
from verify.surface.guard_points import convex_edges, gouge_depths


def profile(rho, radius, corner, grow):
    """Height of a cutting profile over the tip, inf outside."""
    over = np.maximum(rho - (radius - corner + grow), 0.0)
    return np.where(rho <= radius + grow, corner - np.sqrt(np.maximum(corner**2 - over**2, 0)), np.inf)


@pytest.mark.parametrize("radius, corner, grow", [(1.5, 1.5, 0), (2, 0, 0), (2, 0.5, 0), (1.5, 1.5, 1.0), (2, 0, 0.7)])
def test_lowest_is_the_least_of_many_standing_tools(radius, corner, grow):
    rng = np.random.default_rng(2)
    s = np.linspace(0, 1, 40_001)
    met = 0
    for case in range(60):
        d = rng.normal(size=3) * np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1]][case % 3])
        a, (x, y) = rng.normal(size=3), rng.uniform(-2, 2, 2)
        got, touch = lowest(x, y, *a, *d, CutterSizes(radius, corner, 9.0), grow)
        rho = np.hypot(x - a[0] - s * d[0], y - a[1] - s * d[1])
        want = (a[2] + s * d[2] + profile(rho, radius, corner, grow)).min()
        if np.isinf(want):
            continue
        met += 1
        assert got <= want + 1e-9 and got >= want - 1e-3
        assert touch == pytest.approx(s[rho <= radius + grow].min(), abs=1e-4)
    assert met > 20


def test_offset_blank_is_the_union_of_spheres():
    """Twin: spheres on a fine cloud of surface points; it lies below the truth by less than its spacing allows."""
    part = block()
    setup = ProofSetup(margin=1.0, uncertainty=0.2, line_spacing=0.7)
    field = blank(part.mesh, setup.line_spacing, setup)
    f = np.linspace(0, 1, 241)
    u, v = (g.ravel() for g in np.meshgrid(f, f))
    keep = u + v <= 1
    u, v = u[keep][:, None], v[keep][:, None]
    cloud = np.concatenate([t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]) for t in part.mesh.triangles[2:]])
    rng = np.random.default_rng(0)
    for i, j in rng.integers((0, 0), field.height.shape, (60, 2)):
        x, y = field.origin + (np.array([i, j]) + 0.5) * field.step
        d2 = (cloud[:, 0] - x) ** 2 + (cloud[:, 1] - y) ** 2
        near = d2 <= 1.1999**2
        if not near.any():
            assert field.height[i, j] < -1e20 or field.height[i, j] < part.mesh.bounds[1, 2]
            continue
        want = (cloud[near, 2] + np.sqrt(1.44 - d2[near])).max()
        assert want - 1e-9 <= field.height[i, j] <= want + 0.2
        if np.hypot(*(np.abs([x, y]) - [10, 6])) > 2 and d2.min() < 0.3:
            assert field.height[i, j] <= want + 0.02


def test_stock_lines_are_lowered_exactly_and_only_as_far_as_the_flutes_reach():
    part = block()
    setup = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, line_spacing=0.25)
    slot = np.array([[[-30.0, 1, -3], [30, 1, -3]]])
    for flutes, expected in ((8.0, -3.0), (2.0, 0.0)):
        tool = replace(TOOL, flute_length=flutes)
        field = blank(part.mesh, setup.line_spacing, setup)
        run = run_stock(field, Moves(slot[:, 0], slot[:, 1], np.ones(1, bool), np.zeros(1, np.int32)), [tool], setup)
        y = field.origin[1] + (np.arange(field.height.shape[1]) + 0.5) * field.step
        i = field.height.shape[0] // 2
        under = np.abs(y - 1) <= 2.0
        assert (field.height[i, under] == expected).all() and (field.height[i, ~under & (np.abs(y) < 15)] == 0).all()
        assert run.cut[0] == (expected < 0) and (len(run.events) > 0) == (expected == 0)


def test_stock_on_normals_is_the_way_out_of_the_blank():
    bounds = np.array([[-20.0, -15, -10], [20, 15, 0]])
    p, n = np.array([[0.0, 0, -5], [0, 0, -5], [5, 0, -1]]), np.array([[1.0, 0, 0], [0, 0, 1], [0, 0.6, 0.8]])
    box = ProofSetup(stock_kind=StockKind.BOX, margin=0.5, uncertainty=0.0)
    np.testing.assert_allclose(stock_on_normals(p, n, bounds, box, 99.0), [20.5, 5.5, 1.5 / 0.8])
    np.testing.assert_allclose(stock_on_normals(p, n, bounds, box, 2.0), [2, 2, 1.875])
    bar = ProofSetup(stock_kind=StockKind.CYLINDER, margin=0.5, uncertainty=0.0)
    np.testing.assert_allclose(stock_on_normals(p, n, bounds, bar, 99.0), [25.5, 5.5, 1.5 / 0.8])
    np.testing.assert_array_equal(stock_on_normals(p, n, bounds, ProofSetup(), 1.0), 1.0)


def test_descents_and_end_regions():
    z = np.array([0.0, -1.0, -2.0, -2.0, -2.01, -3.0])
    x = np.array([0.0, 0.0, 1.0, 2.0, 3.0, 3.0])
    p = np.column_stack([x, np.zeros(6), z])
    moves = Moves(p[:-1], p[1:], np.ones(5, bool), np.array([0, 0, 0, 0, 1], np.int32))
    steep, earned = descents(moves, [TOOL, TOOL], ProofSetup(ramp_angle=np.radians(3)))
    assert steep.tolist() == [True, True, False, False, True]
    np.testing.assert_allclose(earned[:4], np.tan(np.radians(3)) * np.array([0, 0, 1, 2]), atol=1e-12)
    assert earned[4] > 1e5  # another tool begins anew
    assert end_radii([TOOL]).tolist() == [2.0]
    wide = ProofSetup(ramp_angle=np.radians(3), ramp_angles={TOOL.number: np.radians(50)})
    assert descents(moves, [TOOL, TOOL], wide)[0].tolist() == [True, False, False, False, True]
    plunges = ProofSetup(ramp_angle=np.radians(3), ramp_angles={TOOL.number: np.radians(90)})
    assert not descents(moves, [TOOL, TOOL], plunges)[0].any()
    hollow = replace(plunges, cores={TOOL.number: 1.0})
    assert descents(moves, [TOOL, TOOL], hollow)[0].any()



def test_nearest_point_of_a_triangle():
    rng = np.random.default_rng(6)
    f = np.linspace(0, 1, 301)
    u, v = (g.ravel() for g in np.meshgrid(f, f))
    keep = u + v <= 1 + 1e-12
    u, v = u[keep][:, None], v[keep][:, None]
    for _ in range(50):
        t, p = rng.normal(size=(3, 3)), 2 * rng.normal(size=3)
        cloud = t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0])
        want = np.linalg.norm(cloud - p, axis=1).min()
        got = np.sqrt(triangle2(*p, t))
        assert want - 0.02 <= got <= want + 1e-12


def test_gouge_depth_is_measured_from_the_nearest_surface():
    """A cut 5 µm under the top swallows the whole ray of a sample 2 µm under the edge: it is 2 µm deep there."""
    mesh: TriangleMesh = block().mesh
    tree = TriangleTree(mesh)
    p, n = np.array([[20.0, 0, -0.002], [0, 0, -5], [20, 0, -5]]), np.array([[1.0, 0, 0], [0, 0, 1], [1, 0, 0]])
    got = gouge_depths(tree, p, n, np.array([3.0, 0.02, 0.5]))
    np.testing.assert_allclose(got, [0.002, 0.02, 0.5], atol=1e-9)
    np.testing.assert_allclose(gouge_depths(tree, p[2:], n[2:], np.array([99.0])), [5.0], atol=0.1)


def test_gouge_depth_of_a_ray_that_is_out_of_the_part_at_once_is_nothing():
    """Beside a razor edge: the air behind it is not part, however far the ray then runs through it."""
    v = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [5, 0, 8], [5, 10, 8]], float)
    f = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [3, 5, 2], [1, 2, 5], [1, 5, 4], [0, 4, 5], [0, 5, 3]])
    tree = TriangleTree(TriangleMesh(v, f))
    p = np.array([[5.0, 5.0, 8.0], [5.0, 5.0, 8.0 - 1e-5]])
    n = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    got = gouge_depths(tree, p, n, np.array([13.0, 4.0]))
    assert got[0] == 0.0
    assert got[1] == pytest.approx(4.0 * 5.0 / np.hypot(5.0, 8.0), rel=0.01)


def test_convex_edges_of_a_block_with_a_pocket():
    points, bisector, face = convex_edges(block().mesh)
    assert len(points) == pytest.approx(10 * (2 * 2 * (40 + 30) + 4 * 10 + 2 * (20 + 12)), abs=30)  # ends counted twice
    top = np.abs(points[:, 2]) < 1e-9
    assert (bisector[top, 2] > 0.7).all() and (face > 0).all()
    rim = top & (np.abs(points[:, 0]) < 10.1) & (np.abs(points[:, 1]) < 6.1)
    assert (np.einsum("ij,ij->i", bisector[rim, :2], points[rim, :2]) < 0).all()
