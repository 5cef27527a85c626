"""The trapezoidal map against a shapely overlay and exact slow twins, on random arrangements."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tests.noded_segments import sources_of, take_noded
from tests.oracle import arrangement_twin as twin
from zones.kernels.trapezoid import LIMIT, SUB
from zones.plan_view.snap_rounding import node_segments
from zones.plan_view.trapezoidal_map import TrapezoidMap, _hilbert, insertion_order

EVERYDAY = [(kind, seed) for kind in sorted(twin.KINDS) for seed in range(6)]
SWEEP = 1000


def check_trapezoids(plan):
    """Convex with area, at most 3 n + 1, neighbours mutual, every side of every piece covered just once."""
    x0, x1 = plan.points[plan.left, 0], plan.points[plan.right, 0]
    assert np.array_equal(plan.flat, x0 == x1) and (plan.left < plan.right).all()
    assert len(plan.top) <= 3 * len(plan.noding.pieces) + 1
    wide = ~plan.flat
    gaps = []
    for x in (x0[wide], x1[wide]):
        top, run_top = twin.scaled_height(plan, plan.top[wide], x, 1)
        low, run_low = twin.scaled_height(plan, plan.bottom[wide], x, 1)
        assert (run_top > 0).all() and (run_low > 0).all()
        gaps.append(np.array([int(a) * int(c) - int(b) * int(d) for a, c, b, d in
                              zip(top, run_low, low, run_top, strict=True)], dtype=object))
    assert (gaps[0] >= 0).all() and (gaps[1] >= 0).all() and (gaps[0] + gaps[1] > 0).all()
    for mine, theirs, side in ((2, 0, plan.top), (3, 1, plan.bottom), (0, 2, plan.top), (1, 3, plan.bottom)):
        t = np.flatnonzero(plan.neighbours[:, mine] >= 0)
        other = plan.neighbours[t, mine]
        assert np.array_equal(plan.neighbours[other, theirs], t) and np.array_equal(side[t], side[other])
        west, east = (t, other) if mine > 1 else (other, t)
        assert np.array_equal(plan.right[west], plan.left[east])
    for side in (plan.top, plan.bottom):
        rank = np.lexsort((plan.left, side))
        line, left, right = side[rank], plan.left[rank], plan.right[rank]
        follows = line[1:] == line[:-1]
        assert np.array_equal(right[:-1][follows], left[1:][follows])
        first, last = np.append(True, ~follows), np.append(~follows, True)
        lines = line[first]
        ends = np.where((lines < len(plan.noding.pieces))[:, None], plan.pieces[lines], [0, len(plan.points) - 1])
        assert np.array_equal(left[first], ends[:, 0]) and np.array_equal(right[last], ends[:, 1])
        assert len(lines) == len(plan.noding.pieces) + 1


def check_faces(plan, segments):
    """The same faces as shapely's, by area and by where random points lie."""
    faces = plan.faces()
    box = plan.points[-1] - plan.points[0]
    assert faces.doubled.sum() == 2 * box[0] * box[1] and (faces.doubled > 0).all()
    assert twin.face_areas_by_trapezoid(plan, faces) == faces.doubled.tolist()
    exact = twin.polygons_of(shapely.linestrings(plan.points[plan.pieces[:-2]].astype(float)))
    assert sorted(map(twin.doubled_area, exact)) == sorted(faces.doubled[1:].tolist())
    other = twin.overlay(segments)
    assert sorted(map(twin.doubled_area, other)) == sorted(faces.doubled[1:].tolist())  # tolerance: none
    rng = np.random.default_rng(len(segments))
    low, high = plan.points[0] * twin.GRID, plan.points[-1] * twin.GRID
    points = rng.uniform(low, high, (60, 2))
    steps = shapely.points(points / twin.GRID)
    lines = shapely.union_all(shapely.linestrings(plan.points[plan.pieces[:-2]].astype(float)))
    clear = shapely.distance(steps, lines) > 2.0 if len(plan.pieces) > 2 else np.ones(len(points), bool)
    of = faces.of_trapezoid[plan.locate(points)]
    inside = np.full(len(points), -1)
    hit, polygon = shapely.STRtree(other).query(steps, predicate="within")[:2] if len(other) else ([], [])
    inside[hit] = polygon
    seen = set(zip(inside[clear].tolist(), of[clear].tolist(), strict=True))
    assert len(seen) == len({a for a, _ in seen}) == len({b for _, b in seen})
    for a, b in seen:
        assert (b == 0) == (a == -1) and (a < 0 or twin.doubled_area(other[a]) == faces.doubled[b])


