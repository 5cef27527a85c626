"""The kinds of ``benchmarks/faults`` on the parts of the adversary, with their harm in closed form.

Gouges, bodies, rapids, plunges, wrong length offsets, inches and pasted zones have mechanisms of their own in the other
modules. These are the others.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import REFUSED, SAFE, Case, Expected, Op, Script, made, written
from benchmarks.adversary.adversary_parts import (
    BALL,
    BOW_RADIUS,
    FLAT,
    HALF,
    PARTS,
    SLOPE_DEG,
    WEDGE_DEG,
    R,
)
from benchmarks.adversary.harm_surface import choice, quality, scale_of

Rng = np.random.Generator
STEP_OVER = {"slope": 0.5, "wedge": 0.5, "cylinder": 0.45}
"""mm between contacts of neighbouring rows, about."""


def _rows_of(s: Script, group: str) -> list[Op]:
    return [op for op in s.ops if op.group == group and op.kind == "feed" and op.x is not None]


def _lifted(ops: list[Op]) -> None:
    """Feed moves of a row, run in the air."""
    for op in ops:
        op.z = (op.z or 0.0) + 12.0


def stray_rotary_word(rng: Rng) -> Case:
    """A rotary word on a machine that has no such axis."""
    part = choice(rng, *PARTS)
    s = PARTS[part].program()
    feeds = [k for k, op in enumerate(s.ops) if op.kind == "feed"]
    k, word = feeds[int(rng.integers(len(feeds)))], f"{'AC'[int(rng.integers(2))]}{rng.uniform(-5, 90):.3f}"
    line = Op("raw", text=f"G1 {word}")
    s.ops.insert(k, line)
    return made("stray rotary word", part, s, (REFUSED,), [line])


def wrong_tool(rng: Rng) -> Case:
    """A wider tool in the tool table: walls are cut by half of what it is wider."""
    part = choice(rng, "step", "slot", "boss", "pocket", "rib")
    tolerance, scale, d = scale_of(rng, 0.22)
    s = PARTS[part].program()
    wide = {**FLAT, "diameter_mm": 2 * R + 2 * d}
    return made("wrong tool", part, s, ("gouge",), None, d, {**quality(tolerance), "tools": [wide, BALL]},
                what=f"{scale} x {tolerance}")


def _breaks(before: Op, arc: Op) -> bool:
    """Whether an arc whose I and J are exchanged does not end on its circle."""
    a, b = (np.array([op.x or 0.0, op.y or 0.0]) for op in (before, arc))
    i, j = np.array(arc.centre) - a
    return abs(float(np.linalg.norm(a + [j, i] - b)) - float(np.hypot(i, j))) > 0.1


def swapped_ij(rng: Rng) -> Case:
    """I and J of one arc exchanged: it does not end on its circle."""
    part = choice(rng, "boss", "pocket")
    s = PARTS[part].program()
    text, at = written(s)
    lines = text.splitlines()
    rows = [at[id(op)] for k, op in enumerate(s.ops) if op.kind == "arc" and _breaks(s.ops[k - 1], op)]
    row = rows[int(rng.integers(len(rows)))]
    lines[row - 1] = re.sub(r"I(\S+) J(\S+)", r"I\2 J\1", lines[row - 1])
    want = Expected(False, (REFUSED,), frozenset([row]))
    return Case("swapped I J", part, {}, "\n".join(lines) + "\n", "linuxcnc", want, f"line {row}")


def arc_plane(rng: Rng) -> Case:
    """Another plane before the arcs."""
    part = choice(rng, "boss", "pocket")
    s = PARTS[part].program()
    arcs = [k for k, op in enumerate(s.ops) if op.kind == "arc"]
    s.ops.insert(arcs[int(rng.integers(len(arcs)))], Op("raw", text=choice(rng, "G18", "G19")))
    return made("arc plane", part, s, (REFUSED, "gouge", "plunge"), None)


def missing_pass(rng: Rng) -> Case:
    """Two neighbouring rows of the ball left out: a ridge of five scallops stays."""
    part = choice(rng, "slope", "wedge", "cylinder")
    s = PARTS[part].program()
    rows = _rows_of(s, "ball")
    places = sorted({op.x for op in rows[4:-4] if op.x is not None})
    k = int(rng.integers(4, len(places) - 5))
    _lifted([op for op in rows if op.x in places[k:k + 2]])
    # centres of the neighbours: their circles meet over the middle between them
    tips = {op.x: op.z for op in rows}
    a, b = np.array([places[k - 1], tips[places[k - 1]]]), np.array([places[k + 2], tips[places[k + 2]]])
    wide = float(np.linalg.norm(b - a))
    up = math.sqrt(R * R - 0.25 * wide * wide)
    if part == "cylinder":
        height = math.sqrt((BOW_RADIUS + R) ** 2 - 0.25 * wide * wide) - up - BOW_RADIUS
    else:
        height = R - up
    return made("missing pass", part, s, ("stock_left",), None, None, what=f"ridge of {height:.4f}")


def shifted_pass(rng: Rng) -> Case:
    """One row of the ball moved into the part."""
    part, (tolerance, scale, d) = choice(rng, "slope", "cylinder"), scale_of(rng, 0.5)
    s = PARTS[part].program()
    rows = _rows_of(s, "ball")
    inner = [op for op in rows if op.x is not None and 4.0 < op.x < 18.0]
    x = inner[int(rng.integers(len(inner)))].x
    assert x is not None
    own = [op for op in rows if op.x == x]
    if part == "slope":
        n = np.array([math.sin(math.radians(SLOPE_DEG)), math.cos(math.radians(SLOPE_DEG))])
    else:
        middle = np.array([12.0, PARTS[part].top - BOW_RADIUS])
        n = np.array([x, (own[0].z or 0.0) + R]) - middle
        n /= np.linalg.norm(n)
    for op in own:
        op.x, op.z = x - d * float(n[0]), (op.z or 0.0) - d * float(n[1])
    after = s.ops[s.ops.index(own[-1]) + 1]
    return made("shifted pass", part, s, ("gouge",), [*own, after], d, quality(tolerance),
                what=f"{scale} x {tolerance}")


def unknown_tool(rng: Rng) -> Case:
    """A tool that the setup does not have."""
    part = choice(rng, *PARTS)
    s = PARTS[part].program()
    change = next(op for op in s.ops if op.kind == "tool")
    change.number = int(rng.integers(3, 9))
    return made("unknown tool", part, s, (REFUSED, "program"), None)


def other_tool(rng: Rng) -> Case:
    """The flat where the ball is meant, with its own length: its rim cuts the slope."""
    part = choice(rng, "slope", "wedge")
    s = PARTS[part].program()
    changes = [op for op in s.ops if op.kind == "tool"]
    changes[1].number = 1
    a = math.radians(SLOPE_DEG if part == "slope" else WEDGE_DEG)
    # the tip is R (1 - cos a) under the contact and the rim R (1 - sin a) uphill of it
    deep = R * math.cos(a) * (1 / math.cos(a) - 1 + math.tan(a) * (1 - math.sin(a)))
    if part == "wedge":
        return made("other tool", part, s, ("gouge",), None, None)
    return made("other tool", part, s, ("gouge",), None, deep)


def lost_point(rng: Rng) -> Case:
    """A decimal point left out: the move ends far outside the travel."""
    part, word = choice(rng, "slope", "wedge", "cylinder", "step"), re.compile(r"[XYZ]-?\d\d?\.\d{3}")
    s = PARTS[part].program()
    text, at = written(s)
    lines = text.splitlines()
    rows = [at[id(op)] for op in s.ops if op.kind == "feed" and word.search(lines[at[id(op)] - 1])]
    row = rows[int(rng.integers(len(rows)))]
    lines[row - 1] = re.sub(r"([XYZ]-?\d\d?)\.(\d{3})", r"\1\2", lines[row - 1], count=1)
    want = Expected(False, ("limit", REFUSED))
    return Case("lost point", part, {}, "\n".join(lines) + "\n", "linuxcnc", want, f"line {row}")


def truncated(rng: Rng) -> Case:
    """The end of the file is missing."""
    part = choice(rng, *PARTS)
    text, _ = written(PARTS[part].program())
    lines = text.splitlines()
    k = int(rng.integers(8, len(lines) - 4))
    half = lines[k][:int(rng.integers(0, len(lines[k])))]
    want = Expected(False, (REFUSED, "program", "stock_left", "gouge", "limit", "rapid", "plunge", "nothing_cut"))
    return Case("truncated", part, {}, "\n".join([*lines[:k], half]), "linuxcnc", want, f"after line {k}")


def uncovered_level(rng: Rng) -> Case:
    """One row of a level face left out where the tool is narrower than the gap."""
    part = choice(rng, "step", "rib")
    s = PARTS[part].program()
    z = 4.0 if part == "step" else 6.0
    own = [k for k, op in enumerate(s.ops) if op.kind == "feed" and op.z is not None and abs(op.z - z) < 1e-9
           and op.x is not None and op.y is not None and abs(op.y) > HALF]
    xs = sorted({s.ops[k].x for k in own if s.ops[k].x is not None})
    gone = xs[len(xs) // 2 - (1 if part == "rib" else 0)]
    _lifted([s.ops[k] for k in own if s.ops[k].x == gone])
    return made("row left out", part, s, ("stock_left",), None, None, what=f"x {gone:.2f}")


def deep_zero(rng: Rng) -> Case:
    """The whole program too deep, as with a wrong zero or length: every level is gouged."""
    part, (tolerance, scale, d) = choice(rng, *PARTS), scale_of(rng, 0.3)
    s = PARTS[part].program()
    for op in s.ops:
        if op.kind != "raw" and op.z is not None and op.z < 30.0:
            op.z -= d
    return made("too deep", part, s, ("gouge",), None, None, quality(tolerance), what=f"{scale} x {tolerance}")


def high_zero(rng: Rng) -> Case:
    """The whole program too high: stock is left everywhere."""
    part, d = choice(rng, *PARTS), float(rng.uniform(0.06, 0.5))
    s = PARTS[part].program()
    for op in s.ops:
        if op.kind != "raw" and op.z is not None and op.z < 30.0:
            op.z += d
    return made("too high", part, s, ("stock_left", "nothing_cut"), None, None, what=f"{d:.3f}")


def aside_zero(rng: Rng) -> Case:
    """The whole program aside: walls are cut on one side."""
    part, (tolerance, scale, d) = choice(rng, "step", "slot", "boss", "pocket"), scale_of(rng, 0.4)
    s: Script = PARTS[part].program()
    sign = 1.0 if part == "step" else float(rng.choice([-1.0, 1.0]))
    for op in s.ops:
        op.centre = op.centre[0] + sign * d, op.centre[1]
        if op.x is not None:
            op.x += sign * d
    setup: dict[str, Any] = quality(tolerance)
    return made("aside", part, s, ("gouge",), None, d, setup, what=f"{scale} x {tolerance}")


def shifted_away(rng: Rng) -> Case:
    """A shift of program zero takes the second half of the cuts past the part, with the tool that made the first."""
    part, dialect = choice(rng, "step", "slot", "floor", "pocket"), choice(rng, "linuxcnc", "fanuc", "siemens")
    word = choice(rng, "X", "Y", "Z")
    by = 60.0 if word == "Z" else float(rng.uniform(80.0, 300.0))
    s: Script = PARTS[part].program()
    feeds = [k for k, op in enumerate(s.ops) if op.kind in ("feed", "arc")]
    half = feeds[len(feeds) // 2]
    lifts = [k for k, op in enumerate(s.ops) if op.kind == "rapid" and op.z == SAFE and feeds[2] < k < feeds[-1]]
    k = min(lifts, key=lambda n: abs(n - half))
    begin, end = ("TRANS {}{:.3f}", "TRANS") if dialect == "siemens" else ("G52 {}{:.3f}", "G52 X0. Y0. Z0.")
    s.ops.insert(k + 1, Op("raw", text=begin.format(word, by)))
    s.raw(end)
    return made("shifted away", part, s, ("nothing_cut", "stock_left"), None, None,
                {"machine": {"dialects": [dialect]}}, dialect, what=f"{word}{by:.0f}")


MECHANISMS = {"stray rotary word": stray_rotary_word, "wrong tool": wrong_tool, "swapped I J": swapped_ij,
              "arc plane": arc_plane, "missing pass": missing_pass, "shifted pass": shifted_pass,
              "unknown tool": unknown_tool, "other tool": other_tool, "lost point": lost_point,
              "truncated": truncated, "row left out": uncovered_level, "too deep": deep_zero, "too high": high_zero,
              "aside": aside_zero, "shifted away": shifted_away}
