"""Steps parted where the life of a cutter ends: minutes, places, names, and what programs say."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from output.clamping_sequence import clamped_steps
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from service.stages.cautions import lives_ended
from tests import synthetic_plan as made
from tests.synthetic_plan import write_linuxcnc
from toolpath.feeds.tool_life import minutes_in_cut, with_fresh_cutters, worn
from toolpath.workingsteps import Trajectory, TrajectoryKind, trajectory_seconds

CLEAR, FEED, AIR = made.CLEAR, 600.0, 3000.0


def passes(*lengths: float) -> tuple[Trajectory, ...]:
    """Passes side by side, each from the clearance plane and back to it; the last two go on without lifting."""
    out: list[Trajectory] = []
    at = np.array([0.0, 0.0, CLEAR])

    def go(motion: TrajectoryKind, to: list[float], feed: float) -> None:
        nonlocal at
        end = np.array(to)
        out.append(Trajectory(motion, np.array([at, end]), feed))
        at = end

    for k, length in enumerate(lengths):
        y = float(k)
        if k:
            go(TrajectoryKind.RAPID, [0.0, y, CLEAR], 0.0)
        go(TrajectoryKind.RAPID, [0.0, y, 5.0], 0.0)
        go(TrajectoryKind.APPROACH, [0.0, y, 2.0], 200.0)
        go(TrajectoryKind.CUT, [length, y, 2.0], FEED)
        go(TrajectoryKind.CONNECT, [length, y + 0.5, 2.0], AIR)
        go(TrajectoryKind.CUT, [0.0, y + 0.5, 2.0], FEED)
        go(TrajectoryKind.LIFT, [0.0, y + 0.5, 5.0], AIR)
        go(TrajectoryKind.RAPID, [0.0, y + 0.5, CLEAR], 0.0)
    return tuple(out)


def step(number: int, *lengths: float):
    return made.step(number, made.BALL, "zigzag", trajectories=passes(*lengths))


def cuts(steps) -> list[np.ndarray]:
    return [t.points for s in steps for t in s.trajectories if t.motion is TrajectoryKind.CUT]


def test_minutes_are_those_of_moves_at_the_feed_and_below_it():
    s = step(1, 100.0)
    kept = [t.motion for t, m in zip(s.trajectories, minutes_in_cut(s), strict=True) if m > 0.0]
    assert kept == [TrajectoryKind.APPROACH, TrajectoryKind.CUT, TrajectoryKind.CUT]


def test_minutes_hold_cuts_faster_than_the_feed_of_the_step_and_all_where_air_is_no_faster():
    s = step(1, 100.0)
    eased = replace(s, feed=0.1 * FEED)  # as of a slender tool, whose layers go faster where less stands in front
    assert minutes_in_cut(eased).sum() == minutes_in_cut(s).sum() > 0.2
    same = replace(s, feed=AIR, trajectories=tuple(replace(t, feed=AIR) for t in s.trajectories))
    kept = [t.motion for t, m in zip(same.trajectories, minutes_in_cut(same), strict=True) if m > 0.0]
    assert kept == [m for m in (t.motion for t in s.trajectories) if m is not TrajectoryKind.RAPID]
    assert minutes_in_cut(s).sum() == pytest.approx(2 * 100.0 / FEED + 3.0 / 200.0, rel=0.01)
    assert trajectory_seconds(s.trajectories, s.rates).sum() == pytest.approx(s.seconds)
    assert trajectory_seconds((), s.rates).shape == (0,)


def test_a_step_is_parted_between_passes_before_the_life_ends():
    whole = step(7, *[30.0] * 5)
    each = float(minutes_in_cut(whole).sum()) / 5
    parts = with_fresh_cutters([whole], {"T1": 2.5 * each}, CLEAR)
    assert [(s.id, s.fresh) for s in parts] == [("S07", False), ("S07b", True), ("S07c", True)]
    assert {s.zone for s in parts} == {"Z3"}
    assert [round(float(minutes_in_cut(s).sum()) / each, 6) for s in parts] == [2.0, 2.0, 1.0]
    assert parts[1].name == "S07b Z3 zigzag T1 F12 F13 fresh cutter" and parts[0].name == whole.name
    for a, b in zip(cuts([whole]), cuts(parts), strict=True):
        assert np.array_equal(a, b)
    for s in parts:
        assert s.trajectories[0].points[0][2] == CLEAR and s.trajectories[-1].points[-1][2] == CLEAR
        assert all(np.array_equal(a.points[-1], b.points[0])
                   for a, b in zip(s.trajectories, s.trajectories[1:], strict=False))
    assert parts[1].trajectories[0].points[0].tolist() == [0.0, 2.0, CLEAR]  # over its own first pass


def test_lives_go_on_over_steps_and_programs():
    a, b, c = step(1, 30.0), step(2, 30.0), step(3, 30.0)
    each = float(minutes_in_cut(a).sum())
    got = with_fresh_cutters([a, b, c], {"T1": 2.2 * each}, CLEAR)
    assert [(s.id, s.fresh) for s in got] == [("S01", False), ("S02", False), ("S03", True)]
    assert worn(got) == {"T1": pytest.approx(each)} and worn([a, b]) == {"T1": pytest.approx(2 * each)}
    got = with_fresh_cutters([c], {"T1": 2.2 * each}, CLEAR, worn([a, b]))
    assert [(s.id, s.fresh) for s in got] == [("S03", True)] and got[0].name.endswith("fresh cutter")


def test_nothing_changes_without_a_life_or_within_it():
    s = [step(1, 30.0, 30.0), step(2, 5.0)]
    assert all(a is b for a, b in zip(with_fresh_cutters(s, {}, CLEAR), s, strict=True))
    got = with_fresh_cutters(s, {"T1": 1e6}, CLEAR)
    assert [(t.id, t.name, t.fresh) for t in got] == [(t.id, t.name, False) for t in s]
    assert [len(t.trajectories) for t in got] == [len(t.trajectories) for t in s]


def test_a_run_longer_than_a_life_gets_a_cutter_of_its_own_and_is_told_of():
    whole = step(4, 10.0, 300.0, 10.0)
    got = with_fresh_cutters([whole], {"T1": 0.5}, CLEAR)
    assert [(s.id, len(cuts([s]))) for s in got] == [("S04", 2), ("S04b", 2), ("S04c", 2)]
    inputs = SimpleNamespace(tools=[SimpleNamespace(id="T1", life_min=0.5), SimpleNamespace(id="T2", life_min=None)])
    told = lives_ended(inputs, got)
    assert [c.subjects for c in told] == [("T1", "S04b", "S04c"), ("T1", "S04b")]
    assert told[0].remedy == "have 3 cutters ready" and told[1].measured == pytest.approx(1.0, abs=0.05)
    assert lives_ended(inputs, [step(1, 10.0)]) == []


def test_the_thirtieth_part_has_a_name_of_two_letters():
    got = with_fresh_cutters([step(2, *[60.0] * 30)], {"T1": 0.25}, CLEAR)
    assert [s.id for s in got][:3] == ["S02", "S02b", "S02c"] and got[25].id == "S02z" and got[26].id == "S02bb"
    assert len({s.id for s in got}) == len(got) == 30


def test_the_program_puts_the_tool_away_stops_and_takes_it_again():
    parts = with_fresh_cutters([step(7, 30.0, 30.0)], {"T1": 0.15}, CLEAR)
    text = write_linuxcnc(made.plan(*parts))
    lines = text.splitlines()
    at = lines.index("T0 M6")
    assert lines[at - 3:at] == ["M5", "M9", lines[at - 1]] and lines[at - 1].startswith("(T1")
    assert lines[at + 1:at + 5] == ["(Fresh cutter in T1: change it and set its length)", "M0", "T1 M6", "G43 H1"]
    assert lines[at - 4] == "" and f"Z{CLEAR:g}." in lines[at - 5]  # up at the clearance plane before
    first = next(i for i in range(at + 5, len(lines)) if lines[i].startswith("G0"))
    assert lines[first] == f"G0 Z{CLEAR:g}." and re.match(r"X\S+ Y1\.$", lines[first + 1])
    assert text.count("T1 M6") == 2 and "M0\n" not in write_linuxcnc(made.plan(step(7, 30.0)))


def test_step_nc_names_the_fresh_cutter():
    parts = with_fresh_cutters([step(7, 30.0, 30.0)], {"T1": 0.15}, CLEAR)
    for write in (write_stepnc_aim, write_stepnc_arm):
        assert "S07b Z3 zigzag T1 F12 F13 fresh cutter" in write(made.plan(*parts))


def test_where_the_machine_turns_the_cutter_is_changed_above_the_ball():
    whole = made.clamped()
    assert whole.clamping is not None
    parts: list = []
    for s in whole.steps:
        clear = whole.clamping.frames[s.access].clearance
        parts += with_fresh_cutters([s], {s.tool.id: 1e-6}, clear, worn(parts))
    assert len(parts) > 1 and any(s.fresh for s in parts)
    for s in clamped_steps(replace(whole, steps=tuple(parts))):
        assert s.fresh or not s.step.fresh
    walked = clamped_steps(replace(whole, steps=tuple(parts)))
    assert all(a.last == b.fresh for a, b in zip(walked, walked[1:], strict=False))
    text = write_linuxcnc(replace(whole, steps=tuple(parts)))
    assert text.count("T0 M6") == sum(s.fresh for s in parts)
    assert all(text.index(f"({s.id} ") > 0 for s in parts)
