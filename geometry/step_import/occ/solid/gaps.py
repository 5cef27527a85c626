"""Gaps between the free edges of an open shell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from geometry.mesh import F64
from geometry.step_import.occ.topology import Shape

SAMPLES = 33


def free_edge_gap(edges: Sequence[Shape]) -> float:
    """Largest distance of a free edge from its nearest neighbour among the other free edges.

    edges : kernel edges

    Returns float, mm; infinity when there is a single free edge, 0 when there is none.
    Notes   Each edge is sampled at 33 points against the polylines of the others. The error for an edge of length L is
            at most its sag over L/32.
    """
    if len(edges) < 2:
        return float("inf") if edges else 0.0
    from scipy.spatial import cKDTree  # few parts have free edges, and it takes a fifth of a second

    lines = [_points(e) for e in edges]
    owner = np.repeat(np.arange(len(lines)), [SAMPLES - 1] * len(lines))
    start = np.concatenate([p[:-1] for p in lines])
    end = np.concatenate([p[1:] for p in lines])
    tree = cKDTree(0.5 * (start + end))
    count = min(len(start), 2 * SAMPLES + 8)
    worst = 0.0
    for number, points in enumerate(lines):
        inner = points[1:-1]
        near = tree.query(inner, k=count)[1].reshape(len(inner), -1)
        distance = _to_segments(inner, start[near], end[near])
        distance[owner[near] == number] = np.inf
        best = distance.min(axis=1)
        worst = max(worst, float(best.max()))
    return worst


def free_edges(shape: Shape) -> list[Shape]:
    """Edges that bound one face only (seams and degenerate edges left out)."""
    owners = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, owners)
    out = []
    for i in range(1, owners.Extent() + 1):
        edge = TopoDS.Edge_s(owners.FindKey(i))
        if owners.FindFromIndex(i).Extent() > 1 or BRep_Tool.Degenerated_s(edge):
            continue
        if not BRep_Tool.IsClosed_s(edge, TopoDS.Face_s(owners.FindFromIndex(i).First())):
            out.append(edge)
    return out


def _points(edge: Shape) -> F64:
    curve = BRepAdaptor_Curve(TopoDS.Edge_s(edge))
    values = np.linspace(curve.FirstParameter(), curve.LastParameter(), SAMPLES)
    return np.array([curve.Value(float(t)).Coord() for t in values])


def _to_segments(points: F64, start: F64, end: F64) -> F64:
    direction = end - start
    offset = points[:, None, :] - start
    length = np.einsum("ijk,ijk->ij", direction, direction)
    t = np.einsum("ijk,ijk->ij", offset, direction) / np.where(length > 0, length, 1.0)
    foot = start + np.clip(t, 0.0, 1.0)[..., None] * direction
    return np.asarray(np.linalg.norm(points[:, None, :] - foot, axis=2))
