"""What moves leave or cut between samples that stand wide apart, on flat places of the part.

A sample with ``covers`` > 0 stands for the flat place within that distance. Each such place is settled whole, or gets
close points (docs/theory/sampling.md):

- *Stock*: the cutting part of a straight move sweeps a convex body. If it takes the stock down to a height on the rays
  at the four corners of a square, it does so on every ray between them. If no move reaches below that height, none of
  the stock below it is gone.
- *Gouges*: a move whose cutting part nowhere reaches below the plane by more than the tolerance, or that passes the
  place at a distance, cuts nothing too deep there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples, joined, split_cells
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_on_normals
from verify.kernels.surface.patches import PlaceArrays, judge_tile
from verify.material.tiles import CellGrid, run_tiles
from verify.model import ProofSetup, StockKind
from verify.moves import Moves, cutter_table
from verify.progress import Report, silent
from verify.surface.guard_points import CLOSER_SHARE
from verify.surface.removal import residual_on_normals
from verify.surface.sample_scores import RAY_ERROR

CLOSE = 0.1  # mm between close points
SAME_HEIGHT = 0.005  # mm: a place with stock is settled where its height differs from that of its sample by no more
CONVEX = (StockKind.BOX, StockKind.PART_OFFSET, StockKind.CYLINDER)  # blanks whose height on a plane is concave
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ClosePoints:
    """Points of flat places that no single move settles.

    points, normals : (n, 3) float64, mm and unit, setup frame
    row             : (n,) int64, index, sample that stands for the place
    area            : mm² that each point stands for
    """

    points: F64
    normals: F64
    row: INT
    area: F64


@dataclass(frozen=True, eq=False)
class Places:
    """The n flat places of samples, and what the moves do there.

    row     : (n,) int64, index, the sample of each
    settled : (n,) bool: within the budget everywhere, or above it by the height of the sample +- ``SAME_HEIGHT``
    suspect : (n,) bool: some move that passes the place reaches too deep below its plane, or into the allowance
    pits    : (k, 3) float64, mm, the deepest points of such moves over their place; at most one in each
    pit_row : (k,) int64, index, the sample of each
    """

    row: INT
    settled: BOOL
    suspect: BOOL
    pits: F64
    pit_row: INT


def judged_places(samples: SurfaceSamples, residual: F64, bounds: F64, moves: Moves, tools: Sequence[ToolBody],
                  setup: ProofSetup, reach: float, threads: int = 2, report: Report = silent) -> Places:
    """What the moves do on the flat places of samples.

    samples  : SurfaceSamples, setup frame
    residual : (n,) float64, mm of stock on each normal after all moves, not above ``reach``
    bounds   : (2, 3) float64, mm, of the part, setup frame
    report   : called with the share done, 0 to 1; an exception from it ends the work

    Notes
    -----
    Error below 1e-6 mm: the moves are straight, and rays are exact. Where a tool leans, no place is settled.
    """
    rows = np.flatnonzero(samples.covers > 0) if samples.covers is not None else np.zeros(0, np.int64)
    if not len(rows) or samples.covers is None:
        return Places(rows, np.zeros(0, np.bool_), np.zeros(0, np.bool_), np.zeros((0, 3)), rows)
    if moves.axes is not None:
        all_ = np.ones(len(rows), np.bool_)
        return Places(rows, ~all_, all_, np.zeros((0, 3)), np.zeros(0, np.int64))
    points, normals, half, left = samples.points[rows], samples.normals[rows], samples.covers[rows], residual[rows]
    budget = setup.stock_allowance + setup.scallop_height + RAY_ERROR
    high = left > budget
    u, v = _sides(normals)
    state = _worked(points, normals, u, v, half, np.where(high, left + SAME_HEIGHT, budget), moves, tools, threads,
                    report)
    low, most = _first_stock(points, normals, u, v, half, bounds, setup, reach)
    enough = state.whole | (most <= np.where(high, left + SAME_HEIGHT, budget))
    stands = np.minimum(low, -state.depth) >= np.maximum(left - SAME_HEIGHT, budget)
    deep = CLOSER_SHARE * setup.gouge_tolerance - setup.stock_allowance
    suspect = state.depth > deep
    pit = np.flatnonzero(state.inside > deep)
    pits = points[pit] + state.foot[pit, :1] * u[pit] + state.foot[pit, 1:] * v[pit]
    return Places(rows, enough & (~high | stands), suspect, pits, rows[pit])


def close_points(samples: SurfaceSamples, residual: F64, places: Places, setup: ProofSetup) -> ClosePoints:
    """Points ``CLOSE`` mm apart on the places that are not settled, and the deepest points of moves there.

    samples  : SurfaceSamples, n of them, setup frame
    residual : (n,) float64, mm of stock on each normal after all moves
    places   : of ``judged_places``

    A place that is no more than known to be uncut gets none, since its sample says so.
    """
    if samples.covers is None:
        return ClosePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0))
    within = residual[places.row] <= setup.stock_allowance + setup.scallop_height + RAY_ERROR
    grid = _close(samples, places.row[(within & ~places.settled) | places.suspect])
    return ClosePoints(np.concatenate([grid.points, places.pits]),
                       np.concatenate([grid.normals, samples.normals[places.pit_row]]),
                       np.concatenate([grid.row, places.pit_row]),
                       np.concatenate([grid.area, np.zeros(len(places.pit_row))]))


def settled_samples(samples: SurfaceSamples, bounds: F64, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
                    reach: float, threads: int = 2, report: Report = silent) -> SurfaceSamples:
    """The samples with close ones in each place that is not settled whole.

    samples : SurfaceSamples, setup frame, whose coarse ones are of ``geometry.sampling.graded_samples`` in that frame
    bounds  : (2, 3) float64, mm, setup frame, of the part
    moves, tools, setup, threads : as in ``judged_places``
    reach   : float, mm, height up to which stock is followed
    report  : called with the share done, 0 to 1; an exception from it ends the work

    Each sample of the result stands for its own place: within the budget or not, it is so everywhere there, and its
    residual holds there to ``SAME_HEIGHT``, or to the distance of close samples. None is suspect of a gouge.
    The deepest point of each move too deep over a coarse place is among the samples, with no area.
    """
    if samples.covers is None or not (samples.covers > 0).any():
        return samples
    wide = np.flatnonzero(samples.covers > 0)
    few = samples.subset(wide)
    first = stock_on_normals(few.points, few.normals, bounds, setup, reach)
    left, _ = residual_on_normals(few.points, few.normals, first, moves, tools, threads=threads,
                                  progress=lambda f: report(0.3 * f))
    places = judged_places(few, left, bounds, moves, tools, setup, reach, threads, lambda f: report(0.3 + 0.7 * f))
    split = ~places.settled | places.suspect
    stays = np.ones(len(samples), np.bool_)
    stays[wide[split]] = False
    sets, unsettled = [samples.subset(np.flatnonzero(stays))], few.subset(np.flatnonzero(split))
    for covers in np.unique(few.covers[split] if few.covers is not None else []).tolist():
        parts = 2 * round((covers * np.sqrt(2.0) / CLOSE - 1.0) / 2.0) + 1
        assert unsettled.covers is not None
        sets.append(split_cells(unsettled.subset(np.flatnonzero(unsettled.covers == covers)), parts)[0])
    pits = few.subset(places.pit_row)
    none = np.zeros(len(pits))
    sets.append(replace(pits, points=places.pits, area=none, covers=none))
    return replace(joined(sets), covers=None)


@dataclass(frozen=True, eq=False)
class _Worked:
    """``PlaceArrays.whole``, ``depth``, ``inside`` and ``foot`` of places, in their own order."""

    whole: BOOL
    depth: F64
    inside: F64
    foot: F64


def _worked(points: F64, normals: F64, u: F64, v: F64, half: F64, limit: F64, moves: Moves, tools: Sequence[ToolBody],
            threads: int, report: Report) -> _Worked:
    """What the moves do on places (n, 3), mm, of half side ``half`` (n,) mm."""
    n = len(points)
    grid = CellGrid.build(points, 1.0)
    sort = grid.order
    at, out, one, other, size, most = (np.ascontiguousarray(x[sort]) for x in (points, normals, u, v, half, limit))
    made = _Worked(np.zeros(n, np.bool_), np.full(n, -np.inf), np.full(n, -np.inf), np.zeros((n, 2)))
    if not len(moves):
        return made
    places = PlaceArrays(at, out, one, other, size, most, made.whole, made.depth, made.inside, made.foot)
    cells, steps, cutters = grid.arrays, moves.arrays, cutter_table(tools)

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        return lambda: judge_tile(tile, cells, places, steps, cutters)

    run_tiles([job(t) for t in grid.tiles()], threads, report)
    back = np.empty(n, np.int64)
    back[sort] = np.arange(n)
    return _Worked(made.whole[back], made.depth[back], made.inside[back], made.foot[back])


def _first_stock(points: F64, normals: F64, u: F64, v: F64, half: F64, bounds: F64, setup: ProofSetup,
                 reach: float) -> tuple[F64, F64]:
    """The least and the greatest stock of the blank over each place, (n,) mm each; 0 and inf where it is not known.

    The height f of a convex blank on parallel rays is concave: least at a corner of the square, and nowhere above
    2 f(middle) - least, since f(x) + f(-x) <= 2 f(middle) for places opposite one another.
    """
    n = len(points)
    if setup.stock_kind not in CONVEX:
        return np.zeros(n), np.full(n, np.inf)
    at = [stock_on_normals(points + (half * e)[:, None] * u + (half * f)[:, None] * v, normals, bounds, setup, reach)
          for e in (-1.0, 1.0) for f in (-1.0, 1.0)]
    middle = stock_on_normals(points, normals, bounds, setup, reach)
    low = np.min(at, axis=0)
    return np.minimum(low, middle), 2.0 * middle - low


def _sides(normals: F64) -> tuple[F64, F64]:
    """Two unit vectors (n, 3) square to each normal and to each other."""
    u = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = u - np.einsum("ij,ij->i", u, normals)[:, None] * normals
    u /= np.linalg.norm(u, axis=1)[:, None]
    return np.ascontiguousarray(u), np.ascontiguousarray(np.cross(normals, u))


def _close(samples: SurfaceSamples, rows: INT) -> ClosePoints:
    covers = np.zeros(0) if samples.covers is None else samples.covers[rows]
    u, v = _sides(samples.normals[rows])
    count = np.maximum(np.ceil(2.0 * covers / CLOSE - 1e-9), 1).astype(np.int64)
    of = np.repeat(np.arange(len(rows)), count**2)
    nth = np.arange(len(of)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    n = count[of]
    a, b = ((k + 0.5) / n * 2.0 - 1.0 for k in (nth // n, nth % n))
    points = samples.points[rows[of]] + (covers[of] * a)[:, None] * u[of] + (covers[of] * b)[:, None] * v[of]
    return ClosePoints(points, samples.normals[rows[of]], rows[of], samples.area[rows[of]] / n**2)


__all__ = ["ClosePoints", "Places", "close_points", "judged_places", "settled_samples"]
