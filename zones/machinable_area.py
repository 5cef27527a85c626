"""The machinable area Ma, and the form of each piece of it."""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples

STEEP = 0.70710678  # n_z below: steeper than 45 degrees, cut by waterlines
LEVEL = 1.0 - 1e-6  # n_z above: a level plane, on which a flat end leaves no cusp
SEEN = -0.02  # n_z above: the access direction sees it
SEEN_SHARE = 0.005  # of the area of a face
UP = ((0.0, 0.0, 1.0),)


class AreaForm(StrEnum):
    """Form of the surface at a sample, which decides how it is cut."""

    LEVEL = "level"
    SHALLOW = "shallow"
    STEEP = "steep"


FORMS = (AreaForm.LEVEL, AreaForm.SHALLOW, AreaForm.STEEP)


def machinable_faces(samples: SurfaceSamples, seat: Collection[int], wanted: set[int] | None, excluded: set[int],
                     directions: ArrayLike = UP) -> set[int]:
    """Numbers of the faces of the machinable area Ma [Arivazhagan2020].

    Without ``wanted`` these are all faces of which some access direction sees at least ``SEEN_SHARE``. The seat counts
    only if an access faces it within 45 degrees, since then the part is turned over. With ``wanted`` they are the
    wanted faces. The share avoids that one facet of rounding at the rim of an underside decides.

    samples    : SurfaceSamples of all faces, in the frame of the directions
    seat       : numbers of the faces that the part stands on
    directions : (d, 3) float64, dimensionless, from the tool tip to the spindle, frame of the samples
    """
    total = np.bincount(samples.face, weights=samples.area)
    least = np.where(np.isin(samples.face, list(seat)), STEEP, SEEN)
    chosen: set[int] = set()
    for direction in np.asarray(directions, dtype=np.float64):
        seen = samples.area * (samples.normals @ direction > least)
        part = np.bincount(samples.face, weights=seen, minlength=len(total))
        chosen |= {int(f) for f in np.flatnonzero((part > 0) & (part >= SEEN_SHARE * total))}
    return (chosen if wanted is None else set(wanted)) - excluded


def forms_of(normals: F64) -> NDArray[np.object_]:
    """Form of each sample, (n,) object, each an AreaForm.

    normals : (n, 3) float64, dimensionless, unit normals in the access frame, out of the material
    """
    return np.array(FORMS, dtype=object)[form_codes(normals)]


def form_codes(normals: F64) -> NDArray[np.int8]:
    """Form of each sample, (n,) int8, index: its place in ``FORMS``.

    normals : (n, 3) float64, dimensionless, access frame, as those of ``forms_of``
    """
    return np.where(normals[:, 2] > LEVEL, 0, np.where(normals[:, 2] < STEEP, 2, 1)).astype(np.int8)
