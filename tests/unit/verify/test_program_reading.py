"""Lines behind the end of a program: named, and read on for the faces that they would work on."""

import numpy as np
import pytest

from tests.pocket_case import TOOL
from verify.gcode.reader import read_program
from verify.model import NcProgram
from verify.program_reading import read_on, read_one

HEAD = "G21 G90 G17 G94 G54 G61\nT1 M6\nS900 M3\nG43 H1\nG0 X0. Y0. Z5.\nG1 Z1. F100.\n"


def both(text, dialect="linuxcnc"):
    nc = NcProgram("p", HEAD + text, dialect=dialect)
    read = read_one(nc, (TOOL,))
    return read, read_on(nc, read, lambda program: read_one(program, (TOOL,)))


@pytest.mark.parametrize(("text", "end"), [
    ("M2\nX5.\nX9.\nM2\n", 7), ("N70 M5 M30\nX5.\nX9.\nM30\n", 7), ("X1.\nM02\nX5.\nX9.\n", 8),
    ("M2\nX5.\nM2\nX9.\nM2\n", 7)])
def test_a_program_is_read_on_through_its_ends(text, end):
    read, whole = both(text + "%\n" if not text.endswith("M2\n") else text)
    assert read.cut_off == end and any(f"line {end} ends the program" in n for n in read.notes)
    assert whole.end[-1, 0] == 9.0 and (whole.end[:len(read)] == read.end).all()


@pytest.mark.parametrize(("text", "dialect"), [
    ("X5.\nM30\n", "linuxcnc"), ("X5.\nM30\n%\n(made by hand)\n", "fanuc"), ("M2\nX5. Q9 W1\nM2\n", "linuxcnc")])
def test_nothing_follows_or_what_follows_cannot_be_read(text, dialect):
    assert both(text, dialect)[1] is None


@pytest.mark.parametrize("dialect", ["linuxcnc", "fanuc", "haas"])
@pytest.mark.parametrize("end", ["M30\n%\n", "M30\n"])
def test_a_program_is_read_on_through_a_percent_sign_in_its_middle(dialect, end):
    nc = NcProgram("p", "%\n" + HEAD + "X1.\n%\nX5.\nX9.\n" + end, dialect=dialect)
    read = read_one(nc, (TOOL,))
    assert read.cut_off == 9 and any("line 9 ends the program; 3 lines from 10 to 12" in n for n in read.notes)
    whole = read_on(nc, read, lambda program: read_one(program, (TOOL,)))
    assert whole.end[-1, 0] == 9.0 and (whole.end[:len(read)] == read.end).all()


@pytest.mark.parametrize(("dialect", "end"), [
    ("linuxcnc", "M99"), ("fanuc", "M99"), ("haas", "N8 M5 M99"), ("siemens", "RET"), ("siemens", "N8 M17"),
    ("siemens", "GOTOS")])
def test_a_program_is_read_on_through_a_return_of_a_subprogram(dialect, end):
    head = HEAD.replace("G94 G54 G61", "G54 G94") if dialect != "siemens" else (
        "G71 G90 G17 G94 G54\nT=\"T1\" M6\nS900 M3\nD1\nG0 X0 Y0 Z5\nG1 Z1 F100\n")
    nc = NcProgram("p", f"{head}X1.\n{end}\nX5.\nX9.\nM30\n", dialect=dialect)
    read = read_one(nc, (TOOL,))
    assert read.cut_off == 8 and read.end[-1, 0] == 1.0
    whole = read_on(nc, read, lambda program: read_one(program, (TOOL,)))
    assert whole.end[-1, 0] == 9.0 and (whole.end[:len(read)] == read.end).all()


