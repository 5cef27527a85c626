"""How wide a holder may be, against a twin that stands the axis at many places of each move."""

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import terraces
from verify.kernels.free_width import beside_box
from verify.material.free_width import LARGEST, free_holder_width
from verify.model import ProofSetup, StockKind
from verify.moves import Moves

TOOL = ToolBody("T1", 1, 6.0, 0.0, 10.0, 6.0, 10.0, 6.0, 15.0)
WALL = terraces([0.0, 30.0, 40.0], [0.0, 30.0], [[10.0, 60.0]])
"""A floor at Z10 and a wall from X30 to X40 up to Z60, 30 mm wide in Y."""
SETUP = ProofSetup(stock_kind=StockKind.PART_OFFSET, margin=0.0, uncertainty=0.0)


def moves_of(*places, feed=True):
    p = np.array(places, float)
    return Moves(p[:-1], p[1:], np.full(len(p) - 1, feed), np.zeros(len(p) - 1, np.int32))


def twin(moves, boxes, stickout):
    """Least distance in plan from the axis to boxes that stand higher than the stickout."""
    least = LARGEST
    for a, b in zip(moves.start, moves.end, strict=True):
        tips = a + np.linspace(0, 1, 4001)[:, None] * (b - a)
        for low, high in boxes:
            off = np.maximum(np.maximum(low[:2] - tips[:, :2], tips[:, :2] - high[:2]), 0.0)
            off = np.hypot(off[:, 0], off[:, 1])[tips[:, 2] + stickout < high[2]]
            least = min(least, float(off.min(initial=np.inf)))
    return 2.0 * least


@pytest.mark.parametrize("seed", range(4))
def test_the_free_width_is_that_of_many_places(seed):
    rng = np.random.default_rng(seed)
    moves = moves_of(*rng.uniform([0, 2, 12], [24, 28, 50], (8, 3)))
    fixture = np.array([[-20.0, 5, 0], [-8, 15, 50]])
    setup = ProofSetup(**{**SETUP.__dict__, "fixtures": (fixture,)})
    want = twin(moves, [(np.array([30.0, 0, 0]), np.array([40.0, 30, 60])), fixture], TOOL.stickout)
    (free, _), = free_holder_width(WALL, moves, [TOOL], setup, 1).values()
    assert want - 0.75 <= free <= want + 1e-6


def test_stock_that_is_gone_leaves_room_and_what_stands_does_not():
    setup = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0)
    layers = [(x, 15.0, z) for z in (52.0, 44.0, 36.0) for x in ((-5.0, 20.0) if z != 44.0 else (20.0, -5.0))]
    free, m = free_holder_width(WALL, moves_of(*layers), [TOOL], setup, 1)[0]
    # the slot is 6 mm wide: its walls, 3 mm from the axis, are higher than 15 mm over the tip from Z44 on
    assert 6.0 - 0.75 <= free <= 6.0 and m in (1, 2)
    high, m = free_holder_width(WALL, moves_of((-5, 15, 50), (20, 15, 50)), [TOOL], setup, 1)[0]
    assert high == 2.0 * LARGEST and m == -1


def test_a_tool_with_a_holder_is_not_asked():
    held = ToolBody("T2", 2, 6.0, 0.0, 10.0, 6.0, 10.0, 6.0, 15.0, (HolderFrustum(20.0, 20.0, 30.0),))
    assert free_holder_width(WALL, moves_of((10, 10, 12), (20, 10, 12)), [held], SETUP, 1) == {}


def test_beside_a_box():
    rng, box = np.random.default_rng(8), np.array([[0.0, 0, 0], [4, 3, 10]])
    for _ in range(200):
        a, b = rng.uniform(-8, 12, (2, 3))
        moves = moves_of(a, b)
        want = 0.5 * twin(moves, [box], 2.0)
        got = min(beside_box(tuple(a), tuple(b - a), 2.0, box), LARGEST)
        assert got == pytest.approx(want, abs=0.01)
