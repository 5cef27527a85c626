"""Tools that lean or turn against slow twins: chords of poses, carried cutting parts, rays, nested balls of points."""

import itertools

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from tests.machined_cases import mill
from tests.oracle.turning_twin import least_left, random_moves, random_rays, seen, signed
from verify.kernels.pose import MAX_ANGLE, PIECE, fill_piece, near_segment2, pieces, turned, view
from verify.kernels.profile import FINE, carried, standing
from verify.material.point_tree import CHUNK, PointTree, curve_keys
from verify.moves import BOW, Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes, square_to

TOOLS = {"ball": mill(4.0, 2.0, 7.0), "flat": mill(5.0, 0.0, 8.0), "bull": mill(6.0, 1.0, 8.0)}


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def seen_exactly(p, a, b, axis, about, angle, s):
    """Where a turning tool sees a point (3,) at shares s (k,) of its move."""
    phi = (s * angle)[:, None]
    z = np.cos(phi) * axis + np.sin(phi) * np.cross(about, axis)
    off = p - (a + s[:, None] * (b - a))
    return np.stack([off @ about, (off * np.cross(z, about)).sum(1), (off * z).sum(1)], 1)


@pytest.mark.parametrize("seed", range(4))
def test_points_stay_within_the_bow_of_their_chords(seed):
    rng = np.random.default_rng(seed)
    piece, inner = np.empty(PIECE), np.linspace(0, 1, 33)
    for _ in range(60):
        axis = unit(rng.normal(size=3))
        about = unit(np.cross(axis, rng.normal(size=3)))
        angle = float(rng.choice([0.0, 1e-6, rng.uniform(0, 0.2), rng.uniform(0, 3.1)]))
        a, b = rng.uniform(-20, 20, (2, 3))
        reach, bow = rng.uniform(1, 120), float(rng.choice([5e-4, 0.01]))
        n = pieces(angle, float(np.linalg.norm(b - a)), reach, bow)
        assert (n == 1) if angle == 0.0 else angle / n <= MAX_ANGLE
        for k in sorted({0, n // 2, n - 1}):
            fill_piece(piece, a, b, axis, about, angle, k, n)
            s = (k + inner) / n
            for _ in range(3):
                # "within reach" is of the tip, wherever on the piece that is
                tip = a + rng.choice(s) * (b - a)
                p = tip + unit(rng.normal(size=3)) * rng.uniform(0, reach)
                q = np.array(view(piece, *p))
                chord = q[:3] - inner[:, None] * q[3:]
                assert np.linalg.norm(chord - seen_exactly(p, a, b, axis, about, angle, s), axis=1).max() <= \
                    bow * (1.0 + 2.0 * float(np.linalg.norm(b - a)) / n / reach) + 1e-9
            d = unit(rng.normal(size=3))
            half = seen_exactly(d, np.zeros(3), np.zeros(3), axis, about, angle, np.array([(k + 0.5) / n]))[0]
            np.testing.assert_allclose(turned(piece, *d), half, atol=1e-12)


def test_pieces_follow_each_other_and_end_where_the_move_ends():
    rng = np.random.default_rng(9)
    a, b = rng.normal(size=(2, 3))
    axes = ToolAxes.between(unit(rng.normal(size=(1, 3))), unit(rng.normal(size=(1, 3))))
    made = np.empty((7, PIECE))
    for k in range(7):
        fill_piece(made[k], a, b, axes.axis[0], axes.about[0], axes.angle[0], k, 7)
    for one, after in itertools.pairwise(made):
        np.testing.assert_allclose(one[9:18], after[0:9], atol=1e-12)
    assert (made[0, :3] == a).all() and (made[-1, 9:12] == b).all()
    for k in range(7):
        frame = np.stack([made[k, 18:21], made[k, 3:6], made[k, 6:9]])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)


def test_near_segment_is_the_least_of_many_places():
    rng = np.random.default_rng(4)
    for _ in range(100):
        p, a, b = rng.normal(size=(3, 3))
        b = a if rng.random() < 0.1 else b
        want = ((a + np.linspace(0, 1, 20001)[:, None] * (b - a) - p) ** 2).sum(1).min()
        assert near_segment2(*p, a, b) == pytest.approx(want, abs=1e-7)


def test_axes_run_along_great_circles():
    rng = np.random.default_rng(5)
    start, end = unit(rng.normal(size=(2, 500, 3)))
    end[:20] = start[:20]
    end[20:30] = -start[20:30]
    axes = ToolAxes.between(start, end)
    assert (axes.angle[:20] == 0.0).all() and np.abs(axes.angle[20:30] - np.pi).max() < 1e-7
    np.testing.assert_allclose(np.einsum("ij,ij->i", axes.axis, axes.about), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(axes.about, axis=1), 1.0, atol=1e-12)
    phi = axes.angle[:, None]
    there = np.cos(phi) * axes.axis + np.sin(phi) * np.cross(axes.about, axes.axis)
    np.testing.assert_allclose(there, end, atol=1e-9)
    np.testing.assert_allclose(axes.middle[30:], unit(start[30:] + end[30:]), atol=1e-9)
    np.testing.assert_array_equal(axes.only(np.arange(500) == 7).axis, start[7:8])
    up = ToolAxes.upright(3)
    assert up.axis.tolist() == [[0, 0, 1]] * 3 and (up.angle == 0).all()
    np.testing.assert_allclose(np.einsum("ij,ij->i", square_to(start), start), 0.0, atol=1e-12)
    np.testing.assert_array_equal(square_to(np.array([[0.0, 0.0, 1.0]])), [[1, 0, 0]])


@pytest.mark.parametrize("kind", TOOLS)
def test_a_standing_cutting_part_is_as_far_as_its_profile(kind):
    """Twin: the nearest of many points of the profile; the flutes' end is left out of places beyond it."""
    tool, rng = TOOLS[kind], np.random.default_rng(6)
    flat, corner, length = tool.radius - tool.corner_radius, tool.corner_radius, tool.flute_length
    arc = np.linspace(0, np.pi / 2, 2001)
    up = np.linspace(corner, length, 4001)
    line = np.concatenate([np.stack([np.linspace(0, flat, 2001), np.zeros(2001)], 1),
                           np.stack([flat + corner * np.sin(arc), corner - corner * np.cos(arc)], 1),
                           np.stack([np.full(4001, tool.radius), up], 1),
                           np.stack([np.linspace(0, tool.radius, 2001), np.full(2001, length)], 1)])
    for rho, h in rng.uniform([0, -3], [5, length + 3], (400, 2)):
        got = standing(rho, h, CutterSizes(flat + corner, corner, length))
        want = np.linalg.norm(line - [rho, h], axis=1).min()
        assert got == pytest.approx(float(signed(np.array(rho), np.array(h), tool)), abs=1e-12)
        if h > length:
            assert got <= want + 2e-3
        elif got > 0 or h > corner:
            assert abs(got) == pytest.approx(want, abs=2e-3)


@pytest.mark.parametrize("kind", TOOLS)
def test_carried_is_the_least_over_the_way(kind):
    tool, rng = TOOLS[kind], np.random.default_rng(7)
    flat, corner, length = tool.radius - tool.corner_radius, tool.corner_radius, tool.flute_length
    s = np.linspace(0, 1, 20_001)[:, None]
    for case in range(400):
        d = rng.normal(size=3) * np.array([[3, 3, 3], [3, 3, 0], [0, 0, 3], [0, 0, 0], [3, 3, 1e-3]][case % 5])
        q = rng.uniform([-6, -6, -4], [6, 6, length + 4])
        w = q - s * d
        want = signed(np.hypot(w[:, 0], w[:, 1]), w[:, 2], tool).min()
        got = carried(*q, *d, CutterSizes(flat + corner, corner, length))
        apart = float(np.linalg.norm(d)) / 20_000  # between two places of the twin
        assert want - apart - 1e-12 <= got <= want + FINE


@pytest.mark.parametrize("kind", TOOLS)
def test_rays_meet_turning_tools_within_the_bow(kind):
    """No later than a cutting part smaller by ``bow`` all round is met, and no sooner than one larger by it."""
    tool, rng = TOOLS[kind], np.random.default_rng(8)
    moves = random_moves(rng, 4)
    p, normal = random_rays(moves, tool, 40, rng)
    slanting = unit(normal + 0.7 * rng.normal(size=p.shape))
    for bow, n in ((BOW, normal), (BOW, slanting), (0.02, normal)):
        left, mover = residual_on_normals(p, n, np.full(len(p), 3.0), moves, [tool], bow=bow)
        least, most = (least_left(p, n, moves, tool, 3.0, level, 41) for level in (bow, -bow))
        assert (left >= least - 1e-4).all() and (left <= most + 1e-4).all()
        assert ((mover >= 0) == (left < 3.0)).all() and (mover >= 0).sum() > 10


def test_what_stands_still_agrees_with_the_kernel_of_upright_tools():
    rng = np.random.default_rng(12)
    walk = rng.uniform(-6, 6, (200, 3)) * [1, 1, 0.3]
    p, n = rng.uniform(-6, 6, (9000, 3)) * [1, 1, 0.3], unit(rng.normal(size=(9000, 3)))
    plain = Moves(walk[:-1], walk[1:], rng.random(199) > 0.2, np.zeros(199, np.int32))
    posed = Moves(plain.start, plain.end, plain.feed, plain.tool, ToolAxes.upright(199))
    for tool in TOOLS.values():
        want, who = residual_on_normals(p, n, np.ones(9000), plain, [tool])
        got, other = residual_on_normals(p, n, np.ones(9000), posed, [tool])
        np.testing.assert_allclose(got, want, atol=1e-9)
        assert (who == other).mean() > 0.999  # equals may go to another of two moves that meet


def test_threads_and_the_order_of_points_change_nothing():
    rng = np.random.default_rng(13)
    moves, tool = random_moves(rng, 40), TOOLS["bull"]
    p, n = rng.uniform(-5, 5, (2 * CHUNK + 77, 3)), unit(rng.normal(size=(2 * CHUNK + 77, 3)))
    one = residual_on_normals(p, n, np.ones(len(p)), moves, [tool], threads=1)
    two = residual_on_normals(p, n, np.ones(len(p)), moves, [tool], threads=2)
    assert one[0].tobytes() == two[0].tobytes() and one[1].tobytes() == two[1].tobytes()
    mixed = rng.permutation(len(p))
    other = residual_on_normals(p[mixed], n[mixed], np.ones(len(p)), moves, [tool])
    np.testing.assert_allclose(other[0], one[0][mixed], atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 9, CHUNK, CHUNK + 1, 3 * CHUNK - 5])
