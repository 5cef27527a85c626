"""The shell of a tool in the stock, against every place inside the tool asked one by one."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, box_mesh, tool
from toolpath.five_axis.oriented_motion import CELLS, loaded
from toolpath.stock.stock_map import StockMap
from toolpath.stock.tool_shell import shells
from zones.reach.assembly import Clearances, Disc

STEP, DEEP = 0.1, 0.2
PART = TriangleTree(box_mesh([0, 0, -2], [30, 30, 0]))
CLEAR = Clearances()
DISCS = (Disc("shank", 3.5, 20.0), Disc("holder", 8.0, 24.0), Disc("holder", 8.0, 30.0), Disc("holder", 6.0, 34.0))
BODIES = {"flat": tool(6.0, 0.0, neck=20.0, stickout=24.0), "bull": tool(6.0, 1.0, neck=20.0, stickout=24.0),
          "ball": ball(6.0, neck=20.0, stickout=24.0)}


def terrain(rng, boxes):
    """Stock of upright boxes over the part, some of it as high as the part."""
    stock = StockMap.box(PART, np.array([0.0, 0.0, -2.0]), np.array([30.0, 30.0, 0.0]), STEP)
    lat = stock.lattice
    for _ in range(boxes):
        low, size, high = rng.uniform(0.0, 28.0, 2), rng.uniform(0.1, 6.0, 2), rng.uniform(0.5, 30.0)
        i0, i1 = np.searchsorted(lat.y0 + STEP * np.arange(lat.ny), [low[1], low[1] + size[1]])
        j0, j1 = np.searchsorted(lat.x0 + STEP * np.arange(lat.nx), [low[0], low[0] + size[0]])
        stock.top[i0:i1, j0:j1] = stock.cover[i0:i1, j0:j1] = high
        if rng.random() < 0.3:
            stock.part[i0:i1, j0:j1] = high
    return stock


def solid(body, thick, under):
    """Of the tool's own frame: is a place in the cutting part made smaller, and in one of the other bodies."""
    r, wide, flat = body.corner_radius, body.radius, body.radius - body.corner_radius

    def half(h, off):  # of the cutting part, ``off`` inside its outside
        low = np.maximum(r - h, 0.0)
        inside = np.sqrt(np.maximum((r - off) ** 2 - low**2, 0.0)) if r > off else np.full_like(h, r)
        return np.where((r > off) & (low > r - off), -np.inf, flat + inside)

    def cutter(rho, h):
        low = np.maximum(r - np.maximum(h - under, 0.0), 0.0)
        side = flat + np.sqrt(np.maximum(r * r - low**2, 0.0)) - thick
        at = np.minimum(np.maximum(half(h, under), side), wide - thick)
        return (h >= under) & (h <= body.flute_length) & (rho <= np.where(np.isneginf(half(h, under)), -1.0, at))

    def others(rho, h):
        neck = (rho <= 0.5 * body.neck_diameter + CLEAR.neck) & (h >= body.flute_length) & (h <= body.neck_length)
        shank = (rho <= 0.5 * body.shank_diameter + CLEAR.shank) & (h >= body.neck_length) & (h <= body.stickout)
        return np.logical_or.reduce([neck, shank, *((rho <= d.radius) & (h >= d.height) for d in DISCS)])

    return cutter, others


def deepest(stock, tip, axis, body, thick, under, grown):
    """mm that stock is in the tool, over a node, at most; the tool is made wider by ``grown``."""
    lat, most = stock.lattice, 0.0
    x, y = np.meshgrid(lat.x0 + STEP * np.arange(lat.nx), lat.y0 + STEP * np.arange(lat.ny))
    low = tip[2] - 3.0 if grown > 0.0 else tip[2] - 2.0
    for where, bare in zip(solid(body, thick, under), (False, True), strict=True):
        stands = np.where(stock.top > stock.part, stock.top, -np.inf) if bare else stock.top
        seen = stands > low
        within, high = np.zeros(int(seen.sum())), stands[seen]
        for z in np.arange(low, float(stock.top.max()), DEEP):
            rel = np.column_stack([x[seen], y[seen], np.full(len(high), z)]) - tip
            h = rel @ axis
            rho = np.linalg.norm(rel - h[:, None] * axis, axis=1)
            within += DEEP * (where(np.maximum(rho - grown, 0.0), h) & (high > z))
        most = max(most, float(within.max(initial=0.0)))
    return most


