"""Queries sorted along a curve: the same answers in the order they were asked."""

import numpy as np

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.curve_order import LARGE, MANY, along_curve
from geometry.mesh_queries.drop import blocked_many, drop_tips
from geometry.mesh_queries.outline_drop import drop_turned
from geometry.mesh_queries.push import push_stops
from geometry.mesh_queries.revolved_outline import Outline


def _field(n=80):
    g = np.linspace(0.0, 20.0, n + 1)
    x, y = np.meshgrid(g, g)
    cell = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    far = cell + n + 2
    faces = np.concatenate([np.stack([cell, cell + 1, far], 1), np.stack([cell, far, far - 1], 1)])
    return TriangleMesh(np.stack([x, y, np.sin(x) + np.cos(0.7 * y)], -1).reshape(-1, 3), faces)


def test_what_is_few_small_or_in_order_stays():
    rng = np.random.default_rng(0)
    xy = 20.0 * rng.random((MANY, 2))
    assert along_curve(xy, LARGE) is not None
    assert along_curve(xy, LARGE - 1) is None and along_curve(xy[:-1], LARGE) is None
    assert along_curve(xy[:0], LARGE) is None and along_curve(np.ones((MANY, 2)), LARGE) is None
    g = np.linspace(0.0, 20.0, 60)
    rows = np.stack(np.meshgrid(g, g), -1).reshape(-1, 2)
    assert along_curve(rows, LARGE) is None


def test_neighbours_follow_each_other():
    xy = 20.0 * np.random.default_rng(1).random((10_000, 2))
    order = along_curve(xy, LARGE)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(xy)))
    assert np.linalg.norm(np.diff(xy[order], axis=0), axis=1).mean() < 0.4


def test_answers_are_those_of_points_one_by_one():
    tree = TriangleTree(_field())
    tips = np.random.default_rng(2).random((MANY, 3)) * [20.0, 20.0, 2.0]
    ball = Outline.bull(0.5, 0.5)
    for ask in (lambda p: drop_tips(tree, p[:, :2], 0.5, 0.5), lambda p: drop_turned(tree, p[:, :2], ball),
                lambda p: blocked_many(tree, p, 0.5, 0.5), lambda p: push_stops(tree, p, [1.0, 0.2], ball)):
        assert ask(tips).tobytes() == np.concatenate([ask(part) for part in np.array_split(tips, 7)]).tobytes()
