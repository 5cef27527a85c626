"""Widest paths, against taking the nodes away one width after the other."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.connected_components import connected_components
from geometry.widest_paths import widest_paths

NONE = np.iinfo(np.int64).min


def by_levels(pairs, width, roots):
    """A node keeps the largest width at which nodes of no less join it with a root."""
    out = np.full(len(width), NONE)
    for level in np.unique(width).tolist():
        there = roots | (width >= level)
        group = connected_components(pairs[there[pairs].all(axis=1)], len(width))
        out[there & np.isin(group, group[roots])] = level
    return out


@pytest.mark.parametrize("seed", range(12))
def test_a_node_stays_joined_as_long_as_the_least_node_of_its_best_path(seed):
    rng = np.random.default_rng(seed)
    n = 40
    pairs = np.unique(np.sort(rng.integers(0, n, (60, 2)), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    width, roots = rng.integers(-1, 9, n), rng.random(n) < 0.1
    width[rng.random(n) < 0.2] = np.iinfo(np.int64).max
    found = widest_paths(pairs, width, roots)
    assert (found[roots] == np.iinfo(np.int64).max).all()
    assert np.array_equal(found[~roots], by_levels(pairs, width, roots)[~roots])


def test_without_a_root_nothing_is_joined():
    assert widest_paths(np.array([[0, 1]]), np.array([3, 4]), np.zeros(2, np.bool_)).tolist() == [NONE, NONE]
