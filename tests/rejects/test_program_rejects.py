"""Programs that cannot be read: each names its line and what is wrong."""

import tracemalloc

import pytest

from geometry.errors import ProgramError
from verify.gcode.reader import read_program
from verify.program import move_log
from verify.program.move_log import MAX_MOVES_A_BLOCK

HEAD = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG0 X0 Y0\nG43 H1 Z10\n"
TAIL = "M30\n%\n"


@pytest.mark.parametrize("body, message", [
    ("G1 X5\n", "without a feed"),
    ("G2 X5 Y5 F100\n", "without its centre"),
    ("G2 X5 Y5 K1 F100\n", "without its centre"),
    ("G2 X5 Y0 I2.5 K1 F100\n", "no meaning in plane G17"),
    ("G2 X10 Y0 I3 J0 F100\n", "circles of different radii"),
    ("G2 X10 Y0 R4 F100\n", "cannot span"),
    ("G2 X0 Y0 R4 F100\n", "two different ends"),
    ("G1 A5 F100\n", "unknown word A5"),
    ("G1 X5 U1 F100\n", "unknown word U1"),
    ("G41 D1\n", "G41 needs the radius of T1"),
    ("G43.4 H1\n", "tool centre point control"),
    ("G76 P1 Z-5 I1 J1 K1\n", "unknown word G76 (threading)"),
    ("G68 X0 Y0 R30\n", "unknown word G68 (a rotated frame)"),
    ("G88 Z-5 R1 F100\n", "unknown word G88"),
    ("G5.1 X1 Y1 I1 J1\n", "unknown word G5.1 (a spline)"),
    # program zero and polar words
    ("G28\nG92 X0\n", "because the program has not stated X"),
    ("G49\nG92 Z0\n", "G92 Z while the length offset is off"),
    ("G92\n", "G92 needs X, Y or Z"),
    ("G92.1 X1\n", "G92.1 takes no coordinates"),
    ("G92.3\n", "a shift that the program has not set"),
    ("G92 X0 G1 F100\n", "G92 and G1 in one block"),
    ("G52 @1 ^1\n", "polar words with G52"),
    ("G92 G52 X1\n", "G92 and G52 in one block"),
    ("G1 X5 F100\nG10 L2 P1 X0\n", "G10 L2 of G54 after feed moves"),
    ("G10 P1 X0\n", "G10 without L (a changed offset table)"),
    ("G10 L10 P1 Z5\n", "G10 L10 (a changed tool table)"),
    ("G91 G10 L2 P2 X5\n", "G10 L2 in G91 of G55"),
    ("G10 L20 P12 X0\n", "the number of the work offset from 0 to 9"),
    ("G10 L20 P1 R5 X0\n", "a rotated frame"),
    ("G0 @5 ^10 X1\n", "polar words and X or Y in one block"),
    ("G18 G0 @5 ^10\n", "polar words in plane G18"),
    ("G28 @5\n", "polar words in a move to a fixed place"),
    ("G0 @5\n", "from program zero"),
    ("G91 G0 ^5\n", "from program zero"),
    ("G28\nG0 @5\n", "polar word continues from a place that the program has not stated"),
    ("G81 X0 Y0 Z-3 R1 F100\nG18 X5 Y-1\n", "another plane"),
    ("M72\n", "M72 without an M70"),
    ("M70 G90\n", "M70 with other words in one block"),
    ("M70 M73\n", "M70 and M73 in one block"),
    # parameters and expressions
    ("G1 X#31 F100\n", "#31 has no value yet"),
    ("G1 X#<deep> F100\n", "#<deep> has no value yet"),
    ("G1 X#5221 F100\n", "#5221 is a parameter of the control"),
    ("G1 X#<_hal[motion.x]> F100\n", "#<_hal[motion.x]> is a parameter of the control"),
    ("G1 X#<_task> F100\n", "#<_task> is a parameter of the control"),
    ("G28\nG1 X#5420 F100\n", "#5420 is unknown because the program has not stated X"),
    ("G0 F#<_feed>\n", "#<_feed> is unknown because the program has not stated it"),
    ("#5221=3\n", "#5221 is a parameter of the control"),
    ("#<_x>=3\n", "a program cannot set #<_x>"),
    ("#1=EXISTS[#<_hal[motion.x]>]\n", "depends on the machine"),
    ("G49\n#1=#5422\n", "#5422 is not the place of the tip while the length offset is off"),
    ("#0=3\n", "#0 is not a parameter"),
    ("#1.5=3\n", "#1.5 is not a parameter"),
    ("#1\n", "'=' is missing"),
    ("#1=[1/0]\n", "1 is divided by zero"),
    ("#1=[1 MOD 0]\n", "MOD zero"),
    ("#1=[0**-1]\n", "has no value"),
    ("#1=[[-2]**0.5]\n", "whole powers"),
    ("#1=[10**200*10**200]\n", "not a finite number"),
    ("#1=EXP[1000]\n", "not a finite number"),
    ("#1=SQRT[-1]\n", "SQRT[-1] has no value"),
    ("#1=LN[0]\n", "LN[0] has no value"),
    ("#1=ACOS[1.1]\n", "ACOS[1.1] has no value"),
    ("#1=ASIN[-2]\n", "ASIN[-2] has no value"),
    ("#1=SINH[1]\n", "'[' is missing"),
    ("#1=FOO[1]\n", "cannot read a number, parameter or expression at 'foo[1]'"),
    ("#1=ATAN[1]\n", "'/' is missing"),
    ("#1=[1+2\n", "']' is missing"),
    ("#1=[1 PLUS 2]\n", "']' is missing"),
    ("#1=EXISTS[#5]\n", "EXISTS takes a named parameter"),
    ("#1=" + "[" * 50 + "1" + "]" * 50 + "\n", "more than 40 nested brackets"),
    ("#1=[1" + "+1" * 130 + "]\n", "LinuxCNC reads 255"),
    ("G0 X[1]=\n", "cannot read '='"),
    ("G#1\n", "#1 has no value yet"),
    ("T[1.5]\n", "unknown word T1.5"),
    ("G[1.05]\n", "unknown word G1.05"),
    ("(py, move(1))\n", "runs this comment as Python"),
    # flow
    ("O100 call [1]\n", "the subroutine '100' is not in the program (LinuxCNC reads it from 100.ngc)"),
    ("o<touch> call\n", "from touch.ngc"),
    ("o<f> sub\no<f> call\no<f> endsub\no<f> call\n", "more than 9 nested calls"),
    ("O1 if [1]\n", "O1 if is never closed"),
    ("O1 endif\n", "O1 endif without an open O-word"),
    ("O1 while [1]\nO2 endwhile\n", "O2 endwhile inside O1 while of line 7"),
    ("O1 if [1]\nO1 while [1]\n", "the label of O1 while appears twice"),
    ("O1 if [1]\nO1 else\nO1 elseif [1]\nO1 endif\n", "O1 elseif after else"),
    ("O1 if [1]\nO2 sub\n", "O2 sub inside O1 if"),
    ("O1 break\n", "O1 break is not in a loop"),
    ("O1 repeat [2]\nO1 break\nO1 endrepeat\n", "O1 break in a repeat"),
    ("O1 do\nO1 continue\nO1 while [0]\n", "takes it for the end of the loop"),
    ("O1 return\n", "return outside a subroutine"),
    ("O1 while\n", "while takes 1 values in brackets, not 0"),
    ("O1 else [1]\n", "else takes no values"),
    ("O1 jump\n", "cannot read the O-word 'jump'"),
    ("O#1 if [1]\n", "a computed label"),
    ("O[0-1] call\n", "O-1 is not a label"),
    ("/O1 if [1]\n", "a / before an O-word"),
    ("G0 X[1] O1 call\n", "must be first in its line"),
    ("M98 P100\n", "M98 P100: the program O100 is not in the file"),
    ("G1 X#1 F100\n", "#1 has no value yet"),
    ("O100 sub\n", "O100 sub is never closed"),
    ("G1 X5 X6 F100\n", "appears twice"),
    ("T9\n", "T9 is not in the tool table"),
    ("(open\n", "comment is not closed"),
    ("hello world\n", "cannot read"),
    ("G81 X0 Y0 Z-3 F100\n", "without R"),
    ("G83 X0 Y0 Z-3 R1 F100\n", "without Q"),
    ("G81 X0 Y0 Z3 R1 F100\n", "above R"),
    ("G80\nX5\n", "without a motion word"),
    ("G93 G1 X5 F2\nX6\n", "needs F in every block"),
    ("G95 S0\nG1 X5 F0.1\n", "without a spindle speed"),
    ("G4\n", "G4 needs P"),
    ("G53 G2 X1 Y1 R1\n", "G53 needs G0"),
    ("G53 G1 Z0 F100\n", "G53 needs G0"),
    ("G1 Z1 F100\nG53 Z0\n", "G53 needs G0"),
    ("G0.04 X1\n", "unknown word G0.04"),
    ("G1.04 X1 F100\n", "unknown word G1.04"),
    ("G43.1\n", "unknown word G43.1"),
    ("M3.5\n", "unknown word M3.5"),
    ("T1.5\n", "unknown word T1.5"),
    ("T-1\n", "unknown word T-1"),
    ("G43 H1.5\n", "unknown word H1.5"),
    ("G2 I5 P1.5 F100\n", "P1.5 is not a count"),
    ("G2 I5 P0 F100\n", "P0 is not a count"),
    ("G81 X1 Y1 Z-1 R1 L2.5 F100\n", "unknown word L2.5"),
    ("G0 G1 X1 F100\n", "G0 and G1 in one block"),
    ("G90 G91 X1\n", "G90 and G91 in one block"),
    ("G17 G18\n", "G17 and G18 in one block"),
    ("G20 G21\n", "G20 and G21 in one block"),
    ("G43 G49\n", "G43 and G49 in one block"),
    ("G61 G64 P0.01\n", "G61 and G64 in one block"),
    ("G80 G81 X1 Y1 Z-1 R1 F100\n", "G80 and G81 in one block"),
    ("M3 M5\n", "M3 and M5 in one block"),
    ("M0 M30\n", "M0 and M30 in one block"),
    ("G4 P-5\n", "G4 P-5 is a negative dwell"),
    ("G82 X1 Y1 Z-1 R1 P-5 F100\n", "P-5 is a negative dwell"),
    ("G2 G4 P1 X5 R9 F9\n", "coordinates in a block with G4"), ("G2 G4 P1 I5 F9\n", "coordinates in a block with G4"),
    ("G81 G4 P1 X5 Z-1 R1 F9\n", "coordinates in a block with G4"), ("X5 G4\n", "G4 needs P"),
    ("G0 X\u0663\n", "'\\u0663'"),
    ("G0 X1\u00a0Y1\n", "'\\xa0'"),
    ("N\u0663 G0 X1\n", "'\\u0663'"),
    ("G0 Z1" + "0" * 400 + "\n", "above 1e+15"),
    ("G1 F1" + "0" * 400 + " X1\n", "above 1e+15"),
    ("G1 X-100000001 F100\n", "farther than any machine moves"),
    ("G2 X10 Y0 I999999 J0 F100\n", "circles of different radii"),
    ("X1 O5\n", "unknown word O5"),
])
def test_named_with_its_line(body, message):
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + body + TAIL, name="a.ngc", tools={1, 2})
    error = caught.value
    assert message in error.message
    assert error.subjects[0] in ("line 7", "line 8", "line 9") and error.subjects[0] in error.message.replace(":", "")


