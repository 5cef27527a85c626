"""Flank passes along walls: what they lie on, what they leave, how deep they are, and where they are not taken."""

from dataclasses import replace

import numpy as np
import pytest

import toolpath.five_axis.flank_milling as flank
from geometry.errors import GeometryError
from tests.hand_parts import ball, tool
from toolpath.five_axis.flank_milling import FlankTolerances, FlankWall, bands
from toolpath.five_axis.oriented_piece import Piece, thinned_poses
from toolpath.stock.residual_map import leaning_depths

ASKED = FlankTolerances(0.02, 0.002, 0.002)
LENGTH, HEIGHT = 40.0, 8.0


class Ruled:
    """Straight lines from a lower curve to an upper one, (n, 3) mm of xi each; the wall looks to -y."""

    def __init__(self, low, high, turn=None):
        self.low, self.high = low, high
        self.turn = np.eye(3) if turn is None else turn

    def point(self, xi, eta):
        return (1.0 - eta)[:, None] * self.low(xi) + eta[:, None] * self.high(xi)

    def contact(self, xi, eta):
        h = 1e-6
        along = self.point(xi + h, eta) - self.point(xi - h, eta)
        up = self.point(xi, eta + h) - self.point(xi, eta - h)
        normal = np.cross(along, up)
        return self.point(xi, eta) @ self.turn.T, normal / np.linalg.norm(normal, axis=1)[:, None] @ self.turn.T


def straight(y0, y1, z):
    return lambda xi: np.column_stack([LENGTH * xi, y0 + (y1 - y0) * xi, np.full(len(xi), z)])


def leaned(angle):
    return Ruled(straight(0.0, 0.0, 0.0), straight(HEIGHT * np.tan(angle), HEIGHT * np.tan(angle), HEIGHT))


def twisted(angle):
    """Its rulings turn by ``angle`` (rad) from one end to the other, about the middle of their height."""
    y = 0.5 * HEIGHT * np.tan(0.5 * angle)
    return Ruled(straight(y, -y, 0.0), straight(-y, y, HEIGHT))


def cone(radius=60.0, lean=0.2, about=0.6, hollow=False):
    """An arc of a cone; outside it where not hollow."""
    def ring(r, z):
        def at(xi):
            a = about * (xi - 0.5) * (-1.0 if hollow else 1.0)
            s = 1.0 if hollow else -1.0
            return np.column_stack([r * np.sin(a) * (-1.0 if hollow else 1.0), s * r * np.cos(a), np.full(len(xi), z)])
        return at
    return Ruled(ring(radius, 0.0), ring(radius + HEIGHT * np.tan(lean) * (1.0 if hollow else -1.0), HEIGHT))


def left_and_deep(wall, band, count=2000):
    """What a pass leaves and how deep it is, at many places (mm), by poses close together."""
    rng = np.random.default_rng(3)
    xi, eta = rng.random(count), band.low + (band.high - band.low) * rng.random(count)
    place = wall.contact(xi, eta)[0]
    depth = leaning_depths(place, *band.poses(2000), band.tool, 1.0)
    return depth.max(), -depth.min()


@pytest.mark.parametrize("body", [ball(6.0), tool(6.0, 1.0), tool(6.0, 0.0)], ids=["ball", "bull", "flat"])
@pytest.mark.parametrize("angle", [-0.2, 0.0, 0.15])
def test_a_plane_takes_one_pass_that_lies_on_it(body, angle):
    wall = FlankWall(leaned(angle))
    (band,) = bands(wall, body, ASKED)
    tip, axis = band.poses(50)
    ruling = np.array([0.0, np.sin(angle), np.cos(angle)])
    assert np.abs(axis @ ruling - 1.0).max() < 1e-6
    normal = np.array([0.0, -np.cos(angle), np.sin(angle)])
    assert np.abs(tip @ normal - 3.0).max() < 1e-5
    assert np.abs((tip + body.corner_radius * axis)[:, 2] - 3.0 * np.sin(angle)).max() < 1e-5  # begins at the border
    left, deep = left_and_deep(wall, band)
    assert left < 1e-4 and deep < 1e-4


@pytest.mark.parametrize("hollow", [False, True])
def test_on_a_cone_axes_go_through_its_apex(hollow):
    wall = FlankWall(cone(hollow=hollow))
    (band,) = bands(wall, ball(6.0), ASKED)
    tip, axis = band.poses(41)
    # the axis is the ruling moved off the wall: both lie in a plane through the axis of the cone
    inner = slice(6, 35)
    across = np.cross(tip[inner], axis[inner])[:, 2]
    assert np.abs(across).max() < 0.2  # mm off that plane
    left, deep = left_and_deep(wall, band)
    assert left < 0.5 * ASKED.left and deep <= ASKED.depth


