"""Words of Heidenhain controls: each program beside the same moves in plain G0, G1, G2 and G3."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import ProgramError
from tests.heidenhain_pairs import PAIRS
from tests.program_pairs import HEIDENHAIN, NAMES, RADII, apart, read, same_feeds
from verify.gcode.dialects.heidenhain import heidenhain_flow
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

CASES = Path(__file__).resolve().parents[7] / "shared" / "cases"

@pytest.mark.parametrize("name", [k for k, (_, plain) in PAIRS.items() if plain])
def test_the_same_moves(name):
    given, plain = PAIRS[name]
    first, second = read(given, "heidenhain"), read(plain, "siemens")
    assert apart(first, second) < 1e-6
    assert same_feeds(first, second) and first.dwell == second.dwell


@pytest.mark.parametrize(("tolerance", "told"), [("HSC-MODE:1 TA5", 1), ("TA0.05", 0), ("HSC-MODE:1", 0)])
def test_a_tool_axis_that_may_lean_off_while_it_cuts_is_told(tolerance, told):
    """The rim of T1, of radius 5, goes 5 sin(TA) off, and 0.01 mm is allowed."""
    p = read("CYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T0.001\nCYCL DEF 32.2 " + tolerance + "\nM126\n"
             "L A+0 C+0 FMAX\nM128\nL X+0 Y+0 Z+9 FMAX\nL X+20 A+5", "heidenhain", "table-table-AC")
    assert [r.message.split(" here,")[0] for r in p.remarks] == [
        "the control may turn the tool axis 5 deg off its way"] * told


def test_turns_over_a_full_circle():
    p = read("L X+10 Y+0 Z+0\nCC X+0 Y+0\nCP IPA-1800 IZ-5 DR-\nCP IPA+765 DR+", "heidenhain")
    assert apart(p, read("G1 X10 Z0\nG2 X10 Y0 Z-5 I-10 J0 P5\nG3 X7.0710678118655 Y7.0710678118655 I-10 J0 P3",
                         "linuxcnc")) < 1e-6
    way = np.unwrap(np.arctan2(p.end[p.line == 8, 1], p.end[p.line == 8, 0]))
    assert way[-1] == pytest.approx(-5 * math.tau) and np.allclose(p.end[p.line == 8, 2], 5 * way / math.tau / 5)


@pytest.mark.parametrize(("moves", "line"), [
    ("L X+20\nRND R3\nL X+20\nL Y+20", 2), ("L X+20\nL X+20\nCHF 3\nL Y+20", 3), ("L X+20\nRND R50\nL Y+20", 2)])
def test_a_corner_that_does_not_go_is_told_with_its_own_line(moves, line):
    with pytest.raises(ProgramError, match=f"line {len(HEIDENHAIN) + line}: a "):
        read(moves, "heidenhain")


@pytest.mark.parametrize("plane", ["PLANE SPATIAL SPA+0 SPB+0 SPC+0", "PLANE SPATIAL SPA+0 SPB+0 SPC+90",
                                   "PLANE RESET"])
def test_a_level_plane_retracts_on_a_machine_without_rotary_axes(plane):
    p = read(f"L Z-1 F100\n{plane} TURN MB20 FMAX\nL X+5 Y+0", "heidenhain")
    np.testing.assert_allclose(p.end[-3:, 2], [-1, 19, 19], atol=1e-9)
    far = read(f"L Z-1 F100\n{plane} MOVE MB MAX FMAX\nL X+5 Y+0 FMAX\nL Z+2", "heidenhain")
    assert [r.message for r in far.remarks] == [] and len(far) == len(p)
    assert read(f"L Z-1 F100\n{plane} STAY\nL X+5 Y+0", "heidenhain").end[-1, 2] == -1.0


def test_a_cycle_takes_the_values_that_its_parameters_have_when_it_is_called():
    """As in the manual's group of holes with several tools: FN 0 gives the depth and the peck of the next tool."""
    cycle = "CYCL DEF 200 DRILLING Q200=2 Q201={} Q206={} Q202={} Q210=0 Q203={} Q204=10 Q211=0\n"
    holes = "L X+10 Y+10 R0 FMAX M99\nL X+20 Y+10 FMAX M99\n"
    given = cycle.format(-3, "AUTO", 3, "+0") + holes + (
        "TOOL CALL 2 Z S1000 F250\nM3\nFN 0: Q201 = -25\nQ202 = 5\n" + holes + "FN 0: Q203 = -4\nQ206 = 80\n" + holes)
    plain = cycle.format(-3, "AUTO", 3, "+0") + holes + "TOOL CALL 2 Z S1000 F250\nM3\n" + cycle.format(
        -25, "AUTO", 5, "+0") + holes + cycle.format(-25, 80, 5, -4) + holes
    first, second = read(given, "heidenhain"), read(plain, "heidenhain")
    assert apart(first, second) < 1e-9 and same_feeds(first, second)


