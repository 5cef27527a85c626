"""LinuxCNC.

Path mode is G64 P, not G61: G61 brakes at every corner of a polyline of many short segments and leaves dwell marks. G64
without P rounds corners as far as the acceleration needs. Q0 is stated because without Q the control drops points
within P and then rounds the corners of the rest by P again. Tool centre point control is a switch of the kinematics
(M428, M429). T and M6 do not change a tool that is already in the spindle, so the program first puts it away to get a
fresh cutter.

Run from line reads all lines before it without moving, then takes tool, spindle and place from the machine. So no
jump tells a start at a step from a run through it, but the tool in the spindle does: it is called only where it is not
in the spindle. Speed, coolant, length and modes are stated at every step; stated again they change nothing.
"""

from __future__ import annotations

import re

from output.gcode.dialects.base import Dialect

_ACTIVE = re.compile(r"^(msg|debug|print|log\w*|probe\w*|py|abort|warning)\s*[,;]", re.IGNORECASE)


class LinuxCnc(Dialect):
    """LinuxCNC 2.8 and later; its interpreter rs274 reads these programs (``tests/contract``)."""

    name, title, ending = "linuxcnc", "LinuxCNC", "ngc"
    tcp_words = "M428: the control keeps the tool tip on the part while axes turn; M429: it does not any more"

    needs_restart = ("Tools are changed at machine zero of Z, which is taken to be the top of its travel",)
    restates = True

    def comment(self, text: str) -> list[str]:
        """Never one of the active comments."""
        return [f"(- {c[1:]}" if _ACTIVE.match(c[1:]) else c for c in super().comment(text)]

    def fresh(self, number: int) -> list[str]:
        """The tool is put away first, since the control does not load a tool that it holds."""
        return ["T0 M6", *super().fresh(number)]

    def spindle(self, speed: str, first: bool, wet: bool) -> list[str]:
        """Both M words in one block: they belong to two groups."""
        return [" ".join(super().spindle(speed, first, wet))]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """G92.1, since a shift by G92 or G52 outlives its program and even a restart of the control."""
        words = super().modes(tolerance, turns)
        return [*words[:-1], f"{words[-1]} Q0", "G92.1"]

    def path(self, tolerance: str) -> str:
        """P bounds the deviation, as Q is 0."""
        return f"Path mode G64 P{tolerance} Q0: the control may leave the written path by P, in mm"

    def arc_modes(self) -> list[str]:
        """G91.1, since G90.1 of an earlier run may still be active."""
        return ["G91.1"]

    def rise(self) -> list[str]:
        """To the top of the travel."""
        return ["G53 G0 Z0."]

    def before_change(self) -> list[str]:
        """The control changes the tool where the spindle stands unless its configuration names a place."""
        return self.rise()

    def begun_again(self, step: str, number: int, modes: list[str], load: list[str], ready: list[str]) -> list[str]:
        """The tool is loaded where it is not in the spindle. G49 is left out, because a length follows in any case."""
        tool = load[-1].split()[0].removeprefix("T")
        called = [f"o{number} if [#<_current_tool> NE {tool}]", *(f"  {x}" for x in load), f"o{number} endif"]
        return [*self.label(step, number), *(x.replace(" G49", "") for x in modes), *called, *ready]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """A switch of the kinematics."""
        return ["M428"]

    def tcp_off(self) -> list[str]:
        """A switch of the kinematics."""
        return ["M429"]
