"""M words without a meaning for the reader: one rule for five controls."""

import re

import pytest

from geometry.errors import ProgramError
from tests.doc_pages import ROOT
from tests.program_pairs import read
from verify.gcode.machine_words import FANUC_M, HAAS_M, HEIDENHAIN_M, SIEMENS_M
from verify.gcode.reader import read_program

HEAD = "G21 G90 G17 G61 G54\nT1 M6\nG43 H1\nS900 M3\nG0 X0. Y0. Z5.\nG1 Z1. F100.\n"
REFUSED = {"fanuc": FANUC_M, "haas": HAAS_M, "siemens": SIEMENS_M, "heidenhain": HEIDENHAIN_M}
ALWAYS = {"heidenhain": {97, 98, 130, 197}}
"""Words that are refused in some states only."""


def program(dialect, line):
    if dialect in ("siemens", "heidenhain"):
        return read(line, dialect)
    return read_program(f"{HEAD}{line}\nX1.\nM30\n", dialect=dialect, radii={1: 3.0})


@pytest.mark.parametrize(("dialect", "word", "line"), [
    ("linuxcnc", 110, 7), ("fanuc", 88, 7), ("haas", 88, 7), ("siemens", 77, 6), ("heidenhain", 211, 6)])
def test_functions_of_the_machine_pass_with_one_note(dialect, word, line):
    p = program(dialect, f"M{word}\nM{word}\nM{word + 1}" if dialect != "heidenhain" else
                f"L M{word}\nL X+1 M{word}\nL M{word + 1}")
    functions = [n for n in p.notes if n.startswith("functions of the machine")]
    last = line + 2
    assert functions == [f"functions of the machine that count as moving nothing: M{word} (line {line}), "
                         f"M{word + 1} (line {last})"]
    assert not p.remarks


@pytest.mark.parametrize("dialect", REFUSED)
def test_words_that_move_are_refused_with_their_line(dialect):
    for word in REFUSED[dialect].keys() - ALWAYS.get(dialect, set()):
        with pytest.raises(ProgramError, match=rf"line \d+: .*M{word}\b"):
            program(dialect, f"L X+1 M{word}" if dialect == "heidenhain" else f"M{word}")


def test_linuxcnc_refuses_what_its_control_refuses():
    for word in (10, 99.5, 200, 999):
        with pytest.raises(ProgramError, match="unknown word M"):
            program("linuxcnc", f"M{word}")


def test_a_spindle_that_takes_a_position_stands():
    p = program("siemens", "M19\nG1 X5")
    assert any("spindle" in r.message for r in p.remarks)


def test_the_page_lists_every_refused_word():
    page = (ROOT / "docs" / "verify.md").read_text()
    for title, words in (("Fanuc", FANUC_M), ("Haas", HAAS_M), ("Siemens", SIEMENS_M), ("Heidenhain", HEIDENHAIN_M)):
        row = re.search(rf"^\| {title} \| (M.*) \|$", page, re.MULTILINE)[1]
        assert {int(m) for m in re.findall(r"M(\d+)", row)} >= set(words), title


ALARMS = [
    ("linuxcnc", "(ABORT, worn)", "o100 if [1 EQ 2]\n(abort, worn)\no100 endif"),
    ("fanuc", "#3000=1(WORN)", "IF[1 NE 2]GOTO5\n#3000=1(WORN)\nN5"),
    ("haas", "#3000=1", "IF[1 NE 2]GOTO5\n#3000=1\nN5"),
    ("siemens", "SETAL(65000)", "IF 1==2\nSETAL(65000)\nENDIF"),
    ("heidenhain", "FN 14: ERROR=1000", "FN 9: IF +1 EQU +1 GOTO LBL 5\nFN 14: ERROR=1000\nLBL 5"),
]


@pytest.mark.parametrize(("dialect", "alarm", "guarded"), ALARMS)
def test_an_alarm_of_the_program_ends_it_where_it_is_reached(dialect, alarm, guarded):
    """What follows is never run; behind a jump that passes it over nothing happens."""
    with pytest.raises(ProgramError, match="stops here with an alarm"):
        program(dialect, alarm)
    program(dialect, guarded)


@pytest.mark.parametrize("comment", ["; abort, worn", "(abort , worn)", "(aborted, worn)"])
def test_what_linuxcnc_takes_for_a_comment_stops_nothing(comment):
    program("linuxcnc", comment)


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_on_fanuc_and_haas_abort_is_a_comment_like_others(dialect):
    program(dialect, "(ABORT, WORN)")
