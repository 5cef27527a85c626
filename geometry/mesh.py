"""Triangle meshes with the number of the B-rep face of each triangle."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles in space, outward by the right-hand rule. All coordinates are in one frame, that of ``vertices``.

    vertices : (n, 3) float64, mm
    faces    : (m, 3) int32, indices into ``vertices``, counter-clockwise seen from outside
    face_ids : (m,) int32, number of the B-rep face of each triangle, 1-based (face ``F12`` is 12);
               zeros where the mesh has no B-rep
    corner_normals : (m, 3, 3) float64, unit outward normals of the exact surface at the corners of every triangle, on
               its own face; NaN where the surface has none. None for a mesh without B-rep

    Raises
    ------
    ValueError
        An array has another shape, or a face refers to a vertex that does not exist.
    """

    vertices: F64
    faces: I32
    face_ids: I32 = field(default=None)  # type: ignore[assignment,arg-type]
    corner_normals: F64 | None = None

    def __post_init__(self) -> None:
        v = np.ascontiguousarray(self.vertices, dtype=np.float64)
        f = np.ascontiguousarray(self.faces, dtype=np.int32)
        if v.ndim != 2 or v.shape[1] != 3:
            raise ValueError(f"vertices must have shape (n, 3), got {v.shape}")
        if f.ndim != 2 or f.shape[1] != 3:
            raise ValueError(f"faces must have shape (m, 3), got {f.shape}")
        if len(f) and (f.min() < 0 or f.max() >= len(v)):
            raise ValueError("faces refer to vertices that do not exist")
        ids = np.zeros(len(f), np.int32) if self.face_ids is None else np.ascontiguousarray(self.face_ids, np.int32)
        if ids.shape != (len(f),):
            raise ValueError(f"face_ids must have shape ({len(f)},), got {ids.shape}")
        corners = None if self.corner_normals is None else np.ascontiguousarray(self.corner_normals, np.float64)
        if corners is not None and corners.shape != (len(f), 3, 3):
            raise ValueError(f"corner_normals must have shape ({len(f)}, 3, 3), got {corners.shape}")
        object.__setattr__(self, "corner_normals", corners)
        object.__setattr__(self, "vertices", v)
        object.__setattr__(self, "faces", f)
        object.__setattr__(self, "face_ids", ids)

    @cached_property
    def triangles(self) -> F64:
        """(m, 3, 3) float64, mm, frame of the mesh: corner points of each triangle."""
        return np.ascontiguousarray(self.vertices[self.faces])

    @cached_property
    def _cross(self) -> F64:
        t = self.triangles
        return np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])

    @cached_property
    def areas(self) -> F64:
        """(m,) float64, mm²."""
        return np.asarray(0.5 * np.linalg.norm(self._cross, axis=1))

    @cached_property
    def normals(self) -> F64:
        """(m, 3) float64, dimensionless, frame of the mesh: unit outward normals; zero for triangles without area."""
        length = 2.0 * self.areas
        return np.asarray(self._cross / np.where(length > 0, length, 1.0)[:, None])

    @cached_property
    def bounds(self) -> F64:
        """(2, 3) float64, mm, frame of the mesh: lower and upper corner of the bounding box."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def volume(self) -> float:
        """Enclosed volume in mm³ (signed; right only for a closed mesh)."""
        t = self.triangles
        return float(np.einsum("ij,ij->i", t[:, 0], np.cross(t[:, 1], t[:, 2])).sum() / 6.0)

    def transformed(self, matrix: F64) -> TriangleMesh:
        """The mesh moved rigidly.

        matrix : (4, 4) float64, a rotation, dimensionless, and a shift, mm, to another frame
        """
        m = np.asarray(matrix, dtype=np.float64)
        normals = None if self.corner_normals is None else self.corner_normals @ m[:3, :3].T
        return TriangleMesh(self.vertices @ m[:3, :3].T + m[:3, 3], self.faces, self.face_ids, normals)
