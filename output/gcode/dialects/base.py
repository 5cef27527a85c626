"""What a control has to be told, and in which words: those of RS-274 where a dialect does not say otherwise.

A dialect is asked by ``output.gcode.program_writer`` and keeps nothing between two questions. What it answers are lines of a
program; lengths come as whole steps of the grid or as text, speeds and feeds as text.
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

UP_THE_TOOL = 50.0
"""mm above the tip at which a tool may leave its place by the path tolerance where its axis is smoothed too."""

ZEROS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
"""How a setup names the zeros of a control, from the first on."""


def axis_tolerance(tolerance: str) -> str:
    """Degrees the tool axis may leave its way by, for a path tolerance in mm.

    >>> axis_tolerance("0.001")
    '0.0011'
    """
    return decimal(max(math.degrees(float(tolerance) / UP_THE_TOOL), 1.0 / PER_MM))


@dataclass(frozen=True)
class Switches:
    """What shops set differently on machines of one control.

    high_speed : say the word for fast contouring (G05.1 Q1, CYCLE832) where the control has it as an option
    haas_tcp   : the word by which a Haas keeps the tip: 'G234' or 'G43.4'
    planes     : a Heidenhain cuts with a fixed tool axis in a plane tilted to it (PLANE SPATIAL)
    swivel     : so does a Siemens (CYCLE800); the name of its swivel data record, '' where it has one alone; None: it
                 does not
    """

    high_speed: bool = False
    haas_tcp: str = "G234"
    planes: bool = False
    swivel: str | None = None


def about_x(angle: float) -> F64:
    """(3, 3): turns right-handed about X by rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle: float) -> F64:
    """(3, 3): turns right-handed about Y by rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def coolant(wet: bool) -> str:
    """The word that turns it on or off."""
    return "M8" if wet else "M9"


class Dialect:
    """One control. Methods return lines unless they say otherwise.

    name    : in ``machine.dialects`` and in file names;  title : in headers;  ending : of files, without the point
    line    : longest line, characters
    zeros   : words for the zeros of ``ZEROS``, in that order
    path    : 'Path mode ...', what the header says of how far the control may leave the path
    bounds_path : whether a word of the program bounds it
    needs   : what the header says of the machine that no word of the program sees to
    needs_restart : and of a program of three axes with restart points besides
    """

    name = title = ending = ""
    line = 100
    zeros: tuple[str, ...] = ZEROS
    length_words = "G43 H is the tool number"
    tcp_words = ""
    bounds_path = True
    needs: tuple[str, ...] = ()
    needs_restart: tuple[str, ...] = ()

    def __init__(self, switches: Switches) -> None:
        self.switches = switches

    # words

    def number(self, value: int) -> str:
        """A grid value, 0.0001 mm or deg, with its decimal point: 12.5, -0.01, 3."""
        whole, rest = divmod(abs(value), PER_MM)
        sign = "-" if value < 0 else ""
        return f"{sign}{whole}.{rest:04d}".rstrip("0") if rest else f"{sign}{whole}."

    def feed(self, value: str) -> str:
        """The feed word for mm/min."""
        return f"F{value}"

    def zero(self, work_offset: str) -> str:
        """The word for the zero that a setup calls ``work_offset``; OutputError where the control has none such."""
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
        """One line of ASCII without what the control does not take in a comment."""
        return text.replace("(", "[").replace(")", "]")

    def path(self, tolerance: str) -> str:
        """What the header says of the way between two points."""
        return f"Path mode G64 P{tolerance}: the control may leave the written path by that much, in mm"

    # the whole

    def opening(self, name: str, low: Sequence[float], high: Sequence[float]) -> list[str]:
        """Before the header; corners of the stock box (3,), mm."""
        return ["%"]

    def numbered(self, number: int, words: str) -> list[str]:
        """Behind ``opening``: the number of the program and what it is, where the control has such numbers."""
        return []

    def closing(self, name: str) -> list[str]:
        """After the last tool is put away."""
        return ["M30", "%"]

    def text(self, lines: list[str]) -> str:
        """All lines as the file holds them."""
        return "\n".join(lines) + "\n"

    # states

    def label(self, step: str, number: int) -> list[str]:
        """Where a step can be started: lines before it."""
        return [f"N{number}"]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """Units, plane, absolute coordinates, feed by the minute, everything else off.

        tolerance : mm the control may leave the path by;  turns : the program has rotary words
        """
        return [f"G21 G17 G90 G94 G40 G49 G80 G64 P{tolerance}"]

    def state_zero(self, zero: str) -> list[str]:
        """Count from a zero, a word of ``zeros``."""
        return [zero]

    def aloft(self, letters: str) -> list[str]:
        """The spindle to machine zero, then the rotary axes (two letters) to 0."""
        return ["G53 G0 Z0.", "G0 " + " ".join(f"{letter}0." for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """Put a tool in, its length counted from here on or from ``arrive``; speed in 1/min."""
        return [f"T{number} M6", f"G43 H{number}"]

    def fresh(self, number: int) -> list[str]:
        """Stop for a fresh cutter in the place of the tool that is in the spindle, which stands still."""
        return [*self.comment(f"Fresh cutter in T{number}: change it and set its length"), "M0"]

    def spindle(self, speed: str, first: bool, wet: bool) -> list[str]:
        """Turn clockwise at 1/min; ``first``: and say whether the coolant runs, after a tool was taken.

        A block has one M word: many controls take no more.
        """
        return [f"S{speed} M3", *([coolant(wet)] if first else [])]

    def rise(self) -> list[str]:
        """Before a step with the tool that is in the spindle, where ``stop`` leaves it low: up to machine zero."""
        return []

    def up(self) -> list[str]:
        """Behind ``modes`` and the zero of a program of three axes that may be started there: the spindle to machine
        zero, wherever it stands."""
        return self.rise()

    def stop(self) -> list[str]:
        """Spindle and coolant off, and the tool to where it can be changed."""
        return ["M5", "M9"]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """From here on the control keeps the tip while rotary axes turn; they stand at 0, the tip over the part."""
        return []

    def tcp_off(self) -> list[str]:
        """It does not any more; rotary axes stand at 0, the tip over the part."""
        return []

    def restated(self, zero: str) -> list[str]:
        """What has to be said again after ``tcp_off``, with a tool in the spindle, before anything moves."""
        return []

    @property
    def planes(self) -> bool:
        """Whether steps of a fixed tool axis are written in a plane square to it; the tip is kept all along."""
        return False

    def plane_angles(self, axis: F64) -> tuple[float, float]:
        """rad about X and about Y that a plane square to a tool axis (3,), unit, is turned by; see ``plane_axes``."""
        return -math.asin(float(axis[1])), math.atan2(float(axis[0]), float(axis[2]))

    def plane_axes(self, first: float, second: float) -> F64:
        """(3, 3): columns are X, Y, Z of the setup frame turned about its X by ``first``, then about its Y, rad.

        >>> np.round(Dialect(Switches()).plane_axes(np.radians(90.0), 0.0) @ [0.0, 0.0, 1.0], 9) + 0.0
        array([ 0., -1.,  0.])
        """
        return np.asarray(about_y(second) @ about_x(first))

    def plane_on(self, first: int, second: int) -> list[str]:
        """From here on X, Y, Z count in the frame of ``plane_axes``, grid steps of 0.0001 deg; no axis moves."""
        return []

    def plane_off(self) -> list[str]:
        """They count in the setup frame again; no axis moves."""
        return []

    # moves

    def arrive(self, number: int, row: str, tcp: bool) -> list[str]:
        """The first way down after a tool was taken, Z alone; tcp: on a control that will keep the tip."""
        return [f"G0 {row}"]

    def straight(self, rows: list[str], rapid: bool, first: bool, feed: str) -> list[str]:
        """Straight blocks.

        rows  : words of the coordinates that change, one row a block
        first : the block before was of another kind;  feed : mm/min where it changes, else ''
        """
        words = [*(["G0" if rapid else "G1"] if first else []), rows[0], *([self.feed(feed)] if feed else [])]
        return [" ".join(words), *rows[1:]]

    def arc_modes(self) -> list[str]:
        """Behind ``modes`` in a program with arcs: I and J count from the start of an arc."""
        return []

    def arc(self, arc: GridArc, feed: str) -> list[str]:
        """An arc of less than half a turn, or a helix, in the XY plane; feed: mm/min where it changes, else ''."""
        (x, y, z), (i, j) = arc.end, arc.offset
        words = [("X", x), ("Y", y), *([("Z", z)] if z != arc.start[2] else []), ("I", i), ("J", j)]
        return [" ".join(["G3" if arc.left else "G2", *(a + self.number(v) for a, v in words),
                          *([self.feed(feed)] if feed else [])])]

    def timed(self, rows: list[str], per_minute: Sequence[float]) -> list[str]:
        """Feed blocks that say how often each would fit into a minute (inverse time)."""
        blocks = (f"G1 {row} {self.feed(decimal(f, 4))}" for row, f in zip(rows, per_minute, strict=True))
        return ["G93", *blocks, "G94"]
