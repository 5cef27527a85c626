"""Cells of samples, processed tile by tile by several threads."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.binning import by_cell, limits_of
from geometry.mesh import F64
from verify.kernels.rays import CellArrays
from verify.moves import Progress

MAX_CELLS = 4_000_000
TILES = 12
PULSE = 0.1


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Samples sorted into the cells of a 3-D grid.

    origin : (3,) float64, mm, lower corner; size : mm, of a cell; shape : (3,) int64, count of cells
    order  : (n,) int64, index, sample numbers sorted by cell
    first  : (cells + 1,) int64, index, start of each cell in ``order``
    """

    origin: F64
    size: float
    shape: NDArray[np.int64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]

    @classmethod
    def build(cls, points: F64, size: float = 0.35) -> CellGrid:
        """Sort points into cells of about ``size`` mm, coarser where that needs over 4 million cells.

        points : (n, 3) float64, setup frame, mm
        """
        lower, upper = limits_of(points)
        extent = np.maximum(upper - lower, 1e-6)
        size = max(size, float(np.cbrt(extent.prod() / MAX_CELLS)))
        while (shape := np.floor(extent / size).astype(np.int64) + 1).prod() > MAX_CELLS:
            size *= 1.2
        index = np.minimum(np.floor((points - lower) / size).astype(np.int64), shape - 1)
        key = (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2]
        order, first = by_cell(key, int(shape.prod()))
        return cls(lower, size, shape, order, first)

    @property
    def arrays(self) -> CellArrays:
        """The cells for kernels, which take the samples in the order of the cells."""
        return CellArrays(self.origin, self.size, self.shape, self.first)

    def tiles(self, across: int = TILES) -> list[tuple[int, int, int, int]]:
        """Blocks (x0, x1, y0, y1) of cell columns that hold samples, about ``across`` squared of them."""
        nx, ny = int(self.shape[0]), int(self.shape[1])
        step = max(4, -(-max(nx, ny) // across))
        counts = np.diff(self.first).reshape(self.shape).sum(axis=2)
        blocks = [(x, min(x + step, nx), y, min(y + step, ny)) for x in range(0, nx, step) for y in range(0, ny, step)]
        return [b for b in blocks if counts[b[0]:b[1], b[2]:b[3]].any()]


def run_tiles(jobs: Sequence[Callable[[], object]], threads: int, progress: Progress | None = None) -> list[object]:
    """Run independent jobs on ``threads`` threads and return their results in order.

    progress : called with the share done after each job, and every ``PULSE`` s during longer ones. An exception from it
               (a cancelled job) ends the run at once: waiting jobs are dropped, and running jobs are not awaited.
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
