"""Fanuc 0i, 30i and related controls.

G43 activates the tool length in the block of the first approach. On machines with rotary axes G43.4 does so, and it
keeps the tip too; G43 alone may move Z by the tool length (parameter 5006). For the same reason G49 stands after the
return home (G28), never above the part. GOTO jumps over the words of a restart point. No word of a program bounds the
rounding of corners: parameters do, and G05.1 Q1 where the option exists. Numbers have a decimal point, since X10 may
mean 0.010 mm (parameter 3401).
"""

from __future__ import annotations

from output.gcode.dialects.base import Dialect

NAMED = 40
"""Most characters of the comment beside the number of a program."""

_SIGNS = str.maketrans({"%": "PCT", ";": ",", "{": "[", "}": "]", "\\": "/", "|": "/", "~": "-", "^": "'", "`": "'"})


class Fanuc(Dialect):
    """Comments are in capitals, with characters that all of these controls show."""

    name, title, ending = "fanuc", "Fanuc", "nc"
    line = 72
    bounds_path = False
    needs: tuple[str, ...] = ("Machine zero of Z is taken to be the top of its travel",
                              "Needed: parameters 1401#1 LRP 1 and, on five axes, 19696#5 WKP 0 and, of rotary axes "
                              "that roll over, 1008#1 RAB 0")
    needs_jumps: tuple[str, ...] = ("Needed: custom macros, for GOTO, and the program in the memory of the control: "
                                    "DNC does not jump",)
    zeros = ("G54", "G55", "G56", "G57", "G58", "G59", "G54.1 P1", "G54.1 P2", "G54.1 P3")
    tcp_words = "G43.4: the control keeps the tool tip on the part while axes turn; G49: it does not any more"
    tcp_word = "G43.4"

    def plain(self, text: str) -> str:
        """Without % and ;, which may end the file or the block during transfer, and without characters outside the
        code.
        """
        return super().plain(text).upper().translate(_SIGNS)

    def feed(self, value: str) -> str:
        """With a decimal point."""
        return f"F{value}" if "." in value else f"F{value}."

    def path(self, tolerance: str) -> str:
        """Parameters bound the deviation."""
        mode = "G05.1 Q1" if self.switches.high_speed else "G64"
        return f"Path mode {mode}: parameters of the machine say how far the control may leave the written path"

    def opening(self, name: str, low: object, high: object) -> list[str]:
        """The number comes next."""
        return ["%"]

    def numbered(self, number: int, words: str) -> list[str]:
        """Each file of a job has its own number, else one would replace another in the control."""
        return [" ".join([f"O{number}", *self.comment(words[:NAMED])[:1 if words else 0]])]

    def modes(self, tolerance: str, turns: bool) -> list[str]:
        """The unit has a block of its own; the tool length is cancelled at home."""
        slow = ["G05.1 Q0"] if self.switches.high_speed else []  # an aborted run may have left it on
        return [*slow, "G21", "G17 G90 G94 G40 G80 G64", *self.home(), "G49"]

    def home(self) -> list[str]:
        """The spindle to its reference point; no other axis moves."""
        return ["G91 G28 Z0.", "G90"]

    def aloft(self, letters: str) -> list[str]:
        """Rotary axes only: ``modes`` has sent the spindle home."""
        return ["G0 " + " ".join(f"{letter}0." for letter in letters)]

    def take(self, number: int, speed: str) -> list[str]:
        """``arrive`` activates the tool length."""
        return [f"T{number} M6", *(["G05.1 Q1"] if self.switches.high_speed else [])]

    def arrive(self, number: int, row: str, tcp: bool) -> list[str]:
        """With the word that activates the tool length."""
        return [f"G0 {self.tcp_word if tcp else 'G43'} {row} H{number}"]

    def lift(self) -> list[str]:
        """Home first, then the tool length off."""
        return [*self.home(), "G49"]

    def stop(self) -> list[str]:
        """Fast contouring ends last."""
        return [*super().stop(), *(["G05.1 Q0"] if self.switches.high_speed else [])]
