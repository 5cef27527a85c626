"""The steps of one clamping one after the other in the setup frame, with safe ways from one tool axis to the next.

Part, stock and fixtures lie in a ball. A tool whose tip stands on the plane that touches the ball square to the tool
axis is wholly outside it. So it goes up along its axis to that plane, across to where the plane touches, and turns
there: while the axis swings the tip stays on the ball, below the axis, so that all of the tool stays outside. Tools
are changed with both rotary axes at zero, above the ball.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from output.program_grid import GRID, I64, grid_path, to_grid
from output.program_grid import link as grid_link
from output.workplan import Clamping, Frame, Workplan
from toolpath.workingsteps import ArcSpan, TrajectoryKind, Workingstep

TURN_STEP = math.radians(2.0)  # the most either axis turns in one block of a turn
SPARE = 0.5  # mm, outside the ball, for what a turn of joints leaves its chords by
SWING = 1e-4  # rad, what a tool axis may leave the great circle between two points of a path by
AT_REST = 1e-9  # rad
JUMP = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class Leg:
    """A polyline of the tip with the tool axis all along.

    motion : RAPID is a G0, everything else a G1 at ``feed``
    tips   : (n, 3) float64, mm, setup frame; axes : (n, 3) float64, unit, tip to spindle
    turns  : (n, 2) float64, rad, where the rotary axes stand
    feed   : mm/min of the tip
    arcs   : stretches of it about Z of the setup frame, none unless both rotary axes stand at 0
    """

    motion: TrajectoryKind
    tips: F64
    axes: F64
    turns: F64
    feed: float
    arcs: tuple[ArcSpan, ...] = ()

    @property
    def is_turning(self) -> bool:
        """Whether a rotary axis moves."""
        return bool(np.ptp(self.turns, axis=0).max() > AT_REST)

    def on_grid(self) -> tuple[I64, F64]:
        """Tips (m, 3) on the grid, and axes (m, 3), without points that repeat the one before."""
        points = to_grid(self.tips)
        keep = np.ones(len(points), np.bool_)
        keep[1:] = (points[1:] != points[:-1]).any(axis=1) | (np.abs(np.diff(self.axes, axis=0)).max(axis=1) > AT_REST)
        return points[keep], self.axes[keep]


@dataclass(frozen=True, eq=False)
class Section:
    """A step with the ways to it and, before a tool is put away, from it.

    fresh, last : its tool is put in before it, and the way to it begins at ``home`` then; it is put away after it.
                  Where the plan has restart points all steps are both, though the tool stays, and so are those
                  between which the speed changes while the control keeps the tip: not every control can change it so
    before, legs, after : the way to its start, the step itself, back to ``home``
    """

    step: Workingstep
    fresh: bool
    last: bool
    before: tuple[Leg, ...]
    legs: tuple[Leg, ...]
    after: tuple[Leg, ...]


def home_of(clamping: Clamping) -> F64:
    """(3,) float64, mm, setup frame: where the tip stands, rotary axes at zero, before and after a tool change."""
    return np.asarray(clamping.centre + [0.0, 0.0, _outside(clamping)])


def sections(plan: Workplan) -> list[Section]:
    """All steps of a clamping with the ways between them; errors as of ``each_section``."""
    return list(each_section(plan))


def each_section(plan: Workplan) -> Iterator[Section]:
    """One step of a clamping after the other, with the ways between them, none kept.

    Raises
    ------
    OutputError
        As ``output.program_grid.grid_path``; no_clamping: the plan has none; no_frame: a step is in the frame of an access
        that the clamping does not have; rotary_limit: the rotary axes cannot stand as a step wants.
    """
    if plan.clamping is None:
        raise OutputError(f"the workplan '{plan.name}' has no clamping", code="no_clamping", subjects=(plan.name,))
    walk, steps = _Walk(plan.clamping), plan.steps
    for k, step in enumerate(steps):
        fresh = k == 0 or _parted(plan, steps[k - 1], step)
        last = k + 1 == len(steps) or _parted(plan, step, steps[k + 1])
        grid_path(step)
        before = walk.enter(step, fresh)
        legs = walk.through(step)
        yield Section(step, fresh, last, tuple(before), tuple(legs), tuple(walk.home()) if last else ())


def _parted(plan: Workplan, step: Workingstep, follower: Workingstep) -> bool:
    """Whether the tool is put away between two steps and put in again."""
    if plan.restart or follower.fresh or follower.tool != step.tool:
        return True
    # a Heidenhain says a speed by TOOL CALL, which M128 does not allow
    return plan.clamping is not None and plan.clamping.machine.tcp and follower.spindle_rpm != step.spindle_rpm


class _Walk:
    """Where the tool stands: the tip in the setup frame, the rotary axes, and the frame of the last step."""

    def __init__(self, clamping: Clamping) -> None:
        self.clamping, self.machine = clamping, clamping.machine
        self.frame: Frame | None = None
        self.ahead: list[F64] = []
        self.tip, self.turn = home_of(clamping), np.zeros(2)

    def enter(self, step: Workingstep, fresh: bool) -> list[Leg]:
        """The way to the first point of a step."""
        legs: list[Leg] = []
        frame = self.clamping.frames.get(step.access)
        if frame is None:
            raise OutputError(f"{step.id} is planned along access '{step.access}', which its clamping does not have",
                              code="no_frame", subjects=(step.id,), limit=sorted(self.clamping.frames))
        if fresh:
            self.frame, self.tip, self.turn = None, home_of(self.clamping), np.zeros(2)
        self.ahead = self._followed(step, frame)
        wanted = self.ahead[0][0]
        if self.frame is not frame or np.abs(wanted - self.turn).max() > AT_REST:
            legs += [*self._away(), *self._turned(wanted)]
            self.frame = frame
        start = step.trajectories[0].points[0]
        here, clear = frame.rotation @ self.tip, int(to_grid(np.array([frame.clearance]))[0])
        path = grid_link(to_grid(here), to_grid(start), clear)
        if len(path) > 1:
            points = path * GRID
            points[0], points[-1] = here, start
            legs.append(self._straight(TrajectoryKind.RAPID, points @ frame.rotation, 0.0))
        self.tip = start @ frame.rotation
        return legs

    def _followed(self, step: Workingstep, frame: Frame) -> list[F64]:
        """Where the rotary axes stand, (n, 2) rad, at the points of each trajectory of a step; of a fixed axis once.

        Found for all of the step: the place that turns least in one trajectory may be none to go on from in the next.
        Where one ends the next begins, at the pole too.
        """
        up, axes, begins = np.array([[0.0, 0.0, 1.0]]), np.zeros((0, 3)), []
        for t in step.trajectories:
            own = (up if t.axes is None else t.axes) @ frame.rotation
            joined = len(axes) > 0 and bool(np.abs(axes[-1] - own[0]).max() <= JUMP)
            begins.append((len(axes) - joined, len(own)))
            axes = np.vstack([axes, own[joined:]])
        turns = self.machine.follow(axes, self.turn)
        return [turns[i:i + n] for i, n in begins]

    def through(self, step: Workingstep) -> list[Leg]:
        """The trajectories of a step that was entered, in the setup frame."""
        legs, frame = [], self.clamping.frames[step.access]
        gauge = self.clamping.gauges[step.tool.number]
        for t, ahead in zip(step.trajectories, self.ahead, strict=True):
            tips = t.points @ frame.rotation
            axis = frame.rotation[2] if t.axes is None else t.axes[0] @ frame.rotation
            if np.abs(self.machine.axes(self.turn[None])[0] - axis).max() > JUMP:
                raise OutputError(f"{step.id}: the tool axis jumps between two trajectories", code="axis_jump",
                                  subjects=(step.id,), measured=axis.tolist(),
                                  limit=self.machine.axes(self.turn[None])[0].tolist(),
                                  remedy="turn it along a trajectory, or in a step of its own")
            if t.axes is None:
                legs.append(replace(self._straight(t.motion, tips, t.feed), arcs=self._arcs(t.arcs, frame)))
            else:
                tips, turns = self.machine.course(tips, t.axes @ frame.rotation, 0.5 * step.chordal_tolerance, SWING,
                                                  gauge, ahead)
                legs.append(Leg(t.motion, tips, self.machine.axes(turns), turns, t.feed))
                self.turn = turns[-1]
            self.tip = tips[-1]
        return legs

    def _arcs(self, arcs: tuple[ArcSpan, ...], frame: Frame) -> tuple[ArcSpan, ...]:
        """Arcs of the frame of an access in that of the setup, where the machine stands as one of three axes does."""
        if not arcs or np.abs(self.turn).max() > AT_REST:
            return ()
        centres = np.array([[*a.centre, 0.0] for a in arcs]) @ frame.rotation
        return tuple(replace(a, centre=(x, y)) for a, (x, y, _) in zip(arcs, centres.tolist(), strict=True))

    def home(self) -> list[Leg]:
        """Back to where tools are changed."""
        return [*self._away(), *self._turned(np.zeros(2))]

    def _straight(self, motion: TrajectoryKind, tips: F64, feed: float) -> Leg:
        turns = np.tile(self.turn, (len(tips), 1))
        return Leg(motion, tips, self.machine.axes(turns), turns, feed)

    def _away(self) -> list[Leg]:
        """Up along the tool axis to the plane that touches the ball, and across to where it does."""
        axis = self.machine.axes(self.turn[None])[0]
        goal = self.clamping.centre + _outside(self.clamping) * axis
        up = float((goal - self.tip) @ axis)
        level = self.tip + up * axis if up > 0.0 else goal - up * axis  # from above: across first, then down
        path = np.array([self.tip, level, goal])
        self.tip = goal
        far = np.linalg.norm(np.diff(path, axis=0), axis=1) > GRID
        keep = np.array([True, far[0], far[1]])
        return [self._straight(TrajectoryKind.RAPID, path[keep], 0.0)] if keep[1:].any() else []

    def _turned(self, wanted: F64) -> list[Leg]:
        """The turn from where the axes stand to where they shall, the tip on the ball."""
        size = float(np.abs(wanted - self.turn).max())
        if size <= AT_REST:
            return []
        share = np.linspace(0.0, 1.0, math.ceil(size / TURN_STEP) + 1)[:, None]
        turns = (1.0 - share) * self.turn + share * wanted
        axes = self.machine.axes(turns)
        tips = self.clamping.centre + _outside(self.clamping) * axes
        self.tip, self.turn = tips[-1], turns[-1]
        return [Leg(TrajectoryKind.RAPID, tips, axes, turns, 0.0)]


def _outside(clamping: Clamping) -> float:
    """mm from the centre, where chords of a turn stay outside the ball."""
    return clamping.radius / math.cos(TURN_STEP) + SPARE


__all__ = ["Leg", "Section", "each_section", "home_of", "sections"]
