"""Snap rounding: pixels, crossings, what is refused, and crossings that floating point would miss."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from geometry.errors import GeometryError, InputError
from tests.noded_segments import sources_of, take_noded
from zones.kernels.trapezoid import LIMIT
from zones.plan_view import snap_rounding as module
from zones.plan_view.snap_rounding import crossing_pixel, node_segments, runs_through
from zones.plan_view.trapezoidal_map import TrapezoidMap

CROSS = np.array([[[0.0, 0.0], [10.0, 10.0]], [[0.0, 10.0], [10.0, 0.0]]])


def in_pixel(segment, pixel):
    """Whether some t in [0, 1] has p + t d in [c - 1/2, c + 1/2) in x and y, by intersecting ranges of t."""
    low, low_open, high, high_open = Fraction(0), False, Fraction(1), False
    for k in (0, 1):
        p, d = segment[0][k], segment[1][k] - segment[0][k]
        a, b = Fraction(2 * pixel[k] - 1, 2), Fraction(2 * pixel[k] + 1, 2)
        if d == 0:
            if not a <= p < b:
                return False
            continue
        start, end = ((a - p) / d, (b - p) / d) if d > 0 else ((b - p) / d, (a - p) / d)
        start_open, end_open = d < 0, d > 0
        low, low_open = max((low, low_open), (start, start_open))
        high, high_open = min((high, not high_open), (end, not end_open))
        high_open = not high_open
    return low < high or (low == high and not low_open and not high_open)


def test_pixels_a_segment_runs_through():
    rng = np.random.default_rng(0)
    segments, pixels = rng.integers(-4, 5, (4000, 2, 2)), rng.integers(-4, 5, (4000, 2))
    keep = (segments[:, 0] != segments[:, 1]).any(axis=1)
    segments, pixels = segments[keep], pixels[keep]
    expected = [in_pixel(s, c) for s, c in zip(segments.tolist(), pixels.tolist(), strict=True)]
    assert runs_through(segments, pixels).tolist() == expected
    assert 0.05 < np.mean(expected) < 0.95


def test_every_place_is_in_one_pixel():
    """A diagonal through corners goes through the pixels of the diagonal, or of one side of it, never both."""
    centres = np.array([[0, 0], [1, 1], [0, 1], [1, 0]])
    falling = np.tile([[-1, 2], [2, -1]], (4, 1, 1))
    rising = np.tile([[-1, -1], [2, 2]], (4, 1, 1))
    assert runs_through(falling, centres).tolist() == [False, True, True, True]
    assert runs_through(rising, centres).tolist() == [True, True, False, False]


@pytest.mark.parametrize(("s", "t", "pixel"), [
    ([[0, 0], [4, 4]], [[0, 4], [4, 0]], (2, 2)),
    ([[0, 0], [1, 1]], [[0, 1], [1, 0]], (1, 1)),  # at (1/2, 1/2): halves go up
    ([[0, 0], [-1, -1]], [[0, -1], [-1, 0]], (0, 0)),
    ([[0, 0], [4, 4]], [[1, 1], [9, 0]], (1, 1)),
    ([[0, 0], [4, 4]], [[5, 0], [9, 0]], None),
    ([[0, 0], [4, 4]], [[1, 1], [2, 2]], None),
    ([[-LIMIT, -LIMIT], [LIMIT, LIMIT - 1]], [[-LIMIT, LIMIT], [LIMIT, -LIMIT]], (0, 0)),
])
def test_pixel_of_a_crossing(s, t, pixel):
    assert crossing_pixel(s, t) == pixel == crossing_pixel(t[::-1], s)


def test_a_crossing_that_was_missed_is_found_by_the_map(monkeypatch):
    rng = np.random.default_rng(2)
    segments = rng.uniform(-5, 5, (9, 2, 2))
    whole = TrapezoidMap.of(segments).faces()
    assert len(whole.areas) > 3
    monkeypatch.setattr(module, "_vertices", lambda lines: np.zeros((0, 2), np.int64))
    assert np.array_equal(TrapezoidMap.of(segments).faces().doubled, whole.doubled)


@pytest.mark.parametrize("segments", [
    CROSS,
    [[[0, 0], [4, 0]], [[2, 0], [2, 3]]],
    [[[0, 0], [4, 0]], [[2, -3], [2, 0]]],
    [[[0, 0], [0, 4]], [[0, 2], [3, 2]]],
    [[[0, 0], [4, 0]], [[1, 0], [6, 0]]],
    [[[0, 0], [4, 4]], [[0, 0], [2, 2]]],
    [[[0, 0], [0, 4]], [[0, 1], [0, 3]]],
])
@pytest.mark.parametrize("seed", range(4))
def test_pieces_that_meet_beside_their_ends_are_refused(segments, seed):
    with pytest.raises(GeometryError) as e:
        TrapezoidMap.of_noding(take_noded(segments, 1.0), seed=seed)
    assert e.value.code == "not_noded" and set(e.value.subjects) == {"0", "1"} and e.value.remedy


@pytest.mark.parametrize(("segments", "options", "code"), [
    ([[[0, 0], [np.nan, 1]]], {}, "not_finite"),
    ([[[0, 0], [np.inf, 1]]], {}, "not_finite"),
    ([[0, 0, 1, 1]], {}, "bad_segments"),
    ([[["a", 0], [1, 1]]], {}, "bad_segments"),
    (CROSS, {"grid": 0.0}, "bad_grid"),
    (CROSS, {"grid": np.nan}, "bad_grid"),
    (CROSS, {"grid": 1e-7}, "out_of_bounds"),
    (CROSS * 1e300, {}, "out_of_bounds"),
    (CROSS, {"margin": 0.0}, "bad_margin"),
    (CROSS, {"margin": 1e9}, "out_of_bounds"),
    (CROSS, {"margin": np.inf}, "bad_margin"),
])
def test_what_is_refused(segments, options, code):
    with pytest.raises(InputError) as e:
        TrapezoidMap.of(segments, **options)
    assert e.value.code == code and e.value.remedy


def test_places_that_are_no_numbers_are_refused_and_far_ones_are_outside():
    plan = TrapezoidMap.of(CROSS)
    with pytest.raises(InputError) as e:
        plan.locate([[0.0, np.nan]])
    assert e.value.code == "not_finite" and e.value.subjects == ("0",)
    assert plan.locate([[1e300, 0.0], [-1e300, 0.0], [0.0, 1e9], [5.0, 6.0]]).tolist()[:3] == [-1, -1, -1]
    assert plan.locate([]).shape == (0,)


def test_no_segments_and_dots_leave_the_box():
    for segments in ([], [[[3.0, 3.0], [3.0, 3.0]]], [[[3.0, 3.0], [3.0002, 3.0]]]):
        plan = TrapezoidMap.of(segments, margin=2.0)
        assert plan.faces().areas.tolist() == pytest.approx([16.0]) and len(plan.top) == 1


def test_a_piece_of_several_segments_names_them_all():
    plan = TrapezoidMap.of([[[0, 0], [4, 0]], [[6, 0], [2, 0]], [[2, 0], [4, 0]], [[9, 9], [9, 9]]])
    named = {tuple((plan.points[plan.pieces[k]] * 1e-3)[:, 0].round(6)): sources_of(plan, k) for k in range(3)}
    assert named == {(0.0, 2.0): [0], (2.0, 4.0): [0, 1, 2], (4.0, 6.0): [1]}
    assert node_segments(CROSS, 1e-3).pieces.shape == (4, 2)
