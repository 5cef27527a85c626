"""Cycles of Heidenhain controls: their definition, and the drilling cycles as rapids and feeds."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence

from verify.gcode.dialects.base import BlockError, Machine
from verify.gcode.dialects.heidenhain.heidenhain_arguments import CYCLES, CycleCall, single_lip
from verify.gcode.dialects.heidenhain.heidenhain_q import NUM, VALUE
from verify.gcode.dialects.holes import DrilledHole, broken_pecks, even_leads, even_pecks, hole_blocks
from verify.gcode.dialects.stated_places import digits

_HEAD = re.compile(r"CYCL DEF ([0-9]+)(?![0-9.])\s*(.*)")
_ITEM = re.compile(rf"(Q[0-9]+)\s*=\s*({VALUE}|FMAX|FAUTO|AUTO|[+-]?\s*MAX)")
DRILLS = frozenset(CYCLES)
NOT_FOLLOWED = {
    204: "back boring", 210: "a slot", 211: "a circular slot", 212: "a pocket", 213: "a stud", 214: "a circular pocket",
    215: "a circular stud", 220: "a circle of points", 221: "rows of points", 224: "a pattern of points",
    225: "engraving", 230: "multipass milling", 231: "a ruled surface", 232: "face milling", 233: "face milling",
    251: "a pocket", 252: "a circular pocket", 253: "a slot", 254: "a circular slot", 256: "a stud",
    257: "a circular stud",
    258: "a polygon stud", 262: "thread milling", 263: "thread milling", 264: "thread milling", 265: "thread milling",
    267: "thread milling", 270: "a contour", 271: "a contour pocket", 272: "a contour pocket", 273: "a contour pocket",
    274: "a contour slot", 275: "a trochoidal slot", 276: "a contour", 291: "interpolation turning",
    292: "interpolation turning", 239: "a measurement of the load",
}
"""Cycles that cut and are not followed, and what they do."""
AT_ONCE = frozenset({220, 221, 224, 239, 291})
"""Cycles that work when they are defined: they move, or couple the spindle to the path."""
TOUCHES = range(400, 500)
"""Cycles of touch probes, which move when they are defined."""


def defined(text: str, value: Callable[[str], float]) -> CycleCall | None:
    """A cycle with Q parameters from its definition; None for another block.

    text : the whole definition, its lines joined; value : evaluates a number or parameter

    Raises
    ------
    BlockError
        A parameter cannot be read.
    """
    m = _HEAD.fullmatch(text)
    if m is None:
        return None
    values = {}
    for name, given in _ITEM.findall(m[2]):
        values[name] = math.inf if given.endswith(("AUTO", "MAX")) else value(given)
    rest = _ITEM.sub("", m[2])
    if "=" in rest:
        raise BlockError(f"cannot read '{rest.strip()[:50]}' in the definition of cycle {m[1]}")
    return CycleCall(int(m[1]), values)


def cycle_blocks(call: CycleCall, here: Sequence[float], machine: Machine, over: float, feed: Callable[[float], str],
                 radius: float | None) -> list[str]:
    """Blocks of a drilling cycle at the place where the tool stands.

    here   : (3,) mm, in the coordinates of the control
    over   : mm, added to the surface (the Z of CYCL CALL POS)
    feed   : gives the F word of a feed of the program
    radius : mm, of the tool; bore milling needs it

    Raises
    ------
    BlockError
        The cycle is not followed, or a parameter is missing.
    """
    n, unit = call.number, machine.s.scale
    if n not in DRILLS:
        raise BlockError(f"cycle {n} ({NOT_FOLLOWED.get(n, 'another cycle')}) is not followed",
                         "let the post write its moves (L, C) instead of the cycle")
    call.check()
    surface = call.get("Q203") * unit + over
    clear = surface + call.get("Q200") * unit
    depth = -call.get("Q201") * unit
    if depth < 0:
        raise BlockError(f"cycle {n} with a depth above the surface (Q201={call.get('Q201'):g}), which is negative in "
                         f"a "
                         "program")
    if depth == 0:
        return []
    if n == 202 and call.get("Q214", 0.0):
        machine.log.note("cycle 202 is read without its shift at the bottom (Q214): the edge of the tool decides")
    back = max(surface + call.get("Q204", 0.0) * unit, clear)
    dwell = call.get("Q211", 0.0)
    down = feed(call.get("Q206")) if n not in (207, 209) else ""
    ways = _ways(call, machine, surface, depth, feed, down)
    if n == 208:
        return _bore_mill(call, here, machine, (clear, surface - depth, back), down, radius)
    hole = DrilledHole(clear, surface - depth, back, dwell=dwell, surface=surface, **ways)  # type: ignore[arg-type]
    blocks = hole_blocks(hole, here, 2, unit, False)
    if n == 241:
        machine.log.turns(machine.s.tool, max(call.get("Q427", 0.0), call.get("Q428", 0.0)))
        before, behind = single_lip(call, machine.s.speed, machine.s.turning)
        return [*before, *blocks, *behind]
    if n not in (207, 209):
        return blocks
    # rigid tapping turns the spindle itself, and controls differ in whether it stands at its end
    return [*([] if machine.s.turning else ["M3"]), *blocks, "M5"]


def _ways(call: CycleCall, machine: Machine, surface: float, depth: float, feed: Callable[[float], str],
          down: str) -> dict[str, object]:
    """Feeds and pecks of a cycle, as the fields of ``DrilledHole``."""
    n, unit = call.number, machine.s.scale
    if n in (207, 209):
        speed, pitch = machine.s.speed, abs(call.get("Q239")) * unit
        machine.log.tap(call.get("Q239") < 0)
        if not speed > 0 or not pitch > 0:
            raise BlockError(f"cycle {n} needs a spindle speed and a pitch (Q239)")
        if n == 209:
            machine.log.turns(machine.s.tool, speed * call.get("Q403", 1.0))  # on the way out
        rate = f"F{digits(pitch * speed / unit)}"
        return {"feed": rate, "out": rate}
    if n == 206:
        machine.log.tap(False)
        return {"feed": down, "out": down}
    if n in (201, 202):
        return {"feed": down, "out": feed(call.get("Q208")) if call.get("Q208", 0.0) not in (0.0, math.inf) else down}
    if n == 241:
        return {"feed": down, "out": feed(call.get("Q208")) if 0 < call.get("Q208", 0.0) < math.inf else None}
    if n not in (200, 203, 205):
        return {"feed": down}
    first = call.get("Q202", 0.0) * unit
    shrink = call.get("Q212", 0.0) * unit if n in (203, 205) else 0.0
    least = call.get("Q205", 0.0) * unit or max(0.01, 0.05 * first)
    pecks = even_pecks(depth, first, shrink, min(least, first) if first > 0 else least, machine)
    leads: tuple[float, ...] = ()
    if n == 205 and "Q258" in call.values:
        leads = even_leads(len(pecks), call.get("Q258") * unit, call.get("Q259", call.get("Q258")) * unit)
    outs: tuple[bool, ...] = (True,) * len(pecks)
    if n == 203 and call.get("Q213", 0.0) > 0:
        outs = tuple((k + 1) % (int(call.get("Q213")) + 1) == 0 for k in range(len(pecks)))
    elif n == 205 and call.get("Q257", 0.0) > 0:
        if pecks:
            machine.log.note("cycle 205 with chip breaking (Q257) is read as going out of the hole after each infeed "
                             "(Q202); older controls may not go out before its end")
        pecks, outs = broken_pecks(depth, pecks, call.get("Q257") * unit, machine)
    lift = max(call.get("Q256", 0.2) * unit, 0.0)
    out = feed(call.get("Q208")) if n != 200 and 0 < call.get("Q208", 0.0) < 99999 else None
    return {"feed": down, "pecks": pecks, "lift": lift, "leads": leads, "outs": outs, "out": out}


def _bore_mill(call: CycleCall, here: Sequence[float], machine: Machine, heights: tuple[float, float, float], feed: str,
               radius: float | None) -> list[str]:
    """Cycle 208: half an arc out, a helix down, a whole turn at the bottom, half an arc back, and up."""
    unit = machine.s.scale
    if radius is None:
        raise BlockError("cycle 208 (bore milling) needs the radius of the tool", "give the tool in the setup")
    if math.isnan(here[0] + here[1]):
        raise BlockError("a drilling cycle at a place that the program has not stated")
    clear, bottom, back = heights
    r = 0.5 * call.get("Q335") * unit - radius
    if r < -1e-9:
        raise BlockError(f"cycle 208 with a bore of {call.get('Q335'):g} and a tool of radius {radius:g} mm, which is "
                         f"larger")
    if r < 1e-6:
        return hole_blocks(DrilledHole(clear, bottom, back, feed=feed), here, 2, unit, False)
    pitch = call.get("Q334") * unit
    if not pitch > 0:
        raise BlockError("cycle 208 needs the infeed of a turn (Q334)")
    word = "G3" if call.get("Q351", 1.0) >= 0 else "G2"
    turns = math.ceil((clear - bottom) / pitch - 1e-9)
    machine.log.room(64.0 * turns)
    x, y = here[0], here[1]

    def at(a: float) -> str:
        return digits(a / unit)

    return [f"G0 Z{at(clear)}",
            f"{word} X{at(x + r)} Y{at(y)} I{at(r / 2)} J0 {feed}",
            f"{word} X{at(x + r)} Y{at(y)} Z{at(bottom)} I{at(-r)} J0 P{turns}",
            f"{word} X{at(x + r)} Y{at(y)} I{at(-r)} J0",
            f"{word} X{at(x)} Y{at(y)} I{at(-r / 2)} J0", f"G0 Z{at(back)}"]


OLD = {1: "pecking", 2: "tapping", 17: "rigid tapping"}
"""Drilling cycles of dotted blocks (CYCL DEF 1.0 to 1.5), which are followed."""


def old_cycle(number: int, items: Mapping[int, str], surface: float, value: Callable[[str], float]) -> CycleCall:
    """A cycle 1, 2 or 17 as the newer cycle that moves alike.

    items   : text of its dotted blocks by their number; surface : its start, which is the clearance above the surface
    """
    def get(k: int, words: str, otherwise: float | None = None) -> float:
        m = re.search(rf"(?:{words})\s*({VALUE})", items.get(k, ""))
        if m is None:
            if otherwise is None:
                raise BlockError(f"cycle {number} without its block {number}.{k}")
            return otherwise
        return value(m[1])

    clear = abs(get(1, "SET UP|DIST|ABST|SET-UP|"))
    given = {"Q200": clear, "Q201": get(2, "DEPTH|TIEFE|"), "Q203": surface - clear, "Q204": 0.0}
    if number == 1:
        given |= {"Q202": abs(get(3, "PECKG|ZUSTLG|")), "Q211": get(4, "DWELL|V.ZEIT|", 0.0), "Q206": get(5, "F")}
        return CycleCall(200, given)
    if number == 2:
        return CycleCall(206, given | {"Q211": 0.0, "Q206": get(4, "F")})
    return CycleCall(207, given | {"Q239": get(3, "PITCH|STEIG|")})


__all__ = ["AT_ONCE", "DRILLS", "NOT_FOLLOWED", "NUM", "OLD", "TOUCHES", "CycleCall", "cycle_blocks", "defined",
           "old_cycle"]
