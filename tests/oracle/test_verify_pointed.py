"""Cutting parts with a cone at the end (drills, chamfer mills, leads of taps) against sampled bodies of revolution."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh
from verify.kernels.heights import bottom, edge_radius, entered, lowest
from verify.kernels.profile import carried, standing
from verify.kernels.rays import gap, new_left
from verify.kernels.stock import PLUNGE
from verify.kernels.sweep import cutter_interval
from verify.material.stock_field import run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.model import ProofSetup
from verify.moves import Moves
from verify.tool_axes import ToolAxes

# radius, width of the corner, length, height of the cone: a drill, a chamfer mill, a lead, an engraver without a side
PARTS = [(1.5, 1.5, 6.0, 0.9), (2.0, 1.4, 5.0, 1.4), (2.0, 0.5, 5.0, 2.0), (1.5, 1.5, 4.0, 4.0)]
WAYS = [(1, 1, 1), (1, 1, 0), (0, 0, 1), (1, 0, 0.02), (0.02, 0, 1)]


def height(rho, part, grow=0.0):
    """Height of the end over the tip, inf beside the tool."""
    radius, corner, _, cone = part
    over = np.maximum(rho - (radius - corner + grow), 0.0)
    return np.where(rho <= radius + grow, over * cone / corner, np.inf)


def outline(part, count=4001):
    """Points all along the outline of the profile, (n, 2) float64, mm: distance from the axis and height."""
    radius, corner, length, cone = part
    corners = np.array([[0.0, 0.0], [radius - corner, 0.0], [radius, cone], [radius, length], [0.0, length]])
    t = np.linspace(0.0, 1.0, count)[:, None]
    return np.concatenate([a + t * (b - a) for a, b in zip(corners[:-1], corners[1:], strict=True)])


def inside(rho, h, part):
    """Whether a standing cutting part holds places."""
    return (rho <= part[0]) & (h >= height(rho, part)) & (h <= part[2])


def random_cases(seed, count):
    """Places seen from the tip, ways of the tip, and directions of rays."""
    rng = np.random.default_rng(seed)
    for case in range(count):
        d = rng.normal(size=3) * np.array(WAYS[case % len(WAYS)])
        n = rng.normal(size=3) * np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1]][case % 3])
        yield rng.uniform([-2.5, -2.5, -1], [2.5, 2.5, 5]), d, n / np.linalg.norm(n)


@pytest.mark.parametrize("part", PARTS)
def test_rays_meet_the_union_of_standing_tools(part):
    t, met = np.linspace(-9.0, 9.0, 1501), 0
    for q, d, n in random_cases(5, 75):
        lo, hi = cutter_interval(*q, *n, *d, CutterSizes(*part))
        p, s = q + t[:, None] * n, np.linspace(0.0, 1.0, 61)[:, None]
        held = inside(np.hypot(p[:, 0] - s * d[0], p[:, 1] - s * d[1]), p[:, 2] - s * d[2], part).any(axis=0)
        if not held.any():
            continue
        met += 1
        assert lo <= t[held].min() + 1e-9 and hi >= t[held].max() - 1e-9
        for at in (lo, 0.5 * (lo + hi), hi):
            p = q + at * n
            assert carried(*p, *d, CutterSizes(*part)) <= 2e-5, (q, d, n, at)
    assert met > 15


@pytest.mark.parametrize("part", PARTS)
def test_rays_along_the_side_of_the_cone_and_along_the_move(part):
    radius, corner, _, cone = part
    side = np.array([corner, 0.0, cone]) / np.hypot(corner, cone)
    still = np.zeros(3)
    # on the side itself, 0.1 mm inside, and 0.1 mm outside
    for off, hits in ((-1e-9, True), (-0.1, True), (0.1, False)):
        q = np.array([radius - corner, 0.0, 0.0]) + off * np.array([side[2], 0.0, -side[0]])
        for n in (side, -side):
            lo, hi = cutter_interval(*(q - 3.0 * n), *n, *still, CutterSizes(*part))
            assert (lo <= hi) == hits
            lo, hi = cutter_interval(*(q - 3.0 * n), *n, *(2.0 * side), CutterSizes(*part))
            assert (lo <= hi) == hits
    # straight down onto the cone, moved along its side: it leaves what the way of the side leaves
    lo, _ = cutter_interval(radius - 0.5 * corner, 0.0, -9.0, 0.0, 0.0, 1.0, 0.0, 0.0, -2.0, CutterSizes(*part))
    assert lo == pytest.approx(9.0 + 0.5 * cone - 2.0, abs=1e-12)


@pytest.mark.parametrize("part", PARTS)
def test_distances_are_those_of_the_outline(part):
    length, cutter = part[2], CutterSizes(*part)
    rng, line = np.random.default_rng(1), outline(part)
    for rho, h in rng.uniform([0.0, -2.0], [4.0, length + 1.0], (400, 2)):
        got = standing(rho, h, cutter)
        far = np.hypot(line[:, 0] - rho, line[:, 1] - h).min()
        if inside(rho, h, part):
            # a cutting part ends at its length: that is no wall of the inside unless it is the nearest
            assert got <= 1e-12 and -got == pytest.approx(far, abs=2e-3)
        elif h <= length:
            assert got == pytest.approx(far, abs=2e-3)
        else:
            assert 0.0 < got <= far + 1e-12


@pytest.mark.parametrize("part", PARTS)
def test_carried_is_the_least_of_standing(part):
    cutter, s = CutterSizes(*part), np.linspace(0.0, 1.0, 401)
    for q, d, _ in random_cases(3, 50):
        want = min(standing(np.hypot(q[0] - k * d[0], q[1] - k * d[1]), q[2] - k * d[2], cutter) for k in s)
        got = carried(*q, *d, cutter)
        assert want - 1e-2 <= got <= want + 2e-5
        assert gap(*q, *d, d[0] ** 2 + d[1] ** 2, cutter) <= got + 2e-5


@pytest.mark.parametrize("grow", [0.0, 0.7])
@pytest.mark.parametrize("part", PARTS)
def test_lowest_is_the_least_of_many_standing_tools(part, grow):
    radius, s, met = part[0], np.linspace(0.0, 1.0, 40_001), 0
    for q, d, _ in random_cases(2, 60):
        x, y = q[:2]
        got, touch = lowest(x, y, 0.0, 0.0, 0.3, *d, CutterSizes(*part), grow)
        rho = np.hypot(x - s * d[0], y - s * d[1])
        want = (0.3 + s * d[2] + height(rho, part, grow)).min()
        if np.isinf(want):
            continue
        met += 1
        assert want - 1e-3 <= got <= want + 1e-9
        assert touch == pytest.approx(s[rho <= radius + grow].min(), abs=1e-4)
    assert met > 12


@pytest.mark.parametrize("part", PARTS)
def test_what_is_left_on_a_normal_is_where_the_tool_begins(part):
    cutter = CutterSizes(*part)
    for q, d, n in random_cases(8, 120):
        lo, hi = cutter_interval(*q, *n, *d, cutter)
        want = lo if lo <= hi and hi >= -1e-6 and lo < 1.0 else 1.0
        assert new_left(*q, *n, *d, d[0] ** 2 + d[1] ** 2, cutter, 1.0) == want


@pytest.mark.parametrize("part", PARTS)
def test_how_deep_a_line_is_entered(part):
    radius, s = part[0], np.linspace(0.0, 1.0, 20_001)
    for q, d, _ in random_cases(4, 60):
        rho = np.hypot(q[0] - s * d[0], q[1] - s * d[1])
        deep = np.minimum(radius - rho, q[2] - s * d[2] - height(np.minimum(rho, radius), part))
        want = float(deep[rho <= radius].max(initial=-1.0))
        got = entered(q[0], q[1], q[2], *d, CutterSizes(*part))
        assert got < 0.0 if want < -1e-3 else got == pytest.approx(want, abs=1e-3)


def test_the_edge_is_as_wide_as_the_cone_there():
    cutter = CutterSizes(*PARTS[1])
    for over, wide in ((0.0, 0.6), (0.7, 1.3), (1.4, 2.0), (3.0, 2.0)):
        assert edge_radius(over, cutter) == pytest.approx(wide)
    assert [bottom(r, cutter) for r in (0.3, 0.6, 1.3, 2.0)] == pytest.approx([0.0, 0.0, 0.7, 1.4])


DRILL = ToolBody("T1", 1, 3.0, 0.0, 12.0, 3.0, 12.0, 3.0, 30.0, (), "drill", 0.0, 0.9)
BLANK = ProofSetup(stock_kind="box", margin=0.0, uncertainty=0.0, line_spacing=0.2)


def feed(start, end, axis=None):
    """One feed move, with a tool axis where it is not +Z."""
    axes = None if axis is None else ToolAxes.between(np.array([axis]), np.array([axis]))
    return Moves(np.array([start], float), np.array([end], float), np.ones(1, bool), np.zeros(1, np.int32), axes)


def test_a_blind_hole_leaves_its_cone_on_every_line():
    mesh = box_mesh((-4, -4, -10), (4, 4, 0))
    field = blank(mesh, 0.2, BLANK)
    run = run_stock(field, feed((0, 0, 3), (0, 0, -5)), [DRILL], BLANK)
    x, y = (field.origin[k] + (np.arange(field.height.shape[k]) + 0.5) * field.step for k in range(2))
    rho = np.hypot(*np.meshgrid(x, y, indexing="ij"))
    want = np.where(rho <= 1.5, np.minimum(-5.0 + rho * 0.9 / 1.5, 0.0), 0.0)
    held = field.height > -20
    np.testing.assert_allclose(field.height[held], want[held], atol=1e-12)
    assert len(run.events) == 0 and run.cut.tolist() == [True]  # a drill may go straight down


@pytest.mark.parametrize("angle", [0.0, 25.0])
def test_the_volume_of_a_drilled_hole(angle):
    # level with the place where the axis meets the top: a slanted top takes as much from one side as it gives the other
    axis = np.array([math.sin(math.radians(angle)), 0.0, math.cos(math.radians(angle))])
    field = stock_field(box_mesh((-5, -4, -9), (5, 4, 0)), BLANK, 0.1)
    run = run_field(field, feed(4.0 * axis, -5.0 * axis, axis), [DRILL], BLANK)
    want = math.pi * 1.5**2 * (5.0 - 0.9 + 0.9 / 3.0)
    assert run.ways.volume.sum() == pytest.approx(want, rel=0.005)
    assert len(run.events) == 0


def test_a_blunt_chamfer_mill_and_a_tap_do_not_plunge():
    mesh = box_mesh((-6, -6, -10), (6, 6, 0))
    chamfer = replace(DRILL, named="chamfer", diameter=6.0, tip_diameter=2.0, cone_height=2.0)
    tap, pointed = replace(DRILL, named="tap", tip_diameter=3.0, cone_height=0.0), replace(chamfer, tip_diameter=0.0)
    down = feed((0, 0, 1), (0, 0, -2))
    depths = [[e[2] for e in run_stock(blank(mesh, 0.2, BLANK), down, [t], BLANK).events if e[1] == PLUNGE]
              for t in (chamfer, tap, replace(pointed, cone_height=3.0), DRILL)]
    assert [max(d, default=0.0) for d in depths] == pytest.approx([2.0, 2.0, 0.0, 0.0])
    # a tap follows its drill, also where that came out under the plate
    field, wide = blank(box_mesh((-6, -6, -3), (6, 6, 0)), 0.2, BLANK), replace(tap, diameter=3.6)
    both = Moves(np.array([[0, 0, 1], [0, 0, 1]], float), np.array([[0, 0, -4], [0, 0, -6]], float), np.ones(2, bool),
                 np.array([0, 1], np.int32))
    assert [e for e in run_stock(field, both, [DRILL, wide], BLANK).events if e[1] == PLUNGE] == []
