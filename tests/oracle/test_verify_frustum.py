"""Closed forms of how deep bodies take in points and columns, against many standing ones."""

import numpy as np
import pytest

from verify.kernels.frustum import Frustum, contact, contact_of_ball, no_deeper, overlap, penetration

Z0, Z1 = 2.0, 6.0
STEPS = np.linspace(0, 1, 4001)


def moves(count, seed):
    """Seen places (3,) and displacements (3,): slanting, level, straight down or up, none."""
    rng = np.random.default_rng(seed)
    for case in range(count):
        d = rng.normal(size=3) * np.array([[2, 2, 2], [2, 2, 0], [0, 0, 2], [0, 0, 0], [0.1, 0.1, 4]][case % 5])
        yield rng.uniform([-4, -4, -1], [4, 4, 9]), d


def standing(w, d, r0, r1, column):
    """The greatest of aside, and of the lesser of aside and down, of tools standing all along the move; mm."""
    high, rho = w[2] - STEPS * d[2], np.hypot(w[0] - STEPS * d[0], w[1] - STEPS * d[1])
    if column:  # down to any height at which the frustum is met
        top = np.clip(high, Z0, Z1)
        wide = np.maximum(r0, r0 + (r1 - r0) * (top - Z0) / (Z1 - Z0))
        met = high > Z0
    else:
        wide, met = r0 + (r1 - r0) * (high - Z0) / (Z1 - Z0), (high > Z0) & (high < Z1)
    aside = np.where(met, wide - rho, -np.inf)
    return aside.max(), np.minimum(aside, np.where(met, high - Z0, -np.inf)).max()


@pytest.mark.parametrize("r0, r1", [(3.0, 3.0), (2.0, 4.0), (4.0, 2.0), (1.0, 9.0), (5.0, 0.0)])
@pytest.mark.parametrize("column", [True, False])
def test_closed_forms_are_the_deepest_of_many_standing_ones(r0, r1, column):
    met = 0
    for w, d in moves(400, 4):
        aside, lesser = standing(w, d, r0, r1, column)
        if np.isinf(aside):
            continue
        met += 1
        off = 0.5 / 4000 * np.linalg.norm(d) * (1.0 + abs(r1 - r0) / (Z1 - Z0)) + 1e-9
        assert aside - 1e-9 <= overlap(*w, *d, Frustum(Z0, Z1, r0, r1), column) <= aside + 2 * off
        got = penetration(*w, *d, Frustum(Z0, Z1, r0, r1), column)
        assert max(lesser, 0.0) - 1e-9 <= got <= max(lesser, 0.0) + 2 * off
    assert met > 150


@pytest.mark.parametrize("r0, r1", [(3.0, 3.0), (2.0, 4.0), (4.0, 2.0)])
def test_a_place_that_is_passed_over_is_no_deeper_than_what_is_known(r0, r1):
    """Neither the bound nor the depth already known may hide a deeper contact."""
    rng = np.random.default_rng(8)
    passed = 0
    for w, d in moves(2000, 9):
        clearance, known = float(rng.uniform(0, 0.5)), float(rng.uniform(0, 2))
        depth = contact(*w, *d, Frustum(Z0, Z1, r0, r1), clearance, 1e-3, 0.0, False)
        again = contact(*w, *d, Frustum(Z0, Z1, r0, r1), clearance, 1e-3, known, False)
        assert again in (0.0, depth) and (again == depth or depth <= known)
        if no_deeper(*w, *d, Z0, Z1, max(r0, r1), clearance, known):
            passed += depth > 0.0
            assert depth <= known
    assert passed > 20


@pytest.mark.parametrize("r0, r1", [(3.0, 3.0), (2.0, 4.0), (4.0, 2.0), (0.5, 9.0), (5.0, 0.0)])
def test_a_ball_is_as_deep_as_the_deepest_place_in_it(r0, r1):
    """Against many places of the ball at many stands; places that are all passed over are not told."""
    rng = np.random.default_rng(5)
    at, q = np.meshgrid(np.linspace(0, 1, 161), np.linspace(-1, 1, 2001))
    told = 0
    for w, d in moves(60, 12):
        v, clearance = float(rng.uniform(0.05, 1.5)), float(rng.choice([0.0, 0.3]))
        high = w[2] - at * d[2] + v * q
        rho = np.hypot(w[0] - at * d[0], w[1] - at * d[1])
        rho = np.maximum(rho - v * np.sqrt(1.0 - q * q), 0.0)
        met = (high > Z0) & (high < Z1)
        aside = np.where(met, r0 + (r1 - r0) * (high - Z0) / (Z1 - Z0) - rho, -np.inf)
        bare = max(np.minimum(aside - clearance, np.where(met, high - Z0, -np.inf)).max(), 0.0)
        want = clearance + bare if bare > 1e-3 else min(max(aside.max(), 0.0), clearance)
        got = contact_of_ball(*w, *d, Frustum(Z0, Z1, r0, r1), v, clearance, 1e-3, 0.0)
        # half a step of the stands and of the places
        off = (0.5 / 160 * np.linalg.norm(d) + 2e-3 * v) * (1.0 + abs(r1 - r0) / (Z1 - Z0)) + 1e-3
        assert want - 1e-3 <= got + 1e-9 and got <= want + off, (w, d, v)
        told += got > 0.0
        for known in (0.5 * got, got):
            again = contact_of_ball(*w, *d, Frustum(Z0, Z1, r0, r1), v, clearance, 1e-3, known)
            assert again == got or (again == 0.0 and got <= known)
    assert told > 15
