"""Solid -> watertight triangle mesh with face numbers, and its distance from the exact surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from geometry.connected_components import connected_components
from geometry.mesh import F64, TriangleMesh
from geometry.step_import.occ.deviation import face_deviations, node_gaps
from geometry.step_import.occ.holes import extend_parameters, fill_slivers
from geometry.step_import.occ.mending import mend_faces
from geometry.step_import.occ.normals import corner_normals
from geometry.step_import.occ.topology import Shape, faces_of
from geometry.step_import.occ.triangulating import FaceMesh, triangulate

__all__ = ["FaceMesh", "SolidMesh", "count_open_edges", "mesh_solid"]

MAX_REMESH = 2
# A mesh larger than half of this is not repeated with a smaller chord.
MAX_TRIANGLES = 1_000_000
# A smaller chord for the whole solid that leaves more than this share of the deviation is not reduced further.
WORTH = 0.8
# A mesh counts as good while its measured deviation stays below this multiple of the requested chord.
DEVIATION_ROOM = 1.5
# Nodes nearer than this on one edge of a triangle are one point (the kernel's own confusion distance).
WELD = 1e-7


@dataclass
class SolidMesh:
    """Mesh of a solid with the links back to the B-rep.

    mesh      : TriangleMesh, STEP coordinates (mm), faces numbered from 1, with the exact normals at its corners
    uv        : (m, 3, 2) float64, surface parameters of the corners of its triangles, see ``Part.uv``
    faces     : FaceMesh per B-rep face
    edge_nodes: per edge in kernel order, (k,) indices into ``mesh.vertices`` along the edge; empty when degenerate
    deviation : float, mm, largest measured distance of triangle centres to the exact surface
    chord     : float, mm, deflection of the last run of the kernel's mesher
    warnings  : sentences
    """

    mesh: TriangleMesh
    uv: F64
    faces: list[FaceMesh]
    edge_nodes: list[np.ndarray]
    deviation: float
    chord: float
    warnings: list[str] = field(default_factory=list)


def mesh_solid(solid: Shape, chord: float, angle: float) -> SolidMesh:
    """Mesh a solid until its measured deviation is within 1.5 times the chord, or no step improves it.

    solid : kernel solid, mm
    chord : float, mm, absolute deflection
    angle : float, rad

    Returns SolidMesh.
    Raises PartError (``mesh_failed``) when faces stay without triangles.
    Notes   Faces that deviate too far are refined one by one between the nodes of their edges. Where that does not
            suffice, and gaps between edges and faces are not the cause, the whole solid is meshed again with a smaller
            chord: at most twice, as long as it helps and the mesh stays below half a million triangles.
    """
    requested, before = chord, np.inf
    limit = DEVIATION_ROOM * requested
    shapes = faces_of(solid)
    for attempt in range(MAX_REMESH + 1):
        faces = triangulate(solid, chord, angle)
        off = face_deviations(shapes, faces, requested)
        if off.max(initial=0.0) > limit:
            faces = mend_faces(solid, faces, np.flatnonzero(off > limit), requested, chord, angle)
            off = face_deviations(shapes, faces, requested)
        deviation = float(off.max(initial=0.0))
        count = sum(len(f.triangles) for f in faces)
        if (not _curable(shapes, faces, off, limit) or attempt == MAX_REMESH or 2 * count > MAX_TRIANGLES
                or deviation > WORTH * before):
            break
        before = deviation
        # the deviation falls about in proportion to the chord, so aim a little below the limit
        chord *= float(np.clip(0.9 * limit / deviation, 0.3, 0.8))
    mesh, uv, edge_nodes = _join(solid, faces)
    warnings = []
    if deviation > DEVIATION_ROOM * requested:
        warnings.append(f"the mesh deviates up to {deviation:.4g} mm from the exact surface; "
                        f"the requested chord is {requested:g} mm")
    open_edges = count_open_edges(mesh)
    if open_edges:
        mesh, holes = fill_slivers(mesh, requested)
        uv = extend_parameters(mesh, uv, _projector(faces_of(solid)))
        open_edges = count_open_edges(mesh)
        if holes:
            warnings.append(f"{holes} sliver holes that the CAD kernel left in the mesh were closed")
    if open_edges:
        warnings.append(f"{open_edges} edges of the mesh are not shared by exactly two triangles")
    mesh = replace(mesh, corner_normals=corner_normals(shapes, mesh.face_ids, uv))
    return SolidMesh(mesh, uv, faces, edge_nodes, deviation, chord, warnings)


def _curable(shapes: list[Shape], faces: list[FaceMesh], off: F64, limit: float) -> bool:
    """Whether some face deviates by more than the gaps between it and its own edges explain."""
    for k in np.flatnonzero(off > limit):
        used = np.unique(faces[k].triangles)
        gaps = node_gaps(BRepAdaptor_Surface(shapes[k], True), faces[k].nodes[used], faces[k].uv[used])
        if off[k] > limit + gaps.max():
            return True
    return False


def count_open_edges(mesh: TriangleMesh) -> int:
    """Count of directed triangle edges without exactly one partner in the other direction; 0 when watertight."""
    f = mesh.faces.astype(np.int64)
    n = len(mesh.vertices)
    start, end = f.ravel(), f[:, [1, 2, 0]].ravel()
    keys, counts = np.unique(start * n + end, return_counts=True)
    partner = np.searchsorted(keys, (keys % n) * n + keys // n)
    inside = np.minimum(partner, len(keys) - 1)
    matched = (keys[inside] == (keys % n) * n + keys // n) & (counts == counts[inside])
    return int(counts[~matched].sum())


def _projector(faces: list[Shape]) -> Callable[[int, F64, F64], F64]:
    """The parameters of a point on a numbered face, in the period of a start value."""
    def project(number: int, point: F64, start: F64) -> F64:
        surface = BRep_Tool.Surface_s(faces[number - 1])
        found = ShapeAnalysis_Surface(surface).NextValueOfUV(gp_Pnt2d(*start), gp_Pnt(*point), 1e-9, -1.0)
        uv = np.array(found.Coord())
        for k, period in enumerate((surface.UPeriod() if surface.IsUPeriodic() else 0.0,
                                    surface.VPeriod() if surface.IsVPeriodic() else 0.0)):
            if period:
                uv[k] += period * np.round((start[k] - uv[k]) / period)
        return uv
    return project


def _join(solid: Shape, faces: list[FaceMesh]) -> tuple[TriangleMesh, F64, list[np.ndarray]]:
    """One vertex per point: nodes on a shared B-rep edge or vertex are the same by topology, not by distance.

    The parameters stay with the corners, so that a point keeps one pair on each face and each side of a seam.
    """
    offsets = np.concatenate([[0], np.cumsum([len(f.nodes) for f in faces])])
    pairs, edge_nodes = _shared_nodes(solid, offsets)
    label = connected_components(pairs, int(offsets[-1]))
    nodes = np.concatenate([f.nodes for f in faces])
    corners = np.concatenate([f.triangles + offsets[i] for i, f in enumerate(faces)])
    ids = np.repeat(np.arange(1, len(faces) + 1), [len(f.triangles) for f in faces])
    triangles = label[corners]
    # points closer than the kernel's own resolution are one as well
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    short = np.linalg.norm(nodes[sides[:, 0]] - nodes[sides[:, 1]], axis=1) < WELD
    if short.any():
        label = connected_components(np.concatenate([pairs, sides[short]]), int(offsets[-1]))
        triangles = label[corners]
    first = np.full(label.max() + 1, -1, np.int64)
    first[label[::-1]] = np.arange(len(label))[::-1]
    whole = ((triangles[:, 0] != triangles[:, 1]) & (triangles[:, 1] != triangles[:, 2])
             & (triangles[:, 2] != triangles[:, 0]))
    triangles, ids = triangles[whole], ids[whole]
    uv = np.concatenate([f.uv for f in faces])[corners[whole]]
    used, packed = np.unique(np.concatenate([triangles.ravel(), *[label[e] for e in edge_nodes]]), return_inverse=True)
    corners_packed = packed[:triangles.size].reshape(-1, 3)
    cuts = np.cumsum([triangles.size, *[len(e) for e in edge_nodes]])
    edges = [packed[cuts[i]:cuts[i + 1]] for i in range(len(edge_nodes))]
    return TriangleMesh(nodes[first[used]], corners_packed.astype(np.int32), ids.astype(np.int32)), uv, edges


def _shared_nodes(solid: Shape, offsets: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    edges, vertices = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(solid, TopAbs_EDGE, edges)
    TopExp.MapShapes_s(solid, TopAbs_VERTEX, vertices)
    edge_nodes: list[np.ndarray | None] = [None] * edges.Extent()
    vertex_node: dict[int, int] = {}
    pairs: list[np.ndarray] = [np.zeros((0, 2), np.int64)]
    for number, face in enumerate(faces_of(solid)):
        location = TopLoc_Location()
        triangulation = BRep_Tool.Triangulation_s(face, location)
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            polygon = BRep_Tool.PolygonOnTriangulation_s(edge, triangulation, location)
            if polygon is None:
                continue
            count = polygon.NbNodes()
            nodes = np.array([polygon.Node(i) for i in range(1, count + 1)], np.int64) - 1 + offsets[number]
            index = edges.FindIndex(edge) - 1
            known = edge_nodes[index]
            if BRep_Tool.Degenerated_s(edge):
                pairs.append(np.stack([nodes, np.full(count, nodes[0])], axis=1))
            elif known is None:
                edge_nodes[index] = nodes
            elif len(known) == count:
                pairs.append(np.stack([known, nodes], axis=1))
            for vertex, node in ((TopExp.FirstVertex_s(edge), nodes[0]), (TopExp.LastVertex_s(edge), nodes[-1])):
                if not vertex.IsNull():
                    other = vertex_node.setdefault(vertices.FindIndex(vertex), int(node))
                    pairs.append(np.array([[other, node]]))
    return np.concatenate(pairs), [np.zeros(0, np.int64) if e is None else e for e in edge_nodes]
