"""Harm by bodies: shanks, holders, clamps, the table, an empty spindle, rapids, and descents into stock.

Depth is the shorter way out of the body, aside or down through its lower end, in closed form.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import SAFE, Case, Script, made
from benchmarks.adversary.adversary_parts import (
    BALL,
    FEED,
    FLAT,
    HALF,
    OUT,
    OVER,
    PARTS,
    POCKET_TOP,
    R,
    begun,
    rows,
    spread,
)
from benchmarks.adversary.harm_surface import base, choice

Rng = np.random.Generator
WALL, WALL_TOP, WALL_FOOT = 14.0, 12.0, 4.0  # mm, of the step
HIGH = 4.0  # mm of stock on the plate where a descent needs some


def _tools(**more: Any) -> dict[str, Any]:
    return {"tools": [{**FLAT, **more}, BALL]}


def holder_touch(rng: Rng) -> Case:
    """A tool clamped so short that its holder enters the wall."""
    nose = float(rng.uniform(2.5, WALL_TOP - WALL_FOOT - 0.3))
    s = base("step")
    return made("holder touch", "step", s, ("collision",), None, WALL_TOP - WALL_FOOT - nose,
                _tools(flute_length_mm=nose, stickout_mm=nose), word="holder", what=f"nose {nose:.3f}")


def shank_touch(rng: Rng) -> Case:
    """A shank wider than the cutter enters the wall."""
    flutes, wide = float(rng.uniform(3.0, 7.0)), 2 * R + float(rng.uniform(0.5, 8.0))
    s = base("step")
    deep = min(0.5 * wide - R, WALL_TOP - WALL_FOOT - flutes)
    return made("shank touch", "step", s, ("collision",), None, deep,
                _tools(flute_length_mm=flutes, shank_diameter_mm=wide), word="shank",
                what=f"flutes {flutes:.3f}, shank {wide:.3f}")


def shank_slack(rng: Rng) -> Case:
    """A shank as wide as the cutter dragged through deep stock, at a wide tolerance."""
    flutes, tolerance = float(rng.uniform(2.0, 6.0)), float(rng.choice([0.05, 0.25, 0.5]))
    s = Script(group="harm")
    begun(s, 1, 1.0, WALL_TOP + OVER + 1.0)
    rows(s, spread(1.0, 25.0, 4.0), WALL_TOP)
    s.rapid(z=SAFE)
    xs = spread(1.0, WALL - R, 4.0)
    s.rapid(xs[0], -OUT)
    s.rapid(z=WALL_FOOT)
    rows(s, xs, WALL_FOOT)
    s.rapid(z=SAFE)
    setup = {**_tools(flute_length_mm=flutes), "quality": {"gouge_tolerance_mm": tolerance}}
    return made("shank slack", "step", s, ("rubbing", "collision"), None, None, setup,
                what=f"flutes {flutes:.3f}, tolerance {tolerance}")


def clamp_feed(rng: Rng) -> Case:
    """A clamp where rows turn: the cutting part enters it from above."""
    deep = float(rng.uniform(0.1, 1.2))
    x, top = float(rng.uniform(6.0, 14.0)), PARTS["plate"].top
    box = [[x, HALF + 1.0, 0.0], [x + 8.0, OUT + 6.0, top + deep]]
    s = base("plate")
    return made("clamp in feed", "plate", s, ("collision",), None, deep, {"fixtures": [{"box_mm": box}]},
                word="fixture", what=f"{deep:.3f} deep")


def _beside(part: str, high: float) -> list[list[float]]:
    width = PARTS[part].size[2]
    return [[width + 8.0, -HALF, 0.0], [width + 20.0, HALF, high]]


def clamp_rapid(rng: Rng) -> Case:
    """A rapid through a clamp."""
    part = choice(rng, "plate", "step", "slot")
    high = PARTS[part].top + float(rng.uniform(2.5, 10.0))
    z = float(rng.uniform(PARTS[part].top + 1.5, high - 0.3))
    width = PARTS[part].size[2]
    s = base(part)
    s.over(-10.0, 0.0)
    s.rapid(z=z)
    ops = [s.rapid(x=width + 30.0)]
    s.rapid(z=SAFE)
    return made("clamp in rapid", part, s, ("rapid",), ops, min(high - z, R),
                {"fixtures": [{"box_mm": _beside(part, high)}]}, what=f"{high - z:.3f} deep")


def rapid_through_part(rng: Rng) -> Case:
    """A rapid under the finished top."""
    part, deep = choice(rng, "plate", "slot", "step"), float(rng.uniform(0.05, 2.0))
    width = PARTS[part].size[2]
    s = base(part)
    s.over(-R - 3.0, float(rng.uniform(-5, 5)))
    s.rapid(z=PARTS[part].top - deep)
    ops = [s.rapid(x=width + R + 3.0)]
    s.rapid(z=SAFE)
    return made("rapid through part", part, s, ("rapid",), ops, deep, what=f"{deep:.3f} deep")


def rapid_in_stock(rng: Rng) -> Case:
    """A rapid over the blank a little below its top, before the first cut."""
    deep = float(rng.uniform(0.08, 0.5))
    s = Script(group="harm")
    top = PARTS["plate"].top
    s.tool(1)
    s.rapid(-R - 3.0, float(rng.uniform(-5, 5)))
    s.rapid(z=SAFE)
    s.rapid(z=top + OVER - deep)
    ops = [s.rapid(x=28.0 + R + 3.0)]
    s.rapid(z=SAFE)
    s.ops += PARTS["plate"].program().ops[1:]
    return made("rapid in stock", "plate", s, ("rapid",), ops, deep, what=f"{deep:.3f} deep")


def rapid_over_face(rng: Rng) -> Case:
    """A rapid aside over a finished face, nearer than the rapid clearance."""
    part, gap = choice(rng, "plate", "step", "slot", "rib"), float(rng.choice([0.001, 0.05, 0.3, 0.8]))
    width = PARTS[part].size[2]
    s = base(part)
    s.over(-R - 3.0, float(rng.uniform(-5, 5)))
    s.rapid(z=PARTS[part].top + gap)
    ops = [s.rapid(x=width + R + 3.0)]
    s.rapid(z=SAFE)
    return made("rapid over face", part, s, ("rapid",), ops, None, what=f"gap {gap}")


def rapid_beside_clamp(rng: Rng) -> Case:
    """A rapid that passes a clamp aside, nearer than the rapid clearance."""
    part, gap = choice(rng, "plate", "slot"), float(rng.choice([0.02, 0.3, 0.8]))
    width = PARTS[part].size[2]
    s = base(part)
    s.over(width + 8.0 - R - gap, -30.0)
    s.rapid(z=5.0)
    ops = [s.rapid(y=30.0)]
    s.rapid(z=SAFE)
    return made("rapid beside clamp", part, s, ("rapid",), ops, gap, {"fixtures": [{"box_mm": _beside(part, 20.0)}]},
                what=f"gap {gap}")


def missing_retract(rng: Rng) -> Case:
    """A rapid aside from the floor, where the tool should have been lifted first."""
    part, deep = choice(rng, "slot", "step"), float(rng.uniform(0.1, 2.5))
    z, x = (5.0, 13.0) if part == "slot" else (WALL_FOOT, 9.0)
    wall = 18.0 if part == "slot" else WALL
    s = base(part)
    s.over(x, float(rng.uniform(-5, 5)))
    s.rapid(z=z + 1.5)
    s.feed(z=z, feed=FEED)
    ops = [s.rapid(x=wall - R + deep)]
    s.rapid(z=SAFE)
    return made("missing retract", part, s, ("rapid",), ops, deep, what=f"{deep:.3f} deep")


def table(rng: Rng) -> Case:
    """A slot beside the part goes below the top of the table."""
    s, z, high = base("plate"), float(rng.uniform(-6.0, -1.0)), 0.0
    s.over(28.0 + R + 1.0, -OUT)
    s.rapid(z=2.0)
    s.feed(z=z, feed=FEED)
    s.feed(y=OUT)
    s.rapid(z=SAFE)
    setup = {"machine": {"table_z_mm": high - float(rng.uniform(0.0, 0.8))}}
    return made("table", "plate", s, ("collision", "rapid"), None, None, setup, what=f"Z {z:.3f}")


def empty_spindle(rng: Rng) -> Case:
    """The spindle without a tool goes down at the place of the part, in rapids."""
    s = base("plate")
    s.raw("M5")
    s.raw("G53 G0 Z0")
    s.raw("T0 M6")
    s.rapid(float(rng.uniform(2, 26)), float(rng.uniform(-8, 8)))
    ops = [s.rapid(z=float(rng.uniform(-20.0, 8.0))), s.rapid(x=float(rng.uniform(-5, 30)))]
    return made("empty spindle", "plate", s, ("collision", "rapid", "program"), ops, None)


def longer_tool_at_top(rng: Rng) -> Case:
    """A change to a longer tool right above the part, on a control that does not go home by itself."""
    long = {**FLAT, "id": "T2", "number": 2, "stickout_mm": 40 + float(rng.uniform(15, 40))}
    s = base("plate")
    s.rapid(float(rng.uniform(5, 23)), 0.0)
    s.rapid(z=PARTS["plate"].top + 1.2)
    s.raw("M5")
    change = s.raw("T2 M6")
    s.raw("S6000 M3")
    s.raw("G43 H2")
    lift = s.rapid(z=SAFE)
    return made("longer tool at top", "plate", s, ("collision", "program", "rapid"), [change, lift], None,
                {"tools": [FLAT, long]})


def _high_stock() -> dict[str, Any]:
    x0, y0, x1, y1, top = PARTS["plate"].size
    return {"stock": {"box_mm": [[x0, y0, 0.0], [x1, y1, top + HIGH]]}}


def _faced(s: Script) -> None:
    """Take the high stock of the plate off in layers; from beside, so that nothing comes down into it."""
    top, count = PARTS["plate"].top, 3
    xs = spread(1.0, 27.0, 4.0)
    s.over(xs[0], -OUT - 1.0)
    for k in range(1, count + 1):
        z = top + HIGH - HIGH * k / count
        s.rapid(z=z + 2.0)
        s.feed(z=z, feed=FEED)
        rows(s, xs, z)
        s.rapid(z=SAFE)
        s.rapid(xs[0], -OUT)


def _into_stock(s: Script, rng: Rng) -> tuple[float, float, float]:
    """Load T1 and stand over the middle of the high stock; x, y, top, mm."""
    x, y, top = float(rng.uniform(6, 22)), float(rng.uniform(-5, 5)), PARTS["plate"].top + HIGH
    s.tool(1)
    s.rapid(x, y)
    s.rapid(z=SAFE)
    s.rapid(z=top + 2.0)
    s.feed(z=top, feed=150.0)
    return x, y, top


def plunge(rng: Rng) -> Case:
    """Straight down into stock by more than a tenth of the diameter."""
    s, deep = Script(group="harm"), float(rng.uniform(0.75, HIGH - 0.2))
    x, y, top = _into_stock(s, rng)
    ops = [s.feed(z=top - deep, feed=100.0)]
    _faced(s)
    return made("plunge", "plate", s, ("plunge",), ops, deep, _high_stock(), what=f"{deep:.3f} deep")


def stairs(rng: Rng) -> Case:
    """Straight down in small steps with a hair of way aside between them."""
    s, deep = Script(group="harm"), float(rng.uniform(1.2, HIGH - 0.3))
    x, y, top = _into_stock(s, rng)
    count = int(rng.integers(8, 20))
    ops = []
    for k in range(1, count + 1):
        ops += [s.feed(z=top - deep * k / count, feed=100.0), s.feed(x=x + 0.001 * (k % 2))]
    _faced(s)
    return made("stairs", "plate", s, ("plunge",), ops, deep, _high_stock(), what=f"{count} steps")


def pecks_paid_in_air(rng: Rng) -> Case:
    """Pecks by a mill that does not cut to its centre; way aside above the stock between them."""
    s, deep = Script(group="harm"), float(rng.uniform(1.5, HIGH - 0.2))
    x, y, top = _into_stock(s, rng)
    count = int(np.ceil(deep / 0.4))
    ops = []
    for k in range(1, count + 1):
        s.feed(z=top + 0.5)
        s.feed(x=x + 12.0, feed=2000.0)
        s.feed(x=x)
        s.feed(z=top - deep * (k - 1) / count, feed=500.0)
        ops.append(s.feed(z=top - deep * k / count, feed=100.0))
    _faced(s)
    return made("pecks paid in air", "plate", s, ("plunge",), ops, None,
                {**_high_stock(), **_tools(center_cutting=False)}, what=f"{deep:.3f} deep")


def no_centre_straight(rng: Rng) -> Case:
    """Straight down by less than a tenth of the diameter, by a mill that does not cut to its centre."""
    s, deep = Script(group="harm"), float(rng.uniform(0.07, 0.5))
    x, y, top = _into_stock(s, rng)
    ops = [s.feed(z=top - deep, feed=100.0)]
    _faced(s)
    return made("no centre, straight", "plate", s, ("plunge",), ops, None,
                {**_high_stock(), **_tools(center_cutting=False)}, what=f"{deep:.3f} deep")


def helix_in_core(rng: Rng) -> Case:
    """A helix so narrow that the core of a mill without centre teeth never moves off."""
    s, radius = Script(group="harm"), float(rng.uniform(0.1, 0.5))
    x, y, top = _into_stock(s, rng)
    z, ops = top, []
    s.feed(x + radius, y)
    while z > top - HIGH + 0.3:
        z -= 0.03 * 2 * np.pi * radius
        ops.append(s.arc(x - radius, y, (x, y), z=z + 0.015 * 2 * np.pi * radius))
        ops.append(s.arc(x + radius, y, (x, y), z=z))
    _faced(s)
    return made("helix in core", "plate", s, ("plunge",), ops, None,
                {**_high_stock(), **_tools(center_cutting=False)}, what=f"radius {radius:.3f}")


def steep_ramp(rng: Rng) -> Case:
    """A ramp far steeper than the material allows."""
    material, least = ("Ti-6Al-4V", 6.0) if rng.random() < 0.5 else ("AlMgSi1 6082", 16.0)
    s, angle, deep = Script(group="harm"), np.radians(least + float(rng.uniform(0, 20))), HIGH - 0.3
    x, y, top = _into_stock(s, rng)
    far = deep / np.tan(angle)
    a, b = max(2.0, 14.0 - far / 2), min(26.0, 14.0 + far / 2)
    s.over(a, y)
    s.rapid(z=top + 2.0)
    s.feed(z=top, feed=150.0)
    z, ops, side = top, [], True
    while z > top - deep + 1e-9:
        z = max(z - (b - a) * float(np.tan(angle)), top - deep)
        ops.append(s.feed(b if side else a, y, z, 150.0))
        side = not side
    _faced(s)
    return made("steep ramp", "plate", s, ("plunge",), ops, None, {**_high_stock(), "material": material},
                what=f"{np.degrees(angle):.1f} deg in {material}")


def pocket_straight(rng: Rng) -> Case:
    """The pocket entered straight down, layer by layer."""
    s = PARTS["pocket"].program()
    ops = []
    for op in s.ops:
        if op.kind == "feed" and op.z is not None and op.z < POCKET_TOP and op.y == 0.0:
            ops.append(op)
    k = int(rng.integers(0, len(ops) // 4)) * 4  # the first of the four ramps of a layer, straight down by all of it
    ops[k].x, ops[k].z = -4.0, ops[k + 3].z
    return made("pocket straight down", "pocket", s, ("plunge",), [ops[k]], None, what=f"layer {k // 4 + 1}")


MECHANISMS = {"holder touch": holder_touch, "shank touch": shank_touch, "shank slack": shank_slack,
              "clamp in feed": clamp_feed, "clamp in rapid": clamp_rapid, "rapid through part": rapid_through_part,
              "rapid in stock": rapid_in_stock, "rapid over face": rapid_over_face,
              "rapid beside clamp": rapid_beside_clamp, "missing retract": missing_retract, "table": table,
              "empty spindle": empty_spindle, "longer tool at top": longer_tool_at_top, "plunge": plunge,
              "stairs": stairs, "pecks paid in air": pecks_paid_in_air, "no centre, straight": no_centre_straight,
              "helix in core": helix_in_core, "steep ramp": steep_ramp, "pocket straight down": pocket_straight}
