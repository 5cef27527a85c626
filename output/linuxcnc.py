"""LinuxCNC programs: three axes or five, millimetres, the tool tip in the work offset.

The shape of a program: header comments for the machinist, one safe block, then
per tool the change and per workingstep a comment and its moves. Nothing is
added to a planned path and nothing is taken from it but points that are equal
on the grid of ``output.grid``. Between steps that do not join, the writer goes
up to the clearance plane, across, and down, one after the other.

Path mode: G64 P, not G61. G61 brakes at every corner of a polyline with
thousands of short segments and leaves dwell marks; G64 without P would round
corners as far as the acceleration needs. ``P`` is the largest distance from
the programmed path, and is kept at or below half the chordal tolerance.

Rotary axes. A job of one clamping is one program: XYZ stay the tip in the setup
frame, the control keeps it there (M428) from before the way down to the part
until the tool is back above it, and rotary words stand in the rapids that turn.
A control that cannot do that gets the linear joints instead, with the pivots
they were computed from in the header; what turns in the cut is then timed
block by block (G93). Tools are changed with both rotary axes at zero.
"""

from __future__ import annotations

import re
import textwrap

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from geometry.toolbody import ToolBody
from output.clamping import Leg, Section, home_of, sections
from output.grid import GRID, I64, PER_MM, check_plan, grid_path, link, to_grid
from output.model import Clamping, Workplan
from output.text import ascii_text, decimal, face_words, height_word, step_title, tool_name
from toolpath.motion import Motion, Trajectory, Workingstep

LINE = 100
"""Longest line of a program, characters."""

LEAST_BELOW = 0.01  # mm under the stock that nobody need be told of

_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
_ACTIVE = re.compile(r"^(msg|debug|print|log\w*|probe\w*|py|abort|warning)\s*[,;]", re.IGNORECASE)


def write_linuxcnc(plan: Workplan) -> str:
    """The program of one access direction, or of one clamping, for LinuxCNC.

    plan : lengths in mm, setup frame or those of its clamping; rapids move Z alone or XY alone there
    Returns the text, ASCII, lines of at most 100 characters, newline at the end; every point reads back
    within 0.00005 mm of the plan on each axis.
    Raises OutputError for an empty plan, an unknown work offset, a rapid that moves XY and Z together,
    a path with a gap, a coordinate, feed or speed that is none, rotary axes that cannot stand as a step wants.
    """
    check_plan(plan)
    if plan.work_offset not in _OFFSETS:
        raise OutputError(f"LinuxCNC has no work offset '{plan.work_offset}'", code="bad_work_offset",
                          subjects=(plan.work_offset,), remedy="use one of " + ", ".join(_OFFSETS))
    tolerance = path_tolerance(plan)
    if plan.clamping is not None:
        turning, walked = _Turning(plan, plan.clamping), sections(plan)
        turning.lines += ["%", *_header(plan, tolerance)]
        turning.run(walked, tolerance)
        return "\n".join(turning.lines) + "\n"
    program = _Program(plan)
    program.lines += ["%", *_header(plan, tolerance)]
    program.lines += [_safe_block(tolerance), plan.work_offset]
    for step in plan.steps:
        program.add_step(step)
    program.end()
    return "\n".join(program.lines) + "\n"


def _safe_block(tolerance: float) -> str:
    return f"G21 G17 G90 G94 G40 G49 G80 G64 P{decimal(tolerance)}"


def path_tolerance(plan: Workplan) -> float:
    """The P word of G64, mm: 0.001, less where half of the finest chordal tolerance of the plan is less."""
    chords = [s.chordal_tolerance for s in plan.steps if s.chordal_tolerance > 0.0]
    return max(GRID, min([0.001, *(0.5 * c for c in chords)]))


