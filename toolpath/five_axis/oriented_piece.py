"""Passes of a tilted tool as poses: their parts, raised over obstacles and thinned out.

Arrays are float64. Tips are in mm, axes and normals dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from geometry.mesh import F64
from toolpath.lines import true_runs
from toolpath.poses import Blocked, between

RAISES = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # radii along the axis, where the end of the tool is blocked
RISE = 0.3  # mm for each mm of way, at which a pass rises and falls
MIN_PIECE = 1.0  # radii: shorter pieces are left to other passes


@dataclass(frozen=True, eq=False)
class Piece:
    """A pass, or part of one, in the order of machining.

    tips   : (k, 3) float64, mm
    axes   : (k, 3) float64, unit, tip to spindle
    away   : (k, 3) float64, unit, out of the surface
    reach  : mm from the tip, how far up the flank cuts; for an end, how far off the axis
    on_end : the end of the tool cuts, tilted forward: the pass has one direction
    """

    tips: F64
    axes: F64
    away: F64
    reach: float
    on_end: bool = False

    def reversed(self) -> Piece:
        """The same in the other direction."""
        return Piece(self.tips[::-1], self.axes[::-1], self.away[::-1], self.reach, self.on_end)

    def raised(self, by: float) -> Piece:
        """The same with every pose moved along its axis; by : mm."""
        return replace(self, tips=self.tips + by * self.axes)

    def at(self, places: F64) -> Piece:
        """The piece through other poses.

        places : (m,) float64, index of its own poses, with fractions between them
        """
        tips, axes = between(self.tips, self.axes, places)
        away = between(self.tips, self.away, places)[1]
        return Piece(tips, axes, away, self.reach, self.on_end)

    def parts(self, good: NDArray[np.bool_], places: F64, min_length: float) -> list[Piece]:
        """Its parts through good places, each at least ``min_length`` mm long at the tip.

        good   : (m,) bool, whether the part may pass a place
        places : (m,) float64, index as for ``at``, ascending, from 0 to the last pose
        """
        out = []
        for i, j in true_runs(good):
            own = np.arange(np.floor(places[i]) + 1.0, np.ceil(places[j - 1]))
            part = self.at(np.concatenate([[places[i]], own, [places[j - 1]]]))
            if j - i > 1 and part.length >= min_length:
                out.append(part)
        return out

    @property
    def length(self) -> float:
        """Length of the tip's way, mm."""
        return float(np.linalg.norm(np.diff(self.tips, axis=0), axis=1).sum())

    @property
    def top(self) -> float:
        """Height of the highest place of the cutting flank, mm."""
        return float((self.tips[:, 2] + self.reach * self.axes[:, 2]).max())


def thinned_poses(tips: F64, axes: F64, reach: float, tolerance: float) -> NDArray[np.int64]:
    """Poses to keep, (k,) int64, index: between them tip and the place ``reach`` mm up the axis keep a tolerance
    [Douglas1973].

    tips, axes : (n, 3) float64, mm and unit, access frame, evenly spaced
    tolerance  : mm
    """
    way = np.hstack([tips, tips + reach * axes])
    keep = np.zeros(len(way), np.bool_)
    keep[[0, -1]] = True
    todo = [(0, len(way) - 1)]
    while todo:
        a, b = todo.pop()
        if b - a < 2:
            continue
        share = np.arange(1, b - a)[:, None] / (b - a)
        off = way[a + 1:b] - ((1.0 - share) * way[a] + share * way[b])
        miss = np.maximum(np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:], axis=1))
        worst = int(miss.argmax())
        if miss[worst] > tolerance:
            keep[a + 1 + worst] = True
            todo += [(a, a + 1 + worst), (a + 1 + worst, b)]
    return np.flatnonzero(keep)


def raised_poses(tip: F64, axis: F64, blocked: Blocked, radius: float,
                 max_rise: float) -> tuple[F64, NDArray[np.bool_]]:
    """Distances to raise poses along their axes, (n,) float64, mm, and (n,) bool where they are blocked all the same.

    tip, axis : (n, 3) float64, mm and unit, access frame, in the order of the pass, close together
    blocked   : whether poses are not free
    radius    : mm; poses are raised in shares of it, evenly before and behind
    max_rise  : mm
    """
    need = np.full(len(tip), np.nan)
    todo = np.arange(len(tip))
    for share in RAISES:
        if share * radius > max_rise or not len(todo):
            break
        met = blocked(tip[todo] + share * radius * axis[todo], axis[todo])
        need[todo[~met]] = share * radius
        todo = todo[met]
    # an obstacle may begin before the pose that meets it
    out = maximum_filter1d(np.nan_to_num(need), 3, mode="nearest")
    way = RISE * np.linalg.norm(np.diff(tip, axis=0), axis=1)
    for order in (range(1, len(out)), range(len(out) - 2, -1, -1)):
        for k in order:
            before, gone = (k - 1, way[k - 1]) if order.step > 0 else (k + 1, way[k])
            out[k] = max(out[k], out[before] - gone)
    met = np.isnan(need)
    met[~met] = blocked((tip + out[:, None] * axis)[~met], axis[~met])
    return out, met
