"""Replaces the many short lines of a planned path by arcs, helices and longer lines within a tolerance.

From each point the search takes the farthest point up to which one line, or one arc in the XY plane, stays within the
tolerance of the path. The longer of the two is kept, and the search goes on from its end. All passes of a plan are
searched at once, so that numpy works on long arrays. docs/theory/arcs.md states the distances that are checked and
proves that the bound holds in both directions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from output.program_grid import GRID, I64, PER_MM
from output.return_places import return_places
from output.workplan import Workplan
from toolpath.workingsteps import ArcSpan, Trajectory, TrajectoryKind, Workingstep

BOOL = NDArray[np.bool_]

MIN_ARC_MOVES = 3
"""Fewest moves that an arc replaces. Any three points lie on a circle, so two moves prove nothing."""
MIN_ARC_CHORD = 0.02
"""mm, least distance between the ends of an arc. A control takes equal ends for a full circle."""
MIN_ARC_RADIUS, MAX_ARC_RADIUS, MAX_HELIX_RADIUS = 0.05, 1000.0, 100.0
"""mm. A Heidenhain ends a helix at an angle of four decimals, which is exact to 0.0001 mm up to a radius of 100 mm."""
MAX_SWEEP = math.radians(170.0)
"""rad, largest sweep of an arc. Near half a turn a small error of the centre becomes a large error of the arc."""
MAX_MOVE_ANGLE = math.radians(60.0)
"""rad, largest angle of one planned move, seen from the centre."""
MAX_HELIX_SLOPE = 0.1
"""Largest slope of a helix, dimensionless. A control that applies F in the plane only is at most 0.5 % faster then."""
SAG = 6e-4
"""mm between an arc and its chords where STEP-NC needs a polyline: helices, and paths with their own tool axes."""
ROUNDED = (TrajectoryKind.CUT, TrajectoryKind.APPROACH, TrajectoryKind.LIFT)
"""Motions that may have arcs: cutting passes, and the lead-in and lead-out moves."""
BLOCK = 256
"""Largest number of moves that one line or arc replaces."""
NO_ROWS = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class FittedStretches:
    """The lines and arcs that replace a path, in order, each from one row of the path to another.

    first, last : (k,) int64, index, rows of the path
    is_arc      : (k,) bool
    centre      : (k, 2) float64, mm, XY plane, of arcs: a whole number of grid steps from the rounded start
    """

    first: I64
    last: I64
    is_arc: BOOL
    centre: F64


def fitted(plan: Workplan, tolerance: float) -> Workplan:
    """The plan with arcs and longer lines where these stay within the tolerance of the planned cuts.

    plan      : cuts within its chordal tolerances
    tolerance : float, mm, >= 0, added to the chordal tolerance of each step; ``Trajectory.loose`` comes on top

    Returns the plan. Cutting passes, lead-in and lead-out moves with a fixed tool axis change; links do not. Arcs occur
    only in steps whose tool axis is Z of the written frame. All trajectories keep their ends, and loose ones the places
    where the tool comes down again (``output.return_places``).

    Notes
    -----
    The search for the longest stretch within a tolerance solves the task of [Douglas1973] from one end, with arcs too.
    """
    places = [(s, t) for s, step in enumerate(plan.steps)
              for t, trajectory in enumerate(step.trajectories) if _can_refit(trajectory)]
    if not places or tolerance <= 0.0:
        return plan
    through = return_places(plan)
    trajectories = [plan.steps[s].trajectories[t] for s, t in places]
    rows = [through.get(place, (w.points, NO_ROWS)) for place, w in zip(places, trajectories, strict=True)]
    round_ = np.array([_axis_is_z(plan, plan.steps[s]) for s, _ in places])
    new = dict(zip(places, _refitted_trajectories(trajectories, rows, round_, tolerance), strict=True))
    steps = tuple(replace(step, chordal_tolerance=step.chordal_tolerance + tolerance + max(
                              (t.loose for t in step.trajectories), default=0.0),
                          trajectories=tuple(new.get((s, t), path) for t, path in enumerate(step.trajectories)))
                  for s, step in enumerate(plan.steps))
    return replace(plan, steps=steps)


def _can_refit(trajectory: Trajectory) -> bool:
    plain = trajectory.axes is None and not trajectory.arcs
    return trajectory.motion in ROUNDED and plain and len(trajectory.points) > 2


def _axis_is_z(plan: Workplan, step: Workingstep) -> bool:
    """Whether the tool stands along Z of the frame in which a step is written."""
    if plan.clamping is None:
        return True
    frame = plan.clamping.frames.get(step.access)
    return frame is not None and bool(np.abs(frame.rotation[2] - [0.0, 0.0, 1.0]).max() < 1e-9)


def _refitted_trajectories(trajectories: Sequence[Trajectory], rows_kept: Sequence[tuple[F64, I64]], round_: BOOL,
                           tolerance: float) -> list[Trajectory]:
    """The trajectories with arcs and longer lines.

    rows_kept : the points of each, (n, 3) float64, mm, and rows (k,) of them that stay
    """
    points = np.concatenate([p for p, _ in rows_kept])
    count = np.array([len(p) for p, _ in rows_kept])
    begin = np.cumsum([0, *count])
    kept = np.concatenate([rows + b for (_, rows), b in zip(rows_kept, begin.tolist(), strict=False)])
    fit = stretches(points, count, round_, tolerance + np.array([w.loose for w in trajectories]), kept)
    rows, starts, per = _along(points, fit)
    out = []
    part = np.searchsorted(fit.first, begin)  # a stretch never goes from one pass to the next
    for k, trajectory in enumerate(trajectories):
        mine = slice(int(part[k]), int(part[k + 1]))
        a, b = int(starts[mine.start]), int(starts[mine.stop])
        path = np.vstack([trajectory.points[:1], rows[a:b]])
        first = starts[mine] - a
        arcs = tuple(ArcSpan(i, i + n, (x, y), left) for i, n, (x, y), left in zip(
            first[fit.is_arc[mine]].tolist(), per[mine][fit.is_arc[mine]].tolist(),
            fit.centre[mine][fit.is_arc[mine]].tolist(), _left(points, fit, mine).tolist(), strict=True))
        out.append(replace(trajectory, points=path, arcs=arcs))
    return out


def _left(points: F64, fit: FittedStretches, mine: slice) -> BOOL:
    """For each arc of some stretches: whether it turns left, seen from above."""
    arc = fit.is_arc[mine]
    a, b = (points[rows[mine][arc], :2] - fit.centre[mine][arc] for rows in (fit.first, fit.last))
    return np.asarray(_cross(a, b) > 0.0)


def stretches(points: F64, count: I64, round_: BOOL, tolerance: F64 | float,
              kept: I64 = NO_ROWS) -> FittedStretches:
    """The lines and arcs that replace paths.

    points : (n, 3) float64, mm, frame of the step; the points of all paths, one path after the other
    count  : (m,) int64, count of the points of each path, >= 2
    round_ : (m,) bool, whether the path may have arcs
    tolerance : (m,) float64 or float, mm, largest distance between a stretch and its path, in both directions
    kept   : (k,) int64, index, ascending, rows of ``points`` at which a stretch must end

    Notes
    -----
    Time and memory grow with n log b, where b <= 256 is the number of moves of the longest stretch.
    """
    ends = np.cumsum(count)
    here = np.searchsorted(kept, np.append(0, ends))
    blocks = [np.unique(np.concatenate([np.arange(e - n, e - 1, BLOCK), kept[a:b], [e - 1]]))
              for n, e, a, b in zip(count.tolist(), ends.tolist(), here[:-1].tolist(), here[1:].tolist(), strict=True)]
    at = np.concatenate([b[:-1] for b in blocks])
    stop = np.concatenate([b[1:] for b in blocks])
    may = np.repeat(round_, [len(b) - 1 for b in blocks])
    place = np.rint(points * PER_MM)
    within = np.repeat(np.broadcast_to(tolerance, len(count)), count)  # mm, by row
    found: list[tuple[I64, I64, BOOL, F64]] = []
    while len(at):
        line = _farthest(at, stop, 1, lambda i, j: _line_fits(points, i, j, within[i]))
        last, is_arc, centre = line.copy(), np.zeros(len(at), np.bool_), np.zeros((len(at), 2))
        # an arc is kept only where it is longer than the line
        room = np.flatnonzero(may & (stop - at >= MIN_ARC_MOVES) & (line < stop))
        if len(room):
            seek = _farthest(at[room], stop[room], MIN_ARC_MOVES,
                             lambda i, j: _arc_fits(points, place, i, j, within[i])[0])
            better = seek > np.maximum(line[room], at[room] + MIN_ARC_MOVES - 1)
            room, seek = room[better], seek[better]
            last[room], is_arc[room] = seek, True
            if len(room):
                centre[room] = _arc_fits(points, place, at[room], seek, within[at[room]])[1]
        found.append((at, last, is_arc, centre))
        on = last < stop
        at, stop, may = last[on], stop[on], may[on]
    first, last, is_arc, centre = (np.concatenate([f[k] for f in found]) for k in range(4))
    order = np.argsort(first)
    return FittedStretches(first[order], last[order], is_arc[order], centre[order])


def _farthest(at: I64, stop: I64, least: int, fits: Callable[[I64, I64], BOOL]) -> I64:
    """The farthest end of a stretch from each row, found with steps that double and then halve.

    at, stop : (k,) int64, first row and last allowed row;  least : number of moves of the first trial

    Returns (k,) int64: the row of the end. It is ``at + 1`` where no trial fits; one move always fits.
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
    """Rows first to last of k stretches: (n,) rows, (n,) number of the stretch, (k,) start of each stretch."""
    size = last - first + 1
    begins = np.cumsum(size) - size
    which = np.repeat(np.arange(len(first)), size)
    return first[which] + np.arange(len(which)) - begins[which], which, begins


