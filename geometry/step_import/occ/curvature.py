"""Kind and curvature of each face."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepLProp import BRepLProp_SLProps
from OCP.GeomAbs import GeomAbs_SurfaceType as Kind
from OCP.TopAbs import TopAbs_REVERSED

from geometry.mesh import F64
from geometry.part import FaceInfo
from geometry.step_import.occ.meshing import FaceMesh
from geometry.step_import.occ.topology import Shape, area_of, length_of

NAMES = {
    Kind.GeomAbs_Plane: "plane", Kind.GeomAbs_Cylinder: "cylinder", Kind.GeomAbs_Cone: "cone",
    Kind.GeomAbs_Sphere: "sphere", Kind.GeomAbs_Torus: "torus", Kind.GeomAbs_BSplineSurface: "bspline",
    Kind.GeomAbs_BezierSurface: "bezier", Kind.GeomAbs_SurfaceOfRevolution: "revolution",
    Kind.GeomAbs_SurfaceOfExtrusion: "extrusion", Kind.GeomAbs_OffsetSurface: "offset",
}
# Triangle centres and nodes per face at which curvature is taken. Free-form faces bend most at nodes on the rim.
SAMPLES = 144
RESOLUTION = 1e-7
# A face narrower than this many modelling tolerances is a sliver.
SLIVER_TOLERANCES = 10.0


def surface_name(face: Shape) -> str:
    """Word for the kind of surface a kernel face lies on, one of those ``FaceInfo.surface`` may hold."""
    return NAMES.get(BRepAdaptor_Surface(face, False).GetType(), "other")


def face_info(number: int, shape: Shape, name: str, mesh: FaceMesh, tolerance: float) -> FaceInfo:
    """Describe one face.

    number    : int, 1-based
    shape     : kernel face
    name      : kind of surface the file gave it
    mesh      : FaceMesh of it
    tolerance : float, mm, modelling tolerance of the file

    Returns FaceInfo.
    """
    surface = BRepAdaptor_Surface(shape, True)
    low, high = (0.0, 0.0) if name == "plane" else _range(surface, mesh, shape.Orientation() == TopAbs_REVERSED)
    area = area_of(shape)
    perimeter = length_of(shape)
    width = 2.0 * area / perimeter if perimeter > 0 else np.inf
    return FaceInfo(number, name, area, bool(width < SLIVER_TOLERANCES * tolerance), low, high,
                    _radius(name, surface, mesh))


def curvatures(surface: BRepAdaptor_Surface, uv: F64, reversed_face: bool) -> F64:
    """Principal curvatures at surface parameters [DoCarmo1976].

    surface       : kernel surface of a face
    uv            : (n, 2) float64, rad, mm or dimensionless, parameters of the surface
    reversed_face : bool, the normal of the face is opposite to that of its surface

    Returns (n, 2) float64, 1/mm, least and greatest, positive where the material is convex; NaN where the surface
    has no curvature (cone tip, collapsed side of a patch).
    """
    out = np.full((len(uv), 2), np.nan)
    properties = BRepLProp_SLProps(surface, 2, RESOLUTION)
    # in the kernel, bending towards the normal is positive; with the normal out of the material that is concave
    sign = 1.0 if reversed_face else -1.0
    for row, (u, v) in enumerate(uv):
        properties.SetParameters(float(u), float(v))
        if properties.IsCurvatureDefined():
            out[row] = sorted((sign * properties.MinCurvature(), sign * properties.MaxCurvature()))
    return out


def _range(surface: BRepAdaptor_Surface, mesh: FaceMesh, reversed_face: bool) -> tuple[float, float]:
    centres = mesh.uv[_spread(mesh.triangles)].mean(axis=1)
    values = curvatures(surface, np.concatenate([centres, _spread(mesh.uv)]), reversed_face)
    values = values[np.isfinite(values).all(axis=1)]
    if not len(values):
        return 0.0, 0.0
    return float(values[:, 0].min()), float(values[:, 1].max())


def _spread(rows: Any) -> Any:
    return rows[np.unique(np.linspace(0, len(rows) - 1, SAMPLES).astype(int))]


def _radius(name: str, surface: BRepAdaptor_Surface, mesh: FaceMesh) -> float | None:
    if name == "cylinder":
        return float(surface.Cylinder().Radius())
    if name == "sphere":
        return float(surface.Sphere().Radius())
    if name == "torus":
        return float(surface.Torus().MinorRadius())
    if name == "cone":
        cone = surface.Cone()
        middle = 0.5 * (mesh.uv[:, 1].min() + mesh.uv[:, 1].max())
        return float(abs(cone.RefRadius() + middle * np.sin(cone.SemiAngle())))
    return None
