"""Parameters, expressions and flow of a program, polar words and shifts of its zero: values by hand."""

import math
import random

import numpy as np
import pytest

from geometry.errors import CamError, ProgramError
from verify.checks.machine_limits import notes_on
from verify.gcode.flow import control_flow
from verify.gcode.flow.control_flow import has_flow
from verify.gcode.flow.o_words import find_structure
from verify.gcode.flow.parametric_lines import is_plain
from verify.gcode.reader import FEED, RAPID, read_program
from verify.model import ProofSetup

HEAD = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG0 X0 Y0\nG43 H1 Z10\nG1 F100\n"
TAIL = "M30\n%\n"


def read(body):
    return read_program(HEAD + body + TAIL)


def ends(body):
    return read(body).end[1:].tolist()


def value(text):
    """X of a move to the expression."""
    return read(f"X{text}\n").end[-1, 0]


@pytest.mark.parametrize("text, expected", [
    ("[1+2*3]", 7), ("[2**3**2]", 64), ("[-2**2]", 4), ("[8-3-2]", 3), ("[7 MOD -3]", 1), ("[-7 MOD 3]", 2),
    ("[1 OR 0 AND 0]", 0), ("[2+3 GT 4]", 1), ("[1.000001 EQ 1]", 1),
    ("[1.00009 EQ 1]", 1), ("[1.00002 NE 1]", 0), ("[1.0002 NE 1]", 1), ("[1.00002 GT 1]", 1), ("[5 XOR 3]", 0),
    ("[2 LE 2]", 1), ("[2 LT 2]", 0), ("[2 GE 3]", 0), ("[2+-[3]]", -1), ("[2--3]", 5), ("-[1+1]", -2), ("+[3]", 3),
    ("ABS[-2]", 2), ("ACOS[0]", 90), ("ASIN[1]", 90), ("ATAN[-1]/[-1]", -135), ("COS[60]", 0.5), ("EXP[0]", 1),
    ("FIX[-1.5]", -2), ("FUP[-1.5]", -1), ("LN[1]", 0), ("ROUND[-2.5]", -3), ("ROUND[2.4]", 2), ("SIN[30]", 0.5),
    ("SQRT[9]", 3), ("TAN[45]", 1), ("-SIN[30]", -0.5), ("[[[1]]]", 1), (" [ 1 + 1 ] ", 2), ("[1(one)+1]", 2)])
def test_expressions(text, expected):
    assert value(text) == pytest.approx(expected, abs=1e-12)


def test_numbers_keep_their_bits():
    for text, exact in (("[1/3]", 1 / 3), ("[1/3000000]", 1 / 3e6), ("[0.1+0.2]", 0.1 + 0.2), ("[10**7/3]", 1e7 / 3)):
        assert value(text) == exact


def test_assignments_of_a_line_take_effect_after_it():
    assert ends("#1=3\n#2=#1 #1=5 X#1\nY#2\nX#1\n") == [[3, 0, 10], [3, 3, 10], [5, 3, 10]]
    assert ends("#7=8\n#8=2\nX##7 Y#[6+1] #[7+1]=4\nX#8\n") == [[2, 8, 10], [4, 8, 10]]


def test_names_ignore_blanks_and_case():
    assert ends("#<A long name>=3\n#<_Wide>=2\nX#<along name> Y#<_WIDE>\n") == [[3, 2, 10]]
    assert ends("#<a>=1\nX[EXISTS[#<a>]] Y[EXISTS[#<b>]] Z[EXISTS[#<_x>]]\n") == [[1, 0, 1]]


def test_parameters_of_the_control():
    """Position in the unit and zero of the program, and its modes."""
    assert ends("X25.4 Y50.8\nG20\nG1 X[#5420+1] Y#<_y> Z[#5422]\nG21\n") == [[25.4, 50.8, 10],
                                                                     [pytest.approx(50.8), 50.8, 10]]
    assert ends("G52 X4\nG1 X1\nX#<_x>\nG92.1\nX0 Y#5420\n")[-1] == [0, 5, 10]
    assert ends("X#<_feed> Y#<_rpm> Z[#<_metric>+#<_absolute>]\n") == [[100, 1000, 2]]
    assert ends("X#<_motion_mode> Y#<_plane> Z#<_coord_system>\n") == [[10, 170, 540]]
    assert ends("X#5220 Y#5400 Z#<_call_level>\n") == [[1, 1, 0]]


