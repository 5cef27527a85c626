"""Numbers, parameters and expressions of LinuxCNC and of macros: parsed once, evaluated whenever their line runs.

Precedence in LinuxCNC, from the highest: ** ; * / MOD ; + - ; EQ NE GT GE LT LE ; AND OR XOR. Operators of one level
run from left to right, and a sign belongs to the value after it. Angles are degrees. EQ and NE treat numbers within
1e-4 as equal. Another ``Grammar`` has other functions, operators and levels (``verify.gcode.flow.macro_variables``).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from verify.gcode.block_words import NUMBER, BlockError
from verify.gcode.flow.parameters import Parameters

Value = Callable[[Parameters], float]

MAX_BRACKETS = 40
EQUAL = 1e-4  # TOLERANCE_EQUAL of the interpreter; GT, GE, LT and LE compare all digits

_NUMBER = re.compile(NUMBER)
_NAME = re.compile(r"<([^<>]*)>")
_PRECEDENCE = {"**": 5, "*": 4, "/": 4, "mod": 4, "+": 3, "-": 3, "eq": 2, "ne": 2, "gt": 2, "ge": 2, "lt": 2, "le": 2,
               "and": 1, "or": 1, "xor": 1}


@dataclass(frozen=True)
class ParameterReference:
    """A parameter as it is written: its name, or the expression of its number."""

    name: str
    number: Value | None

    def read(self, scope: Parameters) -> float:
        """Its present value."""
        return scope.named(self.name) if self.number is None else scope.numbered(self.number(scope))


@dataclass(frozen=True)
class Grammar:
    """Functions and operators of a control.

    functions  : of one value, by name; atan takes two, exists a name
    operators  : of two values, by sign
    precedence : level of each operator, from 1
    pairs      : functions of two values in one bracket, by name
    """

    functions: Mapping[str, Callable[[float], float]]
    operators: Mapping[str, Callable[[float, float], float]]
    precedence: Mapping[str, int]
    pairs: Mapping[str, Callable[[float, float], float]] = field(default_factory=dict)

    @cached_property
    def function(self) -> re.Pattern[str]:
        """Matches the name of a function."""
        return _one_of({*self.functions, *self.pairs, "atan", "exists"})

    @cached_property
    def operator(self) -> re.Pattern[str]:
        """Matches an operator."""
        return _one_of(self.operators)


def _one_of(words: Iterable[str]) -> re.Pattern[str]:
    return re.compile("|".join(re.escape(w) for w in sorted(words, key=len, reverse=True)))


class ExpressionReader:
    """Parser of one line from left to right; the text is without blanks and in lower case."""

    def __init__(self, text: str, grammar: Grammar | None = None) -> None:
        self.text, self.at, self._depth, self.grammar = text, 0, 0, grammar or LINUXCNC_GRAMMAR

    @property
    def rest(self) -> str:
        """The text still to read, for messages."""
        return self.text[self.at:self.at + 40]

    def take(self, sign: str) -> None:
        """Skip ``sign``.

        Raises
        ------
        BlockError
            The text does not continue with it.
        """
        if not self.text.startswith(sign, self.at):
            raise BlockError(f"'{sign}' is missing before '{self.rest}'")
        self.at += len(sign)

    def value(self) -> Value:
        """A number, a parameter, a function, an expression in brackets, or one of these with a sign [Kramer2000].

        Raises
        ------
        BlockError
            More than 40 nested brackets, signs or #.
        """
        self._depth += 1
        if self._depth > MAX_BRACKETS:
            raise BlockError(f"more than {MAX_BRACKETS} nested brackets, signs or #")
        found = self._value()
        self._depth -= 1
        return found

    def _value(self) -> Value:
        if number := _NUMBER.match(self.text, self.at):
            self.at = number.end()
            fixed = float(number.group())
            return lambda scope: fixed
        sign = self.text[self.at:self.at + 1]
        if sign == "[":
            return self.bracket()
        if sign == "#":
            return self.target().read
        if sign in ("+", "-") and sign:
            self.at += 1
            behind = self.value()
            return behind if sign == "+" else lambda scope: -behind(scope)
        if function := self.grammar.function.match(self.text, self.at):
            self.at = function.end()
            return self._function(function.group())
        raise BlockError(f"cannot read a number, parameter or expression at '{self.rest}'")

    def whole(self) -> Value:
        """An expression without brackets round it; it may be vacant."""
        return self._joined(1)

    def bracket(self) -> Value:
        """An expression in brackets."""
        self.take("[")
        inside = self._joined(1)
        self.take("]")
        return _finite(inside)

    def target(self) -> ParameterReference:
        """The parameter behind a # sign."""
        self.take("#")
        if name := _NAME.match(self.text, self.at):
            self.at = name.end()
            return ParameterReference(name.group(1), None)
        return ParameterReference("", self.value())

    def _joined(self, min_precedence: int) -> Value:
        """Values joined by operators of at least this precedence."""
        left = self.value()
        g = self.grammar
        while (sign := g.operator.match(self.text, self.at)) and g.precedence[sign.group()] >= min_precedence:
            self.at = sign.end()
            left = _join(g.operators[sign.group()], left, self._joined(g.precedence[sign.group()] + 1))
        return left

    def _function(self, name: str) -> Value:
        if name == "exists":
            self.take("[")
            target = self.target()
            self.take("]")
            if target.number is not None:
                raise BlockError("EXISTS takes a named parameter, such as EXISTS[#<depth>], not a numbered one")
            return lambda scope: float(scope.exists(target.name))
        if pair := self.grammar.pairs.get(name):
            if (both := self._both(pair)) is not None:
                return _angle(both) if name == "atan" else both
        first = self.bracket()
        if name == "atan":
            self.take("/")
            return _angle(_join(lambda y, x: math.degrees(math.atan2(y, x)), first, self.bracket()))
        if name not in self.grammar.functions:
            raise BlockError(f"{name.upper()} takes two values in its bracket")
        function = self.grammar.functions[name]
        if name == "asin":
            return _angle(lambda scope: function(first(scope)))
        return lambda scope: function(first(scope))


    def _both(self, function: Callable[[float, float], float]) -> Value | None:
        """A function of two values in one bracket; None where the bracket holds one value."""
        start = self.at
        self.take("[")
        left = _finite(self._joined(1))
        if not self.text.startswith(",", self.at):
            self.at = start
            return None
        self.at += 1
        right = _finite(self._joined(1))
        self.take("]")
        return _join(function, left, right)


