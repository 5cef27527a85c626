"""Arguments of the cycles of Siemens controls, in the order of the manual, and the values of one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from verify.gcode.dialects.base import BlockError, Machine
from verify.gcode.dialects.cycle_arguments import Argument, check_argument, digits_of, harmless, refused, used

_HOLE = used("RTP RFP SDIS+ DP DPR")
_MODES = used("_GMODE _DMODE _AMODE")
_THREAD_NAMES = harmless("_PITM _PTAB _PTABA", text=True)
"""The thread of a table, for the editor of the control: its pitch stands in PIT too."""
_ROW = (*used("_VARI"), *refused("_UMODE", "reserved"), Argument("_HIDE", text=True), *refused("_NSP", "reserved"),
        *used("_DMODE"))
CYCLES: dict[str, tuple[Argument, ...]] = {
    "CYCLE81": (*_HOLE, *used("DTB"), *_MODES),
    "CYCLE82": (*_HOLE, *used("DTB"), *_MODES, *refused("_VARI", "drilling with a first cut or a breakthrough"),
                *refused("S_ZA", "the depth of a first cut"), *refused("S_FA", "the feed of a first cut"),
                *refused("S_ZD", "the depth of a breakthrough"), *refused("S_FD", "the feed of a breakthrough")),
    "CYCLE83": (*_HOLE, *used("FDEP FDPR _DAM DTB"), *harmless("DTS"), *used("FRF+ VARI _AXN _MDEP+ _VRT+ _DTD _DIS1+"),
                *_MODES),
    "CYCLE84": (*_HOLE, *used("DTB SDAC MPIT PIT"), *harmless("POSS"), *used("SST+ SST1+ _AXN _PITA"),
                *harmless("_TECHNO"), *used("_VARI"), *harmless("_DAM _VRT"), *_THREAD_NAMES, *_MODES),
    "CYCLE840": (*_HOLE, *used("DTB SDR SDAC ENC MPIT PIT _AXN _PITA"), *harmless("_TECHNO"), *_THREAD_NAMES, *_MODES),
    "CYCLE85": (*_HOLE, *used("DTB FFR+ RFF+"), *_MODES),
    "CYCLE86": (*_HOLE, *used("DTB SDIR RPA RPO"), *harmless("RPAP+ POSS"), *_MODES),
    "CYCLE87": (*_HOLE, *used("SDIR")),
    "CYCLE88": (*_HOLE, *used("DTB SDIR")),
    "CYCLE89": (*_HOLE, *used("DTB")),
    "HOLES1": (*used("SPCA SPCO STA1 FDIS DBH NUM"), *_ROW),
    "HOLES2": (*used("CPA CPO RAD STA1 INDA NUM"), *_ROW),
}
"""Arguments of each cycle that is followed. Chip breaks of a tap (_DAM, _VRT) stay within the thread and its pitch;
a bore is left upwards by RPAP with the spindle standing."""
DRILLS = frozenset(name for name in CYCLES if name.startswith("CYCLE"))
"""The cycles that drill."""
PATTERNS = frozenset(CYCLES) - DRILLS
"""Rows and circles of holes."""
PLANES = {1: 17, 2: 18, 3: 19}
_DEPTH, _TIME, _EITHER = "012", "012", "01"
_ALTERNATIVES: dict[str, tuple[str, ...]] = {
    "CYCLE81": (_DEPTH, _TIME), "CYCLE82": (_DEPTH, _TIME, *("0123456789",) * 4),
    "CYCLE83": (_DEPTH, _TIME, _TIME, _TIME, _DEPTH, "012", _EITHER, _EITHER),
    "CYCLE84": (_DEPTH, *(_EITHER,) * 7), "CYCLE840": (_DEPTH, *(_EITHER,) * 7),
    "CYCLE85": (_DEPTH, _TIME), "CYCLE86": (_DEPTH, _TIME)}
"""Digits of _AMODE that are followed, the units first: how the depth counts, what unit a dwell has, and what belongs to
further arguments. In CYCLE82 those are refused; in CYCLE84 and CYCLE840 a 2 may be a left-hand thread."""


@dataclass(frozen=True)
class CycleCall:
    """A cycle with the values of its call by the names of the manual; those left out are missing."""

    name: str
    values: dict[str, float]

    def at(self, argument: str) -> float | None:
        """The value of an argument, None where the call leaves it out or the cycle has none of that name."""
        return self.values.get(argument)

    def number(self, argument: str, otherwise: float = 0.0) -> float:
        """The value of an argument, ``otherwise`` where it is left out."""
        return self.values.get(argument, otherwise)

    @cached_property
    def alternatives(self) -> list[int]:
        """Digits of _AMODE, the units first."""
        allowed = _ALTERNATIVES.get(self.name, ())
        return digits_of(self.name, "_AMODE", self.number("_AMODE"), allowed)

    def is_relative(self, absolute: str, relative: str, place: int) -> bool:
        """Whether a depth counts from the reference plane.

        absolute, relative : names of the argument of each kind; place : of the digit of _AMODE that chooses

        Raises
        ------
        BlockError
            _AMODE names an argument that the call leaves out.
        """
        kind = self.alternatives[place] if place < len(self.alternatives) else 0
        named = {1: relative, 2: absolute}.get(kind)
        if named is not None and self.at(named) is None:
            raise BlockError(f"{self.name} with _AMODE={self.number('_AMODE'):g} takes its depth from {named}, which "
                             "is left out", f"write {named}, or _AMODE={self.number('_AMODE') - kind * 10 ** place:g}")
        return kind == 1 or (kind == 0 and bool(self.number(relative)))

    def check_plane(self, machine: Machine) -> None:
        """Refuse a plane of the cycle (units of _DMODE) other than that in force.

        Raises
        ------
        BlockError
            It is another one, or none at all.
        """
        mode = self.number("_DMODE")
        plane = digits_of(self.name, "_DMODE", mode, ("0123", *("0123456789",) * 7))[0]
        if plane and PLANES[plane] != machine.s.plane:
            raise BlockError(f"{self.name} with _DMODE={mode:g} works in G{PLANES[plane]} while G{machine.s.plane} is "
                             "in force", f"write _DMODE={mode - plane:g}, and G{PLANES[plane]} before the cycle if it "
                             "is meant")


def called(name: str, values: Sequence[float | str | None]) -> CycleCall:
    """The call of a cycle of ``CYCLES``.

    values : in the order of the manual, None where one is left out

    Raises
    ------
    BlockError
        A value is not followed, or there are more than the cycle has arguments.
    """
    known, held = CYCLES[name], {}
    for k, value in enumerate(values):
        if value is None or (value == "" and k < len(known) and known[k].text):
            continue
        if k >= len(known):
            if value:
                raise BlockError(f"{name} with {value} as argument {k + 1}: the proof knows {len(known)}",
                                 "leave out the arguments behind them")
        elif isinstance(value, str):
            if known[k].name == "_HIDE":
                raise BlockError(f"{name} with hidden holes is not followed")
        else:
            check_argument(name, known[k], value)
            held[known[k].name] = value
    return CycleCall(name, held)


def check_override(what: str, machine: Machine) -> None:
    """Refuse OVR= other than 100 while a tap cuts: the control may hold the feed to the speed of the spindle.

    Raises
    ------
    BlockError
        The program states another one.
    """
    if machine.s.override != 1.0:
        raise BlockError(f"{what} under OVR={100 * machine.s.override:g}: the control may not count it while it taps",
                         "program OVR=100 before it")


__all__ = ["CYCLES", "DRILLS", "PATTERNS", "CycleCall", "called", "check_override"]
