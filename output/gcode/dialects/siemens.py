"""Siemens Sinumerik 840D.

Tool 1 is T1 of the magazine, its first cutting edge D1 holds the length. Corners are rounded by no more than ADIS
(G641), or as CYCLE832 is told where the shop has it. The tip is kept by TRAORI; rotary words are angles of the
machine's axes, which go evenly (ORIAXES, ORIMKS). Frames of the program are off before: the zero is stated again
after every change of the transformation. Where the shop wants it, steps of a fixed tool axis stand in a plane swivelled
by CYCLE800, TRAORI on and the axes already there: axis by axis, X then the new Y (mode 57), no direction (0), so that
it turns the coordinates and no axis.
"""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64
from output.gcode.dialects.base import Dialect, Switches, about_x, about_y, axis_tolerance


class Siemens(Dialect):
    """840D sl and ONE."""

    name, title, ending = "siemens", "Siemens 840D", "mpf"
    zeros = ("G54", "G55", "G56", "G57", "G505", "G506", "G507", "G508", "G509")
    needs: tuple[str, ...] = ("Machine zero of Z is taken to be the top of its travel",
                              "Needed on five axes, of a modulo axis: MD30455 bits 0 and 2 set, for its words go below "
                              "0 and over 360 deg and mean the shorter way")
    length_words = "D1 holds the length of its tool"
    tcp_words = "TRAORI: the control keeps the tool tip on the part while axes turn; TRAFOOF: it does not any more"

    def __init__(self, switches: Switches) -> None:
        super().__init__(switches)
        if switches.swivel is not None:
            self.needs += ("CYCLE800 with direction 0 under TRAORI has to turn the coordinates and to move no axis: "
                           "try it without a part first",)

    def number(self, value: int) -> str:
        """Without a point at the end."""
        return super().number(value).removesuffix(".")

    def comment(self, text: str) -> list[str]:
        """From a semicolon on."""
        return [f"; {c[1:-1]}" for c in super().comment(text)]

    def plain(self, text: str) -> str:
        """Everything is taken."""
        return text

    def path(self, tolerance: str) -> str:
        """Bounded either way."""
        word = f"CYCLE832 {tolerance}" if self.switches.high_speed else f"G641 ADIS={tolerance}"
        return f"Path mode {word}: the control may leave the written path by that much, in mm"

    def opening(self, name: str, low: object, high: object) -> list[str]:
        """Nothing: the name of the file is that of the program."""
        return []

    def closing(self, name: str) -> list[str]:
        """End of the program."""
        return ["M30"]

    def label(self, step: str, number: int) -> list[str]:
        """A label begins with two letters; the search for a block finds it by its name."""
        return [f"STEP_{step}:"]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """1 is finishing, 11 that with a tolerance of the orientation in degrees behind it; 1 there is no tolerance."""
        way = f"G641 ADIS={tolerance} ADISPOS={tolerance}"
        if self.switches.high_speed:
            way = f"CYCLE832({tolerance},{f'11,{axis_tolerance(tolerance)}' if turns else '1,1'})"
        return ["G710 G17 G90 G94 G40", way, *(["CYCLE800()"] if turns and self.planes else [])]

    def aloft(self, letters: str) -> list[str]:
        """Past all frames and lengths."""
        return ["SUPA G0 Z0 D0", "G0 " + " ".join(f"{letter}0" for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """With its first cutting edge."""
        return [f"T{number} M6", "D1"]

    def up(self) -> list[str]:
        """Past all frames and lengths."""
        return ["SUPA G0 Z0 D0"]

    def stop(self) -> list[str]:
        """Up past all frames and lengths."""
        return ["M5", "M9", "SUPA G0 Z0 D0"]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """The zero and the length are stated again behind it."""
        return ["TRAORI", "ORIMKS ORIAXES", f"{zero} D1"]

    def tcp_off(self) -> list[str]:
        """The transformation off."""
        return ["TRAFOOF"]

    def restated(self, zero: str) -> list[str]:
        """TRAFOOF may leave the control without a zero (G500)."""
        return [f"{zero} D1"]

    @property
    def planes(self) -> bool:
        """As the shop says."""
        return self.switches.swivel is not None

    def plane_angles(self, axis: F64) -> tuple[float, float]:
        """About X first, then about the Y that is turned with it."""
        return math.atan2(-float(axis[1]), float(axis[2])), math.asin(float(axis[0]))

    def plane_axes(self, first: float, second: float) -> F64:
        """(3, 3): columns are X, Y, Z of the setup frame turned about its X by ``first``, then about the new Y, rad."""
        return np.asarray(about_x(first) @ about_y(second))

    def plane_on(self, first: int, second: int) -> list[str]:
        """No way up, a new plane, mode 57, from the zero and to it, no direction."""
        angles = f"{self.number(first)},{self.number(second)},0"
        return [f'CYCLE800(0,"{self.switches.swivel}",0,57,0,0,0,{angles},0,0,0,0,0)']

    def plane_off(self) -> list[str]:
        """The frame alone; TRAORI stays."""
        return ["CYCLE800()"]
