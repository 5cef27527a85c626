"""Lengths that a program writes: of two tools against the setup, and of the tool in force."""

import pytest

from verify.assumptions import AssumedKind
from verify.gcode.reader import read_program

LENGTHS = {1: 76.0, 2: 90.0}
WRITES = {"fanuc": "G10 L10 P{} R{}", "haas": "G10 L10 P{} R{}", "linuxcnc": "G10 L1 P{} Z{}"}


def remarks(a, b, dialect, measured=(1, 2), lengths=None, unit="G21"):
    write = WRITES[dialect]
    text = (f"%\n{unit} G17 G90 G94 G40 G49 G80 G64 P0.001\n{write.format(1, a)}\n{write.format(2, b)}\nT1 M6\nG43 H1\n"
            "S900 M3\nG0 X0. Y0.\nZ9.\nM2\n%\n")
    p = read_program(text.replace(" G64 P0.001", "") if dialect != "linuxcnc" else text, dialect=dialect, tools=[1, 2],
                     lengths=lengths or LENGTHS, measured=measured)
    return [(r.line, r.message) for r in p.remarks if "gauge_length_mm" in r.message]


@pytest.mark.parametrize("dialect", sorted(WRITES))
def test_lengths_differ_as_those_of_the_setup(dialect):
    for a, b in ((76.0, 90.0), (0.0, 14.0), (-314.0, -300.0), (76.2, 89.6)):
        assert not remarks(a, b, dialect)
    for a, b in ((76.0, 76.0), (90.0, 76.0), (0.0, 15.1), (-300.0, -300.0)):
        [(line, message)] = remarks(a, b, dialect)
        assert line == 4 and "14 mm more" in message
    assert not remarks(76.0, 76.0, dialect, measured=(1,))
    assert not remarks(3.0, 3.0 + 14.0 / 25.4, dialect, unit="G20") and remarks(3.0, 17.0, dialect, unit="G20")


def test_lengths_of_tool_def():
    text = ("BEGIN PGM 1 MM\nTOOL DEF 1 L+76 R+3\nTOOL DEF 2 L+{}\nTOOL CALL 1 Z S900\nL X+0 Y+0 R0 FMAX M3\n"
            "L Z+9 R0 FMAX\nM30\nEND PGM 1 MM\n")
    for length, count in ((90, 0), (76, 1)):
        p = read_program("\n".join(f"{k} {line}" for k, line in enumerate(text.format(length).splitlines())),
                         dialect="heidenhain", tools=[1, 2], radii={1: 3.0, 2: 3.0}, lengths=LENGTHS, measured=(1, 2))
        found = [r.line for r in p.remarks if "gauge_length_mm" in r.message]
        assert found == [3] * count


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("write", "again", "told"), [
    ("G10 L10 P1 R55.", "", True), ("G10 L11 P1 R-0.5", "", True), ("G10 L10 P1 R55.", "G43 H1\n", False),
    ("G10 L10 P1 R56.", "", False), ("G10 L10 P2 R55.", "", False), ("G10 L11 P1 R0.", "", False)])
def test_a_length_written_in_force(write, again, told, dialect):
    text = ("%\nO1\nG21 G17 G90 G94 G40 G49 G80 G54\nG10 L10 P1 R56.\nT1 M6\nG43 H1\nS900 M3\nG0 X0. Y0.\nZ9.\n"
            f"{write}\n{again}G0 Z12.\nM30\n%\n")
    found = [a for a in read_program(text, dialect=dialect, tools=[1, 2]).open if a.what is AssumedKind.LENGTH_REGISTER]
    assert [("line 10" in str(a.value), "lower" in a.effect) for a in found] == ([(True, True)] if told else [])
