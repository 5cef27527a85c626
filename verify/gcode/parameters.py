"""The parameters of a program: numbered and named, of the program and of each call.

#1 to #30 and names without a leading underscore belong to the call they are set in; the rest to the whole program. What
a program reads must have been given a value by it, or be known to the reader (``served``): a control keeps numbers from
the program before, and a proof cannot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from verify.gcode.block_words import BlockError
from verify.gcode.system_parameters import NAMES, is_served

LOCAL = 30
LAST = 5000
MESSAGES = 5599
"""A switch of the control for its own messages, which moves nothing."""


@dataclass
class CallFrame:
    """What one call, or the main program, has of its own: its parameters and how often its loops still run."""

    numbers: dict[int, float] = field(default_factory=dict)
    names: dict[str, float] = field(default_factory=dict)
    repeats: dict[int, int] = field(default_factory=dict)


class Parameters:
    """All parameters at one time.

    served : value of a number or name the reader knows by itself; raises BlockError where it does not
    """

    def __init__(self, served: Callable[[int | str], float]) -> None:
        self._served = served
        self.frames = [CallFrame()]
        self._numbers: dict[int, float] = {}
        self._names: dict[str, float] = {}
        self.returned: tuple[float, float] = (0.0, 0.0)

    @property
    def frame(self) -> CallFrame:
        """What belongs to the call being run."""
        return self.frames[-1]

    def numbered(self, number: float) -> float:
        """Value of a numbered parameter; BlockError where it has none, naming it."""
        n = _index(number)
        if n > LAST:
            return self._served(n)
        held = self.frame.numbers if n <= LOCAL else self._numbers
        if n not in held:
            raise BlockError(f"#{n} is read before the program gives it a value; set it first")
        return held[n]

    def named(self, name: str) -> float:
        """Value of a named parameter; BlockError where it has none, naming it."""
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
            return self._served(name)
        raise BlockError(f"#<{name}> is read before the program gives it a value; set it first")

    def exists(self, name: str) -> bool:
        """Whether a name has a value, or is one of the control's own; BlockError where that hangs on the machine."""
        if name.startswith(("_ini[", "_hal[")):
            raise BlockError(f"EXISTS[#<{name}>] hangs on the machine, which the proof cannot know")
        return name in self._held(name) or is_served(name)

    def put(self, number: float, value: float) -> None:
        """Give a numbered parameter a value; BlockError for those the control keeps for itself."""
        n = _index(number)
        if n > LAST and n != MESSAGES:
            raise BlockError(f"#{n} is a parameter of the control (offsets, probing, position): a program that sets it "
                             "changes what the proof cannot know")
        (self.frame.numbers if n <= LOCAL else self._numbers)[n] = value

    def put_name(self, name: str, value: float) -> None:
        """Give a named parameter a value; BlockError for those a control does not let a program set."""
        if not name or name in NAMES:
            raise BlockError(f"#<{name}> cannot be set by a program")
        self._held(name)[name] = value

    def _held(self, name: str) -> dict[str, float]:
        return self._names if name.startswith("_") else self.frame.names


def _index(number: float) -> int:
    """Number of a parameter, 1 to 5602; BlockError otherwise."""
    n = round(number)
    if abs(number - n) > 1e-4 or not 1 <= n <= 5602:
        raise BlockError(f"#{number:g} is no parameter: they are numbered from 1 to 5602")
    return n
