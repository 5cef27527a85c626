"""Words of Fanuc and Haas as shops write them: places by hand, and what is refused by name."""

from pathlib import Path

import numpy as np
import pytest

from geometry.errors import ProgramError
from verify.gcode.dialects.fanuc import REFUSED
from verify.gcode.dialects.haas import WORDS
from verify.gcode.reader import FEED, read_program
from verify.kinematics import Kinematics

HEAD = "%\nO1000\nG21 G90 G17\nT1 M6\nS1000 M3\nG0 G54 X0 Y0\nG43 H1 Z10.\n"
F = " F100."


def read(body, dialect="fanuc", **options):
    return read_program(HEAD + body + "M30\n%\n", dialect=dialect, **options)


def ends(body, dialect="fanuc", feeds=True, **options):
    p = read(body, dialect, **options)
    keep = (p.line > 7) & ((p.kind == FEED) | (not feeds))
    return p.end[keep].round(6).tolist()


@pytest.mark.parametrize(("body", "expected"), [
    # a quarter turn about a place: (20, 10) about (10, 10) becomes (10, 20)
    ("G68 X10. Y10. R90.\nG1 X20. Y10. F100.\nX20. Y20.\nG69\nX0. Y0.\n", [[10, 20, 10], [0, 20, 10], [0, 0, 10]]),
    ("G1 X5. Y0. F100.\nG68 R90.\nX6.\nG69\n", [[5, 0, 10], [5, 1, 10]]),
    ("G51 X10. Y0. Z0. P2.\nG1 X15. Y5. Z1. F100.\nG50\nX0.\n", [[20, 10, 2], [0, 10, 2]]),
    ("G51 X0. Y0. Z0. I2. J3. K1.\nG1 X1. Y1. F100.\nG50\n", [[2, 3, 10]]),
    ("G51.1 X10.\nG1 X3. Y4. F100.\nG50.1 X0.\nX3.\n", [[17, 4, 10], [3, 4, 10]]),
    ("G51.1 X0. Y0.\nG1 X3. Y4. F100.\nG50.1 X0.\nX3. Y4.\nG50.1 X0. Y0.\nX1. Y1.\n",
     [[-3, -4, 10], [3, -4, 10], [1, 1, 10]]),
    # scale before rotation: (1, 2) -> (2, 4) -> (-4, 2); mirror before scale: (1, 2) -> (-1, 2) -> (-2, 4)
    ("G51 X0. Y0. Z0. P2.\nG68 X0. Y0. R90.\nG1 X1. Y2. Z5. F100.\nG69\nG50\n", [[-4, 2, 10]]),
    ("G51.1 X0.\nG51 X0. Y0. Z0. P2.\nG1 X1. Y2. Z5. F100.\nG50\nG50.1 X0.\n", [[-2, 4, 10]]),
    ("G52 X100. Y0.\nG68 X10. Y10. R90.\nG1 X20. Y10. F100.\nG69\nG52 X0. Y0.\n", [[110, 20, 10]]),
    ("G16\nG1 X10. Y90. F100.\nX10. Y0.\nG15\nX3. Y3.\n", [[0, 10, 10], [10, 0, 10], [3, 3, 10]])])
def test_coordinates_turned_scaled_and_mirrored(body, expected):
    np.testing.assert_allclose(ends(body), expected, atol=1e-6)


@pytest.mark.parametrize("words", [
    "G51.1 X0.\nG68 X0. Y0. R30.\n", "G68 X0. Y0. R30.\nG51.1 X0.\n", "G51 X0. Y0. Z0. P2.\nG51.1 X0.\n",
    "G51.1 X0.\nG68 X0. Y0. R30.\nG50.1\n", "G51.1 X0.\nG1 X3. Y4. F100.\nG50.1\nX3.\n",
    "G51.1 X0.\nG1 X3. Y4. F100.\nG54\nX3.\n", "G68 X0. Y0. R30.\nG55\nG1 X3. Y4. F100.\n",
    "G51 X0. Y0. Z0. I2. J2. K1.\nG68 X10. Y0. R90.\n"])
def test_orders_of_turns_scales_and_mirrors_that_controls_read_differently_are_refused(words):
    with pytest.raises(ProgramError, match="while a rotation|in a mirror|in a scale|without axes|while the coord"):
        read(f"G1 X1. Y1. F100.\n{words}G1 X1. Y2.\n")


def test_a_level_plane_needs_no_rotary_axes():
    level = "G68.2 X10. Y5. Z1. I0. J0. K90.\nG53.1\nG1 X3. Y0. Z2. F100.\nG69\nX0.\n"
    np.testing.assert_allclose(ends(level), [[10, 8, 3], [0, 8, 3]], atol=1e-9)
    with pytest.raises(ProgramError, match="G53.1 turns the tool axis, and the machine has no rotary axes"):
        read(level.replace("J0.", "J5."))


def test_mirrors_of_haas():
    np.testing.assert_allclose(ends("G101 X0.\nG1 X3. Y4. F100.\nG100 X0.\nX3.\n", "haas"), [[-3, 4, 10], [3, 4, 10]])


def test_arcs_turn_the_other_way_in_a_mirror():
    """A quarter counterclockwise about the zero from (5, 0) is, mirrored at X0, clockwise from (-5, 0)."""
    p = read("G51.1 X0.\nG1 X5. Y0. F100.\nG3 X0. Y5. I-5.\nG50.1 X0.\n")
    arc = p.end[p.line == 10]
    np.testing.assert_allclose(np.hypot(arc[:, 0], arc[:, 1]), 5, atol=1e-9)
    np.testing.assert_allclose(arc[-1], [0, 5, 10], atol=1e-9)
    assert (arc[:, 0] < 1e-9).all() and len(arc) > 5


