"""Faults at edges, tips and rims, and right programs that look like faults: both models, by hand-made truths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import as_part, prism
from verify.model import NcProgram, ProofSetup, ScoredSamples
from verify.prove import prove

BOTH = pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
HEAD = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z40"]
BARE = ProofSetup(margin=0.0, uncertainty=0.0)
SLOPE = math.tan(math.radians(30.0))


def slab(x0, x1, wide, z0, z1):
    return prism([(x0, z0), (x1, z0), (x1, z1), (x0, z1)], [(0, 1, 2), (0, 2, 3)], wide)


BLOCK = slab(-10, 10, 5, -20, -12)  # far below: the blank on it ends at X10, Y5, Z0
BOX = ProofSetup(stock_kind="box", stock_box=np.array([[-10.0, -5.0, -20.0], [10.0, 5.0, 0.0]]))
WEDGE = prism([(-2, -12), (12, -12), (12, -12 * SLOPE), (0, 0), (-2, 0)], [(0, 1, 2), (0, 2, 3), (0, 3, 4)], 4.0)
FLAT = ToolBody("T1", 1, 6.0, 0.0, 10.0, 5.8, 15.0, 6.0, 20.0)


def found(lines, tool=FLAT, part=BLOCK, setup=BOX, turn=None):
    """Findings of moves after a start at Z40, worst of each kind first."""
    s = sample_surface(part.mesh, 1.0, seed=1, triangles=np.flatnonzero(part.mesh.face_ids == 1))
    text = "\n".join([*HEAD, *lines, "G0 Z40", "M5", "M30", "%"]) + "\n"
    proof = prove([NcProgram("p", text, turn)], part, [tool], setup, ScoredSamples(s, np.zeros(len(s), np.int32)), ())
    return [f for f in proof.findings if f.kind != "program"], proof


def depth_of(kind, lines, **case):
    """The depth told of a kind, contacts before near misses; None where there is none."""
    return next((f.depth for f in found(lines, **case)[0] if f.kind == kind), None)


def test_a_collision_stands_before_any_number_of_near_misses():
    """230 rapids pass the blank at 0.9 mm, one goes 0.3 mm into it; 200 are told."""
    lines = []
    for k in range(230):
        lines += ["(apart)"] * 6 + ["G0 X13.9 Y-25", "Z-5", f"Y{-5 + k % 5}", "Z20"]
    lines += ["(apart)"] * 6 + ["G0 X12.7 Y-25", "Z-5", "Y25", "Z20"]
    told, proof = found(lines)
    assert proof.counts["rapid"] == 231 and len(told) == 200
    assert "into stock" in told[0].message and not told[0].near and all(f.near for f in told[1:])


@BOTH
@pytest.mark.parametrize("x, y, depth, share", [(0, 0, 1.5, 0.01), (10, 0, 1.5, 0.03), (10, 5, 3.0, 0.05),
                                                (13, 0, 8.0, 0.2)])
def test_a_plunge_beside_an_edge_is_as_deep_as_what_it_meets(turn, x, y, depth, share):
    """A flat of 8 mm, whole or in part over the blank's edge and corner."""
    tool = ToolBody("T1", 1, 8.0, 0.0, 12.0, 7.8, 20.0, 8.0, 30.0)
    told = depth_of("plunge", [f"G0 X{x} Y{y}", "Z1", f"G1 Z{-depth} F100"], tool=tool, turn=turn)
    assert told == pytest.approx(depth, rel=share)


@BOTH
def test_a_neck_that_meets_stock_before_its_flutes_come_up_is_told(turn):
    """Rising 4 on 10: the neck is 0.7005 mm deep before the flutes have cut that place (200,000 points, 1500 poses)."""
    tool = ToolBody("T1", 1, 10.0, 0.0, 10.0, 6.0, 30.0, 6.0, 40.0)
    told = depth_of("collision", ["G0 X18 Y0", "Z-13", "G1 X8 Z-9 F300"], tool=tool, turn=turn)
    assert told == pytest.approx(0.7005, abs=0.02)


