"""Grids on four-sided regions: Laplace's equation and moving fronts (papers/000 with its errata)."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.parameterization.laplace_grid import laplace
from geometry.parameterization.moving_fronts import correction, interpolated
from geometry.parameterization.quad_grid import Quad, areas, coons, even, evenness, folds
from tests.square_regions import quad, region


def exponential(n):
    """u + iv = exp(xi + i eta), which is harmonic both ways."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    w = np.exp(x + 1j * y)
    return np.stack([w.real, w.imag], axis=-1)


def test_laplace_finds_a_harmonic_map_to_second_order():
    off = []
    for n in (11, 21, 41):
        true = exponential(n)
        grid, rounds = laplace(Quad(true[0].copy(), true[-1].copy(), true[:, 0].copy(), true[:, -1].copy()))
        off.append(np.abs(grid - true).max())
        assert rounds < 20
    assert off[2] < 2e-4 and np.log2(off[0] / off[1]) > 1.8 and np.log2(off[1] / off[2]) > 1.8


def test_the_correction_is_that_of_the_paper():
    got = correction(np.array([0, 0.5, 1, 1.5, 2]) * np.pi)
    np.testing.assert_allclose(got, [1.9528, 1.7122, 1.0, 0.5459, 0.4000], atol=5e-5)
    slope = (correction(np.array([np.pi + 1e-5])) - correction(np.array([np.pi - 1e-5]))) / 2e-5
    assert slope[0] == pytest.approx(-0.514, abs=1e-3)


@pytest.mark.parametrize("n, m", [(41, 31), (41, 30), (81, 31), (7, 4), (7, 3)])
def test_both_keep_the_sides_and_fronts_are_the_evener(n, m):
    for name in "AM":
        q = quad(name, n, m)
        fronts, (harmonic, _) = interpolated(q), laplace(q)
        for grid in (fronts, harmonic):
            for got, want in ((grid[0], q.bottom), (grid[-1], q.top), (grid[:, 0], q.left), (grid[:, -1], q.right)):
                np.testing.assert_allclose(got, want, atol=1e-12)
        if n > 7:
            assert folds(fronts) == folds(harmonic) == 0
            assert evenness(fronts)[0] < evenness(harmonic)[0] and evenness(fronts)[1] < evenness(harmonic)[1]
            assert areas(fronts).sum() == pytest.approx(areas(harmonic).sum(), rel=1e-9)


def test_a_step_folds_both_and_it_is_counted():
    q = quad("B", 41, 31)
    grids = {"Laplace": laplace(q)[0], "fronts": interpolated(q)}
    assert all(folds(g) > 0 for g in grids.values()), {k: folds(g) for k, g in grids.items()}
    assert all(evenness(g) == (np.inf, np.inf) for g in grids.values())


@pytest.mark.parametrize("make", [lambda q: laplace(q)[0], interpolated, coons])
def test_motion_and_size_of_the_region_change_nothing(make):
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    base = make(quad("M", 31, 21))
    moved = make(Quad.of(tuple(130.0 * s @ turn.T + [5.0, -90.0] for s in region(0.2, -0.17)), 31, 21))
    np.testing.assert_allclose(moved, 130.0 * base @ turn.T + [5.0, -90.0], atol=1e-6)


def test_the_middle_front_is_met_from_both_sides():
    """Upside down it is the same grid upside down: neither front is preferred."""
    for m in (30, 31):
        bottom, right, top, left = region(0.2, -0.17)
        base = interpolated(Quad.of((bottom, right, top, left), 41, m))
        over = interpolated(Quad.of((top, left, bottom, right), 41, m))
        np.testing.assert_allclose(over[::-1, ::-1], base, atol=1e-9)


def test_folds_are_counted_by_cells():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1)
    assert folds(grid) == 0 and evenness(grid) == (1.0, 1.0) and areas(grid).sum() == 12.0
    grid[1, 2, 0] = 3.5  # past its neighbour to the right
    assert folds(grid) == 2
    assert folds(grid[:, ::-1]) == 12


def test_sides_that_do_not_meet_are_refused():
    bottom, right, top, left = region(0.0, 0.0)
    with pytest.raises(GeometryError) as caught:
        Quad.of((bottom, right + [0.1, 0.0], top, left), 11, 11)
    assert caught.value.code == "bad_quad" and caught.value.subjects == ("side 1",)
    with pytest.raises(GeometryError):
        Quad.of((bottom, right, top, np.repeat(left[:1], 5, axis=0)), 11, 11)


def test_places_at_even_distances():
    line = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
    np.testing.assert_allclose(even(line, 5), [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1]], atol=1e-12)