def test_compensation_changes_its_side_in_a_mirror():
    body = "G51.1 X0.\nG41 D1 G1 X5. Y0. F100.\nX20.\nG40 X30. Y10.\nG50.1 X0.\n"
    np.testing.assert_allclose(ends(body, radii={1: 2.0}), [[-5, 2, 10], [-20, 2, 10], [-30, 10, 10]], atol=1e-9)
    turned = "G68 X0. Y0. R90.\nG41 D1 G1 X5. Y0. F100.\nX20.\nG40 X30. Y10.\nG69\n"
    np.testing.assert_allclose(ends(turned, radii={1: 2.0}), [[-2, 5, 10], [-2, 20, 10], [-10, 30, 10]], atol=1e-9)


@pytest.mark.parametrize(("body", "expected"), [
    # the first G54 written is the zero of the setup; G55 is 100 mm beside it
    ("G10 L2 P1 X-300. Y-200. Z-400.\nG10 L2 P2 X-200. Y-200. Z-400.\nG0 X1. Y1. Z9.\nG1 X5. F100.\nG55 G1 X5.\n",
     [[5, 1, 9], [105, 1, 9]]),
    ("G10 L2 P2 X-200. Y-200. Z-400.\nG10 L2 P1 X-300. Y-200. Z-400.\nG0 X1. Y1. Z9.\nG55 G1 X5. F100.\n",
     [[105, 1, 9]]),
    ("G10 L2 P1 X-300. Y-200. Z-400.\nG0 X1. Y1. Z9.\nG1 X5. F100.\nG10 L2 P1 X-290. Y-200. Z-400.\nX5.\n",
     [[5, 1, 9], [15, 1, 9]]),
    ("G10 L2 P1 X-300. Y0 Z0\nG0 X1. Y1. Z9.\nG91 G10 L2 P1 X10.\nG90 G1 X5. F100.\n", [[15, 1, 9]]),
    ("G52 X10. Z-1.\nG1 X5. Z0 F100.\nG52 X0 Z0\nX5. Z0\n", [[15, 0, -1], [5, 0, 0]]),
    # lengths: wear moves the tip, the first geometry is the tool's own length
    ("G10 L11 P1 R0.2\nG43 H1\nG1 Z1. F100.\n", [[0, 0, 1.2]]),
    ("G10 L10 P1 R150.\nG43 H1\nG1 Z1. F100.\nG10 L10 P1 R150.5\nG43 H1\nZ1.\n", [[0, 0, 1], [0, 0, 1.5]]),
    # in G91 a value is added, the first one too
    ("G91 G10 L10 P1 R-1.\nG90\nG43 H1\nG1 Z1. F100.\n", [[0, 0, 0]]),
    ("G91 G10 L10 P1 R-1.\nG10 L10 P1 R0.5\nG90\nG43 H1\nG1 Z1. F100.\n", [[0, 0, 0.5]]),
    ("G91 G10 L10 P1 R-1.\nG90 G10 L10 P1 R150.\nG43 H1\nG1 Z1. F100.\n", [[0, 0, 1]]),
    ("G10 L10 P1 R150.\nG91 G10 L10 P1 R-1.\nG90\nG43 H1\nG1 Z1. F100.\n", [[0, 0, 0]]),
])
def test_tables_that_the_program_writes(body, expected):
    head = HEAD.replace("G0 G54 X0 Y0\nG43 H1 Z10.\n", "G54\n" if "L2" in body else "G0 G54 X0 Y0\nG43 H1 Z10.\n")
    p = read_program(head + ("G43 H1\n" if "L2" in body else "") + body + "M30\n%\n", dialect="fanuc")
    np.testing.assert_allclose(p.end[p.kind == FEED], expected, atol=1e-9)
    assert not [r for r in p.remarks if "work offset" in r.message], p.remarks


def test_a_register_of_no_tool_is_the_length_of_the_one_in_the_spindle():
    """H51 with T1 is a habit; H2 with T1 is the length of another tool of the setup."""
    assert read("G43 H51\nG1 Z1. F100.\n", tools={1, 2}).remarks == ()
    assert any("H51 counts as the length of T1" in n for n in read("G43 H51\n", tools={1, 2}).notes)
    for h in (2, 5, 12):
        other = read(f"G43 H{h}\nG1 Z1. F100.\n", tools={1, 2})
        assert any(f"length offset H{h} with tool T1" in r.message for r in other.remarks)
    written = read("G10 L10 P7 R120.\nG43 H7\nG1 Z1. F100.\n", tools={1, 2})
    assert written.remarks == ()


R, Z0 = 2.0, -5.0


@pytest.mark.parametrize(("words", "dialect", "down", "up"), [
    ("G81 R2. Z-5.", "fanuc", [-5], []), ("G82 R2. Z-5. P500", "fanuc", [-5], []),
    ("G83 R2. Z-5. Q3000", "fanuc", [-1, -4, -5], []), ("G83 R2. Z-5. Q3.", "haas", [-1, -4, -5], []),
    ("G83 R2. Z-5. I3. J0.5 K1.", "haas", [-1, -3.5, -5], []), ("G73 R2. Z-5. Q3.", "fanuc", [-1, -4, -5], []),
    ("G84 R2. Z-5.", "fanuc", [-5], [2]), ("G74 R2. Z-5.", "fanuc", [-5], [2]), ("G85 R2. Z-5.", "fanuc", [-5], [2]),
    ("G86 R2. Z-5.", "fanuc", [-5], []), ("G76 R2. Z-5. Q0.2 P100", "fanuc", [-5], []),
    ("G89 R2. Z-5. P100", "fanuc", [-5], [10])])
def test_canned_cycles_are_rapids_and_feeds(words, dialect, down, up):
    """Rapid to R, feed down, feed or rapid up; G98 returns to the height before."""
    p = read(f"G98 {words} X5. Y5. F100.\nG80\n", dialect)
    assert p.end[p.kind == FEED][:, 2].tolist() == [*down, *up]
    assert p.end[-1].tolist() == [5, 5, 10] and R in p.end[:, 2]


