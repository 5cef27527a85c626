"""Arcs on and off walls: their shape, where they are taken, and that nothing is met on them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import RAMP, ball, box_mesh, field_of, joined, tool
from toolpath.counterexamples import BARRED, MIN_BARRED, NONE, Counterexamples
from toolpath.five_axis.oriented_motion import Surroundings, with_ways
from toolpath.five_axis.oriented_piece import Piece
from toolpath.lines import Line, dense
from toolpath.linking.lead_arcs import SIZES, arc_onto, radii
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.plan_settings import CutData, PlanSettings, RotaryAxes
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind
from zones.reach.assembly import Clearances


@pytest.mark.parametrize("radius", [0.06, 0.5, 3.0, 20.0])
def test_an_arc_touches_the_pass_and_its_chords_are_close(radius):
    rng = np.random.default_rng(7)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    start, ahead, off = rng.normal(size=3), axes[0], axes[1]
    arc = arc_onto(start, ahead, off, radius, CHORD)
    centre = start + radius * off
    assert (arc[-1] == start).all()
    np.testing.assert_allclose(arc[0], centre - radius * ahead, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(arc - centre, axis=1), radius, atol=1e-12)
    assert np.abs((arc - start) @ axes[2]).max() < 1e-12
    middle = 0.5 * (arc[1:] + arc[:-1])
    assert (radius - np.linalg.norm(middle - centre, axis=1)).max() <= CHORD
    last = (arc[-1] - arc[-2]) / np.linalg.norm(arc[-1] - arc[-2])
    assert math.acos(min(1.0, last @ ahead)) <= math.acos(1.0 - min(CHORD / radius, 0.3)) + 1e-9


def test_arcs_are_no_longer_than_the_pass_and_not_too_small_to_be_one():
    assert radii(10.0, 100.0) == [10.0 * s for s in SIZES]
    assert radii(10.0, math.pi * 2.6) == [10.0 * s for s in SIZES[:2]]
    assert radii(10.0, 3.0) == []
    assert radii(0.3, 100.0) == [0.3 * s for s in SIZES[1:]]


CHORD = 0.005
FREE = RotaryAxes(lambda axes: np.ones(len(axes), bool), lambda tips, axes: (tips, axes, np.zeros(len(tips) - 1)),
               np.array([0.0, 0, 1]), -100.0)
WALL = joined(box_mesh([0, 0, -2], [30, 30, 0]), box_mesh([0, 18, 0], [30, 22, 8]))


def beside_the_wall(skin, *, slot=None, body=None, found=NONE):
    """A wall along x, its face at y = 18, with a skin of stock on it; slot : mm to a second wall before it."""
    mesh = WALL if slot is None else joined(WALL, box_mesh([0, 2, 0], [30, 18 - slot, 8]))
    body = body or tool(4.0, 0.0)
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 8.0]), 0.1)
    y = stock.lattice.y0 + stock.lattice.step * np.arange(stock.lattice.ny)
    top = np.where((y > 18 - skin)[:, None] & (y < 23)[:, None], stock.top, -2.0)
    stock.become(StockMap(stock.lattice, top, top.copy(), stock.part))
    motions = Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 2.0, 0.001)
    return Linker(field_of(mesh, body), stock, motions, Depths(stock.lattice), found, walls=True)


def along(z, x0=6.0, x1=24.0, y=15.999):
    return Line(np.array([[x0, y, z], [x1, y, z]]), False)


def parts(link):
    return [(t.motion, t) for t in link.trajectories if t.motion is not TrajectoryKind.RAPID]


def test_a_pass_along_a_wall_begins_and_ends_on_an_arc():
    link = beside_the_wall(0.2)
    assert link.add(along(6.0))
    made = parts(link)
    k = [m for m, _ in made].index(TrajectoryKind.CUT)
    cut = made[k][1]
    onto, off = [t for _, t in made[k - 2:k]], [t for _, t in made[k + 1:k + 3]]
    assert {t.motion for t in onto} == {TrajectoryKind.APPROACH} and {t.motion for t in off} == {TrajectoryKind.LIFT}
    assert [t.feed for t in onto] == [3000, 800] and [t.feed for t in off] == [800, 3000]  # slow beside the wall
    lat = link.stock.lattice
    skin = next(y for y in lat.y0 + lat.step * np.arange(lat.ny) if y > 18 - 0.2)  # the first node of it
    for quick in (onto[0], off[1]):
        assert quick.points[:, 1].max() + 2.0 <= skin - 0.5 * lat.step  # half a cell off
    onto, off = (np.vstack([first.points, second.points[1:]]) for first, second in (onto, off))
    for arc in (onto, off[::-1]):
        assert np.ptp(arc[:, 2]) == 0.0 and len(arc) >= 5
        assert np.isclose(abs(arc[0, 0] - arc[-1, 0]), 15.999 - arc[0, 1])  # a quarter
        assert (np.diff(arc[:, 1]) > 0.0).all()  # towards the wall all the way
    assert onto[0, 0] < 6.0 < 24.0 < off[-1, 0]
    np.testing.assert_array_equal(cut.points[[0, -1]], along(6.0).points)
    assert not link.field.blocked_by_cutter(np.vstack([onto, off])).any()


def test_a_thicker_skin_takes_a_wider_arc_and_one_too_thick_takes_none():
    far = []
    for skin in (0.2, 0.7, 1.6):
        link = beside_the_wall(skin)
        assert link.add(along(6.0))
        first = next(t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH and len(t.points) >= 5)
        far.append(round(15.999 - float(first.points[0, 1]), 3))
    assert far == [0.48, 1.0, 2.0]
    link = beside_the_wall(5.0)
    assert link.add(along(6.0))
    assert not [t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH and len(t.points) >= 5]


def test_an_arc_is_gone_once():
    """A second pass from the same place, another way: who runs the same moves in air twice has pasted a program."""
    link = beside_the_wall(0.2)
    assert link.add(along(6.0)) and link.add(Line(np.array([[6.0, 15.999, 6.0], [20.0, 15.998, 6.0]]), False))
    assert link.add(Line(np.array([[9.0, 15.998, 6.0], [24.0, 15.999, 6.0]]), False))
    arcs = [t.points for t in link.trajectories if t.motion in (TrajectoryKind.APPROACH, TrajectoryKind.LIFT)
            and len(t.points) >= 5]
    moves = [tuple(np.round(np.hstack([a, b]), 4)) for arc in arcs for a, b in zip(arc[:-1], arc[1:], strict=True)]
    assert len(arcs) >= 4 and len(set(moves)) == len(moves)


def test_in_a_slot_with_no_room_there_are_no_arcs_and_the_pass_is_walked():
    link = beside_the_wall(0.2, slot=4.3)
    assert link.add(along(6.0))
    assert link.passes == 1
    assert all(len(t.points) < 5 for t in link.trajectories
               if t.motion in (TrajectoryKind.APPROACH, TrajectoryKind.LIFT))


def test_level_after_level_the_tool_goes_down_off_the_wall():
    link = beside_the_wall(0.2)
    for z in (6.0, 5.0, 4.0):
        assert link.add(along(z))
        link.add(Line(along(z - 0.5).points[::-1].copy(), False))
    assert link.passes == 6
    for t in link.trajectories:
        if t.motion is not TrajectoryKind.CUT:
            down = np.flatnonzero(np.abs(np.diff(t.points[:, 2])) > 1e-9)
            assert (t.points[down, 1] < 15.6).all() and (t.points[down + 1, 1] < 15.6).all()


def test_where_the_tool_is_barred_there_is_no_arc_but_the_pass():
    """The far end of the first arc is nearer to the pass than a bar reaches round it, but not on it."""
    link = beside_the_wall(0.2)
    link.add(along(6.0))
    far = next(t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH and len(t.points) >= 5).points[0]
    again = beside_the_wall(0.2, found=Counterexamples(barred={"T1": far[None]}))
    assert again.add(along(6.0)) and again.passes == 1
    reach = max(BARRED * again.field.tool.radius, MIN_BARRED)
    for t in again.trajectories:
        if t.motion is not TrajectoryKind.RAPID and t.points[:, 2].min() < 7.0:
            low = dense(t.points, 0.05)
            low = low[low[:, 2] < 6.2]
            assert not len(low) or np.linalg.norm(low - far, axis=1).min() > reach - 1e-9


@pytest.mark.parametrize("x", [10.0, 12.0, 14.0])
def test_beside_the_end_of_a_wall_an_arc_does_not_curl_round_it(x):
    """A post of stock bars the free side at one end of a pass; on the other side the wall has ended."""
    mesh = joined(box_mesh([0, 0, -2], [30, 30, 0]), box_mesh([0, 18, 0], [x + 1.0, 22, 8]))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 8.0]), 0.1)
    xs = stock.lattice.x0 + stock.lattice.step * np.arange(stock.lattice.nx)
    ys = stock.lattice.y0 + stock.lattice.step * np.arange(stock.lattice.ny)
    post = (np.abs(xs - x - 3.0) < 1.5)[None, :] & (ys < 13.9)[:, None]
    top = np.where(post, 8.0, np.maximum(stock.part, -2.0))
    stock.become(StockMap(stock.lattice, top, top.copy(), stock.part))
    link = Linker(field_of(mesh, tool(4.0, 0.0)), stock, Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 2.0, 0.001),
                  Depths(stock.lattice), walls=True)
    assert link.add(along(6.0, 4.0, x))
    for t in link.trajectories:
        if t.motion in (TrajectoryKind.APPROACH, TrajectoryKind.LIFT) and len(t.points) >= 5:
            assert t.points[:, 1].max() <= 15.999 + 1e-9


def test_a_ring_begins_where_there_is_room_for_an_arc():
    """Round a post a wall stands so close to its first place that no arc fits there."""
    post, wall = box_mesh([13, 13, 0], [17, 17, 6]), box_mesh([19.15, 10, 0], [22, 20, 6])
    mesh = joined(box_mesh([0, 0, -2], [30, 30, 0]), post, wall)
    body = ball(2.0)
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 6.0]), 0.1)
    flat = np.where(stock.part > 0.1, stock.part, -2.0)
    stock.become(StockMap(stock.lattice, flat, flat.copy(), stock.part))
    link = Linker(field_of(mesh, body), stock, Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 2.0, 0.001),
                  Depths(stock.lattice), walls=True)
    c = np.array([[18.003, 15], [18.003, 11.997], [11.997, 11.997], [11.997, 18.003], [18.003, 18.003], [18.003, 15]])
    ring = Line(np.column_stack([c, np.full(6, 3.0)]), True)
    assert link.add(ring)
    cut = next(t for t in link.trajectories if t.motion is TrajectoryKind.CUT).points
    assert (cut[0] == cut[-1]).all() and cut[0, 0] < 18.0
    assert np.isclose(Line(cut, True).length, ring.length)
    assert [t for t in link.trajectories if t.motion is TrajectoryKind.APPROACH and len(t.points) >= 5]


def test_a_ring_that_is_gone_down_along_is_left_where_it_ends():
    """A skin too high for arcs onto it, but at one place between the beginnings: the ramp begins there."""
    mesh = joined(box_mesh([0, 0, -2], [30, 30, 0]), box_mesh([11, 11, 0], [19, 19, 6]))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, 6.0]), 0.1)
    at = stock.lattice.step * np.arange(max(stock.lattice.nx, stock.lattice.ny))
    x, y = np.meshgrid(stock.lattice.x0 + at[:stock.lattice.nx], stock.lattice.y0 + at[:stock.lattice.ny])
    skin = (np.maximum(np.abs(x - 15), np.abs(y - 15)) < 4.2) & ~((x > 17.3) & (y < 13))
    top = np.where(skin, stock.top, -2.0)
    stock.become(StockMap(stock.lattice, top, top.copy(), stock.part))
    link = Linker(field_of(mesh, tool(2.0, 0.0)), stock, Motions(800, 200, 3000, 10000, 14.0, 12.0, RAMP, 1.0, 0.001),
                  Depths(stock.lattice), walls=True)
    side = np.linspace(-5.003, 5.003, 41)
    far = 5.003 + 0.05 * (1.0 - (side / 5.003) ** 2)  # bent: a straight one is two points to the linker
    ring = np.roll(np.vstack([np.column_stack(xy)[1:] for xy in (
        (side, far), (far, -side), (-side, -far), (-far, side))]), 20, axis=0)  # its beginnings are amid its sides
    ring = np.vstack([ring, ring[:1]])
    assert link.add(Line(np.column_stack([ring + 15.0, np.full(len(ring), 3.4)]), True))
    ends = [(a.points[-1], b.points[0]) for a, b in zip(link.trajectories[:-1], link.trajectories[1:], strict=True)]
    assert max(float(np.linalg.norm(a - b)) for a, b in ends) == 0.0
    assert steep(link) and link.trajectories[-1].motion is TrajectoryKind.LIFT


def steep(link):
    """Whether the tool came down along the pass."""
    cut = next(t for t in link.trajectories if t.motion is TrajectoryKind.CUT).points
    return cut[0, 2] > cut[-1, 2] + 1.0


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_a_flank_comes_onto_its_wall_on_an_arc_square_to_itself(lean):
    body = tool(6.0, 1.0)
    mesh = box_mesh([-20, -20, -2], [20, 20, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([-20.0, -20.0, -2.0]), np.array([20.0, 20.0, 0.0]), 0.15)
    axis = np.array([0.0, np.sin(lean), np.cos(lean)])
    away = np.array([0.0, -np.cos(lean), np.sin(lean)])
    tips = np.column_stack([np.linspace(-8.0, 8.0, 33), np.zeros((33, 2))]) + [0.0, 0.0, 1.0]
    axes = np.tile(axis, (33, 1))
    wall = 0.001  # the axis line may not come nearer to the wall than on the pass

    def enters(at, leaning):
        return (at - tips[0]) @ away < -wall

    around = Surroundings(enters, FREE, stock, (), Clearances())
    made = with_ways(Piece(tips, axes, np.tile(away, (33, 1)), 8.0), body, CutData(10_000, 1000.0, 200, 3000, 3.6),
                     PlanSettings(0.01, 0.002, 0.0, 0.0, 20.0, 19.0, RAMP, turning=FREE), around)
    assert not isinstance(made, str)
    arcs = [t for t in made if t.motion is TrajectoryKind.CONNECT]
    assert len(arcs) == 2 and all(len(t.points) >= 5 for t in arcs)
    for arc, end in ((arcs[0].points, tips[0]), (arcs[1].points[::-1], tips[-1])):
        assert np.allclose(arc[-1], end) and np.abs((arc - end) @ axis).max() < 1e-9
        r = SIZES[0] * body.diameter
        np.testing.assert_allclose(np.linalg.norm(arc - (end + r * away), axis=1), r, atol=1e-9)
