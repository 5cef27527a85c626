"""How much of a cutter is in stock: slots, side cuts, ways through corners, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from tests.pocket_case import OTHER, SETUP, TOOL, block, program, scored, text
from verify.kernels.engaged import SECTORS, sector_bits
from verify.material.engagement import RESOLUTION, engaged_angles, engagements, in_parts
from verify.material.stock_field import run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.model import FindingKind, ProofSetup, StockKind
from verify.moves import Moves
from verify.prove import prove
from verify.tool_axes import ToolAxes

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
    parts, _ = in_parts(moves, [tool])
    return engaged_angles(run.engaged, parts, [tool]), parts, tool


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


def test_sectors_are_counted_all_round_from_x():
    def bits(b, over=5.0, corner=0.0, wide=1e-9, way=(1.0, 0.0), twist=0.0):
        dx, dy = way
        cutter = CutterSizes(2.0, corner, 9.0)
        return int(sector_bits(-b * dy, b * dx, dx, dy, 1.0, over, cutter, wide, twist)) & 2**64 - 1

    assert [bits(b) for b in (1.9999, 1e-6, -1e-6, -1.9999, 2.001)] == [1 << 15, 1, 1 << 63, 1 << 48, 0]
    assert bits(1e-6, way=(0.0, 1.0)) == bits(1e-6, twist=0.5 * math.pi) == 1 << 16
    assert bits(0.0, wide=4.0) == (2**16 - 1) | (2**64 - 2**48) | 1 << 16
    assert bits(1.0, wide=0.5) == sum(1 << k for k in range(3, 7))
    assert bits(1.0, wide=1.1) == sum(1 << k for k in range(2, 17))
    # under its equator a ball is thinner
    assert bits(1.5, over=0.2, corner=2.0) == 0


def slot(points, tool, depth=3.0, lean=0.0):
    """Engaged angles along a way (n, 2) through the block, ``depth`` mm deep, where all of the cutter is in it."""
    points = np.column_stack([points, np.full(len(points), 0.5 - depth)])
    moves = Moves(points[:-1], points[1:], np.ones(len(points) - 1, bool), np.zeros(len(points) - 1, np.int32))
    if lean == 0.0:
        run = run_stock(blank(PART.mesh, 0.15 * tool.radius, BLANK), moves, [tool], BLANK)
    else:
        u = np.tile([math.sin(lean), 0.0, math.cos(lean)], (len(moves), 1))
        moves = replace(moves, axes=ToolAxes.between(u, u))
        run = run_field(stock_field(PART.mesh, BLANK, 0.15), moves, [tool], BLANK)
    parts, _ = in_parts(moves, [tool])
    inside = np.all([(np.abs(p[:, :2]) < [14.0, 9.0]).all(axis=1) for p in (parts.start, parts.end)], axis=0)
    return engaged_angles(run.engaged, parts, [tool])[inside]


def straight(cut, jog=0.0):
    x = np.arange(-24.0, -24.0 + 30.0 + 1e-9, cut)
    return np.column_stack([x, jog * (np.arange(len(x)) % 2)])


def stairs(cut):
    k = np.arange(int(28.0 / cut) + 1)
    return np.column_stack([-18.0 + cut * ((k + 1) // 2), -13.0 + cut * (k // 2)])


BALL = replace(TOOL, corner_radius=TOOL.radius)


UPRIGHT = [(tool, depth, cut, 0.0) for tool, depth in ((TOOL, 3.0), (TOOL, 0.3), (BALL, 1.2))
           for cut in (30.0, 0.5, 0.1, 0.02)]
ON_THE_GRID = [(tool, depth, cut, 1e-4) for tool, depth in ((TOOL, 3.0), (BALL, 1.2)) for cut in (30.0, 0.5, 0.1)]


@pytest.mark.parametrize(("tool", "depth", "cut", "lean"), [*UPRIGHT, *ON_THE_GRID])
def test_a_slot_is_a_slot_however_it_is_cut_into_moves(tool, depth, cut, lean):
    """All of the front of a flat is in a slot, and of a ball all but where it is no deeper in than r / 20."""
    angle = slot(straight(cut), tool, depth, lean)
    assert np.quantile(angle[angle > 0.0], 0.1) >= math.radians(170 if tool is TOOL else 130)


@pytest.mark.parametrize("tool", [TOOL, BALL])
def test_turns_that_are_but_steps_of_one_way_hide_nothing(tool):
    for way in (straight(0.02, jog=5e-4), stairs(0.05), stairs(0.02), np.repeat(straight(0.1), 2, axis=0)):
        angle = slot(way, tool, 1.2)
        assert np.quantile(angle[angle > 0.0], 0.1) >= math.radians(150 if tool is TOOL else 125)


def test_what_lies_behind_after_a_corner_is_not_in_front():
    """The tool goes along a side 1 mm in, and turns off it: no more than the side it goes along is in stock."""
    y = -15.0 - TOOL.radius + 1.0
    way = np.array([[-24.0, y], [0.0, y], [0.0, y - 0.2], [0.0, y - 2.0]])
    moves = Moves(np.column_stack([way[:-1], np.full(3, -2.5)]), np.column_stack([way[1:], np.full(3, -2.5)]),
                  np.ones(3, bool), np.zeros(3, np.int32))
    parts, of = in_parts(moves, [TOOL])
    angle = engaged_angles(run_stock(blank(PART.mesh, 0.15, BLANK), moves, [TOOL], BLANK).engaged, parts, [TOOL])
    side = angle[(of == 0) & (parts.start[:, 0] > -18.0)]
    assert side == pytest.approx(math.acos(1.0 - 1.0 / TOOL.radius), abs=RESOLUTION + 0.1)
    assert (angle[of > 0] <= side.max()).all()


def test_what_is_met_at_one_end_of_a_long_move_does_not_count_at_the_other():
    """Along a side, 1 mm in, round the block in air, and across it from one side to the other in one move."""
    tool, y = TOOL, -15.0 - TOOL.radius + 1.0
    places = np.array([[-24.0, y, -2.5], [24.0, y, -2.5], [24.0, 30.0, -2.5], [0.0, 30.0, -2.5], [0.0, -30.0, -2.5]])
    moves = Moves(places[:-1], places[1:], np.ones(4, bool), np.zeros(4, np.int32))
    parts, of = in_parts(moves, [tool])
    assert np.allclose(parts.start[of == 3][0], places[3]) and np.allclose(parts.end[-1], places[4])
    assert np.linalg.norm(parts.end - parts.start, axis=1).max() <= 0.5 * tool.radius + 1e-9
    angle = engaged_angles(run_stock(blank(PART.mesh, 0.15, BLANK), moves, [tool], BLANK).engaged, parts, [tool])
    last = parts.end[:, 1]
    assert angle[(of == 3) & (np.abs(last) < 11.0)].min() >= math.radians(170)
    assert not angle[(of == 3) & ((last > 18.0) | (last < -18.0))].any() and not angle[(of == 1) & (last > -12.0)].any()


def test_a_slot_above_the_limit_is_a_finding_on_its_line():
    lines = program()
    clean = prove([("p", text(lines))], PART, (TOOL, OTHER), SETUP, scored(PART), ("Z1", "Z2"))
    assert clean.no_findings and clean.engaged[1].most > math.radians(160) and 2 not in clean.engaged
    limited = replace(SETUP, max_engaged={1: math.radians(120), 2: math.radians(10)})
    proof = prove([("p", text(lines))], PART, (TOOL, OTHER), limited, scored(PART), ("Z1", "Z2"))
    assert set(proof.counts) == {"engagement"}
    first = min(f.line for f in proof.findings if f.kind == FindingKind.ENGAGEMENT)
    assert first <= 14 and "limit 120 deg" in proof.findings[0].message


@pytest.mark.parametrize(("turn", "front"), [(0.0, 90.0), (45.0, 90.0), (90.0, 90.0), (135.0, 45.0), (180.0, 0.0)])
def test_of_what_was_met_before_a_corner_what_is_in_front_counts(turn, front):
    """The left half of the front, 0 to 90 degrees, is met on a move, and one sector ahead on the next, to the left."""
    a = math.radians(turn)
    places = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3 + 0.9 * math.cos(a), 0.9 * math.sin(a), 0]])
    moves = Moves(places[:-1], places[1:], np.ones(2, bool), np.zeros(2, np.int32))
    ahead = int(turn / 360.0 * SECTORS) % SECTORS
    bits = np.array([2**16 - 1, 1 << ahead], np.uint64).view(np.int64)
    first, second = engaged_angles(bits, moves, [TOOL])
    assert first == pytest.approx(math.pi / 2)
    own = 0.0 if turn < 90.0 else math.pi / (SECTORS // 2)
    assert second == pytest.approx(math.radians(front) + own)