@BOTH
@pytest.mark.parametrize("lean, on", [(80, 0.15), (85, 0.1), (75, 0.3)])
def test_a_flank_that_finishes_downhill_is_no_plunge(turn, lean, on):
    """A ball of 6 mm in one stroke down a draft wall cuts nothing nearer to its axis than 2.2 mm; its end is 1.5."""
    ball = ToolBody("T1", 1, 6.0, 3.0, 30.0, 5.6, 40.0, 5.6, 60.0)
    angle = math.radians(lean)
    foot = 20 / math.tan(angle)
    wall = prism([(-6, -26), (foot + 8, -26), (foot + 8, -20), (foot, -20), (0, 0), (-6, 0)],
                 [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 6.0)

    def tip(z):
        return -z / math.tan(angle) + 3 * math.sin(angle), z + 3 * math.cos(angle) - 3

    (x0, z0), (x1, z1) = tip(3.0), tip(-16.0)
    told, _ = found([f"G0 X{x0:.4f} Y0", f"Z{z0:.4f}", f"G1 X{x1:.4f} Z{z1:.4f} F400", "G1 X30"], tool=ball, part=wall,
                    setup=replace(BARE, margin=on), turn=turn)
    assert [f for f in told if f.kind == "plunge"] == []


@BOTH
def test_a_rapid_through_what_a_rising_slot_cutter_has_cut_is_clean(turn):
    slot = ToolBody("T1", 1, 12.0, 0.0, 3.0, 6.0, 25.0, 6.0, 40.0)
    lines = ["G0 X18 Y0", "Z-6", "G1 X8 Z4 F300", "G0 Z10", "X24 Y0", "Z-1.0", "X15.5", "X24"]
    assert found(lines, tool=slot, turn=turn)[0] == []


@pytest.mark.parametrize("radius, depth", [(1.0, 0.012), (0.5, 0.03), (3.0, 0.01)])
def test_a_ball_that_dips_into_a_fixture_is_told(radius, depth):
    ball = ToolBody("T1", 1, 2 * radius, radius, 3 * radius, 2 * radius - 0.1, 10.0, 4.0, 30.0)
    clamp = np.array([[20.0, -5.0, -20.0], [25.0, 5.0, 3.0]])
    told = depth_of("collision", ["G0 X22.625 Y0.125", "Z10", f"G1 Z{3 - depth:.4f} F100", "G1 Z10"], tool=ball,
                    setup=replace(BOX, fixtures=(clamp,)))
    assert depth - 0.005 <= told <= depth + 1e-6


@BOTH
def test_a_near_miss_with_a_shallow_tip_is_as_near_as_it_is(turn):
    """0.1 mm beside, the tip 0.05 mm under the top."""
    lines = ["G0 X13.1 Y-30", "Z-0.05", "Y30"]
    assert depth_of("rapid", lines, turn=turn) == pytest.approx(0.1, abs=0.06 if turn is None else 0.005)
    clamp = np.array([[20.0, -5.0, -20.0], [30.0, 5.0, 3.0]])
    beside = depth_of("rapid", ["G0 X16.9 Y-30", "Z2.95", "Y30"], setup=replace(BOX, fixtures=(clamp,)), turn=turn)
    assert beside == pytest.approx(0.1, abs=0.002)


@BOTH
@pytest.mark.parametrize("depth", [0.03, 0.06, 0.08])
def test_a_long_narrow_groove_where_nobody_scores_is_told(turn, depth):
    """The rim of a flat along a slope of 30 degrees, as it fell between the columns of a lattice along Y."""
    rim = 33.381966 * 0.18 + 0.003
    lines = [f"G0 X{rim + 3:.4f} Y-30", f"Z{-(rim + 2 * depth) * SLOPE:.5f}", "G1 Y30 F500"]
    told = depth_of("gouge", lines, part=WEDGE, setup=BARE, turn=turn)
    assert told == pytest.approx(depth, rel=0.1)


@BOTH
@pytest.mark.parametrize("depth", [0.02, 0.1])
def test_the_tip_of_a_pyramid_counts(turn, depth):
    corners = [(-3.9, -3.88, -4), (4.1, -3.88, -4), (4.1, 4.12, -4), (-3.9, 4.12, -4), (0.1, 0.12, 0)]
    faces = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    pyramid = as_part(TriangleMesh(np.array(corners, float), np.array(faces, np.int32), np.array([1, 1, 2, 3, 4, 5])))
    held = ToolBody("T1", 1, 4.0, 0.0, 10.0, 3.8, 15.0, 4.0, 20.0, (HolderFrustum(20.0, 20.0, 20.0),))
    over = depth_of("collision", ["G0 X-8 Y-30", f"Z{-20 - depth}", "G1 Y30 F500"], tool=held, part=pyramid,
                    setup=BARE, turn=turn)
    assert over == pytest.approx(depth, abs=2e-3)
    mill = ToolBody("T1", 1, 10.0, 0.0, 15.0, 9.8, 20.0, 10.0, 30.0)
    rapid = depth_of("rapid", ["G0 X0 Y-30", f"Z{-depth}", "Y30"], tool=mill, part=pyramid, setup=BARE, turn=turn)
    assert rapid == pytest.approx(depth, abs=2e-3)


@BOTH
def test_a_lost_decimal_point_far_below_the_part_is_told(turn):
    told, _ = found(["G0 X0 Y0", "Z1", "G1 Z-3000 F300", "X2", "Z5"], part=slab(-3, 3, 3, -6, 0),
                    setup=ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0), turn=turn)
    assert any(f.kind == "collision" for f in told)


@BOTH
def test_fixtures_of_any_size_are_held_exactly(turn):
    wide, small = (np.array([[12.0, -0.5 * far, -20], [far, 0.5 * far, 0]]) for far in (900.0, 30.0))
    lines = ["G1 X0 Y0 Z-5 F900", "X800 Y200", "X800 Y-200"]
    for box in (wide, small):
        hits, proof = found(lines, setup=replace(BOX, fixtures=(box,)), turn=turn)
        assert not any("unseen" in a.effect for a in proof.assumed)
        assert any(f.kind == "collision" for f in hits)
