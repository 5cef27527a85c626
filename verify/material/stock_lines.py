"""The stock in process as vertical lines, and the contacts of tools with it.

Stock is a field of vertical lines, ``line_spacing`` apart, each solid up to one height, as in [VanHook1986] and
[Chappel1983]. Blank and cuts are exact on every line (closed forms, no rounding to cells), so every finding is real;
stock between two lines that is thinner than the spacing is not seen. Normal rays check flanks beside walls, and points
of the part check necks, shanks and holders, so the spacing matters only for stock beyond the part.

- A line is lowered only where the flutes reach its top when the cutter first touches it. Higher stock stays and meets
  the neck.
- A body no wider than the cutting part follows it: its clearance never reaches beyond the cutting radius, and it may
  overlap by ``BESIDE``.
- In a rapid the whole assembly is grown radially by the rapid clearance, and stays as far from everything else too,
  such as a face below it. Straight down before a cut the distance to what is below is that of the approach. A straight
  lift needs no clearance where it starts.
- Plunge: feed moves steeper than the ramp angle remove depth from a line with the end-cutting region of the tool. The
  depths add up; sideways travel in the cut reduces them at the slope of the ramp. Which travel is in the cut is known
  after all moves, so blocks in which it may matter are run a second time. It is a plunge where more than
  ``plunge_skin`` tool diameters are open, so a descent interrupted by side steps, lifts or pecks is still one descent.
  An end that does not cut to its centre leaves a stub under its core. A stub higher than four ramps over the radius of
  the core and a hundredth of the diameter is a plunge, and so is a hundredth of the diameter that no ramp over the same
  ground would have left. The end-cutting
  region is the whole end of a flat, the flat and half the corner of a bull nose, and the inner half radius of a ball
  (to 30 degrees of its sphere). A ball that finishes downhill through a thin skin therefore does not plunge. It is the
  flat at the tip of a chamfer mill, and the core of a tap. A drill and a pointed chamfer mill cut straight down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.tool_body import ToolBody
from verify.blank.blank import blank_cylinder, blank_mesh, stock_bounds
from verify.kernels.bodies import body_tile
from verify.kernels.engaged import EngagedArrays
from verify.kernels.heights import raise_offset
from verify.kernels.stock import PLUNGE, STUB, CutTotals, DescentArrays, LineArrays, stock_tile
from verify.material.stock_pass import (
    BESIDE,
    StockPass,
    WaysInCut,
    contact_limits,
    descents,
    end_radii,
    event_table,
    gather,
    hollow_ends,
    noted,
    parts,
    rapid_arrays,
    tables_for,
    ways_before,
    ways_of,
)
from verify.material.tiles import CellGrid, run_tiles
from verify.model import ProofSetup, StockKind
from verify.moves import Moves, Progress, cutter_table
from verify.progress import StageProgress
from verify.tool_bodies import Bodies

MAX_LINES = 6_000_000
BLOCK = 32
NEVER = -1e30


@dataclass(frozen=True, eq=False)
class StockLines:
    """Vertical lines: line (i, j) stands at origin + ((i, j) + 0.5) step.

    origin : (2,) float64, mm, setup frame
    step   : mm between lines
    height : (nx, ny) float64, mm, top of the stock
    bottom : mm, underside of the stock: an end that comes out of a hole there digs no further
    """

    origin: F64
    step: float
    height: F64
    bottom: float = NEVER


def blank(mesh: TriangleMesh, spacing: float, setup: ProofSetup, *, threads: int = 2,
          progress: Progress | None = None) -> StockLines:
    """The stock before the first cut, never below the part, as vertical lines [VanHook1986].

    spacing : mm between lines, wider where that needs over six million lines

    The heights are exact on every line: an offset blank, or a grown mesh, is the union of spheres on the surface, by
    facets, edges and corners.
    """
    box = stock_bounds(mesh.bounds, setup)
    corners = [box, mesh.bounds]
    lower = np.min([c[0, :2] for c in corners], axis=0)
    extent = np.max([c[1, :2] for c in corners], axis=0) - lower
    step = max(spacing, math.sqrt(float(extent.prod()) / MAX_LINES))
    nx, ny = (np.ceil(extent / step).astype(int) + 1).tolist()
    origin = lower - 0.5 * step
    height = np.full((nx, ny), NEVER)
    x, y = origin[0] + (np.arange(nx) + 0.5) * step, origin[1] + (np.arange(ny) + 0.5) * step
    if setup.stock_kind == StockKind.BOX:
        height[np.ix_((x >= box[0, 0]) & (x <= box[1, 0]), (y >= box[0, 1]) & (y <= box[1, 1]))] = box[1, 2]
    elif setup.stock_kind == StockKind.CYLINDER:
        tops = blank_cylinder(mesh.bounds, setup).tops(*np.meshgrid(x, y, indexing="ij"))
        np.copyto(height, tops, where=np.isfinite(tops))
    stages = StageProgress(progress)
    if setup.stock_kind == StockKind.STEP:
        _raise(height, origin, step, blank_mesh(setup), setup.uncertainty, threads, stages.span(0.0, 0.5))
    reach = setup.margin + setup.uncertainty if setup.stock_kind == StockKind.PART_OFFSET else 0.0
    _raise(height, origin, step, mesh, reach, threads, stages.span(0.5, 1.0))
    return StockLines(origin, step, height, float(min(c[0, 2] for c in corners)))


def _raise(height: F64, origin: F64, step: float, mesh: TriangleMesh, reach: float, threads: int,
           progress: Progress | None) -> None:
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = np.unique(edges, axis=0)
    by_height = np.argsort(-mesh.triangles[:, :, 2].max(axis=1), kind="stable")
    faces = np.ascontiguousarray(mesh.faces[by_height])

    def job(i0: int, i1: int) -> Callable[[], object]:
        return lambda: raise_offset(height, i0, i1, origin, step, mesh.vertices, faces, edges, reach)

    cuts = np.linspace(0, len(height), 4 * max(threads, 1) + 1).astype(int)
    run_tiles([job(int(a), int(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True) if b > a], threads, progress)


def run_stock(field: StockLines, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *, threads: int = 2,
              progress: Progress | None = None) -> StockPass:
    """Run all moves through the stock, in place, and collect contacts; lines are cut as in [VanHook1986].

    Returns StockPass. Raises VerificationError as ``cutter_table``. Same bytes for any number of threads.
    """
    run = _run_twice(field, moves, tools, setup, threads, progress)
    run.events[run.events[:, 1] == STUB, 1] = PLUNGE
    return run


def _run_twice(field: StockLines, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, threads: int,
               progress: Progress | None) -> StockPass:
    """One pass over all blocks, and a second over those where the ways in the cut decide over plunges."""
    start = field.height.copy() if descents(moves, tools, setup)[0].any() else field.height
    run, again = _run(field, moves, tools, setup, None, None, threads, StageProgress(progress).span(0.0, 0.8))
    if not again:
        return run
    # feed moves up to the last steep one that cut tell all plunges, with what is known now of the ways in the cut
    last = int(np.flatnonzero(descents(moves, tools, setup)[0] & run.cut)[-1])
    rows = np.flatnonzero(moves.feed[:last + 1])
    chosen = np.isin(np.arange(len(moves)), rows)
    ways = run.ways.in_cut(parts(moves, tools)).only(chosen)
    second, _ = _run(StockLines(field.origin, field.step, start, field.bottom), moves.only(chosen), tools, setup,
                     ways, again, threads, StageProgress(progress).span(0.8, 1.0))
    plunges = second.events[second.events[:, 1] == PLUNGE]
    plunges[:, 0] = rows[plunges[:, 0].astype(np.int64)]
    events = np.concatenate([run.events[run.events[:, 1] != PLUNGE], plunges])
    return replace(run, events=events[np.argsort(events[:, 0], kind="stable")], lost=run.lost + second.lost)


def _run(field: StockLines, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, ways: WaysInCut | None,
         chosen: Sequence[tuple[int, int]] | None, threads: int,
         progress: Progress | None) -> tuple[StockPass, list[tuple[int, int]]]:
    """One pass over the blocks that begin at ``chosen``; None: over all of them, with necks, shanks and holders.

    ways : of the moves, as far as they are known

    Returns the pass, and where the blocks begin in which a descent may be a plunge once the ways are known.
    """
    cutters = cutter_table(tools)
    bodies = Bodies.of(tools, setup) if chosen is None else Bodies.none(tools)
    sizes = bodies.arrays(cutters, end_radii(tools, setup.tap_holes))
    allowed = DescentArrays(*descents(moves, tools, setup, ways), ways_before(moves),
                            setup.plunge_skin * np.array([t.diameter for t in tools]), hollow_ends(tools, setup))
    cut, under = np.zeros(len(moves), np.uint8), np.zeros(len(moves), np.uint8)
    limits, rapids = contact_limits(setup), rapid_arrays(moves, setup)
    lines, steps = LineArrays(field.height, field.origin, field.step, field.bottom), moves.arrays
    nx, ny = field.height.shape
    first = parts(moves, tools)
    tables, spare = tables_for(threads, (int(first[-1]),))
    sums, free_sums = tables_for(threads, (int(first[-1]), 2))
    blocks = [(i, j) for i in range(0, nx, BLOCK) for j in range(0, ny, BLOCK)] if chosen is None else list(chosen)
    undecided = np.zeros(len(blocks), np.uint8)

    def job(k: int, i: int, j: int) -> Callable[[], object]:
        def work() -> object:
            events, engaged, taken = event_table(), spare.get(), free_sums.get()
            n = stock_tile((i, min(i + BLOCK, nx), j, min(j + BLOCK, ny)), lines, steps, rapids, allowed, sizes, limits,
                           cut, under, EngagedArrays(first, engaged), CutTotals(taken, undecided[k:k + 1]), events)
            spare.put(engaged)
            free_sums.put(taken)
            return noted(events), n
        return work

    events, lost = gather(run_tiles([job(k, *b) for k, b in enumerate(blocks)], threads, progress))
    run = StockPass(events, lost, cut.astype(bool), np.bitwise_or.reduce(tables), ways_of(sums), under.astype(bool))
    return run, [b for b, is_open in zip(blocks, undecided.tolist(), strict=True) if is_open]


def run_bodies(points: F64, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *, threads: int = 2,
               progress: Progress | None = None) -> tuple[F64, int]:
    """Contacts of necks, shanks and holders of all feed moves with points of the part.

    points : (n, 3) float64, mm, setup frame

    Returns the events, (e, 7) float64, mm, sorted by move, and the number of events lost because a table is full.
    """
    if len(points) == 0 or len(moves) == 0:
        return np.zeros((0, 7)), 0
    grid = CellGrid.build(points)
    pts, bodies = np.ascontiguousarray(points[grid.order]), Bodies.of(tools, setup)
    radii, cells, steps = np.array([t.widest_radius for t in tools]), grid.arrays, moves.arrays

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        def work() -> object:
            events = event_table()
            n = body_tile(tile, cells, pts, steps, radii, bodies.rows, bodies.first, BESIDE, events)
            return noted(events), n
        return work

    return gather(run_tiles([job(t) for t in grid.tiles()], threads, progress))
