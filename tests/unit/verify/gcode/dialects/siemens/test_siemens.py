"""Words of Siemens controls: each program beside the same moves in plain G0, G1, G2 and G3."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import ProgramError
from tests.program_pairs import NAMES, RADII, apart, read, same_feeds
from tests.siemens_pairs import PAIRS
from verify.gcode.dialects import dialect_of
from verify.gcode.dialects.siemens import siemens_flow
from verify.gcode.reader import FEED, read_program
from verify.kinematics import Kinematics

CASES = Path(__file__).resolve().parents[7] / "shared" / "cases"

@pytest.mark.parametrize("name", [k for k, (_, plain) in PAIRS.items() if plain])
def test_the_same_moves(name):
    given, plain = PAIRS[name]
    first, second = read(given, "siemens"), read(plain, "siemens")
    assert apart(first, second) < 1e-6
    assert same_feeds(first, second) and first.dwell == second.dwell


def test_turns_over_a_full_circle():
    p = read("G1 X10 Z0\nG3 X0 Y10 Z-9 I-10 J0 TURN=2", "siemens")
    assert apart(p, read("G1 X10 Z0\nG3 X0 Y10 Z-9 I-10 J0 P3", "linuxcnc")) < 1e-6
    way = np.unwrap(np.arctan2(p.end[p.line == 7, 1], p.end[p.line == 7, 0]))
    assert way[-1] == pytest.approx(2.25 * math.tau) and np.allclose(p.end[p.line == 7, 2], -9 * way / way[-1])


def test_inches():
    given = ("G700 G90 G54\nT1 M6\nS1000 M3 F10\nG0 X0 Y0 Z2\nTRANS X1\nG1 X1 Y=IC(0.5) RND=0.2\nG3 X2 Y1.5 I=AC(1) "
             "J=AC(1.5)\n"
             "CYCLE81(1,0,0.1,-0.2)\nATRANS X=-1")
    plain = ("G710 G90 G54\nT1 M6\nS1000 M3 F254\nG0 X0 Y0 Z50.8\nTRANS X25.4\nG1 X25.4 Y=IC(12.7) RND=5.08\n"
             "G3 X50.8 Y38.1 I=AC(25.4) J=AC(38.1)\nCYCLE81(25.4,0,2.54,-5.08)")
    first, second = read(given, "siemens", head=False), read(plain, "siemens", head=False)
    assert apart(first, second) < 1e-6 and same_feeds(first, second)


def test_hexadecimal_and_binary_numbers():
    given, plain = "R1='H1F'\nG1 X=R1+'B101' Y='h0a' F9", "G1 X36 Y10 F9"
    assert apart(read(given, "siemens"), read(plain, "siemens")) < 1e-9
    for word in ("'B2'", "'H'", "'HFFFFFFFF'", "'3'"):
        with pytest.raises(ProgramError, match="cannot read a value"):
            read(f"R1={word}", "siemens")


def test_tools_by_name():
    for word, number in (('T="MILL_D10"', 1), ('T="mill_d10"', 1), ('T="drill 8"', 2), ("T=3", 3), ('T="3"', 3),
                         ("T3", 3)):
        p = read(f"{word} D1\nM6\nS500 M3\nG0 X1 Y1 Z9\nG1 Z1 F9", "siemens")
        assert p.tool[-1] == number and not p.remarks
    with pytest.raises(ProgramError, match="no tool of the setup has this id") as refused:
        read('T="REAMER"\nM6', "siemens")
    assert "MILL_D10" in refused.value.remedy


def test_a_tool_behind_its_m6():
    for words in ("M6 T2", "T2 M6 D1", "T2 D1 M6", "M6 D1 T2"):
        p = read(f"{words}\nG0 X1 Y1 Z9", "siemens")
        assert p.tool[-1] == 2 and not p.remarks, words


def test_a_preselected_tool_is_loaded_by_m6():
    p = read("T2\nG0 X1\nM6\nG1 X2 Y1 Z5", "siemens", radii=RADII)
    assert p.tool[p.line == 7][0] == 1 and p.tool[-1] == 2


REFUSED = [
    ("EXTCALL \"PART\"", "EXTCALL"), ("POCKET4(5,0,1,-9,20,0,0,5)", "POCKET4( ) (a pocket)"),
    ("SLOT1(1)", "slots on a circle"),
    ("CYCLE90(1)", "thread milling"), ("CYCLE97(1)", "a thread"), ("L99", "subprogram L99 is not in this file"),
    ("KONT", "KONT (another approach"), ("BSPLINE X1", "a spline"), ("G58 X1", "programmable work offset"),
    ("G33 Z1 K1", "thread cutting"), ("G1 X9 F9 RND=20\nY9", "does not fit"),
    ("G1 X9 F9 CHR=2\nTRANS X1", "TRANS between a corner"),
    ("X=R5", "R5 has no value yet"), ("DIAMON", "X by the diameter"),
    ("POS[X]=5", "POS (a positioning axis)"), ("ORIRESET(0,0)", "a turn of the tool"),
    ("WAITM(1,1,2)", "another channel"),
    ("G1 X5 AR=90", "AR= is used by no word"), ("G91 G3 X5 Y5 AR=90", "AR= in incremental"),
    ("G3 X5 Y5 AR=360", "AR= in"),
    ("G3 X5 Y5 I2 J2 AR=90", "both the end and the centre"), ("G1 X5 RND=1 FB=9\nY5", "a corner"),
    ("TRAORI", "TRAORI turns"),
    ("G1 X5 F9 F8", "F appears twice"),
    ("G1 X=1/0", "has no value"), ("X=$AA_IM[X]", "$AA_IM[X] is a value of the control"),
    ("$P_UIFR[1,X,TR]=5", "$P_UIFR is set"),
    ("GOTOF ENDE", "no such label"), ("WAYTO", "no subprogram of this file"), ("M98 P1", "M98 (a call of ISO mode)"),
    ("D2", "first cutting edge"),
    ("ENDWHILE", "has no counterpart"), ("ROT X30", "tilts the coordinates"), ("G500\nX1",
                                                                               "G500 without a work offset"),
    ("A3=0 B3=0 C3=1 X1", "no rotary axes"), ("CYCLE81(5,0,1)", "without a depth"),
    ("CYCLE81(5,0,1,3)", "above the place"),
    ("CYCLE801(1)", "a pattern of holes"), ("CALL BLOCK A TO B", "is not a variable"), ("G1 X=(1", "')' is missing"),
    ("CT X5 Y5", "no move came before"), ("G1 X=\"A\"", "a text"),
    ("/IF R1==1", "a / before IF"), ("DEF FRAME F", "cannot read")
]


@pytest.mark.parametrize("corner", ["X20 RND=3\nX20\nY20", "X20\nX20 CHF=3\nY20", "X20\nX21 RND=9\nY20"])
def test_a_corner_that_does_not_go_is_told_with_its_own_line(corner):
    line = 3 + next(k for k, text in enumerate(corner.split("\n")) if "=" in text)
    with pytest.raises(ProgramError, match=f"line {line}: a "):
        read_program(f"G710 G17 G90 G54\nG0 X0 Y0 Z9\nG1 F99 {corner}\nM30\n", dialect="siemens", radii=RADII)


@pytest.mark.parametrize(("line", "said"), REFUSED)
def test_what_is_not_followed_is_named_with_its_line(line, said):
    with pytest.raises(ProgramError, match=re.escape(said)) as refused:
        read_program(f"G710 G17 G90 G54\nG0 X0 Y0 Z9\n{line}\nM30\n",
                     dialect="siemens", names=NAMES, radii=RADII)
    assert re.search("line [3456]", refused.value.message)


def test_a_loop_without_end_is_bounded(monkeypatch):
    monkeypatch.setattr(siemens_flow, "MAX_JUMPS", 1000)
    with pytest.raises(ProgramError, match="jumps") as refused:
        read("R1=1\nAA: R1=R1+1\nGOTOB AA", "siemens")
    assert refused.value.code == "program_too_long" and refused.value.limit == 1000


@pytest.mark.parametrize("block", ["R1=5 G1 Z=R1", "G1 Z=-R1 R1=5", "R1=5 G1 X=AC(R1*2)", "R[1]=5 G1 X=R[1]",
                                   "DEPTH=5 G1 Z=DEPTH", "R1=5 F=R1 X1"])
def test_a_variable_is_not_set_and_read_in_one_block(block):
    with pytest.raises(ProgramError, match="is set and read in one block"):
        read(f"DEF REAL DEPTH\nR1=1 R11=2\n{block}", "siemens")


def test_a_block_that_sets_a_variable_may_read_others_and_set_more():
    p = read("R1=2 R11=3\nR1=5 R2=R1+1 G1 X=R11 F100\nG1 X=R1 Y=R2", "siemens")
    assert p.end[-2:, 0].tolist() == [3.0, 5.0] and p.end[-1, 1] == 6.0
    assert len(read('R1=2 MSG("R1 is 2")\nG1 X=R1 F100', "siemens"))


@pytest.mark.parametrize("loop", ["AA: R1=1\nGOTOB AA", "AA: G1 X10 F100\nG1 X0\nGOTOB AA",
                                  "R1=1\nGOTOS\nIF R1==2 GOTOS"])
def test_a_jump_back_that_finds_all_as_it_was_has_no_end(loop):
    """200,000 rounds of a short loop took minutes."""
    with pytest.raises(ProgramError, match="as they were the time before") as refused:
        read(loop, "siemens")
    assert refused.value.code == "program_too_long" and refused.value.measured <= 3


def test_a_loop_that_goes_on_in_steps_is_read_to_its_end():
    """No variable changes, but the place does: a loop asks for it, and leaves."""
    p = read("G91\nAA: G1 X2 F100\nIF $AA_IW[X]<9 GOTOB AA\nG90", "siemens")
    assert p.end[-1][0] == 10.0 and (np.diff(p.end[:, 0])[-4:] == 2.0).all()


def test_gotos_at_the_end_of_the_main_program_is_read_as_m99():
    text = "G710 G17 G90 G94 G54\nT1 M6 ; if worn, change\nS900 M3\nG0 X0 Y0 Z9\nG1 Z1 F100\nX5\nG0 Z9\nGOTOS\nM30\n"
    p = read_program(text, dialect="siemens")
    once = read_program(text.replace("GOTOS\n", ""), dialect="siemens")
    assert p.end.tolist() == once.end.tolist()
    assert any("GOTOS begins the main program again without end" in note for note in p.notes)
    left = read_program(text.replace("G0 X0 Y0 Z9\n", "G0 X0 Y0 Z9\nG91 G1 X1 F100\n").replace("G17 G90", "G17"),
                        dialect="siemens")
    assert any("the program begins again with what it has left" in str(r) for r in left.remarks)


def test_deep_calls_are_bounded():
    with pytest.raises(ProgramError, match="nested calls"):
        read("L1\nM30\nPROC L1\nL1\nRET", "siemens")


def test_programs_of_one_file():
    text = ("%_N_MAIN_MPF\n;$PATH=/_N_WKS_DIR\nG710 G17 G90 G94 G54\nT1 M6\nS900 M3 F100\nG0 X0 Y0 Z9\nL20 "
            "P2\nHOLE\nM30\n"
            "%_N_L20_SPF\nG1 X=IC(2)\nM17\n%_N_HOLE_SPF\n; a hole\nPROC HOLE\nG1 Z-1\nRET\n")
    p = read_program(text, dialect="siemens")
    assert p.end[-1].tolist() == [4.0, 0.0, -1.0] and dialect_of(text) == "siemens"
    assert p.line.tolist()[-3:] == [11, 11, 16]


AXIS = np.array([0.3, -0.4, 0.87])


@pytest.mark.parametrize("kind", ["table-table-AC", "table-table-BC", "head-head-BC", "head-table-BC"])
def test_vectors_turn_the_tool_along_a_great_circle(kind):
    axis = AXIS / np.linalg.norm(AXIS)
    words = " ".join(f"{k}3={v:.9f}" for k, v in zip("ABC", axis, strict=True))
    p = read(f"TRAORI\nG54\nORIWKS\nG0 X0 Y0 Z9\nG1 X20 Y10 Z5 {words}\nX0 A3=0 B3=1 C3=1", "siemens", kind)
    assert np.allclose(p.poses.end_axis[p.line == 10][-1], axis, atol=1e-8)
    first = p.line == 10
    normal = np.cross([0, 0, 1], axis)
    assert np.abs(p.poses.end_axis[first] @ normal).max() < 1e-6  # in the plane of both ends
    last = p.line == 11
    b = np.array([0.0, 1.0, 1.0]) / math.sqrt(2)
    normal = np.cross(axis, b)
    assert np.abs(p.poses.end_axis[last] @ normal).max() < 5e-5 and last.sum() > 10
    share = (p.end[last, 0] - 20.0) / -20.0
    angle = np.arccos(np.clip(p.poses.end_axis[last] @ axis, -1, 1))
    whole = np.arccos(axis @ b)
    assert np.abs(angle - share * whole).max() < 5e-5  # evenly along the path


def test_axes_that_turn_evenly():
    """ORIMKS: the middle of the block has the middle of the angles."""
    p = read("TRAORI\nG54\nORIMKS\nG0 X0 Y0 Z9 A0 C0\nG1 X20 A20 C40", "siemens", "table-table-AC")
    k = np.argmin(np.abs(p.end[:, 0] - 10.0))
    assert np.allclose(p.poses.end_turn[k], np.radians([10.0, 20.0]) * p.end[k, 0] / 10.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["table-table-AC", "table-table-BC", "head-head-BC"])
def test_cycle800_turns_the_axes_and_keeps_the_tip(kind):
    """The swivelled plane holds the same places as TRAORI with vectors."""
    a, b = math.radians(20.0), math.radians(30.0)
    rx = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    ry = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    plane = rx @ ry
    shift = np.array([5.0, 6.0, 7.0])
    p = read('CYCLE800(1,"TC1",200000,57,5,6,7,20,30,0,0,0,0,-1,0,1)\nG0 X10 Y20\nZ30\nG1 Z-2\nG2 X20 Y20 I5 J0\n'
             "CYCLE81(30,0,2,-4)\nG0 G53 Z0\nCYCLE800()", "siemens", kind)
    places = {9: (10, 20, -2), 10: (20, 20, -2)}
    for line, q in places.items():
        assert np.allclose(p.end[p.line == line][-1], plane @ np.array(q) + shift, atol=1e-6), line
        assert np.allclose(p.poses.end_axis[p.line == line][-1], plane[:, 2], atol=1e-9)
    arc = p.end[p.line == 10] - shift
    assert np.allclose(np.linalg.norm(arc @ plane - np.array([15, 20, -2]), axis=1), 5.0, atol=1e-6)
    assert np.allclose(p.end[p.line == 11][-1], plane @ np.array([20, 20, 30]) + shift, atol=1e-6)
    unknown = p.unknown[p.line[p.unknown[:, 0]] == 8]
    assert len(unknown) == 1  # the way down begins at home


def test_case_files_are_read():
    """The plate program of a shop, and a five-axis program with vectors."""
    path = CASES / "nc" / "siemens_typical.mpf"
    if not path.exists():
        pytest.skip("shared cases are not here")
    p = read_program(path.read_text(), dialect="siemens", names={"FRAESER_D10": 10}, radii={10: 5.0}, tools={10})
    def of(line):
        return p.end[p.line == line]

    assert (p.tool == 10).all() and of(17)[-1].tolist() == [10.0, 10.0, -2.0]
    assert np.allclose(np.linalg.norm(of(18)[:, :2] - [15.0, 10.0], axis=1), 5.0)
    assert of(22)[-1].tolist() == [20.0, 0.0, 10.0] and of(25)[-1].tolist() == [20.0, 0.0, -3.0]
    text = (CASES / "nc" / "s_traori_vec.mpf").read_text()
    q = read_program(text, dialect="siemens", kinematics=Kinematics("table-table-AC"), tools={1})
    axis = np.array([0.0152, -0.0858, 0.9962])
    assert np.allclose(q.poses.end_axis[-1], axis / np.linalg.norm(axis)) and q.end[-1].tolist() == [20.0, 5.0, 40.0]


def test_a_limit_of_the_spindle_holds_before_and_behind_it():
    for opening in ("G26 S20\nS6000 M3\n", "S6000 M3\nG26 S20\n"):
        p = read(f"{opening}G1 X5 F100\nS10\nX10\nG4 S100\nG26 S500\nS400\nX15\n", "siemens")
        assert p.speed[p.kind == FEED].tolist() == [20.0, 10.0, 400.0]


def test_a_least_speed_of_the_spindle_raises_slower_ones():
    for opening in ("G25 S2000\nS600 M3\n", "S600 M3\nG25 S2000\n"):
        p = read(f"{opening}G1 X5 F100\nS3000\nX10\nG4 S100\nG26 S2500\nX12\nG25 S10\nS400\nX15\n", "siemens")
        assert p.speed[p.kind == FEED].tolist() == [2000.0, 3000.0, 2500.0, 400.0]
    still = read("G25 S2000\nM3 S0\nG1 X5 F100\n", "siemens")
    assert still.remarks[0].message.startswith("a feed move with the spindle standing")


def test_rapids_of_their_own_speed_are_told():
    assert read("RTLIOF\nG0 X5 Y9\n", "siemens").own_speed
    assert not read("RTLION\nG0 X5 Y9\n", "siemens").own_speed


@pytest.mark.parametrize("word", ["DIAMON", "DIAM90"])
def test_diameters_are_refused(word):
    with pytest.raises(ProgramError, match="diameter"):
        read(f"{word}\nG1 X5 F100\n", "siemens")


def test_a_programmed_override_counts_as_feed():
    p = read("G1 X10 F100\nOVR=200\nX20\nOVR=50 X30\nG95 F0.1\nX40\nG94 F100\nOVR=100\nX50", "siemens")
    feed = p.feed[p.kind == FEED]
    assert feed[:3].tolist() == [100.0, 200.0, 50.0] and feed[-1] == 100.0
    speed = p.speed[p.kind == FEED][3]
    assert feed[3] == pytest.approx(0.05 * speed)
    with pytest.raises(ProgramError, match="OVR=201 is not above 0 and up to 200"):
        read("OVR=201\nG1 X1 F100", "siemens")


@pytest.mark.parametrize(("line", "told"), [("G18", True), ("G19 G2 Y1 Z49 J0 K-1 F9", True), ("G17", False)])
def test_the_axis_of_the_length_is_told_where_the_plane_changes(line, told):
    """Programming Manual: in G18 length 1 of a mill counts in Y, in G19 in X, unless SD42940 is set."""
    assert [str(a.what) for a in read(line + "\nG1 X3 F9", "siemens").open] == ["length_axis"] * told


@pytest.mark.parametrize(("words", "told"), [("3,3,0,0,0", 1), ("3,0,0.2,0,0", 1), ("3", 0)])
def test_the_shift_of_a_boring_bar_is_told(words, told):
    notes = read(f"F50\nCYCLE86(30,0,2,-4,,0,{words})", "siemens").notes
    assert sum("CYCLE86 is read without its shift" in note for note in notes) == told


@pytest.mark.parametrize(("lines", "stands"), [
    ("CYCLE86(30,0,2,-4,,0,3,0,0,0,0)", True), ("CYCLE87(30,0,2,-4,,3)", True), ("CYCLE88(30,0,2,-4,,0,3)", True),
    ("CYCLE84(5,0,2,-10,,,5,,1.25,,400)", True), ("CYCLE84(5,0,2,-10,,,3,,1.25,,400)", False),
    ("CYCLE84(5,0,2,-10,,,,,1.25,,400)", True), ("CYCLE840(5,0,2,-10,,,4,5,,,1)", True),
    ("CYCLE840(5,0,2,-10,,,4,3,,,1)", False), ("G331 Z-10 K1.5 S200\nG332 Z5 K1.5", True),
    ("G63 Z-10 F9\nG63 Z5", False),
    ("MCALL CYCLE86(30,0,2,-4,,0,3,0,0,0,0)\nX5\nMCALL", True), ("CYCLE85(5,0,1,-4,,0,100,400)", False)])
def test_the_spindle_behind_a_cycle_turns_or_stands_as_the_manual_has_it(lines, stands):
    """Programming Manual: 86 ends in SPOS, 87 and 88 in M5, SDAC counts behind 84 and 840, G332 stands."""
    for again in ("", "M3\n"):
        p = read(f"F50\n{lines}\n{again}G1 X9 F200", "siemens")
        told = [r.line for r in p.remarks if "spindle standing" in r.message]
        assert told == ([5 + lines.count("\n") + 3] if stands and not again else []), p.remarks
    stood = read(f"F50\nM5\n{lines}", "siemens")
    alone = lines.startswith(("CYCLE86", "CYCLE87", "CYCLE88", "CYCLE84(", "MCALL", "G331"))
    assert any("spindle standing" in r.message for r in stood.remarks) != alone


@pytest.mark.parametrize(("line", "stands"), [
    ("SPOS=0", True), ("SPOS[1]=0", True), ("R1=1\nSPOSA[R1]=DC(90)", True), ("SPOS[2]=0", False)])
def test_a_positioned_spindle_stands(line, stands):
    """SPOS[n] is the spindle n; the first one is the master."""
    for again in ("", "M3\n"):
        p = read(f"F50\n{line}\n{again}G1 X9", "siemens")
        assert any("spindle standing" in r.message for r in p.remarks) == (stands and not again)


@pytest.mark.parametrize(("line", "back"), [
    ("CYCLE86(30,0,2,-4,,0,4)", True), ("CYCLE84(5,0,2,-10,,,4,,1.25,,400)", True), ("CYCLE86(30,0,2,-4,,0,3)", False)])
def test_a_cycle_that_turns_the_spindle_backwards_is_told_as_m4_is(line, back):
    assert (read(f"F50\n{line}\nG1 X9 F100", "siemens").reversed_by[-1] > 0) == back


@pytest.mark.parametrize("condition", ["R1>0.3", "0.3<R1"])
def test_a_comparison_that_machine_data_decide_is_refused(condition):
    """0.1 * 3 is greater than 0.3 by rounding alone; >= and == take both for one number on every control."""
    with pytest.raises(ProgramError, match="machine data decide"):
        read(f"R1=0.1*3\nIF {condition}\nG1 X1 F99\nENDIF", "siemens")
    assert len(read("R1=0.1*3\nIF R1>=0.3\nG1 X7 F99\nENDIF\nIF R1>0.2\nG1 X8 F99\nENDIF", "siemens")) == 3


@pytest.mark.parametrize("planes", ["5,6,1,-2", "6,6,1,,8"])
def test_a_retraction_plane_below_the_reference_plane_is_an_alarm(planes):
    with pytest.raises(ProgramError, match="alarm 61101"):
        read(f"F50\nCYCLE81({planes})", "siemens")


def test_another_master_spindle_is_refused():
    with pytest.raises(ProgramError, match=r"SETMS\(2\): another spindle becomes the master"):
        read("SETMS(2)", "siemens")
    for line in ("SETMS", "SETMS(1)", "SETMS()"):
        assert not read(f"{line}\nG1 X1", "siemens").remarks


@pytest.mark.parametrize(("body", "z"), [("TRANS", -1.0), ("TRANS Z-5", -1.0), ("ATRANS Z-5", -1.0), ("", -1.0)])
def test_save_brings_the_frame_back(body, z):
    p = read(f"TRANS Z-1\nUP1\nG1 X5 Z0\nM30\nPROC UP1 SAVE\n{body}\nG0 Z2\nRET", "siemens")
    assert p.end[-1].tolist() == [5.0, 0.0, z]
    p = read(f"UP1\nG1 X5 Z0\nM30\nPROC UP1 SAVE\n{body}\nG0 Z2\nRET", "siemens")
    assert p.end[-1].tolist() == [5.0, 0.0, 0.0]
    p = read(f"TRANS Z-1\nUP1\nG1 X5 Z0\nM30\nPROC UP1\n{body}\nRET", "siemens")
    assert p.end[-1, 2] == {"TRANS": 0.0, "TRANS Z-5": -5.0, "ATRANS Z-5": -6.0, "": -1.0}[body]


def test_save_brings_unit_and_kind_of_feed_back():
    p = read("UP1\nG1 X5 F100\nM30\nPROC UP1 SAVE\nG95 G700\nRET", "siemens")
    assert p.end[-1, 0] == 5.0 and p.feed[-1] == 100.0
    for word in ("G55", "G41 G1 X9"):
        with pytest.raises(ProgramError, match="a subprogram with SAVE changes the work offset"):
            read(f"UP1\nM30\nPROC UP1 SAVE\n{word}\nRET", "siemens")


@pytest.mark.parametrize(("word", "why"), [
    ("SVC=1", "a cutting rate"), ("FLIN", "changes along its move"), ("G1 X1 F5 FCUB", "changes along its move"),
    ("LIMS=100", "a limit of the spindle"), ("G962", "constant cutting speed"), ("OVRA[S1]=10", "slow the spindle"),
    ("VELOLIM[S1]=10", "slow the spindle"), ("VELOLIM[SPI(1)]=10", "slow the spindle"),
    ("OVRA=10", "slow the spindle")])
def test_words_that_part_feed_and_speed_from_f_and_s_are_refused(word, why):
    with pytest.raises(ProgramError, match=why):
        read(f"{word}\nG1 X1", "siemens")


def test_limits_of_axes_are_read():
    assert len(read("VELOLIM[X]=50 OVRA[C]=50\nFL[Y]=10\nACC[X]=80\nFNORM\nG1 X1 F500", "siemens"))


@pytest.mark.parametrize("lines", ["CTOL=1\nCOMPCAD", "COMPCAD\nCTOL=1", "COMPCAD CTOL=1", "G642\nG1 X1\nCTOL=1",
                                   "G641 ADIS=1", "G641 ADIS=0.001\nG1 X1\nADIS=1", "ADIS=1\nG641",
                                   "G641 ADIS=0.001\nG9 G1 X1\nADIS=1",
                                   # MD20480 decides whether ADIS counts here, and the larger one of both is read
                                   "G642 ADIS=1", "G643\nG1 X1\nADISPOS=1", "ADIS=1\nG644", "G645\nG9 X1\nADIS=1",
                                   "CTOL=0.001\nG642\nADIS=1", "G642\nADIS=1\nCTOL=0.001"])
def test_a_tolerance_counts_wherever_it_stands(lines):
    p = read(f"{lines}\nG1 X5 F100", "siemens")
    assert any("lets the control leave the path by 1 mm" in r.message for r in p.remarks)


@pytest.mark.parametrize("lines", ["CTOL=1", "ADIS=1", "G641 ADIS=0.001\nG60\nADIS=1", "COMPCAD\nG60\nCTOL=1",
                                   "COMPCAD CTOL=0.001\nADIS=1", "G642 ADIS=0.001\nG60\nADIS=1",
                                   "G642 ADIS=0.001"])
def test_a_tolerance_that_no_mode_uses_counts_not(lines):
    assert not any("leave the path" in r.message for r in read(f"{lines}\nG1 X5 F100", "siemens").remarks)


@pytest.mark.parametrize(("between", "told"), [("M8\nG4 F1\nM9", False), ("M8\nG4 F1\nM9\nG4 F1", True)])
def test_a_corner_behind_more_than_three_blocks_without_a_move_is_told(between, told):
    """MD20250: with more blocks than that the control gives alarm 10762 and stands in the cut."""
    p = read(f"G0 X-30\nG41 G1 X0 Y0 F100\nX20\n{between}\nY20\nG40 X-9", "siemens")
    assert any("without a move in the plane stand before this corner" in r.message for r in p.remarks) == told


@pytest.mark.parametrize(("words", "arc", "feed"), [
    ("", "G2 X31 Y-1 CR=1", 600.0), ("CFC", "G2 X31 Y-1 CR=1", 600.0), ("CFTCP", "G2 X31 Y-1 CR=1", 100.0),
    ("CFIN", "G2 X31 Y-1 CR=1", 100.0), ("CFTCP\nCFC", "G2 X31 Y-1 CR=1", 600.0), ("G451", "G2 X31 Y-1 CR=1", 600.0),
    ("", "G3 X40 Y10 CR=10", 100.0), ("", "G1 X31 Y-1", 100.0), ("F9900", "G2 X31 Y-1 CR=1", 14696.94),
    ("F20000", "G2 X31 Y-1 CR=1", 20000.0)])
def test_the_centre_is_faster_on_outside_arcs(words, arc, feed):
    """Manual: with CFC the centre runs at F (R + r) / R, here 6 F. A way of radius 6 takes sqrt(1e4 mm/s2 x 6 mm)."""
    p = read(f"G0 X0 Y20\nF100\n{words}\nG41 G1 X10 Y0\nX30\n{arc}\nG1 Y-50\nG40 X0", "siemens")
    assert p.feed[p.kind == FEED].max() == pytest.approx(feed)
    assert any("CFC" in note for note in p.notes) == (feed in (600.0, 14696.94))


def test_the_centre_is_no_faster_than_the_machine():
    p = read("G0 X0 Y20\nF1000\nG41 G1 X10 Y0\nX30\nG2 X31 Y-1 CR=1\nG1 Y-50\nG40 X0", "siemens", max_feed=2500.0)
    assert p.feed[p.kind == FEED].max() == 2500.0


@pytest.mark.parametrize(("condition", "holds"), [
    ("R1==0.3", True), ("R1<>0.3", False), ("R1<=0.3", True), ("0.3>=R1", True),
    ("R1==0.3000001", False), ("R1<=0.2999999", False)])
def test_comparisons_with_equality_are_relative(condition, holds):
    """Job Planning, precision correction on comparison errors: 1e-12; < and > compare all digits."""
    p = read(f"R1=0.1+0.2\nIF {condition}\nG1 X5\nELSE\nG1 X7\nENDIF", "siemens")
    assert p.end[-1, 0] == (5.0 if holds else 7.0)


@pytest.mark.parametrize(("kind", "lines", "right"), [
    ("table-table-AC", "TRAORI\nG54\nG0 A30 C0\nTRANS Z12\nAROT X-30", False),
    ("table-table-AC", "TRAORI\nG54\nG0 A30 C0\nCUT2D\nROT X-30", False),
    ("table-table-AC", "TRAORI\nG54\nG0 A30 C0\nCUT2DF\nROT X-30", True), ("table-table-AC", "ROT Z30", True),
    ("table-table-AC", 'CYCLE800(1,"",0,57,0,0,0,30,0,0,0,0,0,-1,,1)', True),
    ("head-head-AC", 'CYCLE800(1,"",0,57,0,0,0,30,0,0,0,0,0,-1,,1)', False),
    ("head-head-AC", 'CUT2DF\nCYCLE800(1,"",0,57,0,0,0,30,0,0,0,0,0,-1,,1)', True)])
def test_compensation_in_a_tilted_frame_needs_cut2df(kind, lines, right):
    text = f"{lines}\nG0 X0 Y0 Z90\nG1 G41 X20 F100\nX30\nG40 X50"
    if right:
        assert len(read(text, "siemens", kind))
        return
    with pytest.raises(ProgramError, match="in tilted coordinates without CUT2DF"):
        read(text, "siemens", kind)


@pytest.mark.parametrize(("lines", "axis"), [
    ("TRANS Z-0.5\nG91\nG1 X24 Z0", "Z"), ("TRANS X12\nG1 X=IC(2)", "X"), ("ROT Z30\nG91 G1 X5", "X"),
    ("TRANS X3\nG1 X9\nTRANS\nG91\nX5", "X"), ("T2 D1\nM6\nM3\nG91 G1 Z-1", "Z")])
def test_an_increment_behind_a_change_of_coordinates_is_refused(lines, axis):
    """SD42440 and SD42442: with 1 the control goes the change of the frame or the length with the next increment."""
    with pytest.raises(ProgramError, match=f"an increment of {axis} behind a change of its coordinates"):
        read(f"G0 X1 Y1 Z9\n{lines}", "siemens")


@pytest.mark.parametrize("lines", [
    "TRANS Z-0.5\nG1 Z8\nG91\nX24 Z1", "TRANS X12\nG1 X5\nX=IC(2)", "TRANS Z1\nG91 G1 X5", "TRANS Z0\nG91\nG1 Z1",
    "TRANS X3\nG1 X9\nTRANS\nX5\nG91\nX5"])
def test_an_increment_that_no_change_precedes_is_read(lines):
    assert len(read(f"G0 X1 Y1 Z9\n{lines}", "siemens"))


@pytest.mark.parametrize(("line", "said"), [("FGROUP(X)", "FGROUP( ) without X, Y and Z"), ("FGROUP(Z)", "FGROUP"),
                                            ("FGREF[C]=11", "turns faster than the degrees of F")])
def test_feeds_that_count_along_a_part_of_the_path_are_refused(line, said):
    with pytest.raises(ProgramError, match=re.escape(said)):
        read(f"{line}\nG1 X1", "siemens")
    for right in ("FGROUP()", "FGROUP(X,Y,Z)", "FGROUP(X, Y, Z, C)", "FGREF[C]=57.296", "FGREF[C]=100"):
        assert len(read(f"{right}\nG1 X1", "siemens"))


@pytest.mark.parametrize("word", ["G64", "G642", "G645"])
def test_rounding_that_machine_data_decide_is_a_note(word):
    p = read(f"{word}\nG1 X1", "siemens")
    assert not p.remarks and p.unbounded
    assert any("machine data decide how far the control rounds" in n for n in p.notes)


def test_a_further_fixed_point_is_refused():
    with pytest.raises(ProgramError, match="G75 FP=2: the proof does not know"):
        read("G75 FP=2 Z0", "siemens")
    assert len(read("G1 X1\nG75 FP=1 Z0", "siemens"))


def test_trunc_and_case_take_numbers_for_equal_as_comparisons_do():
    """Job Planning, precision correction: 0.3/0.1 and (0.1+0.1+0.1)*10 are 3, which they miss by a last digit."""
    assert read("R1=TRUNC(0.3/0.1)\nG1 X=R1 F100", "siemens").end[-1, 0] == 3.0
    assert read("R1=TRUNC(-2.9)\nG1 X=R1 F100", "siemens").end[-1, 0] == -2.0
    case = "CASE R1 OF 3 GOTOF AA DEFAULT GOTOF BB\nAA: G1 X5 F100\nGOTOF CC\nBB: G1 X7 F100\nCC: G4 F1"
    assert read(f"R1=(0.1+0.1+0.1)*10\n{case}", "siemens").end[-1, 0] == 5.0


@pytest.mark.parametrize(("unsure", "right"), [("ROUNDUP((0.1+0.2)*10)", "ROUNDUP(2.5)"), ("0.3 DIV 0.1", "7 DIV 2")])
def test_a_whole_number_that_rounding_decides_is_refused(unsure, right):
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read(f"R1={unsure}\nG1 X1 F9", "siemens")
    assert len(read(f"R1={right}\nG1 X1 F9", "siemens"))


@pytest.mark.parametrize(("lines", "plain", "corners"), [
    ("G1 X20 RND=2\nZ5", "G1 X20\nZ5", 1), ("G1 X20 CHF=2\nX30 Z40", "G1 X20\nX30 Z40", 1),
    ("G1 Z1 RND=2\nX4", "G1 Z1\nX4", 1), ("G1 X9 Z1 CHR=2\nX14", "G1 X9 Z1\nX14", 1),
    ("G1 X9 RND=2\nG18\nX12 Z45", "G1 X9\nG18\nX12 Z45", 1), ("G1 X9 RND=2\nG18 X12", "G1 X9\nG18 X12", 1),
    ("G1 X9 RND=2\nG17 Y9", "G1 X7\nG3 X9 Y2 I0 J2\nG1 Y9", 0),
    ("G1 X9 RND=2\nY9 RND=1\nZ9", "G1 X7\nG3 X9 Y2 I0 J2\nG1 Y9\nZ9", 1)])
def test_no_corner_next_to_a_move_that_leaves_the_plane(lines, plain, corners):
    p = read(lines, "siemens")
    assert apart(p, read(plain, "siemens")) < 1e-9 and not p.remarks
    assert sum("puts no corner here" in n for n in p.notes) == corners


def test_smoothing_of_the_tool_axis_moves_nothing():
    assert not read("ORISON\nG1 X3\nORISOF", "siemens").remarks


@pytest.mark.parametrize(("words", "degrees"), [
    ("ORISON\nOTOL=5", 5), ("OTOL=2\nCOMPCAD", 2), ("G642 OTOL=5", 5), ("CYCLE832(0.001,_ORI_FINISH,5)", 5),
    ("CYCLE832(0.001,11,3)", 3), ("R1=3\nCYCLE832(0.001,11,R1)", 3),
    ("ORISON OTOL=0.05", 0), ("OTOL=5", 0), ("ORISON OTOL=5\nORISOF", 0), ("COMPCAD OTOL=5\nCOMPOF", 0),
    ("CYCLE832(0.001,_ORI_FINISH,5)\nCYCLE832(0.001,_ORI_FINISH,0.05)", 0), ("CYCLE832(0.001,_FINISH,1)", 0)])
def test_a_tool_axis_that_may_lean_off_while_it_cuts_is_told(words, degrees):
    """The rim of T1, of radius 5, goes 5 sin(OTOL) off, and 0.01 mm is allowed."""
    head = "TRAORI\nG54\nORIMKS\nORIAXES\nG0 X0 Y0 Z9 A20 C0\n" + words + "\nG1 X20 "
    told = [r.message for r in read(head + "A25", "siemens", "table-table-AC").remarks if "off its way" in r.message]
    assert len(told) == (degrees > 0) and all(f"axis {degrees} deg off" in m for m in told)
    still = read(head + "Y5", "siemens", "table-table-AC").remarks
    assert not any("off its way" in r.message for r in still), "the axes stand"


def test_cycle800_without_its_last_argument():
    """As older controls have it, without the retract along the tool."""
    body = 'CYCLE800(1,"TC1",100000,57,0,0,0,20,30,0,0,0,0,-1{})\nG0 X10 Y20\nZ30\nG1 Z-2\nG0 G53 Z0\nCYCLE800()'
    both = [read(body.format(last), "siemens", "table-table-AC") for last in ("", ",0,1")]
    assert apart(*both) == 0.0


@pytest.mark.parametrize(("edited", "plain"), [
    ('CYCLE84(5,0,2,-10,,0,5,,1.25,0,200,200,0,1,0,0,5,1.4,,"ISO_METRIC","M8",,1001,1002)',
     "CYCLE84(5,0,2,-10,,0,5,,1.25,0,200,200)"),
    ('CYCLE840(5,0,2,-10,,0,4,3,0,,1.25,0,1,0,"","ISO_METRIC","M8",,1,1002)',
     "CYCLE840(5,0,2,-10,,0,4,3,0,,1.25)"),
    ("MCALL CYCLE81(5,0,2,-4)\nHOLES1(1,2,30,5,10,3,0,0,,,1)\nMCALL",
     "MCALL CYCLE81(5,0,2,-4)\nHOLES1(1,2,30,5,10,3)\nMCALL"),
    # 1000 is a full circle, whatever INDA; 2000 a part of one, in steps of INDA
    ("MCALL CYCLE81(5,0,2,-4)\nHOLES2(1,2,10,30,45,4,1000,0,,,1)\nMCALL",
     "MCALL CYCLE81(5,0,2,-4)\nHOLES2(1,2,10,30,90,4)\nMCALL"),
    ('MCALL CYCLE81(5,0,2,-4)\nHOLES2(1,2,10,30,45,4,2000,0,"",,1)\nMCALL',
     "MCALL CYCLE81(5,0,2,-4)\nHOLES2(1,2,10,30,45,4)\nMCALL")])
def test_values_that_the_editor_of_the_control_adds_change_no_move(edited, plain):
    first, second = (read(f"S900 M3\n{c}\nM3\nG1 X0 F100", "siemens") for c in (edited, plain))
    assert apart(first, second) < 1e-9


@pytest.mark.parametrize(("call", "said"), [
    ("HOLES2(0,0,10,0,45,4,1010,0,,,1)", "along an arc"), ('HOLES2(0,0,10,0,0,4,1000,0,"0100",,1)', "hidden holes"),
    ("HOLES2(0,0,10,0,0,4,2000)", "kind 2000"), ("HOLES1(0,0,0,5,10,3,1000)", "kind 1000"),
    ("HOLES1(0,0,0,5,10,3,0,1)", "_UMODE=1")])
def test_rows_of_holes_in_other_ways_are_refused(call, said):
    with pytest.raises(ProgramError, match=said):
        read(f"S900 M3\nMCALL CYCLE81(5,0,2,-4)\n{call}\nMCALL", "siemens")


def test_a_text_in_the_place_of_a_depth_is_refused():
    with pytest.raises(ProgramError, match="where a number is needed"):
        read('S900 M3\nCYCLE84(5,0,2,"A",,0,5,,1.25,0,200,200)', "siemens")


def test_the_tolerance_of_cycle832_may_be_a_variable():
    """As the post of NX writes it."""
    body = "DEF REAL _camtolerance\nDEF INT _OFFMODE=0\n_camtolerance=0.004\nCYCLE832({})\nX1 Y1\nX2"
    by_name, plain, off = (read(body.format(c), "siemens") for c in (
        "_camtolerance,_FINISH,1", "0.004,_FINISH,1", "_camtolerance,_OFFMODE,1"))
    assert by_name.leaves == plain.leaves == 0.004 and not by_name.unbounded and off.unbounded
    with pytest.raises(ProgramError, match="not a variable of the program"):
        read("CYCLE832(TOL,_FINISH,1)\nX1", "siemens")
