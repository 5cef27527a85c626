"""The planner's model of the stock: a height over the plan, lowered pass by pass.

It shows where stock is left to cut and where a tool may come down in air. Its errors cost time, never safety: the proof
reads the finished program with a model of its own (``verify``). Arrays are float64. Places are in mm, axes
dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import cutter_shape, one_thread
from geometry.mesh_queries.flat_grid import drop_over_flats
from geometry.tool_body import ToolBody
from toolpath.kernels.shell import Ceilings, PoseArrays, highest_of_four, stands_in
from toolpath.kernels.stock import (
    HALF_DIAGONAL,
    mark_standing,
    meets,
    overlaps,
    overlaps_parallel,
    sink,
    stamp,
    stamp_balls,
    stamp_leaning,
    standing,
)
from toolpath.poses import between, places_along
from toolpath.stock.tool_shell import Shell
from zones.lattice import Lattice
from zones.reach.assembly import Disc

SURE_RIM = 0.7  # lattice steps: half a cell diagonal
SURE_EDGE = 1.05  # lattice steps: sqrt((r + 1)^2 + 0.5^2) - r is less for every body of 2.5 steps or more
POOLED = 12  # nodes a side of the squares whose highest stock is stored
AIR_TOLERANCE = 0.01  # mm
UPRIGHT = 1e-12  # Z of the normal of an upright face of a block, at most
LEANS = 1e-9  # tilt of the axis of a bar: with less it stands upright, or lies level
ON_EDGE = 1e-9  # mm
NEXT_TO = 2e-3  # mm: a tool that follows the part this near, as lines do, need not clear a cell that holds no part
APART, MAX_POSED = 2.0, 0.1  # lattice steps, or radii, between poses that are removed
ROUND = (0.0, 0.25 * np.pi, 0.5 * np.pi)  # how far round the corner a cylinder inside the cutting part touches it
SKIN = 0.08  # diameters: thickest stock that the end of the tool may take in a descent steeper than the ramp


class StockMap:
    """Top of the stock over a lattice.

    lattice : Lattice
    top     : (ny, nx) float64, mm, height at the nodes; -inf where there is none
    cover   : (ny, nx) float64, mm, upper bound of everything in the cell round a node, also of stock thinner than a
              cell; where None, the highest of a node and its neighbours
    part    : (ny, nx) float64, mm, upper bound of the part in the cell; -inf everywhere where None
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

        tree   : TriangleTree of the part, or of a blank that holds it
        bounds : (2, 3) float64, mm, access frame, of the same
        part   : TriangleTree of the part where ``tree`` is a blank
        """
        lat = Lattice.over(bounds, offset + 3 * step, step)
        r, half = max(offset, 1e-3), HALF_DIAGONAL * step
        # A ball dropped from above stands at the highest point of such balls; with a flat end as wide as the disc
        # round a cell it stands at the highest of the disc.
        top, cover = (drop_over_flats(tree, lat.x0, lat.y0, step, lat.nx, lat.ny, r + d, r) + r for d in (0.0, half))
        return cls(lat, top, cover, _in_cells(part or tree, lat))

    @classmethod
    def box(cls, tree: TriangleTree, lower: F64, upper: F64, step: float) -> StockMap:
        """A block round the part between two corners.

        lower, upper : (3,) float64, mm, access frame
        """
        return cls.block(tree, np.array([lower, upper]), np.eye(3), step)

    @classmethod
    def block(cls, tree: TriangleTree, box: F64, rotation: F64, step: float) -> StockMap:
        """A block round the part in any orientation.

        box      : (2, 3) float64, mm, lower and upper corner in a frame along its edges
        rotation : (3, 3) float64, dimensionless, from there into the frame of the part
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
        """A round bar round the part in any orientation.

        radius : float, mm
        ends   : (2, 3) float64, mm, frame of the part, centres of its two flat ends

        Exact at the nodes. No place of a cell is higher than ``cover``: wall and upper end are bounded at the corner of
        the cell where each is highest. Nothing stands in a cell whose rectangle along the bar misses the bar's outline.
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
        """A copy to be cut on its own."""
        out = copy.copy(self)
        out.top, out.cover = self.top.copy(), self.cover.copy()
        out._pooled, out._covered = self._pooled.copy(), self._covered.copy()
        return out

    def become(self, other: StockMap) -> None:
        """Takes over the stock of a copy."""
        self.top, self.cover, self._ceilings = other.top, other.cover, other._ceilings
        self._pooled, self._covered = other._pooled, other._covered

    def snapshot(self) -> StockSnapshot:
        """State of the stock, to continue from later; views of the arrays where possible."""
        if self._others is None:
            return StockSnapshot(self.top, self.cover, None, None)
        cut = np.flatnonzero(self._others.known != [self.cover, self.top])
        return StockSnapshot(self.top, self.cover, cut, self._others.known.ravel()[cut])

    def restore(self, snapshot: StockSnapshot) -> None:
        """Take over the stock of a checkpoint, before any cut.

        Raises
        ------
        ValueError
            The snapshot belongs to another map.
        """
        shape, hollows = self.top.shape, self._others is not None
        if snapshot.top.shape != shape or snapshot.cover.shape != shape or hollows != (snapshot.cut is not None):
            raise ValueError("the stock of the checkpoint is not of this lattice")
        if self._others is not None:
            known = np.array([snapshot.cover, snapshot.top])
            known.ravel()[snapshot.cut] = snapshot.settled
            self._others.known = known
        self.top, self.cover, self._ceilings = snapshot.top.copy(), snapshot.cover.copy(), None
        self._pooled, self._covered = _pooled(self.top), _pooled(self.cover)

    def left_by(self, others: Sequence[tuple[StockMap, F64]], lowest: float) -> None:
        """Lower the stock to what maps of it along other axes have left.

        others : StockMaps, each with the rotation (3, 3) float64, dimensionless, from the frame of this one into its
                 own
        lowest : mm, lower end of the blank in this frame. The part may begin higher: a lower corner of the blank still
                 stands in the way of tools along other axes

        Notes
        -----
        A place is gone where it lies above one of the others. ``cover`` stays a bound: another's cover counts as far
        round a place as a cell reaches, and to the next place compared. ``top`` is lowered by theirs, node by node, so
        a wall that they have finished shows no more than half a cell of stock. A hollow under remaining stock counts as
        stock until that is cut (``settle``).
        """
        if not others:
            return
        self._others = _Others.of(others, self.lattice, lowest)
        self.settle()
        self._pooled, self._covered = _pooled(self.top), _pooled(self.cover)

    def settle(self, last: bool = False) -> None:
        """Lower stock that was cut since the last call into the hollows under it; see ``left_by``.

        last : no more cuts follow, and the other maps are released
        """
        if self._others is not None:
            self._others.sink(self.top, self.cover, self.lattice)
            self._ceilings = None
            self._others = None if last else self._others

    def cut(self, points: F64, tool: ToolBody) -> None:
        """Remove the volume that the cutting part sweeps along a polyline of tips.

        points : (n, 3) float64, mm, access frame
        """
        lat, self._ceilings = self.lattice, None
        stamp(self.top, self.cover, lat.frame, np.ascontiguousarray(points), cutter_shape(tool))

    @contextmanager
    def undone(self, box: F64) -> Iterator[None]:
        """Try cuts: what is cut within the context stands again behind it.

        box : (2, 2) float64, mm, access frame, lower and upper bounds in plan of all that is cut
        """
        lat = self.lattice
        lo = np.floor((box[0] - [lat.x0, lat.y0]) / lat.step).astype(np.int64) - 1
        hi = np.ceil((box[1] - [lat.x0, lat.y0]) / lat.step).astype(np.int64) + 2
        here = (slice(max(int(lo[1]), 0), max(int(hi[1]), 0)), slice(max(int(lo[0]), 0), max(int(hi[0]), 0)))
        kept = [(a, a[here].copy()) for a in (self.top, self.cover)]
        pooled = self._pooled.copy(), self._covered.copy()
        try:
            yield
        finally:
            for a, before in kept:
                a[here] = before
            (self._pooled, self._covered), self._ceilings = pooled, None

    def cut_leaning(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Remove the volume that a tilted tool cuts along poses.

        tips, axes : (n, 3) float64, mm and unit, access frame

        Notes
        -----
        Cylinders inside the cutting part, and the whole of a ball where flutes cover all of it that is seen from below,
        at poses a few lattice steps apart: neither map falls too low.
        """
        lat, self._ceilings = self.lattice, None
        spacing = max(APART * lat.step, MAX_POSED * tool.radius)
        tips, axes = between(tips, axes, places_along(tips, axes, tool.flute_length, spacing))
        r, high = tool.corner_radius, tool.flute_length
        bent = ROUND if r > 0.0 else (0.5 * np.pi,)
        for radius, low in ((tool.radius - r + r * np.sin(a), r - r * np.cos(a)) for a in bent):
            sides = 0.5 * (high - low) * np.abs(axes[:, :2]) + radius * np.sqrt(1.0 - np.minimum(axes[:, :2]**2, 1.0))
            for heights, shrink in ((self.top, 0.0), (self.cover, HALF_DIAGONAL * lat.step)):
                stamp_leaning(heights, lat.frame, np.ascontiguousarray(tips), np.ascontiguousarray(axes), sides, radius,
                              low, high, shrink)
        if r == tool.radius:
            # from under a ball that leans its side is seen up to there, and above short flutes it does not cut
            cuts = high >= r * (1.0 + np.sqrt(np.maximum(1.0 - axes[:, 2]**2, 0.0)))
            centres = np.ascontiguousarray((tips + r * axes)[cuts])
            for heights, shrink in ((self.top, 0.0), (self.cover, HALF_DIAGONAL * lat.step)):
                stamp_balls(heights, lat.frame, centres, r, shrink)

    def stands_in(self, tips: F64, axes: F64, flank: Shell, bodies: Shell) -> NDArray[np.bool_]:
        """Whether stock stands in a tilted tool at poses, (n,) bool.

        tips, axes : (n, 3) float64, mm and unit, access frame
        flank      : Shell of its cutting part, in stock where that is higher at the nearest node, the part included
        bodies     : Shell of neck, shank and holder, in stock where that is also higher than the part
        """
        out, lat = np.zeros(len(tips), np.bool_), self.lattice
        first = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        poses = PoseArrays(np.ascontiguousarray(tips), np.ascontiguousarray(axes), first, np.cross(axes, first))
        if self._ceilings is None:
            self._ceilings = (_ceilings(self.top), _ceilings(np.where(self.top > self.part, self.top, -np.inf)))
        for shell, ceilings in zip((flank, bodies), self._ceilings, strict=True):
            stands_in(ceilings, lat.frame, poses, shell.arrays, out)
        return out

    def overlap(self, tips: F64, tool: ToolBody, rim: float = -0.8, *, lower_bound: float = -np.inf) -> F64:
        """Height of stock above the cutter's bottom at tips, (n,) float64, mm; <= 0 is air.

        tips        : (n, 3) float64, mm, access frame
        rim         : lattice steps added to the radius; -0.8 leaves out the walls that a cutter touches, 0.7 includes
                      everything that may be there
        lower_bound : mm, smaller results come out as this; 0 is faster where only stock matters
        """
        out = np.empty(len(tips))
        lat = self.lattice
        call = overlaps if one_thread(len(tips)) else overlaps_parallel
        call(self.top, self._pooled, POOLED, lat.frame, np.ascontiguousarray(tips), cutter_shape(tool),
             rim * lat.step, 0.0, lower_bound, out)
        return out

    def under_end(self, tips: F64, tool: ToolBody, *, lower_bound: float = -np.inf) -> F64:
        """Upper bound of the stock under the end of the cutter at tips, slivers included, (n,) float64, mm.

        tips        : (n, 3) float64, mm, access frame
        lower_bound : mm, as in ``overlap``

        The end cuts straight down: a flat to its edge, a bull nose to half its corner, a ball to half its radius,
        a circle segment mill to where it leans by 30 degrees. See ``cover``.
        """
        reach = tool.dull_radius
        out, lat = np.empty(len(tips)), self.lattice
        half = HALF_DIAGONAL * lat.step
        overlaps(self.cover, self._covered, POOLED, lat.frame, np.ascontiguousarray(tips),
                 cutter_shape(tool), reach + half - tool.widest_radius, half, lower_bound, out)
        return out

    def above(self, z: float, lattice: Lattice) -> NDArray[np.bool_]:
        """Nodes of another lattice that are nearest to one where more than the part stands above height z, mm.

        Returns (ny, nx) bool, on ``lattice``.
        """
        lat, out = self.lattice, np.zeros((lattice.ny, lattice.nx), np.bool_)
        rows = lattice.cells(lat.nodes(np.arange(lat.ny), np.zeros(lat.ny, np.int64), z))[0]
        cols = lattice.cells(lat.nodes(np.zeros(lat.nx, np.int64), np.arange(lat.nx), z))[1]
        mark_standing(self.top, self.part, z, rows, cols, out)
        return out

    def over_part(self, lattice: Lattice) -> NDArray[np.bool_]:
        """Nodes of another lattice that are over a cell with the part in it, (ny, nx) bool, on ``lattice``."""
        row, column = np.meshgrid(np.arange(lattice.ny), np.arange(lattice.nx), indexing="ij")
        at = self.lattice.cells(lattice.nodes(row.ravel(), column.ravel(), 0.0)[:, :2])
        return np.asarray(np.isfinite(self.part[at]).reshape(lattice.ny, lattice.nx))

    def standing(self, tips: F64, tool: ToolBody) -> F64:
        """Upper bound of the height of stock, not beside a wall, above tips within the cutter, (n,) float64, mm.

        tips : (n, 3) float64, mm, access frame
        """
        out, lat = np.empty(len(tips)), self.lattice
        standing(self.cover, self.part, lat.frame, np.ascontiguousarray(tips), tool.widest_radius,
                 HALF_DIAGONAL * lat.step, out)
        return out

    def meets_bodies(self, tips: F64, bodies: Sequence[Disc]) -> NDArray[np.bool_]:
        """Whether stock would be in shank or holder at tips, (n,) bool.

        tips   : (n, 3) float64, mm, access frame
        bodies : cylinders with their clearance

        The radius is greater by ``SURE_EDGE``: stock that ends along a line shows at a node no more than a step behind
        it, and no more than half a step aside.
        """
        out = np.zeros(len(tips), np.bool_)
        if not len(tips):
            return out
        lat = self.lattice
        tips = np.ascontiguousarray(tips)
        lowest = float(tips[:, 2].min())
        for body in bodies:
            if lowest + body.height < float(self._pooled.max()):
                meets(self.top, self._pooled, POOLED, lat.frame, tips, body.height, body.radius + SURE_EDGE * lat.step,
                      out)
        return out

    def in_air(self, tips: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """Whether the tool may come down from above at tips, (n,) bool.

        tips : (n, 3) float64, mm, access frame

        The cutting part touches no stock at the nodes, and its end takes no more than a skin of what may stand between
        them.
        """
        air = self.overlap(tips, tool, SURE_RIM, lower_bound=0.0) <= AIR_TOLERANCE
        if air.any():
            air[air] = self.under_end(tips[air], tool, lower_bound=0.0) <= SKIN * tool.diameter
        return air

    @property
    def highest(self) -> float:
        """Highest point of the stock, mm; -inf where there is none."""
        return float(self.cover.max()) if self.cover.size else float("-inf")


class _Others:
    """Maps of the same stock along other axes, in their state when this is made.

    turns, frames : (k, 3, 3) and (k, 3), as ``sink`` takes them
    lowest        : mm, where ways down end
    said          : for ``cover`` and for ``top``, the heights of the others, (k, ny, nx) mm, and the rise
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
            sink(heights, known, lat.frame, self.lowest, self.turns, theirs, self.frames, rise)
        np.minimum(top, cover, out=top)
        self.known[0], self.known[1] = cover, top


def _wall(u: F64, arch: F64, aside: float, up: float) -> F64:
    """Height of a leaning bar's wall over the middle of its lower end, mm, ``arch`` being sqrt(radius² - v²)."""
    return np.asarray((up * u + arch) / aside) if aside > 0.0 else np.full(u.shape, np.inf)


def _upper_end(u: F64, length: float, aside: float, up: float) -> F64:
    """Height of the plane of a bar's upper end over the middle of its lower one, mm."""
    return np.asarray((length - aside * u) / up) if up > LEANS else np.full(u.shape, np.inf)


def _in_cells(tree: TriangleTree, lat: Lattice) -> F64:
    """(ny, nx) float64, mm: highest of the part in the disc round each cell, and next to it."""
    return drop_over_flats(tree, lat.x0, lat.y0, lat.step, lat.nx, lat.ny, HALF_DIAGONAL * lat.step + NEXT_TO, 0.0)


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
    heights = np.concatenate([level.ravel() for level in levels])
    return Ceilings(heights, begins.astype(np.int64), *top.shape)


def _pooled(top: F64) -> F64:
    """The highest of each square of ``POOLED`` nodes a side."""
    ny, nx = (-(-n // POOLED) * POOLED for n in top.shape)
    padded = np.full((ny, nx), -np.inf)
    padded[:top.shape[0], :top.shape[1]] = top
    return np.ascontiguousarray(padded.reshape(ny // POOLED, POOLED, nx // POOLED, POOLED).max(axis=(1, 3)))


@dataclass(frozen=True, eq=False)
class StockSnapshot:
    """State of a ``StockMap``.

    top, cover   : (ny, nx) float64, mm
    cut          : (k,) int64, index of the heights of ``cover`` and then ``top``, row by row, that changed since they
                   were last settled; None without hollows to settle into
    settled      : (k,) float64, mm, those heights when they were settled
    """

    top: F64
    cover: F64
    cut: NDArray[np.int64] | None
    settled: F64 | None
