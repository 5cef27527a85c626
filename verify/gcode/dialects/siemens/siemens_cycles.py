"""Drilling cycles of Siemens controls: CYCLE81 to CYCLE89, CYCLE84 and CYCLE840, and rows and circles of holes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from verify.gcode.dialects.base import BlockError, Machine
from verify.gcode.dialects.holes import DrilledHole, even_pecks, hole_blocks
from verify.gcode.dialects.stated_places import digits
from verify.program.arc_chords import PLANE_AXES

INCH = 25.4
METRIC = {1: 0.25, 2: 0.4, 3: 0.5, 4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 14: 2.0, 16: 2.0, 18: 2.5,
          20: 2.5,
          22: 2.5, 24: 3.0, 27: 3.0, 30: 3.5, 33: 3.5, 36: 4.0, 39: 4.0, 42: 4.5, 45: 4.5, 48: 5.0}
"""Pitch, mm, of the coarse metric thread by its nominal diameter."""
Arguments = Sequence[float | None]
_DIRECTION = {"CYCLE86": 6, "CYCLE87": 5, "CYCLE88": 6}
"""Place of the direction of rotation (SDIR) of the cycles that bore and leave the spindle standing."""
_AFTERWARDS = {"CYCLE84": 6, "CYCLE840": 7}
"""Place of the direction of rotation after the cycle (SDAC)."""
TEXTS = {"CYCLE84": range(18, 21), "CYCLE840": range(14, 17), "HOLES1": range(8, 9), "HOLES2": range(8, 9)}
"""Places of texts: the thread of a table (_PITM, _PTAB, _PTABA), whose pitch stands in PIT too, and hidden holes."""


@dataclass(frozen=True)
class DrillingCall:
    """A drilling cycle with the values of its call, in the order of the manual; None where one is left out."""

    name: str
    values: tuple[float | None, ...]

    def at(self, k: int) -> float | None:
        """The value at a place, from 0."""
        return self.values[k] if k < len(self.values) else None

    def number(self, k: int, otherwise: float = 0.0) -> float:
        """The value at a place, ``otherwise`` where it is left out."""
        found = self.at(k)
        return otherwise if found is None else found


def drilling_blocks(call: DrillingCall, here: Sequence[float], machine: Machine) -> list[str]:
    """Blocks of the cycle at the place where the tool stands.

    here : (3,) mm, in the coordinates of the control

    Raises
    ------
    BlockError
        A value is missing or cannot be followed.
    """
    s = machine.s
    axis = PLANE_AXES[s.plane][2]
    hole = _hole(call, machine)
    before, after = _turns(call)
    if call.name == "CYCLE86" and (call.number(7) or call.number(8)):
        machine.log.note("CYCLE86 is read without its shift at the bottom (RPA, RPO): the edge of the tool decides")
    restored = "" if math.isnan(s.feed) else f"F{digits(s.feed if s.feed_mode == 93 else s.feed / s.scale)}"
    if call.name in ("CYCLE84", "CYCLE840"):
        speed = call.number(10) if call.name == "CYCLE84" else 0.0
        speed = speed or s.speed
        at = 7 if call.name == "CYCLE84" else 9
        pitch = _pitch(call, at)
        machine.log.tap(min(call.number(at), call.number(at + 1)) < 0)
        if pitch is None and call.name == "CYCLE84":
            raise BlockError("CYCLE84 without a pitch (MPIT, PIT)")
        if pitch is not None:
            if not speed > 0:
                raise BlockError(f"{call.name} without a spindle speed")
            if call.name == "CYCLE84":
                machine.log.turns(s.tool, call.number(11))  # on the way out
            rate = pitch if s.feed_mode == 95 else pitch * speed
            hole = DrilledHole(hole.clear, hole.bottom, hole.back, hole.pecks, hole.surface, hole.lift,
                               f"F{digits(rate / s.scale)}", f"F{digits(rate / s.scale)}", hole.dwell)
        if call.name == "CYCLE84" and (not s.turning or speed != s.speed):
            before = [f"S{digits(speed)} M3"]
            if not math.isnan(s.speed) and s.speed != speed:
                after.append(f"S{digits(s.speed)}")
    blocks = hole_blocks(hole, here, axis, s.scale, s.relative)
    return [*before, *blocks, *after, *([restored] if restored and any("F" in b for b in blocks) else [])]


def _turns(call: DrillingCall) -> tuple[list[str], list[str]]:
    """Words of the spindle before and after a cycle: those that bore leave it standing, those that tap say how.

    Without SDAC it stands.
    """
    words = {3.0: ["M3"], 4.0: ["M4"], 5.0: ["M5"]}
    for places, name, allowed in ((_DIRECTION, "SDIR", "3 or 4"), (_AFTERWARDS, "SDAC", "3, 4 or 5")):
        value = call.number(places.get(call.name, len(call.values)))
        if value and (value not in words or (name == "SDIR" and value == 5)):
            raise BlockError(f"{call.name} with {name}={value:g}: the control takes {allowed}")
    before = words.get(call.number(_DIRECTION.get(call.name, len(call.values))), [])
    if call.name in _DIRECTION:
        return before, ["M5"]
    return [], words.get(call.number(_AFTERWARDS[call.name]), ["M5"]) if call.name in _AFTERWARDS else []


def _hole(call: DrillingCall, machine: Machine) -> DrilledHole:
    unit = machine.s.scale
    top, reference = call.at(0), call.at(1)
    if top is None or reference is None:
        raise BlockError(f"{call.name} without its retraction plane or reference plane (RTP, RFP)")
    deep, below = call.at(3), call.at(4)
    if below is None and deep is None:
        raise BlockError(f"{call.name} without a depth (DP or DPR)")
    bottom = reference - abs(below) if below else deep if deep is not None else reference
    if call.number(12 if call.name in ("CYCLE83", "CYCLE84") else 11 if call.name == "CYCLE840" else 99) not in (0, 3):
        raise BlockError(f"{call.name} along another axis than that of the tool (AXN)")
    _check_modes(call)
    if top < reference or (top == reference and below):
        raise BlockError(f"{call.name} with its retraction plane at {top:g} and its reference plane at {reference:g}: "
                         "the control stops with alarm 61101")
    # the retraction plane may lie below the safety distance, and the tool then stays as low between holes
    hole = unit * (reference + abs(call.number(2))), unit * bottom, unit * top
    dwell = _dwell(call, machine)
    if call.name == "CYCLE83":
        return _deep(call, machine, hole, dwell)
    if call.name == "CYCLE85":
        feeds = [f"F{digits(v)}" if v else "" for v in (call.number(6), call.number(7))]
        return DrilledHole(*hole, feed=feeds[0], out=feeds[1] or feeds[0], dwell=dwell)
    if call.name in ("CYCLE840", "CYCLE84", "CYCLE89"):
        return DrilledHole(*hole, out="", dwell=dwell)
    return DrilledHole(*hole, dwell=dwell)


def _dwell(call: DrillingCall, machine: Machine) -> float:
    """s at the bottom; a negative value counts turns of the spindle."""
    if call.name in ("CYCLE81", "CYCLE87"):
        return 0.0
    value, speed = call.number(8 if call.name == "CYCLE83" else 5), machine.s.speed
    if value >= 0:
        return value
    return -value * 60.0 / speed if speed > 0 else 0.0


def _check_modes(call: DrillingCall) -> None:
    """Refuse the modes in which a depth counts otherwise."""
    place = {"CYCLE81": 6, "CYCLE82": 6, "CYCLE83": 17}.get(call.name)
    if place is None:
        return
    mode = int(call.number(place))
    if call.name == "CYCLE81" and mode // 10 % 10 == 1:
        raise BlockError("CYCLE81 by the diameter of a centring is not followed: give its depth")
    if call.name != "CYCLE81" and mode % 100 // 10 == 1:
        raise BlockError(f"{call.name} whose depth counts to the shank of the drill is not followed: give that of its "
                         f"tip")


def _deep(call: DrillingCall, machine: Machine, hole: tuple[float, float, float], dwell: float) -> DrilledHole:
    unit = machine.s.scale
    clear, bottom, back = hole
    reference = call.number(1)
    first = abs(call.number(6)) or (reference - call.number(5, reference))
    shrink, least = call.number(7), call.number(13)
    depth = reference - bottom / unit
    if first <= 0:
        first = depth
    step = shrink if shrink > 0 else first * (1 + shrink) if -1 < shrink < 0 else 0.0
    pecks = even_pecks(unit * depth, unit * first, unit * step, unit * (least or (shrink if shrink > 0
                                                                                  else 0.1 * first)),
                       machine)
    swarf = call.number(11) == 1
    lift = math.inf if swarf else unit * (call.number(14) or 1.0)
    return DrilledHole(clear, bottom, back, pecks, unit * reference, lift, dwell=dwell)


def _pitch(call: DrillingCall, at: int) -> float | None:
    """mm for one turn, from a nominal diameter (MPIT) or a pitch (PIT); None where neither is given."""
    size, pitch = abs(call.number(at)), abs(call.number(at + 1))
    kind = call.number(13 if call.name == "CYCLE84" else 12)
    if pitch:
        return {2: INCH / pitch, 3: INCH * pitch, 4: math.pi * pitch}.get(int(kind), pitch)
    if not size:
        return None
    if size not in METRIC:
        raise BlockError(f"{call.name} for a thread M{size:g}: the reader knows the pitches of M1 to M48; give PIT")
    return METRIC[int(size)]


def row_of_holes(name: str, values: Arguments) -> list[tuple[float, float]]:
    """Places of HOLES1 (a row) or HOLES2 (a circle), along the axes of the plane, in units of the program.

    values : in the order of the manual; from the seventh on those that the editor of the control adds

    Raises
    ------
    BlockError
        A value is missing or cannot be followed, or the number of holes is none.
    """
    if not 6 <= len(values) <= 11 or any(v is None for v in values[:6 if name == "HOLES1" else 4]) or (
            values[5] is None):
        raise BlockError(f"{name} needs its 6 values")
    a, b, c, d, e, n = (v or 0.0 for v in values[:6])
    e = _step_of_holes(name, values[6] or 0.0, e) if len(values) > 6 else e
    if any(values[7:8]):
        raise BlockError(f"{name} with an eighth value (_UMODE) is not followed")
    if n != int(n) or not 1 <= n <= 10_000:
        raise BlockError(f"{name}: {n:g} is not a number of holes")
    count = int(n)
    if name == "HOLES1":
        angle = math.radians(c)
        return [(a + (d + k * e) * math.cos(angle), b + (d + k * e) * math.sin(angle)) for k in range(count)]
    step = e or 360.0 / count
    return [(a + c * math.cos(math.radians(d + k * step)), b + c * math.sin(math.radians(d + k * step)))
            for k in range(count)]


def _step_of_holes(name: str, kind: float, step: float) -> float:
    """The step (INDA) of HOLES2 under its kind (_VARI), 0 for a full circle; that of HOLES1 unchanged."""
    whole = {0.0: step, 1000.0: 0.0, 2000.0: step} if name == "HOLES2" else {0.0: step}
    if kind in (10.0, 1010.0, 2010.0) and name == "HOLES2":
        raise BlockError("HOLES2 that goes from hole to hole along an arc is not followed")
    if kind not in whole or (kind == 2000.0 and not step):
        raise BlockError(f"{name} of the kind {kind:g} (_VARI) is not followed")
    return whole[kind]


__all__ = ["TEXTS", "DrillingCall", "drilling_blocks", "row_of_holes"]
