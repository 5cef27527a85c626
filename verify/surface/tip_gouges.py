"""Gouges by the ends of tools: the points of drills and pointed chamfer mills, and the ends of mills in narrow pits.

The surface below a point is the farthest from it where a hole ends in a cone: no normal of the cone leads there. No
normal of a slope leads to the end of a pit in it either. So the depth of an end is its own distance from the surface.
Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.tool_body import ToolBody
from verify.findings import Source, gouge_findings
from verify.model import Finding
from verify.moves import Moves
from verify.surface.guard_points import PATH_BATCH, inside_part, path_places
from verify.tool_axes import square_to

AROUND = 8  # places of each ring of an end
TILTS = (0.0, 0.25 * math.pi, 0.5 * math.pi)  # of rings on a corner, from its lowest place to its side
INT = NDArray[np.int64]


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


def end_depths(tree: TriangleTree, moves: Moves, rows: INT, tools: Sequence[ToolBody],
               tolerance: float) -> tuple[F64, F64, INT]:
    """How deep the ends of mills go into the part on some moves.

    rows      : (k,) int64, index, the moves; tools : those that ``Moves.tool`` refers to
    tolerance : mm; what is less deep counts 0

    Returns
    -------
    depth    : (k,) float64, mm, largest distance of a place of the end, inside the part, from the surface
    place    : (k, 3) float64, mm, setup frame, the place of the surface nearest to it
    triangle : (k,) int64, index of its triangle, -1 where the depth is 0

    Notes
    -----
    Places are the middle of the end and eight on its rim, of a corner eight at each of three heights, in steps of half
    a radius along the move and at both ends of it. Too small by 8 % of the radius at most on a move straight down.
    """
    depth, place, triangle = np.zeros(len(rows)), np.zeros((len(rows), 3)), np.full(len(rows), -1, np.int64)
    radius = np.array([t.radius for t in tools])[moves.tool[rows]]
    count = np.ceil(np.linalg.norm((moves.end - moves.start)[rows], axis=1) / (0.5 * radius)).astype(np.int64) + 1
    ends = np.cumsum(count)
    first = 0
    while first < len(rows):
        last = max(int(np.searchsorted(ends, ends[first] - count[first] + PATH_BATCH, side="right")), first + 1)
        chosen = rows[first:last]
        tip, z, of = path_places(moves.only(chosen), count[first:last])
        near = _near_surface(tree, tip, z, of, moves.tool[chosen], tools)
        tip, z, of = tip[near], z[near], of[near]
        tool = moves.tool[chosen][of]
        for k in np.unique(tool).tolist():
            mine = np.flatnonzero(tool == k)
            for at in _end_places(tip[mine], z[mine], tools[k]):
                away, row, foot = nearest(tree, at)
                deep = np.flatnonzero(away > np.maximum(depth[first:last][of[mine]], tolerance))
                deep = deep[inside_part(tree, at[deep])]
                deep = deep[np.lexsort((deep, -away[deep], of[mine[deep]]))]
                move, one = np.unique(of[mine[deep]], return_index=True)
                best = deep[one]
                depth[first + move], place[first + move], triangle[first + move] = away[best], foot[best], row[best]
        first = last
    return depth, place, triangle


def _near_surface(tree: TriangleTree, tip: F64, z: F64, of: INT, tool: NDArray[np.int32],
                  tools: Sequence[ToolBody]) -> NDArray[np.bool_]:
    """(n,) bool: places of moves that come so near to the surface somewhere that their end may go through it.

    tip, z : (n, 3) float64, mm and unit; of : (n,) int64, index, the move of each; tool : (m,) int32, index, of moves
    """
    corner, radius = (np.array(v)[tool][of] for v in ([t.corner_radius for t in tools], [t.radius for t in tools]))
    away, _, _ = nearest(tree, tip + corner[:, None] * z, float(radius.max(initial=0.0)))
    ball = corner >= radius - 1e-9
    through = np.zeros(len(tool), np.bool_)
    through[of[away < np.where(ball, radius - 1e-4, radius)]] = True
    return through[of]


def _end_places(tip: F64, z: F64, tool: ToolBody) -> list[F64]:
    """Places of the end of a tool with its tip on (n, 3), mm, and its axis along (n, 3): each an (n, 3) array."""
    out = [tip]
    if tool.cone_height > 0.0:
        return out
    x = square_to(z)
    y = np.cross(z, x)
    corner = tool.corner_radius
    for tilt in TILTS if corner > 0.0 else TILTS[:1]:
        wide, high = tool.radius - corner * (1.0 - math.sin(tilt)), corner * (1.0 - math.cos(tilt))
        if wide > 0.0:
            out += [tip + wide * (math.cos(t) * x + math.sin(t) * y) + high * z
                    for t in (2.0 * math.pi * np.arange(AROUND) / AROUND).tolist()]
    return out


__all__ = ["end_depths", "tip_gouges"]
