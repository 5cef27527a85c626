"""Triangles of the kernel's mesher for each face of a solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.IMeshTools import IMeshTools_Parameters
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from geometry.errors import PartError
from geometry.mesh import F64, I32
from geometry.step_import.occ.topology import Shape, faces_of, quick_box

SHOWN = 10  # faces that an error lists


@dataclass
class FaceMesh:
    """Triangles of one face from the kernel, refined or not; some nodes may belong to no triangle.

    nodes     : (n, 3) float64, mm
    uv        : (n, 2) float64, surface parameters of the nodes
    triangles : (m, 3) int32, outward, indices into ``nodes``
    """

    nodes: F64
    uv: F64
    triangles: I32


def triangulate(solid: Shape, chord: float, angle: float) -> list[FaceMesh]:
    """Mesh a solid and leave the mesh in it.

    solid : kernel solid, mm
    chord : float, mm, absolute deflection
    angle : float, rad

    Returns list of FaceMesh in the order of the faces.
    Raises PartError (``mesh_failed``) when faces stay without triangles; it names them, with their places.
    """
    _run(solid, _parameters(chord, angle))
    out, bare = [], {}
    for number, face in enumerate(faces_of(solid), 1):
        location = TopLoc_Location()
        triangulation = BRep_Tool.Triangulation_s(face, location)
        if triangulation is None or triangulation.NbTriangles() == 0:
            bare[f"F{number}"] = face
            continue
        out.append(_face_mesh(face, triangulation, location))
    if bare:
        raise _unmeshed(bare)
    return out


def _unmeshed(bare: dict[str, Shape]) -> PartError:
    """The error that names faces without triangles, by id, and shows where they lie."""
    lines = []
    for name, face in list(bare.items())[:SHOWN]:
        low, high = quick_box(face)
        at, size = (", ".join(f"{x:.4g}" for x in 0.5 * (low + high)), " x ".join(f"{x:.4g}" for x in high - low))
        lines.append(f"{name} at ({at}), {size} mm")
    more = f"\nand {len(bare) - SHOWN} more" if len(bare) > SHOWN else ""
    return PartError(f"{len(bare)} faces of the part cannot be meshed (STEP coordinates):\n" + "\n".join(lines) + more,
                     code="mesh_failed", subjects=tuple(bare), measured=len(bare), limit=0,
                     remedy="rebuild these faces in the CAD system; they are probably degenerate")


def triangulate_plainly(solid: Shape, chord: float, angle: float) -> list[FaceMesh | None]:
    """``triangulate`` without the kernel's check of its triangles against free-form faces.

    Faces have few inner nodes and edges the same nodes as in ``triangulate``. None stands for a face without triangles.
    """
    parameters = _parameters(chord, angle)
    parameters.ControlSurfaceDeflection = False
    _run(solid, parameters)
    out: list[FaceMesh | None] = []
    for face in faces_of(solid):
        location = TopLoc_Location()
        triangulation = BRep_Tool.Triangulation_s(face, location)
        bare = triangulation is None or triangulation.NbTriangles() == 0
        out.append(None if bare else _face_mesh(face, triangulation, location))
    return out


def edge_sides(face: Shape) -> NDArray[np.int64]:
    """(k, 2) int64, index: pairs of neighbouring nodes along the edges of the solid, frame of the face mesh."""
    out = [np.zeros((0, 2), np.int64)]
    location = TopLoc_Location()
    triangulation = BRep_Tool.Triangulation_s(face, location)
    explorer = TopExp_Explorer(face, TopAbs_EDGE)
    while explorer.More():
        polygon = BRep_Tool.PolygonOnTriangulation_s(TopoDS.Edge_s(explorer.Current()), triangulation, location)
        explorer.Next()
        if polygon is not None:
            nodes = np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)], np.int64) - 1
            out.append(np.stack([nodes[:-1], nodes[1:]], axis=1))
    return np.concatenate(out)


def _run(solid: Shape, parameters: IMeshTools_Parameters) -> None:
    # The kernel silently keeps a mesh of an earlier, coarser run, hence the clean-up.
    BRepTools.Clean_s(solid)
    BRepMesh_IncrementalMesh(solid, parameters)


def _parameters(chord: float, angle: float) -> IMeshTools_Parameters:
    out = IMeshTools_Parameters()
    out.Relative = False
    out.Deflection = out.DeflectionInterior = chord
    # the kernel's usual rule: inside a face the chord governs, along edges the angle too
    out.Angle, out.AngleInterior = angle, 2.0 * angle
    # Otherwise one edge whose ends miss their vertices loosens the whole face: 0.07 mm instead of 0.01 mm.
    out.ForceFaceDeflection = True
    out.InParallel = True
    return out


def _face_mesh(face: Shape, triangulation: Shape, location: TopLoc_Location) -> FaceMesh:
    count = triangulation.NbNodes()
    node, uv_node = triangulation.Node, triangulation.UVNode
    nodes = np.array([node(i).Coord() for i in range(1, count + 1)])
    uv = np.array([uv_node(i).Coord() for i in range(1, count + 1)])
    triangle = triangulation.Triangle
    triangles = np.array([triangle(i).Get() for i in range(1, triangulation.NbTriangles() + 1)], np.int32) - 1
    if not location.IsIdentity():
        move = location.Transformation()
        matrix = np.array([[move.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
        nodes = nodes @ matrix[:, :3].T + matrix[:, 3]
    if face.Orientation() == TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return FaceMesh(nodes, uv, np.ascontiguousarray(triangles))
