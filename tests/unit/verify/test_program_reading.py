"""Lines behind the end of a program: named, and read on for the faces that they would work on."""

import numpy as np
import pytest

from tests.pocket_case import TOOL
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
