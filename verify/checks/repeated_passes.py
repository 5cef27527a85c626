"""Parts of a program that run a second time and remove nothing: a zone pasted twice, a pass not deleted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.moves import Moves

MIN_LINES = 4
WINDOW = 8
ROUND = 1e-6  # mm, rad: closer moves are the same


def repeat_findings(moves: Moves, cut: NDArray[np.bool_], source: Source) -> list[Finding]:
    """One finding for each run of feed moves over at least 4 lines that repeats an earlier one and removes no stock.

    cut : (m,) bool, moves that removed stock

    A closed level path that is repeated at once, a spring pass, is not a finding.
    """
    return [Finding(FindingKind.PROGRAM, source.names[source.program[a]], int(source.line[a]), None, None,
                    tuple(round(float(v), 6) for v in moves.end[a]), 0.0, 0.0,  # type: ignore[arg-type]
                    f"T{source.tool[a]}: lines {source.line[a]} to {source.line[b]} repeat lines "
                    f"{source.line[a - shift]} to {source.line[b - shift]} and remove no stock", b - a + 1)
            for a, b, shift in _runs(moves, cut)
            if source.line[b] - source.line[a] + 1 >= MIN_LINES and not _spring(moves, a, b, shift)]


def _spring(moves: Moves, a: int, b: int, shift: int) -> bool:
    """Whether moves a..b repeat a closed level path at once."""
    way = moves.end[a:b + 1] - moves.start[a:b + 1]
    up = np.array([0.0, 0.0, 1.0]) if moves.axes is None else moves.axes.axis[a]
    closed = np.linalg.norm(moves.end[b] - moves.start[a]) < 1e-3
    return bool(shift == b - a + 1 and closed and np.abs(way @ up).max() < 1e-6)


def _runs(moves: Moves, cut: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """First and last move of each run, and how many moves earlier the same moves are."""
    if len(moves) < 2 * WINDOW:
        return
    idle = moves.feed & ~cut
    windows = np.lib.stride_tricks.sliding_window_view
    whole = np.asarray(windows(idle, WINDOW).all(axis=1))
    if not whole.any():
        return
    key, fed = _keys(moves), np.asarray(windows(moves.feed, WINDOW).all(axis=1))
    _, kind = np.unique(windows(key, WINDOW)[fed], axis=0, return_inverse=True)
    place = np.flatnonzero(fed)
    first = np.full(kind.max(initial=-1) + 1, len(moves))
    np.minimum.at(first, kind.reshape(-1), place)
    earlier = np.full(len(whole), -1)
    earlier[place] = first[kind.reshape(-1)]
    again = np.flatnonzero(whole & (earlier >= 0) & (earlier + WINDOW <= np.arange(len(whole))))
    if len(again) == 0:
        return
    shift = again - earlier[again]
    cuts = np.flatnonzero((np.diff(again) != 1) | (np.diff(shift) != 0)) + 1
    for rows in np.split(np.arange(len(again)), cuts):
        yield int(again[rows[0]]), int(again[rows[-1]]) + WINDOW - 1, int(shift[rows[0]])


def _keys(moves: Moves) -> NDArray[np.int64]:
    """(m,) int64, the same for the same move with the same tool."""
    columns: list[F64] = [moves.start, moves.end, moves.tool[:, None].astype(np.float64)]
    if moves.axes is not None:
        columns += [moves.axes.axis, (moves.axes.about * moves.axes.angle[:, None])]
    table = np.round(np.concatenate(columns, axis=1) / ROUND).astype(np.int64)
    return np.asarray(np.unique(table, axis=0, return_inverse=True)[1].reshape(-1), dtype=np.int64)
