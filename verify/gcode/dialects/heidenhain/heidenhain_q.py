"""Q parameters of Heidenhain programs: FN functions, formulas, and values of words.

A parameter must get its value in the program before it is read: a control keeps those of the program before. Angles are
degrees. In formulas a function and a sign bind most, then ^, then * and /, then + and -.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from verify.gcode.dialects.base import BlockError
from verify.gcode.flow.expressions import apart, certain

NUM = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
VALUE = rf"(?:[+-]\s*)?(?:{NUM}|Q[LR]?[0-9]+)"
"""A value of a word: a number or a Q parameter, with or without a sign."""
MAX_DEPTH = 40
_NAME = re.compile(r"Q[LR]?[0-9]+")
_FN = re.compile(r"FN\s*([0-9]+)\s*:\s*(Q[LR]?[0-9]+)\s*=\s*(.*)")
_TWO = re.compile(rf"({VALUE})\s*(DIV|LEN|ANG|[+*/-])\s*({VALUE})")
_ONE = re.compile(rf"(SQRT|SIN|COS)\s*({VALUE})")
_JUMP = re.compile(rf'FN\s*(9|10|11|12)\s*:\s*IF\s*({VALUE})\s*(EQU|NE|GT|LT)\s*({VALUE})\s*GOTO\s*LBL\s*'
                   r'("[^"]*"|[0-9]+)')
_FORMULA = re.compile(r"(Q[LR]?[0-9]+)\s*=\s*(.+)")
_TOKEN = re.compile(rf"\s*({NUM}|Q[LR]?[0-9]+|[A-Z]+|[-+*/^%()])")
ALARM = 14
SILENT = frozenset({15, 16, 19, 20, 29, 37, 38})
"""FN functions that stop, print or talk to the machine and move nothing."""


@dataclass
class QParameters:
    """Values by name, such as 'Q5'; ``served`` gives those that the control sets, or None."""

    served: Callable[[str], float | None]
    held: dict[str, float] = field(default_factory=dict)

    def read(self, name: str) -> float:
        """Value of a parameter.

        Raises
        ------
        BlockError
            The program has not set it.
        """
        name = _normal(name)
        found = self.held.get(name)
        if found is None:
            found = self.served(name)
        if found is None:
            raise BlockError(f"{name} has no value yet; set it first",
                             "set the parameter in the program, or write the number")
        return found

    def value(self, text: str) -> float:
        """Value of a word: a number or a parameter, with or without a sign."""
        text = "".join(text.split())
        sign = -1.0 if text.startswith("-") else 1.0
        text = text.lstrip("+-")
        return sign * (self.read(text) if text.startswith("Q") else float(text))

    def put(self, name: str, value: float) -> None:
        """Set a parameter.

        Raises
        ------
        BlockError
            The value is not finite.
        """
        if not math.isfinite(value):
            raise BlockError(f"the value of {name} is not a finite number")
        self.held[_normal(name)] = value

    def run(self, text: str) -> bool:
        """Run an FN function or a formula that sets a parameter; whether the text is one.

        Raises
        ------
        BlockError
            It cannot be read, or has no value.
        """
        if m := _FN.fullmatch(text):
            self.put(m[2], self._function(int(m[1]), m[3].strip()))
            return True
        if m := re.match(r"FN\s*([0-9]+)\s*:", text):
            if int(m[1]) == ALARM:
                raise BlockError(f"{text[:40]}: the program stops here with an alarm")
            if int(m[1]) in SILENT:
                return True
            raise BlockError(f"FN {m[1]} is not followed: FN 0 to FN 13 are")
        if m := _FORMULA.fullmatch(text):
            self.put(m[1], _Formula(m[2], self).value())
            return True
        return False

    def jump(self, text: str) -> str | None:
        """Label of a conditional jump whose condition holds, '' where it does not; None where the text is none."""
        m = _JUMP.fullmatch(text)
        if m is None:
            return None
        a, b = apart(self.value(m[2]), self.value(m[4]))
        holds = {"EQU": a == b, "NE": a != b, "GT": a > b, "LT": a < b}[m[3]]
        return m[5] if holds else ""

    def _function(self, number: int, text: str) -> float:
        if number == 0 and re.fullmatch(VALUE, text):
            return self.value(text)
        if number in (5, 6, 7) and (m := _ONE.fullmatch(text)):
            name = {5: "SQRT", 6: "SIN", 7: "COS"}[number]
            given = self.value(m[2])
            if m[1] == name:
                return _finite(name, lambda: _FUNCTIONS[name](given))
        wanted = {1: "+", 2: "-", 3: "*", 4: "DIV", 8: "LEN", 13: "ANG"}.get(number)
        if (m := _TWO.fullmatch(text)) and wanted and (m[2] == wanted or (wanted == "DIV" and m[2] == "/")):
            a, b = self.value(m[1]), self.value(m[3])
            return _finite(f"FN {number}", lambda: _PAIRS[wanted](a, b))
        raise BlockError(f"cannot read 'FN {number}: {text[:40]}'")


class _Formula:
    """Evaluates a formula from left to right."""

    def __init__(self, text: str, parameters: QParameters) -> None:
        self.parameters, self.tokens, self.at, self.depth = parameters, [], 0, 0
        at = 0
        text = text.strip()
        while at < len(text):
            m = _TOKEN.match(text, at)
            if m is None:
                raise BlockError(f"cannot read the formula at '{text[at:at + 30]}'")
            self.tokens.append(m[1])
            at = m.end()

    def value(self) -> float:
        found = self._sum()
        if self.at < len(self.tokens):
            raise BlockError(f"cannot read the formula at '{self.tokens[self.at]}'")
        return found

    def _next(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def _sum(self) -> float:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise BlockError(f"more than {MAX_DEPTH} nested brackets")
        left = self._product()
        while self._next() in ("+", "-"):
            sign = self._take()
            right = self._product()
            left = left + right if sign == "+" else left - right
        self.depth -= 1
        return left

    def _product(self) -> float:
        left = self._power()
        while self._next() in ("*", "/", "%"):
            sign = self._take()
            a, b = left, self._power()
            left = _finite(sign, lambda a=a, b=b, sign=sign: _PAIRS[sign](a, b))  # type: ignore[misc]
        return left

    def _power(self) -> float:
        left = self._single()
        while self._next() == "^":
            self._take()
            a, b = left, self._single()
            left = _finite("^", lambda a=a, b=b: math.pow(a, b))  # type: ignore[misc]
        return left

    def _single(self) -> float:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise BlockError(f"more than {MAX_DEPTH} nested brackets and functions")
        found = self._bare()
        self.depth -= 1
        return found

    def _bare(self) -> float:
        word = self._take()
        if word == "(":
            inside = self._sum()
            if self._take() != ")":
                raise BlockError("')' is missing in a formula")
            return inside
        if word in ("-", "+"):
            return -self._single() if word == "-" else self._single()
        if word == "PI":
            return math.pi
        if word in _FUNCTIONS:
            given = self._single()
            return _finite(word, lambda: _FUNCTIONS[word](given))
        if _NAME.fullmatch(word):
            return self.parameters.read(word)
        if re.fullmatch(NUM, word):
            return float(word)
        raise BlockError(f"cannot read '{word}' in a formula" if word else "a formula ends too early")

    def _take(self) -> str:
        word = self._next()
        self.at += 1
        return word


def _normal(name: str) -> str:
    return re.sub(r"^(Q[LR]?)0+(?=[0-9])", r"\1", name)


def _finite(name: str, compute: Callable[[], float]) -> float:
    try:
        found = compute()
    except BlockError:
        raise
    except (ValueError, OverflowError, ZeroDivisionError):
        raise BlockError(f"{name} has no value here") from None
    if isinstance(found, complex) or not math.isfinite(found):
        raise BlockError(f"{name} is not a finite number")
    return found


_PAIRS: dict[str, Callable[[float, float], float]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "DIV": operator.truediv,
    "%": math.fmod, "LEN": math.hypot, "ANG": lambda y, x: math.degrees(math.atan2(y, x)) % 360.0}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "SQ": lambda v: v * v, "SQRT": math.sqrt, "SIN": lambda v: math.sin(math.radians(v)),
    "COS": lambda v: math.cos(math.radians(v)), "TAN": lambda v: math.tan(math.radians(v)),
    "ASIN": lambda v: math.degrees(math.asin(v)), "ACOS": lambda v: math.degrees(math.acos(v)),
    "ATAN": lambda v: math.degrees(math.atan(v)), "LN": math.log, "LOG": math.log10, "EXP": math.exp, "ABS": abs,
    "INT": certain("INT", math.trunc), "FRAC": certain("FRAC", lambda v: math.modf(v)[0]), "NEG": operator.neg,
    "SGN": lambda v: math.copysign(1.0, v) if v else 0.0}

__all__ = ["NUM", "VALUE", "QParameters"]
