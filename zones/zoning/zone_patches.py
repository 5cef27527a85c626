"""Zones as trimmed faces of the part: the pieces of every B-rep face in each zone, with their borders in (u, v).

A point belongs to the zone of the nearest sample of its own face, form and cell of the plan view. So borders between
cells and forms are exact. Borders at the end of a tool's reach are accurate to the spacing of the samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.sampling import SurfaceSamples
from geometry.trimming.trim import FacePatch, trim_faces
from zones.machinable_area import LEVEL, STEEP
from zones.reach.access_view import View
from zones.zoning.zones import ZoneArea

PITCH = 0.5  # mm between the first points on a face; wider where there would be more than MAX_POINTS
MAX_POINTS = 4e5
WIDE = 1e3  # mm, the same on faces of one zone, which have no border
TOLERANCE = 0.02  # mm, largest distance of a border from the change of zone
REST = 0  # label of the area outside all zones
MAX_CELLS = 1 << 20


def zone_patches(view: View, zones: Sequence[ZoneArea]) -> dict[str, tuple[FacePatch, ...]]:
    """Trimmed faces of every zone, and of the remainder under ''.

    view  : the first access, whose samples the zones index
    zones : in any order

    Returns
    -------
    dict
        By zone id; pieces by face number. The pieces of all zones and the remainder partition the machinable faces.
    """
    samples = view.samples
    faces = [int(f) for f in np.unique(samples.face)]
    area = float(view.part.mesh.areas[np.isin(view.part.mesh.face_ids, faces)].sum())
    owner = np.full(len(samples), REST, np.int64)
    for k, z in enumerate(zones, start=1):
        owner[z.samples] = k
    inner = samples.area > 0
    owners = _owners(samples.face[inner], owner[inner])
    mixed = [f for f in faces if owners.get(f) is None]
    pitch = max(PITCH, float(np.sqrt(2.0 * area / MAX_POINTS)))
    found = [trim_faces(view.part, mixed, Nearest(view, owner), pitch, TOLERANCE)] if mixed else []
    for label in sorted({one for one in owners.values() if one is not None}):
        found.append(trim_faces(view.part, [f for f in faces if owners.get(f) == label], _constant(label), WIDE))
    names = {REST: "", **{k: z.id for k, z in enumerate(zones, start=1)}}
    out: dict[str, tuple[FacePatch, ...]] = {}
    for some in found:
        for label, patches in some.items():
            out[names[label]] = tuple(sorted((*out.get(names[label], ()), *patches), key=lambda q: (q.face, -q.area)))
    return out


def _owners(face: I32, owner: NDArray[np.int64]) -> dict[int, int | None]:
    """The common owner of all samples of each face, None where there are several."""
    low, high = (np.full(int(face.max()) + 1, fill, np.int64) for fill in (np.iinfo(np.int64).max, -1))
    np.minimum.at(low, face, owner)
    np.maximum.at(high, face, owner)
    return {int(f): int(low[f]) if low[f] == high[f] else None for f in np.unique(face)}


def _constant(label: int) -> Callable[[F64, F64, I32], NDArray[np.int64]]:
    """The label function of faces with a single label."""

    def everywhere(points: F64, _normals: F64, _face: I32) -> NDArray[np.int64]:
        return np.full(len(points), label, np.int64)

    return everywhere


class Nearest:
    """Label function: the owner of the nearest sample of the same face, form and cell; of the face where there is none.

    view  : the first access
    owner : (n,) int64, index of the label of each of its samples
    """

    def __init__(self, view: View, owner: NDArray[np.int64]) -> None:
        # samples on the borders represent no area; with them a border sample would get a strip of it
        inner = np.flatnonzero(view.samples.area > 0)
        s = view.samples.subset(inner)
        self.view, self.owner = view, owner[inner]
        self.names = {r: k for k, r in enumerate(view.labels.regions)}
        self.cells = KeyedPoints(_key(s, view.labels.code[inner]), s.points)
        self.faces = KeyedPoints(s.face.astype(np.int64), s.points)

    def __call__(self, points: F64, normals: F64, face: I32) -> NDArray[np.int64]:
        """Labels (k,) of points (k, 3) mm with unit normals on faces (k,), in the access frame."""
        here = SurfaceSamples(points, normals, np.zeros(len(points)), face, np.zeros(len(points), np.int32))
        labels = self.view.label(here)
        code = np.array([self.names.get(r, -1) for r in labels.regions], dtype=np.int64)[labels.code]
        found = self.cells.nearest(np.where(code >= 0, _key(here, code), -1), points)[:, 0]
        lone = np.flatnonzero(found < 0)
        found[lone] = self.faces.nearest(face[lone].astype(np.int64), points[lone])[:, 0]
        return np.where(found >= 0, self.owner[found], REST)


def _key(samples: SurfaceSamples, code: NDArray[np.int64]) -> NDArray[np.int64]:
    nz = samples.normals[:, 2]
    form = np.where(nz > LEVEL, 0, np.where(nz < STEEP, 2, 1))
    return np.asarray((samples.face.astype(np.int64) * 3 + form) * MAX_CELLS + code)
