"""Where a tool assembly can stand, and which surface samples it can touch.

One quantity carries everything in three axes: the *tip limit* H(x, y), the lowest
height of the tool tip over (x, y) at which nothing of the assembly enters the part
or a fixture. A tip at or above H is safe; the free region of a height z is
F(z) = {H <= z}, and F grows with z.

The cutting part is exact (``geometry.kernels.drop`` on the mesh). Shank and holder
need no such care: they are looked up on a coarse grid, grown by their clearance and
by half a cell diagonal, so the look-up is never lower than the truth.

A neck thinner than the cutter never decides: the cutter has passed everywhere the
neck goes. Source: ALGORITHMS 1, "reach is computed, not guessed".
"""

from __future__ import annotations

import copy
import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import blocked_many, drop_grid, drop_tips
from geometry.tool_body import ToolBody
from zones.kernels.lattice import noncut_blocked, noncut_lookup
from zones.lattice import Lattice
from zones.machinable_area import LEVEL, SEEN
from zones.reach.assembly import Clearances, Disc, discs_of

LEVEL_TOLERANCE = 1e-5  # mm: a tip this little below H still counts as standing on it
LOOKUP_STEP = 0.4  # mm, grid of the shank and holder limits
EDGE_SLACK = 0.01  # mm: a flat bottom is not asked to reach nearer than this to a wall beside the plane
BELOW = 1.0  # mm: a tip is never asked about farther under the obstacles than this and its own radius
AIMED = 12  # free nodes a flat bottom is tried towards over a level place
BEYOND = 3.0  # lattice steps outside the flat: how far these may be
INSIDE = 1.5e-3  # mm: a flat bottom is not asked to reach nearer than this to its own rim: lines are off by so much
PLAY_STEPS = 1.42  # lattice steps of sideways play a tool must have beside a wall to be planned there


class DiscHeights:
    """How low the underside of a disc gets over one set of obstacles, kept by radius: tools in one holder ask the same.

    tree : TriangleTree of the obstacles in the access frame
    """

    def __init__(self, tree: TriangleTree) -> None:
        self.tree = tree
        self._kept: dict[float, tuple[Lattice, F64]] = {}

    def over(self, lattice: Lattice, radius: float) -> F64:
        """(ny, nx) float64, mm, over the nodes of a lattice of ``Lattice.on_multiples``; not to be written to."""
        kept = self._kept.get(radius)
        if kept is not None and (part := lattice.within(kept[0])) is not None:
            return kept[1][part]
        height = drop_grid(self.tree, lattice.x0, lattice.y0, lattice.step, lattice.nx, lattice.ny, radius, 0.0)
        if kept is None or kept[1].size < height.size:
            self._kept[radius] = lattice, height
        return height


