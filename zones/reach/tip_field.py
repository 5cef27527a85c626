"""Admissible positions of a tool assembly, and the surface samples it can touch.

One quantity describes reach in three axes: the *tip limit* H(x, y), the lowest height of the tool tip over (x, y) at
which nothing of the assembly enters the part or a fixture. A tip at or above H is safe. The free region of a height z
is F(z) = {H <= z}, and F grows with z.

The cutting part is exact (``geometry.kernels.drop`` on the mesh). Shank and holder need less precision. A look-up on a
coarse grid, grown by their clearance and by half a cell diagonal, is never below the true limit. A neck thinner than
the cutter never decides, since the cutter has passed everywhere the neck goes. Coordinates are those of the access
frame.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import LeaningSide, Shape, Side, blocked_many, drop_along, drop_shape, drop_tips
from geometry.mesh_queries.flat_grid import drop_over_flats
from geometry.tool_body import ToolBody
from zones.kernels.lattice import noncut_blocked, noncut_lookup
from zones.lattice import Lattice, blocked_beside
from zones.machinable_area import LEVEL, SEEN
from zones.reach.assembly import Clearances, Disc, discs_of

LEVEL_TOLERANCE = 1e-5  # mm: a tip within this below H still counts as standing on it
LOOKUP_STEP = 0.2  # mm, grid of the shank and holder limits
EDGE_SLACK = 0.01  # mm: a flat bottom need not reach nearer than this to a wall beside the plane
BELOW = 1.0  # mm: no query has a tip farther under the obstacles than this plus its own radius
AIMED = 12  # free nodes towards which a flat bottom is tried over a level place
BEYOND = 3.0  # lattice steps: largest distance of these nodes outside the flat
INSIDE = 1.5e-3  # mm: a flat bottom need not reach nearer than this to its own rim, because of the error of lines
SQUARE = 5  # nodes along a square of them that is asked as a whole
PLAY_STEPS = 1.42  # lattice steps: least sideways play of a tool beside a wall, for it to be planned there


class DiscHeights:
    """Lowest height of the underside of a disc over one set of obstacles, cached by radius for tools in one holder.

    tree : TriangleTree of the obstacles in the access frame
    """

    def __init__(self, tree: TriangleTree) -> None:
        self.tree = tree
        self._kept: dict[float, tuple[Lattice, F64]] = {}

    def over(self, lattice: Lattice, radius: float) -> F64:
        """(ny, nx) float64, mm, over the nodes of a lattice of ``Lattice.on_multiples``; do not write to it."""
        kept = self._kept.get(radius)
        if kept is not None and (part := lattice.within(kept[0])) is not None:
            return kept[1][part]
        height = drop_over_flats(self.tree, lattice.x0, lattice.y0, lattice.step, lattice.nx, lattice.ny, radius, 0.0)
        if kept is None or kept[1].size < height.size:
            self._kept[radius] = lattice, height
        return height


class TipField:
    """The tip limit of one tool over one set of obstacles.

    tree   : TriangleTree of the obstacles (part and fixture boxes) in the access frame
    tool   : ToolBody
    clear  : Clearances
    bounds : (2, 3) float64, mm, access frame, region of interest in plan
    step   : mm, spacing of the planning lattice
    allowance : mm, material to leave on the part: the cutting part is grown by it on all sides
    cusp   : mm, height that passes may leave above the allowance: shank and holder stay higher by it
    standing : DiscHeights of the same obstacles, shared with other tools

    ``kept`` holds what callers computed last from this field alone, by their names.
    """

    def __init__(self, tree: TriangleTree, tool: ToolBody, clear: Clearances, bounds: F64, margin: float,
                 step: float, allowance: float = 0.0, cusp: float = 0.0, standing: DiscHeights | None = None) -> None:
        self.tree, self.tool, self.clear, self.allowance, self.cusp = tree, tool, clear, allowance, cusp
        self.lattice = Lattice.over(bounds, margin, step)
        self.coarse = Lattice.on_multiples(bounds, margin + 2 * LOOKUP_STEP, LOOKUP_STEP)
        self.standing = standing or DiscHeights(tree)
        self.discs = discs_of(tool, clear)
        self.noncut = self._noncut(self.discs)
        self._cut: F64 | None = None
        self._height: F64 | None = None
        self._off: tuple[tuple[float, tuple[F64, NDArray[np.int32]] | None], ...] = ()
        self.kept: dict[str, Any] = {}

    def _noncut(self, discs: tuple[Disc, ...]) -> F64:
        grid = np.full((self.coarse.ny, self.coarse.nx), -np.inf)
        for d in (d for d in discs if self._can_meet(d)):
            limit = self.disc_limit(d, self.standing.over(self.coarse, self.disc_radius(d, 0.5)))
            grid = np.maximum(grid, limit)
        if discs:  # obstacles beyond the grid are unknown, so the tool does not go there
            for edge in (grid[:1], grid[-1:], grid[:, :1], grid[:, -1:]):
                edge[:] = np.inf
        return grid

    def _can_meet(self, disc: Disc) -> bool:
        """Whether a disc can come down to the top of the obstacles, at any tip of a query.

        A ball that touches the lowest edge from the side has its tip a radius under the obstacles.
        """
        if not len(self.tree):
            return False
        bottom, top = float(self.tree.arrays.lower[0, 2]), float(self.tree.arrays.upper[0, 2])
        return top + self.allowance + self.cusp - disc.height > bottom - self.grown_radius - BELOW

    def disc_radius(self, disc: Disc, diagonals: float) -> float:
        """Radius of a disc with the allowance and this many cell diagonals of the shank and holder grid, mm."""
        return disc.radius + self.allowance + diagonals * LOOKUP_STEP * math.sqrt(2.0)

    def disc_limit(self, disc: Disc, height: F64) -> F64:
        """Tip limit for a disc.

        height : (n,) or (ny, nx) float64, mm, least height of the underside of the disc

        Returns (n,) or (ny, nx) float64, mm, as ``height``.
        """
        return np.asarray(height + self.allowance + self.cusp - disc.height)

    def window(self, lower: F64, upper: F64, step: float) -> TipField:
        """The same tool and obstacles on a lattice of another step.

        lower, upper : (2,) float64, mm, in plan, corners;  step : mm
        """
        out = copy.copy(self)
        out.lattice = Lattice.over(np.array([lower, upper]), 0.0, step)
        out._cut = out._height = None
        out._off, out.kept = (), {}
        return out

    def forget(self) -> None:
        """Drop what is kept of the last heights."""
        self._off, self.kept = (), {}

    @property
    def grown_radius(self) -> float:
        """Radius of the cutting part with the allowance, mm."""
        return self.tool.radius + self.allowance

    @property
    def grown_corner(self) -> float:
        """Corner radius of the cutting part with the allowance, mm."""
        return self.tool.corner_radius + self.allowance

    @property
    def grown_side(self) -> Side | None:
        """Side of a tapered or arcs of a circle segment mill with the allowance; None for another cutting part."""
        return self._side(0.0)

    @property
    def shape(self) -> Shape:
        """The cutting part with the allowance, as compiled loops take it."""
        return drop_shape(self.grown_radius, self.grown_corner, self.grown_side)

    def _side(self, wider: float) -> Side | None:
        """``grown_side`` of a cutting part whose radius is ``wider`` mm larger than it is."""
        tool = self.tool
        if tool.arcs is not None:
            return tool.arcs.grown(self.allowance).shifted(wider)
        return LeaningSide(tool.taper, tool.widest_radius + self.allowance + wider) if tool.taper > 0.0 else None

    @property
    def cut_height(self) -> F64:
        """(ny, nx) float64, mm: tip limit of the cutting part alone at the lattice nodes."""
        if self._cut is None:
            self._cut = self.cut_heights()
        return self._cut

    def cut_heights(self) -> F64:
        """(ny, nx) float64, mm: ``cut_height`` computed anew, not kept: other threads may use the field meanwhile."""
        lat = self.lattice
        return drop_over_flats(self.tree, lat.x0, lat.y0, lat.step, lat.nx, lat.ny, self.grown_radius,
                               self.grown_corner, side=self.grown_side) + self.allowance

    def know(self, heights: F64) -> None:
        """Take over what ``cut_heights`` has computed.

        heights : (ny, nx) float64, mm
        """
        self._cut = heights

    @property
    def height(self) -> F64:
        """(ny, nx) float64, mm: tip limit of the whole assembly at the lattice nodes."""
        if self._height is None:
            lat = self.lattice
            xs = lat.x0 + lat.step * np.arange(lat.nx)
            ys = lat.y0 + lat.step * np.arange(lat.ny)
            _, j = self.coarse.cells(np.column_stack([xs, np.zeros_like(xs)]))
            i, _ = self.coarse.cells(np.column_stack([np.zeros_like(ys), ys]))
            self._height = np.maximum(self.cut_height, self.noncut[np.ix_(i, j)])
        return self._height

    def rim(self, xy: F64, z: float, reach: float) -> F64:
        """Nodes near xy where the cutting part is free at tip height z, next to a node where it is not.

        xy : (n, 2) float64, mm, in plan; near is within ``reach`` mm along x and along y. Only the lattice around xy is
             searched.

        Returns (k, 2) float64, mm, in plan.
        """
        lat, half = self.lattice, int(math.ceil(reach / self.lattice.step))
        i, j = lat.cells(xy)
        found = [self._rim(i[mine], j[mine], z, half) for mine in _apart(i, j, 2 * half + 1)]
        rows, cols = (np.concatenate([f[k] for f in found]) for k in (0, 1))
        order = np.lexsort((cols, rows))
        return lat.nodes(rows[order], cols[order], z)[:, :2]

    def _rim(self, i: NDArray[np.int64], j: NDArray[np.int64], z: float,
             half: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of ``rim`` for places at the nodes (i, j); near is within ``half`` nodes."""
        lat = self.lattice
        i0, i1 = max(int(i.min()) - half, 0), min(int(i.max()) + half + 1, lat.ny)
        j0, j1 = max(int(j.min()) - half, 0), min(int(j.max()) + half + 1, lat.nx)
        near = np.zeros((i1 - i0, j1 - j0), np.bool_)
        near[i - i0, j - j0] = True
        near = maximum_filter(near.view(np.uint8), 2 * half + 1).view(np.bool_)
        if self._cut is not None:
            free = self._cut[i0:i1, j0:j1] <= z
        else:
            free = self._free(near, i0, j0, z)
        blocked = near & ~free
        beside = np.zeros_like(near)
        for a, b in ((beside[1:], blocked[:-1]), (beside[:-1], blocked[1:]),
                     (beside[:, 1:], blocked[:, :-1]), (beside[:, :-1], blocked[:, 1:])):
            a |= b
        rows, cols = np.nonzero(near & free & beside)
        return rows + i0, cols + j0

    def _free(self, near: NDArray[np.bool_], i0: int, j0: int, z: float) -> NDArray[np.bool_]:
        """Those of the nodes ``near`` (k, l), the first in row i0 and column j0, where the cutting part is free.

        A square of nodes is free where a cutting part wider by its half diagonal is free over its middle, and blocked
        where a thinner one is blocked there. So single nodes are asked only in squares that have both, or might have.
        """
        lat, free, open_ = self.lattice, np.zeros_like(near), near.copy()
        rows, cols = (np.arange(0, n, SQUARE) for n in near.shape)
        some = np.logical_or.reduceat(np.logical_or.reduceat(near, rows, axis=0), cols, axis=1)
        if near.sum() > 2 * some.size:
            a, b = np.nonzero(some)
            aside = 0.5 * (SQUARE - 1) * lat.step
            middle = lat.nodes(i0 + SQUARE * a, j0 + SQUARE * b, z) + [aside, aside, 0.0]
            around = math.sqrt(2.0) * aside + 1e-3 * lat.step
            empty, full = some.copy(), np.zeros_like(some)
            empty[a, b] = ~self.blocked_by_cutter(middle, around)
            if self.tool.flat_radius > around:
                left = np.flatnonzero(~empty[a, b])
                full[a[left], b[left]] = self.blocked_by_cutter(middle[left], -around)
            spread = (np.arange(near.shape[0])[:, None] // SQUARE, np.arange(near.shape[1])[None] // SQUARE)
            free = near & empty[spread]
            open_ &= ~(empty | full)[spread]
        rows, cols = np.nonzero(open_)
        free[open_] = ~self.blocked_by_cutter(lat.nodes(rows + i0, cols + j0, z))
        return free

    def nearest_blocked(self, z: float) -> tuple[F64, NDArray[np.int32]] | None:
        """Distance of each node, mm, from the nearest one that is blocked at tip height z, mm, and which that is.

        Returns (ny, nx) float64, mm, and (2, ny, nx) int32, rows and columns; None where no node is blocked. The
        results of the last two heights are kept, since each layer uses its own three times while the next one is
        laid out; do not write to them.
        """
        known = self._off  # read and written as a whole: several threads ask a field
        for at, found in known:
            if at == z:
                return found
        free = self.height <= z + LEVEL_TOLERANCE
        off = None if free.all() else blocked_beside(free, self.lattice.step)
        self._off = (z, off), *known[:1]
        return off

    def tips(self, xy: F64) -> F64:
        """Tip limit of the whole assembly, (n,) float64, mm; exact for the cutting part.

        xy : (n, 2) float64, mm, in plan
        """
        xy = np.ascontiguousarray(xy, dtype=np.float64)
        out = drop_tips(self.tree, xy, self.grown_radius, self.grown_corner, side=self.grown_side) + self.allowance
        return np.asarray(np.maximum(out, noncut_lookup(self.noncut, self.coarse.frame, xy)))

    def tips_along(self, xy: F64) -> F64:
        """Tip limit as ``tips``, over places that follow each other as on a path; the same to rounding, with less work.

        xy : (n, 2) float64, mm, in plan

        Returns (n,) float64, mm.
        """
        xy = np.ascontiguousarray(xy, dtype=np.float64)
        out = drop_along(self.tree, xy, self.grown_radius, self.grown_corner, self.grown_side) + self.allowance
        return np.asarray(np.maximum(out, noncut_lookup(self.noncut, self.coarse.frame, xy)))

    def blocked_by_cutter(self, tips: F64, wider: float = 0.0) -> NDArray[np.bool_]:
        """(n,) bool: the cutting part enters the obstacles at tips.

        tips  : (n, 3) float64, mm, access frame
        wider : mm, by which the radius of the cutting part is larger than it is
        """
        lowered = np.array(tips, dtype=np.float64)
        lowered[:, 2] -= self.allowance
        return blocked_many(self.tree, lowered, self.grown_radius + wider, self.grown_corner, self._side(wider))

    def blocked_by_body(self, tips: F64) -> NDArray[np.bool_]:
        """(n,) bool: shank or holder come nearer than their clearance at tips.

        tips : (n, 3) float64, mm, access frame
        """
        return np.asarray(noncut_blocked(self.noncut, self.coarse.frame, np.ascontiguousarray(tips)))


FLAT_RING = np.array([[math.cos(a), math.sin(a)] for a in np.arange(8) * math.pi / 4])


def contact_tips(tool: ToolBody, points: F64, normals: F64, lift: float) -> F64:
    """Highest tip at which the cutting profile touches each point, offset along its normal.

    points, normals : (n, 3) float64, mm and dimensionless, out of the material, access frame
    lift            : mm, offset of the contact along the normal
    Returns (n, 3) float64, mm, access frame: tips. The contact lies on the torus of the corner: axis at
    p + r n + (R - r) n_xy/|n_xy|, tip at its height r (n_z - 1) + p_z. On a circle segment mill it lies where the
    outline leans as the surface does. The whole bottom of a flat or bull end touches a level facet; there the axis is
    over the point.
    """
    level = np.linalg.norm(normals[:, :2], axis=1)
    if tool.arcs is not None:
        rho, high = tool.arcs.at_sines(np.minimum(level, 1.0))
        out = points + normals * lift
        # as below, the flat end is not shifted over a facet that is all but level
        out[:, :2] += np.where(level > 1e-3, rho / np.maximum(level, 1e-12), tool.arcs.low)[:, None] * normals[:, :2]
        out[:, 2] -= high
        return np.ascontiguousarray(out)
    r, flat = tool.corner_radius, tool.radius - tool.corner_radius
    out = points + normals * (lift + r)
    side = np.where(level > 1e-3, 1.0 / np.maximum(level, 1e-12), 0.0)[:, None] * normals[:, :2]
    out[:, :2] += flat * side
    out[:, 2] -= r
    return np.ascontiguousarray(out)


def _aimed(field: TipField, points: F64, tip_z: F64, flat: float) -> F64:
    """Tips (n, k, 3) mm towards free nodes nearby, whose flat bottom of radius ``flat`` covers level points (n, 3).

    A node under the flat is free without a shift. Towards farther nodes the tip moves as far as the flat allows. So the
    search can miss about one step of the lattice, at the end of a corner of the free region. The last of the k tips
    moves towards the middle of those nodes, straight away from a straight wall; there the search misses nothing.
    """
    out = np.repeat(np.column_stack([points[:, :2], tip_z])[:, None], AIMED + 1, axis=1)
    level = np.round(tip_z, 6)  # a rotated plane is level except for rounding
    for z in np.unique(level):
        mine = np.flatnonzero(level == z)
        rim = field.rim(points[mine, :2], float(z), flat + BEYOND * field.lattice.step)
        if not len(rim):
            continue
        near = cKDTree(rim).query(points[mine, :2], k=min(AIMED, len(rim)))[1].reshape(len(mine), -1)
        way = rim[near] - points[mine, None, :2]
        way = np.concatenate([way, 1e3 * way.mean(axis=1, keepdims=True)], axis=1)
        far = np.linalg.norm(way, axis=2, keepdims=True)
        out[mine, :way.shape[1], :2] += way * np.minimum(1.0, (flat - INSIDE) / np.maximum(far, 1e-12))
    return out


def _apart(i: NDArray[np.int64], j: NDArray[np.int64], cells: int) -> Iterator[NDArray[np.int64]]:
    """Index of nodes (i, j), each (n,), in groups that are more than ``cells`` rows or columns apart."""
    rows, cols = i // (cells + 1), j // (cells + 1)
    rows, cols = rows - rows.min(), cols - cols.min()
    taken = np.zeros((int(rows.max()) + 1, int(cols.max()) + 1), np.bool_)
    taken[rows, cols] = True
    group = label(taken, np.ones((3, 3)))[0][rows, cols]
    order = np.argsort(group, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(group[order])) + 1)


