"""Separate places of the depth layers: the tool goes down in one of them before it goes to the next.

Pockets are separate below the rim between them, and what a thicker tool leaves stands in corners and narrow channels.
Level by level the tool would travel to all of them at every level. A wall between two places is held no worse: below
the level that is cut, stock stands beside it on the side that comes later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from toolpath.passes.contours import dilated
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import LayerArea, active_nodes, standing_above
from zones.lattice import blocked_beside
from zones.reach.tip_field import TipField

BESIDE = np.ones((3, 3))  # nodes of one place touch by sides or corners


@dataclass(frozen=True, eq=False)
class Place:
    """A place of some layers.

    mask   : (ny, nx) bool on the lattice of the tool, the nodes that are nearest to it
    window : rows and columns that hold the mask
    nodes  : (k, 2) float64, mm, plan of the access frame, where its rings may be
    """

    mask: NDArray[np.bool_]
    window: tuple[slice, slice]
    nodes: F64


class SeparatePlaces:
    """Where layers find stock, and from which layer on that is in separate places.

    layers : tip heights, mm, access frame, descending, and areas

    Passes of a layer leave the stock above the next one as it is, so the places hold until the last layer is cut.
    """

    def __init__(self, field: TipField, stock: StockMap, layers: Sequence[tuple[float, LayerArea]]) -> None:
        self._field, self._highest = field, stock.highest
        self._lowest = min(z for z, _ in layers)
        self._below: list[NDArray[np.uint8]] = []  # nodes with rings in a layer or in one under it, packed
        below = np.zeros((field.lattice.ny, field.lattice.nx), np.bool_)
        for z, place in reversed(layers):
            below = below | active_nodes(field, place, standing_above(field, stock, z))
            self._below.append(np.packbits(below, axis=1))
        self._below.reverse()

    def of(self, first: int, place: Place | None) -> list[Place]:
        """The places of the layers from ``first`` on in one of those before, none where there is one at most.

        place : of the layers down to ``first``; None: the whole lattice

        Two places are one where the tool in one of them could meet the stock of the other: with a cutter that is wider
        than the way between them, or with shank and holder once it is down.
        """
        field, lat = self._field, self._field.lattice
        below = np.unpackbits(self._below[first], axis=1, count=lat.nx).view(np.bool_)
        window = (slice(0, lat.ny), slice(0, lat.nx)) if place is None else place.window
        found = below[window] if place is None else below[window] & place.mask[window]
        if ndimage.label(found, BESIDE)[1] < 2:  # one at most, and growing them joins more
            return []
        wide = max([field.tool.widest_radius, *(field.disc_radius(disc, 1.0) for disc in field.discs
                                         if self._lowest + disc.height < self._highest)])
        grow = int(np.ceil(0.5 * wide / lat.step))
        joined, count = ndimage.label(dilated(np.pad(found, grow), float(grow)), BESIDE)
        if count < 2:
            return []
        of_all = np.where(found, joined[grow:-grow, grow:-grow], 0)
        i, j = blocked_beside(of_all == 0, lat.step)[1]
        owner = np.zeros((lat.ny, lat.nx), np.int64)
        owner[window] = of_all[i, j]
        if place is not None:
            owner[~place.mask] = 0
        rows, cols = np.nonzero(of_all)
        nodes = lat.nodes(rows + window[0].start, cols + window[1].start, 0.0)[:, :2]
        numbers = of_all[rows, cols]
        return [Place(owner == k, box, nodes[numbers == k])
                for k, box in enumerate(ndimage.find_objects(owner), start=1)]


def nearest_first(places: Sequence[Place], at: F64 | None) -> Iterator[Place]:
    """The places, that nearest to ``at`` first, then always the nearest to the middle of the one before.

    at : (3,) float64, mm, access frame, the tip of the tool; None where it is not known
    """
    left = list(places)
    here = None if at is None else at[:2]
    while left:
        k = 0 if here is None else int(np.argmin([np.linalg.norm(p.nodes - here, axis=1).min() for p in left]))
        place = left.pop(k)
        here = place.nodes.mean(axis=0)
        yield place


__all__ = ["Place", "SeparatePlaces", "nearest_first"]