def test_subroutines_have_their_own_parameters_and_return_a_value():
    body = ("o100 sub\n#3=[#1+#2] #<own>=7 #<_all>=9 #50=4\no100 endsub [#3*2]\n#1=8 #<own>=1\no100 call [1] [2]\n"
            "X#<_value> Y#1 Z#<own>\nX#<_all> Y#50 Z#<_value_returned>\n")
    assert ends(body) == [[6, 8, 1], [9, 4, 1]]
    assert ends("o<f> sub\no<g> return\no<f> endsub [1]\no<f> call\nX#<_value> Y#<_value_returned> Z3\n") == [[0, 0, 3]]
    assert ends("o<later> call [4]\nM30\no<later> sub\nX#1 Y#30\no<later> endsub\n") == [[4, 0, 10]]
    assert ends("o7 sub\nX#1\no7 endsub\n#9=7\no#9 call [2]\no[6+1] call [3]\n") == [[2, 0, 10], [3, 0, 10]]


def test_a_subroutine_calls_itself():
    body = ("o<fac> sub\no<zero> if [#1 EQ 0]\no<fac> return [1]\no<zero> else\no<fac> call [#1-1]\n"
            "o<fac> return [#<_value>*#1]\no<zero> endif\no<fac> endsub\no<fac> call [5]\nX#<_value>\n")
    assert ends(body) == [[120, 0, 10]]


def test_conditions():
    body = "o1 if [#1 EQ 1]\nX1\no1 elseif [#1 EQ 2]\nX2\no1 elseif [#1 EQ 3]\nX3\no1 else\nX4\no1 endif\n"
    assert [ends(f"#1={k}\n{body}") for k in (1, 2, 3, 4)] == [[[k, 0, 10]] for k in (1, 2, 3, 4)]
    assert ends("o1 if [0]\nX1\no1 endif\nY1\n") == [[0, 1, 10]]


def test_loops():
    assert [e[0] for e in ends("#1=0\no1 while [#1 LT 3]\n#1=[#1+1]\nX#1\no1 endwhile\n")] == [1, 2, 3]
    assert [e[0] for e in ends("#1=5\no1 do\nX#1\n#1=[#1+1]\no1 while [#1 LT 3]\n")] == [5]
    body = "#1=0\no1 repeat [2.6]\n#1=[#1+1]\nX#1\no1 endrepeat\no2 repeat [-1]\nX9\no2 endrepeat\n"
    assert [e[0] for e in ends(body)] == [1, 2, 3]
    body = ("#1=0\no1 while [1]\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\no3 if [#1 GT 3]\no1 break\n"
            "o3 endif\nX#1\no1 endwhile\nY1\n")
    assert ends(body) == [[1, 0, 10], [3, 0, 10], [3, 1, 10]]
    nested = "o1 repeat [2]\no2 repeat [2]\nG91 X1\no2 endrepeat\no1 endrepeat\nG90\n"
    assert [e[0] for e in ends(nested)] == [1, 2, 3, 4]


def test_every_block_keeps_its_line():
    p = read("o1 sub\nX#1\nY#1\no1 endsub\no1 call [3]\nX[1]\no1 call [4]\n")
    assert p.line[1:].tolist() == [9, 10, 13, 9, 10]


def test_saved_modes():
    assert ends("M70\nG91 G20\nF7\nM72\nX5\nX5\n") == [[5, 0, 10], [5, 0, 10]]
    p = read("o1 sub\nM73\nG91 F50\nX1\no1 endsub\nX2\no1 call\nX5\n")
    assert p.end[1:, 0].tolist() == [2, 3, 5] and p.feed[1:].tolist() == [100, 50, 100]


