"""Exact normals and curvatures of the B-rep on demand.

The mesh of a ``Part`` is within a chord of the surface, but its normals and curvatures are not those of the surface.
``ExactFaces`` holds the shape of the CAD kernel and evaluates points near it. The module imports the CAD kernel.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepLProp import BRepLProp_SLProps
from OCP.gp import gp_Dir, gp_Pnt
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_REVERSED

from geometry.errors import GeometryError
from geometry.mesh import F64, I32
from geometry.setup_frame import SetupFrame
from geometry.step_import.occ.curvature import RESOLUTION
from geometry.step_import.occ.loading import load_solid
from geometry.step_import.occ.topology import Shape, faces_of


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

    def __init__(self, path: str | os.PathLike[str], *, placement: SetupFrame | None = None,
                 solid: int | None = None) -> None:
        self._faces = faces_of(load_solid(Path(path), solid).body)
        self._placement = placement or SetupFrame()

    def __len__(self) -> int:
        return len(self._faces)

    def evaluate(self, face: int, points: F64) -> SurfacePoints:
        """Evaluate one face at the points nearest to given ones.

        face   : int, 1-based number
        points : (n, 3) float64, mm, setup frame

        Returns SurfacePoints with n rows.
        Raises GeometryError (``no_such_face``) for a number out of range.
        """
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


def surface_points(face: Shape, points: F64) -> tuple[F64, F64, F64, F64]:
    """Nearest points of a face's surface and what it is there.

    face   : kernel face
    points : (n, 3) float64, mm, STEP coordinates

    Returns foot points (n, 3), outward normals (n, 3), curvatures (n, 2) least and greatest (1/mm, positive where the
    material is convex), principal directions (n, 2, 3) of the two; NaN where not defined.
    """
    projector = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face))
    surface = BRepAdaptor_Surface(face, True)
    properties = BRepLProp_SLProps(surface, 2, RESOLUTION)
    reversed_face = face.Orientation() == TopAbs_REVERSED
    n = len(points)
    foot, normals = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    curvature, directions = np.full((n, 2), np.nan), np.full((n, 2, 3), np.nan)
    for row, point in enumerate(points.tolist()):
        u, v = projector.ValueOfUV(gp_Pnt(*point), 1e-9).Coord()
        properties.SetParameters(u, v)
        foot[row] = properties.Value().Coord()
        if properties.IsNormalDefined():
            normals[row] = np.array(properties.Normal().Coord()) * (-1.0 if reversed_face else 1.0)
        if properties.IsCurvatureDefined():
            curvature[row], directions[row] = _principal(properties, reversed_face)
    return foot, normals, curvature, directions


def _principal(properties: BRepLProp_SLProps, reversed_face: bool) -> tuple[F64, F64]:
    sign = 1.0 if reversed_face else -1.0
    values = np.array([properties.MinCurvature(), properties.MaxCurvature()]) * sign
    directions = np.full((2, 3), np.nan)
    if not properties.IsUmbilic():
        greatest, least = gp_Dir(), gp_Dir()
        properties.CurvatureDirections(greatest, least)
        directions = np.array([least.Coord(), greatest.Coord()])
    order = np.argsort(values, kind="stable")
    return values[order], directions[order]
