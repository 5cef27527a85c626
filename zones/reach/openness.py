"""Whether passes can leave a zone: open, or closed by walls and connections on all sides.

The tip of a tool at height z can move within the connected part of its free region F(z) = {H <= z}. So over every place
there is an *escape height*: the least z at which F(z) leads from there out of the part. A sample is open where its tip
stands at that height or above it.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter

from geometry.mesh import F64
from zones.kernels.flood import escape_heights
from zones.reach.tip_field import TipField

AROUND = 5  # lattice nodes across, around a tip: beside a wall it has a play of 1.42 steps, and half a step to the node
TOLERANCE = 1e-3  # mm, above the allowed cusp: a lower edge does not stop a pass
OPEN_SHARE = 0.9  # of the area of an open zone; in a narrow end the lattice may miss a few hundredths

_known: WeakKeyDictionary[TipField, F64] = WeakKeyDictionary()


def escape_field(field: TipField) -> F64:
    """(ny, nx) float64, mm: least escape height around each node of the lattice of a tool; cached with the field."""
    if field not in _known:
        height = np.ascontiguousarray(field.height)
        order = np.argsort(height, axis=None, kind="stable")
        _known[field] = minimum_filter(escape_heights(height, order), AROUND, mode="nearest")
    return _known[field]


def open_share(field: TipField, tips: F64, level: ArrayLike, area: F64) -> float:
    """Share of the area of samples from whose tips the tool can leave the part at a level.

    tips  : (n, 3) float64, mm, access frame, admissible tips
    level : (n,) float64 or one number, mm, height of the tip on the way out
    area  : (n,) float64, mm², of the samples; where all are 0 they have equal weight
    """
    out = escape_field(field)[field.lattice.cells(tips[:, :2])] <= np.asarray(level) + max(TOLERANCE, field.cusp)
    weight: NDArray[np.float64] = area if area.sum() > 0 else np.ones(len(tips))
    return float(weight[out].sum() / max(float(weight.sum()), 1e-300))


__all__ = ["OPEN_SHARE", "escape_field", "open_share"]
