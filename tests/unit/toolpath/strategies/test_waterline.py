"""Levels of waterlines: their steps against the cusp they leave, and their lines against offsets of walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.hand_parts import ball, field_of, slope_field, tool, walls
from tests.plan_checks import dense
from tests.unit.toolpath.strategies.touched_places import CHORD, from_walls, kind, reached, underside
from toolpath.strategies import waterline
from zones.reach.tip_field import LEVEL_TOLERANCE

SIDES = [ball(3.0), tool(3.0, 0.0), tool(3.0, 0.5)]


def leaning(nz, n=1):
    """``n`` unit normals of a wall that leans by nz."""
    return np.tile([math.sqrt(1.0 - nz * nz), 0.0, nz], (n, 1))


def cusp_on_wall(body, nz, dz):
    """The most that levels ``dz`` apart leave on a plane wall, mm along its normal: rays against a stack of tools."""
    nx = math.sqrt(1.0 - nz * nz)
    r, flat = body.corner_radius, body.radius - body.corner_radius
    levels = np.arange(-math.ceil(body.radius / dz) - 2, 3) * dz
    # where the corner circle touches the wall through the origin, tips at these levels
    centre_x = (r - nz * (levels + r)) / nx
    axis = centre_x + flat
    along = np.linspace(0.0, dz / nx, 200)
    left = np.linspace(0.0, 0.2, 4001)
    worst = 0.0
    for s in along:
        x, z = -nz * s + nx * left, nx * s + nz * left
        rise = underside(np.abs(x[:, None] - axis), body)
        inside = (z[:, None] >= levels + rise - 1e-9).any(axis=1)
        worst = max(worst, float(left[np.argmax(inside)]))
        assert inside.any()
    return worst


@pytest.mark.parametrize(("body", "nz"), [(ball(4.0), 0.1), (ball(4.0), 0.5), (ball(2.0), 0.7), (tool(4.0, 0.5), 0.3),
                                          (tool(4.0, 0.0), 0.05), (tool(4.0, 0.0), 0.1), (tool(4.0, 0.02), 0.04)])
def test_levels_leave_the_cusp_asked_for_and_not_much_less(body, nz):
    cusp = 0.012
    step = waterline.level_step(body, leaning(nz, 50), cusp, 9.0)
    left = cusp_on_wall(body, nz, step)
    assert left <= cusp * (1.0 + cusp / max(body.corner_radius, 1.0)) + 1e-4
    assert left >= 0.9 * cusp


def test_level_steps_by_corner_by_flank_and_their_limits():
    r, cusp = 2.0, 0.01
    by_corner = math.sqrt(8 * cusp * r * (1 - 0.36))
    assert waterline.level_step(ball(2 * r), leaning(0.6), cusp, 9.0) == pytest.approx(by_corner)
    assert waterline.level_step(ball(2 * r), leaning(-0.6), cusp, 9.0) == pytest.approx(by_corner)
    assert waterline.level_step(tool(4.0, 0.0), leaning(0.02), cusp, 9.0) == pytest.approx(0.5)
    # an upright wall is left clean by the flank: only the step down limits it
    assert waterline.level_step(ball(2 * r), leaning(0.0), cusp, 1.3) == 1.3
    assert waterline.level_step(tool(4.0, 0.0), leaning(0.9), cusp, 9.0) == waterline.MIN_STEP
    assert waterline.level_step(ball(4.0), np.zeros((0, 3)), cusp, 0.7) == 0.7
    # what a tenth of the area needs is kept, what a fiftieth needs is left to measuring
    flat_part, steep_part = leaning(0.95, 10), leaning(0.1, 90)
    assert waterline.level_step(ball(4.0), np.vstack([flat_part, steep_part]), cusp, 9.0) == pytest.approx(
        math.sqrt(8 * cusp * r * (1 - 0.95**2)))
    assert waterline.level_step(ball(4.0), np.vstack([flat_part[:2], steep_part]), cusp, 9.0) == pytest.approx(
        math.sqrt(8 * cusp * r * 0.99))


@pytest.mark.parametrize(("top", "bottom", "step"),
                         [(5.0, 1.0, 0.3), (5.0, 1.0, 0.5), (2.0, 1.9, 4.0), (3.0, 3.0, 1.0)])
def test_heights_hold_both_ends_and_go_down_by_no_more_than_a_step(top, bottom, step):
    z = waterline.heights(top, bottom, step)
    assert z[0] == top and z[-1] == bottom
    drop = -np.diff(z)
    assert (drop > 0).all() and (drop <= step + 1e-9).all()
    assert len(z) == 1 + math.ceil((top - bottom) / step - 1e-9)  # and no level more than that takes


@pytest.mark.parametrize("seed", range(4))
def test_the_lowest_of_groups_serve_every_height_with_the_fewest_levels(seed):
    rng = np.random.default_rng(seed)
    z, window = rng.choice([rng.uniform(0, 3, 40), np.round(rng.uniform(0, 3, 40), 1)]), 0.25
    levels = waterline.lowest_of_groups(z, window)
    assert (np.diff(levels) < 0).all() and np.isin(levels, z).all()
    above = z[:, None] - levels
    assert ((above >= 0) & (above <= window)).any(axis=1).all()
    # no two of them could be one: heights more than a window apart need a level each
    assert (-np.diff(levels) > window).all()
    assert len(waterline.lowest_of_groups(np.zeros(0), 1.0)) == 0


def on_wall_sides(s):
    return (np.abs(s.normals[:, 2]) < 0.5) & (s.points[:, 2] > 3.0)


@pytest.mark.parametrize("body", SIDES, ids=kind)
def test_waterlines_touch_the_walls_and_have_them_on_the_right(body):
    mesh = walls()
    field = field_of(mesh, body)
    points, tips = reached(field, mesh, on_wall_sides)
    levels = waterline.heights(8.0, 3.5, 1.5)
    got = waterline.waterlines(field, tips, levels, 0.8, CHORD)
    assert len(got) == len(levels)
    for z, lines in zip(levels, got, strict=True):
        p = np.vstack([dense(line.points, 0.03) for line in lines])
        assert np.ptp(p[:, 2]) == 0.0
        assert p[0, 2] == pytest.approx(z - (waterline.SHARP_DIP if body.corner_radius == 0 else 0.0), abs=1e-12)
        assert np.abs(from_walls(p[:, :2]) - body.radius).max() <= CHORD + 1e-3 * field.lattice.step
        # every sample the level serves has the line over its tip
        served = np.abs(tips[:, 2] - z) <= 0.8
        assert served.sum() > 50
        assert cKDTree(p[:, :2]).query(tips[served, :2])[0].max() <= 0.03 + CHORD + 0.003
        for line in lines:
            move = np.diff(line.points[:, :2], axis=0)
            run = np.linalg.norm(move, axis=1)
            right = np.column_stack([move[:, 1], -move[:, 0]]) / np.maximum(run, 1e-12)[:, None]
            at = line.points[:-1, :2] + 0.5 * move
            assert (from_walls(at + 0.05 * right) < body.radius - 0.02)[run > 0.01].all()
            assert (from_walls(at - 0.05 * right) > body.radius + 0.02)[run > 0.01].all()


def test_waterlines_keep_to_the_area_and_leave_levels_without_samples_empty():
    mesh, body = walls(), ball(3.0)
    field = field_of(mesh, body)
    _, tips = reached(field, mesh, lambda s: on_wall_sides(s) & (s.points[:, 0] < 5.001) & (s.points[:, 2] > 7.0))
    got = waterline.waterlines(field, tips, np.array([8.0, 6.0, 3.5]), 0.5, CHORD)
    assert got[2] == [] and len(got[0]) == len(got[1]) == 1
    for (line,) in got[:2]:
        assert not line.closed and line.points[:, 0].max() < 6.0
        assert line.points[:, 1].min() < 2.0 and line.points[:, 1].max() > 12.0


@pytest.mark.parametrize("body", [ball(3.0), tool(3.0, 0.5)], ids=kind)
def test_waterlines_lie_on_the_offset_of_a_leaning_wall(body):
    mesh = slope_field(lambda x, y: 2.0 * x, size=6.0, n=4, base=-9.0)
    field = field_of(mesh, body)
    normal = np.array([-2.0, 0.0, 1.0]) / math.sqrt(5.0)
    _, tips = reached(field, mesh, lambda s: (s.face == 2) & (np.abs(s.points[:, 1]) < 2.0)
                      & (np.abs(s.points[:, 0]) < 1.0))
    levels = waterline.heights(float(tips[:, 2].max()), float(tips[:, 2].min()), 0.7)
    for (line,) in waterline.waterlines(field, tips, levels, 0.7, CHORD):
        p = dense(line.points, 0.05)
        p = p[np.abs(p[:, 1]) < 2.0]
        assert len(p) > 50
        # the nearest point of the corner torus: from its axis towards the wall
        at = p + [0.0, 0.0, body.corner_radius]
        at[:, 0] += body.radius - body.corner_radius
        assert np.abs(at @ normal - body.corner_radius).max() <= CHORD + 1e-3 * field.lattice.step + LEVEL_TOLERANCE
