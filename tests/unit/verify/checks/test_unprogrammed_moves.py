"""Ways of leaning tools that start nobody knows where, turns on a way nobody knows, and what is above everything."""

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from verify.checks.machine_limits import way_findings
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import ProofSetup, StockKind

TOOL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0, (HolderFrustum(50.0, 50.0, 30.0),))
BOUNDS = np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, 20.0]])
PIVOTS = {"table-table-AC": ((0.0, 0.0, -50.0), (0.0, 0.0, 0.0)), "head-table-BC": ((0.0, 0.0, 100.0), (0.0, 0.0, 0.0)),
          "head-head-AC": ((0.0, 0.0, 100.0),)}
HEAD = "%\nG21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG53 G0 Z0\n"  # line 7 is the first of a body


def found(kind, *lines, gauge=True, **options):
    machine = Kinematics(kind, PIVOTS[kind])
    setup = ProofSetup(kinematics=machine, gauge_length={1: 75.0} if gauge else {}, stock_kind=StockKind.PART_OFFSET,
                       margin=0.0, uncertainty=0.0, **options)
    p = read_program(HEAD + "\n".join(lines) + "\nM5\nG53 G0 Z0\nM30\n%\n", kinematics=machine, gauge_length={1: 75.0})
    return [(f.line, f.message) for f in way_findings(p, BOUNDS, [TOOL], setup)]


def test_a_table_that_tilts_is_come_to_along_the_tool():
    """The tool lies along +Y. Its tip 25 mm up, 5 over the part, but where the part is: from where X and Z of the part
    are not stated it came past the side of the part, if not through it."""
    (line, message), = found("table-table-AC", "G0 A90 C0", "M428", "G0 X0 Y-15 Z25")
    assert line == 9 and "36.000 mm too low along the tool axis" in message
    assert found("table-table-AC", "G0 A90 C0", "M428", "G0 X0 Y21.1 Z25") == []
    assert found("table-table-AC", "G0 A90 C0", "M428", "G0 X0 Y21.1 Z5", "G1 Y20.5 F100") == []  # beside it, and in
    assert [line for line, _ in found("table-table-AC", "G0 A90 C0", "M428", "G0 X0 Y20.9 Z5")] == [9]


@pytest.mark.parametrize(("kind", "turn"), [("head-table-BC", "B90"), ("head-head-AC", "A90")])
def test_all_of_a_tool_in_a_tilted_head_comes_from_above(kind, turn):
    """A holder of 50 mm lies with its middle as high as the tip: at Z25 it hangs down to Z0."""
    (line, message), = found(kind, f"G0 {turn} C0", "M428", "G0 X0 Y-60 Z25")
    assert line == 9 and "goes below Z21.000" in message
    assert found(kind, f"G0 {turn} C0", "M428", "G0 X0 Y-60 Z48") == []


def test_upright_tools_are_held_to_their_tips_as_ever():
    for kind in PIVOTS:
        assert found(kind, "M428", "G0 X0 Y0 Z21.1") == []
        assert [line for line, _ in found(kind, "M428", "G0 X0 Y0 Z20.9")] == [8]


def test_a_turn_of_a_dogleg_is_asked_of_the_holder_too():
    lines = ("M428", "G0 X0 Y-80 Z{}", "G0 X5 A90")
    unknown = {"dogleg": True, "gauge": False}  # with lengths and pivots the box of the joints is simulated
    assert [n for n, _ in found("head-head-AC", *(x.format(40) for x in lines), **unknown)] == [9]
    assert found("head-head-AC", *(x.format(60) for x in lines), **unknown) == []
    assert found("head-head-AC", *(x.format(40) for x in lines), gauge=False) == []
    assert found("head-head-AC", *(x.format(40) for x in lines), dogleg=True) == []