@pytest.mark.parametrize("kind", ["MIRROR", "ROTATION", "SCALE"])
def test_a_reset_of_what_is_not_set_moves_nothing(kind):
    assert apart(read(f"TRANS {kind} RESET\nL X+5", "heidenhain"), read("L X+5", "heidenhain")) == 0.0
    for text in ("CYCL DEF 8.1 X", "CYCL DEF 10.1 ROT+30", "CYCL DEF 11.1 SCL 2"):
        both = f"{text}\nTRANS {kind} RESET\nL X+5 Y+0"
        if {"8": "MIRROR", "10": "ROTATION", "11": "SCALE"}[text.split()[2].split(".")[0]] != kind:
            read(both, "heidenhain")
            continue
        with pytest.raises(ProgramError, match=f"TRANS {kind} RESET"):
            read(both, "heidenhain")


def test_a_rounding_between_a_line_and_an_arc_touches_both():
    q = read("L X+30 Y+0\nRND R3\nCC X+30 Y+12\nC X+42 Y+12 DR+\nRND R2\nL X+60", "heidenhain")
    assert q.end[-1].tolist() == [60.0, 12.0, 50.0]
    corner = q.end[q.line == 10]
    middle = np.array([corner[-1, 0], 10.0])
    assert len(corner) > 5 and np.allclose(np.linalg.norm(corner[:, :2] - middle, axis=1), 2.0)
    assert np.linalg.norm(middle - [30.0, 12.0]) == pytest.approx(14.0)  # both arcs touch from outside


@pytest.mark.parametrize(("cycle", "stands"), [
    ("CYCL DEF 207 TAP Q200=2 Q201=-5 Q239=+1 Q203=+0 Q204=10", True),
    ("CYCL DEF 209 TAP Q200=2 Q201=-5 Q239=+1 Q203=+0 Q204=10 Q257=2 Q256=0 Q336=0", True),
    ("CYCL DEF 17.0 TAP\nCYCL DEF 17.1 SETUP 2\nCYCL DEF 17.2 DEPTH -5\nCYCL DEF 17.3 PITCH +1", True),
    ("CYCL DEF 206 TAP Q200=2 Q201=-5 Q206=100 Q211=0 Q203=+0 Q204=10", False)])
def test_the_spindle_stands_behind_rigid_tapping(cycle, stands):
    for before in ("M3", "M5"):
        for again in ("", "M3\n"):
            p = read(f"L X+0 Y+0 R0 FMAX\nL Z+20 R0 FMAX {before}\n{cycle}\nCYCL CALL\nL X+5 R0 FMAX M99\n{again}"
                     "L X+9 R0 F500", "heidenhain")
            told = any("spindle standing" in r.message for r in p.remarks)
            assert told == (not again if stands else before == "M5"), (before, again, p.remarks)


def test_bore_milling_stays_in_its_bore():
    p = read(PAIRS["bore milling"][0], "heidenhain")
    feed = p.kind == 1
    far = np.hypot(p.end[feed, 0], p.end[feed, 1])
    assert far.max() == pytest.approx(4.0) and p.end[feed, 2].min() == -4.0
    assert p.end[-1].tolist() == [0.0, 0.0, 5.0] and (p.feed[feed] == 70.0).all()
    low = np.abs(p.end[:, 2] + 4.0) < 1e-9
    angles = np.unwrap(np.arctan2(p.end[low & (far.size > 0), 1], p.end[low & (far.size > 0), 0]))
    assert np.ptp(angles) > math.tau - 0.2  # a whole turn at the bottom


def test_feeds_that_the_control_may_change_are_told():
    p = read("FUNCTION AFC CUT BEGIN TIME20\nL X+1 F100\nFUNCTION AFC CUT END", "heidenhain")
    assert sum("FUNCTION AFC lets the control change feeds" in note for note in p.notes) == 1
    assert not any("AFC" in note for note in read("FUNCTION AFC CTRL\nL X+1 F100", "heidenhain").notes)


