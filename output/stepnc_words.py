"""What both STEP-NC forms say in words and shapes: names, regions, the stock, the job as a whole."""

from __future__ import annotations

import numpy as np

from geometry.errors import OutputError
from output.grid import GRID, I64, to_grid
from output.model import Workplan
from output.text import face_words
from toolpath.motion import Motion, Workingstep


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


def region_outline(step: Workingstep) -> I64:
    """The outline of a step at its top, closed, at least three different points: (k, 3) int64 grid points."""
    outline = np.asarray(step.outline, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise OutputError(f"{step.id} has no outline", code="bad_outline", subjects=(step.id,),
                          measured=list(outline.shape))
    points = to_grid(np.column_stack([outline, np.full(len(outline), step.top)]))
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
