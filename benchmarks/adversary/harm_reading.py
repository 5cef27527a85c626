"""Harm by what a control reads: offsets, modes, units, registers, ends; and by speeds and feeds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import REFUSED, SAFE, Case, Op, Script, made, number
from benchmarks.adversary.adversary_parts import BALL, FEED, FLAT, OUT, PARTS, R, rows, spread
from benchmarks.adversary.harm_surface import base, choice

Rng = np.random.Generator
LEVEL = ("plate", "rib", "step", "slot", "floor", "boss", "pocket")
LINUXCNC = ["%", "G21 G17 G90 G94 G40 G49 G80 G64 P0.001 Q0", "G54"]


def _raw_change(s: Script, *lines: str) -> list[Op]:
    return [s.raw(line) for line in lines]


def _without_first(s: Script, *lines: str) -> list[Op]:
    """Put lines in place of the first tool change."""
    ops = _raw_change(Script(), *lines)
    s.ops = [*ops, *s.ops[1:]]
    return ops


def wrong_length_offset(rng: Rng) -> Case:
    """The length offset of another tool."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    ops = _without_first(s, "T1 M6", "G43 H2", "S6000 M3")
    return made("wrong length offset", part, s, ("program",), [ops[1]], word="offset")


def no_length_offset(rng: Rng) -> Case:
    """No length offset at all."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    _without_first(s, "T1 M6", "S6000 M3")
    return made("no length offset", part, s, ("program", REFUSED), None)


def no_spindle(rng: Rng) -> Case:
    """The spindle never turns, or stops before the last row."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    if rng.random() < 0.5:
        _without_first(s, "T1 M6", "G43 H1")
    else:
        s.ops.insert(len(s.ops) - 6, Op("raw", text="M5"))
    return made("no spindle", part, s, ("program",), None)


def stale_length_in_rapid(rng: Rng) -> Case:
    """A longer tool comes down in a rapid under the length of the one before it."""
    longer = float(rng.uniform(15.0, 40.0))
    tools = [FLAT, {**FLAT, "id": "T2", "number": 2, "stickout_mm": 40.0 + longer}]
    s = base("plate")
    _raw_change(s, "M5", "G53 G0 Z0", "T2 M6", "S6000 M3")
    s.rapid(float(rng.uniform(2, 26)), float(rng.uniform(-6, 6)))
    ops = [s.rapid(z=PARTS["plate"].top + float(rng.uniform(1.5, 5.0)))]
    _raw_change(s, "G43 H2")
    s.rapid(z=SAFE)
    return made("stale length in rapid", "plate", s, ("program", "rapid", "collision"), ops, None, {"tools": tools})


def shift_by_g92(rng: Rng) -> Case:
    """A shift by G92 that stays: the part is cut that much aside."""
    part, by = choice(rng, "step", "boss"), float(np.round(rng.uniform(0.05, 2.0), 3))
    s = PARTS[part].program()
    way = 1.0 if part == "step" else -1.0
    here = s.ops[1]
    s.ops.insert(2, Op("raw", text=f"G92 X{(here.x or 0.0) - way * by:.4f}"))
    return made("shift by G92", part, s, ("gouge",), None, by, what=f"{by} aside")


def fanuc_g92_g52(rng: Rng) -> Case:
    """Fanuc: G52 X0 does not take back what G92 shifted."""
    by, dialect = float(np.round(rng.uniform(0.05, 2.0), 3)), choice(rng, "fanuc", "haas")
    s = PARTS["step"].program()
    here = s.ops[1]
    s.ops[2:2] = [Op("raw", text=f"G92 X{number((here.x or 0.0) - by, dialect)}"), Op("raw", text="G52 X0.")]
    kinds = ("gouge", "program", REFUSED)
    return made("G92 before G52", "step", s, kinds, None, None, {"machine": {"dialects": [dialect]}}, dialect,
                what=f"{by} aside")


