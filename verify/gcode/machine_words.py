"""M words that the reader has no meaning for: one rule for all controls.

A word is refused by its name where the manual of its control says that it moves the tool or the part, changes
coordinates or the order of the program, or waits for an answer. It is refused too where LinuxCNC has it for such a
thing, as the text may then be one for LinuxCNC. Every other M word belongs to the machine builder and counts as a
function that moves nothing. A note of the program names it with its first line.
"""

from __future__ import annotations

from collections.abc import Mapping

_LINUXCNC = {428: "tool centre point control of LinuxCNC", 429: "tool centre point control of LinuxCNC",
             430: "user-defined kinematics of LinuxCNC"}
FANUC_M: dict[int, str] = _LINUXCNC | {198: "a call of a program outside of the file"}
HAAS_M: dict[int, str] = FANUC_M | {
    36: "it waits for a pallet", 39: "a turn of the tool carousel", 46: "a jump that a pallet decides",
    50: "a change of pallets", 82: "it lets the tool go", 86: "it clamps a tool", 104: "the arm of the probe",
    105: "the arm of the probe", 109: "it waits for an answer"}
SIEMENS_M: dict[int, str] = _LINUXCNC | {
    96: "an interrupt of ISO mode", 97: "an interrupt of ISO mode", 98: "a call of ISO mode",
    99: "a return of ISO mode", 198: "a call of ISO mode"}
HEIDENHAIN_M: dict[int, str] = _LINUXCNC | {
    92: "a place of the machine's maker", 95: "other approaches of radius compensation",
    96: "other approaches of radius compensation", 97: "other corners of radius compensation",
    98: "open contours of radius compensation", 104: "the zero of before",
    109: "a feed that rises on arcs outside", 112: "rounded corners",
    114: "another compensation of rotary axes", 124: "points that are left out",
    130: "coordinates that are not tilted", 136: "feed per turn", 138: "a choice of tilting axes",
    140: "a retract without MB and its length", 142: "the end of shifts, mirrors and scales",
    143: "the end of a basic rotation",
    144: "the kinematics of the moment", 197: "other corners of radius compensation"}
"""M words that are not followed, and what they do, by control."""

USER_M = range(100, 200)
"""M words of LinuxCNC that run a program of the user; it refuses any other word that it does not know."""


def functions_note(first_lines: Mapping[int, int]) -> str:
    """The note that names M words (number: first line) which count as functions of the machine.

    >>> functions_note({88: 12, 89: 20})
    'functions of the machine that count as moving nothing: M88 (line 12), M89 (line 20)'
    """
    named = ", ".join(f"M{m} (line {line})" for m, line in sorted(first_lines.items(), key=lambda e: (e[1], e[0])))
    return f"functions of the machine that count as moving nothing: {named}"


__all__ = ["FANUC_M", "HAAS_M", "HEIDENHAIN_M", "SIEMENS_M", "USER_M", "functions_note"]
