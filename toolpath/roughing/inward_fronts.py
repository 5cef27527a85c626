"""Fronts from the air inwards: when each place of a level is cleared by discs that fit between walls.

Notation
    D(p)  mm, length of the shortest free way from the air to a tip place p
    q(p)  mm, radius of the disc of tip places round p that is cleared with it: half the tool's radius, less near walls
    when  mm, least D + q over the discs that hold a place

Fronts {when < t} advance by no more than the growth of t along the ways, as in trochoidal milling: in a channel they
are arcs from wall to wall, not lines along it. ``D`` solves |grad D| = 1 on the lattice (``kernels.march``) [Zhao2005],
to first order. Where that is too coarse ``toolpath.roughing.engagement_limited_clearing`` adds lines between.
Places are tips in mm, access frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from dataclasses import field as fresh

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from toolpath.kernels.march import march, spread
from toolpath.lines import Line
from toolpath.passes.contours import dilated, from_walls, lines_at
from toolpath.stock.stock_map import StockMap
from zones.lattice import blocked_beside
from zones.reach.tip_field import TipField

AROUND = 2.0  # mm, and two diameters: how far round an area the tool looks for air
EDGE = 0.8  # lattice steps: so much nearer than the radius, stock is still only touched
DISC = 0.5  # of the radius: of the discs, less where walls are nearer
NARROW = 0.25  # of the radius: of the least disc between two walls
RIDGE = 0.8  # how fast the room grows at most where a disc between two walls has its middle
NEVER = -1e9  # mm


@dataclass(frozen=True, eq=False)
class Inwards:
    """When places at one tip height are cleared.

    z      : mm
    when   : (ny, nx) float64, mm of way from the air; inf where neither the tool nor a disc gets
    wanted : (ny, nx) bool, where the tool has to come
    known  : (ny, nx) bool, where a way leads from the air
    corner : mm, x and y of the first node
    """

    field: TipField
    z: float
    when: F64
    wanted: NDArray[np.bool_]
    known: NDArray[np.bool_]
    corner: tuple[float, float]
    _lines: dict[float, list[Line]] = fresh(default_factory=dict)

    @classmethod
    def over(cls, field: TipField, stock: StockMap, z: float, area: NDArray[np.bool_], allowance: float,
             worth: float) -> Inwards | None:
        """The fronts over an area and on the way to it; None where nothing stands [Zhao2005].

        z         : mm, tip height
        area      : (ny, nx) bool, on the lattice of the field
        allowance : mm left beside walls
        worth     : mm of stock above z that count
        """
        lat, r = field.lattice, field.tool.radius
        window = dilated(area, (4.0 * r + AROUND) / lat.step)
        if not window.any():
            return None
        rows, cols = (slice(int(k[0]), int(k[-1]) + 1) for k in
                      (np.flatnonzero(window.any(axis=1)), np.flatnonzero(window.any(axis=0))))
        off = from_walls(field, z, allowance)
        free = window[rows, cols]
        if off is not None:
            free = np.logical_and(free, off[rows, cols])
        stands = stock.above(z + worth, lat)[rows, cols]
        if not stands.any():
            return None
        air = free & (blocked_beside(~stands, lat.step)[0] >= r - EDGE * lat.step)
        far = np.where(air, 0.0, np.inf)
        march(far, free, lat.step)
        wanted = np.logical_and(dilated(area, r / lat.step)[rows, cols], free)
        way = dilated(_way_to(wanted & ~air, far), r / lat.step)
        inside = free & (wanted | way | air)
        far = np.where(air, 0.0, np.inf)
        march(far, inside, lat.step)
        return cls(field, z, _grown(far, air, inside, NARROW * r, DISC * r, lat.step), wanted, np.isfinite(far),
                   (lat.x0 + cols.start * lat.step, lat.y0 + rows.start * lat.step))

    @property
    def last(self) -> float:
        """When the last place is cleared, mm; -inf where the tool gets nowhere from the air."""
        return float(self.when[np.isfinite(self.when)].max(initial=-math.inf))

    def lines(self, when: float) -> list[Line]:
        """Fronts at a distance from the air, mm, stock on their right; they end where the tool is not free."""
        if when not in self._lines:
            known = np.isfinite(self.when)
            cells = np.zeros_like(known)
            cells[:-1, :-1] = known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:]
            gone = np.where(known, -self.when, NEVER)
            self._lines[when] = lines_at(self.field, self.z, gone, -when, cells, self.corner)
        return self._lines[when]

    def shut(self) -> list[tuple[F64, float]]:
        """Areas that no way leads to from the air: the widest spot of each, (3,) float64, mm, access frame, and its
        room, mm."""
        labels, count = ndimage.label(np.logical_and(self.wanted, ~self.known), np.ones((3, 3)))
        if not count:
            return []
        step = self.field.lattice.step
        room = blocked_beside(np.pad(self.wanted, 1), step)[0][1:-1, 1:-1]
        return [(np.array([self.corner[0] + step * j, self.corner[1] + step * i, self.z]), float(room[i, j]))
                for i, j in ndimage.maximum_position(room, labels, np.arange(1, count + 1))]


def _way_to(wanted: NDArray[np.bool_], far: F64) -> NDArray[np.bool_]:
    """(ny, nx) bool: nodes of a way from the air to each of the places wanted, by how far these are from it."""
    out = np.zeros_like(wanted)
    labels, count = ndimage.label(wanted & np.isfinite(far), np.ones((3, 3)))
    for i, j in ndimage.minimum_position(far, labels, np.arange(1, count + 1)) if count else ():
        while far[i, j] > 0.0 and not out[i, j]:
            out[i, j] = True
            i0, j0 = max(i - 1, 0), max(j - 1, 0)
            near = far[i0:i + 2, j0:j + 2]
            k = np.unravel_index(int(np.argmin(near)), near.shape)
            if not near[k] < far[i, j]:
                break
            i, j = i0 + int(k[0]), j0 + int(k[1])
    return out


def _grown(far: F64, air: NDArray[np.bool_], free: NDArray[np.bool_], min_disc: float, max_disc: float,
           step: float) -> F64:
    """When places that discs cover are cleared, (ny, nx) mm, from the distance of their centres from the air.

    far              : (ny, nx) mm
    min_disc, max_disc : mm, radius of a disc. One smaller than ``max_disc`` stands on the ridge between two walls:
                         where the room beside it grows more slowly than the distance to a wall
    """
    room = blocked_beside(np.pad(free, 1, mode="edge"), step)[0][1:-1, 1:-1]
    beside = np.pad(room, 1, mode="edge")
    steepest = np.zeros_like(room)
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            if di or dj:
                there = beside[1 + di:beside.shape[0] - 1 + di, 1 + dj:beside.shape[1] - 1 + dj]
                np.maximum(steepest, (there - room) / (step * math.hypot(di, dj)), out=steepest)
    radius = np.minimum(room, max_disc)
    within = blocked_beside(np.pad(air, 1, constant_values=True), step)[0][1:-1, 1:-1]
    fits = free & np.isfinite(far) & ((room >= max_disc) | ((steepest < RIDGE) & (room >= min_disc)))
    when = np.where(fits, np.where(air, -within, far) + radius, np.inf)
    out = np.full_like(when, np.inf)
    spread(when, radius, step, out)
    out[air] = np.minimum(out[air], 0.0)
    return np.where(free, out, np.inf)
