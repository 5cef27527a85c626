"""Necks, shanks and holders that lean or turn against the part itself and the fixtures (exact, without a grid)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from verify.kernels.clash import clash_chunk
from verify.model import ProofSetup
from verify.pointtree import PointTree
from verify.removal import BOW, Moves, Progress, cutter_table, run_tiles
from verify.stock import EVENTS, Bodies, gather
from verify.toolaxes import ToolAxes

FIXTURE_SPACING = 0.25
MOST_FIXTURE_POINTS = 400_000


def fixture_points(fixtures: Sequence[F64], floor: float) -> F64:
    """Points on the faces of boxes, at most 0.25 mm apart (wider where that would take over 400 000 of them).

    fixtures : boxes as (2, 3) float64 corners, mm; each stands down to ``floor`` mm, or lower where it begins lower

    Returns (n, 3) float64, mm: tops and sides, edges and corners included; undersides stand on the table.
    """
    boxes = [np.array([[*f[0, :2], min(f[0, 2], floor)], f[1]], dtype=np.float64) for f in fixtures]
    area = sum(float(w * d + 2 * h * (w + d)) for w, d, h in (b[1] - b[0] for b in boxes))
    spacing = max(FIXTURE_SPACING, (area / MOST_FIXTURE_POINTS) ** 0.5)
    out = [np.zeros((0, 3))]
    for low, high in boxes:
        x, y, z = (np.linspace(a, b, max(2, int(np.ceil((b - a) / spacing)) + 1))
                   for a, b in zip(low.tolist(), high.tolist(), strict=True))
        out.append(_sheet(x, y, high[2:]))
        out.extend(_sheet(x, np.array([v]), z) for v in (low[1], high[1]))
        out.extend(_sheet(np.array([v]), y, z) for v in (low[0], high[0]))
    return np.concatenate(out)


def _sheet(x: F64, y: F64, z: F64) -> F64:
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), -1).reshape(-1, 3)


def run_clashes(points: F64, fixed: NDArray[np.bool_], moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *,
                threads: int = 2, progress: Progress | None = None, bow: float = BOW) -> tuple[F64, int]:
    """Bodies of all moves, and in rapids the cutting part, against (n, 3) float64 points, mm.

    fixed : (n,) bool, points of fixtures, which the cutting part must not touch either

    Returns the events (e, 7) sorted by move and the number beyond the table.
    """
    if len(points) == 0 or len(moves) == 0:
        return np.zeros((0, 7)), 0
    tree, axes = PointTree.build(points), moves.axes or ToolAxes.upright(len(moves))
    pts, held = np.ascontiguousarray(points[tree.order]), np.ascontiguousarray(fixed[tree.order])
    cutters, bodies = cutter_table(tools), Bodies.of(tools, setup)
    reach = bodies.reach(cutters)
    start, end = np.ascontiguousarray(moves.start), np.ascontiguousarray(moves.end)

    def job(chunk: int) -> Callable[[], object]:
        def work() -> object:
            events = np.empty((EVENTS, 7))
            n = clash_chunk(chunk, *tree.balls, pts, held, start, end, axes.axis, axes.about, axes.angle, moves.feed,
                            moves.tool, cutters, bodies.rows, bodies.first, reach, setup.clearance_rapid,
                            setup.gouge_tolerance, bow, events)
            return events[:min(n, EVENTS)].copy(), n
        return work

    return gather(run_tiles([job(c) for c in range(tree.chunks)], threads, progress))
