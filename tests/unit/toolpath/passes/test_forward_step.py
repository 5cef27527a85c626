"""Forward steps on true profiles: no chordal error above the tolerance, none shorter than need be; the arc rule."""

import numpy as np
import pytest

from benchmarks.passes.arc_rule import arc_rule
from geometry.errors import GeometryError
from toolpath.passes.forward_step import PassProfile, errors, steps

RADIUS = 5.0
PROFILES = {
    "sine": (lambda x: 10 * np.sin(2 * np.pi * x / 120), lambda x: 10 * 2 * np.pi / 120 * np.cos(2 * np.pi * x / 120),
             (0.0, 120.0)),
    "bump": (lambda x: 8 * np.exp(-(x / 15) ** 2), lambda x: -16 * x / 225 * np.exp(-(x / 15) ** 2), (-60.0, 60.0)),
    "concave": (lambda x: x**2 / 60, lambda x: x / 30, (-60.0, 60.0)),
    "convex": (lambda x: -(x**2) / 60, lambda x: -x / 30, (-60.0, 60.0)),
}


def curve_of(name):
    height, slope, (low, high) = PROFILES[name]

    def curve(t):
        x = low + (high - low) * t
        n = np.column_stack([-slope(x), np.zeros(len(x)), np.ones(len(x))])
        return np.column_stack([x, np.zeros(len(x)), height(x)]), n / np.linalg.norm(n, axis=1)[:, None]

    return curve


def measured(curve, t0, t1, radius):
    """The greatest |dev| of one step at 20,001 places of the curve itself."""
    (a, b), normal = curve(np.array([t0, t1]))
    (a, b), p = (a, b) + radius * normal, curve(np.linspace(t0, t1, 20001))[0]
    d = b - a
    s = np.clip((p - a) @ d / (d @ d), 0.0, 1.0)
    return np.abs(np.linalg.norm(p - a - s[:, None] * d, axis=1) - radius).max()


@pytest.mark.parametrize("tolerance", [0.5, 0.05, 0.005])
@pytest.mark.parametrize("name", PROFILES)
def test_steps_use_the_tolerance_and_never_more(name, tolerance):
    curve = curve_of(name)
    profile = PassProfile.of(curve, tolerance, RADIUS)
    ends = steps(profile, RADIUS, tolerance)
    t = profile.parameters(ends)
    off = np.array([measured(curve, a, b, RADIUS) for a, b in zip(t[:-1], t[1:], strict=True)])
    assert off.max() <= 1.0002 * tolerance
    full = np.diff(ends)[:-1] < 39.9
    assert off[:-1][full].mean() >= 0.99 * tolerance
    assert t[0] == 0.0 and t[-1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name, half, tenth, hundredth", [
    ("sine", 8, 24, 74), ("bump", 7, 18, 56), ("concave", 9, 28, 89), ("convex", 10, 31, 96)])
def test_as_many_blocks_as_the_published_scheme_needs(name, half, tenth, hundredth):
    """Counts of the derivation's own check; one more where what is left of a step makes a block."""
    profile = PassProfile.of(curve_of(name), 0.005, RADIUS)
    for tolerance, blocks in ((0.5, half), (0.05, tenth), (0.005, hundredth)):
        assert len(steps(profile, RADIUS, tolerance)) - 1 in (blocks, blocks + 1)


@pytest.mark.parametrize("name, most", [("sine", 8.74), ("bump", 4.09), ("concave", 1.47), ("convex", 1.5)])
def test_the_arc_rule_leaves_more_than_the_tolerance(name, most):
    profile = PassProfile.of(curve_of(name), 0.5, RADIUS)
    off = errors(profile, arc_rule(profile, RADIUS, 0.5), RADIUS)
    assert off.max() == pytest.approx(0.5 * most, rel=0.35)


