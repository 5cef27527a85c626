"""The way of a tool for a page: thinned within the tolerance, in the steps of its plan, and coarse where not proved."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geometry.tool_body import ToolBody
from service.viewer.view_paths import (
    AXIS_UNIT,
    COARSE,
    CUT,
    GRID,
    RAPID,
    START,
    ToolTrack,
    path_chunks,
    thinned,
    track_of,
)
from tests.hand_parts import as_part, box_mesh
from verify.checks.program_sequence import read_all
from verify.model import NcProgram, ProofSetup

TEXT = """G21 G17 G90 G94 G64 P0.001
G54
T1 M6
G43 H1
(S01 several zones roughing depth_layers T1: F1)
S1000 M3
G0 Z20
G0 X0 Y0
G1 Z5 F100
G1 X10 F600
G1 X20
(F2 F3; Z 15 down to 0)
G1 X30 Y0.05
G0 Z20
(S02 Z1 waterline T1: F1)
G0 X5 Y5
G1 Z4 F100
G1 X9 F600
G0 Z20
M2
"""
STEPS = [{"id": "S01", "zone": None, "operation": "roughing", "strategy": "depth_layers"},
         {"id": "S02", "zone": "Z1", "operation": "finishing", "strategy": "waterline"}]


def farthest(place, rows):
    """The farthest any place is from the polyline through those of ``rows``, between the two kept ones round it."""
    worst = 0.0
    for a, b in zip(rows[:-1], rows[1:], strict=True):
        p, way = place[a:b + 1] - place[a], place[b] - place[a]
        share = np.clip(p @ way / max(way @ way, 1e-18), 0, 1)
        worst = max(worst, float(np.linalg.norm(p - share[:, None] * way, axis=1).max()))
    return worst


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.001, 0.5))
def test_what_is_left_out_is_within_the_tolerance(seed, tolerance):
    rng = np.random.default_rng(seed)
    place = np.cumsum(rng.normal(0, 0.1, (200, 3)), axis=0)
    kind = np.where(rng.random(200) < 0.1, RAPID, CUT)
    rows = thinned(place, kind, tolerance)
    assert rows[0] == 0 and rows[-1] == 199 and (np.diff(rows) > 0).all()
    assert farthest(place, rows) <= tolerance + 1e-12
    change = np.flatnonzero(kind[1:-1] != kind[2:]) + 1
    assert np.isin(change, rows).all()


def test_a_circle_needs_few_rows():
    turn = np.linspace(0, 2 * np.pi, 2001)
    place = np.column_stack([10 * np.cos(turn), 10 * np.sin(turn), 0 * turn])
    rows = thinned(place, np.full(2001, CUT), 0.1)
    assert 12 <= len(rows) <= 120 and farthest(place, rows) <= 0.1


def read_way(program, part, tools, steps=()):
    readings = read_all([program], part, tools, ProofSetup(), 0, lambda _share: None)
    return track_of(readings, [program], np.eye(3), steps)


@pytest.fixture(scope="module")
def way(demo_tool):
    return read_way(NcProgram("p.ngc", TEXT), demo_tool[0], [demo_tool[1]], STEPS)


@pytest.fixture(scope="module")
def demo_tool():
    return as_part(box_mesh((0, 0, 0), (30, 10, 3))), ToolBody("T1", 1, 4.0, 0.0, 10.0, 4.0, 10.0, 6.0, 30.0)


def test_moves_belong_to_the_steps_of_the_plan(way):
    assert [s["id"] for s in way.steps] == ["S01", "S02"] and [s["zone"] for s in way.steps] == [None, "Z1"]
    lines = TEXT.split("\n")
    for line, step in zip(way.line.tolist(), way.step.tolist(), strict=True):
        assert step == (1 if line > lines.index("(S02 Z1 waterline T1: F1)") else 0)
    assert (way.ended >= way.begun).all() and way.begun[0] == 0.0
    assert np.allclose(way.begun[1:], way.ended[:-1])


def test_a_line_is_found_in_time_and_place(way):
    row = int(np.flatnonzero(way.line == 10)[0])
    stand = way.stand("p.ngc", 10, (5.0, 0.0, 5.0))
    assert stand.seconds == pytest.approx(0.5 * (way.begun[row] + way.ended[row])) and stand.step == 0
    assert np.allclose(stand.tip, [5, 0, 5]) and np.allclose(stand.axis, [0, 0, 1])
    assert way.stand("p.ngc", 10, None).seconds == way.begun[row]
    assert way.stand("p.ngc", 1, None) is None and way.stand("other", 10, None) is None


def test_at_a_gouge_the_tool_is_below_the_place(way):
    down = TEXT.split("\n").index("G1 Z5 F100") + 1
    # half a mm below what is left of the part there; without, the descent is nearest where it has cut nothing yet
    assert way.stand("p.ngc", down, (1.0, 0.0, 5.5), 0.5).tip[2] == pytest.approx(5.0)
    assert way.stand("p.ngc", down, (1.0, 0.0, 5.5)).tip[2] == pytest.approx(5.5)


def test_at_each_second_the_tool_is_where_the_program_has_it(demo_tool):
    """A straight way with another feed on every line: seconds do not go with the way."""
    feeds = (100, 1500, 60, 900, 2000, 30)
    text = TEXT.replace("G1 X20\n", "".join(f"G1 X{11 + k} F{f}\n" for k, f in enumerate(feeds)))
    way = read_way(NcProgram("p.ngc", text), demo_tool[0], [demo_tool[1]], STEPS)
    low = np.array([-5.0, -5.0, 0.0])
    first, then, _, grid = path_chunks(way, low, open_=True)
    chunk = then[0].columns
    time, line = chunk["time"].rows()[:, 0] / 1000.0, chunk["line"].rows()[:, 0]
    place = chunk["place"].rows() * grid + low
    for row in np.flatnonzero((way.step == 0) & way.feed):
        middle = 0.5 * (way.begun[row] + way.ended[row])
        drawn = [np.interp(middle, time, place[:, c]) for c in range(3)]
        assert np.linalg.norm(drawn - 0.5 * (way.start[row] + way.end[row])) < 0.01
        assert line[np.searchsorted(time, middle)] == way.line[row]
    # the rough level, which is only looked at, keeps neither
    assert len(first[0].columns["kind"].rows()) < len(time) - len(feeds) + 2


def test_of_a_proved_job_both_levels_with_lines(way):
    first, then, steps, grid = path_chunks(way, np.array([-5.0, -5.0, 0.0]), open_=True)
    assert grid == GRID and len(first) == len(then) == 2 and [s["tool"] for s in steps] == [1, 1]
    place = then[0].columns["place"].rows() * grid + [-5.0, -5.0, 0.0]
    kind = then[0].columns["kind"].rows()[:, 0]
    assert kind[0] == START and np.isclose(place, [30.0, 0.05, 5.0]).all(axis=1).any()
    cut = sum(np.linalg.norm(place[k] - place[k - 1]) for k in np.flatnonzero(kind == CUT))
    assert cut == pytest.approx(15.0 + 30.0, abs=0.01)
    assert 11 in then[0].columns["line"].rows()
    # the bend of 0.05 mm is below what the rough level keeps
    assert len(first[0].columns["kind"].rows()) < len(kind)


def test_of_one_that_is_not_proved_a_picture(way):
    first, then, steps, grid = path_chunks(way, np.array([-5.0, -5.0, 0.0]), open_=False)
    assert grid == COARSE and not then and steps[1]["start_s"] == round(steps[1]["start_s"])
    for chunk in first:
        assert set(chunk.columns) == {"place", "kind", "time"}
        assert not (chunk.columns["time"].rows() % 1000).any()


def test_a_foreign_program_is_shown_by_its_tools(demo_tool):
    part, tool = demo_tool
    text = TEXT.replace("M2", "T2 M6\nG43 H2\nS900 M3\nG0 Z20\nX0 Y0\nG1 Z8 F50\nG0 Z20\nM2")
    way = read_way(NcProgram("f.ngc", text), part, [tool, replace(tool, id="T2", number=2)])
    assert [s["id"] for s in way.steps] == ["T1", "T2"]
    assert set(way.tool[way.step == 1].tolist()) == {2}


def test_a_tool_that_turns_keeps_its_axes():
    n = 40
    turn = np.linspace(0.0, 0.5, n + 1)
    place = np.column_stack([np.linspace(0, 4, n + 1), np.zeros(n + 1), np.zeros(n + 1)])
    axis = np.column_stack([np.sin(turn[1:]), np.zeros(n), np.cos(turn[1:])])
    no = np.zeros(n, np.int64)
    step = {"id": "T1", "zone": None, "operation": "", "strategy": "", "program": "p"}
    way = ToolTrack(place[:-1], place[1:], axis, np.ones(n, np.bool_), np.arange(n) + 0.0, np.arange(n) + 1.0,
                    np.arange(n) + 1, no + 1, no, no, (step,), ("p",))
    (first,), (then,), (step,), _ = path_chunks(way, np.zeros(3), open_=True)
    assert step["axis"] is None
    for chunk in (first, then):  # straight, yet nothing is left out: the tool turns all the way
        got = chunk.columns["axis"].rows() / AXIS_UNIT
        assert len(got) == n + 1 and np.allclose(got[1:], axis, atol=1e-4)
