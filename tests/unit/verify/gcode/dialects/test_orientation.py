"""Rotary angles of tool vectors on a machine with a range of angles."""

import numpy as np
import pytest

from verify.gcode.dialects.orientation import ways_differ
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

HEADS = {
    "siemens": ("G710 G17 G90 G94\nT1 M6\nD1\nS6000 M3\nTRAORI\nG54\n{way}\nG0 X0 Y0 Z50\n"
                "G1 X10 A3=0.5 B3=0 C3=0.8660254 F500\nG0 Z60\nM30\n", ("ORIWKS", "ORIMKS")),
    "fanuc": ("%\nO1\nG21 G17 G90 G94 G54\nT1 M6\nS6000 M3\nG0 G43.5 H1 Z50.\nG0 X0. Y0.\n"
              "G1 X10. I0.5 J0. K0.8660254 F500.\nG0 Z60.\nM30\n%\n", ("",)),
    "heidenhain": ("BEGIN PGM 1 MM\nTOOL CALL 1 Z S6000\nM3\nFUNCTION TCPM F TCP AXIS POS PATHCTRL {way}\n"
                   "L X+0 Y+0 Z+50 R0 FMAX\nLN X+10 Y+0 Z+50 TX+0.5 TY+0 TZ+0.8660254 F500\nL Z+60 FMAX\nM30\n"
                   "END PGM 1 MM\n", ("AXIS", "VECTOR")),
}
CASES = [(dialect, text.format(way=way)) for dialect, (text, ways) in HEADS.items() for way in ways]


@pytest.mark.parametrize(("dialect", "text"), CASES)
@pytest.mark.parametrize(("tilt", "turn"), [((0.0, 110.0), 90.0), ((-110.0, 0.0), -90.0)])
def test_a_vector_takes_the_setting_within_the_range(dialect, text, tilt, turn):
    """A30 C90 and A-30 C-90 give one axis; a table that tilts to one side has one of them."""
    machine = Kinematics("table-table-AC", limits=(tilt, (-360.0, 360.0)))
    p = read_program(text, dialect=dialect, tools=[1], kinematics=machine)
    end = np.degrees(p.poses.end_turn[-1])
    assert end == pytest.approx([30.0 if tilt[1] else -30.0, turn], abs=1e-4)
    assert p.poses.end_axis[-1] == pytest.approx([0.5, 0.0, 0.8660254], abs=1e-6)
    assert np.abs(p.poses.end_turn[:, 0]).max() <= np.radians(30.0) + 1e-6


def ways_left_open(words, end="A30 C90"):
    text = f"G710 G17 G90 G94\nT1 M6\nD1\nS6000 M3\nTRAORI\nG54\n{words}\nG0 X0 Y0 Z50 A30 C0\nG1 X10 {end} F500\nM30\n"
    p = read_program(text, dialect="siemens", tools=[1], kinematics=Kinematics("table-table-AC"))
    return [a.value for a in p.open if a.what == "axis_way"]


def test_the_way_of_the_tool_axis_is_open_where_no_word_of_both_groups_states_it():
    """ORIWKS and ORIMKS are of group 25, ORIVECT and ORIAXES of group 51; machine data 21104 decide which counts."""
    for words, way in (("", "even"), ("ORIAXES", "even"), ("ORIMKS", "even"), ("ORIWKS", "great"), ("ORIVECT", "great"),
                       ("ORIWKS ORIAXES", "even"), ("ORIMKS ORIVECT", "great")):
        (value,) = ways_left_open(words)
        assert value.startswith(way) and value.endswith("line 9")
    (value,) = ways_left_open("", "A3=0.5 B3=0 C3=0.8660254")
    assert value.startswith("great")
    assert not ways_left_open("ORIMKS ORIAXES") and not ways_left_open("ORIWKS\nORIVECT")
    assert not ways_left_open("", "A60 C0") and not ways_left_open("", "A30.1 C0.1")  # both ways are one


@pytest.mark.parametrize(("start", "end", "differ"), [
    ((30, 0), (30, 90), True), ((30, 0), (60, 0), False), ((-30, 0), (60, 0), False), ((0, 0), (0, 170), False),
    ((30, 0), (30, 360), True), ((90, 0), (90, 90), False), ((30, 0), (-30, 180), True), ((90, 0), (90, 180), True),
    ((30, 0), (30.5, 1), False), ((30, 0), (32, 3), True)])
def test_where_even_turns_are_no_great_circle(start, end, differ):
    assert ways_differ(Kinematics("head-head-BC"), start, end) is differ
