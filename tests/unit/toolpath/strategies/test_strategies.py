"""Strategies against formulas and slow twins: waterlines, level planes, layers, single touches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from tests.hand_parts import SURFACES, ball, box_mesh, corner, field_of, samples_of, slope_field, terraces, tool, walls
from tests.plan_checks import dense
from toolpath.lines import Line
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import depth_layers, planar_floor, touch_points, waterline, zigzag
from zones.reach.tip_field import LEVEL_TOLERANCE, touchable

CHORD = 0.003
WALLS = [((5.0, 2.0), (7.0, 12.0)), ((15.0, 2.0), (17.0, 12.0))]  # plan of ``walls()``, whose plate is at z = 3
SIDES = [ball(3.0), tool(3.0, 0.0), tool(3.0, 0.5)]


def kind(body):
    return body.kind


def leaning(nz, n=1):
    """``n`` unit normals of a wall that leans by nz."""
    return np.tile([math.sqrt(1.0 - nz * nz), 0.0, nz], (n, 1))


def reached(field, mesh, keep, density=12.0):
    """Points and admissible tips of the samples that ``keep`` picks and the tool touches."""
    s = samples_of(mesh, density)
    s = s.subset(keep(s))
    _, by_tool, tips = touchable(field, s.points, s.normals, 0.002)
    return s.points[by_tool], tips[by_tool]


def from_walls(xy):
    """Distance (n,) mm in plan from ``WALLS``."""
    off = [np.hypot(*np.maximum(np.maximum(np.array(lo) - xy, xy - np.array(hi)), 0.0).T) for lo, hi in WALLS]
    return np.min(off, axis=0)


def underside(rho, body):
    """Height (n,) of the bottom of a cutter above its tip, mm; infinite outside its radius."""
    u = np.maximum(rho - (body.radius - body.corner_radius), 0.0)
    rise = body.corner_radius - np.sqrt(np.maximum(body.corner_radius**2 - u * u, 0.0))
    return np.where(rho <= body.radius, rise, np.inf)


# -- waterlines ---------------------------------------------------------------------------------------------------


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


# -- stock in the way -------------------------------------------------------------------------------------------


class Discs:
    """Stock in columns, lowered by the whole bottom of the cutter at tips every few hundredths of a millimetre."""

    def __init__(self, lo, hi, top, step=0.05):
        self.x, self.y = np.meshgrid(np.arange(lo[0], hi[0], step), np.arange(lo[1], hi[1], step))
        self.top = np.full(self.x.shape, float(top))

    def over(self, tip, body, rim):
        """How far stock stands above the bottom of the cutter inside its radius less ``rim``."""
        rho = np.hypot(self.x - tip[0], self.y - tip[1])
        return float((self.top - tip[2] - underside(rho, body))[rho <= body.radius - rim].max(initial=0.0))

    def cut(self, tip, body):
        rho = np.hypot(self.x - tip[0], self.y - tip[1])
        self.top = np.minimum(self.top, tip[2] + underside(rho, body))


def steepest_bites(lines, stock, body):
    """The most that stood over the steep moves of each line before it was walked, line by line, mm."""
    out = []
    for line in lines:
        p = dense(line.points, 0.04)
        move = np.diff(p, axis=0)
        steep = np.concatenate([[False], np.abs(move[:, 2]) > 0.06 * np.hypot(move[:, 0], move[:, 1])])
        out.append(max((stock.over(tip, body, 0.06) for tip in p[steep]), default=0.0))
        for tip in p:
            stock.cut(tip, body)
    return out


@pytest.mark.parametrize("body", [ball(2.0), tool(2.0, 0.4)], ids=kind)
def test_no_steep_part_of_a_skimmed_pass_takes_more_than_the_skin(body):
    mesh = box_mesh([0, 0, -2], [10, 4, 0])
    x = np.linspace(1.5, 8.5, 41)
    line = Line(np.column_stack([x, np.full(41, 2.0), 0.9 + 0.7 * np.cos(1.3 * x)]), False)
    skin, top = 0.25, 1.9
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([10.0, 4, top]), 0.1)
    got = zigzag.skimmed(line, stock, body, skin, 0.2)
    assert got[-1] is line and len(got) > 3
    # without them the pass itself would take much more
    (plain,) = steepest_bites([line], Discs([0, 0], [10, 4], top), body)
    assert plain > 3 * skin
    bites = steepest_bites(got, Discs([0, 0], [10, 4], top), body)
    # the looked-at places lie 0.3 radii apart on a slope of up to 0.9, the stock of the planner 0.1 mm
    assert max(bites) <= skin + 0.08
    assert all(np.diff([q.points[:, 2].max() for q in got]) < 1e-9)  # from the top down
    lifts = [q.points[:, 2] - np.interp(q.points[:, 0], x, line.points[:, 2]) for q in got]
    assert max(np.ptp(up) for up in lifts) < 0.03
    steps = -np.diff([up.mean() for up in lifts])
    assert np.ptp(steps) < 0.02 and 0.8 * skin < steps.max() <= skin


def open_depth(lines, x, top, slope):
    """The most that is open at x while lines along X are walked: what descents took less what other way worked off."""
    worst = debt = 0.0
    for line in lines:
        p = dense(line.points, 0.01)
        move = np.diff(p, axis=0)
        down = -move[:, 2] > slope * np.abs(move[:, 0])
        k = int(np.abs(0.5 * (p[1:, 0] + p[:-1, 0]) - x).argmin())
        height = float(p[k, 2])
        if down[k] and height < top:
            debt += top - height
        worst, top = max(worst, debt), min(top, height)
        debt = max(debt - slope * float(np.abs(move[~down, 0]).sum()), 0.0)
    return worst


@pytest.mark.parametrize(("run", "up"), [(2.0, 2.0), (30.0, 30.0), (20.0, 1.0), (20.0, 0.0), (3.0, 0.0)])
def test_what_descents_take_is_worked_off_by_way_that_does_not_go_down(run, up):
    """Valleys: down over ``run`` mm, up over ``up`` mm; the way down works nothing off, however long it is."""
    mesh = box_mesh([0, 0, -2], [70, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([70.0, 4, 4.0]), 0.1)
    body, skin, slope = tool(2.0, 0.4), 0.4, 0.05
    valley = [[3.0, 2, 3.6], [3.0 + run, 2, 1.4], *([[3.0 + run + up, 2, 3.6]] if up else [])]
    got = zigzag.skimmed(Line(np.array(valley), False), stock, body, skin, slope)
    assert got[-1].points.tolist() == valley
    assert max(open_depth(got, x, 4.0, slope) for x in (3.0 + 0.5 * run, 3.0 + 0.9 * run)) <= skin + 0.05
    # a skin each is enough on a long way, and for layers walked uphill
    assert len(got) > 8 if run == up == 2.0 else len(got) <= 2.6 / skin + 1


def test_a_level_pass_and_one_in_air_are_not_skimmed():
    mesh = box_mesh([0, 0, -2], [10, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([10.0, 4, 3.0]), 0.1)
    level = Line(np.array([[1.0, 2, 0.1], [9, 2, 0.1]]), False)
    assert zigzag.skimmed(level, stock, ball(2.0), 0.1, 0.05) == [level]
    above = Line(np.array([[1.0, 2, 5.0], [9, 2, 3.0]]), False)
    assert zigzag.skimmed(above, stock, ball(2.0), 0.1, 0.05) == [above]
    into = Line(np.array([[1.0, 2, 3.0], [9, 2, 1.0]]), False)
    assert len(zigzag.skimmed(into, stock, ball(2.0), 0.1, 0.05)) > 5


def test_beside_a_wall_only_what_is_under_the_end_of_a_pass_that_goes_down_is_skimmed():
    mesh = box_mesh([0, 0, -2], [40, 4, 0])
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([40.0, 4, 3.0]), 0.1)
    down = np.array([[3.0, 2, 2.8], [33, 2, 0.6]])
    beside = down + [0.0, 3.4, 0.0]  # the ball of 4 mm goes along the block with 0.6 mm of its flank in it
    assert len(zigzag.skimmed(Line(beside, False), stock, ball(4.0), 0.3, 0.05, True)) == 1
    assert len(zigzag.skimmed(Line(beside, False), stock, ball(4.0), 0.3, 0.05)) > 1
    assert len(zigzag.skimmed(Line(down, False), stock, ball(4.0), 0.3, 0.05, True)) > 5
    assert len(zigzag.skimmed(Line(down[::-1], False), stock, ball(4.0), 0.3, 0.05, True)) == 1


# -- level planes -------------------------------------------------------------------------------------------------


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


# -- layers -------------------------------------------------------------------------------------------------------


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


# -- places that no pass has finished -----------------------------------------------------------------------------


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
