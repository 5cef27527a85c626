"""Material left on the outward normal of every surface sample after all feed moves.

The residual of a sample is the least distance along its normal at which any move's swept cutting part
begins, counted only if that part comes from outside (its interval on the ray ends at or beyond the
surface: a tool behind a thin wall does not count). Negative is a gouge. Closed forms for ball and flat
ends, Newton to 1e-9 mm for a torus corner; nothing is rasterised, so the error does not depend on a grid. A tool that
leans is the same in its own frame; one that turns is so on short pieces of the move (``verify.kernels.pose``).
"""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import VerificationError
from geometry.mesh import F64, I32
from geometry.toolbody import ToolBody
from verify.kernels.rays import cut_tile
from verify.kernels.turned import cut_chunk
from verify.pointtree import PointTree
from verify.toolaxes import ToolAxes

Progress = Callable[[float], None]
MAX_CELLS = 4_000_000
TILES = 12
PULSE = 0.1
BOW = 5e-4
"""mm, how far a turning tool may be from where the pieces of its moves take it to be."""


@dataclass(frozen=True, eq=False)
class Moves:
    """Straight moves of the tool tip in the setup frame, in program order.

    start, end : (m, 3) float64, mm
    feed       : (m,) bool, False for a rapid
    tool       : (m,) int32, row in the sequence of tools the moves belong to
    axes       : of the tool, None where all are +Z
    """

    start: F64
    end: F64
    feed: NDArray[np.bool_]
    tool: I32
    axes: ToolAxes | None = None

    def __len__(self) -> int:
        return len(self.start)

    def only(self, chosen: NDArray[np.bool_]) -> Moves:
        """The moves where ``chosen`` (m,) bool is true."""
        axes = None if self.axes is None else self.axes.only(chosen)
        return Moves(self.start[chosen], self.end[chosen], self.feed[chosen], self.tool[chosen], axes)


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Samples sorted into the cells of a 3-D grid.

    order : (n,) int64, sample numbers sorted by cell; first : (cells + 1,) int64 start of each cell in it
    """

    origin: F64
    size: float
    shape: NDArray[np.int64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]

    @classmethod
    def build(cls, points: F64, size: float = 0.35) -> CellGrid:
        """Sort (n, 3) points in mm into cells of about ``size`` mm, coarser where that needs over 4 M cells."""
        lower, upper = points.min(axis=0), points.max(axis=0)
        extent = np.maximum(upper - lower, 1e-6)
        size = max(size, float(np.cbrt(extent.prod() / MAX_CELLS)))
        while (shape := np.floor(extent / size).astype(np.int64) + 1).prod() > MAX_CELLS:
            size *= 1.2
        index = np.minimum(np.floor((points - lower) / size).astype(np.int64), shape - 1)
        key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
        order = np.argsort(key, kind="stable")
        first = np.searchsorted(key[order], np.arange(int(shape.prod()) + 1)).astype(np.int64)
        return cls(lower, size, shape, order, first)

    def tiles(self, across: int = TILES) -> list[tuple[int, int, int, int]]:
        """Blocks (x0, x1, y0, y1) of cell columns that hold samples, about ``across`` squared of them."""
        nx, ny = int(self.shape[0]), int(self.shape[1])
        step = max(4, -(-max(nx, ny) // across))
        counts = np.diff(self.first).reshape(self.shape).sum(axis=2)
        blocks = [(x, min(x + step, nx), y, min(y + step, ny)) for x in range(0, nx, step) for y in range(0, ny, step)]
        return [b for b in blocks if counts[b[0]:b[1], b[2]:b[3]].any()]


def cutter_table(tools: Sequence[ToolBody]) -> F64:
    """(k, 3) float64, mm: radius, corner radius and flute length of each tool.

    Raises VerificationError where the flutes end below the corner of the cutting part.
    """
    for tool in tools:
        least = 2.0 * tool.corner_radius if tool.kind == "bull" else tool.corner_radius
        if tool.flute_length < least:
            raise VerificationError(
                f"{tool.id}: flute length {tool.flute_length} mm ends inside the corner of the cutting part",
                code="flute_too_short", subjects=(tool.id,), measured=tool.flute_length, limit=least,
                remedy="give the flute length from the tip")
    return np.array([[t.radius, min(t.corner_radius, t.radius), t.flute_length] for t in tools]).reshape(-1, 3)


def run_tiles(jobs: Sequence[Callable[[], object]], threads: int, progress: Progress | None = None) -> list[object]:
    """Run independent jobs on ``threads`` threads and return their results in order.

    progress receives the share done after each job, and again every ``PULSE`` s while one takes longer. An exception
    it raises (a cancelled job) ends the run at once: jobs that wait are dropped, those that run are not waited for.
    """
    ended: queue.SimpleQueue[Future[object]] = queue.SimpleQueue()
    pool = ThreadPoolExecutor(max(1, threads))
    pending = [pool.submit(job) for job in jobs]
    for future in pending:
        future.add_done_callback(ended.put)
    try:
        done = 0
        while done < len(pending):
            try:
                ended.get(timeout=PULSE).result()
                done += 1
            except queue.Empty:
                pass
            if progress is not None:
                progress(done / len(pending))
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()
    return [future.result() for future in pending]


def residual_on_normals(points: F64, normals: F64, initial: F64, moves: Moves, tools: Sequence[ToolBody],
                        *, threads: int = 2, progress: Progress | None = None, bow: float = BOW) -> tuple[F64, I32]:
    """Remaining material along each normal after all feed moves.

    points, normals : (n, 3) float64, mm and unit, setup frame, normals out of the material
    initial         : (n,) float64, mm of stock on each normal before the first move
    moves           : Moves; tools : the tools their ``tool`` column refers to
    threads         : the result has the same bytes for any number
    bow             : mm, error allowed where the tool turns

    Returns
    -------
    (n,) float64 residual in mm, negative where the part is gouged, and (n,) int32 the move that left it
    (the first of equals; -1 where no move lowered the stock).

    Raises
    ------
    VerificationError
        A cutting part whose flutes end inside its corner.

    Notes
    -----
    Error below 1e-8 mm for coordinates under 1 m: roots of quadratics, and Newton stopped at 1e-9 mm. Where the tool
    turns, the surface it sweeps is off by ``bow`` at most.
    """
    n = len(points)
    residual, mover = np.array(initial, dtype=np.float64), np.full(n, -1, np.int32)
    if n == 0 or len(moves) == 0:
        return residual, mover
    if moves.axes is not None:
        return _turned(points, normals, residual, moves, moves.axes, tools, threads, progress, bow)
    grid = CellGrid.build(points)
    pts, nrm = np.ascontiguousarray(points[grid.order]), np.ascontiguousarray(normals[grid.order])
    work, who = residual[grid.order], np.full(n, -1, np.int32)
    counts = np.diff(grid.first)
    left = np.zeros(len(counts))
    full = np.flatnonzero(counts)
    left[full] = np.maximum(np.maximum.reduceat(work, grid.first[full]), 0.0)
    cutters = cutter_table(tools)
    start, end = np.ascontiguousarray(moves.start), np.ascontiguousarray(moves.end)

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        return lambda: cut_tile(*tile, grid.origin, grid.size, grid.shape, grid.first, pts, nrm, work, who, left,
                                start, end, moves.feed, moves.tool, cutters)

    run_tiles([job(t) for t in grid.tiles()], threads, progress)
    residual[grid.order], mover[grid.order] = work, who
    return residual, mover


def _turned(points: F64, normals: F64, residual: F64, moves: Moves, axes: ToolAxes, tools: Sequence[ToolBody],
            threads: int, progress: Progress | None, bow: float) -> tuple[F64, I32]:
    """``residual_on_normals`` for tools that lean or turn."""
    tree = PointTree.build(points)
    pts, nrm = np.ascontiguousarray(points[tree.order]), np.ascontiguousarray(normals[tree.order])
    work, who = residual[tree.order], np.full(len(points), -1, np.int32)
    cutters = cutter_table(tools)
    reach = np.hypot(cutters[:, 0], cutters[:, 2])
    start, end = np.ascontiguousarray(moves.start), np.ascontiguousarray(moves.end)

    def job(chunk: int) -> Callable[[], object]:
        return lambda: cut_chunk(chunk, *tree.balls, pts, nrm, work, who, start, end, axes.axis, axes.about,
                                 axes.angle, moves.feed, moves.tool, cutters, reach, bow)

    run_tiles([job(c) for c in range(tree.chunks)], threads, progress)
    mover = np.empty(len(points), np.int32)
    residual[tree.order], mover[tree.order] = work, who
    return residual, mover
