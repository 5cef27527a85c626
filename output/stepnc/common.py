"""Text and shapes that both STEP-NC forms share: names, regions, the stock, the job as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from output.clamping_sequence import Leg, each_clamped_step
from output.header_text import face_words
from output.inverse_kinematics import RotaryMachine
from output.program_grid import GRID, I64, GridArc, grid_path, link, pieces, to_grid, without_repeats
from output.stepnc.part21 import Part21Writer, real
from output.workplan import Workplan
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep


@dataclass(frozen=True, eq=False)
class Curve:
    """A trajectory on the grid, setup frame.

    points : (m, 3) int64, grid steps of 0.0001 mm; m is 1 where it is shorter than the grid
    axes   : (m, 3) float64, unit, or None where they are Z
    """

    trajectory: Trajectory
    points: I64
    axes: F64 | None = None

    def parts(self) -> list[I64 | GridArc]:
        """The polylines and arcs of the curve, in order; nothing where it does not move.

        A curve with tool axes is one polyline, since both need the same number of points. So is a helix, as a circle is
        flat.

        Returns polylines (k, 3) int64, k >= 2, grid steps of 0.0001 mm, setup frame, and arcs.
        """
        t = self.trajectory
        if len(self.points) < 2:
            return []
        if self.axes is not None or not t.arcs:
            return [self.points]
        grid = to_grid(t.points)
        return list(pieces(grid, [a for a in t.arcs if grid[a.first, 2] == grid[a.last, 2]]))


@dataclass(frozen=True, eq=False)
class StepPath:
    """The curves of one step: rapids that lead to it, the step, rapids to where its tool is put away.

    fresh : the tool reaches the first point from where the control left it
    """

    step: Workingstep
    fresh: bool
    before: tuple[Curve, ...]
    path: tuple[Curve, ...]
    after: tuple[Curve, ...]


def step_paths(plan: Workplan) -> Iterator[StepPath]:
    """All steps of a plan with the rapids between them, setup frame; errors as of ``grid_path`` and
    ``each_clamped_step``.

    The rapids are those of the program. A tool change begins and ends at the clearance plane.
    """
    if plan.clamping is not None:
        machine = plan.clamping.machine
        for s in each_clamped_step(plan):
            yield StepPath(s.step, s.fresh, *(_curves(legs, machine) for legs in (s.before, s.legs, s.after)))
        return
    clearance = int(to_grid(np.array([plan.clearance_plane]))[0])
    here: I64 | None = None
    for step, follower in zip(plan.steps, [*plan.steps[1:], None], strict=True):
        path = tuple(Curve(*pair) for pair in grid_path(step))
        start, end = path[0].points[0], path[-1].points[-1]
        fresh = False
        if here is None or step.fresh:
            fresh = True
            above = np.array([*start[:2], max(clearance, int(start[2]))], dtype=np.int64)
            before = _rapid(without_repeats(np.array([above, start])))
        else:
            before = _rapid(link(here, start, clearance))
        after: tuple[Curve, ...] = ()
        here = end
        if follower is None or follower.tool != step.tool or follower.fresh or plan.restart:
            above = np.array([*end[:2], max(clearance, int(end[2]))], dtype=np.int64)
            after = _rapid(without_repeats(np.array([end, above])))
            here = above
        if follower is not None and (follower.tool != step.tool or follower.fresh):
            here = None
        yield StepPath(step, fresh, before, path, after)


def _rapid(points: I64) -> tuple[Curve, ...]:
    """A rapid through grid points; nothing for a single point."""
    if len(points) < 2:
        return ()
    return (Curve(Trajectory(TrajectoryKind.RAPID, np.asarray(points * GRID, np.float64), 0.0), points),)


def _curves(legs: Sequence[Leg], machine: RotaryMachine | None = None) -> tuple[Curve, ...]:
    """Legs on the grid, each from the point where the one before ended. A turn of C about the tool is not a curve.

    The axes are those of the angles in the program, which are on a grid too.
    """
    out: list[Curve] = []
    for leg in legs:
        if machine is not None:
            leg = replace(leg, axes=machine.axes(np.radians(to_grid(np.degrees(leg.turns)) * GRID)))
        points, axes = leg.on_grid()
        if len(points) < 2:
            continue
        if out:
            points[0] = out[-1].points[-1]
        out.append(Curve(Trajectory(leg.motion, leg.tips, leg.feed), points, axes))
    return tuple(out)


def path_points(path: Sequence[Curve]) -> I64:
    """Ends of the parts of a path and points of its polylines, each once.

    Returns (n, 3) int64, grid steps of 0.0001 mm, setup frame.
    """
    rows = [path[0].points[:1]]
    for curve in path:
        rows += [np.array([p.end], np.int64) if isinstance(p, GridArc) else p[1:] for p in curve.parts()]
    return np.concatenate(rows)


def trimmed_circle(file: Part21Writer, arc: GridArc, start: int, up: int, along: int) -> int:
    """Number of an arc between two CARTESIAN_POINTs, ``start`` and the one after it [ISO10303-21].

    up, along : numbers of DIRECTIONs Z and X
    """
    centre = file.points(np.array([[*arc.centre, arc.start[2]]], np.int64))
    placed = file.add(f"AXIS2_PLACEMENT_3D('',#{centre},#{up},#{along})")
    radius = 0.5 * GRID * sum(math.hypot(p[0] - arc.centre[0], p[1] - arc.centre[1]) for p in (arc.start, arc.end))
    circle = file.add(f"CIRCLE('',#{placed},{real(radius, 6)})")
    sense = ".T." if arc.left else ".F."
    return file.add(f"TRIMMED_CURVE('',#{circle},(#{start}),(#{start + 1}),{sense},.CARTESIAN.)")


def pass_plane_normal(step: Workingstep) -> tuple[float, float, float]:
    """Unit normal of the planes of the cutting passes: Z for level passes, else horizontal and across their main
    direction.
    """
    if step.strategy not in ("zigzag", "one_way"):
        return (0.0, 0.0, 1.0)
    double = 0.0 + 0.0j  # angles are doubled, so that opposite passes add up
    for trajectory in step.trajectories:
        if trajectory.motion is TrajectoryKind.CUT:
            move = np.diff(trajectory.points[:, :2], axis=0)
            z = move[:, 0] + 1j * move[:, 1]
            length = np.abs(z)
            double += complex((z[length > 0] ** 2 / length[length > 0]).sum())
    angle = 0.5 * float(np.angle(double)) + 0.5 * np.pi
    return (float(np.cos(angle)), float(np.sin(angle)), 0.0)


def to_and_fro(step: Workingstep) -> bool:
    """Whether passes alternate in direction.

    Passes along borders of faces alternate where most go against the one before; others where either direction is
    allowed.
    """
    if step.strategy != "isoparametric":
        return step.strategy == "zigzag" or step.cut_direction.both_ways
    cuts = [t.points for t in step.trajectories if t.motion is TrajectoryKind.CUT]
    chords = np.array([points[-1] - points[0] for points in cuts]).reshape(-1, 3)
    return bool(len(chords) > 1 and ((chords[1:] * chords[:-1]).sum(axis=1) < 0.0).mean() > 0.5)


def region_outline(step: Workingstep, rotation: F64 | None = None) -> I64:
    """The closed outline of a step at its top, with three different points or more.

    rotation : (3, 3) float64, dimensionless, from the setup frame into that of the step; None: they are the same

    Returns (k, 3) int64, grid steps of 0.0001 mm, setup frame.

    Raises
    ------
    OutputError
        bad_outline: the step has no outline.
    """
    outline = np.asarray(step.outline, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
        raise OutputError(f"{step.id} has no outline", code="bad_outline", subjects=(step.id,),
                          measured=list(outline.shape))
    places = np.column_stack([outline, np.full(len(outline), step.top)])
    points = to_grid(places if rotation is None else places @ rotation)
    return points if (points[0] == points[-1]).all() else np.concatenate([points, points[:1]])


def stock_box(plan: Workplan) -> tuple[list[float], list[float]]:
    """Lower corner and side lengths of the stock, mm.

    Raises
    ------
    OutputError
        bad_stock: a side length is not positive.
    """
    low = np.asarray(plan.stock.lower, dtype=np.float64)
    size = np.asarray(plan.stock.upper, dtype=np.float64) - low
    if low.shape != (3,) or not np.isfinite(low).all() or not (np.isfinite(size) & (size > GRID)).all():
        raise OutputError("the stock box is empty", code="bad_stock", measured=size.tolist())
    return low.tolist(), size.tolist()


def header_words(plan: Workplan, first: str) -> list[str]:
    """Description lines of the file header."""
    return [first, *setup_words(plan), *plan.figures]


def setup_words(plan: Workplan) -> list[str]:
    """Lines on the whole job: hashes, zero, clearance plane, labels, comments."""
    return [
        f"part sha256 {plan.part_sha256}", f"setup sha256 {plan.setup_sha256}", f"material {plan.material}",
        *((f"stock {plan.stock_words}",) if plan.stock_words else ()),
        f"program zero is the origin of the setup frame, work offset {plan.work_offset}",
        *(f"label {key}: {value}" for key, value in sorted(plan.labels.items())), *plan.comments,
    ]


def written_feed(feed: float) -> float:
    """A feed, mm/min, rounded as in programs: to a tenth, slow ones to four decimals."""
    return round(feed, 1 if feed >= 1.0 else 4)


def written_speed(rpm: float) -> float:
    """A spindle speed, 1/min, rounded as in programs: whole."""
    return float(round(rpm))


def cutter_diameter(tool: ToolBody) -> float:
    """Diameter of a cutter as STEP-NC counts it, mm: where its side would meet the plane of its tip, as in APT.

    Without a taper it is the diameter of the tool. A side at the angle t that touches the corner meets the plane at
    R - r + r (1 - sin t) / cos t, which is less than R.

    >>> ball = ToolBody("T1", 1, 1.0, 0.5, 12.0, 2.0, 12.0, 4.0, 40.0, taper=math.tan(math.radians(3.0)))
    >>> round(cutter_diameter(ball), 6)
    0.948965
    """
    wide, high = tool.corner_end
    return 2.0 * (wide - high * tool.taper) if tool.taper > 0.0 else tool.diameter


def fresh_words(step: Workingstep) -> str:
    """Message for the machinist before a step that needs a fresh cutter."""
    return f"Fresh cutter in T{step.tool.number}: change it and set its length"


def surfaces_of(plan: Workplan, step: Workingstep) -> list[tuple[int, NurbsSurface]]:
    """Numbers and exact surfaces of the faces of a step; empty where its strategy does not follow them.

    It is all of its faces or none, since a feature of some faces would be too small.
    """
    if step.strategy not in ("isoparametric", "flank", "curvature_matched", "inclined_axis"):
        return []
    found = [(n, plan.surfaces[n]) for n in step.faces if n in plan.surfaces]
    return found if len(found) == len(step.faces) else []


def knots_of(knots: F64) -> tuple[list[int], list[float]]:
    """Multiplicities and distinct values of a knot vector.

    knots : (n,) float64, dimensionless, ascending
    """
    values, counts = np.unique(knots, return_counts=True)
    return counts.tolist(), values.tolist()


def operation_words(step: Workingstep) -> str:
    """'S07 finishing waterline': the id of the operation."""
    return f"{step.id} {step.operation} {step.strategy}"


def region_name(step: Workingstep) -> str:
    """'S07 region Z3 F12 F13': the id of the feature, with the face numbers of the part."""
    return " ".join(filter(None, (step.id, "region", step.zone, face_words(step))))
