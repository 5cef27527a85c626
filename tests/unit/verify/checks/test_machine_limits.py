"""Limits of five-axis machines: angles, travel and rates of the joints, each on its line."""

import numpy as np
import pytest

from verify.checks.machine_limits import limit_findings, notes_on
from verify.checks.program_assumptions import long_turns
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import FindingKind, ProofSetup

ZERO = (0.0, 0.0, 0.0)
HEAD = "%\nG21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nM428\nG0 A0 C0\nX0 Y0\nZ10\n"
MACHINE = Kinematics("table-table-AC", (ZERO, ZERO))


def found(body, machine=MACHINE, **options):
    setup = ProofSetup(kinematics=machine, gauge_length={1: 80.0, 2: 100.0}, **options)
    p = read_program(HEAD + body + "M30\n%\n", kinematics=machine, gauge_length=setup.gauge_length)
    findings = limit_findings([p], setup)
    assert all(f.kind == FindingKind.LIMIT for f in findings)
    return findings, list(notes_on(p, -100.0, setup))


def test_angles_beyond_the_limits_of_an_axis():
    limits = np.radians([[-30.0, 110.0], [-360.0, 360.0]])
    findings, _ = found("G0 A45\nA-30.5\nA-31\nC400\n", rotary_limits=limits)
    assert [(f.line, round(f.depth, 9), round(f.limit, 9)) for f in findings] == [(12, 1, -30), (13, 40, 360)]
    assert "A-31 is outside the range of A, -30 to 110 deg" in findings[0].message and "C400" in findings[1].message
    assert found("G0 A110 C-360\nA-30 C360\n", rotary_limits=limits)[0] == []


def test_travel_is_that_of_the_joints():
    """A tip that stays at X0 Y0 Z100 swings the joints by 100 mm in Y when A turns to 90; in Z down to 0."""
    travel = np.array([50.0, 99.0, 101.0])
    findings, _ = found("G0 Z100\nA90\n", travel=travel)
    assert [(f.line, "in Y" in f.message) for f in findings] == [(11, True)]
    assert findings[0].depth == pytest.approx(1.0, abs=1e-6) and "linear axes" in findings[0].message
    assert found("G0 Z100\n", travel=travel)[0] == []
    head = Kinematics("head-head-AC", ((0.0, 0.0, 20.0),))  # swivel 100 mm over the tip
    findings, _ = found("G0 A90\n", machine=head, travel=np.array([50.0, 99.0, 200.0]))
    assert [(f.line, round(f.depth, 6)) for f in findings] == [(10, 1.0)]


def test_a_slow_tip_near_the_pole_makes_the_joints_race():
    """1 mm at F600 is 0.1 s, in which C turns by 90 deg: 54,000 deg/min; at 30 mm from C that is 471 mm/s of joint."""
    body = "G0 X30 A2\nG1 X31 C90 F600\n"
    findings, _ = found(body, rapid_feed=10_000.0, rotary_rate=np.radians(20_000.0))
    assert {f.line for f in findings} == {11}
    assert [f.message.split(" of ")[1][0] for f in findings] == ["X", "Y", "C"]
    assert findings[2].depth == pytest.approx(34_000) and "54000 deg/min of C" in findings[2].message
    speed = 30.5 * np.pi / 2 / 0.1 * 60
    assert findings[1].depth + findings[1].limit == pytest.approx(speed, rel=0.03)
    assert found(body, rapid_feed=30_000.0)[0] == [] and found(body.replace("F600", "F60"), rapid_feed=5_000.0)[0] == []


def test_without_pivots_it_is_said_that_joints_were_not_checked():
    findings, notes = found("G0 Z100\nA90\n", machine=Kinematics("table-table-AC"), travel=np.array([1.0, 1.0, 1.0]))
    assert findings == [] and [n for n in notes if "machine.pivots_mm is not given" in n]
    assert not [n for n in found("G0 Z100\nA90\n")[1] if "pivots" in n]


def turned(dialect, *lines):
    """Which turns of a program from C350 on are taken for granted."""
    head = {"siemens": "G710 G17 G90 G94\nT1 D1\nM6\nS1000 M3\nTRAORI\nG54\n",
            "linuxcnc": "%\nG21\nG17 G90 G94 G40 G80\nG54\nT1 M6\nS1000 M3\n"}.get(
                dialect, "%\nO1\nG21\nG17 G90 G94 G40 G80\nG54\nT1 M6\nS1000 M3\n")
    body = ["G0 A0. C0.", "G0 X0. Y0.", "G0 Z50." if dialect == "siemens" else "G0 G43.4 Z50. H1",
            "G1 X5. C175. F100.", "C350.", *lines]
    p = read_program(head + "\n".join(body) + ("\nM30\n" if dialect == "siemens" else "\nG91 G28 Z0.\nM30\n%\n"),
                     kinematics=MACHINE, dialect=dialect, gauge_length={1: 80.0})
    taken = list(long_turns(p, ProofSetup(kinematics=MACHINE, gauge_length={1: 80.0})))
    assert all(a.what == "rotary_way" for a in taken)
    return [(a.value, a.effect) for a in taken]


def test_the_way_of_more_than_half_a_turn_is_taken_for_granted():
    """From C350 to C10 the proof turns back by 340 deg; a table that rolls over goes 20 on."""
    ((value, effect),) = turned("fanuc", "X10. C10.")
    assert "line 13 turns C by -340 deg" in value and "may turn it by 20," in effect
    ((value, _),) = turned("haas", "X10. C10.", "G0 C200.", "C-5.")
    assert "(and 2 more such blocks)" in value
    assert turned("fanuc", "X10. C365.", "C545.") == [] == turned("linuxcnc", "X10. C10.")


@pytest.mark.parametrize(("word", "told"), [("C=DC(10)", False), ("C=ACN(10)", False), ("C=IC(-340)", False),
                                            ("C10", True), ("C=AC(10)", True)])
def test_words_that_state_the_way_leave_nothing_open(word, told):
    assert len(turned("siemens", f"X10 {word}")) == told
    assert turned("fanuc", "G91 C-340.", "G90") == []