def _take(field: TipField, trial: F64, todo: NDArray[np.int64], cutter: NDArray[np.bool_], whole: NDArray[np.bool_],
          tips: F64) -> None:
    """Keep the free trial tips (k, 3) for the samples ``todo``, in place; tips free for the whole tool come first."""
    if not len(todo):
        return
    free = ~field.blocked_by_cutter(trial)
    ok = free & ~field.blocked_by_body(trial)
    better = ok | (free & ~cutter[todo])
    cutter[todo] |= free
    whole[todo[ok]] = True
    tips[todo[better]] = trial[better]


def touchable(field: TipField, points: F64, normals: F64, lift: float,
              play: float = PLAY_STEPS) -> tuple[NDArray[np.bool_], NDArray[np.bool_], F64]:
    """Samples that the tool can touch within ``lift``, by its cutting part and as a whole assembly.

    points, normals : (n, 3) float64, mm and dimensionless, access frame
    lift            : mm, distance along the normal within which a touch counts
    play            : lattice steps of sideways play beside a wall; a channel that just fits the tool is left to the
                      next thinner one

    Over a level place a flat bottom is tried straight, off its middle, and towards free nodes of the lattice nearby.

    Returns
    -------
    by_cutter  : (n,) bool, the cutting part alone touches the sample
    by_tool    : (n,) bool, shank and holder stay clear as well
    tips       : (n, 3) float64, mm, access frame, the admissible tip; else a tip at which the cutting part alone
                 touches; else the first tried tip
    """
    tips = contact_tips(field.tool, points, normals, lift + field.allowance)
    by_cutter, by_tool = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    seen = np.flatnonzero(normals[:, 2] > SEEN)  # no tool can touch the rest, half of a part
    by_cutter[seen], by_tool[seen], tips[seen] = _touched(field, points[seen], normals[seen], tips[seen], play)
    return by_cutter, by_tool, tips


