"""The inverse kinematics of the writers against the forward kinematics of the witness, and along paths."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.errors import OutputError
from output.inverse_kinematics import RotaryMachine
from verify.kinematics import KINDS, Kinematics

PIVOTS = {"table-table-AC": ((0.0, -3.0, -80.0), (12.0, 5.0, 0.0)),
          "table-table-BC": ((4.0, 0.0, -60.0), (0.0, 9.0, 1.0)),
          "head-table-BC": ((0.0, 0.0, 150.0), (20.0, -7.0, 0.0)), "head-head-BC": ((0.0, 0.0, 150.0),),
          "head-head-AC": ((0.0, 0.0, 90.0),)}
POSES = 10_000


def unit(v):
    v = np.asarray(v, dtype=np.float64)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def machine(kind, limits=None, tcp=True):
    return RotaryMachine(kind, PIVOTS[kind], None if limits is None else np.radians(limits), tcp)


@pytest.mark.parametrize("kind", KINDS)
def test_the_witness_finds_every_pose_again(kind):
    """10,000 tips and axes over the whole sphere, both places of the rotary axes, poles among them."""
    rng = np.random.default_rng(5)
    tips, axes = rng.uniform(-300.0, 300.0, (POSES, 3)), unit(rng.normal(size=(POSES, 3)))
    axes[:3] = [[0, 0, 1], [0, 0, -1], [1e-12, 0, 1]]
    here, witness = machine(kind), Kinematics(kind, PIVOTS[kind])
    for k in range(2):
        turns = here.turns(axes)[:, k]
        joints = here.joints(tips, turns, 137.5)
        assert np.abs(witness.tip(joints, turns, 137.5) - tips).max() < 1e-9
        assert np.abs(witness.axis(turns) - axes).max() < 1e-9
        assert np.abs(here.tips(joints, turns, 137.5) - tips).max() < 1e-9
        assert np.abs(here.axes(turns) - axes).max() < 1e-9
        assert (np.abs(turns[:, 1]) <= np.pi + 1e-12).all()


def test_a_table_of_the_control_stands_where_the_control_puts_it():
    """LinuxCNC's xyzac-trt holds a tip at X10 Z5 with A30 C90 at joints 0, 6.160, 9.330."""
    here = RotaryMachine("table-table-AC", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    turns = np.radians([[30.0, 90.0]])
    assert np.allclose(here.joints(np.array([[10.0, 0.0, 5.0]]), turns, 0.0), [[0.0, 6.160254, 9.330127]], atol=1e-6)
    assert np.allclose(here.follow(here.axes(turns), np.radians([20.0, 80.0])), turns)


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_turns_without_jumps_and_goes_through_the_pole_on_the_other_side(kind):
    here = machine(kind)
    spin = np.linspace(0.0, 6.0 * np.pi, 400)
    cone = np.stack([0.3 * np.cos(spin), 0.3 * np.sin(spin), np.full(400, 0.9)], axis=1)
    turns = here.follow(unit(cone))
    assert np.allclose(np.abs(np.diff(turns[:, 1])), spin[1], atol=1e-9)  # three whole turns, evenly
    assert np.ptp(turns[:, 0]) < 1e-9
    over = unit(np.stack([np.linspace(-0.5, 0.5, 101), np.zeros(101), np.ones(101)], axis=1))
    turns = here.follow(over)
    assert np.ptp(turns[:, 1]) < 1e-9  # the tilt changes its sign, and C stands still
    assert np.allclose(here.axes(turns), over)


def test_limits_choose_the_place_of_the_axes_and_name_what_does_not_fit():
    axes = unit([[0.0, -0.5, 1.0], [0.1, -0.5, 1.0]])
    free = machine("table-table-AC").follow(axes)
    assert (np.degrees(free[:, 0]) < -20.0).all()  # the nearer: C hardly turns
    held = machine("table-table-AC", [[-5.0, 110.0], [-360.0, 360.0]]).follow(axes)
    assert (np.degrees(held[:, 0]) > 20.0).all()
    assert np.allclose(machine("table-table-AC").axes(held), axes)
    with pytest.raises(OutputError) as refused:
        machine("table-table-AC", [[-5.0, 20.0], [-360.0, 360.0]]).follow(axes)
    assert refused.value.code == "rotary_limit" and "A26.565" in refused.value.message


def test_a_turn_that_would_have_to_be_unwound_in_the_cut_is_refused():
    """Two turns round a cone where C may turn one and a half: no jump back while the tool cuts."""
    spin = np.linspace(0.0, 4.0 * np.pi, 300) - 3.1
    cone = unit(np.stack([0.3 * np.cos(spin), 0.3 * np.sin(spin), np.full(300, 0.9)], axis=1))
    held = machine("table-table-AC", [[0.0, 110.0], [-270.0, 270.0]])
    with pytest.raises(OutputError) as refused:
        held.follow(cone)
    assert refused.value.code == "rotary_limit"
    once = held.follow(cone[:190])  # one and a quarter fit, from the right end of the range
    assert (np.abs(once[:, 1]) <= np.radians(270.0) + 1e-9).all()
    assert np.abs(np.diff(once[:, 1])).max() < 0.05


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_between_its_points_a_course_stays_by_the_straight_way(kind, tcp):
    """Held at 50 places of every block against the witness: the tip of a program of joints, the axis of both."""
    rng = np.random.default_rng(9)
    tips, axes = rng.uniform(-40.0, 40.0, (6, 3)), unit(np.column_stack([rng.uniform(-0.6, 0.6, (6, 2)), np.ones(6)]))
    here, witness = machine(kind, tcp=tcp), Kinematics(kind, PIVOTS[kind])
    path, turns = here.course(tips, axes, 0.002, 1e-3, 120.0)
    at = [int(np.argmin(np.linalg.norm(path - t, axis=1))) for t in tips]
    assert at == sorted(at) and np.allclose(path[at], tips)
    joints = here.joints(path, turns, 120.0)
    for share in np.linspace(0.0, 1.0, 50):
        between = (1 - share) * turns[:-1] + share * turns[1:]
        got = witness.axis(between)
        off = [np.abs(got @ unit(np.cross(a, b))) for a, b in zip(axes[:-1], axes[1:], strict=True)]
        assert np.min(off, axis=0).max() < 1.2e-3  # off the nearest of the five great circles
        if not tcp:
            way = (1 - share) * path[:-1] + share * path[1:]
            there = witness.tip((1 - share) * joints[:-1] + share * joints[1:], between, 120.0)
            assert np.linalg.norm(there - way, axis=1).max() < 0.0025


def test_an_axis_that_passes_close_by_the_pole_is_followed():
    """The tilt passes Z at 0.01 deg: C swings half a turn in a few hundredths of a degree of tilt."""
    here = machine("table-table-AC")
    near = np.tan(np.radians(0.01))
    axes = unit(np.array([[-0.2, near, 1.0], [0.2, near, 1.0]]))
    path, turns = here.course(np.array([[0.0, 0, 0], [10.0, 0, 0]]), axes, 0.002, 1e-3, 0.0)
    got = here.axes(np.linspace(turns[:-1], turns[1:], 20).reshape(-1, 2))
    assert np.abs(got @ unit(np.cross(axes[0], axes[1]))).max() < 1.2e-3
    assert len(path) < 200


@pytest.mark.parametrize("limits", [[[-120, 120], [-360, 360]], [[-5, 110], [0, 90]], [[-90, 20], [-200, 170]]])
def test_an_axis_stands_where_one_of_its_places_is_inside_the_limits(limits):
    rng = np.random.default_rng(4)
    axes = unit(rng.normal(size=(400, 3)))
    here, (low, high) = machine("table-table-BC", limits), np.radians(limits).T
    turned = here.turns(axes)[:, None] + 2.0 * np.pi * np.arange(-3, 4)[:, None, None] * [0.0, 1.0]
    inside = ((turned >= low) & (turned <= high)).all(axis=3).any(axis=(1, 2))
    assert np.array_equal(here.stands(axes), inside) and 0 < inside.sum() < 400


@pytest.mark.parametrize("most", [720.0, 99_999.0, 1e6])
def test_limits_far_apart_are_no_more_places_to_choose_from(most):
    """A control that counts on to 99999 deg held 1112 places an axis, and a pass of 100 poses took 7 s."""
    spin = np.linspace(0.0, 2.5, 50)
    cone = unit(np.stack([0.3 * np.cos(spin), 0.3 * np.sin(spin), np.full(50, 0.9)], axis=1))
    near = machine("table-table-AC", [[0.0, 110.0], [-360.0, 360.0]])
    far = machine("table-table-AC", [[0.0, 110.0], [-most, most]])
    assert np.array_equal(far.follow(cone), near.follow(cone))
    for start in (-most, most - 180.0, 0.5 * most):  # from where C stands, by its limits too
        turns = far.follow(cone, np.radians([20.0, start]))
        assert abs(np.degrees(turns[0, 1]) - start) < 505.0  # a turn, and room for the path before its limit
        assert np.allclose(far.axes(turns), cone, atol=1e-8)
    assert far._choices(far.turns(cone), 0.0, np.zeros(49, bool)).shape[1] <= 16


@pytest.mark.parametrize("aside", [0.0, 1e-6, 0.03])
@pytest.mark.parametrize("count", [9, 40])
@pytest.mark.parametrize(("kind", "tilts"), [("table-table-AC", [-30.0, 110.0]), ("table-table-AC", [-110.0, 30.0]),
                                             ("head-head-BC", [-30.0, 110.0]), ("head-table-BC", [-20.0, 100.0])])
def test_the_place_of_the_axes_changes_only_at_the_pole(kind, tilts, count, aside):
    """A fan through Z, farther to one side than the tilt may go to it: C has to swing round at the pole, not before."""
    lean = np.radians(np.linspace(37.0, -37.0, count))
    fan = np.column_stack([np.full(count, aside), np.sin(lean), np.cos(lean)])
    axes = unit(fan[:, [1, 0, 2]] if "BC" in kind else fan)
    tips = np.column_stack([np.zeros(count), np.linspace(0.0, 20.0, count), np.zeros(count)])
    here = machine(kind, [tilts, [-360.0, 360.0]])
    path, turns = here.course(tips, axes, 0.002, 1e-4, 100.0)
    assert np.degrees(turns[:, 0]).min() >= tilts[0] - 1e-9 and np.degrees(turns[:, 0]).max() <= tilts[1] + 1e-9
    ends = np.array([np.interp(path[:, 1], tips[:, 1], column) for column in axes.T]).T
    for share in np.linspace(0.0, 1.0, 11):
        got = here.axes((1 - share) * turns[:-1] + share * turns[1:])
        at = (1 - share) * path[:-1, 1] + share * path[1:, 1]
        wanted = unit(np.array([np.interp(at, path[:, 1], column) for column in unit(ends).T]).T)
        assert np.linalg.norm(got - wanted, axis=1).max() < 5e-3  # 25 degrees where they changed in between
