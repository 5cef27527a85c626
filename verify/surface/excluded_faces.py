"""Faces that the setup does not let machine, and feed moves that bring them to size all the same.

A feed move brings a place to size where it takes off more than the gouge tolerance and leaves no more than a
finished face may have. A tool that finishes the face beside it cannot help that: it runs along a wall while it finishes
the floor. So a place does not count where the same tool touches it from a position in which it finishes another face,
nor within the distance of two places from one of another face that is brought to size: a pass rolls over the edge.
Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_on_normals
from verify.findings import Source, excluded_findings
from verify.model import Finding, ProofSetup
from verify.moves import Moves
from verify.surface.sample_scores import RAY_ERROR
from verify.work.asked_faces import OFF_FACETS

SLACK = 0.2  # of the tool radius, by which a pass may run over the border of its face
INT = NDArray[np.int64]
BOOL = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CutPlaces:
    """Places all over the part, and what was left there.

    points, normals : (n, 3) float64, mm and unit, setup frame
    face     : (n,) int32, index, face number
    area     : (n,) float64, mm²
    residual : (n,) float64, mm left on each normal; mover : (n,) int32, index, the move that left it, -1 for none
    """

    points: F64
    normals: F64
    face: I32
    area: F64
    residual: F64
    mover: I32


def excluded_cuts(places: CutPlaces, mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
                  source: Source, spacing: float) -> list[Finding]:
    """Findings of faces in ``setup.left_alone`` that feed moves bring to size.

    mesh    : of the part, mm, setup frame; spacing : mm between the places

    The depth is the stock on the normal before the first cut, up to another face of the part where it meets one.

    A place that is cut deeper is a gouge and no such finding.
    """
    most = setup.stock_allowance + setup.scallop_height + setup.gouge_tolerance + RAY_ERROR
    to_size = (places.mover >= 0) & (places.residual <= most) & (places.residual >= -setup.gouge_tolerance - RAY_ERROR)
    alone = np.isin(places.face, list(setup.left_alone))
    rows = np.flatnonzero(to_size & alone)
    if not len(rows):
        return []
    points, normals = places.points[rows], places.normals[rows]
    wall, _ = first_hits(TriangleTree(mesh), points, normals, t_min=OFF_FACETS)
    before = np.minimum(stock_on_normals(points, normals, mesh.bounds, setup, np.inf), wall)
    taken = before - places.residual[rows]
    rows, taken = rows[thick := taken > setup.gouge_tolerance + RAY_ERROR], taken[thick]
    others = np.flatnonzero(to_size & ~alone)
    own = np.ones(len(rows), np.bool_)
    for k in np.unique(moves.tool[places.mover[rows]]).tolist():
        mine, with_it = moves.tool[places.mover[rows]] == k, others[moves.tool[places.mover[others]] == k]
        if len(with_it):
            tips, slack = _tips(places, with_it, moves), SLACK * tools[k].radius + spacing
            touched = _touched if moves.axes is None else _near
            own[mine] = ~touched(places, rows[mine], tips, moves, tools[k], slack)
    if len(others):
        own &= ~np.isfinite(cKDTree(places.points[others]).query(places.points[rows], distance_upper_bound=spacing)[0])
    rows, taken = rows[own], taken[own]
    return excluded_findings(places.points[rows], places.face[rows], taken, places.area[rows], places.mover[rows],
                             source, setup.left_alone, setup.gouge_tolerance)


def _tips(places: CutPlaces, rows: INT, moves: Moves) -> F64:
    """(r, 3) mm: the tip on the mover of each place where its axis passes the place, or where a descent ends."""
    start, end, axes = moves.start[places.mover[rows]], moves.end[places.mover[rows]], moves.axes
    z = np.array([[0.0, 0.0, 1.0]]) if axes is None else axes.middle[places.mover[rows]]
    way = end - start
    plan = way - (way * z).sum(axis=1)[:, None] * z
    size = (plan**2).sum(axis=1)
    share = ((places.points[rows] - start) * plan).sum(axis=1) / np.where(size > 1e-12, size, 1.0)
    return np.asarray(start + np.where(size > 1e-12, np.clip(share, 0.0, 1.0), 1.0)[:, None] * way)


def _near(places: CutPlaces, rows: INT, tips: F64, moves: Moves, tool: ToolBody, slack: float) -> BOOL:
    """``_touched`` for tools that lean: places cut within a tool radius of a position that finishes another face."""
    away, _ = cKDTree(tips).query(_tips(places, rows, moves), distance_upper_bound=tool.widest_radius + slack)
    return np.asarray(np.isfinite(away))


def _touched(places: CutPlaces, rows: INT, tips: F64, moves: Moves, tool: ToolBody, slack: float) -> BOOL:
    """(r,) bool: places within ``slack`` mm of the cylinder round the flutes of a tool along Z on one of ``tips``."""
    p, out, wide = places.points[rows], np.zeros(len(rows), np.bool_), tool.widest_radius + slack
    aside, _ = cKDTree(tips[:, :2]).query(p[:, :2], distance_upper_bound=wide)
    level = np.floor(tips[:, 2] / slack).astype(np.int64)
    order = np.argsort(level, kind="stable")
    for part in np.split(tips[order], np.flatnonzero(np.diff(level[order])) + 1):
        low, high = part[:, 2].min() - slack, part[:, 2].max() + tool.flute_length
        these = np.flatnonzero(~out & np.isfinite(aside) & (p[:, 2] >= low) & (p[:, 2] <= high))
        if len(these):
            out[these] = np.isfinite(cKDTree(part[:, :2]).query(p[these, :2], distance_upper_bound=wide)[0])
    return out


__all__ = ["CutPlaces", "excluded_cuts"]
