"""What the witness says is left of simple blanks, against closed forms, and how its errors fall."""

from __future__ import annotations

import numpy as np
import pytest

from tests.machined_cases import BOX, CASES, mill, path
from tests.oracle.turning_twin import least_left
from tests.oracle.turning_twin import random_rays as rays
from verify.surface.removal import residual_on_normals

STEPS = np.array([0.8, 0.4, 0.2])
SHIFTS = np.random.default_rng(1).uniform(0.0, 1.0, (4, 3))  # wherever the lattice falls


def slope_of(sizes, errors):
    """Exponent of the power law through the errors, by least squares in the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


@pytest.mark.parametrize("name", CASES)
def test_volume_and_surface_converge_within_their_bounds(name):
    case = CASES[name]()
    off, mean = np.zeros((len(STEPS), len(SHIFTS))), np.zeros((len(STEPS), len(SHIFTS)))
    for i, step in enumerate(STEPS.tolist()):
        for k, shift in enumerate(SHIFTS):
            field = case.field(step, shift)
            off[i, k] = field.volume - case.volume
            surface = field.surface()
            apart = np.abs(case.distance(surface.vertices))
            mean[i, k] = apart.mean()
            assert apart.max() <= step
            assert surface.volume == pytest.approx(field.volume, abs=2.0 * case.volume_bound(step))
        assert np.abs(off[i]).max() <= case.volume_bound(step)
    assert slope_of(STEPS, np.sqrt((off**2).mean(axis=1))) > 1.5
    assert slope_of(STEPS, mean.mean(axis=1)) > 1.5


def near_cut(case, count, rng):
    """Places of the stock a little off the cut, how far, and the directions in which they are that far from it."""
    p = rng.uniform(BOX[0], BOX[1], (40 * count, 3))
    off = case.cut(p)
    chosen = np.flatnonzero((off > 0.02) & (off < 0.6) & (case.whole(p) > 0.0))[:count]
    p, e = p[chosen], 1e-5
    slope = np.stack([case.cut(p + d) - case.cut(p - d) for d in e * np.eye(3)], 1)
    return p, off[chosen], -slope / np.linalg.norm(slope, axis=1)[:, None]


@pytest.mark.parametrize("name", CASES)
def test_residuals_are_exact_along_given_normals(name):
    case = CASES[name]()
    p, off, normal = near_cut(case, 400, np.random.default_rng(2))
    assert len(p) > 100
    left, mover = residual_on_normals(p, normal, np.full(len(p), 5.0), case.moves, [case.tool])
    assert (mover >= 0).all()
    assert np.abs(left - off).max() <= case.residual_bound


def test_residuals_of_a_turning_move_converge_with_the_bow_allowed():
    """A leaning flank that turns by a radian while it goes 8 mm: the error is a share of ``bow`` at every size."""
    tool = mill(6.0, 1.0)
    moves = path([[-4, 0, 0], [4, 1, 0.5]], [[np.sin(-0.5), 0, np.cos(-0.5)], [0, np.sin(0.5), np.cos(0.5)]])
    p, normal = rays(moves, tool, 300, np.random.default_rng(3))
    exact = least_left(p, normal, moves, tool, 4.0)
    bows = np.array([0.02, 0.01, 0.005, 0.002, 0.001])
    mean = []
    for bow in bows.tolist():
        left, _ = residual_on_normals(p, normal, np.full(len(p), 4.0), moves, [tool], bow=bow)
        assert np.abs(left - exact).max() <= bow
        mean.append(float(np.abs(left - exact).mean()))
    assert slope_of(bows, mean) == pytest.approx(1.0, abs=0.2)
