"""The planner's stock against many points of the true stock: what a cell says is never too low."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, box_mesh, joined, tool
from toolpath.kernels.ramp import ease
from toolpath.kernels.stock import HALF_DIAGONAL
from toolpath.stock.stock_map import SKIN, SURE_EDGE, StockMap
from zones.lattice import Lattice
from zones.reach.access_view import access_rotation
from zones.reach.assembly import Disc

STEP = 0.2
PART = joined(box_mesh([0, 0, -2], [12, 12, 0]), box_mesh([3.05, 3.0, 0], [4.0, 9.0, 5.0]))
BODIES = [tool(3.0, 0.0), ball(3.0), tool(3.0, 0.6)]
PATH = np.array([[6.0, 1.0, 1.5], [6.3, 8.0, 1.2], [9.0, 9.5, 0.4], [5.51, 5.0, 0.4], [5.51, 8.0, 0.1]])


def bottom(rho, body):
    u = np.maximum(rho - (body.radius - body.corner_radius), 0.0)
    return body.corner_radius - np.sqrt(np.maximum(body.corner_radius**2 - u * u, 0.0))


def swept(points, top, path, body, spacing=0.01):
    """Heights ``top`` over points (n, 2) after the cutter went along the path: every position, one after another."""
    top = top.copy()
    for a, b in zip(path[:-1], path[1:], strict=True):
        for t in np.linspace(0.0, 1.0, int(np.linalg.norm(b - a) / spacing) + 2):
            c = a + t * (b - a)
            rho = np.hypot(*(points - c[:2]).T)
            under = rho <= body.radius
            top[under] = np.minimum(top[under], c[2] + bottom(rho[under], body))
    return top


def offset_blank(points, offset):
    """Highest of balls of a radius on the part's surface over points (n, 2): two boxes, solved box by box."""
    out = np.full(len(points), -np.inf)
    for lo, hi, z in (((0, 0), (12, 12), 0.0), ((3.05, 3.0), (4.0, 9.0), 5.0)):
        off = np.hypot(*np.maximum(np.maximum(np.array(lo) - points, points - np.array(hi)), 0.0).T)
        inside = off <= offset
        out[inside] = np.maximum(out[inside], z + np.sqrt(offset**2 - off[inside] ** 2))
    return out


@pytest.mark.parametrize("beside", [0.0, 1e-9, 2e-4, 1e-3])
def test_nothing_stands_where_a_tool_followed_a_wall_as_near_as_lines_do(beside):
    """The wall just leaves the disc of a cell, which the tool then does not clear whole."""
    part = TriangleTree(joined(box_mesh([-12, -12, -2], [12, 12, 0]), box_mesh([-9, -9, 0], [0.0, 9.0, 5.0])))
    blank = StockMap.around(part, np.array([[-12, -12, -2], [12, 12, 5.0]]), 1.0, STEP)
    x0 = blank.lattice.x0
    column = int(np.ceil(-x0 / STEP)) + 1
    wall = x0 + column * STEP - HALF_DIAGONAL * STEP - beside
    moved = joined(box_mesh([-12, -12, -2], [12, 12, 0]), box_mesh([-9, -9, 0], [wall, 9.0, 5.0]))
    stock = StockMap.around(TriangleTree(moved), np.array([[-12, -12, -2], [12, 12, 5.0]]), 1.0, STEP)
    assert stock.lattice.x0 == x0
    body = tool(3.0, 0.0)
    for z in (3.0, 1.0, 0.1):
        for off in (4.0, 2.0, 0.0):
            stock.cut(np.array([[wall + body.radius + 2e-4 + off, y, z] for y in (-8.0, 8.0)]), body)
    there = np.array([[wall + body.radius + 2e-4, y, 0.1] for y in np.linspace(-5.0, 5.0, 41)])
    assert stock.standing(there, body).max() <= 1e-9


