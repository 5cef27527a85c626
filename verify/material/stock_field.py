"""The stock in process where tools tilt or turn: signed distances on a grid, cut in place.

Vertical lines of one height suffice where the axis stays along Z (``verify.material.stock_lines``); a tilted tool can
cut under an overhang. The error is that of the grid (``verify.kernels.field``): removed stock never counts as standing,
and stock between nodes is seen unless it is thinner than their distance. Residuals on the part do not come from here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.tool_body import ToolBody
from verify.blank.blank import blank_cylinder, blank_mesh, stock_bounds
from verify.kernels.engaged import EngagedArrays
from verify.kernels.field import VOLUME_UNITS, FieldArrays, FieldSums, field_tile
from verify.kernels.grid import cross_columns, net_faces, net_vertices
from verify.kernels.stock import PLUNGE
from verify.material.stock_pass import (
    StockPass,
    contact_limits,
    descents,
    end_radii,
    event_table,
    gather,
    noted,
    parts,
    rapid_arrays,
    tables_for,
    ways_of,
)
from verify.material.tiles import run_tiles
from verify.model import ProofSetup, StockKind
from verify.moves import BOW, Moves, Progress, cutter_table
from verify.tool_axes import ToolAxes, sector_frames
from verify.tool_bodies import Bodies

F32 = NDArray[np.float32]
MAX_NODES = 24_000_000
TILE = 64
WHOLE, MIN_NODES = 0.85, 4.0  # share of the end, and nodes: accuracy of the area of an end that stands on stock
SLAB = 8


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distances into the stock, limited to ``band``; node (i, j, k) is at origin + (i, j, k) step.

    origin : (3,) float64, mm, setup frame
    step   : mm between nodes
    values : (nx, ny, nz) float32, mm, above zero where stock stands
    """

    origin: F64
    step: float
    values: F32

    @property
    def band(self) -> float:
        """Limit of the distances, mm: the step as a float32, so that a removed node is recognised."""
        return float(np.float32(self.step))

    @property
    def arrays(self) -> FieldArrays:
        """The same for kernels, which cut ``values`` in place."""
        return FieldArrays(self.values, self.origin, self.step, self.band)

    @property
    def volume(self) -> float:
        """Volume of the stock, mm³."""
        cells = sum(float(np.clip(0.5 + v / self.step, 0.0, 1.0).sum(dtype=np.float64)) for v in self.values)
        return cells * self.step**3

    def surface(self) -> TriangleMesh:
        """The stock as a closed surface net [Gibson1998], all facets of face number 0; empty where no stock stands."""
        padded = np.pad(self.values, 1, constant_values=-self.step)
        number = np.empty(tuple(n - 1 for n in padded.shape), np.int32)
        vertices = np.empty((net_vertices(padded, number, np.empty((0, 3)), self.step), 3))
        net_vertices(padded, number, vertices, self.step)
        faces = np.empty((net_faces(padded, number, np.empty((0, 3), np.int32)), 3), np.int32)
        net_faces(padded, number, faces)
        return TriangleMesh(vertices + (self.origin - self.step), faces, np.zeros(len(faces), np.int32))


def stock_field(mesh: TriangleMesh, setup: ProofSetup, step: float, *, box: F64 | None = None,
                threads: int = 2, progress: Progress | None = None) -> DistanceField:
    """The stock before the first cut.

    mesh : of the part, mm
    step : mm between nodes, wider where that needs over 24 million nodes
    box  : (2, 3) float64, mm, setup frame, region of interest; all of the stock where None
    """
    lower, upper = stock_bounds(mesh.bounds, setup) if box is None else np.asarray(box, dtype=np.float64)
    step = max(step, float(np.cbrt((upper - lower + 4 * step).prod() / MAX_NODES)))
    counts = np.ceil((upper - lower) / step).astype(int) + 4
    origin = 0.5 * (lower + upper) - 0.5 * step * (counts - 1)
    values = np.empty(tuple(counts.tolist()), np.float32)
    if setup.stock_kind == StockKind.PART_OFFSET:
        _grown(values, origin, step, mesh, setup.margin + setup.uncertainty, threads, progress)
    elif setup.stock_kind == StockKind.STEP:
        _grown(values, origin, step, blank_mesh(setup), setup.uncertainty, threads, progress)
    else:
        _simple(values, origin, step, mesh.bounds, setup)
    return DistanceField(origin, step, values)


