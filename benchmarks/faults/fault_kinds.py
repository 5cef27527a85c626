"""The twenty kinds of planted faults: each takes a clean case and gives a faulty one with what must be found.

A kind returns ``Planted``, or raises ``Redraw`` where this draw does nothing that counts (a pass moved where nobody
looks). Lines, depths and zones that must be found come from the twin.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.fault_case import Case, Mode, Step, place_words, to_joints, tool_axis
from benchmarks.faults.fault_reading import Way, read_way
from benchmarks.faults.fault_twin import Found, Twin, in_blank
from geometry.mesh import F64
from geometry.tool_body import ToolBody

LEAST = 0.006  # mm, a gouge that must be found; the tolerance of the cases is 0.004
MIN_LEFT = 0.012  # mm, the same for what is left; 0.008 is allowed
REFUSED = "refused"


class Redraw(Exception):
    """This draw is no fault that anybody could find, or not one of its kind; the message says why."""


@dataclass(frozen=True, eq=False)
class Planted:
    """A faulty case and what must be found in it.

    kinds : of findings, any of them; REFUSED is a program that is not read
    lines : any of these, or None where no line is to blame; zone : that must be named, or None
    depth : mm, or None; word : in the message
    """

    case: Case
    kinds: tuple[str, ...]
    lines: frozenset[int] | None
    depth: float | None = None
    zone: str | None = None
    word: str = ""


def twin_of(case: Case) -> Twin:
    """The twin of a case as it stands."""
    return Twin(case, read_way(case.text))


def _edit(case: Case, row: int, *lines: str) -> Case:
    """The case with one line replaced by others."""
    return replace(case, lines=(*case.lines[:row], *lines, *case.lines[row + 1:]))


def _gouged(case: Case, found: Found) -> Planted:
    if found.depth < LEAST:
        raise Redraw(f"no gouge of {LEAST} mm comes of it")
    return Planted(case, ("gouge",), found.lines, found.depth)


def _pick(rng: np.random.Generator, steps: list[Step]) -> Step:
    if not steps:
        raise Redraw("no such line in the program")
    return steps[int(rng.integers(len(steps)))]


def _after(case: Case, step: Step) -> Step | None:
    later = [s for s in case.steps if s.row > step.row]
    return later[0] if later else None


def _finishing(case: Case) -> list[Step]:
    """Straight feed steps on a finished surface whose next step is straight, too."""
    out = []
    for s, then in zip(case.steps, case.steps[1:], strict=False):
        if s.normal is not None and not s.arc and not s.rapid and not then.arc and not then.rapid:
            out.append(s)
    return out


def gouge(case: Case, rng: np.random.Generator) -> Planted:
    """One point of a finishing pass 0.01 mm too deep."""
    step = _pick(rng, _finishing(case))
    assert step.normal is not None
    then, dip = _after(case, step), 0.01
    for _ in range(2):  # what a scallop had left there comes on top
        bad = _edit(case, step.row, f"G1 {place_words(case.mode, step.tip - dip * step.normal, step.turn)}")
        found = twin_of(bad).gouge({step.row + 1, then.row + 1 if then else 0})
        dip += 0.01 - max(found.depth, 0.0)
    return _gouged(bad, found)


def _rotary(case: Case, rng: np.random.Generator, change: Callable[[float, float], tuple[float, float]]) -> Planted:
    """Other angles in one line of a finishing pass."""
    step = _pick(rng, [s for s in _finishing(case) if s.turn is not None])
    assert step.turn is not None
    a, c = change(*step.turn)
    bad = _edit(case, step.row, re.sub(r"A\S+ C\S+", f"A{a:.4f} C{c:.4f}", case.lines[step.row]))
    then = _after(case, step)
    return _gouged(bad, twin_of(bad).gouge({step.row + 1, then.row + 1 if then else 0}))


def _stray_word(case: Case, rng: np.random.Generator, word: str) -> Planted:
    """A rotary word on a machine that has no such axis."""
    step = _pick(rng, [s for s in case.steps if not s.rapid])
    return Planted(_edit(case, step.row, f"{case.lines[step.row]} {word}"), (REFUSED,), frozenset([step.row + 1]))


def tilted_axis(case: Case, rng: np.random.Generator) -> Planted:
    """A out by half a degree in one line; without rotary axes a word that must be refused."""
    by = 0.5 if rng.random() < 0.5 else -0.5
    if case.mode == Mode.UPRIGHT:
        return _stray_word(case, rng, f"A{by}")
    return _rotary(case, rng, lambda a, c: (a + by, c))


def sign_of_c(case: Case, rng: np.random.Generator) -> Planted:
    """C mirrored in one line; without rotary axes a word that must be refused."""
    if case.mode == Mode.UPRIGHT:
        return _stray_word(case, rng, f"C-{rng.uniform(5, 90):.3f}")
    return _rotary(case, rng, lambda a, c: (a, c - 2.0 * ((c + 180.0) % 360.0 - 180.0)))


def wrong_tool(case: Case, rng: np.random.Generator) -> Planted:
    """Another diameter in the tool table than the program was made for."""
    body = case.tools[int(rng.integers(len(case.tools)))]
    wide = body.diameter + float(rng.uniform(0.2, 2.0))
    corner = 0.5 * wide if body.kind == "ball" else body.corner_radius
    other = replace(body, diameter=wide, corner_radius=corner, flute_length=max(body.flute_length, corner))
    bad = replace(case, tools=tuple(other if t is body else t for t in case.tools))
    return _gouged(bad, twin_of(bad).gouge(tool=body.number))


def length_offset(case: Case, rng: np.random.Generator) -> Planted:
    """The length offset of the other tool."""
    rows = [k for k, line in enumerate(case.lines) if re.match(r"G43(\.4)? H", line)]
    row = rows[int(rng.integers(len(rows)))]
    word, number = case.lines[row].split(" H")
    return Planted(_edit(case, row, f"{word} H{3 - int(number)}"), ("program",), frozenset([row + 1]), word="offset")


def _bad_arc(bad: Case, line: int) -> Planted:
    way = read_way(bad.text)
    if line in way.refused:
        return Planted(bad, (REFUSED,), frozenset([line]))
    return _gouged(bad, Twin(bad, way).gouge({line}))


def swapped_ij(case: Case, rng: np.random.Generator) -> Planted:
    """I and J of one arc exchanged."""
    step = _pick(rng, [s for s in case.steps if s.arc])
    line = case.lines[step.row]
    i, j = re.search(r"I(\S+)", line)[1], re.search(r"J(\S+)", line)[1]  # type: ignore[index]
    if i == j:
        raise Redraw("I and J are the same")
    return _bad_arc(_edit(case, step.row, re.sub(r"I\S+ J\S+", f"I{j} J{i}", line)), step.row + 1)


def arc_plane(case: Case, rng: np.random.Generator) -> Planted:
    """An arc of the XY plane in another plane."""
    step = _pick(rng, [s for s in case.steps if s.arc])
    plane = "G18" if rng.random() < 0.5 else "G19"
    then = _after(case, step)
    assert then is not None
    bad = _edit(_edit(case, then.row, f"G17 {case.lines[then.row]}"), step.row, f"{plane} {case.lines[step.row]}")
    return _bad_arc(bad, step.row + 1)


def missing_retract(case: Case, rng: np.random.Generator) -> Planted:
    """A rapid aside where the tool should have been lifted first."""
    lifts = []
    for was, s in zip(case.steps, case.steps[1:], strict=False):
        axis = tool_axis(np.radians([s.turn or (0.0, 0.0)]))[0]
        if s.rapid and not was.rapid and was.tool == s.tool and (s.tip - was.tip) @ axis > 0.99 * np.linalg.norm(
                s.tip - was.tip):
            lifts.append((was, s, axis))
    was, step, axis = lifts[int(rng.integers(len(lifts)))]
    way = np.cross(axis, rng.normal(size=3))
    tip = was.tip + 14.0 * way / np.linalg.norm(way)
    bad = _edit(case, step.row, f"G0 {place_words(case.mode, tip, step.turn)}")
    found = twin_of(bad).rapid(step.row + 1)
    if found.depth < 0.3:
        raise Redraw("the way goes through air")
    return Planted(bad, ("rapid",), found.lines, found.depth, word="cutting part")


def _touching(case: Case, rng: np.random.Generator, part: str, make: Callable[[ToolBody], ToolBody]) -> Planted:
    """The last tool with another shank or holder, such that it comes into part or fixture."""
    body = case.tools[-1]
    for _ in range(6):
        other = make(body)
        bad = replace(case, tools=(*case.tools[:-1], other))
        found = twin_of(bad).body(part, body.number)
        if found.depth > 0.02:
            return Planted(bad, ("collision",), found.lines, found.depth, word=part)
    raise Redraw(f"no {part} of six touches anything")


def shank_touch(case: Case, rng: np.random.Generator) -> Planted:
    """A shank that is too wide or begins too low."""
    return _touching(case, rng, "shank", lambda t: replace(
        t, shank_diameter=t.diameter + float(rng.uniform(1.0, 14.0)),
        neck_length=t.flute_length + float(rng.uniform(0.2, 1.5))))


def holder_touch(case: Case, rng: np.random.Generator) -> Planted:
    """A tool clamped too short."""
    def make(t: ToolBody) -> ToolBody:
        nose = t.flute_length + float(rng.uniform(0.3, 5.0))
        return replace(t, neck_length=min(t.neck_length, nose), shank_diameter=t.neck_diameter, stickout=nose)

    return _touching(case, rng, "holder", make)


def clamp_hit(case: Case, rng: np.random.Generator) -> Planted:
    """A clamp that stands in the way of the cutting part."""
    step = _pick(rng, [s for s in case.steps if not s.rapid])
    body = case.tools[step.tool - 1]
    axis, side = int(rng.integers(2)), float(rng.choice([-1.0, 1.0]))
    near = step.tip[axis] + side * (body.radius - float(rng.uniform(0.1, 1.0)))
    box = np.array([step.tip - 2.0, step.tip + 2.0])
    box[:, axis] = sorted((near, near + 6.0 * side))
    box[:, 2] = case.part.mesh.bounds[0, 2], step.tip[2] + float(rng.uniform(0.3, 0.6)) * body.flute_length
    bad = replace(case, setup=replace(case.setup, fixtures=(*case.setup.fixtures[1:], box)))
    found = twin_of(bad).cutter_on_fixtures(step.tool)
    if found.depth < 0.02:
        raise Redraw("the clamp is not touched")
    return Planted(bad, ("collision",), found.lines, found.depth, word="cutting part enters a fixture")


def _at_start(case: Case, *lines: str) -> tuple[Case, int]:
    """The case with lines put in before the first cut, and the number of the first of them."""
    row = case.steps[0].row + 1
    return _edit(case, row, case.lines[row], *lines), row + 2


def rapid_in_stock(case: Case, rng: np.random.Generator) -> Planted:
    """A rapid over the blank a little below its top."""
    z, (a, b) = case.blank_top - float(rng.uniform(0.1, 0.5)), case.across.tolist()
    bad, first = _at_start(case, f"G0 X{a[0]:.4f} Y{a[1]:.4f}", f"G0 Z{z:.4f}", f"G0 X{b[0]:.4f} Y{b[1]:.4f}",
                           f"G0 Z{case.safe:.4f}")
    found = twin_of(bad).rapid(first + 2)
    return Planted(bad, ("rapid",), found.lines, found.depth, word="cutting part")


def feed_plunge(case: Case, rng: np.random.Generator) -> Planted:
    """A feed straight down into the blank."""
    x, y, top, deep = case.room
    z = top - float(rng.uniform(0.75, 0.95 * deep))
    bad, first = _at_start(case, f"G0 X{x:.4f} Y{y:.4f}", f"G0 Z{top + 1.5:.4f}", f"G1 Z{z:.4f}",
                           f"G0 Z{case.safe:.4f}")
    line = np.column_stack([np.full(4000, x), np.full(4000, y), np.linspace(z, top + 1.0, 4000)])
    return Planted(bad, ("plunge",), frozenset([first + 2]), float(line[in_blank(line, case.setup), 2].max() - z))


def inch_for_mm(case: Case, rng: np.random.Generator) -> Planted:
    """G20 where the numbers are mm."""
    bad = _edit(case, 1, case.lines[1].replace("G21", "G20"))
    way = read_way(bad.text)
    far = np.abs(way.end[:, :3]).max(axis=1) > 100.0
    return Planted(bad, ("limit",), frozenset(way.line[far].tolist()))


def lost_point(case: Case, rng: np.random.Generator) -> Planted:
    """A decimal point left out."""
    step = _pick(rng, [s for s in case.steps if not s.rapid and not s.arc])
    word = "XYZ"[int(rng.integers(3))]
    bad = _edit(case, step.row, re.sub(rf"({word}-?\d+)\.", r"\1", case.lines[step.row]))
    then = _after(case, step)
    if then is None or then.arc:
        raise Redraw("an arc follows, which would be refused")  # and rightly
    over = np.ptp(_slides(read_way(bad.text)), axis=0) - 200.0
    axis = int(np.argmax(over))
    if over[axis] < 1.0:
        raise Redraw("the travel is not exceeded")
    return Planted(bad, ("limit",), frozenset([step.row + 1]), float(over[axis]), word=f"in {'XYZ'[axis]}")


def _slides(way: Way) -> F64:
    """(n, 3) mm, where the linear axes are along all moves."""
    share = np.linspace(0.0, 1.0, 65)[:, None, None]
    at = (way.start + share * (way.end - way.start)).reshape(-1, 5)
    centre = np.tile(way.centre, len(share))
    at = at[keep := ~np.isnan(at).any(axis=1)]
    return np.where(centre[keep, None], to_joints(at[:, :3], np.radians(at[:, 3:])), at[:, :3])


def _near(case: Case, zone: str, steps: list[Step]) -> NDArray[np.int64]:
    """(n,) the rows of the samples of a zone within 4 mm of some steps."""
    s, own = case.scored.samples, case.scored.zone == case.zones.index(zone) + 1
    at = np.array([p.tip for p in steps])
    path = np.vstack([a + np.linspace(0, 1, 30)[:, None] * (b - a) for a, b in zip(at[:-1], at[1:], strict=True)])
    rows = np.flatnonzero(own)
    path = path[::max(1, len(path) // 300)]
    gap = np.min([np.linalg.norm(s.points[rows] - p, axis=1) for p in path], axis=0)
    return rows[gap < 4.0]


def _run(case: Case, rng: np.random.Generator) -> tuple[str, list[Step]]:
    """A finishing pass: its zone and feed steps."""
    if not case.runs:
        raise Redraw("no finishing passes")
    k = int(rng.integers(len(case.runs)))
    return case.runs[k], [s for s in case.steps if s.run == k and not s.rapid]


def _left(bad: Case, zone: str, steps: list[Step]) -> Planted:
    twin, s, rows = twin_of(bad), bad.scored.samples, _near(bad, zone, steps)
    if len(rows) == 0:
        raise Redraw("nobody looks there")
    few = rows[::max(1, len(rows) // 900)]
    left = twin.left(s.points[few], s.normals[few])
    deep = s.points[few[np.argsort(-left)[:20]]]
    close = rows[(np.linalg.norm(s.points[rows][:, None] - deep, axis=2) < 0.4).any(axis=1)]
    most = max(float(left.max()), float(twin.left(s.points[close], s.normals[close]).max()))
    if most < MIN_LEFT:
        raise Redraw(f"no {MIN_LEFT} mm are left by it")
    return Planted(bad, ("residual",), None, most, zone)


def without(case: Case, steps: list[Step]) -> Case:
    """The case without the lines of some steps; Redraw where the way past the gap would gouge."""
    gone = {s.row for s in steps}
    bad = replace(case, lines=tuple(line for k, line in enumerate(case.lines) if k not in gone))
    way = read_way(bad.text)
    joined = {row + 1 - sum(g < row for g in gone) for row in {s.row for s in case.steps} - gone
              if row - 1 in gone or row - 2 in gone}
    if way.refused or Twin(bad, way).gouge(joined).depth > 0.003:
        raise Redraw("the way past the gap would gouge")
    return bad


def missing_pass(case: Case, rng: np.random.Generator) -> Planted:
    """One finishing pass left out."""
    zone, steps = _run(case, rng)
    return _left(without(case, steps), zone, steps)


def shifted_pass(case: Case, rng: np.random.Generator) -> Planted:
    """One finishing pass moved aside."""
    zone, steps = _run(case, rng)
    angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 0.4)
    by = far * np.array([np.cos(angle), np.sin(angle), 0.0])
    lines = list(case.lines)
    for s in steps:
        word, tail = lines[s.row].split()[0], re.search(r" I.*", lines[s.row])
        lines[s.row] = f"{word} {place_words(case.mode, s.tip + by, s.turn)}{tail[0] if tail else ''}"
    bad = replace(case, lines=tuple(lines))
    then = _after(case, steps[-1])
    found = twin_of(bad).gouge({s.row + 1 for s in steps} | ({then.row + 1} if then else set()))
    if found.depth >= LEAST:
        return _gouged(bad, found)
    if found.depth > 0.003:
        raise Redraw("neither gouge nor clean")
    return _left(bad, zone, steps)


def duplicated_zone(case: Case, rng: np.random.Generator) -> Planted:
    """What is cut between two visits to the safe height, cut twice."""
    tops = [k for k, s in enumerate(case.steps) if abs(s.tip[2] - case.safe) < 1e-6 and s.rapid]
    spans = [(a, b) for a, b in zip(tops[:-1], tops[1:], strict=True)
             if case.steps[a].tool == case.steps[b].tool and any(s.run >= 0 for s in case.steps[a + 1:b])]
    if not spans:
        raise Redraw("nothing is cut between two visits to the safe height")
    a, b = spans[int(rng.integers(len(spans)))]
    rows = [s.row for s in case.steps[a + 1:b + 1]]
    last = rows[-1]
    feeds = [k for k, s in enumerate(case.steps[a + 1:b + 1]) if not s.rapid]
    bad = _edit(case, last, case.lines[last], *(case.lines[r] for r in rows))
    return Planted(bad, ("program",), frozenset(range(last + 2, last + 3 + feeds[min(1, len(feeds) - 1)])))


def tool_change(case: Case, rng: np.random.Generator) -> Planted:
    """The next tool number at a tool change, with its own length offset or that of the tool meant."""
    number = int(rng.integers(1, len(case.tools) + 1))
    row = case.lines.index(f"T{number} M6")
    bad = _edit(case, row, f"T{number + 1} M6")
    if number == len(case.tools):
        return Planted(bad, (REFUSED,), frozenset([row + 1]))
    if rng.random() < 0.5:
        return Planted(bad, ("program",), frozenset([row + 3]), word="offset")
    bad = _edit(bad, row + 2, bad.lines[row + 2].replace(f"H{number}", f"H{number + 1}"))
    following = {s.row + 1 for s in case.steps if s.tool == number}
    return _gouged(bad, twin_of(bad).gouge(following, tool=number + 1))


def truncated(case: Case, rng: np.random.Generator) -> Planted:
    """The end of the file is missing."""
    first = case.steps[0].row + 3
    k = int(rng.integers(first, case.steps[-1].row))
    part = case.lines[k][:int(rng.integers(0, len(case.lines[k])))]
    return Planted(replace(case, lines=(*case.lines[:k], part)), (REFUSED,), frozenset([k, k + 1, k + 2]))


KINDS: dict[str, Callable[[Case, np.random.Generator], Planted]] = {
    "gouge 0.01": gouge, "tilted axis": tilted_axis, "wrong tool": wrong_tool, "length offset": length_offset,
    "swapped I J": swapped_ij, "missing retract": missing_retract, "shank touch": shank_touch,
    "holder touch": holder_touch, "clamp hit": clamp_hit, "rapid in stock": rapid_in_stock, "sign of C": sign_of_c,
    "inch for mm": inch_for_mm, "missing pass": missing_pass, "shifted pass": shifted_pass,
    "feed plunge": feed_plunge, "arc plane": arc_plane, "duplicated zone": duplicated_zone,
    "tool change": tool_change, "lost point": lost_point, "truncated": truncated}