@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.kind)
def test_no_point_of_the_stock_stands_above_its_cell(body):
    stock = StockMap.around(TriangleTree(PART), PART.bounds, 1.0, STEP)
    stock.cut(PATH, body)
    points = np.random.default_rng(1).uniform(-1.5, 13.5, (40_000, 2))
    true = swept(points, offset_blank(points, 1.0), PATH, body)
    at = stock.lattice.cells(points)
    assert (stock.cover[at] >= true - 1e-9).all()
    assert (stock.cover >= stock.top - 1e-9).all()


@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.kind)
def test_a_cell_the_cutter_has_covered_is_down_to_what_it_left(body):
    stock = StockMap.around(TriangleTree(PART), PART.bounds, 1.0, STEP)
    stock.cut(np.array([[6.0, 2.0, 0.4], [10.0, 2.0, 0.4]]), body)
    below = stock.cover[stock.lattice.cells(np.column_stack([np.linspace(6.0, 10.0, 30), np.full(30, 2.0)]))]
    assert (below <= 0.4 + bottom(np.array(1.5 * STEP), body) + 1e-9).all()
    assert (below >= 0.4).all()


@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.kind)
def test_a_place_called_air_takes_no_more_than_a_skin_with_the_end(body):
    stock = StockMap.around(TriangleTree(PART), PART.bounds, 1.0, STEP)
    stock.cut(PATH, body)
    rng = np.random.default_rng(2)
    tips = np.column_stack([rng.uniform(0, 12, (4000, 2)), rng.uniform(0.0, 3.0, 4000)])
    tips = np.vstack([tips, PATH + [0.0, 0.0, 0.02], PATH[1:3] + [0.3, 0.1, 0.4]])
    air = tips[stock.in_air(tips, body)]
    assert len(air) > 20
    points = rng.uniform(-1.5, 13.5, (40_000, 2))
    true = swept(points, offset_blank(points, 1.0), PATH, body)
    reach = body.radius - 0.5 * body.corner_radius
    for tip in air:
        rho = np.hypot(*(points - tip[:2]).T)
        under = rho <= reach
        assert (true[under] - tip[2] - bottom(rho[under], body)).max(initial=0.0) <= SKIN * body.diameter + 1e-9


def test_stock_beside_a_wall_is_not_what_stands_over_a_pass():
    tree = TriangleTree(PART)
    body = tool(2.0, 0.0)
    beside = np.array([[5.0, 6.0, 0.5]])  # touches the wall at x = 4
    stock = StockMap.around(tree, PART.bounds, 1.0, 0.05)
    assert 5.0 < stock.standing(beside, body)[0] <= 5.5  # the millimetre round the wall is open stock
    stock.cut(np.array([[5.0, 3.0, 0.5], [5.0, 9.0, 0.5]]), body)
    assert stock.standing(beside, body)[0] <= 0.5 + 1e-9  # what is left is the blank on the plate, past the rim


def test_what_stands_in_the_way_of_shank_and_holder_is_found_before_and_after_a_cut():
    stock = StockMap.box(TriangleTree(PART), np.array([-2.0, -2, -2]), np.array([14.0, 14, 6]), STEP)
    bodies = [Disc("shank", 2.6, 1.5), Disc("holder", 4.4, 3.0)]
    rng = np.random.default_rng(3)
    tips = np.column_stack([rng.uniform(-4, 16, (3000, 2)), rng.uniform(0.0, 6.5, 3000)])
    lat = stock.lattice
    nodes = np.stack(np.meshgrid(lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny)), -1)
    shares = []
    for path in (None, PATH, PATH[::-1] + [-3.0, 1.0, 1.0]):
        if path is not None:
            stock.cut(path, tool(6.0, 0.0))
        met = stock.meets_bodies(tips, bodies)
        for tip, said in zip(tips, met, strict=True):
            rho = np.hypot(*(nodes - tip[:2]).transpose(2, 0, 1))
            near = [rho <= b.radius + SURE_EDGE * STEP for b in bodies]
            assert said == any((stock.top[n] > tip[2] + b.height).any() for n, b in zip(near, bodies, strict=True))
        shares.append(met.mean())
    assert shares[0] > shares[1] > shares[2] > 0.05