def test_polar_words():
    root = math.sqrt(0.5)
    np.testing.assert_allclose(ends("X3 Y4\n@10\n^90\n@[2] ^45 Z2\n"), [[3, 4, 10], [6, 8, 10], [0, 10, 10],
                                                                       [2 * root, 2 * root, 2]], atol=1e-12)
    np.testing.assert_allclose(ends("X10\nG91 @1\n^90\nG90\n"), [[10, 0, 10], [11, 0, 10], [0, 11, 10]], atol=1e-12)
    np.testing.assert_allclose(ends("G92 X-5\n@1 ^0\nG92.1\n"), [[6, 0, 10]], atol=1e-12)


def test_a_shift_of_zero_is_known_to_the_bit():
    body = "X10 Y0\nG92 X2 Y1\nX3 Y3\nG91 X1\nG90 G92.2\nX3\nG92.3\nX3\nG92.1\nX3\n"
    assert ends(body) == [[10, 0, 10], [11, 2, 10], [12, 2, 10], [3, 2, 10], [11, 2, 10], [3, 2, 10]]
    assert ends("G52 X2 Y1\nX3 Y3\nG52 X4\nX3 Y3\nG52 X0 Y0\nX3\n") == [[5, 4, 10], [7, 4, 10], [3, 4, 10]]
    assert ends("G52 X2\nG90.1 G2 X4 Y0 I1 J0\nG91.1\nG92.1\n")[-1] == [6, 0, 10]
    p = read("X10\nG92 X2\nX3\nG92.1\n")
    assert p.notes == ("line 9: G92 moves program zero to X8.0000 mm",) and p.remarks == ()
    p = read("X10\nG92 X2\n")
    assert "ends with its zero shifted" in p.remarks[0].message and p.remarks[0].line == 10


def test_notes_reach_the_proof():
    p = read("X[10]\nG52 X2\nG92.1\n")
    assert list(notes_on(p, -100.0, ProofSetup())) == [
        "program, parameters, expressions and O-words are read as in LinuxCNC; other controls differ",
        "program, line 9: G52 moves program zero to X2.0000 mm"]


def test_offset_table_of_the_setup():
    p = read("X10\nG10 L20 P1 X3\nX3\nG92 X1\nG10 L20 P0 X5\nX6\nG92.1\n")
    np.testing.assert_allclose(p.end[1:, 0], [10, 10, 11])
    assert [(r.line, "next run" in r.message) for r in p.remarks] == [(9, True), (12, True)]


def test_cycles_in_other_planes_and_series():
    hole = ends("G0 Y10 Z5\nG18 G98 G81 X5 Y-1 Z7 R3\nG80\nG17\n")
    assert hole[1:] == [[5, 10, 7], [5, 3, 7], [5, -1, 7], [5, 10, 7]]
    deep = ends("G0 X10\nG19 G99 G83 X5 Y1 Z2 R8 Q2\nG80\nG17\n")[1:]
    assert [e[0] for e in deep] == [10, 8, 6, 8, 6.254, 5, 8] and deep[-1][1:] == [1, 2]
    series = ends("G99 G81 X1 Z-3 R1\nX2\nG98 X3\nG80\n")
    assert [e for e in series if e[2] == 10] == [[1, 0, 10], [3, 0, 10], [3, 0, 10]]
    steps = ends("G91 G99 G81 X5 Y5 Z-3 R-4 L2\nG90 G80\n")
    assert steps[-3:] == [[10, 10, 6], [10, 10, 3], [10, 10, 6]] and steps[2] == [5, 5, 3]


def test_a_series_under_a_shifted_zero_keeps_its_number():
    """LinuxCNC keeps the height a series goes back to as a number of the program, and so as another place."""
    series = ends("G98 G81 X1 Z-3 R1\nG52 Z5\nX2\nG80\nG92.1\n")
    assert series[3] == [1, 0, 10] and series[-1] == [2, 0, 15]


def test_a_way_back_that_is_not_stated_is_told():
    assert read("G81 X1 Z-3 R1\nG80\n").notes == (
        "neither G98 nor G99 is stated: drilling cycles are read with G99 (return to R)",)
    assert read("G98 G81 X1 Z-3 R1\nG80\n").notes == () == read("G81 X1 Z-3 R10\nG80\n").notes


@pytest.mark.parametrize("code, kinds, dwell", [
    (81, [FEED, RAPID], 0), (85, [FEED, FEED, RAPID], 0), (86, [FEED, RAPID], 0.5), (89, [FEED, FEED], 0.5)])