def test_inches():
    """F counts tenths of an inch per minute."""
    given = ("BEGIN PGM A INCH\nTOOL CALL 1 Z S1000 F100\nM3\nL X+0 Y+0 Z+2 FMAX\nTRANS DATUM AXIS X+1\nL X+1 IY+0.5 "
             "F100\nRND R0.2\n"
             "CC X+1 Y+1.5\nC X+2 Y+1.5 DR+\nTRANS DATUM RESET\n"
             "CYCL DEF 201 R Q200=0.1 Q201=-0.2 Q206=50 Q211=0 Q208=0 Q203=0 Q204=1\nCYCL CALL\nL X+0 RL\nL Y+3 R0")
    plain = given.replace("INCH", "MM")
    for word in ("X+1", "X+2", "IY+0.5", "R0.2", "Y+1.5", "Z+2", "Q200=0.1", "Q201=-0.2", "Q204=1", "Y+3"):
        k = word.index("=") + 1 if "=" in word else 1 if word[0] in "XYZR" else 2
        plain = re.sub(re.escape(word) + r"(?![0-9.])", f"{word[:k]}{float(word[k:]) * 25.4:+.6f}", plain)
    plain = plain.replace("F100", "F254").replace("Q206=50", "Q206=127")
    first, second = read(given, "heidenhain", head=False), read(plain, "heidenhain", head=False)
    assert apart(first, second) < 1e-5 and same_feeds(first, second)


def test_tools_by_name():
    for word, number in (('"MILL_D10"', 1), ('"mill_d10"', 1), ('"drill 8"', 2), ("3", 3), ('"3"', 3)):
        p = read(f"TOOL CALL {word} Z S500 F9\nM3\nL X+1 Y+1 Z+9 FMAX\nL Z+1", "heidenhain")
        assert p.tool[-1] == number and not p.remarks
    with pytest.raises(ProgramError, match="no tool of the setup has this id") as refused:
        read('TOOL CALL "REAMER" Z S500', "heidenhain")
    assert "MILL_D10" in refused.value.remedy


REFUSED = [
    ("CALL PGM TNC:\\A.H", "runs a program that is not in this file"), ("CALL LBL 7",
                                                                        "the label 7 is not in the program"),
    ("FPOL X+0 Y+0", "a free contour"), ("FL X+1", "a free contour"), ("CYCL DEF 251 Q200=2\nCYCL CALL",
                                                                       "cycle 251 (a pocket)"),
    ("CYCL DEF 262 Q200=2\nCYCL CALL", "cycle 262 (thread milling)"), ("CYCL DEF 220 Q200=2",
                                                                       "cycle 220 (a circle of points)"),
    ("CYCL DEF 291 COUPL.TURNG.INTERP. Q560=1", "cycle 291 (interpolation turning)"),
    ("CYCL DEF 299 Q200=2", "cycle 299 (which may work when it is defined)"), ("CYCL DEF 812 Q200=2", "(turning)"),
    ("CYCL DEF 400 Q200=2", "a touch probe"), ("TCH PROBE 1.0", "a touch probe"),
    ("CYCL DEF 19.0 WORKING PLANE\nCYCL DEF 19.1 A+0 B+5", "cycle 19 (a tilted plane)"),
    ("CYCL DEF 19.1 X+0", "cycle 19 (a tilted plane)"), ("M128", "M128 turns the tool axis"),
    ("L X+5 FMAX F100", "two feeds"), ("PRESET SELECT #40", "a setup can name"),
    ("CYCL DEF 26.0 AXIS SCALING", "cycle 26"), ("PATTERN DEF POS1 (X+1)", "a pattern of points"),
    ("CYCL CALL PAT", "PAT"),
    ("CYCL CALL", "none is defined"), ("APPR LCT X+1 Y+1 R5 RL", "APPR LCT is not followed"),
    ("DEP LCT X+1 R5", "DEP LCT"),
    ("L X+Q9", "Q9 has no value yet"), ("FN 4: Q1 = +1 DIV +0", "no value here"),
    ("FN 18: SYSREAD Q1 = ID1", "FN 18 is not"),
    ("L X+1 M136", "M136 (feed per turn)"), ("L X+1 M109", "M109 (a feed that rises"),
    ("FUNCTION S-PULSE P-TIME10 SCALE50", "a spindle speed that swings"),
    ("L X+1 M142", "M142 (the end of shifts"),
    ("CC X+0 Y+0\nRND R5", "needs a move directly before"),
    ("L X+10\nRND R500\nL Y+5", "does not fit"), ("L X+10\nCHF 50\nL Y+5", "longer than a line"),
    ("PLANE PROJECTED PROPR+1 PROMIN+1 ROT+0 TURN", "are followed"), ("PLANE SPATIAL SPA+10 SPB+0 SPC+0 TURN F99",
                                                                      "rotary"),
    ("C X+1 Y+1 DR+", "has stated"), ("CR X+1 DR+", "without a radius"), ("CC X+0 Y+0\nC X+1 Y+1 R+2 DR+",
                                                                          "with a radius"),
    ("CC X+0 Y+0\nCP IPA+30 DR-", "sign of DR"), ("TOOL CALL 1 X S500", "tool axis"),
    ("TOOL CALL 5.2 Z", "with an index"),
    ("CYCL DEF 10.1 ROT+30\nCYCL DEF 7.1 X+5", "which comes first"), ("L X+1 X+2", "appears twice"),
    ("LX+1", "cannot read"),
    ("CYCL DEF 247 Q339=+40", "a setup can name"), ("L X+5 RL\nL Z+0 FMAX M91", "M91 with radius"),
    ("SPL X+1", "a spline"), ("FUNCTION PROG PATH IS CONTOUR", "a path along the contour"),
    ("LBL 1\nL X+1 F99\nFUNCTION COUNT REPEAT LBL 1", "a jump that the counter"),
    ("TOOL CALL 1 Z S900 DR2+1\nLN X+1 Y+0 Z+3 NX+1 NY+0 NZ+0 F99", "DR2"),
    ("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS REFPNT CENTER-CENTER", "REFPNT CENTER-CENTER"),
    ("CT X+5 Y+5", "no move came"), ("L X+9 RL M197", "M197 (other corners"), ("L X+9 M104",
                                                                               "M104 (the zero of before)"),
    ("L X+9 RL\nL Y+9\nTRANS DATUM AXIS X+1", "while cutter radius compensation is on"),
]


