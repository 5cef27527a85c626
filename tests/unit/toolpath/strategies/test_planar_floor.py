"""Passes over level planes: heights, what they cover, and rings over the middle of pockets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh_queries.drop import drop_tips
from tests.hand_parts import corner, field_of, terraces, tool, walls
from tests.plan_checks import dense
from tests.unit.toolpath.strategies.touched_places import CHORD, reached
from toolpath.strategies import planar_floor


def test_plane_heights_are_grouped_and_go_down():
    z = np.array([3.0, 3.0002, 1.0, 2.9999, 1.0004, 5.0])
    got = planar_floor.plane_heights(np.column_stack([np.zeros((6, 2)), z]))
    assert got == pytest.approx([5.0, 3.0, 1.0002])
    assert planar_floor.plane_heights(np.zeros((0, 3))) == []


@pytest.mark.parametrize("body", [tool(4.0, 0.0), tool(4.0, 0.5), tool(6.0, 0.0)],
                         ids=lambda b: f"{b.kind}{b.diameter}")
@pytest.mark.parametrize("shape", [walls, corner], ids=lambda s: s.__name__)
def test_planes_cover_a_level_area_but_for_islands_in_sharp_turns(shape, body):
    mesh = shape()
    field = field_of(mesh, body)
    points, tips = reached(field, mesh, lambda s: s.normals[:, 2] > 1 - 1e-6, 25.0)
    groups = planar_floor.planes(field, tips, CHORD)
    heights = planar_floor.plane_heights(tips)
    assert len(groups) == len(heights) == 2  # the plate and the tops of the walls
    flat = body.radius - body.corner_radius
    for z, lines in zip(heights, groups, strict=True):
        p = np.vstack([dense(line.points, 0.04) for line in lines])
        assert np.abs(p[:, 2] - z).max() < 1e-9
        limit = drop_tips(field.tree, p[:, :2], body.radius - CHORD, max(body.corner_radius - CHORD, 0.0))
        assert (limit <= z + CHORD).all()
        mine = points[np.abs(tips[:, 2] - z) < 1e-3]
        away = cKDTree(p[:, :2]).query(mine[:, :2])[0]
        # within the flat of some pass nothing is left; chord and lift are what a line may be off the wall.
        # Rings that turn sharply leave small islands, which the plan finds by measuring
        assert len(mine) > 200 and (away <= flat + CHORD + 0.003).mean() > 0.95
        assert away.max() <= 1.5 * flat


@pytest.mark.parametrize("wide", [8.5, 9.0, 9.5, 10.0, 10.8, 12.0, 14.5])
@pytest.mark.parametrize("place", [0.0, 0.35])
def test_rings_over_a_pocket_of_any_width_cover_its_middle(wide, place):
    mesh = terraces([0, 4, 4 + wide, 8 + wide], [0, 4, 28, 32], [[8, 8, 8], [8, 2, 8], [8, 8, 8]])
    field = field_of(mesh, tool(4.0, 0.0))
    x, y = np.meshgrid(np.arange(6.0, 2.0 + wide + 1e-9, 0.25), np.arange(6.0, 26.01, 0.25))
    tips = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    [lines] = planar_floor.planes(field, tips, CHORD, 0, np.full(len(tips), place))
    way = np.vstack([dense(line.points, 0.1)[:, :2] for line in lines])
    middle = tips[np.abs(tips[:, 1] - 16.0) < 4.0, :2]  # in the corners finer rounds take what rings leave
    assert cKDTree(way).query(middle)[0].max() <= field.tool.radius - place
    assert sum(line.length for line in lines) < 1.7 * wide * 24.0 / field.tool.radius  # and not many times over


def test_places_that_stand_for_wide_squares_get_rings_and_no_line_each():
    mesh = terraces([0, 40], [0, 30], [[2]])
    field = field_of(mesh, tool(4.0, 0.0))
    x, y = np.meshgrid(np.arange(10.0, 30.0, 0.5), np.arange(14.0, 16.6, 0.5))
    tips = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    for finer in (1, 2):
        [lines] = planar_floor.planes(field, tips, CHORD, finer, np.full(len(tips), 0.354))
        assert 1 <= len(lines) <= 4
        way = np.vstack([dense(line.points, 0.1)[:, :2] for line in lines])
        assert cKDTree(way).query(tips[:, :2])[0].max() <= field.tool.radius - 0.354
