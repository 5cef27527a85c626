"""Stock lines on the very edge of a cutter: each pass of a slot as wide as the cutter is as deep as its layer."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.hand_parts import tool
from verify.material.stock_lines import StockLines, run_stock
from verify.material.stock_pass import parts
from verify.model import ProofSetup
from verify.moves import Moves

SETUP = ProofSetup()
LAYER = 0.5


def field(step, off):
    """Lines of a square of 30 mm, 6 mm high."""
    count = round(30.0 / step)
    return StockLines(np.full(2, off - 15.0), step, np.full((count, count), 6.0), 0.0)


def depths(ways, mill, lines):
    """Depth of each of the ways (k, 2, 3), mm, and area that it takes as deep, mm²."""
    at = np.array(ways, float)
    moves = Moves(at[:, 0].copy(), at[:, 1].copy(), np.ones(len(at), bool), np.zeros(len(at), np.int32), None)
    run = run_stock(lines, moves, [mill], SETUP)
    whole = run.ways.of_moves(parts(moves, [mill]))
    return whole.depth, whole.volume / whole.depth


@pytest.mark.parametrize(("step", "radius"), [(0.1, 1.0), (0.25, 1.0), (0.15, 1.5)])
def test_layers_there_and_back_are_as_deep_as_they_are(step, radius):
    mill = replace(tool(2.0 * radius, 0.0), flute_length=6.0)
    for k, y in enumerate(np.linspace(-9.0, 9.0, 13).tolist()):
        lines = field(step, 0.1 * k)
        y = round((y - lines.origin[1]) / step) * step + lines.origin[1] + 0.5 * step  # edges on lines
        ways = []
        for n in range(1, 6):
            ends = [(-10.0, y, 6.0 - LAYER * n), (10.0, y, 6.0 - LAYER * n)]
            ways.append(ends if n % 2 else ends[::-1])
        depth, area = depths(ways, mill, lines)
        assert depth == pytest.approx(LAYER, abs=1e-6)
        assert area == pytest.approx(area[0], abs=1e-6)  # each pass takes the same
        assert (np.abs(area - 40.0 * radius - math.pi * radius**2) < 1.3 * 20.0 * step).all()


def test_passes_that_part_by_rounding_of_the_program_are_as_deep_as_they_are():
    mill = replace(tool(2.0, 0.0), flute_length=6.0)
    rng = np.random.default_rng(0)
    for angle in np.linspace(0.0, 1.5, 9).tolist():
        c, s = math.cos(angle), math.sin(angle)
        ways = []
        for n in range(1, 6):
            ends = [(x * c, x * s, 6.0 - LAYER * n) for x in ((-8.0, 8.0) if n % 2 else (8.0, -8.0))]
            ways.append(np.array(ends) + np.r_[rng.uniform(-2e-3, 2e-3, 2), 0.0])
        assert depths(ways, mill, field(0.1, 0.0))[0] == pytest.approx(LAYER, abs=1e-6)


def test_a_round_corner_is_no_deeper_than_the_stock_over_its_tip():
    mill = replace(tool(2.0, 0.3), flute_length=6.0)
    ways = [[(-8.0, 0.05, 6.0 - LAYER * n), (8.0, 0.05, 6.0 - LAYER * n)][::(-1) ** n] for n in range(1, 6)]
    depth, _ = depths(ways, mill, field(0.1, 0.0))
    assert depth[0] == pytest.approx(LAYER, abs=0.01) and (depth <= LAYER + 0.3).all()


def test_a_pass_that_only_skims_the_wall_has_no_depth():
    mill = replace(tool(2.0, 0.0), flute_length=6.0)
    lines = field(0.1, 0.0)
    ways = [[(-8.0, 0.05, 3.0), (8.0, 0.05, 3.0)], [(8.0, 0.053, 3.0), (-8.0, 0.053, 3.0)]]
    at = np.array(ways)
    moves = Moves(at[:, 0].copy(), at[:, 1].copy(), np.ones(2, bool), np.zeros(2, np.int32), None)
    depth = run_stock(lines, moves, [mill], SETUP).ways.of_moves(parts(moves, [mill])).depth
    assert depth.tolist() == [pytest.approx(3.0), 0.0]
