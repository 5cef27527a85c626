"""Push-cutter: no earlier touch by the drop, contacts on mesh and cutter, closed forms, rigid motion."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import FEW
from geometry.mesh_queries.revolved_outline import heights
from tests.oracle.drop_shapes import CUTTERS, SHAPES, box, smooth, soup
from tests.oracle.naive_drop import drop as naive
from tests.oracle.test_outline import TURNED
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_contacts, drop_cutter, push_contacts, push_cutter

TOOLS = {name: Cutter(2.0 * r, c, 20.0) for name, (r, c) in CUTTERS.items()} | TURNED


def ways(mesh, n, seed):
    """Tips between the mesh's bottom and top, and a direction."""
    rng = np.random.default_rng(seed)
    lo, hi = mesh.bounds
    angle = rng.random() * 2.0 * math.pi
    return lo - [2, 2, 0] + rng.random((n, 3)) * (hi - lo + [4, 4, 0]), np.array([math.cos(angle), math.sin(angle)])


def stack_of(cutter):
    from toolpath.drop_cutter import _outline

    return _outline(cutter).stack


def depth(stack, p, x, y, z):
    """How far a point is inside the tool with its tip at (x, y, z), mm along z; -inf beside it."""
    rho = math.hypot(p[0] - x, p[1] - y)
    best = -math.inf
    for k, up in enumerate(stack.offset):
        rows = stack.rows[stack.first[k]:stack.first[k + 1]]
        if rho < rows[-1, 1]:
            best = max(best, float(p[2] - z - up - heights(rows, np.array(rho))))
    return best


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_the_drop_finds_no_earlier_touch(shape, tool):
    mesh, cutter = SHAPES[shape](), TOOLS[tool]
    tree = TriangleTree(mesh)
    tips, d = ways(mesh, 60, seed=1)
    stop = push_cutter(tree, cutter, tips, d)
    met = np.isfinite(stop)
    assert met.sum() > 20
    end = np.where(met, stop, 40.0)
    back = np.concatenate([np.geomspace(1e-6, 80.0, 200), np.linspace(0.01, 80.0, 600)])
    at = tips[:, None, :2] + (end[:, None] - back)[..., None] * d
    tip = drop_cutter(tree, cutter, at.reshape(-1, 2)).reshape(at.shape[:2])
    assert (tip <= tips[:, 2:] + 1e-8).all()


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_contacts_lie_on_triangle_and_tool(shape, tool):
    mesh, cutter = SHAPES[shape](), TOOLS[tool]
    mesh = TriangleMesh(mesh.vertices, mesh.faces, np.arange(7, 7 + len(mesh.faces)))
    tips, d = ways(mesh, 300, seed=2)
    got = push_contacts(mesh, cutter, tips, d)
    np.testing.assert_array_equal(got.value, push_cutter(mesh, cutter, tips, d))
    hit = got.triangle >= 0
    np.testing.assert_array_equal(hit, np.isfinite(got.value))
    np.testing.assert_array_equal(got.face_id, np.where(hit, got.triangle + 7, -1))
    corners = mesh.triangles[got.triangle[hit]]
    assert (got.point[hit] >= corners.min(1) - 1e-9).all() and (got.point[hit] <= corners.max(1) + 1e-9).all()
    off = np.einsum("ij,ij->i", mesh.normals[got.triangle[hit]], got.point[hit] - corners[:, 0])
    assert np.abs(off[mesh.areas[got.triangle[hit]] > 1e-4]).max() < 1e-9
    stack = stack_of(cutter)
    for tip, p, stop in zip(tips[hit], got.point[hit], got.value[hit], strict=True):
        # a shift of e on the side of the tool goes sqrt(2 R e) deep along the rim of an arc, no more
        assert depth(stack, p + [0, 0, 1e-9], *(tip[:2] + (stop + 1e-7) * d), tip[2]) > 0.0
        assert depth(stack, p - [0, 0, 1e-9], *(tip[:2] + (stop - 1e-7) * d), tip[2]) <= 0.0


@pytest.mark.parametrize("tool", [pytest.param("ball", marks=pytest.mark.slow), "flat", "bull"])
def test_stop_is_the_first_lift_of_the_naive_drop(tool):
    radius, corner = CUTTERS[tool]
    for seed in range(30):
        one = soup(seed, 1)
        tips, d = ways(one, 1, seed)
        (x, y, z), stop = tips[0], push_cutter(one, TOOLS[tool], tips, d)[0]
        s = np.linspace(-30.0, 30.0, 400)
        lifts = [naive(one, *(np.array([x, y]) + t * d), radius, corner) > z for t in s]
        if not any(lifts):
            continue
        k = int(np.argmax(lifts))
        low, high = s[k - 1], s[k]
        for _ in range(30):
            t = 0.5 * (low + high)
            low, high = (low, t) if naive(one, *(np.array([x, y]) + t * d), radius, corner) > z else (t, high)
        assert stop == pytest.approx(high, abs=1e-6)


