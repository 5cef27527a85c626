"""How much of a cutter is in stock: slots, side cuts, ways through corners, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.pocket_case import OTHER, SETUP, TOOL, block, program, scored, text
from verify.engagement import RESOLUTION, engaged_angles, engagements
from verify.field import run_field, stock_field
from verify.kernels.engaged import sector_bits
from verify.model import FindingKind, ProofSetup, StockKind
from verify.prove import prove
from verify.removal import Moves
from verify.stock import blank, run_stock
from verify.toolaxes import ToolAxes

PART = block()
BLANK = ProofSetup(StockKind.BOX, stock_box=np.array([[-20.0, -15, -10], [20, 15, 0.5]]))


def side_cut(width, depth=2.0, tool=TOOL, cut=0.25, lean=0.0):
    """Angles of moves that take ``width`` off a side of the block, by lines or, where the tool leans, by the field."""
    y = -15.0 - tool.radius + width
    x = np.arange(-24.0, 24.0, cut)
    points = np.column_stack([x, np.full(len(x), y), np.full(len(x), 0.5 - depth)])
    moves = Moves(points[:-1], points[1:], np.ones(len(x) - 1, bool), np.zeros(len(x) - 1, np.int32))
    if lean == 0.0:
        run = run_stock(blank(PART.mesh, BLANK.line_spacing, BLANK), moves, [tool], BLANK)
    else:
        u = np.tile([math.sin(lean), 0.0, math.cos(lean)], (len(moves), 1))
        moves = replace(moves, axes=ToolAxes.between(u, u))
        run = run_field(stock_field(PART.mesh, BLANK, 0.15), moves, [tool], BLANK)
    return engaged_angles(run.engaged, moves, [tool]), moves, tool


@pytest.mark.parametrize("lean", [0.0, 1e-4])
@pytest.mark.parametrize("width", [0.6, 1.0, 2.0, 3.0, 4.0])
def test_a_side_cut_engages_by_its_width(width, lean):
    """A cut of width a engages acos(1 - a / R) of the front half, a slot all of it."""
    angle, moves, tool = side_cut(width, lean=lean)
    inside = np.abs(moves.end[:, 0]) < 15
    exact = math.acos(1.0 - width / tool.radius)
    strip = 0.15 / (tool.radius * max(math.sin(exact), 0.3))  # half of it, and where lines happen to stand
    assert np.abs(angle[inside] - exact).max() <= RESOLUTION + strip
    used = engagements(angle, moves, [tool])[tool.number]
    assert used.p99 <= used.most and abs(used.most - exact) <= RESOLUTION + strip


def test_what_a_finishing_pass_skims_is_no_engagement():
    angle, moves, tool = side_cut(2.0, depth=0.05 * TOOL.radius * 0.9)
    assert not angle.any() and engagements(angle, moves, [tool]) == {}


def test_sectors_are_counted_from_the_left():
    def bits(b, over=5.0, corner=0.0, wide=1e-9):
        return int(sector_bits(0.0, b, 1.0, 0.0, 1.0, over, 2.0, corner, wide))

    assert [bits(b) for b in (1.9999, 1e-6, -1e-6, -1.9999, 2.001)] == [1, 1 << 15, 1 << 16, 1 << 31, 0]
    assert bits(0.0, wide=4.0) == 2**32 - 1 and bits(1.0, wide=2.0) == 2**16 - 1 | 1 << 16
    # under its equator a ball is thinner
    assert bits(1.5, over=0.2, corner=2.0) == 0


def test_a_slot_above_the_limit_is_a_finding_on_its_line():
    lines = program()
    clean = prove([("p", text(lines))], PART, (TOOL, OTHER), SETUP, scored(PART), ("Z1", "Z2"))
    assert clean.clean and clean.engaged[1].most > math.radians(160) and 2 not in clean.engaged
    limited = replace(SETUP, max_engaged={1: math.radians(120), 2: math.radians(10)})
    proof = prove([("p", text(lines))], PART, (TOOL, OTHER), limited, scored(PART), ("Z1", "Z2"))
    assert set(proof.counts) == {"engagement"}
    first = min(f.line for f in proof.findings if f.kind == FindingKind.ENGAGEMENT)
    assert first <= 14 and "limit 120 deg" in proof.findings[0].message


@pytest.mark.parametrize(("turn", "joined"), [(0.0, True), (25.0, True), (40.0, False), (90.0, False)])
def test_sectors_of_a_way_before_a_corner_are_not_put_together_with_those_after_it(turn, joined):
    """The left quarter of the front is met on one short move, the right one on the next."""
    a = math.radians(turn)
    places = np.array([[0.0, 0, 0], [0.2, 0, 0], [0.2 + 0.2 * math.cos(a), 0.2 * math.sin(a), 0]])
    moves = Moves(places[:-1], places[1:], np.ones(2, bool), np.zeros(2, np.int32))
    bits = np.array([0xFF, 0xFF << 24], np.int64)
    quarter, second = engaged_angles(bits, moves, [TOOL])
    assert quarter == pytest.approx(math.pi / 4)
    assert second == pytest.approx(math.pi / 2 if joined else math.pi / 4)
