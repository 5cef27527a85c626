"""Tool axes led round what is in the way: spread by the closed form, never blocked where a way round exists."""

import numpy as np
import pytest

from geometry.parameterization.grid_map import GridMap
from tests.hand_parts import ball
from tests.unit.toolpath.five_axis.test_oriented_pass import CHORD, SCALLOP, opposite, tree_of, wall
from toolpath.five_axis.axis_smoothing import FAN, SPACING, AxisLimits, fan, steered
from toolpath.five_axis.oriented_pass import enters, lead_and_tilt, leaned, posed
from toolpath.passes.cutter_locations import tips
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.isoparametric_passes import IsoSurface
from toolpath.poses import angles_between
from zones.reach.assembly import Clearances

WIDE = AxisLimits(np.radians(40.0), np.radians(6.0))
R = 2.0


def profile_over(surface, eta=0.5):
    at = np.linspace(0.0, 1.0, 5)
    return PassProfile.of(IsoSurface(surface, GridMap.of(np.dstack(np.meshgrid(at, at)))).curve(eta), CHORD, R)


def nothing(tip, _axis):
    return np.zeros(len(tip), bool)


def jump(at, angle):
    """Z, and from x = at on leaned by an angle along x."""
    def axes(contact, _normal, _way):
        lean = np.where(contact[:, 0] > at, angle, 0.0)
        return np.column_stack([np.sin(lean), np.zeros(len(lean)), np.cos(lean)])

    return axes


def upright(contact, _normal, _way):
    return np.tile([0.0, 0.0, 1.0], (len(contact), 1))


def test_a_fan_is_even_and_has_its_own_axis_first():
    axis = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -1.0, 0.0]])
    made = fan(axis, np.radians(30.0))
    np.testing.assert_allclose(made[:, 0], axis, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(made, axis=2), 1.0, atol=1e-14)
    off = np.arccos(np.clip((made * axis[:, None]).sum(axis=2), -1.0, 1.0))
    assert off.max() <= np.radians(30.0) and off.max() > np.radians(30.0) - FAN
    rng = np.random.default_rng(3)
    for _ in range(200):  # no axis within the cone is far from one of the fan
        lean, turn = np.radians(28.0) * np.sqrt(rng.random()), 2.0 * np.pi * rng.random()
        asked = np.array([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)])
        assert np.arccos(np.clip(made[0] @ asked, -1.0, 1.0)).min() < 0.75 * FAN


@pytest.mark.parametrize("spread", [1.5, 3.0])
def test_a_sudden_turn_is_spread_by_the_closed_form(spread):
    angle, surface = np.radians(10.0), wall(0.0)
    profile = profile_over(surface)
    made = steered(profile, ball(2.0 * R), jump(0.0, angle), nothing, AxisLimits(1.0, 1.0, spread))
    lean = np.arctan2(made.axis[:, 0], made.axis[:, 2])
    s = made.contact[:, 0]
    want = np.where(s > 0.0, angle - 0.5 * angle * np.exp(-s / spread), 0.5 * angle * np.exp(s / spread))
    # a sum over stations against the integral: h²/(24 l²), and where in its step the jump lies
    np.testing.assert_allclose(lean, want, atol=angle * SPACING / spread * 0.6)
    assert np.all(np.diff(lean) >= -1e-12) and made.free.all()
    assert made.per_mm == pytest.approx(angle / (2.0 * spread), rel=0.15)


def test_turns_are_spread_until_they_keep_to_the_limit():
    limit = np.radians(1.0)
    made = steered(profile_over(wall(0.0)), ball(2.0 * R), jump(0.0, np.radians(20.0)), nothing, AxisLimits(1.0, limit))
    assert 0.4 * limit < made.per_mm <= limit


def test_an_even_field_is_left_as_it_is():
    made = steered(profile_over(wall(15.0)), ball(2.0 * R), leaned(np.radians(20.0)), nothing, WIDE)
    want = leaned(np.radians(20.0))(made.contact, np.tile([0.0, -np.cos(0.26), -np.sin(0.26)], (len(made.contact), 1)),
                                    made.contact)
    np.testing.assert_allclose(made.axis, want, atol=1e-9)


