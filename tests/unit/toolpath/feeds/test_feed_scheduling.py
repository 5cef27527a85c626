"""Feeds along a pass through layers: what stands in front decides, the least of it for a guard's way round."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from service.from_wire import parse_setup, tool_bodies
from service.stages.job_inputs import JobInputs
from tests.hand_parts import ball, box_mesh, tool
from toolpath.feeds.feed_scheduling import ANGLE, GUARD, STEP, Pace, paced
from toolpath.linking.ramp_entry import EASE_SHARE
from toolpath.stock.engagement import SKIN_SHARE, angles
from toolpath.stock.stock_map import SURE_RIM, StockMap
from verify.material.stock_pass import descents
from verify.model import ProofSetup
from verify.moves import Moves

SLOT, FULL, AIR, LAYER = 100.0, 400.0, 3000.0, 1.0
MISSED = 2.0 * math.acos(1.0 - SURE_RIM * 0.1 / 2.0)  # what a row of nodes may leave out, on a radius of 2


def under(depth, angle):
    """Made up: falls with depth and angle, all of it in a shallow strip."""
    return min(FULL, max(SLOT, SLOT * LAYER * math.pi / max(depth * angle, 1e-9)))


PACE = Pace(SLOT, AIR, under, LAYER)


def block(top=1.0):
    mesh = box_mesh([0, 0, -4], [30, 30, -3])
    return StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -4]), np.array([30.0, 30, top]), 0.1)


def low(stock, where):
    """Take stock away where (x, y) says."""
    lat = stock.lattice
    y, x = np.meshgrid(lat.y0 + lat.step * np.arange(lat.ny), lat.x0 + lat.step * np.arange(lat.nx), indexing="ij")
    stock.top[where(x, y)] = -4.0
    return stock


@pytest.mark.parametrize("body", [tool(4.0, 0.0), tool(4.0, 0.8), ball(4.0)], ids=["flat", "bull", "ball"])
def test_a_slot_goes_at_the_feed_a_strip_faster_and_air_like_a_link(body):
    """Air up to X 8, then a strip 0.8 wide beside the way, from X 18 on all of it."""
    stock = low(block(), lambda x, y: (x < 8.0) | (x < 18.0) & (y < 15.0 + 2.0 - 0.8))
    way = np.array([[2.0, 15.0, 0.0], [28.0, 15.0, 0.0]])
    made = paced(way, stock, body, PACE)
    assert [air for air, _, _ in made] == [True] + [False] * (len(made) - 1)
    feeds = [f for _, _, f in made]
    assert feeds[0] == AIR and feeds[-1] == SLOT and SLOT < max(feeds[1:]) <= FULL
    edges = [p[-1, 0] for _, p, _ in made]
    guard = GUARD * body.diameter
    assert edges[0] < 8.0 - guard  # slow before it touches
    assert edges[-2] < 18.0 - guard
    joined = np.vstack([made[0][1], *(p[1:] for _, p, _ in made[1:])])
    assert np.allclose(joined[[0, -1]], way) and np.allclose(joined[:, 1:], way[0, 1:])
    assert (np.diff(joined[:, 0]) > 0.0).all()


def test_stock_behind_a_cutter_that_comes_out_of_it_does_not_hold_it_back():
    """Out of a block at X 12, as deep as a layer: what is behind the axis is cut already, though the map shows it."""
    stock = low(block(), lambda x, y: x > 12.0)
    fast = Pace(SLOT, AIR, lambda depth, angle: SLOT * LAYER * math.pi / max(depth * angle, 1e-3), LAYER)
    made = paced(np.array([[4.0, 15.0, 0.0], [20.0, 15.0, 0.0]]), stock, tool(4.0, 0.0), fast)
    assert [f for _, _, f in made[:1]] == [SLOT] and made[-1][0]
    out = [(p, f) for air, p, f in made if not air and p[0, 0] > 12.0]
    # no more is in front than a row of nodes may have left out, and no less
    assert out and all(1.5 * SLOT < f <= SLOT * math.pi / MISSED for p, f in out if p[-1, 0] < 14.45)
    assert out[0][0][0, 0] < 13.0 and out[-1][0][-1, 0] > 14.0  # and not as in air before all of it is behind


def test_no_place_is_gone_faster_than_what_stands_round_it_lets_the_tool():
    rng = np.random.default_rng(4)
    stock, body = block(), tool(4.0, 0.0)
    blobs = rng.uniform(3.0, 27.0, (25, 3))
    stock = low(stock, lambda x, y: np.any([np.hypot(x - a, y - b) < 0.14 * c for a, b, c in blobs], axis=0))
    turn = np.linspace(0.0, 1.5 * np.pi, 60)
    way = np.column_stack([15.0 + 8.0 * np.cos(turn), 15.0 + 8.0 * np.sin(turn), np.full(60, 0.2)])
    made = paced(way, stock, body, PACE)
    assert len(made) > 3 and {round(math.log(f / SLOT, STEP), 6) % 1.0 for _, _, f in made if f < FULL} == {0.0}
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], 4000)
    places = np.column_stack([np.interp(at, s, way[:, c]) for c in range(3)])
    depth, angle = stock.overlap(places, body), angles(stock, places, body)
    none = np.where(depth > SKIN_SHARE * body.radius, ANGLE * math.ceil(MISSED / ANGLE), math.pi)
    most = np.array([under(max(d, 0.0), a or b) for d, a, b in zip(depth, angle, none, strict=True)])
    ends = np.cumsum([np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for _, p, _ in made])
    feed = np.array([f for _, _, f in made])[np.searchsorted(ends, at - 1e-9).clip(0, len(made) - 1)]
    slow = np.flatnonzero(depth > 0.0)
    assert (feed[slow] <= most[slow] * 1.02).all()
    for k in slow[::50]:  # and half a guard before and behind
        near = np.abs(at - at[k]) < 0.5 * GUARD * body.diameter
        assert feed[near].max() <= most[k] * 1.02


def test_what_the_map_does_not_show_is_cut_at_the_feed():
    way = np.array([[2.0, 15.0, 1.5], [28.0, 15.0, 1.5]])
    ((air, points, feed),) = paced(way, block(), tool(4.0, 0.0), PACE)
    assert not air and feed == SLOT and points is way


def test_a_pass_that_takes_what_the_map_does_not_show_has_no_air():
    """Nothing up to X 8, then a slot: before it the feed for what may be hidden, in it its own, though that is less."""
    stock, hidden = low(block(), lambda x, y: x < 8.0), 150.0
    pace = Pace(60.0, AIR, lambda depth, angle: 60.0, LAYER, hidden)
    made = paced(np.array([[2.0, 15.0, 0.0], [28.0, 15.0, 0.0]]), stock, tool(4.0, 0.0), pace)
    assert [(air, feed) for air, _, feed in made] == [(False, hidden), (False, 60.0)]
    assert made[0][1][-1, 0] < 8.0 - 2.0
    alone = np.array([[2.0, 15.0, 0.0], [4.0, 15.0, 0.0]])
    assert [(air, feed) for air, _, feed in paced(alone, stock, tool(4.0, 0.0), pace)] == [(False, hidden)]


def test_an_eased_feed_is_given_back_where_less_stands_and_never_more():
    slim = {"id": "T1", "kind": "flat", "diameter_mm": 3, "flutes": 4, "flute_length_mm": 8, "neck_diameter_mm": 2.8,
            "neck_length_mm": 24, "shank_diameter_mm": 6, "stickout_mm": 40}
    setup = parse_setup(json.dumps({"tools": [slim], "material": "Ti-6Al-4V"}))
    cut, (body,) = JobInputs.of(setup).cut_table["T1"], tool_bodies(setup)
    full = cut.feed / cut.bend.share
    assert cut.bend.share < 0.8
    assert cut.feed_under(body, cut.step_down, math.pi) == pytest.approx(cut.feed)
    assert cut.feed_under(body, 0.05, 0.2) == pytest.approx(full)
    halves = [cut.feed_under(body, d * cut.step_down, a) for d in (0.1, 0.5, 1.0) for a in (0.5, 1.5, 3.0)]
    assert all(cut.feed <= f <= full * (1.0 + 1e-9) for f in halves) and halves[0] > halves[-1]
    own = JobInputs.of(parse_setup(json.dumps({"tools": [{**slim, "feed_mm_min": 300}]}))).cut_table["T1"]
    assert own.feed_under(body, 0.05, 0.2) == own.feed == 300


@pytest.mark.parametrize("air", [0.5 * SLOT, SLOT, FULL])
def test_what_takes_stock_off_is_no_link_however_slow_links_are(air):
    stock = low(block(), lambda x, y: x < 8.0)
    made = paced(np.array([[2.0, 15.0, 0.0], [28.0, 15.0, 0.0]]), stock, tool(4.0, 0.0), Pace(SLOT, air, under, LAYER))
    cut = [part for in_air, part, _ in made if not in_air]
    assert min(p[:, 0].min() for p in cut) < 8.0 and max(p[:, 0].max() for p in cut) == 28.0
    assert all(part[:, 0].max() < 8.0 for in_air, part, _ in made if in_air)


@pytest.mark.parametrize("share", [0.9, EASE_SHARE])
def test_a_way_down_parted_for_its_feeds_is_no_steeper_in_the_program(share):
    """Where a feed changes 7 um before a corner, rounding made that bit a descent that took a whole layer in front."""
    rng, body, ramp, count = np.random.default_rng(11), tool(4.0, 0.0), math.radians(3.0), 0
    for _ in range(40):
        x = np.cumsum(rng.uniform(0.13, 0.5, 60))
        x = 2.0 + 26.0 * (x - x[0]) / (x[-1] - x[0])
        way = np.column_stack([x, np.full(60, 15.0), 0.9 - share * math.tan(ramp) * (x - 2.0)])
        holes = np.sort(rng.uniform(4.0, 26.0, 6))
        stock = low(block(), lambda x, y, at=holes: np.searchsorted(at, x) % 2 == 1)
        parts = [part for _, part, _ in paced(way, stock, body, PACE)]
        count += len(parts)
        points = np.round(np.vstack([parts[0], *(p[1:] for p in parts[1:])]), 4)
        still = np.zeros(len(points) - 1)
        moves = Moves(points[:-1], points[1:], still == 0.0, still.astype(np.int32))
        assert not descents(moves, [body], ProofSetup(ramp_angle=ramp))[0].any()
        assert np.array_equal(points[[0, -1]], np.round(way[[0, -1]], 4))
    assert count > 300
