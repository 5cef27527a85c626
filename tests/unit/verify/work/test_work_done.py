"""Faces that a program works on, stock that it leaves there, and how high it is; against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import SurfaceSamples, sample_surface
from tests.hand_parts import terraces
from tests.pocket_case import DEPTH, SETUP, TOOL, block, program, text
from verify.model import Asked, FindingKind, NcProgram, ScoredSamples
from verify.moves import Moves
from verify.program_reading import read_one
from verify.prove import prove
from verify.tool_axes import ToolAxes
from verify.work import work_done
from verify.work.asked_faces import Cutting, thinned
from verify.work.ways_out import ways_out
from verify.work.work_done import cutting_axes

FLOOR, TOP, WALLS = 11, 6, (7, 8, 9, 10)


class Everything:
    """A touch that reaches all but the corners of the pocket, where no round tool goes, and some faces."""

    def __init__(self, without=()):
        self.without, self.asked = without, []

    def reaches(self, samples, tools, axes, lift, room):
        self.asked.append((len(samples), [t.id for t in tools], axes.tolist(), lift, room))
        corner = (np.abs(samples.points[:, 0]) > 8) & (np.abs(samples.points[:, 1]) > 4) & (samples.face > TOP)
        return ~np.isin(samples.face, self.without) & ~corner

    def edges(self, samples, tools, axes, lift):
        return np.zeros(len(samples), dtype=bool)

    def on_ways(self, samples, tools, axes, lift, stepped):
        return np.zeros(len(samples), dtype=bool)

    def reasons(self, samples, tools, axes):
        return np.full(len(samples), "holder", dtype=object)


def run(lines, faces=None, touch=None, setup=SETUP, whole=None):
    part = block()
    samples = sample_surface(part.mesh, 30.0, seed=3, triangles=np.flatnonzero(part.mesh.face_ids >= 2))
    asked = Asked(None if faces is None else frozenset(faces), touch or Everything(), whole=whole)
    return prove([("pocket.ngc", text(lines))], part, (TOOL,), setup,
                 ScoredSamples(samples, np.zeros(len(samples), np.int32)), [], asked=asked)


def raised(lines, by, axis="Z"):
    import re

    return [re.sub(rf"{axis}(-?[\d.]+)", lambda m: f"{axis}{float(m[1]) + by:.4f}", line) for line in lines]


def of(proof, kind=FindingKind.STOCK_LEFT):
    return [f for f in proof.findings if f.kind is kind]


def test_a_right_program_has_no_finding_and_works_on_the_pocket_alone():
    proof = run(program())
    assert proof.no_findings and proof.work.faces == (*WALLS, FLOOR)
    kept = set(proof.work.reason.tolist())
    assert {"", "not_in_program", "holder"} <= kept <= {"", "not_in_program", "holder", "pass"}


@pytest.mark.parametrize("by", [0.02, pytest.param(0.25, marks=pytest.mark.slow), 2.0])
def test_an_offset_upwards_is_as_high_as_it_is_on_the_floor(by):
    proof = run(raised(program(), by))
    found = of(proof)
    assert proof.counts == {"stock_left": len(found)}
    (floor,) = [f for f in found if f.face == f"F{FLOOR}"]
    assert floor.depth == pytest.approx(by, abs=1e-4) and floor.line in floor.lines and floor.limit == 0.01
    assert floor.area == pytest.approx(20 * 12 - 4 * 2 * 2, rel=0.05) and floor.point[2] == DEPTH
    assert all(f.depth <= by + 1e-6 for f in found), "the foot of a wall is as high as the floor"
    if by > 0.3:
        assert all(f.depth > 0.97 * by for f in found), "not only somewhat up it"


def test_samples_whose_way_is_not_followed_count_up_to_the_top_of_their_neighbour(monkeypatch):
    monkeypatch.setattr(work_done, "MAX_WAYS", 40)
    found = of(run(raised(program(), 2.0)))
    assert {f.face for f in found} == {f"F{n}" for n in (*WALLS, FLOOR)}
    assert all(0.97 * 2.0 < f.depth <= 2.0 + 1e-6 for f in found)


def test_an_offset_aside_is_as_high_as_it_is_on_the_wall_that_it_leaves():
    proof = run(raised(program(), 1.5, "X"))
    left = {f.face: f for f in of(proof)}
    assert left["F10"].depth == pytest.approx(1.5, abs=1e-3) == max(f.depth for f in left.values())
    assert max(f.depth for f in of(proof, FindingKind.GOUGE)) == pytest.approx(1.5, rel=0.1)


@pytest.mark.slow
def test_what_no_tool_touches_is_remainder():
    proof = run(raised(program(), 1.0), touch=Everything(without=(FLOOR,)))
    assert {f.face for f in of(proof)}.isdisjoint({f"F{FLOOR}"})
    assert "holder" in proof.work.reason.tolist()


def test_faces_that_are_named_are_asked_though_nothing_comes_near():
    touch = Everything()
    proof = run(program(), faces={TOP, FLOOR}, touch=touch)
    (top,) = of(proof)
    assert top.face == f"F{TOP}" and top.depth == pytest.approx(0.5, abs=1e-6) and top.line == 0 and top.lines == ()
    assert proof.work.faces == (TOP, FLOOR) and touch.asked[0][1:3] == (["T1"], [[0.0, 0.0, 1.0]])
    assert run(program(), faces=set()).no_findings


def test_air_is_nothing_cut():
    proof = run(raised(program(), 20.0))
    assert proof.counts == {"nothing_cut": 1} and proof.work.faces == ()


def test_the_way_out_of_a_step_beside_the_floor_is_sideways():
    part = block()
    setup = replace(SETUP, stock_kind="box", margin=0.5)
    moves = Moves(np.array([[-30.0, 0.0, 1.0]]), np.array([[30.0, 0.0, 1.0]]), np.ones(1, bool), np.zeros(1, np.int32))
    cutting = Cutting(TriangleTree(part.mesh), setup, moves, (TOOL,))
    points, up = np.array([[0.0, 0.0, DEPTH], [0.0, 5.0, DEPTH]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    out = ways_out(points, up, np.array([[0.0, 0.0, 1.0]]), 0.01, 50.0, cutting)
    way, by = out.length, out.mover
    # above the pocket's floor stand 5.5 mm of the blank; the walls are in the way to the sides
    assert way[0] == pytest.approx(5.49, abs=1e-6) and by[0] == -1
    assert cutting.farthest > 50.0


def test_axes_are_few_and_the_most_used_come_first():
    n = 400
    lean = np.linspace(0.0, 1.2, n)
    axis = np.column_stack([np.sin(lean), np.zeros(n), np.cos(lean)])
    axis[:200] = [0.0, 0.0, 1.0]
    moves = Moves(np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1)), np.ones(n, bool), np.zeros(n, np.int32),
                  ToolAxes.between(axis, axis))
    axes = cutting_axes(moves, moves.feed)
    assert len(axes) <= 24 and axes[0].tolist() == [0.0, 0.0, 1.0]
    assert np.allclose(np.linalg.norm(axes, axis=1), 1.0)
    assert cutting_axes(replace(moves, axes=None), moves.feed).tolist() == [[0.0, 0.0, 1.0]]


def test_rows_are_thinned_evenly():
    rows = np.arange(1000)
    assert np.array_equal(thinned(rows, 1000), rows) and len(thinned(rows, 7)) == 7
    assert np.diff(thinned(rows, 10)).tolist() == [100] * 9


def faced(*heights):
    """Rows over the whole top at some heights, 0 being the top, each a run of its own."""
    rows = [f"X{24 * (1 if k % 2 else -1)} Y{y}\nX{24 * (-1 if k % 2 else 1)}" for k, y in enumerate(range(-16, 18, 3))]
    body = [f"G0 Z20\nX-24 Y-20\nG1 Z{z} F300\n" + "\n".join(rows) for z in heights]
    head = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
    return [*head, *"\n".join(body).split("\n"), "G0 Z20", "M5", "M30", "%"]


def test_facing_the_top_is_no_work_on_the_floor_of_the_pocket():
    proof = run(faced(0.25, 0.0))
    assert proof.work.faces == (TOP,) and not of(proof)


def test_facing_too_high_is_work_on_all_that_lies_under_it():
    proof = run(faced(0.25))
    assert set(proof.work.faces) == {TOP, FLOOR}
    high = {f.face: f.depth for f in of(proof)}
    assert high[f"F{TOP}"] == pytest.approx(0.25, abs=0.005)


@pytest.mark.parametrize("allowance", [0.3, 0.05])
def test_a_cut_to_size_goes_into_the_allowance(allowance):
    proof = run(faced(0.25, 0.0), setup=replace(SETUP, stock_allowance=allowance))
    found = of(proof, FindingKind.ALLOWANCE)
    assert found and max(f.depth for f in found) == pytest.approx(allowance, abs=1e-4)
    assert {f.face for f in found} == {f"F{TOP}"}
    assert not of(run(faced(0.3), setup=replace(SETUP, stock_allowance=0.3)), FindingKind.ALLOWANCE)


@pytest.mark.slow
def test_faces_that_only_unread_lines_cut_are_asked():
    """A stray M2 after the facing: the pocket that the lines behind it would cut is asked, and is left."""
    lines = [*faced(0.0)[:-3], "G0 X-7 Y0", *program()[6:]]
    end = lines.index("G0 X-7 Y0")
    assert set(run(lines).work.faces) == {TOP, *WALLS, FLOOR} and run(lines).no_findings
    stray = [*lines[:end], "M2", *lines[end:]]
    read, whole = (read_one(NcProgram("p", text(t)), (TOOL,)) for t in (stray, lines))
    assert read.cut_off == end + 1
    proof = run(stray)
    assert proof.work.faces == (TOP,) and proof.no_findings, "nothing is known of the lines behind the end"
    proof = run(stray, whole=whole)
    assert set(proof.work.faces) == {TOP, *WALLS, FLOOR}
    assert proof.counts.keys() == {"stock_left"} and {f.face for f in of(proof)} >= {f"F{FLOOR}"}
    assert run(stray, faces={TOP}, whole=whole).work.faces == (TOP,), "faces that are named are the faces"


@pytest.mark.parametrize("allowance", [0.1, 0.5])
def test_samples_in_a_corner_that_two_allowances_share_do_not_count(allowance):
    step = TriangleTree(terraces([0, 8, 16], [0, 12], [[3.0, 6.0]], 0.0))  # floor at 3 up to the wall x = 8
    x = 8.0 - allowance * np.array([0.5, 0.97, 0.999, 1.5])
    points = np.column_stack([x, np.full(4, 6.0), np.full(4, 3.0)])
    few = SurfaceSamples(points, np.tile([0.0, 0.0, 1.0], (4, 1)), np.ones(4), np.ones(4, np.int32),
                         np.zeros(4, np.int32))
    for given, shared in ((allowance, [True, True, False, False]), (0.0, [False] * 4)):
        cutting = Cutting(step, replace(SETUP, stock_allowance=given), Moves(*np.zeros((2, 0, 3)), np.zeros(0, bool),
                                                                             np.zeros(0, np.int32)), [])
        assert work_done._shared(few, cutting, 1e-4).tolist() == shared
