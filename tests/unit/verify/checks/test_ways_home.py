"""Ways to fixed places of the machine, coordinates of the machine, lines behind the end, lengths of another tool."""

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from tests.pocket_case import block
from verify.checks.clear_height import lifted
from verify.checks.machine_limits import limit_findings, low_places, notes_on, way_findings
from verify.checks.program_sequence import FramedProgram, counted, read_all
from verify.checks.table_clearance import table_findings
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import FindingKind, NcProgram, ProofSetup, ScoredSamples, StockKind
from verify.prove import prove

TOOL = ToolBody("T1", 1, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 45.0)
BOUNDS = np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, 10.0]])
HEAD = "%\nG21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0\nZ15\n"  # line 8 is the first of a body
SETUP = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, clearance_rapid=1.0)


def program(*lines, end="M30", behind=()):
    return read_program(HEAD + "\n".join([*lines, "M5", end, *behind, "%"]) + "\n", tools={1, 2})


@pytest.mark.parametrize(("height", "fine"), [(15.0, True), (11.0, True), (10.5, False), (4.0, False)])
@pytest.mark.parametrize("home", ["G91 G28 X0 Y0 Z0", "G53 G0 X0 Y0", "G28"])
def test_x_and_y_go_home_from_above_everything(home, height, fine):
    p = program(f"G0 Z{height}", home, "G90")
    assert not [r for r in p.remarks if "fixed place" in r.message]
    found = [f for f in way_findings(p, BOUNDS, [TOOL], SETUP) if "fixed place" in f.message]
    assert [f.line for f in found] == ([] if fine else [9])
    if not fine:
        assert found[0].depth == pytest.approx(11.0 - height) and found[0].limit == 11.0


@pytest.mark.parametrize("home", ["G28", "G53 G0 X0 Y0"])
def test_without_a_tool_no_height_is_above_everything(home):
    text = HEAD.replace("T1 M6\nS1000 M3\nG43 H1\n", "") + f"G0 Z4\n{home}\nM30\n%\n"
    assert [r for r in read_program(text, tools={1}).remarks if "fixed place" in r.message]


def test_a_move_of_no_length_is_no_move():
    p = program("G0 Z5", "G91 G28 Z0", "G90")
    still = (p.start == p.end).all(axis=1)
    still[p.unknown[:, 0]] = False
    still[[row for row, _ in p.lifts]] = False  # how long the way home is, only the proof knows
    assert still.any() and len(p.lifts) == 1
    kept = counted([FramedProgram(p, None, SETUP, BOUNDS)], [1])
    assert (kept == ~still).all()


@pytest.mark.parametrize(("word", "over"), [("X-99999", 99499.0), ("Z-300.5", 0.5), ("Y400", None), ("X-500", None)])
def test_coordinates_of_the_machine_beyond_its_travel(word, over):
    p = program("G53 G0 Z0", f"G53 G0 {word}")
    found = limit_findings([p], ProofSetup(travel=np.array([500.0, 400.0, 300.0])))
    found = [f for f in found if "G53" in f.message]
    assert [(f.line, f.depth) for f in found] == ([] if over is None else [(9, pytest.approx(over))])
    assert all(f.kind == FindingKind.LIMIT for f in found)


def test_lines_behind_the_end_are_named():
    p = program("G1 Z9 F100", end="M2", behind=("(a comment)", "G1 X5", "", "G1 X9"))
    notes = list(notes_on(p, 0.0, SETUP))
    assert any("line 10 ends the program; 2 lines from 12 to 14 stand behind it and are not read" in n for n in notes)
    assert not [n for n in notes_on(program(behind=("(only words)",)), 0.0, SETUP) if "stand behind" in n]


def test_a_length_of_another_tool_counts_in_rapids():
    stale = program("T2 M6", "S900 M3", "G0 X1 Y1", "Z12", "G43 H2", "G0 Z15")
    assert [r.line for r in stale.remarks if "in a rapid with length offset H1 and tool T2" in r.message] == [11]
    right = program("T2 M6", "S900 M3", "G0 X1 Y1", "G43 H2", "Z12", "G0 Z15")
    assert not [r for r in right.remarks if "in a rapid" in r.message]


@pytest.mark.parametrize(("lines", "depth"), [(["G1 Z-14.9 F100"], None), (["G1 Z-15.2 F100"], 0.2),
                                              (["G0 Z-14.5"], 0.5), (["G0 Z-14"], None)])
def test_the_table_counts_on_three_axes(lines, depth):
    p = program(*lines, "G0 Z15")
    known = ProofSetup(table=-15.0, table_known=True, clearance_rapid=1.0)
    found = table_findings([p], [TOOL], known)
    assert [(f.line, f.depth) for f in found] == ([] if depth is None else [(8, pytest.approx(depth))])
    assert table_findings([p], [TOOL], ProofSetup(table=-15.0, table_known=False)) == []


