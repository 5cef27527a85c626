"""LinuxCNC.

Path mode: G64 P, not G61. G61 brakes at every corner of a polyline with
thousands of short segments and leaves dwell marks; G64 without P would round
corners as far as the acceleration needs. Q0, for without a Q the control leaves
points out by P as well, and rounds the corners of what is left by P more. Tool centre point control is a switch
of the kinematics (M428, M429). A tool that is in the spindle is not changed by
its own T and M6, so a fresh cutter is taken by putting the old one away.
"""

from __future__ import annotations

import re

from output.gcode.dialects.base import Dialect

_ACTIVE = re.compile(r"^(msg|debug|print|log\w*|probe\w*|py|abort|warning)\s*[,;]", re.IGNORECASE)


class LinuxCnc(Dialect):
    """LinuxCNC 2.8 and later; its interpreter rs274 reads what is written here (``tests/contract``)."""

    name, title, ending = "linuxcnc", "LinuxCNC", "ngc"
    tcp_words = "M428: the control keeps the tool tip on the part while axes turn; M429: it does not any more"

    needs_restart = ("Every step begins at machine zero of Z, which is taken to be the top of its travel",)

    def comment(self, text: str) -> list[str]:
        """Never one of the comments that act."""
        return [f"(- {c[1:]}" if _ACTIVE.match(c[1:]) else c for c in super().comment(text)]

    def fresh(self, number: int) -> list[str]:
        """The tool is put away first, as the control takes no tool that it has."""
        return ["T0 M6", *super().fresh(number)]

    def spindle(self, speed: str, first: bool, wet: bool) -> list[str]:
        """Both M words in one block: they are of two groups."""
        return [" ".join(super().spindle(speed, first, wet))]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """A shift by G92 or G52 outlives the program that made it, and even the control's being switched off."""
        words = super().modes(tolerance, turns)
        return [*words[:-1], f"{words[-1]} Q0", "G92.1"]

    def path(self, tolerance: str) -> str:
        """Bounded by P, as Q is 0."""
        return f"Path mode G64 P{tolerance} Q0: the control may leave the written path by P, in mm"

    def arc_modes(self) -> list[str]:
        """G90.1 of a run before may still be in force."""
        return ["G91.1"]

    def rise(self) -> list[str]:
        """The control itself goes up to change a tool, but not for one that it has."""
        return ["G53 G0 Z0."]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """A switch of the kinematics."""
        return ["M428"]

    def tcp_off(self) -> list[str]:
        """A switch of the kinematics."""
        return ["M429"]
