"""When places are gone from the air inwards: lengths of ways against closed forms, discs against the obvious twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import box_mesh, field_of, joined, tool
from toolpath.kernels.march import march, spread
from toolpath.roughing.inward_fronts import DISC, Inwards
from toolpath.stock.stock_map import StockMap


def far_from(seed, inside, step):
    far = np.full(inside.shape, np.inf)
    far[seed] = 0.0
    march(far, inside, step)
    return far


@pytest.mark.parametrize("step", [0.2, 0.1, 0.05])
def test_ways_in_the_open_are_straight_to_first_order(step):
    n = int(10.0 / step) + 1
    far = far_from((0, 0), np.ones((n, n), np.bool_), step)
    y, x = np.mgrid[:n, :n] * step
    error = far - np.hypot(x, y)
    assert error.min() > -1e-9 and error.max() < 0.45 * step * math.log(10.0 / step)
    assert np.allclose(far[0], x[0])


def test_ways_go_round_what_is_in_the_way():
    step = 0.05
    inside = np.ones((121, 121), np.bool_)  # 6 x 6 mm, a wall from the left, 4 mm long, 3 mm up
    inside[60, :81] = False
    far = far_from((40, 20), inside, step)  # (1, 2)
    wanted = 2.0 * math.hypot(4.0 + step - 1.0, 1.0)  # round its end, and as far back above
    assert far[80, 20] == pytest.approx(wanted, rel=0.03) and far[60, 10] == np.inf


def test_what_is_shut_off_is_not_reached():
    inside = np.ones((20, 20), np.bool_)
    inside[:, 10] = False
    far = far_from((5, 5), inside, 0.1)
    assert np.isfinite(far[:, :10]).all() and not np.isfinite(far[:, 10:]).any()


def test_discs_cover_as_their_twin_says():
    rng = np.random.default_rng(2)
    when = np.where(rng.random((17, 23)) < 0.2, rng.uniform(0.0, 5.0, (17, 23)), np.inf)
    radius, out = rng.uniform(0.0, 0.5, (17, 23)), np.full((17, 23), np.inf)
    spread(when, radius, 0.1, out)
    i, j = np.mgrid[:17, :23]
    twin = np.full((17, 23), np.inf)
    for a, b in np.argwhere(np.isfinite(when)):
        held = np.hypot(i - a, j - b) * 0.1 <= radius[a, b] + 1e-12
        twin[held] = np.minimum(twin[held], when[a, b])
    assert (out == twin).mean() > 0.999  # a node on the very rim may fall to either side


def channel(width=8.0, length=24.0):
    """A channel along X between two walls 6 mm high, and a block of stock that stands over all of it."""
    mesh = joined(box_mesh([0, 0, -2], [length, 4, 6]), box_mesh([0, 4 + width, -2], [length, 8 + width, 6]),
                  box_mesh([0, 4, -2], [length, 4 + width, 0]))
    field = field_of(mesh, tool(4.0, 0.0))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([length, 8 + width, 6.5]), 0.1)
    return field, stock


def test_borders_of_what_is_gone_run_from_wall_to_wall():
    field, stock = channel()
    lat = field.lattice
    y, x = np.meshgrid(lat.y0 + lat.step * np.arange(lat.ny), lat.x0 + lat.step * np.arange(lat.nx), indexing="ij")
    area = (x > 0) & (x < 24) & (y > 6) & (y < 10)
    ways = Inwards.over(field, stock, 4.5, area, 0.2, 0.05)
    assert ways is not None and not ways.shut()
    assert 10.0 < ways.last < 16.0  # from both mouths to the middle, less what is in the air before the mouth
    for when in np.arange(4.0, 9.0, 1.0):
        lines = ways.lines(float(when))
        assert len(lines) == 2  # one from each mouth
        for line in lines:
            assert not line.closed
            assert sorted(np.round(line.points[[0, -1], 1], 1)) == pytest.approx([6.2, 9.8], abs=0.25)
            assert np.ptp(line.points[:, 0]) < DISC * 2.0 + 0.3  # bent by no more than a disc
    one = {round(float(line.points[:, 0].mean()), 1) for t in (5.0, 6.0) for line in ways.lines(t)}
    left = sorted(v for v in one if v < 12.0)
    assert left[1] - left[0] == pytest.approx(1.0, abs=0.15)  # a mm of way later, a mm on


def test_nothing_stands_and_nothing_is_made():
    field, stock = channel()
    area = np.ones((field.lattice.ny, field.lattice.nx), np.bool_)
    assert Inwards.over(field, stock, 6.6, area, 0.2, 0.05) is None
    assert Inwards.over(field, stock, 4.5, ~area, 0.2, 0.05) is None