def test_repeats_and_returns_of_cycles():
    """K of Fanuc and L of Haas repeat in G91; 0 only keeps the words; G99 stays at R."""
    assert [e[0] for e in ends("G99 G81 X0 Y0 Z-5. R2. F100. K0\nG91 X10. K3\nG90 G80\n")] == [10, 20, 30]
    assert [e[0] for e in ends("G99 G81 Z-5. R2. F100. L0\nX7.\nX9.\nG80\n", "haas")] == [7, 9]
    assert read("G99 G81 X1. Z-5. R2. F100.\nG80\n").end[-1].tolist() == [1, 0, 2]


@pytest.mark.parametrize("body", [
    "G5.1 Q1\nG1 X1. F100.\nG5.1 Q0\n", "G05 P10000\nG1 X1. F100.\nG05 P0\n", "G08 P1\nG1 X1. F100.\nG08 P0\n",
    "G61\nG1 X1. F100.\nG64\n", "G62\nG63\nG9 G1 X1. F100.\n", "G67 G69 G50 G15 G40 G49 G80\nG43 H1 G1 X1. F100.\n",
    "M88\nM29 S1000\nG1 X1. F100.\nM89\n", "G1 X1. A0. F100.\n", "(A (NESTED) COMMENT)\nG1 X1. F100. (END)\n",
    "G1 X1. F100. ;\n", "/M8\n/2 M8\nN10/M9\nG1 X1. F100.\n", "G97 S1000\nG1 X1. F100.\n", "g1 x1. f100.\n",
    "G1X1.F100.M8\n", "N0100 G01 X+1.000 F100.0\n", "<NAME>\nG1 X1. F100.\n", "G22\nG23\nG94.1\nG1 X1. F100.\n",
    "G1 X1. F100. ; END MILL 6\n; next\n;;\n", "G05.1 Q1 R5\nG1 X1. F100.\nG05.1 Q0\n", "G11\nG1 X1. F100.\n",
    "G22 X300. Y200. Z100. I-300. J-200. K-300.\nG1 X1. F100.\n", "M500 P2\nM83 P500 Q3\nG1 X1. F100. M59 P1134\n",
    "G1 X1. F100.\nG22 X300 Y200 Z100 I0 J0 K0\nG05.1 Q3 X0 Y0 Z0\n"])
def test_modes_comments_and_devices_move_nothing(body):
    p = read(body)
    assert p.end[p.kind == FEED].tolist() == [[1, 0, 10]] and p.remarks == ()


@pytest.mark.parametrize("change", [
    lambda t: t.replace("\n", "\r\n"), lambda t: t.replace("\n", "\r"), lambda t: "\ufeff" + t, lambda t: t + "\x1a",
    lambda t: "\x00\x00" + t + "\x00" * 9, lambda t: t.replace("%\n", "\n\n", 1).removesuffix("%\n"),
    lambda t: t.replace("O1000", ":1000"), lambda t: t.replace("O1000", "O1000(Fr\xe4sen)"),
    lambda t: t.replace("\n", "\r\r\n"), lambda t: t.removesuffix("%\n"), lambda t: t + "anything\n",
    lambda t: "PART 12, REV A\n\n(X)\n" + t, lambda t: t.replace("%\n", "%1000\n", 1)])
def test_line_ends_tape_codes_and_names_as_they_are(change):
    text = HEAD + "G1 X1. F100.\nX2.\nM30\n%\n"
    p = read_program(change(text), dialect="fanuc")
    assert p.end[p.kind == FEED].tolist() == [[1, 0, 10], [2, 0, 10]] and p.remarks == ()


def test_a_block_with_a_slash_is_a_remark_only_where_it_moves():
    assert any("depends on a switch" in r.message for r in read("/G1 X1. F100.\n").remarks)
    assert any("depends on a switch" in r.message for r in read("N5/2 G1 X1. F100.\n").remarks)


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("words", "told"), [
    ("S6000 M3", True), ("M3", True), ("2 M03", True), ("S6000", True), ("M5", True), ("M30", True), ("D1", True),
    ("M8", False), ("M1", False), ("M00", False), ("M31", False)])
def test_a_block_with_a_slash_is_a_remark_where_a_later_move_depends_on_it(dialect, words, told):
    p = read(f"/{words}\nG1 X1. F100.\n", dialect)
    assert any("depends on a switch" in r.message for r in p.remarks) == told


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_without_a_length_the_spindle_face_goes_to_the_height(dialect):
    """T1 is 56 mm long: G49 Z200 takes the tip up to 144, and G49 Z30 down to -26."""
    def body(words):
        return f"G1 X1. F100.\nG0 Z15.\n{words}\nX5. Y5.\n"
    for words in ("G49 Z200.", "G49\nZ200.", "G49\nG0 X2. Z200.", "G49 Z80.\nZ200."):
        p = read(body(words), dialect, lengths={1: 56.0})
        assert p.remarks == () and p.end[-1].tolist() == [5, 5, 144] and any("to Z144" in n for n in p.notes)
    again = read(body("G49 Z200.") + "G43 H1 Z15.\nG1 X9. F100.\n", dialect, lengths={1: 56.0})
    assert again.remarks == () and again.end[-1].tolist() == [9, 5, 15]
    for words, lengths in (("G49 Z30.", {1: 56.0}), ("G49 Z200.", {}), ("G49 Z70.999", {1: 56.0}),
                           ("G49\nG91 Z100.\nG90", {1: 56.0})):
        p = read(body(words), dialect, lengths=lengths)
        assert any("Z moves with the length offset off" in r.message for r in p.remarks), words


def test_a_place_of_the_machine_needs_no_g0_on_these_controls():
    p = read("G1 X1. F100.\nG53 Z0.\nG0 X5.\nG43 H1 Z5.\n")
    assert p.remarks == () and p.end[-1].tolist() == [5, 0, 5]


