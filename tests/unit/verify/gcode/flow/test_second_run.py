"""The second run of a program, which begins with what the first one leaves: M99, tables of G10, modes at M30."""

import pytest

from verify.assumptions import AssumedKind
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

HEAD = "%\nO1\n{modes}G49 G80\nG54\nT1 M6\nG0 X0. Y0.\nG43 H1 Z15.\nS6000 M3\n"
CONTOUR = "X-25. Y-25.\nZ-0.2\nG41 D1 G1 X-7. Y-16. F500.\nY6.\nX7.\nY-6.\nX-16.\n{close}G1 X-25. Y-25.\nG0 Z15.\n"
MODES = "G21 G17 G90 G94 G40 G98 G69 "


def read(end, *, modes=MODES, head="", close="G40 ", dialect="fanuc"):
    text = (HEAD.format(modes=modes) + head + CONTOUR.format(close=close)).splitlines() + end.splitlines()
    return read_program("\n".join([*text, "%", ""]), dialect=dialect, tools=[1], radii={1: 3.0})


def remarks(*given, **named):
    found = read(*given, **named).remarks
    return [(r.line, r.message) for r in found if "again with" in r.message or "G10" in r.message]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("left", "told"), [
    ("G51 X0. Y0. P0.9", "a rotation, a scale"), ("G51.1 X0.", "a rotation, a scale")])
def test_a_frame_left_at_m99_turns_the_second_round(left, told, dialect):
    [(line, message)] = remarks(f"{left}\nM99", dialect=dialect)
    assert line == 19 and told in message and "line 4" in message


def test_a_rotation_that_the_beginning_ends_is_none():
    assert remarks("G68 X0. Y0. R90.\nM99") == []
    [(line, message)] = remarks("G68 X0. Y0. R90.\nM99", modes="G21 G17 G90 G94 G40 G98 ")
    assert line == 19 and "a rotation" in message


@pytest.mark.parametrize(("left", "word"), [("G91", "G90 "), ("G18", "G17 "), ("G95", "G94 ")])
def test_modes_left_at_m99_count_where_the_beginning_does_not_state_them(left, word):
    assert remarks(f"{left}\nM99") == []
    [(line, message)] = remarks(f"{left}\nM99", modes=MODES.replace(word, ""))
    assert line == 19 and left in message


def test_a_contour_left_open_at_m99():
    [(line, message)] = remarks("M99", modes=MODES.replace("G40 ", ""), close="")
    assert line == 18 and "G41 or G42 in force" in message
    assert remarks("M99", close="") == []


def test_a_good_loop_and_a_loop_that_counts_its_rounds():
    assert remarks("M5\nM99") == []
    assert remarks("M5\nG91 G28 Z0.\nM99") == []
    [(line, message)] = remarks("G91 G10 L2 P1 X0.5\nG90\nM99")
    assert line == 20 and "another place in line 10" in message


def test_linuxcnc_repeats_by_m99_too():
    assert remarks("M99", dialect="linuxcnc", close="G40 ") == []
    [(line, message)] = remarks("G95\nM99", modes="G17 G90 G40 ", dialect="linuxcnc")
    assert line == 19 and "another feed" in message


@pytest.mark.parametrize(("left", "line"), [
    ("G10 L13 P1 R-0.2", 11), ("G91 G10 L2 P1 X0.5\nG90", 10), ("G10 L11 P1 R-0.5", 7),
    ("G91 G10 L10 P1 R-1.\nG90", 7), ("G10 L12 P1 R2.8", 11)])
@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_a_value_left_in_a_table_moves_the_next_run(left, line, dialect):
    [(at, message)] = remarks(f"{left}\nM30", dialect=dialect)
    assert at == 18 and f"line {line};" in message


@pytest.mark.parametrize(("first", "last"), [
    ("G10 L13 P1 R0", "G10 L13 P1 R-0.2"), ("G10 L2 P1 X0. Y0. Z0.", "G10 L2 P1 X0.5"),
    ("G10 L12 P1 R3.", "G10 L12 P1 R2.8"), ("G10 L13 P1 R0", "G10 L13 P1 R-0.2\nG10 L13 P1 R0")])
def test_a_table_that_the_beginning_sets_is_no_matter(first, last):
    assert remarks(f"{last}\nM30", head=f"{first}\n") == []


def test_a_table_of_linuxcnc():
    [(line, _)] = remarks("G10 L1 P1 Z54\nM2", head="G10 L1 P1 Z55\n", dialect="linuxcnc")
    assert line == 19


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
def test_a_tilted_plane_left_at_m30_is_an_assumption(dialect):
    plane, text = "G68.2 X0. Y0. Z20. I90. J30. K-90.\nG53.1\n{}G91 G28 Z0.\nG28 B0. C0.\nG90\nM30", HEAD + CONTOUR
    machine = Kinematics("head-head-BC", ((0.0, 0.0, 100.0),))
    for end, left in (("", ["a tilted plane"]), ("G69\n", [])):
        lines = text.format(modes=MODES.replace("G69 ", ""), close="G40 ") + plane.format(end) + "\n%\n"
        p = read_program(lines, dialect=dialect, tools=[1], radii={1: 3.0}, kinematics=machine,
                         gauge_length={1: 100.0})
        assert [w for a in p.open if a.what is AssumedKind.MODES_LEFT for w in left if w in str(a.value)] == left


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("left", "word", "told"), [
    ("G91", "G90 ", "G91"), ("G18", "G17 ", "G18"), ("G95", "G94 ", "G95"),
    ("G51 X0. Y0. P0.9", "", "a rotation, a scale"), ("G20", "G21 ", "inches")])