class _Program:
    """Lines so far and the modal state they leave the control in."""

    letters = "XYZ"

    def __init__(self, plan: Workplan) -> None:
        self.lines: list[str] = []
        self.clearance = int(to_grid(np.array([plan.clearance_plane]))[0])
        self.position: I64 | None = None
        self.tool: ToolBody | None = None
        self.motion = ""
        self.feed = ""
        self.speed = ""

    def add_step(self, step: Workingstep) -> None:
        path = grid_path(step)
        start = path[0][1][0]
        self.lines.append("")
        if step.tool != self.tool or step.fresh:
            self._change_tool(step)
        self.lines += _comment(_step_words(step))
        self._set_speed(step)
        self._go_to(start)
        for trajectory, points in path:
            self._follow(trajectory, points)
        self.position = path[-1][1][-1]

    def end(self) -> None:
        self._retract()
        self.lines += ["M5", "M9", "M30", "%"]

    def _change_tool(self, step: Workingstep) -> None:
        if self.tool is not None:
            self._retract()
            self.lines += ["M5", "M9"]
        self._put_in(step)

    def _put_in(self, step: Workingstep) -> None:
        """The tool of a step; for a fresh cutter it is put away first, as the control takes no tool that it has."""
        tool = step.tool
        self.lines += _comment(tool_name(tool))
        if step.fresh:
            self.lines += ["T0 M6", *_comment(f"Fresh cutter in T{tool.number}: change it and set its length"), "M0"]
        self.lines += [f"T{tool.number} M6", f"G43 H{tool.number}"]
        self.tool, self.position, self.motion, self.feed, self.speed = tool, None, "", "", ""

    def _set_speed(self, step: Workingstep) -> None:
        speed = f"S{decimal(step.spindle_rpm, 0)}"
        if speed != self.speed:
            self.lines.append(f"{speed} M3" if self.speed else f"{speed} M3 M8")
            self.speed = speed

    def _retract(self) -> None:
        """Up to the clearance plane; never down to it."""
        if self.position is not None and self.position[2] < self.clearance:
            self._rapid([None, None, self.clearance])
            self.position = np.array([*self.position[:2], self.clearance])

    def _go_to(self, start: I64) -> None:
        """To the first point of a step: Z to the clearance plane, XY, Z."""
        if self.position is None:  # after a tool change: only the control knows where the tool is
            level = max(self.clearance, int(start[2]))
            self._rapid([None, None, level])
            self._rapid([int(start[0]), int(start[1]), None])
            self.position = np.array([*start[:2], level])
        points = link(self.position, start, self.clearance)
        if len(points) > 1:
            rows = _rows(points, self.letters)
            self.lines += [" ".join([*self._mode("G0"), rows[0]]), *rows[1:]]
        self.position = start

    def _rapid(self, target: list[int | None]) -> None:
        words = [a + _number(v) for a, v in zip(self.letters, target, strict=True) if v is not None]
        self.lines.append(" ".join([*self._mode("G0"), *words]))

    def _mode(self, word: str) -> list[str]:
        if word == self.motion:
            return []
        self.motion = word
        return [word]

    def _follow(self, trajectory: Trajectory, points: I64) -> None:
        """One line a point, with the words that change; the first point is where the tool stands."""
        if len(points) < 2:
            return
        rows = _rows(points, self.letters)
        if trajectory.motion is Motion.RAPID:
            rows[0] = " ".join([*self._mode("G0"), rows[0]])
        else:
            rows[0] = " ".join([*self._mode("G1"), rows[0], *self._feed(trajectory.feed)])
        self.lines += rows

    def _feed(self, feed: float) -> list[str]:
        word = f"F{decimal(feed, 1 if feed >= 1.0 else 4)}"
        tail = [] if word == self.feed else [word]
        self.feed = word
        return tail


