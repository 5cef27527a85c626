"""Places beyond the outermost samples of an area: how far out they go, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from geometry.tool_body import HolderFrustum
from tests.hand_parts import ball, box_mesh, dome, field_of, joined
from toolpath.passes.pass_family import Target
from toolpath.passes.reach_border import COARSEST, FAR, beyond
from zones.reach.tip_field import touchable

LIFT, SPACING = 0.002, 0.2


def spread(inside, half: float = 5.0):
    """Points of a shaken lattice over a square where ``inside`` is true of x and y."""
    g = np.arange(-half, half, SPACING) + 0.5 * SPACING
    xy = np.stack(np.meshgrid(g, g), -1).reshape(-1, 2)
    xy += np.random.default_rng(5).uniform(-0.3, 0.3, xy.shape) * SPACING
    return xy[inside(*xy.T)]


def on_plate(xy):
    return np.column_stack([xy, np.zeros(len(xy))]), np.tile([0.0, 0.0, 1.0], (len(xy), 1))


def places(field, points, normals, lift: float = LIFT):
    """Points, normals and tips of what is beyond the border."""
    more = beyond(field, Target(points, normals, points, SPACING), lift)
    return more.points, more.normals, more.tips


def faced(*parts) -> TriangleMesh:
    """Meshes joined, all triangles of each with a face id of its own."""
    one = joined(*(mesh for mesh, _ in parts))
    return TriangleMesh(one.vertices, one.faces, np.repeat([k for _, k in parts], [len(m.faces) for m, _ in parts]))


def plate():
    return box_mesh((-20.0, -20.0, -2.0), (20.0, 20.0, 0.0))


def largest_gap(points) -> float:
    """Of the directions from the origin, degrees."""
    turn = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    return float(np.degrees(np.diff(turn, append=turn[0] + 2 * np.pi).max()))


@pytest.mark.parametrize("copies", [1, 2])
def test_a_disc_on_a_plate_is_ringed_all_round(copies):
    points, normals = on_plate(np.repeat(spread(lambda x, y: np.hypot(x, y) < 3.0), copies, axis=0))
    field = field_of(TriangleTree(plate()), ball(3.0))
    more, up, tips = places(field, points, normals)
    outside = np.hypot(*more[:, :2].T) > 3.0
    assert (more[:, 2] == 0.0).all() and (up == [0.0, 0.0, 1.0]).all()
    assert outside.mean() > 0.9 and np.hypot(*more[:, :2].T).max() < 3.0 + FAR * SPACING
    assert largest_gap(more[outside]) < 10.0
    assert touchable(field, more, up, LIFT)[1].all()
    np.testing.assert_allclose(tips[:, :2], more[:, :2], atol=1e-9)


def test_the_border_of_what_the_holder_lets_reach_is_known_to_a_step():
    # a holder of 6 mm round the axis and a wall at x = 8: the ball touches the plate up to x = 8 - 6 - clearance
    block = joined(plate(), box_mesh((8.0, -20.0, 0.0), (12.0, 20.0, 30.0)))
    field = field_of(TriangleTree(block), ball(3.0, stickout=8.0, holder=(HolderFrustum(12, 12, 30),)))
    far = np.linspace(0.0, 3.0, 3001)
    line = np.column_stack([far, np.zeros(3001), np.zeros(3001)])
    border = far[touchable(field, line, np.tile([0.0, 0.0, 1.0], (3001, 1)), LIFT)[1]].max()
    points, normals = on_plate(spread(lambda x, y: (x < border - 0.6 * SPACING) & (np.abs(y) < 3.0) & (x > -3.0)))
    more, _, _ = places(field, points, normals)
    at_wall = more[(more[:, 0] > points[:, 0].max() - 0.5 * SPACING) & (np.abs(more[:, 1]) < 2.5)]
    assert more[:, 0].max() <= border + 1e-9
    for y in np.arange(-2.4, 2.5, 2.0 * SPACING):
        near = np.abs(at_wall[:, 1] - y) < SPACING
        assert at_wall[near, 0].max() > border - COARSEST * SPACING, y


def test_no_place_lies_off_the_edge_of_the_part_or_in_a_wall():
    # the area ends at the edge x = 4 of a plate, and at a wall that the ball's side touches from y = 1.5 on
    block = joined(box_mesh((-20.0, -20.0, -2.0), (4.0, 20.0, 0.0)), box_mesh((-20.0, 3.0, 0.0), (4.0, 6.0, 5.0)))
    points, normals = on_plate(spread(lambda x, y: (x < 4.0) & (y < 1.5) & (x > -3.0) & (y > -3.0)))
    more, _, _ = places(field_of(TriangleTree(block), ball(3.0)), points, normals)
    assert len(more) and more[:, 0].max() <= 4.0 and more[:, 1].max() <= 1.5 + LIFT


def test_no_place_lies_on_another_face_or_on_a_fixture():
    # beside the area a clamp is flush with it: part of the obstacles, no face of the part
    field = field_of(TriangleTree(faced((box_mesh((-20.0, -20.0, -2.0), (4.0, 20.0, 0.0)), 7),
                                        (box_mesh((4.0, -20.0, -2.0), (20.0, 20.0, 0.0)), 0))), ball(3.0))
    points, normals = on_plate(spread(lambda x, y: (x < 3.95) & (np.abs(y) < 3.0) & (x > -3.0)))
    target = Target(points, normals, points, SPACING)
    anywhere = beyond(field, target, LIFT).points
    own = beyond(field, target, LIFT, faces=(7,)).points
    assert (anywhere[:, 0] > 4.01).any() and (own[:, 0] <= 4.0).all() and (own[:, 0] < -3.0).any()
    assert not len(beyond(field, target, LIFT, faces=(8,)).points)


def test_places_are_on_the_surface_where_it_is_curved():
    mesh = dome(size=8.0)
    tree = TriangleTree(mesh)
    xy = spread(lambda x, y: np.hypot(x, y) < 2.0)
    points = np.column_stack([xy, drop_tips(tree, xy, 0.0, 0.0)])
    a, b = (drop_tips(tree, xy + d, 0.0, 0.0) - drop_tips(tree, xy - d, 0.0, 0.0)
            for d in (np.array([0.05, 0.0]), np.array([0.0, 0.05])))
    normals = np.column_stack([-a / 0.1, -b / 0.1, np.ones(len(xy))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    more, _, tips = places(field_of(tree, ball(3.0)), points, normals, 0.02)
    assert largest_gap(more) < 15.0
    np.testing.assert_allclose(more[:, 2], drop_tips(tree, more[:, :2], 0.0, 0.0), atol=1e-12)
    assert (drop_tips(tree, tips[:, :2], 1.5, 1.5) <= tips[:, 2] + 1e-6).all()


def test_a_strip_one_sample_wide_gets_places_on_both_sides():
    x = np.arange(-4.0, 4.0, SPACING)
    more, _, _ = places(field_of(TriangleTree(plate()), ball(3.0)), *on_plate(np.column_stack([x, 0.0 * x])))
    for side in (-1, 1):
        there = np.sort(more[side * more[:, 1] > SPACING, 0])
        assert there[0] < -3.8 and there[-1] > 3.6 and np.diff(there).max() < 2.0 * SPACING


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_few_samples_are_ringed_too(count):
    points, normals = on_plate(np.array([[0.0, 0.0], [0.1, 0.0]])[:count])
    more, up, tips = places(field_of(TriangleTree(plate()), ball(3.0)), points, normals)
    assert more.shape == up.shape == tips.shape and (largest_gap(more) < 60.0 if count else not len(more))