def no_path_mode(rng: Rng) -> Case:
    """LinuxCNC with neither G61 nor G64 P: it begins in G64, which rounds corners without a bound."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    s.head = ["%", "G21 G17 G90 G94 G40 G49 G80" + (" G64" if rng.random() < 0.5 else ""), "G54"]
    return made("no path tolerance", part, s, ("program", "limit"), None)


def wide_path_mode(rng: Rng) -> Case:
    """A path tolerance far over the gouge tolerance."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    s.head = ["%", f"G21 G17 G90 G94 G40 G49 G80 G64 P{rng.uniform(0.02, 1.0):.3f}", "G54"]
    return made("wide path tolerance", part, s, ("program", "limit"), None)


def machine_move_too_far(rng: Rng) -> Case:
    """A move in machine coordinates far beyond the travel."""
    s = base("plate")
    axis, far = "XYZ"[int(rng.integers(3))], float(np.round(rng.uniform(900, 99999), 1))
    ops = [s.raw("G53 G0 Z0"), s.raw(f"G53 G0 {axis}-{far}")]
    setup = {"machine": {"travel_mm": [500.0, 500.0, 500.0]}}
    return made("machine move too far", "plate", s, ("limit",), [ops[1]], None, setup, what=f"{axis}-{far}")


def stray_end(rng: Rng) -> Case:
    """M2, or a bare %, before the last rows: what only they cut is left."""
    part = choice(rng, "step", "slot", "boss")
    s = PARTS[part].program()
    cut, word = len(s.ops) - int(rng.integers(4, 10)), choice(rng, "M2", "%")
    s.ops.insert(cut, Op("raw", text=word))
    s.ops.insert(cut, Op("rapid", z=SAFE))
    return made("stray end", part, s, ("stock_left",), None, what=word)


def stray_early_end(rng: Rng) -> Case:
    """M2, or a bare %, right after the top is faced; levels under it are only cut behind that."""
    part, word = choice(rng, "step", "slot", "boss", "rib"), choice(rng, "M2", "%")
    s = PARTS[part].program()
    first = next(k for k, op in enumerate(s.ops) if k > 5 and op.kind == "rapid" and op.z == SAFE)
    s.ops.insert(first + 1, Op("raw", text=word))
    return made("stray early end", part, s, ("stock_left",), None, what=word)


def fanuc_dogleg(rng: Rng) -> Case:
    """Fanuc: a rapid in two axes that is free on the straight line, and not where each axis runs at its own speed."""
    dialect = choice(rng, "fanuc", "haas")
    s = base("plate")
    s.over(14.0, 0.0)
    s.rapid(z=PARTS["plate"].top + 2.0)
    ops = [s.rapid(x=-float(rng.uniform(350, 450)), z=float(rng.uniform(-10.0, 0.0)))]
    s.rapid(z=SAFE)
    return made("dogleg rapid", "plate", s, ("rapid",), ops, None, {"machine": {"dialects": [dialect]}}, dialect)


def sense_of_rotary_axes(rng: Rng) -> Case:
    """Rotary words on a Fanuc, and a setup that does not state which way its table turns."""
    dialect = choice(rng, "fanuc", "haas")
    s = PARTS["plate"].program()
    turn = float(np.round(rng.uniform(10, 60), 1))
    s.ops.insert(2, Op("raw", text=f"G0 A{number(turn, dialect)} C{number(2 * turn, dialect)}"))
    s.ops.insert(3, Op("raw", text="G0 A0. C0."))
    machine = {"dialects": [dialect], "kind": "5-axis", "kinematics": "table-table-AC",
               "pivots_mm": [[0.0, 0.0, -50.0], [0.0, 0.0, -50.0]]}
    return made("sense of rotary axes", "plate", s, (REFUSED,), None, None, {"machine": machine}, dialect)


