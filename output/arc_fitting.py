"""Arcs, helices and longer lines instead of the many short ones of a planned path, within a tolerance both ways.

From each point the farthest one is sought up to which one line, or one arc in the XY plane, stands for the path; the
one that gets farther is taken, and so on from its end. All passes of a plan are gone along at the same time, so that
numpy has long arrays to work on. What a stretch is held against, and why the bound holds both ways, says
docs/theory/arcs.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from output.program_grid import GRID, I64, PER_MM
from output.workplan import Workplan
from toolpath.workingsteps import ArcSpan, Trajectory, TrajectoryKind, Workingstep

BOOL = NDArray[np.bool_]

SHARE = 0.5
"""Of the chordal tolerance of a job: what arcs and longer lines may leave the planned path by. Plans get the rest, half
of it for the points they leave out: so the chords of a planned circle are half as far from it as an arc may be from
them, and what the plan has of noise does not part an arc."""

LEAST_MOVES = 3
"""An arc stands for no fewer moves: there is one through any three points."""
LEAST_CHORD = 0.02
"""mm between the ends of an arc: equal ends are a full circle to a control, and 200 steps of the grid are not equal."""
LEAST_RADIUS, MOST_RADIUS, MOST_HELIX_RADIUS = 0.05, 1000.0, 100.0
"""mm. A helix of a Heidenhain ends where an angle of four decimals says: within 0.0001 mm of its place up to 100 mm."""
MOST_SWEEP = math.radians(170.0)
"""Below a half turn, where a centre off by little is an arc off by much."""
MOST_STEP = math.radians(60.0)
"""Of one planned move as seen from the centre."""
MOST_SLOPE = 0.1
"""Of a helix: some controls count F in the plane alone, and go 0.5 % faster on it at most."""
SAG = 6e-4
"""mm between an arc and the chords it has as a polyline, in STEP-NC where no circle can stand: helices, tool axes."""
ROUNDED = (TrajectoryKind.CUT, TrajectoryKind.APPROACH, TrajectoryKind.LIFT)
"""What may have arcs: passes, and the arcs that lead on and off them."""
BLOCK = 256
"""Moves of a pass at the most between two places at which a block ends in any case."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What stands for a path (n, 3): stretches in order, each from one of its rows to another.

    first, last : (k,) int64, rows of the path;  is_arc : (k,) bool
    centre      : (k, 2) float64, mm, whole steps of the grid from the start as rounded; of arcs
    """

    first: I64
    last: I64
    is_arc: BOOL
    centre: F64


def fitted(plan: Workplan, tolerance: float) -> Workplan:
    """A plan whose cuts are arcs and longer lines where these stay within a tolerance of them.

    plan      : cuts within its chordal tolerances
    tolerance : mm, what is added to these, >= 0

    Returns the plan, the chordal tolerance of its steps so much larger. Cuts and the ways on and off them are touched,
    not links, and of them those whose tool axis is fixed. Arcs are in steps along Z of the written frame alone. The
    ends of all trajectories are where they were.
    """
    places = [(s, t) for s, step in enumerate(plan.steps) for t, way in enumerate(step.trajectories) if _may(way)]
    if not places or tolerance <= 0.0:
        return plan
    ways = [plan.steps[s].trajectories[t] for s, t in places]
    round_ = np.array([_upright(plan, plan.steps[s]) for s, _ in places])
    new = dict(zip(places, _refitted(ways, round_, tolerance), strict=True))
    steps = tuple(replace(step, chordal_tolerance=step.chordal_tolerance + tolerance,
                          trajectories=tuple(new.get((s, t), way) for t, way in enumerate(step.trajectories)))
                  for s, step in enumerate(plan.steps))
    return replace(plan, steps=steps)


def _may(way: Trajectory) -> bool:
    return way.motion in ROUNDED and way.axes is None and not way.arcs and len(way.points) > 2


def _upright(plan: Workplan, step: Workingstep) -> bool:
    """Whether the tool stands along Z of the frame a step is written in."""
    if plan.clamping is None:
        return True
    frame = plan.clamping.frames.get(step.access)
    return frame is not None and bool(np.abs(frame.rotation[2] - [0.0, 0.0, 1.0]).max() < 1e-9)


def _refitted(ways: Sequence[Trajectory], round_: BOOL, tolerance: float) -> list[Trajectory]:
    points = np.concatenate([w.points for w in ways])
    count = np.array([len(w.points) for w in ways])
    begin = np.cumsum([0, *count])
    fit = stretches(points, count, round_, tolerance)
    rows, starts, per = _along(points, fit)
    out = []
    part = np.searchsorted(fit.first, begin)  # a stretch never goes from one pass to the next
    for k, way in enumerate(ways):
        mine = slice(int(part[k]), int(part[k + 1]))
        a, b = int(starts[mine.start]), int(starts[mine.stop])
        path = np.vstack([way.points[:1], rows[a:b]])
        first = starts[mine] - a
        arcs = tuple(ArcSpan(i, i + n, (x, y), left) for i, n, (x, y), left in zip(
            first[fit.is_arc[mine]].tolist(), per[mine][fit.is_arc[mine]].tolist(),
            fit.centre[mine][fit.is_arc[mine]].tolist(), _left(points, fit, mine).tolist(), strict=True))
        out.append(replace(way, points=path, arcs=arcs))
    return out


def _left(points: F64, fit: Fit, mine: slice) -> BOOL:
    """Of the arcs among some stretches: whether they turn left."""
    arc = fit.is_arc[mine]
    a, b = (points[rows[mine][arc], :2] - fit.centre[mine][arc] for rows in (fit.first, fit.last))
    return np.asarray(_cross(a, b) > 0.0)


def stretches(points: F64, count: I64, round_: BOOL, tolerance: float) -> Fit:
    """The stretches that stand for paths.

    points : (n, 3) float64, mm, of all paths one behind the other;  count : (m,) int64, of each, >= 2
    round_ : (m,) bool, whether it may have arcs
    tolerance : mm, of all stretches against what they stand for, both ways

    Notes
    -----
    Time and room grow with n log b, b the moves of the longest stretch, 256 at most.
    """
    ends = np.cumsum(count)
    blocks = [np.unique(np.append(np.arange(e - n, e - 1, BLOCK), e - 1))
              for n, e in zip(count.tolist(), ends.tolist(), strict=True)]
    at = np.concatenate([b[:-1] for b in blocks])
    stop = np.concatenate([b[1:] for b in blocks])
    may = np.repeat(round_, [len(b) - 1 for b in blocks])
    place = np.rint(points * PER_MM)
    found: list[tuple[I64, I64, BOOL, F64]] = []
    while len(at):
        line = _farthest(at, stop, 1, lambda i, j: _line_fits(points, i, j, tolerance))
        last, is_arc, centre = line.copy(), np.zeros(len(at), np.bool_), np.zeros((len(at), 2))
        # an arc has to get farther than the line does
        room = np.flatnonzero(may & (stop - at >= LEAST_MOVES) & (line < stop))
        if len(room):
            seek = _farthest(at[room], stop[room], LEAST_MOVES,
                             lambda i, j: _arc_fits(points, place, i, j, tolerance)[0])
            better = seek > np.maximum(line[room], at[room] + LEAST_MOVES - 1)
            room, seek = room[better], seek[better]
            last[room], is_arc[room] = seek, True
            if len(room):
                centre[room] = _arc_fits(points, place, at[room], seek, tolerance)[1]
        found.append((at, last, is_arc, centre))
        on = last < stop
        at, stop, may = last[on], stop[on], may[on]
    first, last, is_arc, centre = (np.concatenate([f[k] for f in found]) for k in range(4))
    order = np.argsort(first)
    return Fit(first[order], last[order], is_arc[order], centre[order])


def _farthest(at: I64, stop: I64, least: int, fits: Callable[[I64, I64], BOOL]) -> I64:
    """How far from each row something fits that is asked about in steps that double, then halve.

    at, stop : (k,) int64;  least : moves it begins with

    Returns (k,) int64: rows; ``at + 1`` where not even ``least`` moves fit, which need no asking where that is 1.
    """
    good, bad = at + 1, stop + 1
    step = np.full(len(at), least)
    if least == 1:
        step[:] = 2
    growing = np.flatnonzero(at + step <= stop)
    if least > 1:
        bad[at + step > stop] = (at + 1)[at + step > stop] + 1
    while len(growing):
        trial = np.minimum(at[growing] + step[growing], stop[growing])
        ok = fits(at[growing], trial)
        good[growing[ok]] = trial[ok]
        bad[growing[~ok]] = trial[~ok]
        step[growing] *= 2
        growing = growing[ok & (trial < stop[growing])]
    open_ = np.flatnonzero((bad - good > 1) & (good > at + 1) if least > 1 else bad - good > 1)
    while len(open_):
        trial = (good[open_] + bad[open_]) // 2
        ok = fits(at[open_], trial)
        good[open_[ok]] = trial[ok]
        bad[open_[~ok]] = trial[~ok]
        open_ = open_[bad[open_] - good[open_] > 1]
    return good


def _ragged(first: I64, last: I64) -> tuple[I64, I64, I64]:
    """Rows first to last of each of k stretches: (n,) rows, (n,) which stretch, (k,) where each begins among them."""
    size = last - first + 1
    begins = np.cumsum(size) - size
    which = np.repeat(np.arange(len(first)), size)
    return first[which] + np.arange(len(which)) - begins[which], which, begins


def _cross(a: F64, b: F64) -> F64:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _line_fits(points: F64, first: I64, last: I64, tolerance: float) -> BOOL:
    """Whether the points between lie within the tolerance of the line, each further along it than the one before."""
    rows, which, begins = _ragged(first, last)
    a = points[first]
    way = points[last] - a
    length = np.linalg.norm(way, axis=1)
    unit = way / np.maximum(length, GRID)[:, None]
    off = points[rows] - a[which]
    along = (off * unit[which]).sum(axis=1)
    aside = np.linalg.norm(off - along[:, None] * unit[which], axis=1)
    back = np.zeros(len(rows), np.bool_)
    back[1:] = (np.diff(along) <= 0.0) & (which[1:] == which[:-1])
    return np.asarray(~np.logical_or.reduceat((aside > tolerance) | back, begins) & (length > GRID))


def _arc_fits(points: F64, place: F64, first: I64, last: I64, tolerance: float) -> tuple[BOOL, F64]:
    """Whether one arc, or helix, stands for the moves between rows, and its centre (k, 2), mm.

    place : (n, 3) float64, whole steps of the grid, of the points

    Notes
    -----
    The centre lies on the perpendicular bisector of the ends: one number h, for which each point and the middle of
    each move give an interval. Of what these have in common the place nearest to the best circle through the points is
    rounded to the grid, and then asked in full.
    """
    rows, which, begins = _ragged(first, last)
    inner = np.ones(len(rows) - 1, np.bool_)
    inner[begins[1:] - 1] = False  # moves of a stretch, not from one to the next
    moves = np.flatnonzero(inner)
    mine, starts = which[moves], begins - np.arange(len(begins))
    a, b = place[first, :2] * GRID, place[last, :2] * GRID
    chord = b - a
    width = np.hypot(chord[:, 0], chord[:, 1])
    ok = width >= LEAST_CHORD
    unit = chord / np.maximum(width, GRID)[:, None]
    half = 0.5 * width
    middle = 0.5 * (a + b)
    p = points[rows, :2].copy()
    p[begins], p[begins + last - first] = a, b
    h, common = _bisector(p, moves, which, begins, middle, unit, half, tolerance)
    ok &= common
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    offset = np.rint((middle + h[:, None] * normal) * PER_MM - place[first, :2])
    centre = (place[first, :2] + offset) * GRID
    ra, rb = np.hypot(*(a - centre).T), np.hypot(*(b - centre).T)
    r, spread = 0.5 * (ra + rb), 0.5 * np.abs(ra - rb)
    ok &= (r >= LEAST_RADIUS) & (r <= MOST_RADIUS) & (half <= math.sin(0.5 * MOST_SWEEP) * r)
    side = np.where(h > 0.0, 1.0, -1.0)
    # what a point is off, and the nearest place of each move
    v = p - centre[which]
    rho = np.hypot(v[:, 0], v[:, 1])
    u, w = v[moves], v[moves + 1]
    d = w - u
    size = np.hypot(d[:, 0], d[:, 1])
    turn = _cross(u, w)
    angle = np.arctan2(side[mine] * turn, (u * w).sum(axis=1))
    foot = ((u * d).sum(axis=1) < 0.0) & ((w * d).sum(axis=1) > 0.0)
    near = np.where(foot, np.abs(turn) / np.maximum(size, 1e-12), r[mine])
    ahead = (d * unit[mine]).sum(axis=1)
    bad = (angle <= 0.0) | (angle > MOST_STEP) | (ahead <= 0.0)
    ok &= ~np.logical_or.reduceat(bad, starts)
    off = np.maximum(np.maximum.reduceat(np.abs(rho - r[which]), begins),
                     np.maximum.reduceat(np.abs(near - r[mine]), starts)) + spread
    # Z against the angle gone
    z = points[rows, 2].copy()
    za, zb = place[first, 2] * GRID, place[last, 2] * GRID
    z[begins], z[begins + last - first] = za, zb
    sweep = np.add.reduceat(angle, starts)
    gone = np.zeros(len(rows))
    gone[moves + 1] = angle
    gone = np.cumsum(gone)
    gone -= gone[begins][which]
    rise = zb - za
    even = za[which] + rise[which] * gone / np.maximum(sweep, 1e-9)[which]
    dz = np.abs(z[moves + 1] - z[moves])
    uneven = dz * (0.02 * angle * angle + 0.5 * tolerance / np.maximum(r, GRID)[mine])
    high = np.maximum.reduceat(np.abs(z - even), begins) + np.maximum.reduceat(uneven, starts)
    ok &= np.hypot(off, high) <= tolerance
    level = rise == 0.0
    ok &= level | ((np.abs(rise) <= MOST_SLOPE * r * sweep) & (r <= MOST_HELIX_RADIUS))
    return ok, centre


def _bisector(p: F64, moves: I64, which: I64, begins: I64, middle: F64, unit: F64, half: F64,
              tolerance: float) -> tuple[F64, BOOL]:
    """How far left of the middle of the ends the centre lies, mm, and whether all points have such places in common.

    p : (n, 2) float64, mm, points of k stretches;  moves : rows of p at which moves begin;  which : (n,) stretch
    begins : (k,) rows of p;  middle, unit : (k, 2) of the chord, half : (k,) of its length, mm

    Notes
    -----
    With x along the chord and y to its left from its middle, c half of it and q = x² + y² - c², a point is at
    sqrt(r² + q - 2 h y) from the centre, r² = c² + h²: it is off by (q - 2 h y) / 2 r to first order.
    """
    k = len(begins)
    half2 = half * half

    def coordinates(points: F64, of: I64) -> tuple[F64, F64]:
        v, u = points - middle[of], unit[of]
        y = v[:, 1] * u[:, 0] - v[:, 0] * u[:, 1]
        return y, (v * v).sum(axis=1) - half2[of]

    def between(y: F64, q: F64, of: I64, begin: I64) -> tuple[F64, F64]:
        told = np.abs(y) > 1e-12
        twice = np.where(told, 2.0 * y, 1.0)
        a, b = (np.where(told, (q + sign * slack[of]) / twice, sign * np.inf) for sign in (-1.0, 1.0))
        return np.maximum.reduceat(np.minimum(a, b), begin), np.minimum.reduceat(np.maximum(a, b), begin)

    y, q = coordinates(p, which)
    square = np.add.reduceat(y * y, begins)
    h = 0.5 * np.add.reduceat(q * y, begins) / np.maximum(square, 1e-30)
    slack = 2.0 * np.hypot(half, h) * tolerance
    low, high = between(y, q, which, begins)
    mine = which[moves]
    more_low, more_high = between(*coordinates(0.5 * (p[moves] + p[moves + 1]), mine), mine, begins - np.arange(k))
    low, high = np.maximum(low, more_low), np.minimum(high, more_high)
    common = np.isfinite(low) & np.isfinite(high) & (low <= high) & (square > 0.0)
    low, high = np.where(common, low, 1.0), np.where(common, high, 1.0)
    spare = 0.1 * (high - low)
    return np.clip(h, low + spare, high - spare), common


def _along(points: F64, fit: Fit) -> tuple[F64, I64, I64]:
    """The polyline of stretches without the starts of paths.

    Of an arc these are the planned points moved onto it, and as many between as its sag asks for; they stay within
    the tolerance of the plan, for each planned move has its own.

    Returns (n, 3) float64, mm, rows; (k + 1,) int64, where those of each stretch begin; (k,) int64, how many it has.
    """
    per = np.ones(len(fit.first), np.int64)
    arc = np.flatnonzero(fit.is_arc)
    if not len(arc):
        return points[fit.last], np.arange(len(per) + 1), per
    rows, which, begins = _ragged(fit.first[arc], fit.last[arc])
    centre = fit.centre[arc]
    v = points[rows, :2] - centre[which]
    rho = np.hypot(v[:, 0], v[:, 1])
    inner = np.ones(len(rows) - 1, np.bool_)
    inner[begins[1:] - 1] = False
    moves = np.flatnonzero(inner)
    mine = which[moves]
    turned = np.arctan2(_cross(v[moves], v[moves + 1]), (v[moves] * v[moves + 1]).sum(axis=1))
    r = rho[begins]
    pieces = np.maximum(np.ceil(np.abs(turned) / (2.0 * np.arccos(1.0 - np.minimum(SAG / r, 0.5)))[mine]), 1.0)
    pieces = pieces.astype(np.int64)
    per[arc] = np.bincount(mine, pieces, len(arc)).astype(np.int64)
    starts = np.concatenate([[0], np.cumsum(per)])
    out = np.empty((int(starts[-1]), 3))
    line = np.flatnonzero(~fit.is_arc)
    out[starts[line]] = points[fit.last[line]]
    gone = np.zeros(len(rows))
    gone[moves + 1] = turned
    gone = np.cumsum(gone)
    gone -= gone[begins][which]
    # angle behind the start of each point put down
    of = np.repeat(np.arange(len(moves)), pieces)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 1.0) / pieces[of]
    angle = gone[moves][of] + turned[of] * share
    stretch = mine[of]
    sweep = np.bincount(mine, turned, len(arc))[stretch]
    ends = begins + fit.last[arc] - fit.first[arc]
    part = angle / sweep
    radius = r[stretch] + (rho[ends] - r)[stretch] * part
    begun = np.arctan2(v[begins, 1], v[begins, 0])[stretch] + angle
    z = points[rows[begins], 2][stretch] + (points[rows[ends], 2] - points[rows[begins], 2])[stretch] * part
    put = np.repeat(starts[arc], per[arc]) + np.arange(len(of)) - np.repeat(np.cumsum(per[arc]) - per[arc], per[arc])
    out[put, 0] = centre[stretch, 0] + radius * np.cos(begun)
    out[put, 1] = centre[stretch, 1] + radius * np.sin(begun)
    out[put, 2] = z
    out[starts[1:] - 1] = points[fit.last]
    return out, starts, per


__all__ = ["SAG", "SHARE", "Fit", "fitted", "stretches"]
