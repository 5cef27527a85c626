"""A tool that leaves along its axis asks for no clearance, also where its program has three decimals."""

import numpy as np
import pytest

from verify.kernels.clash import is_lift

AXIS = np.array([np.sin(0.7) * np.cos(0.3), np.sin(0.7) * np.sin(0.3), np.cos(0.7)])
START = np.array([1.234, -5.678, 9.012])


@pytest.mark.parametrize("decimals", [3, 4, 9])
def test_a_lift_of_rounded_coordinates_is_straight(decimals):
    for length in (0.05, 1.0, 15.0, 120.0):
        assert is_lift(0.0, AXIS, START, np.round(START + length * AXIS, decimals))


def test_what_goes_aside_down_or_turns_is_no_lift():
    aside = np.cross(AXIS, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    assert not is_lift(0.0, AXIS, START, START + 15.0 * AXIS + 0.003 * aside)
    assert not is_lift(0.0, AXIS, START, START - 0.5 * AXIS)
    assert not is_lift(0.01, AXIS, START, START + 15.0 * AXIS)
