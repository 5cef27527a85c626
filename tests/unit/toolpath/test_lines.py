"""Lines of tips: what smoothing does to rings, corners and the steps of a lattice."""

import numpy as np
import pytest

from toolpath.lines import smoothed


def test_a_smoothed_ring_stays_closed_and_shrinks_by_the_square_of_the_length():
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    ring = 3.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    ring[-1] = ring[0]
    out = smoothed(ring, 0.3)
    radius = np.hypot(*out.T)
    assert (out[0] == out[-1]).all() and np.ptp(radius) < 1e-3
    assert radius.mean() == pytest.approx(3.0 - 0.3**2 / (2.0 * 3.0), abs=1e-3)


@pytest.mark.parametrize("turn", [0.5, 1.5, 2.5])
def test_a_smoothed_corner_moves_by_the_bound_and_no_place_by_more(turn):
    way = np.array([[-5.0, 0.0], [0.0, 0.0], [5.0 * np.cos(turn), 5.0 * np.sin(turn)]])
    out = smoothed(way, 0.25)
    away = np.hypot(*(out - way[1]).T).min()
    assert away == pytest.approx(0.25 * np.sqrt(2.0 / np.pi) * np.sin(0.5 * turn), rel=0.05)
    assert (out[0] == way[0]).all() and (out[-1] == way[-1]).all()
    before = out[:len(out) // 2]
    assert np.abs(before[before[:, 0] < -1.5][:, 1]).max() < 1e-6  # far from the corner the way stays where it was


def test_smoothing_takes_the_steps_of_a_lattice_out_of_a_line():
    x = np.arange(0.0, 20.0, 0.1)
    stairs = np.column_stack([x, 0.15 * np.round(0.1 * x / 0.15)])
    out = smoothed(stairs, 0.6)
    way = np.diff(out[10:-10], axis=0)
    slope = way[:, 1] / way[:, 0]
    assert np.abs(np.diff(slope)).max() < 0.05 < np.abs(np.diff(np.diff(stairs[:, 1]) / 0.1)).max()


def test_a_way_that_stays_in_one_place_is_given_back():
    assert (smoothed(np.full((4, 2), 1.5), 0.3) == 1.5).all()
