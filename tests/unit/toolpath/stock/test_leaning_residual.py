"""What a leaning tool leaves, against poses laid close together and against what can be told without computing."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.errors import GeometryError
from tests.hand_parts import ball, tool
from toolpath.kernels.leaning import TOLERANCE
from toolpath.stock.cut_history import PER_MM
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap, leaning_depths

BODIES = [ball(3.0), ball(6.0), tool(6.0, 1.0), tool(4.0, 0.0)]
MARGIN = 0.5
ROUNDING = 1e-9  # mm
POSES = 400  # of the twin, over one move

each_body = pytest.mark.parametrize("body", BODIES, ids=lambda b: f"{b.kind} {b.diameter:.0f}")


def section(rho, h, body):
    """Signed distance in the half plane of a tool: the nearest of its bottom, its corner, its flank and its end."""
    big, r, flute = body.radius, body.corner_radius, body.flute_length
    a = big - r
    far = np.minimum(np.hypot(np.maximum(rho - a, 0.0), h), np.hypot(rho - big, h - np.clip(h, r, flute)))
    far = np.minimum(far, np.hypot(np.maximum(rho - big, 0.0), h - flute))
    at_corner = (rho > a) & (h < r)
    from_arc = np.hypot(rho - a, h - r) - r
    far = np.where(at_corner, np.minimum(far, np.abs(from_arc)), far)
    inside = (rho < big) & (h > 0.0) & (h < flute) & ~(at_corner & (from_arc > 0.0))
    return np.where(inside, -far, far)


def pose(a, b, t):
    """Tip and axis at shares t of a move from a to b, each (tip, axis)."""
    t = np.asarray(t)[..., None]
    angle = np.arccos(np.clip(a[1] @ b[1], -1.0, 1.0))
    if angle < 1e-7:
        return a[0] + t * (b[0] - a[0]), np.broadcast_to(a[1], (*t.shape[:-1], 3))
    return a[0] + t * (b[0] - a[0]), (np.sin((1 - t) * angle) * a[1] + np.sin(t * angle) * b[1]) / np.sin(angle)


def at_poses(points, tip, axis, body):
    """Signed distances from points (n, 3) to the tool at poses (n or 1, k, 3): (n, k)."""
    q = points[:, None] - tip
    h = (q * axis).sum(axis=-1)
    return section(np.linalg.norm(q - h[..., None] * axis, axis=-1), h, body)


def slow(points, tips, axes, body):
    """The least over POSES of each move; how much lower it can be between two; and the least looked for round those."""
    n, rows = len(points), np.arange(len(points))
    coarse, fine, between = np.full(n, np.inf), np.full(n, np.inf), 0.0
    share = np.linspace(0.0, 1.0, POSES)
    for k in range(len(tips) - 1):
        a, b = (tips[k], axes[k]), (tips[k + 1], axes[k + 1])
        tip, axis = pose(a, b, share)
        far = at_poses(points, tip[None], axis[None], body)
        coarse = np.minimum(coarse, far.min(axis=1))
        # no place of the tool near a sample goes faster than this
        angle = np.arccos(np.clip(a[1] @ b[1], -1.0, 1.0))
        reach = body.flute_length + body.radius + MARGIN
        between = max(between, 0.5 * share[1] * (np.linalg.norm(b[0] - a[0]) + angle * reach))
        mid, wide = share[far.argmin(axis=1)], share[1]
        for _ in range(3):
            t = np.clip(mid[:, None] + np.linspace(-wide, wide, 81), 0.0, 1.0)
            near = at_poses(points, *pose(a, b, t), body)
            mid, wide = t[rows, near.argmin(axis=1)], wide / 40
        fine = np.minimum(fine, near.min(axis=1))
    return coarse, between, fine


def walk(rng, count, step, turn):
    """Tips a random way apart and axes that turn by ``turn`` (rad) each time, from anywhere on the sphere."""
    tips = np.cumsum(rng.normal(size=(count, 3)) * step, axis=0)
    axes = [unit(rng.normal(size=3))]
    for _ in range(count - 1):
        aside = unit(np.cross(axes[-1], rng.normal(size=3)))
        axes.append(np.cos(turn) * axes[-1] + np.sin(turn) * aside)
    return tips, np.array(axes)


def unit(v):
    return v / np.linalg.norm(v)


def rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def beside(rng, tips, axes, body, n, off):
    """Points round the tool at random poses: up to ``off`` mm off its surface, to either side, and some anywhere."""
    k = rng.integers(0, len(tips) - 1, n)
    out = np.empty((n, 3))
    for i in range(n):
        tip, axis = pose((tips[k[i]], axes[k[i]]), (tips[k[i] + 1], axes[k[i] + 1]), rng.random())
        side = unit(np.cross(axis, rng.normal(size=3)))
        phi, r, a = rng.random() * np.pi / 2, body.corner_radius, body.radius - body.corner_radius
        rho, h, normal = [
            (a + r * np.sin(phi), r - r * np.cos(phi), (np.sin(phi), -np.cos(phi))),
            (body.radius, r + rng.random() * (body.flute_length - r), (1.0, 0.0)),
            (rng.random() * a, 0.0, (0.0, -1.0)),
            (rng.random() * body.radius, body.flute_length, (0.0, 1.0)),
            (0.0, rng.random() * body.flute_length, (0.0, 0.0)),
        ][rng.choice(5, p=[0.4, 0.35, 0.1, 0.1, 0.05])]
        d = rng.uniform(-off, off)
        out[i] = tip + (rho + d * normal[0]) * side + (h + d * normal[1]) * axis
    return out


@each_body
def test_the_section_of_the_twin_is_that_of_places_on_the_solid(body):
    rng = np.random.default_rng(3)
    a, r, s = body.radius - body.corner_radius, body.corner_radius, np.linspace(0.0, 1.0, 4001)
    phi, high = s * np.pi / 2, r + (body.flute_length - r) * s
    edge = np.concatenate([
        np.column_stack([a * s, 0.0 * s]), np.column_stack([a + r * np.sin(phi), r - r * np.cos(phi)]),
        np.column_stack([0.0 * s + body.radius, high]), np.column_stack([body.radius * s, 0 * s + body.flute_length])])
    rho, h = rng.random(300) * 2 * body.radius, rng.uniform(-2.0, body.flute_length + 2.0, 300)
    far = np.hypot(rho[:, None] - edge[:, 0], h[:, None] - edge[:, 1]).min(axis=1)
    np.testing.assert_allclose(np.abs(section(rho, h, body)), far, atol=1e-3)
    low = np.where(rho < a, 0.0, r - np.sqrt(np.maximum(r**2 - (rho - a) ** 2, 0.0)))
    np.testing.assert_array_equal(section(rho, h, body) < 0, (rho < body.radius) & (h > low) & (h < body.flute_length))


@each_body
@pytest.mark.parametrize(("step", "turn"), [(0.5, 0.0), (1.5, 0.02), (0.4, 0.1), (0.0, 0.1), (6.0, 0.1), (1.0, 0.8)])
def test_the_measure_is_that_of_poses_laid_close_together(body, step, turn):
    rng = np.random.default_rng([int(body.diameter), int(1e3 * turn), int(10 * step)])
    tips, axes = walk(rng, 4, step, turn)
    points = beside(rng, tips, axes, body, 250, 0.4)
    made = leaning_depths(points, tips, axes, body, MARGIN)
    coarse, between, fine = slow(points, tips, axes, body)
    seen = made < UNTOUCHED
    assert seen.all()  # each lies within 0.4 mm of some pose, or in it
    assert (made <= coarse + TOLERANCE).all()  # never more than any pose the twin has
    assert (made >= coarse - between).all()  # and never less than there is
    np.testing.assert_allclose(made, fine, atol=2 * TOLERANCE)
    assert (made < -0.05).sum() > 20
    if step <= 1.5 and turn < 0.5:
        assert (made > 0.02).sum() > 10


@each_body
def test_only_samples_within_the_margin_are_measured(body):
    rng = np.random.default_rng(5)
    tips, axes = walk(rng, 5, 1.0, 0.05)
    points = np.vstack([beside(rng, tips, axes, body, 200, 1.5), rng.uniform(-30, 30, (500, 3))])
    far = leaning_depths(points, tips, axes, body, 100.0)
    assert (far < UNTOUCHED).all()
    for margin in (0.05, 0.5, 1.0):
        made = leaning_depths(points, tips, axes, body, margin)
        sure = np.abs(far - margin) > 2 * TOLERANCE
        np.testing.assert_array_equal((made < UNTOUCHED)[sure], (far < margin)[sure])
        np.testing.assert_allclose(made[sure & (far < margin)], far[sure & (far < margin)], atol=TOLERANCE)
    np.testing.assert_allclose(leaning_depths(points, tips, axes, body, np.inf), far, atol=TOLERANCE)


def test_a_ball_that_stands_upright_leaves_what_the_upright_kernel_says():
    rng, body = np.random.default_rng(1), ball(3.0)
    tips = np.cumsum(rng.normal(size=(8, 3)) * [1.5, 1.5, 0.3], axis=0)
    tips[:, 2] = np.rint(tips[:, 2] * PER_MM) / PER_MM  # as a program has them
    axes = np.tile([0.0, 0.0, 1.0], (8, 1))
    points = beside(rng, tips, axes, body, 3000, 0.3)
    points = points[points[:, 2] < tips[:, 2].min() + body.flute_length]  # the upright one is endless upwards
    upright = ResidualMap(points, np.tile([1.0, 0.0, 0.0], (len(points), 1)), margin=MARGIN)
    upright.cut(tips, body)
    leaning = leaning_depths(points, tips, axes, body, MARGIN)
    free = upright.residual > 0.0  # what is cut is not measured on there
    assert free.sum() > 200 and (upright.residual[free] < MARGIN).sum() > 200
    np.testing.assert_allclose(leaning[free], upright.residual[free], atol=TOLERANCE + ROUNDING)
    assert (leaning[~free] <= TOLERANCE).all()


@each_body
def test_moving_everything_alike_changes_nothing(body):
    rng = np.random.default_rng(7)
    tips, axes = walk(rng, 5, 1.0, 0.08)
    points = beside(rng, tips, axes, body, 400, 0.4)
    before = leaning_depths(points, tips, axes, body, MARGIN)
    for _ in range(4):
        turn, way = rotation(rng), rng.uniform(-100, 100, 3)
        after = leaning_depths(points @ turn.T + way, tips @ turn.T + way, axes @ turn.T, body, MARGIN)
        np.testing.assert_allclose(after, before, atol=TOLERANCE + ROUNDING)


@each_body
@pytest.mark.parametrize("share", [0.5, 0.137])
def test_a_move_in_two_is_the_same_move_and_so_is_the_way_back(body, share):
    rng = np.random.default_rng(11)
    tips, axes = walk(rng, 4, 1.5, 0.1)
    points = beside(rng, tips, axes, body, 400, 0.4)
    whole = leaning_depths(points, tips, axes, body, MARGIN)
    more_tips, more_axes = [tips[0]], [axes[0]]
    for k in range(3):
        tip, axis = pose((tips[k], axes[k]), (tips[k + 1], axes[k + 1]), share)
        more_tips += [tip, tips[k + 1]]
        more_axes += [axis, axes[k + 1]]
    split = leaning_depths(points, np.array(more_tips), np.array(more_axes), body, MARGIN)
    np.testing.assert_allclose(split, whole, atol=TOLERANCE + ROUNDING)
    np.testing.assert_allclose(leaning_depths(points, tips[::-1], axes[::-1], body, MARGIN), whole, atol=TOLERANCE)


@pytest.mark.parametrize("body", [ball(6.0), tool(6.0, 1.0)], ids=lambda b: b.kind)
def test_a_swing_about_the_tip_leaves_the_two_sides_of_a_sector(body):
    """The flank goes through a plate as thick as the tool; off its middle by y there is |y| - R, however far along."""
    rng = np.random.default_rng(13)
    tip, n = np.array([[4.0, -2.0, 1.0]]), 500
    angle = np.linspace(-0.2, 0.3, 7)
    axes = np.column_stack([np.sin(angle), np.zeros(7), np.cos(angle)])
    y = rng.uniform(0.0, body.radius + 0.3, n) * rng.choice([-1, 1], n)
    far, at = rng.uniform(body.radius, body.flute_length - body.radius, n), rng.uniform(-0.2, 0.3, n)
    points = tip + np.column_stack([far * np.sin(at), y, far * np.cos(at)])
    made = leaning_depths(points, np.repeat(tip, 7, axis=0), axes, body, MARGIN)
    np.testing.assert_allclose(made, np.abs(y) - body.radius, atol=TOLERANCE + ROUNDING)


def leaned_wall(lean, length=30.0, height=9.0, pitch=0.5):
    """Samples (n, 3) of a plane that leans by an angle (rad) to +y, its unit normal, and the way up on it."""
    up, normal = np.array([0.0, -np.sin(lean), np.cos(lean)]), np.array([0.0, np.cos(lean), np.sin(lean)])
    x, s = np.meshgrid(np.arange(0.0, length, pitch), np.arange(0.0, height, pitch))
    return x.reshape(-1, 1) * [1.0, 0.0, 0.0] + s.reshape(-1, 1) * up, normal, up


@each_body
@pytest.mark.parametrize("lean", [0.0, 0.15, -0.15, 0.7])
@pytest.mark.parametrize("off", [0.0, 0.013, -0.05])
def test_a_flank_leaned_with_a_plane_leaves_as_much_all_over_it(body, lean, off):
    """R + off from the plane it leaves off everywhere its flank comes by; that is a gouge where off is below 0."""
    points, normal, up = leaned_wall(lean, height=body.flute_length - body.corner_radius - 0.4)
    tips = (body.radius + off) * normal - (body.corner_radius + 0.2) * up + np.array([[-1.0, 0, 0], [31.0, 0, 0]])
    fine = np.linspace(tips[0], tips[1], 40)
    for way in (tips, fine):
        made = leaning_depths(points, way, np.tile(up, (len(way), 1)), body, MARGIN)
        np.testing.assert_allclose(made, off, atol=TOLERANCE)
    sample_map = ResidualMap(points, np.tile(normal, (len(points), 1)))
    sample_map.cut_leaning(tips, np.tile(up, (2, 1)), body)
    np.testing.assert_allclose(sample_map.residual, off, atol=TOLERANCE)
    sample_map.cut_leaning(tips - 0.03 * normal, np.tile(up, (2, 1)), body)  # what is cut already goes on down
    np.testing.assert_allclose(sample_map.residual, off - 0.03, atol=TOLERANCE)


def test_a_gouge_has_its_depth_under_the_nearest_surface():
    axis = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    side = np.array([0.0, 1.0, 0.0])
    tip = np.array([[1.0, 2.0, 3.0]])
    for body in BODIES:
        high = 0.5 * body.flute_length
        points = tip + np.array([high * axis + (body.radius - 0.2) * side, high * axis,  # under the flank; on the axis
                                 0.15 * axis, (body.flute_length - 0.1) * axis])  # over the tip; under the end
        made = leaning_depths(points, tip, axis[None], body, MARGIN)
        np.testing.assert_allclose(made, [-0.2, -body.radius, -0.15, -0.1], atol=ROUNDING)


def test_a_map_is_lowered_by_one_pass_after_another():
    rng, body = np.random.default_rng(17), ball(6.0)
    points, normal, up = leaned_wall(0.2)
    made = ResidualMap(points, np.tile(normal, (len(points), 1)), margin=0.1)
    least = np.full(len(points), UNTOUCHED)
    for high in (1.0, 3.0, 5.0, 7.0):
        n = 12
        tips = (np.linspace([0.0, 0, 0], [30.0, 0, 0], n) + high * up + (body.radius - 0.02) * normal
                - body.radius * np.array([0.0, 0.0, 1.0]) + rng.normal(size=(n, 3)) * 0.01)
        lean = rng.uniform(0.0, 0.05, n)
        axes = np.column_stack([np.zeros(n), np.sin(lean), np.cos(lean)])
        before = made.residual.copy()
        made.cut_leaning(tips, axes, body)
        assert (made.residual <= before).all()
        least = np.minimum(least, leaning_depths(points, tips, axes, body, 0.1))
        np.testing.assert_allclose(made.residual, least, atol=TOLERANCE)
    assert (made.residual < 0.0).sum() > 10  # what is cut is measured on
    assert (made.residual == UNTOUCHED).sum() > 10


def test_nothing_to_measure_and_nothing_to_walk():
    none = np.zeros((0, 3))
    up = np.array([[0.0, 0.0, 1.0]])
    assert leaning_depths(none, up, up, ball(4.0), 1.0).shape == (0,)
    assert leaning_depths(up, none, none, ball(4.0), 1.0).tolist() == [UNTOUCHED]
    assert leaning_depths(up, np.zeros((1, 3)), up, ball(4.0), 1.0).tolist() == [-1.0]


@pytest.mark.parametrize("second", [[0.0, 0, -1], [1.0, 0, 0], [0.0, 0, 1.1], [0.0, 0, np.nan]])
def test_axes_that_say_no_turn_are_refused(second):
    axes = np.array([[0.0, 0.0, 1.0], second])
    with pytest.raises(GeometryError) as error:
        leaning_depths(np.zeros((1, 3)), np.array([[0.0, 0, 0], [1.0, 2, 3]]), axes, ball(4.0), 1.0)
    assert error.value.code == "bad_axis" and error.value.subjects == ("(1.000, 2.000, 3.000)",)
