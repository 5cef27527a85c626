"""Cutting parts and bodies in fixtures, between any points: closed forms, and random bodies against many directions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.hand_parts import tool
from verify.kernels.stock import CUTTER, FIXTURE, HOLDER, NECK
from verify.material import fixture_contact
from verify.material.fixture_contact import TurnedOutline, fixture_contacts
from verify.material.stock_pass import rapid_arrays
from verify.model import ProofSetup
from verify.moves import Moves
from verify.tool_axes import ToolAxes

BOUNDS = np.array([[0.0, 0.0, 0.0], [16.0, 12.0, 6.0]])
HALF = math.radians(10.0)
NEEDLE = ToolBody("T1", 1, 3.0, 0.0, 8.6, 3.0, 8.6, 3.0, 30.0, (), "chamfer", 0.0, 1.5 / math.tan(HALF))


def contacts(body, tips, box, *, feed=True, axes=None, rapid=0.0):
    """Events of a tool over straight moves past one fixture, by code."""
    tips = np.asarray(tips, float)
    n = len(tips) - 1
    moves = Moves(tips[:-1].copy(), tips[1:].copy(), np.full(n, feed), np.zeros(n, np.int32), axes)
    setup = ProofSetup(fixtures=(np.asarray(box, float),), clearance_rapid=rapid)
    found = fixture_contacts(moves, [body], setup, BOUNDS, rapid_arrays(moves, setup))
    return {int(e[1]): e for e in found}


@pytest.mark.parametrize("edge, depth", [
    (10.0, 0.15),  # the shortest way out is up
    (16.0, 0.0353 * math.cos(HALF) + 0.15 * math.sin(HALF))])  # and here it is aside, square to the cone
def test_the_point_of_a_cone_runs_in_the_top_of_a_clamp(edge, depth):
    run = [(16.0353, -12.0, 4.8), (16.0353, 24.0, 4.8)]
    found = contacts(NEEDLE, run, [[edge, -3.0, 0.0], [24.0, 15.0, 4.95]])
    assert set(found) == {CUTTER + FIXTURE}
    assert found[CUTTER + FIXTURE][2] == pytest.approx(depth, abs=1e-6)
    assert 4.8 - 1e-9 <= found[CUTTER + FIXTURE][6] <= 4.95 or edge > 10.0
    assert not contacts(NEEDLE, run, [[edge, -3.0, 0.0], [24.0, 15.0, 4.7995]])


@pytest.mark.parametrize("depth", [0.2, 0.04, 0.005])
@pytest.mark.parametrize("corner", [0.0, 0.3, 2.0])
def test_the_rim_of_a_leaning_end_dips_into_the_top_of_a_clamp(depth, corner):
    body, lean = tool(4.0, corner, neck=20.0, stickout=60.0), math.radians(45.0)
    axis = np.array([0.0, -math.sin(lean), math.cos(lean)])
    low = (2.0 - corner) * math.sin(lean) + corner * (1.0 - math.cos(lean))
    tip = np.array([24.07, 6.03, 3.0 - depth + low])
    axes = ToolAxes.between(np.tile(axis, (2, 1)), np.tile(axis, (2, 1)))
    found = contacts(body, [tip + [0, 0, 2.0], tip, tip + [0, 0, 2.0]], [[18.0, -20.0, 0.0], [40.0, 30.0, 3.0]],
                     axes=axes)
    assert found[CUTTER + FIXTURE][2] == pytest.approx(depth, abs=2e-4 * max(corner, 0.01))


def test_a_tool_that_swings_over_a_clamp_is_seen_at_its_lowest():
    body = tool(4.0, 0.0, neck=20.0, stickout=60.0)
    first, last = (np.array([[0.0, -math.sin(a), math.cos(a)]]) for a in (-0.3, 0.3))
    axes = ToolAxes.between(first, last)
    tip = np.array([20.0, 5.0, 3.3])
    found = contacts(body, [tip, tip], [[18.0, -20.0, 0.0], [40.0, 30.0, 3.0]], axes=axes)
    assert found[CUTTER + FIXTURE][2] == pytest.approx(2.0 * math.sin(0.3) - 0.3, abs=1e-3)


def test_necks_and_holders_count_from_their_own_surface_and_rapids_with_their_clearance():
    body = replace(tool(4.0, 0.0, neck=20.0, stickout=30.0), neck_diameter=3.0,
                   holder=(HolderFrustum(20.0, 20.0, 30.0),))
    wall = [[1.4, -5.0, 6.0], [9.0, 5.0, 60.0]]
    found = contacts(body, [(0.0, -9.0, 0.0), (0.0, 9.0, 0.0)], wall)
    depth, clear = found[NECK + FIXTURE][2:4]
    assert depth - clear == pytest.approx(0.1, abs=1e-6)
    assert found[HOLDER + FIXTURE][2] - found[HOLDER + FIXTURE][3] == pytest.approx(8.6, abs=1e-6)
    rapid = contacts(body, [(0.0, -9.0, 0.0), (0.0, 9.0, 0.0)], wall, feed=False, rapid=0.5)
    assert rapid[NECK + FIXTURE][3] == pytest.approx(clear + 0.5)
    assert rapid[NECK + FIXTURE][2] - rapid[NECK + FIXTURE][3] == pytest.approx(0.1, abs=1e-6)


def test_random_bodies_meet_where_no_direction_sets_them_apart():
    rng = np.random.default_rng(3)
    for _ in range(40):
        rings = np.array([[0.0, 0.0], [rng.uniform(0, 2), 0.0], [rng.uniform(1, 3), rng.uniform(0, 2)],
                          [rng.uniform(1, 3), rng.uniform(2, 6)]])
        body, box = TurnedOutline(rings, 0, 0.0), np.sort(rng.uniform(-4, 4, (2, 3)), axis=0) + [[0.0], [0.05]]
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        start = rng.uniform(-6, 6, 3)
        one = fixture_contact._Sweep(start[None], (start + 2.0 * rng.normal(size=3))[None], axis[None], axis[None])
        n = rng.normal(size=(20_000, 3))
        n /= np.linalg.norm(n, axis=1)[:, None]
        least = float((fixture_contact._body_support(one, body, -n) + fixture_contact._box_support(box, n)).min())
        overlap, way = fixture_contact._least_overlap(one, body, box)
        apart = fixture_contact._between(one, body, box)
        assert overlap <= least + 1e-9
        assert (apart is None) == (overlap > 0.0) or abs(overlap) < 1e-3
        if apart is not None:
            on = fixture_contact._body_support(one, body, apart[None])[0]
            assert on + fixture_contact._box_support(box, -apart) < 0.0
        assert abs(np.linalg.norm(way) - 1.0) < 1e-12


def test_a_long_program_beside_a_clamp_takes_one_direction():
    n = 20_000
    tips = np.column_stack([np.linspace(0.0, 50.0, n), np.full(n, -6.01), np.full(n, 1.0)])
    assert not contacts(tool(12.0, 0.0), tips, [[0.0, 0.0, 0.0], [50.0, 9.0, 9.0]])
