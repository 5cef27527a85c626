"""Residuals against closed forms."""

import itertools

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from verify.moves import Moves
from verify.surface.removal import residual_on_normals

BALL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0)
FLAT = ToolBody("T2", 2, 4.0, 0.0, 8.0, 3.8, 20.0, 6.0, 45.0)
BULL = ToolBody("T3", 3, 6.0, 1.0, 8.0, 5.8, 20.0, 6.0, 45.0)


def path(points, tool=0):
    points = np.asarray(points, float)
    m = len(points) - 1
    return Moves(points[:-1], points[1:], np.ones(m, bool), np.full(m, tool, np.int32))


def up(xy, z=0.0):
    xy = np.atleast_2d(xy)
    p = np.column_stack([xy, np.full(len(xy), z)])
    return p, np.tile([0.0, 0.0, 1.0], (len(xy), 1))


def test_ball_slot_leaves_a_round_bottom():
    y = np.linspace(-1.4, 1.4, 57)
    p, n = up(np.column_stack([np.zeros_like(y), y]), 0.0)
    res, who = residual_on_normals(p, n, np.full(len(p), 5.0), path([[-10, 0, 0], [10, 0, 0]]), [BALL])
    np.testing.assert_allclose(res, 1.5 - np.sqrt(1.5**2 - y**2), atol=1e-9)
    assert (who == 0).all()


def test_two_ball_passes_leave_the_exact_cusp():
    step = 0.3
    p, n = up([[0.0, step / 2]])
    moves = path([[-5, 0, 0], [5, 0, 0], [5, step, 0], [-5, step, 0]])
    res, _ = residual_on_normals(p, n, np.array([1.0]), moves, [BALL])
    exact = 1.5 - np.sqrt(1.5**2 - (step / 2) ** 2)
    assert res[0] == pytest.approx(exact, abs=1e-9)
    assert res[0] == pytest.approx(step**2 / (8 * 1.5), abs=2e-5)


@pytest.mark.parametrize("tool", [FLAT, BULL])
def test_flat_floor_is_left_clean_and_a_gouge_is_as_deep_as_planted(tool):
    rng = np.random.default_rng(1)
    p, n = up(rng.uniform(-4, 4, (200, 2)))
    rows = np.arange(-5, 5.1, 1.0)
    zig = [[x, y, 0.0] for k, y in enumerate(rows) for x in ((-6, 6) if k % 2 == 0 else (6, -6))]
    res, _ = residual_on_normals(p, n, np.full(200, 1.0), path(zig), [tool])
    assert np.abs(res).max() < 1e-8
    deep = np.array(zig)
    deep[8:10, 2] = -0.02
    res, who = residual_on_normals(p, n, np.full(200, 1.0), path(deep), [tool])
    assert res.min() == pytest.approx(-0.02, abs=1e-8)
    assert who[np.argmin(res)] in (7, 8, 9)


def test_flank_leaves_the_wall_and_a_tool_behind_a_thin_wall_does_not_count():
    z = np.linspace(1.6, 6, 12)
    p = np.column_stack([np.zeros(12), np.zeros(12), z])
    n = np.tile([0.0, -1.0, 0.0], (12, 1))
    near = path([[-5, -1.5, 0], [5, -1.5, 0]])
    behind = path([[-5, 1.5 + 0.4, 0], [5, 1.5 + 0.4, 0]])
    assert np.abs(residual_on_normals(p, n, np.full(12, 1.0), near, [BALL])[0]).max() < 1e-9
    np.testing.assert_array_equal(residual_on_normals(p, n, np.full(12, 1.0), behind, [BALL])[0], 1.0)


def test_threads_do_not_change_a_byte():
    rng = np.random.default_rng(3)
    p = rng.uniform(-10, 10, (4000, 3)) * [1, 1, 0.2]
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    walk = rng.uniform(-10, 10, (300, 3)) * [1, 1, 0.2]
    one = residual_on_normals(p, n, np.ones(4000), path(walk), [BALL], threads=1)
    two = residual_on_normals(p, n, np.ones(4000), path(walk), [BALL], threads=2)
    assert one[0].tobytes() == two[0].tobytes() and one[1].tobytes() == two[1].tobytes()


@pytest.mark.parametrize("tool", [BALL, FLAT, BULL])
def test_the_grid_changes_nothing(tool):
    from geometry.kernels.cutter_sizes import CutterSizes
    from verify.kernels.sweep import cutter_interval

    rng = np.random.default_rng(5)
    p = rng.uniform(-6, 6, (400, 3)) * [1, 1, 0.3]
    n = rng.normal(size=(400, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    walk = rng.uniform(-6, 6, (61, 3)) * [1, 1, 0.3]
    res, _who = residual_on_normals(p, n, np.ones(400), path(walk), [tool])
    sizes = CutterSizes(tool.radius, tool.corner_radius, tool.flute_length)
    for i in range(400):
        best = 1.0
        for a, b in itertools.pairwise(walk):
            lo, hi = cutter_interval(*(p[i] - a), *n[i], *(b - a), sizes)
            if lo <= hi and hi >= -1e-6:
                best = min(best, lo)
        assert res[i] == pytest.approx(best, abs=1.01e-8)  # what a move must take to count
