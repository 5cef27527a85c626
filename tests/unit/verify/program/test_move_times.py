"""Minutes of the moves of programs as they are read."""

import math
from dataclasses import replace

import numpy as np
import pytest

from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import ProofSetup
from verify.program.move_times import minutes_of, spent

SETUP = ProofSetup(rapid_feed=6000.0, acceleration=1e6, jerk=math.inf)
BEGIN = "G21 G17 G90 G94 G40 G49 G80 {}\nG54\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0 Z10\nX100\nX0\n"


def seconds(lines, mode="G64 P0.001", setup=SETUP):
    """Of what comes after 200 mm of rapids."""
    both = [60.0 * minutes_of(read_program(f"%\n{BEGIN.format(mode)}{more}M2\n%\n"), setup).sum()
            for more in ("", "\n".join(lines) + "\n")]
    assert np.isfinite(both).all()
    return float(both[1] - both[0])


@pytest.mark.parametrize("mode", ["", "G61", "G64", "G64 P0.001"])
def test_an_arc_is_not_a_row_of_corners(mode):
    assert seconds(["G2 X0 Y0 I5 J0 F3000"] * 10, mode) == pytest.approx(10.0 * math.pi * 10.0 / 50.0, rel=0.01)


def test_corners_cost_a_slow_machine_time():
    square = [f"G1 {w} F6000" for w in ("X10", "Y10", "X0", "Y0")] * 5
    fast, slow = seconds(square), seconds(square, setup=replace(SETUP, acceleration=500.0))
    assert fast == pytest.approx(2.0, rel=0.01) and slow == pytest.approx(20 * 2 * math.sqrt(10.0 / 500.0), rel=0.05)


def test_a_feed_move_from_an_unknown_place_has_a_time():
    begin = "%\nG21 G17 G90 G94 G40 G49 G80 G64 P0.001\nG54\nT1 M6\nS1 M3\nG43 H1\nG0 X0 Y0\n"
    text = begin + "G93 G1 Z4 F20\nG1 X50 F20\nM2\n%\n"
    got = 60.0 * minutes_of(read_program(text), SETUP)
    assert np.isfinite(got).all() and got.sum() == pytest.approx(3.0, rel=0.01)


def test_a_feed_that_is_next_to_none_is_no_error():
    assert seconds([f"G1 X1 F0.{'0' * 310}1"]) >= 0.0


def test_a_rotary_axis_in_a_rapid_takes_its_turn():
    zero = np.zeros(3)
    machine = Kinematics("table-table-AC", (zero, zero))
    begin = "%\nG21 G17 G90 G94 G40 G49 G80 G64 P0.001\nG54\nG0 A0 C0\nT1 M6\nG43 H1\n"
    text = begin + "G0 X0 Y0 Z50\nM428\nG0 C90\nM429\nM2\n%\n"
    program = read_program(text, kinematics=machine)
    fast = ProofSetup(rapid_feed=1e6, acceleration=1e7, jerk=math.inf, kinematics=machine)
    took = {rate: float(minutes_of(program, replace(fast, rotary_rate=rate)).sum()) for rate in (None, 1.0)}
    assert took[1.0] - took[None] == pytest.approx(0.5 * math.pi * (1.0 - 1.0 / math.radians(7200.0)), rel=1e-3)


def test_time_is_told_apart():
    """A square in which one side takes stock, two tools: rapids, retracts and changes are counted by hand."""
    text = ("%\nG21 G17 G90 G94 G40 G49 G80 G61\nG54\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0 Z10\nG1 Z0 F6000\n"
            "G1 X100\nG1 Y50\nG0 Z10\nT2 M6\nS1000 M3\nG43 H2\nG0 X0 Y0\nG1 Z0 F6000\nG1 X100\nG0 Z10\n"
            "G4 P2\nM2\n%\n")
    program = read_program(text)
    took = minutes_of(program, SETUP)
    known = np.ones(len(took), np.bool_)
    cut = np.abs(program.start[:, 1] - program.end[:, 1]) == 50.0
    cut &= program.kind != 0
    told = spent([program], took, known, cut)
    assert told.retracts == 2 and told.tool_changes == 1
    assert told.in_cut == pytest.approx(0.5, rel=0.01)  # 50 mm at 100 mm/s
    assert told.seconds == pytest.approx(60.0 * took.sum() + 2.0)
    assert told.rapid == pytest.approx(60.0 * took[program.kind == 0].sum())
    twice = spent([program, program], np.concatenate([took, took]), np.concatenate([known, ~known]), cut)
    assert twice.in_cut == pytest.approx(0.5, rel=0.01) and twice.retracts == 4 and twice.tool_changes == 2


def test_a_cutter_changed_for_a_fresh_one_is_a_tool_change():
    text = ("%\nG21 G17 G90 G94 G40 G49 G80 G61\nG54\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0 Z10\nM5\nT0 M6\nM0\nT1 M6\n"
            "S1000 M3\nG43 H1\nG0 X1 Y0 Z10\nM2\n%\n")
    program = read_program(text)
    assert (program.tool == 1).all()
    assert spent([program], minutes_of(program, SETUP), np.ones(len(program), np.bool_),
                 np.zeros(len(program), np.bool_)).tool_changes == 1


def test_no_program_takes_no_time():
    assert spent([], np.zeros(0), np.zeros(0, np.bool_), np.zeros(0, np.bool_)).seconds == 0.0