@pytest.mark.parametrize(("dialect", "way", "kept"), [
    ("fanuc", "G91 G28 Z0.\nG90\n", False), ("fanuc", "G28 G91 Z0.\nG90\n", False), ("fanuc", "G53 G0 Z0.\n", False),
    ("fanuc", "G91 G30 Z0.\nG90\n", False), ("fanuc", "G91 G28 Z0.\nG90\nG28 X0.\n", False),
    ("fanuc", "G0 Z50.\nG91 G28 X0. Y0.\nG90\n", True), ("fanuc", "G0 Z50.\nG53 G0 X0. Y0.\n", True),
    ("haas", "G91 G28 Z0.\nG90\n", False), ("haas", "G53 G0 Z0.\n", True), ("fanuc", "G90 G28 Z50.\n", False),
    ("haas", "G90 G28 Z50.\n", False)])
def test_a_way_home_in_z_drops_the_length_until_g43_with_h(dialect, way, kept):
    """Operator's manuals: Fanuc 0i-MB 14.1.2 (G28, G30 and G53 in the axis of the length), Haas (G28)."""
    body = "G1 X1. F100.\n" + way
    for after in ("G0 X5. Y5.\nZ5.\n", "G0 X5. Y5.\nG1 Z5. F100.\n"):
        told = [r.message for r in read(body + after, dialect).remarks]
        assert any("length offset off (no G43 H1 behind G" in m for m in told) != kept, told
    for after in ("G0 X5. Y5.\nG43 H1 Z5.\nZ4.\n", "G43 H1\nG0 X5. Y5.\nZ5.\n", "G0 X5. Y5.\n"):
        assert not any("length" in r.message for r in read(body + after, dialect).remarks)


@pytest.mark.parametrize(("dialect", "body", "words"), [
    ("fanuc", "G65 P1 X1.\n", "the program O1 is not in the file"), ("fanuc", "G66 P1\n", "G66 (a macro call)"),
    ("fanuc", "G12.1\n", "G12.1 (polar interpolation)"), ("haas", "G13 D1 I5. F100.\n", "G13 (a circular pocket)"),
    ("haas", "G150 P1\n", "G150 (a pocket)"), ("haas", "G70 I5. J0. L6\n", "G70 (a pattern of holes)"),
    ("fanuc", "G87 Z-5. R1. F100.\n", "G87 (back boring)"), ("fanuc", "G31 Z-5. F100.\n", "G31 (probing)"),
    ("fanuc", "G33 Z-5. F1.\n", "G33 (threading)"), ("fanuc", "G6.2 P4 K0 X1.\n", "G6.2 (a spline)"),
    ("fanuc", "G7.1 C10.\n", "G7.1 (cylindrical interpolation)"), ("fanuc", "G60 X1.\n", "G60 (positioning"),
    ("fanuc", "G1 A5. F100.\n", "A5."), ("fanuc", "G68 X0 Y0 I0 J0 K1. R10.\n", "a rotation in space"),
    ("fanuc", "G68 R10.\nG68 R20.\n", "G68 while a rotation is in force"), ("fanuc", "G91 G68 R10.\n", "incremental"),
    ("fanuc", "G51 X0 Y0 P2\n", "without a decimal point"), ("fanuc", "G51 X0 Y0\n", "G51 without a scale"),
    ("fanuc", "G51 X0 Y0 Z0 I2. J1. K1.\nG2 X10. I5. F100.\n", "different scales"),
    ("fanuc", "G68 R10.\nG92 X0\n", "rotated"), ("fanuc", "G16\nG91 G1 X1. Y1. F100.\n", "polar"),
    ("fanuc", "G10 L2 P0 X5.\n", "a common shift"), ("fanuc", "G10 L20 P1 X5.\n", "G54.1"),
    ("fanuc", "G10 L3\n", "G10"), ("fanuc", "G41.1\n", "normal direction control"),
    ("fanuc", "G1 X1. F100.\nG10 L2 P1 X5.\n", "G10 L2 of G54 after feed moves"),
    ("fanuc", "G1 X1. ,C2. F100.\n", ",C2. (a chamfer"), ("haas", "G1 X1. F100. ,R.5\n", ",R.5 (a chamfer"),
    ("haas", "G143 H1\n", "G143 (a length"), ("haas", "G113\n", "G113 is work offset 10"),
    ("fanuc", "G3 X0. Y0. I5. P3 F100.\n", "P3 in a block of an arc"), ("haas", "G3 X0. I5. P2 F9.\n", "P2 in a block"),
    ("fanuc", "G1 X[ROUND[1.2]] F100.\n", "ROUND[1.2] in a word"), ("haas", "#1=POW[2.]\n", "POW takes two values"),
    ("fanuc", "#1=#4014\n", "#4014 is a variable of the control"),
    ("fanuc", "G1 X1. F100. ; X7.\n", "'X7.' follows a ;"), ("fanuc", "G23 X1.\n", "coordinates in a block with G23"),
    ("fanuc", "M3 ; M5 ;\n", "'M5 ;' follows a ;"), ("haas", "N4 ; (off) ; M5\n", "follows a ;"),
    ("fanuc", "; /M5\n", "'/M5' follows a ;"), ("fanuc", "; GOTO 10\n", "'GOTO 10' follows a ;"),
    ("haas", "G0 X1. ; X7.,C1.\n", "'X7.,C1.' follows a ;"),
    ("fanuc", "G1 F9. G22 X1.\n", "coordinates in a block with G22"), ("fanuc", "G05.1 Q2 X0 Y0\n", "a curve through"),
    ("fanuc", "G05 P10001\n", "a cycle of the memory"), ("fanuc", "G05 P10999 L1\n", "a cycle of the memory"),
    ("fanuc", "G05\n", "G05 without P"),
    ("fanuc", "G05.1 Q1 X1.\n", "coordinates in a block with G5.1"), ("fanuc", "G10 L50\n", "L50 (parameters"),
    ("haas", "G47 X1. Y1. P0\n", "G47 (engraving)"), ("fanuc", "G47 X1.\n", "G47 (a tool offset)"),
    ("haas", "G83 R2. Z-5. I3. Q2. F9.\n", "two kinds of pecks"), ("haas", "G73 R2. Z-5. Q2. K6 F9.\n", "K6 of a peck"),
    ("haas", "G83 R2. Z-20. I4. J2. F9.\n", "J2 shortens to nothing")])