@pytest.mark.parametrize(("line", "said"), REFUSED)
def test_what_is_not_followed_is_named_with_its_line(line, said):
    with pytest.raises(ProgramError, match=re.escape(said)) as refused:
        read_program(f"BEGIN PGM A MM\nTOOL CALL 1 Z S900 F100\nL X+0 Y+0 Z+9 FMAX\n{line}\nM30\n",
                     dialect="heidenhain",
                     names=NAMES, radii=RADII)
    assert re.search("line [456]", refused.value.message)


def test_a_loop_without_end_is_bounded(monkeypatch):
    monkeypatch.setattr(heidenhain_flow, "MAX_JUMPS", 1000)
    with pytest.raises(ProgramError, match="jumps") as refused:
        read("Q1 = 0\nLBL 1\nQ1 = Q1 + 1\nFN 9: IF +1 EQU +1 GOTO LBL 1", "heidenhain")
    assert refused.value.code == "program_too_long"


def test_a_jump_back_that_finds_all_as_it_was_has_no_end():
    with pytest.raises(ProgramError, match="as they were the time before") as refused:
        read("LBL 1\nL X+10 F100\nL X+0\nFN 9: IF +1 EQU +1 GOTO LBL 1", "heidenhain")
    assert refused.value.code == "program_too_long" and refused.value.measured <= 3


def plane_of(a, b, c):
    """Axes of PLANE SPATIAL in the columns: about X, then Y, then Z of the untilted frame."""
    a, b, c = np.radians([a, b, c])
    rx = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    ry = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    rz = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return rz @ ry @ rx


@pytest.mark.parametrize("way", ["TURN MB MAX FMAX SEQ+ TABLE ROT", "MOVE DIST50 F1000",
                                 "STAY\nL A+Q120 B+Q121 C+Q122 FMAX"])
