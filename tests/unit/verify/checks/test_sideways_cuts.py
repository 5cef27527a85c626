"""Drills that cut sideways in small steps, and taps that leave their thread at rapid."""

from dataclasses import replace

import numpy as np
import pytest

from tests.hand_parts import tool
from verify.checks.sideways_cuts import sideways_findings, tapped_out, torn_threads, turned_backwards
from verify.findings import Source
from verify.moves import Moves


def drill(kind="drill"):
    return replace(tool(4.0, 0.0), named=kind)


def case(tips, feed, cut):
    at = np.array(tips, float)
    n = len(at) - 1
    moves = Moves(at[:-1].copy(), at[1:].copy(), np.array(feed, bool), np.zeros(n, np.int32), None)
    source = Source(("program",), np.zeros(n, np.int32), np.arange(1, n + 1, dtype=np.int32), np.full(n, 3, np.int32))
    return moves, np.array(cut, bool), source


@pytest.mark.parametrize(("step", "lines"), [(0.0, []), (0.002, [7, 8, 9, 10]), (0.009, [3, 4, 5, 6, 7, 8, 9, 10]),
                                             (0.5, list(range(2, 11)))])
def test_the_way_across_counts_from_where_the_drill_began(step, lines):
    tips = [(0, 0, 5), (0, 0, -3), *((step * k, 0, -3 - 0.001 * k) for k in range(1, 10))]
    moves, cut, source = case(tips, [True] * 10, [True] * 10)
    found = sideways_findings(moves, cut, [drill()], source)
    assert [f.line for f in found] == lines
    assert not found or found[-1].depth == pytest.approx(9 * step)


def test_a_drill_may_go_aside_between_its_holes():
    tips = [(0, 0, 5), (0, 0, -3), (0, 0, 5), (9, 0, 5), (9, 0, -3)]
    moves, cut, source = case(tips, [True, True, True, True], [True, False, False, True])
    assert sideways_findings(moves, cut, [drill()], source) == []


@pytest.mark.parametrize(("kind", "feeds_out", "lines"), [("tap", False, [2]), ("tap", True, []), ("drill", False, [])])
def test_a_tap_feeds_out_of_its_thread(kind, feeds_out, lines):
    tips = [(0, 0, 5), (0, 0, -3), (0, 0, 5), (9, 0, 5)]
    moves, cut, source = case(tips, [True, feeds_out, False], [True, False, False])
    inside = np.roll(cut, 1)
    found = torn_threads(moves, cut, ~cut & cut, [drill(kind)], source)
    assert torn_threads(moves, ~cut & cut, inside, [drill(kind)], source) == found
    assert [f.line for f in found] == lines
    assert not found or (found[0].depth == pytest.approx(8.0) and "T3 is a tap" in found[0].message)


@pytest.mark.parametrize(("kind", "taps", "lines"), [
    ("tap", {}, [2]), ("tap", {1: True, 2: True}, []), ("tap", {1: False, 2: False}, [2]),
    ("tap", {1: False, 2: True}, []),
    ("drill", {}, []), ("drill", {1: True, 2: True}, [1, 2])])
def test_a_tap_is_fed_out_by_a_cycle_that_turns_it_back(kind, taps, lines):
    tips = [(0, 0, 5), (0, 0, -3), (0, 0, 5), (9, 0, 5), (9, 0, 7)]
    moves, cut, source = case(tips, [True, True, False, True], [True, False, False, False])
    none = np.zeros(4, bool)
    for cuts, inside in ((cut, none), (none, np.array([0, 1, 0, 0], bool))):
        found = tapped_out(moves, cuts, inside, [drill(kind)], source, [taps], np.zeros(4, int))
        assert [f.line for f in found] == lines
        assert not found or found[-1].depth == pytest.approx(8.0)
    assert tapped_out(moves, none, none, [drill("tap")], source, [{}], np.zeros(4, int)) == []


@pytest.mark.parametrize(("ways", "torn"), [((0, 7), []), ((7, 0), []), ((0, 0), [2]), ((7, 7), [2])])
def test_a_floating_chuck_is_fed_out_with_the_spindle_reversed(ways, torn):
    """G63 in with M3 and out with M4, and the other way round for a left-hand thread."""
    moves, cut, source = case([(0, 0, 5), (0, 0, -3), (0, 0, 5)], [True, True], [True, False])
    found = tapped_out(moves, cut, ~cut & cut, [drill("tap")], source, [{}], np.array(ways))
    assert [f.line for f in found] == torn


@pytest.mark.parametrize(("kind", "ways", "line"), [
    ("tap", (0, 7), []), ("tap", (7, 0), [7]), ("flat", (0, 0), []), ("flat", (0, 7), [7]), ("drill", (7, 7), [7])])
def test_only_a_tap_on_its_way_out_turns_backwards(kind, ways, line):
    moves, _, source = case([(0, 0, 5), (0, 0, -3), (0, 0, 5)], [True, True], [True, False])
    found = turned_backwards(moves, np.array(ways), [drill(kind)], source)
    assert [f.line for f in found] == line
    assert not found or "M4 turns the spindle backwards, and T3 feeds in line" in found[0].message
