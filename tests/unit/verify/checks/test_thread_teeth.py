"""Thread mills that are drawn along their axis out of a thread, in a bore and round a boss."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import tool
from verify.checks.thread_teeth import drawn_thread_mills, taps_in_holes, teeth_touch
from verify.findings import Source
from verify.moves import Moves
from verify.tool_axes import ToolAxes

PITCH, BORE, HIGH = 0.8, 2.5, 10.0
ORBIT = 0.5
MILL = replace(tool(4.0, 0.0), named="thread_mill", flute_length=3.0)


def tube(radius, floor=None, sides=180):
    """The wall of a bore or boss about Z, from z 0 or the floor to ``HIGH``."""
    low = 0.0 if floor is None else floor
    at = np.arange(sides) * (2.0 * math.pi / sides)
    ring = np.column_stack([radius * np.cos(at), radius * np.sin(at)])
    points = np.concatenate([np.column_stack([ring, np.full(sides, z)]) for z in (low, HIGH)] + [[[0.0, 0.0, low]]])
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.column_stack([k, after, k + sides]), np.column_stack([after, after + sides, k + sides])]
    if floor is not None:
        faces.append(np.column_stack([np.full(sides, 2 * sides), k, after]))
    faces = np.concatenate(faces).astype(np.int32)
    return TriangleTree(TriangleMesh(points, faces, np.ones(len(faces), np.int32)))


def helix(orbit, turns, low, pitch=PITCH, start=0.0, pieces=60):
    """Tips of an upward helix from the angle ``start``, without the first."""
    k = np.arange(1, round(pieces * turns) + 1) / pieces
    at = start + 2.0 * math.pi * k
    return [(orbit * math.cos(a), orbit * math.sin(a), low + pitch * t) for a, t in zip(at, k, strict=True)]


def found(tips, feed=(), tree=None, mill=MILL, cut=None, turn=None, pitch=None):
    """Depths by line, the number of the tip to which a move goes; ``feed`` : lines at rapid."""
    at = np.array(tips, float)
    n = len(at) - 1
    axes = None
    if turn is not None:
        at = at @ turn.T
        axes = ToolAxes.between(*[np.tile(turn[:, 2], (n, 1))] * 2)
    go = np.ones(n, bool)
    go[[line - 1 for line in feed]] = False
    moves = Moves(at[:-1].copy(), at[1:].copy(), go, np.zeros(n, np.int32), axes)
    source = Source(("program",), np.zeros(n, np.int32), np.arange(1, n + 1, dtype=np.int32), np.full(n, 6, np.int32))
    cut = np.zeros(n, bool) if cut is None else np.array(cut, bool)
    return {f.line: f.depth for f in drawn_thread_mills(moves, cut, [mill], source, tree or tube(BORE), 0.03,
                                                          {} if pitch is None else {mill.number: pitch})}


DOWN = [(0, 0, 15), (0, 0, 2)]
IN = [*DOWN, (ORBIT, 0, 2)]
TURN = [*IN, *helix(ORBIT, 1.0, 2.0)]
TOP = 2.0 + PITCH


@pytest.mark.parametrize("tips", [
    [*TURN, (0, 0, TOP), (0, 0, 15)],
    [*IN, *helix(ORBIT, 6.0, 2.0), (0, 0, 6.8), (0, 0, 15)],
    [*TURN, (0, 0, TOP), (0, 0, 2), (ORBIT, 0, 2), *helix(ORBIT, 1.0, 2.0), (0, 0, TOP), (0, 0, 15)],
    [*DOWN, *((0.25 + p[0], p[1], p[2]) for p in helix(0.25, 0.5, 2.0, start=math.pi)), *helix(ORBIT, 1.0, 2.4),
     *((0.25 + p[0], p[1], p[2]) for p in helix(0.25, 0.5, 3.2)), (0, 0, 15)],
    [*IN, *helix(ORBIT, 6.0, 2.0, pieces=8), (0, 0, 6.8), (0, 0, 15)],
    [(0, 0, 15), (0, 0, 6), (ORBIT, 0, 6), *helix(ORBIT, 3.0, 6.0, -PITCH), (0, 0, 3.6), (0, 0, 15)],
    [*TURN, (ORBIT, 0, TOP + 0.5 * PITCH), (0, 0, TOP + 0.5 * PITCH), (0, 0, 15)],
], ids=["one turn", "six turns", "twice", "arcs", "polygons", "down", "half a pitch"])
def test_a_thread_mill_that_leaves_its_thread_aside_is_right(tips):
    assert found(tips) == {}
    assert found(tips, feed=(1, len(tips) - 1)) == {}


@pytest.mark.parametrize(("more", "line", "deep"), [
    ([(ORBIT, 0, 15)], 1, HIGH - TOP),
    ([(ORBIT, 0, TOP + 1.0)], 1, 1.0),
    ([(ORBIT - 0.2, 0, TOP), (ORBIT - 0.2, 0, 15)], 2, 3.0),  # as far as the teeth have cut
    ([(0, 0, TOP), (ORBIT, 0, TOP), (ORBIT, 0, 15)], 3, HIGH - TOP),
    ([(0, 0, 15), (ORBIT, 0, 15), (ORBIT, 0, 5)], 1, None),
    ([(0.5 * ORBIT, 0, TOP + 6.0)], 1, 3.0),
    ([(0, 0, TOP + 6.0)], 1, 3.0),
], ids=["out", "more than a pitch", "a little aside", "back again", "from above", "slanted", "slanted out"])
def test_a_thread_mill_along_its_axis_in_the_thread_is_found(more, line, deep):
    if deep is None:  # from above into the thread
        assert list(found([*TURN[:-1], (0, 0, TOP), *more])) == [len(TURN) + 2]
        return
    where = found([*TURN, *more])
    assert list(where) == [len(TURN) - 1 + line] and where[len(TURN) - 1 + line] == pytest.approx(deep, abs=0.35)
    assert found([*TURN, *more], feed=(len(TURN) - 1 + line,)) == where


def test_small_steps_and_small_turns_are_no_way_out():
    up = [(ORBIT + 0.01 * (-1) ** k, 0, TOP + 0.1 * k) for k in range(1, 60)]
    first = min(found([*TURN, *up]))
    assert len(TURN) <= first <= len(TURN) + 8  # a pitch up
    small = [(x + ORBIT - 0.02, y, z) for x, y, z in helix(0.02, 8.0, TOP, pieces=12)]
    assert len(found([*TURN, *small])) == 1


def test_a_helix_steeper_than_any_thread_is_found():
    bore, orbit = tube(8.0), 6.0
    start = [(0, 0, 15), (0, 0, 1), (orbit, 0, 1)]
    assert found([*start, *helix(orbit, 1.0, 1.0, 1.0), (0, 0, 2), (0, 0, 15)], tree=bore) == {}
    steep = found([*start, *helix(orbit, 0.5, 1.0, 16.0), (0, 0, 9), (0, 0, 15)], tree=bore)
    assert len(steep) >= 1


def test_a_wall_that_is_entered_without_a_helix_counts():
    assert list(found([*IN, (ORBIT, 0, 8)])) == [3]
    assert found([*IN, (ORBIT, 0, 2.3), (0, 0, 2.3), (0, 0, 15)]) == {}


@pytest.mark.parametrize("pieces", [8, 60, 720])
def test_helices_have_the_pitch_that_the_mill_states(pieces):
    tips = [*IN, *helix(ORBIT, 3.0, 2.0, pieces=pieces), (0, 0, 4.4), (0, 0, 15)]
    tips = [(round(x, 6), round(y, 6), round(z, 3)) for x, y, z in tips]
    assert found(tips) == found(tips, pitch=PITCH) == found(tips, pitch=1.015 * PITCH) == {}
    for other in (0.75, 1.0):
        depth = found(tips, pitch=other)
        assert list(depth.values()) == [pytest.approx(PITCH, rel=0.01)]


def test_a_tap_is_in_its_hole_where_it_touches_the_part():
    tap = replace(tool(5.0, 0.0), named="tap", flute_length=3.0)
    at = np.array([(0, 0, 15), (0, 0, 11), (0, 0, 4), (0, 0, 11), (0, 0, 15), (9, 0, 15)], float)
    moves = Moves(at[:-1], at[1:], np.array([1, 1, 1, 0, 1], bool), np.zeros(5, np.int32), None)
    assert np.argwhere(taps_in_holes(moves, [tap], tube(BORE), 0.03)).tolist() == [[1, 1], [2, 0]]
    assert not taps_in_holes(moves, [MILL], tube(BORE), 0.03).any()
    assert not taps_in_holes(moves, [tap], tube(30.0), 0.03).any()


def test_a_thread_in_stock_counts_where_the_tool_cut_it():
    wide = tube(30.0)
    cut = [False, True, *[True] * 60, False]
    assert list(found([*TURN, (ORBIT, 0, 15)], tree=wide, cut=cut)) == [len(TURN)]
    assert found([*TURN, (0, 0, TOP), (0, 0, 15)], tree=wide, cut=[*cut, False]) == {}


def test_a_thread_round_a_boss_and_along_a_leaning_axis():
    boss, orbit = tube(6.0), 8.0
    turn = [(12, 0, 15), (12, 0, 2), (orbit, 0, 2), *helix(orbit, 1.0, 2.0, pieces=180)]
    assert found([*turn, (12, 0, TOP), (12, 0, 15)], tree=boss) == {}
    assert list(found([*turn, (orbit, 0, 15)], tree=boss)) == [len(turn)]
    c, s = math.cos(0.7), math.sin(0.7)
    lean = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    mesh = tube(BORE).mesh
    tree = TriangleTree(TriangleMesh(mesh.vertices @ lean.T, mesh.faces, mesh.face_ids))
    assert found([*TURN, (0, 0, TOP), (0, 0, 15)], tree=tree, turn=lean) == {}
    assert list(found([*TURN, (ORBIT, 0, 15)], tree=tree, turn=lean)) == [len(TURN)]


def test_a_floor_or_a_rim_near_the_tip_is_no_wall():
    up = np.array([[0.0, 0.0, 1.0]])
    blind = tube(BORE, floor=1.9)
    for x, touches in ((0.0, False), (0.4, False), (0.48, True), (0.5, True)):
        at = np.array([[x, 0.0, 2.0]])
        assert teeth_touch(blind, at, up, 2.0, 1.0, 0.03)[0] == touches
        assert teeth_touch(tube(BORE), at, up, 2.0, 3.0, 0.03)[0] == touches
    assert not teeth_touch(tube(BORE), np.array([[0.5, 0.0, HIGH + 0.1]]), up, 2.0, 3.0, 0.03)[0]
    assert not teeth_touch(tube(BORE), np.array([[0.5, 0.0, -3.2]]), up, 2.0, 3.0, 0.03)[0]
    assert not len(teeth_touch(blind, np.zeros((0, 3)), np.zeros((0, 3)), 2.0, 1.0, 0.03))


def passes(*ways):
    """A way in and out of the bore for each helix: (low, turns, orbit, start, hand)."""
    out = list(DOWN[:1])
    for low, turns, orbit, start, hand in ways:
        tips = [(x, hand * y, z) for x, y, z in helix(orbit, turns, low, start=start)]
        x, y = orbit * math.cos(start), hand * orbit * math.sin(start)
        out += [(0, 0, low), (x, y, low), *tips, (0, 0, tips[-1][2])]
    return [*out, DOWN[0]]


@pytest.mark.parametrize(("second", "off"), [
    ((2.0, 2, ORBIT, 0.0, 1), None), ((2.0 + PITCH, 2, ORBIT, 0.0, 1), None), ((2.05, 2, ORBIT, 0.0, 1), None),
    ((2.0 + 0.25 * PITCH, 2, ORBIT, 0.5 * math.pi, 1), None),  # begins a quarter turn on, a quarter pitch higher
    ((2.0 + 0.5 * PITCH, 2, ORBIT, 0.0, 1), 0.4), ((2.1, 2, ORBIT, 0.0, 1), 0.1), ((2.0, 2, ORBIT, math.pi, 1), 0.4),
    ((2.0 + 1.3 * PITCH, 2, ORBIT, 0.0, 1), 0.24), ((4.3, 3, ORBIT, 0.0, 1), 0.1), ((2.0, 2, ORBIT, 0.0, -1), 0.0)])
@pytest.mark.parametrize("shallow", [ORBIT, ORBIT - 0.02])
def test_a_second_pass_runs_in_the_thread_of_the_first(second, off, shallow):
    tips = passes((2.0, 2, shallow, 0.0, 1), second)
    depths = found(tips, pitch=PITCH)
    assert sorted(depths.values()) == ([] if off is None else [pytest.approx(off, abs=1e-6)])
    assert off is None or min(depths) > 120
    assert not found(tips)  # the lead of a thread of several starts


def test_threads_in_two_bores_and_turns_in_air_are_apart():
    first, second = passes((2.0, 2, ORBIT, 0.0, 1))[:-1], passes((2.4, 2, ORBIT, 0.0, 1))[1:]
    assert found([*first, (0, 0, 15), *second], pitch=PITCH)
    beside = [(x + 40.0, y, z) for x, y, z in second]
    assert not found([*first, (0, 0, 15), (40, 0, 15), *beside], pitch=PITCH)
    assert not found(passes((2.0, 2, 0.2, 0.0, 1), (2.4, 2, ORBIT, 0.0, 1)), pitch=PITCH)


def test_a_lead_in_on_an_arc_has_no_phase():
    def with_lead(low, at=0.0):
        k = np.arange(1, 31) / 30.0
        lead = [(0.25 - 0.25 * math.cos(math.pi * t), -0.25 * math.sin(math.pi * t), low - 0.25 * PITCH * (1 - t))
                for t in k]
        tips = [(0, 0, low - 0.25 * PITCH), *lead, *helix(ORBIT, 2, low)]
        return [*tips, (0, 0, tips[-1][2])]

    assert not found([DOWN[0], *with_lead(2.0), *with_lead(2.0 + PITCH)], pitch=PITCH)
    assert len(found([DOWN[0], *with_lead(2.0), *with_lead(2.0 + 0.5 * PITCH)], pitch=PITCH)) == 1


def plane(x, long=20.0):
    """An upright wall at ``x``, from y -long / 2 to long / 2 and z 0 to ``HIGH``."""
    points = np.array([[x, y, z] for y in (-0.5 * long, 0.5 * long) for z in (0.0, HIGH)])
    return TriangleTree(TriangleMesh(points, np.array([[0, 1, 2], [1, 3, 2]], np.int32), np.ones(2, np.int32)))


@pytest.mark.parametrize("pitch", [None, PITCH])
@pytest.mark.parametrize("pieces", [60, 20])
@pytest.mark.parametrize("rise", [0.0, 0.3 * PITCH, -0.3 * PITCH])
def test_a_turn_without_the_rise_of_a_thread_is_a_groove(rise, pieces, pitch):
    tips = [*IN, *helix(ORBIT, 1.0, 2.0, rise, pieces=pieces), (0, 0, 2.0 + rise), (0, 0, 15)]
    way = found(tips, pitch=PITCH if rise else pitch)
    assert min(way) > 2 and max(way.values()) > 0.7 * 2.0 * math.pi * ORBIT


@pytest.mark.parametrize("turns", [0.25, 0.5, 0.6])
def test_a_lead_along_the_wall_is_no_groove(turns):
    way = helix(ORBIT, turns, 2.0, 0.0)
    assert not found([*IN, *way, (0, 0, 2), (0, 0, 15)], pitch=PITCH)


@pytest.mark.parametrize("pieces", [60, 300, 1000])
def test_a_helix_of_fine_chords_rounded_to_a_micrometre_is_no_groove(pieces):
    way = np.round(helix(ORBIT, 3.0, 2.0, pieces=pieces), 3)
    assert not found([*IN, *map(tuple, way), (0, 0, 4.4), (0, 0, 15)], pitch=PITCH)


@pytest.mark.parametrize(("way", "groove"), [(1.5, False), (2.5, True), (30.0, True)])
@pytest.mark.parametrize("pieces", [1, 7, 40])
def test_a_straight_way_along_a_flat_wall_is_a_groove(way, groove, pieces):
    """The tool, of radius 2, goes beside a wall at x = 2; a gap of 0.02 is within the slack."""
    y = np.linspace(-0.5 * way, 0.5 * way, pieces + 1)
    tips = [(-9, y[0], 15), (-9, y[0], 2), *((-0.02, k, 2.0) for k in y), (-9, y[-1], 2), (-9, y[-1], 15)]
    depths = found(tips, feed=(1, 2), tree=plane(2.0))
    assert bool(depths) == groove
    if groove:
        assert 2.0 < depths[max(depths)] <= min(way, 20.0) + 1.0
