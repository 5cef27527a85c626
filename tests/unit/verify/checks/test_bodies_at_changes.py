"""Empty spindles, tools that hang lower after a change, and what a proof takes for granted of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from tests.pocket_case import block
from verify.assumptions import AssumedKind
from verify.checks.body_assumptions import length_assumptions
from verify.checks.empty_spindle import SMALLEST_NOSE
from verify.checks.program_sequence import FramedProgram, read_all
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import NcProgram, ProofSetup, ScoredSamples, StockKind
from verify.progress import silent
from verify.prove import prove
from verify.tool_bodies import NOSE_LENGTH, Bodies

HEAD = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0\nZ15\n"  # line 8 is the first of a body
LONG = {1: 75.0, 2: 100.0}
HOLDER = (HolderFrustum(20.0, 20.0, 30.0),)
SHORT_TOOL = ToolBody("T1", 1, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 45.0, HOLDER)
LONG_TOOL = ToolBody("T2", 2, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 70.0, HOLDER)
SETUP = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, gauge_length=LONG)


def read(*lines, **how):
    return read_program(HEAD + "\n".join([*lines, "M5", "M30", "%"]) + "\n", tools={1, 2}, lengths=LONG, **how)


def proved(*lines, setup=SETUP, tools=(SHORT_TOOL, LONG_TOOL)):
    part = block()  # X -20 to 20, Y -15 to 15, Z -10 to 0
    s = sample_surface(part.mesh, 0.5, seed=1)
    text = HEAD + "\n".join([*lines, "M5", "M30", "%"]) + "\n"
    return prove([NcProgram("p", text)], part, tools, setup, ScoredSamples(s, np.zeros(len(s), np.int32)), [])


def test_a_longer_tool_hangs_lower_where_the_spindle_stays():
    p = read("G0 Z30", "T2 M6", "S900 M3", "G43 H2", "G0 X5")
    (swap,) = p.swaps
    assert (swap.line, swap.old, swap.new, swap.longer, swap.height) == (9, 1, 2, 25.0, 30.0)
    assert p.start[swap.moves].tolist() == [0, 0, 30] and p.end[swap.moves].tolist() == [0, 0, 5]
    assert p.end[-1].tolist() == [5, 0, 5] and p.line[-1] == 12 and not p.unplaced


def test_a_shorter_tool_hangs_higher_and_an_empty_spindle_ends_at_its_face():
    p = read("G0 Z30", "T2 M6", "T1 M6", "G43 H1", "S900 M3", "G0 X5")
    assert p.end[-1].tolist() == [5, 0, 30]
    empty = read("G0 Z30", "T0 M6", "G49", "G0 X5")
    assert empty.swaps[0].longer == -75.0 and empty.end[-1].tolist() == [5, 0, 105]


@pytest.mark.parametrize(("change", "place"), [((300.0,), [5, 0, 200]), ((-50.0, 60.0, 300.0), [5, 60, 200])])
def test_a_stated_change_position_counts(change, place):
    p = read("G0 Z30", "T2 M6", "S900 M3", "G43 H2", "G0 X5", change=change)
    assert p.end[-1].tolist() == place and not p.swaps and not p.unplaced


def test_a_change_position_of_another_frame_is_left_open():
    """It is stated in the setup frame; in the frame of another access the part is clamped anew."""
    p = read("G0 Z30", "T2 M6", "S900 M3", "G43 H2", "G0 X5 Y5 Z9", "X7", change=(math.nan,))
    assert p.unplaced == (3, 9) and not p.swaps and p.end[-1].tolist() == [7, 5, 9]
    setup = replace(SETUP, change_position=(300.0,))
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    text = HEAD + "\n".join(["G0 Z90", "T2 M6", "S900 M3", "G43 H2", "G0 X5 Y5 Z99", "M5", "M30", "%"]) + "\n"
    def told(turn):
        (f,) = read_all([NcProgram("p", text, turn=turn)], block(), (SHORT_TOOL, LONG_TOOL), setup, 0, silent)
        return f.program.unplaced
    assert told(turn) == (3, 9) and told(None) == () and told(np.diag([-1.0, -1.0, 1.0])) == ()


@pytest.mark.parametrize(("before", "told"), [("G53 G0 Z0.", False), ("G0 Z30.", True)])
def test_controls_that_go_to_a_place_of_their_own_leave_it_open(before, told):
    text = f"%\nO0001\nG21 G90 G17 G94 G54\nT1 M6\nS900 M3\nG0 G43 Z15. H1\nX0. Y0.\n{before}\nT2 M6\nM5\nM30\n%\n"
    p = read_program(text, tools={1, 2}, lengths=LONG, dialect="fanuc")
    assert p.unplaced == ((9,) if told else ()) and not p.swaps


def test_tools_of_unknown_length_leave_it_open():
    p = read_program(HEAD + "G0 Z30\nT2 M6\nM5\nM30\n%\n", tools={1, 2}, lengths={1: 75.0})
    assert p.unplaced == (9,) and not p.swaps


def test_a_rapid_with_the_tool_a_change_put_too_low_is_a_collision():
    found = proved("G0 X-30", "Z5", "T2 M6", "S900 M3", "G43 H2", "G0 X30", "G0 Z60")
    hits = [f for f in found.findings if f.kind == "collision"]
    assert {f.line for f in hits} == {13} and "T2 is 25.000 mm longer than T1" in hits[0].message
    assert not [f for f in found.findings if f.kind == "rapid" and not f.near]
    high = proved("G0 X-30", "Z60", "T2 M6", "S900 M3", "G43 H2", "G0 X30", "G0 Z60")
    assert not [f for f in high.findings if f.kind in ("collision", "rapid")]


def test_an_empty_spindle_has_a_nose():
    down = ("G53 G0 Z0", "T0 M6", "G0 X60 Y0", "G0 Z-5", "G0 X55.5", "G0 X45")
    found = proved(*down)
    told = {f.line: f for f in found.findings if f.tip is not None}
    # the nose reaches 34.916 mm, so it is 0.584 mm from the part at X55.5 and 9.916 mm in it at X45
    assert told[12].near and told[12].kind == "rapid" and told[12].depth == pytest.approx(0.584, abs=0.11)
    assert told[13].kind == "collision" and "spindle nose" in told[13].message
    assert [a.value for a in found.assumed if "69.832" in str(a.value)]
    slim = proved(*down, setup=ProofSetup(**{**SETUP.__dict__, "nose_diameter": 30.0}))
    assert not [f for f in slim.findings if f.kind == "collision"]


def test_a_program_that_feeds_without_a_tool_has_no_nose():
    """It has a finding for it, and the moves that would sweep a spindle through the part are not followed."""
    found = proved("G53 G0 Z0", "T0 M6", "S1000 M3", "G0 X60 Y0", "G0 Z-5", "G1 X45 F100", "G53 G0 Z0", "T1 M6")
    assert any("without a tool in the spindle" in f.message for f in found.findings)
    assert not [f for f in found.findings if "spindle nose" in f.message]


def test_a_stated_nose_stands_above_the_holder():
    setup = ProofSetup(nose_diameter=SMALLEST_NOSE, gauge_length={1: 80.0})
    z0, z1, r0, r1, clearance, _ = Bodies.of([SHORT_TOOL], setup).rows[-1]
    assert (z0, z1) == (80.0, 80.0 + NOSE_LENGTH) and r0 - clearance == r1 - clearance == SMALLEST_NOSE / 2


def test_a_stated_nose_stands_above_a_tool_without_a_holder_where_its_gauge_length_is_given():
    bare = ToolBody("T1", 1, 6.0, 0.0, 20.0, 6.0, 20.0, 6.0, 25.0)
    setup = ProofSetup(nose_diameter=120.0, gauge_length={1: 30.0}, gauge_given=frozenset({1}))
    nose = [(z0, z1, r0 - c) for z0, z1, r0, _, c, _ in Bodies.of([bare], setup).rows if r0 - c > 10.0]
    assert nose == [(30.0, 30.0 + NOSE_LENGTH, 60.0)]
    unplaced = ProofSetup(nose_diameter=120.0, gauge_length={1: 30.0})
    assert not [r for r in Bodies.of([bare], unplaced).rows if r[2] > 10.0]


@pytest.mark.parametrize(("given", "told"), [(frozenset(), True), (frozenset({1}), False)])
def test_a_nose_that_nothing_places_is_told(given, told):
    bare = replace(SHORT_TOOL, holder=())
    setup = ProofSetup(**{**SETUP.__dict__, "nose_diameter": 120.0, "gauge_length": {1: 80.0}, "gauge_given": given})
    taken = [a for a in proved("G0 X60", "G0 Z15", tools=[bare], setup=setup).assumed
             if a.what == AssumedKind.ABOVE_HOLDER]
    assert [a.remedy for a in taken] == (["state gauge_length_mm of " + bare.id] if told else [])


def test_what_stands_above_a_holder_and_under_the_part_is_told():
    taken = {a.what: str(a.value) for a in proved("G0 X60", "G0 Z-12.5", "G0 Z15").assumed}
    assert "ends 62.5 mm above the top" in taken[AssumedKind.ABOVE_HOLDER]
    assert "deepest under the part 2.500 mm (p, line 9)" in taken[AssumedKind.TABLE]


@pytest.mark.parametrize(("given", "told"), [(frozenset(), True), (frozenset({1}), False)])
def test_gauge_lengths_of_a_tilted_head_without_tool_centre_point_control_are_told(given, told):
    head = Kinematics("head-table-BC", ((0.0, 0.0, 150.0), (0.0, 0.0, -50.0)))
    text = HEAD + "G0 Z60 B30\nG1 X5 F500\nG0 Z90\nB0\nM5\nM30\n%\n"
    p = read_program(text, tools={1}, kinematics=head, gauge_length={1: 75.0})
    assert p.by_joints == {1}
    setup = ProofSetup(gauge_length={1: 75.0}, gauge_given=given, kinematics=head)
    framed = FramedProgram(p, None, setup, np.array([[-20.0, -15, -10], [20, 15, 0]]))
    found = list(length_assumptions([framed], setup))
    assert [(a.what, a.value) for a in found] == ([(AssumedKind.GAUGE_LENGTH, "T1 75 mm")] if told else [])
    upright = read_program(text.replace(" B30", "").replace("B0\n", ""), tools={1}, kinematics=head,
                           gauge_length={1: 75.0})
    assert upright.by_joints == frozenset()
