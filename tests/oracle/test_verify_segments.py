"""Cutting parts of circle segment mills against their outline in points and against many standing tools.

Random lenses and barrels have diameters of 1 to 20 mm and large arcs of 0.6 to 30 diameters.
"""

import math

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import end_radius, side_height
from geometry.tool_body import ToolBody
from tests.oracle.test_verify_tapered import EXACT, cases, refined, under
from verify.kernels.heights import bottom, edge_radius, entered, lowest
from verify.kernels.profile import carried, standing
from verify.kernels.rays import gap, new_left
from verify.kernels.surface.patches import deepest_point
from verify.kernels.sweep import cutter_interval
from verify.material.stock_field import round_off
from verify.material.stock_pass import end_radii
from verify.moves import cutter_sizes, cutter_table


def lens(diameter, profile, corner, flutes=None):
    """A lens with flutes of twice the diameter."""
    long = 2.0 * diameter if flutes is None else flutes
    return ToolBody("T1", 1, diameter, corner, long, diameter, long, diameter, long + 20.0, form="lens",
                    profile_radius=profile)


def barrel(diameter, profile, corner, degrees=0.0, flat=0.0, flutes=None):
    """A barrel whose flutes end with its large arc, or a fifth above."""
    body = ToolBody("T1", 1, diameter, corner, 1.0, diameter, 1.0, diameter, 1.0, form="barrel",
                    profile_radius=profile, profile_taper=math.tan(math.radians(degrees)), tip_diameter=2.0 * flat)
    long = body.arcs.high * 1.2 if flutes is None else flutes
    return ToolBody("T1", 1, diameter, corner, long, diameter, long, diameter, long + 20.0, form="barrel",
                    profile_radius=profile, profile_taper=body.profile_taper, tip_diameter=2.0 * flat)


