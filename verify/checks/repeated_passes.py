"""Parts of a program that run a second time and remove nothing.

A pass over ground that it has finished before is a spring pass, and a note: it stays at one level. What is no finishing
pass, as a layer that is pasted twice, a zone of several levels, and a whole program that is pasted twice are findings.
"""

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
LEVEL = 1e-3  # mm: heights closer than that are one level
FINISHED = 0.5  # share of the length of a pass that has to leave places within the budget
MAX_NOTES = 8


def repeats(moves: Moves, cut: NDArray[np.bool_], source: Source,
            finishes: NDArray[np.bool_] | None = None) -> tuple[list[Finding], list[str]]:
    """Findings and notes on runs of feed moves over at least 4 lines that repeat earlier ones and remove no stock.

    cut      : (m,) bool, moves that removed stock
    finishes : (m,) bool, moves that leave some place of the part within its budget; None: none do
    """
    length = np.linalg.norm(moves.end - moves.start, axis=1)
    done = np.zeros(len(moves), np.bool_) if finishes is None else finishes
    findings, notes = [], []
    for group in _groups(moves, cut):
        whole = _whole(moves, group)
        for a, b, shift in group:
            if source.line[b] - source.line[a] + 1 < MIN_LINES:
                continue
            both = done[a:b + 1] | done[a - shift:b + 1 - shift]
            spring = _ring(moves, a, b) and len(group) == 1
            words = (f"T{source.tool[a]}: lines {source.line[a]} to {source.line[b]} repeat lines "
                     f"{source.line[a - shift]} to {source.line[b - shift]} and remove no stock")
            fine = length[a:b + 1][both].sum() >= FINISHED * length[a:b + 1].sum()
            if fine and _one_level(moves, a, b) and (spring or not whole):
                notes.append(f"{source.names[source.program[a]]}, {words}: a pass over finished ground")
            elif spring and shift == b - a + 1:
                continue
            else:
                place = tuple(round(float(v), 6) for v in moves.end[a])
                findings.append(Finding(FindingKind.PROGRAM, source.names[source.program[a]], int(source.line[a]),
                                        None, None, place, 0.0, 0.0, words, b - a + 1))  # type: ignore[arg-type]
    if len(notes) > MAX_NOTES:
        notes[MAX_NOTES - 1:] = [f"{notes[MAX_NOTES - 1]} (and {len(notes) - MAX_NOTES} more such passes)"]
    return findings, notes


def _groups(moves: Moves, cut: NDArray[np.bool_]) -> list[list[tuple[int, int, int]]]:
    """Runs one after the other that repeat the same part: between them are rapids, or moves too few to be a run."""
    out: list[list[tuple[int, int, int]]] = []
    for run in _runs(moves, cut):
        if out and out[-1][-1][2] == run[2]:
            out[-1].append(run)
        else:
            out.append([run])
    return out


def _whole(moves: Moves, group: list[tuple[int, int, int]]) -> bool:
    """Whether all feed moves before a group, but for a few on the way, run again in it."""
    first, last, shift = group[0][0], group[-1][1], group[0][2]
    before = int(moves.feed[:first - shift].sum())
    between = int(moves.feed[last - shift + 1:first].sum())
    return before < WINDOW and between < WINDOW


def _one_level(moves: Moves, a: int, b: int) -> bool:
    """Whether moves a..b cut at one level along the tool axis, but for ways down and up."""
    up = np.array([0.0, 0.0, 1.0]) if moves.axes is None else moves.axes.axis[a]
    start, end = moves.start[a:b + 1] @ up, moves.end[a:b + 1] @ up
    way = np.linalg.norm(moves.end[a:b + 1] - moves.start[a:b + 1], axis=1)
    flat = np.abs(end - start) < LEVEL
    return bool(way[flat].sum() >= way[~flat].sum() and np.ptp(end[flat]) < LEVEL)


def _ring(moves: Moves, a: int, b: int) -> bool:
    """Whether moves a..b are a closed level path."""
    way = moves.end[a:b + 1] - moves.start[a:b + 1]
    up = np.array([0.0, 0.0, 1.0]) if moves.axes is None else moves.axes.axis[a]
    closed = np.linalg.norm(moves.end[b] - moves.start[a]) < 1e-3
    return bool(closed and np.abs(way @ up).max() < 1e-6)


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