def test_what_moves_and_is_not_followed_is_refused_by_name(dialect, body, words):
    with pytest.raises(ProgramError) as caught:
        read(body, dialect)
    assert words in caught.value.message and f"line {7 + body.count(chr(10))}:" in caught.value.message


AC = Kinematics("table-table-AC", ((0.0, 0.0, -50.0), (0.0, 0.0, -50.0)))
UNKNOWN = Kinematics("table-table-AC")
START = "%\nO1\nG21 G90 G17\nT1 M6\nS1000 M3\nG54 G0 X0. Y0.\nG43 H1 Z100.\nG53 Z0.\n"
TILT = np.array([[1, 0, 0], [0, np.cos(np.pi / 6), -0.5], [0, 0.5, np.cos(np.pi / 6)]])  # 30 deg about X


def spatial(body, machine=AC):
    return read_program(START + body + "M30\n%\n", dialect="fanuc", kinematics=machine, gauge_length={1: 100.0})


@pytest.mark.parametrize("machine", [AC, UNKNOWN], ids=["pivots", "no pivots"])
def test_a_tilted_plane_turns_the_tool_and_the_coordinates(machine):
    """Origin (10, 0, 5), turned 30 deg about X: the tool stands along the Z of the plane, arcs and holes lie in it."""
    p = spatial("G68.2 X10. Y0. Z5. I0. J30. K0.\nG53.1\nG0 X1. Y2.\nZ20.\nG1 Z-1. F100.\nX5.\nG3 X5. Y8. R3.\n"
                "G0 Z20.\nG98 G81 X7. Y1. Z-3. R2.\nG80\nG53 Z0.\nG69\n", machine)
    cut = p.end[p.kind == FEED]
    place = (cut - [10, 0, 5]) @ TILT
    np.testing.assert_allclose(place[0], [1, 2, -1], atol=1e-9)
    np.testing.assert_allclose(place[1], [5, 2, -1], atol=1e-9)
    np.testing.assert_allclose(np.hypot(*(place[2:-1, :2] - [5, 5]).T), 3, atol=1e-9)
    np.testing.assert_allclose(place[2:-1, 2], -1, atol=1e-9)
    np.testing.assert_allclose(place[-1], [7, 1, -3], atol=1e-9)
    np.testing.assert_allclose(p.poses.end_axis[p.kind == FEED] - TILT[:, 2], 0, atol=1e-9)


def test_tool_vectors_turn_the_axes():
    p = spatial("G43.5 H1\nG0 X0. Y0. Z50. I0. J0. K1.\nG1 X10. I0.5 J0. K0.8660254 F100.\nX20.\nG49\n")
    axes = p.poses.end_axis[p.kind == FEED]
    np.testing.assert_allclose(axes[-1], [0.5, 0, 0.8660254], atol=1e-6)
    np.testing.assert_allclose(p.end[p.kind == FEED][-1], [20, 0, 50])


@pytest.mark.parametrize(("body", "words"), [
    ("G53.1\n", "G53.1 without G68.2"), ("G68.2 P2 Q1 X0. Y0. Z0.\n", "G68.2 in another form"),
    ("G68.2 J30.\nG68.2 J40.\n", "G68.2 while a plane"), ("G91 G68.2 J30.\n", "incremental"),
    ("G43.5 H1\nG0 Z50.\nG2 X5. I5. J0. F100.\n", "tool vectors"), ("G43.5 H1\nG0 Z50. I0. J0. K0.\n", "length 0")])
def test_planes_and_vectors_that_cannot_be_read(body, words):
    with pytest.raises(ProgramError) as caught:
        spatial(body)
    assert words in caught.value.message


def test_a_plane_needs_rotary_axes():
    with pytest.raises(ProgramError) as caught:
        read("G68.2 J30.\nG53.1\n")
    assert "G53.1 turns the tool axis" in caught.value.message


def test_the_page_lists_every_word_that_is_refused():
    page = (Path(__file__).resolve().parents[4] / "docs" / "verify.md").read_text().partition("## Words it refuses")[2]
    listed = set(page.replace(",", " ").split())
    assert not [f"G{code:g}" for code in (*REFUSED, *WORDS) if f"G{code:g}" not in listed]


def test_a_percent_behind_blocks_is_no_leader():
    with pytest.raises(ProgramError, match="does not begin with one"):
        read_program("G21 G90\n" + HEAD + "M30\n%\n", dialect="fanuc")


@pytest.mark.parametrize(("dialect", "body", "expected"), [
    # G92 at X0 says X5: zero is at X-5, and G52 X0 does not take that back
    ("fanuc", "G92 X5. Y0\nG52 X0 Y0\nG1 X10. F100.\n", [5, 0, 10]),
    ("haas", "G92 X5. Y0\nG52 X0 Y0\nG1 X10. F100.\n", [5, 0, 10]),
    ("fanuc", "G92 X5.\nG52 X2. Y3.\nG1 X10. Y0 F100.\n", [7, 3, 10]),
    ("fanuc", "G52 X2. Y3.\nG92 X5.\nG1 X10. Y0 F100.\n", [5, 3, 10]),  # G92 ends G52 of the axis it names
    ("fanuc", "G52 X2. Y3.\nG92 X5.\nG92.1 X0 Y0\nG1 X10. Y1. F100.\n", [10, 1, 10]),
    ("fanuc", "G52 X2. Y3.\nG92.1 X0\nG1 X10. Y0 F100.\n", [10, 3, 10]),
    ("linuxcnc", "G92 X5 Y0\nG52 X0 Y0\nG1 X10 F100\n", [10, 0, 10]),  # one register
    ("linuxcnc", "G52 X2 Y3\nG92 X5\nG1 X10 Y0 F100\n", [5, 3, 10]),
])
def test_registers_of_zero_shifts_are_those_of_the_control(dialect, body, expected):
    np.testing.assert_allclose(read(body, dialect).end[-1], expected, atol=1e-12)


