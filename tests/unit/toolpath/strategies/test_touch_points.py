"""Single touches of places without a pass, and those that become one pass."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import SURFACES, ball, field_of, terraces, tool
from tests.plan_checks import dense
from tests.unit.toolpath.strategies.touched_places import reached
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import touch_points
from toolpath.strategies.zigzag import skimmed
from zones.reach.tip_field import LEVEL_TOLERANCE


def upward(tips):
    return np.tile([0.0, 0.0, 1.0], (len(tips), 1))


@pytest.mark.parametrize("name", SURFACES)
def test_every_place_is_on_a_line_or_has_a_touch_of_its_own(name):
    mesh, body = SURFACES[name](), ball(3.0)
    field = field_of(mesh, body)
    _, tips = reached(field, mesh, lambda s: s.normals[:, 2] > -0.01, 0.6)
    tips = tips[:300]
    got = touch_points.touches(field, tips, upward(tips))
    single = [line for line in got if line.length == pytest.approx(touch_points.SHORT) and len(line.points) == 2]
    passes = [line for line in got if not any(line is one for one in single)]
    ends = np.vstack([line.points[-1:] if any(line is one for one in single) else line.points for line in got])
    assert cKDTree(ends).query(tips)[0].max() <= math.sqrt(3.0) * touch_points.APART
    assert np.isclose(cKDTree(tips).query(ends)[0], 0.0).all()  # nowhere else
    assert len(ends) == len({tuple(t) for t in np.round(tips / touch_points.APART).astype(int).tolist()})
    assert not field.blocked_by_cutter(ends + [0.0, 0.0, 2 * LEVEL_TOLERANCE]).any()
    between = np.vstack([dense(line.points, 0.02) for line in got])
    assert not field.blocked_by_cutter(between + [0.0, 0.0, 0.002]).any()
    assert all(np.ptp(line.points[:, 2]) < 1e-12 for line in single)
    for line in passes:
        way = np.diff(line.points, axis=0)
        assert (np.abs(way[:, 2]) <= touch_points.GRADE * np.hypot(way[:, 0], way[:, 1]) + 1e-12).all()
        assert (np.linalg.norm(way, axis=1) <= touch_points.BESIDE).all()


def test_no_pass_through_places_needs_layers_above_it():
    """Places of a wall lie at any height: passes that followed them down 4 degrees were cut in 30 raised copies."""
    mesh, body = terraces([0, 4, 11.5, 16], [0, 20], [[8, 2, 8]]), tool(6.0, 0.0)
    field, rng = field_of(mesh, body), np.random.default_rng(6)
    tips = np.column_stack([np.full(400, 7.0), rng.uniform(3.0, 17.0, 400), rng.uniform(4.0, 4.6, 400)])
    got = touch_points.touches(field, tips, np.tile([1.0, 0.0, 0.0], (400, 1)))
    assert max(np.ptp(line.points[:, 2]) for line in got) > 0.02
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0.0, 0.0]), np.array([16.0, 20.0, 8.0]), 0.15)
    assert all(skimmed(line, stock, body, 0.6, 0.047, True) == [line] for line in got)


def test_touches_are_few_and_leave_out_what_has_no_free_direction():
    mesh = terraces([0, 4, 7.02, 11], [0, 4, 7.02, 11], [[8, 8, 8], [8, 2, 8], [8, 8, 8]])
    field = field_of(mesh, ball(3.0))
    pit, top = np.array([[5.51, 5.51, 3.0]]), np.array([[2.0, 2.0, 8.0]])
    assert not field.blocked_by_cutter(pit).any()
    both = np.vstack([pit, top])
    got = touch_points.touches(field, both, upward(both))
    assert len(got) == 1 and got[0].points[-1].tolist() == top[0].tolist()
    assert len(touch_points.touches(field_of(mesh, ball(2.0)), pit, upward(pit))) == 1
    many = np.column_stack([np.linspace(0, 99, 600), np.full(600, 5.0), np.full(600, 9.0)])
    assert sum(len(q.points) for q in touch_points.touches(field, many, upward(many))) == \
        touch_points.MAX_PLACES


def test_places_along_the_walls_of_a_slot_as_wide_as_the_tool_become_one_pass_a_wall_in_climb_order():
    mesh = terraces([0, 4, 7.01, 11], [0, 20], [[8, 2, 8]])
    field = field_of(mesh, tool(3.0, 0.0))
    rng = np.random.default_rng(4)
    x = {side: np.linspace(2.0, 18.0, 120) + rng.uniform(-0.06, 0.06, 120) for side in (-1, 1)}
    tips = np.vstack([np.column_stack([np.full(120, 5.505 + 0.004 * side), x[side], np.full(120, 6.0)])
                      for side in (-1, 1)])
    normals = np.repeat([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], 120, axis=0)  # of the wall at x = 4, then at x = 7.01
    mixed = rng.permutation(240)
    got = touch_points.touches(field, tips[mixed], normals[mixed])
    assert len(got) == 2
    for line in got:
        wall = np.sign(line.points[0, 0] - 5.505)
        assert (np.sign(line.points[:, 0] - 5.505) == wall).all()
        way = np.diff(line.points[:, 1])
        assert (way * wall > 0.0).all()  # the wall is on the right: at x = 4 the tool goes down, at x = 7.01 up
        assert abs(line.points[-1, 1] - line.points[0, 1]) > 15.0


def test_places_on_both_sides_of_a_wall_are_not_joined_through_it():
    mesh = terraces([0, 4, 4.2, 8], [0, 20], [[2, 8, 2]])
    field = field_of(mesh, ball(0.1))
    y = np.linspace(2.0, 4.0, 11)
    tips = np.vstack([np.column_stack([np.full(11, at), y, np.full(11, 3.0)]) for at in (3.94, 4.26)])
    got = touch_points.touches(field, tips, upward(tips))
    assert sorted(round(float(line.points[0, 0]), 2) for line in got) == [3.94, 4.26]
    assert all(np.ptp(line.points[:, 0]) == 0.0 and len(line.points) == 11 for line in got)
