"""NURBS surfaces against closed forms, printed values and their own differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from benchmarks.passes.faceting import facet_deviation, steps_for_chord
from examples.family.thesis import Kind, control_points, surface
from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.setup_frame import SetupFrame
from geometry.surfaces.foot_points import foot_points
from geometry.surfaces.nurbs import NurbsSurface, open_uniform_knots

ROOT_HALF = np.sqrt(0.5)
QUARTER = np.array([[1, 0, 1], [ROOT_HALF, ROOT_HALF, ROOT_HALF], [0, 1, 1]])  # homogeneous, order 3


def cylinder(radius=5.0, height=8.0, side=1):
    """A quarter of a cylinder about z, u round it and v up: its normal points away from the axis at side 1."""
    weights = np.repeat(QUARTER[:, 2:], 2, axis=1)
    flat = radius * QUARTER[:, :2] / QUARTER[:, 2:]
    control = np.stack([np.column_stack([flat, np.full(3, z)]) for z in (0.0, height)], axis=1)
    return NurbsSurface(control, np.array([0, 0, 0, 1, 1, 1]), np.array([0, 0, 1, 1]), (3, 2), weights, side)


def octant(radius=5.0):
    """An eighth of a sphere; the side v = 1 is its pole."""
    ring, rise = QUARTER, QUARTER
    weights = np.outer(ring[:, 2], rise[:, 2])
    flat = np.stack([np.outer(ring[:, 0], rise[:, 0]), np.outer(ring[:, 1], rise[:, 0]),
                     np.outer(ring[:, 2], rise[:, 1])], axis=-1)
    knots = np.array([0, 0, 0, 1, 1, 1])
    return NurbsSurface(radius * flat / weights[..., None], knots, knots, (3, 3), weights)


def random_surface(seed=0, weighted=True, orders=(4, 3)):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(6.0), np.arange(7.0), indexing="ij")
    weights = rng.uniform(0.5, 2.0, x.shape) if weighted else None
    points = np.stack([x, y, rng.normal(size=x.shape)], axis=-1)
    return NurbsSurface.from_control_points(points, orders, weights=weights)


def inner(surface, count=400, seed=1):
    low, high = surface.domain
    return low + np.random.default_rng(seed).uniform(0.05, 0.95, (count, 2)) * (high - low)


def test_open_uniform_knots_are_those_of_equation_3_7():
    assert open_uniform_knots(5, 4).tolist() == [0, 0, 0, 0, 1, 2, 2, 2, 2]
    assert surface(Kind.CONVEX).domain.tolist() == [[0, 0], [2, 2]]


def test_a_surface_meets_its_corner_points_and_lies_between_its_control_points():
    s = surface(Kind.CONCAVE)
    net = control_points(Kind.CONCAVE)
    assert np.allclose(s.points([[0, 0], [0, 2], [2, 0], [2, 2]]), net[[0, 0, -1, -1], [0, -1, 0, -1]], atol=1e-13)
    z = s.points(inner(s))[:, 2]
    assert net[..., 2].min() < z.min() and z.max() < net[..., 2].max()


@pytest.mark.parametrize("weighted", [False, True])
def test_derivatives_are_limits_of_differences(weighted):
    s, h = random_surface(weighted=weighted), 1e-5
    uv = inner(s)
    # steps must not cross a knot, where the second derivative of order 3 jumps
    uv = uv[(np.abs(uv - np.round(uv)) > 0.01).all(axis=1)]
    d = s.derivatives(uv)
    for axis, first, second in ((0, d.u, d.uu), (1, d.v, d.vv)):
        e = np.eye(2)[axis] * h
        before, after = s.derivatives(uv - e), s.derivatives(uv + e)
        assert np.abs((after.point - before.point) / (2 * h) - first).max() < 1e-8
        assert np.abs(((after.u, after.v)[axis] - (before.u, before.v)[axis]) / (2 * h) - second).max() < 1e-7
    mixed = (s.derivatives(uv + [0, h]).u - s.derivatives(uv - [0, h]).u) / (2 * h)
    assert np.abs(mixed - d.uv).max() < 1e-7


def test_a_cylinder_is_exact():
    s = cylinder()
    uv = inner(s)
    p = s.points(uv)
    assert np.abs(np.hypot(p[:, 0], p[:, 1]) - 5.0).max() < 1e-14
    assert np.abs(s.normals(uv) - p * [0.2, 0.2, 0.0]).max() < 1e-14
    assert np.abs(s.curvature(uv) - [0.0, 0.2]).max() < 1e-12
    assert np.abs(cylinder(side=-1).curvature(uv) - [-0.2, 0.0]).max() < 1e-12


def test_a_sphere_is_exact_and_has_no_normal_at_its_pole():
    s = octant()
    uv = inner(s)
    assert np.abs(np.linalg.norm(s.points(uv), axis=1) - 5.0).max() < 2e-15 * 5
    assert np.abs(s.curvature(uv) - 0.2).max() < 1e-7  # the root of a difference of equal squares
    assert np.isnan(s.normals([[0.3, 1.0]])).all()
    first, second = s.forms(uv)
    assert np.allclose(second, -first / 5.0, atol=1e-12)


def test_weights_that_are_equal_change_nothing():
    plain, s = random_surface(weighted=False), random_surface(weighted=False)
    heavy = NurbsSurface(s.control, s.knots_u, s.knots_v, s.orders, np.full(s.control.shape[:2], 3.0))
    uv = inner(s)
    assert np.allclose(plain.points(uv), heavy.points(uv), atol=1e-14)
    assert np.allclose(plain.curvature(uv), heavy.curvature(uv), atol=1e-12)


def test_a_motion_moves_points_and_normals_and_leaves_curvature():
    s, uv = random_surface(), inner(random_surface())
    matrix = SetupFrame((1, 2, 3), (0.3, 1, 0.2), (1, 0, 0)).matrix
    m = s.moved(matrix)
    assert np.allclose(m.points(uv), s.points(uv) @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-13)
    assert np.allclose(m.normals(uv), s.normals(uv) @ matrix[:3, :3].T, atol=1e-13)
    assert np.allclose(m.curvature(uv), s.curvature(uv), atol=1e-11)
    with pytest.raises(GeometryError, match="scales, shears or mirrors"):
        s.moved(np.diag([1.0, 1.0, -1.0, 1.0]))


@pytest.mark.parametrize("side", [1, -1])
def test_facets_face_outward_with_the_normals_of_the_surface(side):
    s = cylinder(side=side)
    mesh = s.discretised(0.1, 1.0)
    assert len(mesh.faces) == 20
    assert np.sign(np.einsum("ij,ij->i", mesh.normals, mesh.triangles.mean(axis=1) * [1, 1, 0])).tolist() == [side] * 20
    assert (np.einsum("fi,fci->fc", mesh.normals, mesh.corner_normals) > 0.99).all()


def test_facets_at_a_pole_are_single_and_steps_divide_evenly():
    mesh = octant().discretised(0.3, 0.5)  # four cells by two, of which four touch the pole
    assert len(mesh.faces) == 2 * 8 - 4 and (mesh.areas > 0).all()
    assert np.isnan(mesh.corner_normals).any() and octant().grid_counts(0.3, 0.5) == (4, 2)


def test_foot_points_inside_on_borders_and_at_corners():
    s = surface(Kind.CONVEX)
    uv = inner(s)
    near = foot_points(s, s.points(uv) + 0.7 * s.normals(uv))
    assert np.abs(near.uv - uv).max() < 1e-8 and np.abs(near.distance - 0.7).max() < 1e-12
    beside = foot_points(s, [[-3.0, 25.0, 20.0], [-3.0, -4.0, 15.0]])
    assert np.allclose(beside.points[1], [0, 0, 15]) and abs(beside.points[0, 0]) < 1e-12
    assert foot_points(s, np.zeros((0, 3))).distance.shape == (0,)


def test_facets_of_a_cylinder_leave_it_by_the_sagitta():
    s = cylinder()
    found = facet_deviation(s, s.discretised(1.0, 1.0))
    assert found.inside == pytest.approx(5.0 * (1 - ROOT_HALF), abs=1e-9) and found.outside < 1e-8
    flipped = cylinder(side=-1)
    assert facet_deviation(flipped, flipped.discretised(1.0, 1.0)).outside == pytest.approx(found.inside)
    shifted = TriangleMesh(s.discretised(0.02, 1.0).vertices * [1.01, 1.01, 1.0], s.discretised(0.02, 1.0).faces)
    assert facet_deviation(s, shifted).outside == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("make", [cylinder, octant, lambda: surface(Kind.CONCAVE), random_surface])
@pytest.mark.parametrize("chord", [0.05, 0.02])
def test_steps_for_a_chord_keep_it_without_waste(make, chord):
    s = make()
    found = facet_deviation(s, s.discretised(*steps_for_chord(s, chord))).largest
    assert 0.4 * chord < found <= chord


BAD = [
    ({"control": np.zeros((4, 4))}, "control", "shape (n, m, 3)"),
    ({"control": np.where(np.arange(75).reshape(5, 5, 3) == 38, np.nan, 1.0)}, "control[2, 2]", "has z = nan"),
    ({"weights": np.ones((5, 4))}, "weights", "(5, 4)"),
    ({"weights": np.where(np.arange(25).reshape(5, 5) == 7, -1.0, 1.0)}, "weights[1, 2]", "row 1, column 2 is -1"),
    ({"knots_u": np.arange(8.0)}, "knots_u", "take 9 knots_u"),
    ({"knots_v": np.array([0, 0, 0, 0, 2, 1, 2, 2, 2.0])}, "knots_v[5]", "less than the knot before it"),
    ({"knots_v": np.array([0, 0, 0, 0, np.inf, 2, 2, 2, 2.0])}, "knots_v[4]", "is inf"),
    ({"knots_u": np.zeros(9)}, "knots_u", "no range"),
    ({"orders": (4, 6)}, "orders.v", "there are 5"),
    ({"orders": (2, 4), "knots_u": np.array([0, 0, 1, 1, 2, 3, 3.0])}, "knots_u", "tears"),
    ({"side": 0}, "side", "1 or -1"),
]


@pytest.mark.parametrize(("change", "subject", "words"), BAD, ids=[s for _, s, _ in BAD])
def test_bad_surfaces_say_what_where_and_what_to_do(change, subject, words):
    good = {"control": control_points(Kind.CONVEX), "knots_u": open_uniform_knots(5, 4),
            "knots_v": open_uniform_knots(5, 4), "orders": (4, 4), "weights": None, "side": 1}
    with pytest.raises(GeometryError) as caught:
        NurbsSurface(**{**good, **change})
    error = caught.value
    assert error.code == "bad_surface" and error.subjects == (subject,) and words in error.message
    assert error.remedy and error.limit is not None


def test_parameters_and_steps_out_of_range_are_refused():
    s = surface(Kind.CONVEX)
    for call, code in ((lambda: s.points([[0, 0], [2.1, 0]]), "outside_domain"),
                       (lambda: s.points([[0, np.nan]]), "bad_array"),
                       (lambda: s.discretised(0.0, 1.0), "bad_step"), (lambda: s.discretised(1e-5, 1e-5), "bad_step"),
                       (lambda: steps_for_chord(s, 0.0), "bad_chord")):
        with pytest.raises(GeometryError) as caught:
            call()
        assert caught.value.code == code


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("orders", [(3, 5), (4, 3), (6, 4)])
def test_values_and_derivatives_are_those_of_products_of_splines(orders, rational):
    rng = np.random.default_rng(7 * orders[0] + rational)
    weights = rng.uniform(0.5, 2.0, (9, 8)) if rational else np.ones((9, 8))
    net = np.dstack([rng.uniform(-5.0, 5.0, (9, 8, 3)) * weights[..., None], weights])
    inner = [np.sort(rng.uniform(0.1, 0.9, n - k)) for n, k in zip((9, 8), orders, strict=True)]
    inner[0][1] = inner[0][0]  # a knot that repeats
    knots = [np.concatenate([np.zeros(k), q, np.ones(k)]) for k, q in zip(orders, inner, strict=True)]
    uv = np.vstack([rng.uniform(0.0, 1.0, (200, 2)), [[0, 0], [1, 1], [1, 0], [inner[0][3 % len(inner[0])], 1.0]]])

    def twin(i: int, j: int) -> np.ndarray:
        rows = BSpline(knots[1], net.swapaxes(0, 1), orders[1] - 1)(uv[:, 1], j)
        return np.array([BSpline(knots[0], row, orders[0] - 1)(u, i) for row, u in zip(rows, uv[:, 0], strict=True)])

    a, au, av = twin(0, 0), twin(1, 0), twin(0, 1)
    point = a[:, :3] / a[:, 3:]
    found = NurbsSurface(net[..., :3] / weights[..., None], *knots, orders, weights if rational else None
                         ).derivatives(uv)
    assert np.allclose(found.point, point, atol=1e-10)
    assert np.allclose(found.u, (au[:, :3] - au[:, 3:] * point) / a[:, 3:], atol=1e-8)
    assert np.allclose(found.v, (av[:, :3] - av[:, 3:] * point) / a[:, 3:], atol=1e-8)
