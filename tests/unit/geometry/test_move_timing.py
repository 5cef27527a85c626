"""How long moves take: closed forms, a slow twin that walks, and what has to hold of any way."""

import math

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.move_timing import Rates, move_seconds

A = 1000.0
STOPPING = Rates(10000.0, A, 0.0)


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
    assert total([[3.0, 0, 0], [-3.0, 0, 0]], 4000, Rates(1e4, A, 1.0)) == pytest.approx(2 * one)
    assert total([[3.0, 0, 0], [3.0, 0, 0]], 4000, stop=np.array([False, True])) == pytest.approx(2 * one)
    assert total([[3.0, 0, 0], [0, 0, 0], [3.0, 0, 0]], 4000) == pytest.approx(2 * one)


def test_a_square_corner_is_run_on_an_arc_beside_it():
    d = 0.01
    r = d / (math.sqrt(2.0) - 1.0)
    v = math.sqrt(math.sqrt(0.75) * A * r)
    speed, length = 40.0, 10.0
    side = (length - r) / speed + 0.5 * speed / A + 0.5 * (speed - v) ** 2 / (A * speed) + 0.25 * math.pi * r / v
    assert total([[length, 0, 0], [0, length, 0]], 60 * speed, Rates(1e4, A, d)) == pytest.approx(2 * side, rel=1e-9)


@pytest.mark.parametrize("chord", [0.05, 0.2])
def test_round_a_circle_the_radius_says_how_fast(chord):
    radius, rounds = 0.5, 30
    n = round(2 * math.pi * radius / chord)
    at = 2.0 * math.pi * np.arange(rounds * n + 1) / n
    way = np.diff(radius * np.column_stack([np.cos(at), np.sin(at), 0 * at]), axis=0)
    v = math.sqrt(math.sqrt(0.75) * A * radius)
    even = rounds * 2.0 * math.pi * radius / v
    # a loose corner would let it run faster: half of each chord is the limit
    assert total(way, 60 * 4 * v, Rates(1e4, A, 1.0)) == pytest.approx(even + v / A, rel=0.01)


def walked(way, feed, rates, steps=400):
    """Seconds by walking what is straight and the arcs between in small steps, speeds capped and swept both ways."""
    way, a = np.array(way, dtype=np.float64), rates.acceleration
    left = np.linalg.norm(way, axis=1)
    unit, length = way / left[:, None], left.copy()
    arcs = []
    for i in range(1, len(way)):
        phi = math.atan2(np.linalg.norm(np.cross(unit[i - 1], unit[i])), unit[i - 1] @ unit[i])
        wide = 0.5 * min(length[i - 1:i + 1]) / math.tan(phi / 2.0)
        r = min(rates.rounding / (1.0 / math.cos(phi / 2.0) - 1.0), wide)
        arcs.append((r * phi, min(math.sqrt(math.sqrt(0.75) * a * r), *(feed[i - 1:i + 1] / 60.0)), 0.5 * a))
        left[i - 1:i + 1] -= r * math.tan(phi / 2.0)
    pieces = []
    for i, one in enumerate(left.tolist()):
        pieces += [(one, feed[i] / 60.0, a), *arcs[i:i + 1]]
    step = np.repeat([p[0] / steps for p in pieces], steps)
    change = np.repeat([p[2] for p in pieces], steps)
    most = np.repeat([p[1] for p in pieces], steps)
    square = np.concatenate([[0.0], np.minimum(most[1:], most[:-1]), [0.0]]) ** 2
    for k in range(1, len(square)):
        square[k] = min(square[k], square[k - 1] + 2.0 * change[k - 1] * step[k - 1])
    for k in range(len(square) - 2, -1, -1):
        square[k] = min(square[k], square[k + 1] + 2.0 * change[k] * step[k])
    v = np.sqrt(square)
    moved = step > 0.0
    return float((2.0 * step[moved] / (v[1:] + v[:-1])[moved]).sum())


@pytest.mark.parametrize("seed", range(6))
def test_as_long_as_walking_it_in_small_steps(seed):
    rng = np.random.default_rng(seed)
    way = rng.normal(size=(12, 3)) * rng.uniform(0.1, 3.0, (12, 1))
    feed = rng.uniform(300.0, 6000.0, 12)
    rates = Rates(1e4, float(rng.uniform(200.0, 3000.0)), float(rng.uniform(0.0, 0.05)))
    assert float(move_seconds(way, feed, rates).sum()) == pytest.approx(walked(way, feed, rates), rel=2e-3)


@pytest.mark.parametrize("seed", range(20))
def test_faster_machines_and_looser_corners_take_no_longer(seed):
    rng = np.random.default_rng(100 + seed)
    way, feed = rng.normal(size=(30, 3)), rng.uniform(300.0, 6000.0, 30)
    slow = move_seconds(way, feed, Rates(1e4, 500.0, 0.001)).sum()
    at_feed = (60.0 * np.linalg.norm(way, axis=1) / feed).sum()
    assert at_feed <= move_seconds(way, feed, Rates(1e4, 2000.0, 0.001)).sum() <= slow
    assert move_seconds(way, feed, Rates(1e4, 500.0, 0.05)).sum() <= slow
    assert move_seconds(way, 2.0 * feed, Rates(1e4, 500.0, 0.001)).sum() <= slow
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert move_seconds(way @ turn, feed, Rates(1e4, 500.0, 0.001)).sum() == pytest.approx(slow, rel=1e-12)
    assert move_seconds(-way[::-1], feed[::-1], Rates(1e4, 500.0, 0.001)).sum() == pytest.approx(slow, rel=1e-9)


@pytest.mark.parametrize(("feed", "acceleration"), [(0.0, A), (-1.0, A), (math.nan, A), (math.inf, A), (100.0, 0.0)])
def test_a_rate_that_is_none(feed, acceleration):
    with pytest.raises(GeometryError) as refusal:
        move_seconds(np.ones((2, 3)), np.array([100.0, feed]), Rates(1e4, acceleration, 0.0))
    assert refusal.value.code == "bad_rate"


def test_nothing_takes_no_time():
    assert len(move_seconds(np.zeros((0, 3)), np.zeros(0), STOPPING)) == 0
    assert total(np.zeros((3, 3)), 100) == 0.0


def test_chords_of_one_curve_have_no_corner():
    at = np.linspace(0.0, 20.0 * math.pi, 2001)
    way = np.diff(5.0 * np.column_stack([np.cos(at), np.sin(at), 0 * at]), axis=0)
    curve = np.arange(len(way)) > 0
    feed, rates = np.full(len(way), 3000.0), Rates(1e4, 20000.0, 0.0)
    even = 100.0 * math.pi / 50.0 + 50.0 / 20000.0
    assert move_seconds(way, feed, rates, curve=curve).sum() == pytest.approx(even, rel=2e-3)
    assert move_seconds(way, feed, rates).sum() > 1.5 * even
