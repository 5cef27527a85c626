"""The drop kernel against its naive twin, against sampling from below, and against opencamlib."""

import numpy as np
import pytest

from geometry.kernels.drop import bull_of, drop_tip_below
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import blocked_many, drop_along, drop_contacts, drop_grid, drop_tips
from geometry.sampling import sample_surface
from tests.oracle.drop_shapes import CUTTERS, SHAPES, smooth, soup
from tests.oracle.naive_drop import drop, lift_of_points


def _points(mesh, n, seed=0):
    lo, hi = mesh.bounds[:, :2]
    return lo - 1.0 + np.random.default_rng(seed).random((n, 2)) * (hi - lo + 2.0)


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_the_naive_one(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    xy = _points(mesh, 60)
    expected = [drop(mesh, x, y, radius, corner) for x, y in xy]
    np.testing.assert_allclose(drop_tips(TriangleTree(mesh), xy, radius, corner), expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_never_below_what_samples_force(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    xy = _points(mesh, 40, seed=1)
    t = np.linspace(0.0, 1.0, 300)[:, None, None, None]
    edges = (1.0 - t) * mesh.triangles + t * np.roll(mesh.triangles, -1, axis=1)
    cloud = np.concatenate([edges.reshape(-1, 3), sample_surface(mesh, 60.0).points])
    floor = np.array([lift_of_points(cloud, x, y, radius, corner) for x, y in xy])
    tip = drop_tips(TriangleTree(mesh), xy, radius, corner)
    # 1e-8: a sample is rounded off its needle, and at the rim of the cutter the profile is steep.
    assert (tip >= floor - 1e-8).all()
    dense = floor > -np.inf
    assert np.median(tip[dense] - floor[dense]) < 0.05


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_contact_lies_on_its_triangle_and_on_the_cutter(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    xy = _points(mesh, 200, seed=2)
    tree = TriangleTree(mesh)
    got = drop_contacts(tree, xy, radius, corner)
    np.testing.assert_array_equal(got.z, drop_tips(tree, xy, radius, corner))
    hit = got.triangle >= 0
    np.testing.assert_array_equal(hit, np.isfinite(got.z))
    np.testing.assert_array_equal(hit, np.isfinite(got.point).all(axis=1))
    # On the triangle: no farther outside its box than rounding; on the plane where it has one.
    corners = mesh.triangles[got.triangle[hit]]
    assert (got.point[hit] >= corners.min(1) - 1e-9).all() and (got.point[hit] <= corners.max(1) + 1e-9).all()
    off = np.einsum("ij,ij->i", mesh.normals[got.triangle[hit]], got.point[hit] - corners[:, 0])
    assert np.abs(off[mesh.areas[got.triangle[hit]] > 1e-4]).max() < 1e-9
    # On the cutter: a point (rho, h) of the profile; near the rim h is steep, so measure along the arc's radius.
    rho = np.hypot(*(got.point[hit, :2] - xy[hit]).T)
    h = got.point[hit, 2] - got.z[hit]
    t = np.maximum(rho - (radius - corner), 0.0)
    assert np.abs(np.hypot(t, corner - h) - corner).max() < 1e-8 and (rho <= radius + 1e-9).all()


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_blocked_is_drop_above_z(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    tree = TriangleTree(mesh)
    xy = _points(mesh, 400, seed=3)
    tip = drop_tips(tree, xy, radius, corner)
    rest = np.where(np.isfinite(tip), tip, 0.0)
    for shift in (-3.0, -1e-3, -1e-7, 0.0, 1e-7, 1e-3, 3.0):
        at = np.column_stack([xy, rest + shift])
        np.testing.assert_array_equal(blocked_many(tree, at, radius, corner), tip > at[:, 2] + 1e-9)
    start = float(np.median(rest))
    below = [drop_tip_below(tree.arrays, bull_of(radius, corner), x, y, start) for x, y in xy]
    np.testing.assert_allclose(below, np.maximum(tip, start), rtol=0, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_radius_zero_is_the_height_of_the_mesh(shape):
    mesh = SHAPES[shape]()
    xy = _points(mesh, 200, seed=4)
    got = drop_tips(TriangleTree(mesh), xy, 0.0, 0.0)
    n = np.cross(mesh.triangles[:, 1] - mesh.triangles[:, 0], mesh.triangles[:, 2] - mesh.triangles[:, 0])
    for (x, y), z in zip(xy, got, strict=True):
        v = mesh.triangles - [x, y, 0.0]
        w = np.stack([np.cross(v[:, i], v[:, (i + 1) % 3])[:, 2] for i in (1, 2, 0)], 1)
        inside = ((w > 0).all(1) | (w < 0).all(1)) & (np.abs(n[:, 2]) > 1e-6)
        w = w[inside] / w[inside].sum(1, keepdims=True)
        assert z == pytest.approx((w * mesh.triangles[inside, :, 2]).sum(1).max(initial=-np.inf), abs=1e-9)


@pytest.mark.parametrize("cutter", CUTTERS)
def test_no_bound_hides_a_triangle(cutter):
    # One leaf of everything has no bounds to go wrong.
    rough = soup(9, 3000)
    for mesh in (smooth(40), TriangleMesh(rough.vertices * [3.0, 3.0, 1.0], rough.faces)):
        xy = _points(mesh, 300, seed=7)
        plain = drop_tips(TriangleTree(mesh, leaf_size=len(mesh.faces)), xy, *CUTTERS[cutter])
        np.testing.assert_allclose(drop_tips(TriangleTree(mesh), xy, *CUTTERS[cutter]), plain, rtol=0, atol=1e-11)


def test_grid_is_the_points_one_by_one():
    tree = TriangleTree(smooth())
    x, y = np.meshgrid(-0.5 + 0.3 * np.arange(31), 1.0 + 0.3 * np.arange(17))
    grid = drop_grid(tree, -0.5, 1.0, 0.3, 31, 17, 1.0, 0.4)
    np.testing.assert_array_equal(grid.ravel(), drop_tips(tree, np.column_stack([x.ravel(), y.ravel()]), 1.0, 0.4))


@pytest.mark.parametrize("cutter", ["ball", "small_ball", "flat", "bull"])
@pytest.mark.parametrize("shape", ["smooth", "walls", "soup", "slivers"])
def test_tip_is_that_of_opencamlib(shape, cutter):
    ocl = pytest.importorskip("opencamlib", reason="the peer opencamlib is not installed")
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    xy = _points(mesh, 400, seed=6)
    theirs = peer_tips(ocl, mesh, radius, corner, xy)
    ours = drop_tips(TriangleTree(mesh), xy, radius, corner)
    ours[np.isneginf(ours)] = -1000.0
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6)


def peer_tips(ocl, mesh, radius, corner, xy):
    """Tip heights by opencamlib's BatchDropCutter, -1000 where it finds nothing."""
    surface = ocl.STLSurf()
    for t in mesh.triangles.tolist():
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*p) for p in t)))
    if corner == 0.0:
        cutter = ocl.CylCutter(2 * radius, 100.0)
    else:
        cutter = ocl.BallCutter(2 * radius, 100.0) if corner == radius else ocl.BullCutter(2 * radius, corner, 100.0)
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    batch.setCutter(cutter)
    batch.setThreads(1)
    for x, y in xy.tolist():
        batch.appendPoint(ocl.CLPoint(x, y, -1000.0))
    batch.run()
    return np.array([p.z for p in batch.getCLPoints()])


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tips_along_a_way_are_those_of_its_places(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    tree, ends = TriangleTree(mesh), _points(mesh, 12, seed=3)
    for step in (0.02 * radius, 0.1 * radius):
        way = np.vstack([a + np.linspace(0.0, 1.0, 40)[:, None] * 39.0 * step * (b - a) / np.linalg.norm(b - a)
                         for a, b in zip(ends[:-1], ends[1:], strict=True)])
        np.testing.assert_allclose(drop_along(tree, way, radius, corner), drop_tips(tree, way, radius, corner), rtol=0,
                                   atol=1e-10)
