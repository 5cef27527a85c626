"""Lines at one height: pieces, thinning, and lines that keep to the free region."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from geometry.mesh import TriangleMesh
from tests.hand_parts import ball, box_mesh, field_of, joined, terraces, tool, walls
from tests.plan_checks import dense
from toolpath.kernels.contour import OFF, SEGMENTS, trace
from toolpath.lines import Line, pieces_where, place_keys, thinned, true_runs
from toolpath.passes.contours import contour_pieces, contours, dilated, free_pieces, moves_free, rings


def circle(n=200, r=10.0, closed=True):
    a = np.linspace(0, 2 * np.pi, n + 1)
    return Line(np.column_stack([r * np.cos(a), r * np.sin(a), np.zeros(n + 1)]), closed)


def along(points):
    return np.asarray(points, float)


def everywhere(field):
    return np.ones((field.lattice.ny, field.lattice.nx), bool)


def test_length_and_reversal():
    line = circle()
    assert line.length == pytest.approx(2 * np.pi * 10, rel=1e-3)
    back = line.reversed()
    assert back.closed and (back.points[::-1] == line.points).all()


def test_runs_of_true():
    assert true_runs(np.array([1, 1, 0, 1, 0, 0, 1], bool)) == [(0, 2), (3, 4), (6, 7)]
    assert true_runs(np.zeros(3, bool)) == []


@pytest.mark.parametrize("tolerance", [0.5, 0.05, 0.001])
def test_thinning_keeps_ends_and_stays_within_its_tolerance(tolerance):
    rng = np.random.default_rng(4)
    points = np.cumsum(rng.normal(size=(300, 3)) * [0.2, 0.2, 0.02], axis=0)
    kept = thinned(points, tolerance)
    assert (kept[0] == points[0]).all() and (kept[-1] == points[-1]).all()
    fine = dense(kept, 0.25 * tolerance + 1e-3)
    gap = np.sqrt(((points[:, None] - fine[None]) ** 2).sum(-1)).min(axis=1)
    assert gap.max() <= tolerance + 0.5 * (0.25 * tolerance + 1e-3)
    assert len(thinned(circle().points, 0.01)) < 80


def test_a_straight_line_keeps_two_points():
    assert len(thinned(np.linspace([0, 0, 0], [9, 3, 1], 50), 1e-9)) == 2


def test_dilation_grows_a_square():
    m = np.zeros((9, 9), bool)
    m[4, 4] = True
    assert dilated(m, 0.0).sum() == 1 and dilated(m, 1.0).sum() == 9 and dilated(m, 1.2).sum() == 25


@pytest.mark.parametrize("seed", range(6))
def test_dilation_agrees_with_every_node_asked_for_itself(seed):
    rng = np.random.default_rng(seed)
    mask, reach = rng.random(rng.integers(1, 30, 2)) < rng.choice([0.01, 0.1, 0.5]), int(rng.integers(1, 7))
    got = dilated(mask, reach - 0.5)
    for i, j in np.ndindex(mask.shape):
        assert got[i, j] == mask[max(i - reach, 0):i + reach + 1, max(j - reach, 0):j + reach + 1].any()


def chains_by_hand(blocked, active):
    """Chains of lattice edges, each edge as its two nodes, from a table of who follows whom."""
    follow = {}
    for i, j in np.ndindex(blocked.shape[0] - 1, blocked.shape[1] - 1):
        nodes = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
        if not active[i, j]:
            continue
        turns = [k for k in range(4) if blocked[nodes[k]] != blocked[nodes[(k + 1) % 4]]]
        for k in turns:  # into the cell where the side runs from a free node to a blocked one, seen anticlockwise
            if blocked[nodes[(k + 1) % 4]]:
                out = next(m % 4 for m in range(k - 1, k - 4, -1) if m % 4 in turns)
                follow[frozenset((nodes[k], nodes[(k + 1) % 4]))] = frozenset((nodes[out], nodes[(out + 1) % 4]))
    chains = []
    for at in [*(e for e in follow if e not in follow.values()), *follow]:
        chain = []
        while at in follow:
            chain.append(at)
            at = follow.pop(at)
        if chain:
            chains.append((chain if at == chain[0] else [*chain, at], at == chain[0]))
    return chains


@pytest.mark.parametrize("seed", range(8))
def test_traced_chains_are_those_found_by_hand(seed):
    rng = np.random.default_rng(seed)
    blocked = ndimage.gaussian_filter(rng.random((14, 17)), rng.choice([0.1, 1.0])) > 0.5
    active = rng.random(blocked.shape) < rng.choice([0.7, 1.0])
    ids, starts, closed = trace(blocked, active, SEGMENTS)
    nx = blocked.shape[1]
    ends = [frozenset((divmod(e // 2, nx), divmod(e // 2 + (nx if e % 2 else 1), nx))) for e in ids.tolist()]
    got = {(frozenset(zip(ends[a:b], ends[a + 1:b], strict=False)), bool(c))
           for a, b, c in zip(starts[:-1], starts[1:], closed, strict=True)}
    hand = chains_by_hand(blocked, active)
    assert {(frozenset(zip(c, c[1:], strict=False)), k) for c, k in hand if not k} == {g for g in got if not g[1]}
    rounds = {frozenset(c) for c, k in hand if k}
    assert rounds == {frozenset(ends[a:b]) for a, b, c in zip(starts[:-1], starts[1:], closed, strict=True) if c}


def test_pieces_are_cut_out_extended_and_joined():
    points = np.column_stack([np.arange(21.0), np.zeros(21), np.zeros(21)])
    line = Line(points, False)
    wanted = np.zeros(21, bool)
    wanted[[3, 4, 5, 12, 13]] = True
    got = pieces_where(line, wanted, 0.5, 2.0)
    assert [(p.points[0, 0], p.points[-1, 0]) for p in got] == [(2.5, 5.5), (11.5, 13.5)]
    assert [(p.points[0, 0], p.points[-1, 0]) for p in pieces_where(line, wanted, 0.5, 7.0)] == [(2.5, 13.5)]
    assert pieces_where(line, np.zeros(21, bool), 1, 1) == []
    wanted[:] = True
    assert pieces_where(line, wanted, 5.0, 1.0)[0].points[[0, -1], 0].tolist() == [0.0, 20.0]


@pytest.mark.parametrize("start", [0, 37, 100, 160])
def test_a_piece_of_a_loop_does_not_depend_on_where_the_loop_begins(start):
    loop = circle()
    ring = np.roll(loop.points[:-1], -start, axis=0)
    line = Line(np.vstack([ring, ring[:1]]), True)
    wanted = line.points[:, 0] > 5.0
    wanted |= (line.points[:, 0] < -9.99)  # a second, tiny piece on the far side
    got = pieces_where(line, wanted, 0.7, 1.0)
    assert len(got) == 2 and not any(p.closed for p in got)
    assert max(p.length for p in got) == pytest.approx(2 * np.pi / 3 * 10 + 1.4, abs=0.4)


@pytest.mark.parametrize("start", range(0, 200, 40))
def test_near_pieces_of_a_loop_are_joined_wherever_it_begins(start):
    loop = circle()
    ring = np.roll(loop.points[:-1], -start, axis=0)
    line = Line(np.vstack([ring, ring[:1]]), True)
    angle = np.degrees(np.arctan2(line.points[:, 1], line.points[:, 0]))
    wanted = (np.abs(angle) < 60) & (np.abs(angle) > 5)
    assert len(pieces_where(line, wanted, 0.1, 3.0)) == 1


def test_a_loop_that_is_wanted_all_round_stays_closed():
    line = circle()
    assert pieces_where(line, np.ones(201, bool), 0.1, 0.1)[0].closed
    wanted = np.ones(201, bool)
    wanted[100] = False
    assert pieces_where(line, wanted, 0.1, 1.0)[0].closed


def test_contours_walk_with_the_material_on_the_right():
    field = field_of(box_mesh([0, 0, 0], [8, 5, 4]), ball(3.0))
    (line,) = contours(field, 1.0, everywhere(field), 0.002)
    assert line.closed and (line.points[:, 2] == 1.0).all()
    p = line.points[:, :2]
    assert 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1])) < 0  # clockwise round an island
    pocket = field_of(terraces([0, 2, 12, 14], [0, 2, 12, 14], [[6, 6, 6], [6, 2, 6], [6, 6, 6]]), ball(3.0))
    inner = [c for c in contours(pocket, 3.0, everywhere(pocket), 0.002)
             if (np.abs(c.points[:, :2] - 7).max(axis=1) < 5).all()]
    assert len(inner) == 1
    p = inner[0].points[:, :2]
    assert 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1])) > 0  # the other way inside a pocket


@pytest.mark.parametrize("body", [ball(3.0), tool(3.0, 0.0), tool(3.0, 0.6)], ids=lambda b: b.kind)
@pytest.mark.parametrize("turn", [0.0, 0.3, 0.7])
def test_places_of_a_contour_lie_where_the_tool_is_stopped(body, turn):
    box, (c, s) = box_mesh([-4, -2.5, 0], [4, 2.5, 4]), (np.cos(turn), np.sin(turn))
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    field = field_of(TriangleMesh(box.vertices @ rotation.T, box.faces), body)
    (line,) = contours(field, 1.0, everywhere(field), 0.002)
    away = np.hypot(*np.maximum(np.abs((line.points @ rotation)[:, :2]) - [4, 2.5], 0).T) - body.radius
    assert -1e-9 <= away.min() and away.max() <= OFF + 1e-9  # 0 at a node that touches
    # and so do the chords between them, but for the allowed part of the tolerance
    middle = 0.5 * (line.points[1:] + line.points[:-1])
    away = np.hypot(*np.maximum(np.abs((middle @ rotation)[:, :2]) - [4, 2.5], 0).T) - body.radius
    assert -0.002 < away.min() and away.max() <= 0.002


def test_where_the_holder_ends_the_way_the_place_is_found_by_halving():
    holder = tool(3.0, 0.0, neck=2.0, shank=8.0, stickout=30.0)
    field = field_of(box_mesh([0.013, 0.027, 0], [8, 5, 4]), holder)  # no node on the border of two cells of the holder
    (line,) = contours(field, 1.0, everywhere(field), 0.002)
    at = line.points + [0.0, 0.0, 1e-5]
    assert not (field.blocked_by_cutter(at) | field.blocked_by_body(at)).any()
    outside = np.hypot(*(np.maximum(np.maximum([0, 0] - line.points[:, :2], line.points[:, :2] - [8, 5]), 0)).T)
    assert outside.min() >= 4.0  # the shank's radius


def test_a_contour_that_leaves_the_area_is_open():
    field = field_of(box_mesh([0, 0, 0], [8, 5, 4]), ball(3.0))
    active = everywhere(field)
    active[:, active.shape[1] // 2:] = False
    (line,) = contours(field, 1.0, active, 0.002)
    assert not line.closed
    assert contours(field, 1.0, np.zeros_like(active), 0.002) == []
    assert contours(field, 9.0, everywhere(field), 0.002) == []


@pytest.mark.parametrize("seed", range(24))
def test_pieces_found_exactly_only_where_they_stay_are_those_of_whole_contours(seed):
    rng = np.random.default_rng(seed)
    mesh = walls() if seed % 2 else box_mesh([0, 0, 0], [8, 5, 4])
    level = 4.5 if seed % 2 else 1.0
    field = field_of(mesh, (ball, lambda d: tool(d, 0.0))[seed % 3 == 0](float(rng.uniform(1.0, 3.0))))
    borders = contours(field, level, everywhere(field), 0.002)
    there = np.vstack([c.points for c in borders])
    asked = field.lattice.mask(there[rng.integers(0, len(there), rng.integers(1, 9)), :2])
    wanted = dilated(asked, float(rng.integers(2, 12)))
    active = dilated(wanted, float(rng.integers(3, 60)))
    extend, join, dip = rng.uniform(0.0, 1.5), rng.uniform(0.0, 3.0), 0.1 * (seed % 2)
    twin = [p for c in contours(field, level, active, 0.002)
            for p in pieces_where(c, wanted[field.lattice.cells(c.points[:, :2])], extend, join)]
    found = contour_pieces(field, level, active, wanted, extend, join, 0.002, dip)
    assert twin
    assert [p.closed for p in found] == [p.closed for p in twin]
    for one, other in zip(found, twin, strict=True):
        assert len(one.points) == len(other.points)
        assert np.abs(one.points + [0.0, 0.0, dip] - other.points).max() < 1e-9


@pytest.mark.parametrize("distance", [0.4, 1.1])
def test_rings_keep_their_distance(distance):
    field = field_of(box_mesh([0, 0, 0], [8, 5, 4]), tool(3.0, 0.0))
    lines = next(rings(field, 1.0, everywhere(field), (distance,), 100.0))
    p = np.vstack([dense(r.points, 0.05) for r in lines])
    outside = np.hypot(*(np.maximum(np.maximum([0, 0] - p[:, :2], p[:, :2] - [8, 5]), 0)).T)
    near = outside < 4.0
    assert np.abs(outside[near] - 1.5 - distance).max() <= 0.005
    assert not list(rings(field, 1.0, np.zeros((field.lattice.ny, field.lattice.nx), bool), (1.0,), 1.0))


def test_moves_through_a_wall_are_seen_and_cut_out():
    field = field_of(walls(), ball(2.0))
    line = along([[1, 7, 4], [3, 7, 4], [9, 7, 4], [12, 7, 4]])
    assert moves_free(field, line).tolist() == [True, False, True]
    got = free_pieces(field, line, False)
    assert [p.points[:, 0].tolist() for p in got] == [[1, 3], [9, 12]]
    whole = free_pieces(field, along([[1, 7, 4], [3, 7, 4]]), False)
    assert len(whole) == 1 and len(whole[0].points) == 2
    # standing inside the wall is no better than moving through it
    assert free_pieces(field, along([[6, 7, 4], [6.1, 7, 4]]), False) == []


def test_a_place_has_one_key_however_it_was_rounded():
    """Nice fractions of a mm, as a lattice has them, and the same a few digits of rounding off; neighbours differ."""
    p = np.array([[-28.979375, 0.0703125, 9.40651], [0.15, -0.0375, 0.0]])
    for off in (1e-14, -1e-14, 1e-10, -1e-10):
        assert place_keys(p + off) == place_keys(p)
    assert not set(place_keys(p + 2e-6)) & set(place_keys(p))


@pytest.mark.parametrize("turn", [0.1, 0.37])
def test_a_slit_hardly_wider_than_the_tool_is_one_line_and_not_a_loop_for_each_row_of_nodes(turn):
    # two walls 4.06 mm apart, askew to the lattice, and a flat end of 4 mm: the tool has 0.03 mm to each side
    ahead = np.array([np.cos(turn), np.sin(turn)])
    aside = np.array([-ahead[1], ahead[0]])
    mesh = None
    for side in (-1.0, 1.0):
        at = np.array([10.0, 6.0]) + side * (2.03 + 0.75) * aside
        block = box_mesh([-6, -0.75, 0], [6, 0.75, 5])
        xy = block.vertices[:, :2]
        vertices = np.column_stack([at + xy[:, :1] * ahead + xy[:, 1:] * aside, block.vertices[:, 2]])
        block = TriangleMesh(vertices, block.faces, block.face_ids)
        mesh = block if mesh is None else joined(mesh, block)
    field = field_of(mesh, tool(4.0, 0.0))
    lat = field.lattice
    j, i = np.mgrid[:lat.ny, :lat.nx]
    off = np.column_stack([lat.x0 + lat.step * i.ravel(), lat.y0 + lat.step * j.ravel()]) - [10.0, 6.0]
    slit = ((np.abs(off @ ahead) < 4.0) & (np.abs(off @ aside) < 1.0)).reshape(lat.ny, lat.nx)
    found = contour_pieces(field, 1.0, everywhere(field), slit, 0.5, 1.0, 0.001)
    assert 1 <= len(found) <= 4
    p = np.vstack([dense(line.points, 0.05) for line in found]) - [10.0, 6.0, 1.0]
    inner = p[np.abs(p[:, :2] @ ahead) < 3.5]
    away = inner[:, :2] @ aside
    assert np.abs(np.abs(away) - 0.03).max() < 0.002  # along both walls
    for side in (away < 0, away > 0):
        assert np.ptp(inner[side, :2] @ ahead) > 6.8
