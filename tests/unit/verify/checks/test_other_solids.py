"""Solids of the part's file that are not the part."""

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.part import OtherSolid
from geometry.tool_body import HolderFrustum, ToolBody
from verify.assumptions import AssumedKind
from verify.checks.other_solids import other_assumptions
from verify.model import ProofSetup
from verify.moves import Moves
from verify.tool_axes import ToolAxes

TOOL = ToolBody("T4", 4, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 45.0, (HolderFrustum(30.0, 30.0, 30.0),))
NONE = np.zeros((0, 2, 3))
BOX = np.array([[10.0, -5.0, 0.0], [20.0, 5.0, 9.0]])


def told(*ways, tilted=False, boxes=NONE):
    start, end = (np.array([w[k] for w in ways], dtype=np.float64) for k in (0, 1))
    count = len(ways)
    moves = Moves(start, end, np.zeros(count, np.bool_), np.zeros(count, np.int32),
                  axes=ToolAxes.upright(count) if tilted else None)
    source = SimpleNamespace(tool=np.full(count, 4), line=np.arange(7, 7 + count))
    setup = ProofSetup(others=(OtherSolid(2, "jaw", BOX, boxes),))
    return list(other_assumptions(moves, source, [TOOL], setup))


@pytest.mark.parametrize(("way", "met"), [
    (((0, 0, 5), (6.0005, 0, 5)), False),  # the cutting part touches
    (((0, 0, 5), (6.1, 0, 5)), True),
    (((6.1, -20, 9), (6.1, 20, 9)), False),  # beside and over it
    (((6.1, -20, 8.9), (6.1, 20, 8.9)), True),
    (((0, 0, -35.9), (0, 3, -35.9)), False),  # the holder begins 45 mm over the tip
    (((0, 0, -35.9), (0, 0, -36.1)), True),
    (((-9, 0, -37), (-5.1, 0, -37)), False),
    (((-9, 0, -37), (-4.9, 0, -37)), True)])
def test_tools_that_enter_the_box_are_told(way, met):
    assert bool(told(way)) == met


def test_air_in_the_box_round_a_solid_is_free():
    foot, wall = [[10, -5, 0], [20, 5, 3]], [[17, -5, 3], [20, 5, 9]]
    over, into = ((0, 0, 3), (12.9, 0, 3)), ((0, 0, 2.9), (12.9, 0, 2.9))
    assert told(over) and not told(over, boxes=np.array([foot, wall], np.float64))
    assert told(into, boxes=np.array([foot, wall], np.float64))
    assert told(((0, 0, 3), (13.1, 0, 3)), boxes=np.array([foot, wall], np.float64))


def test_the_assumption_names_solid_tool_and_first_line():
    (a,) = told(((-20, 0, 5), (-10, 0, 5)), ((-10, 0, 5), (40, 0, 5)), ((40, 0, 5), (0, 0, 5)))
    assert a.what is AssumedKind.OTHER_SOLIDS and a.remedy == "state part.others"
    assert "solid 2 (jaw)" in a.value and "T4" in a.value and "line 8" in a.value


def test_a_tool_that_leans_counts_as_a_ball():
    far = ((-70, 0, 5), (-69, 0, 5))
    near = ((-60, 0, 5), (-59, 0, 5))
    assert not told(far, tilted=True) and not told(near) and told(near, tilted=True)