def check_look_up(plan):
    """Exactly the trapezoid of the slow twin: anywhere, on points, on walls, on pieces, a hair beside them."""
    rng = np.random.default_rng(len(plan.points))
    low, high = plan.points[0], plan.points[-1]
    anywhere = rng.integers(low * SUB - SUB, high * SUB + SUB, (40, 2))
    ends = plan.points[rng.integers(0, len(plan.points), 25)] * SUB
    walls = np.column_stack([ends[:, 0], rng.integers(low[1] * SUB, high[1] * SUB, 25)])
    middles = plan.points[plan.pieces[rng.integers(0, len(plan.pieces), 25)]].sum(axis=1) * (SUB // 2)
    places = np.vstack([anywhere, ends, walls, middles, ends + rng.integers(-1, 2, ends.shape),
                        middles + rng.integers(-1, 2, middles.shape)])
    found, depth = plan.look_up(places * (twin.GRID / SUB))
    assert np.array_equal(found, twin.naive_locate(plan, places, SUB))
    outside = ((places < low * SUB) | (places >= high * SUB)).any(axis=1)
    assert np.array_equal(found < 0, outside) and (depth[outside] == 0).all()


def check_sources(plan, segments):
    """The pieces of a segment lead from its one end to the other, nowhere farther than half a step from it."""
    noding = plan.noding
    pieces = [sources_of(plan, k) for k in range(len(noding.pieces))]
    assert all(pieces) and not sources_of(plan, len(pieces))
    hot = noding.hot
    for s, (p, q) in enumerate(np.floor(segments / twin.GRID + 0.5).astype(np.int64)):
        mine = noding.pieces[[k for k, of in enumerate(pieces) if s in of]]
        if (p == q).all():
            assert not len(mine)
            continue
        ends, times = np.unique(mine, return_counts=True)
        odd = hot[ends[times == 1]]
        assert (times <= 2).all() and sorted(odd.tolist()) == sorted([p.tolist(), q.tolist()])
        axis = int(np.argmax(np.abs(q - p)))  # distance along the other axis, at most half a step, and half again
        t = (hot[ends][:, axis] - p[axis]) / (q - p)[axis]
        off = np.abs(p + t[:, None] * (q - p) - hot[ends])
        assert (off.max(axis=1) <= 1.0).all()


def check(kind, seed):
    segments = twin.arrangement(kind, seed)
    plan = TrapezoidMap.of(segments, twin.GRID, seed=seed)
    check_trapezoids(plan)
    check_faces(plan, segments)
    check_look_up(plan)
    check_sources(plan, segments)


@pytest.mark.parametrize(("kind", "seed"), EVERYDAY)
def test_map_is_the_overlay(kind, seed):
    check(kind, seed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(twin.KINDS))
def test_map_is_the_overlay_on_a_thousand_arrangements(kind):
    for seed in range(100, 100 + -(-SWEEP // len(twin.KINDS))):
        check(kind, seed)


@pytest.mark.parametrize("kind", sorted(twin.KINDS))
def test_map_hangs_neither_on_seed_nor_on_order_nor_on_direction(kind):
    segments = twin.arrangement(kind, 50)
    one = TrapezoidMap.of(segments, twin.GRID, seed=0)
    rng = np.random.default_rng(1)
    mixed = segments[rng.permutation(len(segments))]
    back = rng.random(len(mixed)) < 0.5
    mixed[back] = mixed[back][:, ::-1]
    two = TrapezoidMap.of(mixed, twin.GRID, seed=7)
    for name in ("points", "pieces", "top", "bottom", "left", "right", "neighbours", "flat"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    a, b = one.faces(), two.faces()
    assert np.array_equal(a.of_trapezoid, b.of_trapezoid) and np.array_equal(a.doubled, b.doubled)


@pytest.mark.parametrize("kind", sorted(twin.KINDS))
def test_a_quarter_turn_keeps_the_faces(kind):
    segments = twin.arrangement(kind, 51)
    plan = TrapezoidMap.of(segments, twin.GRID)
    pieces = plan.points[plan.pieces[:-2]] * twin.GRID
    turned = TrapezoidMap.of_noding(take_noded(np.stack([-pieces[..., 1], pieces[..., 0]], axis=-1), twin.GRID))
    assert turned.faces().doubled[0] == plan.faces().doubled[0]
    assert np.array_equal(np.sort(turned.faces().doubled), np.sort(plan.faces().doubled))
    # the noding itself rounds halves up, so a turn may move a crossing by one step
    again = TrapezoidMap.of(np.stack([-segments[..., 1], segments[..., 0]], axis=-1), twin.GRID).faces()
    one = np.sort(plan.faces().areas)
    length = float(np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=-1).sum()) + 4.0
    assert len(one) == len(again.areas) and np.abs(np.sort(again.areas) - one).max() <= 2.0 * twin.GRID * length


@pytest.mark.parametrize("kind", ["crossing", "upright", "polygons", "mixed"])
def test_corners_and_outlines_have_the_areas(kind):
    plan = TrapezoidMap.of(twin.arrangement(kind, 52), twin.GRID)
    faces = plan.faces()
    shapes = shapely.polygons(plan.corners())
    sums = np.bincount(faces.of_trapezoid, weights=shapely.area(shapes), minlength=len(faces.areas))
    assert np.allclose(sums, faces.areas, rtol=1e-9, atol=1e-9)
    drawn = [shapely.area(plan.outline(faces, k)) for k in range(len(faces.areas))]
    assert np.allclose(drawn, faces.areas, rtol=1e-9, atol=1e-9)


def test_predicates_are_exact_at_the_bound():
    """Two needles across the whole range, one step apart at one end: floating point cannot tell them apart."""
    far = LIMIT - 2
    segments = np.array([[[-far, -far], [far, far - 1]], [[-far, -far], [far, far]], [[-far, far], [far, -far]]], float)
    plan = TrapezoidMap.of(segments, 1.0, margin=1.0)
    check_trapezoids(plan)
    faces = plan.faces()
    assert twin.face_areas_by_trapezoid(plan, faces) == faces.doubled.tolist()
    assert faces.doubled.sum() == 2 * (2 * far + 2) ** 2
    x = np.random.default_rng(0).integers(-far, far, 300)
    places = np.column_stack([x * SUB, x * SUB + np.random.default_rng(1).integers(-SUB, 2, 300)])
    found = plan.locate(places / SUB)
    assert np.array_equal(found, twin.naive_locate(plan, places, SUB))
    assert len(np.unique(faces.of_trapezoid[found])) == len(faces.doubled)


def apart(n, rng):
    """n segments that do not meet: one in each cell of a square lattice, mm."""
    side = int(np.ceil(np.sqrt(n)))
    cell = np.column_stack([np.arange(n) % side, np.arange(n) // side])[:, None] * 1.0
    return cell + rng.uniform(0.02, 0.98, (n, 2, 2))


def test_a_look_up_asks_a_few_times_ln_n_nodes():
    rng = np.random.default_rng(3)
    n = 10_000
    plan = TrapezoidMap.of_noding(take_noded(apart(n, rng), twin.GRID))
    found, depth = plan.look_up(rng.uniform(0.0, 100.0, (10_000, 2)))
    assert (found >= 0).all()
    assert depth.mean() <= 3.5 * np.log(n) and depth.max() <= 8.0 * np.log(n)


def test_a_hilbert_curve_goes_from_cell_to_neighbour_and_through_all():
    x, y = np.meshgrid(np.arange(16), np.arange(16))
    cells = np.column_stack([x.ravel(), y.ravel()]) * (1 << 12)
    walk = cells[np.argsort(_hilbert(cells))]
    assert len(np.unique(_hilbert(cells))) == 256
    assert (np.abs(np.diff(walk, axis=0)).sum(axis=1) == 1 << 12).all()


def test_the_order_is_a_permutation_by_rounds():
    noding = node_segments(apart(2000, np.random.default_rng(5)), twin.GRID)
    one, two = (insertion_order(noding.hot, noding.pieces, seed) for seed in (1, 2))
    assert sorted(one.tolist()) == list(range(len(noding.pieces))) and not np.array_equal(one, two)
    assert np.array_equal(one, insertion_order(noding.hot, noding.pieces, 1))


@pytest.mark.parametrize("seed", range(12))
def test_windings_are_the_turns_of_the_angle(seed):
    rng = np.random.default_rng(seed)
    lines = [rng.integers(0, 12, (int(rng.integers(3, 9)), 2)).astype(float) for _ in range(5)]
    lines.append(lines[0][::-1])  # takes the first one back
    lines.append(lines[1])  # goes round twice
    segments = np.concatenate([np.stack([line, np.roll(line, -1, axis=0)], axis=1) for line in lines])
    plan = TrapezoidMap.of(segments, seed=seed)
    faces = plan.faces()
    found = plan.windings(faces)
    at = rng.uniform(-0.5, 12.5, (400, 2))
    near = shapely.distance(shapely.multilinestrings(segments), shapely.points(at)) < 0.01
    a, b = (segments[None, :, k] - at[:, None] for k in (0, 1))
    turned = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=2)).sum(axis=1)
    wanted = np.rint(turned / (2 * np.pi)).astype(int)
    assert len(np.unique(wanted)) > 3 and near.sum() < 40
    assert np.array_equal(found[faces.of_trapezoid[plan.locate(at)]][~near], wanted[~near])
    inside = np.append(found != 0, False)
    merged = faces.merged(inside[faces.above] == inside[faces.below])
    assert merged.doubled.sum() == faces.doubled.sum() and merged.of_trapezoid[0] == 0
    assert len(merged.doubled) < len(faces.doubled)
    for k in range(len(merged.doubled)):
        own = np.unique(faces.of_trapezoid[merged.of_trapezoid == k])
        assert len(set(inside[own].tolist())) == 1 and merged.doubled[k] == faces.doubled[own].sum()
