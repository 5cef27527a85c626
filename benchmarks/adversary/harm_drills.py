"""Harm by drills and taps in the plate: their holes are gouges too, and what is asked for is the harm to the tool.

Ways and forces are closed forms of the numbers that are drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import SAFE, Case, Op, Script, made
from benchmarks.adversary.adversary_parts import BALL, FLAT, HALF, PARTS
from benchmarks.adversary.harm_surface import base, choice

Rng = np.random.Generator
TOP, BOTTOM, SPEED = 10.0, 1.0, 1500
THREADS = ((5.0, 0.8, 3.3), (4.2, 0.8, 3.3), (6.0, 1.0, 4.2), (5.0, 1.0, 4.2), (4.0, 0.7, 2.5), (3.3, 0.7, 2.5),
           (8.0, 1.25, 5.0), (6.8, 1.25, 5.0))
"""mm: diameter of a tap, of its teeth or of its hole; its pitch; the hole of the next smaller thread."""


def _drill(diameter: float, flutes: float = 30.0, stickout: float = 40.0) -> dict[str, Any]:
    return {"id": "T3", "number": 3, "kind": "drill", "diameter_mm": diameter, "flute_length_mm": flutes,
            "stickout_mm": stickout}


def _tap(diameter: float, **more: Any) -> dict[str, Any]:
    return {"id": "T4", "number": 4, "kind": "tap", "diameter_mm": diameter, "flute_length_mm": 15.0,
            "stickout_mm": 40.0, **more}


def _setup(*tools: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"tools": [FLAT, BALL, *tools], **more}


def _place(rng: Rng) -> tuple[float, float]:
    return round(float(rng.uniform(6.0, 22.0)), 3), round(float(rng.uniform(-5.0, 5.0)), 3)


def _hole(s: Script, x: float, y: float, a_turn: float, down: float = BOTTOM) -> Op:
    """A hole in one go from over the plate, ``a_turn`` mm in a turn; returns its feed move."""
    s.tool(3, SPEED)
    s.rapid(x, y)
    s.rapid(z=TOP + 2.0)
    op = s.feed(x, y, down, round(a_turn * SPEED, 1))
    s.rapid(z=SAFE)
    return op


def _over_a_hole(rng: Rng, hole: float) -> tuple[Script, float, float]:
    """A program that has drilled a hole and stands over it with the tap; its place, mm."""
    x, y = _place(rng)
    s = base("plate")
    _hole(s, x, y, 0.02 * hole)
    s.tool(4, 500)
    s.rapid(x, y)
    s.rapid(z=TOP + 2.0)
    return s, x, y


def flutes_shut_in(rng: Rng) -> Case:
    """A drill goes deeper than its flutes in one go, by more than half of its diameter."""
    d = round(float(rng.uniform(2.0, 5.0)), 2)
    flutes = round(float(rng.uniform(0.4 * d, TOP - BOTTOM - 0.9 * d)), 2)
    s = base("plate")
    op = _hole(s, *_place(rng), 0.02 * d)
    return made("flutes shut in", "plate", s, ("load",), [op], None, _setup(_drill(d, flutes)), word="shut in",
                what=f"{d} mm, flutes {flutes}")


def one_lip(rng: Rng) -> Case:
    """A slender drill beside the plate, with its axis in air."""
    d = round(float(rng.uniform(1.0, 2.0)), 2)
    s = base("plate")
    op = _hole(s, _place(rng)[0], HALF + float(rng.uniform(0.05, 0.3)) * d, 0.02 * d)
    return made("one lip", "plate", s, ("load",), [op], None, _setup(_drill(d, 30.0, float(rng.uniform(40.0, 60.0)))),
                word="one side only", what=f"{d} mm")


def drill_too_fast(rng: Rng) -> Case:
    """A drill that goes more than a tenth of its diameter in a turn."""
    d = round(float(rng.uniform(1.0, 6.0)), 2)
    a_turn = float(rng.uniform(0.11, 0.3)) * d
    s = base("plate")
    op = _hole(s, *_place(rng), a_turn)
    return made("drill too fast", "plate", s, ("load",), [op], None, _setup(_drill(d)), word="any drill bears",
                what=f"{d} mm, {a_turn:.3f} in a turn")


def drill_buckles(rng: Rng) -> Case:
    """A drill 60 to 80 diameters long in steel, at 0.09 diameters in a turn."""
    d = round(float(rng.uniform(0.5, 1.0)), 2)
    s = base("plate")
    op = _hole(s, *_place(rng), 0.09 * d, TOP - 2.0)
    long = float(rng.uniform(60.0, 80.0)) * d
    tool = _drill(d, 0.9 * long, long)
    return made("drill buckles", "plate", s, ("load",), [op], None, _setup(tool, material="C45"), word="buckles",
                what=f"{d} mm")


def narrow_tap_hole(rng: Rng) -> Case:
    """A tap in the hole of the next smaller thread."""
    diameter, pitch, hole = THREADS[int(rng.integers(len(THREADS)))]
    s, x, y = _over_a_hole(rng, hole)
    stated = {"pitch_mm": pitch} if rng.random() < 0.5 else {}
    op = s.raw(f"G84 X{x} Y{y} Z{BOTTOM + 2.0} R{TOP + 2.0} F{500 * pitch:g}")
    s.raw("G80")
    return made("narrow tap hole", "plate", s, ("plunge",), [op], None, _setup(_drill(hole), _tap(diameter, **stated)),
                word="before this tap", what=f"{diameter} x {pitch} in {hole}")


def tap_fed_out(rng: Rng) -> Case:
    """A tap that goes out as it went in: the spindle turns on."""
    diameter, pitch, hole = ((5.0, 0.8, 4.2), (6.0, 1.0, 5.0), (4.0, 0.7, 3.3))[int(rng.integers(3))]
    s, x, y = _over_a_hole(rng, hole)
    s.feed(x, y, BOTTOM + 2.0, 500 * pitch)
    op = s.feed(x, y, TOP + 2.0)
    return made("tap fed out", "plate", s, ("program",), [op], None, _setup(_drill(hole), _tap(diameter)),
                word="fed out", what=f"{diameter} x {pitch}")


def thread_mill_on_walls(rng: Rng) -> Case:
    """A thread mill where an end mill is meant: its teeth leave grooves in every wall that it runs along."""
    part = choice(rng, "boss", "pocket", "step", "slot", "rib")
    stated = {"pitch_mm": float(choice(rng, "0.5", "0.8", "1.0"))} if rng.random() < 0.5 else {}
    tools = [{**FLAT, "kind": "thread_mill", **stated}, BALL]
    return made("thread mill on walls", part, PARTS[part].program(), ("program",), None, None, {"tools": tools},
                word="without the rise of a thread", what=str(stated))


MECHANISMS = {"flutes shut in": flutes_shut_in, "one lip": one_lip, "drill too fast": drill_too_fast,
              "drill buckles": drill_buckles, "narrow tap hole": narrow_tap_hole, "tap fed out": tap_fed_out,
              "thread mill on walls": thread_mill_on_walls}