@pytest.mark.parametrize("degrees, error", [(30.0, 0.12490), (45.0, 0.2496)])
def test_a_helix_on_a_cylinder_leaves_what_its_torsion_says(degrees, error):
    """dev = s²/8 (k - r (k² + t²)), convex k < 0: a plane rule would be 15 % and 10 % short."""
    big, way = 20.0, np.radians(degrees)

    def curve(t):
        s = 8.0 * t
        turn = s * np.sin(way) / big
        n = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(t))])
        return big * n + np.column_stack([np.zeros((len(t), 2)), s * np.cos(way)]), n

    profile = PassProfile.of(curve, 0.01, RADIUS)
    assert errors(profile, np.array([0.0, profile.length]), RADIUS)[0] == pytest.approx(error, rel=1e-3)
    k, t = -np.sin(way) ** 2 / big, np.sin(way) * np.cos(way) / big
    assert errors(profile, np.array([0.0, profile.length]), RADIUS)[0] == pytest.approx(
        8.0 * abs(k - RADIUS * (k * k + t * t)), rel=5e-3)


def test_a_pass_that_bends_aside_is_followed_for_the_sake_of_the_ridge():
    """A circle of 50 mm on a plane: the pass itself is always met, and the ridge beside it asks for sagittas."""
    scallop, tolerance = 0.5, 0.005

    def curve(t):
        turn = 1.2 * t
        return (50.0 * np.column_stack([np.cos(turn), np.sin(turn), 0 * t]), np.tile([0.0, 0.0, 1.0], (len(t), 1)))

    profile = PassProfile.of(curve, tolerance, RADIUS)
    aside = tolerance / np.sqrt(2 * scallop / RADIUS)
    assert np.diff(steps(profile, RADIUS, tolerance, scallop))[:-1] == pytest.approx(np.sqrt(8 * 50 * aside), rel=2e-3)
    bare = np.sqrt((RADIUS + tolerance) ** 2 - RADIUS**2)
    assert np.diff(steps(profile, RADIUS, tolerance))[:-1] == pytest.approx(np.sqrt(8 * 50 * bare), rel=5e-3)


def test_a_straight_pass_is_one_step_or_steps_of_the_greatest_length():
    def curve(t):
        return np.column_stack([100.0 * t, 0 * t, 0 * t]), np.tile([0.0, 0.0, 1.0], (len(t), 1))

    profile = PassProfile.of(curve, 0.01, RADIUS)
    assert np.diff(steps(profile, RADIUS, 0.01)).tolist() == pytest.approx([40.0, 40.0, 20.0])
    assert len(steps(profile, RADIUS, 0.01, longest=200.0)) == 2


def test_a_pass_without_length_is_refused():
    with pytest.raises(GeometryError) as refusal:
        PassProfile.of(lambda t: (np.zeros((len(t), 3)), np.tile([0.0, 0.0, 1.0], (len(t), 1))), 0.01, RADIUS)
    assert refusal.value.code == "bad_pass"


@pytest.mark.parametrize(("long", "tolerance"), [(300.0, 0.02), (300.0, 0.005), (200.0, 0.02)])
def test_a_straight_pass_along_which_the_surface_twists_keeps_the_tolerance(long, tolerance):
    """z = x y / 4 along a ruling: the contact is straight and the normal turns over."""
    def curve(t):
        x = long * (t - 0.5)
        normal = np.column_stack([0 * t, -x / 4.0, np.ones(len(t))])
        return np.column_stack([x, 0 * t, 0 * t]), normal / np.linalg.norm(normal, axis=1)[:, None]

    profile = PassProfile.of(curve, tolerance, 3.0)
    way = np.linspace(0.0, profile.length, 5001)
    point, normal = curve(way / profile.length)
    assert np.abs(profile.centres(way, 3.0) - point - 3.0 * normal).max() < 0.002 * tolerance
    t = profile.parameters(steps(profile, 3.0, tolerance))
    off = np.array([measured(curve, a, b, 3.0) for a, b in zip(t[:-1], t[1:], strict=True)])
    assert off.max() <= 1.001 * tolerance


def test_a_pass_across_an_edge_is_refused_with_the_place():
    """Two planes that meet at 20 degrees."""
    def curve(t):
        lean = np.where(t > 0.4, np.radians(20.0), 0.0)
        x = 10.0 * t
        z = -np.tan(np.radians(20.0)) * np.maximum(x - 4.0, 0.0)
        return np.column_stack([x, 0 * t, z]), np.column_stack([np.sin(lean), 0 * t, np.cos(lean)])

    with pytest.raises(GeometryError, match=r"4\.00|3\.99") as refusal:
        PassProfile.of(curve, 0.01, RADIUS)
    assert refusal.value.code == "bad_pass"
