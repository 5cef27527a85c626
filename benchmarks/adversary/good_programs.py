"""Good programs as shops and posts write them: none of them may be refused."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.adversary.adversary_case import ENDINGS, SAFE, Case, Op, Script, made, written
from benchmarks.adversary.adversary_parts import (
    BALL,
    DOWN,
    FEED,
    FLAT,
    HALF,
    OUT,
    PARTS,
    POCKET_FLOOR,
    POCKET_TOP,
    R,
    rows,
)
from benchmarks.adversary.harm_bodies import HIGH, _faced, _high_stock, _into_stock, _tools
from benchmarks.adversary.harm_surface import LEVELLED, base, choice, contact, dip, level, load

Rng = np.random.Generator
LEVELS = ("plate", "rib", "step", "slot", "floor")


def _machine(dialect: str, **more: Any) -> dict[str, Any]:
    return {"machine": {"dialects": [dialect], **more}}


def in_any_dialect(rng: Rng) -> Case:
    """The right program of a part, for one of the five controls."""
    part, dialect = choice(rng, *PARTS), choice(rng, *ENDINGS)
    return made("any dialect", part, PARTS[part].program(), setup=_machine(dialect), dialect=dialect, what=dialect)


def spring_pass(rng: Rng) -> Case:
    """The rows of the last level once more, after a lift."""
    part = choice(rng, *LEVELS[1:], "boss")
    s = PARTS[part].program()
    last = max(k for k, op in enumerate(s.ops[:-1]) if op.kind == "rapid" and op.z == SAFE)
    own = s.ops[last + 1:-1]
    low = min(op.z for op in own if op.z is not None)
    first = min(k for k, op in enumerate(own) if op.z == low)
    again = [Op(**vars(op)) for op in own[first:]]
    s.rapid(own[0].x, own[0].y)
    s.rapid(z=low)
    s.ops += again
    s.rapid(z=SAFE)
    return made("spring pass", part, s)


def spring_wall(rng: Rng) -> Case:
    """The pass along a finished wall once more, from a lift."""
    walls = [("step", 11.0, 4.0), ("slot", 11.0, 5.0), ("slot", 15.0, 5.0), ("rib", 9.0, 6.0)]
    part, x, z = walls[int(rng.integers(4))]
    s = base(part)
    s.over(x, -OUT - 1.0)
    s.rapid(z=z)
    for k in range(int(rng.integers(1, 3))):
        s.feed(x, -OUT if k % 2 else OUT, z, FEED)
    s.rapid(z=SAFE)
    return made("spring wall", part, s)


def lift_with_rounding(rng: Rng) -> Case:
    """A post rounds: the lift from a wall goes some micrometres aside."""
    part, x, z, wall = [("step", 11.0, 4.0, 1.0), ("slot", 11.0, 5.0, -1.0)][int(rng.integers(2))]
    aside = float(np.round(rng.uniform(0.0005, 0.004), 4)) * float(rng.choice([-1.0, 1.0]))
    s = base(part)
    y = float(rng.uniform(-5, 5))
    s.over(x - 1.5 * wall, y)
    s.rapid(z=z + 2.0)
    s.feed(z=z, feed=FEED)
    s.feed(x=x)
    s.rapid(x=x + aside, z=SAFE)
    return made("lift with rounding", part, s, what=f"{aside}")


def dwell(rng: Rng) -> Case:
    """Dwells in the air and after a spindle start."""
    part, dialect = choice(rng, *PARTS), choice(rng, "linuxcnc", "fanuc", "haas", "siemens")
    s = PARTS[part].program()
    word = {"linuxcnc": "G4 P0.5", "fanuc": "G4 P500", "haas": "G4 P500", "siemens": "G4 F0.5"}[dialect]
    s.ops.insert(1, Op("raw", text=word))
    s.ops.append(Op("raw", text=word))
    return made("dwell", part, s, setup=_machine(dialect), dialect=dialect, what=dialect)


def home_from_work(rng: Rng) -> Case:
    """G91 G28 Z0 straight from a wall or a floor, and G28 in three axes from above everything."""
    dialect, part = choice(rng, "fanuc", "haas", "linuxcnc"), choice(rng, "step", "slot", "plate")
    s = PARTS[part].program()
    dot = "" if dialect == "linuxcnc" else "."
    if rng.random() < 0.5:
        s.ops.pop()  # the last lift
        s.foot = [f"G91 G28 Z0{dot}", "G90", "M5", "M30", "%"]
    else:
        s.foot = ["M5", f"G91 G28 X0{dot} Y0{dot} Z0{dot}", "G90", "M30", "%"]
    return made("home from work", part, s, setup=_machine(dialect), dialect=dialect, what=dialect)


def home_between(rng: Rng) -> Case:
    """Home in Z between two levels, with the length counted again where the control drops it, and a limited speed."""
    dialect, part = choice(rng, "fanuc", "haas", "linuxcnc", "siemens"), choice(rng, "step", "slot", "boss", "rib")
    s = PARTS[part].program()
    lift = next(k for k, op in enumerate(s.ops) if k > 5 and op.kind == "rapid" and op.z == SAFE)
    lines = {"linuxcnc": ["G91 G28 Z0", "G90"], "siemens": ["SUPA G0 Z0 D0", "D1", "G25 S500"],
             "fanuc": [choice(rng, "G91 G28 Z0.", "G53 G0 Z0."), "G90", f"G0 G43 H1 Z{SAFE:g}."],
             "haas": ["G91 G28 Z0.", "G90", f"G0 G43 H1 Z{SAFE:g}."]}[dialect]
    s.ops[lift + 1:lift + 1] = [Op("raw", text=line) for line in lines]
    return made("home between", part, s, setup=_machine(dialect), dialect=dialect, what=dialect)


def no_length_moves(rng: Rng) -> Case:
    """Moves to where the tool stands, feeds and rapids, anywhere."""
    part = choice(rng, *PARTS)
    s = PARTS[part].program()
    for _ in range(int(rng.integers(1, 5))):
        k = int(rng.integers(6, len(s.ops)))
        here: list[float | None] = [None, None, None]
        for op in s.ops[:k]:
            if op.kind in ("rapid", "feed", "arc"):
                here = [v if v is not None else h for v, h in zip((op.x, op.y, op.z), here, strict=True)]
        kind = s.ops[k - 1].kind
        s.ops.insert(k, Op("rapid" if kind == "rapid" or rng.random() < 0.3 else "feed", *here))
    return made("moves of no length", part, s)


def helix_entry(rng: Rng) -> Case:
    """The pocket entered by helices of less than three degrees in place of ramps, by mills of both kinds."""
    s = Script(group="good")
    right = PARTS["pocket"].program()
    first = next(k for k, op in enumerate(right.ops) if op.kind == "rapid" and op.x == -4.0)
    s.ops = right.ops[:first]
    radius = float(rng.uniform(1.2, 2.2))
    s.rapid(radius, 0.0)
    s.rapid(z=POCKET_TOP + 1.5)
    z = POCKET_TOP + 0.1
    s.feed(z=z, feed=DOWN)
    pitch = 2 * np.pi * radius * np.tan(np.radians(float(rng.uniform(1.5, 2.7))))
    while z > POCKET_FLOOR + 1e-9:
        z = max(z - 0.5 * pitch, POCKET_FLOOR)
        s.arc(-radius, 0.0, (0.0, 0.0), z=z)
        z = max(z - 0.5 * pitch, POCKET_FLOOR)
        s.arc(radius, 0.0, (0.0, 0.0), z=z)
    s.arc(-radius, 0.0, (0.0, 0.0))
    s.arc(radius, 0.0, (0.0, 0.0))
    s.rapid(z=SAFE)
    s.ops += right.ops[first:]
    hollow = rng.random() < 0.5  # no core is left: the radius is more than 0.15 D
    return made("helix entry", "pocket", s, setup=_tools(center_cutting=False) if hollow else None,
                what=f"radius {radius:.2f}, {'no ' if hollow else ''}centre")


def other_order(rng: Rng) -> Case:
    """The levels of a part in another order, and rows from the other side."""
    part = choice(rng, "rib", "slot", "step")
    s = PARTS[part].program()
    for op in s.ops:
        if op.y is not None:
            op.y = -op.y
    if part == "rib":
        lifts = [k for k, op in enumerate(s.ops) if op.kind == "rapid" and op.z == SAFE]
        a, b, c = lifts[1], lifts[2], lifts[3]
        s.ops = [*s.ops[:a], *s.ops[b:c], *s.ops[a:b], *s.ops[c:]]
    return made("other order", part, s)


def within_tolerance(rng: Rng) -> Case:
    """Dips of half to 0.9 of the gouge tolerance."""
    part = choice(rng, *LEVELLED, "slope", "cylinder")
    tolerance = float(rng.choice([0.01, 0.05, 0.25]))
    d = tolerance * float(rng.uniform(0.4, 0.9))
    s = base(part)
    load(s, part, 2)
    if part in LEVELLED:
        x, y, z = level(part, rng)
        dip(s, part, x, y, z - d)
    else:
        p, n = contact(part, rng)
        dip(s, part, *(p + (R - d) * n - [0.0, 0.0, R]).tolist())
    return made("within tolerance", part, s, setup={"quality": {"gouge_tolerance_mm": tolerance}},
                what=f"{d / tolerance:.2f} x {tolerance}")


def everything_stated(rng: Rng) -> Case:
    """Clamps, table, limits and coolant stated, and kept."""
    part = choice(rng, *LEVELS)
    width, top = PARTS[part].size[2], PARTS[part].top
    s = PARTS[part].program()
    s.ops.insert(1, Op("raw", text="M8"))
    box = [[width + R + 3.0, -HALF, -5.0], [width + 20.0, HALF, top]]
    setup = {"fixtures": [{"box_mm": box}], "machine": {"table_z_mm": -10.0, "max_rpm": 12000.0,
                                                        "max_feed_mm_min": 3000.0}}
    return made("everything stated", part, s, setup=setup)


def both_m_words(rng: Rng) -> Case:
    """M3 with M8 on one line, N words, comments, lower case, spaces and Windows line ends."""
    part, dialect = choice(rng, *PARTS), choice(rng, "linuxcnc", "fanuc", "haas")
    style = choice(rng, "together", "numbered", "comments", "lower case", "line ends", "byte order mark", "empty lines")
    if style == "together" and dialect == "haas":
        dialect = "fanuc"  # a Haas takes one M word in a block
    text, _ = written(PARTS[part].program(), dialect)
    lines = text.splitlines()
    if style == "together":
        lines = [line.replace(" M3", " M3 M8") if line.startswith("S") else line for line in lines]
    elif style == "numbered":
        lines = [f"N{10 * k} {line}" if line[0] not in "%O" else line for k, line in enumerate(lines, 1)]
    elif style == "comments":
        lines = [f"{line} (row {k})" if line[0] not in "%O" else line for k, line in enumerate(lines, 1)]
    elif style == "lower case":
        lines = [line if line.startswith("O") else line.lower() for line in lines]
    elif style == "empty lines":
        lines = [x for line in lines for x in ((line, "") if rng.random() < 0.2 and line != "%" else (line,))]
    text = ("\r\n" if style == "line ends" else "\n").join(lines) + "\n"
    if style == "byte order mark":
        text = "\ufeff" + text
    case = made("ways of writing", part, Script(), setup=_machine(dialect), dialect=dialect, what=f"{style}, {dialect}")
    return Case(case.mechanism, part, case.setup, text, dialect, case.expected, case.what)


def run_again(rng: Rng) -> Case:
    """Programs that begin again by M99, or write tables at their beginning and end."""
    part, dialect = choice(rng, *PARTS), choice(rng, "fanuc", "haas")
    style = choice(rng, "loop", "loop in G91", "wear", "zero", "lengths")
    s = PARTS[part].program()
    end = ["M5", "G91 G28 Z0.", "G90", "M30", "%"]
    s.foot = {"loop": [*end[:3], "M99", "%"], "loop in G91": [*end[:2], "M99", "%"],
              "wear": [*end[:3], "G10 L11 P1 R-0.3", *end[3:]],
              "zero": [*end[:3], "G10 L2 P1 X1.", *end[3:]], "lengths": end}[style]
    first = {"wear": ["G10 L11 P1 R0."], "zero": ["G10 L2 P1 X0. Y0. Z0."],
             "lengths": ["G10 L10 P1 R80.1", "G10 L10 P2 R95."]}.get(style, [])
    s.ops[:0] = [Op("raw", text=line) for line in first]
    setup = _machine(dialect)
    if style == "lengths":
        setup["tools"] = [{**FLAT, "gauge_length_mm": 80.0}, {**BALL, "gauge_length_mm": 95.2}]
    return made("runs again", part, s, setup=setup, dialect=dialect, what=f"{style}, {dialect}")


def incremental(rng: Rng) -> Case:
    """A row in G91."""
    part = choice(rng, *LEVELS)
    s = base(part)
    z = PARTS[part].top
    s.over(2.0, -OUT)
    s.rapid(z=z + 1.5)
    s.feed(z=z, feed=FEED)
    s.raw("G91")
    s.feed(y=2 * OUT)
    s.feed(z=2.0)
    s.raw("G90")
    s.rapid(z=SAFE)
    return made("incremental row", part, s)


def modal_words(rng: Rng) -> Case:
    """Words that stay are left out, as most posts do."""
    part, dialect = choice(rng, *PARTS), choice(rng, "linuxcnc", "fanuc", "haas", "siemens")
    text, _ = written(PARTS[part].program(), dialect)
    out, word = [], ""
    for line in text.splitlines():
        head, _, tail = line.partition(" ")
        if head in ("G0", "G1") and tail[:1] in "XYZ":
            out.append(tail if head == word else line)
            word = head
        else:
            out.append(line)
            word = head if head in ("G2", "G3") else ""
    case = made("modal words", part, Script(), setup=_machine(dialect), dialect=dialect, what=dialect)
    return Case(case.mechanism, part, case.setup, "\n".join(out) + "\n", dialect, case.expected, case.what)


def split_moves(rng: Rng) -> Case:
    """Every feed move in pieces, as a post of splines writes them."""
    part, pieces = choice(rng, "plate", "step", "slot", "rib"), int(rng.integers(5, 30))
    right = PARTS[part].program()
    s = Script(group="good")
    here = np.zeros(3)
    for op in right.ops:
        there = np.array([h if v is None else v for v, h in zip((op.x, op.y, op.z), here, strict=True)])
        if op.kind == "feed" and np.linalg.norm(there - here) > 5.0:
            for k in range(1, pieces + 1):
                s.feed(*np.round(here + (there - here) * k / pieces, 4).tolist(), feed=op.feed)
        else:
            s.add(op)
        if op.kind in ("feed", "rapid", "arc"):
            here = there
    return made("split moves", part, s, what=f"{pieces} pieces")


def gentle_ramp(rng: Rng) -> Case:
    """Ramps into high stock within the angle of the material."""
    material, most = ("AlMgSi1 6082", 9.0) if rng.random() < 0.6 else ("Ti-6Al-4V", 2.8)
    angle = float(rng.uniform(0.5 * most, most))
    s = Script(group="good")
    x, y, top = _into_stock(s, rng)
    s.feed(6.0, y)
    z, side = top, True
    while z > top - 1.0:
        z -= 16.0 * float(np.tan(np.radians(angle)))
        z = max(z, top - 1.0)
        s.feed(22.0 if side else 6.0, y, z, 200.0)
        side = not side
    s.feed(22.0 if side else 6.0, y, z)
    _faced(s)
    return made("gentle ramp", "plate", s, setup={**_high_stock(), "material": material},
                what=f"{angle:.1f} deg in {material}")


def shallow_step_down(rng: Rng) -> Case:
    """Straight down by less than a tenth of the diameter, by a mill that cuts to its centre."""
    s = Script(group="good")
    x, y, top = _into_stock(s, rng)
    s.feed(z=top - float(rng.uniform(0.1, 0.5)), feed=100.0)
    s.feed(x=x + 3.0, feed=200.0)
    _faced(s)
    return made("shallow step down", "plate", s, setup=_high_stock(), what=f"of {HIGH} mm")


def finer_rows(rng: Rng) -> Case:
    """Level faces once more by narrower rows, in the other direction of travel."""
    part = choice(rng, "plate", "step")
    s = base(part)
    top = PARTS[part].top
    a, b = (1.0, 27.0) if part == "plate" else (18.0, 25.0)
    s.over(b, -OUT - 1.0)
    s.rapid(z=top + 1.5)
    s.feed(b, -OUT, top, FEED)
    rows(s, np.linspace(b, a, int(rng.integers(8, 20))).tolist(), top)
    s.rapid(z=SAFE)
    return made("finer rows", part, s)


def second_tool(rng: Rng) -> Case:
    """A change to a longer tool with the spindle home, its length counted, and a touch of the top with it."""
    long = {**FLAT, "id": "T2", "number": 2, "stickout_mm": 40.0 + float(rng.uniform(5, 40))}
    s = base("plate")
    s.tool(2)
    s.rapid(2.0, -OUT)
    s.rapid(z=SAFE)
    s.rapid(z=PARTS["plate"].top + 1.5)
    s.feed(z=PARTS["plate"].top, feed=FEED)
    s.feed(y=OUT)
    s.rapid(z=SAFE)
    return made("second tool", "plate", s, setup={"tools": [FLAT, long]})


def allowance_kept(rng: Rng) -> Case:
    """Stock that is to stay does stay."""
    keep = float(np.round(rng.uniform(0.1, 0.4), 3))
    s = PARTS["plate"].program()
    for op in s.ops:
        if op.z is not None and abs(op.z - 10.0) < 1e-9:
            op.z = 10.0 + keep
    return made("allowance kept", "plate", s, setup={"quality": {"stock_allowance_mm": keep}}, what=f"{keep}")


MECHANISMS = {"any dialect": in_any_dialect, "spring pass": spring_pass, "spring wall": spring_wall,
              "lift with rounding": lift_with_rounding, "dwell": dwell, "home from work": home_from_work,
              "home between": home_between,
              "moves of no length": no_length_moves, "helix entry": helix_entry, "other order": other_order,
              "within tolerance": within_tolerance, "everything stated": everything_stated,
              "ways of writing": both_m_words, "incremental row": incremental, "modal words": modal_words,
              "split moves": split_moves, "gentle ramp": gentle_ramp, "shallow step down": shallow_step_down,
              "finer rows": finer_rows, "second tool": second_tool, "allowance kept": allowance_kept,
              "runs again": run_again}