@pytest.mark.parametrize(("dialect", "word", "words"), [
    ("fanuc", "G92.1", "G92.1 names the axes"),
    ("fanuc", "G92.1 Z0", "the control drops it"),
    ("fanuc", "G92.1 X5.", "each with 0"),
    ("haas", "G92.1 X0", "Haas ends a shift"), ("fanuc", "G91 G52 X5.", "incremental")])
def test_shift_words_that_a_control_does_not_take(dialect, word, words):
    with pytest.raises(ProgramError, match=words):
        read(f"{word}\n", dialect)


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_a_shift_that_is_left_is_told(dialect):
    for body in ("G92 X5.\nG52 X0\n", "G52 X5.\n"):
        (told,) = read(body, dialect).remarks
        assert "its zero shifted" in told.message and "G52 X0 Y0 Z0" in told.message
    assert read("G52 X5.\nG52 X0\n", dialect).remarks == ()


@pytest.mark.parametrize(("dialect", "words", "free"), [
    ("fanuc", "", True), ("fanuc", "G61\n", False), ("fanuc", "G61\nG1 X1. F100.\nG64\n", True),
    ("haas", "", True), ("haas", "G187 P3 E0.005\nG64\n", False), ("haas", "G187 E0.005\nG1 X1. F100.\nG187\n", True),
    ("haas", "G61\n", False), ("haas", "G1 X1. F100.\nG187 E0.005\n", True), ("fanuc", "G1 X1. F100.\nG61\n", True)])
def test_a_path_mode_counts_from_its_word_on(dialect, words, free):
    assert read(f"{words}G1 X5. Y5. F100.\n", dialect).unbounded is free


@pytest.mark.parametrize(("dialect", "heights"), [("fanuc", [5, 12, 5]), ("haas", [5, 12, 5]),
                                                  ("linuxcnc", [12, 12, 12, 12])])
def test_a_cycle_that_begins_below_r_goes_aside_where_the_control_does(dialect, heights):
    # Fanuc and Haas go aside first; LinuxCNC goes up to R first
    p = read("G0 Z5.\nG98 G82 X20. Y0. Z2. R12. F100.\nG80\n", dialect)
    rapids = p.end[(p.line == 9) & (p.kind != FEED)]
    assert rapids[:, 2].tolist() == heights, rapids
    assert rapids[0, 0] == (0.0 if dialect == "linuxcnc" else 20.0)


@pytest.mark.parametrize(("dialect", "stands"), [("haas", True), ("fanuc", False), ("linuxcnc", False)])
@pytest.mark.parametrize("word", ["M0", "M01"])
def test_the_spindle_stands_after_a_stop_of_haas(dialect, stands, word):
    for again in ("", "M3\n"):
        p = read(f"{word}\n{again}G1 X1. F100.\n", dialect)
        assert any("spindle standing" in r.message for r in p.remarks) == (stands and not again)


@pytest.mark.parametrize(("dialect", "word"), [("fanuc", "M19"), ("haas", "M19"), ("haas", "M19 P90"),
                                               ("haas", "M19 R90."), ("haas", "M19 R90"),
                                               ("fanuc", "M19 R90"), ("linuxcnc", "M19 R0")])
def test_a_spindle_that_takes_an_angle_stands(dialect, word):
    for again in ("", "M3\n"):
        p = read(f"{word}\n{again}G1 X1. F100.\n", dialect)
        assert any("spindle standing" in r.message for r in p.remarks) == (not again)


@pytest.mark.parametrize(("dialect", "word"), [("fanuc", "K3"), ("fanuc", "L3"), ("haas", "L3")])
def test_the_number_of_holes_has_no_point(dialect, word):
    p = read(f"G91 G99 G81 X5. Z-3. R-1. F100. {word}\nG80 G90\n", dialect)
    assert p.end[p.kind == FEED][:, 0].tolist() == [5, 10, 15]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_words_behind_the_first_end_of_a_comment_are_not_hidden(dialect):
    with pytest.raises(ProgramError, match="'Z4.' stands behind the first . of a comment"):
        read("G1 X5. F100. (A (B) Z4. )\n", dialect)
    for comment in ("(TOOL 1 (D8) FLAT)", "(A (B 2) (Z4.) )", "((T1))"):
        assert ends(f"G1 X5. F100. {comment}\n", dialect) == [[5, 0, 10]]


@pytest.mark.parametrize(("dialect", "end", "told"), [
    ("fanuc", "Y0.0004", True), ("haas", "Y0.0004", True), ("fanuc", "Y-0.0009", True), ("fanuc", "Y0.002", False),
    ("fanuc", "", False), ("fanuc", "X19.9996", True), ("linuxcnc", "Y0.0004", False)])
def test_an_arc_that_a_control_takes_for_a_whole_circle_is_told(dialect, end, told):
    """Of radius 5, clockwise from (20, 0): controls that count in 0.001 mm run 31.4 mm where the text has 0.0004."""
    p = read(f"G1 X20.{F}\nG2 {end} I5.{F}\n", dialect)
    assert sum("runs a whole circle of radius 5.000 mm" in r.message for r in p.remarks) == told


def test_short_arcs_in_inches_and_by_their_radius():
    inch = read("G20\nG1 X1. F4.\nG2 Y0.00004 I1.\nG21\n").remarks
    assert ["whole circle" in r.message for r in inch].count(True) == 1
    assert not any("whole circle" in r.message for r in read(f"G1 X20.{F}\nG2 Y0.0004 R5.\n").remarks)


