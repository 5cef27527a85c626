"""One line of a program with parameters or O-words, parsed once: its words, its assignments, or its O-word."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from verify.gcode.block_words import BlockError, bare
from verify.gcode.flow.expressions import ExpressionReader, ParameterReference, Value
from verify.gcode.flow.parameters import Parameters

_O_WORD = re.compile(r"(/?)(?:n[0-9]+\.?[0-9]*)?o(?:<([^<>]*)>|([0-9]+)(?![0-9])|(?=[\[#]))(?=.)")
_KEYWORD = re.compile(r"endsub|endif|endwhile|endrepeat|elseif|else|sub|return|call|if|while|do|break|continue|repeat")
_CONDITIONS = frozenset({"if", "elseif", "while", "repeat"})
_MAX_VALUES = {"call": 30, "return": 1, "endsub": 1, "if": 1, "elseif": 1, "while": 1, "repeat": 1}
_WHOLE = frozenset("MTDHL")
MAX_CHARACTERS = 255
"""Characters of a line that LinuxCNC reads; the limit also bounds the depth of an expression."""


@dataclass(frozen=True)
class ParametricLine:
    """Words and assignments of a line.

    deleted  : whether it begins with /
    words    : letters with their values, in order
    assigned : parameters with their new values; they get them after all values of the line are evaluated
    """

    deleted: bool
    words: tuple[tuple[str, Value], ...]
    assigned: tuple[tuple[ParameterReference, Value], ...]

    def run(self, scope: Parameters) -> str:
        """Evaluate the line, make its assignments, and return the plain block that is left, '' for none."""
        words = "".join([letter + digits(letter, value(scope)) for letter, value in self.words])
        results = [(target, target.number and target.number(scope), value(scope)) for target, value in self.assigned]
        for target, number, result in results:
            digits("#", result)
            if number is None:
                scope.put_name(target.name, result)
            else:
                scope.put(number, result)
        return "/" + words if self.deleted else words


@dataclass(frozen=True)
class OWord:
    """An O-word: label ('' where it is computed), keyword, and the values in brackets after it."""

    label: str
    computed: Value | None
    keyword: str
    values: tuple[Value, ...]


def is_plain(raw: str) -> bool:
    """Whether a line has no parameter, expression or O-word outside its comments."""
    if "#" not in raw and "[" not in raw and "o" not in raw and "O" not in raw:
        return True
    try:
        text = _compact(raw)
    except BlockError:
        return True  # the block reports it
    return "#" not in text and "[" not in text and not _O_WORD.match(text)


def read_line(raw: str) -> ParametricLine:
    """Words and assignments of a line that is not plain.

    Raises
    ------
    BlockError
        The line cannot be read.
    """
    text = _compact(raw)
    reading = _reading(raw, text)
    deleted = text.startswith("/")
    reading.at = int(deleted)
    words: list[tuple[str, Value]] = []
    assigned: list[tuple[ParameterReference, Value]] = []
    while reading.rest:
        letter = text[reading.at]
        if letter == "#":
            target = reading.target()
            reading.take("=")
            assigned.append((target, reading.value()))
        elif letter.isalpha() or letter in "@^":
            if letter == "o":
                raise BlockError(f"the O-word '{reading.rest}' must be first in its line")
            reading.at += 1
            words.append((letter.upper(), reading.value()))
        else:
            raise BlockError(f"cannot read '{reading.rest}'")
    return ParametricLine(deleted, tuple(words), tuple(assigned))


def read_o_word(raw: str) -> OWord | None:
    """The O-word of a line; None where it has none, or only a program number such as O1000.

    Raises BlockError where it is not an O-word of LinuxCNC.
    """
    text = _compact(raw)
    found = _O_WORD.match(text)
    if found is None:
        return None
    if found[1]:
        raise BlockError("a / before an O-word: the flow of the program would depend on a switch of the machine")
    reading = _reading(raw, text)
    reading.at = found.end()
    label, computed = found[2] or (str(int(found[3])) if found[3] else ""), None
    if not label:
        computed = reading.value()
    word = _KEYWORD.match(text, reading.at)
    if word is None:
        raise BlockError(f"cannot read the O-word '{reading.rest}'")
    keyword, reading.at = word.group(), word.end()
    if computed is not None and keyword != "call":
        raise BlockError(f"a computed label before '{keyword}': only a call may have one")
    values: list[Value] = []
    while reading.rest:
        values.append(reading.bracket())
    limit = _MAX_VALUES.get(keyword, 0)
    if len(values) > limit or (keyword in _CONDITIONS and not values):
        raise BlockError(f"{keyword} takes {limit or 'no'} values in brackets, not {len(values)}")
    return OWord(label, computed, keyword, tuple(values))


def _reading(raw: str, text: str) -> ExpressionReader:
    if len(raw.rstrip()) > MAX_CHARACTERS:
        raise BlockError(f"a line with parameters, expressions or O-words has {len(raw.rstrip())} characters; "
                         f"LinuxCNC reads {MAX_CHARACTERS}: split it")
    return ExpressionReader(text)


def _compact(raw: str) -> str:
    return "".join(bare(raw).lower().split())


def digits(letter: str, number: float) -> str:
    """The number as text that reads back to the same bits; whole where the letter takes whole numbers only.

    There a quotient such as 2.99999 counts as 3, as on the control: within 1e-4, for G words within 1e-4 of a tenth.

    Raises
    ------
    BlockError
        It is not finite.
    """
    if not math.isfinite(number):
        raise BlockError(f"the value of {letter} is not a finite number")
    if letter in _WHOLE and abs(number - round(number)) < 1e-4:
        number = round(number)
    elif letter == "G" and abs(number * 10 - round(number * 10)) < 1e-3:
        number = round(number * 10) / 10
    if number == math.floor(number) and abs(number) < 1e15:
        return str(int(number))
    return np.format_float_positional(number, trim="-")
