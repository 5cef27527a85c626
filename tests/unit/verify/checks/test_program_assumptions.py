"""What a program leaves open: the path of rapids and the path mode, by dialect."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pocket_case import SETUP, TOOL
from verify.assumptions import AssumedKind
from verify.checks.program_assumptions import program_assumptions, rapids_decided, untold_axes
from verify.checks.program_sequence import FramedProgram
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

BOUNDS = np.array([[-12.0, -9.0, -6.0], [12.0, 9.0, 0.0]])
HEAD = "G21 G90 G17 G94 G54\nG61\nT1 M6\nS900 M3\nG43 H1\nG0 X-30. Y0\nZ20.\n"
CUT = "G1 Z-1. F100.\nG0 Z20.\n"
SLANTED = "Z-1.\nX-25. Z-2.\n" + CUT


def framed(text, dialect="linuxcnc", setup=SETUP, kinematics=None):
    program = read_program(f"{text}M5\nM30\n", tools={1}, dialect=dialect, kinematics=kinematics)
    return [FramedProgram(program, None, setup, BOUNDS)]


def taken(read, setup=SETUP):
    decided, own = rapids_decided(read, setup)
    told = program_assumptions(decided, (TOOL,), own, setup.dogleg is not None)
    return own.dogleg, {a.what: a.value for a in told}


@pytest.mark.parametrize(("dialect", "dogleg"), [
    ("linuxcnc", False), ("fanuc", True), ("haas", True)])
def test_rapids_go_as_the_control_moves_them(dialect, dogleg):
    """The path is told only where a rapid of several axes is not above everything."""
    own, told = taken(framed(HEAD + SLANTED, dialect))
    assert own is dogleg and told[AssumedKind.RAPID_PATH] == ("dogleg" if dogleg else "linear")
    assert AssumedKind.RAPID_PATH not in taken(framed(HEAD + CUT, dialect))[1]


@pytest.mark.parametrize("dogleg", [False, True])
def test_a_setup_that_states_the_path_has_its_way(dogleg):
    setup = replace(SETUP, dogleg=dogleg)
    own, told = taken(framed(HEAD + SLANTED, "fanuc", setup), setup)
    assert own is dogleg and AssumedKind.RAPID_PATH not in told


def test_a_program_that_turns_axes_has_straight_rapids():
    """Tool centre point control needs them; that the control is set so is assumed."""
    body = HEAD.replace("G43 H1", "G43.4 H1") + "G0 A30.\n" + SLANTED
    own, told = taken(framed(body, "fanuc", kinematics=Kinematics("table-table-AC")))
    assert own is False and told[AssumedKind.RAPID_PATH] == "linear"


def test_a_path_mode_that_parameters_decide_is_told():
    assert AssumedKind.PATH_MODE in taken(framed(HEAD.replace("G61\n", "") + CUT, "fanuc"))[1]
    assert AssumedKind.PATH_MODE not in taken(framed(HEAD + CUT, "fanuc"))[1]
    assert AssumedKind.PATH_MODE not in taken(framed(HEAD + CUT))[1]


def test_words_that_a_control_may_drop_are_told():
    told = taken(framed(HEAD.replace("S900 M3", "S900 M3 M8") + CUT, "fanuc"))[1]
    assert told[AssumedKind.COOLANT] == "M3 and M8 in one block both count"


@pytest.mark.parametrize(("first", "last", "left", "taken"), [
    ("G0 A0 C0", "G0 A30", False, []), ("G0 C0", "G0 A30", True, ["A0"]), ("G0 X1", "G0 A30 C90", True, ["A0, C0"]),
    ("G0 X1", "G0 A30 C90\nA0 C0", False, ["A0, C0"]), ("G0 X1", "G0 C360", False, ["A0, C0"]),
    ("G28", "G0 A30", False, []), ("G1 X1 F900\nG0 A0 C0", "G0 A30", False, [])])
def test_axes_that_are_not_stated_before_the_first_cut(first, last, left, taken):
    """The next run begins where this one leaves them. A feed move in air is no cut."""
    text = f"T1 M6\nS1000 M3\nG43 H1\nG61\nM428\n{first}\nG0 X0 Y0 Z50\nG1 X5 F100\n{last}\n"
    read = framed(text, kinematics=Kinematics("table-table-AC"))
    p = read[0].program
    found, told = untold_axes(read, np.ones(len(p), bool), p.feed == 100.0)
    assert [f.message[:27] for f in found] == ["the program does not state "] * left
    assert [a.value for a in told] == taken
    assert untold_axes(read, np.ones(len(p), bool), np.zeros(len(p), bool)) == ([], [])
