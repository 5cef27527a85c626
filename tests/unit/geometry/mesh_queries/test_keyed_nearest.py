"""Nearest points of the same key, against asking everyone."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.keyed_nearest import KeyedPoints


@pytest.mark.parametrize("seed", range(4))
def test_nearest_of_the_key_is_what_a_full_search_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, key = rng.uniform(-5, 40, (300, 3)), rng.integers(-3, 9, 300) * 1000
    asked, wanted = rng.uniform(-5, 40, (200, 3)), rng.integers(-4, 10, 200) * 1000
    found = KeyedPoints(key, points).nearest(wanted, asked, 3)
    for row, k, p in zip(found, wanted, asked, strict=True):
        own = np.flatnonzero(key == k)
        order = own[np.argsort(np.linalg.norm(points[own] - p, axis=1))][:3]
        assert row[: len(order)].tolist() == order.tolist() and (row[len(order):] == -1).all()


def test_nothing_to_find_is_minus_one() -> None:
    empty = KeyedPoints(np.zeros(0, np.int64), np.zeros((0, 3)))
    assert empty.nearest(np.array([1]), np.zeros((1, 3))).tolist() == [[-1]]
    one = KeyedPoints(np.array([7]), np.array([[1.0, 2.0]]))
    assert one.nearest(np.array([7, 8]), np.array([[1.0, 2.0], [1.0, 2.0]])).tolist() == [[0], [-1]]
