"""Heidenhain TNC, conversational.

Every block has its number, from 0 on. FMAX holds for one block only, so every rapid repeats it. Zeros are rows of the
preset table (cycle 247). Cycle 32 bounds the rounding of corners by its tolerance. M128 keeps the tip; it is off (M129)
before the spindle goes to machine zero (M91) and before a tool is called. Where the shop wants it, steps with a fixed
tool axis are in a tilted plane (PLANE SPATIAL), with M128 on and the axes already in place (STAY). Rotary words
continue
beyond 360 deg. An axis whose display does not may then turn back by a whole turn, depending on a machine parameter.
With
M126 it takes the shorter way, and no block turns by more than half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from geometry.errors import OutputError
from output.gcode.dialects.base import Dialect, axis_tolerance, coolant
from output.header_text import decimal
from output.program_grid import PER_MM, GridArc


class Heidenhain(Dialect):
    """TNC 320 to 640, TNC7."""

    name, title, ending = "heidenhain", "Heidenhain TNC", "h"
    zeros = tuple(f"preset {n}" for n in range(1, 10))
    needs = ("Machine zero of Z is taken to be the top of its travel",)
    length_words = "TOOL CALL counts the length of the tool table"
    tcp_words = "M128: the control keeps the tool tip on the part while axes turn; M129: it does not any more"

    def number(self, value: int) -> str:
        """With a sign."""
        text = super().number(value).removesuffix(".")
        return text if value < 0 else f"+{text}"

    def comment(self, text: str) -> list[str]:
        """After a semicolon."""
        return [f"; {c[1:-1]}" for c in super().comment(text)]

    def plain(self, text: str) -> str:
        """Without ~, which at the end of a line continues the block."""
        return text.replace("~", "-")

    def path(self, tolerance: str) -> str:
        """Cycle 32 bounds the deviation."""
        return f"Path mode cycle 32 T{tolerance}: the control may leave the written path by that much, in mm"

    def opening(self, name: str, low: Sequence[float], high: Sequence[float]) -> list[str]:
        """The name, and the blank for the graphics of the control."""
        corner = [" ".join(f"{a}{self.number(round(v * 1000) * 10)}" for a, v in zip("XYZ", p, strict=True))
                  for p in (low, high)]
        return [f"BEGIN PGM {_name(name)} MM", f"BLK FORM 0.1 Z {corner[0]}", f"BLK FORM 0.2 {corner[1]}"]

    def closing(self, name: str) -> list[str]:
        """The name again."""
        return ["M30", f"END PGM {_name(name)} MM"]

    def text(self, lines: list[str]) -> str:
        """Numbered; continuation lines have no number."""
        out, count = [], 0
        for line in lines:
            if line.startswith(" "):
                out.append(line)
            elif line:
                out.append(f"{count} {line}")
                count += 1
        return "\n".join(out) + "\n"

    def label(self, step: str, number: int) -> list[str]:
        """A named label."""
        return [f'LBL "{step}"']

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """Cycle 32 for the path, in its finishing mode; units, plane and absolute coordinates are fixed."""
        way = ["CYCL DEF 32.0 TOLERANCE", f"CYCL DEF 32.1 T{tolerance}"]
        if not turns:
            return way
        return [*way, f"CYCL DEF 32.2 HSC-MODE:0 TA{axis_tolerance(tolerance)}", "PLANE RESET STAY", "M126"]

    def state_zero(self, zero: str) -> list[str]:
        """The row of the preset table."""
        return ["CYCL DEF 247 DATUM SETTING ~", f"    Q339=+{zero.split()[1]} ;DATUM NUMBER"]

    def aloft(self, letters: str) -> list[str]:
        """In machine coordinates."""
        return ["L Z+0 R0 FMAX M91", "L " + " ".join(f"{letter}+0" for letter in letters) + " R0 FMAX"]

    def take(self, number: int, speed: str) -> list[str]:
        """With its speed."""
        return [f"TOOL CALL {number} Z S{speed}"]

    def spindle(self, speed: str, first: bool, wet: bool) -> list[str]:
        """The tool call has set the speed; another speed is a call without a tool."""
        return ["M3", coolant(wet)] if first else [f"TOOL CALL S{speed}"]

    def up(self) -> list[str]:
        """In machine coordinates."""
        return ["L Z+0 R0 FMAX M91"]

    def lift(self) -> list[str]:
        """Up in machine coordinates."""
        return self.up()

    def jump(self, step: str, number: int) -> list[str]:
        """A condition that always holds."""
        return [f'FN 9: IF +0 EQU +0 GOTO LBL "GO {step}"']

    def target(self, step: str, number: int) -> list[str]:
        """A label like those of steps."""
        return [f'LBL "GO {step}"']

    def tcp_on(self, number: int, zero: str) -> list[str]:
        """It needs its own block."""
        return ["M128"]

    def tcp_off(self) -> list[str]:
        """Before M91 and TOOL CALL."""
        return ["M129"]

    @property
    def planes(self) -> bool:
        """A setting of the shop."""
        return self.switches.planes

    def plane_on(self, first: int, second: int) -> list[str]:
        """Without a preferred side the control takes the nearest solution, which is where the axes stand."""
        return [f"PLANE SPATIAL SPA{self.number(first)} SPB{self.number(second)} SPC+0 STAY"]

    def plane_off(self) -> list[str]:
        """The plane only; M128 stays on."""
        return ["PLANE RESET STAY"]

    def arrive(self, number: int, row: str, tcp: bool) -> list[str]:
        """A rapid like any other."""
        return self.straight([row], True, True, "")

    def straight(self, rows: list[str], rapid: bool, first: bool, feed: str) -> list[str]:
        """FMAX in every block; F until the next."""
        if rapid:
            return [f"L {row} R0 FMAX" for row in rows]
        out = [f"L {row}" for row in rows]
        return [f"{out[0]} R0 F{feed}" if feed else out[0], *out[1:]]

    def arc(self, arc: GridArc, feed: str) -> list[str]:
        """C around CC. A helix exists in polar coordinates only, with its incremental angle."""
        number, sense = self.number, "+" if arc.left else "-"
        x, y, z = arc.end
        words = f"C X{number(x)} Y{number(y)}"
        if z != arc.start[2]:
            words = f"CP IPA{number(round(math.degrees(arc.sweep) * PER_MM))} Z{number(z)}"
        return [f"CC X{number(arc.centre[0])} Y{number(arc.centre[1])}",
                f"{words} DR{sense}" + (f" R0 F{feed}" if feed else "")]

    def timed(self, rows: list[str], per_minute: Sequence[float]) -> list[str]:
        """The control has no inverse-time feed.

        Raises
        ------
        OutputError
            no_inverse_time: always.
        """
        raise OutputError("Heidenhain has no inverse-time feed, which a turning cut with joint positions needs",
                          code="no_inverse_time", subjects=("machine.tcp",), measured=decimal(per_minute[0]),
                          remedy="set machine.tcp true so that the control keeps the tip (M128), or set "
                                 "machine.simultaneous false")


def _name(text: str) -> str:
    """Letters, digits, - and _ of a name, 1 to 24 of them."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in text)[:24] or "zonemill"