HEADS, TABLES = Kinematics("head-head-AC", ((0.0, 0.0, 100.0),)), Kinematics("table-table-AC", ((0.0,) * 3, (0.0,) * 3))
AWAY = {"linuxcnc": "G53 G0 Z0", "heidenhain": "L M140 MB MAX FMAX"}
TILTED = {
    "linuxcnc": "%\nG21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nM428\nG0 X0 Y0\nZ60\nA-30\nX1 Y2 Z5\n",
    "heidenhain": "BEGIN PGM A MM\nTOOL CALL 1 Z S1000\nL Z+0 R0 FMAX M91\nL A+0 C+0 FMAX M3\nL X+0 Y+0 FMAX\n"
                  "L Z+60 FMAX\nM128\nL A-30 FMAX\nL X+1 Y+2 Z+5 FMAX\n"}


@pytest.mark.parametrize(("dialect", "machine", "along"), [("linuxcnc", HEADS, False), ("linuxcnc", TABLES, True),
                                                           ("heidenhain", HEADS, True), ("heidenhain", TABLES, True)])
def test_the_way_home_is_followed_until_all_of_the_tool_is_above_everything(dialect, machine, along):
    """Z of the machine is the tool axis where the table tilts, and Z of the setup where the head does."""
    held = ToolBody("T1", 1, 8.0, 0.0, 20.0, 8.0, 20.0, 8.0, 45.0, (HolderFrustum(50.0, 50.0, 30.0),))
    end = "M30\n%\n" if dialect == "linuxcnc" else "M129\nM30\nEND PGM A MM\n"
    p = read_program(TILTED[dialect] + AWAY[dialect] + "\n" + end, tools={1}, kinematics=machine, dialect=dialect,
                     gauge_length={1: 75.0}, radii={1: 4.0})
    ((row, _),) = p.lifts
    setup = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, clearance_rapid=1.0, kinematics=machine)
    assert p.end[row].tolist() == p.start[row].tolist() == pytest.approx([1, 2, 5])
    way = lifted(p, low_places(p, [held], setup), BOUNDS, setup)[row] - p.start[row]
    up = p.poses.end_axis[row] if along else np.array([0.0, 0.0, 1.0])
    assert np.linalg.norm(np.cross(way, up)) < 1e-9 and up[2] > 0.8
    corners = np.array([[x, y, z] for x in BOUNDS[:, 0] for y in BOUNDS[:, 1] for z in BOUNDS[:, 2]])
    lowest = (p.start[row] + way) @ up if along else p.start[row, 2] - 4.0 * np.sin(np.radians(30.0)) + way[2]
    assert lowest >= (corners @ up).max() + 1.0


@pytest.mark.parametrize(("home", "line"), [("G53 G0 Z0", 13), ("G91 G28 Z0", 13), ("T0 M6", None)])
def test_a_cutter_with_a_thin_neck_goes_home_through_what_stands_over_it(home, line):
    cutter = ToolBody("T1", 1, 8.0, 0.0, 2.0, 2.0, 30.0, 6.0, 60.0, ())
    part = block()  # X -20 to 20, Y -15 to 15, Z -10 to 0
    text = HEAD + "\n".join(["G0 X-30", "Z-5", "G1 X-23 F500", "X-22.5", f"(lifts) {'G1 X-30' * (line is None)}", home,
                             "M5", "M30", "%"]) + "\n"
    s = sample_surface(part.mesh, 0.5, seed=1)
    none = ScoredSamples(s, np.zeros(len(s), np.int32))
    found = prove([NcProgram("p", text)], part, [cutter], SETUP, none, []).findings
    assert {f.line for f in found if f.kind == FindingKind.RAPID} == ({line} if line else set())


@pytest.mark.parametrize(("first", "depth"), [("G0 Z4", 7.0), ("G0 Z11", None), ("G0 X0\nZ10.5", 0.5),
                                              ("G0 X0 Y0 Z15", None)])
def test_z_does_not_come_down_before_x_and_y_are_stated(first, depth):
    """At the start, and where a way home leaves X and Y of the part unknown."""
    text = HEAD.replace("G0 X0 Y0\nZ15\n", first + "\nG0 Z15\nX0 Y0\n") + "G1 Z9 F100\nG0 Z15\nM5\nM30\n%\n"
    p = read_program(text, tools={1})
    found = [f for f in way_findings(p, BOUNDS, [TOOL], SETUP) if "before X and Y are stated" in f.message]
    assert [f.depth for f in found] == ([] if depth is None else [pytest.approx(depth)])
    tilted = TILTED["linuxcnc"] + "Z60\nG53 G0 Z0\nM429\nA0\nZ4\nZ15\nX0 Y0\nM5\nM30\n%\n"
    p = read_program(tilted, tools={1}, kinematics=HEADS, gauge_length={1: 75.0})
    setup = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, kinematics=HEADS)
    found = [f for f in way_findings(p, BOUNDS, [TOOL], setup) if "before X and Y are stated" in f.message]
    assert [(f.line, f.depth) for f in found] == [(15, pytest.approx(7.0))]


@pytest.mark.parametrize(("turn", "known"), [(np.diag([-1.0, -1.0, 1.0]), True), (np.diag([1.0, -1.0, -1.0]), False)])
def test_the_height_of_the_table_holds_only_where_z_stays(turn, known):
    setup = ProofSetup(**{**SETUP.__dict__, "table": -15.0, "table_known": True})
    (framed,) = read_all([NcProgram("p", HEAD + "M30\n%\n", turn=turn)], block(), [TOOL], setup, 0, lambda _: None)
    assert framed.setup.table_known is known and framed.setup.table == (-15.0 if known else None)
