"""A tool that leaves along its axis asks for no clearance, also where its program has three decimals."""

import numpy as np
import pytest

from verify.kernels.clash import is_lift
from verify.material.stock_pass import free_rapids
from verify.moves import Moves

AXIS = np.array([np.sin(0.7) * np.cos(0.3), np.sin(0.7) * np.sin(0.3), np.cos(0.7)])
START = np.array([1.234, -5.678, 9.012])


@pytest.mark.parametrize("decimals", [3, 4, 9])
def test_a_lift_of_rounded_coordinates_is_straight(decimals):
    for length in (0.05, 1.0, 15.0, 120.0):
        assert is_lift(0.0, AXIS, START, np.round(START + length * AXIS, decimals))


def test_what_goes_aside_down_or_turns_is_no_lift():
    aside = np.cross(AXIS, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    assert not is_lift(0.0, AXIS, START, START + 15.0 * AXIS + 0.006 * aside)
    assert not is_lift(0.0, AXIS, START, START - 0.5 * AXIS)
    assert not is_lift(0.01, AXIS, START, START + 15.0 * AXIS)


def _chain(*places, feed):
    """Moves from place to place; None is a way nobody wrote down."""
    pairs = [(a, b) for a, b in zip(places[:-1], places[1:], strict=True) if a is not None and b is not None]
    return Moves(np.array([a for a, _ in pairs], float), np.array([b for _, b in pairs], float), np.array(feed),
                 np.zeros(len(pairs), np.int32))


def test_a_peck_goes_back_into_its_own_hole_alone():
    up, deep, high = (0, 0, 1), (0, 0, -5), (0, 0, 20)
    pecks = _chain(up, deep, up, (0, 0, -4.5), deep, high, feed=[True, False, False, True, False])
    assert free_rapids(pecks).tolist() == [False, True, True, False, True]
    beside = _chain(up, deep, high, (23, 0, 20), (23, 0, -3), feed=[True, False, False, False])
    assert free_rapids(beside).tolist() == [False, True, False, False]


@pytest.mark.parametrize("pause", [[], [(23, 0, 20)]])
def test_a_way_by_the_machines_own_zero_is_no_way_back(pause):
    """What comes down beside the hole after G28 asks for its clearance, with or without a row that does not move."""
    home = [(0, 0, 1), (0, 0, -5), (0, 0, 20), None, *pause, (23, 0, 20), (23, 0, -3)]
    moves = _chain(*home, feed=[True, False, *[False] * len(pause), False])
    assert not free_rapids(moves)[-1]
