"""Distance from triangle centres to the exact surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Cone, GeomAbs_Cylinder, GeomAbs_Plane, GeomAbs_Sphere, GeomAbs_Torus
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.ShapeAnalysis import ShapeAnalysis_Surface

from geometry.mesh import F64
from geometry.step_import.occ.topology import Shape

if TYPE_CHECKING:
    from geometry.step_import.occ.triangulating import FaceMesh

MAX_SAMPLES = 20_000
NEWTON_STEPS = 4
MAX_PROJECTIONS = 200


def largest_deviation(shapes: Sequence[Shape], faces: Sequence[FaceMesh], chord: float) -> float:
    """Largest distance from sampled triangle centres to their exact face.

    shapes : kernel faces
    faces  : FaceMesh of each
    chord  : float, mm; distances above it are refined

    Returns float, mm.
    Notes   Planes, cylinders, cones, spheres and tori: by formula, every triangle. Other faces: at most some 20 000
            triangles, an even share of each face with its largest ones. The distance to the surface point at the
            mean (u, v) of the corners bounds the true distance from above. A few Gauss-Newton steps towards the foot
            point lower the bound. Where it still exceeds ``chord``, the kernel projects the point. So the value is
            never too small for a measured triangle. On a smooth surface a chord errs most at its centre. The trim of
            the face is ignored.
    """
    return float(face_deviations(shapes, faces, chord).max(initial=0.0))


def face_deviations(shapes: Sequence[Shape], faces: Sequence[FaceMesh], chord: float) -> F64:
    """Largest distance per face, (f,) float64, mm, for f faces; arguments as in ``largest_deviation``."""
    total = sum(len(f.triangles) for f in faces)
    out = []
    for shape, face in zip(shapes, faces, strict=True):
        surface = BRepAdaptor_Surface(shape, True)
        exact = elementary_distances(surface, face.nodes[face.triangles].mean(axis=1))
        if exact is not None:
            out.append(float(exact.max()))
            continue
        count = len(face.triangles)
        share = max(10, int(MAX_SAMPLES * count / max(total, 1)))
        out.append(_face_deviation(shape, surface, face, _sample(face, min(share, count)), chord))
    return np.array(out)


def elementary_distances(surface: BRepAdaptor_Surface, points: F64) -> F64 | None:
    """Distances of points from a plane, cylinder, cone, sphere or torus without its trim; None for another surface.

    surface : kernel surface; points : (n, 3) float64, mm, frame of the surface

    Returns (n,) float64, mm, or None.
    """
    kind = surface.GetType()
    if kind == GeomAbs_Plane:
        plane = surface.Plane()
        return np.asarray(np.abs((points - plane.Location().Coord()) @ plane.Axis().Direction().Coord()))
    if kind == GeomAbs_Sphere:
        sphere = surface.Sphere()
        return np.asarray(np.abs(np.linalg.norm(points - sphere.Location().Coord(), axis=1) - sphere.Radius()))
    if kind not in (GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Torus):
        return None
    body = {GeomAbs_Cylinder: surface.Cylinder, GeomAbs_Cone: surface.Cone, GeomAbs_Torus: surface.Torus}[kind]()
    offset = points - body.Location().Coord()
    along = offset @ np.array(body.Axis().Direction().Coord())
    away = np.sqrt(np.maximum(np.einsum("ij,ij->i", offset, offset) - along**2, 0.0))
    if kind == GeomAbs_Cylinder:
        return np.asarray(np.abs(away - body.Radius()))
    if kind == GeomAbs_Torus:
        return np.asarray(np.abs(np.hypot(away - body.MajorRadius(), along) - body.MinorRadius()))
    slope = body.SemiAngle()
    # for a positive angle the kernel's cone axis points to growing radii; the lower nappe is never meshed
    sides = [(s * away - body.RefRadius()) * np.cos(slope) - along * np.sin(slope) for s in (1.0, -1.0)]
    return np.asarray(np.minimum(np.abs(sides[0]), np.abs(sides[1])))


def _sample(face: FaceMesh, share: int) -> np.ndarray:
    t = face.nodes[face.triangles]
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    order = np.argsort(-area, kind="stable")
    spread = np.linspace(0, len(order) - 1, max(1, share // 2)).astype(int)
    return np.unique(np.concatenate([order[:share - share // 2], order[spread]]))


def _face_deviation(shape: Shape, surface: BRepAdaptor_Surface, face: FaceMesh, rows: np.ndarray,
                    chord: float) -> float:
    corners = face.triangles[rows]
    centres, uv = face.nodes[corners].mean(axis=1), face.uv[corners].mean(axis=1)
    bounds = np.array([distance_near(surface, c, q) for c, q in zip(centres.tolist(), uv, strict=True)])
    order = np.argsort(-bounds)
    worst = 0.0
    projector = ShapeAnalysis_Surface(BRep_Tool.Surface_s(shape))
    for row in order[:MAX_PROJECTIONS]:
        bound = float(bounds[row])
        if bound <= max(chord, worst):
            return max(bound, worst)
        projector.NextValueOfUV(gp_Pnt2d(*uv[row]), gp_Pnt(*centres[row]), 1e-9, -1.0)
        worst = max(worst, min(bound, float(projector.Gap())))
    rest = order[MAX_PROJECTIONS:]
    return max(worst, float(bounds[rest].max()) if len(rest) else 0.0)


def node_gaps(surface: BRepAdaptor_Surface, nodes: F64, uv: F64) -> F64:
    """Distance of nodes from the surface point at their parameters: the gaps of the file's edges.

    nodes : (n, 3) float64, mm, frame of the surface
    uv    : (n, 2) float64, rad, mm or dimensionless, parameters of the surface

    Returns (n,) float64, mm. No mesh can be nearer to the surface at these nodes.
    """
    if not len(nodes):
        return np.zeros(0)
    exact = np.array([surface.Value(u, v).Coord() for u, v in uv.tolist()])
    return np.asarray(np.linalg.norm(nodes - exact, axis=1))


def distance_near(surface: BRepAdaptor_Surface, centre: list[float], uv: F64, enough: float = 0.0) -> float:
    """Upper bound of the distance of a point to a surface.

    surface : kernel surface
    centre  : 3 numbers, mm
    uv      : (2,) float64, rad, mm or dimensionless, parameters near the foot point
    enough  : float, mm; a bound below this is not lowered further

    Returns float, mm: least distance to the surface points of a few Gauss-Newton steps from ``uv``.
    """
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    u, v = float(uv[0]), float(uv[1])
    best = float("inf")
    for _ in range(NEWTON_STEPS):
        surface.D1(u, v, point, along_u, along_v)
        p, a, b = point.Coord(), along_u.Coord(), along_v.Coord()
        r = [centre[i] - p[i] for i in range(3)]
        here = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]) ** 0.5
        if here >= best:
            break
        if here < enough:
            return here
        better = best - here > 0.01 * here
        best = here
        aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
        determinant = aa * bb - ab * ab
        if not better or determinant <= 1e-18 * aa * bb:
            break
        ra, rb = _dot(r, a), _dot(r, b)
        u += (ra * bb - rb * ab) / determinant
        v += (rb * aa - ra * ab) / determinant
    return best


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
