"""Passes of matched ends on surfaces: what the proof sees of them, and the pieces they are made of."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.parameterization.grid_map import GridMap
from geometry.surfaces.foot_points import foot_points
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import tool
from toolpath.five_axis.curvature_matching import matching_tilt, strip_width
from toolpath.five_axis.matched_passes import MatchedPasses, MatchTolerances
from toolpath.five_axis.tilted_end import Nose, PassContacts, strip_edges
from toolpath.passes.isoparametric_passes import IsoSurface
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes

HALF = 20.0


def bowl(across, along, cubic=0.0, side=1):
    """z = x^2 / 2 across + y^2 / 2 along + cubic x^3 on 40 x 40 mm, exact, degree 3 each way."""
    square = HALF**2 * np.array([1.0, -1 / 3, -1 / 3, 1.0])
    third = HALF**3 * np.array([-1.0, 1.0, -1.0, 1.0])
    at = np.linspace(-HALF, HALF, 4)
    knots = np.array([0.0, 0, 0, 0, 1, 1, 1, 1])
    z = (square / (2 * across) + cubic * third)[:, None] + (square / (2 * along))[None, :]
    x, y = np.meshgrid(at, at, indexing="ij")
    return NurbsSurface(np.stack([x, y, z], axis=-1), knots, knots, side=side)


def passes_along_y(surface):
    at = np.linspace(0.0, 1.0, 7)
    return IsoSurface(surface, GridMap.of(np.stack(np.meshgrid(at, at), axis=-1)), True)


def measured(surface, body, passes):
    g = (np.arange(120) + 0.5) / 120
    points, normals = surface.points_and_normals(np.stack(np.meshgrid(g, g), axis=-1).reshape(-1, 2))
    start, stop = (np.concatenate([t[cut] for t, _ in passes]) for cut in (slice(-1), slice(1, None)))
    first, last = (np.concatenate([a[cut] for _, a in passes]) for cut in (slice(-1), slice(1, None)))
    moves = Moves(start, stop, np.ones(len(start), bool), np.zeros(len(start), np.int32), ToolAxes.between(first, last))
    return residual_on_normals(points, normals, np.full(len(points), 1.0), moves, [body], bow=1e-5)[0]


@pytest.mark.parametrize(("surface", "least", "height", "body"), [
    (bowl(60.0, 150.0), 0.0, 0.005, tool(12.0, 0.0)), (bowl(60.0, 150.0, 1e-5), 0.0, 0.005, tool(12.0, 1.0)),
    (bowl(-200.0, -150.0), 0.5, 0.02, tool(12.0, 1.0)), (bowl(80.0, -90.0), 0.5, 0.02, tool(12.0, 0.0))],
    ids=["hollow", "curvature that grows", "convex", "saddle"])
def test_the_proof_finds_no_more_left_and_no_deeper_cut_than_asked(surface, least, height, body):
    wanted = MatchTolerances(0.9 * height, 0.001, np.radians(least), 0.0003)
    made = MatchedPasses.over(passes_along_y(surface), body, wanted)
    strips = made.lay_out()
    left = measured(surface, body, [made.located(s) for s in strips])
    assert left.max() <= height
    assert left.min() >= -0.002
    etas = [s.eta for s in strips]
    assert all(b > a for a, b in zip(etas, etas[1:], strict=False))


@pytest.mark.parametrize(("surface", "least", "body", "most"), [
    (bowl(1e9, 1e9), 0.02, tool(12.0, 0.0), 4), (bowl(60.0, 60.0), 0.0, tool(6.0, 0.0), 9)], ids=["plane", "sphere"])
def test_strips_as_wide_as_the_tool_are_cut_to_the_ends_of_the_face(surface, least, body, most):
    """The edges of such strips lie the whole radius behind the contact: passes go on so far, and do not crawl."""
    made = MatchedPasses.over(passes_along_y(surface), body, MatchTolerances(0.0045, 0.001, np.radians(least), 0.0003))
    strips = made.lay_out()
    assert len(strips) <= most
    left = measured(surface, body, [made.located(s) for s in strips])
    assert left.max() <= 0.005 and left.min() >= -0.002


def test_a_level_plane_without_a_least_tilt_takes_a_strip_a_tool_wide():
    made = MatchedPasses.over(passes_along_y(bowl(1e9, 1e9)), tool(12.0, 0.0),
                              MatchTolerances(0.0045, 0.001, 0.0, 0.0003))
    assert len(made.lay_out()) == 4


def test_a_place_whose_height_is_not_known_counts_as_one_the_nose_enters(monkeypatch):
    """At a pole there is no normal: no tilt may be called free there."""
    surface, body = bowl(60.0, 150.0), tool(6.0, 0.0)
    at = PassContacts.on(surface, np.array([[0.5, 0.5], [0.3, 0.4]]), np.tile([0.0, 1.0], (2, 1)))
    nose, heights = Nose(surface, body, surface.domain), Nose.heights
    assert np.isfinite(nose.least_tilt(at, np.zeros(2), 1e-3, 0.0)).all()

    def blind(self, *args):
        high, feet = heights(self, *args)
        high[0, 0, 5], feet[0, 0, 5] = np.nan, np.nan
        return high, feet

    monkeypatch.setattr(Nose, "heights", blind)
    assert np.isnan(nose.least_tilt(at, np.zeros(2), 1e-3, 0.0)).tolist() == [True, False]


def test_few_passes_where_the_nose_matches():
    """On the hollow of 60 by 150 mm a flat of 12 mm cuts strips of 6.6 mm, a ball of 12 mm such of 0.5 mm."""
    body = tool(12.0, 0.0)
    strips = MatchedPasses.over(passes_along_y(bowl(60.0, 150.0)), body,
                                MatchTolerances(0.005, 0.0, 0.0, 0.0003)).lay_out()
    width = strip_width(matching_tilt(np.array([1 / 60]), body), np.array([1 / 60]), np.array([1 / 150]), body, 0.005)
    assert len(strips) <= np.ceil(2 * HALF * 1.02 / (0.9 * width[0]))


def test_the_strip_is_where_the_nose_stands_lower_than_the_height():
    surface, body = bowl(60.0, 150.0), tool(12.0, 0.0)
    at = PassContacts.on(surface, np.array([[0.5, 0.5]]), np.array([[0.0, 1.0]]))
    nose, straight = Nose(surface, body, surface.domain), np.zeros(1)
    tilt = nose.least_tilt(at, straight, 0.0, 0.0)
    assert tilt[0] == pytest.approx(matching_tilt(np.array([1 / 60]), body)[0], rel=2e-3)
    high, feet = nose.heights(at, tilt, straight)
    edges = surface.points(strip_edges(high, feet, 0.005)[:, 0])
    assert np.ptp(edges[:, 0]) == pytest.approx(6.655, rel=0.01)  # printed, by brute force
    assert high.min() > -1e-6


@pytest.mark.parametrize("turn", [-20.0, -10.0, 0.0, 20.0])
@pytest.mark.parametrize(("surface", "least"), [(bowl(60.0, 150.0), 0.0), (bowl(-200.0, -150.0), 0.5)])
def test_a_pass_goes_on_until_the_nose_from_edge_to_edge_is_over_the_border(surface, least, turn):
    """Turned, the nose reaches ahead of the contact and of the edge on one side, and lags on the other."""
    wanted = MatchTolerances(0.0045, 0.001, np.radians(least), 0.0003)
    made = MatchedPasses.over(passes_along_y(surface), tool(12.0, 0.0), wanted)
    strip = made.strip(0.5, np.full(len(made.stations), np.radians(turn)))
    assert made.run_out >= strip.ends[1] - 1.0
    assert np.diff(made.stations).max() <= 1.0 / 32.0 + 1e-12  # however far it runs out
    at = made.contacts(np.array(strip.ends), 0.5)
    tilt, turned = strip.leans(np.array(strip.ends))
    high, feet = made.nose.heights(at, tilt, turned, 257)
    for side in range(2):
        first, last = (made.iso.square(feet[side, k], np.full(257, strip.ends[k]), np.full(257, 0.5))[0]
                       [:np.argmax(high[side, k] > 0.0045)] for k in (0, 1))
        assert first.max() <= 2e-3
        assert last.min() >= 1.0 - 2e-3


@pytest.mark.parametrize(("surface", "depth"), [(bowl(-200.0, -150.0), 0.0), (bowl(60.0, 150.0, 1e-5), 0.0),
                                                (bowl(60.0, 150.0, 1e-5), 1e-3), (bowl(80.0, -90.0), 0.0)])
def test_edges_lie_where_a_nose_of_many_places_has_them(surface, depth):
    """Of a strip but two places of the nose wide a straight line between heights took 6 %."""
    body, rng = tool(30.0, 0.0), np.random.default_rng(6)
    at = PassContacts.on(surface, rng.uniform(0.3, 0.7, (20, 2)), np.tile([0.0, 1.0], (20, 1)))
    nose, turn = Nose(surface, body, surface.domain), rng.uniform(-0.1, 0.1, 20)
    tilt = nose.least_tilt(at, turn, depth, np.radians(0.25))

    def halves(count):
        edges = strip_edges(*nose.heights(at, tilt, turn, count), 0.005)
        return np.array([((surface.points(e) - at.point) * at.left).sum(axis=1) for e in edges])

    assert halves(65) == pytest.approx(halves(8193), rel=0.01)


def test_a_tilt_below_the_least_enters_and_one_above_does_not():
    surface, body = bowl(40.0, 25.0, 2e-5), tool(12.0, 1.0)
    uv = np.random.default_rng(1).uniform(0.2, 0.8, (12, 2))
    at = PassContacts.on(surface, uv, np.tile([0.0, 1.0], (12, 1)))
    nose, turn = Nose(surface, body, surface.domain), np.linspace(-0.3, 0.3, 12)
    least = nose.least_tilt(at, turn, 1e-4, 0.0)
    for tilt, free in ((least + 1e-3, True), (least - 3e-3, False)):
        low = nose.heights(at, tilt, turn, 721)[0].min(axis=(0, 2))
        assert ((low > -1.5e-4) == free).all()


def test_where_no_tilt_is_enough_it_is_said():
    with pytest.raises(GeometryError, match="no tilt keeps the end of the tool out") as found:
        MatchedPasses.over(passes_along_y(bowl(5.0, 5.0)), tool(12.0, 0.0), MatchTolerances(0.005, 0.0, 0.0, 0.0003))
    assert found.value.code == "bad_pass" and "T1" in found.value.subjects


# -- surfaces -----------------------------------------------------------------------------------------------------


def random_surface(order, weights, side=1):
    rng = np.random.default_rng(3)
    g = np.linspace(0.0, 100.0, 7)
    net = np.stack([*np.meshgrid(g, g, indexing="ij"), rng.normal(0.0, 4.0, (7, 7))], axis=-1)
    return NurbsSurface.from_control_points(net, order, weights=rng.uniform(0.9, 1.1, (7, 7)) if weights else None,
                                            side=side)


@pytest.mark.parametrize("weights", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_heights_of_chains_are_those_over_foot_points(weights, side):
    s = random_surface(4, weights, side)
    uv = np.random.default_rng(0).uniform(0.5, 3.5, (20, 2))
    t = np.linspace(0.0, 5.0, 60)
    chains = s.points(uv)[:, None] + 0.5 * s.normals(uv)[:, None] * np.sin(t)[:, None] + t[:, None] * [0.7, 0.3, 0.1]
    high, feet = s.heights_along(chains, uv)
    slow = foot_points(s, chains.reshape(-1, 3), feet.reshape(-1, 2))
    assert np.abs(high.ravel()) == pytest.approx(slow.distance, abs=1e-9)
    off = np.einsum("ij,ij->i", chains.reshape(-1, 3) - slow.points, s.normals(slow.uv))
    assert high.ravel() == pytest.approx(off, abs=1e-9)


@pytest.mark.parametrize("weights", [False, True])
@pytest.mark.parametrize("order", [2, 3, 4, (4, 3)])
def test_an_extended_surface_is_the_same_inside_and_goes_on_as_the_polynomial_of_its_border(order, weights):
    s = random_surface(order, weights, -1)
    wide = s.extended(0.05)
    assert wide.domain == pytest.approx(s.domain + 0.05 * np.ptp(s.domain, axis=0) * [[-1.0], [1.0]])
    uv = np.random.default_rng(2).uniform(*s.domain, (200, 2))
    assert wide.points(uv) == pytest.approx(s.points(uv), abs=1e-10)
    assert wide.normals(uv) == pytest.approx(s.normals(uv), abs=1e-9)
    out = np.random.default_rng(4).uniform(*wide.domain, (200, 2))
    high, _ = s.heights_along(wide.points(out)[:, None], np.clip(out, *s.domain), 0.05)
    assert np.abs(high).max() < 1e-9
