"""The place at which a carried disc is nearest, against 200,000 places: also where it all but covers the point."""

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from verify.kernels.rays import new_left
from verify.kernels.sweep import _disc_nearest


@pytest.mark.parametrize("fall", [0.0, 1e-6, 1e-3, 1.0, 5.0])
def test_a_disc_that_just_covers_a_point_is_found(fall):
    """The slope vanishes over a short way in the middle of a long move: a false position alone creeps there."""
    rng, s = np.random.default_rng(0), np.linspace(0.0, 1.0, 200_001)
    for offset in (-1e-3, -1e-5, 0.0, 1e-6, 0.1):
        for _ in range(30):
            a, d = float(rng.uniform(0.3, 3.0)), rng.normal(size=3) * [5.0, 5.0, fall]
            across = np.array([-d[1], d[0]]) / np.hypot(d[0], d[1])
            plan = rng.uniform(0.1, 0.9) * d[:2] + a * (1.0 + offset) * across
            q = np.array([*plan, rng.choice([-0.5, 0.5, 1e-3])])

            def gap(t, q=q, d=d, a=a):
                return np.hypot(np.maximum(np.hypot(q[0] - t * d[0], q[1] - t * d[1]) - a, 0.0), q[2] - t * d[2])

            assert gap(_disc_nearest(*q, *d, a)) <= gap(s).min() + 1e-9


def test_a_bull_nose_whose_flat_end_just_passes_over_leaves_nothing():
    """A ray 0.8 µm inside the flat of a bull nose (R 2, r 0.5) that passes 6.6 mm of it; 0.018 mm were told as left."""
    d = (0.7568586214809795, 6.532449095636578, 2.598069071380049e-06)
    q = (0.8645836449266626, 4.818492435225797, -6.051286743108397e-06)
    left = new_left(*q, 0.0, 0.0, 1.0, *d, d[0] ** 2 + d[1] ** 2, CutterSizes(2.0, 0.5, 4.0), 0.05)
    assert 0.0 <= left < 1e-5