def _touched(field: TipField, points: F64, normals: F64, tips: F64,
             play: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_], F64]:
    """``touchable`` for samples in sight, with the tips to try first."""
    tips = tips + [0.0, 0.0, LEVEL_TOLERANCE]
    cutter = ~field.blocked_by_cutter(tips)
    upright = np.flatnonzero(cutter & (np.abs(normals[:, 2]) < 0.5))
    aside = tips[upright]
    side = normals[upright, :2] / np.linalg.norm(normals[upright, :2], axis=1, keepdims=True)
    aside[:, :2] += play * field.lattice.step * side
    cutter[upright] = ~field.blocked_by_cutter(aside)
    whole = cutter & ~field.blocked_by_body(tips)
    flat = field.tool.flat_radius
    if flat > 0:
        level = normals[:, 2] > LEVEL
        for reach in (0.5 * flat, max(flat - EDGE_SLACK, 0.9 * flat)):
            for side in FLAT_RING:
                todo = np.flatnonzero(level & ~whole)
                trial = tips[todo].copy()
                trial[:, :2] = points[todo, :2] + reach * side
                _take(field, trial, todo, cutter, whole, tips)
        open_to = np.flatnonzero(level & ~whole)
        if len(open_to):
            for trials in _aimed(field, points[open_to], tips[open_to, 2], flat).transpose(1, 0, 2):
                left = np.flatnonzero(~whole[open_to])
                _take(field, np.ascontiguousarray(trials[left]), open_to[left], cutter, whole, tips)
    tips[:, 2] -= LEVEL_TOLERANCE
    return cutter, whole, tips
