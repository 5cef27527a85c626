"""Cutting parts of tapered mills against bodies put together from many thin discs and from their outline in points.

Random tools have tips of 0.1 to 6 mm and sides that lean by 0.5 to 30 degrees.
"""

import math

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import corner_end, end_radius, side_height
from geometry.tool_body import ToolBody
from verify.kernels.frustum import Frustum, overlap
from verify.kernels.heights import bottom, edge_radius, entered, lowest, lowest_within
from verify.kernels.profile import carried, standing
from verify.kernels.rays import gap, new_left
from verify.kernels.surface.patches import deepest_point
from verify.kernels.sweep import cutter_interval
from verify.moves import cutter_sizes, cutter_table

KINDS = ("ball", "bull", "flat")
WAYS = np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1], [1, 0, 0.02], [0.02, 0, 1], [0.2, 0.2, 1]], float)
EXACT = 1e-6  # mm


def mill(end, tip, degrees, flutes, corner=None):
    """A tapered mill: diameter of its end, lean of its side, length of its flutes."""
    r = {"ball": 0.5 * tip, "flat": 0.0, "bull": 0.2 * tip}[end] if corner is None else corner
    wide = tip + 2.0 * flutes
    return ToolBody("T1", 1, tip, r, flutes, wide, flutes, wide, flutes + 20.0, taper=math.tan(math.radians(degrees)))


