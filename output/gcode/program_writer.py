"""Programs for any control: the order of comments, modes, tool changes and moves, in the language of a dialect.

A program has header comments for the machinist and the modes. Each tool then has its change, and each workingstep a
comment and its moves. The writer adds nothing to a planned path and drops only points that are equal on the grid of
``output.program_grid``. Between steps that do not join it goes up to the clearance plane, across, and down, one after
the other. The words are those of RS-274 [Kramer2000] where a dialect has no other.

Rotary axes: a job of one clamping is one program. XYZ remain the tip in the setup frame, and rotary words stand in the
rapids that turn. The control keeps the tip from before the first approach until after the last retract. A control
without this function gets the linear joints, and the header states their pivots. Cutting blocks that turn are then
timed one by one. Tools are changed with both rotary axes at zero.

Restart points: a program can be started at every step. Behind a label stand tool, length, zero, speed, coolant and tool
centre point control, as after a tool change. Between steps with one tool a program that runs from the top does not
execute them (``Dialect.begun_again``): it neither calls the tool nor stops the spindle. The step starts above the
clearance plane, or above the ball on a machine that turns.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import reduce

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from output.clamping_sequence import ClampedStep, Leg, clamped_steps, home_of
from output.gcode.dialects.base import Dialect
from output.gcode.program_header import header_lines
from output.header_text import decimal, face_words, height_word, step_title, tool_name
from output.program_grid import GRID, I64, GridArc, check_plan, grid_path, link, pieces, to_grid
from output.workplan import FIRST_NUMBER, Clamping, Workplan
from toolpath.workingsteps import ArcSpan, Trajectory, TrajectoryKind, Workingstep

UPRIGHT_TOLERANCE = 1e-6  # rad from Z, up to which no plane is tilted
_PARTED = re.compile("S[0-9]+([b-z]*)")  # ids of steps, and of their parts after a change to a fresh cutter


def write_program(plan: Workplan, dialect: Dialect) -> str:
    """The program of one access direction, or of one clamping.

    plan    : lengths in mm, setup frame or frames of its clamping; rapids move either Z or XY there
    dialect : of the control

    Returns ASCII text with a newline at the end and no line longer than ``dialect.line``. Every point reads back within
    0.00005 mm of the plan on each axis.

    OutputErrors come from ``check_plan``, ``grid_path``, ``Dialect.zero``, ``each_clamped_step`` and ``Dialect.timed``:
    an empty plan, a path with a gap, a rapid that moves XY and Z together, a missing work offset, rotary axes outside
    their
    limits, or a turning cut without inverse-time feed.
    """
    check_plan(plan)
    zero = dialect.zero(plan.work_offset)
    tolerance = decimal(path_tolerance(plan))
    steps = [] if plan.clamping is None else clamped_steps(plan)
    low, high = plan.stock.lower.tolist(), plan.stock.upper.tolist()
    head = [*dialect.opening(_program_title(plan), low, high), *dialect.numbered(plan.number, plan.number_words),
            *header_lines(plan, dialect, zero, tolerance)]
    if plan.clamping is not None:
        turning = _FiveAxisProgram(plan, dialect, zero, tolerance, plan.clamping)
        turning.run(steps)
        return dialect.text([*head, *turning.lines])
    program = _ThreeAxisProgram(plan, dialect, zero, tolerance)
    for step in plan.steps:
        program.add_step(step)
    program.end()
    return dialect.text([*head, *program.lines])


def path_tolerance(plan: Workplan) -> float:
    """Largest deviation that the program allows the control, mm.

    It is 0.001, or half of the finest chordal tolerance where that is smaller.
    """
    chords = [s.chordal_tolerance for s in plan.steps if s.chordal_tolerance > 0.0]
    return max(GRID, min([0.001, *(0.5 * c for c in chords)]))


class _ProgramText:
    """The lines so far, and the modal state of the control after them."""

    letters = "XYZ"

    def __init__(self, plan: Workplan, dialect: Dialect, zero: str, tolerance: str) -> None:
        self.plan, self.dialect, self.zero, self.tolerance = plan, dialect, zero, tolerance
        self.lines: list[str] = []
        self.position: I64 | None = None
        self.tool: ToolBody | None = None
        self.rapid: bool | None = None
        self.feed = self.speed = ""
        self.arcs = any(t.arcs for s in plan.steps for t in s.trajectories)

    def _put_in(self, step: Workingstep) -> None:
        """Load the tool of a step from the magazine, or replace a worn cutter."""
        tool, d = step.tool, self.dialect
        self.lines += d.comment(tool_name(tool))
        if step.fresh:
            self.lines += d.fresh(tool.number)
        self.lines += d.take(tool.number, decimal(step.spindle_rpm, 0))
        self.tool, self.position, self.rapid, self.feed, self.speed = tool, None, None, "", ""

    def _set_speed(self, step: Workingstep) -> None:
        speed = decimal(step.spindle_rpm, 0)
        if speed != self.speed:
            self.lines += self.dialect.spindle(speed, not self.speed, self.plan.coolant)
            self.speed = speed

    def _arrive(self, step: Workingstep, place: Sequence[int], tcp: bool) -> None:
        """First moves after a tool change: Z first, then across, since only the control knows where the tool is."""
        height = self.letters[2] + self.dialect.number(place[2])
        self.lines += self.dialect.arrive(step.tool.number, height, tcp)
        self.rapid = True
        self._straight([" ".join(a + self.dialect.number(v) for a, v in zip("XY", place, strict=False))], True)

    def _straight(self, rows: list[str], rapid: bool, feed: float = 0.0) -> None:
        """Straight blocks of one kind, with the words that change."""
        word = "" if rapid else self._changed(feed)
        self.lines += self.dialect.straight(rows, rapid, rapid is not self.rapid, word)
        self.rapid = rapid

    def _arc(self, arc: GridArc, feed: float) -> None:
        """The block or blocks of an arc; the next block states its kind again."""
        self.lines += self.dialect.arc(arc, self._changed(feed))
        self.rapid = None

    def _path_with_arcs(self, points: I64, arcs: Sequence[ArcSpan], feed: float) -> None:
        """A path with arcs; points (n, k) on the grid, the first is where the tool stands."""
        for piece in pieces(points, arcs):
            if isinstance(piece, GridArc):
                self._arc(piece, feed)
            else:
                self._straight(self._rows(piece), False, feed)

    def _changed(self, feed: float) -> str:
        """The feed as text where it differs from the one before, else ''."""
        word = decimal(feed, 1 if feed >= 1.0 else 4)
        if word == self.feed:
            return ""
        self.feed = word
        return word

    def _rows(self, points: I64) -> list[str]:
        """Coordinate words of points[1:], only those that differ from the point before."""
        moved = np.diff(points, axis=0) != 0
        columns, number = [], self.dialect.number
        for axis, letter in enumerate(self.letters[:points.shape[1]]):
            words = [""] * len(moved)
            where = np.flatnonzero(moved[:, axis])
            for i, value in zip(where.tolist(), points[1:, axis][where].tolist(), strict=True):
                words[i] = letter + number(value)
            columns.append(words)
        return [" ".join(filter(None, row)) for row in zip(*columns, strict=True)]

    def _label(self, step: Workingstep) -> None:
        if self.plan.restart:
            self.lines += self.dialect.label(step.id, label_number(self.plan, step))

    def _is_new(self, step: Workingstep) -> bool:
        """Whether a step needs another tool than the one in the spindle, or a fresh cutter."""
        return self.tool is None or step.tool != self.tool or step.fresh

    def _begun_again(self, step: Workingstep, modes: list[str], up: list[str], arrive: list[str]) -> None:
        """What a start at a step needs that goes on with the tool in the spindle.

        modes, up, arrive : lines of modes and zero, of the way up before a tool is called, and of the first approach
        """
        d, speed = self.dialect, decimal(step.spindle_rpm, 0)
        take = d.take(step.tool.number, speed)
        ready = [*take[1:], *d.spindle(speed, True, self.plan.coolant), *arrive]
        self.lines += d.begun_again(step.id, label_number(self.plan, step), modes, [*up, take[0]], ready)
        self.rapid, self.feed = None, ""
        if d.restates:
            self.speed = speed


class _ThreeAxisProgram(_ProgramText):
    """A program of three axes."""

    def __init__(self, plan: Workplan, dialect: Dialect, zero: str, tolerance: str) -> None:
        super().__init__(plan, dialect, zero, tolerance)
        self.clearance = int(to_grid(np.array([plan.clearance_plane]))[0])
        if not plan.restart:  # with restart points every step states the modes
            self.lines += self._modes()

    def _modes(self) -> list[str]:
        d = self.dialect
        return [*d.modes(self.tolerance, False), *(d.arc_modes() if self.arcs else []), *d.state_zero(self.zero)]

    def add_step(self, step: Workingstep) -> None:
        """A step, with the moves to it."""
        path = grid_path(step)
        start = path[0][1][0]
        self.lines.append("")
        kept = not self._is_new(step)
        if not kept:
            if self.tool is not None:
                self._retract()
                self.lines += self.dialect.stop()
            if self.plan.restart:
                self._label(step)
                self.lines += [*self._modes(), *self.dialect.up()]
            elif self.tool is not None and step.tool != self.tool:
                self.lines += self.dialect.before_change()
            self._put_in(step)
        here = self._part(step, start) if kept and self.plan.restart else None
        self.lines += self.dialect.comment(step_words(step))
        self._set_speed(step)
        if here is not None:
            self._go_across(here, start)
        self._go_to(step, start)
        for trajectory, points in path:
            self._follow(trajectory, points)
        self.position = path[-1][1][-1]

    def end(self) -> None:
        """Retract and end of the program."""
        self._retract()
        self.lines += [*self.dialect.stop(), *self.dialect.closing(_program_title(self.plan))]

    def _retract(self) -> None:
        """Up to the clearance plane; never down to it."""
        if self.position is not None and self.position[2] < self.clearance:
            self._straight([self.letters[2] + self.dialect.number(self.clearance)], True)
            self.position = np.array([*self.position[:2], self.clearance])

    def _part(self, step: Workingstep, start: I64) -> I64:
        """Above the step before, where a program from the top and one started at the label of a step come together.

        Returns the place of the first; the second is above any place, at the height of ``_height``.
        """
        d, height = self.dialect, self._height(start)
        here = np.zeros(3, dtype=np.int64) if self.position is None else self.position
        if here[2] < height:
            self._straight([self.letters[2] + d.number(height)], True)
            here = np.array([*here[:2], height])
        row = self.letters[2] + d.number(height)
        self._begun_again(step, self._modes(), d.up(), d.arrive(step.tool.number, row, False))
        if d.restates:
            self.rapid = True
        return here

    def _height(self, start: I64) -> int:
        """Height above the first point of a step at which the tool arrives, grid steps."""
        return max(self.clearance, int(start[2]))

    def _go_across(self, here: I64, start: I64) -> None:
        """Across to above the first point of a step, with both words, since a start at its label needs them."""
        d, height = self.dialect, self._height(start)
        self._straight([" ".join(a + d.number(v) for a, v in zip("XY", start.tolist(), strict=False))], True)
        if here[2] > height:
            self._straight([self.letters[2] + d.number(height)], True)
        self.position = np.array([*start[:2], height])

    def _go_to(self, step: Workingstep, start: I64) -> None:
        """Rapids to the first point of a step: Z to the clearance plane, XY, Z."""
        if self.position is None:
            place = [int(start[0]), int(start[1]), self._height(start)]
            self._arrive(step, place, False)
            self.position = np.array(place)
        points = link(self.position, start, self.clearance)
        if len(points) > 1:
            self._straight(self._rows(points), True)
        self.position = start

    def _follow(self, trajectory: Trajectory, points: I64) -> None:
        """One line a point, with the words that change; the first point is where the tool stands."""
        if trajectory.arcs:
            self._path_with_arcs(to_grid(trajectory.points), trajectory.arcs, trajectory.feed)
        elif len(points) > 1:
            self._straight(self._rows(points), trajectory.motion is TrajectoryKind.RAPID, trajectory.feed)


class _FiveAxisProgram(_ProgramText):
    """A program with the columns X, Y, Z and two rotary axes, grid steps of 0.0001 mm and 0.0001 deg."""

    def __init__(self, plan: Workplan, dialect: Dialect, zero: str, tolerance: str, clamping: Clamping) -> None:
        super().__init__(plan, dialect, zero, tolerance)
        self.clamping, self.machine = clamping, clamping.machine
        self.letters = "XYZ" + self.machine.letters
        self.home = home_of(clamping)
        self.plane: F64 | None = None  # columns are the axes of the tilted plane in the setup frame
        self.place = np.zeros(3, dtype=np.int64)  # tip in the tilted plane, grid steps

    def run(self, steps: list[ClampedStep]) -> None:
        """All lines after the header."""
        self.lines += self.dialect.comment("The spindle goes up to machine zero before the rotary axes turn to 0: Z0 "
                                           "there is taken to be the top of its travel")
        if not self.plan.restart:
            self.lines += self._modes()
        for clamped in steps:
            self._add_step(clamped)
        self.lines += [*self.dialect.stop(), *self.dialect.closing(_program_title(self.plan))]

    def _modes(self) -> list[str]:
        d = self.dialect
        return [*d.modes(self.tolerance, True), *(d.arc_modes() if self.arcs else []),
                *(d.tcp_off() if self.machine.tcp else []), *d.state_zero(self.zero), *d.aloft(self.machine.letters)]

    def _add_step(self, clamped: ClampedStep) -> None:
        step = clamped.step
        self.lines.append("")
        if clamped.fresh:
            self._begin(step)
        self.lines += self.dialect.comment(step_words(step))
        self._set_speed(step)
        if clamped.fresh:
            at = to_grid(self.home).tolist()
            self._arrive(step, at, self.machine.tcp)
            if self.machine.tcp:
                self.lines += self.dialect.tcp_on(step.tool.number, self.zero)
                self.rapid = None
            self.position = np.array([*at, 0, 0], dtype=np.int64)
        for leg in clamped.before:
            self._write_leg(leg)
        self._in_plane(clamped.legs)
        for leg in clamped.after:
            self._write_leg(leg)
        if clamped.last and self.machine.tcp:
            self.lines += [*self.dialect.tcp_off(), *self.dialect.restated(self.zero)]
            self.rapid = None

    def _begin(self, step: Workingstep) -> None:
        """A step that begins above the ball: its tool is loaded, or stays in the spindle."""
        if not self._is_new(step):
            self.lines += self.dialect.lift()
            self.position, self.rapid, self.feed = None, None, ""
            if self.plan.restart:
                self._begun_again(step, self._modes(), [], [])
            else:  # another speed
                self.lines += self.dialect.rise()
            self.lines += self.dialect.lowered()
            return
        if self.tool is not None:
            self.lines += self.dialect.stop()
        if self.plan.restart:
            self._label(step)
            self.lines += self._modes()
        elif self.tool is not None and step.tool != self.tool:
            self.lines += self.dialect.before_change()
        self._put_in(step)

    def _in_plane(self, legs: Sequence[Leg]) -> None:
        """The moves of a step; in a tilted plane where its axis is fixed and tilted and the dialect wants it."""
        axis = legs[0].axes[0]
        flat = not any(leg.is_turning for leg in legs) and float(np.hypot(*axis[:2])) > UPRIGHT_TOLERANCE
        if flat and self.dialect.planes and self.machine.tcp:
            first, second = to_grid(np.degrees(self.dialect.plane_angles(axis))).tolist()
            self.plane = self.dialect.plane_axes(np.radians(first * GRID), np.radians(second * GRID))
            self.place = to_grid(legs[0].tips[0] @ self.plane)
            self.lines += self.dialect.plane_on(first, second)
            self.rapid = None
        for leg in legs:
            self._write_leg(leg)
        if self.plane is not None:
            self.plane, self.rapid = None, None
            self.lines += self.dialect.plane_off()

    def _write_leg(self, leg: Leg) -> None:
        """The blocks of a leg; it begins where the tool stands."""
        turns = to_grid(self.machine.words(np.degrees(leg.turns)))
        gauge = 0.0 if self.tool is None else self.clamping.gauges[self.tool.number]
        linear = leg.tips if self.machine.tcp else self.machine.joints(
            leg.tips, np.radians(self.machine.words(np.asarray(turns * GRID, dtype=np.float64))), gauge)
        points = np.column_stack([to_grid(linear), turns])
        if self.position is not None:
            points[0] = self.position
        rapid = leg.motion is TrajectoryKind.RAPID
        in_time = not self.machine.tcp and not rapid and leg.is_turning
        self.position = points[-1]
        if leg.arcs:
            self._path_with_arcs(points, leg.arcs, leg.feed)
            return
        moved = (points[1:] != points[:-1]).any(axis=1)
        if self.plane is None:
            rows = [row for row in self._rows(points) if row]
        else:
            rows = self._planar(to_grid(leg.tips[1:] @ self.plane)[moved], leg.tips[1:][moved] @ self.plane)
        if not rows:
            return
        if in_time:
            length = np.maximum(np.linalg.norm(np.diff(leg.tips, axis=0), axis=1)[moved], GRID)
            self.lines += self.dialect.timed(rows, (leg.feed / length).tolist())
            self.rapid, self.feed = None, ""
            return
        self._straight(rows, rapid, leg.feed)

    def _planar(self, points: I64, places: F64) -> list[str]:
        """Rows of points (m, 3) in the tilted plane, grid steps; ``places`` are the same points in mm.

        A very short move may vanish on this grid. It then gets one step in its direction, so that a program has the
        same
        blocks with planes and without.
        """
        at = self.place
        for k in range(len(points)):
            if (points[k] == at).all():
                off = places[k] / GRID - at
                axis = int(np.argmax(np.abs(off)))
                points[k, axis] += 1 if off[axis] >= 0.0 else -1
            at = points[k]
        rows = self._rows(np.vstack([self.place, points]))
        self.place = at
        return rows


def label_number(plan: Workplan, step: Workingstep) -> int:
    """The N word of the restart point of a step: a hundred times the number in its id, plus the number of its part.

    It is the same in a program of some of the steps, unless the ids have another form.

    >>> from types import SimpleNamespace as S
    >>> plan = S(steps=[S(id="S07"), S(id="S07b"), S(id="S08")])
    >>> [label_number(plan, s) for s in plan.steps], label_number(S(steps=plan.steps[1:]), plan.steps[1])
    ([700, 701, 800], 701)
    """
    def number(name: str) -> str:
        return "".join(c for c in name if c.isdigit())

    own = 100 * int(number(step.id) or 0)
    if named := _PARTED.fullmatch(step.id):
        return own + reduce(lambda n, letter: 25 * n + ord(letter) - ord("a"), named[1], 0)
    same = [s.id for s in plan.steps if number(s.id) == number(step.id)]
    return own + same.index(step.id)


def _program_title(plan: Workplan) -> str:
    """The name for controls that know programs by names. They truncate names, so the number of a further one is first.
    """
    return plan.name if plan.number == FIRST_NUMBER else f"{plan.number} {plan.name}"


def step_words(step: Workingstep) -> str:
    """The comment before a step: its id, zone, strategy, tool, faces and heights."""
    zone = step.zone or "several zones"
    faces = face_words(step) or "no faces"
    words = [
        f"{step.id} {zone} {step.operation} {step.strategy} T{step.tool.number}: {faces}",
        f"{height_word(step)} {decimal(step.top, 3)} down to {decimal(step.bottom, 3)}",
    ]
    title = step_title(step)
    if any(w not in words[0] for w in title.split()):
        words.append(title)
    return "; ".join(words)


__all__ = ["label_number", "path_tolerance", "step_words", "write_program"]
