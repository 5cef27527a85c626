"""Feeds that a machine can follow: the same way, never faster, with few changes that are not close together."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from geometry.machine_rates import Rates
from geometry.move_timing import change_seconds
from toolpath.feeds import feed_changes
from toolpath.feeds.feed_changes import LEAST, PRICE, with_few_changes
from toolpath.lines import SHORTEST
from toolpath.workingsteps import Trajectory, TrajectoryKind

RATES = Rates(10000.0, 1000.0, 0.001)


def straight(pieces, drop=0.0):
    """Trajectories along X, one for each (length, feed)."""
    x, out = 0.0, []
    for length, feed in pieces:
        ends = np.array([[x, 0.0, -drop * x], [x + length, 0.0, -drop * (x + length)]])
        out.append(Trajectory(TrajectoryKind.CUT, ends, feed))
        x += length
    return out


def profile(trajectories):
    """Joined (length, feed)."""
    out = []
    for t in trajectories:
        if out and out[-1][1] == t.feed:
            out[-1][0] += t.length
        else:
            out.append([t.length, t.feed])
    return out


def seconds(pieces):
    """What the choice of feeds minimizes: time at the feeds, time lost in changes, and their price."""
    speeds = [f / 60.0 for _, f in pieces]
    lost = [change_seconds(a, b, RATES) * abs(a - b) / (2 * max(a, b)) + PRICE
            for a, b in itertools.pairwise(speeds) if a != b]
    return sum(length / v for (length, _), v in zip(pieces, speeds, strict=True)) + sum(lost)


def test_a_short_fast_stretch_takes_the_feed_of_its_neighbours():
    assert profile(with_few_changes(straight([(5.0, 50.0), (0.1, 225.0), (5.0, 50.0)]), RATES)) == [[10.1, 50.0]]


def test_a_short_slow_stretch_is_lengthened():
    (a, _), (b, slow), (c, _) = profile(with_few_changes(straight([(9.0, 200.0), (0.1, 50.0), (9.0, 200.0)]), RATES))
    assert slow == 50.0 and b == pytest.approx(LEAST) and a + b + c == pytest.approx(18.1)


def test_long_stretches_keep_their_feeds():
    pieces = [[20.0, 200.0], [20.0, 100.0], [40.0, 3000.0], [20.0, 200.0]]
    assert profile(with_few_changes(straight(pieces), RATES)) == pieces


def test_a_link_that_saves_no_time_worth_its_changes_goes_at_the_feed_of_the_cut():
    """At 1200 mm/min a link of 3 mm takes 0.15 s; at 3000 the machine would need 5 mm to get there and back."""
    assert profile(with_few_changes(straight([(9.0, 1200.0), (3.0, 3000.0), (9.0, 1200.0)]), RATES)) == [[21.0, 1200.0]]
    assert len(profile(with_few_changes(straight([(9.0, 100.0), (3.0, 3000.0), (9.0, 100.0)]), RATES))) == 3


@pytest.mark.parametrize("seed", range(5))
def test_the_choice_is_the_best_of_all(seed):
    """Against every combination of feeds, for stretches long enough that no other rule counts."""
    rng = np.random.default_rng(seed)
    pieces = [(float(a), float(f)) for a, f in zip(rng.uniform(0.5, 3.0, 6), rng.choice([50, 60, 90, 200, 900], 6),
                                                    strict=True)]
    found = feed_changes._cheapest(np.array([a for a, _ in pieces]), np.array([f for _, f in pieces]), RATES)
    levels = sorted({f for _, f in pieces})
    best = min(seconds([(a, f) for (a, _), f in zip(pieces, choice, strict=True)])
               for choice in itertools.product(levels, repeat=6)
               if all(f <= most for f, (_, most) in zip(choice, pieces, strict=True)))
    assert seconds([(p.length, p.feed) for p in found]) == pytest.approx(best)


@pytest.mark.parametrize("seed", range(4))
def test_the_way_is_the_same_and_no_place_is_gone_faster(seed):
    """Random feeds on a way that turns and descends, with rapids between."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.uniform(0.005, 0.03, 600))
    way = np.column_stack([8.0 * np.cos(turn), 8.0 * np.sin(turn), -0.2 * turn])
    out, at = [], 0
    while at < 590:
        n = int(rng.integers(1, 9))
        kind = TrajectoryKind.RAPID if rng.random() < 0.03 else TrajectoryKind.CUT
        out.append(Trajectory(kind, way[at:at + n + 1], 0.0 if kind is TrajectoryKind.RAPID else
                              float(rng.choice([47.0, 58.9, 73.6, 225.0, 3000.0]))))
        at += n
    made = with_few_changes(out, RATES)
    ends = np.vstack([t.points[-1:] for t in out])
    assert all(np.isclose(np.vstack([t.points for t in made]), e, atol=1e-12).all(axis=1).any() for e in ends)
    assert [t.points.tolist() for t in made if t.motion is TrajectoryKind.RAPID] \
        == [t.points.tolist() for t in out if t.motion is TrajectoryKind.RAPID]
    assert sum(t.length for t in made) == pytest.approx(sum(t.length for t in out))
    bounds, places = np.cumsum([t.length for t in out]), np.cumsum([t.length for t in made])
    for t, end in zip(made, places, strict=True):
        if t.motion is not TrajectoryKind.RAPID:
            over = np.flatnonzero((bounds > end - t.length + 1e-6) & (np.append(0.0, bounds[:-1]) < end - 1e-6))
            assert t.feed <= min(out[k].feed for k in over if out[k].motion is not TrajectoryKind.RAPID)
    run = []
    for t in [*made, Trajectory(TrajectoryKind.RAPID, way[:2], 0.0)]:
        if t.motion is TrajectoryKind.RAPID:
            joined = profile(run)
            assert len(joined) < 2 or min(length for length, _ in joined) > LEAST - 1e-6
            run = []
        else:
            run.append(t)
    before = sum(a.feed != b.feed for a, b in itertools.pairwise(out))
    assert sum(a.feed != b.feed for a, b in itertools.pairwise(made)) < before


def test_a_part_of_a_move_down_stays_long_enough_for_its_slope():
    made = with_few_changes(straight([(0.2, 50.0), (9.0, 900.0), (0.2, 50.0), (9.0, 900.0)], drop=0.05), RATES)
    assert len(made) > 4 and min(t.length for t in made) >= SHORTEST - 1e-9


def test_a_way_that_turns_is_parted_at_its_points():
    x = np.linspace(0.0, 9.0, 31)
    tips = np.column_stack([x, 0.0 * x, 0.0 * x])
    lean = np.column_stack([np.sin(0.02 * x), 0.0 * x, np.cos(0.02 * x)])
    run = [Trajectory(TrajectoryKind.CUT, np.array([[-0.1, 0.0, 0.0], [0.0, 0.0, 0.0]]), 50.0, lean[:2]),
           Trajectory(TrajectoryKind.CUT, tips, 900.0, lean)]
    made = with_few_changes(run, RATES)
    assert [len(t.points) for t in made] == [2, 2, 30] and [t.feed for t in made] == [50.0, 50.0, 900.0]
    assert all(t.axes is not None and len(t.axes) == len(t.points) for t in made)