@pytest.mark.parametrize("text", ["", HEAD + "G1 X5 F100\n", HEAD + "G1 X5 F1"])
def test_a_program_that_breaks_off(text):
    with pytest.raises(ProgramError, match="incomplete"):
        read_program(text)


@pytest.mark.parametrize("body", [
    "G2 X0 Y0 I5 P100000 F100\n", "G2 I1000000000000 F100\n", "G18 G3 K1000000000000 F100\n",
    "G2 I900000000000000 F9\n",
    "G83 X0 Y0 Z-5 R1 Q0.00001 F100\n", "G73 X0 Y0 Z-5 R1 Q0." + "0" * 320 + "1 F100\n",
    "G81 X0 Y0 Z-5 R1 L1000000 F100\n", "G83 X0 Y0 Z-50000000 R1 Q0.00000001 F100\n"])
def test_a_block_that_would_grow_without_bound_costs_no_memory(body):
    tracemalloc.start()
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + body + TAIL, name="a.ngc")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    error = caught.value
    assert error.code == "program_too_long" and error.subjects == ("line 7",) and "line 7" in error.message
    assert error.measured > error.limit == MAX_MOVES_A_BLOCK and error.remedy and peak < 5e6


@pytest.mark.parametrize("body, line", [("G1 F100\n" + "X1\nX2\n" * 60, 97), ("G2 I5 F100\n", 7)])
def test_a_program_of_too_many_moves(body, line, monkeypatch):
    """Plain lines are counted whenever a chunk of them is packed, arcs before they are written out."""
    monkeypatch.setattr(move_log, "MAX_MOVES", 90)
    monkeypatch.setattr(move_log.Log, "full", 5)
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + body + TAIL)
    assert caught.value.code == "program_too_long" and caught.value.limit == 90
    assert caught.value.subjects == (f"line {line}",)


def test_a_percent_sign_in_the_middle():
    with pytest.raises(ProgramError, match="line 3: a % within a program"):
        read_program("G21 G90\nT1 M6\n%\nM30\n")


def test_no_text():
    with pytest.raises(ProgramError, match="not a text file"):
        read_program("PK\x03\x04\x00\x00")


def test_several_lines_are_named_together():
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + "G1 A1 F100\nG1 X1 F5\nG41\n" + TAIL)
    assert caught.value.subjects == ("line 7", "line 9") and "1 more" in caught.value.message
