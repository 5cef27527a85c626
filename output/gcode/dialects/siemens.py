"""Siemens Sinumerik 840D.

Tool 1 is T1 of the magazine; its first cutting edge D1 holds the length. ADIS (G641) bounds the rounding of corners, or
CYCLE832 where the shop has it. TRAORI keeps the tip. Rotary words are angles of the machine axes, which move evenly
(ORIAXES, ORIMKS). Frames of the program are off before. The zero is stated again after every change of the
transformation. Where the shop wants it, steps with a fixed tool axis are in a plane swivelled by CYCLE800, with TRAORI
on and the axes already in place. The cycle turns axis by axis, X then the new Y (mode 57), with direction 0, so that it
turns the coordinates and moves no axis.
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
        """After a semicolon."""
        return [f"; {c[1:-1]}" for c in super().comment(text)]

    def plain(self, text: str) -> str:
        """The control accepts all printable ASCII."""
        return text

    def path(self, tolerance: str) -> str:
        """Both words bound the deviation."""
        word = f"CYCLE832 {tolerance}" if self.switches.high_speed else f"G641 ADIS={tolerance}"
        return f"Path mode {word}: the control may leave the written path by that much, in mm"

    def opening(self, name: str, low: object, high: object) -> list[str]:
        """Nothing: the file name is the name of the program."""
        return []

    def closing(self, name: str) -> list[str]:
        """End of the program."""
        return ["M30"]

    def label(self, step: str, number: int) -> list[str]:
        """A label begins with two letters; the block search finds it by name."""
        return [f"STEP_{step}:"]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """Mode 1 is finishing; mode 11 adds a tolerance of the orientation in degrees."""
        way = f"G641 ADIS={tolerance} ADISPOS={tolerance}"
        if self.switches.high_speed:
            way = f"CYCLE832({tolerance},{f'11,{axis_tolerance(tolerance)}' if turns else '1,1'})"
        return ["G710 G17 G90 G94 G40", way, *(["CYCLE800()"] if turns and self.planes else [])]

    def aloft(self, letters: str) -> list[str]:
        """Without frames and tool lengths."""
        return ["SUPA G0 Z0 D0", "G0 " + " ".join(f"{letter}0" for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """With its first cutting edge."""
        return [f"T{number} M6", "D1"]

    def up(self) -> list[str]:
        """Without frames and tool lengths."""
        return ["SUPA G0 Z0 D0"]

    def lift(self) -> list[str]:
        """Up without frames and tool lengths."""
        return self.up()

    def lowered(self) -> list[str]:
        """D0 was for the way up."""
        return ["D1"]

    def jump(self, step: str, number: int) -> list[str]:
        """Forwards, to a label with a name."""
        return [f"GOTOF GO_{step}"]

    def target(self, step: str, number: int) -> list[str]:
        """A label like those of steps."""
        return [f"GO_{step}:"]

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """Zero and length are stated again after it."""
        return ["TRAORI", "ORIMKS ORIAXES", f"{zero} D1"]

    def tcp_off(self) -> list[str]:
        """Transformation off."""
        return ["TRAFOOF"]

    def restated(self, zero: str) -> list[str]:
        """TRAFOOF may leave the control without a zero (G500)."""
        return [f"{zero} D1"]

    @property
    def planes(self) -> bool:
        """A setting of the shop."""
        return self.switches.swivel is not None

    def plane_angles(self, axis: F64) -> tuple[float, float]:
        """Angles about X, then about the turned Y.

        axis : (3,) float64, unit, setup frame

        Returns rad.
        """
        return math.atan2(-float(axis[1]), float(axis[2])), math.asin(float(axis[0]))

    def plane_axes(self, first: float, second: float) -> F64:
        """Axes of the setup frame turned about its X by ``first``, then about the new Y by ``second``, rad.

        Returns (3, 3) float64, unit; columns are X, Y, Z of the tilted plane in the setup frame.
        """
        return np.asarray(about_x(first) @ about_y(second))

    def plane_on(self, first: int, second: int) -> list[str]:
        """No retract, a new plane, mode 57, no offsets, no direction."""
        angles = f"{self.number(first)},{self.number(second)},0"
        return [f'CYCLE800(0,"{self.switches.swivel}",0,57,0,0,0,{angles},0,0,0,0,0)']

    def plane_off(self) -> list[str]:
        """The frame only; TRAORI stays on."""
        return ["CYCLE800()"]
