"""Faults in awkward places: after the machine's own zero, beside a large gouge, where a near miss stands in the way."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.pocket_case import SETUP, TOOL, block, line_of, program, scored, text
from verify.material.collision import run_clashes
from verify.material.stock_lines import run_bodies
from verify.model import NcProgram, ProofSetup, ScoredSamples
from verify.moves import Moves
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))
LINES = program()
BASE, END = LINES[:line_of(LINES, "G0 Z20", -1) - 1], ["M5", "M30", "%"]
HEAD = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
BOTH = pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])


def proved(lines, tools=(TOOL,), setup=SETUP, turn=None):
    return prove([NcProgram("p", text(lines), turn)], PART, tools, setup, NOBODY, ())


@BOTH
@pytest.mark.parametrize("home", [["G91 G28 Z0", "G90"], ["G53 G0 Z0"], []])
def test_a_rapid_past_a_clamp_after_a_drilling_cycle_and_home(home, turn):
    """It passes the clamp by 2 µm where 1 mm is asked for: a way by the machine's zero is no way back into the hole.

    How near it comes is told by points of the clamp, between which a tool may be 0.005 mm nearer.
    """
    lines = [*BASE, "G0 Z20", "G81 X0 Y0 Z-5 R1 F100", "G80", *home, "G0 X23.0 Y0", "G43 H1 Z20", "Z-3", "Z20", *END]
    clamp = np.array([[25.002, -15.0, -10.0], [32.0, 15.0, 4.0]])
    found = proved(lines, setup=replace(SETUP, fixtures=(clamp,)), turn=turn)
    line = line_of(lines, "Z-3", -1)
    near = [f for f in found.findings if f.kind == "rapid" and "of a fixture" in f.message]
    assert near and near[0].line <= line + 1 and 0.002 <= near[0].depth <= 0.007


@BOTH
def test_a_graze_in_a_rapid_is_as_deep_as_it_is_wide(turn):
    """The blank ends at X20.5, the tool's side runs at X20.2, 5.5 mm below its top; aside lines are 0.15 mm apart."""
    (found,) = proved([*HEAD, "G0 X22.2 Y-25", "Z-5", "Y25", "Z20", *END], turn=turn).findings[:1]
    assert found.kind == "rapid" and "into stock" in found.message
    assert found.depth == pytest.approx(0.3, abs=0.15 if turn is None else 0.01)


@BOTH
def test_a_collision_is_not_hidden_by_a_nearer_looking_miss(turn):
    """One rapid goes 0.5 mm into the blank, the next stays 0.05 mm beside it: the first is told."""
    lines = [*HEAD, "G0 X22 Y-25", "Z-5", "Y25", "X22.55", "Y-25", "Z20", *END]
    found = [f for f in proved(lines, turn=turn).findings if f.kind == "rapid"]
    assert found[0].line == line_of(lines, "Y25") and "into stock" in found[0].message
    assert found[0].depth == pytest.approx(0.5, abs=0.15 if turn is None else 0.01)


def test_a_near_segment_of_a_holder_does_not_hide_one_that_collides():
    """A slim segment, whose clearance is 0.1 mm, 0.3 mm deep; a wide one, of 1 mm, 0.05 mm beside."""
    tool = ToolBody("T1", 1, 20.0, 0.0, 5.0, 8.0, 20.0, 8.0, 30.0,
                    (HolderFrustum(19.8, 19.8, 15.0), HolderFrustum(26.0, 26.0, 20.0)))
    points = np.array([[0.0, 9.6, 40.0], [0.0, 13.05, 50.0]])
    moves = Moves(np.array([[-5.0, 0.0, 0.0]]), np.array([[5.0, 0.0, 0.0]]), np.array([True]), np.zeros(1, np.int32))
    setup = ProofSetup(clearance_holder=1.0)
    for order in ([0, 1], [1, 0]):
        for events in (run_bodies(points[order], moves, [tool], setup)[0],
                       run_clashes(points[order], np.zeros(2, np.bool_), moves, [tool], setup)[0]):
            assert (events[:, 2] - events[:, 3]).max() == pytest.approx(0.3)


@pytest.mark.parametrize("floor", ["Z-5.000", "Z-5.300"])
def test_dips_are_told_on_their_lines_beside_a_large_gouge(floor):
    """A ball of 1 mm pressed into the top face eight times, straight down and up, 0.03 mm deep."""
    ball = ToolBody("T2", 2, 1.0, 0.5, 3.0, 0.9, 10.0, 4.0, 30.0)
    places = np.random.default_rng(3).uniform([-18.0, -13.0], [-12.0, 13.0], (8, 2))
    lines = [line.replace("Z-5.000", floor) for line in BASE] + ["G0 Z20", "T2 M6", "S8000 M3", "G0 G43 H2 Z20"]
    planted = []
    for x, y in places.tolist():
        lines += ["(dip)"] * 6 + [f"G0 X{x:.3f} Y{y:.3f}", "Z1.5", "G1 Z-0.030 F100", "G1 Z1.5", "G0 Z20"]
        planted.append(len(lines) - 2)
    found = proved([*lines, *END], tools=(TOOL, ball), setup=replace(SETUP, margin=0.02))
    dips = {f.line: f.depth for f in found.findings if f.kind == "gouge" and f.line > len(BASE)}
    assert sorted(dips) == planted
    assert list(dips.values()) == pytest.approx([0.03] * 8, rel=0.1)
