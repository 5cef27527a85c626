"""The planner's picture of the stock: a height over the plan, lowered pass by pass.

It decides where something is left to cut and where a tool may come down in air. It errs only in time, never in
safety: the proof reads the finished program with a model of its own (``verify``).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_grid
from geometry.tool_body import ToolBody
from toolpath.kernels.shell import highest_of_four, stands_in
from toolpath.kernels.stock import HALF_DIAGONAL, meets, overlaps, sink, stamp, stamp_balls, stamp_leaning, standing
from toolpath.poses import between, places_along
from toolpath.stock.tool_shell import Shell
from zones.lattice import Lattice
from zones.reach.assembly import Disc

SURE_RIM = 0.7  # lattice steps: half a cell diagonal
POOLED = 12  # nodes a side of the squares whose highest stock is kept
AIR_TOLERANCE = 0.01  # mm
UPRIGHT = 1e-12  # of the normal of a face of a block
LEANS = 1e-9  # of the axis of a bar: by less it stands, or lies
ON_EDGE = 1e-9  # mm
APART, MAX_POSED = 2.0, 0.1  # lattice steps, or of the radius, between poses that are taken off
ROUND = (0.0, 0.25 * np.pi, 0.5 * np.pi)  # how far round the corner a cylinder inside the cutting part touches it
SKIN = 0.08  # of the tool diameter, the most a descent steeper than the ramp may take off with the end of the tool


Ceilings = tuple[F64, NDArray[np.int64]]
"""Heights of a lattice and of ever larger squares of it, as ``toolpath.kernels.shell`` looks at them."""


class StockMap:
    """Top of the stock over a lattice.

    lattice : Lattice
    top     : (ny, nx) float64, mm, height at the nodes; -inf where there is none
    cover   : (ny, nx) float64, mm, no lower than anything in the cell round a node: what is thinner than a cell
              is in it too. Left out, it is the highest of a node and its neighbours
    part    : (ny, nx) float64, mm, no lower than the part in the cell; -inf everywhere where left out
    """

    def __init__(self, lattice: Lattice, top: F64, cover: F64 | None = None, part: F64 | None = None) -> None:
        self.lattice, self.top = lattice, np.ascontiguousarray(top)
        self.cover = ndimage.maximum_filter(self.top, 3) if cover is None else np.ascontiguousarray(cover)
        self.part = np.full_like(self.top, -np.inf) if part is None else np.ascontiguousarray(part)
        self._pooled, self._covered = _pooled(self.top), _pooled(self.cover)  # never too low: lowered as looked at
        self._ceilings: tuple[Ceilings, Ceilings] | None = None  # of stock, and of stock that is not part
        self._others: _Others | None = None

    @classmethod
    def around(cls, tree: TriangleTree, bounds: F64, offset: float, step: float,
               part: TriangleTree | None = None) -> StockMap:
        """Stock that stands ``offset`` mm off a mesh everywhere: the envelope of balls on its surface.

        tree, bounds : TriangleTree and (2, 3) float64, mm, of the part, or of a blank that holds it
        part         : TriangleTree of the part where the mesh is another
        """
        lat = Lattice.over(bounds, offset + 3 * step, step)
        r, half = max(offset, 1e-3), HALF_DIAGONAL * step
        # A ball dropped from above stands at the highest point of such balls; with a flat end as wide as the disc
        # round a cell it stands at the highest of the disc.
        top, cover = (drop_grid(tree, lat.x0, lat.y0, step, lat.nx, lat.ny, r + d, r) + r for d in (0.0, half))
        return cls(lat, top, cover, _in_cells(part or tree, lat))

    @classmethod
    def box(cls, tree: TriangleTree, lower: F64, upper: F64, step: float) -> StockMap:
        """A block between two corners (3,), mm, round the part."""
        return cls.block(tree, np.array([lower, upper]), np.eye(3), step)

    @classmethod
    def block(cls, tree: TriangleTree, box: F64, rotation: F64, step: float) -> StockMap:
        """A block round the part, however it stands.

        box      : (2, 3) float64, mm, lower and upper corner in a frame along its edges
        rotation : (3, 3) float64, from there into the frame of the part
        """
        corners = np.array([[box[i >> k & 1][k] for k in range(3)] for i in range(8)]) @ rotation.T
        lat = Lattice.over(np.array([corners.min(axis=0), corners.max(axis=0)]), 3 * step, step)
        x, y = np.meshgrid(lat.x0 + step * np.arange(lat.nx), lat.y0 + step * np.arange(lat.ny))
        upper, lower, bound = np.full(x.shape, np.inf), np.full(x.shape, -np.inf), np.full(x.shape, np.inf)
        # a face, n p <= d, holds the height of a vertical line from above or below, or keeps the line out
        for axis in range(3):
            for sense, d in ((1.0, box[1][axis]), (-1.0, -box[0][axis])):
                n = sense * rotation[:, axis]
                room = d - n[0] * x - n[1] * y
                if abs(n[2]) < UPRIGHT:
                    upper[room < -ON_EDGE] = -np.inf
                elif n[2] > 0.0:
                    np.minimum(upper, room / n[2], out=upper)
                    grade = (abs(n[0]) + abs(n[1])) / n[2]
                    np.minimum(bound, room / n[2] + 0.5 * step * grade, out=bound)
                else:
                    np.maximum(lower, room / n[2], out=lower)
        stands = upper >= lower
        # the highest of a cell is on no plane above what that has at the cell's worst corner, nor above the block
        near = ndimage.binary_dilation(stands, np.ones((3, 3)))
        cover = np.where(near, np.minimum(bound, corners[:, 2].max()), -np.inf)
        return cls(lat, np.where(stands, upper, -np.inf), cover, _in_cells(tree, lat))

    @classmethod
    def cylinder(cls, tree: TriangleTree, radius: float, ends: F64, step: float) -> StockMap:
        """A round bar round the part, however it stands or lies.

        radius : float, mm; ends : (2, 3) float64, mm, middles of its two flat ends, in the frame of the part

        Exact at the nodes. No place of a cell is higher than ``cover``: of the wall and of the upper end that holds at
        the corner of the cell where each is highest, and nothing stands in a cell whose rectangle along the bar misses
        the bar's outline.
        """
        low, high = ends if ends[1][2] >= ends[0][2] else ends[::-1]
        length = float(np.linalg.norm(high - low))
        aside = float(np.hypot(*(high - low)[:2])) / length  # sine and cosine of how far it leans
        up = float(high[2] - low[2]) / length
        if aside < LEANS:
            aside, up = 0.0, 1.0
        bearing = (high - low)[:2] / (aside * length) if aside > 0.0 else np.array([1.0, 0.0])
        spread = radius * np.sqrt(np.maximum(1.0 - ((high - low) / length) ** 2, 0.0))
        lat = Lattice.over(np.array([np.minimum(low, high) - spread, np.maximum(low, high) + spread]), 3 * step, step)
        x, y = np.meshgrid(lat.x0 + step * np.arange(lat.nx) - low[0], lat.y0 + step * np.arange(lat.ny) - low[1])
        # in plan u runs along the bar and v square to it, from the middle of its lower end
        u, v = bearing[0] * x + bearing[1] * y, bearing[0] * y - bearing[1] * x
        arch = np.sqrt(np.maximum(radius * radius - v * v, 0.0))
        far = up * arch  # how far the flat ends reach beyond their middles at v
        held = np.clip(u, -far, aside * length + far)
        stands = (np.abs(v) <= radius + ON_EDGE) & (np.abs(u - held) <= ON_EDGE)
        wall, end = _wall(held, arch, aside, up), _upper_end(held, length, aside, up)
        top = np.where(stands, low[2] + np.minimum(wall, end), -np.inf)
        half = 0.5 * step * float(np.abs(bearing).sum())  # of a cell, along u and along v
        near_v = np.maximum(np.abs(v) - half, 0.0)
        arch = np.sqrt(np.maximum(radius * radius - near_v * near_v, 0.0))
        far = up * arch
        near = (near_v <= radius) & (u + half >= -far) & (u - half <= aside * length + far)
        bound = np.minimum(_wall(u + half, arch, aside, up), _upper_end(u - half, length, aside, up))
        cover = np.where(near, low[2] + np.minimum(bound, up * length + aside * radius), -np.inf)
        return cls(lat, top, np.maximum(cover, top), _in_cells(tree, lat))

    def copied(self) -> StockMap:
        """The same stock, to be cut on its own."""
        out = copy.copy(self)
        out.top, out.cover = self.top.copy(), self.cover.copy()
        out._pooled, out._covered = self._pooled.copy(), self._covered.copy()
        return out

    def become(self, other: StockMap) -> None:
        """Take over what a copy of this has come to."""
        self.top, self.cover, self._ceilings = other.top, other.cover, other._ceilings
        self._pooled, self._covered = other._pooled, other._covered

    def now(self) -> StockSnapshot:
        """What is left, to go on with another time; as views where nothing else will do."""
        if self._others is None:
            return StockSnapshot(self.top, self.cover, None, None)
        cut = np.flatnonzero(self._others.known != [self.cover, self.top])
        return StockSnapshot(self.top, self.cover, cut, self._others.known.ravel()[cut])

    def go_on(self, now: StockSnapshot) -> None:
        """Become what a map like this, cut so far by none, was left as.

        Raises
        ------
        ValueError
            That was no map like this.
        """
        shape, hollows = self.top.shape, self._others is not None
        if now.top.shape != shape or now.cover.shape != shape or hollows != (now.cut is not None):
            raise ValueError("the stock that is kept is not of this lattice")
        if self._others is not None:
            known = np.array([now.cover, now.top])
            known.ravel()[now.cut] = now.settled
            self._others.known = known
        self.top, self.cover, self._ceilings = now.top.copy(), now.cover.copy(), None
        self._pooled, self._covered = _pooled(self.top), _pooled(self.cover)

    def left_by(self, others: Sequence[tuple[StockMap, F64]], lowest: float) -> None:
        """Lower the stock to what other maps of it, seen along other axes, have left.

        others : StockMaps, each with the rotation (3, 3) from the frame of this one into its own
        lowest : mm, below which the blank has nothing in this frame. The part may begin higher: a corner of the blank
                 that stands lower than that is still in the way of tools along other axes

        A place is gone where it lies above one of the others. ``cover`` stays a bound: another's cover counts as far
        round a place as a cell reaches, and the way to the next place asked. ``top`` is lowered by theirs, node by
        node, so a wall they have finished shows no more than half a cell of stock. A hollow under what is left counts
        as stock until that is cut (``settle``).
        """
        if not others:
            return
        self._others = _Others.of(others, self.lattice, lowest)
        self.settle()
        self._pooled, self._covered = _pooled(self.top), _pooled(self.cover)

    def settle(self, last: bool = False) -> None:
        """Lower what was cut since the last time into the hollows that lie under it; see ``left_by``.

        last : nothing is cut any more, and what the other maps say is let go
        """
        if self._others is not None:
            self._others.sink(self.top, self.cover, self.lattice)
            self._ceilings = None
            self._others = None if last else self._others

    def cut(self, points: F64, tool: ToolBody) -> None:
        """Take away what the cutting part sweeps along a polyline of tips (n, 3), mm."""
        lat, self._ceilings = self.lattice, None
        stamp(self.top, self.cover, lat.x0, lat.y0, lat.step, np.ascontiguousarray(points), tool.radius,
              tool.corner_radius)

    def cut_leaning(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Take away what a leaning tool has cut along poses, tips (n, 3) mm and axes (n, 3) unit.

        Of its cutting part cylinders that lie inside, and the whole of a ball where flutes are on all of it that is
        seen from below, at poses a few lattice steps apart: neither map falls too low.
        """
        lat, self._ceilings = self.lattice, None
        spacing = max(APART * lat.step, MAX_POSED * tool.radius)
        tips, axes = between(tips, axes, places_along(tips, axes, tool.flute_length, spacing))
        r, high = tool.corner_radius, tool.flute_length
        bent = ROUND if r > 0.0 else (0.5 * np.pi,)
        for radius, low in ((tool.radius - r + r * np.sin(a), r - r * np.cos(a)) for a in bent):
            sides = 0.5 * (high - low) * np.abs(axes[:, :2]) + radius * np.sqrt(1.0 - np.minimum(axes[:, :2]**2, 1.0))
            for heights, shrink in ((self.top, 0.0), (self.cover, HALF_DIAGONAL * lat.step)):
                stamp_leaning(heights, lat.x0, lat.y0, lat.step, np.ascontiguousarray(tips),
                              np.ascontiguousarray(axes), sides, radius, low, high, shrink)
        if r == tool.radius:
            # from under a ball that leans its side is seen up to there, and above short flutes it does not cut
            cuts = high >= r * (1.0 + np.sqrt(np.maximum(1.0 - axes[:, 2]**2, 0.0)))
            centres = np.ascontiguousarray((tips + r * axes)[cuts])
            for heights, shrink in ((self.top, 0.0), (self.cover, HALF_DIAGONAL * lat.step)):
                stamp_balls(heights, lat.x0, lat.y0, lat.step, centres, r, shrink)

    def stands_in(self, tips: F64, axes: F64, flank: Shell, bodies: Shell) -> NDArray[np.bool_]:
        """(n,) bool: poses, tips (n, 3) mm and axes (n, 3) unit, at which stock stands in a leaning tool.

        flank  : of its cutting part: in stock where that is higher at the nearest node, the part counted
        bodies : of neck, shank and holder: in stock where it is also higher than the part
        """
        out, lat = np.zeros(len(tips), np.bool_), self.lattice
        first = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        pose = np.ascontiguousarray(tips), np.ascontiguousarray(axes), first, np.cross(axes, first)
        if self._ceilings is None:
            self._ceilings = (_ceilings(self.top), _ceilings(np.where(self.top > self.part, self.top, -np.inf)))
        for shell, (heights, begins) in zip((flank, bodies), self._ceilings, strict=True):
            stands_in(heights, begins, lat.ny, lat.nx, lat.x0, lat.y0, lat.step, *pose, shell.places, shell.boxes,
                      shell.levels, out)
        return out

    def overlap(self, tips: F64, tool: ToolBody, rim: float = -0.8, *, least: float = -np.inf) -> F64:
        """(n,) float64, mm: how far stock stands above the cutter's bottom at tips (n, 3); <= 0 is air.

        rim   : lattice steps added to the radius looked at; -0.8 overlooks the walls a cutter touches, 0.7 sees
                everything that may be there
        least : mm, what less than that comes out as: who asks only for stock is told sooner with 0
        """
        out = np.empty(len(tips))
        lat = self.lattice
        overlaps(self.top, self._pooled, POOLED, lat.x0, lat.y0, lat.step, np.ascontiguousarray(tips), tool.radius,
                 tool.corner_radius, rim * lat.step, 0.0, least, out)
        return out

    def under_end(self, tips: F64, tool: ToolBody, *, least: float = -np.inf) -> F64:
        """(n,) float64, mm: the most that may stand under the end of the cutter at tips (n, 3), slivers included.

        The end is what cuts straight down: a flat to its edge, a bull nose to half its corner, a ball to half its
        radius. See ``cover``; least as in ``overlap``.
        """
        reach = tool.radius - 0.5 * tool.corner_radius
        out, lat = np.empty(len(tips)), self.lattice
        half = HALF_DIAGONAL * lat.step
        overlaps(self.cover, self._covered, POOLED, lat.x0, lat.y0, lat.step, np.ascontiguousarray(tips), tool.radius,
                 tool.corner_radius, reach + half - tool.radius, half, least, out)
        return out

    def above(self, z: float) -> F64:
        """(n, 2) float64, mm: nodes where more than the part stands above height z."""
        iy, ix = np.nonzero(self.top > np.maximum(self.part, z))
        return np.column_stack([self.lattice.x0 + self.lattice.step * ix, self.lattice.y0 + self.lattice.step * iy])

    def standing(self, tips: F64, tool: ToolBody) -> F64:
        """(n,) float64, mm: how far stock that is not beside a wall may stand above tips (n, 3) within the cutter."""
        out, lat = np.empty(len(tips)), self.lattice
        standing(self.cover, self.part, lat.x0, lat.y0, lat.step, np.ascontiguousarray(tips), tool.radius,
                 HALF_DIAGONAL * lat.step, out)
        return out

    def meets_bodies(self, tips: F64, bodies: Sequence[Disc]) -> NDArray[np.bool_]:
        """(n,) bool: at tips (n, 3), mm, stock would be in shank or holder, given as cylinders with their clearance.

        Whatever cell it stands in: the radius is half a cell diagonal greater.
        """
        out = np.zeros(len(tips), np.bool_)
        if not len(tips):
            return out
        lat = self.lattice
        tips = np.ascontiguousarray(tips)
        lowest = float(tips[:, 2].min())
        for body in bodies:
            if lowest + body.height < float(self._pooled.max()):
                meets(self.top, self._pooled, POOLED, lat.x0, lat.y0, lat.step, tips, body.height,
                      body.radius + HALF_DIAGONAL * lat.step, out)
        return out

    def in_air(self, tips: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """(n,) bool: at tips (n, 3), mm, the tool may come down from above.

        The cutting part touches nothing that the nodes show, and with its end takes no more than a skin of what
        may stand between them.
        """
        air = self.overlap(tips, tool, SURE_RIM, least=0.0) <= AIR_TOLERANCE
        if air.any():
            air[air] = self.under_end(tips[air], tool, least=0.0) <= SKIN * tool.diameter
        return air

    @property
    def highest(self) -> float:
        """Highest point of the stock, mm; -inf where there is none."""
        return float(self.cover.max()) if self.cover.size else float("-inf")


class _Others:
    """What maps of the same stock along other axes say; taken as they are when it is made.

    turns, frames : (k, 3, 3) and (k, 3), as ``sink`` takes them; lowest : mm, where ways down end
    said          : for ``cover`` and for ``top``, what the others say, (k, ny, nx) mm, and the rise
    """

    def __init__(self, turns: F64, frames: F64, lowest: float, said: Sequence[tuple[F64, float]]) -> None:
        self.turns, self.frames, self.lowest, self.said = turns, frames, lowest, said
        self.known = np.zeros((2, 0, 0))  # heights of both, as they came out the last time

    @classmethod
    def of(cls, others: Sequence[tuple[StockMap, F64]], lat: Lattice, lowest: float) -> _Others:
        """Of StockMaps with the rotations (3, 3) from the frame of ``lat`` into theirs."""
        reach = HALF_DIAGONAL * lat.step
        # a place as far as that from another falls on a node of theirs no farther than so many and one
        wide = [ndimage.maximum_filter(m.cover, 2 * int((reach + lat.step) / m.lattice.step) + 3) for m, _ in others]
        return cls(np.array([turn for _, turn in others], dtype=np.float64),
                   np.array([[m.lattice.x0, m.lattice.y0, m.lattice.step] for m, _ in others]), lowest - lat.step,
                   ((_stacked(wide), reach), (_stacked([m.top for m, _ in others]), 0.0)))

    def sink(self, top: F64, cover: F64, lat: Lattice) -> None:
        """Lower both where they are not as they came out the last time."""
        if self.known.shape[1:] != top.shape:
            self.known = np.full((2, *top.shape), np.inf)
        for heights, known, (theirs, rise) in zip((cover, top), self.known, self.said, strict=True):
            sink(heights, known, lat.x0, lat.y0, lat.step, self.lowest, self.turns, theirs, self.frames, rise)
        np.minimum(top, cover, out=top)
        self.known[0], self.known[1] = cover, top


def _wall(u: F64, arch: F64, aside: float, up: float) -> F64:
    """Height of a leaning bar's wall over the middle of its lower end, mm, ``arch`` being sqrt(radius² - v²)."""
    return np.asarray((up * u + arch) / aside) if aside > 0.0 else np.full(u.shape, np.inf)


def _upper_end(u: F64, length: float, aside: float, up: float) -> F64:
    """Height of the plane of a bar's upper end over the middle of its lower one, mm."""
    return np.asarray((length - aside * u) / up) if up > LEANS else np.full(u.shape, np.inf)


def _in_cells(tree: TriangleTree, lat: Lattice) -> F64:
    """(ny, nx) float64, mm: highest of the part in the disc round each cell."""
    return drop_grid(tree, lat.x0, lat.y0, lat.step, lat.nx, lat.ny, HALF_DIAGONAL * lat.step, 0.0)


def _stacked(heights: Sequence[F64]) -> F64:
    """Maps one over the other, (k, ny, nx), with nothing where one has no node."""
    ny, nx = np.max([h.shape for h in heights], axis=0)
    out = np.full((len(heights), ny, nx), -np.inf)
    for k, h in enumerate(heights):
        out[k, :h.shape[0], :h.shape[1]] = h
    return out


def _ceilings(top: F64) -> Ceilings:
    """Heights of the nodes, then the highest of squares of 2, 4, 8, ... nodes a side, and where each begins."""
    levels = [np.ascontiguousarray(top)]
    while max(levels[-1].shape) > 1:
        ny, nx = levels[-1].shape
        coarse = np.empty(((ny + 1) // 2, (nx + 1) // 2))
        highest_of_four(levels[-1], coarse)
        levels.append(coarse)
    begins = np.concatenate([[0], np.cumsum([level.size for level in levels])])[:-1]
    return np.concatenate([level.ravel() for level in levels]), begins.astype(np.int64)


def _pooled(top: F64) -> F64:
    """The highest of each square of ``POOLED`` nodes a side."""
    ny, nx = (-(-n // POOLED) * POOLED for n in top.shape)
    padded = np.full((ny, nx), -np.inf)
    padded[:top.shape[0], :top.shape[1]] = top
    return np.ascontiguousarray(padded.reshape(ny // POOLED, POOLED, nx // POOLED, POOLED).max(axis=(1, 3)))


@dataclass(frozen=True, eq=False)
class StockSnapshot:
    """Heights of a ``StockMap``, (ny, nx) mm each.

    cut, settled : (k,) int64, where ``cover`` and then ``top``, row by row, are not what they were when they were last
                   settled, and (k,) mm, what that was; None where there are no hollows to settle into
    """

    top: F64
    cover: F64
    cut: NDArray[np.int64] | None
    settled: F64 | None