@pytest.mark.parametrize("step", [0.07, 0.2, 0.5])
def test_nodes_of_another_lattice_near_standing_stock_are_those_found_one_by_one(step):
    rng = np.random.default_rng(2)
    top = np.where(rng.random((31, 44)) < 0.2, rng.uniform(0.0, 2.0, (31, 44)), -np.inf)
    stock = StockMap(Lattice(0.3, -0.2, 0.2, 44, 31), top)
    other = Lattice(1.0, 0.4, step, 23, 17)
    i, j = np.nonzero(top > 1.0)
    assert np.array_equal(stock.above(1.0, other), other.mask(stock.lattice.nodes(i, j, 0.0)[:, :2]))


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.6, 0.78])
def test_stock_that_ends_along_a_line_is_seen_wherever_the_line_lies_between_nodes(angle):
    """The planner cleared half a cell diagonal round a shank; an edge just behind a row of nodes was 6 um too near."""
    x, y = np.meshgrid(0.1 * np.arange(200), 0.1 * np.arange(200))
    body, aside = Disc("shank", 4.0, 1.0), np.array([np.cos(angle), np.sin(angle)])
    for edge in np.linspace(14.0, 14.2, 41):
        top = np.where(x * aside[0] + y * aside[1] >= edge, 5.0, -np.inf)
        stock = StockMap(Lattice(0.0, 0.0, 0.1, 200, 200), top)
        for gap, met in ((-1e-6, True), (0.12, False)):
            foot = np.array([9.0, 9.0]) - (np.array([9.0, 9.0]) @ aside) * aside
            tip = foot + (edge - 4.0 - gap) * aside
            assert stock.meets_bodies(np.array([[*tip, 0.0]]), [body])[0] == met


