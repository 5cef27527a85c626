"""Tapered mills in a setup: what is taken, the defaults, what comes back, and what is refused with which words."""

import math

import pytest

from geometry.errors import SetupError
from schemas.setup import canonical_json
from service.from_wire import check_plannable, parse_setup, tool_bodies

BALL = {"id": "T1", "kind": "tapered_ball", "diameter_mm": 1, "taper_angle_deg": 3, "flute_length_mm": 12}
BULL = {**BALL, "kind": "tapered_bull", "diameter_mm": 2, "corner_radius_mm": 0.4}
FLAT = {**BALL, "kind": "tapered_flat", "diameter_mm": 2}
WIDTHS = {"tapered_ball": 2.206752, "tapered_bull": 3.216958, "tapered_flat": 3.257787}
"""Diameter at the end of the flutes, mm: twice R - r (1 - cos) + (l - r (1 - sin)) tan."""


def job(tool, **changes):
    return {"tools": [{**tool, **changes}], "quality": {"scallop_height_mm": 0.05}}


def refused(tool, **changes):
    with pytest.raises(SetupError) as caught:
        parse_setup(job(tool, **changes))
    assert caught.value.code == "bad_setup" and caught.value.remedy
    return caught.value.message


@pytest.mark.parametrize("given", [BALL, BULL, FLAT], ids=lambda t: t["kind"])
def test_a_tapered_mill_is_taken_with_neck_and_shank_as_wide_as_its_cone(given):
    setup = parse_setup(job(given))
    check_plannable(setup)
    (tool,), (body,) = setup.tools, tool_bodies(setup)
    wide = WIDTHS[given["kind"]]
    assert (tool.widest_mm, tool.neck_diameter_mm, tool.shank_diameter_mm) == pytest.approx((wide,) * 3, abs=1e-6)
    assert (2 * body.widest_radius, body.neck_diameter, body.shank_diameter) == pytest.approx((wide,) * 3, abs=1e-6)
    assert (tool.neck_length_mm, tool.stickout_mm) == (12, max(12, 10 * given["diameter_mm"]))
    assert body.kind == given["kind"] and body.end == given["kind"].removeprefix("tapered_")
    assert body.taper == pytest.approx(math.tan(math.radians(3)))


@pytest.mark.parametrize("given", [BALL, BULL, FLAT], ids=lambda t: t["kind"])
@pytest.mark.parametrize("angle", [0.5, 3, 7.5, 45])
def test_the_cone_touches_the_corner(given, angle):
    """The end of the corner lies on its circle, and there the circle has the slope of the side."""
    (body,) = tool_bodies(parse_setup(job(given, taper_angle_deg=angle)))
    wide, high = body.corner_end
    middle = body.radius - body.corner_radius
    assert math.hypot(wide - middle, high - body.corner_radius) == pytest.approx(body.corner_radius)
    if body.corner_radius:
        assert (body.corner_radius - high) / (wide - middle) == pytest.approx(body.taper)


@pytest.mark.parametrize("given", [BALL, {**BULL, "neck_diameter_mm": 3, "neck_length_mm": 20, "shank_diameter_mm": 6},
                                   FLAT, {**FLAT, "taper_angle_deg": 45, "shank_diameter_mm": 3}], ids=str)
def test_a_setup_that_is_read_written_and_read_again_is_the_same(given):
    once = parse_setup(job(given))
    again = parse_setup(canonical_json(once))
    assert canonical_json(again) == canonical_json(once) and tool_bodies(again) == tool_bodies(once)


def test_a_cone_may_be_wider_than_the_shank():
    (body,) = tool_bodies(parse_setup(job(FLAT, taper_angle_deg=20, shank_diameter_mm=6, neck_length_mm=20,
                                          stickout_mm=40)))
    assert 2 * body.widest_radius == pytest.approx(2 + 24 * math.tan(math.radians(20))) and body.shank_diameter == 6


def test_a_ball_needs_no_corner_radius_and_a_neck_may_be_as_wide_as_the_cone():
    (body,) = tool_bodies(parse_setup(job(BALL, corner_radius_mm=0.5, neck_diameter_mm=2.2, neck_length_mm=15)))
    assert body.corner_radius == 0.5 and body.neck_diameter == 2.2


@pytest.mark.parametrize(("given", "words"), [
    (job(BALL, taper_angle_deg=0), ("tool T1", "taper_angle_deg 0", "at most 45", "kind ball for 0")),
    (job(BULL, taper_angle_deg=60), ("tool T1", "taper_angle_deg 60", "at most 45", "kind chamfer for more")),
    (job(BALL, taper_angle_deg=45.1), ("taper_angle_deg 45.1", "at most 45")),
    (job(FLAT, corner_radius_mm=0.3), ("tool T1", "corner_radius_mm 0, not 0.3", "use kind tapered_bull")),
    (job(BULL, corner_radius_mm=0), ("tool T1", "corner_radius_mm above 0", "use kind tapered_flat")),
    (job(BULL, corner_radius_mm=1.2), ("tool T1", "corner_radius_mm 1.2", "half the diameter, 1", "at most that")),
    (job(BALL, corner_radius_mm=0.4), ("tool T1", "half its diameter, 0.5, not 0.4", "call it tapered_bull")),
    (job(BALL, neck_diameter_mm=2.3, neck_length_mm=20),
     ("tool T1", "neck_diameter_mm 2.3", "the end of the cone, 2.20675", "at most that")),
    (job(BALL, neck_diameter_mm=2), ("tool T1", "neck_diameter_mm is given without neck_length_mm")),
    (job(BALL, flute_length_mm=0.4),
     ("tool T1", "flute_length_mm 0.4 is less than twice the", "radius, 1,", "at least")),
    (job(FLAT, taper_angle_deg=45, flute_length_mm=1500), ("tool T1", "3002 wide", "more than 2000",
                                                           "reduce taper_angle_deg")),
    (job(FLAT, kind="flat"), ("tool T1", "taper_angle_deg 3", "is 0 for kind flat",
                              "use kind tapered_flat, or leave it out")),
    (job(FLAT, kind="drill"), ("tool T1", "taper_angle_deg 3", "is 0 for kind drill; leave it out")),
    (job(FLAT, point_angle_deg=90), ("tool T1", "point_angle_deg belongs to kinds drill, tap and chamfer"))])
def test_a_wrong_tapered_mill_is_refused_with_tool_value_limit_and_remedy(given, words):
    with pytest.raises(SetupError) as caught:
        parse_setup(given)
    assert caught.value.code == "bad_setup" and all(w in caught.value.message for w in words), caught.value.message


@pytest.mark.parametrize("angle", [-1, 90, 120, "3", float("nan")])
def test_an_angle_that_is_none_is_refused_by_the_field(angle):
    assert "taper_angle_deg" in refused(BALL, taper_angle_deg=angle)