class TipField:
    """The tip limit of one tool over one set of obstacles.

    tree   : TriangleTree of the obstacles (part and fixture boxes) in the access frame
    tool   : ToolBody
    clear  : Clearances
    bounds : (2, 3) float64, mm, region of interest in plan
    step   : mm, spacing of the planning lattice
    allowance : mm, material to leave on the part: the cutting part is grown by it all round
    cusp   : mm, what passes may leave standing above that: shank and holder stay as much higher
    standing : DiscHeights of the same obstacles that other tools have asked
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
        self._off: tuple[float, F64 | None] = (math.nan, None)

    def _noncut(self, discs: tuple[Disc, ...]) -> F64:
        grid = np.full((self.coarse.ny, self.coarse.nx), -np.inf)
        for d in (d for d in discs if self._can_meet(d)):
            limit = self.disc_limit(d, self.standing.over(self.coarse, self.disc_radius(d, 0.5)))
            grid = np.maximum(grid, limit)
        if discs:  # what stands beyond the grid is not known here, so the tool does not go there
            for edge in (grid[:1], grid[-1:], grid[:, :1], grid[:, -1:]):
                edge[:] = np.inf
        return grid

    def _can_meet(self, disc: Disc) -> bool:
        """Whether a disc can get as low as anything stands, with the tip where it is ever asked about.

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
        """Tip limit for a disc whose underside stands at ``height``, mm."""
        return np.asarray(height + self.allowance + self.cusp - disc.height)

    def window(self, lower: F64, upper: F64, step: float) -> TipField:
        """The same tool over the same obstacles on a lattice of another ``step``, mm, from lower to upper (2,), mm."""
        out = copy.copy(self)
        out.lattice = Lattice.over(np.array([lower, upper]), 0.0, step)
        out._cut = out._height = None
        out._off = (math.nan, None)
        return out

    @property
    def grown_radius(self) -> float:
        """Radius of the cutting part with the allowance, mm."""
        return self.tool.radius + self.allowance

    @property
    def grown_corner(self) -> float:
        """Corner radius of the cutting part with the allowance, mm."""
        return self.tool.corner_radius + self.allowance

    @property
    def cut_height(self) -> F64:
        """(ny, nx) float64, mm: tip limit of the cutting part alone at the lattice nodes."""
        if self._cut is None:
            lat = self.lattice
            self._cut = drop_grid(self.tree, lat.x0, lat.y0, lat.step, lat.nx, lat.ny, self.grown_radius,
                                  self.grown_corner) + self.allowance
        return self._cut

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
        """(k, 2) mm: nodes where the cutting part is free at tip height z, beside one where it is not, near some of xy.

        xy is (n, 2) mm; near is within ``reach`` mm along x and along y. Only the lattice round xy is looked at.
        """
        lat, half = self.lattice, int(math.ceil(reach / self.lattice.step))
        i, j = lat.cells(xy)
        i0, i1 = max(int(i.min()) - half, 0), min(int(i.max()) + half + 1, lat.ny)
        j0, j1 = max(int(j.min()) - half, 0), min(int(j.max()) + half + 1, lat.nx)
        near = np.zeros((i1 - i0, j1 - j0), np.bool_)
        near[i - i0, j - j0] = True
        near = maximum_filter(near.view(np.uint8), 2 * half + 1).view(np.bool_)
        if self._cut is not None:
            free = self._cut[i0:i1, j0:j1] <= z
        else:
            rows, cols = np.nonzero(near)
            free = np.zeros_like(near)
            free[near] = ~self.blocked_by_cutter(lat.nodes(rows + i0, cols + j0, z))
        blocked = near & ~free
        beside = np.zeros_like(near)
        for a, b in ((beside[1:], blocked[:-1]), (beside[:-1], blocked[1:]),
                     (beside[:, 1:], blocked[:, :-1]), (beside[:, :-1], blocked[:, 1:])):
            a |= b
        rows, cols = np.nonzero(near & free & beside)
        return lat.nodes(rows + i0, cols + j0, z)[:, :2]

    def off_blocked(self, z: float) -> F64 | None:
        """(ny, nx) float64, mm: distance of each node from the nearest one that is blocked at tip height z, mm.

        None where none is. The last answer is kept, for a layer asks three times.
        """
        if self._off[0] != z:
            free = self.height <= z + LEVEL_TOLERANCE
            self._off = z, None if free.all() else distance_transform_edt(free) * self.lattice.step
        return self._off[1]

    def tips(self, xy: F64) -> F64:
        """Tip limit (n,) mm of the whole assembly at xy (n, 2) mm; exact for the cutting part."""
        xy = np.ascontiguousarray(xy, dtype=np.float64)
        out = drop_tips(self.tree, xy, self.grown_radius, self.grown_corner) + self.allowance
        return np.asarray(np.maximum(out, noncut_lookup(self.noncut, self.coarse_row, xy)))

    @property
    def coarse_row(self) -> tuple[float, float, float]:
        """(x0, y0, step) of the shank and holder grid, for kernels."""
        return (self.coarse.x0, self.coarse.y0, self.coarse.step)

    def blocked_by_cutter(self, tips: F64) -> NDArray[np.bool_]:
        """(n,) bool: the cutting part would enter the obstacles at tips (n, 3) mm."""
        lowered = np.array(tips, dtype=np.float64)
        lowered[:, 2] -= self.allowance
        return blocked_many(self.tree, lowered, self.grown_radius, self.grown_corner)

    def blocked_by_body(self, tips: F64) -> NDArray[np.bool_]:
        """(n,) bool: shank or holder would come nearer than their clearance at tips (n, 3) mm."""
        return np.asarray(noncut_blocked(self.noncut, self.coarse_row, np.ascontiguousarray(tips)))


