"""Fanuc 0i, 30i and their kin.

The length is counted by G43 in the block of the first way down, and on machines
that turn by G43.4 there, which keeps the tip too: G43 alone may move Z by the
length of the tool (parameter 5006). For the same reason G49 stands after the
way home (G28), never above the part. No word of a program bounds what the
control rounds corners by: parameters do, and G05.1 Q1 where the option is
there. Numbers have a decimal point, for X10 may mean 0.010 mm (parameter 3401).
"""

from __future__ import annotations

from output.gcode.dialects.base import Dialect

NAMED = 40
"""Characters of what stands beside the number of a program."""

_SIGNS = str.maketrans({"%": "PCT", ";": ",", "{": "[", "}": "]", "\\": "/", "|": "/", "~": "-", "^": "'", "`": "'"})


class Fanuc(Dialect):
    """Comments in capitals, of the characters that all of them show."""

    name, title, ending = "fanuc", "Fanuc", "nc"
    line = 72
    bounds_path = False
    needs: tuple[str, ...] = ("Machine zero of Z is taken to be the top of its travel",
                              "Needed: parameters 1401#1 LRP 1 and, on five axes, 19696#5 WKP 0 and, of rotary axes "
                              "that roll over, 1008#1 RAB 0")
    zeros = ("G54", "G55", "G56", "G57", "G58", "G59", "G54.1 P1", "G54.1 P2", "G54.1 P3")
    tcp_words = "G43.4: the control keeps the tool tip on the part while axes turn; G49: it does not any more"
    tcp_word = "G43.4"

    def plain(self, text: str) -> str:
        """% would end the file and ; the block, on a way of transfer or another; others its code has no sign for."""
        return super().plain(text).upper().translate(_SIGNS)

    def feed(self, value: str) -> str:
        """With its decimal point."""
        return f"F{value}" if "." in value else f"F{value}."

    def path(self, tolerance: str) -> str:
        """Bounded by parameters."""
        mode = "G05.1 Q1" if self.switches.high_speed else "G64"
        return f"Path mode {mode}: parameters of the machine say how far the control may leave the written path"

    def opening(self, name: str, low: object, high: object) -> list[str]:
        """The number follows."""
        return ["%"]

    def numbered(self, number: int, words: str) -> list[str]:
        """One file of a job would take the place of another in the control if they had the same."""
        return [" ".join([f"O{number}", *self.comment(words[:NAMED])[:1 if words else 0]])]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """The unit has a block of its own, and the length is given up at home."""
        slow = ["G05.1 Q0"] if self.switches.high_speed else []  # a run that was broken off may have left it on
        return [*slow, "G21", "G17 G90 G94 G40 G80 G64", *self.home(), "G49"]

    def home(self) -> list[str]:
        """The spindle to its reference point, no other axis."""
        return ["G91 G28 Z0.", "G90"]

    def aloft(self, letters: str) -> list[str]:
        """``modes`` has sent the spindle home."""
        return ["G0 " + " ".join(f"{letter}0." for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """Its length is counted in ``arrive``."""
        return [f"T{number} M6", *(["G05.1 Q1"] if self.switches.high_speed else [])]

    def arrive(self, number: int, row: str, tcp: bool) -> list[str]:
        """With the word that counts the length."""
        return [f"G0 {self.tcp_word if tcp else 'G43'} {row} H{number}"]

    def stop(self) -> list[str]:
        """Home before the length is given up."""
        return ["M5", "M9", *self.home(), "G49", *(["G05.1 Q0"] if self.switches.high_speed else [])]
