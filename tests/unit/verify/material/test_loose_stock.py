"""Pieces of stock that are cut off from the rest, on lines and on nodes."""

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh
from verify.assumptions import AssumedKind
from verify.material.loose_stock import loose_assumptions, loose_lines, loose_nodes
from verify.material.stock_field import DistanceField
from verify.material.stock_lines import StockLines
from verify.model import ProofSetup
from verify.moves import Moves

STEP, TOP = 0.25, 6.0
PART = box_mesh([-7.0, -7.0, 0.0], [7.0, 7.0, TOP])
BLANK = np.array([[-15.0, -15.0, 0.0], [15.0, 15.0, TOP]])
JAW = np.array([[-30.0, -5.0, -5.0], [-15.0, 5.0, 3.0]])  # beside the blank from X-15 on
FLAT = ToolBody("T1", 1, 6.0, 0.0, 14.0, 6.0, 14.0, 6.0, 26.0, ())


def standing(*rings):
    """Heights over the square of 30 mm, 0 where a ring (inner and outer half width, what stands in it) was milled."""
    x = np.arange(-15.0 + 0.5 * STEP, 15.0, STEP)
    far = np.maximum(*np.abs(np.meshgrid(x, x, indexing="ij")))
    height = np.full(far.shape, TOP)
    for low, high, left in rings:
        height[(far >= low) & (far <= high)] = left
    return height


def lines(*rings):
    return StockLines(np.array([-15.0, -15.0]), STEP, standing(*rings), 0.0)


def nodes(*rings):
    height = standing(*rings)
    z = np.arange(0.0, TOP + 0.1, STEP)
    values = np.where(z[None, None, :] < height[:, :, None], STEP, -STEP).astype(np.float32)
    return DistanceField(np.array([-15.0 + 0.5 * STEP, -15.0 + 0.5 * STEP, 0.0]), STEP, values)


def loose(stock, fixtures=(), **more):
    setup = ProofSetup(fixtures=tuple(fixtures), **more)
    return (loose_lines if isinstance(stock, StockLines) else loose_nodes)(stock, PART, setup)


@pytest.mark.parametrize("stock", [lines, nodes])
def test_a_slug_is_loose_and_the_frame_is_not(stock):
    for held in ([], [JAW]):
        (slug,) = loose(stock((3.0, 9.0, 0.0)), held)
        assert slug.volume == pytest.approx(6.0 * 6.0 * TOP, rel=0.03)
        np.testing.assert_allclose(slug.middle, [0.0, 0.0, 0.5 * TOP], atol=STEP)


@pytest.mark.parametrize("stock", [lines, nodes])
def test_a_part_that_its_jaw_touches_no_more_is_loose(stock):
    """The jaw touches the blank at X-15; milled away from X-14 on, the part stands before it."""
    (part,) = loose(stock((13.9, 15.0, 0.0)), [JAW], stock_kind="box", stock_box=BLANK)
    assert part.part and part.let_go
    assert not loose(stock((13.9, 15.0, 1.0)), [JAW], stock_kind="box", stock_box=BLANK)  # a floor of 1 mm is left
    assert not loose(stock((13.9, 15.0, 0.0)), [JAW - [5.0, 0.0, 0.0]], stock_kind="box", stock_box=BLANK)


@pytest.mark.parametrize("stock", [lines, nodes])
def test_what_hangs_together_is_held(stock):
    assert loose(stock()) == []
    assert loose(stock((3.0, 9.0, 0.3))) == []  # a floor is left
    tabs = stock((3.0, 9.0, 0.0))
    row = tabs.height if stock is lines else tabs.values
    row[20:100, 58:62] = TOP if stock is lines else STEP
    assert loose(tabs) == []


@pytest.mark.parametrize("stock", [lines, nodes])
def test_chips_are_no_pieces(stock):
    assert loose(stock((0.4, 9.0, 0.0))) == []  # 0.8 mm thick
    assert loose(stock((9.0, 14.6, 0.0)), [JAW]) != []
    assert loose(stock((9.0, 14.6, 0.0))) == []  # a frame of 0.4 mm
    assert len(loose(stock((0.7, 9.0, 0.0)))) == 1


def test_a_flake_is_no_piece():
    flake = standing((3.0, 9.0, 0.0))
    flake[48:72, 48:72] = 0.5
    assert loose(StockLines(np.array([-15.0, -15.0]), STEP, flake, 0.0)) == []


@pytest.mark.parametrize("stock", [lines, nodes])
def test_fixtures_say_which_piece_is_held(stock):
    part, ring = loose(stock((7.0, 9.0, 0.0), (12.0, 12.5, 0.0)), [JAW])
    assert part.part and not ring.part and ring.volume > part.volume
    under = np.array([[-2.0, -2.0, -3.0], [2.0, 2.0, 0.0]])
    assert loose(stock((7.0, 9.0, 0.0)), [JAW, under]) == []
    beside = JAW - [0.2, 0.0, 0.0]
    assert [p.part for p in loose(stock((7.0, 9.0, 0.0)), [beside])] == [True]  # the largest is held


def told(pieces, ways):
    start, end = (np.array([w[k] for w in ways], dtype=np.float64) for k in (0, 1))
    moves = Moves(start, end, np.ones(len(ways), np.bool_), np.zeros(len(ways), np.int32))
    source = SimpleNamespace(line=np.arange(7, 7 + len(ways)), program=np.zeros(len(ways), np.int32), names=("p",))
    return list(loose_assumptions(pieces, moves, np.ones(len(ways), np.bool_), source, [FLAT]))


def test_the_assumption_names_the_line_that_cut_the_piece_off():
    around = [((6, -6, 0), (6, 6, 0)), ((6, 6, 0), (-6, 6, 0)), ((-6, 6, 0), (-6, -6, 0)), ((-6, -6, 0), (6, -6, 0))]
    later = [((-6, -6, 3), (6, -6, 3)), ((13, 13, 0), (13, -13, 0))]
    (a,) = told(loose(lines((3.0, 9.0, 0.0))), [*around, *later])
    assert a.what is AssumedKind.LOOSE_STOCK and "by line 10 of p" in a.value and "216 mm³" in a.value


def test_many_pieces_are_counted():
    grid = standing()
    grid[::20], grid[:, ::20] = 0.0, 0.0
    pieces = loose(StockLines(np.array([-15.0, -15.0]), STEP, grid, 0.0))
    entries = told(pieces, [((0, 0, 0), (1, 0, 0))])
    assert len(pieces) == 35 and len(entries) == 4 and entries[-1].value.endswith("(and 31 more)")
