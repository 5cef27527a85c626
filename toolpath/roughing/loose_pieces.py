"""Pieces of stock that layers along the walls of an opening would cut loose.

Along the wall of a hole right through, a tool cuts a ring. What stands inside the ring falls once the ring is through:
the tool may catch it, or throw it. A small piece is cut away with the layers instead; the proof tells of a large one,
which the shop has to hold.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from toolpath.passes.contours import dilated
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import STOCK_WORTH, ring_spacing
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

BESIDE = np.ones((3, 3), np.int64)  # nodes that hang together
WORTH = 1.0  # times what layers cut round it: a larger piece is not cut away


def loose_pieces(field: TipField, stock: StockMap, z: float, area: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Places of the pieces that layers down to a height would cut loose, of those that are worth cutting away.

    Such a piece stands where the tool may go and the part has nothing, in an opening that is closed all round, and
    touches no wall of it. In plan it is no larger than what is cut round it.

    z    : mm, tip height of the lowest layer
    area : (ny, nx) bool on the lattice, where that layer removes stock, as in ``LayerArea``

    Returns (ny, nx) bool on the lattice, places of the tip.
    """
    lat, tool = field.lattice, field.tool
    free = field.height <= z + LEVEL_TOLERANCE
    # rings go a radius beyond the area less a space between rings at most, and the tool cuts a radius beyond them
    cleared = dilated(area, (2.0 * tool.radius - ring_spacing(tool)) / lat.step)
    left = free & stock.above(z + STOCK_WORTH, lat) & ~cleared
    out = np.zeros_like(left)
    if not left.any():
        return out
    openings, _ = ndimage.label(free, BESIDE)
    border = np.concatenate([openings[0], openings[-1], openings[:, 0], openings[:, -1]])
    held = dilated(~free, 1.0) | np.isin(openings, np.unique(border)) | stock.over_part(lat)
    cut = np.bincount(openings[free & ~left], minlength=int(openings.max()) + 1)
    pieces, count = ndimage.label(left, BESIDE)
    for k, where in enumerate(ndimage.find_objects(pieces), start=1):
        mine = pieces[where] == k
        if not (mine & held[where]).any() and mine.sum() <= WORTH * cut[openings[where][mine][0]]:
            out[where] |= mine
    return out


__all__ = ["loose_pieces"]
