"""What a control needs and the words it uses: those of RS-274 [Kramer2000], where a dialect has no other.

``output.gcode.program_writer`` calls a dialect, which keeps no state between calls. It returns lines of a program.
Lengths
are whole grid steps or text, speeds and feeds are text.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from output.header_text import ascii_text, decimal
from output.program_grid import PER_MM, GridArc

LABELS = 99
"""Labels of parts of a step count from 0 on, the places behind the words for a start there from this number down."""

UP_THE_TOOL = 50.0
"""mm above the tip; there the smoothing of the tool axis may move the tool by the path tolerance."""

ZEROS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
"""Names of the work offsets in a setup, from the first on."""


def axis_tolerance(tolerance: str) -> str:
    """Tolerance of the tool axis in degrees, for a path tolerance in mm.

    >>> axis_tolerance("0.001")
    '0.0011'
    """
    return decimal(max(math.degrees(float(tolerance) / UP_THE_TOOL), 1.0 / PER_MM))


@dataclass(frozen=True)
class Switches:
    """Settings that differ between machines with the same control.

    high_speed : the control has fast contouring as an option (G05.1 Q1, CYCLE832), and programs use it
    haas_tcp   : word of tool centre point control on a Haas: 'G234' or 'G43.4'
    planes     : a Heidenhain cuts with a fixed tool axis in a tilted plane (PLANE SPATIAL)
    swivel     : name of the swivel data record with which a Siemens does the same (CYCLE800), '' for its only one;
                 None:
                 it does not
    """

    high_speed: bool = False
    haas_tcp: str = "G234"
    planes: bool = False
    swivel: str | None = None


def about_x(angle: float) -> F64:
    """Rotation about X, right-handed.

    angle : rad

    Returns (3, 3) float64, dimensionless, coordinates of the frame in which it turns.
    """
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle: float) -> F64:
    """Rotation about Y, right-handed.

    angle : rad

    Returns (3, 3) float64, dimensionless, coordinates of the frame in which it turns.
    """
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def coolant(wet: bool) -> str:
    """The word that turns coolant on or off."""
    return "M8" if wet else "M9"


class Dialect:
    """One control. Methods return lines unless their docstring says otherwise.

    name    : in ``machine.dialects`` and in file names;  title : in headers;  ending : of files, without the point
    line    : longest line, characters
    zeros   : words for the zeros of ``ZEROS``, in that order
    path    : header line 'Path mode ...' on how far the control may deviate from the path
    bounds_path : whether a word of the program bounds that deviation
    needs   : header lines on conditions of the machine that no word of the program sets
    needs_restart : the same, for programs of three axes with restart points
    needs_jumps : the same, for programs that jump over words
    restates : a program from the top executes ``ready`` of ``begun_again`` too
    """

    name = title = ending = ""
    line = 100
    zeros: tuple[str, ...] = ZEROS
    length_words = "G43 H is the tool number"
    tcp_words = ""
    bounds_path = True
    needs: tuple[str, ...] = ()
    needs_restart: tuple[str, ...] = ()
    needs_jumps: tuple[str, ...] = ()
    restates = False

    def __init__(self, switches: Switches) -> None:
        self.switches = switches

    # words

    def number(self, value: int) -> str:
        """A grid value, 0.0001 mm or deg, with its decimal point: 12.5, -0.01, 3."""
        whole, rest = divmod(abs(value), PER_MM)
        sign = "-" if value < 0 else ""
        return f"{sign}{whole}.{rest:04d}".rstrip("0") if rest else f"{sign}{whole}."

    def feed(self, value: str) -> str:
        """The feed word, mm/min."""
        return f"F{value}"

    def zero(self, work_offset: str) -> str:
        """The word for the zero that a setup names ``work_offset``.

        Raises
        ------
        OutputError
            bad_work_offset: the control has no such zero.
        """
        try:
            return self.zeros[ZEROS.index(work_offset)]
        except (ValueError, IndexError):
            raise OutputError(f"{self.title} has no work offset '{work_offset}'", code="bad_work_offset",
                              subjects=(work_offset,), remedy="use one of " + ", ".join(ZEROS)) from None

    def comment(self, text: str) -> list[str]:
        """``text`` as comments, ASCII, wrapped to the longest line."""
        plain = self.plain(ascii_text(text))
        parts = textwrap.wrap(plain, self.line - 4, break_on_hyphens=False) or [""]
        return [f"({p})" for p in parts]

    def plain(self, text: str) -> str:
        """One line of ASCII without characters that the control refuses in a comment."""
        return text.replace("(", "[").replace(")", "]")

    def path(self, tolerance: str) -> str:
        """Header line on the deviation that the control may make between two points."""
        return f"Path mode G64 P{tolerance}: the control may leave the written path by that much, in mm"

    # the whole

    def opening(self, name: str, low: Sequence[float], high: Sequence[float]) -> list[str]:
        """Lines before the header; ``low`` and ``high`` are corners of the stock box (3,), mm."""
        return ["%"]

    def numbered(self, number: int, words: str) -> list[str]:
        """Lines after ``opening``: number and comment of the program, where the control numbers programs."""
        return []

    def closing(self, name: str) -> list[str]:
        """Lines after the last tool is put away."""
        return ["M30", "%"]

    def text(self, lines: list[str]) -> str:
        """All lines as the text of the file."""
        return "\n".join(lines) + "\n"

    # states

    def label(self, step: str, number: int) -> list[str]:
        """Lines before a step at which it can be started."""
        return [f"N{number}"]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """Units, plane, absolute coordinates, feed per minute; all other functions off.

        tolerance : mm, allowed deviation of the path;  turns : whether the program has rotary words
        """
        return [f"G21 G17 G90 G94 G40 G49 G80 G64 P{tolerance}"]

    def state_zero(self, zero: str) -> list[str]:
        """Activate a zero, a word of ``zeros``."""
        return [zero]

    def aloft(self, letters: str) -> list[str]:
        """The spindle to machine zero, then the rotary axes (two letters) to 0."""
        return ["G53 G0 Z0.", "G0 " + " ".join(f"{letter}0." for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """Load a tool; its length counts from here on or from ``arrive``. ``speed`` in 1/min."""
        return [f"T{number} M6", f"G43 H{number}"]

    def fresh(self, number: int) -> list[str]:
        """Stop, so that the machinist replaces the cutter of the tool in the spindle; the spindle stands."""
        return [*self.comment(f"Fresh cutter in T{number}: change it and set its length"), "M0"]

    def spindle(self, speed: str, first: bool, wet: bool) -> list[str]:
        """Turn clockwise, 1/min. With ``first``, after a tool change, the coolant is set too.

        A block has one M word, since many controls accept no more.
        """
        return [f"S{speed} M3", *([coolant(wet)] if first else [])]

    def rise(self) -> list[str]:
        """Up to machine zero, before a step with the tool in the spindle, where ``stop`` leaves it low."""
        return []

    def up(self) -> list[str]:
        """After ``modes`` and the zero, at a restart point on three axes: the spindle to machine zero from any place.
        """
        return self.rise()

    def before_change(self) -> list[str]:
        """Before a tool is changed for another one, where the control does not go to a place for it by itself."""
        return []

    def stop(self) -> list[str]:
        """Spindle and coolant off, and the tool to where it can be changed."""
        return ["M5", "M9", *self.lift()]

    def lift(self) -> list[str]:
        """The tool to where it can be changed, while spindle and coolant stay on."""
        return []

    def lowered(self) -> list[str]:
        """After ``lift``, before the tool that stayed in the spindle goes down: its length, if ``arrive`` lacks it."""
        return []

    def jump(self, step: str, number: int) -> list[str]:
        """A jump to ``target``."""
        return [f"GOTO {number}"]

    def target(self, step: str, number: int) -> list[str]:
        """Where a program goes on that has run through the step before, and one that has been started at its label."""
        return [f"N{number}"]

    def begun_again(self, step: str, number: int, modes: list[str], load: list[str], ready: list[str]) -> list[str]:
        """Lines between two steps with one tool: the label of the second, and words that only a start there needs.

        step   : its id;  number : of its label
        modes  : lines of the modes and the zero
        load   : lines that bring the tool into the spindle
        ready  : lines of its length, speed, coolant and first height

        A program that runs from the top jumps over them.
        """
        behind = number // 100 * 100 + LABELS - number % 100
        return [*self.jump(step, behind), *self.label(step, number), *modes, *load, *ready, *self.target(step, behind)]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """Tool centre point control on; rotary axes stand at 0, the tip above the part."""
        return []

    def tcp_off(self) -> list[str]:
        """Tool centre point control off; rotary axes stand at 0, the tip above the part."""
        return []

    def restated(self, zero: str) -> list[str]:
        """Words to repeat after ``tcp_off`` before anything moves, with a tool in the spindle."""
        return []

    @property
    def planes(self) -> bool:
        """Whether steps with a fixed tool axis are written in a plane perpendicular to it; the tip is kept throughout.
        """
        return False

    def plane_angles(self, axis: F64) -> tuple[float, float]:
        """Angles about X and Y of the plane perpendicular to a tool axis; see ``plane_axes``.

        axis : (3,) float64, unit, setup frame

        Returns rad.
        """
        return -math.asin(float(axis[1])), math.atan2(float(axis[0]), float(axis[2]))

    def plane_axes(self, first: float, second: float) -> F64:
        """Axes of the setup frame turned about its X by ``first``, then about its Y by ``second``, rad.

        Returns (3, 3) float64, unit; columns are X, Y, Z of the tilted plane in the setup frame.

        >>> np.round(Dialect(Switches()).plane_axes(np.radians(90.0), 0.0) @ [0.0, 0.0, 1.0], 9) + 0.0
        array([ 0., -1.,  0.])
        """
        return np.asarray(about_y(second) @ about_x(first))

    def plane_on(self, first: int, second: int) -> list[str]:
        """X, Y, Z count in the frame of ``plane_axes`` from here on, angles in grid steps of 0.0001 deg; no axis moves.
        """
        return []

    def plane_off(self) -> list[str]:
        """X, Y, Z count in the setup frame again; no axis moves."""
        return []

    # moves

    def arrive(self, number: int, row: str, tcp: bool) -> list[str]:
        """The first approach after a tool change, Z alone. ``tcp``: the control will keep the tip."""
        return [f"G0 {row}"]

    def straight(self, rows: list[str], rapid: bool, first: bool, feed: str) -> list[str]:
        """Straight blocks.

        rows  : words of the coordinates that change, one row a block
        first : the block before was of another kind;  feed : mm/min where it changes, else ''
        """
        words = [*(["G0" if rapid else "G1"] if first else []), rows[0], *([self.feed(feed)] if feed else [])]
        return [" ".join(words), *rows[1:]]

    def arc_modes(self) -> list[str]:
        """After ``modes`` in a program with arcs: I and J count from the start of an arc."""
        return []

    def arc(self, arc: GridArc, feed: str) -> list[str]:
        """An arc of less than half a turn, or a helix, in the XY plane. ``feed``: mm/min where it changes, else ''."""
        (x, y, z), (i, j) = arc.end, arc.offset
        words = [("X", x), ("Y", y), *([("Z", z)] if z != arc.start[2] else []), ("I", i), ("J", j)]
        return [" ".join(["G3" if arc.left else "G2", *(a + self.number(v) for a, v in words),
                          *([self.feed(feed)] if feed else [])])]

    def timed(self, rows: list[str], per_minute: Sequence[float]) -> list[str]:
        """Feed blocks with inverse-time feed: how often each block fits into a minute."""
        blocks = (f"G1 {row} {self.feed(decimal(f, 4))}" for row, f in zip(rows, per_minute, strict=True))
        return ["G93", *blocks, "G94"]
