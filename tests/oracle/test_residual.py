"""The planner's measure of what passes leave, against tips every hundredth of a millimetre."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numba
import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.tool_body import ToolBody
from tests.hand_parts import ball, tool
from tests.plan_checks import dense
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap

SPACING = 0.004
TAPERED = ToolBody("T1", 1, 1.0, 0.5, 6.0, 0.5, 6.0, 0.5, 6.0, taper=0.1)


def slow(points, path, body):
    """Least distance from each point to the cutting part among dense tips (the flank counts as high as the flute)."""
    best = np.full(len(points), np.inf)
    r, flat = body.corner_radius, body.radius - body.corner_radius
    for c in dense(path, SPACING):
        u = np.maximum(np.hypot(points[:, 0] - c[0], points[:, 1] - c[1]) - flat, 0.0)
        w = np.maximum(c[2] + r - points[:, 2], 0.0)
        best = np.minimum(best, np.sqrt(u**2 + w**2) - r)
    return best


@pytest.mark.parametrize("body", [ball(3.0), tool(4.0, 1.0)], ids=lambda b: b.kind)
@pytest.mark.parametrize("seed", range(4))
def test_the_measure_is_that_of_dense_tips(body, seed):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(size=(7, 3)) * [1.5, 1.5, 0.4], axis=0)
    near = dense(path, 0.05)
    n = 3000
    c = near[rng.integers(0, len(near), n)]
    a, phi, off = rng.random(n) * 2 * np.pi, rng.random(n) * 0.5 * np.pi, rng.normal(size=n) * 0.01
    u = body.radius - body.corner_radius + (body.corner_radius + off) * np.sin(phi)
    points = c + np.column_stack([u * np.cos(a), u * np.sin(a),
                                  body.corner_radius - (body.corner_radius + off) * np.cos(phi)])
    normals = -np.column_stack([np.sin(phi) * np.cos(a), np.sin(phi) * np.sin(a), -np.cos(phi)])
    made = ResidualMap(points, normals)
    made.cut(path, body)
    true = slow(points, path, body)
    # the measure stops once a sample is inside the sweep; it is never below the truth by more than the sampling
    out = true > 1e-4
    assert out.sum() > 50
    seen = made.residual < UNTOUCHED
    assert (made.residual[seen & out] >= true[seen & out] - 2e-4).all()
    close = out & (true < 0.015)
    assert close.sum() > 20
    if body.kind == "bull":
        return  # on an inclined move the measure of a bull nose is an upper bound only
    np.testing.assert_allclose(made.residual[close & seen], true[close & seen], atol=2e-4)
    assert (made.residual[~out] <= 2e-4).all()


@pytest.mark.parametrize("body", [TAPERED, replace(TAPERED, corner_radius=0.4, diameter=2.0),
                                  replace(TAPERED, corner_radius=0.0)], ids=lambda b: b.kind)
@pytest.mark.parametrize("level", [True, False])
def test_the_measure_of_a_tapered_mill_is_that_of_dense_tips(body, level):
    rng = np.random.default_rng(3)
    path = np.cumsum(rng.normal(size=(7, 3)) * [1.5, 1.5, 0.0 if level else 0.4], axis=0)
    near = dense(path, 0.05)
    n = 700
    c, a = near[rng.integers(0, len(near), n)], rng.random(n) * 2 * np.pi
    high = rng.random(n) * body.flute_length
    outline = np.array([width(body, h) for h in high]) + np.abs(rng.normal(size=n) * 0.01)
    points = c + np.column_stack([outline * np.cos(a), outline * np.sin(a), high])
    # the normal only tells level places and walls apart
    made = ResidualMap(points, np.tile([0.6, 0.0, 0.8], (n, 1)))
    made.cut(path, body)
    off = points[:, None] - dense(path, 5.0 * SPACING)
    true = off_mill(body, np.hypot(off[..., 0], off[..., 1]), off[..., 2]).min(axis=1)
    out, seen = true > 1e-4, made.residual < UNTOUCHED
    assert (out & seen).sum() > 8
    assert (made.residual[seen & out] >= true[seen & out] - 5e-4).all()
    if level:
        np.testing.assert_allclose(made.residual[seen & out], true[seen & out], atol=5e-4)


def width(body, h):
    """Radius of a tapered mill at height h."""
    wide, high = body.corner_end
    if h >= high:
        return wide + body.taper * (h - high)
    r = body.corner_radius
    return body.radius - r + np.sqrt(max(r * r - (r - h) ** 2, 0.0))


@lru_cache
def outline_of(body):
    """Outline of a tapered mill that goes on above as points close together, and a tree of them."""
    at = 3.0 * body.flute_length * np.linspace(0.0, 1.0, 100_000)**2
    side = np.column_stack([[width(body, h) for h in at], at])
    end = np.linspace(0.0, side[0, 0], 20_000)
    return side, cKDTree(np.vstack([np.column_stack([end, np.zeros_like(end)]), side]))


def off_mill(body, rho, h):
    """Distance of places from the outline of a tapered mill, negative inside; infinite from a tenth of a mm on."""
    side, tree = outline_of(body)
    off = tree.query(np.stack([rho, h], axis=-1), distance_upper_bound=0.1)[0]
    return np.where((h >= 0.0) & (rho < np.interp(h, side[:, 1], side[:, 0])), -off, off)


def test_several_passes_only_lower():
    rng = np.random.default_rng(9)
    points = rng.random((500, 3)) * [10, 10, 0.0]
    made = ResidualMap(points, np.tile([0.0, 0, 1], (500, 1)))
    before = made.residual.copy()
    for y in (2.0, 5.0, 8.0):
        made.cut(np.array([[0, y, 0.0], [10, y, 0.0]]), ball(4.0))
        assert (made.residual <= before).all()
        before = made.residual.copy()
    off = np.min(np.abs(points[:, 1, None] - [2.0, 5.0, 8.0]), axis=1)
    np.testing.assert_allclose(made.residual[off < 1.9], (2 - np.sqrt(4 - off**2))[off < 1.9], atol=1e-9)


@pytest.mark.parametrize("height", [0.01, 0.05, 0.3])
def test_a_plane_below_the_bottom_is_measured_as_far_as_the_scallop_goes(height):
    points = np.array([[5.0, 5.0, 0.0]])
    made = ResidualMap(points, np.array([[0.0, 0, 1]]), margin=0.5)
    made.cut(np.array([[0, 5, height], [10, 5, height]]), tool(4.0, 0.0))
    assert made.residual[0] == pytest.approx(height)


def test_a_sharp_end_above_the_foot_of_a_wall_leaves_it():
    points, normals = np.array([[5.0, 5.0, 0.0]]), np.array([[0.0, 1.0, 0]])
    made = ResidualMap(points, normals)
    made.cut(np.array([[0, 7.0, 0.01], [10, 7.0, 0.01]]), tool(4.0, 0.0))
    assert made.residual[0] == 1e3
    made.cut(np.array([[0, 7.0, -0.5], [10, 7.0, -0.5]]), tool(4.0, 0.0))
    assert made.residual[0] <= 1e-9
    empty = ResidualMap(np.zeros((0, 3)), np.zeros((0, 3)))
    empty.cut(np.zeros((2, 3)), ball(2.0))


@pytest.mark.parametrize("body", [tool(3.0, 0.0), tool(4.0, 1.0)], ids=lambda b: b.kind)
@pytest.mark.parametrize("upright", [False, True])
def test_a_place_is_left_with_no_more_than_its_sample_says(body, upright):
    """A sample that covers a place: a single move leaves no more than that anywhere in the square that holds it."""
    rng = np.random.default_rng(5)
    n, half = 300, 0.35
    normal = np.array([0.6, -0.8, 0.0]) if upright else np.array([0.0, 0.0, 1.0])
    along = np.array([0.8, 0.6, 0.0])
    across = np.array([0.0, 0.0, 1.0]) if upright else np.array([-0.6, 0.8, 0.0])
    points = rng.uniform(-8, 8, (n, 1)) * along + rng.uniform(-5, 5, (n, 1)) * across
    made = ResidualMap(points, np.tile(normal, (n, 1)), margin=0.015, covers=np.full(n, half))
    steps = np.linspace(-half, half, 9)
    e, f = (x.reshape(-1, 1) for x in np.meshgrid(steps, steps))
    # a square in its own plane; a level one may be turned, so the disc in it counts
    dense_ = points[:, None] + e * along + f * across if upright else \
        points[:, None] + np.minimum(1.0, half / np.maximum(np.hypot(e, f), 1e-9)) * (e * along + f * across)
    every = ResidualMap(dense_.reshape(-1, 3), np.tile(normal, (dense_.size // 3, 1)), margin=0.015)
    off = body.radius + 0.004
    for k in range(-2, 3):
        middle = off * normal + k * 1.9 * across if upright else np.array([0, 0, 0.004]) + k * 2.9 * across
        path = np.array([middle - 7.0 * along, middle + (6.0 + 0.2 * k) * along])
        made.cut(path, body)
        every.cut(path, body)
    said = made.residual < 0.015
    assert 100 < said.sum() < n
    most = every.residual.reshape(n, -1).max(axis=1)
    assert (most - made.residual)[said].max() <= 1e-9
    assert made.residual.min() == pytest.approx(0.004, abs=1e-6)


def test_the_same_bytes_on_one_thread_and_two():
    rng = np.random.default_rng(2)
    points = rng.random((60_000, 3)) * [20.0, 16.0, 2.0]
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])[rng.integers(0, 3, len(points))]
    path = np.cumsum(rng.normal(size=(60, 3)) * [3.0, 3.0, 0.1], axis=0) % [20.0, 16.0, 2.0]
    threads, found = numba.get_num_threads(), []
    try:
        for n in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(n)
            made = ResidualMap(points, normals, covers=np.full(len(points), 0.02))
            made.cut(path, ball(3.0))
            found.append(made.residual)
    finally:
        numba.set_num_threads(threads)
    assert np.array_equal(*found) and (found[0] < UNTOUCHED).mean() > 0.2
