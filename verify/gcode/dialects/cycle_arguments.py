"""Arguments of the cycles of a control, and what the reader does with each of them.

An argument that moves nothing and changes no speed by the manual of the control is harmless. Every other one is used,
or its cycle is refused where its value is not the neutral one: no argument is dropped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from verify.gcode.dialects.base import BlockError


class Role(StrEnum):
    """What the reader does with an argument."""

    USED = "used"
    HARMLESS = "harmless"
    REFUSED = "refused"


@dataclass(frozen=True)
class Argument:
    """An argument of a cycle.

    name     : as the manual has it
    role     : what the reader does with it
    what     : what it is, for one that is refused; '' for others
    unsigned : whether the manual takes no value below 0
    text     : whether it may be a text
    """

    name: str
    role: Role = Role.USED
    what: str = ""
    unsigned: bool = False
    text: bool = False


def used(names: str) -> tuple[Argument, ...]:
    """Arguments with these names that the reader uses; a + behind a name: the manual takes no value below 0."""
    return tuple(Argument(n.rstrip("+"), unsigned=n.endswith("+")) for n in names.split())


def harmless(names: str, *, text: bool = False) -> tuple[Argument, ...]:
    """Arguments with these names that move nothing and change no speed; a + as in ``used``."""
    return tuple(Argument(n.rstrip("+"), Role.HARMLESS, unsigned=n.endswith("+"), text=text) for n in names.split())


def refused(names: str, what: str) -> tuple[Argument, ...]:
    """Arguments with these names that are refused unless they are 0."""
    return tuple(Argument(n, Role.REFUSED, what) for n in names.split())


def check_argument(cycle: str, argument: Argument, value: float) -> None:
    """Refuse a value that the reader cannot follow, or that the manual does not take.

    Raises
    ------
    BlockError
        The value is not 0 and the argument is refused, or it is below 0 and the manual takes none there.
    """
    name = argument.name
    if argument.role is Role.REFUSED and value:
        raise BlockError(f"{cycle} with {name}={value:g} ({argument.what}) is not followed",
                         f"write {name}=0, and what it does as moves or as another cycle")
    if argument.unsigned and value < 0:
        raise BlockError(f"{cycle} with {name}={value:g}: the control takes no value below 0",
                         f"write {name}={-value:g}")


def digits_of(cycle: str, name: str, value: float, allowed: Sequence[str]) -> list[int]:
    """Digits of a mode, the units first; as many as there are in ``allowed``.

    allowed : the digits that are followed at each place, the units first; every other place has to be 0

    Raises
    ------
    BlockError
        It is no whole number from 0, or has another digit at some place.
    """
    if not math.isfinite(value) or value < 0 or value != int(value):
        raise BlockError(f"{cycle} with {name}={value:g}: the mode is a whole number from 0")
    text = str(int(value))[::-1].ljust(len(allowed), "0")
    for k, digit in enumerate(text):
        if digit not in (allowed[k] if k < len(allowed) else "0"):
            raise BlockError(f"{cycle} with {name}={value:g} is not followed: the proof does not know its digit "
                             f"{digit} for {10 ** k}", f"write {name} with 0 there")
    return [int(d) for d in text[:len(allowed)]]


__all__ = ["Argument", "Role", "check_argument", "digits_of", "harmless", "refused", "used"]
