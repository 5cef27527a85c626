"""Contours of the free region of a tool at one height, such as the waterlines that finish walls.

``contours`` gives the exact boundary of F(z) inside an active area: places where the tool touches. ``rings`` gives
lines at a distance from it, for roughing. The distance from the exact boundary is computed at the nodes of the lattice,
and every move is tested against the exact cutter.

Arrays are float64 unless they are masks; places are tips in mm, access frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from geometry.arc_pair import ArcPair
from geometry.mesh import F64
from geometry.mesh_queries.drop import one_thread
from geometry.mesh_queries.revolved_outline import Outline
from toolpath.kernels.contour import (
    MAX_PER_CHORD,
    SEGMENTS,
    TipLimits,
    chords_free,
    linear_crossings,
    place_crossings,
    refine,
    trace,
)
from toolpath.kernels.grown import grow_square
from toolpath.kernels.wall_distance import (
    EVERYWHERE,
    Bands,
    Walls,
    box_of,
    from_boundary,
    from_boundary_parallel,
    places_of,
)
from toolpath.lines import Line, dense, pieces_where, smoothed, true_runs
from zones.kernels.lattice import LatticeFrame
from zones.lattice import blocked_beside
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

THIN = 1.5  # lattice steps: mean width of loops that a slit may have fallen apart into
FINER = 4  # of the lattice, in a slit
ROUND = 0.5  # of the distance between rings, over which all but those along the walls are smoothed
MIN_APART = 0.6  # lattice steps between successive crossings; less only where a corner is cut
SHORT = 1.25
"""Lattice steps that the boundary is nearer than the nearest blocked node: sqrt(5) / 2 at the most, with some to spare.

