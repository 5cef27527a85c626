"""The machinable area Ma, and the form a strategy sees in a piece of it."""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from zones.model import Decomposition

STEEP = 0.70710678  # n_z below: steeper than 45 degrees, cut by waterlines
LEVEL = 1.0 - 1e-6  # n_z above: a level plane, a flat end leaves no cusp
SEEN = -0.02  # n_z above: the access direction sees it
SEEN_SHARE = 0.005  # of the area of a face
UP = ((0.0, 0.0, 1.0),)


class AreaForm(StrEnum):
    """How a sample is cut."""

    LEVEL = "level"
    SHALLOW = "shallow"
    STEEP = "steep"


def machinable_faces(samples: SurfaceSamples, decomposition: Decomposition, wanted: set[int] | None,
                     excluded: set[int], directions: ArrayLike = UP) -> set[int]:
    """Numbers of the faces of the machinable area Ma.

    By default every face of which some access direction sees at least ``SEEN_SHARE``; the seat only if an access
    looks at it from within 45 degrees, for then the part lies turned over. Else the faces asked for. The share keeps
    the answer from hanging on one facet of rounding at the rim of an underside.

    samples    : of all faces, in the frame of the directions
    directions : (d, 3) float64, unit, from the tool tip to the spindle
    """
    total = np.bincount(samples.face, weights=samples.area)
    least = np.where(np.isin(samples.face, list(decomposition.seat)), STEEP, SEEN)
    chosen: set[int] = set()
    for direction in np.asarray(directions, dtype=np.float64):
        seen = samples.area * (samples.normals @ direction > least)
        part = np.bincount(samples.face, weights=seen, minlength=len(total))
        chosen |= {int(f) for f in np.flatnonzero((part > 0) & (part >= SEEN_SHARE * total))}
    return (chosen if wanted is None else set(wanted)) - excluded


def forms_of(normals: F64) -> NDArray[np.object_]:
    """Form of each sample by its outward unit normal (n, 3) in the access frame."""
    out = np.full(len(normals), AreaForm.SHALLOW, dtype=object)
    out[normals[:, 2] > LEVEL] = AreaForm.LEVEL
    out[normals[:, 2] < STEEP] = AreaForm.STEEP
    return out
