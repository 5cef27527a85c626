"""Feeds that are eased: never more for a longer tool, never below the floor, and the limit kept above it."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schemas.materials import MATERIALS
from service.from_wire import parse_setup
from service.stages.job_inputs import JobInputs
from toolpath.tool_deflection import BENT_SHARE, MIN_SHARE, left_by_layers

KINDS = st.sampled_from(["ball", "flat", "bull"])


def table(material, kind, diameter, neck, stickout, **more):
    corner = {"ball": 0.0, "flat": 0.0, "bull": 0.2 * diameter}[kind]
    tool = {"id": "T1", "kind": kind, "diameter_mm": diameter, "corner_radius_mm": corner, "flutes": 4,
            "flute_length_mm": 1.5 * diameter, "neck_diameter_mm": 0.95 * diameter,
            "neck_length_mm": neck * diameter, "shank_diameter_mm": max(6.0, diameter),
            "stickout_mm": (neck + stickout) * diameter, **more}
    given = {"tools": [tool], "material": material, "quality": {"scallop_height_mm": 0.005}}
    return JobInputs.of(parse_setup(json.dumps(given))).cut_table["T1"]


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(MATERIALS)), KINDS, st.floats(0.5, 16.0), st.floats(2.0, 12.0), st.floats(0.5, 8.0),
       st.floats(0.0, 6.0), st.floats(0.0, 6.0), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_a_longer_tool_never_gets_more_feed(material, kind, diameter, neck, shank, neck_more, shank_more, deep, wide):
    short = table(material, kind, diameter, neck, shank)
    long = table(material, kind, diameter, neck + neck_more, shank + shank_more)
    for a, b in ((short, long), (short.finish.under(deep * diameter, wide * diameter),
                                 long.finish.under(deep * diameter, wide * diameter))):
        assert b.step_down <= a.step_down and b.step_down * b.feed <= a.step_down * a.feed * (1.0 + 1e-6)
        if b.step_down == a.step_down:
            assert b.feed <= a.feed and b.plunge_feed <= a.plunge_feed and b.spindle_rpm == a.spindle_rpm


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(MATERIALS)), KINDS, st.floats(0.5, 16.0), st.floats(2.0, 15.0), st.floats(0.01, 0.5),
       st.floats(0.01, 1.0))
def test_an_eased_feed_keeps_the_limit_or_stands_on_the_floor(material, kind, diameter, neck, deep, wide):
    full = table(material, kind, diameter, neck, 4.0).finish
    cut = full.under(deep * diameter, wide * diameter)
    least = full.bending.least_share(full.feed)
    assert MIN_SHARE <= least <= cut.bend.share <= 1.0
    assert cut.feed == pytest.approx(max(0.1, cut.bend.share * full.feed))
    assert cut.plunge_feed == pytest.approx(min(full.plunge_feed, cut.feed))
    if cut.bend.share > least:
        assert cut.bend.deflection <= cut.bend.limit * (1.0 + 1e-9)
    if full.feed * least > 0.2:  # what is reported is what a cut at that feed bends it by
        again = replace(full.bending, limit=1e9).under(cut.feed, deep * diameter, wide * diameter)
        assert again.full == pytest.approx(cut.bend.deflection, rel=1e-9)


def test_a_feed_of_the_setup_is_not_eased_but_told_of():
    own = table("Ti-6Al-4V", "flat", 1.0, 15.0, 5.0, feed_mm_min=300, plunge_feed_mm_min=40)
    assert (own.feed, own.plunge_feed) == (300, 40)
    assert own.bend.fixed and own.bend.share == 1.0 and own.bend.deflection == own.bend.full > own.bend.limit
    ways = table("Ti-6Al-4V", "flat", 1.0, 15.0, 5.0, plunge_feed_mm_min=40)
    assert ways.plunge_feed == 40 and ways.bend.share < 1.0


def test_a_material_without_a_specific_cutting_force_bends_nothing():
    plain = {"name": "X", "cutting_speed_m_min": 60, "feed_per_tooth": [{"diameter_mm": 1, "feed_per_tooth_mm": 0.01}]}
    cut = table(plain, "flat", 1.0, 15.0, 5.0)
    assert cut.bend is None and cut.finish.under(0.5, 0.5).bend is None


@pytest.mark.parametrize(("direction", "limit"), [("climb", 0.03), ("conventional", 0.004), ("either", 0.004)])
def test_a_finish_that_climbs_may_leave_what_a_cusp_may_and_one_that_may_dig_half_of_a_gouge(direction, limit):
    tool = {"id": "T1", "kind": "flat", "diameter_mm": 6, "flute_length_mm": 12, "stickout_mm": 40}
    given = {"tools": [tool], "operations": {"cut_direction": direction},
             "quality": {"scallop_height_mm": 0.03, "gouge_tolerance_mm": 0.008}}
    cut = JobInputs.of(parse_setup(json.dumps(given))).cut_table["T1"]
    assert cut.finish.under(1.0, 0.1).bend.limit == pytest.approx(limit)
    assert cut.bend.limit == pytest.approx(BENT_SHARE * left_by_layers(cut.step_down, 0.15))
