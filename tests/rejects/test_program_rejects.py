"""Programs that cannot be read: each names its line and what is wrong."""

import tracemalloc

import pytest

from geometry.errors import ProgramError, VerificationError
from verify import log
from verify.log import MOST_MOVES_A_BLOCK
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
    ("G53 G1 Z0 F100\n", "G53 needs G0"),
    ("G1 Z1 F100\nG53 Z0\n", "G53 needs G0"),
    ("G0.04 X1\n", "unknown word G0.04"),
    ("G1.04 X1 F100\n", "unknown word G1.04"),
    ("G43.1\n", "unknown word G43.1"),
    ("M3.5\n", "unknown word M3.5"),
    ("T1.5\n", "unknown word T1.5"),
    ("T-1\n", "unknown word T-1"),
    ("G43 H1.5\n", "unknown word H1.5"),
    ("G2 I5 P1.5 F100\n", "P1.5 is no count"),
    ("G2 I5 P0 F100\n", "P0 is no count"),
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
    ("G4 P-5\n", "G4 P-5 waits"),
    ("G82 X1 Y1 Z-1 R1 P-5 F100\n", "P-5 waits"),
    ("G4 P1 X5\n", "coordinates in a block with G4"),
    ("G0 X\u0663\n", "'\\u0663'"),
    ("G0 X1\u00a0Y1\n", "'\\xa0'"),
    ("N\u0663 G0 X1\n", "'\\u0663'"),
    ("G0 Z5\rX1\n", "'\\r'"),
    ("G0 Z1" + "0" * 400 + "\n", "beyond 1e+15"),
    ("G1 F1" + "0" * 400 + " X1\n", "beyond 1e+15"),
    ("G2 X10 Y0 I999999 J0 F100\n", "off one circle"),
    ("X1 O5\n", "unknown word O5"),
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


@pytest.mark.parametrize("body", [
    "G2 X0 Y0 I5 P100000 F100\n", "G2 I1000000000000 F100\n", "G18 G3 K1000000000000 F100\n",
    "G2 I900000000000000 F9\n",
    "G83 X0 Y0 Z-5 R1 Q0.00001 F100\n", "G73 X0 Y0 Z-5 R1 Q0." + "0" * 320 + "1 F100\n",
    "G81 X0 Y0 Z-5 R1 L1000000 F100\n", "G83 X0 Y0 Z-500000000000000 R1 Q0.1 F100\n"])
def test_a_block_that_would_grow_without_bound_costs_no_memory(body):
    tracemalloc.start()
    with pytest.raises(VerificationError) as caught:
        read_program(HEAD + body + TAIL, name="a.ngc")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    error = caught.value
    assert error.code == "program_too_long" and error.subjects == ("line 7",) and "line 7" in error.message
    assert error.measured > error.limit == MOST_MOVES_A_BLOCK and error.remedy and peak < 5e6


@pytest.mark.parametrize("body, line", [("G1 F100\n" + "X1\nX2\n" * 60, 97), ("G2 I5 F100\n", 7)])
def test_a_program_of_too_many_moves(body, line, monkeypatch):
    """Plain lines are counted whenever a chunk of them is packed, arcs before they are written out."""
    monkeypatch.setattr(log, "MOST_MOVES", 90)
    monkeypatch.setattr(log.Log, "full", 5)
    with pytest.raises(VerificationError) as caught:
        read_program(HEAD + body + TAIL)
    assert caught.value.code == "program_too_long" and caught.value.limit == 90
    assert caught.value.subjects == (f"line {line}",)


def test_a_percent_sign_in_the_middle():
    with pytest.raises(ProgramError, match="line 3: a % in the middle"):
        read_program("G21 G90\nT1 M6\n%\nM30\n")


def test_no_text():
    with pytest.raises(ProgramError, match="not a text file"):
        read_program("PK\x03\x04\x00\x00")


def test_several_lines_are_named_together():
    with pytest.raises(ProgramError) as caught:
        read_program(HEAD + "G1 A1 F100\nG1 X1 F5\nG41\n" + TAIL)
    assert caught.value.subjects == ("line 7", "line 9") and "1 more" in caught.value.message
