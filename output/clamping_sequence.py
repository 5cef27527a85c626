"""The steps of one clamping in the setup frame, with safe moves from one tool axis to the next.

Part, stock and fixtures lie in a ball. A plane that touches the ball and is perpendicular to the tool axis has the
whole tool on its far side while the tip stands on it. So the tool moves up along its axis to that plane and across to
the point of contact, and the axes turn there. During the turn the tip stays on the ball, so the tool stays outside.
Tools are changed above the ball with both rotary axes at zero.
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
from output.workplan import AccessFrame, Clamping, Workplan
from toolpath.workingsteps import ArcSpan, TrajectoryKind, Workingstep

BALL_CLEARANCE = 0.5  # mm outside the ball, since linear joints leave the chords of a turn
MAX_AXIS_DEVIATION = 1e-4  # rad, from the great circle between two points of a path
AT_REST = 1e-9  # rad
AXIS_JUMP = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class Leg:
    """A polyline of the tip, with the tool axis at each point.

    motion : RAPID is a G0, everything else a G1 at ``feed``
    tips   : (n, 3) float64, mm, setup frame; axes : (n, 3) float64, unit, tip to spindle
    turns  : (n, 2) float64, rad, angles of the rotary axes
    feed   : mm/min of the tip
    arcs   : arcs about Z of the setup frame; there are none unless both rotary axes stand at 0
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
        """The points of the leg on the grid, without repeats.

        Returns (m, 3) int64 tips, grid steps of 0.0001 mm, setup frame, and (m, 3) float64 axes, unit.
        """
        points = to_grid(self.tips)
        keep = np.ones(len(points), np.bool_)
        keep[1:] = (points[1:] != points[:-1]).any(axis=1) | (np.abs(np.diff(self.axes, axis=0)).max(axis=1) > AT_REST)
        return points[keep], self.axes[keep]


@dataclass(frozen=True, eq=False)
class ClampedStep:
    """A step with the moves to it, and from it to ``home_of`` where the next one begins there.

    fresh : the moves to it begin at ``home_of``, where its tool is loaded unless it is in the spindle
    last  : the tool goes back to ``home_of`` after it
    before, legs, after : moves to its start, the step itself, moves back to ``home_of``

    With restart points every step is fresh and last. So are steps between which the spindle speed changes while the
    control keeps the tip: not every control can change it then.
    """

    step: Workingstep
    fresh: bool
    last: bool
    before: tuple[Leg, ...]
    legs: tuple[Leg, ...]
    after: tuple[Leg, ...]


def home_of(clamping: Clamping) -> F64:
    """(3,) float64, mm, setup frame: the tip before and after a tool change, with the rotary axes at zero."""
    return np.asarray(clamping.centre + [0.0, 0.0, _turn_radius(clamping)])


def clamped_steps(plan: Workplan) -> list[ClampedStep]:
    """All steps of a clamping with the moves between them; errors as of ``each_clamped_step``."""
    return list(each_clamped_step(plan))


def each_clamped_step(plan: Workplan) -> Iterator[ClampedStep]:
    """Yields the steps of a clamping with the moves between them, one at a time.

    Raises
    ------
    OutputError
        As ``output.program_grid.grid_path``; no_clamping: the plan has none; no_frame: the clamping lacks the access
        of a step; rotary_limit: the rotary axes cannot reach a tool axis; axis_jump: the tool axis jumps.
    """
    if plan.clamping is None:
        raise OutputError(f"the workplan '{plan.name}' has no clamping", code="no_clamping", subjects=(plan.name,))
    position, steps = _ToolPosition(plan.clamping), plan.steps
    for k, step in enumerate(steps):
        fresh = k == 0 or _goes_home(plan, steps[k - 1], step)
        last = k + 1 == len(steps) or _goes_home(plan, step, steps[k + 1])
        grid_path(step)
        before = position.enter(step, fresh)
        legs = position.through(step)
        yield ClampedStep(step, fresh, last, tuple(before), tuple(legs), tuple(position.home()) if last else ())


def _goes_home(plan: Workplan, step: Workingstep, follower: Workingstep) -> bool:
    """Whether the tool goes to ``home_of`` between two steps."""
    if plan.restart or follower.fresh or follower.tool != step.tool:
        return True
    # a Heidenhain sets the speed by TOOL CALL, which M128 forbids
    return plan.clamping is not None and plan.clamping.machine.tcp and follower.spindle_rpm != step.spindle_rpm


