"""Scale drawing of a tool assembly, as shapes on paper that a web page and a PDF draw alike.

The left view is the whole assembly in the spindle, tip down, with diameters on its left and heights above the tip on
its
right. Where the tip would be too small to read, a larger view is beside it. Both scales are standard ones and hold on
paper: the unit of the drawing is a mm of paper.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from geometry.tool_body import ToolBody
from output.header_text import decimal

WIDTH, HEIGHT = 118.0, 88.0  # mm of paper
FLOOR, CEILING = 80.0, 5.0  # height of the tip, and upper end of the assembly
MIDDLE, TIP_MIDDLE = 38.0, 97.0  # of the assembly and of the larger tip
ASSEMBLY_ROOM, TIP_ROOM = (32.0, FLOOR - CEILING), (24.0, 46.0)  # width, height
MIN_TIP_WIDTH = 10.0  # mm of paper; a narrower cutting part is also drawn larger
MAX_LABELS = 16
CHORDS = 18  # of a round corner
APART, LETTER = 4.2, 2.9  # mm between labels; height of letters
SCALES = (50.0, 20.0, 10.0, 5.0, 2.0, 1.0, 1 / 2, 1 / 5, 1 / 10, 1 / 20, 1 / 50, 1 / 100)

Point = tuple[float, float]


@dataclass(frozen=True)
class FilledOutline:
    """A filled outline, y down, mm. part : 'flutes', 'neck', 'shank' or 'holder'; view : 'assembly' or 'tip'."""

    part: str
    view: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class DrawnLine:
    """A line. kind : 'measure', 'axis' or 'spindle'."""

    kind: str
    points: tuple[Point, ...]


@dataclass(frozen=True)
class DrawnText:
    """Text on a base line; anchor : 'start', 'middle' or 'end'."""

    text: str
    at: Point
    anchor: str = "start"


@dataclass(frozen=True)
class ToolDrawing:
    """The drawing of one tool, ``WIDTH`` by ``HEIGHT`` mm of paper; scales are mm of paper per mm of tool."""

    title: str
    scale: float
    tip_scale: float | None
    areas: tuple[FilledOutline, ...]
    strokes: tuple[DrawnLine, ...]
    words: tuple[DrawnText, ...]


def draw_tool(body: ToolBody, gauge: float) -> ToolDrawing:
    """The drawing of an assembly whose spindle face is ``gauge`` mm above the tip."""
    top = max(gauge, body.stickout + sum(h.length for h in body.holder))
    widest = max([2.0 * body.widest_radius, body.shank_diameter,
                  *(max(h.diameter, h.diameter_top) for h in body.holder)])
    scale = _scale(ASSEMBLY_ROOM, widest, top)
    outlines = _outlines(body)
    areas = [_placed(part, "assembly", points, MIDDLE, scale) for part, points in outlines]
    reach = FLOOR - scale * top
    strokes = [DrawnLine("axis", ((MIDDLE, FLOOR + 2.0), (MIDDLE, reach - 2.0)))]
    words = [DrawnText(f"assembly {_ratio(scale)}", (MIDDLE, HEIGHT - 1.5), "middle")]
    edge = 0.5 * scale * widest
    if gauge > 0.0:
        y = FLOOR - scale * gauge
        strokes.append(DrawnLine("spindle", ((MIDDLE - edge - 2.0, y), (MIDDLE + edge + 2.0, y))))
    _label(_heights(body, gauge), MIDDLE + edge + 4.0, 1.0, scale, strokes, words, MIDDLE)
    _label(_diameters(body), MIDDLE - edge - 4.0, -1.0, scale, strokes, words, MIDDLE)
    tip_scale = None
    if scale * body.diameter < MIN_TIP_WIDTH:
        tip_scale = _add_tip(body, outlines[0][1], areas, strokes, words)
    what = body.named.replace("_", " ") or f"{body.kind.replace('_', ' ')} end mill"
    cone = f" and {decimal(body.taper_deg)} deg" if body.taper_deg > 0.0 else ""
    if body.form:
        cone = f" with a profile radius of {decimal(body.profile_radius)} mm{cone}"
    title = f"T{body.number}: {what} of {decimal(body.diameter)} mm{cone}, to scale"
    return ToolDrawing(title, scale, tip_scale, tuple(areas), tuple(strokes), tuple(words))


def _add_tip(body: ToolBody, outline: Sequence[Point], areas: list[FilledOutline], strokes: list[DrawnLine],
             words: list[DrawnText]) -> float:
    """The larger tip, cut off where its shape does not change any more; returns its scale."""
    shown = min(body.flute_length, max(1.6 * body.diameter, 1.2 * body.corner_radius, 1.1 * body.end_height))
    cut = [*(p for p in outline if p[1] < shown), (_radius_at(outline, shown), shown)]
    scale = _scale(TIP_ROOM, 2.0 * max(cut[-1][0], body.radius), shown)
    areas.append(_placed("flutes", "tip", cut, TIP_MIDDLE, scale))
    half, y = 0.5 * scale * body.diameter, FLOOR - scale * shown
    strokes.append(DrawnLine("axis", ((TIP_MIDDLE, FLOOR + 2.0), (TIP_MIDDLE, y - 2.0))))
    above = y - 4.0
    low = FLOOR - scale * body.corner_end[1] if body.taper > 0.0 else y  # a cone has that diameter at its foot only
    strokes += [DrawnLine("measure", ((TIP_MIDDLE + side * half, low), (TIP_MIDDLE + side * half, above - 1.0)))
                for side in (-1.0, 1.0)]
    strokes.append(DrawnLine("measure", ((TIP_MIDDLE - half, above), (TIP_MIDDLE + half, above))))
    words += [DrawnText(f"Ø{decimal(body.diameter)}", (TIP_MIDDLE, above - 1.2), "middle"),
              DrawnText(f"tip {_ratio(scale)}, corner R{decimal(body.corner_radius)}", (TIP_MIDDLE, HEIGHT - 1.5),
                        "middle")]
    return scale


def _radius_at(outline: Sequence[Point], height: float) -> float:
    """Radius of an outline at a height, mm; ``outline`` rises."""
    for (r0, z0), (r1, z1) in pairwise(outline):
        if z0 < height <= z1:
            return r0 + (r1 - r0) * (height - z0) / (z1 - z0)
    return outline[-1][0]


def _scale(room: tuple[float, float], width: float, height: float) -> float:
    """The largest standard scale at which the shape fits into the room, mm of paper."""
    return next((s for s in SCALES if s * width <= room[0] and s * height <= room[1]), SCALES[-1])


def _ratio(scale: float) -> str:
    return f"{decimal(scale)}:1" if scale >= 1.0 else f"1:{decimal(1.0 / scale)}"


def _outlines(body: ToolBody) -> list[tuple[str, list[Point]]]:
    """Each part as half widths right of the axis and heights above the tip, mm, from the tip up; ``_placed`` mirrors
    it.
    """
    out = [("flutes", body.cutting_profile(CHORDS))]
    n, s = 0.5 * body.neck_diameter, 0.5 * body.shank_diameter
    if body.neck_length > body.flute_length:
        out.append(("neck", [(n, body.flute_length), (n, body.neck_length)]))
    if body.stickout > body.neck_length:
        out.append(("shank", [(s, body.neck_length), (s, body.stickout)]))
    z = body.stickout
    for h in body.holder:
        out.append(("holder", [(0.5 * h.diameter, z), (0.5 * h.diameter_top, z + h.length)]))
        z += h.length
    return out


def _placed(part: str, view: str, half: Sequence[Point], middle: float, scale: float) -> FilledOutline:
    right = [(middle + scale * x, FLOOR - scale * h) for x, h in half]
    left = [(middle - scale * x, FLOOR - scale * h) for x, h in reversed(half)]
    return FilledOutline(part, view, tuple(right + left))


def _heights(body: ToolBody, gauge: float) -> list[tuple[float, float, str]]:
    """Heights of the parts: height above the tip, half width where the line begins, and text, from the tip up."""
    d = decimal
    out = [(0.0, 0.0, "0 tip"), (body.flute_length, body.widest_radius, f"{d(body.flute_length)} flutes")]
    if body.neck_length > body.flute_length:
        out.append((body.neck_length, 0.5 * body.neck_diameter, f"{d(body.neck_length)} neck"))
    out.append((body.stickout, 0.5 * body.shank_diameter, f"{d(body.stickout)} stickout"))
    z = body.stickout
    for h in body.holder[:-1]:
        z += h.length
        out.append((z, 0.5 * h.diameter_top, f"{d(z)} holder"))
    if body.holder and abs(z + body.holder[-1].length - gauge) > 1e-6:
        out.append((z + body.holder[-1].length, 0.5 * body.holder[-1].diameter_top,
                    f"{d(z + body.holder[-1].length)} holder"))
    widest = max([body.shank_diameter, *(max(h.diameter, h.diameter_top) for h in body.holder)])
    out.append((gauge, 0.5 * widest, f"{d(gauge)} gauge length"))
    return out


def _diameters(body: ToolBody) -> list[tuple[float, float, str]]:
    """Diameters of the parts, at the middle of each, in the same form."""
    d = decimal
    out = [(0.5 * body.flute_length, body.radius, f"Ø{d(body.diameter)}")]
    if body.taper > 0.0:
        wide, low = body.corner_end
        middle = 0.5 * (low + body.flute_length)
        out = [(low, wide, f"Ø{d(body.diameter)} tip"),
               (middle, wide + body.taper * (middle - low), f"{d(body.taper_deg)}° side"),
               (body.flute_length, body.widest_radius, f"Ø{d(2.0 * body.widest_radius)} cone")]
    if body.arcs is not None:
        arcs = body.arcs
        (rho, high), words = arcs.at_sine(0.5 * (arcs.join_sine + arcs.end_sine)), f"R{d(body.profile_radius)} profile"
        out = [(*arcs.at_sine(0.5 * arcs.join_sine)[::-1], words), *out] if body.form == "lens" else \
            [(high, rho, words), (arcs.high, body.radius, f"Ø{d(body.diameter)}")]
    if body.neck_length > body.flute_length:
        out.append((0.5 * (body.flute_length + body.neck_length), 0.5 * body.neck_diameter,
                    f"Ø{d(body.neck_diameter)} neck"))
    if body.stickout > body.neck_length:
        out.append((0.5 * (body.neck_length + body.stickout), 0.5 * body.shank_diameter,
                    f"Ø{d(body.shank_diameter)} shank"))
    z = body.stickout
    for h in body.holder:
        words = f"Ø{d(h.diameter)}" if h.diameter == h.diameter_top else f"Ø{d(h.diameter)} to {d(h.diameter_top)}"
        out.append((z + 0.5 * h.length, 0.25 * (h.diameter + h.diameter_top), words))
        z += h.length
    return out


def _label(entries: Sequence[tuple[float, float, str]], x: float, side: float, scale: float, strokes: list[DrawnLine],
           words: list[DrawnText], middle: float) -> None:
    """Text in a column beside the assembly, each with a line to its height, without overlap.

    Where there are too many, those at both ends are kept; the list beside the drawing has all segments of a holder.
    """
    if len(entries) > MAX_LABELS:
        entries = [*entries[:MAX_LABELS // 2], *entries[-MAX_LABELS // 2:]]
    wanted = [FLOOR - scale * h for h, _, _ in entries]
    placed: list[float] = []
    for y in wanted:  # upwards from the tip
        placed.append(min(y, placed[-1] - APART) if placed else y)
    if placed and placed[-1] < LETTER:  # no room above: move the whole column down, the lowest first
        low = LETTER
        for k in reversed(range(len(placed))):
            placed[k] = max(placed[k], low)
            low = placed[k] + APART
    for (_, half, text), y, at in zip(entries, wanted, placed, strict=True):
        start = middle + side * (scale * half + 0.6)
        strokes.append(DrawnLine("measure", ((start, y), (x - side * 1.5, y), (x + side * 2.0, at))))
        words.append(DrawnText(text, (x + side * 2.8, at + 0.35 * LETTER), "start" if side > 0 else "end"))


def svg_of(drawing: ToolDrawing) -> str:
    """The drawing as an SVG element with a title; all text in it is escaped."""
    title = html.escape(drawing.title)
    out = [f'<svg class="tool" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" '
           f'width="{WIDTH:g}mm" height="{HEIGHT:g}mm" role="img" aria-label="{title}" '
           f'data-scale="{drawing.scale:.6g}"><title>{title}</title>']
    out += [f'<polygon class="{a.part}" data-part="{a.part}" data-view="{a.view}" points="{_pairs(a.points)}"/>'
            for a in drawing.areas]
    out += [f'<polyline class="{s.kind}" points="{_pairs(s.points)}"/>' for s in drawing.strokes]
    out += [f'<text x="{w.at[0]:.3f}" y="{w.at[1]:.3f}" text-anchor="{w.anchor}" font-size="{LETTER:g}">'
            f'{html.escape(w.text)}</text>' for w in drawing.words]
    return "".join([*out, "</svg>"])


def _pairs(points: Sequence[Point]) -> str:
    return " ".join(f"{x + 0.0:.3f},{y + 0.0:.3f}" for x, y in points)


__all__ = ["HEIGHT", "LETTER", "WIDTH", "FilledOutline", "DrawnLine", "ToolDrawing", "DrawnText", "draw_tool", "svg_of"]
