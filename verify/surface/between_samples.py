"""What moves leave or cut between samples that stand wide apart, on flat places of the part.

A sample with ``covers`` > 0 stands for the flat place within that distance. Each such place is settled whole, or gets
close points (docs/theory/sampling.md):

- *Stock*: the cutting part of a straight move sweeps a convex body. If it takes the stock down to the limit on the rays
  at the four corners of a square, it does so on every ray between them.
- *Gouges*: a move whose cutting part nowhere reaches below the plane by more than the tolerance, or that passes the
  place at a distance, cuts nothing too deep there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from verify.kernels.patches import DEEP, WHOLE, PlaceArrays, judge_tile
from verify.material.tiles import CellGrid, run_tiles
from verify.model import ProofSetup, StockKind
from verify.moves import Moves, cutter_table
from verify.progress import Report, silent
from verify.surface.guard_points import CLOSER_SHARE
from verify.surface.sample_scores import RAY_ERROR

CLOSE = 0.1  # mm between close points
HALF = 0.5  # of the limit: where a straight-sided blank leaves no more above a sample, it leaves no more than the limit


@dataclass(frozen=True, eq=False)
class ClosePoints:
    """Points of flat places that no single move settles.

    points, normals : (n, 3) float64, mm and unit, setup frame
    row             : (n,) int64, index, sample that stands for the place
    area            : mm² that each point stands for
    """

    points: F64
    normals: F64
    row: NDArray[np.int64]
    area: F64


def close_points(samples: SurfaceSamples, initial: F64, residual: F64, moves: Moves, tools: Sequence[ToolBody],
                 setup: ProofSetup, threads: int = 2, report: Report = silent) -> ClosePoints:
    """Points ``CLOSE`` mm apart on the flat places that are not settled whole.

    samples  : SurfaceSamples, setup frame
    initial, residual : (n,) float64, mm of stock on each normal before and after all moves
    report   : called with the share done, 0 to 1; an exception from it ends the work

    Notes
    -----
    Error below 1e-6 mm: the moves are straight, and rays are exact. Where a tool leans, every place gets close points.
    A place whose sample has stock over the limit gets none for that reason, since it is known to be uncut.
    """
    wide = np.flatnonzero(samples.covers > 0) if samples.covers is not None else np.zeros(0, np.int64)
    if not len(wide) or samples.covers is None:
        return ClosePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0))
    limit = setup.stock_allowance + setup.scallop_height + RAY_ERROR
    half = samples.covers[wide]
    state = _judged(samples.points[wide], samples.normals[wide], half, limit, CLOSER_SHARE * setup.gouge_tolerance,
                    moves, tools, threads, report)
    blank = setup.stock_kind in (StockKind.BOX, StockKind.PART_OFFSET)
    whole = (state & WHOLE > 0) | (blank & (initial[wide] <= HALF * limit)) | (residual[wide] > limit)
    return _close(samples, wide[~whole | (state & DEEP > 0)])


def _judged(points: F64, normals: F64, half: F64, limit: float, deep: float, moves: Moves, tools: Sequence[ToolBody],
            threads: int, report: Report) -> NDArray[np.uint8]:
    """WHOLE and DEEP of places (n, 3), mm, of half side ``half`` (n,) mm."""
    if moves.axes is not None or not len(moves):
        return np.full(len(points), 0 if not len(moves) else DEEP, np.uint8)
    grid = CellGrid.build(points, 1.0)
    order = grid.order
    pts, nrm, e = (np.ascontiguousarray(x[order]) for x in (points, normals, half))
    u, v = _sides(nrm)
    state, cutters = np.zeros(len(points), np.uint8), cutter_table(tools)
    cells, steps, places = grid.arrays, moves.arrays, PlaceArrays(pts, nrm, u, v, e, state)

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        return lambda: judge_tile(tile, cells, places, limit, deep, steps, cutters)

    run_tiles([job(t) for t in grid.tiles()], threads, report)
    out = np.empty_like(state)
    out[order] = state
    return out


def _sides(normals: F64) -> tuple[F64, F64]:
    """Two unit vectors (n, 3) square to each normal and to each other."""
    u = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = u - np.einsum("ij,ij->i", u, normals)[:, None] * normals
    u /= np.linalg.norm(u, axis=1)[:, None]
    return np.ascontiguousarray(u), np.ascontiguousarray(np.cross(normals, u))


def _close(samples: SurfaceSamples, rows: NDArray[np.int64]) -> ClosePoints:
    covers = np.zeros(0) if samples.covers is None else samples.covers[rows]
    u, v = _sides(samples.normals[rows])
    count = np.maximum(np.ceil(2.0 * covers / CLOSE - 1e-9), 1).astype(np.int64)
    of = np.repeat(np.arange(len(rows)), count**2)
    nth = np.arange(len(of)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    n = count[of]
    a, b = ((k + 0.5) / n * 2.0 - 1.0 for k in (nth // n, nth % n))
    points = samples.points[rows[of]] + (covers[of] * a)[:, None] * u[of] + (covers[of] * b)[:, None] * v[of]
    return ClosePoints(points, samples.normals[rows[of]], rows[of], samples.area[rows[of]] / n**2)


__all__ = ["ClosePoints", "close_points"]