@pytest.mark.parametrize(("body", "told"), [
    ("G18\nG43 H1\nG17\n", True), ("G19 G43 H1\nG17\n", True), ("G18\nG17 G43 H1\n", False), ("G18\nX1.\n", False)])
def test_the_axis_of_a_length_that_begins_in_another_plane_is_told(body, told):
    assert [str(a.what) for a in read(body).open] == ["length_axis"] * told


@pytest.mark.parametrize(("dialect", "calls"), [
    ("fanuc", "M98 P10\nM30\nO10\nG1 X1. F9.\nM99\nO10\nG1 X2. F9.\nM99\n"),
    ("haas", "M98 P10\nM30\nO10\nG1 X1. F9.\nM99\nO10\nG1 X2. F9.\nM99\n"),
    ("fanuc", "G65 P10\nM30\nO10\nG1 X1. F9.\nM99\nO10\nG1 X2. F9.\nM99\n"),
    ("linuxcnc", "M98 P10\nM2\nO10\nG1 X1 F9\nM99\nO10\nG1 X2 F9\nM99\n"),
    ("haas", "M97 P5\nM30\nN5 G1 X1. F9.\nM99\nN5 G1 X2. F9.\nM99\n"),
    ("fanuc", "M98 P10 Q5\nM30\nO10\nN5 G1 X1. F9.\nN5 G1 X2. F9.\nM99\n"),
    ("fanuc", "M98 P10\nN7 X9.\nN7 X8.\nM30\nO10\nG1 X1. F9.\nM99 P7\n")])
def test_a_destination_that_stands_twice_is_refused(dialect, calls):
    with pytest.raises(ProgramError, match="stands (twice|at the lines)"):
        read(calls, dialect)


@pytest.mark.parametrize(("dialect", "tap", "rigid"), [
    ("fanuc", "M29 S500\nG99 G84 X5. Z-3. R2. F500.\nX7.\nG80\n", True),
    ("fanuc", "G99 G84 X5. Z-3. R2. F500.\nX7.\nG80\n", False),
    ("fanuc", "G98 G74 X5. Z-3. R2. F500.\nG80\n", False),
    ("fanuc", "M29 S500 G84 X5. Z-3. R2. F500.\nG0 X8.\n", True),
    ("haas", "G99 G84 X5. Z-3. R2. F500.\nX7.\nG80\n", True)])
def test_the_spindle_stands_behind_a_tapping_cycle(dialect, tap, rigid):
    """Without M29 a parameter of Fanuc decides whether a cycle taps rigidly and leaves the spindle standing."""
    for before in ("", "M5\n"):
        for again in ("", "M3\n"):
            p = read(f"{before}{tap}{again}G1 X1. F100.\n", dialect)
            told = sum("spindle standing" in r.message for r in p.remarks)
            assert sum("left-hand" in r.message for r in p.remarks) == tap.count("G74")
            assert told == (not again or bool(before and not rigid)), (before, again, p.remarks)
    p = read(f"{tap.replace('G80', 'G81 X9. Z-1. R2.')}G80\nM3\n", dialect)
    assert ["spindle standing" in r.message for r in p.remarks if "left-hand" not in r.message] \
        == [True] * (tap.count("G80"))


@pytest.mark.parametrize("word", ["EQ", "NE", "GT", "GE", "LT", "LE"])
@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_a_comparison_that_rounding_decides_is_refused(dialect, word):
    body = "#1=0.1+0.2\nIF[#1{}{}]THEN #2=1.\nG1 X1. F9.\n"
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read(body.format(word, "0.3"), dialect)
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read(f"#1=0.3-0.1-0.1-0.1\nIF[#1{word}0]THEN #2=1.\nG1 X1. F9.\n", dialect)
    for number in ("0.30001", "5.", "#1"):
        assert len(read(body.format(word, number), dialect))


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_the_first_move_behind_a_rotation_names_both_axes(dialect):
    """Fanuc 30i, 11600#5: an axis that is not named counts where it stands, or at its number of before, turned."""
    for body in ("G68 X0. Y0. R90.\nG1 X20. F9.\n", "G68 X0. Y0. R90.\nG1 Z5. F9.\nX20.\n",
                 "G68 X0. Y0. R90.\nG0 X1. Y2.\nG69\nX5.\n", "G68 X0. Y0. R90.\nG98 G81 X5. Z-3. R2. F9.\nG80\n"):
        with pytest.raises(ProgramError, match="with one axis of the plane behind G6[89]"):
            read("G0 X-20. Y-20.\n" + body, dialect)
        read(body.replace("X5.\n", ""), dialect)  # at the centre of the rotation both are one
    p = read("G68 X0. Y0. R90.\nG0 X1. Y2.\nX5.\nG69\nG0 Z50.\nX1. Y1.\nX3.\n", dialect)
    assert p.end[-4:, :2].round(9).tolist() == [[-2, 5], [-2, 5], [1, 1], [3, 1]]


@pytest.mark.parametrize(("words", "told"), [("G10 L12 P1 R5.\n", True), ("G10 L12 P1 R10.\n", True),
                                             ("G10 L13 P1 R0.1\n", True), ("", False)])
@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_radius_or_diameter_of_a_register_is_told(dialect, words, told):
    p = read(f"{words}G42 D1 G1 X20. Y5. F9.\nX40.\nG40 X60.\n", dialect, radii={1: 5.0})
    assert [str(a.what) for a in p.open] == ["radius_register"] * told


@pytest.mark.parametrize(("dialect", "first", "again"), [("fanuc", 1, 1), ("haas", 1, 1), ("linuxcnc", 0, 0)])
def test_a_length_offset_without_h_is_that_of_before(dialect, first, again):
    """Fanuc and Haas keep H, which is 0 after power on; LinuxCNC takes the length of the tool."""
    p = read_program("G21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG0 X0 Y0\nG43 Z15.\nG1 Z9. F9.\nM30\n", dialect=dialect)
    assert sum("G43 without H" in r.message for r in p.remarks) == first
    p = read("T2 M6\nS900 M3\nG43 Z15.\nG1 Z9. F9.\n", dialect)
    assert any("length offset H1 with tool T2" in r.message for r in p.remarks) == again
    p = read("G49\nG43 Z15.\nG1 Z9. F9.\n", dialect)
    assert not any("length offset" in r.message or "without H" in r.message for r in p.remarks)