def random_mills(seed, count):
    """Lenses with and without corner, oval and tapered barrels with balls and flats at the tip."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        d = float(np.exp(rng.uniform(math.log(1.0), math.log(20.0))))
        if k % 4 < 2:
            yield lens(d, d * float(np.exp(rng.uniform(math.log(0.51), math.log(30.0)))),
                       d * float(rng.uniform(0.01, 0.4)) if k % 4 else 0.0, d * float(rng.uniform(0.6, 3.0)))
        else:
            flat, corner = d * float(rng.uniform(0.0, 0.2)) * (k % 4 - 2), d * float(rng.uniform(0.02, 0.28))
            yield barrel(d, d * float(np.exp(rng.uniform(math.log(0.8), math.log(30.0)))), corner,
                         0.0 if k % 8 < 4 else float(rng.uniform(1.0, 30.0)), flat)


def outline(tool, count=20_001):
    """Points all along the outline, (n, 2) float64, mm: distance from the axis and height."""
    a = tool.arcs
    t = np.linspace(0.0, 1.0, count)
    low, high = (np.arcsin(min(s, 1.0)) for s in (a.join_sine, a.end_sine))
    first, last = low * t, low + (high - low) * t
    top = np.array([tool.radius, tool.flute_length])
    return np.concatenate([np.column_stack([a.flat * t, 0.0 * t]),
                           np.column_stack([a.flat + a.low * np.sin(first), a.low * (1.0 - np.cos(first))]),
                           np.column_stack([a.out + a.bow * np.sin(last), a.up - a.bow * np.cos(last)]),
                           [a.wide, a.high] + t[:, None] * (top - [a.wide, a.high]),
                           np.column_stack([top[0] * t, np.full(count, top[1])])])


def heights(rho, tool):
    """Height of the end over the tip at distances from the axis up to the radius."""
    return np.array([tool.arcs.height(float(r)) for r in np.ravel(rho)])


def test_the_arcs_touch_each_other_and_the_side():
    for tool in random_mills(1, 200):
        a = tool.arcs
        assert 0.0 <= a.join_sine <= a.end_sine <= 1.0 + 1e-12 and 0.0 < a.high <= tool.flute_length
        assert math.hypot(a.flat - a.out, a.low - a.up) == pytest.approx(abs(a.bow - a.low), rel=1e-12)
        assert math.hypot(a.join - a.out, a.join_up - a.up) == pytest.approx(a.bow, rel=1e-9, abs=1e-9)
        assert a.height(a.wide) == pytest.approx(a.high, abs=1e-6) and a.wide == tool.radius
        assert a.end_sine == pytest.approx(1.0 / math.hypot(1.0, tool.profile_taper), abs=1e-12)
        if tool.form == "lens":
            assert (a.flat, a.low, a.bow) == (0.0, tool.profile_radius, tool.corner_radius)
            assert a.out == pytest.approx(tool.radius - tool.corner_radius, abs=1e-12) and a.up == a.high
        else:
            assert (a.low, a.bow) == (tool.corner_radius, tool.profile_radius)


def test_an_oval_of_the_catalogue():
    """Tip of 3 mm, diameter of 10 mm, segment of 85 mm: its centre lies 80 mm beyond the axis."""
    tool = barrel(10.0, 85.0, 3.0)
    assert tool.arcs.out == pytest.approx(-80.0) and tool.arcs.high == pytest.approx(3.0 + math.sqrt(82**2 - 80**2))


def test_the_sizes_are_those_of_the_body():
    for tool in random_mills(2, 60):
        cutter, rho = cutter_sizes(tool), np.linspace(0.0, tool.radius, 40)
        assert cutter_table([tool])[0].tolist() == list(cutter)
        assert side_height(cutter) == tool.arcs.high and end_radius(cutter) == tool.radius
        low = heights(rho, tool)
        assert np.array([bottom(r, cutter) for r in rho]) == pytest.approx(low, abs=1e-12)
        wide = np.array([edge_radius(h, cutter) for h in low])
        assert wide[rho > tool.arcs.flat] == pytest.approx(rho[rho > tool.arcs.flat], abs=2e-6 * tool.radius)
        assert edge_radius(2.0 * tool.flute_length, cutter) == tool.radius
        assert 0.0 < end_radii([tool])[0] <= tool.radius and round_off([tool])[0] >= 0.0


def test_distances_are_those_of_the_outline():
    rng = np.random.default_rng(3)
    for tool in random_mills(3, 32):
        line, cutter = outline(tool), cutter_sizes(tool)
        step = 3.0 * max(tool.flute_length, tool.radius) / 20_000
        for rho, h in rng.uniform([0.0, -0.4], [2.0, 1.2], (60, 2)) * [tool.radius, tool.flute_length]:
            got = standing(rho, h, cutter)
            far = np.hypot(line[:, 0] - rho, line[:, 1] - h).min()
            held = rho <= tool.radius and tool.arcs.height(rho) <= h <= tool.flute_length
            slack = 1e-10 + min(step * step / (8.0 * max(far, 1e-12)), step)
            if held:
                assert far - slack <= -got <= far + 1e-10
            elif h <= tool.flute_length:
                assert far - slack <= got <= far + 1e-10
            else:
                assert 0.0 < got <= far + 1e-10


def test_carried_is_the_least_of_standing():
    for tool in random_mills(4, 40):
        cutter = cutter_sizes(tool)
        for q, d, _ in cases(tool, 4, 24):
            want, _ = refined(lambda s, q=q, d=d, c=cutter: np.array(
                [standing(math.hypot(q[0] - k * d[0], q[1] - k * d[1]), q[2] - k * d[2], c) for k in s]), count=41)
            got = carried(*q, *d, cutter)
            assert want - EXACT <= got <= want + 1e-5, (tool, q, d)
            assert gap(*q, *d, d[0] ** 2 + d[1] ** 2, cutter) <= got + 1e-9


@pytest.mark.parametrize("grow", [0.0, 0.7])
def test_lowest_is_the_least_of_many_standing_tools(grow):
    met = 0
    for tool in random_mills(5, 40):
        cutter, wide = cutter_sizes(tool), tool.radius + grow
        for q, d, _ in cases(tool, 5, 24):
            got, touch = lowest(*q[:2], 0.0, 0.0, 0.3, *d, cutter, grow)
            first, last = under(q, d, wide)
            if first > last:
                assert np.isinf(got)
                continue
            met += 1

            def over(s, q=q, d=d, tool=tool):
                rho = np.maximum(np.hypot(q[0] - s * d[0], q[1] - s * d[1]) - grow, 0.0)
                return 0.3 + s * d[2] + heights(np.minimum(rho, tool.radius), tool)
            want, _ = refined(over, first, last)
            assert got == pytest.approx(want, abs=1e-9), (tool, q, d)
            assert touch == pytest.approx(first, abs=1e-9)
    assert met > 250


def least_at(p, d, cutter):
    """Least signed distance of a place to a moved tool, by ever finer samples."""
    return refined(lambda s: np.array([standing(math.hypot(p[0] - k * d[0], p[1] - k * d[1]), p[2] - k * d[2], cutter)
                                       for k in s]), count=41)[0]


def test_intervals_end_where_the_distance_is_zero():
    """A ray begins and ends inside where the signed distance is 0, and is beside the tool where that never is."""
    hits = 0
    for tool in random_mills(8, 80):
        cutter, size = cutter_sizes(tool), tool.flute_length + tool.radius
        for q, d, n in cases(tool, 8, 24):
            lo, hi = cutter_interval(*q, *n, *d, cutter)
            if lo <= hi:
                hits += 1
                for t in (lo, hi):
                    assert abs(least_at(q + t * n, d, cutter)) <= EXACT * max(size, 1.0), (tool, q, n, d, t)
                for t in (lo - 1e-3 * size, hi + 1e-3 * size):
                    assert least_at(q + t * n, d, cutter) > 0.0
            else:
                t = np.linspace(-3.0 * size, 3.0 * size, 201)
                assert min(carried(*(q + k * n), *d, cutter) for k in t) > -1e-4 * size
    assert hits > 300


def test_what_is_left_on_a_normal_is_where_the_tool_begins():
    for tool in random_mills(9, 40):
        cutter, most = cutter_sizes(tool), 0.5 * tool.radius
        for q, d, n in cases(tool, 9, 40):
            lo, hi = cutter_interval(*q, *n, *d, cutter)
            want = lo if lo <= hi and hi >= -1e-6 and lo < most else most
            assert new_left(*q, *n, *d, d[0] ** 2 + d[1] ** 2, cutter, most) == want


def test_how_deep_a_line_is_entered():
    for tool in random_mills(10, 30):
        cutter = cutter_sizes(tool)
        for q, d, _ in cases(tool, 10, 12):
            def out(s, q=q, d=d, tool=tool, cutter=cutter):
                rho = np.hypot(q[0] - s * d[0], q[1] - s * d[1])
                top = q[2] - s * d[2]
                aside = np.array([edge_radius(float(max(h, 0.0)), cutter) for h in top])
                return -np.minimum(aside - rho, top - heights(np.minimum(rho, tool.radius), tool))
            want = -refined(out, count=201)[0]
            got = entered(*q, *d, cutter)
            assert got < 1e-6 if want < 0.0 else got == pytest.approx(want, abs=1e-5 * tool.flute_length)


def test_the_deepest_point_is_the_deepest_of_the_outline():
    for tool in random_mills(11, 24):
        line, cutter = outline(tool, 4001), cutter_sizes(tool)
        for q, d, n in cases(tool, 11, 12):
            aside = math.hypot(n[0], n[1])
            depth, *place = deepest_point(*q, *n, *d, cutter)
            far = max(-(n[2] * (line[:, 1] + k * d[2] - q[2])
                        + (-line[:, 0] * aside + n[0] * (k * d[0] - q[0]) + n[1] * (k * d[1] - q[1]))).min()
                      for k in (0.0, 1.0))
            assert depth == pytest.approx(-float(n @ np.array(place)), abs=1e-9)
            assert far == pytest.approx(depth, abs=1e-5 * tool.flute_length) and far <= depth + 1e-9