def test_ball_at_walls_edges_and_corners():
    ball = Cutter.ball(diameter=4.0, length=9.0)
    wall = box((10.0, -50.0, -5.0), (20.0, 50.0, 30.0))
    for angle in (0.0, 0.4, -1.0):
        d = [3.0 * math.cos(angle), 3.0 * math.sin(angle)]
        assert push_cutter(wall, ball, [[0, 0, 1]], d) == pytest.approx(8.0 / math.cos(angle), abs=1e-12)
    # the upper edge at z = 0.5 over the tip: the ball is sqrt(4 - 1.5^2) wide there
    low = box((10.0, -50.0, -5.0), (20.0, 50.0, 0.5))
    assert push_cutter(low, ball, [[3, 1, 0]], [1, 0]) == pytest.approx(7.0 - math.sqrt(4.0 - 2.25), abs=1e-12)
    assert push_cutter(low, ball, [[3, 1, 0.5]], [1, 0]) == math.inf  # slides over it
    # an upright edge 1.2 aside, and its upper end
    assert push_cutter(low, ball, [[3, -51.2, -3]], [1, 0]) == pytest.approx(7.0 - 1.6, abs=1e-12)
    assert push_cutter(low, ball, [[3, -51.2, 0]], [1, 0]) == pytest.approx(7.0 - math.sqrt(1.75 - 1.44), abs=1e-12)
    assert push_cutter(low, ball, [[3, -52, -3]], [1, 0]) == math.inf  # grazes it
    assert push_cutter(low, ball, [[33, 0, -1]], [1, 0])[0] < -23.0  # had to stop before


def test_slope_of_45_degrees():
    ramp = TriangleMesh([[-50.0, -50, -50], [50, -50, 50], [0, 90, 0]], [[0, 1, 2]])  # z = x
    root = math.sqrt(2.0)
    for cutter, tip in ((Cutter.ball(diameter=4, length=9), 2.0 * root - 2.0), (Cutter.flat(diameter=4, length=9), 2.0),
                        (Cutter.bull(diameter=4, length=9, corner_radius=0.5), 1.5 + 0.5 * root - 0.5)):
        assert push_cutter(ramp, cutter, [[3, 1, 5]], [1, 0]) == pytest.approx(5.0 - tip - 3.0, abs=1e-12)
        for tip_z in (0.0, 4.0):  # a push up to a slope is a drop onto it
            x = push_cutter(ramp, cutter, [[0, 0, tip_z]], [1, 0.3])[0] * np.array([1.0, 0.3]) / math.hypot(1.0, 0.3)
            assert drop_cutter(ramp, cutter, [x]) == pytest.approx(tip_z, abs=1e-12)


@pytest.mark.parametrize("tool", ["ball", "flat", "bull", "tapered", "barrel", "assembly"])
@pytest.mark.parametrize("shape", ["smooth", "soup"])
def test_turning_and_moving_change_nothing(shape, tool):
    mesh = SHAPES[shape]()
    tips, d = ways(mesh, 200, seed=3)
    stop = push_cutter(mesh, TOOLS[tool], tips, d)
    c, s = math.cos(0.7), math.sin(0.7)
    move = np.array([[c, -s, 0, 5.0], [s, c, 0, -3.0], [0, 0, 1, 1.5], [0, 0, 0, 1]])
    moved = push_cutter(mesh.transformed(move), TOOLS[tool], tips @ move[:3, :3].T + move[:3, 3], move[:2, :2] @ d)
    np.testing.assert_allclose(moved, stop, rtol=0, atol=1e-7)
    ahead = push_cutter(mesh, TOOLS[tool], tips + [*(2.5 * d), 0.0], 7.0 * d)
    np.testing.assert_allclose(ahead + 2.5, stop, rtol=0, atol=1e-7)


@pytest.mark.parametrize("tool", ["ball", "flat", "bull", "tapered", "barrel", "assembly"])
def test_no_bound_hides_a_triangle(tool):
    for mesh in (smooth(30), soup(9, 1500)):
        tips, d = ways(mesh, 200, seed=4)
        plain = push_cutter(TriangleTree(mesh, leaf_size=len(mesh.faces)), TOOLS[tool], tips, d)
        np.testing.assert_allclose(push_cutter(mesh, TOOLS[tool], tips, d), plain, rtol=0, atol=1e-11)


def test_the_same_bytes_on_one_thread_and_two():
    tree = TriangleTree(smooth())
    tips, d = ways(tree.mesh, FEW + 1000, seed=6)
    threads, out = numba.get_num_threads(), []
    try:
        for n in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(n)
            out.append(push_cutter(tree, TOOLS["assembly"], tips, d).tobytes())
    finally:
        numba.set_num_threads(threads)
    assert out[0] == out[1]


def test_what_is_no_direction_is_refused():
    mesh, ball = smooth(), Cutter.ball(diameter=2.0, length=9.0)
    for d in ([0.0, 0.0], [math.nan, 1.0], [math.inf, 0.0], [1.0, 0.0, 0.0]):
        with pytest.raises(GeometryError, match="direction") as caught:
            push_cutter(mesh, ball, [[0, 0, 0]], d)
        assert caught.value.code == "bad_direction"
    with pytest.raises(GeometryError):
        push_cutter(mesh, ball, [[0, 0]], [1, 0])
    with pytest.raises(TypeError):
        push_cutter(mesh, "ball", [[0, 0, 0]], [1, 0])
    tiny = push_cutter(mesh, ball, [[-9, 5, 0]], [1e-310, 0.0])
    assert tiny == push_cutter(mesh, ball, [[-9, 5, 0]], [1, 0])


def test_contacts_of_the_drop_name_the_face():
    mesh = TriangleMesh(smooth().vertices, smooth().faces, np.arange(3, 3 + len(smooth().faces)))
    for tool in ("ball", "tapered"):
        xy = np.array([[5.0, 5.0], [99.0, 99.0]])
        got = drop_contacts(mesh, TOOLS[tool], xy)
        np.testing.assert_array_equal(got.value, drop_cutter(mesh, TOOLS[tool], xy))
        assert got.face_id[0] == got.triangle[0] + 3 and got.face_id[1] == got.triangle[1] == -1
        assert np.isfinite(got.point[0]).all() and np.isnan(got.point[1]).all()