def test_nested_balls_hold_their_points(count):
    rng = np.random.default_rng(14)
    p = rng.normal(size=(count, 3)) * [5, 1, 0.0 if count == 9 else 2]
    tree = PointTree.build(p)
    assert sorted(tree.order.tolist()) == list(range(count)) and tree.chunks == -(-count // CHUNK)
    keys = curve_keys(p)[tree.order]
    assert (keys[1:] >= keys[:-1]).all()
    for level, balls in enumerate(tree.balls):
        size = 8 ** (level + 1)
        assert len(balls) == tree.chunks * CHUNK // size
        assert (balls[-(-count // size):, 3] == -1.0).all()
        for k, i in enumerate(range(0, count, size)):
            own = p[tree.order[i:i + size]]
            far = np.linalg.norm(own - balls[k, :3], axis=1).max()
            assert far == pytest.approx(balls[k, 3], abs=1e-12)
            assert balls[k, 3] <= 0.5 * np.linalg.norm(np.ptp(own, axis=0)) + 1e-12


def test_the_curve_keeps_neighbours_together():
    """Of 8 points in a row on the curve, the ball is far smaller than that of 8 points thrown together."""
    p = np.random.default_rng(15).uniform(0, 1, (CHUNK, 3))
    assert PointTree.build(p).balls[0][:, 3].mean() < 0.25 * np.sqrt(3) / 2


def test_the_twin_itself_sees_a_point_where_it_is():
    """A checker that cannot fail is none: one pose by hand."""
    lying = ToolAxes.between(np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]))
    moves = Moves(np.zeros((1, 3)), np.array([[2.0, 0.0, 0.0]]), np.ones(1, bool), np.zeros(1, np.int32), lying)
    rho, h = seen(np.array([[5.0, 3.0, 4.0]])[:, None, :], moves, 0, np.array([[0.0, 1.0]]))
    assert rho.tolist() == [[5.0, 5.0]] and h.tolist() == [[5.0, 3.0]]
