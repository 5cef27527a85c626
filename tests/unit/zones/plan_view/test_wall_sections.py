"""Sections of walls: two sides or two rings, the void on the left, caps left out, interruptions bridged."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.part import Part
from tests.decomposition_shapes import SHAPES, box, pair, plate, ring, to_part
from zones.features.decomposition import decompose
from zones.model import Decomposition, Wall
from zones.plan_view.mesh_slices import Slicer
from zones.plan_view.wall_sections import SideCurve, _Section, wall_sections

pytest.importorskip("cadquery")


def _prism(points, at=(0.0, 5.0)):
    """A wall of this outline in plan on a plate, with a plain wall beside it."""
    import cadquery as cq

    wall = cq.Workplane().polyline(points).close().extrude(14).translate((*at, 3))
    return plate(80, 60).union(wall).union(box(50, 2, 14, 0, 30, 3))


def _slot():
    import cadquery as cq

    return plate(80, 60).union(cq.Workplane().slot2D(50, 2).extrude(14).translate((25, 5, 3))).union(
        box(50, 2, 14, 0, 30, 3))


def _lens():
    import cadquery as cq

    wall = cq.Workplane().moveTo(0, 0).threePointArc((25, 3), (50, 0)).threePointArc((25, -1), (0, 0)).close()
    return plate(80, 60).union(wall.extrude(14).translate((0, 5, 3))).union(box(50, 2, 14, 0, 30, 3))


def _bored():
    """A wall 6 mm thick with two upright holes in it."""
    import cadquery as cq

    wall = box(50, 6, 22, 0, -10, 3).cut(cq.Workplane().pushPoints([(12, -7), (38, -7)]).circle(2).extrude(40))
    return plate().union(wall).union(box(50, 2, 14, 0, 10, 3))


def _bent_window():
    """A wall round half a circle of 8 mm with a window in its bend, so wide that its ends do not lie in line."""
    import cadquery as cq

    wall = cq.Workplane().circle(8.8).circle(7.2).extrude(14).intersect(cq.Workplane().rect(40, 20).extrude(14)
                                                                        .translate((0, 11, 0)))
    wall = wall.cut(cq.Workplane().box(12, 12, 2.8).translate((0, 8, 7)))
    return plate(80, 60).union(wall.translate((25, 5, 3))).union(box(50, 2, 14, 0, 30, 3))


def _hook():
    """A wall 2 mm thick with a bend near its end: 1 mm of radius inside, 3 mm outside, then 2 mm straight."""
    import cadquery as cq

    outer, inner = ((30 + r * np.sqrt(0.5), 3 - r * np.sqrt(0.5)) for r in (3.0, 1.0))
    wall = cq.Workplane().moveTo(0, 0).lineTo(30, 0).threePointArc(outer, (33, 3)).lineTo(33, 5).lineTo(31, 5)
    wall = wall.lineTo(31, 3).threePointArc(inner, (30, 2)).lineTo(0, 2).close()
    return plate(80, 60).union(wall.extrude(14).translate((0, 5, 3))).union(box(50, 2, 14, 0, 30, 3))


def _held_ring():
    """A ring 1 mm thick held at mid height by a bar from within and one from without, both in its bends.

    The bars are so wide that the ends they leave of either side of the ring do not lie in line.
    """
    import cadquery as cq

    def tube(radius: float, thick: float):
        round_wall = cq.Workplane().circle(radius + 0.5 * thick).circle(radius - 0.5 * thick)
        return round_wall.extrude(14).translate((25, 0, 3))

    part = plate(80, 60).union(tube(5, 1)).union(tube(2.6, 0.8)).union(box(50, 2, 14, 0, 12, 3))
    return part.union(box(2.3, 5, 2, 27.3, -2.5, 9)).union(box(7.6, 8, 2, 21.2, 4.4, 9).cut(
        cq.Workplane().circle(4.5).extrude(20).translate((25, 0, 0))))


OWN = {
    "held ring": _held_ring,
    "window in a bend": _bent_window,
    "slot": _slot,
    "lens": _lens,
    "pointed": lambda: _prism([(0, 0), (1, 1), (49, 1), (50, 0), (49, -1), (1, -1)]),
    "slanted ends": lambda: _prism([(0, 0), (50, 0), (47, 2), (3, 2)]),
    "L": lambda: _prism([(0, 0), (40, 0), (40, 15), (38, 15), (38, 2), (0, 2)]),
    "oblique ends": lambda: _prism([(0, 0), (50, 0), (51.6, 2), (1.6, 2)]),
    "wedge": lambda: _prism([(0, -1), (50, 0), (0, 1)]),
    "slit ring": lambda: ring().cut(box(30, 3, 20, 0, -1.5, 4)),
    "bored wall": _bored,
    "slab at mid height": lambda: pair().union(box(45, 9, 2, 2, -9, 9.5)),
}


@cache
def made(name: str) -> tuple[Part, Decomposition]:
    part = to_part(OWN[name]() if name in OWN else SHAPES[name][0]())
    return part, decompose(part)


def curves(name: str, wall: str = "W1") -> list[SideCurve]:
    return [c for c in wall_sections(*made(name)) if c.wall == wall]


def length(c: SideCurve) -> float:
    p = np.vstack([c.points, c.points[:1]]) if c.closed else c.points
    return float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())


def bridges(name: str, wall: str) -> list[int]:
    """How many bridges each side has, which may be of several segments."""
    starts = [(c.face == 0) & (np.roll(c.face, 1) != 0) for c in curves(name, wall)]
    return sorted(int(s.sum()) for s in starts)


EVERYDAY = ("T", "cross", "tray with a rib", "ring with a strut", "wall with a window", "bar through a wall",
            "walls flush with the plate ends", "walls flush with the plate sides", "web on the floor",
            "fillets at a bar", "wavy walls", "wavy walls in strips", "fork", "two walls", "tray", "square bar", *OWN)
REST = [pytest.param(n, marks=pytest.mark.slow) for n in SHAPES if SHAPES[n][1][0] and n not in EVERYDAY]


@pytest.mark.parametrize("name", [*EVERYDAY, *REST])
def test_every_wall_has_two_sides_with_the_void_on_the_left(name: str) -> None:
    part, found = made(name)
    sections = wall_sections(part, found)
    for wall in found.walls:
        own = [c for c in sections if c.wall == wall.id]
        assert len(own) == 2 and own[0].closed == own[1].closed
        for c in own:
            assert len(c.face) == len(c.points)
            assert set(c.face.tolist()) <= {f.number for f in part.faces} | {0}
            cut = Slicer(part.mesh).cut(c.z)
            p, q = c.points[:-1][c.face[:-1] > 0], c.points[1:][c.face[:-1] > 0]
            left = np.column_stack([-(q - p)[:, 1], (q - p)[:, 0]]) / np.linalg.norm(q - p, axis=1)[:, None]
            for at, normal in zip(0.5 * (p + q), left, strict=True):
                assert not cut.holds(at + 1e-3 * normal) and cut.holds(at - 1e-3 * normal)


@pytest.mark.parametrize(("name", "wall", "expected"), [
    ("two walls", "W1", (50, 50)), ("slot", "W1", (48, 48)), ("pointed", "W1", (48, 48)),
    ("slanted ends", "W1", (50, 44)), ("L", "W1", (51, 55)),
    ("oblique ends", "W1", (50, 50)), ("T", "W1", (14, 14)), ("T", "W2", (50, 50)),
    ("cross", "W1", (50, 50)), ("cross", "W2", (50, 50)), ("wall with a window", "W2", (50, 50)),
    ("walls flush with the plate ends", "W1", (50, 50)), ("walls flush with the plate sides", "W1", (50, 50)),
    ("tray", "W1", (160, 144)), ("tray with a rib", "W2", (26, 26)), ("web on the floor", "W1", (8, 8)),
    ("fillets at a bar", "W1", (50, 50)), ("bored wall", "W1", (50, 50)),
    ("bar through a wall", "W3", (50, 50)), ("wedge", "W1", (50.01, 50.01)),
])
def test_lengths_are_those_of_the_sides_without_their_ends(name, wall, expected) -> None:
    assert sorted(length(c) for c in curves(name, wall)) == pytest.approx(sorted(expected), abs=0.02)


@pytest.mark.parametrize(("name", "wall", "expected"), [
    ("square bar", "W1", [0, 1]), ("cross", "W1", [1, 1]), ("T", "W2", [0, 1]), ("wall with a window", "W2", [1, 1]),
    ("bar through a wall", "W3", [1, 1]), ("ring with a strut", "W1", [0, 2]), ("two walls", "W1", [0, 0]),
])
def test_interruptions_become_one_bridge_each(name, wall, expected) -> None:
    assert bridges(name, wall) == expected


def test_rings_are_closed_and_a_slit_opens_them() -> None:
    inner, outer = sorted(curves("ring with a strut"), key=length)
    assert inner.closed and outer.closed
    assert length(outer) == pytest.approx(2 * np.pi * 20, rel=1e-3)
    assert length(inner) == pytest.approx(2 * np.pi * 18, rel=1e-3)
    assert not np.allclose(outer.points[0], outer.points[-1])
    assert not any(c.closed for c in curves("slit ring"))


def test_a_bridge_in_a_ring_goes_round_with_it() -> None:
    for c, radius in zip(sorted(curves("ring with a strut"), key=length), (18, 20), strict=True):
        middle = 0.5 * (c.points + np.roll(c.points, -1, axis=0))
        assert np.abs(np.hypot(*middle.T) - radius).max() < 0.025


def test_a_side_in_parts_is_cut_at_another_height() -> None:
    found = curves("window in a bend")
    assert len(found) == 2 and all((c.face > 0).all() for c in found)
    assert sorted(length(c) for c in found) == pytest.approx(sorted([r * np.pi for r in (7.2, 8.8)]), rel=0.1)
    assert len({c.z for c in found}) == 1 and not 8.6 < found[0].z < 11.4
    part, decomposition = made("window in a bend")
    assert len([c for c in wall_sections(part, decomposition, height=10.0) if c.wall == "W1"]) > 2


def test_a_ring_torn_open_in_its_bends_is_cut_at_another_height() -> None:
    found = sorted(curves("held ring"), key=length)
    assert [c.closed for c in found] == [True, True]
    assert [length(c) for c in found] == pytest.approx([9 * np.pi, 11 * np.pi], rel=2e-3)
    part, decomposition = made("held ring")
    middle = [c for c in wall_sections(part, decomposition, height=10.0) if c.wall == "W1"]
    assert [c.closed for c in middle] == [False, False]


def test_a_tight_bend_at_the_end_of_a_wall_is_no_rounding_of_its_end() -> None:
    part = to_part(_hook(), chord=0.004)
    found = [c for c in wall_sections(part, decompose(part)) if c.wall == "W1"]
    expected = [30 + r * np.pi / 2 + 2 for r in (1.0, 3.0)]
    assert sorted(length(c) for c in found) == pytest.approx(expected, abs=0.02)


def test_sides_end_where_lips_do() -> None:
    """A wall of one face all round whose sides run on as thin lips, one longer than the other, over a hollow end."""
    hollow = [(50, 0.05), (48.9, 0.08), (48.9, 0.6), (48.3, 0.6), (48.3, 1.12), (50, 1.15)]
    outline = np.array([(0, 0), (50, 0), *hollow, (50, 1.2), (0, 1.2)])
    n = len(outline)
    v = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 10.0)])
    f = np.array([t for i in range(n) for j in [(i + 1) % n] for t in ((i, j, n + j), (i, n + j, n + i))])
    mesh = TriangleMesh(v, f.astype(np.int32), np.ones(len(f), np.int32))
    wall = Wall("W1", (1,), (1,), 1.2, 0.0, 10.0)
    sides = _Section(Slicer(mesh), np.array([-1, 0]), 0, wall, 5.0).sides()[0]
    assert [length(c) for c in sides] == pytest.approx([50, 50])
    assert all(np.ptp(c.points[:, 1]) < 1e-9 for c in sides)


def test_wavy_sides_keep_their_length_and_strips_change_nothing() -> None:
    x = np.linspace(0, 50, 2001)
    true = np.linalg.norm(np.diff(np.column_stack([x, 2 * np.sin(x * 12 / 96)]), axis=0), axis=1).sum()
    for name in ("wavy walls", "wavy walls in strips"):
        for wall in ("W1", "W2"):
            assert [length(c) for c in curves(name, wall)] == pytest.approx([true, true], rel=2e-3)


def test_a_height_nearby_is_taken_where_a_slab_hides_the_middle() -> None:
    part, found = made("slab at mid height")
    for c in wall_sections(part, found):
        assert not 9.5 <= c.z <= 11.5 and (c.face > 0).all()
    asked = wall_sections(part, found, height=10.0)
    assert {c.z for c in asked} == {10.0}


def test_the_same_part_gives_the_same_curves() -> None:
    part, found = made("fork")
    for a, b in zip(wall_sections(part, found), wall_sections(part, found), strict=True):
        assert np.array_equal(a.points, b.points) and np.array_equal(a.face, b.face)


def test_cutting_through_vertices_links_every_segment() -> None:
    """A cube with a vertex at its middle height: the plane runs through vertices and edges."""
    ring4 = [(0, 0), (4, 0), (4, 4), (0, 4)]
    v = np.array([(x, y, z) for z in (0, 1, 2) for x, y in ring4], float)
    f = [t for k in (0, 4) for i in range(4) for t in (
        (k + i, k + (i + 1) % 4, k + 4 + i), (k + (i + 1) % 4, k + 4 + (i + 1) % 4, k + 4 + i))]
    f += [(0, 2, 1), (0, 3, 2), (8, 9, 10), (8, 10, 11)]
    cut = Slicer(TriangleMesh(v, np.array(f))).cut(1.0)
    walk = cut.loops
    assert len(walk) == 1 and (cut.following >= 0).all()
    area = 0.5 * (cut.start[:, 0] * cut.end[:, 1] - cut.start[:, 1] * cut.end[:, 0]).sum()
    assert area == pytest.approx(-16.0) and cut.holds(np.array([2.0, 2.0])) and not cut.holds(np.array([5.0, 2.0]))


def test_a_cut_keeps_clear_of_rows_of_nodes() -> None:
    # three rows of nodes, those of the middle one off by rounding: the plane must not run to and fro between them
    rng = np.random.default_rng(1)
    x = np.linspace(0, 10, 21)
    rows = [np.column_stack([x, 0 * x, z + noise]) for z, noise in ((0.0, 0 * x), (5.0, rng.normal(0, 1e-13, 21)),
                                                                  (10.0, 0 * x))]
    quads = [(r * 21 + i, r * 21 + i + 1, (r + 1) * 21 + i + 1, (r + 1) * 21 + i) for r in (0, 1) for i in range(20)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    slicer = Slicer(TriangleMesh(np.concatenate(rows), faces, np.ones(len(faces), np.int32)))
    z = slicer.clear_of_nodes(5.0, 0.1)
    assert abs(z - 5.0) == pytest.approx(0.05, abs=1e-6)
    assert slicer.clear_of_nodes(3.0, 0.1) == pytest.approx(3.0)
    cut = slicer.cut(z)
    assert (np.linalg.norm(cut.end - cut.start, axis=1) > 1e-3).all()
