"""Material left on the outward normal of every surface sample after all feed moves.

The method is that of vectors that moves shorten [Chappel1983], here without facets. The residual of a sample is the
smallest distance along its normal at which the swept cutting part of any move begins. It counts only if that part comes
from outside: its interval on the ray ends at or beyond the surface, so a tool behind a thin wall does not count. A
negative residual is a gouge. Ball and flat ends have closed forms, a torus corner Newton to 1e-9 mm; there is no grid,
so the error does not depend on one. A tilted tool is treated in its own frame, a turning one on short pieces of the
move (``verify.kernels.pose``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from geometry.mesh import F64, I32
from geometry.tool_body import ToolBody
from verify.kernels.rays import SampleArrays, cut_tile
from verify.kernels.turned import cut_chunk
from verify.material.point_tree import PointTree
from verify.material.tiles import CellGrid, run_tiles
from verify.moves import BOW, Moves, Progress, cutter_table
from verify.tool_axes import ToolAxes


def residual_on_normals(points: F64, normals: F64, initial: F64, moves: Moves, tools: Sequence[ToolBody],
                        *, threads: int = 2, progress: Progress | None = None, bow: float = BOW) -> tuple[F64, I32]:
    """Remaining material along each normal after all feed moves [Chappel1983].

    points, normals : (n, 3) float64, mm and unit, setup frame, normals out of the material
    initial         : (n,) float64, mm of stock on each normal before the first move
    moves           : Moves; tools : the tools their ``tool`` column refers to
    threads         : the result has the same bytes for any number
    bow             : mm, error allowed where the tool turns

    Returns
    -------
    (n,) float64, mm, the residual, negative where the part is gouged, and (n,) int32, index, the move that left it
    (the first of equals; -1 where no move lowered the stock).

    Raises
    ------
    SetupError
        A cutting part whose flutes end inside its corner.

    Notes
    -----
    Error below 1e-8 mm for coordinates under 1 m: roots of quadratics, and Newton stopped at 1e-9 mm. Where the tool
    turns, the surface it sweeps is off by ``bow`` at most.
    """
    residual, mover = np.array(initial, dtype=np.float64), np.full(len(points), -1, np.int32)
    _cut(points, normals, residual, mover, moves, tools, threads, progress, bow, once=False)
    return residual, mover


def first_below(points: F64, normals: F64, level: F64, moves: Moves, tools: Sequence[ToolBody], *, threads: int = 2,
                progress: Progress | None = None) -> I32:
    """The first feed move that leaves less than ``level`` on each normal.

    points, normals : (n, 3) float64, mm and unit, setup frame, normals out of the material
    level           : (n,) float64, mm
    moves, tools, threads, progress : as in ``residual_on_normals``

    Returns (n,) int32, index, -1 where no move does.
    """
    residual, mover = np.array(level, dtype=np.float64), np.full(len(points), -1, np.int32)
    _cut(points, normals, residual, mover, moves, tools, threads, progress, BOW, once=True)
    return mover


def _cut(points: F64, normals: F64, residual: F64, mover: I32, moves: Moves, tools: Sequence[ToolBody], threads: int,
         progress: Progress | None, bow: float, *, once: bool) -> None:
    """Change ``residual`` and ``mover`` (n,) by all feed moves, or by the first that cuts each ray (``once``)."""
    if len(points) == 0 or len(moves) == 0:
        return
    if moves.axes is not None:
        _turned(points, normals, residual, mover, moves, moves.axes, tools, threads, progress, bow, once=once)
        return
    grid = CellGrid.build(points)
    pts, nrm = np.ascontiguousarray(points[grid.order]), np.ascontiguousarray(normals[grid.order])
    work, mover_of = residual[grid.order], np.full(len(points), -1, np.int32)
    counts = np.diff(grid.first)
    left = np.zeros(len(counts))
    full = np.flatnonzero(counts)
    left[full] = np.maximum(np.maximum.reduceat(work, grid.first[full]), 0.0)
    cutters, samples = cutter_table(tools), SampleArrays(pts, nrm, work, mover_of)
    cells, steps = grid.arrays, moves.arrays

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        return lambda: cut_tile(tile, cells, samples, left, steps, cutters, once)

    run_tiles([job(t) for t in grid.tiles()], threads, progress)
    residual[grid.order], mover[grid.order] = work, mover_of


def _turned(points: F64, normals: F64, residual: F64, mover: I32, moves: Moves, axes: ToolAxes,
            tools: Sequence[ToolBody], threads: int, progress: Progress | None, bow: float, *, once: bool) -> None:
    """``_cut`` for tools that tilt or turn."""
    tree = PointTree.build(points)
    pts, nrm = np.ascontiguousarray(points[tree.order]), np.ascontiguousarray(normals[tree.order])
    work, mover_of = residual[tree.order], np.full(len(points), -1, np.int32)
    cutters = cutter_table(tools)
    reach = np.hypot(cutters[:, 0], cutters[:, 2])
    samples, steps, turns = SampleArrays(pts, nrm, work, mover_of), moves.arrays, axes.arrays(bow)

    def job(chunk: int) -> Callable[[], object]:
        return lambda: cut_chunk(chunk, tree.balls, samples, steps, turns, cutters, reach, once)

    run_tiles([job(c) for c in range(tree.chunks)], threads, progress)
    residual[tree.order], mover[tree.order] = work, mover_of
