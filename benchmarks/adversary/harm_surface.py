"""Harm to the surface: pits, grooves, notches, ribs, floors and edges cut too deep.

Depth is that of docs/theory/proof.md, in closed form: the larger of the ways from what was removed to the surface, and
from the surface to what remains. Every mechanism adds moves to a right program, in depths of 1.2 to 20 tolerances.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import SAFE, Case, Op, Script, made
from benchmarks.adversary.adversary_parts import (
    BALL,
    BOSS,
    BOSS_FOOT,
    BOSS_TOP,
    BOW_RADIUS,
    DOWN,
    FEED,
    FLAT,
    FLOOR,
    HALF,
    OUT,
    PARTS,
    POCKET_FLOOR,
    RIB,
    RIB_HEIGHT,
    SLOPE_DEG,
    WEDGE_DEG,
    R,
)

Rng = np.random.Generator
SCALES = (1.2, 1.5, 2.0, 5.0, 20.0)
TOLERANCES = (0.002, 0.01, 0.01, 0.05, 0.25)  # mm
NEEDLE: dict[str, Any] = {"id": "T3", "number": 3, "kind": "flat", "diameter_mm": 0.12, "flutes": 2,
                          "flute_length_mm": 2.0, "shank_diameter_mm": 3.0, "stickout_mm": 25}
LEVEL = {"plate": [(4.0, 24.0, 10.0)], "rib": [(4.0, 8.5, 6.0), (16.5, 21.0, 6.0)],
         "step": [(4.0, 10.5, 4.0), (17.5, 22.0, 12.0)], "slot": [(11.5, 14.5, 5.0)]}
"""x from, to, and height of level places where a tool has room, mm."""
LOW = HALF - 4.0  # mm, so far from the middle along Y


def scale_of(rng: Rng, most: float = 1.0) -> tuple[float, float, float]:
    """Tolerance, scale, and their product, no more than ``most`` mm."""
    for _ in range(50):
        tolerance, scale = float(rng.choice(TOLERANCES)), float(rng.choice(SCALES))
        if tolerance * scale <= most:
            return tolerance, scale, tolerance * scale
    return 0.01, 1.2, 0.012


def quality(tolerance: float) -> dict[str, Any]:
    """The section of the setup, with its tools as they are."""
    return {"quality": {"gouge_tolerance_mm": tolerance}}


def base(part: str) -> Script:
    """The right program of a part, ready for more."""
    s = PARTS[part].program()
    s.group = "harm"
    return s


def choice(rng: Rng, *names: str) -> str:
    """One of some names."""
    return str(names[int(rng.integers(len(names)))])


def in_hand(part: str) -> int:
    """T number of the tool at the end of the right program."""
    return 2 if PARTS[part].ball else 1


def load(s: Script, part: str, number: int, speed: int = 6000) -> None:
    """See that a tool is in the spindle."""
    if in_hand(part) != number:
        s.tool(number, speed)


def dip(s: Script, part: str, x: float, y: float, tip: float, feed: float = DOWN) -> list[Op]:
    """Down to a place and up again; the two feed moves. No rapid goes below the top of the part, beside a wall."""
    s.over(x, y)
    s.rapid(z=max(tip + 3.0, PARTS[part].top + 1.5))
    s.feed(z=tip + 1.0, feed=FEED)
    ops = [s.feed(z=tip, feed=feed), s.feed(z=tip + 1.5)]
    s.rapid(z=SAFE)
    return ops


def contact(part: str, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """A place and the normal there of a slope or a cylinder, (3,) mm and unit."""
    y = float(rng.uniform(-LOW, LOW))
    if part == "cylinder":
        a = float(rng.uniform(-0.5, 0.5))
        n = np.array([math.sin(a), 0.0, math.cos(a)])
        return np.array([12.0, y, PARTS[part].top - BOW_RADIUS]) + BOW_RADIUS * n, n
    angle = math.radians(SLOPE_DEG if part == "slope" else WEDGE_DEG)
    x = float(rng.uniform(4.0, 18.0))
    return (np.array([x, y, PARTS[part].top - x * math.tan(angle)]),
            np.array([math.sin(angle), 0.0, math.cos(angle)]))


def level(part: str, rng: Rng) -> tuple[float, float, float]:
    """A place on a level face where both tools have room: x, y, z, mm."""
    y = float(rng.uniform(-LOW, LOW))
    if part == "boss":
        a = float(rng.uniform(0, 2 * math.pi))
        if rng.random() < 0.5:
            r = float(rng.uniform(0.0, BOSS - R - 0.5))
            return r * math.cos(a), r * math.sin(a), BOSS_TOP
        r = float(rng.uniform(BOSS + R + 1.2, BOSS + R + 1.6))
        return r * math.cos(a), r * math.sin(a), BOSS_FOOT
    if part == "pocket":
        return float(rng.uniform(-4, 4)), float(rng.uniform(-2.5, 2.5)), POCKET_FLOOR
    x0, x1, z = LEVEL[part][int(rng.integers(len(LEVEL[part])))]
    return float(rng.uniform(x0, x1)), y, z


LEVELLED = ("plate", "rib", "step", "slot", "boss", "pocket")


def pit_level(rng: Rng) -> Case:
    """A pit of a flat or a ball in a level face."""
    part, (tolerance, scale, d) = choice(rng, *LEVELLED), scale_of(rng)
    number = int(rng.integers(1, 3))
    s = base(part)
    load(s, part, number)
    x, y, z = level(part, rng)
    return made("pit level", part, s, ("gouge",), dip(s, part, x, y, z - d), d, quality(tolerance),
                what=f"T{number} {scale} x {tolerance}")


def _pit_on(part: str, rng: Rng) -> Case:
    tolerance, scale, d = scale_of(rng)
    s = base(part)
    p, n = contact(part, rng)
    tip = p + (R - d) * n - [0.0, 0.0, R]
    ops = dip(s, part, *tip.tolist())
    return made(f"pit {part}", part, s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def pit_slope(rng: Rng) -> Case:
    """A pit of a ball in a slope."""
    return _pit_on("slope", rng)


def pit_cylinder(rng: Rng) -> Case:
    """A pit of a ball in a cylinder."""
    return _pit_on("cylinder", rng)


def groove(rng: Rng) -> Case:
    """A row of a ball too deep: across a level face in any direction, along a slope or a cylinder."""
    part, (tolerance, scale, d) = choice(rng, "plate", "step", "slope", "cylinder"), scale_of(rng)
    s = base(part)
    load(s, part, 2)
    if part in LEVEL:
        x, y, z = level(part, rng)
        a, far = float(rng.uniform(0, 2 * math.pi)), float(rng.uniform(0.5, 3.0))
        ends = [np.array([x + sign * far * math.cos(a), y + sign * far * math.sin(a), z - d]) for sign in (-1, 1)]
        if part == "step":  # keeps off the wall
            ends = [np.array([x, y + sign * far, z - d]) for sign in (-1, 1)]
    else:
        p, n = contact(part, rng)
        tip = p + (R - d) * n - [0.0, 0.0, R]
        ends = [np.array([tip[0], -3.0, tip[2]]), np.array([tip[0], 4.0, tip[2]])]
    a, b = ends
    s.over(float(a[0]), float(a[1]))
    s.rapid(z=float(a[2]) + 3.0)
    ops = [s.feed(z=float(a[2]), feed=DOWN), s.feed(float(b[0]), float(b[1]), float(b[2]), FEED),
           s.feed(z=float(b[2]) + 2.0)]
    s.rapid(z=SAFE)
    return made("groove", part, s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def needle(rng: Rng) -> Case:
    """A pit of a tool of 0.06 mm radius, far narrower than the samples lie apart."""
    part, (tolerance, scale, d) = choice(rng, "plate", "step", "slot", "boss", "slope", "cylinder"), scale_of(rng, 0.3)
    s = base(part)
    s.tool(3, 12000)
    number = in_hand(part)
    if part in LEVELLED:
        x, y, z = level(part, rng)
        depth: float | None = d
    else:
        p, _ = contact(part, rng)
        x, y, z = p.tolist()
        n = contact_normal(part, x)
        z += 0.06 * math.tan(math.acos(n[2]))  # its rim touches where the face stands highest under its end
        drop = d / n[2]
        z, d, depth = z + d - drop, d, d if part == "slope" else None
    s.group = "harm"
    ops = dip(s, part, x, y, z - d, feed=60.0)
    setup = {**quality(tolerance), "tools": [FLAT, BALL, NEEDLE]}
    return made("needle", part, s, ("gouge",), ops, depth, setup, what=f"after T{number}, {scale} x {tolerance}")


def small_ball(rng: Rng) -> Case:
    """A pit of a small ball on a curved face."""
    tolerance, scale, d = scale_of(rng, 0.2)
    radius = float(rng.choice([0.1, 0.25, 0.5]))
    tool = {**BALL, "id": "T3", "number": 3, "diameter_mm": 2 * radius, "flute_length_mm": 4.0,
            "shank_diameter_mm": 3.0, "stickout_mm": 30.0}
    s = base("cylinder")
    s.tool(3, 12000)
    p, n = contact("cylinder", rng)
    ops = dip(s, "cylinder", *(p + (radius - d) * n - [0.0, 0.0, radius]).tolist(), feed=60.0)
    setup = {**quality(tolerance), "tools": [FLAT, BALL, tool]}
    return made("small ball", "cylinder", s, ("gouge",), ops, d, setup, what=f"R{radius}, {scale} x {tolerance}")


def smooth_dip(rng: Rng) -> Case:
    """A small ball follows an arc into a curved face and out again, in chords that turn by ten degrees at most."""
    tolerance, scale, d = scale_of(rng, 0.1)
    radius, bow = float(rng.choice([0.1, 0.25, 0.5])), float(rng.uniform(0.5, 2.0))
    tool = {**BALL, "id": "T3", "number": 3, "diameter_mm": 2 * radius, "flute_length_mm": 4.0,
            "shank_diameter_mm": 3.0, "stickout_mm": 30.0}
    s = base("cylinder")
    s.tool(3, 12000)
    p, n = contact("cylinder", rng)
    most = math.acos(1.0 - (0.2 + d) / bow)
    angles = np.linspace(-most, most, 2 * math.ceil(most / math.radians(5.0)) + 1)
    tips = [p + (radius - d + bow * (1.0 - math.cos(a))) * n + [0.0, bow * math.sin(a), -radius] for a in angles]
    s.over(float(tips[0][0]), float(tips[0][1]) - 2.0)
    s.rapid(z=float(tips[0][2]) + 3.0)
    s.feed(z=float(tips[0][2]), feed=300.0)
    ops = [s.feed(*tip.tolist(), feed=100.0) for tip in tips]
    s.feed(y=float(tips[-1][1]) + 2.0)
    s.rapid(z=SAFE)
    setup = {**quality(tolerance), "tools": [FLAT, BALL, tool]}
    return made("smooth dip", "cylinder", s, ("gouge",), ops, d, setup, what=f"R{radius}, {scale} x {tolerance}")


def rim_pit(rng: Rng) -> Case:
    """The rim of a flat pressed into a cylinder or a slope from above: a lens far narrower than the tool."""
    part, (tolerance, scale, d) = choice(rng, "cylinder", "slope"), scale_of(rng, 0.4)
    s = base(part)
    s.tool(1)
    y = float(rng.uniform(-LOW, LOW))
    if part == "cylinder":
        low, dx = PARTS[part].top - BOW_RADIUS, float(rng.uniform(1.0, 6.0))
        x = 12.0 + (dx + R) * float(rng.choice([-1.0, 1.0]))
        tip = low + math.sqrt((BOW_RADIUS - d) ** 2 - dx * dx)
    else:
        a, x = math.radians(SLOPE_DEG), float(rng.uniform(7.0, 18.0))
        tip = PARTS[part].top - (x - R) * math.tan(a) - d / math.cos(a)
    return made("rim pit", part, s, ("gouge",), dip(s, part, x, y, tip), d, quality(tolerance),
                what=f"{scale} x {tolerance}")


def contact_normal(part: str, x: float) -> tuple[float, float, float]:
    """The normal of a slope or a cylinder at x, mm."""
    if part == "cylinder":
        sin = (x - 12.0) / BOW_RADIUS
        return sin, 0.0, math.sqrt(1 - sin * sin)
    a = math.radians(SLOPE_DEG if part == "slope" else WEDGE_DEG)
    return math.sin(a), 0.0, math.cos(a)


def edge_notch(rng: Rng) -> Case:
    """A notch a deep and b wide in a convex edge: of the step, the plate, or the boss; the lesser of both counts."""
    part, (tolerance, scale, d) = choice(rng, "step", "plate"), scale_of(rng, 0.5)
    a, b = (d, d * float(rng.uniform(1.0, 4.0)))
    if rng.random() < 0.5:
        a, b = b, a
    s = base(part)
    load(s, part, 1)
    y, far = float(rng.uniform(-LOW, LOW - 2.0)), float(rng.uniform(0.0, 2.0))
    wall, top = (14.0, 12.0) if part == "step" else (0.0, 10.0)
    x = wall - R
    s.over(x - 2.0, y)
    s.rapid(z=top + 2.0)
    s.feed(z=top - a, feed=FEED)
    ops = [s.feed(x=x + b, feed=DOWN)]
    if far > 0.3:
        ops.append(s.feed(y=y + far))
    ops.append(s.feed(x=x - 1.0))
    s.rapid(z=SAFE)
    return made("edge notch", part, s, ("gouge",), ops, min(a, b), quality(tolerance),
                what=f"{a:.4f} x {b:.4f}, {scale} x {tolerance}")


def wall_cut(rng: Rng) -> Case:
    """A stretch of a wall milled too deep."""
    part, (tolerance, scale, d) = choice(rng, "step", "slot", "boss", "pocket"), scale_of(rng)
    s = base(part)
    load(s, part, 1)
    x, y, z = {"step": (11.0, 0.0, 4.0), "slot": (11.0, 0.0, 5.0), "boss": (BOSS + R, 0.0, BOSS_FOOT),
               "pocket": (6.0, 0.0, POCKET_FLOOR)}[part]
    way = {"step": 1.0, "slot": -1.0, "boss": -1.0, "pocket": 1.0}[part]
    if part in ("step", "slot"):
        y = float(rng.uniform(-LOW, LOW))
    s.over(x - 1.5 * way, y)
    s.rapid(z=z + 2.0)
    s.feed(z=z, feed=FEED)
    ops = [s.feed(x=x + way * d, feed=DOWN), s.feed(x=x - 0.5 * way)]
    s.rapid(z=SAFE)
    return made("wall cut", part, s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def _along(s: Script, x: float, z: float, y0: float, y1: float) -> list[Op]:
    s.over(x, y0)
    s.rapid(z=z + 3.0)
    ops = [s.feed(z=z, feed=DOWN), s.feed(x, y1, z, FEED), s.feed(z=z + 3.0)]
    s.rapid(z=SAFE)
    return ops


def rib_top(rng: Rng) -> Case:
    """The top of the thin rib milled too low over its length."""
    tolerance, scale, d = scale_of(rng, RIB_HEIGHT / 2)
    s = base("rib")
    ops = _along(s, 12.0 + RIB / 2, 6.0 + RIB_HEIGHT - d, -OUT, OUT)
    return made("rib top", "rib", s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def rib_side(rng: Rng) -> Case:
    """One side of the rib milled too deep; what of it remains stands."""
    tolerance, scale, d = scale_of(rng, 0.9 * RIB)
    s = base("rib")
    left = rng.random() < 0.5
    x = 12.0 - R + d if left else 12.0 + RIB + R - d
    ops = _along(s, x, 6.0, -OUT, OUT)
    return made("rib side", "rib", s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def rib_off(rng: Rng) -> Case:
    """The whole rib milled off, at tolerances up to its thickness."""
    tolerance = float(rng.choice([0.01, 0.05, 0.25, 0.5]))
    s = base("rib")
    ops = _along(s, 12.0 + float(rng.uniform(-1.5, 2.0)), 6.0, -OUT, OUT)
    return made("rib off", "rib", s, ("gouge",), ops, RIB_HEIGHT, quality(tolerance), what=f"tolerance {tolerance}")


def rib_gap(rng: Rng) -> Case:
    """A gap through the rib: what was there has half its width, or its depth, to what remains."""
    tolerance = float(rng.choice([0.01, 0.05, 0.25, 0.5]))
    deep = float(rng.uniform(0.6, RIB_HEIGHT))
    s = base("rib")
    y = float(rng.uniform(-LOW, LOW))
    s.over(7.5, y)
    s.rapid(z=12.0)
    z = 6.0 + RIB_HEIGHT - deep
    s.feed(z=z, feed=FEED)
    ops = [s.feed(x=17.5, feed=DOWN)]
    s.feed(z=12.0)
    s.rapid(z=SAFE)
    return made("rib gap", "rib", s, ("gouge",), ops, min(deep, R), quality(tolerance),
                what=f"{deep:.3f} deep, tolerance {tolerance}")


def floor_dip(rng: Rng) -> Case:
    """The thin floor milled too deep, not through."""
    tolerance, scale, d = scale_of(rng, 0.85 * FLOOR)
    s = base("floor")
    x, y = float(rng.uniform(10.5, 15.5)), float(rng.uniform(-LOW, LOW))
    return made("floor dip", "floor", s, ("gouge",), dip(s, "floor", x, y, FLOOR - d), d, quality(tolerance),
                what=f"{scale} x {tolerance}")


def floor_through(rng: Rng) -> Case:
    """A hole through the thin floor: its radius counts."""
    tolerance = float(rng.choice([0.01, 0.05, 0.25, 0.5]))
    s = base("floor")
    x, y = float(rng.uniform(10.5, 15.5)), float(rng.uniform(-LOW + 1, LOW - 1))
    ops = dip(s, "floor", x, y, -float(rng.uniform(0.01, 1.0)))
    return made("floor through", "floor", s, ("gouge",), ops, R, quality(tolerance), what=f"tolerance {tolerance}")


def wedge_short(rng: Rng) -> Case:
    """The knife edge cut off square."""
    tolerance, scale, d = scale_of(rng, 4.0)
    s = base("wedge")
    s.tool(1)
    x = 26.0 - d + R
    ops = _along(s, x, -0.5, -OUT, OUT)
    return made("wedge short", "wedge", s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def wedge_shaved(rng: Rng) -> Case:
    """A row of the ball over the knife edge a little too low: the edge is shorter by far more than that."""
    tolerance, scale, d = scale_of(rng, 1.5)
    a = math.radians(WEDGE_DEG)
    low, high = 0.0, 0.8
    for _ in range(80):  # the row that leaves the edge d mm short
        mid = 0.5 * (low + high)
        cx, cz = 26.0 + (R - mid) * math.sin(a), (R - mid) * math.cos(a)
        short = 26.0 - (cx - math.sqrt(max(R * R - cz * cz, 0.0)))
        low, high = (mid, high) if short < d else (low, mid)
    s = base("wedge")
    tip = 26.0 + (R - mid) * math.sin(a), (R - mid) * math.cos(a) - R
    s.over(tip[0], -OUT)
    s.rapid(z=tip[1] + 2.0)
    s.feed(z=tip[1], feed=DOWN)
    ops = [s.feed(y=OUT, feed=FEED)]
    s.rapid(z=SAFE)
    return made("wedge shaved", "wedge", s, ("gouge",), ops, d, quality(tolerance),
                what=f"{mid:.4f} too low, {scale} x {tolerance}")


def allowance(rng: Rng) -> Case:
    """Stock that is to stay on the part is cut: all of it, or a pit in it."""
    tolerance, scale, d = scale_of(rng, 0.3)
    s = Script(group="base")
    keep = 0.3
    s.ops = PARTS["plate"].program().ops
    for op in s.ops:
        if op.z is not None and abs(op.z - 10.0) < 1e-9:
            op.z = 10.0 + keep
    s.group = "harm"
    x, y, _ = level("plate", rng)
    ops = dip(s, "plate", x, y, 10.0 + keep - d)
    setup = {"quality": {"gouge_tolerance_mm": tolerance, "stock_allowance_mm": keep}}
    return made("allowance", "plate", s, ("allowance",), ops, d, setup, what=f"{scale} x {tolerance}")


def excluded_face(rng: Rng) -> Case:
    """A pit in a face that is excluded, or that the setup does not ask."""
    part, (tolerance, scale, d) = choice(rng, "plate", "slope", "cylinder"), scale_of(rng)
    s = base(part)
    load(s, part, 2)
    if part == "plate":
        x, y, z = level(part, rng)
        ops = dip(s, part, x, y, z - d)
    else:
        p, n = contact(part, rng)
        ops = dip(s, part, *(p + (R - d) * n - [0.0, 0.0, R]).tolist())
    operations = {"exclude_faces": ["F5"]} if rng.random() < 0.5 else {"faces": ["F1"]}
    return made("excluded face", part, s, ("gouge",), ops, d, {**quality(tolerance), "operations": operations},
                what=f"{scale} x {tolerance} {operations}")


def excluded_face_finished(rng: Rng) -> Case:
    """A face that is to be left alone is brought to size."""
    part = choice(rng, "plate", "slope", "cylinder")
    operations = {"exclude_faces": ["F5"]}
    return made("excluded face finished", part, base(part), ("excluded_face",), None, None, {"operations": operations})


def side_cut(rng: Rng) -> Case:
    """An outer side that no one works on, cut from beside."""
    part, (tolerance, scale, d) = choice(rng, "plate", "step", "slot"), scale_of(rng)
    s = base(part)
    width, y = PARTS[part].size[2], float(rng.uniform(-LOW, LOW))
    z = float(rng.uniform(1.0, 3.0))
    s.over(width + R + 2.0, y)
    s.rapid(z=z)
    ops = [s.feed(x=width + R - d, feed=DOWN), s.feed(x=width + R + 1.0)]
    s.rapid(z=SAFE)
    return made("side cut", part, s, ("gouge",), ops, d, quality(tolerance), what=f"{scale} x {tolerance}")


def many_dips(rng: Rng) -> Case:
    """One pit too deep among hundreds that are within the tolerance."""
    tolerance = float(rng.choice([0.01, 0.05]))
    d = 1.2 * tolerance
    s = base("plate")
    load(s, "plate", 2)
    places = [(float(x), float(y)) for x in np.arange(4.0, 24.0, 1.0) for y in np.arange(-6.0, 6.01, 1.0)]
    bad = int(rng.integers(len(places)))
    ops: list[Op] = []
    s.over(*places[0])
    s.rapid(z=12.0)
    for k, (x, y) in enumerate(places):
        s.feed(x, y, 10.5, 2000.0)
        deep = s.feed(z=10.0 - (d if k == bad else 0.8 * tolerance))
        up = s.feed(z=10.5)
        if k == bad:
            ops = [deep, up]
    s.rapid(z=SAFE)
    return made("many dips", "plate", s, ("gouge",), ops, d, quality(tolerance), what=f"tolerance {tolerance}")


MECHANISMS = {"pit level": pit_level, "pit slope": pit_slope, "pit cylinder": pit_cylinder, "groove": groove,
              "needle": needle, "small ball": small_ball,
              "smooth dip": smooth_dip, "rim pit": rim_pit, "edge notch": edge_notch, "wall cut": wall_cut,
              "rib top": rib_top,
              "rib side": rib_side, "rib off": rib_off, "rib gap": rib_gap, "floor dip": floor_dip,
              "floor through": floor_through, "wedge short": wedge_short, "wedge shaved": wedge_shaved,
              "allowance": allowance, "excluded face": excluded_face,
              "excluded face finished": excluded_face_finished, "side cut": side_cut, "many dips": many_dips}
