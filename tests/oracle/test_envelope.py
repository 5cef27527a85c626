"""The swept envelope against its definition, and distances along normals against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope

CUTTERS = {
    "ball": (Cutter.ball(diameter=6.0, length=20.0), lambda rho: 3.0 - np.sqrt(9.0 - rho**2)),
    "flat": (Cutter.flat(diameter=4.0, length=20.0), lambda rho: 0.0 * rho),
    "bull": (Cutter.bull(diameter=6.0, length=20.0, corner_radius=1.0),
             lambda rho: 1.0 - np.sqrt(1.0 - np.maximum(rho - 2.0, 0.0) ** 2)),
    "tapered": (Cutter.tapered(tip_diameter=2.0, diameter=5.0, angle_deg=10.0, length=20.0),
                lambda rho: np.where(rho <= math.cos(math.radians(10.0)),
                                     1.0 - np.sqrt(np.maximum(1.0 - rho**2, 0.0)),
                                     1.0 - math.sin(math.radians(10.0))
                                     + (rho - math.cos(math.radians(10.0))) / math.tan(math.radians(10.0)))),
}


def brute(paths, radius, profile, xy, spacing=2e-4):
    """Least of c_z + h(rho) over points put closely along the paths."""
    out = np.full(len(xy), np.inf)
    for path in paths:
        for a, b in zip(path[:-1], path[1:], strict=True):
            n = int(np.linalg.norm(b - a) / spacing) + 2
            c = a + np.linspace(0.0, 1.0, n)[:, None] * (b - a)
            rho = np.hypot(xy[:, None, 0] - c[:, 0], xy[:, None, 1] - c[:, 1])
            with np.errstate(invalid="ignore"):
                up = np.where(rho < radius, c[:, 2] + profile(np.minimum(rho, radius)), np.inf)
            out = np.minimum(out, up.min(axis=1))
    return out


@pytest.mark.parametrize("name", CUTTERS)
def test_the_envelope_is_the_least_over_the_path(name):
    cutter, profile = CUTTERS[name]
    rng = np.random.default_rng(5)
    paths = [rng.uniform(-4.0, 4.0, (4, 3)), rng.uniform(-4.0, 4.0, (2, 3))]
    xy = rng.uniform(-6.0, 6.0, (90, 2))
    got, want = Envelope(paths, cutter).heights(xy), brute(paths, cutter.radius, profile, xy)
    reached = np.isfinite(want)
    assert 20 < reached.sum() < 90 and np.isinf(got[~reached]).all()
    assert (got[reached] <= want[reached] + 1e-9).all()  # the twin looks at single points, so it is never lower
    inside = reached.copy()  # near the rim the profile is steep
    inside[reached] = want[reached] - got[reached] < 0.02
    assert inside.sum() >= reached.sum() - 3
    np.testing.assert_allclose(got[inside], want[inside], atol=2e-3)


def test_a_path_of_one_point_and_no_path():
    cutter = Cutter.ball(diameter=6.0, length=20.0)
    got = Envelope([np.array([[1.0, 2.0, 3.0]])], cutter).heights(np.array([[1.0, 2.0], [2.5, 2.0], [4.5, 2.0]]))
    np.testing.assert_allclose(got, [3.0, 6.0 - math.sqrt(9.0 - 2.25), np.inf])
    assert np.isinf(Envelope([], cutter).heights(np.zeros((2, 2)))).all()


@pytest.mark.parametrize("slope", [0.0, 20.0, 45.0, 60.0])
@pytest.mark.parametrize("turn", [0.0, 35.0, 90.0])
def test_the_scallop_of_two_passes_on_a_slope_is_that_of_their_distance_across(slope, turn):
    # a plane that leans by slope towards x; passes along a line of it that is turned by turn
    r, apart = 1.5, 0.5
    normal = np.array([math.sin(math.radians(slope)), 0.0, math.cos(math.radians(slope))])
    down, level = np.array([normal[2], 0.0, -normal[0]]), np.array([0.0, 1.0, 0.0])
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    feed, across = c * level + s * down, c * down - s * level
    lift = r * normal - [0.0, 0.0, r]
    ends = np.array([[-4.0], [4.0]])
    paths = [lift + k * apart * across + ends * feed for k in (-0.5, 0.5)]
    v = np.linspace(-0.5, 0.5, 41)
    points = v[:, None] * apart * across + np.linspace(-1.0, 1.0, 41)[:, None] * feed
    got = Envelope(paths, Cutter.ball(diameter=2 * r, length=20.0)).along(points, np.tile(normal, (41, 1)))
    np.testing.assert_allclose(got, r - np.sqrt(r * r - (apart * (0.5 - np.abs(v))) ** 2), atol=1e-9)


def test_what_was_cut_too_deep_is_negative_and_what_was_not_reached_infinite():
    cutter = Cutter.ball(diameter=4.0, length=20.0)
    path = [np.array([[-5.0, 0.0, -0.1], [5.0, 0.0, -0.1]])]
    got = Envelope(path, cutter).along(np.array([[0.0, 0.0, 0.0], [0.0, 9.0, 0.0]]), np.tile([0.0, 0.0, 1.0], (2, 1)))
    np.testing.assert_allclose(got, [-0.1, np.inf])
