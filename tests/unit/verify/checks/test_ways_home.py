"""Ways to fixed places of the machine, coordinates of the machine, lines behind the end, lengths of another tool."""

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from verify.checks.machine_limits import limit_findings, notes_on, way_findings
from verify.checks.program_sequence import FramedProgram, counted
from verify.checks.table_clearance import table_findings
from verify.gcode.reader import read_program
from verify.model import FindingKind, ProofSetup, StockKind

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
    assert still.any()
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
