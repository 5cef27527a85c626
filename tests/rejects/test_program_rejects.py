"""Programs that cannot be read: each names its line and what is wrong."""

import pytest

from geometry.errors import ProgramError
from verify.reader import read_program

HEAD = "%\nG21 G90 G17 G94 G40 G49 G54\nT1 M6\nS1000 M3\nG0 X0 Y0\nG43 H1 Z10\n"
TAIL = "M30\n%\n"


@pytest.mark.parametrize("body, message", [
    ("G1 X5\n", "without a feed"),
    ("G2 X5 Y5 F100\n", "without its centre"),
    ("G2 X5 Y5 K1 F100\n", "without its centre"),
    ("G2 X5 Y0 I2.5 K1 F100\n", "no meaning in plane G17"),
    ("G2 X10 Y0 I3 J0 F100\n", "off one circle"),
    ("G2 X10 Y0 R4 F100\n", "cannot span"),
    ("G2 X0 Y0 R4 F100\n", "two different ends"),
    ("G1 A5 F100\n", "unknown word A5"),
    ("G1 X5 U1 F100\n", "unknown word U1"),
    ("G41 D1\n", "G41 (cutter radius compensation)"),
    ("G43.4 H1\n", "tool centre point control"),
    ("G92 X0\n", "shifted origin"),
    ("G84 Z-5 R1 F100\n", "unknown word G84"),
    ("M98 P100\n", "unknown word M98"),
    ("G1 X#1 F100\n", "cannot read 'G1X#1"),
    ("O100 sub\n", "subroutine"),
    ("G1 X5 X6 F100\n", "stands twice"),
    ("T9\n", "T9 is not in the tool table"),
    ("(open\n", "comment is not closed"),
    ("hello world\n", "cannot read"),
    ("G81 X0 Y0 Z-3 F100\n", "without R"),
    ("G83 X0 Y0 Z-3 R1 F100\n", "without Q"),
    ("G81 X0 Y0 Z3 R1 F100\n", "above R"),
    ("G80\nX5\n", "without a motion word"),
    ("G93 G1 X5 F2\nX6\n", "needs F on every line"),
    ("G95 S0\nG1 X5 F0.1\n", "without a spindle speed"),
    ("G4\n", "G4 needs P"),
    ("G53 G2 X1 Y1 R1\n", "G53 needs G0"),
])
def test_named_with_its_line(body, message):
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + body + TAIL, name="a.ngc", tools={1, 2})
    error = caught.value
    assert message in error.message
    assert error.subjects[0] in ("line 7", "line 8") and error.subjects[0] in error.message.replace(":", "")


@pytest.mark.parametrize("text", ["", HEAD + "G1 X5 F100\n", HEAD + "G1 X5 F1"])
def test_a_program_that_breaks_off(text):
    with pytest.raises(ProgramError, match="cut off"):
        read_program(text)


def test_no_text():
    with pytest.raises(ProgramError, match="not a text file"):
        read_program("PK\x03\x04\x00\x00")


def test_several_lines_are_named_together():
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + "G1 A1 F100\nG1 X1 F5\nG41\n" + TAIL)
    assert caught.value.subjects == ("line 7", "line 9") and "1 more" in caught.value.message
