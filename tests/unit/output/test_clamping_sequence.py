"""Programs of one clamping, read back by the witness: tips, tool axes, ways from one axis to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import OutputError
from output.clamping_sequence import Leg, clamped_steps, home_of
from output.inverse_kinematics import RotaryMachine
from output.stepnc.common import _curves
from tests.synthetic_plan import clamped, write_linuxcnc
from toolpath.workingsteps import Trajectory, TrajectoryKind
from verify.gcode.reader import read_program
from verify.kinematics import KINDS, Kinematics
from verify.program.move_kinds import FEED


def read(plan):
    machine = plan.clamping.machine
    return read_program(write_linuxcnc(plan), kinematics=Kinematics(machine.kind, machine.pivots),
                        gauge_length=plan.clamping.gauges)


def wanted(plan):
    """Tips (n, 3) and axes (n, 3) of all feed moves of a plan in the setup frame, in order, with their starts."""
    tips, axes = [], []
    for step in plan.steps:
        turn = plan.clamping.frames[step.access].rotation
        for t in step.trajectories:
            if t.motion is not TrajectoryKind.RAPID:
                a = np.tile([0.0, 0.0, 1.0], (len(t.points), 1)) if t.axes is None else t.axes
                tips.append(t.points @ turn)
                axes.append(a @ turn)
    return np.vstack(tips), np.vstack(axes)


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_the_witness_reads_the_planned_tips_and_axes(kind, tcp):
    plan = clamped(kind, tcp)
    p = read(plan)
    cuts = np.flatnonzero(~np.isnan(p.feed))
    tips, axes = wanted(plan)
    got_tips = np.vstack([p.end[cuts], p.start[cuts]])
    got_axes = np.vstack([p.poses.end_axis[cuts], p.poses.start_axis[cuts]])
    far = np.linalg.norm(got_tips[:, None] - tips[None], axis=2)  # every planned point is there, and nothing far off
    assert far.min(axis=0).max() < 3e-4
    near = np.argmin(far, axis=0)
    assert np.linalg.norm(got_axes[near] - axes, axis=1).max() < 5e-6
    segments = np.array([0.0, 0.25, 0.5, 0.75, 1.0])[None, :, None]
    way = p.start[cuts][:, None] + segments * (p.end[cuts] - p.start[cuts])[:, None]
    a, b = tips[:-1], tips[1:]
    d = b - a
    for places in way:
        t = np.clip(((places[:, None] - a) * d).sum(axis=2) / np.maximum((d * d).sum(axis=1), 1e-30), 0.0, 1.0)
        assert np.linalg.norm(places[:, None] - a - t[..., None] * d, axis=2).min(axis=1).max() < 2.5e-3


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_what_turns_stays_out_of_the_ball(kind, tcp):
    """While an axis turns in a rapid, and on the way there, the plane under the tip does not enter the ball."""
    plan = clamped(kind, tcp)
    p, c = read(plan), plan.clamping
    turning = np.abs(p.poses.end_turn - p.poses.start_turn).max(axis=1) > 1e-9
    rapid = np.isnan(p.feed)
    rows = np.flatnonzero(turning & rapid)
    assert len(rows) > 20
    for share in np.linspace(0.0, 1.0, 9):
        tip = (1 - share) * p.start[rows] + share * p.end[rows]
        axis = (1 - share) * p.poses.start_axis[rows] + share * p.poses.end_axis[rows]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        assert (np.einsum("ni,ni->n", tip - c.centre, axis) > c.radius).all()
    for k in np.flatnonzero(rapid & ~turning):  # all others go along the tool axis or square to it
        move, axis = p.end[k] - p.start[k], p.poses.end_axis[k]
        if not np.isfinite(move).all():
            continue
        along = abs(float(move @ axis))
        assert along < 1e-3 or np.linalg.norm(np.cross(move, axis)) < 1e-3
    assert not (turning & ~rapid).any() or (p.kind[turning & ~rapid] == FEED).all()


def test_a_tool_is_changed_above_the_ball_with_the_axes_at_zero():
    plan = clamped()
    lines = write_linuxcnc(plan).splitlines()
    change = [k for k, line in enumerate(lines) if " M6" in line]
    assert len(change) == 2
    home = home_of(plan.clamping)
    before = clamped_steps(plan)[1].after[-1]
    assert np.allclose(before.tips[-1], home) and np.allclose(before.turns[-1], 0.0)
    assert lines[change[1] - 5:change[1] - 1] == ["", "M5", "M9", "G53 G0 Z0."] and lines[change[1] - 6] == "M429"
    after = [line for line in lines[change[1]:change[1] + 8] if line.startswith(("G", "M"))]
    assert after[:1] == ["G43 H1"] and after.index("M428") > [k for k, x in enumerate(after) if x.startswith("G0 Z")][0]


def test_programs_of_joints_time_what_turns_block_by_block():
    """The tip goes at its feed although XYZ are joints."""
    plan = clamped(tcp=False)
    text = write_linuxcnc(plan)
    assert "G93" in text and "M428" not in text and "Made only for pivots 5 0 -80; 7 3 -20 mm" in text
    p = read(plan)
    turning = (np.abs(p.poses.end_turn - p.poses.start_turn).max(axis=1) > 1e-9) & ~np.isnan(p.feed)
    length = np.linalg.norm(p.end - p.start, axis=1)[turning]
    assert length.sum() > 10.0
    assert length.sum() / p.minutes[turning].sum() == pytest.approx(600.0, rel=1e-3)


def test_an_axis_that_jumps_from_one_trajectory_to_the_next_is_refused():
    plan = clamped(swings=False)
    last = plan.steps[-1]
    lean = np.tile([0.1, 0.0, np.sqrt(0.99)], (len(last.trajectories[2].points), 1))
    jumps = replace(last, trajectories=(*last.trajectories[:2], replace(last.trajectories[2], axes=lean),
                                        *last.trajectories[3:]))
    with pytest.raises(OutputError) as refused:
        write_linuxcnc(replace(plan, steps=(*plan.steps[:-1], jumps)))
    assert refused.value.code == "axis_jump" and refused.value.subjects == ("S05",)


def test_limits_and_missing_frames_are_refused_by_name():
    plan = clamped()
    held = replace(plan.clamping.machine, limits=np.radians([[-20.0, 20.0], [-360.0, 360.0]]))
    with pytest.raises(OutputError) as refused:
        write_linuxcnc(replace(plan, clamping=replace(plan.clamping, machine=held)))
    assert refused.value.code == "rotary_limit"
    frames = {k: v for k, v in plan.clamping.frames.items() if k != "I2"}
    with pytest.raises(OutputError) as refused:
        write_linuxcnc(replace(plan, clamping=replace(plan.clamping, frames=frames)))
    assert refused.value.code == "no_frame" and refused.value.subjects == ("S04",)


def test_c_alone_round_an_upright_tool_is_no_curve():
    """After a pass that ends upright C goes home while nothing else moves."""
    tips, up = np.array([[0.0, 0.0, 20.0], [5.0, 0.0, 20.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    across = Leg(TrajectoryKind.RAPID, tips, up, np.array([[0.0, 0.4], [0.0, 0.4]]), 0.0)
    home = Leg(TrajectoryKind.RAPID, tips[[1, 1]], up, np.array([[0.0, 0.4], [0.0, 0.0]]), 0.0)
    (curve,) = _curves([across, home])
    assert len(curve.points) == 2
    assert len(_curves([home, across])) == 1


def test_the_place_of_the_rotary_axes_is_chosen_for_the_whole_step():
    """Both places do for the first axis; from the nearer one C would run into its limit in the middle of the pass."""
    plan = clamped("table-table-AC", True)
    a = np.radians(np.linspace(0.0, 200.0, 101))
    lean = np.radians(20.0)
    axes = np.column_stack([np.sin(lean) * np.sin(a), -np.sin(lean) * np.cos(a), np.full(101, np.cos(lean))])
    tips = np.column_stack([np.linspace(-4.0, 4.0, 101), np.zeros(101), np.full(101, 12.0)])
    step = replace(plan.steps[0], trajectories=(Trajectory(TrajectoryKind.CUT, tips, 500.0, axes),))
    clamping = replace(plan.clamping, machine=RotaryMachine("table-table-AC", limits=np.radians(
        [[-60.0, 60.0], [-190.0, 190.0]])))
    (section,) = clamped_steps(replace(plan, steps=(step,), clamping=clamping))
    turns = np.vstack([leg.turns for leg in section.legs])
    assert np.abs(turns[:, 1]).max() <= np.radians(190.0) + 1e-9
    wanted_axes = axes @ plan.clamping.frames[step.access].rotation
    assert np.abs(clamping.machine.axes(turns)[[0, -1]] - wanted_axes[[0, -1]]).max() < 1e-9
    alone = clamping.machine.follow(wanted_axes[:1], np.zeros(2))[0]
    assert np.abs(alone - turns[0]).max() > 1.0  # it would have been the other place


@pytest.mark.parametrize("at", [0, 24, 25, 26, 30])
def test_parts_of_a_pass_over_the_pole_go_on_from_one_another(at):
    """A tilts to one side alone, so C has to swing round at the pole; the part that ends just past it would rather
    tilt the other way, from where the next part has no way on."""
    plan = clamped()
    lean = np.radians(np.linspace(25.0, -25.0, 51))
    axes = np.column_stack([np.zeros(51), -np.sin(lean), np.cos(lean)])
    tips = np.column_stack([np.linspace(-4.0, 4.0, 51), np.zeros(51), np.full(51, 12.0)])
    parts = [(0, 51)] if at == 0 else [(0, at + 1), (at, 51)]
    cuts = tuple(Trajectory(TrajectoryKind.CUT, tips[a:b], 500.0, axes[a:b]) for a, b in parts)
    machine = RotaryMachine("table-table-AC", limits=np.radians([[-5.0, 110.0], [-360.0, 360.0]]))
    job = replace(plan, steps=(replace(plan.steps[0], trajectories=cuts),),
                  clamping=replace(plan.clamping, machine=machine))
    (section,) = clamped_steps(job)
    before, *legs = [section.before[-2], *section.legs]
    assert np.degrees(np.vstack([leg.turns for leg in legs])[:, 0]).min() >= -5.0
    for one, other in zip([before, *legs], legs, strict=False):
        assert np.abs(one.turns[-1] - other.turns[0]).max() < 1e-9
    assert np.abs(np.vstack([leg.axes for leg in legs])[[0, -1]] - axes[[0, -1]]).max() < 1e-9
    p = read(job)
    cut = np.flatnonzero(~np.isnan(p.feed))
    assert np.abs(p.poses.end_axis[cut[:-1]] - p.poses.start_axis[cut[1:]]).max() < 1e-9
