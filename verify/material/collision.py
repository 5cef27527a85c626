"""Collisions of tilted or turning necks, shanks and holders with part and fixtures, exact and without a grid.

Points are float64, mm, in the setup frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.clash import PointArrays, clash_chunk
from verify.kernels.tables import RapidArrays
from verify.material.point_tree import PointTree
from verify.material.stock_pass import contact_limits, end_radii, event_table, gather, noted, rapid_arrays
from verify.material.tiles import run_tiles
from verify.model import ProofSetup
from verify.moves import BOW, Moves, Progress, cutter_table
from verify.tool_axes import ToolAxes
from verify.tool_bodies import Bodies

FIXTURE_SPACING = 0.25  # mm, largest distance of the points of a fixture
DIP = 0.005  # mm, largest unseen penetration of a ball between the points of a fixture
MAX_FIXTURE_POINTS = 1_500_000


def fixture_points(setup: ProofSetup, bounds: F64, moves: Moves, tools: Sequence[ToolBody]) -> F64:
    """Points on the faces of the fixtures near the moves, for the clearances of bodies and rapids.

    Contacts are exact (``verify.material.fixture_contact``).

    They are at most 0.25 mm apart, and closer for thin tools: half a radius, and close enough that no ball enters a
    face by 0.005 mm between them.

    bounds : (2, 3) float64, mm, setup frame, of the part; a fixture reaches down to its underside, or lower
    moves, tools : places that no tool can reach are left out

    Returns (n, 3) float64, mm, setup frame: tops, sides and undersides, edges and corners included. The points are
    wider apart where that would need over 1.5 million.
    """
    boxes = _near_boxes(setup, bounds, moves, tools)
    radii = [t.radius for t in tools]
    spacing = _fixture_spacing(boxes, radii)
    out = [np.zeros((0, 3))]
    for low, high, under in boxes:
        x, y, z = (np.linspace(a, b, max(2, int(np.ceil((b - a) / spacing)) + 1))
                   for a, b in zip(low.tolist(), high.tolist(), strict=True))
        out.extend(_sheet(x, y, np.array([v])) for v in (high[2], under))
        out.extend(_sheet(x, np.array([v]), z) for v in (low[1], high[1]))
        out.extend(_sheet(np.array([v]), y, z) for v in (low[0], high[0]))
    return np.concatenate(out)


def _fixture_spacing(boxes: Sequence[tuple[F64, F64, float]], radii: Sequence[float]) -> float:
    """Distance between the points of ``fixture_points``, mm; boxes as ``_near_boxes`` gives them."""
    area = sum(float(2 * w * d + 2 * h * (w + d)) for w, d, h in (high - low for low, high, _ in boxes))
    finest = min((min(0.5 * r, (4.0 * DIP * r - 2.0 * DIP**2) ** 0.5) for r in radii if r > DIP),
                default=FIXTURE_SPACING)
    return max(min(FIXTURE_SPACING, finest), (area / MAX_FIXTURE_POINTS) ** 0.5)


def _near_boxes(setup: ProofSetup, bounds: F64, moves: Moves,
                tools: Sequence[ToolBody]) -> list[tuple[F64, F64, float]]:
    """Lower and upper corner and underside of the fixtures, clipped to the reach of the tools."""
    if len(moves) == 0 or not setup.fixtures:
        return []
    cutters, bodies = cutter_table(tools), Bodies.of(tools, setup)
    below = above = aside = float(bodies.reach(cutters).max())
    if moves.axes is None:
        below, aside = 0.0, bodies.width(cutters)
    ways, near = np.concatenate([moves.start, moves.end]), setup.clearance_rapid
    lower = ways.min(axis=0) - np.array([aside, aside, below]) - near
    upper = ways.max(axis=0) + np.array([aside, aside, above]) + near
    out = []
    for f in setup.fixtures:
        low, high = np.asarray(f, dtype=np.float64)
        under = float(low[2])
        low = np.maximum([low[0], low[1], min(under, float(bounds[0, 2]))], lower)
        high = np.minimum(high, upper)
        if (low < high).all():
            out.append((low, high, max(under, float(low[2]))))
    return out


def _sheet(x: F64, y: F64, z: F64) -> F64:
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), -1).reshape(-1, 3)


def run_clashes(points: F64, fixed: NDArray[np.bool_], moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *,
                threads: int = 2, progress: Progress | None = None, bow: float = BOW,
                rapids: RapidArrays | None = None) -> tuple[F64, int]:
    """Contacts of bodies, and in rapids of the cutting part, with points.

    points : (n, 3) float64, mm, setup frame
    fixed  : (n,) bool, points of fixtures, which the cutting part must not touch either
    rapids : of the moves; found from them where None
    bow    : mm, error allowed where the tool turns

    Returns the events, (e, 7) float64, mm, sorted by move, and the number of events lost because a table is full.
    """
    if len(points) == 0 or len(moves) == 0:
        return np.zeros((0, 7)), 0
    tree, axes = PointTree.build(points), moves.axes or ToolAxes.upright(len(moves))
    cloud = PointArrays(np.ascontiguousarray(points[tree.order]), np.ascontiguousarray(fixed[tree.order]), tree.balls)
    sizes = Bodies.of(tools, setup).arrays(cutter_table(tools), end_radii(tools, setup.tap_holes))
    known = rapid_arrays(moves, setup) if rapids is None else rapids
    steps, turns, limits = moves.arrays, axes.arrays(bow), contact_limits(setup)

    def job(chunk: int) -> Callable[[], object]:
        def work() -> object:
            events = event_table()
            n = clash_chunk(chunk, cloud, steps, turns, known, sizes, limits, events)
            return noted(events), n
        return work

    return gather(run_tiles([job(c) for c in range(tree.chunks)], threads, progress))