class _ToolPosition:
    """Position of the tool: tip in the setup frame, angles of the rotary axes, frame of the last step."""

    def __init__(self, clamping: Clamping) -> None:
        self.clamping, self.machine = clamping, clamping.machine
        self.frame: AccessFrame | None = None
        self.ahead: list[F64] = []
        self.tip, self.turn = home_of(clamping), np.zeros(2)

    def enter(self, step: Workingstep, fresh: bool) -> list[Leg]:
        """Moves to the first point of a step."""
        legs: list[Leg] = []
        frame = self.clamping.frames.get(step.access)
        if frame is None:
            raise OutputError(f"{step.id} uses access '{step.access}', which its clamping does not have",
                              code="no_frame", subjects=(step.id,), limit=sorted(self.clamping.frames))
        if fresh:
            self.frame, self.tip, self.turn = None, home_of(self.clamping), np.zeros(2)
        self.ahead = self._rotary_positions(step, frame)
        wanted = self.ahead[0][0]
        if self.frame is not frame or np.abs(wanted - self.turn).max() > AT_REST:
            legs += [*self._legs_to_ball(), *self._turn_legs(wanted)]
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

    def _rotary_positions(self, step: Workingstep, frame: AccessFrame) -> list[F64]:
        """Angles of the rotary axes, (n, 2) rad, at the points of each trajectory of a step; one row for a fixed axis.

        They are found for the whole step, since the shortest turn of one trajectory may leave no way into the next.
        Each trajectory begins at the angles at which the one before it ends, at the pole too.
        """
        up, axes, begins = np.array([[0.0, 0.0, 1.0]]), np.zeros((0, 3)), []
        for t in step.trajectories:
            own = (up if t.axes is None else t.axes) @ frame.rotation
            joined = len(axes) > 0 and bool(np.abs(axes[-1] - own[0]).max() <= AXIS_JUMP)
            begins.append((len(axes) - joined, len(own)))
            axes = np.vstack([axes, own[joined:]])
        turns = self.machine.follow(axes, self.turn)
        return [turns[i:i + n] for i, n in begins]

    def through(self, step: Workingstep) -> list[Leg]:
        """The trajectories of the step last entered, in the setup frame."""
        legs, frame = [], self.clamping.frames[step.access]
        gauge = self.clamping.gauges[step.tool.number]
        for t, ahead in zip(step.trajectories, self.ahead, strict=True):
            tips = t.points @ frame.rotation
            axis = frame.rotation[2] if t.axes is None else t.axes[0] @ frame.rotation
            if np.abs(self.machine.axes(self.turn[None])[0] - axis).max() > AXIS_JUMP:
                raise OutputError(f"{step.id}: the tool axis jumps between two trajectories", code="axis_jump",
                                  subjects=(step.id,), measured=axis.tolist(),
                                  limit=self.machine.axes(self.turn[None])[0].tolist(),
                                  remedy="turn the axis along a trajectory, or use a separate step")
            if t.axes is None:
                legs.append(replace(self._straight(t.motion, tips, t.feed), arcs=self._arcs(t.arcs, frame)))
            else:
                tips, turns = self.machine.course(tips, t.axes @ frame.rotation, 0.5 * step.chordal_tolerance,
                                                  MAX_AXIS_DEVIATION, gauge, ahead)
                legs.append(Leg(t.motion, tips, self.machine.axes(turns), turns, t.feed))
                self.turn = turns[-1]
            self.tip = tips[-1]
        return legs

    def _arcs(self, arcs: tuple[ArcSpan, ...], frame: AccessFrame) -> tuple[ArcSpan, ...]:
        """The arcs of an access in the setup frame; none unless the rotary axes stand at zero."""
        if not arcs or np.abs(self.turn).max() > AT_REST:
            return ()
        centres = np.array([[*a.centre, 0.0] for a in arcs]) @ frame.rotation
        return tuple(replace(a, centre=(x, y)) for a, (x, y, _) in zip(arcs, centres.tolist(), strict=True))

    def home(self) -> list[Leg]:
        """Moves back to the place of tool changes."""
        return [*self._legs_to_ball(), *self._turn_legs(np.zeros(2))]

    def _straight(self, motion: TrajectoryKind, tips: F64, feed: float) -> Leg:
        turns = np.tile(self.turn, (len(tips), 1))
        return Leg(motion, tips, self.machine.axes(turns), turns, feed)

    def _legs_to_ball(self) -> list[Leg]:
        """Up along the tool axis to the plane that touches the ball, and across to the point of contact."""
        axis = self.machine.axes(self.turn[None])[0]
        goal = self.clamping.centre + _turn_radius(self.clamping) * axis
        up = float((goal - self.tip) @ axis)
        level = self.tip + up * axis if up > 0.0 else goal - up * axis  # from above: across first, then down
        path = np.array([self.tip, level, goal])
        self.tip = goal
        far = np.linalg.norm(np.diff(path, axis=0), axis=1) > GRID
        keep = np.array([True, far[0], far[1]])
        return [self._straight(TrajectoryKind.RAPID, path[keep], 0.0)] if keep[1:].any() else []

    def _turn_legs(self, wanted: F64) -> list[Leg]:
        """The turn to the wanted angles, with the tip on the ball."""
        size = float(np.abs(wanted - self.turn).max())
        if size <= AT_REST:
            return []
        share = np.linspace(0.0, 1.0, math.ceil(size / self.clamping.step) + 1)[:, None]
        turns = (1.0 - share) * self.turn + share * wanted
        axes = self.machine.axes(turns)
        tips = self.clamping.centre + _turn_radius(self.clamping) * axes
        self.tip, self.turn = tips[-1], turns[-1]
        return [Leg(TrajectoryKind.RAPID, tips, axes, turns, 0.0)]


def _turn_radius(clamping: Clamping) -> float:
    """mm from the centre of the ball: the chords of a turn stay outside the ball from there on."""
    return clamping.radius / math.cos(clamping.step) + BALL_CLEARANCE


__all__ = ["Leg", "ClampedStep", "each_clamped_step", "home_of", "clamped_steps"]