@pytest.mark.parametrize("radius", [3.0, 5.0])
def test_what_a_twisted_wall_leaves_falls_with_the_square_of_the_height(radius):
    """Half as high turns half as much along a ruling: a quarter of the miss."""
    wanted = FlankTolerances(0.1, 10.0, 0.002)  # where anything may be left, the steepest way is as good as a ruling
    wall, body = FlankWall(twisted(0.5)), ball(2.0 * radius)
    whole, half = (bands(wall, body, wanted, 0.5 - 0.5 * h, 0.5 + 0.5 * h)[0] for h in (1.0, 0.5))
    misses = [sum(left_and_deep(wall, band)) for band in (whole, half)]
    assert misses[1] <= 0.3 * misses[0]
    turned = HEIGHT * 0.5 / LENGTH
    assert 0.5 < misses[0] / (radius * turned**2 / 8.0) < 2.0


def test_a_wall_that_bulges_is_cut_in_as_few_bands_as_leave_little_enough():
    """An arc of 150 mm, 8 mm high: a straight line misses it by 0.053 mm, one half as high by 0.013."""
    class Bulge:
        def contact(self, xi, eta):
            a = HEIGHT / 150.0 * (eta - 0.5)
            normal = np.column_stack([0.0 * xi, -np.cos(a), np.sin(a)])
            return np.column_stack([LENGTH * xi, 0.0 * xi, 0.0 * xi]) + 150.0 * normal, normal

    wall = FlankWall(Bulge())
    made = bands(wall, ball(10.0), ASKED)
    assert [(b.low, b.high) for b in made] == [(0.5, 1.0), (0.0, 0.5)]
    for band in made:
        left, deep = left_and_deep(wall, band)
        assert 0.007 < left <= ASKED.left and deep <= 1.25 * ASKED.depth
    whole, = bands(wall, ball(10.0), FlankTolerances(0.06, 0.002, 0.002))
    assert 0.04 < left_and_deep(wall, whole)[0] < 0.06


def test_what_is_round_both_ways_is_refused_with_what_it_misses():
    class Dome:
        def contact(self, xi, eta):
            a, b = 1.2 * (xi - 0.5), 1.2 * (eta - 0.5)
            normal = np.column_stack([np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b), np.sin(b)])
            return 20.0 * normal, normal

    with pytest.raises(GeometryError) as refusal:
        bands(FlankWall(Dome()), ball(6.0), ASKED)
    assert refusal.value.code == "bad_pass"
    assert refusal.value.measured > ASKED.left


def test_flutes_shorter_than_the_wall_take_more_bands():
    short = tool(6.0, 1.0, neck=30.0)
    made = bands(FlankWall(leaned(0.1)), short, ASKED)
    room = short.flute_length - short.corner_radius
    assert len(made) == int(np.ceil(HEIGHT / np.cos(0.1) / room))


def test_an_allowance_is_left():
    wall = FlankWall(leaned(0.1))
    (band,) = bands(wall, ball(6.0), ASKED, allowance=0.3)
    xi = np.linspace(0.05, 0.95, 50)
    depth = leaning_depths(wall.contact(xi, np.full(50, 0.5))[0], *band.poses(400), band.tool, 1.0)
    assert np.abs(depth - 0.3).max() < 1e-3


def test_it_does_not_matter_how_the_wall_stands():
    q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    plain, turned = cone(), cone()
    turned.turn = q if q[2, 2] > 0 else q @ np.diag([1.0, -1.0, -1.0])
    a, b = (bands(FlankWall(w), ball(6.0), ASKED)[0] for w in (plain, turned))
    assert FlankWall(turned)._upwards
    assert np.abs(b.poses(20)[0] - a.poses(20)[0] @ turned.turn.T).max() < 1e-3


def test_a_pass_is_raised_over_what_its_end_would_meet_and_ends_where_that_is_too_much():
    wall = FlankWall(leaned(0.0))
    (band,) = bands(wall, ball(6.0), ASKED)

    def blocked(tip, axis):
        low = (tip[:, 0] > 10.0) & (tip[:, 0] < 15.0) & (tip[:, 2] < -1.5)
        high = (tip[:, 0] > 30.0) & (tip[:, 0] < 33.0)
        return low | high

    pieces = band.pieces(blocked, 0.002)
    assert len(pieces) == 2
    first = pieces[0]
    x, z = first.tips[:, 0], first.tips[:, 2]
    filled = np.linspace(x[0], x[-1], 2000)
    height = np.interp(filled, x, z)
    assert not blocked(np.column_stack([filled, filled * 0.0, height + 2e-3]), None).any()
    assert height[(filled > 10.2) & (filled < 14.8)].max() < 0.0  # no more than it takes
    assert np.abs(np.diff(z) / np.diff(x)).max() < 0.35
    assert z[0] == pytest.approx(-3.0, abs=1e-6)
    assert first.tips[-1, 0] < 30.0 + 1e-9 and pieces[1].tips[0, 0] > 33.0 - 1e-9


