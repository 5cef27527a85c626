"""Depth of gouges from the surface that is gone to the material that is left.

A gouge is measured both ways. ``verify.surface.guard_points.gouge_depths`` takes the removed places and their distance
from the surface. That is never more than half the thickness of a rib, a floor or an edge, however much of it is gone.
Here the places of the surface whose material is gone are taken, with their distance from what is left. The larger of
the two is the Hausdorff distance between the part and what is left of it [Hausdorff1914].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.tool_body import ToolBody
from verify.kernels.surface.remains import CLOSE, SHARE, distances_left
from verify.material.point_tree import curve_keys
from verify.material.tiles import run_tiles
from verify.moves import BOW, Moves, Progress, cutter_table
from verify.progress import Report, silent
from verify.surface.guard_points import FACETS_OFF, gouge_depths, inside_part
from verify.tool_axes import ToolAxes

WHOLE = 0.99  # of the way along a ray: a gouge that deep is measured by its ray
BATCH = 64  # places of one call at most: near each other, so that few moves have to be looked through
SHARES = 8  # calls a thread at least, where there are as many places: places differ much in what they take
CELL = 5.0  # mm: of the places in such a cell only those are measured that may be the farthest
APART = 0.05  # mm
MANY_RAYS = 250_000  # whose ends are computed at a time
SHALLOW = 0.25  # of the tolerance, that the deeper of two cuts takes at least where they make something vanish
STARTS = 1e-4  # mm: what is nearer to the start of a ray is where it starts
LEAST_TURNED = 0.1  # cosine: a cut reaches no farther along a ray than its depth by that of their angle
BESIDE, FEW = 0.5, 8  # mm: rays so near to each other tell of one place; how many of them do
APART_ASKED = 1.0  # mm: one place in such a cell is asked whether anything is left near it
NEAR, MANY = 2.0, 256  # mm, and of them along the places: what cells of that size do not hold is looked for among all


class Remains:
    """What a program leaves of a part.

    tree    : TriangleTree of the part, setup frame
    moves   : Moves; tools : the tools their ``tool`` column refers to
    threads : the result has the same bytes for any number
    """

    def __init__(self, tree: TriangleTree, moves: Moves, tools: Sequence[ToolBody], threads: int = 2) -> None:
        self.tree, self.moves, self.threads = tree, moves, threads
        self.cutters = cutter_table(tools)
        self.reach = np.hypot(self.cutters[:, 0], self.cutters[:, 2])
        axes = ToolAxes.upright(len(moves)) if moves.axes is None else moves.axes
        self.axes = axes.arrays(BOW)
        self.feeds = np.flatnonzero(moves.feed)

    def distances(self, points: F64, within: F64, enough: float | F64 = 0.0, progress: Progress | None = None) -> F64:
        """Distance of places to what is left of the part.

        points : (n, 3) float64, mm, setup frame
        within : (n,) float64, mm: inf is returned where nothing is left as near as that
        enough : () or (n,) float64, mm; what is nearer need not be measured any better

        Returns (n,) float64, mm, too large by 1e-4 mm or 1 % at most. Films thinner than 1e-4 mm or 3 % of
        their distance count as gone.
        """
        out = np.full(len(points), np.inf)
        order = np.argsort(curve_keys(points), kind="stable")
        a, b = self.moves.start[self.feeds], self.moves.end[self.feeds]
        middle, half = 0.5 * (a + b), 0.5 * np.linalg.norm(b - a, axis=1) + self.reach[self.moves.tool[self.feeds]]
        arrays, normals = self.moves.arrays, self.tree.mesh.normals
        limit = np.broadcast_to(np.asarray(enough, dtype=np.float64), len(points))

        def job(rows: NDArray[np.int64]) -> Callable[[], object]:
            def work() -> None:
                low, high = points[rows].min(axis=0), points[rows].max(axis=0)
                far = half + BOW + np.sqrt(3.0) * float(within[rows].max())
                chosen = self.feeds[((middle > low - far[:, None]) & (middle < high + far[:, None])).all(axis=1)]
                found = np.empty(len(rows))
                distances_left(np.ascontiguousarray(points[rows]), within[rows], self.tree.arrays, normals, arrays,
                               self.axes, self.cutters, self.reach, chosen, limit[rows], found)
                out[rows] = found
            return work

        batch = max(1, min(BATCH, len(order) // (SHARES * self.threads)))
        run_tiles([job(order[i:i + batch]) for i in range(0, len(order), batch)], self.threads, progress)
        return out

    def gone(self, points: F64, tolerance: float, progress: Progress | None = None) -> NDArray[np.bool_]:
        """(n,) bool: places with nothing left of the part as near as ``tolerance`` mm.

        points : (n, 3) float64, mm, setup frame
        """
        return np.isinf(self.distances(points, np.full(len(points), tolerance), tolerance, progress))

    def depths(self, points: F64, bound: F64, progress: Progress | None = None) -> F64:
        """Distance of places to what is left, measured for the farthest of each cell of 5 mm.

        points : (n, 3) float64, mm, setup frame
        bound  : (n,) float64, mm, what the distance cannot exceed; see ``bounds``

        Returns (n,) float64, mm. The farthest of a cell is right within 2 %. Others of a cell may have their bound, or
        the distance of the farthest where that is less: the distance changes by no more than the way between places.
        """
        _, group = np.unique(np.floor(points / CELL).astype(np.int64), axis=0, return_inverse=True)
        group, bound = group.reshape(-1), bound.copy()
        known, most = np.zeros(len(points), np.bool_), np.zeros(group.max(initial=-1) + 1)
        enough = CLOSE * np.ones(len(most))
        while (rows := np.flatnonzero(~known & (bound > enough[group]))).size:
            rows = rows[np.lexsort((rows, -bound[rows], group[rows]))]
            rows = rows[np.unique(group[rows], return_index=True)[1]]
            found = np.minimum(self.distances(points[rows], bound[rows] * (1.0 + SHARE) + CLOSE, enough[group[rows]]),
                               bound[rows])
            known[rows], bound[rows] = True, found
            farther = rows[found > enough[group[rows]]]  # of others it is known only that they are not farther
            np.maximum.at(most, group[farther], bound[farther])
            enough = most * (1.0 + 2.0 * SHARE) + CLOSE
            at = np.full(len(most), -1)
            at[group[rows]] = np.arange(len(rows))
            other = np.flatnonzero(~known & (at[group] >= 0))
            measured = at[group[other]]
            away = np.linalg.norm(points[other] - points[rows[measured]], axis=1)
            bound[other] = np.minimum(bound[other], found[measured] + away)
            if progress is not None:
                progress(float(known.mean()))
        return np.minimum(bound, most[group])


class Rays(NamedTuple):
    """Places of the surface and what the program left on their normals, setup frame.

    points, normals : (n, 3) float64, mm and unit, normals out of the material
    residual        : (n,) float64, mm, negative where the part is cut
    """

    points: F64
    normals: F64
    residual: F64


def vanished(left: Remains, rays: Rays, even: int, tolerance: float) -> NDArray[np.int64]:
    """Rays with nothing left of the part as near as the tolerance, for cuts take its whole thickness.

    left      : Remains
    rays      : Rays
    even      : count of rays that lie evenly over the part; others are not asked
    tolerance : mm

    Returns (m,) int64, index. Of two cuts that make a thickness vanish, perhaps neither deeper than the tolerance, one
    takes half of it or more. So the part is t <= 2 a thick under its rays, and rays near their far ends are cut by
    t - a. Cuts of less than ``SHALLOW`` of the tolerance are not asked. Then the rays of the far side are asked. One
    ray of each cell of ``APART_ASKED`` mm is asked for all that may be gone there: how deep each is cut is measured
    later.
    """
    cut = -rays.residual[:even]
    rows = np.flatnonzero(cut >= SHALLOW * tolerance)
    thick = _thickness(left.tree, rays, rows, 2.0 * cut[rows])
    rows, thick = rows[np.isfinite(thick)], thick[np.isfinite(thick)]
    over = cut[rows] + _cut_at(rays, rows, thick, np.flatnonzero(cut > CLOSE)) - thick
    rows, over = rows[over > -STARTS], over[over > -STARTS]
    found = rows[_gone_by_cell(left, rays.points[rows], over, tolerance)]
    if not len(found):
        return found
    rest = np.setdiff1d(np.arange(even), found)
    over = _over_from_behind(left.tree, rays, rest, found, found, tolerance)
    rest, over = rest[over >= 0.0], over[over >= 0.0]
    return np.union1d(found, rest[_gone_by_cell(left, rays.points[rest], over, tolerance)])


def _gone_by_cell(left: Remains, points: F64, over: F64, tolerance: float) -> NDArray[np.bool_]:
    """Whether nothing is left near a place of each cell, (n,) bool.

    points : (n, 3) float64, mm, setup frame
    over   : (n,) float64, mm, the place where it is most is asked
    """
    if not len(points):
        return np.zeros(0, np.bool_)
    _, cell = np.unique(np.floor(points / APART_ASKED).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    order = np.lexsort((np.arange(len(over)), -over, cell))
    asked = order[np.unique(cell[order], return_index=True)[1]]
    return np.asarray(left.gone(points[asked], tolerance)[cell])


def _cut_at(rays: Rays, rows: NDArray[np.int64], thick: F64, among: NDArray[np.int64]) -> F64:
    """How deep the part is cut at the far ends of rays, along them, (k,) float64, mm: the most of the rays beside.

    rows, thick : (k,) int64, index, the rays, and (k,) float64, mm, how far off their far ends are
    among       : (m,) int64, index, the rays that may be there
    """
    out = np.zeros(len(rows))
    behind = rays.points[rows] - thick[:, None] * rays.normals[rows]
    among = among[_in_cells(rays.points[among], behind)]
    if len(among):
        away, k = cKDTree(rays.points[among]).query(behind, FEW, distance_upper_bound=BESIDE)
        there = among[np.where(np.isfinite(away), k, 0)]
        turned = np.abs(np.einsum("ij,ikj->ik", rays.normals[rows], rays.normals[there]))
        cut = np.maximum(-rays.residual[there], 0.0) / np.maximum(turned, LEAST_TURNED)
        out = np.where(np.isfinite(away), cut, 0.0).max(axis=1)
    return np.asarray(out)


def _thickness(tree: TriangleTree, rays: Rays, rows: NDArray[np.int64], within: F64) -> F64:
    """Thickness of the part under rays (k,), (k,) float64, mm; inf where it is more than ``within``, (k,) mm."""
    points, normals = rays.points[rows], rays.normals[rows]
    out, begin, open_ = np.full(len(rows), np.inf), np.zeros(len(rows)), np.arange(len(rows))
    for _ in range(2):  # a sample of the exact surface may lie above its facet, which is not the far side
        way = within[open_] - begin[open_] + STARTS
        most = float(way.max(initial=STARTS))
        t, hit = first_hits(tree, points[open_] - begin[open_, None] * normals[open_], -way[:, None] * normals[open_],
                            STARTS / most, 1.0)
        open_, t, hit = open_[hit >= 0], (t * way)[hit >= 0], hit[hit >= 0]
        far = np.einsum("ij,ij->i", tree.mesh.normals[hit], normals[open_]) < 0.0
        out[open_[far]] = begin[open_[far]] + t[far]
        again = ~far & (t < FACETS_OFF)
        open_ = open_[again]
        begin[open_] += t[again]
    return out


class LeftOnRays:
    """Places where rays meet what is left: what ``Remains.depths`` starts from.

    tree    : TriangleTree of the part, setup frame
    rays    : Rays
    rows    : (k,) int64, index, the rays that count; those whose cut goes out at the far side of an edge do not
    largest : mm, returned where no ray counts
    """

    def __init__(self, tree: TriangleTree, rays: Rays, rows: NDArray[np.int64], largest: float) -> None:
        self.tree, self.rays, self.rows, self.largest = tree, rays, rows, largest

    def bounds(self, points: F64) -> F64:
        """Distances of places to the nearest of these.

        points : (n, 3) float64, mm, setup frame

        Returns (n,) float64, mm.
        """
        if not len(points):
            return np.zeros(0)
        near = max(NEAR, float(np.ptp(points, axis=0).max()) / MANY)
        asked = np.floor(points / near).astype(np.int64)
        low, high = asked.min(axis=0) - 1, asked.max(axis=0) + 2
        marked = np.zeros(high - low, np.uint8)
        marked[tuple((asked - low).T)] = 1
        grown = maximum_filter(marked, 3)
        found = [np.zeros(0, np.int64)]
        for first in range(0, len(self.rows), MANY_RAYS):
            rows = self.rows[first:first + MANY_RAYS]
            ends = self._ends(rows)
            within = np.flatnonzero(((ends >= low * near) & (ends < high * near)).all(axis=1))
            cell = np.clip(np.floor(ends[within] / near).astype(np.int64), low, high - 1) - low
            found.append(rows[within[grown[tuple(cell.T)] > 0]])
        beside = np.concatenate(found)
        out = self._nearest(points, beside, self._ends(beside))
        far = np.flatnonzero(out > near)  # all that is nearer lies in the cells beside
        if len(far):
            out[far] = self._nearest(points[far], self.rows, self._ends(self.rows))
        return np.minimum(out, self.largest)

    def _ends(self, rows: NDArray[np.int64]) -> F64:
        """Where rays (k,) meet what is left, (k, 3), mm."""
        return np.asarray(self.rays.points[rows]
                          + np.minimum(self.rays.residual[rows], 0.0)[:, None] * self.rays.normals[rows])

    def _nearest(self, points: F64, rows: NDArray[np.int64], ends: F64) -> F64:
        """Distances to the ends (k, 3) of rays (k,), inf where none counts."""
        cut = np.flatnonzero(self.rays.residual[rows] < -CLOSE)
        kept = np.ones(len(rows), np.bool_)
        kept[cut] = inside_part(self.tree, ends[cut])
        if not kept.any():
            return np.full(len(points), np.inf)
        return np.asarray(cKDTree(ends[kept]).query(points)[0], dtype=np.float64)


def _in_cells(points: F64, others: F64) -> NDArray[np.bool_]:
    """Whether one of (m, 3) others may be within ``BESIDE`` of points (n, 3), mm, (n,) bool."""
    if not len(others):
        return np.zeros(len(points), np.bool_)
    low = np.floor(others.min(axis=0) / BESIDE) - 1.0
    size = np.floor(others.max(axis=0) / BESIDE) - low + 2.0
    scale = np.array([size[1] * size[2], size[2], 1.0])
    around = np.stack(np.meshgrid(*[np.arange(-1.0, 2.0)] * 3), axis=-1).reshape(-1, 3) @ scale
    wanted = np.unique(((np.unique(np.floor(others / BESIDE), axis=0) - low) @ scale)[:, None] + around)
    cell = np.floor(points / BESIDE) - low
    inside = ((cell >= 0.0) & (cell < size)).all(axis=1)
    inside[inside] = np.isin(cell[inside] @ scale, wanted)
    return inside


def _over_from_behind(tree: TriangleTree, rays: Rays, rows: NDArray[np.int64], deep: NDArray[np.int64],
                      cut: NDArray[np.int64], least: float) -> F64:
    """How far a cut from the far side may reach over the ends of rays, (k,) float64, mm; -inf where it does not.

    rows  : (k,) int64, index, the rays
    deep  : (d,) int64, index, those where nothing is left; only rays near them are looked at
    cut   : (m,) int64, index, those that tell how deep the far side is cut
    least : mm, that the far side is cut everywhere at least

    From 0 on the ends may be gone. Where ``least`` is above 0 it is said of some that stand, too.
    """
    out = np.full(len(rows), -np.inf)
    most = max(least, -float(rays.residual[deep].min(initial=0.0)))
    box = rays.points[deep].min(axis=0) - most - BESIDE, rays.points[deep].max(axis=0) + most + BESIDE
    near = np.flatnonzero(((rays.points[rows] >= box[0]) & (rays.points[rows] <= box[1])).all(axis=1))
    own = np.maximum(-rays.residual[rows[near]], 0.0)
    thick = _thickness(tree, rays, rows[near], own + most)
    thin = np.isfinite(thick)
    near, own, thick = near[thin], own[thin], thick[thin]
    there = np.maximum(_cut_at(rays, rows[near], thick, cut), least)
    out[near] = own + there + STARTS - thick
    return out


def depths_both_ways(left: Remains, rays: Rays, deep: NDArray[np.int64], thin: NDArray[np.bool_], even: int,
                     tolerance: float, tell: Report = silent) -> F64:
    """Depth of gouges: removed places to the surface, or surface that is gone to what is left [Hausdorff1914].

    left      : Remains
    rays      : Rays
    deep      : (k,) int64, index, the rays on which the part is cut, in rising order
    thin      : (k,) bool, those of them that are ``vanished``
    even      : count of rays that lie evenly over the part. Those after them are close round places that are cut. They
                are asked for the second way only where none of the others in their cell is gone, one in 0.05 mm
    tolerance : mm; where something is left as near as that, only the first way counts
    tell      : called with the share done, 0 to 1; an exception from it ends the work

    Returns (k,) float64, mm: the larger of the two, as exact as ``gouge_depths`` and ``Remains.depths``.
    """
    points, along = rays.points[deep], -rays.residual[deep]
    depth = gouge_depths(left.tree, points, rays.normals[deep], along, lambda f: tell(0.3 * f))
    whole = (depth >= WHOLE * along) & ~thin  # what is left begins at the end of the ray
    if whole.all():
        return depth
    ends = np.ones(len(rays.points), np.bool_)
    ends[deep[~whole]] = False
    size = float(np.linalg.norm(np.diff(left.tree.mesh.bounds, axis=0)))
    rows = np.flatnonzero(ends)
    if thin.any():
        cut = np.flatnonzero(-rays.residual > CLOSE)
        rows = rows[_over_from_behind(left.tree, rays, rows, deep[thin], cut, 0.0) < 0.0]
    there = LeftOnRays(left.tree, rays, rows, size)

    def second(rows: NDArray[np.int64], first: float, last: float) -> NDArray[np.int64]:
        bound = there.bounds(points[rows])
        rows, bound = rows[bound > tolerance], bound[bound > tolerance]
        gone = thin[rows]
        gone[~gone] = left.gone(points[rows[~gone]], tolerance, lambda f: tell(first + 0.5 * (last - first) * f))
        rows, bound = rows[gone], bound[gone]
        away = left.depths(points[rows], bound, lambda f: tell(0.5 * (first + last) + 0.5 * (last - first) * f))
        depth[rows] = np.maximum(depth[rows], away)
        return rows

    found = second(np.flatnonzero(~whole & (deep < even)), 0.3, 0.7)
    rows = np.flatnonzero(~whole & (deep >= even))
    if len(rows):
        cells = np.floor(points / CELL).astype(np.int64)
        known = {tuple(c) for c in np.unique(cells[found], axis=0).tolist()}
        rows = rows[[tuple(c) not in known for c in cells[rows].tolist()]]
        rows = rows[np.sort(np.unique(np.floor(points[rows] / APART).astype(np.int64), axis=0, return_index=True)[1])]
        second(rows, 0.7, 1.0)
    return depth