A chord across a cell is no farther from its blocked corners.
"""


def dilated(mask: NDArray[np.bool_], cells: float) -> NDArray[np.bool_]:
    """A mask grown by ``cells`` lattice steps in each direction, a square round every node, (ny, nx) bool.

    mask : (ny, nx) bool, on the lattice
    """
    reach = int(np.ceil(cells))
    if reach <= 0 or not mask.any():
        return mask
    near = _window(mask, reach)
    out = np.zeros(mask.shape, np.bool_)
    grow_square(np.ascontiguousarray(mask[near]), reach, out[near])
    return out


def _window(active: NDArray[np.bool_], grow: int) -> tuple[slice, slice]:
    rows, cols = np.flatnonzero(active.any(axis=1)), np.flatnonzero(active.any(axis=0))
    return (slice(max(int(rows[0]) - grow, 0), int(rows[-1]) + 2 + grow),
            slice(max(int(cols[0]) - grow, 0), int(cols[-1]) + 2 + grow))


def contours(field: TipField, z: float, active: NDArray[np.bool_], tolerance: float) -> list[Line]:
    """Boundary of the free region of a tool at tip height z, inside an area.

    field     : TipField
    z         : mm, tip height in the access frame
    active    : (ny, nx) bool on ``field.lattice``
    tolerance : mm, largest distance between the lines and the true boundary

    Returns
    -------
    list of Line
        Every point is free. A line that leaves the area is open.
    """
    return _traced(field, z, active, tolerance)[0]


def contour_pieces(field: TipField, z: float, active: NDArray[np.bool_], wanted: NDArray[np.bool_], extend: float,
                   join: float, tolerance: float, dip: float = 0.0) -> list[Line]:
    """The pieces of ``contours`` in wanted cells, extended and joined as in ``pieces_where``.

    active       : (ny, nx) bool on ``field.lattice``, area of the lines
    wanted       : (ny, nx) bool on ``field.lattice``, inside ``active``
    z, tolerance : mm, tip height and largest distance from the true boundary
    extend, join : mm
    dip          : mm, how far below z the lines lie

    Most of an area is cut away again, so only what may stay is found exactly. Where more stays than expected, all of it
    is found exactly. A slit hardly wider than the tool falls apart into thin loops, one for each row of nodes that it
    meets: there the pieces are found on a finer lattice.
    """
    found = _pieces(field, z, active, wanted, extend, join, tolerance, dip)
    thin = [p for p in found if p.closed and _mean_width(p) < THIN * field.lattice.step]
    if len(thin) < 2:
        return found
    lat, places = field.lattice, np.vstack([p.points[:, :2] for p in thin])
    fine = field.window(places.min(axis=0) - 4.0 * lat.step, places.max(axis=0) + 4.0 * lat.step, lat.step / FINER)
    inside = dilated(lat.mask(places), 2.0)
    there = fine.lattice
    nodes = np.stack(np.meshgrid(there.x0 + there.step * np.arange(there.nx),
                                 there.y0 + there.step * np.arange(there.ny)), axis=-1).reshape(-1, 2)
    i, j = lat.cells(nodes)
    shape = there.ny, there.nx
    return (_pieces(field, z, active, wanted & ~inside, extend, join, tolerance, dip)
            + _pieces(fine, z, active[i, j].reshape(shape), (wanted & inside)[i, j].reshape(shape), extend, join,
                      tolerance, dip))


def _mean_width(line: Line) -> float:
    """Twice the area that a closed line goes round in plan by its length, mm."""
    x, y = line.points[:-1, :2].T
    return abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / line.length


def _pieces(field: TipField, z: float, active: NDArray[np.bool_], wanted: NDArray[np.bool_], extend: float,
            join: float, tolerance: float, dip: float) -> list[Line]:
    """``contour_pieces`` on the lattice of the field."""
    lat = field.lattice

    def pieces(lines: list[Line]) -> list[Line]:
        return [p for line in (Line(line.points - [0.0, 0.0, dip], line.closed) for line in lines)
                for p in pieces_where(line, wanted[lat.cells(line.points[:, :2])], extend, join)]

    lines, rough = _traced(field, z, active, tolerance, wanted, extend + 0.5 * join)
    found = pieces(lines)
    if len(rough) and any(np.isin(_flat(p.points), rough).any() for p in found):
        found = pieces(contours(field, z, active, tolerance))
    return found


def _traced(field: TipField, z: float, active: NDArray[np.bool_], tolerance: float,
            wanted: NDArray[np.bool_] | None = None, overrun: float = 0.0) -> tuple[list[Line], NDArray[np.complex128]]:
    """``contours``, exact along ``overrun`` mm round wanted cells; (k,) x + iy of points in the rest, or next to it."""
    rough = np.zeros(0, np.complex128)
    chains = _chains(field, z, active, tolerance, wanted, overrun)
    if chains is None:
        return [], rough
    starts, points, begins = chains.starts, chains.points, chains.begins[chains.starts]
    if not chains.exact.all():
        follows, beside = chains.after, ~chains.exact
        beside[follows[(follows >= 0) & ~chains.exact]] = True
        beside[(follows >= 0) & ~chains.exact[follows]] = True
        rough = _flat(points[chains.begins[:-1][beside]])
    out = []
    for k in range(len(starts) - 1):
        way = points[begins[k]:begins[k + 1]]
        if starts[k + 1] - starts[k] < 2:
            continue
        if chains.closed[k]:
            way = np.vstack([way, way[:1]])
        out.append(Line(np.column_stack([way, np.full(len(way), z)]), bool(chains.closed[k])))
    return out, rough


@dataclass(frozen=True, eq=False)
class _Chains:
    """Boundary of a free region as chains of places on lattice edges.

    rows, cols : slice, window of the lattice
    frame      : LatticeFrame of the window
    ids        : (n,) int64, edge of each place
    starts     : (c + 1,) int64, first place of each chain
    closed     : (c,) bool
    after      : (n,) int64, place that follows each, -1 for none
    exact      : (n,) bool, places found exactly; others are the middles of their edges
    points     : (m, 2) float64, mm, places with the points put in behind each
    begins     : (n + 1,) int64, where the points of each place begin
    """

    rows: slice
    cols: slice
    frame: LatticeFrame
    ids: NDArray[np.int64]
    starts: NDArray[np.int64]
    closed: NDArray[np.bool_]
    after: NDArray[np.int64]
    exact: NDArray[np.bool_]
    points: F64
    begins: NDArray[np.int64]


def _chains(field: TipField, z: float, active: NDArray[np.bool_], tolerance: float = math.inf,
            wanted: NDArray[np.bool_] | None = None, overrun: float = 0.0) -> _Chains | None:
    """The boundary in an area, exact along ``overrun`` mm round wanted cells; None where there is none.

    tolerance : mm, of chords; inf puts no points in between
    """
    if not active.any():
        return None
    lat = field.lattice
    rows, cols = _window(active, 1)
    blocked = np.ascontiguousarray(field.height[rows, cols] > z + LEVEL_TOLERANCE)
    ids, starts, closed = trace(blocked, np.ascontiguousarray(active[rows, cols]), SEGMENTS)
    if not len(ids):
        return None
    frame = LatticeFrame(lat.x0 + cols.start * lat.step, lat.y0 + rows.start * lat.step, lat.step)
    xy = np.empty((len(ids), 2))
    limits = _limits(field)
    after = np.arange(1, len(ids) + 1)
    after[starts[1:] - 1] = np.where(closed, starts[:-1], -1)
    exact = np.ones(len(ids), np.bool_)
    if wanted is not None:
        middle = _middles(ids, blocked.shape[1]) * lat.step + [frame.x0, frame.y0]
        more = 2 + math.ceil(overrun / (MIN_APART * lat.step))
        exact = _along_chains(wanted[lat.cells(middle)], starts, closed, more)
        xy[~exact] = middle[~exact]
    placed = np.empty((int(exact.sum()), 2))
    place_crossings(field.tree.arrays, limits, ids[exact], blocked, frame, z + LEVEL_TOLERANCE, placed)
    xy[exact] = placed
    if math.isinf(tolerance):
        return _Chains(rows, cols, frame, ids, starts, closed, after, exact, xy, np.arange(len(ids) + 1))
    both = exact & (after >= 0)
    both[both] = exact[after[both]]
    fine, count = np.empty((len(ids), MAX_PER_CHORD, 2)), np.empty(len(ids), np.int64)
    refine(field.tree.arrays, limits, xy, np.where(both, after, -1), z + LEVEL_TOLERANCE, tolerance, lat.step, fine,
           count)
    return _Chains(rows, cols, frame, ids, starts, closed, after, exact,
                   fine[np.arange(MAX_PER_CHORD) < count[:, None]], np.concatenate([[0], np.cumsum(count)]))


def wall_distance(field: TipField, z: float, asked: NDArray[np.bool_]) -> F64 | None:
    """Distance of nodes from the boundary of the free region of a tool at height z, (ny, nx) float64, mm.

    z     : mm, tip height in the access frame
    asked : (ny, nx) bool on ``field.lattice``

    Returns None where every node is free. At the nodes asked for it is the distance from chords between exact places of
    the boundary on lattice edges, and less than 0 where they are blocked, next to the boundary. At the rest it is the
    distance from the nearest blocked node. That stands for it also beside features that the lattice does not see, or
    sees only the end of. A chord is off a round of radius r by no more than step^2 / (4 r).
    """
    walls = _WallDistance.of(field, z, asked)
    if walls is None:
        return None
    walls.find(EVERYWHERE)
    return walls.far


@dataclass(frozen=True, eq=False)
class _WallDistance:
    """``wall_distance`` of some nodes, found band by band.

    field        : TipField
    off, nearest : as ``TipField.nearest_blocked`` gives them
    asked        : (ny, nx) bool, on the lattice
    window       : first row and column of the boundary, count of its rows and columns
    walls        : Walls; None where none of the nodes has a boundary
    far          : (ny, nx) float64, mm, as far as it is found, else ``off``
    """

    field: TipField
    off: F64
    nearest: NDArray[np.int32]
    asked: NDArray[np.bool_]
    window: tuple[int, int, int, int]
    walls: Walls | None
    far: F64

    @classmethod
    def of(cls, field: TipField, z: float, asked: NDArray[np.bool_]) -> _WallDistance | None:
        """Of the nodes asked for; None where every node is free."""
        blocked = field.nearest_blocked(z)
        if blocked is None:
            return None
        off, nearest = blocked
        needed, window, walls = box_of(off, nearest, asked), (0, 0, 0, 0), None
        if needed[0] + needed[2] <= 0:
            chains = _chains_in(field, z, needed)
            if chains is not None:
                rows, cols = chains.rows, chains.cols
                window = (rows.start, cols.start, *off[rows, cols].shape)
                before = np.full(len(chains.ids), -1)
                follows = np.flatnonzero(chains.after >= 0)
                before[chains.after[follows]] = follows
                walls = Walls(places_of(chains.ids, window), chains.after, before, chains.points, chains.begins)
        return cls(field, off, nearest, asked, window, walls, off.copy())

    def find(self, bands: Bands) -> None:
        """Find the distances of the nodes asked for that are in some bands."""
        if self.walls is not None:
            fill = from_boundary if one_thread(self.far.size) else from_boundary_parallel
            fill(self.walls, self.window, self.off, self.nearest, self.asked, bands, self.field.lattice.frame, self.far)

    def widest(self, inside: NDArray[np.bool_]) -> float:
        """The greatest distance of nodes (ny, nx) bool, asked for, mm; found as far as that takes."""
        far = float(self.off[inside].max())
        self.find(Bands(far, 1.0, 1, SHORT * self.field.lattice.step, 0.0))
        return float(self.far[inside].max())

    def along(self, first: float, spacing: float, count: int) -> None:
        """Find the distances of both ends of each lattice edge that lines at equal distances cross, in mm."""
        step = self.field.lattice.step
        self.find(Bands(first, spacing, count, step, (1.0 + SHORT) * step))


def _chains_in(field: TipField, z: float, needed: NDArray[np.int64]) -> _Chains | None:
    """The boundary at a height in a box, as ``box_of`` gives it, or in more; of the last two heights it is kept."""
    kept: Sequence[tuple[float, NDArray[np.int64], _Chains | None]] = field.kept.get("walls", ())
    for at, box, chains in kept:
        if at == z:
            if (needed >= box).all():
                return chains
            needed = np.minimum(needed, box)
    around = np.zeros((field.lattice.ny, field.lattice.nx), np.bool_)
    around[needed[0]:1 - needed[2], needed[1]:1 - needed[3]] = True
    chains = _chains(field, z, around)
    field.kept["walls"] = ((z, needed, chains), *[one for one in kept if one[0] != z][:1])
    return chains


def from_walls(field: TipField, z: float, distance: float) -> NDArray[np.bool_] | None:
    """Whether nodes are at least a distance from the boundary of the free region of a tool at height z, (ny, nx) bool.

    z, distance : mm

    Returns None where every node is free.
    """
    blocked = field.nearest_blocked(z)
    if blocked is None:
        return None
    off = blocked[0]
    walls = wall_distance(field, z, (off >= distance) & (off < distance + field.lattice.step))  # the rest is certain
    return None if walls is None else walls >= distance


def _limits(field: TipField) -> TipLimits:
    """What keeps the tip of a field's tool up, beside the obstacles, for kernels."""
    side = field.grown_side
    if isinstance(side, ArcPair):
        outline = Outline.two_arcs(side)
    else:
        outline = Outline.bull(field.grown_radius, field.grown_corner) if side is None else \
            Outline.tapered(field.grown_radius, field.grown_corner, side.taper, side.widest)
    return TipLimits(field.noncut, *field.coarse.frame, field.shape, field.allowance, outline.stack.rows)


