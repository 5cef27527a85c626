"""Drills and taps that cut sideways, taps that leave their thread the wrong way, and tools that turn backwards.

Lips and leads cut along the axis only. A tap comes out of its thread at the pitch, so it feeds out. Coordinates are in
the setup frame, lengths in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.moves import Moves
from verify.tool_axes import ToolAxes

ASIDE = 0.01  # mm: coordinates of programs have three decimals


def sideways_findings(moves: Moves, cut: NDArray[np.bool_], tools: Sequence[ToolBody], source: Source) -> list[Finding]:
    """One finding for each line in which a drill or tap removes stock on a way that is not along its axis.

    cut : (m,) bool, whether each move removes stock

    The way across the axis counts from where the tool began to cut, so steps of 0.009 mm are a way too. It is the depth
    of a finding, mm.
    """
    only = np.array([t.along_axis_only for t in tools], np.bool_)
    if not only.any() or not len(moves):
        return []
    axes = moves.axes or ToolAxes.upright(len(moves))
    way, up = moves.end - moves.start, axes.middle
    cuts = moves.feed & cut & only[moves.tool]
    begins = cuts.copy()
    begins[1:] &= ~(cuts[:-1] & (moves.tool[1:] == moves.tool[:-1]) & (source.program[1:] == source.program[:-1]))
    first = np.maximum.accumulate(np.where(begins, np.arange(len(moves)), 0))
    way = np.where(cuts[:, None], moves.end - moves.start[first], way)
    aside = np.linalg.norm(way - np.einsum("ij,ij->i", way, up)[:, None] * up, axis=1)
    bad = np.flatnonzero(cuts & ((aside > ASIDE) | (axes.angle > 0.0)))
    return one_a_line(bad, aside, moves.end, source, lambda m: (
        f"T{source.tool[m]} is a {tools[moves.tool[m]].kind} and cuts {aside[m]:.3f} mm sideways; it cuts along its "
        "axis only"))


def torn_threads(moves: Moves, cut: NDArray[np.bool_], inside: NDArray[np.bool_], tools: Sequence[ToolBody],
                 source: Source) -> list[Finding]:
    """One finding for each line in which a tap in its thread moves at rapid: the thread would be torn out.

    cut    : (m,) bool, whether each move removes stock
    inside : (m,) bool, whether the teeth touch the part where each move begins

    The depth of a finding is the way of the rapid, mm.
    """
    taps = np.array([t.kind == "tap" for t in tools], np.bool_)
    if not taps.any() or len(moves) < 2:
        return []
    way = np.linalg.norm(moves.end - moves.start, axis=1)
    same = (moves.tool[1:] == moves.tool[:-1]) & (source.program[1:] == source.program[:-1])
    bad = 1 + np.flatnonzero(taps[moves.tool[:-1]] & same & moves.feed[:-1] & (cut[:-1] | inside[1:])
                             & ~moves.feed[1:] & (way[1:] > ASIDE))
    return one_a_line(bad, way, moves.start, source, lambda m: (
        f"T{source.tool[m]} is a tap and leaves its thread at rapid; it feeds out as it fed in"))


def tapped_out(moves: Moves, cut: NDArray[np.bool_], inside: NDArray[np.bool_], tools: Sequence[ToolBody],
               source: Source, taps: Sequence[Mapping[int, bool]], reversed_by: NDArray[np.int64]) -> list[Finding]:
    """One finding for each line in which a tap is fed out of its thread although the spindle is not reversed.

    cut    : (m,) bool, whether each move removes stock
    inside : (m,) bool, whether the teeth touch the part where each move begins
    taps   : by program, ``Program.taps``; another tool than a tap in such a line is a finding too
    reversed_by : (m,) int64, index, as ``Program.reversed_by``

    A floating chuck (G63) lets the program reverse the spindle by M3 and M4, so what counts is how the spindle turned
    in the last feed of the tap into the part.
    """
    if not any(taps) and not any(t.kind == "tap" for t in tools) or len(moves) < 2:
        return []
    up = np.tile([0.0, 0.0, 1.0], (len(moves), 1)) if moves.axes is None else moves.axes.axis
    way = np.linalg.norm(moves.end - moves.start, axis=1)
    rise = np.einsum("ij,ij->i", moves.end - moves.start, up)
    is_tap = np.array([t.kind == "tap" for t in tools], np.bool_)[moves.tool]
    follows = np.zeros(len(moves), np.bool_)
    follows[1:] = (moves.tool[1:] == moves.tool[:-1]) & (source.program[1:] == source.program[:-1]) & cut[:-1]
    out = np.flatnonzero(is_tap & moves.feed & (rise > ASIDE) & (follows | inside))
    way_in = np.maximum.accumulate(np.where(is_tap & moves.feed & (rise < -ASIDE), np.arange(len(moves)), -1))[out]
    back = ((way_in >= 0) & (moves.tool[way_in] == moves.tool[out]) & (source.program[way_in] == source.program[out])
            & ((reversed_by[way_in] > 0) != (reversed_by[out] > 0)))
    torn = np.array([m for m in out[~back].tolist() if not taps[source.program[m]].get(int(source.line[m]), False)],
                    np.intp)
    odd = np.concatenate([np.zeros(0, np.int64), *(np.flatnonzero(
        ~is_tap & moves.feed & (way > ASIDE) & (source.program == k) & np.isin(source.line, sorted(lines)))
        for k, lines in enumerate(taps))])
    return [*one_a_line(torn, way, moves.start, source, lambda m: (
        f"T{source.tool[m]} is a tap and is fed out of its thread while the spindle turns on; a tapping cycle turns it "
        "back")), *one_a_line(odd, way, moves.start, source, lambda m: (
            f"T{source.tool[m]} is a {tools[moves.tool[m]].kind.replace('_', ' ')} and no tap, and the cycle turns it "
            "back in its hole"))]


def turned_backwards(moves: Moves, reversed_by: NDArray[np.int64], tools: Sequence[ToolBody],
                     source: Source) -> list[Finding]:
    """One finding for each word by which the spindle turns backwards in a feed of a tool that cuts forwards.

    reversed_by : (m,) int64, index, as ``Program.reversed_by``

    A tap may turn backwards on its way out.
    """
    up = np.tile([0.0, 0.0, 1.0], (len(moves), 1)) if moves.axes is None else moves.axes.axis
    leaves = np.einsum("ij,ij->i", moves.end - moves.start, up) > 0.0
    is_tap = np.array([t.kind == "tap" for t in tools], np.bool_)[moves.tool]
    bad = np.flatnonzero((reversed_by > 0) & moves.feed & ~(is_tap & leaves))
    words = replace(source, line=reversed_by.astype(np.int32))
    return one_a_line(bad, np.zeros(len(moves)), moves.start, words, lambda m: (
        f"M4 turns the spindle backwards, and T{source.tool[m]} feeds in line {source.line[m]}"))


def one_a_line(bad: NDArray[np.intp], depth: F64, at: F64, source: Source,
                words: Callable[[int], str]) -> list[Finding]:
    """Findings of moves, one for each line: the first of its moves counts.

    bad   : (n,) intp, index, moves
    depth : (m,) float64, mm, of a finding at each move
    at    : (m, 3) float64, mm, setup frame, place of each move
    words : gives the message of a move
    """
    out, seen = [], set[tuple[int, int]]()
    for m in bad.tolist():
        key = (int(source.program[m]), int(source.line[m]))
        if key in seen:
            continue
        seen.add(key)
        x, y, z = (round(float(v), 6) for v in at[m])
        out.append(Finding(FindingKind.PROGRAM, source.names[key[0]], key[1], None, None, (x, y, z), float(depth[m]),
                           0.0, words(m), tip=(x, y, z)))
    return out


__all__ = ["one_a_line", "sideways_findings", "tapped_out", "torn_threads", "turned_backwards"]
