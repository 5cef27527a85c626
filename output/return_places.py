"""Places of loose cuts at which their tool comes straight down again.

A tool may come down where it has cut as deep before, for nothing stands there. A cut written within a loose tolerance
(``Trajectory.loose``) passes beside such a place: it leaves a sliver as wide as that tolerance, and as high as the
stock. So the written cut must go through the place.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry.mesh import F64
from output.program_grid import GRID, I64
from output.workplan import Workplan
from toolpath.stock.cut_history import ON
from toolpath.workingsteps import Trajectory, TrajectoryKind

UPRIGHT = 1e-9  # mm in plan, of a move straight down
SAME = 1e-6  # mm: a place that near a point of the cut is that point

Place = tuple[int, int]
"""Index of a step of the plan, and of a trajectory of it."""


def return_places(plan: Workplan) -> dict[Place, tuple[F64, I64]]:
    """Loose cuts with the places in them at which their tool comes down later, no deeper than they are.

    Returns, by cut, its points with these places among them, (n, 3) float64, mm, frame of the access, and their rows,
    (k,) int64, ascending. Cuts without such places are left out.
    """
    cuts: dict[tuple[str, str], list[Place]] = defaultdict(list)
    down: dict[tuple[str, str], list[tuple[Place, F64]]] = defaultdict(list)
    for s, step in enumerate(plan.steps):
        of = step.tool.id, step.access
        for t, trajectory in enumerate(step.trajectories):
            if trajectory.axes is not None:
                continue
            if trajectory.motion is TrajectoryKind.CUT and trajectory.loose > 0.0:
                cuts[of].append((s, t))
            down[of] += [((s, t), place) for place in _straight_down(trajectory)]
    out: dict[Place, tuple[F64, I64]] = {}
    for of, places in cuts.items():
        if down[of]:
            out |= _with_places({p: plan.steps[p[0]].trajectories[p[1]].points for p in places}, down[of])
    return out


def _straight_down(trajectory: Trajectory) -> F64:
    """Ends of the moves of a trajectory that go straight down, (k, 3) float64, mm."""
    move = np.diff(trajectory.points, axis=0)
    return trajectory.points[1:][(np.hypot(move[:, 0], move[:, 1]) <= UPRIGHT) & (move[:, 2] < -UPRIGHT)]


def _with_places(cuts: dict[Place, F64], down: list[tuple[Place, F64]]) -> dict[Place, tuple[F64, I64]]:
    """The cuts of one tool with the places where it comes down later.

    cuts : points (n, 3), mm, in the order of the plan
    down : when it comes down, and the place (3,), mm
    """
    names, paths = list(cuts), list(cuts.values())
    begin = np.cumsum([0, *(len(p) - 1 for p in paths)])
    start, end = np.concatenate([p[:-1] for p in paths]), np.concatenate([p[1:] for p in paths])
    places = np.array([place for _, place in down])
    move, spot = shapely.STRtree(shapely.points(places[:, :2])).query(
        shapely.linestrings(np.stack([start[:, :2], end[:, :2]], axis=1)), predicate="dwithin", distance=ON)
    way = end[move] - start[move]
    length = np.hypot(way[:, 0], way[:, 1])
    share = ((places[spot] - start[move])[:, :2] * way[:, :2]).sum(axis=1) / np.maximum(length, UPRIGHT) ** 2
    on = start[move] + share.clip(0.0, 1.0)[:, None] * way
    cut = np.searchsorted(begin, move, side="right") - 1
    later = np.array([names[c] < down[k][0] for c, k in zip(cut.tolist(), spot.tolist(), strict=True)], np.bool_)
    good = later & (on[:, 2] <= places[spot, 2] + GRID)
    out = {}
    for c in np.unique(cut[good]).tolist():
        mine = good & (cut == c)
        out[names[c]] = _inserted(paths[c], move[mine] - begin[c], on[mine])
    return out


def _inserted(points: F64, move: NDArray[np.int64], on: F64) -> tuple[F64, I64]:
    """A path (n, 3), mm, with places (k, 3), mm, on its moves (k,), and their rows."""
    at_start = np.linalg.norm(on - points[move], axis=1) <= SAME
    at_end = np.linalg.norm(on - points[move + 1], axis=1) <= SAME
    between = ~at_start & ~at_end
    moves, first = np.unique(np.column_stack([move[between], np.rint(on[between] / SAME)]), axis=0, return_index=True)
    new, after = on[between][first], moves[:, 0].astype(np.int64)
    far = np.linalg.norm(new - points[after], axis=1)
    order = np.lexsort((far, after))
    new, after = new[order], after[order]
    path = np.insert(points, after + 1, new, axis=0)
    ends = np.unique(np.concatenate([move[at_start], move[at_end & ~at_start] + 1]))
    rows = np.concatenate([ends + np.searchsorted(after, ends), after + 1 + np.arange(len(after))])
    return path, np.unique(rows).astype(np.int64)


__all__ = ["Place", "return_places"]