@pytest.mark.parametrize("kind", ["table-table-AC", "table-table-BC", "head-head-BC"])
def test_planes_that_turn_the_axes(kind, way):
    plane, shift = plane_of(20, 30, 40), np.array([5.0, 6.0, 0.0])
    way = re.sub(f" [{({'A', 'B', 'C'} - set(kind[-2:])).pop()}]\\+Q12[0-2]", "", way)
    p = read(f"TRANS DATUM AXIS X+5 Y+6\nL Z+0 FMAX M91\nPLANE SPATIAL SPA+20 SPB+30 SPC+40 {way}\nL X+10 Y+20 FMAX\nL "
             f"Z+30 FMAX\n"
             "L Z-2\nL X+20\nRND R2\nL Y+30\nPLANE RESET STAY", "heidenhain", kind)
    end = p.end[np.flatnonzero(p.kind == 1)[-1]]
    assert np.allclose(end, plane @ np.array([20, 30, -2]) + shift, atol=1e-6)
    assert np.allclose(p.poses.end_axis[-1], plane[:, 2], atol=1e-9)
    flat = (p.end[p.kind == 1] - shift) @ plane
    assert np.allclose(flat[1:, 2], -2.0, atol=1e-6) and len(flat) > 10


def test_a_move_of_plane_keeps_the_place_at_the_part():
    """MOVE with DIST: the point below the tip stays, the tip turns about it."""
    p = read("L X+10 Y+20 Z+50 FMAX\nPLANE SPATIAL SPA+30 SPB+0 SPC+0 MOVE DIST40 F1000", "heidenhain",
             "table-table-AC")
    centre = np.array([10.0, 20.0, 10.0])
    swing = p.line == 7
    assert np.allclose(p.end[swing] - 40 * p.poses.end_axis[swing], centre, atol=1e-6) and swing.sum() > 5


def test_other_planes():
    same = "PLANE SPATIAL SPA+20 SPB+30 SPC+40 STAY"
    z, x = plane_of(20, 30, 40)[:, 2], plane_of(20, 30, 40)[:, 0]
    vector = "PLANE VECTOR " + " ".join(f"{k}{v:+.12f}" for k, v in zip(("BX", "BY", "BZ", "NX", "NY", "NZ"), (*x, *z),
                                                                     strict=True)) + " STAY"
    moves = "L X+10 Y+20 Z+30 FMAX\nL Z-2\nL X+5"
    first = read(f"M128\n{same}\n{moves}", "heidenhain", "table-table-AC")
    for other in (vector, "PLANE SPATIAL SPA+20 SPB+30 SPC+0 STAY\nPLANE RESET STAY\n" + same):
        assert apart(first, read(f"M128\n{other}\n{moves}", "heidenhain", "table-table-AC")) < 1e-6
    euler = read(f"M128\nPLANE EULER EULPR+90 EULNU+20 EULROT-90 STAY\n{moves}", "heidenhain", "table-table-AC")
    assert apart(euler, read(f"M128\nPLANE SPATIAL SPA+0 SPB+20 SPC+0 STAY\n{moves}", "heidenhain",
                             "table-table-AC")) < 1e-6
    relative = "PLANE SPATIAL SPA+0 SPB+20 SPC+0 STAY\nPLANE RELATIV SPB+15 STAY"
    assert apart(read(f"M128\n{relative}\n{moves}", "heidenhain", "table-table-AC"),
                 read(f"M128\nPLANE SPATIAL SPA+0 SPB+35 SPC+0 STAY\n{moves}", "heidenhain", "table-table-AC")) < 1e-6
    axial = read(f"PLANE AXIAL B+35 TURN FMAX\n{moves}", "heidenhain", "table-table-BC")
    assert np.allclose(axial.poses.end_axis[-1], [-math.sin(math.radians(35)), 0, math.cos(math.radians(35))],
                       atol=1e-9)


def test_a_move_before_the_axes_stand_in_the_plane_is_refused():
    with pytest.raises(ProgramError, match="before the rotary axes stand in it"):
        read("PLANE SPATIAL SPA+20 SPB+0 SPC+0 STAY\nL X+1 Y+1 Z+1", "heidenhain", "table-table-AC")


