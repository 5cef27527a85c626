"""Circle segment mills as shapes of a drop, against the outline of the same mill and against samples of the mesh."""

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import blocked_many, cutter_shape, drop_along, drop_contacts, drop_grid, drop_tips
from geometry.mesh_queries.flat_grid import drop_over_flats
from geometry.mesh_queries.outline_drop import drop_turned
from geometry.mesh_queries.revolved_outline import Outline
from geometry.sampling import sample_surface
from tests.oracle.drop_shapes import SHAPES
from tests.oracle.test_tapered_drop import places
from tests.oracle.test_verify_segments import barrel, heights, lens, outline

MILLS = {"lens": lens(6.0, 20.0, 0.5), "sharp lens": lens(4.0, 3.0, 0.0), "flat lens": lens(10.0, 250.0, 1.0),
         "oval": barrel(6.0, 85.0, 1.0), "stout oval": barrel(6.0, 4.0, 1.5),
         "bull barrel": barrel(8.0, 30.0, 0.5, 0.0, 2.0), "taper barrel": barrel(8.0, 100.0, 1.0, 20.0)}


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_that_of_the_outline(shape, name):
    mesh, tool = SHAPES[shape](), MILLS[name]
    tree, xy, (radius, arcs) = TriangleTree(mesh), places(mesh, 400), (tool.radius, tool.arcs)
    tips = drop_tips(tree, xy, radius, 0.0, side=arcs)
    np.testing.assert_allclose(tips, drop_turned(tree, xy, Outline.two_arcs(arcs)), rtol=0, atol=1e-9)
    stand = np.column_stack([xy, tips])[np.isfinite(tips)]
    assert not blocked_many(tree, stand + [0.0, 0.0, 1e-6], radius, 0.0, arcs).any()
    assert blocked_many(tree, stand - [0.0, 0.0, 1e-6], radius, 0.0, arcs).all()
    low = mesh.bounds[0]
    grid = drop_grid(tree, low[0], low[1], 0.9, 6, 5, radius, 0.0, arcs)
    np.testing.assert_array_equal(grid, drop_over_flats(tree, low[0], low[1], 0.9, 6, 5, radius, 0.0, 1, arcs))


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_never_below_what_samples_force(shape, name):
    mesh, tool = SHAPES[shape](), MILLS[name]
    t = np.linspace(0.0, 1.0, 300)[:, None, None, None]
    edges = (1.0 - t) * mesh.triangles + t * np.roll(mesh.triangles, -1, axis=1)
    cloud = np.concatenate([edges.reshape(-1, 3), sample_surface(mesh, 60.0).points])
    got = drop_contacts(TriangleTree(mesh), places(mesh, 30, seed=1), tool.radius, 0.0, tool.arcs)
    for (x, y), tip, point in zip(places(mesh, 30, seed=1), got.z, got.point, strict=True):
        rho = np.hypot(cloud[:, 0] - x, cloud[:, 1] - y)
        near = rho < tool.radius
        if near.any():
            assert tip >= (cloud[near, 2] - heights(rho[near], tool)).max() - 1e-8
        if np.isfinite(tip):
            assert tip == pytest.approx(point[2] - heights(math.hypot(*(point[:2] - [x, y])), tool)[0], abs=1e-6)


def test_tips_along_a_path():
    mesh = SHAPES["smooth"]()
    tree, t = TriangleTree(mesh), np.linspace(0.0, 20.0, 700)
    for tool in MILLS.values():
        for xy in (np.column_stack([t, 7.0 + 0.3 * t]), np.column_stack([t, 3.0 + 2.0 * np.sin(t)])):
            along = drop_along(tree, xy, tool.radius, 0.0, tool.arcs)
            np.testing.assert_allclose(along, drop_tips(tree, xy, tool.radius, 0.0, side=tool.arcs), atol=1e-12)


@pytest.mark.parametrize("name", MILLS)
def test_grown_arcs_are_the_parallel_outline(name):
    tool = MILLS[name]
    for by in (0.3, -0.1):
        if name != "sharp lens" or by > 0.0:
            grown = tool.arcs.grown(by)
            for sine in np.linspace(0.0, 0.999 * tool.arcs.end_sine, 60).tolist():
                rho, h = tool.arcs.at_sine(sine)
                rho, h = rho + by * sine, h + by * (1.0 - math.sqrt(1.0 - sine * sine))
                if rho < grown.wide - 1e-9 and tool.arcs.low + by > 0.0 and tool.arcs.bow + by > 0.0:
                    assert grown.height(rho) == pytest.approx(h, abs=1e-7)
    wider = tool.arcs.shifted(0.4)
    for rho in np.linspace(0.0, tool.radius, 30).tolist():
        assert wider.height(rho + 0.4) == pytest.approx(tool.arcs.height(rho), abs=1e-9)


def test_shapes_are_kept():
    assert cutter_shape(MILLS["oval"]) is cutter_shape(MILLS["oval"])
    assert cutter_shape(MILLS["oval"]).radius == 3.0


def test_passes_apart_are_the_chord_of_the_outline():
    for name, tool in MILLS.items():
        line = outline(tool, 40_001)
        line = np.concatenate([line[::-1] * [-1.0, 1.0], line])
        for sine in (0.0, 0.05, 0.4, 0.8, 0.95, 0.999):
            for cusp in (0.002, 0.02):
                n, t = np.array([sine, -math.sqrt(1 - sine**2)]), np.array([math.sqrt(1 - sine**2), sine])
                off = (line @ n).max() - line @ n
                along = (line @ t)[off <= cusp]
                got = float(tool.arcs.passes_apart(np.array([sine]), cusp)[0])
                if along.max() < (line[:, 1].max() * t[1] - 1e-3):  # else it ends with the flutes
                    assert got == pytest.approx(np.ptp(along), rel=2e-3, abs=2e-3), (name, sine, cusp)
    big = lens(10.0, 40.0, 1.0)
    assert big.arcs.passes_apart(np.array([0.0, 0.05]), 0.01) == pytest.approx(2 * math.sqrt(2 * 40 * 0.01 - 1e-4))
    oval = barrel(10.0, 85.0, 3.0)
    assert oval.arcs.passes_apart(np.array([0.99]), 0.01)[0] == pytest.approx(2 * math.sqrt(2 * 85 * 0.01 - 1e-4))