def test_an_eased_ramp_is_never_steeper_than_its_slope_less_the_rounding():
    rng = np.random.default_rng(3)
    runs = np.where(rng.random(400) < 0.4, 10.0 ** rng.uniform(-4, -2, 400), rng.uniform(0.05, 0.6, 400))
    points = np.column_stack([np.concatenate([[0.0], np.cumsum(runs)]), np.zeros(401), np.zeros(401)])
    slope, rounding = math.tan(math.radians(3.0)) * 0.98, 1.1e-4
    wanted = 2.0 - points[:, 0] * math.tan(math.radians(3.0)) * 0.9
    lift = np.maximum(wanted, 0.0)
    ease(points, lift, slope, rounding)
    assert (lift >= np.maximum(wanted, 0.0)).all()
    assert lift[-1] == 0.0
    assert np.abs(lift - np.maximum(wanted, 0.0)).max() < 0.01
    written = np.round(lift, 4)
    at = np.round(points[:, 0], 4)
    assert (np.diff(written) >= -math.tan(math.radians(3.0)) * np.diff(at) - 1e-9).all()


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.5, -0.3, 0.9), (-0.8, 0.2, 0.1), (1.0, 0.0, 0.0)])
def test_a_block_that_stands_askew_is_as_high_as_its_corners_and_edges(direction):
    """Against 40 places a node through the block, sampled along the vertical line."""
    rotation = access_rotation(direction)
    box = np.array([[-2.0, -2.0, -2.0], [14.0, 14.0, 6.0]])
    mesh = PART.transformed(np.block([[rotation, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]))
    stock = StockMap.block(TriangleTree(mesh), box, rotation, 0.5)
    lat = stock.lattice
    heights = np.linspace(-30.0, 30.0, 6001)
    checked = 0
    for iy in range(0, lat.ny, 5):
        for ix in range(0, lat.nx, 5):
            line = np.column_stack([np.full_like(heights, lat.x0 + lat.step * ix),
                                    np.full_like(heights, lat.y0 + lat.step * iy), heights]) @ rotation
            inside = ((line >= box[0] - 1e-9) & (line <= box[1] + 1e-9)).all(axis=1)
            if inside.any():
                assert abs(stock.top[iy, ix] - heights[inside].max()) < 0.011
                checked += 1
                for dx, dy in ((-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25), (0.1, -0.2), (0.0, 0.25)):
                    near = (line @ rotation.T + [dx, dy, 0.0]) @ rotation
                    there = ((near >= box[0]) & (near <= box[1])).all(axis=1)
                    assert stock.cover[iy, ix] >= (heights[there].max() if there.any() else -np.inf) - 1e-9
            elif stock.top[iy, ix] > -np.inf:  # a corner thinner than the comb
                at = np.array([lat.x0 + lat.step * ix, lat.y0 + lat.step * iy, stock.top[iy, ix]]) @ rotation
                assert ((at >= box[0] - 1e-6) & (at <= box[1] + 1e-6)).all()
    assert checked > 20


def highest(lat, stands, column):
    """Rows and columns of every third node, and the highest of a column of heights at which something stands there."""
    iy, ix = (v.ravel() for v in np.mgrid[5:lat.ny - 5:3, 5:lat.nx - 5:3])
    nodes = np.column_stack([lat.x0 + STEP * ix, lat.y0 + STEP * iy])
    every = np.concatenate([np.repeat(nodes, len(column), axis=0), np.tile(column, len(nodes))[:, None]], axis=1)
    there = stands(every).reshape(len(nodes), -1)
    return iy, ix, np.where(there.any(axis=1), column[there.shape[1] - 1 - there[:, ::-1].argmax(axis=1)], -np.inf)


def leaning_maps(slot):
    """Stock of a block round PART: seen from above after a slot with a flat, and its frame leaned, not yet told."""
    lower, upper = np.array([-1.0, -1.0, -2.0]), np.array([13.0, 13.0, 6.0])
    first = StockMap.box(TriangleTree(PART), lower, upper, STEP)
    first.cut(slot, tool(3.0, 0.0))
    turn = access_rotation(np.array([0.35, -0.2, 0.9]) / np.linalg.norm([0.35, -0.2, 0.9]))
    turned = replace(PART, vertices=PART.vertices @ turn.T)
    other = StockMap.block(TriangleTree(turned), np.array([lower, upper]), turn, STEP)
    return first, other, turn


SLOT = np.array([[6.5, -3.0, 1.0], [6.5, 15.0, 1.0], [9.0, 15.0, 1.0], [9.0, -3.0, 1.0]])


def test_what_an_axis_before_has_left_is_a_bound_and_no_more_than_cells_above_the_truth():
    first, other, turn = leaning_maps(SLOT)
    whole = other.copied()
    other.left_by([(first, turn.T)], -9.0)
    assert (other.cover <= whole.cover).all() and (other.top <= other.cover + 1e-12).all()

    def stands(points):  # in the frame of the part: the block without the slot
        inside = (np.abs(points - [6.0, 6.0, 2.0]) <= [7.0, 7.0, 4.0]).all(axis=1)
        return inside & ~((points[:, 0] > 5.0) & (points[:, 0] < 10.5) & (points[:, 2] > 1.0))

    rng = np.random.default_rng(5)
    lat = other.lattice
    plan = np.array([lat.x0, lat.y0]) + rng.random((200_000, 2)) * STEP * np.array([lat.nx - 1, lat.ny - 1])
    high = rng.uniform(-6.0, 12.0, len(plan))
    points = np.column_stack([plan, high])
    true = stands(points @ turn)
    cover = other.cover[lat.cells(plan)]
    assert (cover[true] >= high[true]).all()  # never too low
    # and where the slot is open to this axis it is not far above: cells of both, a step of the way, over their slopes
    column = np.arange(-6.0, 12.0, 0.02)
    iy, ix, height = highest(lat, lambda points: stands(points @ turn), column)
    seen = np.isfinite(height) & np.isfinite(other.top[iy, ix])
    over = other.top[iy, ix][seen] - height[seen]
    assert seen.sum() > 500 and np.quantile(over, 0.9) < 2.0 * STEP
    assert (whole.top[iy, ix][seen] - height[seen]).max() > 3.0  # the slot was there to be seen


@pytest.mark.parametrize("level", [4.0, 2.0, 0.0])
def test_a_hollow_counts_as_air_once_it_is_open(level):
    """Cut down to a level along the second axis: what the first has taken off below it is not there to be cut again."""
    first, other, turn = leaning_maps(np.array([[6.5, -3.0, -1.5], [6.5, 15.0, -1.5]]))
    other.left_by([(first, turn.T)], -9.0)
    y = np.arange(-8.0, 22.0, 0.5)
    rows = np.column_stack([np.tile([-8.0, 22.0, 22.0, -8.0], len(y) // 2), np.repeat(y, 2),
                            np.full(2 * len(y), level)])
    other.cut(rows, tool(3.0, 0.0))
    before = other.top.copy()
    other.settle()

    def stands(points):  # in the frame of the part: the block without the slot
        inside = (np.abs(points - [6.0, 6.0, 2.0]) <= [7.0, 7.0, 4.0]).all(axis=1)
        return inside & ~((points[:, 0] > 5.0) & (points[:, 0] < 8.0) & (points[:, 2] > -1.5))

    rng, lat = np.random.default_rng(6), other.lattice
    plan = np.array([lat.x0, lat.y0]) + rng.random((100_000, 2)) * STEP * np.array([lat.nx - 1, lat.ny - 1])
    high = rng.uniform(-8.0, level, len(plan))
    true = stands(np.column_stack([plan, high]) @ turn)
    assert (other.cover[lat.cells(plan)][true] >= high[true]).all()  # never too low
    column = np.arange(-8.0, level, 0.02)
    iy, ix, height = highest(lat, lambda points: stands(points @ turn), column)
    seen = np.isfinite(height) & np.isfinite(other.top[iy, ix])
    assert seen.sum() > 300 and np.quantile(other.top[iy, ix][seen] - height[seen], 0.9) < 2.0 * STEP
    assert (before[iy, ix][seen] - other.top[iy, ix][seen]).max() > 1.5  # there were hollows
    held = other.top.copy()
    other.settle(last=True)
    np.testing.assert_array_equal(other.top, held)


def test_nothing_is_lowered_by_a_whole_block_and_everything_by_one_that_is_gone():
    first, other, turn = leaning_maps(np.array([[50.0, 50.0, 9.0], [51.0, 50.0, 9.0]]))
    before = other.cover.copy()
    other.left_by([], -9.0)
    np.testing.assert_array_equal(other.cover, before)
    other.left_by([(first, turn.T)], -9.0)
    inner = np.s_[5:-5, 5:-5]
    stood = np.isfinite(before[inner])
    np.testing.assert_allclose(other.cover[inner][stood], before[inner][stood], atol=1.0)
    first.top[:], first.cover[:] = -np.inf, -np.inf
    other.left_by([(first, turn.T)], -9.0)
    assert not np.isfinite(other.cover).any() and other.highest == -np.inf


def test_what_stands_lower_than_the_part_along_one_axis_is_still_there_along_another():
    """A corner of the block lies under the part, seen from the far side: those who came after took it for gone."""
    lower, upper = np.array([-1.0, -1.0, -2.0]), np.array([13.0, 13.0, 6.0])
    middle = box_mesh([5.0, 5.0, 0.0], [7.0, 7.0, 5.0])
    above = StockMap.box(TriangleTree(middle), lower, upper, STEP)
    maps, turns = [above], [np.eye(3)]
    for axis in ([-0.6, -0.6, 0.5], [0.6, 0.6, 0.4]):
        turn = access_rotation(np.array(axis) / np.linalg.norm(axis))
        mesh = replace(middle, vertices=middle.vertices @ turn.T)
        stock = StockMap.block(TriangleTree(mesh), np.array([lower, upper]), turn, STEP)
        corners = np.array([[x, y, z] for x in (-1.0, 13.0) for y in (-1.0, 13.0) for z in (-2.0, 6.0)]) @ turn.T
        stock.left_by([(m, t @ turn.T) for m, t in zip(maps, turns, strict=True)], corners[:, 2].min())
        maps.append(stock)
        turns.append(turn)
    points = np.random.default_rng(3).uniform(lower, upper, (50_000, 3))
    for stock, turn in zip(maps, turns, strict=True):
        seen = points @ turn.T
        assert (stock.cover[stock.lattice.cells(seen[:, :2])] >= seen[:, 2]).all()
    lowest = float((middle.vertices @ turns[1].T)[:, 2].min())
    assert ((points @ turns[1].T)[:, 2] < lowest - 1.0).sum() > 1000


@pytest.mark.parametrize("body", BODIES, ids=lambda b: b.kind)
def test_how_far_stock_stands_above_a_cutter_is_that_of_every_node_in_the_disc(body):
    """Squares of nodes are passed over by their highest, which is lowered as it is looked at and by no cut."""
    stock = StockMap.around(TriangleTree(PART), PART.bounds, 1.0, STEP)
    lat, rng = stock.lattice, np.random.default_rng(5)
    at = np.stack(np.meshgrid(lat.x0 + STEP * np.arange(lat.nx), lat.y0 + STEP * np.arange(lat.ny)), axis=-1)
    tips = rng.uniform([-4.0, -4.0, -1.0], [16.0, 16.0, 8.0], (400, 3))
    for cut in (None, PATH, PATH - [0.0, 1.0, 0.3]):
        if cut is not None:
            stock.cut(cut, body)
        for rim in (-0.8, 0.0, 0.7):
            inner = max(body.radius + rim * STEP, 0.35 * body.radius)
            slow = np.full(len(tips), -np.inf)
            for k, (x, y, z) in enumerate(tips):
                rho = np.hypot(at[..., 0] - x, at[..., 1] - y)
                disc = rho <= inner
                if disc.any():
                    under = bottom(np.minimum(rho[disc], body.radius), body)
                    slow[k] = (stock.top[disc] - z - under).max()
            np.testing.assert_allclose(stock.overlap(tips, body, rim), slow, atol=1e-9)
            np.testing.assert_allclose(stock.overlap(tips, body, rim, lower_bound=0.0), np.maximum(slow, 0.0),
                                       atol=1e-9)
        held = stock.copied()
        np.testing.assert_array_equal(stock.under_end(tips, body, lower_bound=0.0),
                                      np.maximum(held.under_end(tips, body), 0.0))
        assert (np.isfinite(slow) & (slow > 0.0)).sum() > 50 < (slow < 0.0).sum()


def test_cuts_that_are_tried_stand_again():
    mesh = box_mesh([0, 0, -2], [20, 10, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([20.0, 10, 3.0]), 0.1)
    body, path = tool(3.0, 0.0), np.array([[4.0, 5.0, 1.0], [16.0, 5.0, 1.0]])
    top, cover, seen = stock.top.copy(), stock.cover.copy(), stock.overlap(path, body)
    box = np.array([path[:, :2].min(axis=0) - 1.5, path[:, :2].max(axis=0) + 1.5])
    with stock.undone(box):
        stock.cut(path, body)
        assert (stock.overlap(path, body) < 0.1).all()  # which also lowers the coarse squares
    assert (stock.top == top).all() and (stock.cover == cover).all()
    assert (stock.overlap(path, body) == seen).all() and seen.max() == pytest.approx(2.0)
