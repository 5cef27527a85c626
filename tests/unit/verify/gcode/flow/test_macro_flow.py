"""Subprograms, macros, jumps and variables of Fanuc and Haas: the order of lines, values, and what is refused."""

import pytest

from geometry.errors import CamError, ProgramError
from verify.gcode.reader import FEED, read_program

HEAD = "%\nO1000 (MAIN)\nG21 G90 G17\nT1 M6\nS1000 M3\nG0 G54 G43 H1 Z50.\nX0 Y0\n"


def places(body, dialect="fanuc"):
    p = read_program(HEAD + body + "%\n", dialect=dialect)
    return [tuple(e) for e in p.end[p.kind == FEED][:, :2].round(6).tolist()]


@pytest.mark.parametrize(("body", "expected"), [
    ("M98 P2000 L2\nM30\nO2000\nG91 G1 X1. F100.\nG90\nM99\n", [1, 2]),
    ("M98 P32000\nM30\nO2000\nG91 G1 X1. F100.\nG90\nM99\n", [1, 2, 3]),
    ("M98 P00032000\nM30\nO2000\nG91 G1 X1. F100.\nG90\nM99\n", [1, 2, 3]),
    ("G1 X9. F100. M98 P0020\nM30\nO20\nG1 X5.\nM98 P30\nX7.\nM99\nO0030\nX6.\nM99\n", [9, 5, 6, 7]),
    ("M98 P20\nG1 X2. F100.\nN50 X3.\nM30\nO20\nG1 X1. F100.\nM99 P50\n", [1, 3]),
    ("M98 P20 Q7\nM30\nO20\nG1 X1. F100.\nN7 G1 X2. F100.\nM99\n", [2]),
    ("G1 X1. F100.\nGOTO 10\nX2.\nN10 X3.\nM99\n", [1, 3])])
def test_programs_call_one_another(body, expected):
    """Repeats by L and by the count of P, a program within a program, M99 to a label, M99 as the end."""
    assert [x for x, _ in places(body)] == expected


def test_local_calls_of_haas():
    body = "M97 P500 L2\nG1 X9.\nM30\nN500 G91 G1 X1. F100.\nG90\nM99\n"
    assert [x for x, _ in places(body, "haas")] == [1, 2, 9]


@pytest.mark.parametrize(("body", "expected"), [
    ("#1=0\nWHILE[#1LT3]DO1\n#1=#1+1\nG1 X[#1*10] F100.\nEND1\nM30\n", [(10, 0), (20, 0), (30, 0)]),
    ("#100=3\nN5 #100=#100-1\nG1 X#100 F100.\nIF [#100 GT 0] GOTO 5\nM30\n", [(2, 0), (1, 0), (0, 0)]),
    ("IF[#3 EQ #0]THEN #3=4.5\nIF[#3 NE 4.5]GOTO90\nG1 X#3 Y-#3 F100.\nN90 M30\n", [(4.5, -4.5)]),
    ("#1=1\nIF [[#1 EQ 1] AND [2 GT 3]] GOTO 9\nG1 X1. F100.\nN9 M30\n", [(1, 0)]),
    ("#1=1\nIF [#1 EQ 1] AND [3 GT 2] GOTO 9\nG1 X1. F100.\nN9 M30\n", []),
    ("G1 X[ATAN[1]/[-1]] F100.\nX[FIX[-2.5]] Y[FUP[-2.5]]\nX[2+3*4 MOD 5] Y[7 AND 2]\nM30\n",
     [(135, 0), (-2, -3), (4, 2)]),
    ("#[100+1]=7\nG1 X#101 F100.\nX[#5041+1.]\nM30\n", [(7, 0), (8, 0)]),
    ("G65 P20 X10. I2. J3. A5\nM30\nO20\nG1 X#24 Y#4 F100.\nX#5 Y#1\n#24=1\nM99\n", [(10, 2), (3, 5)]),
    ("G65 P20 I1. I2. I3.\nM30\nO20\nG1 X#4 Y#7 F100.\nX#10\nM99\n", [(1, 2), (3, 2)]),
    ("#1=7\nG65 P20 L2\nG1 X#1 F100.\nM30\nO20\n#1=2\nM99\n", [(7, 0)]),
    ("#1=#0\nG1 X5. Y#1 F100.\n#500=#0\nX6. Y#500\nM30\n", [(5, 0), (6, 0)]),
    ("#1=#0\n#2=#1\n#3=#2\nG1 X5. Y#3 F100.\nM30\n", [(5, 0)]),
    ("G65 P20 X5.\nM30\nO20\nG1 X#24 Y#25 F100.\nX#0 Y2.\nM99\n", [(5, 0), (5, 2)]),
    ("DPRNT[X#5041[43]]\n#3006=1 (CHECK)\nG1 X1. F100.\nM30\n", [(1, 0)])])
