"""Waterlines against the exact offset of a plan with upright walls."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from tests.hand_parts import ball, field_of, terraces, tool
from tests.plan_checks import dense
from toolpath.passes.contours import ROUND, contours, lines_at, rings, wall_distance

shapely = pytest.importorskip("shapely")

HEIGHTS = np.array([[0, 6, 6, 0], [6, 6, 0, 6], [0, 0, 6, 0]], float)
XS, YS = np.array([0, 3, 8, 11, 14.0]), np.array([0, 4, 7.5, 12.0])


def plan():
    """The walls as a polygon in plan: an L, a bay, and blocks that meet at their corners only."""
    cells = [shapely.box(XS[j], YS[i], XS[j + 1], YS[i + 1])
             for i in range(3) for j in range(4) if HEIGHTS[i, j] > 0]
    return shapely.union_all(cells)


@pytest.mark.parametrize("tolerance", [0.01, 0.002])
@pytest.mark.parametrize("body", [ball(2.0), ball(4.0), tool(4.0, 0.5)], ids=lambda b: f"{b.kind}")
def test_waterlines_are_the_offset_of_the_walls(body, tolerance):
    field = field_of(terraces(XS, YS, np.maximum(HEIGHTS, 0.0), -2.0), body)
    lines = contours(field, 1.0, np.ones((field.lattice.ny, field.lattice.nx), bool), tolerance)
    assert lines and all(line.closed for line in lines)
    exact = plan().buffer(body.radius, quad_segs=400).boundary
    walked = dense(np.vstack([line.points for line in lines[:1]]), 0.02)
    for line in lines[1:]:
        walked = np.vstack([walked, dense(line.points, 0.02)])
    away = shapely.distance(shapely.points(walked[:, :2]), exact)
    assert away.max() <= 1.1 * tolerance
    # and the whole offset is there, but for cusps narrower than the lattice sees
    made = shapely.MultiLineString([line.points[:, :2] for line in lines])
    back = shapely.points([exact.interpolate(s).coords[0] for s in np.arange(0, exact.length, 0.05)])
    missing = shapely.distance(back, made)
    assert np.quantile(missing, 0.97) <= 1.1 * tolerance and missing.max() <= 2.0 * field.lattice.step


@pytest.mark.parametrize("body", [ball(4.0), tool(4.0, 0.0), tool(4.0, 0.5)], ids=lambda b: f"{b.kind}")
def test_every_point_of_a_waterline_is_free_touches_and_has_the_wall_on_its_right(body):
    field = field_of(terraces(XS, YS, np.maximum(HEIGHTS, 0.0), -2.0), body)
    exact = plan().buffer(body.radius, quad_segs=2000)
    for line in contours(field, 1.0, np.ones((field.lattice.ny, field.lattice.nx), bool), 0.002):
        at = line.points + np.array([0.0, 0.0, 1e-5])
        assert not field.blocked_by_cutter(at).any()
        assert shapely.distance(shapely.points(line.points[:, :2]), exact.boundary).max() < 5e-4
        step = np.diff(line.points[:, :2], axis=0)
        length = np.linalg.norm(step, axis=1)
        right = np.column_stack([step[:, 1], -step[:, 0]]) / np.maximum(length, 1e-12)[:, None]
        probe = line.points[:-1, :2] + 0.5 * step + 0.02 * right
        inside = shapely.contains(exact, shapely.points(probe))
        assert inside[length > 0.02].mean() > 0.99


def test_distances_from_walls_are_exact_and_the_same_on_one_thread_and_two():
    body, threads, found = ball(2.0), numba.get_num_threads(), []
    exact = plan().buffer(body.radius, quad_segs=400)
    try:
        for n in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(n)
            field = field_of(terraces(XS, YS, np.maximum(HEIGHTS, 0.0), -2.0), body)
            found.append(wall_distance(field, 1.0, np.ones((field.lattice.ny, field.lattice.nx), bool)))
    finally:
        numba.set_num_threads(threads)
    assert np.array_equal(*found)
    rows, cols = np.nonzero(found[0] > 0.0)
    true = shapely.distance(shapely.points(field.lattice.nodes(rows, cols, 0.0)[:, :2]), exact)
    # a chord is off the round by step^2 / (4 r) at the most; cusps are narrower than the lattice sees
    off = np.abs(found[0][rows, cols] - true)
    assert np.quantile(off, 0.97) <= field.lattice.step**2 / (4.0 * body.radius) and off.max() <= field.lattice.step


@pytest.mark.parametrize("seed", range(6))
def test_rings_are_lines_of_the_distance_of_all_nodes(seed):
    """Only nodes that a line may cross beside are measured; the lines have the same bytes."""
    rng = np.random.default_rng(seed)
    body = [ball(2.0), tool(3.0, 0.0), tool(4.0, 0.5)][seed % 3]
    field = field_of(terraces(XS, YS, np.maximum(HEIGHTS, 0.0), -2.0), body)
    lat, firsts, spacing = field.lattice, tuple(rng.uniform(0.02, 1.5, 2).tolist()), float(rng.uniform(0.2, 1.6))
    active = np.zeros((lat.ny, lat.nx), bool)
    low, high = rng.integers(0, 20, 2), [lat.ny, lat.nx] - rng.integers(0, 20, 2)
    active[low[0]:high[0], low[1]:high[1]] = True
    far = wall_distance(field, 1.0, np.ones_like(active))
    widest, found = far[active].max(), list(rings(field, 1.0, active, firsts, spacing))
    each = [np.arange(min(f, 0.9 * widest), widest, spacing)[::-1] for f in firsts]
    at = [(d, 0.0 if d == ds[-1] else ROUND * spacing) for ds in each for d in ds]
    for lines, (distance, rounded) in zip(found, at, strict=True):
        twin = lines_at(field, 1.0, far, distance, active, (lat.x0, lat.y0), rounded)
        # places are counted from the corner of the area, or from that of the lattice
        assert len(lines) == len(twin)
        for one, other in zip(lines, twin, strict=True):
            assert one.closed == other.closed and np.abs(one.points - other.points).max() < 1e-12