def _cross(a: F64, b: F64) -> F64:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _line_fits(points: F64, first: I64, last: I64, tolerance: F64) -> BOOL:
    """Whether the points of a stretch lie within the tolerance of its line and advance along it without going back."""
    rows, which, begins = _ragged(first, last)
    a = points[first]
    chord = points[last] - a
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, GRID)[:, None]
    off = points[rows] - a[which]
    along = (off * unit[which]).sum(axis=1)
    aside = np.linalg.norm(off - along[:, None] * unit[which], axis=1)
    back = np.zeros(len(rows), np.bool_)
    back[1:] = (np.diff(along) <= 0.0) & (which[1:] == which[:-1])
    return np.asarray(~np.logical_or.reduceat((aside > tolerance[which]) | back, begins) & (length > GRID))


def _arc_fits(points: F64, place: F64, first: I64, last: I64, tolerance: F64) -> tuple[BOOL, F64]:
    """Whether one arc or helix replaces the moves between two rows, and its centre (k, 2), mm.

    place : (n, 3) float64, grid steps, the points on the grid

    Notes
    -----
    The centre lies on the perpendicular bisector of the two ends, at one signed distance h. Each point and the middle
    of each move allow an interval of h. The common value nearest to the best circle is rounded to the grid.
    The rounded arc is then checked in full.
    """
    rows, which, begins = _ragged(first, last)
    inner = np.ones(len(rows) - 1, np.bool_)
    inner[begins[1:] - 1] = False  # moves of a stretch, not from one to the next
    moves = np.flatnonzero(inner)
    mine, starts = which[moves], begins - np.arange(len(begins))
    a, b = place[first, :2] * GRID, place[last, :2] * GRID
    chord = b - a
    width = np.hypot(chord[:, 0], chord[:, 1])
    ok = width >= MIN_ARC_CHORD
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
    ok &= (r >= MIN_ARC_RADIUS) & (r <= MAX_ARC_RADIUS) & (half <= math.sin(0.5 * MAX_SWEEP) * r)
    side = np.where(h > 0.0, 1.0, -1.0)
    # deviation of the points, and the nearest place of each move
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
    bad = (angle <= 0.0) | (angle > MAX_MOVE_ANGLE) | (ahead <= 0.0)
    ok &= ~np.logical_or.reduceat(bad, starts)
    off = np.maximum(np.maximum.reduceat(np.abs(rho - r[which]), begins),
                     np.maximum.reduceat(np.abs(near - r[mine]), starts)) + spread
    # Z against the swept angle
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
    uneven = dz * (0.02 * angle * angle + 0.5 * (tolerance / np.maximum(r, GRID))[mine])
    high = np.maximum.reduceat(np.abs(z - even), begins) + np.maximum.reduceat(uneven, starts)
    ok &= np.hypot(off, high) <= tolerance
    level = rise == 0.0
    ok &= level | ((np.abs(rise) <= MAX_HELIX_SLOPE * r * sweep) & (r <= MAX_HELIX_RADIUS))
    return ok, centre


