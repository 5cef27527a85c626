"""Tapping cycles of Siemens and Heidenhain: the lines whose moves they make, and left-hand threads."""

import pytest

from verify.gcode.reader import read_program

SIEMENS = "G710 G17 G90 G94 G54\nT1 M6 D1\nS500 M3\nG0 X0 Y0 Z15\n{}G0 Z20\nM30\n"
HEIDENHAIN = ["TOOL CALL 1 Z S500", "L X+0 Y+0 FMAX M3", "L Z+15 FMAX", "{}", "L X+5 Y+0 FMAX M99", "L Z+20 FMAX M30"]
CYCLE = "MCALL CYCLE84(15,10,2,1,,0,3,,{},0,500,500)\nX5\nMCALL\n"


@pytest.mark.parametrize(("lines", "taps", "left"), [
    (CYCLE.format(0.8), {6: True}, False), (CYCLE.format(-0.8), {6: True}, True),
    ("MCALL CYCLE840(15,10,2,1,,0,4,3,1,,0.8)\nX5\nMCALL\n", {6: True}, False),
    ("MCALL CYCLE85(15,10,2,1,,0,400,400)\nX5\nMCALL\n", {}, False),
    ("G331 Z1 K0.8 S500\nG332 Z12 K0.8\n", {5: False, 6: True}, False),
    ("G331 Z1 K-0.8 S500\nG332 Z12 K-0.8\n", {5: False, 6: True}, True)])
def test_siemens(lines, taps, left):
    p = read_program(SIEMENS.format(lines), dialect="siemens")
    assert p.taps == taps and any("left-hand" in r.message for r in p.remarks) == left


@pytest.mark.parametrize(("cycle", "taps", "left"), [
    ("207 TAP Q200=2 Q201=-9 Q239=+0.8 Q203=10 Q204=5", {6: True}, False),
    ("207 TAP Q200=2 Q201=-9 Q239=-0.8 Q203=10 Q204=5", {6: True}, True),
    ("206 TAP Q200=2 Q201=-9 Q206=400 Q211=0 Q203=10 Q204=5", {6: True}, False),
    ("201 REAM Q200=2 Q201=-9 Q206=400 Q211=0 Q208=400 Q203=10 Q204=5", {}, False)])
def test_heidenhain(cycle, taps, left):
    body = [line.format(f"CYCL DEF {cycle}") for line in HEIDENHAIN]
    text = "\n".join(f"{n} {line}" for n, line in enumerate(["BEGIN PGM A MM", *body, "END PGM A MM"]))
    p = read_program(text + "\n", dialect="heidenhain")
    assert p.taps == taps and any("left-hand" in r.message for r in p.remarks) == left


BORE = "G710 G17 G90 G94\nT1 M6\nD1\nS400 M3\nG0 X0 Y0 Z50\nCYCLE84(50,12,3,-1,,0,3,,0.8,0,400{})\nM30\n"


@pytest.mark.parametrize(("dialect", "text", "speed"), [
    ("siemens", BORE.format(",900"), 900), ("siemens", BORE.format(""), 400),
    ("haas", "%\nO1\nG21 G17 G90 G94 G54\nT1 M6\nS400 M3\nG0 G43 H1 Z50.\nG0 X0. Y0.\nG84 Z-1. R15. F320. J3\n"
     "G80\nM30\n%\n", 1200),
    ("heidenhain", "BEGIN PGM 1 MM\nTOOL CALL 1 Z S400\nL X+0 Y+0 Z+50 R0 FMAX M3\nCYCL DEF 209 Q200=+3 Q201=-13 "
     "Q239=+0.8 Q203=+12 Q204=+38 Q257=+3 Q256=+1 Q336=+0 Q403=+2.5\nCYCL CALL\nM30\nEND PGM 1 MM\n", 1000)])
def test_a_tap_that_comes_out_faster_turns_faster(dialect, text, speed):
    """SST1 of CYCLE84, J of G84 and Q403 of cycle 209 count against the limits of machine and tool."""
    assert read_program(text, dialect=dialect, tools=[1]).speeds[1][0] == speed
