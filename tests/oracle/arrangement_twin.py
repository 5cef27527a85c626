"""Random arrangements of segments, and the slow, exact view of their trapezoidal map."""

from __future__ import annotations

import numpy as np
import shapely

GRID = 1e-3


def crossing(rng, n):
    """Long segments all over each other."""
    return rng.uniform(-20, 20, (n, 2, 2))


def short(rng, n):
    """Short segments, few of which meet."""
    a = rng.uniform(-20, 20, (n, 2))
    return np.stack([a, a + rng.normal(0, 1.5, (n, 2))], axis=1)


def star(rng, n):
    """Some centres with many segments from each, to ends of which some are shared."""
    centre = rng.uniform(-10, 10, (max(1, n // 8), 2))
    ends = rng.uniform(-12, 12, (n, 2))
    return np.stack([centre[rng.integers(0, len(centre), n)], ends[rng.integers(0, n, n)]], axis=1)


def upright(rng, n):
    """Level and vertical segments on a coarse lattice: shared ends, crossings, overlaps, equal x."""
    a = rng.integers(-5, 6, (n, 2)).astype(float)
    b = a.copy()
    b[np.arange(n), rng.integers(0, 2, n)] += rng.integers(-6, 7, n)
    return np.stack([a, b], axis=1)


def lattice(rng, n):
    """Segments between the points of a coarse lattice."""
    return rng.integers(-3, 4, (n, 2, 2)) * 0.5


def collinear(rng, n):
    """Overlapping stretches of a few lines."""
    lines = max(1, n // 6)
    base, way = rng.integers(-8, 9, (lines, 2)).astype(float), rng.integers(-3, 4, (lines, 2)).astype(float)
    pick = rng.integers(0, lines, n)
    t = rng.integers(-4, 5, (n, 2, 1))
    return base[pick][:, None] + t * way[pick][:, None]


def tees(rng, n):
    """Segments that end on another one: at a point of the grid that lies on it, or at the nearest such point.

    Feet that would lie just half a step off the other segment do not occur; who takes part there is a matter of the
    rounding rule.
    """
    first = rng.integers(-5000, 5000, (max(1, n // 3), 2, 2)) * 4.0 * GRID
    on = first[rng.integers(0, len(first), n - len(first))]
    t = np.where(rng.random((len(on), 1)) < 0.5, rng.choice([0.25, 0.5], (len(on), 1)), rng.random((len(on), 1)))
    foot = on[:, 0] + t * (on[:, 1] - on[:, 0])
    return np.concatenate([first, np.stack([foot, rng.uniform(-20, 20, foot.shape)], axis=1)])


def polygons(rng, n):
    """Closed polygons, nested, side by side or over each other."""
    out = []
    while sum(map(len, out)) < n:
        k = int(rng.integers(3, 9))
        angle = np.sort(rng.uniform(0, 2 * np.pi, k))
        ring = rng.uniform(-8, 8, 2) + rng.uniform(0.5, 8) * np.column_stack([np.cos(angle), np.sin(angle)])
        out.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
    return np.concatenate(out)


def steep(rng, n):
    """Segments that lean by no more than a few grid steps, and level ones over them."""
    x = rng.integers(-3, 4, n) * 0.004
    run = rng.integers(-2, 3, n) * GRID
    y = rng.uniform(-10, 10, (n, 2))
    out = np.stack([np.column_stack([x, y[:, 0]]), np.column_stack([x + run, y[:, 1]])], axis=1)
    level = rng.random(n) < 0.25
    out[level, 0, 0], out[level, 1, 0] = -1.0, 1.0
    return out


def repeated(rng, n):
    """Segments given several times, also backwards, and segments of no length."""
    some = rng.uniform(-20, 20, (max(1, n // 3), 2, 2))
    out = some[rng.integers(0, len(some), n)]
    back = rng.random(n) < 0.5
    out[back] = out[back][:, ::-1]
    dots = rng.random(n) < 0.1
    out[dots, 1] = out[dots, 0]
    return out


def mixed(rng, n):
    """A little of everything."""
    each = max(2, n // 4)
    return np.concatenate([KINDS[k](rng, each) for k in rng.choice(sorted(set(KINDS) - {"mixed"}), 4)])


KINDS = {f.__name__: f for f in (crossing, short, star, upright, lattice, collinear, tees, polygons, steep, repeated,
                                 mixed)}


def arrangement(kind, seed):
    """(s, 2, 2) mm: a random arrangement of a kind, 1 to 40 segments or so."""
    rng = np.random.default_rng([sorted(KINDS).index(kind), seed])
    return KINDS[kind](rng, int(rng.integers(1, 41)))


def overlay(segments):
    """Faces of the arrangement by shapely alone, in grid steps: union on the grid, then polygons."""
    steps = np.floor(segments / GRID + 0.5)
    lines = shapely.linestrings(steps[(steps[:, 0] != steps[:, 1]).any(axis=1)])
    return polygons_of(shapely.get_parts(shapely.union_all(lines, grid_size=1.0)))


def polygons_of(lines):
    """Bounded faces of noded lines."""
    return shapely.get_parts(shapely.polygonize(lines))


def doubled_area(polygon):
    """Twice the area of a polygon with whole coordinates, exactly."""
    rings = [shapely.get_coordinates(r).astype(np.int64) for r in (polygon.exterior, *polygon.interiors)]
    sums = [abs(int((r[:-1, 0] * r[1:, 1] - r[1:, 0] * r[:-1, 1]).sum())) for r in rings]
    return sums[0] - sum(sums[1:])


def scaled_height(plan, line, x, scale):
    """(numerator, denominator > 0) of y of pieces at x / scale, times scale; whole numbers."""
    p, q = plan.points[plan.pieces[line, 0]], plan.points[plan.pieces[line, 1]]
    run = q[..., 0] - p[..., 0]
    return p[..., 1] * scale * run + (q[..., 1] - p[..., 1]) * (x - p[..., 0] * scale), run


def naive_locate(plan, places, scale):
    """The one trapezoid with left <= x < right and bottom <= y < top, or -1; places (k, 2) int64 in steps / scale."""
    wide = np.flatnonzero(~plan.flat)
    x0, x1 = plan.points[plan.left[wide], 0] * scale, plan.points[plan.right[wide], 0] * scale
    out = np.full(len(places), -1)
    for k, (x, y) in enumerate(places):
        here = wide[(x0 <= x) & (x < x1)]
        low, run_low = scaled_height(plan, plan.bottom[here], x, scale)
        top, run_top = scaled_height(plan, plan.top[here], x, scale)
        inside = here[(low <= y * run_low) & (y * run_top < top)]
        assert len(inside) <= 1
        if len(inside):
            out[k] = inside[0]
    return out


def face_areas_by_trapezoid(plan, faces):
    """Twice the area of each face as the sum of its trapezoids, in whole numbers; every division must come out even."""
    total = [0] * len(faces.doubled)
    for side, sign in ((plan.top, 1), (plan.bottom, -1)):
        shares = {}
        for t in np.flatnonzero(~plan.flat).tolist():
            p, q = (plan.points[e].tolist() for e in plan.pieces[side[t]])
            x0, x1 = int(plan.points[plan.left[t], 0]), int(plan.points[plan.right[t], 0])
            run, rise = q[0] - p[0], q[1] - p[1]
            part = (x1 - x0) * (2 * run * p[1] + rise * (x0 + x1 - 2 * p[0]))
            key = (int(side[t]), int(faces.of_trapezoid[t]))
            shares[key] = (shares.get(key, (0, run))[0] + part, run)
        for (_, face), (share, run) in shares.items():
            whole, rest = divmod(share, run)
            assert rest == 0
            total[face] += sign * whole
    return total
