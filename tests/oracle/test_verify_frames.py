"""Programs with another side up, stock carried from one to the next, boxes of doglegs, runs pasted twice."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import SurfaceSamples
from tests.pocket_case import SETUP, TOOL, block, line_of, program, scored, text
from verify.checks.repeated_passes import _runs
from verify.findings import Source
from verify.kinematics import Kinematics
from verify.material.dogleg_rapids import box_findings, spread
from verify.model import FindingKind, NcProgram, ScoredSamples
from verify.moves import Moves
from verify.prove import prove
from verify.tool_axes import ToolAxes

PART = block()
FLIP = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
ASIDE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
NOBODY = ScoredSamples(SurfaceSamples(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int32),
                                      np.zeros(0, np.int32)), np.zeros(0, np.int32))


def turned_part(turn):
    """The block in a frame in which programs of the block's own frame have ``turn``."""
    mesh = PART.mesh
    return replace(PART, mesh=type(mesh)(mesh.vertices @ turn, mesh.faces, mesh.face_ids),
                   bounds=np.sort(PART.bounds @ turn, 0))


@pytest.mark.parametrize("turn", [FLIP, ASIDE, np.eye(3)])
def test_another_side_up_is_the_same_proof(turn):
    """The part turned and its program in its own frame: residuals, gouges and places are those of the part as it was.

    (Which of two moves that leave the same is named may differ, and with it how findings are folded.)
    """
    lines = program()
    at = line_of(lines, "Y4.0", -1) + 1
    lines[at - 1] += " Z-5.02"
    lines.insert(at, "Z-5")
    own = scored(PART)
    there = ScoredSamples(SurfaceSamples(own.samples.points @ turn, own.samples.normals @ turn, own.samples.area,
                                         own.samples.triangle, own.samples.face), own.zone)
    plain = prove([("p", text(lines))], PART, [TOOL], SETUP, own, ["Z1", "Z2"])
    proof = prove([NcProgram("p", text(lines), turn)], turned_part(turn), [TOOL], SETUP, there, ["Z1", "Z2"])
    assert np.abs(proof.residual - plain.residual).max() < 1e-6 and (proof.line == plain.line).mean() > 0.999
    assert set(proof.counts) == set(plain.counts) == {"gouge", "residual"}
    a, b = proof.findings[0], plain.findings[0]
    assert a.kind == b.kind and abs(a.line - b.line) <= 1 and a.depth == pytest.approx(b.depth, abs=1e-6)
    x, y, z = np.array(a.point) @ turn.T
    assert abs(x) < 10 and abs(y) < 6 and z == pytest.approx(-5.0, abs=1e-5)
    assert proof.spent.seconds == pytest.approx(plain.spent.seconds, rel=1e-9)


def test_limits_and_ways_are_told_in_the_frame_of_the_proof():
    lines = ["G21 G90 G17 G94 G54 G61",
             "T1 M6", "S1000 M3", "G43 H1", "G0 X0 Y0", "Z40", "G1 Z38 F9000", "G0 Z5", "M30"]
    proof = prove([NcProgram("low", text(lines), FLIP)], PART, [TOOL], replace(SETUP, max_feed=5000.0), NOBODY, [])
    limit = next(f for f in proof.findings if f.kind == FindingKind.LIMIT)
    assert limit.line == 7 and limit.point == (0.0, 0.0, -38.0)
    low = [f for f in proof.findings if "retract the tool" in f.message]
    assert [f.line for f in low] == [9] and low[0].depth == pytest.approx(10 - 5)  # the underside is its top


def test_stock_is_carried_from_one_program_to_the_next():
    """A long tool goes where a short one has been: alone its neck meets the stock, after the other it does not."""
    short = replace(TOOL, id="T2", number=2, flute_length=2.0, neck_diameter=4.0, neck_length=20.0)
    first = text(program())
    way = ["%", "G21 G90 G17 G94 G40 G49 G54 G61",
           "T2 M6", "S8000 M3", "G0 G43 H2 Z20", "X-7 Y0", "Z1.5", "G1 Z-4 F300",
           "G1 X7", "G0 Z20", "M5", "M30", "%"]
    second = text(way)
    for turn in (None, np.eye(3)):
        alone = prove([NcProgram("b", second, turn)], PART, [TOOL, short], SETUP, NOBODY, [])
        after = prove([("a", first), NcProgram("b", second, turn)], PART, [TOOL, short], SETUP, NOBODY, [])
        assert alone.counts.get("collision", 0) >= 1
        assert set(after.counts) == {"program"}  # nothing is left for it to take
        assert "no feed move meets the stock" in after.findings[0].message


