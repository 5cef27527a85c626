"""Surfaces in pieces for matched ends: where they are cut, where not, and that nothing is lost between pieces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from geometry.parameterization.grid_map import GridMap
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import tool
from tests.unit.toolpath.five_axis.test_matched_passes import bowl, measured, passes_along_y, random_surface
from toolpath.five_axis.curvature_matching import matching_tilt, strip_width
from toolpath.five_axis.matched_passes import MatchedPasses, MatchTolerances
from toolpath.five_axis.surface_partition import (
    CELLS,
    FINE,
    LAST,
    Feed,
    best_feeds,
    cheapest,
    feed_of,
    parted,
    price,
    turned,
)
from toolpath.five_axis.tilted_end import Nose, PassContacts, strip_edges
from toolpath.passes.isoparametric_passes import IsoSurface

ASKED = MatchTolerances(0.0045, 0.001, 0.0, 0.0003)
M = CELLS * FINE


def hollow(height, half=20.0, count=24):
    """z = height(x, y), mm, on a square, as close as a net of many points with even knots comes."""
    at = np.linspace(-half, half, count + 1)
    one = make_interp_spline(at, height(*np.meshgrid(at, at, indexing="ij")), 3, axis=0)
    two = make_interp_spline(at, one.c.T, 3, axis=0)
    mean = np.array([one.t[i + 1:i + 4].mean() for i in range(count + 1)])
    knots = (one.t + half) / (2.0 * half)
    return NurbsSurface(np.stack([*np.meshgrid(mean, mean, indexing="ij"), two.c.T], axis=-1), knots, knots)


def grown(t, soft=3.0):
    """Level up to -soft and curved by 1 from soft on, in between by what lies on a straight line."""
    return np.where(t < -soft, 0.0, np.where(t > soft, t * t / 2.0 + soft**2 / 6.0, (t + soft)**3 / (12.0 * soft)))


def crossed(x, y):
    """60 mm across; along 240 mm on the near half and 20 mm on the far one: the greater curvature changes ways."""
    return x * x / 120.0 + y * y / 480.0 + (1.0 / 20.0 - 1.0 / 240.0) * grown(y)


def cornered(x, y):
    """Convex, gently all over and tightly in one corner."""
    return -(x * x + y * y) / 800.0 - 0.002 * grown(x) * grown(y) / 8.0


def even(reach=0.1, length=40.0):
    return Feed(np.full((M, M), reach), np.full((M, M), length))


# -- where it is cut ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", [bowl(60.0, 150.0), bowl(60.0, 60.0), bowl(-200.0, -150.0), bowl(1e9, 1e9)],
                         ids=["hollow", "round", "convex", "plane"])
def test_what_is_curved_alike_everywhere_stays_whole(surface):
    parts = parted(passes_along_y(surface), tool(12.0, 0.0), MatchTolerances(0.0045, 0.001, np.radians(0.5), 0.0003))
    assert len(parts) == 1 and (parts[0].low == 0.0).all() and (parts[0].high == 1.0).all()


@pytest.mark.parametrize("given", [False, True])
def test_the_feed_goes_along_the_least_curvature_whatever_way_it_was_given(given):
    at = np.linspace(0.0, 1.0, 7)
    iso = IsoSurface(bowl(60.0, 150.0), GridMap.of(np.stack(np.meshgrid(at, at), axis=-1)), given)
    part, = parted(iso, tool(12.0, 0.0), ASKED)
    assert part.iso.turned
    assert part.spread < 0.01


def test_where_principal_directions_change_places_it_is_cut_between_and_fed_both_ways():
    iso = passes_along_y(hollow(crossed))
    near, far = sorted(parted(iso, tool(6.0, 0.0), ASKED), key=lambda p: p.low[0])
    assert near.high[0] == far.low[0] == pytest.approx(0.5, abs=0.13)
    assert near.iso.turned and not far.iso.turned
    whole, = parted(iso, tool(6.0, 0.0), ASKED, cut=False)
    assert near.way + far.way < 0.95 * whole.way
    assert whole.spread > 0.4 and max(near.spread, far.spread) < 0.2


def test_a_tight_corner_is_cut_off_and_what_is_gently_curved_beside_it_has_passes_of_its_own():
    iso = passes_along_y(hollow(cornered))
    asked = MatchTolerances(0.0045, 0.001, np.radians(0.5), 0.0003)
    parts = parted(iso, tool(12.0, 0.0), asked, round_way=0.0)
    whole, = parted(iso, tool(12.0, 0.0), asked, round_way=0.0, cut=False)
    assert sum(p.way for p in parts) < 0.95 * whole.way
    for tight in (0.7, 0.95):  # of the half and of the quarter that is gentle nothing is in one piece with the corner
        assert not any((p.low < 0.3).all() and (p.high > tight).all() for p in parts)


def test_pieces_cover_the_square_once_and_meet_in_the_same_places():
    rng = np.random.default_rng(5)
    for _ in range(4):
        feeds = tuple(Feed(np.exp(np.kron(rng.normal(0.0, 1.0, (4, 4)), np.ones((M // 4, M // 4)))) * 0.02,
                           np.full((M, M), 40.0)) for _ in range(2))
        count = np.zeros((CELLS, CELLS), int)
        pieces = cheapest(feeds, 5.0, 0.5)
        assert len(pieces) > 1
        for _, (a, b, c, d) in pieces:
            count[c:d, a:b] += 1
        assert (count == 1).all()


def test_the_cheapest_is_that_of_all_ways_to_cut():
    """Against every tree of cuts, written out, where only the quarters differ and nothing runs out of them."""
    rng = np.random.default_rng(8)
    for _ in range(3):
        feeds = tuple(Feed(np.exp(np.kron(rng.normal(0.0, 1.2, (2, 2)), np.ones((M // 2, M // 2)))) * 0.02,
                           np.full((M, M), 40.0)) for _ in range(2))

        def cost(piece, feeds=feeds):
            return min(price(feeds, way, piece, 5.0, 0.0)[1] for way in (False, True))

        def slow(a, b, c, d, cost=cost):
            whole, half = cost((a, b, c, d)), CELLS // 2
            cuts = [slow(a, half, c, d) + slow(half, b, c, d)] if b - a == CELLS else []
            cuts += [slow(a, b, c, half) + slow(a, b, half, d)] if d - c == CELLS else []
            return min([v for v in cuts if v < 0.95 * whole], default=whole)

        got = sum(price(feeds, way, piece, 5.0, 0.0)[1] for way, piece in cheapest(feeds, 5.0, 0.0))
        assert got == pytest.approx(slow(0, CELLS, 0, CELLS), rel=1e-9)


# -- what a piece costs -------------------------------------------------------------------------------------------


def test_a_pass_is_as_far_from_the_next_as_its_narrowest_place_allows():
    reach = np.full((M, M), 0.1)
    reach[:, 3] = 0.02
    feeds = (Feed(reach, np.full((M, M), 40.0)), even())
    passes, way = price(feeds, False, (0, CELLS, 0, CELLS), 5.0, 0.0)
    assert passes == pytest.approx(50.0 + LAST)
    assert way == pytest.approx((50.0 + LAST) * 45.0)
    assert price(feeds, False, (1, CELLS, 0, CELLS), 5.0, 0.0)[0] == pytest.approx(10.0 + LAST)
    assert price(feeds, True, (0, CELLS, 0, CELLS), 5.0, 0.0)[0] == pytest.approx(10.0 + LAST)


def test_a_piece_too_short_to_run_out_of_or_without_reach_has_no_price():
    assert price((even(), even()), False, (0, 1, 0, CELLS), 5.0, 1.0) == (np.inf, np.inf)
    assert np.isfinite(price((even(), even()), False, (0, CELLS, 0, CELLS), 5.0, 1e3)).all()
    assert price((even(0.0), even()), False, (0, CELLS, 0, CELLS), 5.0, 0.0) == (np.inf, np.inf)


def test_a_strip_fed_along_a_principal_direction_is_the_closed_one():
    body = tool(12.0, 0.0)
    feed = feed_of(passes_along_y(bowl(60.0, 150.0)), body, ASKED)
    width = strip_width(matching_tilt(np.array([1 / 60]), body), np.array([1 / 60]), np.array([1 / 150]), body, 0.0045)
    middle = feed.reach[M // 2, M // 2] * 40.0
    assert middle == pytest.approx(width[0], rel=0.01)
    assert feed.length[M // 2, M // 2] == pytest.approx(40.0, rel=1e-3)


@pytest.mark.parametrize("off", [0.0, 10.0, 20.0, 45.0, 70.0, 90.0])
def test_a_strip_fed_any_way_is_near_what_the_nose_leaves(off):
    """The closed strip against heights over the surface, turned as it is wanted: what the twist does is left out."""
    body, surface = tool(12.0, 0.0), bowl(60.0, 150.0)
    a = np.radians(off)
    at = PassContacts.on(surface, np.array([[0.5, 0.5]]), np.array([[np.sin(a), np.cos(a)]]))
    nose = Nose(surface, body, surface.domain)
    best = 0.0
    for turn in np.radians(np.arange(-20.0, 21.0, 2.5)):
        lean = np.array([turn])
        tilt = nose.least_tilt(at, lean, 0.0, 0.0)
        feet = strip_edges(*nose.heights(at, tilt, lean, 257), 0.0045)
        left, right = (float(((surface.points(f) - at.point) * at.left).sum()) for f in feet)
        best = max(best, 2.0 * min(abs(left), abs(right)))
    s, c = 4.0 * np.sin(a), 4.0 * np.cos(a)
    grid = np.linspace(-0.5, 0.5, 5)
    xi, eta = np.meshgrid(grid, grid)
    uv = 0.5 + np.stack([xi * s + eta * -c, xi * c + eta * s], axis=-1) / 40.0
    feed = feed_of(IsoSurface(surface, GridMap.of(uv)), body, ASKED)
    assert feed.reach[M // 2, M // 2] * 4.0 == pytest.approx(best, rel=0.25)


def test_best_feeds_lie_along_the_least_curvature():
    surface = random_surface(4, False)
    at = np.linspace(0.0, 3.0, 7)
    iso = IsoSurface(surface, GridMap.of(np.stack(np.meshgrid(at, at), axis=-1)))
    angle, weight = best_feeds(iso)
    assert weight.min() >= 0.0
    for row, col in ((5, 9), (30, 40), (60, 2)):
        xi, eta = np.array([(col + 0.5) / M]), np.array([(row + 0.5) / M])
        uv = iso.parameters(xi, eta)
        d, normal = surface.derivatives(uv), surface.normals(uv)[0]
        one = d.u[0] / np.linalg.norm(d.u)
        way = np.cos(angle[row, col]) * one + np.sin(angle[row, col]) * np.cross(normal, one) * np.sign(
            normal @ np.cross(d.u[0], d.v[0]))
        step = np.linalg.lstsq(np.stack([d.u[0], d.v[0]], axis=1), way, rcond=None)[0]
        first, second = surface.forms(uv)
        bend = second[0] @ [step[0] ** 2, 2.0 * step[0] * step[1], step[1] ** 2]
        assert -bend == pytest.approx(surface.curvature(uv)[0, 1], abs=1e-9)
    assert (turned(turned(iso)).turned, turned(iso).turned) == (False, True)


# -- pieces -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("given", [False, True])
def test_a_part_of_a_map_is_the_map(given):
    at = np.linspace(0.0, 1.0, 7)
    xi, eta = np.meshgrid(at, at)
    bent = GridMap.of(np.stack([xi + 0.1 * eta * eta, eta + 0.1 * np.sin(xi)], axis=-1))
    part = bent.part(np.array([0.25, 0.5]), np.array([0.75, 1.0])).part(np.array([0.5, 0.0]), np.array([1.0, 0.5]))
    x, y = np.random.default_rng(2).uniform(0.0, 1.0, (2, 50))
    assert part(x, y) == pytest.approx(bent(0.5 + 0.25 * x, 0.5 + 0.25 * y), abs=1e-15)
    for mine, whole, by in zip(part.tangents(x, y), bent.tangents(0.5 + 0.25 * x, 0.5 + 0.25 * y), (0.25, 0.25),
                               strict=True):
        assert mine == pytest.approx(by * whole, abs=1e-14)


@pytest.mark.slow
def test_the_proof_finds_no_more_left_and_no_deeper_cut_on_a_parted_surface():
    surface, body = hollow(crossed), tool(6.0, 0.0)
    iso = passes_along_y(surface)
    counts = []
    for cut in (False, True):
        parts = parted(iso, body, ASKED, cut=cut)
        made = [MatchedPasses.over(p.iso, body, ASKED) for p in parts]
        passes = [m.located(s) for m in made for s in m.lay_out()]
        left = measured(surface, body, passes)
        assert left.max() <= 0.005
        assert left.min() >= -0.002
        counts.append(sum(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum() for tip, _ in passes))
        assert len(passes) == pytest.approx(sum(p.passes for p in parts), rel=0.25, abs=2)
    assert counts[1] < 0.9 * counts[0]

