"""Connected components against those that scipy finds, and the process that reads parts without scipy."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components as by_scipy

from geometry.connected_components import connected_components


def twin(pairs: np.ndarray, count: int) -> np.ndarray:
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return by_scipy(graph, directed=False)[1]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9, 3.0])
@pytest.mark.parametrize("count", [1, 2, 40, 3000])
def test_components_are_those_of_scipy(count, share):
    rng = np.random.default_rng(count)
    for _ in range(20 if count < 100 else 3):
        pairs = rng.integers(0, count, (round(share * count), 2))
        np.testing.assert_array_equal(connected_components(pairs, count), twin(pairs, count))


def test_a_long_chain_is_one_component_however_it_is_numbered():
    rng = np.random.default_rng(3)
    for order in (np.arange(5000), np.arange(5000)[::-1], rng.permutation(5000)):
        pairs = np.stack([order[:-1], order[1:]], axis=1)
        assert not connected_components(pairs, 5000).any()
        assert connected_components(pairs[:2499], 5000).max() == 2500


def test_a_part_is_read_without_scipy():
    """The reader starts as a process for every job: scipy would take it half a second."""
    told = subprocess.run([sys.executable, "-c", "import sys, geometry.step_import.occ.loading, "
                           "geometry.step_import.reader_process; print('scipy' in sys.modules, 'OCP' in sys.modules)"],
                          capture_output=True, text=True, check=True, timeout=120)
    assert told.stdout.split() == ["False", "True"]