FLAT_RING = np.array([[math.cos(a), math.sin(a)] for a in np.arange(8) * math.pi / 4])


def contact_tips(tool: ToolBody, points: F64, normals: F64, lift: float) -> F64:
    """Highest tip at which the cutting profile touches each point moved out along its normal.

    points, normals : (n, 3) float64, mm and unit, out of the material
    lift            : mm, distance along the normal at which contact is asked for
    Returns (n, 3) float64 tips, mm. The contact lies on the torus of the corner: axis at
    p + r n + (R - r) n_xy/|n_xy|, tip at its height r (n_z - 1) + p_z. Under a flat or bull end a level
    facet is touched by the whole bottom; there the axis is put over the point.
    """
    r, flat = tool.corner_radius, tool.radius - tool.corner_radius
    out = points + normals * (lift + r)
    level = np.linalg.norm(normals[:, :2], axis=1)
    side = np.where(level > 1e-3, 1.0 / np.maximum(level, 1e-12), 0.0)[:, None] * normals[:, :2]
    out[:, :2] += flat * side
    out[:, 2] -= r
    return np.ascontiguousarray(out)


def _aimed(field: TipField, points: F64, tip_z: F64, flat: float) -> F64:
    """Tips (n, k, 3) mm whose flat bottom of radius ``flat`` covers level points (n, 3): towards free nodes near by.

    A node that lies under the flat is free as it stands; towards farther ones the tip goes as far as the flat allows.
    So about one step of the lattice is what can be missed, at the end of a corner of the free region. The last of the k
    goes towards the middle of those nodes, which is straight away from a straight wall: there nothing is missed.
    """
    out = np.repeat(np.column_stack([points[:, :2], tip_z])[:, None], AIMED + 1, axis=1)
    level = np.round(tip_z, 6)  # a plane that was turned is level but for rounding
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


def _take(field: TipField, trial: F64, todo: NDArray[np.int64], cutter: NDArray[np.bool_], whole: NDArray[np.bool_],
          tips: F64) -> None:
    """Keep of trial tips (k, 3) for the samples ``todo`` what is free, in place; those of the whole tool come first."""
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
    """Which samples the tool can touch within ``lift``, by its cutting part and as a whole assembly.

    play : lattice steps of room to move away from a wall beside it: a channel that fits the tool like a gauge is for
           the next thinner one

    A flat bottom is tried over a level place straight, off its middle, and towards free nodes of the lattice near by.

    Returns
    -------
    by_cutter  : (n,) bool, the cutting part alone gets there
    by_tool    : (n,) bool, shank and holder stay clear as well
    tips       : (n, 3) float64, mm, the admissible tip; else one at which the cutting part alone gets there; else
                 the first tried
    """
    tips = contact_tips(field.tool, points, normals, lift + field.allowance)
    by_cutter, by_tool = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    seen = np.flatnonzero(normals[:, 2] > SEEN)  # the rest, half of a part, no tool is asked about
    by_cutter[seen], by_tool[seen], tips[seen] = _touched(field, points[seen], normals[seen], tips[seen], play)
    return by_cutter, by_tool, tips


def _touched(field: TipField, points: F64, normals: F64, tips: F64,
             play: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_], F64]:
    """``touchable`` of samples in sight, with the tips to try first."""
    tips = tips + [0.0, 0.0, LEVEL_TOLERANCE]
    cutter = ~field.blocked_by_cutter(tips)
    upright = np.flatnonzero(cutter & (np.abs(normals[:, 2]) < 0.5))
    aside = tips[upright]
    side = normals[upright, :2] / np.linalg.norm(normals[upright, :2], axis=1, keepdims=True)
    aside[:, :2] += play * field.lattice.step * side
    cutter[upright] = ~field.blocked_by_cutter(aside)
    whole = cutter & ~field.blocked_by_body(tips)
    flat = field.tool.radius - field.tool.corner_radius
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