@pytest.mark.parametrize("kind", BODIES)
def test_a_pose_is_loaded_where_a_place_inside_the_tool_is_in_the_stock(kind):
    rng = np.random.default_rng(len(kind) + ord(kind[0]))
    body, seen = BODIES[kind], [0, 0]
    for _ in range(5):
        stock = terrain(rng, 8)
        for _ in range(8):
            axis = rng.normal(size=3) * [0.5, 0.5, 0.0] + [0.0, 0.0, 1.0]
            axis /= np.linalg.norm(axis)
            tip = np.array([*rng.uniform(2.0, 28.0, 2), rng.uniform(0.5, 28.0)])
            told = bool(loaded(stock, tip[None], axis[None], body, DISCS, CLEAR, 0.6)[0])
            under = max(min(0.6, 0.08 * body.diameter), CELLS * STEP)
            surely = deepest(stock, tip, axis, body, 0.6, under, -1.5 * STEP)
            at_all = deepest(stock, tip, axis, body, 0.6, under, 1.5 * STEP)
            if surely > 3.0 * DEEP:
                assert told, (tip, axis, surely)
                seen[0] += 1
            if at_all == 0.0:
                assert not told, (tip, axis)
                seen[1] += 1
    assert min(seen) > 8, seen


def test_boxes_change_no_answer():
    """Every place asked by itself, over heights with holes, from below everything to above it."""
    rng = np.random.default_rng(5)
    stock = terrain(rng, 40)
    stock.top[rng.random(stock.top.shape) < 0.2] = -np.inf
    lat, body = stock.lattice, BODIES["bull"]
    flank, bodies = shells(body, DISCS, CLEAR, 0.6, 0.48, STEP, 40.0)
    tips = np.column_stack([rng.uniform(-5.0, 35.0, (400, 2)), rng.uniform(-3.0, 34.0, 400)])
    axes = rng.normal(size=(400, 3)) * [0.6, 0.6, 0.0] + [0.0, 0.0, 1.0]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    first = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second, want = np.cross(axes, first), np.zeros((2, 400), np.bool_)
    for s, shell in enumerate((flank, bodies)):
        for k in range(400):
            p = tips[k] + shell.places @ np.array([first[k], second[k], axes[k]])
            j = np.rint((p[:, 0] - lat.x0) / STEP).astype(int)
            i = np.rint((p[:, 1] - lat.y0) / STEP).astype(int)
            on = (i >= 0) & (j >= 0) & (i < lat.ny) & (j < lat.nx)
            top = stock.top[i[on], j[on]]
            want[s, k] = ((top > p[on, 2]) & ((s == 0) | (top > stock.part[i[on], j[on]]))).any()
    got = stock.stands_in(tips, axes, flank, bodies)
    np.testing.assert_array_equal(got, want.any(axis=0))
    assert 40 < got.sum() < 360 and (want[1] & ~want[0]).sum() >= 3


def test_what_is_cut_is_gone_from_the_boxes_too():
    body, up = BODIES["flat"], np.array([[0.0, 0.0, 1.0]])
    stock = terrain(np.random.default_rng(3), 0)
    stock.top[:] = stock.cover[:] = 5.0
    tip = np.array([[15.0, 15.0, 1.0]])
    assert loaded(stock, tip, up, body, (), CLEAR, 0.6)[0]
    whole = stock.copied()
    stock.cut(np.array([[10.0, 15.0, 1.0], [20.0, 15.0, 1.0]]), replace(body, diameter=8.0))
    assert not loaded(stock, tip, up, body, (), CLEAR, 0.6)[0]
    assert loaded(whole, tip, up, body, (), CLEAR, 0.6)[0]
    stock.become(whole)
    assert loaded(stock, tip, up, body, (), CLEAR, 0.6)[0]