def test_macros_compute_and_branch(body, expected):
    """Loops, jumps, vacant variables, functions, arguments of G65 and its own level of local variables."""
    if "A5" in body:
        body = body.replace("A5", "A5.")
    assert places(body) == [pytest.approx(e) for e in expected]


@pytest.mark.parametrize(("body", "line", "words"), [
    ("M98 P2000\nM30\n", 8, "M98 P2000: the program O2000 is not in the file"),
    ("G1 F100.\nG65 P9010 X1.\nM30\n", 9, "the program O9010 is not in the file"),
    ("M98\nM30\n", 8, "M98 without P"), ("M98 P20\nM30\nO20\nG1 X1. F100.\n", 11, "O20 ends without M99"),
    ("M98 P20\nM30\nO20\nM98 P20\nM99\n", 11, "more than 10 nested calls"),
    ("G1 X#100 F100.\nM30\n", 8, "#100 has no value"), ("G1 X#7 F100.\nM30\n", 8, "X#7 uses #7, which has no value"),
    ("#1=#1-0.5\nG1 Z#1 F100.\nM30\n", 8, "#1-0.5 uses #1, which has no value"),
    ("#1=#0\n#2=-#1\nM30\n", 9, "-#1 uses #1, which has no value"),
    ("#2=#1\nG1 Z#2 F100.\nM30\n", 8, "an assignment uses #1, which has no value"),
    ("G65 P20 X1.\nM30\nO20\n#26=#26*2.\nM99\n", 11, "#26*2. uses #26, which has no value"),
    ("#1=#5221\nM30\n", 8, "#5221 is a variable of the control"), ("#5221=3.\nM30\n", 8, "#5221 is a variable"),
    ("#3005=4\nM30\n", 8, "#3005 is a variable of the control"), ("#3007=0\nM30\n", 8, "#3007 is a variable"),
    ("#3000=1 (NO TOOL)\nM30\n", 8, "stops here with an alarm"), ("GOTO 77\nM30\n", 8, "N77 is not in the program"),
    ("/GOTO 5\nN5 M30\n", 8, "a / before a statement"), ("/M98 P20\nM30\nO20\nM99\n", 8, "a / before M98"),
    ("M98 P20\nM30\nO20\nG91 G1 X1. F100.\nM99 L2\n", 12, "M99 with L"),
    ("END1\nM30\n", 8, "END without DO"), ("WHILE[1]DO1\nM30\n", 8, "WHILE without DO and END"),
    ("G65 P20 X10\nM30\nO20\nM99\n", 8, "X10 of G65 without a decimal point"),
    ("M97 P5\nN5 M99\n", 8, "a local call of Haas"), ("M96 P5\nM30\n", 8, "an interrupt"),
    ("G66 P20 X1.\nM30\nO20\nM99\n", 8, "G66 (a macro call)")])
def test_what_cannot_be_known_is_refused_by_name(body, line, words):
    with pytest.raises(ProgramError) as caught:
        places(body)
    assert f"line {line}:" in caught.value.message and words in caught.value.message, caught.value.message


@pytest.mark.parametrize("body", ["N5 GOTO 5\nM30\n", "WHILE[1EQ1]DO1\nEND1\nM30\n", "M98 P20\nM30\nO20\nN1 M99 P1\n"])
def test_a_loop_without_end_is_named(body):
    with pytest.raises(CamError) as caught:
        places(body)
    assert caught.value.code in ("program_too_long", "bad_program"), caught.value.message


@pytest.mark.parametrize(("body", "told"), [
    ("#1=ATAN[-1]/[1]\nIF [#1 LT 0] GOTO 5\nG1 X1. F100.\nN5 G1 X2. F100.\nM30\n", 8),
    ("G1 Y1. F100.\n#1=ASIN[-0.5]\nG1 X#1\nM30\n", 9), ("#1=ATAN[1]/[1]\nG1 X#1 F100.\nM30\n", 0),
    ("#1=ATAN[-1]/[1]\nG1 X[10*COS[#1]] Y[10*SIN[#1]] F100.\nM30\n", 0),
    ("#1=ATAN[-1]/[1]\nIF [#1 LT 0] THEN #1=#1+360\nG1 X#1 F100.\nM30\n", 0)])
def test_the_range_of_an_angle_is_told_where_it_changes_the_moves(body, told):
    """Parameter 6004#0 of Fanuc gives 0 to 360 or -180 to 180 deg; Haas has no such parameter."""
    lines = [r.line for r in read_program(HEAD + body + "%\n", dialect="fanuc").remarks if "6004" in r.message]
    assert lines == ([told] if told else [])
    assert not any("6004" in r.message for r in read_program(HEAD + body + "%\n", dialect="haas").remarks)


def test_a_call_in_a_comment_is_none():
    assert places("(CALL M98 P20 WITH #1)\nG1 X1. F100.\nM30\n") == [(1, 0)]
