"""Workplans made by hand: three tools, five steps, awkward labels; and long ones for timing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from geometry.mesh import TriangleMesh
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import HolderFrustum, ToolBody
from output.gcode.dialects.base import Switches
from output.gcode.dialects.linuxcnc import LinuxCnc
from output.gcode.program_writer import write_program
from output.inverse_kinematics import RotaryMachine
from output.workplan import AccessFrame, Ap238, Assembly, Clamping, StockBox, StockCylinder, Workplan
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep
from zones.reach.access_view import access_rotation

HOLDER = (HolderFrustum(20.0, 20.0, 30.0),)
BALL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0, HOLDER)
FLAT = ToolBody("T2", 2, 6.0, 0.0, 18.0, 6.0, 18.0, 6.0, 40.0, HOLDER)
BULL = ToolBody("rougher Ø8", 7, 8.0, 1.0, 20.0, 7.6, 30.0, 8.0, 50.0, HOLDER)
CLEAR = 25.0
TAPERED = {body.kind: body for body in (
    ToolBody("T1", 1, d, c, 12.0, 2.0, 20.0, 6.0, 45.0, HOLDER, taper=math.tan(math.radians(3.0)))
    for d, c in ((1.0, 0.5), (2.0, 0.4), (2.0, 0.0)))}
"""A tapered mill of each kind, 3 degrees between side and axis."""
SEGMENTS = {name: ToolBody("T1", 1, d, c, 12.0, d, 12.0, 6.0, 45.0, HOLDER, form=form, profile_radius=profile,
                           profile_taper=math.tan(math.radians(lean)))
            for name, form, d, c, profile, lean in (
                ("lens", "lens", 6.0, 0.5, 20.0, 0.0), ("sharp lens", "lens", 6.0, 0.0, 20.0, 0.0),
                ("oval", "barrel", 6.0, 1.0, 20.0, 0.0), ("taper barrel", "barrel", 6.0, 1.0, 30.0, 15.0))}
"""Circle segment mills."""


def write_linuxcnc(plan: Workplan) -> str:
    """The program of a plan for LinuxCNC."""
    return write_program(plan, LinuxCnc(Switches()))


def line(motion: TrajectoryKind, *points: tuple[float, float, float], feed: float = 0.0) -> Trajectory:
    return Trajectory(motion, np.array(points, dtype=np.float64), feed)


def passes(x: float, z: float, feed: float = 600.0) -> tuple[Trajectory, ...]:
    """Down, in, a wavy cut, a connection with its own feed, a second cut, out, up."""
    t = np.linspace(0.0, 20.0, 7)
    first = np.column_stack([x + 0.5 * np.sin(t), t, np.full_like(t, z)])
    second = first[::-1] + [1.0, 0.0, 0.0]
    a, b, c, d = first[0], first[-1], second[0], second[-1]
    high, low = (a[0], a[1], CLEAR), (a[0], a[1], z + 1.0)
    return (
        line(TrajectoryKind.RAPID, high, low),
        line(TrajectoryKind.APPROACH, low, tuple(a), feed=0.4 * feed),
        Trajectory(TrajectoryKind.CUT, first, feed),
        Trajectory(TrajectoryKind.CONNECT, np.array([b, c]), feed),
        Trajectory(TrajectoryKind.CUT, second, feed),
        line(TrajectoryKind.LIFT, tuple(d), (d[0], d[1], z + 1.0), feed=feed),
        line(TrajectoryKind.RAPID, (d[0], d[1], z + 1.0), (d[0], d[1], CLEAR)),
    )


def step(number: int, tool: ToolBody, strategy: str, *, zone: str | None = "Z3", faces: tuple[int, ...] = (12, 13),
         x: float = 5.0, z: float = 4.0, trajectories: tuple[Trajectory, ...] | None = None) -> Workingstep:
    ident = f"S{number:02d}"
    words = [ident, zone or "", strategy, tool.id, *(f"F{f}" for f in faces)]
    return Workingstep(
        id=ident, name=" ".join(filter(None, words)), zone=zone, faces=faces,
        operation="roughing" if strategy == "depth_layers" else "finishing", strategy=strategy, tool=tool,
        spindle_rpm=12000.0, feed=600.0, side_step=0.25, scallop_height=0.01, chordal_tolerance=0.002,
        trajectories=passes(x, z) if trajectories is None else trajectories,
        outline=np.array([[x, 0.0], [x + 2.0, 0.0], [x + 2.0, 20.0], [x, 20.0], [x, 0.0]]), top=z + 6.0, bottom=z)


def plan(*steps: Workingstep, **changes: object) -> Workplan:
    chosen = steps or (
        step(1, BULL, "depth_layers", zone=None, faces=(), x=2.0, z=8.0),
        step(2, FLAT, "planar_floor", zone="Z1", faces=(4,)),
        step(3, BALL, "waterline"),
        step(4, BALL, "zigzag", zone="Z4", faces=(20, 21, 22), x=11.0, z=3.0),
        step(5, BULL, "depth_layers", zone="Z5", faces=(30,), x=15.0, z=6.0),
    )
    values: dict[str, object] = dict(
        name="demo", steps=chosen, tools=(BALL, FLAT, BULL), clearance_plane=CLEAR, work_offset="G54",
        stock=StockBox(np.array([0.0, 0.0, 0.0]), np.array([30.0, 20.0, 15.0])), material="Ti-6Al-4V",
        part_sha256="ab" * 32, setup_sha256="cd" * 32, version="0.1.0",
        labels={"order": "Müller's \"4711\" (rush) \\ 20 %", "revision": "B → C 漢 😀"},
        assumed=("travel: long enough. Else a move may run into the end of an axis. Remedy: state machine.travel_mm",),
        comments=("MSG, not a message to the operator", "clamp at the seat; check runout (0.01)"))
    return Workplan(**{**values, **changes})  # type: ignore[arg-type]


def tiny() -> Workplan:
    """One tool, one step, a handful of points: small enough to read as a golden file."""
    cut = (
        line(TrajectoryKind.RAPID, (0.0, 0.0, CLEAR), (0.0, 0.0, 6.0)),
        line(TrajectoryKind.APPROACH, (0.0, 0.0, 6.0), (0.0, 0.0, 5.0), feed=200.0),
        line(TrajectoryKind.CUT, (0.0, 0.0, 5.0), (10.0, 0.0, 5.0), (10.00001, 0.00001, 5.0), (10.0, 2.5, 4.99996),
             (-0.00001, 2.5, 4.5), feed=600.0),
        line(TrajectoryKind.LIFT, (-0.00001, 2.5, 4.5), (0.0, 2.5, 6.0), feed=600.0),
        line(TrajectoryKind.RAPID, (0.0, 2.5, 6.0), (0.0, 2.5, CLEAR)),
    )
    return plan(step(1, BALL, "waterline", trajectories=cut), labels={"order": "4711"}, comments=())


def tapered(kind: str = "tapered_ball", **changes: object) -> Workplan:
    """One step with a tapered mill."""
    tool = TAPERED[kind]
    return plan(step(1, tool, "waterline"), tools=(tool,), **changes)


def segment(kind: str = "lens", **changes: object) -> Workplan:
    """One step with a circle segment mill."""
    tool = SEGMENTS[kind]
    return plan(step(1, tool, "waterline"), tools=(tool,), **changes)


def long_plan(points: int, rows: int = 300) -> Workplan:
    """A plan of about ``points`` points in ``rows`` cutting passes."""
    n = points // rows
    t = np.linspace(0.0, 60.0, n)
    out: list[Trajectory] = []
    end: np.ndarray | None = None
    for k in range(rows):
        y = np.full(n, 0.1 * k)
        row = np.column_stack([t, y, 3.0 + np.sin(0.3 * t + 0.05 * k)])[:: 1 if k % 2 == 0 else -1]
        if end is not None:
            out.append(Trajectory(TrajectoryKind.CONNECT, np.array([end, row[0]]), 600.0))
        out.append(Trajectory(TrajectoryKind.CUT, np.ascontiguousarray(row), 600.0))
        end = row[-1]
    return plan(step(1, BALL, "zigzag", trajectories=tuple(out)))


def leaning(x: float, z: float, size: float = 0.2) -> tuple[Trajectory, ...]:
    """``passes`` whose first cut swings the axis to and fro, by ``size`` in its X and Y, upright at both ends."""
    out = list(passes(x, z))
    t = np.linspace(0.0, 1.0, len(out[2].points))
    axes = np.column_stack([size * np.sin(np.pi * t), 0.7 * size * np.sin(2 * np.pi * t), np.ones_like(t)])
    out[2] = Trajectory(TrajectoryKind.CUT, out[2].points, 600.0, axes / np.linalg.norm(axes, axis=1, keepdims=True))
    return tuple(out)


def clamped(kind: str = "table-table-AC", tcp: bool = True, swings: bool = True) -> Workplan:
    """A job of one clamping: upright, leaning two ways, one pass with an axis that swings, two tools."""
    frames = {"A1": AccessFrame(np.eye(3), CLEAR)}
    for name, direction in (("I1", (0.5, -0.3, 0.9)), ("I2", (-0.8, 0.2, 0.1))):
        frames[name] = AccessFrame(access_rotation(direction), 40.0)
    pivots = ((5.0, 0.0, -80.0), (7.0, 3.0, -20.0)) if kind.startswith("table") else ((0.0, 0.0, 150.0), (20.0, -7, 0))
    machine = RotaryMachine(kind, pivots[:1] if kind.startswith("head-head") else pivots, None, tcp)
    steps = [replace(step(1, FLAT, "depth_layers", zone=None, faces=(), x=2.0, z=8.0), access="A1"),
             replace(step(2, FLAT, "planar_floor", zone="Z1", faces=(4,)), access="I1"),
             replace(step(3, BALL, "waterline"), access="I1"), replace(step(4, BALL, "zigzag", x=11.0), access="I2"),
             replace(step(5, BALL, "waterline", trajectories=leaning(4.0, 5.0) if swings else None), access="I1")]
    clamping = Clamping(machine, frames, np.array([15.0, 10.0, 7.5]), 60.0, {1: 75.0, 2: 70.0})
    return plan(*steps, clamping=clamping, labels={"order": "4711"}, comments=())


def block_mesh() -> TriangleMesh:
    """A block of 30 by 20 by 15 mm, a face number for each side."""
    corners = np.array([[x, y, z] for x in (0.0, 30.0) for y in (0.0, 20.0) for z in (0.0, 15.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    rows = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(rows, np.int32), face_ids=np.repeat(np.arange(1, 7, dtype=np.int32), 2))


def full(job: Workplan | None = None, **changes: object) -> Workplan:
    """A job with all that a workplan may hold: assemblies, a fresh cutter, exact faces, meshes, a round blank."""
    job = plan() if job is None else job
    bowl = NurbsSurface.from_control_points(np.array([[[x, y, 0.1 * x * y] for y in (0.0, 7, 14, 20)]
                                                      for x in (0.0, 5, 10)]), (3, 4))
    round_ = NurbsSurface(bowl.control, np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.0, 0, 0, 0.5, 1, 1, 1]), (3, 3),
                          np.array([[1.0, 0.9, 0.9, 1.0]] * 3))
    steps = list(job.steps)
    steps[2] = replace(steps[2], strategy="isoparametric")
    steps[3] = replace(steps[3], fresh=True)
    values: dict[str, object] = dict(
        steps=tuple(steps), stock_words="cylinder", part_mesh=block_mesh(),
        cylinder=StockCylinder(np.array([15.0, 10, -2]), np.array([0.0, 0, 1]), 22.0, 20.0),
        assemblies={1: Assembly(75.5, 2, 45.0), 2: Assembly(70.0), 7: Assembly(81.0, 4)},
        surfaces={12: bowl, 13: round_})
    return replace(job, **{**values, **changes})  # type: ignore[arg-type]


def shaped(**changes: object) -> Workplan:
    """``full`` with shapes in its AP238."""
    return full(**{"ap238": Ap238.CC2, **changes})
