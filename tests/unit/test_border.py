"""Places beyond the outermost samples of an area: how far out they go, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.bvh import TriangleTree
from geometry.drop import drop_tips
from tests.hand_parts import ball, box_mesh, dome, field_of, joined
from toolpath.border import beyond
from toolpath.family import Target
from zones.reach import touchable

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


def plate():
    return box_mesh((-20.0, -20.0, -2.0), (20.0, 20.0, 0.0))


def test_a_disc_on_a_plate_is_ringed_all_round():
    points, normals = on_plate(spread(lambda x, y: np.hypot(x, y) < 3.0))
    field = field_of(TriangleTree(plate()), ball(3.0))
    more, up, tips = places(field, points, normals)
    rho = np.hypot(*more[:, :2].T)
    assert (more[:, 2] == 0.0).all() and (up == [0.0, 0.0, 1.0]).all()
    assert rho.min() > 3.0 and rho.max() < 3.0 + 1.5 * SPACING + 1e-9
    turn = np.sort(np.arctan2(more[:, 1], more[:, 0]))
    assert np.diff(turn, append=turn[0] + 2 * np.pi).max() < np.radians(40.0)
    assert touchable(field, more, up, LIFT)[1].all()
    np.testing.assert_allclose(tips[:, :2], more[:, :2], atol=1e-9)


def test_no_place_lies_off_the_edge_of_the_part_or_in_a_wall():
    # the area ends at the edge x = 4 of a plate, and at a wall that the ball's side touches from y = 1.5 on
    block = joined(box_mesh((-20.0, -20.0, -2.0), (4.0, 20.0, 0.0)), box_mesh((-20.0, 3.0, 0.0), (4.0, 6.0, 5.0)))
    points, normals = on_plate(spread(lambda x, y: (x < 4.0) & (y < 1.5) & (x > -3.0) & (y > -3.0)))
    field = field_of(TriangleTree(block), ball(3.0))
    more, _, _ = places(field, points, normals)
    assert len(more) and more[:, 0].max() <= 4.0 and more[:, 1].max() <= 1.5 + LIFT
    assert ((more[:, 0] < -3.0) | (more[:, 1] < -3.0) | (more[:, 1] > points[:, 1].max() - 0.5 * SPACING)
            | (more[:, 0] > 4.0 - SPACING)).all()


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
    assert len(more) > 10 and np.hypot(*more[:, :2].T).min() > 1.9
    np.testing.assert_allclose(more[:, 2], drop_tips(tree, more[:, :2], 0.0, 0.0), atol=1e-12)
    assert (drop_tips(tree, tips[:, :2], 1.5, 1.5) <= tips[:, 2] + 1e-6).all()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_few_samples_make_no_trouble(count):
    points, normals = on_plate(np.array([[0.0, 0.0], [0.1, 0.0]])[:count])
    more, up, tips = places(field_of(TriangleTree(plate()), ball(3.0)), points, normals)
    assert more.shape == up.shape == tips.shape == (0 if count < 2 else count, 3)


def test_it_turns_with_the_part():
    # an L is ringed from inside its corner as well, and a quarter turn of everything turns the places
    def ell(x, y):
        return ((x < 0.0) | (y < 0.0)) & (np.abs(x) < 3.0) & (np.abs(y) < 3.0)

    xy = spread(ell)
    field = field_of(TriangleTree(plate()), ball(3.0))
    one = places(field, *on_plate(xy))[0]
    turned = places(field, *on_plate(xy @ np.array([[0.0, 1.0], [-1.0, 0.0]])))[0]
    back = turned[:, :2] @ np.array([[0.0, -1.0], [1.0, 0.0]])
    assert len(one) == len(turned) and ((one[:, 0] > 0.0) & (one[:, 1] > 0.0)).any()
    np.testing.assert_allclose(back[np.lexsort(np.round(back, 6).T)],
                               one[np.lexsort(np.round(one[:, :2], 6).T)][:, :2], atol=1e-6)
