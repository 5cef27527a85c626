"""Values of Siemens programs: numbers, R parameters, variables, arithmetic and conditions.

Precedence, from the highest: NOT, B_NOT and signs; * / DIV MOD; + -; B_AND; B_XOR; B_OR; AND; XOR; OR; <<; comparisons.
Operators of one level run from left to right. Angles are degrees. A quotient of two whole numbers keeps its fraction.
Truth is 1 and 0.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from verify.gcode.block_words import BlockError
from verify.gcode.flow.expressions import certain

Value = float | str
MAX_DEPTH = 40
"""Nested brackets and signs; deeper text is refused before it exhausts the stack."""
MAX_ELEMENTS = 100_000
_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:EX[+-]?[0-9]{1,3})?")
_NAME = re.compile(r"\$?[A-Z_][A-Z_0-9]*")
_CODED = re.compile(r"'(?:H([0-7]?[0-9A-F]{1,7})|B([01]{1,31}))'")  # hexadecimal and binary, no sign bit
_TEXT = re.compile(r'"([^"]*)"')
_OPERATOR = re.compile(r"\s*(==|<>|<=|>=|<<|[*/+<>-]|(?:DIV|MOD|B_AND|B_XOR|B_OR|AND|XOR|OR)(?![A-Z_0-9]))")
_LEVELS = {"*": 10, "/": 10, "DIV": 10, "MOD": 10, "+": 9, "-": 9, "B_AND": 8, "B_XOR": 7, "B_OR": 6, "AND": 5,
           "XOR": 4,
           "OR": 3, "<<": 2, "==": 1, "<>": 1, "<": 1, ">": 1, "<=": 1, ">=": 1}
_R = re.compile(r"R([0-9]+)")
_PLACED = re.compile(r"(AC|IC|DC|ACP|ACN)\s*\(")


@dataclass
class Variables:
    """R parameters, variables of the program and of each call.

    r      : R parameters by number; the program must set one before it reads it
    frames : variables of the main program and of the calls in it, by name; an array has a number for each index
    types  : type of each variable by name, in the same order
    served : gives a value of the control by its name and index, such as ('$AA_IW', 'X'); raises BlockError
    """

    served: Callable[[str, str], Value]
    r: dict[int, float] = field(default_factory=dict)
    frames: list[dict[str, Value | dict[tuple[int, ...], Value]]] = field(default_factory=lambda: [{}])
    types: list[dict[str, str]] = field(default_factory=lambda: [{}])

    def known(self, name: str) -> bool:
        """Whether a variable of this name is defined here."""
        return self._level(name) is not None

    def define(self, kind: str, name: str, value: Value | dict[tuple[int, ...], Value]) -> None:
        """A new variable of the running program. Raises BlockError where its type cannot hold the value."""
        self.types[-1][name] = kind
        self.frames[-1][name] = value if isinstance(value, dict) else _typed(kind, value)

    def read(self, name: str, index: tuple[int, ...] = ()) -> Value:
        """Value of a parameter or variable.

        Raises
        ------
        BlockError
            It has no value yet, or is no variable of the program.
        """
        if name == "R" or (m := _R.fullmatch(name)):
            number = index[0] if name == "R" and len(index) == 1 else int(m[1]) if name != "R" and m else -1
            if number not in self.r:
                raise BlockError(f"R{number} has no value yet; set it first" if number >= 0
                                 else f"cannot read '{name}'")
            return self.r[number]
        level = self._level(name)
        held = None if level is None else self.frames[level][name]
        if isinstance(held, dict):
            if index not in held:
                raise BlockError(f"{name}{list(index)} is no element of its array")
            return held[index]
        if held is None or index:
            raise BlockError(f"{name} is not a variable of the program")
        return held

    def put(self, name: str, index: tuple[int, ...], value: Value) -> None:
        """Set a parameter or variable.

        Raises
        ------
        BlockError
            There is none of this name or index, or its type does not take the value.
        """
        if name == "R" or (m := _R.fullmatch(name)):
            number = index[0] if name == "R" and len(index) == 1 else int(m[1]) if name != "R" and m else -1
            if number < 0 or isinstance(value, str):
                raise BlockError(f"cannot set '{name}'")
            self.r[number] = value
            return
        level = self._level(name)
        if level is None:
            raise BlockError(f"{name} is not a variable of the program")
        kind, held = self.types[level][name], self.frames[level][name]
        if isinstance(held, dict):
            if index not in held:
                raise BlockError(f"{name}{list(index)} is no element of its array")
            held[index] = _typed(kind, value)
        elif index:
            raise BlockError(f"{name} is no array")
        else:
            self.frames[level][name] = _typed(kind, value)

    def _level(self, name: str) -> int | None:
        """The call or program whose variable this is: the running one, or the main program."""
        if name in self.frames[-1]:
            return len(self.frames) - 1
        return 0 if name in self.frames[0] else None


def _typed(kind: str, value: Value) -> Value:
    """A value as a variable of a type keeps it: INT rounds, halves up."""
    if (kind == "STRING") != isinstance(value, str):
        raise BlockError(f"a variable of type {kind} cannot hold {value!r}")
    if isinstance(value, str):
        return value
    if kind in ("INT", "CHAR"):
        return float(math.floor(value + 0.5))
    return float(value != 0) if kind == "BOOL" else value


class ValueReader:
    """Reads and evaluates values at a place of one line, from left to right.

    text : the line, upper case outside of quotes; at : place of the next character
    """

    def __init__(self, text: str, variables: Variables, at: int = 0) -> None:
        self.text, self.variables, self.at, self._depth = text, variables, at, 0

    def skip(self) -> None:
        """Skip blanks."""
        while self.at < len(self.text) and self.text[self.at] in " \t":
            self.at += 1

    def takes(self, sign: str) -> bool:
        """Skip blanks and ``sign`` where it is next."""
        text = self.text
        if text[self.at:self.at + 1] in (" ", "\t"):
            self.skip()
        if not text.startswith(sign, self.at):
            return False
        self.at += len(sign)
        return True

    def need(self, sign: str) -> None:
        """Skip ``sign``.

        Raises
        ------
        BlockError
            Something else is next.
        """
        if not self.takes(sign):
            raise BlockError(f"'{sign}' is missing before '{self.text[self.at:self.at + 30]}'")

    def number(self) -> float:
        """A value that is a number.

        Raises
        ------
        BlockError
            It is a text, or not finite.
        """
        value = self.value()
        if isinstance(value, str):
            raise BlockError(f"a text ('{value[:30]}') where a number is needed")
        if not math.isfinite(value):
            raise BlockError("the value of an expression is not a finite number")
        return value

    def value(self, least: int = 1) -> Value:
        """An expression whose operators have at least this level. Raises BlockError where it cannot be read."""
        left = self._single()
        while (m := _OPERATOR.match(self.text, self.at)) and _LEVELS[m[1]] >= least:
            self.at = m.end()
            left = _joined(m[1], left, self.value(_LEVELS[m[1]] + 1))
        return left

    def index(self) -> tuple[int, ...]:
        """Whole numbers in square brackets, or () where none follow. Raises BlockError for other numbers."""
        if not self.takes("["):
            return ()
        found = [_whole(self.number())]
        while self.takes(","):
            found.append(_whole(self.number()))
        self.need("]")
        return tuple(found)

    def placed(self) -> str:
        """AC, IC, DC, ACP or ACN with its opening bracket, without which it is returned; '' where none follows."""
        if (m := _PLACED.match(self.text, self.at)) is None:
            return ""
        self.at = m.end()
        return m[1]

    def _single(self) -> Value:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise BlockError(f"more than {MAX_DEPTH} nested brackets and signs")
        found = self._bare()
        self._depth -= 1
        return found

    def _bare(self) -> Value:
        self.skip()
        if m := _NUMBER.match(self.text, self.at):
            self.at, written = m.end(), m[0].replace("EX", "E")
            return _finite(m[0], lambda: float(written))
        if m := _CODED.match(self.text, self.at):
            self.at = m.end()
            return float(int(m[1], 16) if m[1] else int(m[2], 2))
        if m := _NAME.match(self.text, self.at):
            self.at = m.end()
            return self._named(m[0])
        if self.takes("("):
            inside = self.value()
            self.need(")")
            return inside
        if self.takes("-"):
            return -_as_number(self._single())
        if self.takes("+"):
            return _as_number(self._single())
        if m := _TEXT.match(self.text, self.at):
            self.at = m.end()
            return m[1]
        raise BlockError(f"cannot read a value at '{self.text[self.at:self.at + 30]}'")

    def _named(self, name: str) -> Value:
        if name in ("TRUE", "FALSE"):
            return float(name == "TRUE")
        if name in ("NOT", "B_NOT"):
            value = _as_number(self._single())
            return float(value == 0) if name == "NOT" else float(~_whole(value))
        if name.startswith("$"):
            end = self.text.find("]", self.at) if self.takes("[") else -1
            inside = self.text[self.at:end].strip() if end >= 0 else ""
            self.at = end + 1 if end >= 0 else self.at
            return self.variables.served(name, inside)
        if name in _FUNCTIONS:
            return self._function(name)
        return self.variables.read(name, self.index())

    def _function(self, name: str) -> float:
        count, function = _FUNCTIONS[name]
        self.need("(")
        given = [self.number()]
        while self.takes(","):
            given.append(self.number())
        self.need(")")
        if len(given) != count:
            raise BlockError(f"{name} takes {count} values, not {len(given)}")
        return _finite(name, lambda: function(*given))


def _as_number(value: Value) -> float:
    if isinstance(value, str):
        raise BlockError(f"a text ('{value[:30]}') where a number is needed")
    return value


def _finite(name: str, compute: Callable[[], float]) -> float:
    try:
        found = compute()
    except BlockError:
        raise
    except (ValueError, OverflowError, ZeroDivisionError):
        raise BlockError(f"{name} has no value here") from None
    if not math.isfinite(found):
        raise BlockError(f"{name} is not a finite number")
    return found


def _whole(value: float) -> int:
    if not math.isfinite(value) or abs(value) > 1e15:
        raise BlockError(f"{value:g} is not a whole number")
    return math.floor(value + 0.5)


def _joined(sign: str, left: Value, right: Value) -> Value:
    if sign == "<<":
        return f"{_shown(left)}{_shown(right)}"
    if sign in ("==", "<>") and isinstance(left, str) and isinstance(right, str):
        return float((left == right) == (sign == "=="))
    return _finite(sign, lambda: _OPERATIONS[sign](_as_number(left), _as_number(right)))


def _shown(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _rounded(value: float) -> float:
    """Nearest whole number, halves away from zero."""
    return math.copysign(math.floor(abs(value) + 0.5), value)


def _truncated(value: float) -> float:
    """TRUNC: a number that a comparison takes for a whole one is that one (Job Planning, precision correction)."""
    return _rounded(value) if same(value, _rounded(value)) else float(math.trunc(value))


def same(a: Value, b: Value) -> bool:
    """Whether a comparison with equality, or CASE, takes both for one: numbers within 1e-12 (Job Planning, TRUNC)."""
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return abs(a - b) <= 1e-12 * max(abs(a), abs(b))


def _exceeds(a: float, b: float) -> bool:
    """Whether a is greater than b.

    Raises
    ------
    BlockError
        They differ by so little that a control may take them for equal (Job Planning, precision correction; MD10280).
    """
    if a != b and same(a, b):
        raise BlockError(f"{a!r} is compared with {b!r}: machine data decide whether the control takes both for equal",
                         "compare with a number between two values, or count in whole numbers")
    return a > b


def _bits(function: Callable[[int, int], int]) -> Callable[[float, float], float]:
    return lambda a, b: float(function(_whole(a), _whole(b)))


_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "*": operator.mul, "/": operator.truediv, "+": operator.add, "-": operator.sub,
    "DIV": lambda a, b: certain("DIV", math.trunc)(a / b), "MOD": math.fmod,
    "==": lambda a, b: float(same(a, b)), "<>": lambda a, b: float(not same(a, b)),
    "<": lambda a, b: float(_exceeds(b, a)), ">": lambda a, b: float(_exceeds(a, b)),
    "<=": lambda a, b: float(a < b or same(a, b)), ">=": lambda a, b: float(a > b or same(a, b)),
    "AND": lambda a, b: float(a != 0 and b != 0), "OR": lambda a, b: float(a != 0 or b != 0),
    "XOR": lambda a, b: float((a != 0) != (b != 0)), "B_AND": _bits(operator.and_), "B_OR": _bits(operator.or_),
    "B_XOR": _bits(operator.xor),
}
_FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "SIN": (1, lambda v: math.sin(math.radians(v))), "COS": (1, lambda v: math.cos(math.radians(v))),
    "TAN": (1, lambda v: math.tan(math.radians(v))), "ASIN": (1, lambda v: math.degrees(math.asin(v))),
    "ACOS": (1, lambda v: math.degrees(math.acos(v))), "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
    "SQRT": (1, math.sqrt), "ABS": (1, abs), "POT": (1, lambda v: v * v),
    "TRUNC": (1, _truncated),
    "ROUND": (1, certain("ROUND", _rounded, 0.5)), "ROUNDUP": (1, certain("ROUNDUP", math.ceil)), "LN": (1, math.log),
    "EXP": (1, math.exp),
    "MINVAL": (2, min), "MAXVAL": (2, max), "BOUND": (3, lambda low, high, v: min(max(v, low), high)),
}


def arguments(reader: ValueReader) -> list[str]:
    """Text of the arguments up to the closing bracket; quotes and inner brackets are kept whole.

    Raises
    ------
    BlockError
        A bracket is not closed.
    """
    text, depth, quoted, begun = reader.text, 0, False, reader.at
    out: list[str] = []
    for at in range(reader.at, len(text)):
        c = text[at]
        if c == '"':
            quoted = not quoted
        elif quoted:
            continue
        elif c in "([":
            depth += 1
        elif c == ")" and depth == 0:
            reader.at = at + 1
            return [*out, text[begun:at].strip()]
        elif c in ")]":
            depth -= 1
        elif c == "," and depth == 0:
            out.append(text[begun:at].strip())
            begun = at + 1
    raise BlockError(f"a bracket is not closed in '{text[:40]}'")


__all__ = ["MAX_ELEMENTS", "Value", "ValueReader", "Variables", "arguments"]