def test_a_box_of_a_dogleg_is_filled():
    """Every place of the box is within reach of some sweep, none goes up the tool, one-axis moves are left alone."""
    rng = np.random.default_rng(3)
    start, end = rng.uniform(-5, 5, (6, 3)), rng.uniform(-5, 5, (6, 3))
    end[0, :2] = start[0, :2]
    moves = Moves(start, end, np.array([False] * 5 + [True]), np.zeros(6, np.int32))
    out, origin = spread(moves, None, np.full(6, 2.0), 100.0)
    assert (origin == 0).sum() == 1 and (origin == 5).sum() == 1 and (np.diff(origin) >= 0).all()
    for m in range(1, 5):
        own = np.flatnonzero(origin == m)
        assert ((out.end[own] - out.start[own])[:, 2] <= 1e-12).all()
        places = start[m] + rng.uniform(0, 1, (200, 3)) * (end[m] - start[m])
        d = out.end[own] - out.start[own]
        s = np.clip(np.einsum("pkj,kj->pk", places[:, None] - out.start[own], d) / (d * d).sum(1), 0, 1)
        gap = np.linalg.norm(places[:, None] - out.start[own] - s[:, :, None] * d, axis=2).min(axis=1)
        assert gap.max() <= 2.0 / 4 * np.sqrt(0.5) + 1e-9
    thin = np.full(6, 0.01)
    told = box_findings(moves, None, thin, 100.0, Source(("p",), np.zeros(6, np.int32), np.arange(1, 7, dtype=np.int32),
                                                         np.ones(6, np.int32)))
    assert [f.line for f in told] == [2, 3, 4, 5] and len(spread(moves, None, thin, 100.0)[0]) == 6
    above, _ = spread(moves, None, np.full(6, 2.0), -100.0)
    assert len(above) == 6


def test_a_box_lies_along_the_slides_of_the_machine():
    """With the table at C90 a machine's X is the part's Y; a diagonal of the part at C45 is one slide and no dogleg."""
    machine = Kinematics("table-table-AC")
    turn = np.radians([[0.0, 45.0]])
    moves = Moves(np.zeros((1, 3)), np.array([[3.0, 3.0, 0.0]]), np.array([False]), np.zeros(1, np.int32),
                  ToolAxes.upright(1))
    assert len(spread(moves, machine.slides(turn), np.full(1, 2.0), 100.0)[0]) == 1
    assert len(spread(moves, None, np.full(1, 2.0), 100.0)[0]) > 4
    joints = Kinematics("table-table-AC", ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    turn = np.radians([[30.0, 70.0]])
    step = joints.tip(np.eye(3), np.repeat(turn, 3, 0), 0.0) - joints.tip(np.zeros((3, 3)), np.repeat(turn, 3, 0), 0.0)
    assert np.allclose(joints.slides(turn)[0], step, atol=1e-12)


def test_runs_are_found_where_they_begin_and_end():
    rng = np.random.default_rng(5)
    points = rng.uniform(-5, 5, (400, 3))
    points[250:301] = points[100:151]
    feed = np.ones(399, bool)
    moves = Moves(points[:-1], points[1:], feed, np.zeros(399, np.int32))
    cut = np.ones(399, bool)
    cut[250:300] = False
    assert list(_runs(moves, cut)) == [(250, 299, 150)]
    assert list(_runs(moves, np.ones(399, bool))) == []
    other = replace(moves, tool=np.repeat([0, 1], [200, 199]).astype(np.int32))
    assert list(_runs(other, cut)) == []
    leaning = replace(moves, axes=ToolAxes.between(*(rng.normal(size=(399, 3)) for _ in range(2))))
    assert list(_runs(leaning, cut)) == []
