"""The mesh facets of some faces as a sheet with its own nodes, and their division into small facets.

A point has one node per face and side of a seam, so that (u, v) is a function of the node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.kernels.trim import COLUMNS, count_division, divide
from geometry.mesh import F64, I32
from geometry.part import Part

I64 = NDArray[np.int64]
BOOL = NDArray[np.bool_]


@dataclass(eq=False)
class FacetSheet:
    """Facets of some faces of a part, in the frame of the part.

    nodes    : (n, 8) float64: x, y, z mm, u, v, normal (not unit); a point has one node per face and side of a seam
    face     : (n,) int32, face number of each node
    corners  : (t, 3) int64, node numbers, counter-clockwise seen from outside the material
    label    : (t,) int64 of each facet; without meaning before the cut
    original : int, this many nodes at the start are corners of the part's own mesh
    first_cut: int, nodes from this one on lie where the label changes
    """

    nodes: F64
    face: I32
    corners: I64
    label: I64
    original: int
    first_cut: int = 0

    def areas(self) -> F64:
        """(t,) float64, mm²."""
        p = self.nodes[self.corners, :3]
        return np.asarray(0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1))

    def uv_areas(self) -> F64:
        """(t,) float64, dimensionless or rad, mm or mm² as the parameters have it: signed areas in (u, v)."""
        q = self.nodes[self.corners, 3:5]
        a, b = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
        return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))

    def add(self, rows: F64, face: I32) -> I64:
        """Append nodes and return their numbers, (k,) int64, index.

        rows : (k, 8) float64, node rows as in ``nodes``, mm and parameters; face : (k,) int32, index of their faces
        """
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, rows])
        self.face = np.concatenate([self.face, face])
        return np.arange(first, first + len(rows))


def sheet_of(part: Part, faces: Sequence[int] | None) -> FacetSheet:
    """The mesh facets of the wanted faces as a sheet.

    part  : Part with ``uv``
    faces : face numbers, all when None

    Returns FacetSheet. At a pole of a surface the mesh leaves out facets without area. The sheet holds them again,
    since they have area in (u, v).
    Raises GeometryError (``no_parameters``, ``no_such_face``).
    """
    if part.uv is None:
        raise GeometryError("the part carries no surface parameters", code="no_parameters",
                            remedy="read the part from a STEP file")
    wanted = np.arange(1, len(part.faces) + 1) if faces is None else np.unique(np.asarray(faces, dtype=np.int64))
    absent = [f"F{f}" for f in wanted if not 1 <= f <= len(part.faces)]
    if absent:
        raise GeometryError(f"faces {', '.join(absent)} do not exist; the solid has {len(part.faces)} faces",
                            code="no_such_face", subjects=tuple(absent), limit=len(part.faces))
    rows = np.flatnonzero(np.isin(part.mesh.face_ids, wanted))
    ids, vertex = np.repeat(part.mesh.face_ids[rows], 3), part.mesh.faces[rows].ravel()
    uv = part.uv[rows].reshape(-1, 2)
    order = np.lexsort((uv[:, 1], uv[:, 0], vertex, ids))
    new_point = np.ones(len(order), bool)
    new_point[1:] = (np.diff(ids[order]) != 0) | (np.diff(vertex[order]) != 0)
    new_node = new_point.copy()
    new_node[1:] |= (np.diff(uv[order], axis=0) != 0).any(axis=1)
    point, node = np.empty(len(order), np.int64), np.empty(len(order), np.int64)
    point[order], node[order] = np.cumsum(new_point) - 1, np.cumsum(new_node) - 1
    first = order[new_node]
    t = part.mesh.triangles[rows]
    cross = np.repeat(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), 3, axis=0)
    normal: F64 = np.stack([np.bincount(point, weights=cross[:, k]) for k in range(3)], axis=1)
    length = np.linalg.norm(normal, axis=1)
    normal = normal / np.where(length > 0, length, 1.0)[:, None]
    nodes = np.concatenate([part.mesh.vertices[vertex[first]], uv[first], normal[point[first]]], axis=1)
    corners = _with_poles(node.reshape(-1, 3), vertex[first].astype(np.int64))
    return FacetSheet(nodes, ids[first].astype(np.int32), corners, np.zeros(len(corners), np.int64), len(nodes))


def _with_poles(corners: I64, vertex: I64) -> I64:
    """Corners with the notches closed where the rim runs from a pole to a node and back to the pole at another u."""
    start, end = corners.ravel(), corners[:, [1, 2, 0]].ravel()
    size = int(corners.max(initial=0)) + 1
    bare = ~np.isin(end * size + start, start * size + end)
    start, end = start[bare], end[bare]
    before = np.full(size, -1)
    before[end] = start
    a, p, b = before[start], start, end
    spike = (a >= 0) & (a != b) & (vertex[a] == vertex[b])
    return np.concatenate([corners, np.stack([p, a, b], axis=1)[spike]])


def sides_of(corners: I64) -> tuple[I64, I64, I64]:
    """Undirected sides of facets.

    corners : (t, 3) int64, index of the nodes in the frame of the sheet

    Returns (e,) lower and (e,) higher node number of each edge, and (t, 3) the edge number of the side from corner k to
    corner k + 1, all int64, index.
    """
    a, b = corners, corners[:, [1, 2, 0]]
    keys, index = np.unique((np.minimum(a, b) << 32 | np.maximum(a, b)).ravel(), return_inverse=True)
    return keys >> 32, keys & 0xFFFFFFFF, index.reshape(-1, 3)


def refined(sheet: FacetSheet, pitch: float) -> FacetSheet:
    """The sheet with every facet divided so that no side and no row is longer than the pitch.

    sheet : FacetSheet
    pitch : float, mm

    Returns a new FacetSheet; nodes on a side depend on the side alone, so neighbours share them.
    """
    low, high, sides = sides_of(sheet.corners)
    length = np.linalg.norm(sheet.nodes[high, :3] - sheet.nodes[low, :3], axis=1)
    parts = np.maximum(1, np.ceil(length / pitch)).astype(np.int64)
    edge = np.repeat(np.arange(len(parts)), parts - 1)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
    share = (step / parts[edge])[:, None]
    a, b = sheet.nodes[low[edge]], sheet.nodes[high[edge]]
    first = len(sheet.nodes) + np.cumsum(parts - 1) - (parts - 1)
    data = np.concatenate([sheet.nodes, a + share * (b - a)])
    inner, small = count_division(sheet.corners, sides, parts, length, first, data, pitch)
    node_at, facet_at = len(data) + np.cumsum(inner) - inner, np.cumsum(small) - small
    nodes = np.concatenate([data, np.empty((int(inner.sum()), COLUMNS))])
    corners = np.empty((int(small.sum()), 3), np.int64)
    divide(sheet.corners, sides, parts, length, first, nodes, pitch, node_at, facet_at, corners)
    face = np.concatenate([sheet.face, sheet.face[low[edge]], np.repeat(sheet.face[sheet.corners[:, 0]], inner)])
    return FacetSheet(nodes, face, corners, np.zeros(len(corners), np.int64), sheet.original)
