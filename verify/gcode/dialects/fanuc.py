"""Fanuc: nearly the words of the reader itself.

Differences: further work offsets are G54.1 P, fast contouring is G05.1 Q, G04 counts ms, ';' ends a block. X10 without
a decimal point is 10 mm or 0.010 mm, depending on a parameter. Macros (#, [ ]) are refused: GOTO, IF and WHILE of Fanuc
differ from those of LinuxCNC.
"""

from __future__ import annotations

import re

from verify.gcode.block_words import bare
from verify.gcode.dialects.base import NUMBER, BlockError, DialectReader, zero_word

_PLAIN = re.compile(r"(?:N[0-9]+ ?)?(?:G0?[01] ?)?(?:[XYZABC][+-]?(?:[0-9]*\.[0-9]*|0) ?)*(?:F[0-9]+\.[0-9]* ?)?\r?")
_WORD = re.compile(rf"([A-Z])({NUMBER})")
_FOREIGN: dict[str, frozenset[float]] = {
    "M": frozenset({70, 71, 72, 73, 428, 429}), "G": frozenset({59.1, 59.2, 59.3, 92.2, 92.3})}
ROUNDING = "parameters of the machine set how far the control rounds corners: the error bound does not include it"
_PLACES = "XYZABCIJKR"


class FanucReader(DialectReader):
    """Fanuc 0i, 30i and relatives."""

    title = "FanucReader"
    further = 54.1
    bounds_path = False
    home_from, gives_up_length = 0, True

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True

    def blocks(self, raw: str) -> list[str]:
        """A plain straight move unchanged; every other line word by word.

        Raises
        ------
        BlockError
            The line cannot be read, or could be read in two ways.
        """
        if _PLAIN.fullmatch(raw):
            return [raw]
        text = self._bare(raw)
        if not text or text == "%" or re.fullmatch(r"O[0-9]+", text):
            return [text] if text else []
        words = [(a, b) for a, b in _WORD.findall(text.removeprefix("/"))]
        if "".join(a + b for a, b in words) != text.removeprefix("/"):
            raise BlockError(f"cannot read '{text[:60]}'")
        for letter, digits in words:
            self._check(letter, digits)
        if len(ms := [a + b for a, b in words if a == "M"]) > 1:
            self._several(" and ".join(ms))
        values = dict(words)
        codes = [float(b) for a, b in words if a == "G"]
        out = []
        for letter, digits in words:
            out += self._word(letter, digits, codes, values)
        block = " ".join(out)
        return [f"/{block}" if text.startswith("/") else block, *self._after(codes)]

    def _bare(self, raw: str) -> str:
        """The line without comments and blanks."""
        before, _, after = re.sub(r"\([^()]*\)", " ", raw).partition(";")
        if after.strip():
            raise BlockError(f"'{after.strip()[:40]}' follows a ; which ends the block: give it its own line")
        text = "".join(bare(before).upper().split())
        if "#" in text or "[" in text:
            raise BlockError(f"a macro of {self.title} ('{text[:40]}')",
                             "let the post write plain moves: no macro variables, no GOTO, IF or WHILE")
        return text

    def _check(self, letter: str, digits: str) -> None:
        number = float(digits)
        if number in _FOREIGN.get(letter, frozenset()):
            raise BlockError(f"{letter}{digits} is a word of LinuxCNC with another meaning, or none, on {self.title}")
        if letter in _PLACES and "." not in digits and number != 0:
            raise BlockError(f"{letter}{digits} without a decimal point is {digits} or {number / 1000:g}, depending on "
                             "a parameter of the machine", "write the decimal point: X10. is 10 mm everywhere")

    def _several(self, ms: str) -> None:
        """A block has several M words, named by ``ms``."""
        self.remarks.append(f"{ms} in one block: parameter 3404#7 decides whether the control runs both or only the "
                            "last; give each its own block")

    def _word(self, letter: str, digits: str, codes: list[float], values: dict[str, str]) -> list[str]:
        """One word in the words of the reader; none where another word of the block includes it."""
        if letter == "G":
            return self._code(float(digits), values)
        if letter in "PX" and 4 in codes:
            seconds = float(digits) if letter == "X" or self._in_seconds(digits) else float(digits) / 1000.0
            return [f"P{seconds:.6f}"]
        taken = {"P": self.further in codes or 187 in codes, "E": 187 in codes,
                 "Q": 5.1 in codes, "R": 5.1 in codes}
        return [] if taken.get(letter) else [letter + digits]

    def _in_seconds(self, digits: str) -> bool:
        """Whether the P of a dwell is in s."""
        return False

    def _code(self, code: float, values: dict[str, str]) -> list[str]:
        if code == self.further:
            return [zero_word(6 + int(float(values.get("P", "0"))), f"G{code:g} P{values.get('P', '')}")]
        if code == 5.1:
            if float(values.get("Q", "-1")) not in (0.0, 1.0):
                raise BlockError("G05.1 without Q0 or Q1")
            self.notes.append(ROUNDING)
            return []
        if code == 64:
            self.notes.append(ROUNDING)
            return []
        return [f"G{code:g}"]

    def _after(self, codes: list[float]) -> list[str]:
        """Blocks that follow a block with these G words."""
        return []
