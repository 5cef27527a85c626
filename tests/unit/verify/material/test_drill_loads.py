"""Drills in their holes: flutes that are shut in, and drills that cut with one side only."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from schemas.tools import Tool
from service.cutting_data import MATERIALS, cutting_words
from tests.pocket_case import SETUP, block, scored, text
from verify.model import NcProgram, ScoredSamples, StockKind
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))
STATED = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="drill", diameter_mm=3.0, flute_length_mm=4.0))
OPEN = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="drill", diameter_mm=3.0))


def drill(diameter=3.0, flutes=4.0, stickout=30.0):
    return ToolBody("T1", 1, diameter, 0.0, flutes, diameter, flutes, diameter, stickout, named="drill",
                    cone_height=0.3 * diameter)


def judged(lines, tool, words=STATED, setup=SETUP, more=()):
    """Lines of findings ``load``, their depths, and whether the length of the flutes is taken for granted."""
    head = ["%", "G21 G90 G17 G94 G40 G49 G54", *more, "T1 M6", "S2000 M3", "G0 X14 Y10", "G43 H1 Z20"]
    whole = NcProgram("p", text([*head, *lines, "G80", "G0 Z20", "M5", "M30", "%"]))
    tools = (tool, ToolBody("T2", 2, 6.0, 0.0, 12.0, 6.0, 12.0, 6.0, 30.0))
    proof = prove([whole], PART, tools, replace(setup, cutting={1: words}), NOBODY, (), threads=2)
    return [(f.line, f.depth) for f in proof.findings if f.kind == "load"], \
        any(a.what == "flute_length" for a in proof.assumed)


@pytest.mark.parametrize(("cycle", "flutes", "deep"), [
    ("G98 G81 X14 Y10 R2 Z-9 F100", 4.0, 5.5), ("G98 G73 X14 Y10 R2 Z-9 Q1 F100", 4.0, 5.5),
    ("G98 G83 X14 Y10 R2 Z-9 Q1 F100", 4.0, None), ("G98 G83 X14 Y10 R2 Z-9 Q9 F100", 4.0, 3.5),
    ("G98 G81 X14 Y10 R2 Z-4.5 F100", 4.0, None), ("G98 G81 X14 Y10 R2 Z-9 F100", 9.0, None)])
def test_a_drill_whose_flutes_are_shut_in_is_a_load(cycle, flutes, deep):
    found, taken = judged([cycle], drill(flutes=flutes))
    assert [line for line, _ in found] == [7] * (deep is not None) and not taken
    assert not found or found[0][1] == pytest.approx(deep, abs=0.8)


def test_flutes_of_a_length_that_nothing_states_are_told():
    assert judged(["G98 G81 X14 Y10 R2 Z-9 F100"], drill(), OPEN) == ([], True)
    assert judged(["G98 G81 X14 Y10 R2 Z-4 F100"], drill(), OPEN) == ([], False)


def test_flutes_are_open_in_a_groove_and_beside_the_blank():
    groove = ["T2 M6", "S2000 M3", "G0 X14 Y-30", "G43 H2 Z20", "Z-4", "G1 Y30 F300", "G0 Z20"]
    assert judged(["G98 G81 X14 Y10 R2 Z-9 F100"], drill(), more=groove)[0] == []
    offset = replace(SETUP, stock_kind=StockKind.PART_OFFSET)
    assert judged(["G98 G81 X20 Y10 R2 Z-9 F20"], drill(), setup=offset)[0] == []
    assert len(judged(["G98 G81 X14 Y10 R2 Z-9 F20"], drill(), setup=offset)[0]) == 1


@pytest.mark.parametrize(("x", "stickout", "harm"), [(20.9, 45.0, True), (20.9, 10.0, False), (18.0, 45.0, False),
                                                  (20.42, 45.0, True), (20.3, 45.0, False)])
def test_a_slender_drill_that_cuts_with_one_side_is_a_load(x, stickout, harm):
    """The blank ends at X20.5; the core of the drill has a radius of 0.15 mm."""
    found, _ = judged([f"G98 G81 X{x} Y10 R2 Z-4 F100"], drill(1.5, 8.0, stickout))
    assert [line for line, _ in found] == [7] * harm


def test_a_hole_before_the_drill_is_on_both_sides():
    wide = ["T2 M6", "S2000 M3", "G0 X14 Y10", "G43 H2 Z20", "G1 Z-4 F100", "G0 Z20"]
    assert judged(["G98 G81 X14 Y10 R2 Z-5 F100"], drill(6.5, 9.0, 90.0), more=wide)[0] == []
