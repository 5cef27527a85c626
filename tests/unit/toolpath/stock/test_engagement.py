"""How much of a cutter is in stock: against the obvious twin, the closed form of a side step, and what skims leave."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.kernels.drop import bull_of
from geometry.kernels.tapered import tapered_of
from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, box_mesh, tool
from toolpath.counterexamples import Counterexamples
from toolpath.kernels.engaged import SECTORS, _sector, joined, sectors, sectors_parallel
from toolpath.lines import Line, dense
from toolpath.stock.engagement import LOOK, SKIN_SHARE, UNBOUNDED, angles, over_limit, skims, within
from toolpath.stock.stock_map import StockMap

SECTOR = math.pi / SECTORS


def block(step=0.1, top=2.0, size=30.0):
    mesh = box_mesh([0, 0, -4], [size, size, -3])
    return StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -4]), np.array([size, size, top]), step)


def twin(top, x0, y0, step, tips, ways, radius, corner, skin, window, taper=0.0, widest=None):
    """The same, place by place: a set of sectors for each tip, joined back along the way."""
    sets = []
    for (x, y, z), way in zip(tips, ways, strict=True):
        own = set()
        for i in range(top.shape[0]):
            for j in range(top.shape[1]):
                wx, wy, over = x0 + j * step - x, y0 + i * step - y, top[i, j] - z
                rho = math.hypot(wx, wy)
                if rho > (widest or radius) or over <= skin or way[0] * wx + way[1] * wy < -step:
                    continue
                long = math.hypot(1.0, taper)
                join, side_from = radius - corner + corner / long, corner * (1.0 - taper / long)
                run = max(rho - (radius - corner), 0.0)
                bottom = side_from + (rho - join) / taper if taper and rho > join else \
                    corner - math.sqrt(max(corner**2 - run**2, 0.0))
                if over - bottom <= skin:
                    continue
                edge = min(join + taper * (over - side_from), widest or radius) if over >= side_from else \
                    radius - corner + math.sqrt(over * (2.0 * corner - over))
                side = way[0] * wy - way[1] * wx
                low, high = (math.asin(max(-1.0, min(1.0, (side + s * 0.5 * step) / edge))) for s in (-1.0, 1.0))
                first, last = (min(max(int((a / math.pi + 0.5) * SECTORS), 0), SECTORS - 1) for a in (low, high))
                if over >= side_from:
                    first, last = first if side - step >= -edge else 0, last if side + step <= edge else SECTORS - 1
                own |= set(range(first, last + 1))
        sets.append(own)
    out = []
    for k, own in enumerate(sets):
        joint, way, m = set(own), 0.0, k
        while own and m > 0:
            way += math.hypot(*(tips[m] - tips[m - 1])[:2])
            if way > window:
                break
            m -= 1
            joint |= sets[m]
        out.append(len(joint) * SECTOR)
    return np.array(out)


@pytest.mark.parametrize("corner", [0.0, 0.4, 1.0])
def test_the_kernel_says_what_the_obvious_twin_says(corner):
    rng = np.random.default_rng(5)
    top = rng.uniform(-1.0, 1.0, (24, 30))
    top[rng.random(top.shape) < 0.5] = -np.inf
    tips = np.column_stack([rng.uniform(0.0, 3.0, 12), rng.uniform(0.0, 2.4, 12), rng.uniform(-0.6, 0.8, 12)])
    turn = rng.uniform(0, 2 * np.pi, 12)
    ways = np.column_stack([np.cos(turn), np.sin(turn)])
    given = (top, 0.05, -0.03, 0.1, tips, ways, 1.0, corner, 0.05)
    met, again, got = np.zeros(12, np.int64), np.zeros(12, np.int64), np.empty(12)
    sectors(*given[:6], bull_of(1.0, corner), 0.05, met)
    sectors_parallel(*given[:6], bull_of(1.0, corner), 0.05, again)
    joined(met, tips, 0.9, got)
    assert np.allclose(got, twin(*given, 0.9)) and 0.0 < got.min() < got.max()
    assert np.array_equal(met, again)
    # a side that leans is wider where it is higher, and its stock is met farther out
    cone = np.zeros(12, np.int64)
    sectors(*given[:6], tapered_of(1.0, corner, 0.5, 1.4), 0.05, cone)
    joined(cone, tips, 0.9, got)
    assert np.allclose(got, twin(*given, 0.9, 0.5, 1.4)) and not np.array_equal(cone, met)


@pytest.mark.parametrize("share", [0.2, 0.6, 1.0, 1.5])
def test_a_side_step_has_the_angle_of_its_closed_form(share):
    """Along a straight edge ae deep, theta = acos(1 - ae / r); the strip of a node widens it at the inner end."""
    stock, body = block(), tool(6.0, 0.0)
    edge = 12.0 + 1e-6  # of the stock, half a step in front of the first row that stands
    stock.top[:int(math.ceil((edge - stock.lattice.y0) / 0.1)), :] = -np.inf
    first = stock.lattice.y0 + 0.1 * math.ceil((edge - stock.lattice.y0) / 0.1) - 0.05
    y = first - 3.0 + 3.0 * share
    got = angles(stock, np.array([[8.0, y, 1.0], [20.0, y, 1.0]]), body)
    wanted = math.acos(1.0 - share)
    assert wanted - SECTOR <= got[0] <= wanted + 2.0 * SECTOR


def test_a_slot_is_half_a_turn_and_a_skim_is_nothing():
    stock, body = block(), tool(6.0, 0.0)
    line = np.array([[5.0, 15.0, 0.0], [25.0, 15.0, 0.0]])
    assert np.allclose(angles(stock, line, body), math.pi)
    assert not angles(stock, line + [0, 0, 2.0 - 0.9 * SKIN_SHARE * 3.0], body).any()
    assert not over_limit(stock, line, body, UNBOUNDED).any() and not within(stock, line, body, math.radians(150))


@pytest.mark.parametrize("body", [tool(4.0, 0.0), tool(4.0, 0.8), ball(4.0)], ids=["flat", "bull", "ball"])
def test_after_its_skims_a_pass_keeps_the_limit_and_so_does_each_skim(body):
    stock, most = block(), math.radians(100.0)
    # half of it along a wall of stock it may take, half in the full
    stock.top[:int((12.0 - stock.lattice.y0) / 0.1), :150] = -np.inf
    line = Line(np.array([[3.0, 11.5, 1.0], [27.0, 11.5, 1.0]]), False)
    made = skims(stock, line, body, most)
    assert made and not within(stock, line.points, body, most)
    assert all(min(s.points[:, 0]) > 11.0 for s in made)  # only where it would be too much
    heights = [s.points[0, 2] for s in made]
    assert heights == sorted(heights, reverse=True)
    assert heights[0] >= 2.0 - SKIN_SHARE * body.radius and heights[-1] - 1.0 <= SKIN_SHARE * body.radius
    for s in made:
        assert within(stock, s.points, body, most)
        stock.cut(s.points, body)
    assert within(stock, line.points, body, most) and not skims(stock, line, body, most)


def test_places_a_proof_named_are_over_the_limit_where_there_is_stock():
    stock, body, most = block(), tool(4.0, 0.0), math.radians(170.0)
    stock.top[:int((15.0 - stock.lattice.y0) / 0.1), :] = -np.inf
    points = dense(np.array([[5.0, 14.0, 1.0], [25.0, 14.0, 1.0]]), LOOK * 2.0)
    found = Counterexamples(packed={body.id: np.array([[15.0, 14.0, 1.0]])})
    bad = points[over_limit(stock, points, body, most, found)]
    assert 13.5 <= bad[:, 0].min() < 15.0 < bad[:, 0].max() <= 16.5
    assert not over_limit(stock, points, body, most).any()
    stock.cut(points, body)
    assert not over_limit(stock, points, body, most, found).any()


def test_the_sector_of_a_sine_is_that_of_its_angle():
    rng = np.random.default_rng(5)
    drawn = [*rng.uniform(-1.0, 1.0, 3000).tolist(), *np.sin(rng.uniform(-1.57, 1.57, 3000)).tolist()]
    for sine in [-2.0, -1.0, 1.0, 2.0, 0.0, *drawn]:
        angle = math.asin(min(max(sine, -1.0), 1.0)) / math.pi + 0.5
        assert _sector(sine) == min(int(angle * SECTORS), SECTORS - 1)
