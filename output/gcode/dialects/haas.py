"""Haas mills.

They are like Fanuc, with four differences. The word of tool centre point control is G234 on a UMC, or G43.4 on
controls
set up so. There are further work offsets (G154 P). The program itself bounds the rounding of corners (G187 E).
"""

from __future__ import annotations

from output.gcode.dialects.base import Switches
from output.gcode.dialects.fanuc import Fanuc


class Haas(Fanuc):
    """Next Generation Control."""

    name, title = "haas", "Haas"
    bounds_path = True
    needs: tuple[str, ...] = ("Machine zero of Z is taken to be the top of its travel",
                              "Needed: rapids go straight, by the setting of linear rapids")
    needs_jumps: tuple[str, ...] = ("Needed: the program in the memory of the control, for DNC does not jump (M99 P)",)
    zeros = ("G54", "G55", "G56", "G57", "G58", "G59", "G154 P1", "G154 P2", "G154 P3")

    def __init__(self, switches: Switches) -> None:
        super().__init__(Switches(False, switches.haas_tcp))  # G187 is not an option
        self.tcp_word = switches.haas_tcp
        self.tcp_words = (f"{self.tcp_word}: the control keeps the tool tip on the part while axes turn; G49: it does "
                          "not any more")

    def path(self, tolerance: str) -> str:
        """E bounds the deviation."""
        return f"Path mode G187 E{tolerance}: the control may leave the written path by that much, in mm"

    def jump(self, step: str, number: int) -> list[str]:
        """M99 with P, since GOTO needs the option of macros."""
        return [f"M99 P{number}"]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """P3 is the smoothness for finishing."""
        return ["G21", "G17 G90 G94 G40 G80", *self.home(), "G49", f"G187 P3 E{tolerance}"]
