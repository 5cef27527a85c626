"""What both STEP-NC forms say in words and shapes: names, regions, the stock, the job as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from output.clamping import Leg, sections
from output.grid import GRID, I64, grid_path, link, to_grid
from output.model import Workplan
from output.text import face_words
from toolpath.motion import Motion, Trajectory, Workingstep


@dataclass(frozen=True, eq=False)
class Curve:
    """A trajectory as it is written: (m, 3) int64 grid points in the setup frame, m is 1 where it is shorter than the
    grid; axes (m, 3) float64, unit, None where they are Z."""

    trajectory: Trajectory
    points: I64
    axes: F64 | None = None


@dataclass(frozen=True, eq=False)
class Way:
    """What is written of one step: the rapids that lead to it, itself, and the rapids to where its tool is put away.

    fresh : the tool is put in before it, and comes to the first point from where the control left it
    """

    step: Workingstep
    fresh: bool
    before: tuple[Curve, ...]
    path: tuple[Curve, ...]
    after: tuple[Curve, ...]


def ways(plan: Workplan) -> list[Way]:
    """All steps of a plan with the rapids between them, setup frame; errors as of ``grid_path`` and ``sections``."""
    if plan.clamping is not None:
        return [Way(s.step, s.fresh, _curves(s.before), _curves(s.legs), _curves(s.after)) for s in sections(plan)]
    out: list[Way] = []
    clearance = int(to_grid(np.array([plan.clearance_plane]))[0])
    for k, step in enumerate(plan.steps):
        path = tuple(Curve(*pair) for pair in grid_path(step))
        fresh = k == 0 or plan.steps[k - 1].tool != step.tool or step.fresh
        before: tuple[Curve, ...] = ()
        if not fresh:
            points = link(out[-1].path[-1].points[-1], path[0].points[0], clearance)
            if len(points) > 1:
                before = (Curve(Trajectory(Motion.RAPID, np.asarray(points * GRID, np.float64), 0.0), points),)
        out.append(Way(step, fresh, before, path, ()))
    return out


def _curves(legs: Sequence[Leg]) -> tuple[Curve, ...]:
    """Legs on the grid, each from the point where the one before ended; C alone, round the tool, is no curve."""
    out: list[Curve] = []
    for leg in legs:
        points, axes = leg.on_grid()
        if len(points) < 2:
            continue
        if out:
            points[0] = out[-1].points[-1]
        out.append(Curve(Trajectory(leg.motion, leg.tips, leg.feed), points, axes))
    return tuple(out)


def pass_plane_normal(step: Workingstep) -> tuple[float, float, float]:
    """Unit normal of the planes the cutting passes lie in: Z for level passes, else across the main XY direction."""
    if step.strategy not in ("zigzag", "one_way"):
        return (0.0, 0.0, 1.0)
    double = 0.0 + 0.0j  # directions, not senses: angles are doubled, so that zig and zag add up
    for trajectory in step.trajectories:
        if trajectory.motion is Motion.CUT:
            move = np.diff(trajectory.points[:, :2], axis=0)
            z = move[:, 0] + 1j * move[:, 1]
            length = np.abs(z)
            double += complex((z[length > 0] ** 2 / length[length > 0]).sum())
    angle = 0.5 * float(np.angle(double)) + 0.5 * np.pi
    return (float(np.cos(angle)), float(np.sin(angle)), 0.0)


def to_and_fro(step: Workingstep) -> bool:
    """Whether passes are walked to and fro: those along the borders of faces where most go against the one before."""
    if step.strategy != "isoparametric":
        return step.strategy == "zigzag"
    ways = np.array([t.points[-1] - t.points[0] for t in step.trajectories if t.motion is Motion.CUT]).reshape(-1, 3)
    return bool(len(ways) > 1 and ((ways[1:] * ways[:-1]).sum(axis=1) < 0.0).mean() > 0.5)


def region_outline(step: Workingstep, rotation: F64 | None = None) -> I64:
    """The outline of a step at its top, closed, three different points or more: (k, 3) int64, 0.0001 mm.

    rotation : (3, 3) float64, from the setup frame into that of the step; None: they are the same
    """
    outline = np.asarray(step.outline, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise OutputError(f"{step.id} has no outline", code="bad_outline", subjects=(step.id,),
                          measured=list(outline.shape))
    places = np.column_stack([outline, np.full(len(outline), step.top)])
    points = to_grid(places if rotation is None else places @ rotation)
    return points if (points[0] == points[-1]).all() else np.concatenate([points, points[:1]])


def stock_box(plan: Workplan) -> tuple[list[float], list[float]]:
    """Lower corner and side lengths of the stock, mm."""
    low = np.asarray(plan.stock.lower, dtype=np.float64)
    size = np.asarray(plan.stock.upper, dtype=np.float64) - low
    if low.shape != (3,) or not np.isfinite(low).all() or not (np.isfinite(size) & (size > GRID)).all():
        raise OutputError("the stock box is empty", code="bad_stock", measured=size.tolist())
    return low.tolist(), size.tolist()


def header_words(plan: Workplan, first: str) -> list[str]:
    """Description lines of the file header."""
    return [first, *setup_words(plan)]


def setup_words(plan: Workplan) -> list[str]:
    """What belongs to the whole job: hashes, zero, clearance plane, labels, comments."""
    return [
        f"part sha256 {plan.part_sha256}", f"setup sha256 {plan.setup_sha256}", f"material {plan.material}",
        f"program zero is the origin of the setup frame, work offset {plan.work_offset}",
        *(f"label {key}: {value}" for key, value in sorted(plan.labels.items())), *plan.comments,
    ]


def operation_words(step: Workingstep) -> str:
    """'S07 finishing zlevel': the id of the operation."""
    return f"{step.id} {step.operation} {step.strategy}"


def region_name(step: Workingstep) -> str:
    """'S07 region Z3 F12 F13': the id of the feature, with the face numbers of the part."""
    return " ".join(filter(None, (step.id, "region", step.zone, face_words(step))))
