"""Lines of a finish that are needed: each brings some sample to its aim that no other line does.

Passes are laid out for a zone as if stock stood everywhere. Rims of the layers, passes of other rounds and neighbouring
lines have brought part of the samples to size, and a pass there would cut nothing.

Places are in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import Line, dense, pieces_where, thinned
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap

STRAIGHT = 1e-4  # mm: points between which a line is straight to this make one move; it has to take a flat place whole
LEVEL = 1e-3  # mm between the heights of a line that is level
CUT = 0.0  # mm: a sample with no more left is not measured


@dataclass(frozen=True)
class Reach:
    """How lines are cut to the samples that need them, mm.

    beside  : distance within which a place of a line serves a tip: higher up, the side of the cutter would take more
              than the feed of the passes is made for
    spacing : between places of a line that are compared
    overrun : added at both ends of a piece
    join    : gaps no longer than this are closed
    """

    beside: float
    spacing: float
    overrun: float
    join: float


def needed(groups: Sequence[Sequence[Line]], residual: ResidualMap, tool: ToolBody, failing: NDArray[np.int64],
           tips: F64, aim: F64, reach: Reach) -> list[list[Line]]:
    """The lines, or parts of them, without which a failing sample would keep more than its aim.

    groups   : lines in their order
    residual : ResidualMap at the samples, before any of the lines; unchanged
    failing  : (k,) int64, index of the samples above their aim
    tips     : (n, 3) float64, mm, access frame, a tip that touches each sample
    aim      : (n,) float64, mm, residual at which a sample is finished
    reach    : Reach

    Where no line brings a sample to its aim, the one that leaves the least counts. Lines are looked at in their order;
    one that only serves samples which others serve too is left out.
    """
    lines = [line for group in groups for line in group]
    served = _served(lines, residual, tool, failing, tips, reach)
    best = residual.residual.copy()
    for at, left in served:
        np.minimum.at(best, at, left)
    wanted = np.zeros(len(best), np.bool_)
    wanted[failing] = best[failing] < residual.residual[failing]
    goal = np.maximum(best, aim)
    serves = [at[wanted[at] & (left <= goal[at])] for at, left in served]
    count = np.bincount(np.concatenate(serves), minlength=len(best)) if serves else np.zeros(0, np.int64)
    kept: list[list[Line]] = []
    for line, mine in zip(lines, serves, strict=True):
        only = mine[count[mine] == 1]
        if not len(only):
            count[mine] -= 1
            kept.append([])
            continue
        parts = _parts(line, tips[only], reach)
        if parts != [line]:
            count[mine[_away(parts, tips[mine], reach)]] -= 1
        kept.append(parts)
    out, k = [], 0
    for group in groups:
        out.append([part for parts in kept[k:k + len(group)] for part in parts])
        k += len(group)
    return out


def _served(lines: Sequence[Line], residual: ResidualMap, tool: ToolBody, failing: NDArray[np.int64], tips: F64,
            reach: Reach) -> list[tuple[NDArray[np.int64], F64]]:
    """The failing samples that each line comes near, index, and what it leaves there, mm."""
    trial, out = residual.copied(), []
    trial.residual[:] = CUT
    trial.residual[failing] = UNTOUCHED
    over = float((residual.points[failing, 2] - tips[failing, 2]).max(initial=0.0))
    for line in lines:
        # a level line serves no sample farther above it: its tip would be farther away than ``beside``
        above = reach.beside + over if np.ptp(line.points[:, 2]) < LEVEL else math.inf
        trial.cut(thinned(line.points, STRAIGHT), tool, above + LEVEL)
        at = failing[trial.residual[failing] < UNTOUCHED]
        mine = at[~_away([line], tips[at], reach)] if len(at) else at
        out.append((mine, trial.residual[mine].copy()))
        trial.residual[at] = UNTOUCHED
    return out


def _parts(line: Line, tips: F64, reach: Reach) -> list[Line]:
    """The parts of a line near tips (n, 3), mm; the line itself where all of it is, or none."""
    way = Line(dense(line.points, reach.spacing), line.closed)
    near = cKDTree(tips).query(way.points, distance_upper_bound=reach.beside)[0] <= reach.beside
    if near.all() or not near.any():
        return [line]
    parts = pieces_where(way, near, reach.overrun, reach.join)
    return [line] if len(parts) == 1 and parts[0] is way else parts


def _away(parts: Sequence[Line], tips: F64, reach: Reach) -> NDArray[np.bool_]:
    """Which of tips (n, 3), mm, no part serves, (n,) bool."""
    places = np.vstack([dense(p.points, reach.spacing) for p in parts])
    return np.asarray(cKDTree(places).query(tips, distance_upper_bound=reach.beside)[0] > reach.beside)