def random_mills(seed, count):
    """Tapered mills of every end, from stout to slender."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        tip = float(np.exp(rng.uniform(math.log(0.1), math.log(6.0))))
        yield mill(KINDS[k % 3], tip, float(np.exp(rng.uniform(math.log(0.5), math.log(30.0)))),
                   tip * float(rng.uniform(1.0, 8.0)))


def height(rho, tool):
    """Height of the end and the side over the tip, inf beside the tool: by its definition, not by the kernels."""
    a, r, (wide, high) = tool.radius - tool.corner_radius, tool.corner_radius, tool.corner_end
    over = np.clip(rho - a, 0.0, wide - a)
    arc = r - np.sqrt(np.maximum(r * r - over * over, 0.0))
    side = high + np.maximum(rho - wide, 0.0) / tool.taper
    return np.where(rho <= tool.widest_radius + 1e-12, np.where(rho <= wide, arc, side), np.inf)


def outline(tool, count=20_001):
    """Points all along the outline of the profile, (n, 2) float64, mm: distance from the axis and height."""
    a, r, (wide, high) = tool.radius - tool.corner_radius, tool.corner_radius, tool.corner_end
    t = np.linspace(0.0, 1.0, count)
    turn = t * math.asin(min((wide - a) / r, 1.0)) if r > 0.0 else 0.0 * t
    top = np.array([tool.widest_radius, tool.flute_length])
    return np.concatenate([np.column_stack([a * t, 0.0 * t]),
                           np.column_stack([a + r * np.sin(turn), r * (1.0 - np.cos(turn))]),
                           [wide, high] + t[:, None] * (top - [wide, high]),
                           np.column_stack([top[0] * t, np.full(count, top[1])])])


def cases(tool, seed, count):
    """Places seen from the tip, ways of the tip, and directions of rays, in proportion to the tool."""
    rng, size = np.random.default_rng(seed), np.array([tool.widest_radius, tool.widest_radius, tool.flute_length])
    for case in range(count):
        d = rng.normal(size=3) * WAYS[case % len(WAYS)] * size
        n = rng.normal(size=3) * np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1]][case % 3])
        yield rng.uniform([-1.5, -1.5, -0.3], [1.5, 1.5, 1.2]) * size, d, n / np.linalg.norm(n)


def refined(f, lo=0.0, hi=1.0, count=401, rounds=7):
    """Least value of a convex function of many places at once, by ever finer samples between lo and hi."""
    low, high = lo, hi
    for _ in range(rounds):
        s = np.linspace(lo, hi, count)
        value = f(s)
        k = int(np.argmin(value))
        lo, hi = s[max(k - 1, 0)], s[min(k + 1, count - 1)]
    return float(value.min()), float(np.clip(s[k], low, high))


def test_the_sizes_are_those_of_the_body():
    for tool in random_mills(1, 60):
        cutter = cutter_sizes(tool)
        assert cutter_table([tool])[0].tolist() == list(cutter)
        assert cutter.radius == pytest.approx(tool.widest_radius, rel=1e-14) and cutter.length == tool.flute_length
        assert cutter.radius - cutter.corner == pytest.approx(tool.radius - tool.corner_radius, abs=1e-14)
        assert corner_end(cutter) == pytest.approx(tool.corner_end, abs=1e-14)
        assert side_height(cutter) == pytest.approx(tool.corner_end[1], abs=1e-14)
        assert end_radius(cutter) == pytest.approx(tool.radius, abs=1e-14)


def test_the_profile_is_that_of_the_body():
    rng = np.random.default_rng(2)
    for tool in random_mills(2, 60):
        cutter = cutter_sizes(tool)
        for rho in rng.uniform(0.0, tool.widest_radius, 40):
            low = bottom(rho, cutter)
            assert low == pytest.approx(float(height(rho, tool)), abs=1e-12)
            assert rho <= tool.radius - tool.corner_radius or edge_radius(low, cutter) == pytest.approx(rho, abs=1e-7)
        assert edge_radius(2.0 * tool.flute_length, cutter) == cutter.radius


def test_distances_are_those_of_the_outline():
    rng = np.random.default_rng(3)
    for tool in random_mills(3, 24):
        line, cutter = outline(tool), cutter_sizes(tool)
        step = 3.0 * max(tool.flute_length, tool.widest_radius) / 20_000
        for rho, h in rng.uniform([0.0, -0.4], [2.0, 1.2], (60, 2)) * [tool.widest_radius, tool.flute_length]:
            got = standing(rho, h, cutter)
            far = np.hypot(line[:, 0] - rho, line[:, 1] - h).min()
            held = rho <= tool.widest_radius and height(rho, tool) <= h <= tool.flute_length
            # far is too large by the half of a step square over itself at most
            slack = 1e-12 + min(step * step / (8.0 * max(far, 1e-12)), step)
            if held:
                assert far - slack <= -got <= far + 1e-12
            elif h <= tool.flute_length:
                assert far - slack <= got <= far + 1e-12
            else:
                assert 0.0 < got <= far + 1e-12


def test_carried_is_the_least_of_standing():
    shortcuts = 0
    for tool in random_mills(4, 30):
        cutter = cutter_sizes(tool)
        for q, d, _ in cases(tool, 4, 24):
            want, at = refined(lambda s, q=q, d=d, c=cutter: np.array(
                [standing(math.hypot(q[0] - k * d[0], q[1] - k * d[1]), q[2] - k * d[2], c) for k in s]), count=41)
            got = carried(*q, *d, cutter)
            assert want - EXACT <= got <= want + 1e-5, (tool, q, d)
            shortcuts += 0.0 < at < 1.0
            assert gap(*q, *d, d[0] ** 2 + d[1] ** 2, cutter) <= got + 1e-9
    assert shortcuts > 100


def under(q, d, wide):
    """First and last s at which the axis is no farther than ``wide`` in plan from a place, the last less if never."""
    a, b, c = d[0]**2 + d[1]**2, -(q[0] * d[0] + q[1] * d[1]), q[0]**2 + q[1]**2 - wide**2
    if b * b - a * c < 0.0 or (a == 0.0 and c > 0.0):
        return 1.0, 0.0
    if a == 0.0:
        return 0.0, 1.0
    half = math.sqrt(b * b - a * c)
    return max((-b - half) / a, 0.0), min((-b + half) / a, 1.0)


@pytest.mark.parametrize("grow", [0.0, 0.7])
def test_lowest_is_the_least_of_many_standing_tools(grow):
    met = 0
    for tool in random_mills(5, 40):
        cutter, wide = cutter_sizes(tool), tool.widest_radius + grow
        for q, d, _ in cases(tool, 5, 24):
            got, touch = lowest(*q[:2], 0.0, 0.0, 0.3, *d, cutter, grow)
            first, last = under(q, d, wide)
            if first > last:
                assert np.isinf(got)
                continue
            met += 1

            def over(s, q=q, d=d, tool=tool):
                rho = np.maximum(np.hypot(q[0] - s * d[0], q[1] - s * d[1]) - grow, 0.0)
                return 0.3 + s * d[2] + height(np.minimum(rho, tool.widest_radius), tool)
            want, _ = refined(over, first, last)
            assert got == pytest.approx(want, abs=1e-9), (tool, q, d)
            assert touch == pytest.approx(first, abs=1e-9)
            within = lowest_within(*q[:2], 0.0, 0.0, 0.3, *d, tool.radius, cutter)[0]
            assert within >= lowest(*q[:2], 0.0, 0.0, 0.3, *d, cutter, 0.0)[0] - 1e-12
    assert met > 250


def discs(tool, count):
    """Heights and radii of thin discs, of which the tool is the hull."""
    low = tool.corner_end[1]
    z = np.concatenate([low * (0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, count))),
                        np.linspace(low, tool.flute_length, 9)])
    return z, np.array([edge_radius(float(h), cutter_sizes(tool)) for h in z])


def ray_in_discs(q, n, d, tool, count=25):
    """Interval of a ray in the union of the standing tool at many places, each as frusta between thin discs."""
    z, r = discs(tool, count)
    lo, hi = np.inf, -np.inf
    for s in np.linspace(0.0, 1.0, 101):
        w = q - s * d
        for z0, z1, r0, r1 in zip(z[:-1], z[1:], r[:-1], r[1:], strict=True):
            if z1 - z0 < 1e-12:
                continue
            m = (r1 - r0) / (z1 - z0)
            wide = r0 + m * (w[2] - z0)
            a, b = n[0]**2 + n[1]**2 - (m * n[2])**2, w[0] * n[0] + w[1] * n[1] - wide * m * n[2]
            disc = b * b - a * (w[0]**2 + w[1]**2 - wide**2)
            roots = [] if disc < 0.0 or abs(a) < 1e-15 else [(-b + k * math.sqrt(disc)) / a for k in (-1.0, 1.0)]
            ends = [(v - w[2]) / n[2] for v in (z0, z1)] if abs(n[2]) > 1e-12 else []
            for t in (*roots, *ends):
                h = w[2] + t * n[2]
                rho = math.hypot(w[0] + t * n[0], w[1] + t * n[1])
                if z0 - 1e-9 <= h <= z1 + 1e-9 and rho <= r0 + m * (h - z0) + 1e-9:
                    lo, hi = min(lo, t), max(hi, t)
    return lo, hi


def test_rays_meet_the_union_of_standing_tools():
    met = 0
    for tool in random_mills(7, 15):
        cutter = cutter_sizes(tool)
        for q, d, n in cases(tool, 7, 18):
            lo, hi = cutter_interval(*q, *n, *d, cutter)
            first, last = ray_in_discs(q, n, d, tool)
            if np.isinf(first):
                continue
            met += 1
            assert lo <= first + 1e-8 and hi >= last - 1e-8, (tool, q, n, d)
            # and no place of the interval is out of the sweep
            for t in (lo, 0.5 * (lo + hi), hi):
                assert least_at(q + t * n, d, cutter) <= EXACT, (tool, q, n, d, t)
    assert met > 40


def least_at(p, d, cutter):
    """Least signed distance of a place to a moved tool, by ever finer samples."""
    return refined(lambda s: np.array([standing(math.hypot(p[0] - k * d[0], p[1] - k * d[1]), p[2] - k * d[2], cutter)
                                       for k in s]), count=41)[0]


def test_intervals_end_where_the_distance_is_zero():
    """A ray begins and ends inside where the signed distance is 0, and is beside the tool where that never is."""
    hits = 0
    for tool in random_mills(8, 60):
        cutter, size = cutter_sizes(tool), tool.flute_length + tool.widest_radius
        for q, d, n in cases(tool, 8, 24):
            lo, hi = cutter_interval(*q, *n, *d, cutter)
            if lo <= hi:
                hits += 1
                for t in (lo, hi):
                    assert abs(least_at(q + t * n, d, cutter)) <= EXACT * max(size, 1.0), (tool, q, n, d, t)
            else:
                t = np.linspace(-3.0 * size, 3.0 * size, 201)
                assert min(carried(*(q + k * n), *d, cutter) for k in t) > -1e-4 * size
    assert hits > 300


@pytest.mark.parametrize("end", KINDS)
def test_rays_along_the_side_of_the_cone_and_along_the_move(end):
    tool = mill(end, 1.0, 5.0, 12.0)
    cutter, (wide, high) = cutter_sizes(tool), tool.corner_end
    side, still = np.array([tool.taper, 0.0, 1.0]) / math.hypot(1.0, tool.taper), np.zeros(3)
    for off, hits in ((-1e-9, True), (-0.1, True), (0.1, False)):
        q = np.array([wide, 0.0, high]) + off * np.array([side[2], 0.0, -side[0]])
        for n in (side, -side):
            for d in (still, 2.0 * side):
                lo, hi = cutter_interval(*(q - 3.0 * n), *n, *d, cutter)
                assert (lo <= hi) == hits
    # straight up from under the tip, moved down along its side
    lo, _ = cutter_interval(0.0, 0.0, -9.0, 0.0, 0.0, 1.0, *(-2.0 * side), cutter)
    want, _ = refined(lambda s: -2.0 * s * side[2] + height(2.0 * s * side[0], tool))
    assert lo == pytest.approx(9.0 + want, abs=1e-9)


def test_what_is_left_on_a_normal_is_where_the_tool_begins():
    for tool in random_mills(9, 40):
        cutter, most = cutter_sizes(tool), 0.5 * tool.widest_radius
        for q, d, n in cases(tool, 9, 40):
            lo, hi = cutter_interval(*q, *n, *d, cutter)
            want = lo if lo <= hi and hi >= -1e-6 and lo < most else most
            assert new_left(*q, *n, *d, d[0] ** 2 + d[1] ** 2, cutter, most) == want


def test_how_deep_a_line_is_entered():
    for tool in random_mills(10, 30):
        cutter = cutter_sizes(tool)
        for q, d, _ in cases(tool, 10, 12):
            def out(s, q=q, d=d, tool=tool, cutter=cutter):
                rho = np.minimum(np.hypot(q[0] - s * d[0], q[1] - s * d[1]), tool.widest_radius)
                top = q[2] - s * d[2]
                aside = np.array([edge_radius(float(max(h, 0.0)), cutter) for h in top])
                return -np.minimum(aside - np.hypot(q[0] - s * d[0], q[1] - s * d[1]), top - height(rho, tool))
            want = -refined(out, count=201)[0]
            got = entered(*q, *d, cutter)
            assert got < 1e-6 if want < 0.0 else got == pytest.approx(want, abs=1e-5 * tool.flute_length)


def test_the_deepest_point_is_the_deepest_of_the_outline():
    for tool in random_mills(11, 20):
        line, cutter = outline(tool, 4001), cutter_sizes(tool)
        for q, d, n in cases(tool, 11, 12):
            aside = math.hypot(n[0], n[1])
            depth, *place = deepest_point(*q, *n, *d, cutter)
            far = max(-(n[2] * (line[:, 1] + k * d[2] - q[2])
                        + (-line[:, 0] * aside + n[0] * (k * d[0] - q[0]) + n[1] * (k * d[1] - q[1]))).min()
                      for k in (0.0, 1.0))
            far_point = -float(n @ np.array(place))
            assert depth == pytest.approx(far_point, abs=1e-9)
            assert far == pytest.approx(depth, abs=1e-5 * tool.flute_length) and far <= depth + 1e-9


def test_a_body_as_wide_as_the_cone_is_no_wider_than_the_cutting_part():
    """The frustum of the side is taken in by the sweep of the cutting part: the neck over it runs where it has been."""
    for tool in random_mills(12, 20):
        (wide, high), cutter = tool.corner_end, cutter_sizes(tool)
        side = Frustum(high, tool.flute_length, wide, tool.widest_radius)
        for q, d, _ in cases(tool, 12, 12):
            if overlap(*q, *d, side, False) > 1e-9:
                assert carried(*q, *d, cutter) <= 1e-5