@pytest.mark.parametrize("kind", ["table-table-AC", "head-head-BC"])
def test_vectors_and_spatial_angles(kind):
    axis = plane_of(20, 30, 40)[:, 2]
    words = " ".join(f"T{k}{v:+.9f}" for k, v in zip("XYZ", axis, strict=True))
    first = read(f"M128\nLN X+0 Y+0 Z+9 TX+0 TY+0 TZ+1 FMAX\nLN X+10 Y+5 Z+5 NX+0 NY+0 NZ+1 {words} F300", "heidenhain",
                 kind)
    assert np.allclose(first.poses.end_axis[-1], axis, atol=1e-8) and (first.feed[first.line == 8] == 300.0).all()
    tcpm = "FUNCTION TCPM F TCP AXIS SPAT PATHCTRL VECTOR\nL X+0 Y+0 Z+9 FMAX\nL X+10 Y+5 Z+5 A+20 B+30 C+40 F300"
    second = read(tcpm, "heidenhain", kind)
    assert np.allclose(second.poses.end_axis[-1], axis, atol=1e-8)
    normal = np.cross([0, 0, 1], axis)
    assert np.abs(second.poses.end_axis[second.line == 8] @ normal).max() < 5e-5


def test_case_files_are_read():
    """FUNCTION TCPM and M128 with a feed: the same as M128 alone."""
    path = CASES / "nc" / "h_tcpm.h"
    if not path.exists():
        pytest.skip("shared cases are not here")
    for name, kind, letters in (("h_tcpm.h", "table-table-BC", "BC"), ("h_m128f.h", "table-table-AC", "AC")):
        text = (CASES / "nc" / name).read_text()
        p = read_program(text, dialect="heidenhain", kinematics=Kinematics(kind), tools={1})
        plain = re.sub("FUNCTION TCPM.*|M128 F1000", "M128", text).replace("FUNCTION RESET TCPM", "M129")
        assert apart(p, read_program(plain, dialect="heidenhain", kinematics=Kinematics(kind), tools={1})) == 0.0
        turn = np.radians([5.0, 10.0])
        assert np.allclose(p.poses.end_turn[-1], turn) and p.end[-1].tolist() == [20.0, 5.0, 40.0]
        assert np.allclose(p.poses.end_axis[-1], Kinematics(kind).axis(turn[None])[0]), letters


@pytest.mark.parametrize(("word", "line"), [("M0", 4), ("M1", 4), ("M6", 3), ("M19", 3)])
def test_a_stop_ends_the_spindle_too(word, line):
    # M6 and M19 act before the move of their block
    head = "TOOL CALL 1 Z S1000\nL X+0 Y+0 Z+0 R0 FMAX M3\n"
    stopped = read(f"{head}L X+5 F100 {word}\nL X+10\n", "heidenhain")
    assert [r.line for r in stopped.remarks if "spindle standing" in r.message] == [len(HEIDENHAIN) + line]
    again = read(f"{head}L X+5 F100\n{word}\nM3\nL X+10\n", "heidenhain")
    assert not [r for r in again.remarks if "spindle standing" in r.message]


@pytest.mark.parametrize(("line", "said"), [
    ("TOOL CALL DL-1", "with DL or DR and without a tool"),
    ("TOOL CALL S900 DR+0.2", "with DL or DR and without a tool"),
    ("CYCL DEF 205 Q200=+2 Q201=-8 Q206=+200 Q202=+3 Q203=+0 Q204=+20 Q379=+6 Q253=+8000\nCYCL CALL",
     "cycle 205 with Q379=6 .a start within the hole.")])
def test_lengths_and_depths_that_would_be_passed_over_are_refused(line, said):
    with pytest.raises(ProgramError, match=said):
        read(line, "heidenhain")


@pytest.mark.parametrize(("side", "told"), [(1, 1), (0, 0)])
def test_the_shift_of_a_boring_bar_is_told(side, told):
    cycle = f"CYCL DEF 202 Q200=+2 Q201=-4 Q206=+100 Q211=+0 Q208=+0 Q203=+0 Q204=+20 Q214=+{side} Q336=+0\nCYCL CALL"
    assert sum("cycle 202 is read without its shift" in note for note in read(cycle, "heidenhain").notes) == told


@pytest.mark.parametrize(("defs", "said"), [
    (("TOOL DEF 1 L+0 R+2.5",), "the setup gives T1 5 mm"), (("TOOL DEF 9 L+0 R+2.5",), "the setup gives T9 no radius"),
    (("TOOL DEF 1 L+50 R+5", "TOOL DEF 1 L+49 R+5"), "an earlier one gives it 50 mm")])
def test_sizes_of_tool_def_are_those_of_the_proof(defs, said):
    with pytest.raises(ProgramError, match=re.escape(said)):
        read([*defs, "TOOL CALL 1 Z S1000"], "heidenhain", tools={1, 9})