class _Turning(_Program):
    """A program whose columns are X, Y, Z and the two rotary axes, grid units, 0.0001 mm and 0.0001 deg."""

    def __init__(self, plan: Workplan, clamping: Clamping) -> None:
        super().__init__(plan)
        self.plan, self.clamping, self.machine = plan, clamping, clamping.machine
        self.letters = "XYZ" + self.machine.letters
        self.home = home_of(clamping)

    def run(self, walked: list[Section], tolerance: float) -> None:
        """All lines after the header."""
        tcp = ["M429"] if self.machine.tcp else []
        zero = "G0 " + " ".join(f"{letter}0." for letter in self.machine.letters)
        self.lines += [*_comment("The spindle goes up to machine zero before the rotary axes turn to 0"),
                       _safe_block(tolerance), *tcp, self.plan.work_offset, "G53 G0 Z0.", zero]
        for section in walked:
            self._add(section)
        self.lines += ["M5", "M9", "M30", "%"]

    def _add(self, section: Section) -> None:
        step = section.step
        self.lines.append("")
        if section.fresh:
            if self.tool is not None:
                self.lines += ["M5", "M9"]
            self._put_in(step)
        self.lines += _comment(_step_words(step))
        self._set_speed(step)
        if section.fresh:
            self._arrive()
        for leg in (*section.before, *section.legs, *section.after):
            self._walk(leg)
        if section.last and self.machine.tcp:
            self.lines.append("M429")
            self.motion = ""

    def _arrive(self) -> None:
        """From wherever the control left the tool to above the part, both rotary axes at zero."""
        at = to_grid(self.home)
        self._rapid([None, None, int(at[2]), None, None])
        self._rapid([int(at[0]), int(at[1]), None, None, None])
        if self.machine.tcp:
            self.lines.append("M428")
            self.motion = ""
        self.position = np.array([*at, 0, 0], dtype=np.int64)

    def _walk(self, leg: Leg) -> None:
        """The blocks of a leg; it begins where the tool stands."""
        turns = to_grid(np.degrees(leg.turns))
        gauge = 0.0 if self.tool is None else self.clamping.gauges[self.tool.number]
        linear = leg.tips if self.machine.tcp else self.machine.joints(leg.tips, np.radians(turns * GRID), gauge)
        points = np.column_stack([to_grid(linear), turns])
        if self.position is not None:
            points[0] = self.position
        in_time = not self.machine.tcp and leg.motion is not Motion.RAPID and leg.is_turning
        self.position = points[-1]
        moved = (points[1:] != points[:-1]).any(axis=1)
        rows = [row for row in _rows(points, self.letters) if row]
        if not rows:
            return
        if in_time:
            length = np.maximum(np.linalg.norm(np.diff(leg.tips, axis=0), axis=1)[moved], GRID)
            per_minute = (leg.feed / length).tolist()
            timed = [f"G1 {row} F{decimal(f, 4)}" for row, f in zip(rows, per_minute, strict=True)]
            self.lines += ["G93", *timed, "G94"]
            self.motion, self.feed = "", ""
            return
        rapid = leg.motion is Motion.RAPID
        tail = [] if rapid else self._feed(leg.feed)
        rows[0] = " ".join([*self._mode("G0" if rapid else "G1"), rows[0], *tail])
        self.lines += rows


def _rows(points: I64, letters: str) -> list[str]:
    """Coordinate words of points[1:], only those that differ from the point before."""
    moved = np.diff(points, axis=0) != 0
    columns = []
    for axis, letter in enumerate(letters):
        words = [""] * len(moved)
        where = np.flatnonzero(moved[:, axis])
        for i, value in zip(where.tolist(), points[1:, axis][where].tolist(), strict=True):
            words[i] = letter + _number(value)
        columns.append(words)
    return [" ".join(filter(None, row)) for row in zip(*columns, strict=True)]


def _number(value: int) -> str:
    """A grid value in mm with its decimal point: 12.5, -0.01, 3."""
    whole, rest = divmod(abs(value), PER_MM)
    sign = "-" if value < 0 else ""
    return f"{sign}{whole}.{rest:04d}".rstrip("0") if rest else f"{sign}{whole}."


def _comment(text: str) -> list[str]:
    """``text`` as LinuxCNC comments: ASCII, no parentheses inside, never one of the comments that act."""
    plain = ascii_text(text).replace("(", "[").replace(")", "]")
    parts = textwrap.wrap(plain, LINE - 4, break_on_hyphens=False) or [""]
    parts = [f"- {p}" if _ACTIVE.match(p) else p for p in parts]
    return [f"({p})" for p in parts]


