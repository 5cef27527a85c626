"""A spiral over shallow area: rings at growing distance from its border, joined turn by turn [Lee2003].

The place across the passes is the distance of a tip from the border of all tips in plan. So a ring is a level line of
that distance, and ``toolpath.passes.side_step`` brackets from ring to ring as from line to line. Where one closed ring
follows the other, the path changes from ring to ring along the whole turn, at equal shares of their lengths. On a round
area turns are as far apart as the rings. Beside a bay they may be a little farther apart; the measurement finds that.
Places are in mm, access frame, float64.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from geometry.mesh import F64
from toolpath.kernels.contour import SEGMENTS, linear_crossings, trace
from toolpath.lines import smoothed
from toolpath.passes.pass_family import Dragged, Family, FinishTarget, Pass, Promise, strip_width
from zones.lattice import Lattice, blocked_beside

NEAR = 1.5  # spacings of samples: gaps between tips up to twice this are none
ROUND = 1.0  # lattice steps over which rings are rounded, or a twentieth of their length
SMOOTH = 1.0  # lattice steps, of the distance field


class Rings(Family):
    """Rings at distances from the border of the tips."""

    def __init__(self, dragged: Dragged, target: FinishTarget, promise: Promise) -> None:
        tips = target.tips[:, :2]
        step = max(0.5 * target.spacing, 0.05 * dragged.cutter.radius)
        near = max(1, int(np.ceil(NEAR * target.spacing / step)))
        bounds = np.array([tips.min(axis=0), tips.max(axis=0)])
        self.lattice = lat = Lattice.over(bounds, (2 * near + 4) * step, step)
        disc = np.hypot(*np.mgrid[-near:near + 1, -near:near + 1]) <= near
        mask = ndimage.binary_closing(lat.mask(tips), disc)
        far = blocked_beside(mask, step)[0]
        self.far = np.ascontiguousarray(ndimage.gaussian_filter(far, SMOOTH))
        self.inside = np.ascontiguousarray(ndimage.binary_dilation(mask, iterations=2))
        at = (tips[:, ::-1] - [lat.y0, lat.x0]).T / step
        t = ndimage.map_coordinates(self.far, at, order=1)
        rise = np.column_stack([ndimage.map_coordinates(g, at, order=1) for g in np.gradient(self.far)[::-1]])
        length = np.linalg.norm(rise, axis=1, keepdims=True)
        across = np.where(length > 1e-9, rise / np.maximum(length, 1e-9), [1.0, 0.0])
        cells = np.floor(tips / strip_width(dragged, target)).astype(np.int64)
        cells -= cells.min(axis=0)
        super().__init__(dragged, target, promise, t, cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1], across)

    def pass_at(self, t: float, window: float, only: NDArray[np.bool_] | None = None) -> Pass:
        """As in ``Family``; a ring is whole or absent.

        only : (n,) bool; only tells whether the pass counts as whole
        """
        lines = [p for way in self.ways(t) for p in self.dragged.pieces(way, self.step, self.promise.chord)]
        return Pass(t, tuple(lines), only is None)

    def ways(self, t: float) -> list[F64]:
        """Level lines of the distance, each (n, 2) float64, mm, access frame; a closed one repeats its first point
        [Lorensen1987]."""
        ids, starts, closed = trace(self.far < t, self.inside, SEGMENTS)
        xy = np.empty((len(ids), 2))
        linear_crossings(ids, self.far, t, self.lattice.frame, xy)
        out = []
        for k in range(len(starts) - 1):
            way = xy[starts[k]:starts[k + 1]]
            if len(way) > 2:
                out.append(smoothed(np.vstack([way, way[:1]]) if closed[k] else way, ROUND * self.lattice.step))
        return out


def spiralled(rings: Rings, places: list[float], climb: bool = True) -> list[F64]:
    """Rings as tip paths, each (n, 3) float64, mm, access frame, joined to spirals where ring follows ring [Lee2003].

    places : list of float, mm, ascending
    climb  : clockwise, with the stock inside on the right, else the other way

    A path begins with its outermost ring, whole, changes to the next ring along each turn, and ends with its innermost
    ring, whole. Where rings split or join, or one is open, a new path begins.
    """
    out: list[F64] = []
    chain: list[F64] = []

    def close() -> None:
        if chain:
            out.extend(rings.dragged.pieces(_joined(chain), rings.step, rings.promise.chord))
        chain.clear()

    for t in places:
        ways = [way[::-1] for way in rings.ways(t)] if climb else rings.ways(t)
        if len(ways) == 1 and _closed(ways[0]):
            chain.append(ways[0])
            continue
        close()
        out.extend(p for way in ways for p in rings.dragged.pieces(way, rings.step, rings.promise.chord))
    close()
    return out


def _closed(way: F64) -> bool:
    return bool((way[0] == way[-1]).all())


def _joined(rings: list[F64]) -> F64:
    """One way through closed rings (n, 2), outermost first."""
    way = [rings[0]]
    before = rings[0]
    for ring in rings[1:]:
        start = int(cKDTree(ring[:-1]).query(before[0])[1])
        ring = np.vstack([ring[start:-1], ring[:start + 1]])
        a, b = _shares(before), _shares(ring)
        u = np.union1d(a, b)
        turn = (1.0 - u)[:, None] * _at(before, a, u) + u[:, None] * _at(ring, b, u)
        way.append(turn[1:])
        before = ring
    return np.vstack([*way, before[1:]])


def _shares(way: F64) -> F64:
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    return np.asarray(s / s[-1])


def _at(way: F64, shares: F64, u: F64) -> F64:
    return np.column_stack([np.interp(u, shares, way[:, c]) for c in range(2)])
