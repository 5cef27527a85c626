"""B-splines in the paper's convention: equation 3, a slow twin of equation 2, fits, closed curves."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.surfaces.bspline import (
    Ends,
    SplineCurve,
    arc_length,
    basis,
    even_errors,
    fit,
    fit_even,
    knot_vector,
    resample,
)

EQUATION_3 = np.array([(100, 0), (196, 34), (281, 102), (346, 199), (383, 321), (385, 459), (350, 606), (274, 751),
                       (156, 886), (0, 1000)], float)


def slow(i: int, k: int, u: float, knots) -> float:
    """Equation 2 as printed, 0/0 = 0; the last span holds its right end."""
    if k == 1:
        last = knots[i + 1] == knots[-1] and u == knots[-1] and knots[i] < knots[i + 1]
        return float(knots[i] <= u < knots[i + 1] or last)
    out = 0.0
    if knots[i + k - 1] > knots[i]:
        out += (u - knots[i]) / (knots[i + k - 1] - knots[i]) * slow(i, k - 1, u, knots)
    if knots[i + k] > knots[i + 1]:
        out += (knots[i + k] - u) / (knots[i + k] - knots[i + 1]) * slow(i + 1, k - 1, u, knots)
    return out


def test_ten_control_points_of_order_five_have_fifteen_open_uniform_knots() -> None:
    knots = knot_vector()
    assert len(knots) == 15
    assert knots == pytest.approx([0] * 5 + [1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6] + [1] * 5)


@pytest.mark.parametrize("u", [0.0, 0.05, 1 / 6, 0.3, 0.5, 0.77, 0.999, 1.0])
def test_basis_is_equation_two(u: float) -> None:
    knots = knot_vector().tolist()
    assert basis([u])[0] == pytest.approx([slow(i, 5, u, knots) for i in range(10)], abs=1e-14)


def test_equation_three_by_hand() -> None:
    """Ends, end tangents 4/(1/6) times the first and last leg, and the middle, where the blending weights are known."""
    curve = SplineCurve(EQUATION_3)
    assert curve.at([0.0, 1.0]) == pytest.approx(EQUATION_3[[0, -1]])
    assert curve.at([0.0, 1.0], 1) == pytest.approx(24 * np.array([[96, 34], [-156, 114]]), rel=1e-9)
    # u = 1/2 is a knot with uniform knots on both sides as far as N_3..N_6 reach: weights (1, 11, 11, 1)/24.
    assert curve.at([0.5])[0] == pytest.approx(np.array([1, 11, 11, 1]) / 24 @ EQUATION_3[3:7])
    u = np.linspace(0, 1, 23)
    knots = knot_vector().tolist()
    by_hand = [sum(slow(i, 5, v, knots) * EQUATION_3[i] for i in range(10)) for v in u]
    assert curve.at(u) == pytest.approx(np.array(by_hand), abs=1e-9)


def test_curvature_is_the_turn_per_length() -> None:
    curve = SplineCurve(EQUATION_3)
    u = np.linspace(0, 1, 20001)
    d = np.diff(curve.at(u), axis=0)
    heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    step = np.linalg.norm(d, axis=1)
    assert (np.diff(heading) / step[1:])[::100] == pytest.approx(curve.curvature(u[1:-1])[::100], rel=1e-3)
    assert (curve.curvature(u) > 0).all()


def test_a_spline_is_its_own_fit_and_ends_are_held_or_free() -> None:
    """Uniform speed: control points of a straight even curve; then noise, which held ends keep and free ones do not."""
    rng = np.random.default_rng(5)
    line = np.column_stack([np.linspace(0, 9, 400), np.zeros(400)])
    assert fit(line).at(np.linspace(0, 1, 400)) == pytest.approx(line, abs=1e-9)
    noisy = np.column_stack([np.linspace(0, 9, 400), rng.normal(size=400) * 1e-3])
    held, free = fit(noisy), fit(noisy, ends=Ends.FREE)
    assert held.control[[0, -1]] == pytest.approx(noisy[[0, -1]])
    assert abs(free.control[0, 1]) < abs(noisy[0, 1]) or abs(free.control[-1, 1]) < abs(noisy[-1, 1])
    u = arc_length(noisy) / arc_length(noisy)[-1]
    residual = lambda c: float(((c.at(u) - noisy) ** 2).sum())  # noqa: E731
    assert residual(free) <= residual(held)


def test_a_fit_has_no_better_neighbour() -> None:
    """Least squares: moving any control point of the fit makes the residual worse."""
    x = np.linspace(0, 2, 300)
    p = np.column_stack([x, np.sin(4 * x)])
    for curve in (fit(p, ends=Ends.FREE), fit(p)):
        u = arc_length(p) / arc_length(p)[-1]
        best = ((curve.at(u) - p) ** 2).sum()
        for i in range(1, 9):
            for step in ([1e-3, 0], [-1e-3, 0], [0, 1e-3], [0, -1e-3]):
                moved = curve.control.copy()
                moved[i] += step
                assert ((SplineCurve(moved).at(u) - p) ** 2).sum() > best


def test_even_fit_is_the_same_fit() -> None:
    x = np.linspace(0, 2, 1000)
    p = resample(np.column_stack([x, np.sin(4 * x)]), 256)
    curve, left = fit_even(p, 14)
    # Chords of the resampled points differ a little in length; the parameters of ``fit`` follow them.
    assert curve.control == pytest.approx(fit(p, 14, ends=Ends.FREE).control, abs=2e-3)
    assert left == pytest.approx(np.sqrt(((curve.at(np.linspace(0, 1, 256)) - p) ** 2).sum() / 256))


@pytest.mark.parametrize("closed", [False, True])
def test_errors_of_the_even_fit_are_those_noise_makes(closed: bool) -> None:
    """At single places, three times as much at the ends of an open curve, and of a height over a chord."""
    rows = even_errors(128, 12, closed, 40)
    weights = np.vstack([np.eye(41), np.eye(41)[20] - 0.5 * (np.eye(41)[12] + np.eye(41)[28])])
    rng, at = np.random.default_rng(1), np.linspace(0, 1, 41)
    found = np.array([weights @ fit_even(rng.normal(size=(128, 2)), 12, closed)[0].at(at) for _ in range(1500)])
    assert np.linalg.norm(weights @ rows, axis=1) == pytest.approx(np.sqrt((found**2).mean(axis=(0, 2))), rel=0.08)
    single = np.linalg.norm(rows, axis=1)
    assert single[0] == pytest.approx(single[-1])
    assert (single[0] > 2.5 * single[20]) == (not closed)


def test_closed_curves_have_no_seam() -> None:
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    for curve in (fit(circle, closed=True), fit_even(circle, 10, closed=True)[0]):
        for r in range(4):
            assert curve.at([0.0], r) == pytest.approx(curve.at([1.0], r), abs=1e-8)
        assert np.linalg.norm(curve.at(np.linspace(0, 1, 77)), axis=1) == pytest.approx(1.0, abs=1e-3)
        assert curve.curvature(np.linspace(0, 1, 77)) == pytest.approx(1.0, abs=0.01)
    # Starting elsewhere on the ring, by a whole number of control points, moves the control points along.
    moved = fit(np.roll(circle, -20, axis=0), closed=True)
    assert moved.control == pytest.approx(np.roll(fit(circle, closed=True).control, -1, axis=0), abs=1e-9)


def test_resampled_points_are_evenly_spaced() -> None:
    corner = [(0, 0), (3, 0), (3, 1)]
    assert resample(corner, 5) == pytest.approx(np.array([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)], float))
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    assert resample(square, 8, closed=True)[[1, 3, 7]] == pytest.approx(np.array([(0.5, 0), (1, 0.5), (0, 0.5)]))


@pytest.mark.parametrize("call", [
    lambda: fit([(1, 1), (1, 1)]), lambda: fit([(0, 0), (np.nan, 1)]), lambda: fit([(0, 0, 0), (1, 1, 1)]),
    lambda: knot_vector(4, 5), lambda: knot_vector(4, 1), lambda: resample(np.zeros((0, 2)), 10),
])
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(GeometryError):
        call()