def _angle(value: Value) -> Value:
    """An angle, deg, in the range of the control."""
    return lambda scope: scope.angle(value(scope))


def _finite(value: Value) -> Value:
    def checked(scope: Parameters) -> float:
        result = value(scope)
        if not math.isfinite(result):
            raise BlockError("the value of an expression is not a finite number")
        return result
    return checked


def _join(operation: Callable[[float, float], float], left: Value, right: Value) -> Value:
    return lambda scope: operation(left(scope), right(scope))


def divided(left: float, right: float) -> float:
    """The quotient.

    Raises
    ------
    BlockError
        A division by zero.
    """
    if right == 0:
        raise BlockError(f"{left:g} is divided by zero")
    return left / right


def modulo(left: float, right: float) -> float:
    """The remainder, never negative.

    Raises
    ------
    BlockError
        A division by zero.
    """
    if right == 0:
        raise BlockError(f"{left:g} MOD zero has no value")
    return left % abs(right)


def power(left: float, right: float) -> float:
    """The power.

    Raises
    ------
    BlockError
        It has no value, or overflows.
    """
    if left < 0 and right != math.floor(right):
        raise BlockError(f"{left:g} ** {right:g} has no value: a negative number has whole powers only")
    if left == 0 and right < 0:
        raise BlockError(f"0 ** {right:g} has no value")
    return small_enough(f"{left:g} ** {right:g}", lambda: math.pow(left, right))


def apart(a: float, b: float) -> tuple[float, float]:
    """Both numbers of a comparison of a control that counts with fewer digits than the reader.

    Raises
    ------
    BlockError
        They differ by less than the rounding of such a control: it may take them for equal or not.
    """
    if a != b and abs(a - b) <= max(1e-9, 1e-8 * max(abs(a), abs(b))):
        raise BlockError(f"{a!r} is compared with {b!r}: the rounding of the control decides",
                         "compare with a number between two values, or count in whole numbers")
    return a, b


def certain(name: str, function: Callable[[float], float], edge: float = 0.0) -> Callable[[float], float]:
    """A function that goes to a whole number, for a control that counts with fewer digits than the reader.

    edge : from whole numbers to where the function changes, 0 or 0.5

    It refuses numbers that differ from such a place by less than the rounding of the control; ``name`` stands for it in
    the message.
    """
    def applied(number: float) -> float:
        near = math.floor(number - edge + 0.5) + edge if math.isfinite(number) else number
        if number != near and abs(number - near) <= max(1e-9, 1e-8 * abs(number)):
            raise BlockError(f"{name}[{number!r}]: the rounding of the control decides to which whole number it goes",
                             "add or take off a half before, so that the number lies between two whole ones")
        return function(number)
    return applied


def small_enough(name: str, compute: Callable[[], float]) -> float:
    """The computed number.

    Raises
    ------
    BlockError
        It overflows.
    """
    try:
        return compute()
    except OverflowError:
        raise BlockError(f"{name} is not a finite number") from None


def within(name: str, function: Callable[[float], float], low: float, high: float) -> Callable[[float], float]:
    """A function that refuses numbers not from ``low`` to ``high``; ``name`` stands for it in the message."""
    def applied(number: float) -> float:
        if not low <= number <= high:
            raise BlockError(f"{name}[{number:g}] has no value: it takes numbers from {low:g} to {high:g}")
        return function(number)
    return applied


def rounded(number: float) -> float:
    """Nearest whole number, halves away from zero."""
    return math.copysign(math.floor(abs(number) + 0.5), number)


_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "**": power, "*": operator.mul, "/": divided, "mod": modulo, "+": operator.add, "-": operator.sub,
    "eq": lambda a, b: float(abs(a - b) < EQUAL), "ne": lambda a, b: float(abs(a - b) >= EQUAL),
    "gt": lambda a, b: float(a > b), "ge": lambda a, b: float(a >= b), "lt": lambda a, b: float(a < b),
    "le": lambda a, b: float(a <= b), "and": lambda a, b: float(a != 0 and b != 0),
    "or": lambda a, b: float(a != 0 or b != 0), "xor": lambda a, b: float((a != 0) != (b != 0)),
}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs, "fix": math.floor, "fup": math.ceil, "round": rounded,
    "exp": lambda v: small_enough(f"EXP[{v:g}]", lambda: math.exp(v)),
    "acos": within("ACOS", lambda v: math.degrees(math.acos(v)), -1, 1),
    "asin": within("ASIN", lambda v: math.degrees(math.asin(v)), -1, 1),
    "cos": lambda v: math.cos(math.radians(v)), "sin": lambda v: math.sin(math.radians(v)),
    "tan": lambda v: math.tan(math.radians(v)),
    "ln": within("LN", math.log, math.ulp(0.0), math.inf), "sqrt": within("SQRT", math.sqrt, 0, math.inf),
}
LINUXCNC_GRAMMAR = Grammar(_FUNCTIONS, _OPERATIONS, _PRECEDENCE)
"""LinuxCNC."""
