"""How faces meet: convex, concave or smooth, by the exact normals along each edge."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepLProp import BRepLProp_SLProps
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from geometry.mesh import F64
from geometry.part import EdgeInfo, EdgeKind
from geometry.step_import.occ.meshing import SolidMesh
from geometry.step_import.occ.topology import Shape, faces_of, length_of

SMOOTH_ANGLE = np.radians(5.0)
# Share of the edge along which the normals must agree for the edge to count as smooth.
SMOOTH_SHARE = 0.7
SAMPLES = 11

# One use of an edge by a face: (0-based face number, face, edge as oriented there).
Use = tuple[int, Shape, Shape]


def edge_infos(solid: Shape, mesh: SolidMesh, warnings: list[str]) -> tuple[EdgeInfo, ...]:
    """Describe every edge of a solid.

    solid    : kernel solid
    mesh     : SolidMesh of it; edges take their points from it, so they lie on the mesh exactly
    warnings : a sentence is appended when more than two faces share an edge

    Returns tuple of EdgeInfo in STEP coordinates, in the order of the kernel; degenerate edges are left out.
    """
    uses = _uses(solid)
    surfaces = [BRepAdaptor_Surface(f, True) for f in faces_of(solid)]
    out, crowded = [], 0
    for index, users in enumerate(uses):
        nodes = mesh.edge_nodes[index]
        if not users or len(nodes) == 0:
            continue
        points = mesh.mesh.vertices[nodes]
        length = length_of(users[0][2])
        crowded += len(users) > 2
        if len(users) == 1:
            out.append(EdgeInfo((users[0][0] + 1,) * 2, EdgeKind.BOUNDARY, length, 0.0, points))
        for first, second in zip(users[:-1], users[1:], strict=True):
            kind, angle = _meeting(first, second, surfaces)
            out.append(EdgeInfo((first[0] + 1, second[0] + 1), kind, length, angle, points))
    if crowded:
        warnings.append(f"{crowded} edges are shared by more than two faces")
    return tuple(out)


def _uses(solid: Shape) -> list[list[Use]]:
    edges = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(solid, TopAbs_EDGE, edges)
    uses: list[list[Use]] = [[] for _ in range(edges.Extent())]
    for number, face in enumerate(faces_of(solid)):
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            if not BRep_Tool.Degenerated_s(edge):
                uses[edges.FindIndex(edge) - 1].append((number, face, edge))
    return uses


def _meeting(first: Use, second: Use, surfaces: list[BRepAdaptor_Surface]) -> tuple[EdgeKind, float]:
    """Kind and mean signed angle between outward normals.

    With the material's normal n1 up and face 1 on the left of its edge direction t, the other normal n2 leans to the
    right where the edge is convex: angle = atan2((n1 x n2) . t, n1 . n2).
    """
    curve = BRepAdaptor_Curve(first[2])
    values = _inner(curve.FirstParameter(), curve.LastParameter())
    tangents = _tangents(curve, values) * (-1.0 if first[2].Orientation() == TopAbs_REVERSED else 1.0)
    n1 = _normals(first, surfaces[first[0]], values)
    n2 = _normals(second, surfaces[second[0]], values)
    sine = np.einsum("ij,ij->i", np.cross(n1, n2), tangents)
    angles = np.arctan2(sine, np.einsum("ij,ij->i", n1, n2))
    angles = angles[np.isfinite(angles)]
    if not len(angles):
        return EdgeKind.SMOOTH, 0.0
    mean = float(angles.mean())
    if (np.abs(angles) < SMOOTH_ANGLE).mean() >= SMOOTH_SHARE:
        return EdgeKind.SMOOTH, mean
    return (EdgeKind.CONVEX if mean > 0 else EdgeKind.CONCAVE), mean


def _inner(low: float, high: float) -> np.ndarray:
    """Parameters spread over the edge, its ends left out: corners belong to no pair of faces alone."""
    return low + (high - low) * (np.arange(SAMPLES) + 0.5) / SAMPLES


def _tangents(curve: BRepAdaptor_Curve, values: np.ndarray) -> F64:
    point, derivative = gp_Pnt(), gp_Vec()
    out = np.full((len(values), 3), np.nan)
    for row, value in enumerate(values):
        curve.D1(float(value), point, derivative)
        if derivative.Magnitude() > 1e-12:
            out[row] = derivative.Normalized().Coord()
    return out


def _normals(use: Use, surface: BRepAdaptor_Surface, values: np.ndarray) -> F64:
    """Outward normals of a face at parameters of one of its edges."""
    _, face, edge = use
    out = np.full((len(values), 3), np.nan)
    curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if curve is None:
        return out
    sign = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    properties = BRepLProp_SLProps(surface, 1, 1e-9)
    for row, value in enumerate(values):
        u, v = curve.Value(float(value)).Coord()
        properties.SetParameters(u, v)
        if properties.IsNormalDefined():
            out[row] = sign * np.array(properties.Normal().Coord())
    return out
