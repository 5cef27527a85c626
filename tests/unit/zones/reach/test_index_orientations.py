"""Further tool axes: what they win, that nothing wins more, round angles, and the table that leaning tools clear."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from output.inverse_kinematics import RotaryMachine
from service.stages.programs import room_to_turn
from tests.hand_parts import box_mesh, joined
from verify.checks.table_clearance import table_findings
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.model import ProofSetup
from zones.reach.approach_cones import directions_over_hemisphere
from zones.reach.assembly import Clearances
from zones.reach.index_orientations import AxisCoverage, _chosen, orientations

BALL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 24.0, 6.0, 36.0, (HolderFrustum(20.0, 20.0, 30.0),))


UP = np.array([[0.0, 0.0, 1.0]])


def shelf():
    """A floor with a roof over half of it, on a wall: under the roof a tool gets only from the open side."""
    return joined(box_mesh([0, 0, 0], [30, 20, 2]), box_mesh([0, 0, 2], [3, 20, 16]),
                  box_mesh([3, 0, 12], [18, 20, 16]))


def test_under_a_roof_one_axis_from_the_open_side_does():
    mesh = shelf()
    coverage = AxisCoverage(TriangleTree(mesh), [BALL], Clearances(), 0.02, 0.005, 0.0)
    every = sample_surface(mesh, 2.0, seed=1)
    x, _, z = every.points.T
    under = np.flatnonzero((np.abs(z - 2.0) < 1e-6) & (every.normals[:, 2] > 0.9) & (x > 6.0) & (x < 16.0))
    few = every.subset(under)
    assert not coverage.reached(few, np.array([[0.0, 0.0, 1.0]])).any()
    machine = RotaryMachine("table-table-AC", None, np.radians([[-100.0, 100.0], [-360.0, 360.0]]))
    axes = orientations(few, coverage, machine.stands, machine.even, UP, 5.0)
    assert 1 <= len(axes) <= 2 and axes[0] @ [1.0, 0.0, 0.0] > 0.3
    got = coverage.reached(few, axes).any(axis=1)
    best = coverage.reached(few, directions_over_hemisphere(241)).any(axis=1)
    assert few.area[got].sum() > few.area[best].sum() - 5.0 * len(axes) - 1e-9
    turns = np.degrees(machine.turns(axes)[:, 0])
    assert np.allclose(turns, np.round(turns), atol=1e-6)  # whole degrees
    limited = RotaryMachine("table-table-AC", None, np.radians([[-10.0, 10.0], [-360.0, 360.0]]))
    assert len(orientations(few, coverage, limited.stands, limited.even, UP, 5.0)) == 0


def test_the_choice_is_the_best_of_all_choices():
    """Against every subset, on 40 random reach maps."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        got, area = rng.random((30, 8)) < 0.25, rng.uniform(0.2, 3.0, 30)
        worth = float(rng.uniform(0.5, 8.0))
        sets = [[k for k in range(8) if bits >> k & 1] for bits in range(256)]
        value = [float(area[got[:, s].any(axis=1)].sum()) - worth * len(s) for s in sets if len(s) <= 6]
        chosen = _chosen(got, area, worth)
        mine = float(area[got[:, chosen].any(axis=1)].sum()) - worth * len(chosen)
        assert mine == pytest.approx(max(value), abs=1e-4)


def program(*lines):
    head = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG0 A0 C0\nX0 Y0\nZ80\nM428\n"
    return read_program(head + "\n".join(lines) + "\nM30\n%\n", kinematics=Kinematics("table-table-AC", None),
                        gauge_length={1: 66.0})


def drawn(tool, tip, axis, count=4000):
    """The lowest of many points of an assembly without its cutting corner, drawn one by one."""
    z = axis / np.linalg.norm(axis)
    x = np.cross(z, [0.3, 0.7, -0.2])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    t = np.linspace(0.0, 2.0 * np.pi, count)
    low = np.inf
    rims = [(tool.flute_length, tool.radius), (tool.stickout, 0.5 * tool.shank_diameter)]
    at = tool.stickout
    for h in tool.holder:
        rims += [(at, 0.5 * h.diameter), (at + h.length, 0.5 * h.diameter_top)]
        at += h.length
    for h, r in rims:
        low = min(low, float((tip + h * z + r * (np.outer(np.cos(t), x) + np.outer(np.sin(t), y)))[:, 2].min()))
    centre = tip + tool.corner_radius * z  # a ball
    return min(low, float(centre[2] - tool.corner_radius))


@pytest.mark.parametrize(("a", "z"), [(30.0, 4.0), (75.0, 6.0), (90.0, 11.5), (100.0, 40.0)])
def test_how_low_a_leaning_tool_reaches(a, z):
    p = program(f"G0 X0 Y0 Z{z} A{a} C0")
    axis = Kinematics("table-table-AC", None).axis(np.radians([[a, 0.0]]))[0]
    low = drawn(BALL, np.array([0.0, 0.0, z]), axis)
    for known in (False, True):
        def found(table, known=known):
            return table_findings([p], [BALL], ProofSetup(kinematics=Kinematics("table-table-AC", None), table=table,
                                                          table_known=known))
        assert not found(low - 1.0 - 0.15)  # what an axis that swings may add is within 0.1 mm here
        hit = found(low - 0.9)
        assert len(hit) == 1 and hit[0].kind == "collision" and hit[0].depth > 0.09
        assert hit[0].line == 10 and "T1 comes down" in hit[0].message


def test_an_upright_tool_goes_past_a_part_on_a_table_nobody_told_of():
    p = program("G0 X50 Y0", "Z-3", "Z80")
    machine = Kinematics("table-table-AC", None)
    assert not table_findings([p], [BALL], ProofSetup(kinematics=machine, table=0.0))
    assert table_findings([p], [BALL], ProofSetup(kinematics=machine, table=0.0, table_known=True))
    assert not table_findings([p], [BALL], ProofSetup(kinematics=machine, table=-4.5, table_known=True))


@pytest.mark.parametrize("leans", [0.0, 40.0, 75.0, 90.0, 110.0])
def test_the_ball_is_lifted_just_enough_to_turn_over_the_table(leans):
    radius, height, table = 30.0, 12.0, 1.0
    lift = room_to_turn(height, radius, np.radians(leans), [BALL], table)
    lows = []
    for a in np.radians(np.arange(0.0, leans + 0.5, 0.5)):
        axis = np.array([np.sin(a), 0.0, np.cos(a)])
        tip = np.array([0.0, 0.0, height + lift]) + (radius + lift) * axis
        lows.append(drawn(BALL, tip, axis))
    assert min(lows) >= table
    assert lift == 0.0 or min(lows) < table + 0.35  # less what the proof takes off for an axis that swings, 0.09 mm
