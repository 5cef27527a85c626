"""Circle segment mills in a setup: what they become, and what is refused with value, limit and remedy."""

import json
import math

import pytest

from geometry.errors import CamError
from service.cutting_data import cut_diameter
from service.from_wire import parse_setup, tool_body

LENS = {"id": "T1", "kind": "lens", "diameter_mm": 10, "profile_radius_mm": 40, "corner_radius_mm": 1,
        "flute_length_mm": 12}
BARREL = {"id": "T1", "kind": "barrel", "diameter_mm": 10, "profile_radius_mm": 85, "corner_radius_mm": 3,
          "flute_length_mm": 25}


def tool(fields):
    return parse_setup(json.dumps({"tools": [fields]})).tools[0]


def test_a_lens_is_a_sphere_a_fillet_and_a_cylinder():
    given = tool(LENS)
    body = tool_body(given)
    assert (body.kind, body.end, body.form, body.radius, body.widest_radius) == ("lens", "lens", "lens", 5.0, 5.0)
    assert body.flat_radius == 0.0 and body.tip_curvature == 40.0
    high = 40.0 - math.sqrt(39.0**2 - 4.0**2)
    assert body.end_height == pytest.approx(high) and given.end_height == pytest.approx(high)
    assert given.widest_mm == given.shank_diameter_mm == 10.0
    assert cut_diameter(given, 0.1) == pytest.approx(2.0 * math.sqrt(0.1 * 79.9))
    assert tool({**LENS, "corner_radius_mm": 0}).end_height == pytest.approx(40.0 - math.sqrt(1600.0 - 25.0))


def test_a_barrel_is_a_tip_a_segment_and_a_cylinder():
    body = tool_body(tool(BARREL))
    assert (body.kind, body.taper, body.taper_deg, body.end_height) == ("barrel", 0.0, 0.0, pytest.approx(21.0))
    lean = tool_body(tool({**BARREL, "taper_angle_deg": 20, "corner_radius_mm": 1, "tip_diameter_mm": 1}))
    assert lean.taper == 0.0 and lean.taper_deg == pytest.approx(20.0) and lean.flat_radius == 0.5
    assert lean.arcs.end_sine == pytest.approx(math.cos(math.radians(20.0)))


def test_flutes_are_at_least_as_long_as_the_arcs_by_default():
    given = {k: v for k, v in BARREL.items() if k != "flute_length_mm"}
    assert tool(given).flute_length_mm == 30.0
    assert tool({**given, "profile_radius_mm": 400}).flute_length_mm == pytest.approx(
        3.0 + math.sqrt(397.0**2 - 395.0**2))


@pytest.mark.parametrize(("fields", "words"), [
    ({**LENS, "diameter_mm": 1, "corner_radius_mm": 0.1}, ("diameter_mm 1 of a lens must be at least 1.5",)),
    ({**LENS, "profile_radius_mm": None}, ("a lens needs profile_radius_mm",)),
    ({**LENS, "profile_radius_mm": 5}, ("profile_radius_mm 5 of a lens", "half the diameter, 5", "kind ball")),
    ({**LENS, "corner_radius_mm": 5}, ("corner_radius_mm 5 of a lens", "less than half the diameter, 5", "kind ball")),
    ({**LENS, "taper_angle_deg": 3}, ("taper_angle_deg 3", "barrel", "leave it out")),
    ({**LENS, "tip_diameter_mm": 1}, ("tip_diameter_mm belongs to a barrel",)),
    ({**LENS, "point_angle_deg": 90}, ("point_angle_deg belongs to kinds drill, tap and chamfer",)),
    ({**LENS, "flute_length_mm": 1.1}, ("flute_length_mm 1.1 is shorter than the arcs", "1.206", "at least")),
    ({**LENS, "neck_diameter_mm": 11, "neck_length_mm": 20}, ("neck_diameter_mm 11 is larger than diameter_mm 10",)),
    ({**LENS, "kind": "bull"}, ("profile_radius_mm belongs to kinds lens and barrel", "kind bull")),
    ({**BARREL, "corner_radius_mm": 0}, ("a barrel needs a corner_radius_mm above 0", "kind lens")),
    ({**BARREL, "taper_angle_deg": 50}, ("taper_angle_deg 50 of a barrel", "at most 45")),
    ({**BARREL, "tip_diameter_mm": 5}, ("is 11 wide", "less than diameter_mm 10", "reduce")),
    ({**BARREL, "profile_radius_mm": 5}, ("profile_radius_mm 5 of a barrel", "more than 5", "does not touch the tip")),
    ({**BARREL, "flute_length_mm": 20}, ("flute_length_mm 20 is shorter than the arcs of the barrel", "end 21 over")),
    ({**BARREL, "kind": "lollipop"}, ("kind",))])
def test_what_does_not_join_is_refused_with_value_limit_and_remedy(fields, words):
    with pytest.raises(CamError) as refused:
        tool(fields)
    assert all(word in str(refused.value) for word in words), refused.value
