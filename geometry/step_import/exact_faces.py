"""Exact normals and curvatures of the B-rep on demand.

The mesh of a ``Part`` is within a chord of the surface, but its normals and curvatures are not those of the surface.
``ExactFaces`` holds the kernel shape and answers for points near it. Use it inside a child process: the kernel is
imported when the first instance is made.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.errors import GeometryError
from geometry.mesh import F64, I32
from geometry.setup_frame import Placement


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """What the exact surface is at its points nearest to given ones.

    points     : (n, 3) float64, mm, setup frame, on the surface of the face (its trim is not looked at)
    normals    : (n, 3) float64, unit, out of the material; NaN at a singular point
    curvature  : (n, 2) float64, 1/mm, least and greatest principal curvature, positive where the material is
                 convex; NaN where there is none
    directions : (n, 2, 3) float64, unit, tangent directions of the two; NaN where they are not determined (plane,
                 sphere) or the point is singular
    distance   : (n,) float64, mm, from the given points
    """

    points: F64
    normals: F64
    curvature: F64
    directions: F64
    distance: F64


class ExactFaces:
    """The faces of one solid of a STEP file, numbered as in ``read_part`` of the same file and solid.

    path      : STEP file
    placement : Placement, the setup frame of all points and vectors; the file's own frame when None
    solid     : int, 1-based number of one of several separate solids

    Raises what ``geometry.step_import.reader.read_part`` raises about the file and its solids.
    """

    def __init__(self, path: str | os.PathLike[str], *, placement: Placement | None = None,
                 solid: int | None = None) -> None:
        from geometry.step_import.occ.loading import load_solid
        from geometry.step_import.occ.topology import faces_of

        self._faces = faces_of(load_solid(Path(path), solid).body)
        self._placement = placement or Placement()

    def __len__(self) -> int:
        return len(self._faces)

    def evaluate(self, face: int, points: F64) -> SurfacePoints:
        """Evaluate one face at the points nearest to given ones.

        face   : int, 1-based number
        points : (n, 3) float64, mm, setup frame

        Returns SurfacePoints with n rows.
        Raises GeometryError (``no_such_face``) for a number out of range.
        """
        from geometry.occ.projection import surface_points

        if not 1 <= face <= len(self._faces):
            raise GeometryError(f"face F{face} does not exist; the solid has {len(self._faces)} faces",
                                code="no_such_face", subjects=(f"F{face}",), measured=face, limit=len(self._faces),
                                remedy="number faces as read_part does")
        into, back = self._placement.inverse, self._placement.matrix
        given = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        foot, normals, curvature, directions = surface_points(
            self._faces[face - 1], given @ into[:3, :3].T + into[:3, 3])
        foot = foot @ back[:3, :3].T + back[:3, 3]
        turn = back[:3, :3].T
        return SurfacePoints(foot, normals @ turn, curvature, directions @ turn,
                             np.asarray(np.linalg.norm(given - foot, axis=1)))

    def normals(self, faces: I32, points: F64) -> F64:
        """Exact outward normals at points of several faces.

        faces  : (n,) int32, 1-based face number of each point
        points : (n, 3) float64, mm, setup frame

        Returns (n, 3) float64, unit; NaN at singular points.
        Raises GeometryError (``no_such_face``).
        """
        return self._gather(faces, points)[0]

    def curvature(self, faces: I32, points: F64) -> F64:
        """Exact principal curvatures at points of several faces.

        faces  : (n,) int32, 1-based face number of each point
        points : (n, 3) float64, mm, setup frame

        Returns (n, 2) float64, 1/mm, least and greatest, positive where the material is convex; NaN where undefined.
        Raises GeometryError (``no_such_face``).
        """
        return self._gather(faces, points)[1]

    def _gather(self, faces: I32, points: F64) -> tuple[F64, F64]:
        numbers = np.asarray(faces)
        normals, curvature = np.full((len(numbers), 3), np.nan), np.full((len(numbers), 2), np.nan)
        for number in np.unique(numbers):
            rows = numbers == number
            found = self.evaluate(int(number), np.asarray(points)[rows])
            normals[rows], curvature[rows] = found.normals, found.curvature
        return normals, curvature
