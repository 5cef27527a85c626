"""Lines of tool tips: the value that passes, links and layers hand to each other.

Places are in mm, access frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from geometry.mesh import F64
from toolpath.kernels.contour import thin

SAME_PLACE = 1e-6  # mm
BESIDE = 0.1234  # share of that by which the borders between keys are shifted
CORNER = math.radians(30.0)
SHORTEST = 0.11  # mm, a part of a move down that is parted, at least


@dataclass(frozen=True, eq=False)
class Line:
    """A line of tip positions, in climb order (free side on the left where it follows a wall).

    points : (n, 3) float64, mm, access frame; a closed line repeats its first point
    closed : bool
    """

    points: F64
    closed: bool

    @property
    def length(self) -> float:
        """Length, mm."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def reversed(self) -> Line:
        """The same line in the other direction."""
        return Line(np.ascontiguousarray(self.points[::-1]), self.closed)


def thinned(points: F64, tolerance: float) -> F64:
    """A polyline with points left out while the rest stays within a tolerance of it [Douglas1973].

    points    : (n, 3) float64, mm, access frame
    tolerance : mm

    Returns (m, 3) float64, mm, access frame.
    """
    points = np.ascontiguousarray(points)
    keep = np.zeros(len(points), np.bool_)
    thin(points, tolerance, keep)
    return np.ascontiguousarray(points[keep])


def smoothed(way: F64, length: float) -> F64:
    """A way without what wobbles faster than a length: the mean of its places, weighted by a bell along it.

    way    : (n, 2) float64, mm, any frame, n >= 3; one that repeats its first point is closed
    length : mm, standard deviation of the bell; at most a twentieth of the way counts

    Returns
    -------
    (m, 2) float64, mm, its frame, half a length apart; closed as the way is, and with its ends where it is open. A way
    that stays in one place is given back as it is: a contour has one where a node lies just on it.

    Notes
    -----
    A round of radius r becomes smaller by length^2 / (2 r). A corner of the angle t is rounded, and its place moves by
    0.8 length sin(t / 2), at most: the mean of a bell's half is sqrt(2 / pi) lengths from its middle.
    """
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    if s[-1] == 0.0:
        return way
    length = min(length, s[-1] / 20.0)
    count = int(np.ceil(2.0 * s[-1] / length))
    u = np.linspace(0.0, s[-1], count + 1)
    at = np.column_stack([np.interp(u, s, way[:, c]) for c in range(way.shape[1])])
    width = length * count / s[-1]
    if (way[0] == way[-1]).all():
        ring = gaussian_filter1d(at[:-1], width, axis=0, mode="wrap")
        return np.vstack([ring, ring[:1]])
    more = min(int(np.ceil(4.0 * width)) + 1, count)
    before, after = 2.0 * at[:1] - at[more:0:-1], 2.0 * at[-1:] - at[-2:-more - 2:-1]
    out = gaussian_filter1d(np.vstack([before, at, after]), width, axis=0, mode="nearest")[more:-more]
    out[0], out[-1] = at[0], at[-1]
    return np.asarray(out)


def place_keys(points: F64) -> list[bytes]:
    """A key for each point, the same for places that differ by rounding only.

    Lines cut from a lattice lie on simple fractions of it. So the borders between keys lie beside these.

    points : (n, k) float64, mm
    """
    return [row.tobytes() for row in np.floor(points / SAME_PLACE + BESIDE).astype(np.int64)]


def legs(points: F64) -> F64:
    """Lengths of a polyline from corner to corner, (k,) float64, mm; it turns by more than ``CORNER`` there.

    points : (n, 3) float64, mm, access frame
    """
    way = np.diff(points, axis=0)
    size = np.linalg.norm(way, axis=1)
    way, size = way[size > 1e-9], size[size > 1e-9]
    if not len(size):
        return size
    unit = way / size[:, None]
    turns = (unit[1:] * unit[:-1]).sum(axis=1) < math.cos(CORNER)
    return np.asarray(np.add.reduceat(size, np.concatenate([[0], np.flatnonzero(turns) + 1])))


