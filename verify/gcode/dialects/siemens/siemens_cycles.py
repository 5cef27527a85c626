"""Drilling cycles of Siemens controls: CYCLE81 to CYCLE89, CYCLE84 and CYCLE840, and rows and circles of holes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from verify.gcode.dialects.base import BlockError, Machine
from verify.gcode.dialects.cycle_arguments import digits_of
from verify.gcode.dialects.holes import DrilledHole, even_pecks, hole_blocks, scaled_pecks
from verify.gcode.dialects.siemens.siemens_arguments import CYCLES, CycleCall, check_override
from verify.gcode.dialects.stated_places import digits
from verify.program.arc_chords import PLANE_AXES

INCH, PERCENT = 25.4, 100.0
SAME_PITCH = 0.02
"""Share by which a feed in a turn may differ from the pitch of a tap with a chuck: as in the proof."""
METRIC = {1: 0.25, 2: 0.4, 3: 0.5, 4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 14: 2.0, 16: 2.0, 18: 2.5,
          20: 2.5,
          22: 2.5, 24: 3.0, 27: 3.0, 30: 3.5, 33: 3.5, 36: 4.0, 39: 4.0, 42: 4.5, 45: 4.5, 48: 5.0}
"""Pitch, mm, of the coarse metric thread by its nominal diameter."""
_TURNED = frozenset({"CYCLE86", "CYCLE87", "CYCLE88"})
"""Cycles that bore and leave the spindle standing; SDIR turns it on the way down."""
TAPS = frozenset({"CYCLE84", "CYCLE840"})
"""Cycles that tap; SDAC says how the spindle turns behind them."""
_FEED_OF_PROGRAM = 1.0
"""ENC of CYCLE840 with which F of the program counts, not the pitch."""


def drilling_blocks(call: CycleCall, here: Sequence[float], machine: Machine) -> list[str]:
    """Blocks of the cycle at the place where the tool stands.

    here : (3,) mm, in the coordinates of the control

    Raises
    ------
    BlockError
        A value is missing or cannot be followed.
    """
    s = machine.s
    call.check_plane(machine)
    axis = PLANE_AXES[s.plane][2]
    hole = _hole(call, machine)
    before, after = _turns(call)
    if call.name == "CYCLE86" and (call.number("RPA") or call.number("RPO")):
        machine.log.note("CYCLE86 is read without its shift at the bottom (RPA, RPO): the edge of the tool decides")
    restored = "" if math.isnan(s.feed) else f"F{digits(s.feed if s.feed_mode == 93 else s.feed / s.scale)}"
    if call.name in TAPS:
        check_override(call.name, machine)
        speed = (call.number("SST") if call.name == "CYCLE84" else 0.0) or s.speed
        pitch = _pitch(call)
        machine.log.tap(min(call.number("MPIT"), call.number("PIT")) < 0)
        if call.name == "CYCLE840":
            _check_chuck(call, machine, pitch)
        elif pitch is None:
            raise BlockError("CYCLE84 without a pitch (MPIT, PIT)")
        if pitch is not None:
            if not speed > 0:
                raise BlockError(f"{call.name} without a spindle speed")
            if call.name == "CYCLE84":
                machine.log.turns(s.tool, call.number("SST1"))  # on the way out
            rate = f"F{digits((pitch if s.feed_mode == 95 else pitch * speed) / s.scale)}"
            hole = replace(hole, feed=rate, out=rate)
        if call.name == "CYCLE84" and (not s.turning or speed != s.speed):
            before = [f"S{digits(speed)} M3"]
            if not math.isnan(s.speed) and s.speed != speed:
                after.append(f"S{digits(s.speed)}")
    blocks = hole_blocks(hole, here, axis, s.scale, s.relative)
    return [*before, *blocks, *after, *([restored] if restored and any("F" in b for b in blocks) else [])]


def _check_chuck(call: CycleCall, machine: Machine, pitch: float | None) -> None:
    """Refuse CYCLE840 where the tap would not turn back, or where feed and pitch disagree."""
    s, back, mode = machine.s, call.number("SDR"), call.number("ENC")
    ahead = 4.0 if machine.log.senses[-1][1] > 0 else 3.0
    if back not in (0.0, 3.0, 4.0) or (s.turning and back == ahead):
        raise BlockError(f"CYCLE840 with SDR={back:g} does not turn the spindle back: the tap is drawn out of its "
                         f"thread while it {'stands' if back == 5 else 'turns on'}",
                         f"write SDR={7 - ahead:g}, or SDR=0 with an encoder")
    if mode not in (0.0, _FEED_OF_PROGRAM, 11.0, 20.0):
        raise BlockError(f"CYCLE840 with ENC={mode:g}: the control takes 0, 1, 11 or 20")
    if mode == _FEED_OF_PROGRAM and pitch is not None and s.feed > 0 and s.speed > 0:
        given = s.feed if s.feed_mode == 95 else s.feed / s.speed
        if abs(given - pitch) > SAME_PITCH * pitch:
            raise BlockError(f"CYCLE840 with ENC=1 feeds with F, {given:g} mm in a turn, and its pitch is {pitch:g} mm",
                             "write ENC=11, or F as pitch times speed before the cycle")


def _turns(call: CycleCall) -> tuple[list[str], list[str]]:
    """Words of the spindle before and after a cycle: those that bore leave it standing, those that tap say how.

    Without SDAC it stands.
    """
    words = {3.0: ["M3"], 4.0: ["M4"], 5.0: ["M5"]}
    for name, allowed in (("SDIR", "3 or 4"), ("SDAC", "3, 4 or 5")):
        value = call.number(name)
        if value and (value not in words or (name == "SDIR" and value == 5)):
            raise BlockError(f"{call.name} with {name}={value:g}: the control takes {allowed}")
    if call.name in _TURNED:
        return words.get(call.number("SDIR"), []), ["M5"]
    return [], words.get(call.number("SDAC"), ["M5"]) if call.name in TAPS else []


def _hole(call: CycleCall, machine: Machine) -> DrilledHole:
    unit = machine.s.scale
    top, reference = call.at("RTP"), call.at("RFP")
    if top is None or reference is None:
        raise BlockError(f"{call.name} without its retraction plane or reference plane (RTP, RFP)")
    if call.at("DP") is None and call.at("DPR") is None:
        raise BlockError(f"{call.name} without a depth (DP or DPR)")
    relative = call.is_relative("DP", "DPR", 0)
    bottom = reference - abs(call.number("DPR")) if relative else call.number("DP", reference)
    if call.number("_AXN") not in (0, 3):
        raise BlockError(f"{call.name} along another axis than that of the tool (AXN)")
    _check_modes(call)
    if top < reference or (top == reference and relative):
        raise BlockError(f"{call.name} with its retraction plane at {top:g} and its reference plane at {reference:g}: "
                         "the control stops with alarm 61101")
    # the retraction plane may lie below the safety distance, and the tool then stays as low between holes
    hole = unit * (reference + call.number("SDIS")), unit * bottom, unit * top
    dwell = _dwell(call, machine)
    if call.name == "CYCLE83":
        return _deep(call, machine, hole, dwell)
    if call.name == "CYCLE85":
        feeds = [f"F{digits(v)}" if v else "" for v in (call.number("FFR"), call.number("RFF"))]
        return DrilledHole(*hole, feed=feeds[0], out=feeds[1] or feeds[0], dwell=dwell)
    if call.name in TAPS or call.name == "CYCLE89":
        return DrilledHole(*hole, out="", dwell=dwell)
    return DrilledHole(*hole, dwell=dwell)


def _dwell(call: CycleCall, machine: Machine) -> float:
    """s at the bottom; a negative value, or _AMODE, counts turns of the spindle."""
    last = call.number("_DTD") != 0.0
    value, speed = call.number("_DTD" if last else "DTB"), machine.s.speed
    place = (2 if last else 1) if call.name not in TAPS else len(call.alternatives)
    kind = call.alternatives[place] if place < len(call.alternatives) else 0
    if kind == 1 or (kind == 0 and value >= 0):
        return abs(value)
    return abs(value) * 60.0 / speed if speed > 0 else 0.0


def _check_modes(call: CycleCall) -> None:
    """Refuse the modes in which a depth counts otherwise, or that the reader does not know."""
    mode = call.number("_GMODE")
    tens = digits_of(call.name, "_GMODE", mode, ("0123456789",) * 8)[1]
    if call.name == "CYCLE81" and tens == 1:
        raise BlockError("CYCLE81 by the diameter of a centring is not followed: give its depth")
    if call.name in ("CYCLE82", "CYCLE83") and tens == 1:
        raise BlockError(f"{call.name} whose depth counts to the shank of the drill is not followed: give that of its "
                         f"tip")
    # the mode of a boring cycle is that of its lift at the bottom
    if mode and (call.name != "CYCLE86" or any(call.number(k) for k in ("RPA", "RPO", "RPAP"))):
        raise BlockError(f"{call.name} with _GMODE={mode:g} is not followed", "write _GMODE=0")
    if (call.name == "CYCLE83" and call.number("VARI") not in (0, 1)) or call.number("_VARI") not in (0, 1, 2):
        raise BlockError(f"{call.name} with VARI={call.number('VARI') or call.number('_VARI'):g} is not followed",
                         "write 0 or 1")


def _deep(call: CycleCall, machine: Machine, hole: tuple[float, float, float], dwell: float) -> DrilledHole:
    unit, s = machine.s.scale, machine.s
    clear, bottom, back = hole
    reference = call.number("RFP")
    relative = call.is_relative("FDEP", "FDPR", 4)
    first = abs(call.number("FDPR")) if relative else reference - call.number("FDEP", reference)
    least, depth = call.number("_MDEP"), reference - bottom / unit
    if first <= 0:
        first = depth
    share, step = _shrinking(call)
    pecks = (scaled_pecks(unit * depth, unit * first, share, unit * (least or 0.1 * first), machine) if share < 1.0 else
             even_pecks(unit * depth, unit * first, unit * step, unit * (least or step or 0.1 * first), machine))
    leads = (unit * call.number("_DIS1"),) * len(pecks) if call.number("_DIS1") else ()
    lift = math.inf if call.number("VARI") == 1 else unit * (call.number("_VRT") or 1.0)
    factor = _first_feed(call)
    feed = "" if factor == 1.0 or math.isnan(s.feed) else f"F{digits(s.feed / s.scale)}"
    slow = feed and f"F{digits(factor * s.feed / s.scale)}"
    return DrilledHole(clear, bottom, back, pecks, unit * reference, lift, feed, dwell=dwell, leads=leads, first=slow)


def _shrinking(call: CycleCall) -> tuple[float, float]:
    """The share of a peck that the next one has, 1 for all of it, and by how much it is shorter (_DAM)."""
    value, kind = call.number("_DAM"), call.alternatives[5]
    if kind == 2 and 0 < value <= PERCENT:
        return value / PERCENT, 0.0
    if kind == 0 and -1.0 <= value < 0:
        return -value, 0.0
    if value < 0 or (kind == 2 and value):
        raise BlockError(f"CYCLE83 with _DAM={value:g} is not followed", "write by how much each peck is shorter, or a "
                         "factor from -1 to 0")
    return 1.0, value


def _first_feed(call: CycleCall) -> float:
    """Factor of the feed of the first peck (FRF). The editor of the control writes it in percent, with _AMODE."""
    value = call.number("FRF") or 1.0
    if value > 1.0 and call.number("_AMODE") and value <= PERCENT:
        return value / PERCENT
    if value > 1.0:
        raise BlockError(f"CYCLE83 with FRF={value:g}: the factor of the first feed is 0.001 to 1", "write FRF=1")
    return value


def _pitch(call: CycleCall) -> float | None:
    """mm for one turn, from a nominal diameter (MPIT) or a pitch (PIT); None where neither is given."""
    size, pitch, kind = abs(call.number("MPIT")), abs(call.number("PIT")), call.number("_PITA")
    if kind not in (0, 1, 2, 3, 4):
        raise BlockError(f"{call.name} with _PITA={kind:g} is not followed", "write _PITA=1, and PIT in mm")
    if pitch:
        pitch = {2: INCH / pitch, 3: INCH * pitch, 4: math.pi * pitch}.get(int(kind), pitch)
    if size and size not in METRIC:
        raise BlockError(f"{call.name} for a thread M{size:g}: the reader knows the pitches of M1 to M48; give PIT")
    coarse = METRIC[int(size)] if size else pitch
    if pitch and abs(coarse - pitch) > SAME_PITCH * pitch:
        raise BlockError(f"{call.name} with the pitch {pitch:g} mm (PIT) for a thread M{size:g}, which has "
                         f"{coarse:g} mm", "write MPIT or PIT alone")
    return coarse or None


def row_of_holes(call: CycleCall, machine: Machine) -> list[tuple[float, float]]:
    """Places of HOLES1 (a row) or HOLES2 (a circle), along the axes of the plane, in units of the program.

    Raises
    ------
    BlockError
        A value is missing or cannot be followed, or the number of holes is none.
    """
    name, names = call.name, [a.name for a in CYCLES[call.name][:6]]
    missing = {"HOLES1": names, "HOLES2": [*names[:4], "NUM"]}[name]
    if any(call.at(k) is None for k in missing):
        raise BlockError(f"{name} needs its 6 values")
    call.check_plane(machine)
    a, b, c, d, e, n = (call.number(k) for k in names)
    e = _step_of_holes(name, call.number("_VARI"), e)
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


__all__ = ["TAPS", "drilling_blocks", "row_of_holes"]
