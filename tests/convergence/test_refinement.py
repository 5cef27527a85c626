"""Errors fall with refinement as fast as theory says: slopes over several steps, never one figure."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from geometry.sampling import sample_surface
from tests.hand_parts import ball, field_of, slope_field, terraces
from tests.plan_checks import dense
from toolpath.cutter.cutter import Cutter
from toolpath.lines import thinned
from toolpath.passes.contours import contours
from toolpath.passes.pass_family import Dragged, FinishTarget, Promise, Swath

RADIUS = 12.0
SHAPES = {
    "sphere": lambda x, y: np.sqrt(RADIUS**2 - x**2 - y**2),
    "cylinder": lambda x, y: np.sqrt(RADIUS**2 - x**2) + 0.0 * y,
    "hollow": lambda x, y: -np.sqrt(RADIUS**2 - x**2 - y**2),
}


def slope_of(sizes, errors):
    """Exponent of the power law through the errors, by least squares in the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def exact_tip(name, xy, r):
    """Tip of a ball that rests on the true surface: its centre lies on the surface offset by r."""
    d2 = xy[:, 0] ** 2 if name == "cylinder" else (xy**2).sum(axis=1)
    if name == "hollow":
        return -np.sqrt((RADIUS - r) ** 2 - d2) - r
    return np.sqrt((RADIUS + r) ** 2 - d2) - r


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("r", [0.8, 3.0])
def test_tip_heights_converge_with_the_square_of_the_edge_length(name, r):
    counts = np.array([8, 16, 32, 64])
    xy = np.random.default_rng(1).uniform(-2.0, 2.0, (2000, 2))
    exact = exact_tip(name, xy, r)
    worst = []
    for n in counts:
        tree = TriangleTree(slope_field(SHAPES[name], size=8.0, n=int(n), base=-20.0))
        worst.append(float(np.abs(drop_tips(tree, xy, r, r) - exact).max()))
    assert slope_of(8.0 / counts, worst) == pytest.approx(2.0, abs=0.2)
    # the sagitta of the diagonal of a cell bounds them, more where the surface leans or is hollow
    assert (worst <= 1.25 * 2.0 * (8.0 / counts) ** 2 / (8.0 * RADIUS)).all()


@pytest.mark.parametrize("diameter", [2.0, 6.0])
def test_contours_converge_on_the_exact_offset_with_their_tolerance(diameter):
    # an L of two walls: an arc round its outer corner, a sharp turn in its inner one, as the plan makes them
    body, r = ball(diameter), diameter / 2
    tolerances = np.array([0.064, 0.032, 0.016, 0.008, 0.004, 0.002])
    arc = np.zeros((5, len(tolerances)))
    turn = np.zeros_like(arc)
    points = np.zeros(len(tolerances))
    for k, x in enumerate(np.linspace(0.0, 0.11, len(arc))):  # wherever the lattice falls
        field = field_of(terraces([x, 4 + x, 6 + x, 14 + x], [0, 4, 6, 14], [[2, 2, 2], [2, 6, 6], [2, 6, 2]]), body)
        everywhere = np.ones((field.lattice.ny, field.lattice.nx), bool)
        for m, tol in enumerate(tolerances):
            line = max(contours(field, 3.0, everywhere, tol / 2), key=lambda line: line.length)
            thin = thinned(line.points, tol / 2)
            p = dense(thin, 0.01)[:, :2]
            off = p[(p < [4.0 + x, 4.0]).all(axis=1)] - [4.0 + x, 4.0]
            arc[k, m] = np.abs(np.hypot(*off.T) - r).max()
            turn[k, m] = cKDTree(p).query([6.0 + x + r, 6.0 + r])[0]
            points[m] += len(thin)
    assert (arc.max(axis=0) <= tolerances).all() and (turn.max(axis=0) <= tolerances).all()
    assert slope_of(tolerances, arc.mean(axis=0)) == pytest.approx(1.0, abs=0.25)
    assert (np.diff(points) > 0).all()  # a line finer than asked for would not be one that follows the tolerance


@pytest.mark.parametrize("lean", [0.0, 0.5])
def test_the_scallop_of_parallel_passes_falls_with_the_square_of_the_side_step(lean):
    r, mesh = 2.0, slope_field(lambda x, y: lean * y, size=8.0, n=2, base=-9.0)
    field = field_of(mesh, ball(2 * r))
    normal = np.array([0.0, -lean, 1.0]) / math.hypot(1.0, lean)
    rng = np.random.default_rng(2)
    xy = rng.uniform(-1.0, 1.0, (3000, 2))
    points = np.column_stack([xy, lean * xy[:, 1]])
    tips = points + r * normal - [0.0, 0.0, r]
    steps = np.array([0.8, 0.4, 0.2, 0.1])
    left = []
    dragged = Dragged(Cutter.of(field.tool), field.tips, field.tree)
    for step in steps:
        promise = Promise(1.0, 1e-4, 0.3, 1.0)
        swath = Swath(dragged, FinishTarget(points, np.tile(normal, (len(points), 1)), tips, 0.05), promise, 0.0)
        at = step * np.arange(math.floor(swath.t[0] / step), math.ceil(swath.t[-1] / step) + 1)
        lines = [line for t in at.tolist() for line in swath.pass_at(t, float(step)).lines]
        centres = cKDTree(np.vstack([dense(line, 0.01) for line in lines]) + [0.0, 0.0, r])
        # highest place that is in no ball along the normals: distance of ball from plane, brute force
        left.append(max(_uncut(centres, points, normal, r)))
    along = steps * math.hypot(1.0, lean)
    np.testing.assert_allclose(left, r - np.sqrt(r * r - along**2 / 4.0), rtol=0.06, atol=3e-5)
    assert slope_of(steps, left) == pytest.approx(2.0, abs=0.2)


def _uncut(centres, points, normal, r):
    """How far along the normal each point must go to meet a ball, mm; by halving."""
    low, high = np.zeros(len(points)), np.full(len(points), 0.2)
    assert (centres.query(points + 0.2 * normal)[0] < r).all()
    for _ in range(16):
        mid = 0.5 * (low + high)
        inside = centres.query(points + mid[:, None] * normal)[0] < r
        low, high = np.where(inside, low, mid), np.where(inside, mid, high)
    return 0.5 * (low + high)


def test_the_area_of_a_patch_by_samples_converges_with_their_number():
    # share of a dome inside a circle in plan: a cap whose area is known
    mesh = slope_field(lambda x, y: np.sqrt(RADIUS**2 - x**2 - y**2), size=8.0, n=80)
    cap = 2.0 * math.pi * RADIUS * (RADIUS - math.sqrt(RADIUS**2 - 9.0))
    top = np.flatnonzero(mesh.face_ids == 2)
    densities = np.array([2.0, 8.0, 32.0, 128.0])
    errors = []
    for density in densities:
        off = []
        for seed in range(16):
            s = sample_surface(mesh, float(density), seed=seed, triangles=top)
            assert s.area.sum() == pytest.approx(mesh.areas[top].sum())
            off.append(float(s.area[np.hypot(*s.points[:, :2].T) < 3.0].sum()) - cap)
        errors.append(float(np.sqrt(np.mean(np.square(off)))))
    # samples thrown at random give -0.5; strata along the area do better
    assert slope_of(densities, errors) < -0.55
    assert errors[-1] < 0.005 * cap