def test_modes_left_at_m30_are_an_assumption(left, word, told, dialect):
    p = read(f"{left}\nM30", modes=MODES.replace(word, "") if word else MODES, dialect=dialect)
    [a] = [a for a in p.open if a.what is AssumedKind.MODES_LEFT]
    assert told in str(a.value) and "line " in a.effect
    if word:
        assert not any(a.what is AssumedKind.MODES_LEFT for a in read(f"{left}\nM30", dialect=dialect).open)


def test_controls_that_set_modes_back_leave_nothing_open():
    p = read("G95\nM2", modes="G17 G90 G40 ", dialect="linuxcnc")
    assert not p.open and not any("again" in r.message for r in p.remarks)


@pytest.mark.parametrize(("left", "head", "told"), [
    ("G20", "", "inches"), ("G20", "G21 ", ""), ("G90.1", "", "G90.1"), ("G90.1", "G91.1 ", ""),
    ("G91\nG18\nG95", "", "")])
def test_modes_that_m2_of_linuxcnc_leaves(left, head, told):
    """The manual lists what M2 sets back: the plane, G90, G94 and others, neither the unit nor the arc centres."""
    text = (f"{head}G64 P0.001 Q0\nT1 M6\nG43 H1\nS6000 M3\nG0 X2 Y0\nZ15\nG1 Z1 F90\nG3 X2 Y0 I-5 J0\nG0 Z15\n"
            f"{left}\nM2\n")
    p = read_program(text, tools=[1])
    found = [str(a.value) for a in p.open if a.what is AssumedKind.MODES_LEFT]
    assert bool(found) is bool(told) and all(told in value for value in found)


def test_a_contour_left_open_at_m30_is_an_assumption():
    p = read("M30", modes=MODES.replace("G40 ", ""), close="")
    assert [a.what for a in p.open] == [AssumedKind.MODES_LEFT]


@pytest.mark.parametrize("dialect", ["fanuc", "linuxcnc"])
def test_another_tool_left_in_the_spindle(dialect):
    end = "M30" if dialect == "fanuc" else "M2"
    text = ("%\nO1\nG21 G17 G90 G94 G40 G49 G80 G54\n{}G43 H1\nS6000 M3\nG0 X0. Y0.\nZ15.\nG1 Z1. F90.\nG0 Z15.\n"
            "T2 M6\n{}\n%\n")
    if dialect == "linuxcnc":
        text = text.replace("O1\n", "")

    def left(first, last):
        p = read_program(text.format(first, last), dialect=dialect, tools=[1, 2], spindle_tool=1)
        lines = [r.line for r in p.remarks if "again" in r.message]
        return [a for a in p.open if a.what is AssumedKind.MODES_LEFT], lines

    assert left("T1 M6\n", end) == ([], []) and left("T1 M6\n", "M99") == ([], [])
    (a,), _ = left("", end)
    assert "T2 in the spindle" in str(a.value)
    assert left("", "M99")[1] == [11 if dialect == "fanuc" else 10]


def test_a_cycle_that_states_its_height_of_return():
    cycle = "G99 G81 X0. Y0. Z-3. R2. F300.\nG80\n"
    assert not read(f"{cycle}M30", modes="G17 G90 G94 G40 G69 ").open
    [a] = read("G81 X0. Y0. Z-3. R2. F300.\nX5.\nG80\nG99\nM30", modes="G17 G90 G94 G40 G69 ").open
    assert "G99" in str(a.value)


@pytest.mark.parametrize(("left", "told"), [
    ("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 Z-1", True),
    ("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 Z-1\nCYCL DEF 7.1 Z+0", False),
    ("CYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+90", True)])
@pytest.mark.parametrize("first", [False, True])
def test_coordinates_left_on_a_heidenhain_control(left, told, first):
    """MP7300 or clearMode decide whether M30 ends them, so a beginning that states them leaves nothing open."""
    reset = "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+0\nCYCL DEF 7.2 Y+0\nCYCL DEF 7.3 Z+0\n" \
            "CYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+0\n"
    text = (f"BEGIN PGM 1 MM\n{reset if first else ''}TOOL CALL 1 Z S6000\nL X+0 Y+5 Z+50 R0 FMAX M3\nL Z+2 FMAX\n"
            f"L Z-1 F500\nL X+20\nL Z+50 FMAX\n{left}\nM30\nEND PGM 1 MM\n")
    p = read_program(text, dialect="heidenhain", tools=[1])
    assert any(a.what is AssumedKind.MODES_LEFT for a in p.open) is (told and not first)


@pytest.mark.parametrize("end", ["CYCLE800()\nM30", "M30"])
def test_a_plane_of_cycle800_left_on_a_siemens_control(end):
    text = ('G710 G17 G90 G94 G54\nT1 M6\nD1\nS6000 M3\nG0 X0 Y5 Z50\nG1 Z-1 F500\nX20\nG0 Z50\n'
            'CYCLE800(1,"",0,57,0,0,0,0,30,0,0,0,0,-1,,1)\nSUPA G0 Z0\nG0 B0 C0\n' + end + "\n")
    p = read_program(text, dialect="siemens", tools=[1], kinematics=Kinematics("head-head-BC", ((0.0, 0.0, 100.0),)),
                     gauge_length={1: 100.0})
    assert any(a.what is AssumedKind.MODES_LEFT for a in p.open) is (end == "M30")