def test_no_station_is_blocked_where_an_axis_of_the_fan_is_free_and_the_field_stays_even():
    """A bar hangs over the middle of the way: upright the tool is in it, leaned it is not."""
    body = ball(2.0 * R)
    profile = profile_over(wall(0.0, 0.0, 0.0, 12.0), 0.2)

    def bar(tip, axis):  # |x| < 3 at z = 30, y from -20 to -1: passed by leaning along x or away under it
        up = (30.0 - tip[:, 2]) / axis[:, 2]
        at = tip + up[:, None] * axis
        return (np.abs(at[:, 0]) < 3.0) & (at[:, 1] > -20.0)

    made = steered(profile, body, upright, bar, AxisLimits(np.radians(40.0), np.radians(10.0)))
    assert made.free.all()
    normal = np.tile([0.0, -1.0, 0.0], (len(made.contact), 1))
    tip = tips(made.contact, normal, body, made.axis)
    assert not bar(tip, made.axis).any()
    assert np.abs(angles_between(made.axis)).max() < np.radians(15.0)  # one side to the other, under the bar
    far = np.abs(made.contact[:, 0]) > 12.0
    assert np.degrees(np.arccos(made.axis[far, 2])).max() < 3.0  # where nothing is in the way it is what was wanted


def test_where_every_axis_is_blocked_that_is_told_and_the_others_are_not_moved():
    profile = profile_over(wall(0.0))
    made = steered(profile, ball(2.0 * R), upright,
                   lambda tip, axis: np.abs((tip + R * axis)[:, 0]) < 2.0, WIDE)
    inside = np.abs(made.contact[:, 0]) < 2.0
    np.testing.assert_array_equal(made.free, ~inside)
    np.testing.assert_allclose(made.axis, np.tile([0.0, 0.0, 1.0], (len(inside), 1)), atol=1e-6)


def test_a_thinner_obstacle_turns_axes_less():
    profile, lean = profile_over(wall(0.0)), []
    for half in (1.0, 3.0):
        def met(tip, axis, half=half):
            at = tip + ((25.0 - tip[:, 2]) / axis[:, 2])[:, None] * axis
            return (np.abs(at[:, 0]) < half) & (np.abs(at[:, 1] + R) < half)
        made = steered(profile, ball(2.0 * R), upright, met, WIDE)
        assert made.free.all()
        lean.append(float(np.arccos(made.axis[:, 2]).sum()))
    assert 0.0 < lean[0] < lean[1]


def test_the_pass_before_is_followed():
    profile = profile_over(wall(0.0))
    body = ball(2.0 * R)
    first = steered(profile, body, jump(-100.0, np.radians(20.0)), nothing, WIDE)
    alone = steered(profile, body, upright, nothing, WIDE)
    beside = steered(profile, body, upright, nothing, WIDE, first)
    angle = np.degrees(np.arccos(np.clip((beside.axis * alone.axis).sum(axis=1), -1.0, 1.0)))
    np.testing.assert_allclose(angle, np.degrees(np.arctan2(np.sin(np.radians(20.0)), 2.0 + np.cos(np.radians(20.0)))),
                               atol=1e-6)


def test_passes_between_walls_are_walked_whole_with_steered_axes_and_not_with_those_wanted():
    """A wall of 12 mm with another 9 mm before it: along the normal, leaned, the holder meets the other."""
    surface = wall(0.0, 0.0, 0.0, 12.0)
    tree = tree_of(surface, opposite(-9.0, 12.0))
    body = ball(2.0 * R, neck=8.0, stickout=18.0, shank=6.0)
    profile = profile_over(surface, 0.3)
    free = enters(tree, body, Clearances())
    field = lead_and_tilt(0.0, np.radians(30.0))
    ends = steps(profile, R, CHORD, SCALLOP)
    blunt = posed(profile, ends, body, field, free, CHORD, 0.003)
    made = steered(profile, body, field, free, AxisLimits(np.radians(70.0), np.radians(10.0)))
    led = posed(profile, ends, body, made, free, CHORD, 0.003)
    assert made.free.all()
    assert sum(b - a for a, b in blunt.left) > 0.9 * profile.length
    assert sum(b - a for a, b in led.left) == 0.0 and len(led.pieces) == 1


def test_a_pass_shorter_than_it_takes_to_get_round_is_led_too():
    """Both ends are nearer than it takes to turn through the cone at the limit."""
    profile, slow = profile_over(wall(0.0)), AxisLimits(np.radians(40.0), np.radians(0.2))
    assert slow.cone / slow.per_mm > profile.length
    blocked = beside = 0

    def post(tip, axis):
        nonlocal blocked, beside
        met = (np.abs(tip[:, 0]) < 1.0) & (axis @ [0.0, 0.0, 1.0] > np.cos(np.radians(10.0)))
        blocked, beside = blocked + int(met.sum()), beside + int((~met).sum())
        return met

    made = steered(profile, ball(2.0 * R), upright, post, slow)
    assert len(made.axis) == len(made.contact) and made.free.all() and blocked and beside
