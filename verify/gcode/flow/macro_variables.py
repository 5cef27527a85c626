"""Variables and arithmetic of the macros of Fanuc and Haas.

#1 to #33 belong to one level of G65; #100 to #199 and #500 to #999 to the control. #0 and a local variable without a
value are vacant, which EQ and NE tell from 0. A common variable keeps its value from the program before, so one that
the program has not set is unknown, and reading it is an error that names it. A word whose variable is vacant is
ignored. One that may be vacant is an error too, and so is a formula of a vacant one, which controls count as 0.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable

from verify.gcode.block_words import BlockError
from verify.gcode.flow.expressions import (
    Grammar,
    apart,
    certain,
    divided,
    modulo,
    power,
    rounded,
    small_enough,
    within,
)
from verify.gcode.flow.parameters import Parameters

LOCALS = 33
POSITIONS = {5001: 5420, 5002: 5421, 5003: 5422, 5041: 5420, 5042: 5421, 5043: 5422}
"""Places of the tip in programmed coordinates, and the numbers of LinuxCNC for them."""
MODES: dict[int, tuple[str, tuple[float, ...]]] = {
    4001: ("_motion_mode", (0, 1, 2, 3)), 4002: ("_plane", ()), 4003: ("_absolute", (91, 90)),
    4006: ("_metric", (20, 21)), 4010: ("_retract_r_plane", (98, 99)),
    4109: ("_feed", ()), 4119: ("_rpm", ()), 4120: ("_current_tool", ())}
"""Modal words by the variable that holds them: their name in the reader, and the G words of 0 and 1."""
IDLE = frozenset({3003, 3004, 3006})
"""Variables that stop, show messages or lock switches, but move nothing."""
ALARM = 3000
_COMMON = (range(100, 200), range(500, 1000))
ARGUMENTS = dict(zip("ABCIJKDEFHMQRSTUVWXYZ",
                     (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 13, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26), strict=True))
"""Numbers of the local variables that the letters of G65 fill."""


class MacroVariables(Parameters):
    """All variables at one time; the levels of G65 are its frames.

    vacant  : the latest number that was read without a value
    ignored : words of the latest block that the control ignores
    angle   : gives an angle, deg, from -180 to 180, in the range of the control; None: as it is
    """

    vacant = 0

    def __init__(self, served: Callable[[int | str], float], angle: Callable[[float], float] | None = None) -> None:
        super().__init__(served)
        self.ignored: list[str] = []
        self._angle = angle

    def angle(self, degrees: float) -> float:
        """An angle that ATAN or ASIN gives, deg, in the range of the control."""
        return degrees if self._angle is None else self._angle(degrees)

    def numbered(self, number: float) -> float:
        """Value of a variable, nan where it is vacant.

        Raises
        ------
        BlockError
            It is unknown; the message names it.
        """
        n = _whole(number)
        if n <= LOCALS:
            found = self.frame.numbers.get(n, math.nan)
            if found != found:
                self.vacant = n
            return found
        if n in POSITIONS or n in MODES:
            self.changes += 1
            return self._served(POSITIONS[n]) if n in POSITIONS else self._mode(n)
        if n not in self._numbers:
            if any(n in r for r in _COMMON):
                raise BlockError(f"#{n} has no value: the program has not set it, and a control keeps it from the "
                                 "program before", f"set #{n} in the program, such as #{n}=0")
            raise BlockError(f"#{n} is a variable of the control that the proof cannot know",
                             "write the number instead")
        if self._numbers[n] != self._numbers[n]:
            self.vacant = n
        return self._numbers[n]

    def _mode(self, n: int) -> float:
        """A modal word of the block before: #4001 holds the motion, #4002 the plane, #4003 90 or 91, and so on."""
        name, codes = MODES[n]
        found = self._served(name)
        code = found / 10.0 if name in ("_motion_mode", "_plane") else codes[int(found)] if codes else found
        if n == 4001 and code not in codes:
            raise BlockError("#4001 in a drilling cycle, which controls count differently")
        return code

    def put(self, number: float, value: float) -> None:
        """Give a variable a value; nan makes it vacant.

        Raises
        ------
        BlockError
            It is one of the control, or the program stops with an alarm.
        """
        n = _whole(number)
        if n == ALARM:
            raise BlockError(f"#3000={value:g}: the program stops here with an alarm")
        if n in IDLE:
            return
        if n == 0 or not (n <= LOCALS or any(n in r for r in _COMMON)):
            raise BlockError(f"#{n} is a variable of the control; the proof does not know the effect of setting it",
                             "leave it out; words state zeros and units (G10, G52, G20, G21)")
        held = self.frame.numbers if n <= LOCALS else self._numbers
        self.changes += held.get(n) != value
        held[n] = value

    def emptied(self) -> bool:
        """Whether the variable read last is certainly vacant: #0, one that the program emptied, a local one of a call.

        A local variable of the main program may hold the value of a program before.
        """
        n = self.vacant
        return n == 0 or n > LOCALS or n in self.frame.numbers or len(self.frames) > 1

    def known(self, value: float, what: str) -> float:
        """The value itself.

        Raises
        ------
        BlockError
            It is vacant; the message names the variable and ``what`` uses it.
        """
        if value != value:
            raise BlockError(f"{what} uses #{self.vacant}, which has no value yet; set it first")
        return value


