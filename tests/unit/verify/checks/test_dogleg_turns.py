"""How far turning rapids may leave their straight way: against poses all over the boxes of their joints."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from verify.checks.dogleg_turns import bounded, drops, strays
from verify.checks.table_clearance import lowest_places
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import ProofSetup, StockKind

TOOL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0, (HolderFrustum(50.0, 50.0, 30.0),))
BOUNDS = np.array([[-20.0, -10.0, 0.0], [20.0, 15.0, 20.0]])
GAUGE = 75.0
PIVOTS = {"table-table-AC": ((3.0, -6.0, -50.0), (5.0, 2.0, 0.0)),
          "table-table-BC": ((3.0, 9.0, -30.0), (5.0, 2.0, 0.0)),
          "head-table-BC": ((0.0, 0.0, 100.0), (4.0, -3.0, 0.0)),
          "head-head-AC": ((0.0, 0.0, 100.0),)}
HEAD = "%\nG21 G90 G17 G94 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG53 G0 Z0\nG0 {}0 C0\nM428\nG0 X0 Y0 Z90\n"


def read(kind, *lines, dogleg=True, pivots=True):
    """The program after line 9, its setup, and which moves are those of the last line."""
    machine = Kinematics(kind, PIVOTS[kind] if pivots else None)
    setup = ProofSetup(kinematics=machine, gauge_length={1: GAUGE}, stock_kind=StockKind.PART_OFFSET, margin=1.0,
                       uncertainty=0.0, dogleg=dogleg)
    text = HEAD.format(kind[-2]) + "\n".join(lines) + "\nM5\nG53 G0 Z0\nM30\n%\n"
    p = read_program(text, kinematics=machine, gauge_length={1: GAUGE})
    return p, setup, p.line == 9 + len(lines)


def farthest(machine, start, end, turns, drop=False):
    """Most that a place of the box comes nearer to a place of the tool than at the first pose: poses at random."""
    rng = np.random.default_rng(7)
    first = machine.joints(start[None], turns[:1], GAUGE)[0]
    last = machine.joints(end[None], turns[1:], GAUGE)[0]
    n, most = 4000, 0.0
    share = np.where(rng.random((n, 5)) < 0.5, rng.integers(0, 2, (n, 5)), rng.random((n, 5)))
    joints, turn = first + share[:, :3] * (last - first), turns[0] + share[:, 3:] * (turns[1] - turns[0])
    for corner, high in itertools.product(itertools.product(*(BOUNDS + [[-1.0], [1.0]]).T), (0.0, 30.0, GAUGE)):
        place = np.tile(corner, (n, 1))
        if drop:  # of a place of the tool over the table, in the frame of the part
            tip = machine.tip(joints, turn, GAUGE) + high * machine.axis(turn)
            there = machine.tip(first[None], turns[:1], GAUGE) + high * machine.axis(turns[:1])
            most = max(most, float((there - tip)[:, 2].max()))
            continue
        now = machine.joints(place, turn, GAUGE - high) - joints
        then = machine.joints(place[:1], turns[:1], GAUGE - high) - first
        most = max(most, float(np.linalg.norm(now - then, axis=1).max()))
    return most


@pytest.mark.parametrize("kind", PIVOTS)
@pytest.mark.parametrize("words", ["{}2 C3 X1", "{}20 C50 X10 Y-8 Z70", "{}0.5 Z89.5"])
def test_no_pose_of_the_box_is_nearer(kind, words):
    p, setup, own = read(kind, "G0 " + words.format(kind[-2]))
    found, low = strays(p, BOUNDS, [TOOL], setup), drops(p, [TOOL], setup)
    rows = np.flatnonzero(own)
    turns = np.stack([p.poses.start_turn[rows[0]], p.poses.end_turn[rows[-1]]])
    ends = p.start[rows[0]], p.end[rows[-1]]
    want = farthest(setup.kinematics, *ends, turns)
    assert np.ptp(found[own]) == 0.0 and want <= found[own][0] <= 4.0 * want
    assert farthest(setup.kinematics, *ends, turns, drop=True) <= low[own][0] <= 8.0 * want
    assert (found[~own] == 0.0).all() and (low[~own] == 0.0).all()


def test_what_goes_its_straight_way_strays_nowhere():
    for lines in (["G1 A20 X5 F500"], ["G0 X5 Y5"]):
        p, setup, own = read("table-table-AC", *lines)
        assert own.any() and (strays(p, BOUNDS, [TOOL], setup) == 0.0).all()
    p, setup, _ = read("table-table-AC", "G0 A20 X5", dogleg=False)
    assert (strays(p, BOUNDS, [TOOL], setup) == 0.0).all()
    p, setup, own = read("table-table-AC", "M429", "G0 A20")  # one axis alone: the joints stay
    assert own.any() and (strays(p, BOUNDS, [TOOL], setup) == 0.0).all()


def test_without_pivots_or_gauge_length_the_way_is_unknown():
    p, setup, _ = read("table-table-AC", "G0 A20 X5", pivots=False)
    assert not bounded(p, setup) and (strays(p, BOUNDS, [TOOL], setup) == 0.0).all()
    for kind, known in (("head-head-AC", False), ("table-table-AC", True)):
        p, setup, _ = read(kind, "G0 A20 X5")
        assert bounded(p, setup) and bounded(p, replace(setup, gauge_length={})) == known


def test_over_the_table_a_turn_is_as_low_as_it_may_come():
    p, setup, own = read("table-table-AC", "G0 A60 C30 X5 Z80")
    low = lowest_places(p, [TOOL], setup, leaning=False)[own]
    assert (drops(p, [TOOL], setup)[own] > 50.0).all() and np.isfinite(low).all()
