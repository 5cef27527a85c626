"""Refines faces of a meshed solid whose triangles leave the exact surface, between the same border nodes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

from geometry.mesh import F64
from geometry.step_import.occ.refining import I64, Net, present, refine_net
from geometry.step_import.occ.topology import Shape, faces_of
from geometry.step_import.occ.triangulating import FaceMesh, edge_sides, triangulate_plainly

# Triangles that mending may make in one solid. The refinement of a face ends at its share.
MAX_MENDED = 200_000


def mend_faces(solid: Shape, faces: list[FaceMesh], numbers: Iterable[int], limit: float, chord: float,
               angle: float) -> list[FaceMesh]:
    """Refine some faces of a solid.

    solid   : kernel solid, mm, with the mesh that ``faces`` were read from; it keeps that mesh
    faces   : FaceMesh of every face
    numbers : faces to refine, from 0
    limit   : float, mm, largest distance of the middle of inner sides and triangles from the surface
    chord   : float, mm, deflection of the mesh
    angle   : float, rad, angle of the mesh

    Returns list of FaceMesh: the others as they were, the refined ones with the nodes they had in their old places
    and new ones behind them. Sides along edges of the solid are those of before, so neighbours still fit.
    Notes   Starts from the kernel's triangles between border nodes alone, because its own rounds of insertion leave
            large and badly shaped triangles on such a face. Where the borders do not agree, it starts from the latter.
    """
    out = list(faces)
    shapes = faces_of(solid)
    # a copy that shares the geometry: the mesh in the solid itself links nodes to edges
    plain = triangulate_plainly(BRepBuilderAPI_Copy(solid, False, False).Shape(), chord, angle)
    room = MAX_MENDED
    for k in numbers:
        kept = edge_sides(shapes[k])
        net = _start(faces[k], plain[k], kept)
        net = refine_net(BRepAdaptor_Surface(shapes[k], True), net, limit, len(net.triangles) + room)
        room = max(0, room - len(net.triangles))
        out[k] = FaceMesh(net.nodes, net.uv, net.triangles.astype(np.int32))
    return out


def _start(full: FaceMesh, plain: FaceMesh | None, kept: I64) -> Net:
    """The plain triangles on the nodes of the full mesh, if they contain all sides along edges."""
    old = Net(full.nodes, full.uv, full.triangles.astype(np.int64), kept)
    if plain is None:
        return old
    border = np.unique(kept)
    place = {row: int(node) for node, row in zip(border, _rows(full, border), strict=True)}
    fresh: list[int] = []
    index = np.empty(len(plain.nodes), np.int64)
    for node, row in enumerate(_rows(plain, np.arange(len(plain.nodes)))):
        index[node] = place.get(row, len(full.nodes) + len(fresh))
        if row not in place:
            fresh.append(node)
    triangles = index[plain.triangles]
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    if len(place) < len(border) or not present(sides, kept).all():
        return old
    nodes, uv = np.concatenate([full.nodes, plain.nodes[fresh]]), np.concatenate([full.uv, plain.uv[fresh]])
    return Net(nodes, uv, triangles, kept)


def _rows(face: FaceMesh, nodes: I64) -> list[tuple[float, ...]]:
    """Place and parameters per node: on a seam or at a pole one of the two is not enough."""
    table: F64 = np.concatenate([face.nodes[nodes], face.uv[nodes]], axis=1)
    return [tuple(row) for row in table.tolist()]