def dense(points: F64, spacing: float) -> F64:
    """A polyline with points added, at most ``spacing`` mm apart along it.

    points : (n, 3) float64, mm, access frame

    Returns (m, 3) float64, mm, access frame.
    """
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    more = np.unique(np.concatenate([s, np.linspace(0.0, s[-1], int(s[-1] / spacing) + 2)]))
    return np.column_stack([np.interp(more, s, points[:, c]) for c in range(3)])


def true_runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Half-open ranges [a, b) of index with consecutive True values.

    flags : (n,) bool
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def pieces_where(line: Line, wanted: NDArray[np.bool_], extend: float, join: float) -> list[Line]:
    """The wanted parts of a line, each extended, with near ones joined.

    wanted : (n,) bool, for the points of the line
    extend : mm, added along the line at both ends of a piece
    join   : mm, pieces nearer than this along the line become one
    """
    if not wanted.any():
        return []
    points = line.points
    if line.closed:
        n = len(points) - 1
        if wanted[:-1].all():
            return [line]
        # begin in the middle of the longest unwanted stretch, so that no piece is cut at the arbitrary start
        order = (np.arange(n) + int(np.argmax(wanted[:-1]))) % n
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[[*order, order[0]]], axis=0), axis=1))])
        a, b = max(true_runs(~wanted[order]), key=lambda run: float(at[run[1]] - at[run[0]]))
        shift = int(order[(a + b) // 2])
        order = np.concatenate([np.arange(shift, n), np.arange(0, shift + 1)])
        points, wanted = points[order], wanted[order]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    spans: list[list[float]] = []
    for a, b in true_runs(wanted):
        lo, hi = s[a] - extend, s[b - 1] + extend
        if spans and lo - spans[-1][1] < join:
            spans[-1][1] = hi
        else:
            spans.append([lo, hi])
    if line.closed and len(spans) == 1 and spans[0][1] - spans[0][0] >= s[-1] - join:
        return [line]
    return [Line(stretch(points, s, max(lo, 0.0), min(hi, s[-1])), False) for lo, hi in spans]


def stretch(points: F64, s: F64, low: float, high: float) -> F64:
    """A polyline from ``low`` to ``high`` mm along it.

    points : (n, 3) float64, mm, access frame
    s      : (n,) float64, mm, distance of its points along it

    Returns (m, 3) float64, mm, access frame.
    """
    inner = points[(s > low) & (s < high)]
    ends = np.array([[np.interp(t, s, points[:, c]) for c in range(3)] for t in (low, high)])
    return np.vstack([ends[:1], inner, ends[1:]])


def parting(points: F64, s: F64, at: F64) -> F64:
    """Where to part a polyline: at given places, moved to its nearest point where they would leave a short move down.

    points : (n, 3) float64, mm, access frame
    s      : (n,) float64, mm, distance of its points along it
    at     : (m,) float64, mm along it, ascending

    Returns
    -------
    (k,) float64, mm along it, ascending, k <= m

    Notes
    -----
    A program rounds Z by g / 2 and X and Y by g / 2 each, g = 0.0001 mm. A move of run l that descends at a share q of
    the slope m of the steepest ramp keeps that slope in the program where q m l + g <= m (l - sqrt(2) g), so where
    l >= (g / m + sqrt(2) g) / (1 - q). For a ramp of 3 degrees and q = 0.98 that is 0.103 mm. Moves of the polyline
    itself may be shorter: ramps are laid for them (``toolpath.linking.ramp_entry``).
    """
    k = np.clip(np.searchsorted(s, at), 1, len(s) - 1)
    before, after = s[k - 1], s[k]
    short = np.minimum(at - before, after - at) < SHORTEST
    nearest = np.where(at - before <= after - at, before, after)
    return np.unique(np.where(short & (points[k, 2] < points[k - 1, 2]), nearest, at))