@pytest.mark.parametrize("call", ["M98 P10 L0", "G65 P10 L0"])
def test_a_call_of_no_times_is_refused(call):
    with pytest.raises(ProgramError, match="a call that runs no times, or once"):
        read(f"{call}\nM30\nO10\nG1 X1. F9.\nM99\n")


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_the_second_reference_point_is_that_of_g30_alone(dialect):
    first, second = (read(f"G91 G30 {p}Z0.\nG90\n", dialect) for p in ("", "P2 "))
    assert not any("P2" in r.message for r in second.remarks)
    assert [s.event for s in first.stops] == [s.event for s in second.stops]
    with pytest.raises(ProgramError, match="G30 P3: the proof does not know"):
        read("G91 G30 P3 Z0.\nG90\n", dialect)


@pytest.mark.parametrize(("dialect", "text", "right"), [
    ("fanuc", "#1=FIX[0.3/0.1]\n", "#1=FIX[0.35/0.1]\n"), ("haas", "#1=FUP[0.1+0.1+0.1-0.3]\n", "#1=FUP[3.]\n"),
    ("fanuc", "#1=ROUND[5.*0.1*3.-0.000000001]\n", "#1=ROUND[1.4]\n")])
def test_a_whole_number_that_rounding_decides_is_refused(dialect, text, right):
    with pytest.raises(ProgramError, match="the rounding of the control decides"):
        read(f"{text}G1 X1. F9.\n", dialect)
    assert len(read(f"{right}G1 X1. F9.\n", dialect))


@pytest.mark.parametrize(("text", "dialect", "taps", "left"), [
    ("G99 G84 X1. Y1. Z-2. R2. F400.\nX5.\nG80\n", "fanuc", [8, 9], False),
    ("G99 G74 X1. Y1. Z-2. R2. F400.\nG80\n", "haas", [8], True),
    ("G99 G85 X1. Y1. Z-2. R2. F400.\nG80\n", "fanuc", [], False),
    ("G99 G84 X1 Y1 Z-2 R2 F400\nG80\n", "linuxcnc", [8], False)])
def test_lines_of_tapping_cycles_are_known(text, dialect, taps, left):
    p = read(text, dialect)
    assert p.taps == dict.fromkeys(taps, True)
    assert any("left-hand" in r.message for r in p.remarks) == left


@pytest.mark.parametrize(("words", "down"), [
    ("G83 Z-20. R2. I8. J2. K3.", [-6, -12, -16, -19, -20]), ("G73 Z-20. R2. I8. J2. K3.", [-6, -12, -16, -19, -20]),
    ("G83 Z-4. R2. I4. J2.", [-2, -4]), ("G83 Z-9. R2. I4.", [-2, -6, -9]),
    ("G83 Z-9. R2. I400. J0.000001 K0.0000001", [-9]), ("G83 Z-9. R2. I5. J0.000001 K0.0000001", [-3, -8, -9]),
    ("G83 Z-9. R2. I2. J1. K4.", [0, -4, -8, -9])])
def test_pecks_of_haas_that_shrink(words, down):
    """The first peck is I, each next one shorter by J, none shorter than K but the last; a later hole has the same."""
    p = read(f"G99 {words} X5. Y0. F50.\nX9.\nG80\n", "haas")
    for x in (5, 9):
        assert p.end[(p.kind == FEED) & (p.end[:, 0] == x)][:, 2].round(3).tolist() == down
    assert p.remarks == ()


def test_pecks_of_haas_that_return_to_r():
    """G73 with Q and K: 6 mm of pecks, then up to R; the peck after it begins just above its depth."""
    p = read("G99 G83 X5. Z-20. R2. I8. J2. K3. F50.\nG73 X7. Z-12. R2. Q2. K6.\nG80\n", "haas")
    z = p.end[(p.end[:, 0] == 7)][2:, 2].round(3).tolist()
    assert z == [0, 0.254, -2, -1.746, -4, 2, -3.746, -6, -5.746, -8, -7.746, -10, 2, -9.746, -12, 2]
    assert p.remarks == ()


def test_places_that_haas_sends_out_are_no_moves():
    assert ends("G1 X1. F9.\nG102 X Z\nN5 G102\nX2.\n", "haas") == [[1, 0, 10], [2, 0, 10]]


@pytest.mark.parametrize(("dialect", "word"), [("fanuc", "G54.1 P1"), ("haas", "G154 P2"), ("haas", "G111")])
def test_a_work_offset_is_told_by_the_word_of_the_program(dialect, word):
    assert [r.message.split(" is not")[0] for r in read(f"{word}\nG1 X1. F9.\n", dialect).remarks] == [word]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_the_same_kind_of_feed_again_keeps_f(dialect):
    """The line of safety that posts write at each tool change."""
    p = read("G94\nG1 X5. F100.\nG0 G17 G40 G49 G80 G90 G94\nG43 H1\nG1 X9.\n", dialect)
    assert p.feed[p.line == 12].tolist() == [100.0]


def test_another_kind_of_feed_and_the_first_one_need_f():
    for body in ("G94\nG1 X5. F100.\nG95\nG94\nG1 X9.\n", "F100.\nG94\nG1 X5.\n"):
        with pytest.raises(ProgramError, match="without a feed"):
            read(body)


def test_linuxcnc_drops_f_with_the_same_kind_of_feed():
    """As its interpreter does."""
    with pytest.raises(ProgramError, match="without a feed"):
        read("G94\nG1 X5. F100.\nG94\nG1 X9.\n", "linuxcnc")
