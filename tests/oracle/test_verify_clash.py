"""Bodies of tools that lean or turn against slow twins: every touch found, none invented, as deep as it is."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.oracle.turning_twin import random_moves, seen, signed
from verify.kernels.clash import TOUCHING, is_lift
from verify.kernels.frustum import Frustum, contact
from verify.kernels.stock import CUTTER, FIXTURE, HOLDER, NECK, ROUNDING, SHANK
from verify.material.collision import FIXTURE_SPACING, MAX_FIXTURE_POINTS, fixture_points, run_clashes
from verify.material.fixture_contact import fixture_contacts
from verify.material.stock_pass import BESIDE, rapid_arrays
from verify.model import ProofSetup
from verify.moves import BOW, Moves
from verify.tool_axes import ToolAxes
from verify.tool_bodies import Bodies

TOOL = ToolBody("T1", 1, 4.0, 2.0, 5.0, 3.6, 9.0, 5.0, 14.0, (HolderFrustum(10.0, 14.0, 5.0),))
BULL = replace(TOOL, diameter=5.0, corner_radius=1.0, neck_diameter=5.0)
SETUP = ProofSetup(gouge_tolerance=0.01, clearance_rapid=1.0)
STEPS = np.linspace(0.0, 1.0, 4001)


def frustum_depths(rho, h, body, off):
    """How deep points are in a standing frustum grown by ``off`` mm all round: aside, and aside or down."""
    z0, z1, r0, r1 = body
    inside = (h > z0 - off) & (h < z1 + off)
    aside = r0 + (r1 - r0) * (h - z0) / (z1 - z0) - rho + off
    return (np.where(inside, aside, -np.inf).max(axis=-1),
            np.where(inside, np.minimum(aside, h - z0 + off), -np.inf).max(axis=-1))


def body_depth(rho, h, row, grow, slack, off):
    """What an event says of points (n, k) seen along a move; 0 where there is none."""
    z0, z1, r0, r1, clearance, _ = row
    near, _ = frustum_depths(rho, h, (z0, z1, r0 + grow, r1 + grow), off)
    _, bare = frustum_depths(rho, h, (z0, z1, r0 - clearance, r1 - clearance), off)
    wide = clearance + grow
    return np.where(near <= slack, 0.0, np.where(bare > slack, wide + bare, np.minimum(near, wide)))


def cutter_depth(rho, h, tool, grow, slack, off):
    """The same for the cutting part; how near it comes is how much wider it would have to be."""
    def deep(row, wider):
        return -signed(rho[row], h[row], replace(tool, diameter=tool.diameter + 2.0 * wider)).min() + off

    out = np.zeros(len(rho))
    for row, s in enumerate(np.broadcast_to(slack, len(rho)).tolist()):
        if deep(row, 0.0) > s:
            out[row] = grow + deep(row, 0.0)
        elif grow > 0.0 and deep(row, grow) > s:
            free, hits = 0.0, grow
            for _ in range(20):
                wider = 0.5 * (free + hits)
                free, hits = (free, wider) if deep(row, wider) > s else (wider, hits)
            out[row] = grow - max(hits - s, 0.0)
    return out


@pytest.mark.parametrize("off", [0.0, 0.06, 0.125, 0.19])
@pytest.mark.parametrize("angle", [0.0, 3.0, 30.0, 45.0])
def test_a_rim_over_a_thin_neck_is_met_by_a_fixture(angle, off):
    """The rim of a cone or a disc goes along the side of a fixture 0.2 mm deep."""
    deep, flutes = 0.2, 3.0 if angle else 0.1
    mill = ToolBody("T1", 1, 6.0, 0.0, flutes, 4.0, 20.0, 4.0, 25.0, taper=np.tan(np.radians(angle)))
    y, low = -5.0 + mill.widest_radius - deep, 1.6 - flutes
    way = Moves(np.array([[-20.0, y, low]]), np.array([[20.0, y, low]]), np.array([True]), np.array([0]))
    setup = replace(SETUP, fixtures=(np.array([[-2.0, -9.0, 0.5 + off], [2.0, -5.0, 3.0 + off]]),))
    part = np.array([[0.0, 0.0, 0.6], [9.0, 9.0, 9.0]])
    events = fixture_contacts(way, [mill], setup, part, rapid_arrays(way, setup))
    assert abs(events[events[:, 1] == FIXTURE, 2].max() - deep) < 1e-3


def apart(rho, h, z0, z1, r0, r1):
    """Distance of points to a standing frustum, as the least of those to its three sides; 0 inside."""
    out = np.full(rho.shape, np.inf)
    for a, b in (((0, z0), (r0, z0)), ((r0, z0), (r1, z1)), ((r1, z1), (0, z1))):
        d = np.subtract(b, a)
        s = np.clip(((rho - a[0]) * d[0] + (h - a[1]) * d[1]) / max(d @ d, 1e-30), 0.0, 1.0)
        out = np.minimum(out, np.hypot(rho - a[0] - s * d[0], h - a[1] - s * d[1]))
    return np.where((h >= z0) & (h <= z1) & (rho <= r0 + (r1 - r0) * (h - z0) / (z1 - z0)), 0.0, out)


def near_depth(gap, room, clearance, off):
    """How much nearer than the room of a rapid, as an event of ``clearance`` counts it."""
    gap = gap.min(axis=-1) - off
    return np.where(gap < room - ROUNDING, clearance - np.maximum(gap, 0.0), 0.0)


def twin(points, fixed, moves, tool, setup, off):
    """{(move, code): depth} of standing tools at 4001 places of every move, grown by ``off`` mm all round."""
    rows, out = Bodies.of([tool], setup).rows, {}
    for m in range(len(moves)):
        rho, h = seen(points[:, None, :], moves, m, np.broadcast_to(STEPS, (len(points), len(STEPS))))
        feed = bool(moves.feed[m])
        d, axis = moves.end[m] - moves.start[m], moves.axes.axis[m]
        lift = not feed and moves.axes.angle[m] == 0 and d @ axis > 0 and np.linalg.norm(np.cross(d, axis)) < 1e-6
        grow = 0.0 if feed or lift else setup.clearance_rapid
        found = []
        if not feed or fixed.any():
            slack = np.where(fixed, TOUCHING, setup.gouge_tolerance)
            depth = cutter_depth(rho, h, tool, grow, slack, off)
            depth = np.maximum(depth, near_depth(signed(rho, h, tool), grow, grow, off))
            found.append((CUTTER, np.where(fixed | (not feed), depth, 0.0)))
        for row in rows:
            beside = max(row[2], row[3]) <= tool.radius + 1e-9
            slack = np.where(fixed | (not beside), TOUCHING, BESIDE)
            extra = 0.0 if feed else -row[4] if lift else grow - min(grow, row[4])
            gap = apart(rho, h, row[0], row[1], row[2] - row[4], row[3] - row[4])
            found.append((int(row[5]), np.maximum(body_depth(rho, h, row, extra, slack, off),
                                                  near_depth(gap, grow, row[4] + extra, off))))
        for code, depth in found:
            for held in (False, True):
                worst = float(depth[fixed == held].max(initial=0.0))
                if worst > 0.0:
                    key = (m, code + (FIXTURE if held else 0))
                    out[key] = max(out.get(key, 0.0), worst)
    return out


def events_of(events):
    out = {}
    for row in events:
        key = (int(row[0]), int(row[1]))
        out[key] = max(out.get(key, 0.0), float(row[2]))
    return out


def check(points, fixed, moves, tool, setup):
    """Deeper than a tool smaller by ``BOW`` all round would be and less deep than one larger by it; returns codes."""
    events, lost = run_clashes(points, fixed, moves, [tool], setup)
    assert lost == 0
    got = events_of(events)
    # the twin steps along the move: a few micrometres, where a body passes a point at speed
    least, most = twin(points, fixed, moves, tool, setup, -BOW), twin(points, fixed, moves, tool, setup, BOW + 1e-3)
    assert set(least) <= set(got) <= set(most)
    for key, depth in got.items():
        assert least.get(key, 0.0) - 1e-3 <= depth <= most[key] + 1e-3, key
    return {code for _, code in got}


@pytest.mark.parametrize("tool", [TOOL, BULL], ids=["ball", "bull"])
@pytest.mark.parametrize("seed", range(3))
def test_touches_are_those_of_many_standing_tools(tool, seed):
    rng = np.random.default_rng(seed)
    moves = random_moves(rng, 24, length=5.0, still=seed == 2)
    moves = Moves(moves.start, moves.end, rng.random(24) < 0.5, moves.tool, moves.axes)
    points = rng.uniform([-14, -14, -3], [14, 14, 20], (60, 3))
    fixed = rng.random(60) < 0.3
    codes = check(points, fixed, moves, tool, SETUP)
    assert {SHANK, HOLDER, SHANK + FIXTURE, HOLDER + FIXTURE} <= codes and codes & {CUTTER, CUTTER + FIXTURE}


def test_grazing_touches_keep_their_depth():
    """Points placed 0 to 0.3 mm inside the clearance or the body of a turning holder, where events are shallow."""
    rng = np.random.default_rng(11)
    moves = random_moves(rng, 12, length=4.0)
    points = []
    for m in range(12):
        s = rng.uniform(0, 1, 4)
        for share in s:
            phi = share * moves.axes.angle[m]
            z = np.cos(phi) * moves.axes.axis[m] + np.sin(phi) * np.cross(moves.axes.about[m], moves.axes.axis[m])
            aside = np.cross(z, rng.normal(size=3))
            aside /= np.linalg.norm(aside)
            tip = moves.start[m] + share * (moves.end[m] - moves.start[m])
            radius = rng.choice([1.8, 2.5, 5.0])
            height = {1.8: 7.0, 2.5: 11.0, 5.0: 14.2}[radius]
            points.append(tip + height * z + (radius + rng.uniform(-0.3, 1.0)) * aside)
    points = np.array(points)
    codes = check(points, np.zeros(len(points), bool), moves, TOOL, SETUP)
    assert {NECK, SHANK, HOLDER} <= codes


def test_a_straight_lift_leaves_the_place_it_stands_in_and_a_slanting_one_does_not():
    lean = np.array([0.0, 0.6, 0.8])
    axes = ToolAxes.between(np.tile(lean, (3, 1)), np.tile(lean, (3, 1)))
    ends = np.array([6.0 * lean, 6.0 * lean + [0.5, 0, 0], -6.0 * lean])
    assert [is_lift(0.0, lean, np.zeros(3), e) for e in ends] == [True, False, False]
    assert not is_lift(0.1, lean, np.zeros(3), ends[0])
    aside = np.array([1.0, 0.0, 0.0])
    points = 3.0 * lean + (2.0 + 0.5) * aside[None, :]  # half a millimetre beside the cutting part
    moves = Moves(np.zeros((3, 3)), ends, np.zeros(3, bool), np.zeros(3, np.int32), axes)
    check(points, np.zeros(1, bool), moves, TOOL, SETUP)
    got = events_of(run_clashes(points, np.zeros(1, bool), moves, [TOOL], SETUP)[0])
    assert (0, CUTTER) not in got and (1, CUTTER) in got and (2, CUTTER) in got


@pytest.mark.parametrize("grow", [0.0, 0.8])
def test_the_depth_in_one_body_is_the_deepest_of_many_places(grow):
    rng, met = np.random.default_rng(3), 0
    s = np.linspace(0, 1, 20_001)
    for case in range(300):
        body = np.array([2.0, 6.0, 3.0 + 0.3, 3.0 + 1.5 * (case % 2) + 0.3, 0.3, SHANK])
        d = rng.normal(size=3) * np.array([[2, 2, 2], [2, 2, 0], [0, 0, 2], [0, 0, 0]][case % 4])
        q = rng.uniform([-5, -5, 0], [5, 5, 8])
        grown = Frustum(2.0, 6.0, body[2] + grow, body[3] + grow)
        got = contact(*q, *d, grown, body[4] + grow, TOUCHING, 0.0, False)
        w = q - s[:, None] * d
        rho, h = np.hypot(w[:, 0], w[:, 1])[None], w[:, 2][None]
        least, most = (float(body_depth(rho, h, body, grow, TOUCHING, off)[0]) for off in (-1e-6, 1e-3))
        assert least - 1e-3 <= got <= most + 1e-3 and (got > 0) <= (most > 0) and (least > 0) <= (got > 0)
        met += got > 0
    assert met > 60


def test_threads_and_empty_inputs():
    rng = np.random.default_rng(5)
    moves = random_moves(rng, 30, length=6.0)
    points = rng.uniform(-12, 12, (9000, 3))
    fixed = np.zeros(9000, bool)
    one, two = (run_clashes(points, fixed, moves, [TOOL], SETUP, threads=n)[0] for n in (1, 2))
    assert len(one) > 0 and one.tobytes() == two.tobytes()
    nothing = run_clashes(points[:0], fixed[:0], moves, [TOOL], SETUP)
    assert len(nothing[0]) == 0 and nothing[1] == 0
    assert len(run_clashes(points, fixed, moves.only(np.zeros(30, bool)), [TOOL], SETUP)[0]) == 0


def test_upright_moves_are_those_of_an_axis_along_z():
    rng = np.random.default_rng(6)
    plain = random_moves(rng, 20)
    up = Moves(plain.start, plain.end, plain.feed, plain.tool, None)
    posed = Moves(plain.start, plain.end, plain.feed, plain.tool, ToolAxes.upright(20))
    points, fixed = rng.uniform(-6, 14, (500, 3)), rng.random(500) < 0.5
    a, b = (run_clashes(points, fixed, m, [TOOL], SETUP)[0] for m in (up, posed))
    assert len(a) > 0 and a.tobytes() == b.tobytes()


def near_all(boxes, lower=(-50.0, -50, -50), upper=(500.0, 400, 200)):
    """Points of fixtures with a move of the tool that goes everywhere."""
    moves = Moves(np.array([lower]), np.array([upper]), np.array([True]), np.zeros(1, np.int32))
    bounds = np.array([[0.0, 0, -4], [10, 10, 10]])
    return fixture_points(replace(SETUP, fixtures=tuple(boxes)), bounds, moves, [TOOL])


def test_points_of_fixtures_cover_tops_sides_and_undersides():
    boxes = [np.array([[0.0, 0, 2], [10, 4, 5]]), np.array([[-3.0, -3, -8], [-1, 9, 1]])]
    points = near_all(boxes)
    for box, floor in zip(boxes, (-4.0, -8.0), strict=True):
        low, high = np.array([*box[0, :2], floor]), box[1]
        own = points[((points >= low - 1e-9) & (points <= high + 1e-9)).all(axis=1)]
        on = np.isclose(own, low) | np.isclose(own, high)
        on[:, 2] = np.isclose(own[:, 2], high[2]) | np.isclose(own[:, 2], box[0, 2])
        assert len(own) and on.any(axis=1).all()
        rng = np.random.default_rng(2)
        for axis, value in ((2, high[2]), (2, box[0, 2]), (0, low[0]), (0, high[0]), (1, low[1]), (1, high[1])):
            ask = rng.uniform(low, high, (300, 3))
            ask[:, axis] = value
            apart = np.linalg.norm(ask[:, None, :] - own, axis=2).min(axis=1)
            assert apart.max() <= FIXTURE_SPACING * np.sqrt(0.5) + 1e-9
    assert near_all([]).shape == (0, 3)


@pytest.mark.parametrize("radius", [0.15, 2.0])
def test_no_ball_dips_far_between_the_points_of_a_fixture(radius):
    box = np.array([[0.0, 0, 0], [20.0, 20.0, 5.0]])
    moves = Moves(np.zeros((1, 3)), np.full((1, 3), 20.0), np.array([True]), np.zeros(1, np.int32))
    tool = replace(TOOL, diameter=2.0 * radius, corner_radius=radius)
    points = fixture_points(replace(SETUP, fixtures=(box,)), np.array([[0.0, 0, 0], [9, 9, 9]]), moves, [tool])
    middle = np.append(np.random.default_rng(4).uniform(6.0, 14.0, 2), 5.0)
    near = points[(np.abs(points - middle) < 3.0).all(axis=1) & (points[:, 2] > 5.0 - 1e-9)]
    dip = []
    for at in middle[:2] + np.random.default_rng(5).uniform(-2.0, 2.0, (4000, 2)):
        d2 = ((near[:, :2] - at) ** 2).sum(axis=1).min()
        dip.append(radius - max(radius**2 - d2, 0.0) ** 0.5)
    assert max(dip) <= 0.005 + 1e-12


def test_many_fixture_points_are_thinned_and_what_no_tool_comes_near_is_left_out():
    big = [np.array([[0.0, 0, 0], [400, 300, 100]])]
    assert 0.5 * MAX_FIXTURE_POINTS < len(near_all(big)) < 1.1 * MAX_FIXTURE_POINTS
    here = near_all(big, (10.0, 10, 95), (20.0, 20, 110))
    assert len(here) < 0.2 * MAX_FIXTURE_POINTS and here[:, 0].max() < 60 and here[:, 2].max() == 100
    assert near_all(big, (10.0, 10, 105), (20.0, 20, 110)).shape == (0, 3)



@pytest.mark.parametrize("seed", range(2))
def test_rapids_that_stray_keep_as_much_more_free_however_far_the_place_is(seed):
    rng, steps = np.random.default_rng(seed), np.linspace(0.0, 1.0, 601)
    plain = random_moves(rng, 10, length=5.0)
    stray = np.repeat([0.0, 6.0, 80.0], (2, 4, 4))
    moves = Moves(plain.start, plain.end, np.zeros(10, bool), plain.tool, plain.axes, stray)
    points = rng.uniform(-70.0, 70.0, (300, 3))
    points = points[(np.linalg.norm(points[:, :2], axis=1) > 25.0) | (points[:, 2] < -12.0)]
    fixed = rng.random(len(points)) < 0.3
    got = {}
    for row in run_clashes(points, fixed, moves, [TOOL], SETUP)[0]:
        key = (int(row[0]), int(row[1]))
        got[key] = max(got.get(key, 0.0), row[2] - row[3] + SETUP.clearance_rapid + stray[int(row[0])])
    count = 0
    for m in range(10):
        rho, h = seen(points[:, None, :], moves, m, np.broadcast_to(steps, (len(points), len(steps))))
        gaps = {CUTTER: signed(rho, h, TOOL)}
        for row in Bodies.of([TOOL], SETUP).rows:
            gap = apart(rho, h, row[0], row[1], row[2] - row[4], row[3] - row[4])
            gaps[int(row[5])] = np.minimum(gaps.get(int(row[5]), np.inf), gap)
        for code, gap in gaps.items():
            for held in (False, True):
                want = SETUP.clearance_rapid + stray[m] - gap.min(axis=1)[fixed == held].min()
                assert got.get((m, code + FIXTURE * held), 0.0) == pytest.approx(max(want, 0.0), abs=0.02)
                count += want > 0.0
    assert count > 20


def test_a_place_beyond_the_reach_of_the_tool_is_within_its_stray():
    z = np.array([[0.0, 0.0, 1.0]])
    moves = Moves(np.zeros((1, 3)), np.array([[0.0, 3.0, 0.0]]), np.zeros(1, bool), np.zeros(1, np.int32),
                  ToolAxes.between(z, z), np.array([70.0]))
    events, _ = run_clashes(np.array([[62.0, 1.0, 2.5]]), np.zeros(1, bool), moves, [TOOL], SETUP)
    assert events[events[:, 1] == CUTTER, 2] == pytest.approx([71.0 - 60.0])
