"""Parameters of the drilling cycles of Heidenhain controls, by their numbers, and the values of one call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.cycle_arguments import Argument, check_argument, harmless, refused, used
from verify.gcode.dialects.stated_places import digits

_HOLE = used("Q200+ Q201 Q203 Q204+")
_EDGE = refused("Q395", "a depth that counts to the edge of the drill")
_INSIDE = (*refused("Q379", "a start within the hole"), *harmless("Q253+"))
"""Q253 is the feed to a start within the hole."""
CYCLES: dict[int, tuple[Argument, ...]] = {
    200: (*_HOLE, *used("Q202+ Q206+ Q211+"), *harmless("Q210+"), *_EDGE),
    201: (*_HOLE, *used("Q206+ Q208+ Q211+")),
    202: (*_HOLE, *used("Q206+ Q208+ Q211+ Q214"), *harmless("Q336 Q357+")),
    203: (*_HOLE, *used("Q202+ Q205+ Q206+ Q208+ Q211+ Q212+ Q213+ Q256+"), *harmless("Q210+"), *_EDGE),
    205: (*_HOLE, *used("Q202+ Q205+ Q206+ Q208+ Q211+ Q212+ Q256+ Q257+ Q258+ Q259+"), *harmless("Q373+"),
          *_INSIDE, *_EDGE),
    206: (*_HOLE, *used("Q206+ Q211+")),
    207: (*_HOLE, *used("Q239")),
    208: (*_HOLE, *used("Q206+ Q334+ Q335+ Q351"), *harmless("Q342+"),
          *refused("Q370", "an overlap of several helices")),
    209: (*_HOLE, *used("Q239 Q403+"), *harmless("Q256+ Q257+ Q336")),
    240: (*_HOLE, *used("Q206+ Q211+"), *refused("Q343", "the diameter of a centring"), *harmless("Q344"),
          *refused("Q342", "a hole drilled before"), *harmless("Q253+")),
    241: (*_HOLE, *used("Q206+ Q208+ Q211+ Q401+ Q426+ Q427+ Q428+ Q429+ Q430+ Q435+"), *harmless("Q202+ Q205+ Q212+"),
          *_INSIDE),
}
"""Parameters of each cycle that is followed. Chip breaks of a tap (Q256, Q257) stay within the thread and its pitch;
cycle 241 stays in its hole between infeeds (Q202). Q342 of cycle 208 ends a check of the control, and Q344 is the
diameter that counts with Q343. Q373 of cycle 205 is a feed in what is drilled."""
FEEDS = frozenset({"Q206", "Q208", "Q253", "Q373"})
"""Parameters that are a feed: they may be AUTO or MAX."""
_COOLANT = frozenset({7.0, 8.0, 9.0})
_TURNS = frozenset({3.0, 4.0, 5.0})
WAY_OF_CUT = 3.0
"""Q426 as the number of an M word: the way that drills cut."""
PERCENT = 100.0


@dataclass(frozen=True)
class CycleCall:
    """A cycle in force: its number and its parameters by name."""

    number: int
    values: Mapping[str, float]

    def get(self, name: str, otherwise: float | None = None) -> float:
        """Value of a parameter.

        Raises
        ------
        BlockError
            The definition lacks it.
        """
        found = self.values.get(name, otherwise)
        if found is None:
            raise BlockError(f"cycle {self.number} without {name}")
        return found

    def check(self) -> None:
        """Refuse a parameter that is not followed.

        Raises
        ------
        BlockError
            A value has another effect than the reader gives it, or the cycle has no such parameter.
        """
        cycle, known = f"cycle {self.number}", {a.name: a for a in CYCLES[self.number]}
        for name, value in self.values.items():
            if name not in known:
                if value:
                    raise BlockError(f"{cycle} with {name}={value:g}: the proof does not know this parameter of the "
                                     "cycle", "leave it out")
            elif math.isinf(value):
                if name not in FEEDS:
                    raise BlockError(f"{cycle} with {name} as AUTO or MAX: it is no feed", "write a number")
            else:
                check_argument(cycle, known[name], value)


def single_lip(call: CycleCall, speed: float, turning: bool) -> tuple[list[str], list[str]]:
    """Words of spindle and coolant before and behind cycle 241.

    speed : 1/min, in force; turning : whether the spindle turns

    The control drills with Q428 and M3, goes in and out with Q427 as Q426 says, and leaves the spindle so. The spindle
    counts as standing behind the cycle where that is another way to turn than before it.

    Raises
    ------
    BlockError
        A parameter is not followed.
    """
    stated = {"Q426", "Q427", "Q428"} & call.values.keys()
    drills, way = call.get("Q428", speed), call.get("Q426", WAY_OF_CUT)
    moves = call.get("Q427", drills)
    if "Q428" in stated and not drills > 0:
        raise BlockError("cycle 241 with Q428=0: the drill stands while it cuts", "write its speed as Q428")
    if way not in _TURNS:
        raise BlockError(f"cycle 241 with Q426={way:g}: the control takes 3, 4 or 5")
    if call.get("Q435", 0.0) and call.get("Q401", PERCENT) not in (0.0, PERCENT):
        raise BlockError(f"cycle 241 with Q401={call.get('Q401'):g} and Q435={call.get('Q435'):g} (a slower feed from "
                         "a depth on) is not followed", "write Q401=100, or Q435=0")
    if math.isinf(call.get("Q206")) and drills != speed:
        raise BlockError(f"cycle 241 with Q206 as AUTO and Q428={drills:g}, which is not the speed in force",
                         "give Q206 as a number")
    before = [f"S{digits(drills)} M3"] if stated and not (turning and drills == speed) else []
    behind = []
    if stated and not (turning and way == WAY_OF_CUT and moves == speed == drills):
        behind = [*([f"S{digits(moves)}"] if "Q427" in stated else []), "M5"]
    for words, name in ((before, "Q429"), (behind, "Q430")):
        number = call.get(name, 0.0)
        if number and number not in _COOLANT:
            raise BlockError(f"cycle 241 with {name}={number:g}: only M7, M8 and M9 are known to switch nothing but "
                             "the coolant", f"write {name}=8 or 9")
        words += [f"M{number:g}"] if number else []
    return before, behind


__all__ = ["CYCLES", "CycleCall", "single_lip"]