def _simple(values: F32, origin: F64, step: float, bounds: F64, setup: ProofSetup) -> None:
    """Box or cylinder, slab by slab."""
    x, y, z = (origin[c] + step * np.arange(n) for c, n in enumerate(values.shape))
    lower, upper = stock_bounds(bounds, setup)
    high = np.minimum(z - lower[2], upper[2] - z)[None, None, :]
    across = np.minimum(y - lower[1], upper[1] - y)[None, :, None]
    for i in range(0, len(x), SLAB):
        s = slice(i, i + SLAB)
        if setup.stock_kind == StockKind.CYLINDER:
            depth = blank_cylinder(bounds, setup).depth(x[s, None, None], y[None, :, None], z[None, None, :])
        else:
            side = np.minimum(np.minimum(x[s] - lower[0], upper[0] - x[s])[:, None, None], across)
            depth = np.minimum(side, high)
        values[s] = np.clip(depth, -step, step)


def _grown(values: F32, origin: F64, step: float, mesh: TriangleMesh, reach: float, threads: int,
           progress: Progress | None) -> None:
    """Part or blank grown by ``reach``: nodes near the surface get their distance, others are inside or outside."""
    inside = np.zeros(values.shape, np.bool_)
    cuts = np.linspace(0, len(values), 4 * max(threads, 1) + 1).astype(int)

    def job(a: int, b: int) -> Callable[[], object]:
        return lambda: cross_columns(inside, a, b, origin, step, mesh.vertices, mesh.faces)

    run_tiles([job(int(a), int(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True) if b > a], threads,
              None if progress is None else lambda f: progress(0.2 * f))
    tree = TriangleTree(mesh)

    def slab(i: int) -> Callable[[], object]:
        at = origin + [i * step, 0.0, 0.0]
        return lambda: _grown_slab(values[i:i + 4], inside[i:i + 4], at, step, tree, reach)

    run_tiles([slab(i) for i in range(0, len(values), 4)], threads,
              None if progress is None else lambda f: progress(0.2 + 0.8 * f))


def _grown_slab(values: F32, inside: NDArray[np.bool_], origin: F64, step: float, tree: TriangleTree,
                reach: float) -> None:
    """Four layers of nodes: bricks of 4, then of 2, are wholly inside, wholly outside, or computed node by node."""
    # where the margin is a step or more, places inside the part are at least a step from the surface
    unsure = ~inside if reach >= step else np.ones_like(inside)
    values[:] = step
    for size in (4, 2):
        half = 0.5 * math.sqrt(3.0) * (size - 1) * step
        lookup = np.logical_or.reduceat(unsure, np.arange(0, unsure.shape[0], size), axis=0)
        for axis in (1, 2):
            lookup = np.logical_or.reduceat(lookup, np.arange(0, unsure.shape[axis], size), axis=axis)
        gap = np.full(lookup.shape, reach)
        centres = (np.argwhere(lookup) * size + 0.5 * (size - 1)) * step + origin
        gap[lookup] = nearest(tree, centres, reach + step + half)[0]
        for axis, count in enumerate(unsure.shape):
            gap = np.repeat(gap, size, axis=axis).take(np.arange(count), axis=axis)
        values[unsure & ~inside & (gap > reach + step + half)] = -step
        unsure &= (gap <= reach + step + half) & (gap >= reach - step - half)
    gap = nearest(tree, np.argwhere(unsure) * step + origin, reach + step)[0]
    values[unsure] = np.clip(np.where(inside[unsure], reach + gap, reach - gap), -step, step)


def run_field(field: DistanceField, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *, bare: bool = False,
              threads: int = 2, progress: Progress | None = None, bow: float = BOW) -> StockPass:
    """Run all moves through the stock, in place, and collect contacts.

    bare : whether only cutting parts are simulated, without bodies

    Returns StockPass. Raises VerificationError as ``cutter_table``. Same bytes for any number of threads.

    Notes
    -----
    Plunge: the mean depth of a steep descent is the volume that the end-cutting region removes, over the area that the
    region covers; straight down, over the part of it that stands on stock. The distribution of the volume over the
    region tells how much deeper its middle is than its rim, so a round end gets its full depth. Depths add up over the
    moves. Sideways travel reduces them at the slope of a ramp. A depth that the region no longer covers is another
    hole.
    """
    cutters, ends = cutter_table(tools), end_radii(tools, setup.tap_holes)
    bodies = Bodies.none(tools) if bare else Bodies.of(tools, setup)
    axes = moves.axes or ToolAxes.upright(len(moves))
    sizes, (steep, _) = bodies.arrays(cutters, ends), descents(moves, tools, setup)
    stock, limits = field.arrays, contact_limits(setup)
    steps, turns, rapids = moves.arrays, axes.arrays(bow), rapid_arrays(moves, setup)
    x, y = sector_frames(moves.axes, len(moves))
    twists = np.arctan2((axes.about * y).sum(axis=1), (axes.about * x).sum(axis=1))
    first = parts(moves, tools)
    sums, spare = tables_for(threads, (len(moves), 4))
    tables, blank_table = tables_for(threads, (int(first[-1]),))
    parted, free_parted = tables_for(threads, (int(first[-1]), 2))

    def job(tile: NDArray[np.int64]) -> Callable[[], object]:
        def work() -> object:
            events, taken, engaged, own = event_table(), spare.get(), blank_table.get(), free_parted.get()
            n = field_tile(stock, tile, steps, turns, twists, rapids, steep, sizes, limits,
                           FieldSums(taken, own), EngagedArrays(first, engaged), events)
            free_parted.put(own)
            spare.put(taken)
            blank_table.put(engaged)
            return noted(events), n
        return work

    events, lost = gather(run_tiles([job(t) for t in _tiles(field.values.shape)], threads, progress))
    taken, engaged = np.sum(sums, axis=0), np.bitwise_or.reduce(tables)
    ways = ways_of(parted)
    end = ends[moves.tool]
    aside = np.linalg.norm(_across(moves.end - moves.start, axes.middle), axis=1)
    over = (np.pi * end**2 + 2.0 * end * aside)
    stands = taken[:, 3] / VOLUME_UNITS
    # straight down beside an edge only the area on stock digs; a few nodes do not measure that area
    partly = (aside <= 0.25 * end) & (stands < WHOLE * over) & (stands > MIN_NODES * field.step**2)
    over = np.where(partly, stands, over)[:, None]
    plunges = _plunges(moves, axes, taken[:, [1, 2]] / VOLUME_UNITS / over, end,
                       descents(moves, tools, setup, ways.in_cut(first))[1],
                       setup.plunge_skin * np.array([t.diameter for t in tools]), round_off(tools))
    return StockPass(np.concatenate([events, plunges]), lost, taken[:, 0] > 0, engaged, ways)


def _across(way: F64, axis: F64) -> F64:
    """Vectors (n, 3) less their components along unit vectors (n, 3)."""
    return np.asarray(way - (way * axis).sum(axis=1, keepdims=True) * axis)


def round_off(tools: Sequence[ToolBody]) -> F64:
    """(k,) float64, mm: depth of the middle of each tool end minus the mean depth of the end, from its shape."""
    share = (np.arange(400) + 0.5) / 400.0  # of the area of the end
    out = []
    for tool, end in zip(tools, end_radii(tools).tolist(), strict=True):
        if tool.arcs is not None:
            out.append(float(np.mean([tool.arcs.height(rho) for rho in (end * np.sqrt(share)).tolist()])))
            continue
        over, corner = np.maximum(end * np.sqrt(share) - (tool.radius - tool.corner_width), 0.0), tool.corner_width
        out.append(float(np.mean(over * tool.cone_height / corner if tool.cone_height > 0.0 else
                                 corner - np.sqrt(np.maximum(corner**2 - over**2, 0.0)))))
    return np.array(out)


def _plunges(moves: Moves, axes: ToolAxes, dug: F64, end: F64, earned: F64, skins: F64, rounds: F64) -> F64:
    """Rows (move, PLUNGE, depth, 0, x, y, z) of the moves that make the open depth larger than the skin of their tool.

    dug    : (m, 2) float64, mm, mean depth of each move, and its mean times the square of the share of the radius
    end    : (m,) float64, mm, radius of the end that dug it; rounds : (k,) float64, mm, as ``round_off``

    Earlier depth counts by the share of the width that the end still covers. A path that goes on downhill is then as
    deep as the stock at its end, not as deep as all its steps together.
    """
    digging = np.flatnonzero(dug[:, 0] > 0.0)
    gone = np.zeros(len(digging))
    gone[1:] = np.linalg.norm(_across(np.diff(moves.end[digging], axis=0), axes.middle[digging[1:]]), axis=1)
    over = np.maximum(1.0 - gone / (2.0 * end[digging]), 0.0)
    rows, mean, moment, paid = [], 0.0, 0.0, 0.0
    for m, share in zip(digging.tolist(), over.tolist(), strict=True):
        kept = max(mean - (earned[m] - paid), 0.0) * share
        moment = kept / mean * moment + dug[m, 1] if mean > 0.0 else dug[m, 1]
        mean = kept + dug[m, 0]
        paid = earned[m]
        # for a depth that falls with the square of the radius, 4 mean - 6 moment is the depth of the middle
        depth = min(max(4.0 * mean - 6.0 * moment, mean), mean + rounds[moves.tool[m]])
        if depth > skins[moves.tool[m]]:
            rows.append((m, PLUNGE, depth, 0.0, *moves.end[m].tolist()))
    return np.array(rows, dtype=np.float64).reshape(-1, 7)


def _tiles(shape: tuple[int, ...]) -> list[NDArray[np.int64]]:
    cuts = [[(a, min(a + TILE, n)) for a in range(0, n, TILE)] for n in shape]
    return [np.array([*x, *y, *z], np.int64) for x in cuts[0] for y in cuts[1] for z in cuts[2]]
