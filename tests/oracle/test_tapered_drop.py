"""Tapered mills as shapes of a drop, against the outline of the same mill, which has a kernel of its own."""

import math

import numpy as np
import pytest

from geometry.kernels.tapered import tapered_of
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import (
    LeaningSide,
    blocked_many,
    cutter_shape,
    drop_along,
    drop_contacts,
    drop_grid,
    drop_tips,
)
from geometry.mesh_queries.flat_grid import drop_over_flats
from geometry.mesh_queries.outline_drop import drop_turned
from geometry.mesh_queries.revolved_outline import Outline
from geometry.sampling import sample_surface
from geometry.tool_body import ToolBody
from tests.oracle.drop_shapes import SHAPES

# radius of the end, corner radius, angle of the side in deg, height of the flutes
MILLS = {"slender ball": (0.5, 0.5, 3.0, 12.0), "stout ball": (0.5, 0.5, 20.0, 2.0), "bull": (2.0, 0.5, 10.0, 5.0),
         "flat": (1.0, 0.0, 5.0, 4.0), "wide flat": (1.0, 0.0, 40.0, 0.5), "short": (0.3, 0.3, 1.0, 1.0),
         "sharp bull": (3.0, 1e-3, 45.0, 3.0), "no side": (0.5, 0.5, 3.0, 0.5 * (1.0 - math.sin(math.radians(3.0))))}


def mill(name):
    radius, corner, angle, high = MILLS[name]
    tool = ToolBody("T1", 1, 2.0 * radius, corner, high, 0.1, high, 0.1, high,
                    taper=math.tan(math.radians(angle)))
    return radius, corner, LeaningSide(tool.taper, tool.widest_radius), tool


def profile(rho, tool):
    """Height of the mill over its tip at a distance from the axis, piece by piece."""
    wide, high = tool.corner_end
    run = np.clip(rho - (tool.radius - tool.corner_radius), 0.0, tool.corner_radius)
    return np.where(rho <= wide, tool.corner_radius - np.sqrt(tool.corner_radius**2 - run**2),
                    high + (rho - wide) / tool.taper)


def places(mesh, count, seed=0):
    low, high = mesh.bounds[:, :2]
    return low - 1.0 + np.random.default_rng(seed).random((count, 2)) * (high - low + 2.0)


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_that_of_the_outline(shape, name):
    mesh, (radius, corner, side, _) = SHAPES[shape](), mill(name)
    tree, xy = TriangleTree(mesh), places(mesh, 400)
    tips = drop_tips(tree, xy, radius, corner, side=side)
    turned = drop_turned(tree, xy, Outline.tapered(radius, corner, *side))
    np.testing.assert_allclose(tips, turned, rtol=0, atol=1e-10)
    stand = np.column_stack([xy, tips])[np.isfinite(tips)]
    assert not blocked_many(tree, stand + [0.0, 0.0, 1e-6], radius, corner, side).any()
    assert blocked_many(tree, stand - [0.0, 0.0, 1e-6], radius, corner, side).all()
    low = mesh.bounds[0]
    grid = drop_grid(tree, low[0], low[1], 0.9, 6, 5, radius, corner, side)
    np.testing.assert_array_equal(grid, drop_over_flats(tree, low[0], low[1], 0.9, 6, 5, radius, corner, 1, side))


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_never_below_what_samples_force(shape, name):
    mesh, (radius, corner, side, tool) = SHAPES[shape](), mill(name)
    t = np.linspace(0.0, 1.0, 300)[:, None, None, None]
    edges = (1.0 - t) * mesh.triangles + t * np.roll(mesh.triangles, -1, axis=1)
    cloud = np.concatenate([edges.reshape(-1, 3), sample_surface(mesh, 60.0).points])
    got = drop_contacts(TriangleTree(mesh), places(mesh, 40, seed=1), radius, corner, side)
    for (x, y), tip, point in zip(places(mesh, 40, seed=1), got.z, got.point, strict=True):
        rho = np.hypot(cloud[:, 0] - x, cloud[:, 1] - y)
        near = rho < tool.widest_radius
        if near.any():
            assert tip >= (cloud[near, 2] - profile(rho[near], tool)).max() - 1e-8
        if np.isfinite(tip):  # the contact is on the mill
            rho = math.hypot(point[0] - x, point[1] - y)
            assert point[2] - tip == pytest.approx(float(profile(min(rho, tool.widest_radius), tool)), abs=1e-7)


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_path_gets_the_tips_of_its_places(shape, name):
    mesh, (radius, corner, side, _) = SHAPES[shape](), mill(name)
    rng = np.random.default_rng(2)
    tree = TriangleTree(mesh)
    path = mesh.bounds[:, :2].mean(axis=0) + np.cumsum(rng.normal(size=(400, 2)) * 0.03, axis=0)
    each = drop_tips(tree, path, radius, corner, side=side)
    np.testing.assert_allclose(drop_along(tree, path, radius, corner, side), each, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", MILLS)
def test_lines_in_the_square_of_the_radius_stay_below_the_mill(name):
    radius, corner, side, tool = mill(name)
    shape = tapered_of(radius, corner, *side)
    rho = np.linspace(0.0, shape.radius, 20001)
    h = profile(rho, tool)
    for k in shape.bend * np.array([1.0, 1.5, 10.0]):
        assert (h[-1] - 0.5 * k * (shape.radius**2 - rho**2) <= h + 1e-9).all()
    if corner > 1e-2:  # a smaller bend would cut off some of it
        k = 0.98 * shape.bend
        assert (h[-1] - 0.5 * k * (shape.radius**2 - rho**2) > h + 1e-9).any()


def test_the_shape_of_a_tool():
    radius, corner, side, tool = mill("slender ball")
    assert cutter_shape(tool) == tapered_of(radius, corner, *side)
    half = math.radians(3.0)
    assert tool.widest_radius == pytest.approx(0.5 / math.cos(half) + (12.0 - 0.5) * math.tan(half))
    assert cutter_shape(tool).radius == tool.widest_radius
