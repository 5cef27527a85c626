"""Plunges of an end of 0.1 mm, whatever the spacing of the stock: along its axis, exactly."""

import numpy as np
import pytest

from tests.hand_parts import tool
from verify.kernels.stock import PLUNGE
from verify.material.fine_plunges import fine_plunges
from verify.model import ProofSetup
from verify.moves import Moves
from verify.tool_axes import ToolAxes

FINE, WIDE = tool(0.1, 0.0, "T1"), tool(4.0, 0.0, "T2")
BOX = np.array([[0.0, 0.0, -5.0], [20.0, 20.0, 0.0]])
SETUP = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0)
SKIN = 0.01


def dug(points, tools=None, feed=True, axes=False, setup=SETUP, fine=(FINE,), hollow=()):
    """Depth by move of what a path through (n, 3) points digs; tools: index of the tool of each move."""
    points = np.array(points, dtype=float)
    n = len(points) - 1
    which = np.zeros(n, np.int32) if tools is None else np.array(tools, np.int32)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    moves = Moves(points[:-1].copy(), points[1:].copy(), np.full(n, feed), which,
                  ToolAxes.between(up, up) if axes else None)
    events = fine_plunges(moves, [FINE, WIDE], fine, BOX, setup, hollow=hollow)
    assert (events[:, 1] == PLUNGE).all()
    return dict(zip(events[:, 0].astype(int).tolist(), events[:, 2].tolist(), strict=True))


@pytest.mark.parametrize("axes", [False, True])
def test_a_descent_is_as_deep_as_the_stock_over_its_end(axes):
    found = dug([[3.217, 4.119, 2.0], [3.217, 4.119, -0.3], [3.217, 4.119, 2.0]], axes=axes)
    assert found == {0: pytest.approx(0.8, abs=0.8 / 4096)}


def test_a_ramp_and_what_a_wider_tool_has_cleared_are_none():
    ramp = [[3.0, 3.0, 0.5], [13.0, 3.0, 0.1], [3.0, 3.0, -0.3]]
    assert dug(ramp) == {}
    slot = [[2.0, 8.0, 0.0], [18.0, 8.0, 0.0], [18.0, 8.0, 3.0], [9.0, 8.0, 3.0], [9.0, 8.0, -0.005]]
    assert dug(slot, [1, 1, 1, 0]) == {}
    assert dug([*slot[:-1], [9.0, 8.0, -0.2]], [1, 1, 1, 0]) == {3: pytest.approx(0.2, abs=1e-3)}


def test_many_small_steps_are_one_descent():
    steps = [[5.0, 5.0, 0.5 - 0.004 * k] for k in range(60)]
    found = dug(steps)
    assert found and min(found.values()) == pytest.approx(3.0 * SKIN)
    # each step with a way aside that earns it
    aside = [p for k in range(12) for p in ([5.0, 5.0, 0.5 - 0.004 * k], [5.3, 5.0, 0.5 - 0.004 * k],
                                            [5.0, 5.0, 0.5 - 0.004 * k])]
    assert dug(aside) == {}


def test_rapids_and_other_tools_are_not_looked_at():
    straight = [[3.0, 4.0, 2.0], [3.0, 4.0, -0.3]]
    assert dug(straight, feed=False) == {} and dug(straight, [1]) == {}


@pytest.mark.parametrize("axes", [False, True])
def test_a_core_that_goes_straight_down(axes):
    setup = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, cores={1: 0.2})
    straight = [[9.0, 9.0, 2.0], [9.0, 9.0, 0.4], [9.0, 9.0, 2.0]]
    assert dug(straight, [1, 1], axes=axes, setup=setup, fine=()) == {}
    found = dug(straight, [1, 1], axes=axes, setup=setup, fine=(), hollow=(WIDE,))
    assert found == {0: pytest.approx(0.1, abs=1e-3)}
    shallow = [[9.0, 9.0, 2.0], [9.0, 9.0, 0.47]]
    assert dug(shallow, [1], axes=axes, setup=setup, fine=(), hollow=(WIDE,)) == {}
    steep = [[9.0, 9.0, 0.5], [9.5, 9.0, 0.4]]  # no way straight down: lines judge it
    assert dug(steep, [1], axes=axes, setup=setup, fine=(), hollow=(WIDE,)) == {}
