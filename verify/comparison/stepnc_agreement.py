"""Compares two readings of one job: NC program and STEP-NC file must describe the same motion.

Moves are compared one by one. Left out are moves of unknown start in both readings and blocks that turn the tool about
its own axis; the pieces of a turning block count as one move. STEP-NC leaves the move from a tool change to the next
path to the control; there the rapids of the other reading up to the same place are not compared. A stretch of one feed
with different numbers of points, such as an arc against chords, is compared as a line in space. The chords of a G2 or
G3 may leave their arc by ``CHORD``, so points of STEP-NC on that arc may be that much farther off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.errors import InternalError
from geometry.mesh import F64
from verify.program.arc_chords import CHORD
from verify.program.program import Program

TIP = 1e-3  # mm
AXIS = 1e-6  # of unit vectors, per component
FEED = 1e-6  # share; feed words are decimal, so equal feeds differ by rounding only
INVERSE = 1e-4  # 1/min, rounding of inverse time words, which time the turning blocks of joints
STILL_TIP, STILL_AXIS = 5e-5, 3e-6  # mm and of unit vectors: smaller moves count as none


@dataclass(frozen=True)
class Agreement:
    """Result of a comparison: number of moves, and the largest differences of tip, mm, and axis, of unit vectors."""

    moves: int
    tip: float
    axis: float


class _Rows:
    """The moves of one reading in the form that is compared.

    at    : (n, 12) start and end of the tip, mm, and of the axis
    pace  : feed, mm/min, 0 for rapids
    alike : for each row, the end of the rows from it on with exactly its tool, kind, feed and speed
    """

    def __init__(self, p: Program, *, arrivals: bool) -> None:
        up = np.tile([0.0, 0.0, 1.0], (len(p), 1))
        first, last = (up, up) if p.poses is None else (p.poses.start_axis, p.poses.end_axis)
        at = np.hstack([p.start, p.end, first, last])
        rapid = np.isnan(p.feed)
        unknown = np.zeros(len(p), np.bool_)
        unknown[p.unknown[:, 0]] = True
        turning = np.abs(last - first).max(axis=1, initial=0.0) > 0.0
        on = np.zeros(len(p), np.bool_)  # continues the turning block before it
        on[1:] = (turning[1:] & turning[:-1] & (p.line[1:] == p.line[:-1]) & (rapid[1:] == rapid[:-1])
                  & (p.tool[1:] == p.tool[:-1]) & ~unknown[1:] & ~unknown[:-1])
        begins = np.flatnonzero(~on)
        ends = np.r_[begins[1:], len(p)] - 1 if len(p) else begins
        at = np.hstack([at[begins, :3], at[ends, 3:6], at[begins, 6:9], at[ends, 9:]])
        moves = ((np.abs(at[:, 3:6] - at[:, :3]).max(axis=1, initial=0.0) > STILL_TIP)
                 | (np.abs(at[:, 9:] - at[:, 6:9]).max(axis=1, initial=0.0) > STILL_AXIS))
        keep = np.where(unknown[begins], arrivals, moves)
        rows = begins[keep.astype(np.bool_)]
        self.at, self.name = at[keep.astype(np.bool_)], p.name
        self.rapid, self.feed, self.tool, self.line = rapid[rows], p.feed[rows].copy(), p.tool[rows], p.line[rows]
        self.arrival, self.turning = unknown[rows], turning[rows]
        self.speed, self.coolant = p.speed[rows], p.coolant[rows]
        took = np.add.reduceat(p.minutes, begins)[keep.astype(np.bool_)] if len(begins) else p.minutes
        tip = np.linalg.norm(self.at[:, 3:6] - self.at[:, :3], axis=1) / np.where(took > 0.0, took, np.inf)
        # turning joints are fed by time: the speed of the tip follows from it, with the rounding of both
        other = np.abs(tip - self.feed) > FEED * np.nan_to_num(self.feed)
        self.timed = self.turning & ~self.rapid & other & (tip > 0.0)
        self.feed[self.timed] = tip[self.timed]
        self.pace = np.nan_to_num(self.feed)
        words = np.column_stack([self.rapid, self.tool, self.pace, self.speed])
        ends = np.append(np.flatnonzero((words[1:] != words[:-1]).any(axis=1)) + 1, len(words))
        self.alike = ends[np.searchsorted(ends, np.arange(len(words)), side="right")] if len(words) else ends

    def __len__(self) -> int:
        return len(self.at)


def check_agreement(nc: Program, stepnc: Program) -> Agreement:
    """Compare a STEP-NC file [ISO14649-10; ISO10303-238] with the NC program of the same job.

    nc, stepnc : as read, both in the frame of the program

    Returns
    -------
    Agreement
        Number of compared moves and the largest differences.

    Raises
    ------
    InternalError
        Code stepnc_differs. The tips are more than 0.001 mm apart, or the axes more than 1e-6. Or feed, tool or kind of
        a move differ, or speed or coolant of a feed move. Or one reading has more moves. The message names the lines of
        both.
    """
    a, b = _Rows(nc, arrivals=False), _Rows(stepnc, arrivals=True)
    i, moves, tip, axis = 0, 0, 0.0, 0.0
    marks = [*np.flatnonzero(b.arrival).tolist(), len(b)]
    for k, end in enumerate(marks):
        begin = marks[k - 1] + 1 if k else 0
        if k:
            place = b.at[marks[k - 1], 3:6]
            while i < len(a) and a.rapid[i] and np.abs(a.at[i, :3] - place).max() > TIP:
                i += 1
        count = end - begin
        if i + count <= len(a) and _same_words(a, i, b, begin, count) is None:
            apart = np.abs(a.at[i:i + count] - b.at[begin:end])
            bad = np.flatnonzero((apart[:, :6].max(axis=1, initial=0.0) > TIP)
                                 | (apart[:, 6:].max(axis=1, initial=0.0) > AXIS))
            if len(bad) and not _chords(a, i, i + count):
                _differ(a, i + int(bad[0]), b, begin + int(bad[0]), "go to different places or have different axes")
            if not len(bad):
                tip = max(tip, float(apart[:, :6].max(initial=0.0)))
                axis = max(axis, float(apart[:, 6:].max(initial=0.0)))
                i, moves = i + count, moves + count
                continue
        i, far = _by_stretches(a, i, b, begin, end)
        tip, moves = max(tip, far), moves + count
    while i < len(a) and a.rapid[i]:
        i += 1  # to the end
    if i < len(a):
        _differ(a, i, b, len(b) - 1, "do not end together")
    return Agreement(moves, tip, axis)


def _same_words(a: _Rows, i: int, b: _Rows, j: int, count: int) -> int | None:
    """The first of ``count`` moves whose tool, kind or feed differs; None where none does."""
    mine, theirs = slice(i, i + count), slice(j, j + count)
    rapid = a.rapid[mine]
    way = np.linalg.norm(a.at[mine, 3:6] - a.at[mine, :3], axis=1)
    feed, other = (np.where(rapid, 0.0, pace) for pace in (a.pace[mine], b.pace[theirs]))
    slack = FEED * other + np.where(a.timed[mine], INVERSE * way + other * TIP / np.maximum(way, TIP), 0.0)
    turned = np.abs(a.speed[mine] - b.speed[theirs]) > FEED * b.speed[theirs]
    wet = a.coolant[mine] != b.coolant[theirs]
    bad = np.flatnonzero((rapid != b.rapid[theirs]) | (a.tool[mine] != b.tool[theirs])
                         | (np.abs(feed - other) > slack) | (~rapid & (turned | wet)))
    return int(bad[0]) if len(bad) else None


def _by_stretches(a: _Rows, i: int, b: _Rows, begin: int, end: int) -> tuple[int, float]:
    """Compare stretches of one tool, kind and feed as lines in space.

    Returns the next row of ``a``, and the distance, mm, less the allowed deviation of chords from their arcs.
    """
    far = 0.0
    while begin < end:
        last_b = _stretch(b, begin, end)
        if i >= len(a):
            _differ(a, len(a) - 1, b, begin, "do not end together")
        last_a = _stretch(a, i, len(a))
        if b.rapid[begin]:  # rapids have no arcs, and ``a`` may continue to places that ``b`` does not have
            last_a = min(last_a, i + last_b - begin)
        if _same_words(a, i, b, begin, 1) is not None:
            _differ(a, i, b, begin, "have different feeds, speeds, coolant, tools or kinds of move")
        if last_a - i == last_b - begin and not _chords(a, i, last_a):
            apart = float(np.abs(a.at[i:last_a, :6] - b.at[begin:last_b, :6]).max(initial=0.0))
            leaning = float(np.abs(a.at[i:last_a, 6:] - b.at[begin:last_b, 6:]).max(initial=0.0))
        else:
            one, other = (np.vstack([r.at[k, :3], r.at[k:m, 3:6]]) for r, k, m in ((a, i, last_a), (b, begin, last_b)))
            bow = CHORD if _chords(a, i, last_a) else 0.0
            apart = max(_along(one, other, TIP), _along(other, one, TIP + bow) - bow)
            axis = np.tile(a.at[i, 6:9], 2)  # stretches with different points must not turn
            leaning = max(float(np.abs(r.at[k:m, 6:] - axis).max()) for r, k, m in ((a, i, last_a), (b, begin, last_b)))
        if apart > TIP or leaning > AXIS:
            _differ(a, i, b, begin, f"are {apart:.4f} mm apart after this move, or have different axes")
        far, i, begin = max(far, apart), last_a, last_b
    return i, far


def _chords(r: _Rows, begin: int, end: int) -> bool:
    """Whether some of these moves are chords of one block, an arc."""
    return bool((r.line[begin + 1:end] == r.line[begin:end - 1]).any())


def _stretch(r: _Rows, begin: int, end: int) -> int:
    """End of the moves from ``begin`` on with its tool, kind and feed; feed moves also need its spindle speed."""
    first, at = r.pace[begin], int(r.alike[begin])
    while at < end:  # feeds that differ by rounding alone are one
        if (r.rapid[at] != r.rapid[begin] or r.tool[at] != r.tool[begin]
                or abs(r.pace[at] - first) > FEED * first
                or (r.speed[at] != r.speed[begin] and not r.rapid[begin])):
            return at
        at = int(r.alike[at])
    return end


def _along(points: F64, way: F64, limit: float) -> float:
    """mm, largest distance of points (n, 3) from a polyline (m, 3), matched in order along it.

    The search ends at the first point that is farther than the limit.
    """
    if (abreast := _abreast(points, way)) <= limit:
        return abreast
    at, far = 0, 0.0
    for p in points:
        best, place = np.inf, at
        for k in range(at, len(way) - 1):
            d = way[k + 1] - way[k]
            share = min(max(float((p - way[k]) @ d) / max(float(d @ d), 1e-30), 0.0), 1.0)
            distance = float(np.linalg.norm(p - way[k] - share * d))
            if distance < best:
                best, place = distance, k
            elif best <= limit:
                break
        at, far = place, max(far, best)
        if far > limit:
            return far
    return far


def _abreast(points: F64, way: F64) -> float:
    """An upper bound of ``_along``: each point is matched with the few segments at the same share of the length."""
    gone, length = (np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))) for x in (points, way))
    if len(way) < 2 or not (gone[-1] > 0.0 and length[-1] > 0.0):
        return np.inf
    place = np.searchsorted(length, gone * (length[-1] / gone[-1])) - 1
    k = np.minimum(np.maximum(place[:, None] + np.arange(-2, 3), 0), len(way) - 2)
    begin, d = way[k], way[k + 1] - way[k]
    off = points[:, None] - begin
    share = np.minimum(np.maximum((off * d).sum(axis=2) / np.maximum((d * d).sum(axis=2), 1e-30), 0.0), 1.0)
    return float(np.sqrt(((off - share[..., None] * d)**2).sum(axis=2).min(axis=1).max()))


def _differ(a: _Rows, i: int, b: _Rows, j: int, how: str) -> None:
    """Raise the error that names the moves of both."""
    words = []
    for r, k in ((a, i), (b, j)):
        if 0 <= k < len(r):
            kind = "rapid" if r.rapid[k] else f"F{r.feed[k]:.6g}"
            place = " ".join(f"{v:.4f}" for v in (*r.at[k, 3:6], *r.at[k, 9:]))
            words.append(f"{r.name} line {r.line[k]}: T{r.tool[k]} {kind} to {place}")
        else:
            words.append(f"{r.name}: no move")
    raise InternalError(f"the STEP-NC file and the program of the job {how}: {'; '.join(words)}",
                            code="stepnc_differs", subjects=(a.name, b.name), measured=words,
                            remedy="please report it with part and setup; nothing is delivered")


__all__ = ["Agreement", "check_agreement"]
