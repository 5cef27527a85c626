"""Tip limits, touch and the shapes they are made of."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import HolderFrustum
from tests.hand_parts import ball, box_mesh, field_of, terraces, tool, walls
from zones.lattice import Lattice, lattice_step
from zones.reach import tip_field
from zones.reach.assembly import Clearances, discs_of
from zones.reach.tip_field import DiscHeights, contact_tips, touchable


def test_a_lattice_covers_its_bounds_and_finds_its_nodes():
    lat = Lattice.over(np.array([[0.0, 1.0], [3.0, 2.0]]), 0.5, 0.25)
    assert (lat.x0, lat.y0) == (-0.5, 0.5)
    assert lat.x0 + (lat.nx - 1) * lat.step >= 3.5 and lat.y0 + (lat.ny - 1) * lat.step >= 2.5
    i, j = lat.cells(np.array([[-0.5, 0.5], [0.1, 0.99], [99.0, -99.0]]))
    assert i.tolist() == [0, 2, 0] and j.tolist() == [0, 2, lat.nx - 1]
    assert lat.mask(np.array([[0.1, 0.99]])).sum() == 1 and not lat.mask(np.zeros((0, 2))).any()


def test_lattices_of_whole_multiples_share_their_nodes():
    bounds = np.array([[-3.13, 1.0], [3.0, 2.07]])
    wide, narrow = Lattice.on_multiples(bounds, 2.0, 0.4), Lattice.on_multiples(bounds, 0.7, 0.4)
    for lat, margin in ((wide, 2.0), (narrow, 0.7)):
        assert -0.4 < lat.x0 - (bounds[0, 0] - margin) <= 1e-12 and -0.4 < lat.y0 - (bounds[0, 1] - margin) <= 1e-12
        assert -1e-12 <= lat.x0 + (lat.nx - 1) * 0.4 - (bounds[1, 0] + margin) < 0.4
    rows, columns = narrow.within(wide)
    assert np.allclose(wide.x0 + 0.4 * np.arange(wide.nx)[columns], narrow.x0 + 0.4 * np.arange(narrow.nx))
    assert np.allclose(wide.y0 + 0.4 * np.arange(wide.ny)[rows], narrow.y0 + 0.4 * np.arange(narrow.ny))
    assert wide.within(narrow) is None


def test_heights_under_discs_are_the_same_asked_before_or_not():
    tree, bounds = TriangleTree(walls()), np.array([[-9.0, -7.0], [9.0, 7.0]])
    shared, lattices = DiscHeights(tree), [Lattice.on_multiples(bounds, m, 0.4) for m in (1.0, 3.0, 2.0)]
    for lat in lattices:
        for radius in (2.03, 5.01):  # no node of these is right under the rim of a disc that touches a wall
            np.testing.assert_allclose(shared.over(lat, radius), DiscHeights(tree).over(lat, radius), rtol=0, atol=1e-9)


def test_lattice_steps_follow_the_tool_within_limits():
    assert lattice_step(ball(1.0)) == 0.05
    assert lattice_step(ball(2.0)) == pytest.approx(0.1)
    assert lattice_step(ball(12.0)) == 0.15


def test_discs_enclose_shank_and_holder_with_their_clearance():
    body = ball(4.0, neck=20, shank=6.0, stickout=45,
                holder=(HolderFrustum(10, 22, 12), HolderFrustum(22, 22, 20)))
    discs = discs_of(body, Clearances(shank=0.2, holder=1.0))
    assert (discs[0].name, discs[0].radius, discs[0].height) == ("shank", 3.2, 20)
    holder = [d for d in discs if d.name == "holder"]
    for h in np.linspace(0, 31.9, 60):
        true = np.interp(h, [0, 12], [5, 11]) if h < 12 else 11
        assert max(d.radius for d in holder if d.height <= 45 + h) >= true + 1.0 - 1e-9
    assert max(d.radius for d in holder) == 12.0 and holder[-1].height == 57


def test_bodies_no_wider_than_the_cutter_are_left_out():
    assert discs_of(ball(4.0, shank=4.0), Clearances()) == ()


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (0.6, 0, 0.8), (0.0, -0.8, 0.6)])
@pytest.mark.parametrize("body", [ball(4.0), tool(4.0, 0.5), tool(4.0, 0.0)])
def test_contact_tips_touch_the_lifted_point(normal, body):
    n, p, lift = np.array([normal], float), np.array([[1.0, 2.0, 3.0]]), 0.01
    tip = contact_tips(body, p, n, lift)[0]
    q = (p + lift * n)[0]
    r, flat = body.corner_radius, body.radius - body.corner_radius
    rho = math.hypot(q[0] - tip[0], q[1] - tip[1])
    if normal == (0, 0, 1):
        assert tip == pytest.approx(q)
    else:
        # the point lies on the torus of the corner
        assert math.hypot(rho - flat, q[2] - tip[2] - r) == pytest.approx(r, abs=1e-12)


def test_a_floor_beside_a_wall_is_touched_by_the_rim_of_a_flat_end():
    mesh = walls()
    field = field_of(mesh, tool(4.0, 0.0))
    p = np.array([[7.02, 7.0, 3.0], [11.0, 7.0, 3.0]])
    by_cutter, by_tool, tips = touchable(field, p, np.tile([0.0, 0, 1], (2, 1)), 0.002)
    assert by_cutter.all() and by_tool.all()
    assert (np.hypot(*(tips - p)[:, :2].T) <= 2.0).all()
    assert not field.blocked_by_cutter(tips + [0, 0, 1e-5]).any()
    by_ball = touchable(field_of(mesh, ball(4.0)), p, np.tile([0.0, 0, 1], (2, 1)), 0.002)[0]
    assert by_ball.tolist() == [False, True]


@pytest.mark.parametrize("known", [False, True])
def test_the_rim_near_places_far_apart_is_that_of_one_search(known, monkeypatch):
    """Groups of places get a window of the lattice each; none of its nodes is lost, doubled or out of order."""
    rng = np.random.default_rng(4)
    for reach in (0.11, 0.5, 1.7):
        field = field_of(walls(), tool(4.0, 0.0))
        if known:
            assert field.cut_height.size
        xy = rng.uniform([4.0, 0.0], [12.0, 12.0], (40, 2))
        found = field.rim(xy, 3.0, reach)
        groups = list(tip_field._apart(*field.lattice.cells(xy), 2 * math.ceil(reach / field.lattice.step) + 1))
        assert sorted(np.concatenate(groups).tolist()) == list(range(40))
        with monkeypatch.context() as one:
            one.setattr(tip_field, "_apart", lambda i, _j, _cells: [np.arange(len(i))])
            assert np.array_equal(found, field.rim(xy, 3.0, reach)) and len(found)
        assert (len(groups) > 1) == (reach < 1.0)


@pytest.mark.parametrize(("corner", "size"), [(0.0, 4.0), (0.5, 4.0), (0.95, 2.0), (0.0, 9.0)])
def test_nodes_free_by_squares_are_those_free_one_by_one(corner, size):
    rng = np.random.default_rng(7)
    field = field_of(walls(), tool(size, corner))
    lat = field.lattice
    for z in (0.0, 1.0, 2.999, 3.0, 4.0):
        near = np.zeros((min(lat.ny, 43), min(lat.nx, 61)), np.bool_)
        near[:, :50] = rng.random((len(near), 50)) < 0.9
        i0, j0 = int(rng.integers(lat.ny - near.shape[0] + 1)), int(rng.integers(lat.nx - near.shape[1] + 1))
        rows, cols = np.nonzero(near)
        one_by_one = np.zeros_like(near)
        one_by_one[near] = ~field.blocked_by_cutter(lat.nodes(rows + i0, cols + j0, z))
        assert np.array_equal(field._free(near, i0, j0, z), one_by_one)


def test_a_channel_that_fits_like_a_gauge_is_for_a_thinner_tool():
    mesh = terraces([0, 5, 9.05, 14], [0, 10], [[8, 2, 8]])
    p, n = np.array([[5.0, 5.0, 5.0]]), np.array([[1.0, 0.0, 0.0]])
    assert not touchable(field_of(mesh, ball(4.0)), p, n, 0.002)[0][0]
    assert touchable(field_of(mesh, ball(3.0)), p, n, 0.002)[0][0]


def test_what_faces_down_is_not_touched():
    p, n = np.array([[5.0, 5.0, 3.0]]), np.array([[0.0, 0.0, -1.0]])
    assert not touchable(field_of(walls(), ball(2.0)), p, n, 0.002)[1][0]


def test_shank_and_holder_set_the_depth():
    mesh = terraces([0, 10, 20], [0, 10], [[12, 2]])
    p, n = np.array([[10.0, 5.0, z] for z in (11.0, 8.0, 5.0, 3.0)]), np.tile([1.0, 0.0, 0.0], (4, 1))
    # contact at the equator, tip 2 lower: the shank passes the top of the wall where the tip is above 12 - neck
    by_cutter, by_tool, tips = touchable(field_of(mesh, ball(4.0, neck=7.0, shank=6.0)), p, n, 0.002)
    assert by_cutter.tolist() == [True, True, True, False]
    assert by_tool.tolist() == [True, True, False, False]
    held = field_of(mesh, ball(4.0, stickout=5.0, holder=(HolderFrustum(20, 20, 30),)))
    by_cutter, by_tool, tips = touchable(held, p, n, 0.002)
    assert by_tool.tolist() == [True, False, False, False]
    assert held.tips(np.array([[12.0, 5.0]]))[0] == pytest.approx(7.0)


def test_an_allowance_lifts_cutter_shank_and_holder():
    mesh = terraces([0, 10, 20], [0, 10], [[12, 2]])
    body = ball(4.0, neck=7.0, shank=6.0)
    plain, more = field_of(mesh, body), field_of(mesh, body, allowance=0.3)
    far, beside = np.array([[17.0, 5.0]]), np.array([[12.4, 5.0]])
    assert more.tips(far)[0] == pytest.approx(plain.tips(far)[0] + 0.3)
    assert plain.tips(beside)[0] == pytest.approx(5.0) and more.tips(beside)[0] == pytest.approx(5.3)
    aside = np.array([[14.0, 5.0]])
    assert more.tips(aside)[0] == pytest.approx(2.3)


def test_heights_at_the_nodes_are_the_tips_there():
    field = field_of(walls(), ball(3.0, neck=4.0, shank=5.0))
    lat = field.lattice
    i, j = np.arange(0, lat.ny, 17), np.arange(0, lat.nx, 13)
    x, y = np.meshgrid(lat.x0 + lat.step * j, lat.y0 + lat.step * i)
    at = field.tips(np.column_stack([x.ravel(), y.ravel()]))
    np.testing.assert_allclose(field.height[np.ix_(i, j)].ravel(), at, atol=1e-9)


def test_beyond_the_look_up_a_holder_is_not_taken_for_free():
    # a holder of 40 mm reaches the part from far outside the lattice
    mesh = box_mesh([0, 0, 0], [10, 10, 30])
    body = ball(4.0, stickout=10.0, holder=(HolderFrustum(40, 40, 30),))
    field = field_of(mesh, body)
    at = np.array([[17.5, 5.0, 0.0], [19.0, 5.0, 0.0], [-25.0, 5.0, 0.0]])
    assert field.blocked_by_body(at).all()
    assert (field.tips(at[:, :2]) >= 20.0 - 1e-9).all()
    thin = field_of(mesh, ball(4.0))
    assert not thin.blocked_by_body(at).any() and (thin.tips(at[:, :2]) == -np.inf).all()


def test_many_queries_answer_like_few():
    field = field_of(TriangleTree(walls()), ball(3.0))
    rng = np.random.default_rng(2)
    tips = rng.random((5000, 3)) * [22, 14, 10]
    np.testing.assert_array_equal(field.tips(tips[:, :2])[:100], field.tips(tips[:100, :2]))
    np.testing.assert_array_equal(field.blocked_by_cutter(tips)[:100], field.blocked_by_cutter(tips[:100]))


@pytest.mark.parametrize("stickout", [12.0, 14.0, 16.0, 30.0])
def test_discs_without_a_grid_block_nothing_a_grid_would(monkeypatch, stickout):
    body = ball(3.0, neck=9.0, shank=5.0, stickout=stickout, holder=(HolderFrustum(8, 14, 5), HolderFrustum(20, 20, 9)))
    mesh = walls()
    some = field_of(mesh, body, allowance=0.1)
    monkeypatch.setattr(type(some), "_can_meet", lambda _self, _disc: True)
    every = field_of(mesh, body, allowance=0.1)
    lower, upper = mesh.bounds
    tips = lower - [4, 4, 2.6] + np.random.default_rng(7).random((20_000, 3)) * (upper - lower + [8, 8, 2.6])
    blocked = every.blocked_by_body(tips)
    assert 0.02 < blocked.mean() < 0.98
    np.testing.assert_array_equal(some.blocked_by_body(tips), blocked)
    assert (some.noncut < every.noncut).any()  # and there was something to leave out