def test_a_program_of_heidenhain_is_read_on_through_an_end_in_its_middle():
    text = ("BEGIN PGM X MM\nTOOL CALL 1 Z S900\nL X+0 Y+0 R0 FMAX M3\nL Z+5 FMAX\nL Z+1 F100\nEND PGM X MM\n"
            "L X+9\nL Z+5 M30\nEND PGM X MM\n")
    nc = NcProgram("p", text, dialect="heidenhain")
    read = read_one(nc, (TOOL,))
    assert read.cut_off == 6
    whole = read_on(nc, read, lambda program: read_one(program, (TOOL,)))
    assert len(whole) == len(read) + 2 and whole.end[-2, 0] == 9.0


def test_another_program_of_the_file_is_told_and_not_read_on():
    read, whole = both("X5.\nM30\nO2000\nG0 X9.\nM30\n%\n", "fanuc")
    assert read.cut_off == 0 and whole is None
    assert any("line 9 begins another program" in n for n in read.notes)


@pytest.mark.parametrize(("tolerance", "off"), [(0.01, 1e-3), (0.002, 5e-4), (0.001, 2.5e-4), (0.0001, 2e-4)])
def test_chords_of_arcs_are_finer_than_the_gouge_tolerance(tolerance, off):
    """A circle of radius 20; chords lie within it."""
    nc = NcProgram("p", HEAD + "G1 X20. Y0.\nG2 X20. Y0. I-20. J0.\nM2\n")
    read = read_one(nc, (TOOL,), gouge_tolerance=tolerance)
    arc = read.line == 8
    middle = 0.5 * (read.start[arc, :2] + read.end[arc, :2])
    most = float((20.0 - np.linalg.norm(middle, axis=1)).max())
    assert 0.8 * off < most <= off * (1.0 + 1e-6)


SUBPROGRAMS = {
    "siemens": "G17 G90 G54 G71\nT1 D1 M6\nS900 M3 F99\nG0 X0 Y0 Z9\nUP1(3)\nG0 Z50\nM30\n%_N_UP1_SPF\n"
               "PROC UP1(REAL A)\nDEF REAL B\nB=A*2\nG1 Y=B\nIF B>100\nG1 X9\nENDIF\nM17\n",
    "heidenhain": "BEGIN PGM A MM\nTOOL CALL 1 Z S900 F99\nL Z+9 FMAX M3\nCALL LBL 1\nL X+5 Y+0 FMAX M99\n"
                  "L Z+50 FMAX M30\nLBL 1\nCYCL DEF 200 DRILLING ~\nQ200=2 Q201=-2 ~\n"
                  "Q206=150 Q202=5 Q210=0 ~\nQ203=+0 Q204=20\n"
                  "FN 9: IF +1 EQU +1 GOTO LBL 9\nL X+9 Y+9\nLBL 9\nQ1 = 3\nLBL 0\nEND PGM A MM\n",
    "fanuc": "%\nO1\nG21 G90 G17 G94 G54\nT1 M6\nS900 M3\nG0 G43 H1 Z9.\nX0. Y0.\nG65 P10 A5.\nG0 Z50.\nM30\n"
             "O10\nG90\n#3=#1\nIF [#3 GT 3.] GOTO 5\nG1 X3. F99.\nN5\nG1 Y#3 F99.\nM99\n%\n",
    "linuxcnc": "G21 G90 G17 G94 G54 G61\nT1 M6\nS900 M3\nG43 H1\nG0 X0 Y0 Z9\nF99\no1 call\nG0 Z50\nM2\n"
                "o1 sub\n#1=3\no2 if [#1 gt 5]\nG1 X1\no2 endif\nG1 Y#1\no1 endsub\n"}


@pytest.mark.parametrize("dialect", SUBPROGRAMS)
def test_a_called_subprogram_behind_the_end_is_read_whole(dialect):
    """Its values, its jumps, and what a condition leaves out are no lines behind the end of the program."""
    read = read_program(SUBPROGRAMS[dialect], dialect=dialect)
    assert not read.cut_off and not [n for n in read.notes if "ends the program" in n]
