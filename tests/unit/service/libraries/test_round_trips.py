"""Export of tools and import of the file give the same tools, as far as the format has places for their fields."""

from __future__ import annotations

import pytest

from schemas.tools import Tool
from service.libraries.entry import Source
from service.libraries.exchange import export_library, import_library
from service.libraries.registry import FORMATS, ONE_SPEED, SPEEDS, WRITTEN

HOLDER = [{"diameter_mm": 14.5, "diameter_top_mm": 20, "length_mm": 12.25},
          {"diameter_mm": 24, "diameter_top_mm": 24, "length_mm": 30}]
DATA = [{"material": "Ti-6Al-4V", "spindle_rpm": 3000, "feed_mm_min": 240, "plunge_feed_mm_min": 80},
        {"spindle_rpm": 9000.5, "feed_mm_min": 900}]


def tool(number: int, kind: str, diameter: float, **more) -> Tool:
    name = {"flat": "end mill", "ball": "ball nose end mill", "bull": "torus end mill", "drill": "drill",
            "tap": "tap", "thread_mill": "thread mill"}.get(kind, kind)
    return Tool.model_validate({
        "id": f"EM-{number}", "number": number, "kind": kind, "diameter_mm": diameter, "flutes": 3,
        "description": f"{name} {number}", "order_code": f"A {number}", "shank_diameter_mm": 12, "stickout_mm": 55,
        **more})


TOOLS = [
    tool(1, "flat", 6.35, flute_length_mm=19.05, neck_diameter_mm=6.1, neck_length_mm=24, holder=HOLDER,
         cutting_data=DATA, coolant="flood"),
    tool(2, "ball", 3, flute_length_mm=9, neck_diameter_mm=2.8, neck_length_mm=20, holder=HOLDER),
    tool(3, "bull", 8, corner_radius_mm=0.75, flute_length_mm=16, cutting_data=DATA[1:]),
    tool(4, "tapered_ball", 2, taper_angle_deg=3.8, flute_length_mm=15),
    tool(5, "tapered_bull", 3, corner_radius_mm=0.5, taper_angle_deg=5, flute_length_mm=12),
    tool(6, "tapered_flat", 2.5, taper_angle_deg=10, flute_length_mm=10),
    tool(7, "drill", 5, point_angle_deg=140, flute_length_mm=30),
    tool(8, "tap", 6, pitch_mm=1, flute_length_mm=14),
    tool(9, "chamfer", 10, point_angle_deg=90, tip_diameter_mm=1, flute_length_mm=6),
    tool(10, "thread_mill", 8, pitch_mm=1.25, flute_length_mm=16),
    tool(12, "lens", 8, profile_radius_mm=40.5, corner_radius_mm=0.5, flute_length_mm=16),
    tool(13, "barrel", 8, profile_radius_mm=60, corner_radius_mm=1.5, taper_angle_deg=12.5, tip_diameter_mm=1,
         flute_length_mm=24),
]
FULL = [tool(11, "flat", 4, flute_length_mm=11, center_cutting=False, core_diameter_mm=1.5, ramp_angle_deg=2,
             max_rpm=20000, max_engagement_deg=90, life_min=45.5, spindle_rpm=7000, feed_mm_min=600,
             plunge_feed_mm_min=150, gauge_length_mm=120, holder=HOLDER)]


def stated(one: Tool, name: str) -> dict:
    """The fields of a tool that a format carries."""
    kind, fields = FORMATS[name], one.model_dump(mode="json")
    found = {k: v for k, v in fields.items() if k in kind.carried or k in ("id", "kind", "corner_radius_mm")}
    if SPEEDS not in kind.carried:
        found.pop("cutting_data", None)
    return found


@pytest.mark.parametrize("name", WRITTEN)
def test_export_and_import_give_the_same_tools(name):
    written = export_library(TOOLS + FULL, name)
    again = import_library(written.data, Source("tools"), FORMATS[name].name)
    assert [e.reason for e in again.entries if e.tool is None] == []
    kept = [t for t in TOOLS + FULL if t.id not in written.left_out]
    assert [stated(t, name) for t in again.tools] == [stated(t, name) for t in kept]
    assert {t.kind for t in TOOLS} - FORMATS[name].kinds == {t.kind for t in TOOLS if t.id in written.left_out}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_second_export_gives_the_same_bytes(name):
    data = export_library(TOOLS, name).data
    assert export_library(TOOLS, name).data == data
    again = import_library(data, Source("tools")).tools
    assert export_library(again, name).data == export_library(again, name).data


@pytest.mark.parametrize("name", ["zonemill", "csv", "xlsx"])
def test_own_formats_lose_nothing(name):
    written = export_library(TOOLS + FULL, name)
    assert (written.losses, written.left_out) == ({}, {})
    assert import_library(written.data, Source("tools")).tools == TOOLS + FULL


def test_what_a_format_has_no_place_for_is_listed_by_tool():
    written = export_library([*TOOLS, *FULL], "freecad")
    assert written.left_out["EM-5"] == "FreeCAD has no kind tapered_bull"
    assert written.losses["EM-1"] == ("stickout_mm", "holder", "coolant", "order_code", "cutting_data")
    assert set(export_library(FULL, "fusion").losses["EM-11"]) == {
        "center_cutting", "core_diameter_mm", "ramp_angle_deg", "max_rpm", "max_engagement_deg", "life_min",
        "spindle_rpm", "feed_mm_min", "plunge_feed_mm_min"}


def test_speeds_of_a_material_are_never_written_as_those_of_all():
    written = export_library(TOOLS, "hsmlib")
    assert written.losses["EM-1"] == ("cutting_data",) and "EM-3" not in written.losses
    again = {t.id: t for t in import_library(written.data, Source("tools")).tools}
    assert [d.material for d in again["EM-1"].cutting_data] == [None]
    assert again["EM-1"].cutting_data[0].spindle_rpm == 9000.5
    assert ONE_SPEED in FORMATS["hsmlib"].carried


def test_an_imported_id_is_written_back():
    made = [TOOLS[0].model_copy(update={"id": "L-1", "library_id": "{0c7f-11}"})]
    again = import_library(export_library(made, "fusion").data, Source("tools")).tools[0]
    assert again.library_id == "{0c7f-11}" and again.id.startswith("L0c7f-11-")
    assert import_library(export_library([again], "fusion").data, Source("tools")).tools == [again]
