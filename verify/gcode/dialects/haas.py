"""Haas: the words of Fanuc, with differences.

G234 is tool centre point control, G154 P a work offset, G187 smoothness (E: its bound), G101 and G100 mirror. A whole P
of G04 and of cycles counts ms, one with a decimal point s. F without a decimal point is refused like a coordinate. G28
cancels the length offset. M16 is M6. M0 and M1 stop the spindle and the coolant. I, J and K of a peck cycle are its
first peck, by how much each next one is shorter, and the shortest; K with Q of G73 is the depth after which the tool
returns to R. L is the number of holes. G110 to G129 are G154 P1 to P20. J of a tapping cycle is the speed of its
retract. G103 limits how far the control reads ahead, and G102 sends places of axes to a port.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.fanuc import REFUSED, FanucReader
from verify.gcode.machine_words import HAAS_M

WORDS: dict[float, str] = {
    35: "probing", 47: "engraving", 136: "probing", 141: "compensation in space", 143: "a length along the tilted tool",
    150: "a pocket", 253: "a turn of the tool", 254: "a dynamic work offset", 268: "a tilted plane"}
"""G words that move or cut and are not followed, and what they are."""
_OUTPUT = re.compile(r"(?:N[0-9]+)?G102[XYZABC]*")
_MIRRORS = {101: "G51.1", 100: "G50.1"}


class HaasReader(FanucReader):
    """Haas mills, Next Generation Control."""

    title = "Haas"
    further = 154.0
    local_calls = bounds_path = True
    repeats = "L"
    counts = "KJ"
    refused_m = HAAS_M
    refused_g = REFUSED | WORDS
    rigid = None
    length_words = (*FanucReader.length_words, 234)
    looks_ahead = 80.0
    shrinking_pecks = True

    def _check(self, letter: str, digits: str) -> None:
        super()._check(letter, digits)
        if letter == "F" and "." not in digits and float(digits) != 0:
            raise BlockError(f"F{digits} without a decimal point counts thousandths or not, depending on a setting",
                             f"write F{digits}.")

    def _bare(self, raw: str) -> str:
        text = super()._bare(raw)
        return "" if _OUTPUT.fullmatch(text) else text

    def _several(self, ms: list[str]) -> None:
        raise BlockError(f"{' and '.join(f'M{m}' for m in ms)} in one block: Haas takes one M word in a block",
                         "give each its own block")

    def _in_seconds(self, digits: str) -> bool:
        return "." in digits

    def _idle_m(self, digits: str) -> bool:
        return float(digits) != 16 and super()._idle_m(digits)

    def _word(self, letter: str, digits: str, codes: list[float], values: dict[str, str]) -> list[str]:
        if letter == "M" and float(digits) == 16:
            return ["M6"]
        if self.hole and letter in "IJK" and self._cycles(codes) & {73.0, 83.0}:
            if "." not in digits and float(digits) != 0:
                raise BlockError(f"{letter}{digits} of a peck cycle without a decimal point counts thousandths or not, "
                                 "depending on a setting", f"write {letter}{digits}.")
            return [letter + digits]
        if letter == "J" and self._cycles(codes) & {74.0, 84.0}:
            speed = float(values.get("S", self.machine.s.speed))
            self.machine.log.turns(self.machine.s.tool, float(digits) * speed)  # on the way out of a tapped hole
            return []
        if letter == "P" and 103 in codes:
            return []
        return super()._word(letter, digits, codes, values)

    def _cycles(self, codes: list[float]) -> set[float]:
        """G words of the drilling cycle that a block of these G words runs; none without one."""
        stated = {c for c in codes if 73 <= c <= 89}
        return stated or ({self.machine.s.motion or 0.0} if self.hole else set())

    def _code(self, code: float, values: dict[str, str]) -> list[str]:
        if code == 234:
            return ["G43.4"]
        if code in _MIRRORS:
            return [_MIRRORS[int(code)]]
        if code == 103:
            return []
        if 110 <= code <= 129:
            return [self.zero(6 + int(code) - 109, f"G{code:g}")]
        if code == 187:
            if "E" not in values:
                self.notes.append("G187 without E: a setting of the machine decides how far the control rounds "
                                  "corners; the error bound does not include it")
                self.limited = False
                self.bound(self.exact)
                return []
            self.limited = True
            self.bound(True)
            return [f"G64 P{values['E']}"]
        if code in (5.1, 54.1):
            raise BlockError(f"unknown word G{code:g}: Haas has G187 and G154")
        if code == 92.1:
            raise BlockError("unknown word G92.1: Haas ends a shift with another G92, or with G52")
        return super()._code(code, values)

    def _translated(self, words: list[tuple[str, str]], codes: list[float], deleted: bool) -> list[str]:
        stops = any(a == "M" and float(b) in (0.0, 1.0) for a, b in words)
        return [*super()._translated(words, codes, deleted), *(["M5", "M9"] if stops else [])]

    def _after(self, codes: list[float], values: Mapping[str, str]) -> list[str]:
        if 28 not in codes or 43 in codes:
            return []
        self.drops = "G28"  # behind this line: the way to the place on the way home has the length
        return ["G49"]
