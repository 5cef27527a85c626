"""How long moves take: closed forms, a slow twin that walks, and what has to hold of any way."""

import math

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.kernels import timing as kernels
from geometry.machine_rates import Rates
from geometry.move_timing import change_seconds, change_way, leg_seconds, move_seconds, peak_speed

A = 1000.0
AT_ONCE = math.inf
STOPPING = Rates(10000.0, A, 0.0, AT_ONCE)


def total(way, feed, rates=STOPPING, stop=None):
    way = np.array(way, dtype=np.float64)
    return float(move_seconds(way, np.full(len(way), float(feed)), rates, stop).sum())


def test_one_move_speeds_up_runs_and_slows_down():
    speed, length = 50.0, 20.0
    assert total([[length, 0, 0]], 60 * speed) == pytest.approx(length / speed + speed / A)


def test_a_move_too_short_for_its_feed():
    assert total([[0, 0.4, 0]], 60 * 100.0) == pytest.approx(2.0 * math.sqrt(0.4 / A))


def test_straight_on_is_one_move():
    whole = total([[0, 0, -12.0]], 6000)
    assert total([[0, 0, -0.05]] * 240, 6000) == pytest.approx(whole, rel=1e-9)


def test_back_and_stops_are_standstills():
    one = total([[3.0, 0, 0]], 4000)
    assert total([[3.0, 0, 0], [-3.0, 0, 0]], 4000, Rates(1e4, A, 1.0, AT_ONCE)) == pytest.approx(2 * one)
    assert total([[3.0, 0, 0], [3.0, 0, 0]], 4000, stop=np.array([False, True])) == pytest.approx(2 * one)
    assert total([[3.0, 0, 0], [0, 0, 0], [3.0, 0, 0]], 4000) == pytest.approx(2 * one)


def test_a_square_corner_is_run_as_fast_as_an_arc_beside_it():
    d = 0.01
    r = d / (math.sqrt(2.0) - 1.0)
    v = math.sqrt(math.sqrt(0.75) * A * r)
    speed, length = 40.0, 10.0
    side = length / speed + 0.5 * speed / A + 0.5 * (speed - v) ** 2 / (A * speed)
    rates = Rates(1e4, A, d, AT_ONCE)
    assert total([[length, 0, 0], [0, length, 0]], 60 * speed, rates) == pytest.approx(2 * side, rel=1e-9)


@pytest.mark.parametrize("chord", [0.05, 0.2])
def test_round_a_circle_the_radius_says_how_fast(chord):
    radius, rounds = 0.5, 30
    n = round(2 * math.pi * radius / chord)
    at = 2.0 * math.pi * np.arange(rounds * n + 1) / n
    way = np.diff(radius * np.column_stack([np.cos(at), np.sin(at), 0 * at]), axis=0)
    v = math.sqrt(math.sqrt(0.75) * A * radius)
    even = rounds * 2.0 * math.pi * radius / v
    # a loose corner would let it run faster: half of each chord is the limit
    assert total(way, 60 * 4 * v, Rates(1e4, A, 1.0, AT_ONCE)) == pytest.approx(even + v / A, rel=0.01)


def walked(way, feed, rates, steps=400):
    """Seconds by walking every move in small steps at the full acceleration, speeds at corners capped."""
    way, a = np.array(way, dtype=np.float64), rates.acceleration
    length = np.linalg.norm(way, axis=1)
    unit, cap = way / length[:, None], [0.0]
    for i in range(1, len(way)):
        phi = math.atan2(np.linalg.norm(np.cross(unit[i - 1], unit[i])), unit[i - 1] @ unit[i])
        wide = 0.5 * min(length[i - 1:i + 1]) / math.tan(phi / 2.0)
        r = min(rates.rounding / (1.0 / math.cos(phi / 2.0) - 1.0), wide)
        cap.append(min(math.sqrt(math.sqrt(0.75) * a * r), *(feed[i - 1:i + 1] / 60.0)))
    cap.append(0.0)
    step, most = np.repeat(length / steps, steps), np.repeat(feed / 60.0, steps)
    square = np.concatenate([most[:1], np.minimum(most[1:], most[:-1]), most[-1:]]) ** 2
    square[::steps] = np.minimum(square[::steps], np.square(cap))
    for k in range(1, len(square)):
        square[k] = min(square[k], square[k - 1] + 2.0 * a * step[k - 1])
    for k in range(len(square) - 2, -1, -1):
        square[k] = min(square[k], square[k + 1] + 2.0 * a * step[k])
    v = np.sqrt(square)
    return float((2.0 * step / (v[1:] + v[:-1])).sum())