def test_how_a_cycle_leaves_its_hole(code, kinds, dwell):
    p = read(f"G98 G{code} X5 Z-3 R1{' P0.5' if code > 85 else ''}\nG80\n")
    down = int(np.flatnonzero(p.end[:, 2] == -3)[0])
    assert p.kind[down:].tolist() == kinds and p.end[-1, 2] == 10 and p.dwell == dwell


def test_plain_programs_take_no_stage_before():
    plain = HEAD + "X1 (zone 4 of 2)\n" + TAIL
    assert not has_flow(plain) and has_flow(HEAD + "O100 sub\n") and has_flow("X#1") and has_flow("X[1]")
    assert not has_flow("O1234\nG0 X1\n") and has_flow("o<a> call")
    assert is_plain("G1 X1 (cost [#1])") and is_plain("O1234") and not is_plain("N5 o1 if [1]")


def test_the_stage_before_changes_nothing_of_plain_blocks():
    body = "X1 Y2\nG2 X5 Y6 I2 J2\nG81 X1 Y1 Z-1 R1\nX4\nG80\nG0 Z10\n/X3\n"
    plain, staged = read(body + "\n"), read(body + "#1=1\n")
    for name in ("start", "end", "kind", "feed", "tool", "line"):
        assert getattr(plain, name).tobytes() == getattr(staged, name).tobytes()
    assert plain.remarks == staged.remarks


def test_a_loop_without_end(monkeypatch):
    monkeypatch.setattr(control_flow, "MAX_BLOCKS", 1000)
    with pytest.raises(ProgramError) as caught:
        read("o1 while [1]\no1 endwhile\n")
    error = caught.value
    assert error.code == "program_too_long" and error.limit == 1000 and error.measured == 1001
    assert error.subjects[0] in ("line 8", "line 9") and "may have no end" in error.message


def test_an_error_in_a_loop_is_named_once():
    with pytest.raises(ProgramError) as caught:
        read("o1 repeat [50]\nG1 A5\no1 endrepeat\nX[1/0]\n")
    assert caught.value.subjects == ("line 9",)


def test_structure_pairs_what_belongs_together():
    found = find_structure(["o1 if [1]", "o2 while [1]", "o2 break", "o2 endwhile", "o1 else", "o1 endif"])
    assert (found.steps[0].other, found.steps[0].end, found.steps[4].end) == (4, 5, 5)
    assert (found.steps[2].end, found.steps[3].start) == (3, 1) and found.subs == {}


def test_any_pieces_give_a_program_or_an_error_with_a_line(monkeypatch):
    """A reading of random pieces ends in finite moves or names a line; nothing else escapes."""
    monkeypatch.setattr(control_flow, "MAX_BLOCKS", 2000)
    r = random.Random(5)
    pieces = ("# [ ] #1 #2 #<a> #<_x> 1 2 -3 0.5 + - * / ** MOD EQ AND = = o1 o2 o<f> sub endsub if else endif while "
              "do endwhile repeat endrepeat call return break continue [1] [0] [#1] X Y1 G1 G0 F50 ATAN SIN[ LN "
              "EXISTS[ ] @ ^ G92 G52 M70 M72 M73 ( ) ; / % 99999999").split()
    whole = ["#1=1", "#<a>=[#1+1]", "G1 X#1", "o1 if [#1]", "o1 endif", "o1 while [#1 LT 9]", "#1=[#1+1]",
             "o1 endwhile", "o<f> sub", "o<f> endsub [2]", "o<f> call [1]", "X[#<a>/2]", "M73", "o2 repeat [3]",
             "o2 endrepeat"]
    read_through = 0
    for _ in range(4000):
        body = "\n".join(" ".join(r.choices(pieces, k=r.randint(1, 7))) if r.random() < 0.2 else r.choice(whole)
                         for _ in range(r.randint(1, 7))) + "\n"
        try:
            p = read(body)
        except CamError as error:
            assert error.subjects[0].startswith("line "), body
            continue
        read_through += 1
        assert np.isfinite(p.start).all() and np.isfinite(p.end).all(), body
    assert read_through > 50
