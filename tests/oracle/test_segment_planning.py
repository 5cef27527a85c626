"""Circle segment mills in the planner's kernels, against their outline place by place."""

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import cutter_shape
from tests.hand_parts import box_mesh
from tests.oracle.drop_shapes import SHAPES
from tests.oracle.test_verify_segments import barrel, heights, lens, outline
from tests.plan_checks import dense
from toolpath.kernels.engaged import SECTORS, sectors
from toolpath.kernels.stock import HALF_DIAGONAL, stamp
from toolpath.passes.contours import contour_pieces
from toolpath.planning.zone_finishing import no_flank
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap
from toolpath.strategies import curvature_matched, isoparametric
from zones.kernels.lattice import LatticeFrame
from zones.reach.access_reach import able
from zones.reach.assembly import Clearances
from zones.reach.tip_field import TipField, contact_tips

MILLS = {"lens": lens(2.0, 3.0, 0.3), "sharp lens": lens(2.0, 2.5, 0.0), "oval": barrel(2.0, 8.0, 0.3),
         "bull barrel": barrel(2.0, 5.0, 0.2, 0.0, 0.5), "taper barrel": barrel(2.0, 8.0, 0.4, 15.0)}


@pytest.mark.parametrize("name", MILLS)
def test_stock_is_lowered_to_the_outline(name):
    tool, rng = MILLS[name], np.random.default_rng(1)
    frame = LatticeFrame(*rng.uniform(-1.0, 1.0, 2), 0.1)
    top = rng.uniform(0.0, 2.0, (50, 40))
    cover = top + rng.uniform(0.0, 0.3, top.shape)
    tip = np.array([frame.x0 + 1.9, frame.y0 + 2.6, 0.2])
    given = top.copy(), cover.copy()
    stamp(*given, frame, tip[None], cutter_shape(tool))
    x, y = np.meshgrid(frame.x0 + 0.1 * np.arange(40), frame.y0 + 0.1 * np.arange(50))
    rho, half = np.hypot(x - tip[0], y - tip[1]), HALF_DIAGONAL * 0.1
    for got, was, more in ((given[0], top, 0.0), (given[1], cover, half)):
        under = (rho + more <= tool.radius) & (cover > tip[2])
        want = was.copy()
        want[under] = np.minimum(was[under], 0.2 + heights(rho[under] + more, tool))
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MILLS)
def test_sectors_are_those_of_stock_over_the_outline(name):
    tool, rng = MILLS[name], np.random.default_rng(5)
    top = rng.uniform(-1.0, 1.0, (24, 30))
    top[rng.random(top.shape) < 0.6] = -np.inf
    tips = np.column_stack([rng.uniform(0.0, 3.0, 12), rng.uniform(0.0, 2.4, 12), rng.uniform(-0.6, 0.8, 12)])
    turn = rng.uniform(0, 2 * np.pi, 12)
    ways, met = np.column_stack([np.cos(turn), np.sin(turn)]), np.zeros(12, np.int64)
    sectors(top, 0.05, -0.03, 0.1, tips, ways, cutter_shape(tool), 0.05, met)
    assert met.any()
    for (x, y, z), way, bits in zip(tips, ways, met.tolist(), strict=True):
        own = 0
        for i, j in np.ndindex(*top.shape):
            wx, wy, over = 0.05 + j * 0.1 - x, -0.03 + i * 0.1 - y, top[i, j] - z
            rho = math.hypot(wx, wy)
            if rho > tool.radius or over <= 0.05 or way[0] * wx + way[1] * wy < -0.1 \
                    or over - tool.arcs.height(rho) <= 0.05:
                continue
            edge, side = tool.arcs.width(over), way[0] * wy - way[1] * wx
            low, high = (math.asin(max(-1.0, min(1.0, (side + s * 0.05) / edge))) for s in (-1.0, 1.0))
            first, last = (min(max(int((a / math.pi + 0.5) * SECTORS), 0), SECTORS - 1) for a in (low, high))
            if over >= tool.arcs.high:
                first, last = first if side - 0.1 >= -edge else 0, last if side + 0.1 <= edge else SECTORS - 1
            own |= sum(1 << k for k in range(first, last + 1))
        assert bits == own