@pytest.mark.parametrize("seed", range(6))
def test_as_long_as_walking_it_in_small_steps(seed):
    rng = np.random.default_rng(seed)
    way = rng.normal(size=(12, 3)) * rng.uniform(0.1, 3.0, (12, 1))
    feed = rng.uniform(300.0, 6000.0, 12)
    rates = Rates(1e4, float(rng.uniform(200.0, 3000.0)), float(rng.uniform(0.0, 0.003)), AT_ONCE)
    assert float(move_seconds(way, feed, rates).sum()) == pytest.approx(walked(way, feed, rates), rel=3e-3)


@pytest.mark.parametrize("seed", range(20))
def test_faster_machines_and_looser_corners_take_no_longer(seed):
    rng = np.random.default_rng(100 + seed)
    way, feed = rng.normal(size=(30, 3)), rng.uniform(300.0, 6000.0, 30)
    slow = move_seconds(way, feed, Rates(1e4, 500.0, 0.001)).sum()
    assert slow <= move_seconds(way, feed, Rates(1e4, 500.0, 0.001, 5000.0)).sum()
    assert slow >= move_seconds(way, feed, Rates(1e4, 500.0, 0.001, AT_ONCE)).sum()
    at_feed = (60.0 * np.linalg.norm(way, axis=1) / feed).sum()
    assert at_feed <= move_seconds(way, feed, Rates(1e4, 2000.0, 0.001)).sum() <= slow
    assert move_seconds(way, feed, Rates(1e4, 500.0, 0.05)).sum() <= slow
    assert move_seconds(way, 2.0 * feed, Rates(1e4, 500.0, 0.001)).sum() <= slow
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert move_seconds(way @ turn, feed, Rates(1e4, 500.0, 0.001)).sum() == pytest.approx(slow, rel=1e-12)
    assert move_seconds(-way[::-1], feed[::-1], Rates(1e4, 500.0, 0.001)).sum() == pytest.approx(slow, rel=1e-9)


@pytest.mark.parametrize(("feed", "acceleration", "jerk"), [
    (0.0, A, 1.0), (-1.0, A, 1.0), (math.nan, A, 1.0), (math.inf, A, 1.0), (100.0, 0.0, 1.0), (100.0, A, 0.0)])
def test_a_rate_that_is_none(feed, acceleration, jerk):
    with pytest.raises(GeometryError) as refusal:
        move_seconds(np.ones((2, 3)), np.array([100.0, feed]), Rates(1e4, acceleration, 0.0, jerk))
    assert refusal.value.code == "bad_rate"


def test_nothing_takes_no_time():
    assert len(move_seconds(np.zeros((0, 3)), np.zeros(0), STOPPING)) == 0
    assert total(np.zeros((3, 3)), 100) == 0.0


def test_chords_of_one_curve_have_no_corner():
    at = np.linspace(0.0, 20.0 * math.pi, 2001)
    way = np.diff(5.0 * np.column_stack([np.cos(at), np.sin(at), 0 * at]), axis=0)
    curve = np.arange(len(way)) > 0
    feed, rates = np.full(len(way), 3000.0), Rates(1e4, 20000.0, 0.0, AT_ONCE)
    even = 100.0 * math.pi / 50.0 + 50.0 / 20000.0
    assert move_seconds(way, feed, rates, curve=curve).sum() == pytest.approx(even, rel=2e-3)
    assert move_seconds(way, feed, rates).sum() > 1.5 * even


def profile(seconds, dv, most, jerk):
    """Speed over time of a change: jerk up, acceleration held, jerk down; in small steps."""
    t = np.linspace(0.0, seconds, 200_001)
    peak = min(most, math.sqrt(dv * jerk))
    a = np.minimum(np.minimum(jerk * t, peak), jerk * (t[-1] - t))
    return t, np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))])


@pytest.mark.parametrize("jerk", [5000.0, 20000.0, 1e6])
@pytest.mark.parametrize(("slow", "fast", "most"), [(4.0, 7.0, 1000.0), (4.0, 50.0, 1000.0), (10.0, 90.0, 500.0),
                                                    (50.0, 4.0, 4905.0)])
def test_a_change_keeps_the_limits_of_jerk_and_acceleration(slow, fast, most, jerk):
    rates, dv = Rates(1e4, most, 0.0, jerk), abs(fast - slow)
    peak = min(most, math.sqrt(dv * jerk))
    t, gained = profile(2.0 * peak / jerk + max(dv / peak - peak / jerk, 0.0), dv, most, jerk)
    v = gained + min(slow, fast)
    assert v[-1] == pytest.approx(max(slow, fast), rel=1e-6)
    assert change_seconds(slow, fast, rates) == pytest.approx(t[-1])
    assert change_way(slow, fast, rates) == pytest.approx(float(np.sum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))


