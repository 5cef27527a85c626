"""Drawings of tools: every part as large as the scale says, every word there and none over another."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET

import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from service.pictures.tool_drawing import HEIGHT, LETTER, WIDTH, draw_tool, svg_of

SVG = "{http://www.w3.org/2000/svg}"
HOLDER = (HolderFrustum(14.0, 20.0, 12.0), HolderFrustum(20.0, 20.0, 30.0))
BALL = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0, HOLDER)
BULL = ToolBody("T7", 7, 8.0, 1.0, 20.0, 8.0, 20.0, 8.0, 50.0)
LONG = ToolBody("T9", 9, 0.4, 0.0, 0.8, 0.38, 6.0, 4.0, 60.0, (HolderFrustum(63.0, 63.0, 160.0),) * 3)
CROWDED = ToolBody("T3", 3, 1.0, 0.5, 1.0, 0.9, 1.2, 3.0, 1.4, (HolderFrustum(40.0, 40.0, 0.3),) * 12)
STACKED = ToolBody("T4", 4, 6.0, 0.0, 12.0, 6.0, 12.0, 6.0, 30.0, (HolderFrustum(20.0, 22.0, 1.0),) * 50)
DRILL = ToolBody("T5", 5, 3.0, 0.0, 24.0, 3.0, 24.0, 3.0, 40.0, (), "drill", 0.0, 0.9)
TAPERED = [ToolBody("T6", 6, 1.0, 0.5, 12.0, 2.1, 20.0, 4.0, 40.0, HOLDER, taper=math.tan(math.radians(3.0))),
           ToolBody("T8", 8, 4.0, 0.6, 30.0, 8.0, 40.0, 10.0, 55.0, HOLDER, taper=math.tan(math.radians(5.0))),
           ToolBody("T10", 10, 2.0, 0.0, 12.0, 6.0, 20.0, 6.0, 40.0, (), taper=math.tan(math.radians(20.0)))]
TOOLS = [(DRILL, 40.0), (BALL, 87.0), (BULL, 50.0), (LONG, 560.0), (CROWDED, 5.0), (STACKED, 80.0),
         *((t, 82.0) for t in TAPERED)]


def read(body: ToolBody, gauge: float) -> ET.Element:
    return ET.fromstring(svg_of(draw_tool(body, gauge)))


def box(polygon: ET.Element) -> tuple[float, float, float, float]:
    """Left, right, upper and lower end, mm of paper."""
    places = [tuple(map(float, pair.split(","))) for pair in polygon.attrib["points"].split()]
    xs, ys = zip(*places, strict=True)
    return min(xs), max(xs), min(ys), max(ys)


@pytest.mark.parametrize(("body", "gauge"), TOOLS, ids=lambda x: getattr(x, "id", ""))
def test_every_part_is_drawn_to_scale(body, gauge):
    root = read(body, gauge)
    scale = float(root.attrib["data-scale"])
    floor = None
    wanted = [("flutes", 2 * body.widest_radius, 0.0, body.flute_length)]
    if body.neck_length > body.flute_length:
        wanted.append(("neck", body.neck_diameter, body.flute_length, body.neck_length))
    wanted.append(("shank", body.shank_diameter, body.neck_length, body.stickout))
    at = body.stickout
    for h in body.holder:
        wanted.append(("holder", max(h.diameter, h.diameter_top), at, at + h.length))
        at += h.length
    drawn = [p for p in root.iter(f"{SVG}polygon") if p.attrib["data-view"] == "assembly"]
    assert [p.attrib["data-part"] for p in drawn] == [w[0] for w in wanted]
    for polygon, (_, across, low, high) in zip(drawn, wanted, strict=True):
        left, right, up, down = box(polygon)
        floor = down if floor is None else floor
        assert right - left == pytest.approx(scale * across, abs=0.003)
        assert floor - down == pytest.approx(scale * low, abs=0.003)
        assert floor - up == pytest.approx(scale * high, abs=0.003)


def test_a_drill_has_its_point_and_its_name():
    drawing = draw_tool(DRILL, 40.0)
    flutes = next(a for a in drawing.areas if a.part == "flutes").points
    low = max(y for _, y in flutes)
    assert sorted({round((low - y) / drawing.scale, 6) for _, y in flutes}) == pytest.approx([0.0, 0.9, 24.0])
    assert drawing.title == "T5: drill of 3 mm, to scale"


@pytest.mark.parametrize("body", TAPERED, ids=lambda b: b.kind)
def test_a_tapered_mill_is_drawn_with_its_cone(body):
    """Every point of the cutting part lies on the end, the corner or the side, in both views."""
    drawing = draw_tool(body, 82.0)
    for view, scale in (("assembly", drawing.scale), ("tip", drawing.tip_scale)):
        (area,) = [a for a in drawing.areas if a.view == view and a.part == "flutes"]
        middle, low = (sum(x for x, _ in area.points) / len(area.points), max(y for _, y in area.points))
        wide, high = body.corner_end
        heights = []
        for x, y in area.points:
            r, z = abs(x - middle) / scale, (low - y) / scale
            corner = math.hypot(r - body.radius + body.corner_radius, z - body.corner_radius) - body.corner_radius
            side = r - wide - body.taper * (z - high)
            assert min(abs(corner) if z <= high + 1e-6 else math.inf, abs(side), z) == pytest.approx(0.0, abs=1e-6)
            heights.append(z)
        assert view == "tip" or max(heights) == pytest.approx(body.flute_length)
    angle = f"{math.degrees(math.atan(body.taper)):g}"
    assert drawing.title.endswith(f"{body.kind.replace('_', ' ')} end mill of {body.diameter:g} mm and {angle} deg, "
                                  "to scale")
    words = [w.text for w in drawing.words]
    assert f"{angle}° side" in words and f"Ø{round(2 * body.widest_radius, 4):g} cone" in words


def test_the_tip_is_drawn_larger_and_round_where_it_is_small():
    root = read(BALL, 87.0)
    (tip,) = [p for p in root.iter(f"{SVG}polygon") if p.attrib["data-view"] == "tip"]
    left, right, _, down = box(tip)
    assert right - left == pytest.approx(5.0 * 3.0, abs=0.003)
    places = [tuple(map(float, pair.split(","))) for pair in tip.attrib["points"].split()]
    round_end = [(x, y) for x, y in places if y > down - 7.4]
    assert len(round_end) > 20
    assert all((x - 97.0) ** 2 + (y - (down - 7.5)) ** 2 == pytest.approx(7.5 ** 2, rel=1e-3) for x, y in round_end)
    assert not [p for p in read(BULL, 50.0).iter(f"{SVG}polygon") if p.attrib["data-view"] == "tip"] or \
        float(read(BULL, 50.0).attrib["data-scale"]) * 8.0 < 10.0


@pytest.mark.parametrize(("body", "gauge"), TOOLS, ids=lambda x: getattr(x, "id", ""))
def test_words_are_on_the_paper_and_none_is_over_another(body, gauge):
    words = draw_tool(body, gauge).words
    assert all(0.0 < w.at[0] < WIDTH and LETTER <= w.at[1] + LETTER and w.at[1] <= HEIGHT for w in words)
    for side in ("start", "end"):
        lines = sorted(w.at[1] for w in words if w.anchor == side)
        assert all(b - a > LETTER for a, b in itertools.pairwise(lines))


def test_it_says_each_length_and_diameter():
    said = [w.text for w in draw_tool(BALL, 90.0).words]
    assert {"0 tip", "9 flutes", "20 neck", "45 stickout", "57 holder", "87 holder", "90 gauge length"} <= set(said)
    assert {"Ø3", "Ø2.8 neck", "Ø6 shank", "Ø14 to 20", "Ø20", "assembly 1:2", "tip 5:1, corner R1.5"} <= set(said)
