"""The grid to which every writer rounds: whole ten-thousandths of a millimetre.

A path is rounded to the grid once, as integers, and the text is made from the integers. A reader therefore gets exactly
the grid point, at most ``GRID / 2`` = 0.00005 mm from the planned point on each axis. "Equal" and "moves" mean equality
on the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import OutputError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from output.workplan import Workplan
from toolpath.workingsteps import ArcSpan, Trajectory, TrajectoryKind, Workingstep

I64 = NDArray[np.int64]

PER_MM = 10_000
"""Grid steps in a millimetre (four decimals)."""

GRID = 1.0 / PER_MM
"""Grid width, mm."""

REACH = 1.0e6
"""Largest coordinate that is accepted, mm."""


def to_grid(points: F64) -> I64:
    """Round points to the grid.

    points : (..., k) float64, mm, any frame

    Returns (..., k) int64, ten-thousandths of a mm.

    Raises
    ------
    OutputError
        A value is not finite or larger than 1 km.
    """
    p = np.asarray(points, dtype=np.float64)
    if not np.isfinite(p).all() or (p.size and np.abs(p).max() > REACH):
        raise OutputError("a path holds a coordinate that is not a finite length below 1 km", code="bad_coordinate")
    return np.rint(p * PER_MM).astype(np.int64)


def without_repeats(points: I64) -> I64:
    """The points without those that equal the point before them; the first stays.

    points : (n, k) int64, grid steps of 0.0001 mm

    Returns (m, k) int64, grid steps of 0.0001 mm, 1 <= m <= n for n >= 1.
    """
    if len(points) < 2:
        return points
    keep = np.empty(len(points), dtype=bool)
    keep[0] = True
    np.any(points[1:] != points[:-1], axis=1, out=keep[1:])
    return points[keep]


@dataclass(frozen=True)
class GridArc:
    """An arc or helix about Z on the grid: X, Y, Z of both ends, X and Y of the centre, grid steps.

    left : counter-clockwise seen from above
    """

    start: tuple[int, int, int]
    end: tuple[int, int, int]
    centre: tuple[int, int]
    left: bool

    @property
    def offset(self) -> tuple[int, int]:
        """X and Y of the centre, from the start."""
        return self.centre[0] - self.start[0], self.centre[1] - self.start[1]

    @property
    def sweep(self) -> float:
        """rad, positive to the left."""
        (ax, ay), (bx, by) = ((p[0] - self.centre[0], p[1] - self.centre[1]) for p in (self.start, self.end))
        return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def pieces(points: I64, arcs: Sequence[ArcSpan]) -> Iterator[I64 | GridArc]:
    """The blocks of a path: polylines without repeats, and arcs, in order.

    points : (n, k) int64, grid steps of 0.0001 mm, X, Y, Z of the frame of the step first
    arcs   : stretches of rows of ``points``

    Yields arcs, and polylines as (m, k) int64, grid steps of 0.0001 mm, m >= 2.
    """
    at = 0
    for arc in arcs:
        line = without_repeats(points[at:arc.first + 1])
        if len(line) > 1:
            yield line
        (sx, sy, sz), (ex, ey, ez) = points[[arc.first, arc.last], :3].tolist()
        x, y = to_grid(np.array(arc.centre)).tolist()
        yield GridArc((sx, sy, sz), (ex, ey, ez), (x, y), arc.left)
        at = arc.last
    line = without_repeats(points[at:])
    if len(line) > 1:
        yield line


def grid_path(step: Workingstep) -> list[tuple[Trajectory, I64]]:
    """The trajectories of a step on the grid, checked.

    Returns pairs of the trajectory and its (m, 3) int64 points, grid steps of 0.0001 mm, frame of the step, without
    repeats. m is 1 where a trajectory is shorter than the grid.

    Raises
    ------
    OutputError
        bad_trajectory: a trajectory has a wrong shape; gap_in_path: it does not start at the end of the one before it;
        slanted_rapid: a rapid moves Z and XY in one block; bad_feed: a feed is not a positive number.
    """
    path: list[tuple[Trajectory, I64]] = []
    end: I64 | None = None
    for number, trajectory in enumerate(step.trajectories, start=1):
        where = (step.id, f"trajectory {number}")
        if trajectory.points.ndim != 2 or trajectory.points.shape[1] != 3 or len(trajectory.points) < 2:
            raise OutputError(f"{step.id}: trajectory {number} is not a polyline of two or more points in space",
                              code="bad_trajectory", subjects=where, measured=list(trajectory.points.shape))
        points = to_grid(trajectory.points)
        if end is not None and (points[0] != end).any():
            raise OutputError(f"{step.id}: trajectory {number} does not start where the one before it ended",
                              code="gap_in_path", subjects=where, limit=GRID,
                              measured=float(np.linalg.norm(points[0] - end) * GRID))
        end = points[-1]
        points = without_repeats(points)
        if trajectory.motion is TrajectoryKind.RAPID:
            _check_rapid(points, where)
        elif not (np.isfinite(trajectory.feed) and trajectory.feed >= GRID):
            raise OutputError(f"{step.id}: trajectory {number} has no feed", code="bad_feed", subjects=where,
                              measured=trajectory.feed, limit=GRID)
        path.append((trajectory, points))
    return path


def link(here: I64, start: I64, clearance: int) -> I64:
    """The rapid between two steps that do not join: up to the clearance plane, across, down.

    here, start : (3,) int64, grid steps of 0.0001 mm, frame of the step;  clearance : int, grid steps

    Returns (k, 3) int64, grid steps of 0.0001 mm, from ``here`` to ``start``, k <= 4, without repeats; k is 1
    where they are equal.
    """
    if (here == start).all():
        return here[None, :]
    level = max(clearance, int(here[2]), int(start[2]))
    return without_repeats(np.array([here, [*here[:2], level], [*start[:2], level], start], dtype=np.int64))


def check_plan(plan: Workplan) -> None:
    """Check that the plan as a whole can be written.

    Raises
    ------
    OutputError
        empty_plan: no steps; id_twice: an id occurs twice; empty_step: a step has no trajectory; bad_spindle: a spindle
        speed is below 1; tool_number_twice: two different tools have one number.
    """
    if not plan.steps:
        raise OutputError(f"the workplan '{plan.name}' has no workingstep", code="empty_plan")
    ids = [step.id for step in plan.steps]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise OutputError("workingstep ids are used twice: " + ", ".join(twice), code="id_twice", subjects=tuple(twice))
    bodies: dict[int, ToolBody] = {}
    for step in plan.steps:
        if not step.trajectories:
            raise OutputError(f"{step.id} has no trajectory", code="empty_step", subjects=(step.id,))
        if not (np.isfinite(step.spindle_rpm) and step.spindle_rpm >= 1.0):
            raise OutputError(f"{step.id} has no spindle speed", code="bad_spindle", subjects=(step.id,),
                              measured=step.spindle_rpm, limit=1.0)
        if bodies.setdefault(step.tool.number, step.tool) != step.tool:
            raise OutputError(f"two different tools have the number {step.tool.number}",
                              code="tool_number_twice", subjects=(bodies[step.tool.number].id, step.tool.id))


def _check_rapid(points: I64, where: tuple[str, ...]) -> None:
    move = np.diff(points, axis=0) != 0
    slanted = np.flatnonzero(move[:, :2].any(axis=1) & move[:, 2])
    if len(slanted):
        a, b = (tuple(float(c) * GRID for c in points[slanted[0] + k]) for k in (0, 1))
        raise OutputError("a rapid moves Z together with X or Y", code="slanted_rapid",
                          subjects=(*where, f"({a[0]:.4f}, {a[1]:.4f}, {a[2]:.4f})",
                                    f"({b[0]:.4f}, {b[1]:.4f}, {b[2]:.4f})"))