def _bisector(p: F64, moves: I64, which: I64, begins: I64, middle: F64, unit: F64, half: F64,
              tolerance: F64) -> tuple[F64, BOOL]:
    """Signed distance h of the centre from the middle of the ends, mm, positive to the left; and whether one exists.

    p : (n, 2) float64, mm, points of k stretches;  moves : rows of p at which moves begin;  which : (n,) stretch
    begins : (k,) rows of p;  middle, unit : (k, 2) of the chord, half : (k,) of its length, mm

    Notes
    -----
    With x along the chord and y to its left from its middle, c half of it and q = x² + y² - c², a point is
    sqrt(r² + q - 2 h y) from the centre, where r² = c² + h². Its deviation is (q - 2 h y) / 2 r to first order.
    """
    k = len(begins)
    half2 = half * half

    def coordinates(points: F64, of: I64) -> tuple[F64, F64]:
        v, u = points - middle[of], unit[of]
        y = v[:, 1] * u[:, 0] - v[:, 0] * u[:, 1]
        return y, (v * v).sum(axis=1) - half2[of]

    def between(y: F64, q: F64, of: I64, begin: I64) -> tuple[F64, F64]:
        steep = np.abs(y) > 1e-12
        twice = np.where(steep, 2.0 * y, 1.0)
        a, b = (np.where(steep, (q + sign * slack[of]) / twice, sign * np.inf) for sign in (-1.0, 1.0))
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


def _along(points: F64, fit: FittedStretches) -> tuple[F64, I64, I64]:
    """The polyline of stretches without the starts of paths.

    An arc contributes its planned points, moved onto it, and points between them where the sag needs them. They stay
    within the tolerance of the plan because each planned move has its own.

    Returns (n, 3) float64, mm, rows; (k + 1,) int64, first row of each stretch; (k,) int64, number of its rows.
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
    # angle from the start of the arc to each point
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


__all__ = ["SAG", "FittedStretches", "fitted", "stretches"]
