"""Sheets of a part and how far they are from what holds them: places of thin walls against their drawing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from tests.decomposition_shapes import box, to_part
from tests.hand_parts import joined, terraces
from tests.thin_wall_case import FOOT, LEFT, RIGHT, THICK, TOP, wall_part
from verify.surface.slender_walls import HELD, STEP, ThinWalls, thin_walls


def places(mesh: TriangleMesh, ratio: float = 10.0, density: float = 60.0) -> ThinWalls:
    return thin_walls(TriangleTree(mesh), sample_surface(mesh, density, seed=5), ratio)


def turned(mesh: TriangleMesh, angle: float, shift) -> TriangleMesh:
    c, s = math.cos(angle), math.sin(angle)
    return TriangleMesh(mesh.vertices @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + shift, mesh.faces, mesh.face_ids)


def finer(mesh: TriangleMesh) -> TriangleMesh:
    """Every triangle as four."""
    t = mesh.triangles
    a, b, c = (t[:, k] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    v = np.concatenate([np.stack(q, 1) for q in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return TriangleMesh(v.reshape(-1, 3), np.arange(3 * len(v)).reshape(-1, 3), np.tile(mesh.face_ids, 4))


@pytest.mark.parametrize("ratio", [6.0, 10.0, 16.0])
def test_a_wall_is_free_from_its_limit_above_the_foot_on(ratio):
    found = places(wall_part().mesh, ratio)
    border = FOOT + ratio * THICK
    assert np.allclose(found.thickness, THICK) and np.allclose(found.limit, ratio * THICK)
    z = found.points[:, 2]
    assert found.free[z > border + STEP * THICK].all() and not found.free[z < border - STEP * THICK].any()
    assert set(np.round(found.points[:, 0], 9)) == {LEFT, RIGHT} and len(np.unique(found.wall)) == 1
    assert np.allclose(np.abs(found.points[:, 0] - found.across[:, 0]), THICK)
    assert z.min() < FOOT + 2.0 * found.spacing  # places that are held say where stock stands
    assert np.isinf(found.support[found.free]).all()
    held = ~found.free
    past = found.support[held] - (z[held] - FOOT)  # against the way down to the foot, to a step
    assert (np.abs(past) < STEP * THICK + 1e-9).all()


def test_a_wall_that_is_no_higher_than_its_limit_is_left_out():
    high = TOP - FOOT
    assert len(places(wall_part().mesh, high / THICK - 1.0)) > 0
    assert len(places(wall_part().mesh, high / THICK + 2.0 * STEP)) == 0


def test_a_rib_holds_a_wall_on_both_its_sides():
    """The rib is from Y 7 to 9: within ten times the thickness of it nothing is free, however high."""
    found = places(wall_part(rib=True).mesh)
    beside = np.abs(found.points[:, 1] - 8.0) - 1.0
    at_top = found.points[:, 2] > FOOT + 10.0 * THICK + STEP * THICK
    assert found.free[at_top & (beside > 10.0 * THICK + STEP * THICK)].all()
    assert not found.free[beside < 10.0 * THICK - STEP * THICK].any()


def test_a_bar_to_a_stout_wall_holds_a_thin_one():
    pytest.importorskip("cadquery")
    alone = box(13, 16, 2, 0, 0, 0).union(box(0.5, 16, 11, 4, 0, 1)).union(box(4, 16, 11, 9, 0, 1))
    bare, held = (places(to_part(s).mesh) for s in (alone, alone.union(box(5, 2, 2, 4.2, 7, 9))))
    # 0.5 mm thick, so what is within 5 mm of the bar is held: 4.5 counted, for a step of looks
    beside = np.abs(held.points[:, 1] - 8.0) - 1.0 < 4.5
    level = (held.points[:, 2] > 9.2) & (held.points[:, 2] < 10.8)
    assert bare.free.mean() > 0.4 and (beside & level).any() and not held.free[beside & level].any()
    assert held.free[np.abs(held.points[:, 1] - 8.0) > 6.5].any()


def test_thickness_counts_on_the_way_down():
    """0.4 mm at the top and 1.2 at the foot, 8 high: 10 to 1 by its mean, though 20 to 1 by its top."""
    v = np.array([(x, y, z) for y in (0.0, 12.0) for x, z in ((-0.6, 2), (0.6, 2), (0.2, 10), (-0.2, 10))])
    quads = [(0, 1, 2, 3), (7, 6, 5, 4), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0), (0, 4, 5, 1)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    wall = TriangleMesh(v, faces, np.repeat(np.arange(2, 8), 2).astype(np.int32))
    assert wall.volume > 0
    part = joined(terraces([-6, 6], [0, 12], [[2.0]]), wall)
    top = places(part, 9.0)
    assert top.free.any() and top.points[top.free, 2].min() > 9.0
    assert not len(places(part, 11.0)) and places(part, 6.0).free.sum() > 2 * top.free.sum()


def test_edges_of_plates_and_stout_blocks_are_no_sheets():
    assert len(places(terraces([0, 30], [0, 20], [[3.0]]))) == 0
    assert len(places(terraces([0, 4, 6, 12], [0, 20], [[2.0, 14.0, 2.0]]))) == 0  # 12 over 2


def test_walls_beside_each_other_are_two():
    mesh = terraces([0, 4, 4.5, 6, 6.5, 10], [0, 10], [[2, 12, 2, 12, 2]])
    found = places(mesh)
    number = [np.unique(found.wall[found.points[:, 0] < 5.0]), np.unique(found.wall[found.points[:, 0] > 5.0])]
    assert [len(n) for n in number] == [1, 1] and number[0] != number[1]


@pytest.mark.parametrize("angle", [0.3, 1.5, 4.0])
def test_nothing_hangs_on_how_the_part_stands_in_plan_or_is_meshed(angle):
    mesh = wall_part(rib=True).mesh
    for other in (turned(mesh, angle, [30.0, -7.0, 5.0]), finer(mesh)):
        here, there = places(mesh), places(other)
        assert there.free.mean() == pytest.approx(here.free.mean(), abs=0.02)
        assert np.allclose(there.limit, 10.0 * THICK) and HELD == 2.0