def _whole(number: float) -> int:
    if number != number or abs(number - round(number)) > 1e-4 or not 0 <= number <= 99999:
        raise BlockError(f"#{number:g} is not a variable")
    return round(number)


def _equal(a: float, b: float) -> float:
    a, b = apart(a, b)
    return float((a != a and b != b) or a == b)


def _ordered(compare: Callable[[float, float], bool]) -> Callable[[float, float], float]:
    def compared(a: float, b: float) -> float:
        if a != a or b != b:
            raise BlockError("a comparison with a variable that has no value yet; set it first")
        return float(compare(*apart(a, b)))
    return compared


def _bits(combine: Callable[[int, int], int]) -> Callable[[float, float], float]:
    def combined(a: float, b: float) -> float:
        if not (math.isfinite(a) and math.isfinite(b)):
            raise BlockError("AND, OR or XOR of a variable that has no value yet; set it first")
        return float(combine(round(a), round(b)))
    return combined


def _truncated(number: float) -> float:
    return float(math.trunc(number)) if math.isfinite(number) else number


def _away(number: float) -> float:
    return math.copysign(math.ceil(abs(number)), number) if math.isfinite(number) else number


def _rounded(number: float) -> float:
    return rounded(number) if math.isfinite(number) else number


_SQRT = within("SQRT", math.sqrt, 0, math.inf)
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs, "fix": certain("FIX", _truncated), "fup": certain("FUP", _away),
    "round": certain("ROUND", _rounded, 0.5), "rnd": certain("RND", _rounded, 0.5),
    "exp": lambda v: small_enough(f"EXP[{v:g}]", lambda: math.exp(v)),
    "acos": within("ACOS", lambda v: math.degrees(math.acos(v)), -1, 1),
    "asin": within("ASIN", lambda v: math.degrees(math.asin(v)), -1, 1),
    "cos": lambda v: math.cos(math.radians(v)), "sin": lambda v: math.sin(math.radians(v)),
    "tan": lambda v: math.tan(math.radians(v)),
    "ln": within("LN", math.log, math.ulp(0.0), math.inf), "sqrt": _SQRT, "sqr": _SQRT,
}
_OPERATORS: dict[str, Callable[[float, float], float]] = {
    "*": operator.mul, "/": divided, "+": operator.add, "-": operator.sub, "mod": modulo,
    "and": _bits(operator.and_), "or": _bits(operator.or_), "xor": _bits(operator.xor),
    "eq": _equal, "ne": lambda a, b: 1.0 - _equal(a, b), "gt": _ordered(operator.gt), "ge": _ordered(operator.ge),
    "lt": _ordered(operator.lt), "le": _ordered(operator.le),
}
_PRECEDENCE = {"*": 3, "/": 3, "mod": 3, "and": 3, "+": 2, "-": 2, "or": 2, "xor": 2,
               "eq": 1, "ne": 1, "gt": 1, "ge": 1, "lt": 1, "le": 1}
_PAIRS: dict[str, Callable[[float, float], float]] = {
    "pow": power, "atan": lambda y, x: math.degrees(math.atan2(y, x))}


def _in_word(number: float) -> float:
    raise BlockError(f"ROUND[{number:g}] in a word rounds to the least increment of the control, in an assignment to a "
                     "whole number", "round in an assignment before: #1=ROUND[#2]")


MACRO_GRAMMAR = Grammar(_FUNCTIONS, _OPERATORS, _PRECEDENCE, _PAIRS)
"""Expressions of macro B in assignments and conditions."""
WORD_GRAMMAR = Grammar({**_FUNCTIONS, "round": _in_word, "rnd": _in_word}, _OPERATORS, _PRECEDENCE, _PAIRS)
"""Expressions of macro B behind a letter."""
