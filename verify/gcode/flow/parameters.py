"""The parameters of a program: numbered and named, of the program and of each call.

#1 to #30 and names without a leading underscore belong to the call that sets them, the rest to the whole program. The
program must give a parameter its value before it reads it, or the reader must know it (``served``). A control keeps
values of the program before; a proof cannot know them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from verify.gcode.block_words import BlockError
from verify.gcode.flow.system_parameters import NAMES, is_served

LOCAL = 30
LAST = 5000
MESSAGES = 5599
"""A switch of the control for its messages; it moves nothing."""


@dataclass
class CallFrame:
    """The local state of one call, or of the main program: its parameters and the remaining runs of its loops."""

    numbers: dict[int, float] = field(default_factory=dict)
    names: dict[str, float] = field(default_factory=dict)
    repeats: dict[int, int] = field(default_factory=dict)


class Parameters:
    """All parameters at one time.

    changes : how often a value changed, or one of the control was read; the flow adds its calls
    served : gives the value of a number or name that the control serves; raises BlockError where the reader does not
             know it
    """

    def __init__(self, served: Callable[[int | str], float]) -> None:
        self._served, self.changes = served, 0
        self.frames = [CallFrame()]
        self._numbers: dict[int, float] = {}
        self._names: dict[str, float] = {}
        self.returned: tuple[float, float] = (0.0, 0.0)

    @property
    def frame(self) -> CallFrame:
        """The local state of the running call."""
        return self.frames[-1]

    def numbered(self, number: float) -> float:
        """Value of a numbered parameter.

        Raises
        ------
        BlockError
            It has no value; the message names it.
        """
        n = _index(number)
        if n > LAST:
            self.changes += 1
            return self._served(n)
        held = self.frame.numbers if n <= LOCAL else self._numbers
        if n not in held:
            raise BlockError(f"#{n} has no value yet; set it first")
        return held[n]

    def angle(self, degrees: float) -> float:
        """An angle that ATAN or ASIN gives, deg, from -180 to 180, in the range of the control."""
        return degrees

    def named(self, name: str) -> float:
        """Value of a named parameter.

        Raises
        ------
        BlockError
            It has no value; the message names it.
        """
        if name == "_value":
            return self.returned[0]
        if name == "_value_returned":
            return self.returned[1]
        if name == "_call_level":
            return float(len(self.frames) - 1)
        held = self._held(name)
        if name in held:
            return held[name]
        if is_served(name):
            self.changes += 1
            return self._served(name)
        raise BlockError(f"#<{name}> has no value yet; set it first")

    def exists(self, name: str) -> bool:
        """Whether a name has a value, or the control serves it.

        Raises
        ------
        BlockError
            That depends on the machine.
        """
        if name.startswith(("_ini[", "_hal[")):
            raise BlockError(f"EXISTS[#<{name}>] depends on the machine, and the proof cannot know it")
        return name in self._held(name) or is_served(name)

    def put(self, number: float, value: float) -> None:
        """Give a numbered parameter a value.

        Raises
        ------
        BlockError
            It is one that the control sets.
        """
        n = _index(number)
        if n > LAST and n != MESSAGES:
            raise BlockError(f"#{n} is a parameter of the control (offsets, probing, position); the proof does not "
                             "know the effect of setting it")
        held = self.frame.numbers if n <= LOCAL else self._numbers
        self.changes += held.get(n) != value
        held[n] = value

    def put_name(self, name: str, value: float) -> None:
        """Give a named parameter a value.

        Raises
        ------
        BlockError
            A program cannot set it.
        """
        if not name or name in NAMES:
            raise BlockError(f"a program cannot set #<{name}>")
        held = self._held(name)
        self.changes += held.get(name) != value
        held[name] = value

    def _held(self, name: str) -> dict[str, float]:
        return self._names if name.startswith("_") else self.frame.names


def _index(number: float) -> int:
    """Number of a parameter, 1 to 5602; BlockError otherwise."""
    n = round(number)
    if abs(number - n) > 1e-4 or not 1 <= n <= 5602:
        raise BlockError(f"#{number:g} is not a parameter: numbers go from 1 to 5602")
    return n