def _header(plan: Workplan, tolerance: float) -> list[str]:
    low, high = plan.stock.lower, plan.stock.upper
    box = ", ".join(f"{a} {decimal(low[i], 3)} to {decimal(high[i], 3)}" for i, a in enumerate("XYZ"))
    texts = [
        f"Program {plan.name}, zonemill {plan.version}, LinuxCNC, {_axes_words(plan)}",
        f"Part sha256 {plan.part_sha256[:16]}, setup sha256 {plan.setup_sha256[:16]}",
        *(f"Label {key}: {value}" for key, value in sorted(plan.labels.items())),
        f"Material {plan.material}",
        f"Units mm and mm/min. Work offset {plan.work_offset}. Program zero is the origin of the setup frame",
        f"XYZ is the tool tip{_only_at_zero(plan)}: set every tool length in the tool table, G43 H is the tool number",
        f"Stock box {box}",
        *_heights(plan),
        f"Path mode G64 P{decimal(tolerance)}: the control may leave the written path by that much, in mm",
        "Tools, all lengths in mm from the tip:",
        *(tool_name(t) for t in _tools_in_use(plan)),
        *plan.comments,
    ]
    return [line for text in texts for line in _comment(text)]


def _axes_words(plan: Workplan) -> str:
    return "3 axes" if plan.clamping is None else f"5 axes {plan.clamping.machine.kind}"


def _only_at_zero(plan: Workplan) -> str:
    return "" if plan.clamping is None or plan.clamping.machine.tcp else " at zero of the rotary axes only"


def _heights(plan: Workplan) -> list[str]:
    """Where rapids are free, how deep the tip goes, and what a machine with rotary axes has to know."""
    c = plan.clamping
    if c is None:
        return [f"Clearance plane Z {decimal(plan.clearance_plane, 3)}: above it rapids in XY are free", _lowest(plan)]
    x, y, z = c.centre.tolist()
    ball = f"({decimal(x, 3)}, {decimal(y, 3)}, {decimal(z, 3)}), radius {decimal(c.radius, 3)}"
    out = [f"Part, stock and fixtures lie in the ball round {ball}: the tool turns outside it", _lowest(plan),
           *(f"Access {name}, tool axis " + " ".join(decimal(v, 6) for v in f.rotation[2].tolist()) + ": "
             + " ".join(f"{letter}{decimal(float(np.degrees(v)), 4)}" for letter, v in
                        zip(c.machine.letters, c.machine.follow(f.rotation[2:], np.zeros(2))[0], strict=True))
             + ", or tilted the other way with C half a turn on; and whole turns of C" for name, f in c.frames.items())]
    if c.machine.tcp:
        return [*out, "M428: the control keeps the tool tip on the part while axes turn; M429: it does not any more"]
    pivots = "; ".join(" ".join(decimal(v, 4) for v in p) for p in c.machine.pivots or ())
    long = ", ".join(f"T{n} {decimal(g, 4)}" for n, g in sorted(c.gauges.items()))
    head = f" and gauge lengths {long}" if c.machine.tilts_head else ""
    return [*out, "XYZ are linear joints where rotary axes stand off 0",
            f"Made only for pivots {pivots} mm{head}"]


def _lowest(plan: Workplan) -> str:
    """How deep the tip goes, for whoever sets the part on a table."""
    lowest = min(float((t.points @ _into_setup(plan, s.access))[:, 2].min()) for s in plan.steps
                 for t in s.trajectories)
    below = float(plan.stock.lower[2]) - lowest
    more = f", {decimal(below, 3)} below the stock box: nothing may stand there" if below > LEAST_BELOW else ""
    return f"Lowest Z of the tip {decimal(lowest, 3)}{more}"


def _into_setup(plan: Workplan, access: str) -> F64:
    """(3, 3): points (n, 3) of the frame of an access, times this, are in the setup frame."""
    return np.eye(3) if plan.clamping is None else plan.clamping.frames[access].rotation


def _tools_in_use(plan: Workplan) -> list[ToolBody]:
    return sorted({s.tool.number: s.tool for s in plan.steps}.values(), key=lambda t: t.number)


def _step_words(step: Workingstep) -> str:
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
