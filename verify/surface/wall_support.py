"""Support of thin walls: both sides are cut down in turn, and stock stands beside them not far below.

Notation: p and q are opposite places of a thin wall (``verify.surface.slender_walls``), K is the allowed ratio of free
height to thickness. ``done(p)`` is the time at which at most twice the scallop is left at p over the allowance.
``gone(p)`` is the time at which the stock in front of p stops supporting the wall. **The rule**: when both p and q are
done, stock still stands on both sides at a place of the same wall within the limit of p, K times the mean thickness
below p; or the finished part supports the wall within that limit. Times count along the path of the tool, so they do
not depend on how a program divides its path into blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import ToolBody
from geometry.widest_paths import widest_paths
from verify.blank.blank import stock_bounds, stock_on_normals
from verify.findings import Source
from verify.model import Finding, FindingKind, ProofSetup, ScoredSamples, Support
from verify.moves import Moves
from verify.progress import Report, silent
from verify.surface.removal import first_below, residual_on_normals
from verify.surface.sample_scores import RAY_ERROR
from verify.surface.slender_walls import LEVEL, TOUCHES, Lie, Rests, ThinWalls, thin_walls

PIECES = 200_000  # of the path that are worked at a time
REST = 2.0  # scallops that may be left at a place that is done: later cuts of so little do not bend a wall
HOLDS = 0.5  # share of the stock of the blank in front of a place that must stand to support the wall
ROOM = 2.0  # of the distance of places: the highest supported place may lie this much below the top of the stock
BEND = 0.1  # of |Z| of normals about that of level walls: there a wall goes on among those of the other lie
NEAR = 2.5  # of the distance of places: nearer ones are joined
BLOCK = 256
TEXTS = {
    Lie.UPRIGHT: "finishes a wall {:.2f} mm thick at a free height of {:.1f} mm; {:g} times its thickness are "
                 "allowed{}: cut both sides down in turn by no more than that, or support the wall",
    Lie.LEVEL: "finishes a floor or shelf {:.2f} mm thick where it is free over {:.1f} mm; {:g} times its thickness "
               "are allowed{}: cut both sides in turn from the free end by no more than that, or support it",
}
INT = NDArray[np.int64]
NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class CutTimes:
    """Times of n places: when each is done, and when its stock is gone.

    gone  : (n,) int64, index, piece of the path on which the stock stops supporting the wall, -1 before the first cut,
            NEVER also where the blank had none
    done  : (n,) int64, index, piece on which the cut ends, NEVER where no move cuts it
    mover : (n,) int64, index, the move after which it is done, -1 where none
    """

    gone: INT
    done: INT
    mover: INT

    def part(self, rows: slice) -> CutTimes:
        """The times of some of the places."""
        return CutTimes(self.gone[rows], self.done[rows], self.mover[rows])


def supported(tree: TriangleTree, scored: ScoredSamples, setup: ProofSetup, moves: Moves, tools: Sequence[ToolBody],
              source: Source, zone_ids: Sequence[str], threads: int = 2, report: Report = silent
              ) -> tuple[Support, list[Finding]]:
    """Free height of thin walls when they are cut, and findings where it is above the limit.

    tree   : TriangleTree of the part; Z of its frame is up
    scored : the samples that supply the places
    report : called with the share done, 0 to 1; an exception from it ends the work

    Returns Support, and a finding for each wall and program where ``setup.walls_in_turn`` is on and one axis that never
    turns cuts everything.

    Notes
    -----
    A violation within ``ThinWalls.spacing`` of path is not seen, and one of less than twice that spacing does not
    count: an order that keeps the rule never gets a finding.
    """
    rests = _rests(tree, setup)
    lies = {lie: thin_walls(tree, scored.samples, setup.free_ratio, lie, rests) for lie in Lie}
    lies = {lie: walls for lie, walls in lies.items() if len(walls)}
    if not lies or not moves.feed.any():
        return Support(0, 0, 0.0, setup.free_ratio, 0), []
    in_turn = setup.walls_in_turn and _one_axis(moves)
    figures, findings = [], []
    for k, (lie, walls) in enumerate(lies.items()):
        span = _share(report, k, len(lies))
        both = _times(np.concatenate([walls.points, walls.across]), np.concatenate([walls.normals, walls.beyond]),
                      np.tile(walls.thickness, 2), walls.spacing, lie, tree.mesh.bounds, setup, moves, tools, threads,
                      span)
        times = [both.part(slice(0, len(walls))), both.part(slice(len(walls), None))]
        free, judged = _free_ways(walls, times, float(tree.mesh.bounds[0, 2]))
        over = np.flatnonzero(judged & (free > walls.limit + ROOM * walls.spacing))
        figures.append(_figures(walls, free, judged, over, setup.free_ratio, in_turn=in_turn))
        if in_turn:
            findings += _findings(walls, lie, free, over, times, setup, scored, source, zone_ids)
    worst = max(figures, key=lambda f: f.most)
    return replace(worst, walls=sum(f.walls for f in figures), places=sum(f.places for f in figures),
                   over=sum(f.over for f in figures), found=any(f.found for f in figures)), findings


def _rests(tree: TriangleTree, setup: ProofSetup) -> Rests:
    """What holds level sheets from below: fixtures, and the table unless it is known to lie lower than the blank."""
    bottom = float(stock_bounds(tree.mesh.bounds, setup)[0, 2])
    lies = not setup.table_known or setup.table is None or bottom <= setup.table + TOUCHES
    return Rests(max(bottom, float(tree.mesh.bounds[0, 2])) if lies else -np.inf,
                 tuple(np.asarray(f, dtype=np.float64) for f in setup.fixtures))


def _share(report: Report, part: int, parts: int) -> Report:
    """Reports the share of one of several equal parts."""
    return lambda done: report((part + done) / parts)


def _figures(walls: ThinWalls, free: F64, judged: NDArray[np.bool_], over: INT, allowed: float, *,
             in_turn: bool) -> Support:
    """The figures of walls of which (n,) places ``judged`` are ``free``, mm, and (k,) of them ``over`` the limit."""
    ratio = np.where(judged, free / walls.limit, 0.0) * allowed
    x, y, z = walls.points[int(np.argmax(ratio))].tolist()
    return Support(len(np.unique(walls.wall[walls.free])), int(judged.sum()), float(ratio.max()), allowed, len(over),
                   in_turn and bool(len(over)), (x, y, z) if judged.any() else None)


def _one_axis(moves: Moves) -> bool:
    """Whether one axis that never turns cuts everything."""
    if moves.axes is None:
        return True
    axes = moves.axes.only(moves.feed)
    return bool((axes.angle == 0.0).all() and (axes.axis @ axes.axis[0] > 1.0 - 1e-9).all())


def _times(points: F64, normals: F64, thickness: F64, spacing: float, lie: Lie, bounds: F64, setup: ProofSetup,
           moves: Moves, tools: Sequence[ToolBody], threads: int, report: Report) -> CutTimes:
    """Times of places (n, 3), mm, of walls ``thickness`` (n,) mm thick, along a path in pieces of ``spacing`` mm.

    A place is done when no more is left on it than the rest allowed. Where more stays, it is done when no more than the
    rest stands over what stays. On a level wall the end of the tool stays over the place for up to its diameter of way
    after that.
    """
    left = np.minimum(stock_on_normals(points, normals, bounds, setup, float(thickness.max())), thickness)
    rest = REST * setup.scallop_height + RAY_ERROR
    enough = setup.stock_allowance + rest
    had = stock_on_normals(points, normals, bounds, setup, np.inf)
    holds = np.minimum(thickness, HOLDS * had)
    near = moves.only(beside := moves.feed & _beside(moves, tools, points, thickness))
    final, by = residual_on_normals(points, normals, left, near, tools, threads=threads,
                                    progress=lambda f: report(0.3 * f))
    stands = (left >= holds) & (holds > enough)
    target = np.where(final <= enough, enough, final + rest)
    open_ = (by >= 0) & (left > enough) & (target < left)
    rows = np.concatenate([np.flatnonzero(stands), np.flatnonzero(open_)])
    level = np.concatenate([holds[stands] - RAY_ERROR, target[open_]])
    piece, of = _first_pieces(points[rows], normals[rows], level, spacing, near, tools, threads,
                              lambda f: report(0.3 + 0.7 * f))
    gone = np.where(stands | (had <= enough), NEVER, -1)  # a side that never had stock loses none
    done, mover = np.where(left <= enough, -1, NEVER), np.full(len(points), -1, np.int64)
    count = int(stands.sum())
    gone[stands] = piece[:count]
    numbers = np.append(np.flatnonzero(beside), -1)  # the last one for none
    done[open_], mover[open_] = piece[count:], numbers[of[count:]]
    if lie is Lie.LEVEL:
        wide = np.array([t.diameter for t in tools])[moves.tool[np.maximum(mover, 0)]]
        done[open_] = _later(done, mover >= 0, wide, spacing, near)[open_]
    return CutTimes(gone, done, mover)


def _first_pieces(points: F64, normals: F64, level: F64, spacing: float, moves: Moves, tools: Sequence[ToolBody],
                  threads: int, report: Report) -> tuple[INT, INT]:
    """When less than ``level`` (n,) mm is left on normals first: (n,) piece of the path, NEVER where at no time, and
    (n,) its move, -1 where none."""
    piece, of = np.full(len(points), NEVER), np.full(len(points), -1, np.int64)
    count = _pieces(moves, spacing)
    ends = np.cumsum(count)
    total, first = int(ends[-1]) if len(ends) else 0, 0
    while first < len(moves) and (open_ := np.flatnonzero(of < 0)).size:
        before = int(ends[first] - count[first])
        last = max(int(np.searchsorted(ends, before + PIECES, side="right")), first + 1)
        chosen = np.zeros(len(moves), np.bool_)
        chosen[first:last] = True
        pieces, owner = moves.only(chosen).parted(count[first:last])
        met = first_below(points[open_], normals[open_], level[open_], pieces, tools, threads=threads)
        rows = open_[met >= 0]
        piece[rows], of[rows] = before + met[met >= 0], first + owner[met[met >= 0]]
        first = last
        report(int(ends[last - 1]) / total)
    return piece, of


def _later(piece: INT, chosen: NDArray[np.bool_], way: F64, spacing: float, moves: Moves) -> INT:
    """(n,) index, the piece that comes ``way`` (n,) mm of path after each of the chosen pieces (n,)."""
    length = np.linalg.norm(moves.end - moves.start, axis=1)
    count = _pieces(moves, spacing)
    ends, far = np.concatenate([[0], np.cumsum(count)]), np.concatenate([[0.0], np.cumsum(length)])
    out = piece.copy()
    at = np.interp(piece[chosen].astype(np.float64), ends, far) + way[chosen]
    out[chosen] = np.ceil(np.interp(at, far, ends)).astype(np.int64)
    return out


def _pieces(moves: Moves, spacing: float) -> INT:
    """(m,) number of pieces of each move, no longer than ``spacing`` mm."""
    return np.maximum(np.ceil(np.linalg.norm(moves.end - moves.start, axis=1) / spacing), 1.0).astype(np.int64)


def _boxes(moves: Moves, rows: INT, tools: Sequence[ToolBody], room: float) -> tuple[F64, F64]:
    """Boxes, corners (k, 3) and (k, 3), mm, that hold the cutting part of moves and ``room`` round it."""
    reach = np.array([np.hypot(t.widest_radius, t.flute_length) if moves.axes is not None else t.widest_radius
                      for t in tools])
    wide = reach[moves.tool[rows]][:, None] + room
    low, high = (f(moves.start[rows], moves.end[rows]) for f in (np.minimum, np.maximum))
    tall = wide if moves.axes is not None else np.array([t.flute_length for t in tools])[moves.tool[rows]][:, None]
    up = np.concatenate([wide, wide, tall + room], axis=1)
    down = np.concatenate([wide, wide, wide if moves.axes is not None else np.full_like(wide, room)], axis=1)
    return low - down, high + up


def _beside(moves: Moves, tools: Sequence[ToolBody], points: F64, room: F64) -> NDArray[np.bool_]:
    """(m,) bool: moves whose box meets the box of all places."""
    low, high = _boxes(moves, np.arange(len(moves)), tools, float(room.max()))
    return np.asarray(((low <= points.max(axis=0)) & (high >= points.min(axis=0))).all(axis=1))


def _free_ways(walls: ThinWalls, times: Sequence[CutTimes], low: float) -> tuple[F64, NDArray[np.bool_]]:
    """(n,) mm, distance of each place from the support of its wall when both sides are done, and (n,) which count.

    low : mm, Z of the bottom of the part
    """
    one, other = times
    middle = 0.5 * (walls.points + walls.across)
    stands = _joined_stock(walls, middle, np.minimum(one.gone, other.gone), low)
    done = np.maximum(one.done, other.done)
    judged = walls.free & (done != NEVER) & (np.maximum(one.mover, other.mover) >= 0)
    free = np.zeros(len(walls))
    for number in np.unique(walls.wall[judged]).tolist():
        own = np.flatnonzero(walls.wall == number)
        tried = own[judged[own]]
        held = walls.support[own]  # by the finished part
        for rows in np.array_split(tried, -(-len(tried) // BLOCK)):
            way = cdist(middle[rows], middle[own])
            by_stock = np.where(stands[own] >= done[rows][:, None], way, np.inf).min(axis=1)
            free[rows] = np.minimum(by_stock, (way + held).min(axis=1))
    # a sheet without any support, such as one that hangs in the stock
    return np.where(np.isfinite(free), free, 2.0 * walls.limit), judged


def _joined_stock(walls: ThinWalls, middle: F64, stands: INT, low: float) -> INT:
    """(n,) index, time up to which stock ``stands`` and is joined with what holds the wall.

    Stock on both sides is joined through places of the wall where it stands too. It is held where the finished part
    holds the wall, near the bottom of the part, and where the wall goes on beyond 60 degrees. So an island of stock on
    a thin wall holds nothing. A wall without such a place keeps ``stands``.
    """
    level = np.abs(walls.normals[:, 2])
    roots = ~walls.free | (np.abs(level - LEVEL) < BEND) | (walls.points[:, 2] < low + walls.limit * (level < LEVEL))
    pairs = cKDTree(middle).query_pairs(max(NEAR * walls.spacing, float(np.median(walls.thickness))),
                                        output_type="ndarray").astype(np.int64)
    pairs = pairs[walls.wall[pairs[:, 0]] == walls.wall[pairs[:, 1]]]
    joined = np.minimum(stands, widest_paths(pairs, stands, roots))
    return np.where(np.isin(walls.wall, np.unique(walls.wall[roots])), joined, stands)


def _findings(walls: ThinWalls, lie: Lie, free: F64, over: INT, times: Sequence[CutTimes], setup: ProofSetup,
              scored: ScoredSamples, source: Source, zone_ids: Sequence[str]) -> list[Finding]:
    """A finding for each wall and program, at the worst of its places (k,) ``over`` the limit."""
    last = np.where(times[0].done >= times[1].done, times[0].mover, times[1].mover)
    last = np.where(last >= 0, last, np.maximum(times[0].mover, times[1].mover))
    out = []
    groups = np.column_stack([source.program[last[over]], walls.wall[over]])
    _, group = np.unique(groups, axis=0, return_inverse=True)
    for number in range(int(group.max(initial=-1)) + 1):
        mine = over[group.reshape(-1) == number]
        k = int(mine[np.argmax(free[mine] / walls.limit[mine])])
        m, row = int(last[k]), int(walls.row[k])
        zone = int(scored.zone[row])
        x, y, z = (round(float(v), 6) for v in walls.points[k])
        lines = source.line[last[mine]]
        span = f", lines {int(lines.min())} to {int(lines.max())}" if lines.min() < lines.max() else ""
        text = f"T{source.tool[m]} " + TEXTS[lie].format(walls.limit[k] / setup.free_ratio, free[k],
                                                                setup.free_ratio, span)
        out.append(Finding(FindingKind.SUPPORT, source.names[source.program[m]], int(source.line[m]),
                           zone_ids[zone - 1] if zone else None, f"F{scored.samples.face[row]}", (x, y, z),
                           float(free[k]), float(walls.limit[k]), text, len(mine)))
    return out


__all__ = ["Support", "supported"]
