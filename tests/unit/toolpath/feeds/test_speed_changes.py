"""Changes of speed at limits of jerk and acceleration, and moves made of them."""

from __future__ import annotations

import numpy as np
import pytest

from toolpath.feeds.speed_changes import JERK, change_seconds, change_way, leg_seconds, peak_speed


@pytest.mark.parametrize(("slow", "fast", "most"), [(4.0, 7.0, 1000.0), (4.0, 50.0, 1000.0), (10.0, 90.0, 500.0),
                                                    (50.0, 4.0, 4905.0)])
def test_a_change_keeps_the_limits_of_jerk_and_acceleration(slow, fast, most):
    """Integrated in small steps of time: jerk up, acceleration held, jerk down."""
    dv = abs(fast - slow)
    peak = min(most, np.sqrt(dv * JERK))
    up, held = peak / JERK, max(dv / peak - peak / JERK, 0.0)
    t = np.linspace(0.0, 2 * up + held, 200_001)
    a = np.minimum(np.minimum(JERK * t, peak), JERK * (t[-1] - t))
    v = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(t))]) + min(slow, fast)
    assert v[-1] == pytest.approx(max(slow, fast), rel=1e-6)
    assert change_seconds(slow, fast, most) == pytest.approx(t[-1])
    assert change_way(slow, fast, most) == pytest.approx(float(np.sum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))


def test_a_short_move_does_not_reach_its_speed_and_a_long_one_does():
    assert peak_speed(1.0, 0.0, 50.0, 1000.0) < 50.0 == peak_speed(5.0, 0.0, 50.0, 1000.0)
    reached = peak_speed(1.0, 0.0, 50.0, 1000.0)
    assert change_way(0.0, reached, 1000.0) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("length", [0.01, 0.5, 2.0, 30.0])
def test_a_move_is_as_long_as_its_parts(length):
    """Twice the way up to the peak and the rest at it; longer moves take longer, by the speed where it is reached."""
    seconds = leg_seconds(length, 50.0, 1000.0)
    assert seconds >= length / 50.0 and leg_seconds(length + 1.0, 50.0, 1000.0) - seconds >= 1.0 / 50.0 - 1e-9
    if length > 10.0:
        assert leg_seconds(length + 1.0, 50.0, 1000.0) - seconds == pytest.approx(1.0 / 50.0)
        assert seconds == pytest.approx(length / 50.0 + change_seconds(0.0, 50.0, 1000.0))
    assert leg_seconds(0.0, 50.0, 1000.0) == leg_seconds(-1.0, 50.0, 1000.0) == 0.0
