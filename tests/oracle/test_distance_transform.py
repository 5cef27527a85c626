"""Distance from blocked nodes, against scipy's and by its own words."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from zones.lattice import blocked_beside


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99, 0.999])
def test_distances_are_those_of_scipy_and_the_nodes_named_are_that_far(share):
    rng = np.random.default_rng(int(1000 * share))
    for _ in range(40):
        shape = rng.integers(1, 45, 2)
        free = rng.random(shape) < share
        free[tuple(rng.integers(0, shape))] = False
        far, near = blocked_beside(free, 0.15)
        assert np.allclose(far, 0.15 * distance_transform_edt(free), rtol=0.0, atol=1e-12)
        assert not free[near[0], near[1]].any()
        rows, cols = np.indices(free.shape)
        assert np.allclose(0.15 * np.hypot(rows - near[0], cols - near[1]), far, rtol=0.0, atol=1e-12)


def test_one_blocked_node_in_a_corner_decides_everywhere():
    free = np.ones((30, 20), np.bool_)
    free[29, 0] = False
    far, near = blocked_beside(free, 2.0)
    assert far[0, 19] == pytest.approx(2.0 * np.hypot(29, 19)) and (near[0] == 29).all() and (near[1] == 0).all()