def test_a_pass_goes_only_where_it_is_wanted():
    (band,) = bands(FlankWall(leaned(0.1)), ball(6.0), ASKED)
    served = np.zeros(101, np.bool_)
    served[20:61] = True
    (piece,) = band.pieces(lambda tip, axis: np.zeros(len(tip), np.bool_), 0.002, served)
    assert piece.tips[[0, -1], 0] == pytest.approx([0.2 * LENGTH, 0.6 * LENGTH], abs=0.6)


@pytest.mark.parametrize("seed", range(5))
def test_poses_left_out_are_on_the_way_between_those_kept(seed):
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, 400)[:, None]
    a, b = rng.normal(size=(2, 3))
    tips = 30.0 * s * [1.0, 0.0, 0.0] + np.sin(4.0 * s + a) * [0.0, 2.0, 0.5]
    axes = np.column_stack([0.2 * np.sin(3.0 * s + b)[:, 0], 0.1 * s[:, 0], np.ones(400)])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    rows = thinned_poses(tips, axes, 20.0, 0.01)
    assert rows[0] == 0 and rows[-1] == 399 and len(rows) < 120
    for ends in (tips, tips + 20.0 * axes):
        there = np.column_stack([np.interp(np.arange(400), rows, ends[rows, c]) for c in range(3)])
        assert np.linalg.norm(there - ends, axis=1).max() <= 0.01 + 1e-12


def test_the_steps_of_the_search_are_smoothed_out_and_straight_changes_are_left_alone():
    x = np.linspace(0.0, 1.0, 65)
    np.testing.assert_allclose(flank._evened(0.1 - 0.3 * x), 0.1 - 0.3 * x, atol=1e-12)
    true = 0.02 * np.sin(2.0 * np.pi * x)
    stairs = 0.004 * np.round(true / 0.004)
    even = flank._evened(stairs)
    assert np.abs(even - true).max() < 0.5 * np.abs(stairs - true).max()
    assert np.abs(np.diff(even, 2)).max() < 0.1 * np.abs(np.diff(stairs, 2)).max()


def test_on_a_plane_with_oblique_ends_the_axis_stays_the_steepest():
    """Its own parameters fan to both sides; every ruling of a plane is as good."""
    wall = FlankWall(Ruled(straight(0.0, 0.0, 0.0), shorter(0.8, 0.1 * HEIGHT)))
    (band,) = bands(wall, ball(6.0), ASKED)
    axis = band.poses(200)[1]
    assert np.degrees(np.arccos(np.clip(axis @ axis[100], -1.0, 1.0))).max() < 1.0  # 27 where it goes along the ends
    assert np.degrees(np.abs(axis[:, 0])).max() < 1.0
    assert max(left_and_deep(wall, band)) < 1e-3


def shorter(share, y):
    """A line above the middle ``share`` of those of ``straight``, ``y`` aside."""
    ends = straight(y, y, HEIGHT)(np.array([0.5 - 0.5 * share, 0.5 + 0.5 * share]))
    return lambda xi: ends[0] + np.asarray(xi)[:, None] * (ends[1] - ends[0])


def test_a_tool_whose_flutes_end_where_its_corner_does_has_no_flank():
    with pytest.raises(GeometryError) as refused:
        bands(FlankWall(leaned(0.1)), replace(ball(6.0), flute_length=3.0), ASKED)
    assert refused.value.code == "bad_pass" and "no flank" in refused.value.message


def test_a_pass_in_parts_goes_where_it_went_and_through_good_places_only():
    """A quarter of a circle of 10 mm, its axis turning with it; between 0.8 and 1.5 of its poses it may not go."""
    turn = np.linspace(0.0, 0.5 * np.pi, 5)
    around = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(5)])
    axes = 0.1 * around + np.array([0.0, 0.0, 1.0])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    whole = Piece(10.0 * around, axes, around, 8.0)
    at = np.linspace(0.0, 4.0, 41)
    dense = whole.at(at)
    assert dense.tips[::10] == pytest.approx(whole.tips) and dense.axes[::10] == pytest.approx(whole.axes)
    assert np.linalg.norm(dense.axes, axis=1) == pytest.approx(1.0)
    good = (at < 0.75) | (at > 1.55)
    first, last = whole.parts(good, at, 0.5)
    assert first.tips == pytest.approx(dense.tips[[0, 7]]) and last.tips == pytest.approx(dense.tips[[16, 20, 30, 40]])
    assert last.reach == 8.0
    assert len(whole.parts(good, at, 4.0)) == 1  # the first part is 2.7 mm
    assert whole.parts(at == 2.0, at, 0.0) == []
