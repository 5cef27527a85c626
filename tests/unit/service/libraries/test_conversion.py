"""Entries as tools: defaults with their notes, shapes that are never slimmer than stated, speeds by material."""

from __future__ import annotations

import json
import math

import pytest

from schemas.materials import same_material
from service.from_wire import parse_setup
from service.libraries.cone import cone_tip_diameter, end_diameter
from service.libraries.conversion import converted
from service.libraries.entry import Entry, Preset, Segment
from service.stages.job_inputs import JobInputs


def one(kind: str = "flat", **values):
    entry = Entry("entry 1", kind, kind, "E1", values={
        "diameter_mm": 6.0, "flutes": 3, "flute_length_mm": 12.0, "shank_diameter_mm": 8.0, "stickout_mm": 40.0,
        **values})
    entry.values = {k: v for k, v in entry.values.items() if v is not None}
    return converted([entry])[0]


@pytest.mark.parametrize("diameter,radius,taper", [(2.0, 1.0, 3.8), (3.0, 0.5, 10.0), (4.0, 0.0, 20.0),
                                                   (6.0, 3.0, 45.0)])
def test_the_cone_of_a_tapered_mill_is_tangent_to_its_corner(diameter, radius, taper):
    tip, angle = cone_tip_diameter(diameter, radius, taper), math.radians(taper)
    # distance of the centre of the corner from the line through (tip / 2, 0) that leans by the angle
    centre = (0.5 * diameter - radius - 0.5 * tip, radius)
    assert centre[1] * math.sin(angle) - centre[0] * math.cos(angle) == pytest.approx(radius)
    assert end_diameter(tip, radius, taper) == pytest.approx(diameter)


def test_rounded_figures_of_cone_and_ball_make_a_ball():
    found = one("tapered", diameter_mm=None, cone_tip_diameter_mm=1.87, corner_radius_mm=1.0, taper_angle_deg=3.8)
    assert (found.tool.kind, found.tool.diameter_mm) == ("tapered_ball", 2.0)
    assert "differ by 0.0016 mm" in found.notes[0]
    found = one("tapered", diameter_mm=None, cone_tip_diameter_mm=1.5, corner_radius_mm=1.0, taper_angle_deg=3.8)
    assert found.verdict == "left_out" and "corner_radius_mm" in found.reason


@pytest.mark.parametrize("values,words", [
    ({"flutes": None}, "flutes is not stated; 2 teeth are taken"),
    ({"flute_length_mm": None}, "flute_length_mm is not stated; 18 is taken"),
    ({"shank_diameter_mm": None}, "shank_diameter_mm is not stated; 6 is taken"),
    ({"stickout_mm": None}, "stickout_mm is not stated; 60 is taken"),
    ({"stickout_mm": None, "overall_length_mm": 50.0}, "stickout_mm is not stated; 50 is taken"),
    ({"neck_length_mm": 20.0}, "the diameter of the neck up to 20 mm is not stated; the shank of 8 mm begins"),
    ({"neck_length_mm": 20.0, "neck_diameter_mm": 7.0}, "the neck of 7 mm is wider than the cutting part"),
    ({"neck_length_mm": 10.0}, "the neck ends at 10 mm, below the end of the flutes"),
    ({"neck_diameter_mm": 5.0}, "the neck of 5 mm is left out, since its length is not stated"),
    ({"neck_length_mm": 45.0, "neck_diameter_mm": 5.8}, "the neck is 45 mm long, and 40 mm of the tool stand out"),
    ({"gauge_length_mm": 20.0}, "gauge_length_mm 20 is less than the stickout 40"),
    ({"corner_radius_mm": 1.0}, "a corner radius of 1 mm; kind bull is taken"),
])
def test_each_default_has_a_note(values, words):
    found = one(**values)
    assert found.verdict == "noted" and len(found.notes) == 1 and words in found.notes[0]


def test_a_tool_is_never_slimmer_than_the_library_states():
    open_neck = one(neck_length_mm=20.0).tool
    assert (open_neck.neck_length_mm, open_neck.shank_diameter_mm) == (12.0, 8.0)
    wide = one(neck_length_mm=20.0, neck_diameter_mm=9.0).tool
    assert (wide.neck_length_mm, wide.shank_diameter_mm) == (12.0, 9.0)


@pytest.mark.parametrize("kind,values,words", [
    ("flat", {"diameter_mm": None}, "states no diameter"),
    ("bull", {}, "needs its corner radius"),
    ("ball", {"corner_radius_mm": 1.0}, "has the radius 3, not 1"),
    ("tapered", {}, "needs the angle of its side"),
    ("mill", {"taper_angle_deg": 45.0}, "its side leans by 45 deg"),
    ("flat", {"stickout_mm": 5.0}, "is longer than stickout_mm"),
    ("flat", {"diameter_mm": 0.001}, "diameter_mm: "),
    ("", {}, "does not state what kind of tool it is"),
    ("lollipop", {}, "kind 'lollipop' is not available"),
])
def test_what_cannot_be_taken_is_left_out_with_its_reason(kind, values, words):
    found = one(kind, **values)
    assert found.tool is None and found.verdict == "left_out" and words in found.reason


def test_a_holder_needs_a_stickout():
    entry = Entry("entry 1", "flat", "flat", "E1", values={"diameter_mm": 6.0}, holder=[Segment(20, 20, 30)])
    assert "how far the tool stands out" in converted([entry])[0].reason


def test_t_numbers_are_apart_from_pockets_and_from_h_and_d():
    entry = Entry("line 1", "flat", "flat", "E1", t_number=7, h_number=17, d_number=7, pocket=3, values={
        "diameter_mm": 6.0, "flutes": 3, "flute_length_mm": 12.0, "shank_diameter_mm": 6.0, "stickout_mm": 40.0})
    found = converted([entry])[0]
    assert found.tool.number == 7 and found.notes == ("the library states H 17 for T 7; programs use 7 for both",)
    entry = Entry("line 2", "flat", "flat", "E2", t_number=0, values=dict(entry.values))
    found = converted([entry])[0]
    assert found.tool.number is None and "T number 0 means no number" in found.notes[0]


def test_speeds_and_feeds_of_the_material_are_used():
    entry = Entry("entry 1", "flat", "flat", "E1", t_number=1, presets=[
        Preset("a", "ti6al4v", 2000.0, 200.0, 50.0), Preset("b", "C45", 4000.0, 500.0), Preset("c", None, 9000.0)],
        values={"diameter_mm": 6.0, "flutes": 3, "flute_length_mm": 12.0, "shank_diameter_mm": 6.0,
                "stickout_mm": 40.0})
    tool = converted([entry])[0].tool

    def cut(material: str):
        setup = parse_setup(json.dumps({"tools": [tool.model_dump(mode="json")], "material": material}))
        return JobInputs.of(setup).cut_table["E1"]

    assert (cut("Ti-6Al-4V").spindle_rpm, cut("Ti-6Al-4V").feed, cut("Ti-6Al-4V").plunge_feed) == (2000, 200, 50)
    assert (cut("C45").spindle_rpm, cut("C45").feed) == (4000, 500)
    assert cut("316L").spindle_rpm == 9000
    own = tool.model_copy(update={"spindle_rpm": 1000.0})
    assert own.in_material("C45").spindle_rpm == 1000 and own.in_material("C45").feed_mm_min == 500


def test_names_of_one_material():
    assert same_material("1.4301", "AISI-304") and same_material("My Steel", "my steel")
    assert not same_material("My Steel", "Ti-6Al-4V")