def test_tool_def_makes_a_tool_ready():
    for line in ("TOOL DEF 2", 'TOOL DEF "drill 8"', "TOOL DEF 1 L+50 R+5", 'TOOL DEF "SOMETHING"'):
        assert not read([line, line, "L X+1 F100"], "heidenhain").remarks


@pytest.mark.parametrize("jump", ["FN 9: IF +Q1 EQU +0.3", "FN 10: IF +Q1 NE +0.3", "FN 11: IF +Q1 GT +0.3"])
def test_a_comparison_that_rounding_decides_is_refused(jump):
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read(["Q1 = 0.1 + 0.2", f"{jump} GOTO LBL 1", "L X+1 F100", "LBL 1"], "heidenhain")
    assert len(read(["Q1 = 0.1 + 0.2", f"{jump}1 GOTO LBL 1", "L X+1 F100", "LBL 1"], "heidenhain"))


@pytest.mark.parametrize("moves", [("L X+20 F500",), ("L Z+4 F500", "L Y+20"), ("L IX+3 F500",)])
def test_the_first_move_behind_a_rotation_names_both_axes(moves):
    """Cycle 10: both axes of the plane have to be moved to activate the rotation for all axes."""
    turn = ("L X-20 Y-3 R0 FMAX", "CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT+90")
    with pytest.raises(ProgramError, match="behind a rotation"):
        read([*turn, *moves], "heidenhain")
    with pytest.raises(ProgramError, match="behind a rotation"):
        read([*turn, "L X+1 Y+2 FMAX", "CYCL DEF 10.0 ROTATION", "CYCL DEF 10.1 ROT+0", *moves], "heidenhain")
    assert len(read([*turn, "L X+1 Y+2 FMAX", *moves], "heidenhain"))
    assert len(read(["L X+0 Y+0 R0 FMAX", *turn[1:], *moves], "heidenhain"))


@pytest.mark.parametrize("lines", [("L C+30 F2000 M116",), ("L X+1 F200 M116", "L C+30 F2000"), ("M116", "L A+5 F900")])
def test_feeds_of_rotary_axes_in_mm_are_refused(lines):
    with pytest.raises(ProgramError, match="under M116"):
        read(lines, "heidenhain", "table-table-AC")
    assert len(read([*lines[:-1], "M117", "L C+30 F2000"], "heidenhain", "table-table-AC"))
    assert len(read(["M116", "L C+30 FMAX"], "heidenhain", "table-table-AC"))


@pytest.mark.parametrize("function", ["INT", "FRAC"])
def test_a_whole_number_that_rounding_decides_is_refused(function):
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read([f"Q1 = {function}(0.3/0.1)", "L X+1 F100"], "heidenhain")
    assert len(read([f"Q1 = {function}(0.35/0.1)", "L X+1 F100"], "heidenhain"))


def test_feeds_per_turn():
    """FU counts with the speed in force, of TOOL CALL too, and FAUTO takes it back."""
    p = read("L X+6 FU0.05\nTOOL CALL S2000\nL X+7\nL X+8 F70\nTOOL CALL S500\nL X+9\nTOOL CALL 1 Z S400 FU 0.1\nM3\n"
             "L X+10 FAUTO\nRND R1 F9\nL Y+5", "heidenhain")
    assert p.feed[p.kind == 1][[0, 1, 2, 3, 4, 5, -1]].tolist() == [50, 100, 70, 70, 40, 9, 40]


def test_feeds_per_tooth():
    """FZ counts with speed and teeth of the tool that is in, of TOOL CALL and of a block."""
    text = ("L X+6 FZ0.05\nTOOL CALL S2000\nL X+7\nTOOL CALL 2\nM3\nL Z+50 FMAX\nL X+8\nL X+9 F70\n"
            "TOOL CALL 1 Z S500 FZ 0.1\nM3\nL Z+50 FMAX\nL X+10 FAUTO\nL X+11 FU0.1\nTOOL CALL 2 Z S400\nM3\n"
            "L Z+50 FMAX\nL X+12\nL X+13 FAUTO")
    p = read(text, "heidenhain", teeth={1: 4, 2: 3})
    feeds = p.feed[p.kind == 1]
    assert feeds.tolist() == pytest.approx([200, 400, 300, 70, 200, 50, 40, 120])
    assert any("T1 count with the 4 teeth (flutes)" in note for note in p.notes)
    for word in ("L X+6 FZ0.05", "TOOL CALL 1 Z S100 FZ0.1"):
        with pytest.raises(ProgramError, match="whose number of teeth is not known"):
            read(word, "heidenhain")
    with pytest.raises(ProgramError, match="FZ .* with T3"):
        read("L X+6 FZ0.05\nTOOL CALL 3 Z S100", "heidenhain", teeth={1: 4})


