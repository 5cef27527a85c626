"""What the feed moves of programs leave on the surface of a part, and where they cut into it.

Rays go out from the scored samples and from guard points all over the part; then from close points on flat places that
no coarse sample speaks for; then round all places where the part is cut, for gouges that are deepest between them.
Coordinates are float64, mm, in the setup frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed
from verify.blank.blank import stock_on_normals
from verify.findings import Source, allowance_findings, gouge_findings
from verify.model import Finding, ProofSetup, ScoredSamples
from verify.moves import Moves
from verify.progress import Report, silent
from verify.surface.between_samples import ClosePoints, close_points, judged_places
from verify.surface.cutter_ends import end_depths, tip_gouges, turning_feet
from verify.surface.excluded_faces import CutPlaces, excluded_cuts
from verify.surface.guard_points import (
    CLOSER_SHARE,
    FINE,
    closer_points,
    closer_seeds,
    convex_edges,
    fine_moves,
    first_points,
    guard_samples,
    guard_spacing,
    path_points,
    wide_samples,
    worth_a_look,
)
from verify.surface.remains import Rays, Remains, depths_both_ways, vanished
from verify.surface.removal import residual_on_normals
from verify.surface.sample_scores import RAY_ERROR

MIN_REACH = 1.0
RAY_BATCH = 400_000  # rays at a time from places under paths
OWN_LOOKS = 500  # places of a face at most that are asked whether their tool alone cuts them
SEED_BATCH = 4000  # places that are looked at more closely at a time


@dataclass(frozen=True, eq=False)
class SurfaceCuts:
    """Residuals of n scored samples, and cuts into the part or its allowance anywhere.

    residual  : (n,) float64, mm of stock on each normal, negative where the part is cut
    mover     : (n,) int32, index, the move that left it, -1 where none did
    gouges, allowance, excluded : findings
    gouge_max : mm, depth of the deepest gouge
    guard, edge : (g, 3) and (e, 3) float64, mm, points that watch for gouges on faces and along edges, setup frame,
                each as deep under its face as it was cut, within the gouge tolerance
    close     : ClosePoints, c of them; close_residual : (c,) float64, mm of stock on their normals
    reach     : mm, height above the part up to which stock was followed
    assumed   : what is taken for granted between the points
    notes     : for the report
    """

    residual: F64
    mover: I32
    gouges: list[Finding]
    allowance: list[Finding]
    excluded: list[Finding]
    gouge_max: float
    guard: F64
    edge: F64
    close: ClosePoints
    close_residual: F64
    reach: float
    assumed: list[Assumed]
    notes: list[str]


COLUMNS = ("points", "normals", "face", "area", "residual", "mover")


@dataclass(frozen=True, eq=False)
class _Table(CutPlaces):
    """Rays so far, and what was left on their normals."""

    def __len__(self) -> int:
        return len(self.points)

    def only(self, rows: NDArray[np.int64] | slice) -> _Table:
        return _Table(*(getattr(self, f)[rows] for f in COLUMNS))


def _joined(parts: list[_Table]) -> _Table:
    """Tables as one, in order.

    ``parts`` is emptied, so that each column is freed as soon as it is copied: the memory of the proof peaks here.
    """
    columns = [[getattr(part, f) for part in parts if len(part)] for f in COLUMNS] if any(map(len, parts)) else []
    parts.clear()
    made = []
    while columns:
        column = columns.pop(0)
        made.append(column[0] if len(column) == 1 else np.concatenate(column))
        del column
    return _Table(*made) if made else _none()


@dataclass(frozen=True, eq=False)
class _Shooting:
    """The moves that cut rays, and the stock that stands on them before."""

    bounds: F64
    moves: Moves
    tools: Sequence[ToolBody]
    setup: ProofSetup
    threads: int
    reach: float

    def rays(self, points: F64, normals: F64, face: I32, area: F64, report: Report, *,
             stock: float | None = None) -> _Table:
        """Rays cut by all moves; stock : mm that stands on all of them, None: as much as the blank has."""
        first = np.full(len(points), stock) if stock is not None else stock_on_normals(
            points, normals, self.bounds, self.setup, self.reach)
        left, by = residual_on_normals(points, normals, first, self.moves, self.tools, threads=self.threads,
                                       progress=report)
        return _Table(points, normals, face, area, left, by)


def reach_of(setup: ProofSetup) -> float:
    """Height above the part up to which stock is followed everywhere, mm."""
    return max(MIN_REACH, setup.stock_allowance + 4 * setup.scallop_height)


def surface_cuts(part: Part, tools: Sequence[ToolBody], setup: ProofSetup, scored: ScoredSamples, moves: Moves,
                 source: Source, threads: int, tell: Report) -> SurfaceCuts:
    """Cut rays from samples, guard points and close points with all feed moves.

    part  : Part in the setup frame; tools : those that ``Moves.tool`` refers to
    tell  : called with the share done, 0 to 1; an exception from it ends the work

    Returns SurfaceCuts; the same bytes for any number of threads.
    """
    s, shot = scored.samples, _Shooting(part.mesh.bounds, moves, tools, setup, threads, reach_of(setup))
    watching, guarded = _watching(part.mesh, tell)
    first, on_edge = len(s) + len(watching[0]), len(s) + guarded
    # one after the other: the memory of the proof peaks here
    parts = [shot.rays(s.points, s.normals, s.face, s.area, lambda f: tell(0.1 + 0.4 * f)),
             shot.rays(*watching, lambda f: tell(0.5 + 0.2 * f))]
    del watching
    left_on = parts[0].residual
    places = judged_places(s, left_on, part.mesh.bounds, moves, tools, setup, shot.reach, threads,
                           lambda f: tell(0.7 + 0.05 * f))
    close = close_points(s, left_on, places, setup)
    del left_on
    if len(close.row):
        parts.append(shot.rays(close.points, close.normals, s.face[close.row], np.zeros(len(close.row)),
                               lambda f: tell(0.75 + 0.05 * f)))
    even = sum(map(len, parts))
    tree = TriangleTree(part.mesh)
    feet, wide = turning_feet(tree, moves, tools, setup.gouge_tolerance)
    if len(feet.triangle):
        parts.append(shot.rays(feet.points, feet.normals, part.mesh.face_ids[feet.triangle],
                               np.zeros(len(feet.triangle)), lambda f: tell(0.8 + 0.05 * f), stock=shot.reach))
    parts.append(_followed(tree, shot))
    parts = [_joined(parts)]
    parts = [_deepened(parts, even, tree, shot, lambda f: tell(0.85 + 0.15 * f))]
    table = _at_ends(parts, tree, shot)
    gouged = np.flatnonzero((table.residual < -setup.gouge_tolerance - RAY_ERROR) & (table.mover >= 0))
    by = _by_own_tool(table, gouged, tree, shot)
    tips = tip_gouges(tree, moves, tools, source, setup.gouge_tolerance + RAY_ERROR)
    watch = np.arange(len(s), first)
    sunk = np.clip(table.residual[watch], -setup.gouge_tolerance, 0.0)
    left = table.points[watch] + sunk[:, None] * table.normals[watch]
    row = np.arange(len(table))  # the stock on an edge belongs to two faces, so an edge has no allowance
    return SurfaceCuts(
        table.residual[:len(s)], table.mover[:len(s)],
        [*tips, *gouge_findings(table.points[gouged], table.face[gouged], -table.residual[gouged], table.area[gouged],
                                by, source, setup.gouge_tolerance)],
        _in_allowance(table, (row < on_edge) | ((row >= first) & (row < even)), setup, source),
        _excluded(table, slice(len(s), on_edge), part.mesh, shot, source),
        max([float(-table.residual.min(initial=0.0)), 0.0, *(f.depth for f in tips)]), left[:guarded],
        left[guarded:], close, table.residual[first:even], shot.reach, [*wide_samples(part.mesh), *wide],
        _thread_notes(np.unique(moves.tool[by]).tolist(), tools))


def _watching(mesh: TriangleMesh, tell: Report) -> tuple[tuple[F64, F64, I32, F64], int]:
    """Points, normals, faces and areas of guard points and places on edges; and how many guard points."""
    guard = guard_samples(mesh)
    tell(0.05)
    edge, bisector, edge_face = convex_edges(mesh)
    tell(0.1)
    return (np.concatenate([guard.points, edge]), np.concatenate([guard.normals, bisector]),
            np.concatenate([guard.face, edge_face]), np.concatenate([guard.area, np.zeros(len(edge))])), len(guard)


def _thread_notes(cutting: Sequence[int], tools: Sequence[ToolBody]) -> list[str]:
    """Notes on tools for threads that cut into the part.

    cutting : places in ``tools`` of those that do
    """
    return [f"{tools[k].id} is a {tools[k].kind.replace('_', ' ')} and cuts into the part: where the part shows the "
            "hole before the thread, give the diameter of that hole as diameter_mm"
            for k in cutting if tools[k].kind in ("tap", "thread_mill")]


def _followed(tree: TriangleTree, shot: _Shooting) -> _Table:
    """Rays from places under the paths of fine tools, those of them that are cut.

    All moves cut each batch of rays, so places are gathered to batches of ``RAY_BATCH`` before. Only cuts into the part
    count, so no stock stands on these rays: moves that touch the surface do not come near.
    """
    kept, points, rows = [_none()], [np.zeros((0, 3))], [np.zeros(0, np.int64)]

    def shoot() -> None:
        row = np.concatenate(rows)
        kept.append(_cut(_close_rays(tree, shot, np.concatenate(points), tree.mesh.normals[row], row, 0.0), shot))
        points[1:], rows[1:] = [], []

    for more, row in path_points(tree, shot.moves, shot.tools, shot.setup.gouge_tolerance):
        points.append(more)
        rows.append(row)
        if sum(map(len, rows)) >= RAY_BATCH:
            shoot()
    shoot()
    return _joined(kept)


def _none() -> _Table:
    none, rows = np.zeros((0, 3)), np.zeros(0, np.int32)
    return _Table(none, none, rows, np.zeros(0), np.zeros(0), rows)


def _close_rays(tree: TriangleTree, shot: _Shooting, points: F64, normals: F64, row: NDArray[np.int64],
                stock: float | None = None) -> _Table:
    """Rays from places close together, which stand for no area, of triangles ``row`` (n,).

    stock : mm on them; None: as far as they are followed
    """
    return shot.rays(points, normals, tree.mesh.face_ids[row], np.zeros(len(row)), silent,
                     stock=shot.reach if stock is None else stock)


def _cut(table: _Table, shot: _Shooting) -> _Table:
    """The rays of a table that are cut deep enough for a closer look."""
    return table.only(np.flatnonzero((table.residual < -CLOSER_SHARE * shot.setup.gouge_tolerance)
                                     & (table.mover >= 0)))


def _deepened(taken: list[_Table], even: int, tree: TriangleTree, shot: _Shooting, tell: Report) -> _Table:
    """More rays round the places that are cut, and the depths of all gouges.

    taken : one table, which is taken out of the list
    even  : count of rays that lie evenly over the part
    """
    tolerance = shot.setup.gouge_tolerance
    near, left = _cut(taken[0], shot), Remains(tree, shot.moves, shot.tools, shot.threads)
    doubtful = deep = np.zeros((0, 3))
    if len(near):
        doubtful, deep = closer_seeds(near.points, near.residual, near.mover, tolerance)
    looks, kept = len(doubtful) + len(deep), [taken.pop()]
    for i in range(0, len(doubtful), SEED_BATCH):
        seeds = doubtful[i:i + SEED_BATCH]
        first = _close_rays(tree, shot, *first_points(tree, seeds))
        deep = np.concatenate([deep, seeds[worth_a_look(first.residual, tolerance)]])
        kept.append(_gouged(first, shot))
        tell(0.25 * (i + len(seeds)) / looks)
    for i in range(0, len(deep), SEED_BATCH):
        seeds = deep[i:i + SEED_BATCH]
        kept.append(_gouged(_close_rays(tree, shot, *closer_points(tree, seeds)), shot))
        tell(0.25 + 0.25 * (i + len(seeds)) / len(deep))
    table = _joined(kept)
    rays = Rays(table.points, table.normals, table.residual)
    rows = np.flatnonzero((table.residual < -tolerance) & (table.mover >= 0))
    thin = vanished(left, rays, even, tolerance)
    rows = np.union1d(rows, thin)
    if len(rows):
        table.residual[rows] = -depths_both_ways(left, rays, rows, np.isin(rows, thin), even, tolerance,
                                                 lambda f: tell(0.5 + 0.5 * f))
    return table


def _at_ends(taken: list[_Table], tree: TriangleTree, shot: _Shooting) -> _Table:
    """The rays of a table, and the ends of tools that gouge deeper than the rays of their move say.

    taken : one table, which is taken out of the list
    """
    table = taken.pop()
    tolerance = shot.setup.gouge_tolerance + RAY_ERROR
    gouged = np.flatnonzero((table.residual < -tolerance) & (table.mover >= 0))
    gouged = gouged[np.lexsort((gouged, table.residual[gouged], table.mover[gouged]))]
    mover, first = np.unique(table.mover[gouged], return_index=True)
    small = np.array([t.radius <= FINE for t in shot.tools])
    fine = fine_moves(tree.mesh, shot.moves, shot.tools, shot.setup.gouge_tolerance)
    rows = np.union1d(mover, fine[small[shot.moves.tool[fine]]]).astype(np.int64)
    depth, place, triangle = end_depths(tree, shot.moves, rows, shot.tools, tolerance)
    known = np.full(len(rows), tolerance)  # of the move, by its rays
    known[np.searchsorted(rows, mover)] = -table.residual[gouged[first]]
    pointed = np.array([t.cone_height > 0.0 and t.tip_diameter <= 0.0 for t in shot.tools])  # see ``tip_gouges``
    new = np.flatnonzero((depth > known + RAY_ERROR) & ~pointed[shot.moves.tool[rows]])
    parts = [table, _Table(place[new], tree.mesh.normals[triangle[new]], tree.mesh.face_ids[triangle[new]],
                           np.zeros(len(new)), -depth[new], rows[new].astype(np.int32))]
    del table
    return _joined(parts)


def _by_own_tool(table: _Table, rows: NDArray[np.int64], tree: TriangleTree, shot: _Shooting) -> I32:
    """The moves that are told of gouges, (r,) int32, index; rows : (r,) int64, index, of the gouges.

    At the edge of a hole a drill may take a place along its ray, as facets stand into the hole, while another tool cuts
    the hole too wide. So on faces that several tools gouge, a move whose tool alone leaves something of the part as
    near as the tolerance is not told, but the move of another tool.
    """
    moves, tolerance = shot.moves, shot.setup.gouge_tolerance + RAY_ERROR
    by = table.mover[rows].copy()
    tool = moves.tool[by]
    pairs, of = np.unique(np.column_stack([table.face[rows], tool]), axis=0, return_inverse=True)
    face, count = np.unique(pairs[:, 0], return_counts=True)
    mixed = np.isin(pairs[:, 0], face[count > 1])
    for pair in np.flatnonzero(mixed).tolist():
        mine, k = np.flatnonzero(of.reshape(-1) == pair), int(pairs[pair, 1])
        if len(mine) > OWN_LOOKS:
            continue
        alone = Remains(tree, moves.only(moves.tool == k), shot.tools, shot.threads)
        other = mine[~alone.gone(table.points[rows[mine]], tolerance)]
        rest = np.flatnonzero(moves.tool != k)
        left, move = residual_on_normals(table.points[rows[other]], table.normals[rows[other]], np.zeros(len(other)),
                                         moves.only(rest), shot.tools, threads=shot.threads)
        found = (move >= 0) & (left < -tolerance)
        by[other[found]] = rest[move[found]]
    return by


def _gouged(table: _Table, shot: _Shooting) -> _Table:
    """The rays that are gouges, and the deepest of all."""
    rows = np.flatnonzero((table.residual < -shot.setup.gouge_tolerance) & (table.mover >= 0))
    return table.only(rows if len(rows) else np.array([int(np.argmin(table.residual))]))


def _excluded(table: _Table, guard: slice, mesh: TriangleMesh, shot: _Shooting, source: Source) -> list[Finding]:
    """Findings of faces that are left alone and brought to size, on the even points of the whole part."""
    if not shot.setup.left_alone:
        return []
    return excluded_cuts(table.only(guard), mesh, shot.moves, shot.tools, shot.setup, source, guard_spacing(mesh))


def _in_allowance(table: _Table, counts: NDArray[np.bool_], setup: ProofSetup, source: Source) -> list[Finding]:
    """Findings of cuts that leave the part whole and less than the allowance on it."""
    depth = setup.stock_allowance - table.residual
    into = np.flatnonzero(counts & (table.residual >= -setup.gouge_tolerance) & (table.mover >= 0)
                          & (depth > setup.gouge_tolerance + RAY_ERROR))
    return allowance_findings(table.points[into], table.face[into], depth[into], table.area[into], table.mover[into],
                              source, setup.stock_allowance, setup.gouge_tolerance)
