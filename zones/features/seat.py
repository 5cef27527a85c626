"""The seat of a part: the faces it stands on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.part import Part

DOWN = -0.99  # Z of the mean unit normal, below which a plane faces away from the access
FLUSH = 1e-4  # of the height of the part: planes so little above the lowest one belong to the seat


def seat_of(part: Part) -> NDArray[np.bool_]:
    """Whether each face belongs to the lowest plane that faces away from the access.

    part : Part, mm, access along +Z

    Returns (n,) bool, one for each face; all False where no plane faces down.
    """
    mesh, n = part.mesh, len(part.faces)
    of, z = mesh.face_ids.astype(np.int64) - 1, mesh.triangles[:, :, 2]
    area = np.bincount(of, weights=mesh.areas, minlength=n)
    normal_z = np.bincount(of, weights=mesh.normals[:, 2] * mesh.areas, minlength=n) / np.maximum(area, 1e-30)
    lowest_of, highest_of = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(lowest_of, of, z.min(axis=1))
    np.maximum.at(highest_of, of, z.max(axis=1))
    flush = FLUSH * float(part.bounds[1, 2] - part.bounds[0, 2])
    down = np.array([f.surface == "plane" for f in part.faces], dtype=bool) & (normal_z < DOWN)
    if not down.any():
        return np.zeros(n, np.bool_)
    lowest = max(float(part.bounds[0, 2]) + flush, float(lowest_of[down].min()) + flush)
    return np.asarray(down & (highest_of <= lowest))
