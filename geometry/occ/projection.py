"""Foot points on an exact face, with normal, curvature and principal directions there."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepLProp import BRepLProp_SLProps
from OCP.gp import gp_Dir, gp_Pnt
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_REVERSED

from geometry.mesh import F64
from geometry.step_import.occ.curvature import RESOLUTION
from geometry.step_import.occ.topology import Shape


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