@pytest.mark.parametrize("seed", range(40))
def test_the_speed_reached_over_a_way_is_the_one_whose_change_takes_it(seed):
    rng = np.random.default_rng(seed)
    a, j = rng.uniform(200.0, 9000.0), 10.0 ** rng.uniform(3.0, 6.0) if seed % 4 else math.inf
    v, length = rng.uniform(0.0, 100.0) * (seed % 3 > 0), 10.0 ** rng.uniform(-2.0, 2.0)
    w = float(kernels.reached(v, length, a, j))
    assert w > v and float(kernels.change_way(v, w, a, j)) == pytest.approx(length, rel=1e-7)


@pytest.mark.parametrize("length", [0.01, 0.5, 2.0, 30.0])
def test_a_move_is_as_long_as_its_parts(length):
    """Twice the way up to the peak and the rest at it; longer moves take longer, by the speed where it is reached."""
    rates = Rates(1e4, A, 0.0)
    seconds = leg_seconds(length, 50.0, rates)
    assert seconds >= length / 50.0 and leg_seconds(length + 1.0, 50.0, rates) - seconds >= 1.0 / 50.0 - 1e-9
    if length > 10.0:
        assert leg_seconds(length + 1.0, 50.0, rates) - seconds == pytest.approx(1.0 / 50.0)
        assert seconds == pytest.approx(length / 50.0 + change_seconds(0.0, 50.0, rates))
    else:
        peak = peak_speed(0.5 * length, 0.0, 50.0, rates)
        assert seconds == pytest.approx(2.0 * change_seconds(0.0, peak, rates) +
                                        (length - 2.0 * change_way(0.0, peak, rates)) / peak)
    assert leg_seconds(0.0, 50.0, rates) == leg_seconds(-1.0, 50.0, rates) == 0.0
    assert all(0.0 < leg_seconds(length, speed, rates) < 1e-5 for length in (1e-17, 1e-18, 1e-21, 1e-30, 5e-324)
               for speed in (1.0, 50.0, 500.0))
    assert total([[length, 0, 0]], 3000.0, rates) == pytest.approx(seconds)


@pytest.mark.parametrize(("phi", "length"), [(1.5, 4.0), (0.2, 4.0), (0.2, 0.3)])
def test_the_acceleration_square_to_the_way_rises_and_falls_within_a_corner(phi, length):
    """v³ = j r² phi / 2: at that speed the arc takes as long as v² / r up and down again at the jerk."""
    rates = Rates(1e4, 1e9, 0.002)
    r = min(rates.rounding / (1.0 / math.cos(0.5 * phi) - 1.0), 0.5 * length / math.tan(0.5 * phi))
    v = (0.5 * rates.jerk * r * r * phi) ** (1.0 / 3.0)
    assert 2.0 * (v * v / r) / rates.jerk == pytest.approx(r * phi / v)
    way = [[length, 0, 0], [length * math.cos(phi), length * math.sin(phi), 0]]
    peak = float(kernels.reached(v, length, 1e9, rates.jerk))
    seconds = 2.0 * float(kernels.leg_seconds(0.0, v, 1000.0, length, 1e9, rates.jerk))
    assert peak > v and total(way, 60e3, rates) == pytest.approx(seconds, rel=1e-6)


def test_round_a_circle_the_jerk_binds_only_at_its_ends():
    """Fine chords of 2 mm radius: v³ = j r² all along, not the speed of each corner alone."""
    at = np.linspace(0.0, 80.0 * math.pi, 16001)
    way = np.diff(2.0 * np.column_stack([np.cos(at), np.sin(at), 0 * at]), axis=0)
    rates = Rates(1e4, 1e5, 1e-4)
    v = (rates.jerk * 4.0) ** (1.0 / 3.0)
    took = float(move_seconds(way, np.full(len(way), 60e3), rates).sum())
    assert took == pytest.approx(160.0 * math.pi / v, rel=0.015)


def test_a_move_next_to_nothing_slows_only_its_own_corners():
    """Rounding leaves moves of a nanometre square to the way; what lies beside them is run as fast as before."""
    way = [[2.0, 0, 0], [0, 0, 1e-9], [-0.02, 0, 0], [0, 0, -1e-9], [2.0, 0, 0]]
    alone = [total([[x, 0, 0]], 3000.0, Rates(1e4, A, 0.001)) for x in (2.0, 0.02, 2.0)]
    assert total(way, 3000.0, Rates(1e4, A, 0.001)) == pytest.approx(sum(alone), rel=0.02)