@pytest.mark.parametrize(("line", "told"), [("/12 L X+5", True), ("12 /L X+5", True), ("/ TOOL CALL S900", True),
                                           ("/7 M8", False), ("/7 ; text", False), ("/9 CYCL DEF 7.1 X+5", True)])
def test_a_block_with_a_slash_runs_and_is_told_where_it_counts(line, told):
    p = read(f"{line}\nL X+5", "heidenhain")
    assert p.end[-1].tolist()[:1] == [10 if "CYCL" in line else 5]
    assert [r.message[:14] for r in p.remarks] == ["a block with /"] * told


@pytest.mark.parametrize("line", ["/12 CALL LBL 1", "/LBL 1", "12 /FN 9: IF +1 EQU +1 GOTO LBL 3", "/Q1=5"])
def test_a_slash_before_what_decides_the_order_is_refused(line):
    with pytest.raises(ProgramError, match="would depend on a switch"):
        read(f"{line}\nL X+5", "heidenhain")


def down_and_up(p):
    """Heights of the moves along Z over X5, with their kinds."""
    here = (p.end[:, 0] == 5) & (p.start[:, 0] == 5) & (p.end[:, 2] != p.start[:, 2])
    return [(round(float(z), 6), "f" if k else "r") for z, k in zip(p.end[here, 2], p.kind[here], strict=True)]


def test_cycle_205_breaks_chips_between_infeeds_and_goes_out_behind_each():
    given = "Q200=+2 Q201=-10 Q206=90 Q202=+5 Q203=+0 Q204=+20 Q212=+0 Q205=+0 Q257=+2 Q256=+0.2 Q258=+0.5 Q259=+0.5"
    p = read(f"CYCL DEF 205 {given}\nL X+5 FMAX M99", "heidenhain")
    assert down_and_up(p) == [
        (2, "r"), (-2, "f"), (-1.8, "r"), (-4, "f"), (-3.8, "r"), (-5, "f"), (2, "r"), (-4.5, "r"),
        (-7, "f"), (-6.8, "r"), (-9, "f"), (-8.8, "r"), (-10, "f"), (20, "r")]
    assert any("chip breaking (Q257)" in note for note in p.notes)
    single = read(f"CYCL DEF 205 {given}\nL X+5 FMAX M99".replace("Q202=+5", "Q202=+10"), "heidenhain")
    assert down_and_up(single) == [(2, "r"), *(x for k in (2, 4, 6, 8) for x in ((-k, "f"), (0.2 - k, "r"))),
                                   (-10, "f"), (20, "r")]


def test_cycle_203_goes_out_behind_its_number_of_breaks():
    given = "Q200=2 Q201=-10 Q206=90 Q202=2 Q210=0 Q203=0 Q204=5 Q212=0 Q205=2 Q211=0 Q208=0 Q256=0.5"
    p = read(f"CYCL DEF 203 {given} Q213=2\nL X+5 FMAX M99", "heidenhain")
    assert down_and_up(p) == [(2, "r"), (-2, "f"), (-1.5, "r"), (-4, "f"), (-3.5, "r"), (-6, "f"), (2, "r"),
                              (-5.8, "r"), (-8, "f"), (-7.5, "r"), (-10, "f"), (5, "r")]


def test_pecks_begin_their_stop_distance_above_the_last_depth():
    """Cycle 205: Q258 above the first depth, Q259 above the last one, evenly between; Q206 is the feed of TOOL CALL."""
    given = "Q200=+2 Q201=-20 Q206=AUTO Q202=+5 Q203=+0 Q204=+20 Q212=+0 Q205=+0 Q257=+0 Q256=+0.2"
    p = read(f"CYCL DEF 205 {given} Q258=+0.5 Q259=+1\nL X+5 FMAX M99", "heidenhain")
    down = p.end[(p.end[:, 0] == 5) & (p.start[:, 2] == 2) & (p.kind == 0)][:, 2]
    assert down[:3].tolist() == [-4.5, -9.25, -14] and set(p.feed[p.kind == 1]) == {200}