def inch(rng: Rng) -> Case:
    """G20 where the numbers are mm."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    s.head = ["%", "G20 G17 G90 G94 G40 G49 G80 G64 P0.0001 Q0", "G54"]
    machine = {"travel_mm": [300.0, 300.0, 300.0]}
    return made("inch for mm", part, s, ("limit", "gouge", "stock_left", "nothing_cut", "program"), None, None,
                {"machine": machine})


def wrong_zero(rng: Rng) -> Case:
    """Another work offset than that of the setup."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    s.head = [*LINUXCNC[:2], f"G{55 + int(rng.integers(4))}"]
    return made("wrong zero", part, s, ("program", REFUSED), None)


def incremental_left_on(rng: Rng) -> Case:
    """G91 for one row, never taken back."""
    part = choice(rng, "step", "slot", "boss")
    s = PARTS[part].program()
    s.ops.insert(int(rng.integers(8, len(s.ops) // 2)), Op("raw", text="G91"))
    kinds = ("gouge", "rapid", "limit", "plunge", "stock_left", "program", "collision", REFUSED)
    return made("G91 left on", part, s, kinds, None)


def block_delete(rng: Rng) -> Case:
    """A lift that is skipped where the switch of the panel is on."""
    part = choice(rng, "step", "slot", "boss")
    s = PARTS[part].program()
    k = next(k for k in range(len(s.ops) - 2, 0, -1) if s.ops[k].kind == "rapid" and s.ops[k].z == SAFE
             and s.ops[k + 1].kind == "rapid")
    s.ops[k] = Op("raw", text=f"/G0 Z{SAFE:g}")
    return made("block delete", part, s, ("program", REFUSED), [s.ops[k]])


def pasted_twice(rng: Rng) -> Case:
    """The whole cutting pasted in twice."""
    part = choice(rng, "step", "slot", "boss", "plate")
    s = PARTS[part].program()
    s.ops += PARTS[part].program().ops[1:]
    return made("pasted twice", part, s, ("program",), None)


def over_limit(rng: Rng) -> Case:
    """Faster than the spindle, the tool, or the feed of the machine."""
    part = choice(rng, *LEVEL)
    s = PARTS[part].program()
    what = choice(rng, "spindle", "tool", "feed")
    setup: dict[str, Any] = {"spindle": {"machine": {"max_rpm": 5000.0}},
                             "tool": {"tools": [{**FLAT, "max_rpm": 5900.0}, BALL]},
                             "feed": {"machine": {"max_feed_mm_min": 450.0}}}[what]
    return made("over a limit", part, s, ("limit",), None, None, setup, what=what)


def chip_too_thick(rng: Rng) -> Case:
    """A chip a tooth that no cutter bears: hardly turning, or far too fast a feed."""
    part = choice(rng, "plate", "step", "slot")
    s = PARTS[part].program()
    speed, feed = (int(rng.integers(1, 100)), 2000.0) if rng.random() < 0.5 else (3000, float(rng.uniform(2e4, 6e4)))
    s.ops[0].speed = speed
    for op in s.ops:
        if op.feed is not None and op.feed >= FEED:
            op.feed = feed
    return made("chip too thick", part, s, ("load",), None, what=f"S{speed} F{feed:.0f}")


def deep_slot(rng: Rng) -> Case:
    """A slot many diameters deep in one pass, in titanium, at a feed for aluminium."""
    long = {**FLAT, "flute_length_mm": 30, "stickout_mm": 60}
    s, deep = Script(group="harm"), float(rng.uniform(18.0, 26.0))
    top = PARTS["plate"].top
    x0, y0, x1, y1, _ = PARTS["plate"].size
    s.tool(1)
    s.rapid(1.0, -OUT)
    s.rapid(z=SAFE + 20.0)
    s.rapid(z=top + deep + 2.0)
    s.feed(z=top, feed=3000.0)
    rows(s, spread(1.0, 27.0, 4.0), top)
    s.rapid(z=SAFE + 20.0)
    setup = {"tools": [long, BALL], "material": "Ti-6Al-4V",
             "stock": {"box_mm": [[x0, y0, 0.0], [x1, y1, top + deep]]}}
    return made("deep slot", "plate", s, ("load", "deflection"), None, None, setup, what=f"{deep:.1f} deep")


def bends_too_far(rng: Rng) -> Case:
    """A tool so slender that it bends by more than half a mm in sound cuts."""
    part, long = choice(rng, *LEVEL), float(rng.uniform(220.0, 300.0))
    slim = {**FLAT, "stickout_mm": long}
    return made("bends too far", part, PARTS[part].program(), ("load",), None, None, {"tools": [slim, BALL]},
                what=f"{long:.0f} mm of D6")


def steep_climb(rng: Rng) -> Case:
    """Up through stock from beside it, steeper than 45 degrees and many diameters deep."""
    long = {**FLAT, "flute_length_mm": 30, "stickout_mm": 60}
    s, deep, angle = Script(group="harm"), float(rng.uniform(18.0, 26.0)), float(rng.uniform(47.0, 65.0))
    x0, y0, x1, y1, top = PARTS["plate"].size
    s.tool(1)
    s.rapid(float(rng.uniform(4.0, 20.0)), -OUT)
    s.rapid(z=SAFE + 20.0)
    s.rapid(z=top + deep + 2.0)
    s.feed(z=top, feed=3000.0)
    s.feed(y=y0 - R - 0.1)
    climb = s.feed(y=y0 - R - 0.1 + (deep + 1.0) / math.tan(math.radians(angle)), z=top + deep + 1.0, feed=3000.0)
    s.rapid(z=SAFE + 20.0)
    setup = {"tools": [long, BALL], "material": "Ti-6Al-4V",
             "stock": {"box_mm": [[x0, y0, 0.0], [x1, y1, top + deep]]}}
    return made("steep climb", "plate", s, ("load",), [climb], None, setup, what=f"{angle:.0f} deg, {deep:.1f} deep")


def stands_behind_taps(rng: Rng) -> Case:
    """A tapping cycle in the air leaves the spindle standing, and nothing starts it again."""
    part, name = choice(rng, *LEVEL), choice(rng, "fanuc rigid", "fanuc", "haas", "heidenhain")
    dialect, rigid = name.split()[0], "rigid" in name
    s = PARTS[part].program()
    cycle = f"{choice(rng, 'G98', 'G99')} {choice(rng, 'G84', 'G74')} R{SAFE - 1.0:g}. Z{SAFE - 3.0:g}. F500."
    lines = [*(["M29 S500"] * rigid), cycle, "G80", f"G0 Z{SAFE:g}."]
    if dialect == "heidenhain":
        number = choice(rng, "207", "209")
        breaks = " Q257=1 Q256=0" if number == "209" else ""
        lines = [f"L Z+{SAFE:g} R0 FMAX", f"CYCL DEF {number} TAPPING Q200=1 Q201=-2 Q239=+1 "
                 f"Q203=+{SAFE - 3:g} Q204=2{breaks}", "CYCL CALL", f"L Z+{SAFE:g} R0 FMAX"]
    s.ops[2:2] = [Op("raw", text=line) for line in lines]
    return made("stands behind taps", part, s, ("program",), None, None, {"machine": {"dialects": [dialect]}}, dialect,
                word="spindle")


def other_feed_by_a_word(rng: Rng) -> Case:
    """A word of Siemens or Heidenhain after which feed or speed is not what F and S say."""
    part, word = choice(rng, *LEVEL), choice(rng, "VELOLIM[S1]=2", "OVRA[S1]=2", "FLIN", "FCUB", "SVC=1", "FGROUP(Z)",
                                             "FUNCTION S-PULSE P-TIME10 SCALE90", "M109")
    dialect = "heidenhain" if word[0] == "M" or " " in word else "siemens"
    s = PARTS[part].program()
    s.ops.insert(2, Op("raw", text=word))
    return made("other feed by a word", part, s, (REFUSED, "load"), None, None, {"machine": {"dialects": [dialect]}},
                dialect, what=word)


def surface_speed(rng: Rng) -> Case:
    """A speed in titanium over 31 times the recommended one: the cutter burns."""
    part = choice(rng, "plate", "step")
    s = PARTS[part].program()
    s.ops[0].speed = int(rng.integers(100_000, 150_000))
    for op in s.ops:
        if op.feed is not None and op.feed >= FEED:
            op.feed = 3000.0
    return made("surface speed", part, s, ("load", "limit"), None, None, {"material": "Ti-6Al-4V"})


def below_at_end(rng: Rng) -> Case:
    """The program ends, or changes the tool, with the tip below the top of the part."""
    part = choice(rng, "step", "slot")
    s = PARTS[part].program()
    last = max(k for k, op in enumerate(s.ops) if op.kind == "rapid" and op.z == SAFE)
    del s.ops[last:]
    s.foot = ["M5", "M2", "%"]
    return made("ends in the part", part, s, ("program",), None)


def left_at_m99(rng: Rng) -> Case:
    """Fanuc, Haas: M99 begins the program again, in a mode that the first round has left."""
    part, dialect = choice(rng, *LEVEL), choice(rng, "fanuc", "haas")
    turn, share = float(np.round(rng.uniform(1.0, 359.0), 1)), float(np.round(rng.uniform(0.8, 0.99), 3))
    left, word = {"G68": (f"G68 X0. Y0. R{turn:.1f}", ""), "G51": (f"G51 X0. Y0. Z0. P{share:.3f}", ""),
                  "G95": ("G95", "G94 "), "G52": (f"G52 X{turn / 90.0:.3f}", "")}[
                      choice(rng, "G68", "G51", "G95", "G52")]  # each tool change states G90
    s = PARTS[part].program()
    s.head = ["%", "O1000", "G21 G17 G90 G94 G40 G49 G80".replace(word, ""), "G54"]
    s.foot = ["M5", "G91 G28 Z0.", "G90", left, "M99", "%"]
    return made("left at M99", part, s, ("program", REFUSED), None, None, {"machine": {"dialects": [dialect]}}, dialect,
                word="begins again", what=left)


def left_in_a_table(rng: Rng) -> Case:
    """A value that G10 writes behind the cuts, with which the next run begins."""
    part, dialect = choice(rng, *LEVEL), choice(rng, "fanuc", "haas")
    by = float(np.round(rng.uniform(0.02, 2.0), 3)) * (1.0 if rng.random() < 0.5 else -1.0)
    left = {"wear": f"G10 L11 P1 R{by}", "length": f"G91 G10 L10 P1 R{by}", "zero": f"G91 G10 L2 P1 X{by}",
            "height": f"G91 G10 L2 P1 Z{by}"}[choice(rng, "wear", "length", "zero", "height")]
    s = PARTS[part].program()
    s.foot = ["M5", "G91 G28 Z0.", "G90", left, "G90", "M30", "%"]
    return made("left in a table", part, s, ("program",), None, None, {"machine": {"dialects": [dialect]}}, dialect,
                word="G10", what=left)


def lengths_that_contradict(rng: Rng) -> Case:
    """Two tools whose lengths in the program differ otherwise than those of the setup."""
    part, dialect = choice(rng, *LEVEL), choice(rng, "linuxcnc", "fanuc", "haas")
    first, second, off = (float(np.round(v, 2)) for v in rng.uniform([60, 60, 1.5], [120, 120, 30.0]))
    write = "G10 L1 P{} Z{}" if dialect == "linuxcnc" else "G10 L10 P{} R{}"
    s = PARTS[part].program()
    s.ops[:0] = [Op("raw", text=write.format(1, first)), Op("raw", text=write.format(2, round(second - off, 2)))]
    tools = [{**FLAT, "gauge_length_mm": first}, {**BALL, "gauge_length_mm": second}]
    setup = {"machine": {"dialects": [dialect]}, "tools": tools}
    return made("lengths contradict", part, s, ("program",), [s.ops[1]], None, setup, dialect, word="gauge_length_mm",
                what=f"{off} off")


def _after_a_level(s: Script, *lines: str) -> Op:
    """Put lines behind the first lift to the safe height; the next rapid in Z."""
    lift = next(k for k, op in enumerate(s.ops) if k > 5 and op.kind == "rapid" and op.z == SAFE)
    down = next(op for op in s.ops[lift + 1:] if op.z is not None)
    s.ops[lift + 1:lift + 1] = _raw_change(Script(), *lines)
    return down


def length_dropped(rng: Rng) -> Case:
    """A way home in Z drops the length offset, and Z comes down without G43."""
    part, dialect = choice(rng, "step", "slot", "boss", "rib"), choice(rng, "fanuc", "haas")
    way = choice(rng, "G91 G28 Z0.", "G28 G91 Z0.", *(["G53 G0 Z0.", "G91 G30 Z0."] if dialect == "fanuc" else []))
    s = PARTS[part].program()
    down = _after_a_level(s, way, "G90")
    return made("length dropped", part, s, ("program",), [down], None, {"machine": {"dialects": [dialect]}}, dialect,
                word="drops it", what=f"{dialect} {way}")


def pallet_changed(rng: Rng) -> Case:
    """LinuxCNC changes the pallet before the program has ended: the next levels meet another blank."""
    part = choice(rng, "step", "slot", "boss", "rib")
    s = PARTS[part].program()
    _after_a_level(s, "M60")
    return made("pallet changed", part, s, ("program",), None, word="M60")


def speed_raised(rng: Rng) -> Case:
    """A least speed of Siemens over what the tool or the machine may turn."""
    part, least, before = choice(rng, "step", "slot", "boss", "rib"), int(rng.integers(9000, 30000)), rng.random() < 0.5
    s = PARTS[part].program()
    if before:
        s.ops.insert(0, Op("raw", text=f"G25 S{least}"))
    else:
        _after_a_level(s, f"G25 S{least}")
    machine: dict[str, Any] = {"dialects": ["siemens"]}
    limited = {"machine": {**machine, "max_rpm": 8000}} if rng.random() < 0.5 else {
        "machine": machine, "tools": [{**FLAT, "max_rpm": 8000}, BALL]}
    return made("speed raised", part, s, ("limit",), None, None, limited, "siemens", what=str(least))


MECHANISMS = {"wrong length offset": wrong_length_offset, "no length offset": no_length_offset,
              "no spindle": no_spindle, "stale length in rapid": stale_length_in_rapid, "shift by G92": shift_by_g92,
              "G92 before G52": fanuc_g92_g52, "no path tolerance": no_path_mode,
              "wide path tolerance": wide_path_mode, "machine move too far": machine_move_too_far,
              "stray end": stray_end, "stray early end": stray_early_end, "dogleg rapid": fanuc_dogleg,
              "sense of rotary axes": sense_of_rotary_axes, "inch for mm": inch, "wrong zero": wrong_zero,
              "G91 left on": incremental_left_on, "block delete": block_delete, "pasted twice": pasted_twice,
              "over a limit": over_limit, "chip too thick": chip_too_thick, "deep slot": deep_slot,
              "surface speed": surface_speed, "ends in the part": below_at_end, "bends too far": bends_too_far,
              "steep climb": steep_climb, "stands behind taps": stands_behind_taps,
              "other feed by a word": other_feed_by_a_word, "left at M99": left_at_m99,
              "left in a table": left_in_a_table, "lengths contradict": lengths_that_contradict,
              "length dropped": length_dropped, "pallet changed": pallet_changed, "speed raised": speed_raised}