def _flat(points: F64) -> NDArray[np.complex128]:
    return np.asarray(points[:, 0] + 1j * points[:, 1])


def _middles(ids: NDArray[np.int64], nx: int) -> F64:
    """(n, 2) middles of lattice edges in steps from the first node; numbered as ``kernels.contour`` does."""
    node, up = ids // 2, ids % 2
    return np.column_stack([node % nx + 0.5 * (1 - up), node // nx + 0.5 * up])


def _along_chains(marked: NDArray[np.bool_], starts: NDArray[np.int64], closed: NDArray[np.bool_],
                  more: int) -> NDArray[np.bool_]:
    """(n,) bool: marked places and ``more`` neighbours on each side, chain by chain."""
    out = np.zeros_like(marked)
    for k in range(len(starts) - 1):
        part = marked[starts[k]:starts[k + 1]]
        if part.any():
            out[starts[k]:starts[k + 1]] = ndimage.maximum_filter1d(
                part.view(np.uint8), 2 * more + 1, mode="wrap" if closed[k] else "constant").view(np.bool_)
    return out


def rings(field: TipField, z: float, active: NDArray[np.bool_], firsts: Sequence[float],
          spacing: float) -> Iterator[list[Line]]:
    """Lines of tip positions at equal distances inside the boundary of the free region at height z.

    active  : (ny, nx) bool, cells of the lattice that get lines
    firsts  : (m,) mm, distance of the lines nearest to the boundary; for each there are all lines of an area
    spacing : mm between one list and the next

    Yields
    ------
    list of Line
        One list a distance, in the order of stock removal: the farthest from obstacles first. At a height without
        obstacles, distances count from the border of ``active``, and the lines along it come first. A move that the
        exact cutter does not allow is left out, which opens the line there.
    """
    if not active.any():
        return
    lat = field.lattice
    rows, cols = _window(active, 1)
    inside = np.ascontiguousarray(active[rows, cols])
    walls = _WallDistance.of(field, z, dilated(active, 1.0))
    if walls is not None:
        far, widest = np.zeros(0), walls.widest(active)
    else:
        far = np.ascontiguousarray(blocked_beside(np.pad(inside, 1), lat.step)[0][1:-1, 1:-1])
        widest = float(far[inside].max())
    corner = lat.x0 + cols.start * lat.step, lat.y0 + rows.start * lat.step
    for first in firsts:
        distances = np.arange(min(first, 0.9 * widest), widest, spacing).tolist()
        if walls is not None and distances:
            walls.along(distances[0], spacing, len(distances))
            far = np.ascontiguousarray(walls.far[rows, cols])
        for distance in distances if walls is None else distances[::-1]:
            rounded = ROUND * spacing if walls is not None and distance > distances[0] else 0.0
            yield lines_at(field, z, far, distance, inside, corner, rounded)


def lines_at(field: TipField, z: float, far: F64, distance: float, inside: NDArray[np.bool_],
             corner: tuple[float, float], rounded: float = 0.0) -> list[Line]:
    """The free pieces of the lines on which ``far`` crosses ``distance``, as tips at height z, mm [Lorensen1987].

    far     : (ny, nx) float64, mm, contiguous, on the step of the lattice
    inside  : (ny, nx) bool; lines end where it does
    corner  : x and y of the first node, mm
    rounded : mm over which lines are ``toolpath.lines.smoothed``; 0 for those of an exact distance
    """
    ids, starts, closed = trace(np.ascontiguousarray(far < distance), inside, SEGMENTS)
    xy = np.empty((len(ids), 2))
    linear_crossings(ids, far, distance, LatticeFrame(*corner, field.lattice.step), xy)
    lines: list[Line] = []
    for k in range(len(starts) - 1):
        chain = xy[starts[k]:starts[k + 1]]
        if len(chain) < 2:
            continue
        if closed[k]:
            chain = np.vstack([chain, chain[:1]])
        if rounded > 0.0 and len(chain) > 2:
            chain = smoothed(chain, rounded)
        lines.extend(free_pieces(field, np.column_stack([chain, np.full(len(chain), z)]), bool(closed[k])))
    return lines


def moves_free(field: TipField, points: F64) -> NDArray[np.bool_]:
    """Whether each straight level move of a line stays free, (n - 1,) bool, tested every step of the lattice.

    points : (n, 3) float64, mm, access frame, tips

    Between two free places a step apart, a tool of radius r enters no more than step^2 / (8 r), 0.0019 mm for the steps
    of ``lattice_step``.
    """
    ok = np.ones(max(len(points) - 1, 0), np.bool_)
    if len(points) > 1:
        chords_free(field.tree.arrays, _limits(field), np.ascontiguousarray(points[:, :2]),
                    float(points[:, 2].max()) + LEVEL_TOLERANCE, field.lattice.step, ok)
    return ok


def free_pieces(field: TipField, points: F64, closed: bool) -> list[Line]:
    """The pieces of a level line whose points and moves are free.

    points : (n, 3) float64, mm, access frame, tips
    """
    ok = moves_free(field, points)
    at = points.copy()
    at[:, 2] += LEVEL_TOLERANCE
    stands = ~(field.blocked_by_cutter(at) | field.blocked_by_body(at))
    ok &= stands[:-1] & stands[1:]
    if ok.all():
        return [Line(points, closed)]
    return [Line(points[a:b + 1], False) for a, b in true_runs(ok)]


def serving(lines: Sequence[Line], tips: F64, reach: float, spacing: float, overrun: float, link: float) -> list[Line]:
    """The parts of lines within ``reach`` mm of some tips, extended by ``overrun`` mm.

    tips    : (n, 2) float64, mm, compared in plan, or (n, 3), access frame
    spacing : mm between compared places along a line
    link    : mm, shorter gaps are closed
    """
    tree, k = cKDTree(tips), tips.shape[1]
    out: list[Line] = []
    for line in lines:
        way = Line(dense(line.points, spacing), line.closed)
        out.extend(pieces_where(way, tree.query(way.points[:, :k])[0] <= reach, overrun, link))
    return out
