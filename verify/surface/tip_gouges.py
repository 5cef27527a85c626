"""Gouges by the points of drills and pointed chamfer mills: their tips inside the part.

The surface below a point is the farthest from it where a hole ends in a cone: no normal of the cone leads there. So the
depth of a tip is its own distance from the part. Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.tool_body import ToolBody
from verify.findings import Source, gouge_findings
from verify.model import Finding
from verify.moves import Moves


def tip_gouges(mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], source: Source,
               tolerance: float) -> list[Finding]:
    """Findings where feed moves of pointed tools end with the tip more than ``tolerance`` mm inside the part."""
    pointed = np.array([t.cone_height > 0.0 and t.tip_diameter <= 0.0 for t in tools], np.bool_)
    if not pointed.any() or not len(moves):
        return []
    rows, tree = np.flatnonzero(moves.feed & pointed[moves.tool]), TriangleTree(mesh)
    tips, which = np.unique(np.round(moves.end[rows], 6), axis=0, return_index=True)
    depth, triangle, _ = nearest(tree, tips)
    deep = np.flatnonzero(depth > tolerance)
    up = np.tile([0.0, 0.0, 1.0], (len(deep), 1))
    _, met = first_hits(tree, tips[deep], up)
    # a tip is inside where the surface over it is met from inside
    inside = deep[(met >= 0) & (mesh.normals[met, 2] > 0.0)]
    return gouge_findings(tips[inside], mesh.face_ids[triangle[inside]], depth[inside], np.zeros(len(inside)),
                          rows[which[inside]].astype(np.int32), source, tolerance)


__all__ = ["tip_gouges"]
