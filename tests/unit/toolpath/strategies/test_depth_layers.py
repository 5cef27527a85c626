"""Layers of roughing: heights, what they leave, rings, islands and rims."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from tests.hand_parts import ball, corner, field_of, slope_field, tool, walls
from tests.plan_checks import dense
from tests.unit.toolpath.strategies.touched_places import CHORD, from_walls, kind
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import depth_layers
from zones.reach.tip_field import LEVEL_TOLERANCE


@pytest.mark.parametrize(("top", "bottom", "step"), [(10.0, 3.2, 1.0), (5.0, 4.9, 1.0), (4.0, 3.0, 0.3)])
def test_layers_are_even_end_at_the_bottom_and_are_no_deeper_than_a_step(top, bottom, step):
    z = depth_layers.layer_heights(top, bottom, step)
    drop = -np.diff([top, *z])
    assert z[-1] == bottom and len(z) == math.ceil((top - bottom) / step - 1e-9)
    assert drop.max() <= step + 1e-9 and np.ptp(drop) < 1e-9


def clear(field, z, allowance):
    """Nodes of the lattice that the cutter covers from a place free at z and ``allowance`` mm off its boundary."""
    lat = field.lattice
    far = distance_transform_edt(field.height <= z + LEVEL_TOLERANCE) * lat.step
    i, j = np.nonzero(far >= allowance)
    ok = cKDTree(np.column_stack([lat.x0 + lat.step * j, lat.y0 + lat.step * i]))
    x, y = np.meshgrid(lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny))
    away = ok.query(np.column_stack([x.ravel(), y.ravel()]))[0].reshape(x.shape)
    return away <= field.tool.radius - 1.5 * lat.step, x, y


def rough(shape, body, z, allowance, near_net, above=0.8):
    """Field, stock and area of a part, stock that stood ``above`` z cut by all lines of one layer there."""
    mesh = shape()
    field = field_of(mesh, body)
    if near_net:
        stock = StockMap.around(field.tree, mesh.bounds, 1.0, 0.1)
    else:
        stock = StockMap.box(field.tree, mesh.bounds[0] - 1.0, mesh.bounds[1] + 1.0, 0.1)
    stock.top[:] = np.minimum(stock.top, z + above)
    area = np.zeros((field.lattice.ny, field.lattice.nx), bool)
    lat = field.lattice
    (x0, y0), (x1, y1) = mesh.bounds[:, :2]
    lo, hi = lat.cells(np.array([[x0, y0], [x1, y1]]))
    area[lo[0]:lo[1] + 1, hi[0]:hi[1] + 1] = True
    groups = list(depth_layers.layer(field, stock, z, depth_layers.LayerArea(area), allowance, 0.8 * body.radius))
    for lines in groups:
        for line in lines:
            stock.cut(line.points, body)
    return field, stock, area, groups


@pytest.mark.parametrize("near_net", [True, False], ids=["near net", "block"])
@pytest.mark.parametrize("shape", [walls, corner], ids=lambda s: s.__name__)
def test_a_layer_leaves_no_stock_above_it_but_the_allowance(shape, near_net):
    body, allowance, z = tool(3.0, 0.0), 0.3, 4.0
    field, stock, area, groups = rough(shape, body, z, allowance, near_net)
    assert groups
    must, x, y = clear(field, z, allowance + 1.5 * field.lattice.step)
    at = stock.lattice.cells(np.column_stack([x[must & area], y[must & area]]))
    assert must[area].mean() > 0.5
    assert (stock.top[at] > z + depth_layers.STOCK_WORTH).mean() <= 0.002
    # and no line comes nearer to a wall than the allowance, to a step of the lattice
    p = np.vstack([dense(line.points, 0.1) for lines in groups for line in lines])
    p = p[(drop_tips(field.tree, p[:, :2], body.radius + allowance - 1.5 * field.lattice.step, 0.0) > z + 1e-6)]
    assert len(p) == 0


def test_a_layer_comes_from_the_side_away_from_the_walls():
    body, z = tool(3.0, 0.0), 4.0
    field, _, _, groups = rough(walls, body, z, 0.3, False)
    off = [np.median(np.concatenate([from_walls(line.points[:, :2]) for line in lines])) for lines in groups]
    first_sweep = off[:int(np.argmin(off)) + 1]
    assert len(first_sweep) > 2 and (np.diff(first_sweep) < 0).all()
    # a second time over cut stock there is nothing to do
    _, stock, area, _ = rough(walls, body, z, 0.3, False)
    again = list(depth_layers.layer(field, stock, z, depth_layers.LayerArea(area), 0.3, 1.2))
    assert sum(q.length for lines in again for q in lines) < 0.02 * sum(q.length for lines in groups for q in lines)


def test_a_ring_is_left_out_where_the_next_one_to_the_wall_takes_its_stock():
    # a strip of stock 1 mm wide along the walls: the ring nearest to them is wide enough for it
    body, z, allowance = tool(3.0, 0.0), 4.0, 0.3
    mesh = walls()
    field = field_of(mesh, body)
    stock = StockMap.box(field.tree, mesh.bounds[0] - 1.0, mesh.bounds[1] + 1.0, 0.1)
    lat = stock.lattice
    x, y = np.meshgrid(lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny))
    off = from_walls(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    stock.top[:] = np.where((off > 0.0) & (off < 1.3), z + 0.8, z)
    before, area = stock.top.copy(), np.ones((field.lattice.ny, field.lattice.nx), bool)
    groups = depth_layers.layer(field, stock, z, depth_layers.LayerArea(area), allowance, 0.8 * body.radius)
    first = next(groups)
    assert (stock.top == before).all()  # rings are tried on the stock
    assert all(np.abs(from_walls(dense(r.points, 0.1)[:, :2]) - body.radius - allowance).max() < 0.1 for r in first)
    for line in first:
        stock.cut(line.points, body)
    assert list(groups) == []


def test_islands_stay_only_where_neither_shank_nor_holder_comes():
    body, z, allowance = tool(1.0, 0.0), 4.0, 0.3
    mesh = walls()
    field = field_of(mesh, body)
    stock = StockMap.box(field.tree, mesh.bounds[0] - 1.0, mesh.bounds[1] + 1.0, 0.1)
    stock.top[:] = np.minimum(stock.top, z + 0.8)
    lat = field.lattice
    area = np.ones((lat.ny, lat.nx), bool)
    bare = np.tile(lat.x0 + lat.step * np.arange(lat.nx) > 0.0, (lat.ny, 1))
    place = depth_layers.LayerArea(area, bare)
    for lines in depth_layers.layer(field, stock, z, place, allowance, 0.8 * body.radius, 1.0):
        for line in lines:
            stock.cut(line.points, body)
    must, x, y = clear(field, z, allowance + 1.5 * lat.step)
    left = stock.top[stock.lattice.cells(np.column_stack([x[must], y[must]]))] > z + depth_layers.STOCK_WORTH
    assert left[x[must] > 0.0].mean() <= 0.002
    assert left[x[must] < -body.radius].mean() > 0.05  # no place there has more than the island over the cutter


@pytest.mark.parametrize("body", [tool(3.0, 0.0), ball(3.0)], ids=kind)
def test_the_rim_pass_leaves_nothing_at_a_wall(body):
    z = 4.0
    field, stock, area, _ = rough(walls, body, z, 0.3, True, 2.5)
    before = stock.top.copy()
    none = np.zeros_like(area)
    lines = depth_layers.rim(field, stock, z, area, none, 0.3, CHORD, False)
    for line in lines:
        assert np.abs(from_walls(dense(line.points, 0.05)[:, :2]) - body.radius).max() <= CHORD + 0.001
        stock.cut(line.points, body)
    lat = stock.lattice
    x, y = np.meshgrid(lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny))
    off = from_walls(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    beside = (off > 0.02) & (off < 0.29)
    # what the side of the cutter took, at the height where the wall is touched
    foot = z + (body.corner_radius if body.corner_radius else 1e-6)
    assert (before[beside] > foot).mean() > 0.5
    assert (stock.top[beside] > foot).sum() == 0


def test_the_rim_pass_is_for_walls_nobody_finishes_or_for_all_once_a_flute():
    body, z = tool(3.0, 0.0), 4.0
    field, stock, area, _ = rough(walls, body, z, 0.3, True)
    lat = field.lattice
    one = np.zeros_like(area)
    x = lat.x0 + lat.step * np.arange(lat.nx)
    one[:, x < 11.0] = True  # a finish follows the wall at x = 5..7, none the other
    everything = depth_layers.rim(field, stock, z, area, np.zeros_like(area), 0.3, CHORD, False)
    other = depth_layers.rim(field, stock, z, area, one, 0.3, CHORD, False)
    assert min(line.points[:, 0].min() for line in everything) < 5.0
    assert other and min(line.points[:, 0].min() for line in other) > 10.0
    assert depth_layers.rim(field, stock, z, area, np.ones_like(area), 0.3, CHORD, False) == []
    unseen = depth_layers.rim(field, stock, z, area, np.ones_like(area), 0.3, CHORD, True)
    assert sum(q.length for q in unseen) >= 0.99 * sum(q.length for q in everything)
    for always in (False, True):  # the wall at x = 5..7 is left alone, once a flute too
        kept = depth_layers.rim(field, stock, z, area, np.zeros_like(area), 0.3, CHORD, always, 0.0, one)
        assert kept and min(line.points[:, 0].min() for line in kept) > 10.0
    stock.top[:] = -5.0
    assert depth_layers.rim(field, stock, z, area, np.zeros_like(area), 0.3, CHORD, False) == []


def test_what_a_finish_leaves_on_a_steep_wall_is_no_rim():
    """Stock 0.04 mm thick on a wall that leans 3 degrees stands 0.76 mm over the cutter that touches the wall."""
    body, z, rise = tool(3.0, 0.0), 0.5, math.tan(math.radians(3.0))
    mesh = slope_field(lambda x, y: np.clip(y / rise, 0.0, 6.0), size=12.0, n=240)
    field = field_of(mesh, body)
    stock = StockMap.box(TriangleTree(mesh), np.array([-6.0, -6.0, -3.0]), np.array([6.0, 6.0, 6.0]), 0.05)
    lat, lengths = field.lattice, []
    area = np.abs(lat.x0 + lat.step * np.arange(lat.nx)) < 3.0
    area = area & (lat.y0 + lat.step * np.arange(lat.ny) < 0.0)[:, None]
    y = np.broadcast_to((stock.lattice.y0 + stock.lattice.step * np.arange(stock.lattice.ny))[:, None], stock.top.shape)
    for thick in (0.04, 0.3):
        high = np.clip((y + thick) / rise, 0.0, 6.0)
        stock.become(StockMap(stock.lattice, high, high.copy(), stock.part))
        for thin in (0.0, 0.08):
            lines = depth_layers.rim(field, stock, z, area, np.zeros_like(area), 0.2, CHORD, False, thin)
            lengths.append(sum(line.length for line in lines))
    assert lengths[1] == 0.0 and min(lengths[0], *lengths[2:]) > 5.0