@pytest.mark.parametrize("name", MILLS)
@pytest.mark.parametrize("level", [True, False])
def test_the_residual_is_that_of_dense_tips(name, level):
    tool, rng, n = MILLS[name], np.random.default_rng(3), 400
    path = np.cumsum(rng.normal(size=(6, 3)) * [1.5, 1.5, 0.0 if level else 0.4], axis=0)
    near = dense(path, 0.05)
    c, a = near[rng.integers(0, len(near), n)], rng.random(n) * 2 * np.pi
    sine = rng.random(n) * tool.arcs.end_sine
    rho, high = tool.arcs.at_sines(sine)
    off = np.abs(rng.normal(size=n) * 0.01)
    rho, high = rho + off * sine, high - off * np.sqrt(1.0 - sine**2)
    points = c + np.column_stack([rho * np.cos(a), rho * np.sin(a), high])
    made = ResidualMap(points, np.tile([0.6, 0.0, 0.8], (n, 1)))
    made.cut(path, tool)
    line, tips = outline(tool, 3001), dense(path, 0.02)
    # the nearest tips by the outline as points; the sign by the height over the tip
    true = np.full(n, np.inf)
    for k, p in enumerate(points):
        off = p - tips
        rho = np.hypot(off[:, 0], off[:, 1])
        close = np.flatnonzero(rho < tool.radius + 0.1)
        inside = (rho[close] <= tool.radius) & (off[close, 2] > heights(np.minimum(rho[close], tool.radius), tool))
        if inside.any():
            true[k] = -1.0
        elif len(close):
            near = close[np.argsort(np.abs(off[close, 2] - heights(np.minimum(rho[close], tool.radius), tool)))[:60]]
            true[k] = np.hypot(line[:, 0] - rho[near, None], line[:, 1] - off[near, None, 2]).min()
    out, seen = true > 1e-3, made.residual < UNTOUCHED
    assert (out & seen).sum() > 8
    np.testing.assert_allclose(made.residual[seen & out], true[seen & out], atol=1e-3)
    assert (made.residual[(true < 0.0) & seen] <= 1e-3).all()


@pytest.mark.parametrize("name", MILLS)
def test_the_highest_tip_touches_each_point(name):
    tool, rng = MILLS[name], np.random.default_rng(4)
    n = rng.normal(size=(200, 3))
    n[:, 2] = np.abs(n[:, 2])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n[0] = [0.0, 0.0, 1.0]
    points, line = rng.uniform(-5.0, 5.0, (200, 3)), outline(tool, 4001)
    tips = contact_tips(tool, points, n, 0.01)
    for p, normal, tip in zip(points + 0.01 * n, n, tips, strict=True):
        level = math.hypot(*normal[:2])
        # the outline keeps out of the plane and touches it at the place
        off = (line[:, 1] + tip[2] - p[2]) * normal[2] - line[:, 0] * level + (tip[:2] - p[:2]) @ normal[:2]
        assert off.min() == pytest.approx(0.0, abs=1e-5)
        rho = math.hypot(*(p[:2] - tip[:2]))
        assert p[2] - tip[2] == pytest.approx(tool.arcs.height(min(rho, tool.radius)), abs=1e-6) \
            or p[2] - tip[2] >= tool.arcs.high - 1e-9


@pytest.mark.parametrize("name", MILLS)
def test_levels_run_along_a_leaning_wall_at_the_distance_of_the_outline(name):
    tool = MILLS[name]
    mesh = SHAPES["walls"]()
    field = TipField(TriangleTree(mesh), tool, Clearances(0.05, 0.2, 1.0, 1.0), mesh.bounds, 3.0, 0.15)
    every = np.ones((field.lattice.ny, field.lattice.nx), np.bool_)
    lines = contour_pieces(field, 6.0, every, every, 1.0, 4.0, 0.005, 0.0)
    assert lines
    for line in lines:
        tips = field.tips(line.points[:, :2])
        assert (tips <= 6.0 + 1e-5).all()
    # beside the wall of x = 4 that ends at 12 mm the axis is a radius off
    beside = np.concatenate([line.points for line in lines])
    beside = beside[(beside[:, 0] < 4.0) & (beside[:, 1] > 4.0) & (beside[:, 1] < 16.0)]
    assert np.abs(beside[:, 0].max() - (4.0 - tool.radius)) < 0.006


def test_a_field_keeps_its_allowance():
    mesh = box_mesh([0, 0, -4], [30, 30, 0])
    for tool in MILLS.values():
        field = TipField(TriangleTree(mesh), tool, Clearances(0.05, 0.2, 1.0, 1.0), mesh.bounds, 3.0, 0.3, 0.2)
        assert field.tips(np.array([[15.0, 15.0]]))[0] == pytest.approx(0.2, abs=1e-9)
        # beside the box the end rests on its rim
        assert field.tips(np.array([[-0.5, 15.0]]))[0] == pytest.approx(
            0.2 - tool.arcs.grown(0.2).height(0.5), abs=1e-9)


def test_a_rim_cuts_no_slope():
    """A sharp lens and a taper barrel finish what their arcs touch, and upright walls."""
    lean = np.radians([0.0, 10.0, 30.0, 74.0, 76.0, 89.9])
    normals = np.column_stack([np.sin(lean), 0.0 * lean, np.cos(lean)])
    assert able(MILLS["lens"], normals, 0.02).all() and able(MILLS["oval"], normals, 0.02).all()
    assert able(MILLS["sharp lens"], normals, 0.02).tolist() == [True, True, False, False, False, True]
    assert able(MILLS["taper barrel"], normals, 0.02).tolist() == [True, True, True, True, False, True]


def test_strategies_that_count_on_a_round_corner_leave_them_out():
    for tool in MILLS.values():
        assert not isoparametric.suits(tool) and not curvature_matched.suits(tool)
        assert no_flank(tool) == "a circle segment mill is planned upright only"
