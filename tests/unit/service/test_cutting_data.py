"""Speeds and feeds: effective diameter, thin chips, what a setup says of a tool, limits and what is told of them."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import pytest

from benchmarks.passes import feeds_sweep
from benchmarks.passes.feeds_sweep import MACHINES, OVERRIDES, faults, varied
from examples.demo import demo_setup
from geometry.cutting_mechanics import effective_diameter
from schemas.materials import MATERIALS
from service.cutting_data import (
    MAX_CHIP_THINNING,
    chip_thinning,
    cut_diameter,
    cutting_data,
    cutting_words,
    feed_per_tooth,
)
from service.from_wire import parse_setup, tool_bodies
from service.stages.cautions import bent, dry, limited, uncut_centres
from service.stages.job_inputs import JobInputs
from tests.synthetic_plan import BALL as SLIM
from tests.synthetic_plan import step
from toolpath.tool_deflection import MAX_BENT_TIMES, DeflectionEstimate, left_by_layers

BALL = {"id": "T1", "number": 1, "kind": "ball", "diameter_mm": 3, "flutes": 2}
FLAT = {"id": "T2", "number": 2, "kind": "flat", "diameter_mm": 4, "flutes": 4}


def setup(*tools, **changes):
    return parse_setup(json.dumps({"tools": list(tools), "material": "C45", **changes}))


@pytest.mark.parametrize("depth", [0.01, 0.2, 0.9, 1.4999])
def test_the_effective_diameter_is_that_of_the_circle_at_the_depth(depth):
    half = 0.5 * effective_diameter(3.0, 1.5, depth)
    assert half**2 + (1.5 - depth) ** 2 == pytest.approx(1.5**2)
    assert effective_diameter(8.0, 1.5, depth) == pytest.approx(5.0 + 2.0 * half)
    assert effective_diameter(3.0, 1.5, 1.5) == effective_diameter(3.0, 1.5, 9.0) == 3.0


def test_a_thin_chip_is_measured_on_the_path_of_a_tooth():
    """Side cut ae deep: the thickest chip is fz sin(phi) with cos(phi) = 1 - 2 ae / D, counted here on two circles."""
    radius, ae, fz = 5.0, 4.0, 1e-4
    phi = math.acos(1.0 - ae / radius)
    # along the radius at phi, from the circle that the tooth before has cut, fz behind, to that of this one
    before = math.sqrt(radius**2 - (fz * math.cos(phi)) ** 2) - fz * math.sin(phi)
    assert (radius - before) / fz == pytest.approx(math.sin(phi), rel=1e-4)
    assert chip_thinning(0.0, 1.0, phi) == pytest.approx(1.0 / math.sin(phi))
    assert chip_thinning(0.0, None, 0.5 * math.pi) == chip_thinning(0.0, None, math.pi) == 1.0
    assert chip_thinning(0.0, None, 0.01) == chip_thinning(2.0, 1e-6) == chip_thinning(2.0, 0.0) == MAX_CHIP_THINNING


def test_finishing_keeps_the_figures_of_the_table_and_layers_of_a_ball_count_their_depth():
    found = setup(BALL)
    fine = cutting_data(found.material, found.tools[0], found.machine)
    assert (fine.spindle_rpm, fine.limited_by) == (13793, "material")
    assert fine.feed == pytest.approx(13793 * 2 * 0.020) and fine.plunge_feed == pytest.approx(0.3 * fine.feed)
    rough = cutting_data(found.material, found.tools[0], found.machine, 0.9)
    wide = 3.0 * 2.0 * math.sqrt(0.3 * 0.7)
    assert rough.spindle_rpm == math.floor(130e3 / (math.pi * wide))
    assert rough.feed_per_tooth == pytest.approx(0.020 * 3.0 / wide)
    flat = setup(FLAT)
    same = [cutting_data(flat.material, flat.tools[0], flat.machine, d) for d in (None, 2.0)]
    assert same[0] == same[1]


@pytest.mark.parametrize(("kind", "share"), [("tapered_ball", 0.3), ("tapered_bull", 0.3), ("tapered_flat", 0.5)])
def test_a_tapered_mill_has_the_figures_of_its_end_and_layers_count_its_cone(kind, share):
    end = {"corner_radius_mm": 0.4} if kind == "tapered_bull" else {}
    given = {"id": "T1", "number": 1, "diameter_mm": 2, "flutes": 2, "flute_length_mm": 10, "stickout_mm": 20, **end}
    cone = setup({**given, "kind": kind, "taper_angle_deg": 20})
    plain = setup({**given, "kind": kind.removeprefix("tapered_")})
    tool, straight = cone.tools[0], plain.tools[0]
    assert cutting_data(cone.material, tool, cone.machine) == cutting_data(plain.material, straight, plain.machine)
    words = cutting_words(cone.material, tool)
    assert (words.per_tooth, words.section) == (feed_per_tooth(cone.material.feed_per_tooth, 2.0), share * 4.0)
    depth = 0.9
    body = tool_bodies(cone)[0]
    wide, high = body.corner_end
    assert depth > high and cut_diameter(straight, depth) < cut_diameter(tool, depth)
    assert cut_diameter(tool, depth) == pytest.approx(2 * (wide + math.tan(math.radians(20)) * (depth - high)))
    assert cut_diameter(tool, 10.0) == pytest.approx(2 * body.widest_radius)
    rough = cutting_data(cone.material, tool, cone.machine, depth)
    assert rough.spindle_rpm == min(18000, math.floor(130e3 / (math.pi * cut_diameter(tool, depth))))
    assert 0.0 < JobInputs.of(cone).cut_table["T1"].step_down <= share * 2.0


def test_a_bound_on_the_engaged_angle_feeds_layers_faster_and_no_finish():
    slot, side = (setup({**FLAT, "max_engagement_deg": a}) for a in (90, 60))
    feeds = [cutting_data(s.material, s.tools[0], s.machine, 2.0).feed for s in (setup(FLAT), slot, side)]
    assert feeds[0] == feeds[1] and feeds[2] == pytest.approx(feeds[0] / math.sin(math.radians(60)))
    assert cutting_data(side.material, side.tools[0], side.machine).feed == feeds[0]


def test_what_the_setup_says_of_a_tool_stands_and_is_held_to_the_limits():
    own = {"spindle_rpm": 9000, "feed_mm_min": 321, "plunge_feed_mm_min": 55}
    cut = JobInputs.of(setup({**BALL, **own})).cut_table["T1"]
    assert (cut.spindle_rpm, cut.feed, cut.plunge_feed) == (9000, 321, 55)
    assert (cut.finish.spindle_rpm, cut.finish.feed, cut.finish.plunge_feed) == (9000, 321, 55)
    assert limited(JobInputs.of(setup({**BALL, **own}))) == []
    slow = setup({**BALL, **own}, {**FLAT, "spindle_rpm": 7000, "max_rpm": 5000},
                 machine={"max_rpm": 8000, "max_feed_mm_min": 200})
    told = limited(JobInputs.of(slow))
    assert [(c.subjects, c.measured, c.limit) for c in told] == [
        (("T1",), 9000, 8000), (("T1",), 321, 200), (("T2",), 7000, 5000)]
    assert told[0].sentence == ("tool T1: spindle_rpm 9000 is more than machine.max_rpm 8000; it runs at 8000; lower "
                                "the figure, or correct the limit")
    assert "its max_rpm 5000" in told[2].message
    cut = JobInputs.of(slow).cut_table["T1"]
    assert (cut.spindle_rpm, cut.feed, cut.plunge_feed, cut.link_feed) == (8000, 200, 55, 200)
    only = cutting_data(slow.material, setup({**BALL, "spindle_rpm": 1000}).tools[0], slow.machine)
    assert only.feed == pytest.approx(1000 * 2 * 0.020)  # the feed follows the speed


def test_an_own_figure_may_pass_the_caution_for_machines_that_state_no_limit():
    fast = setup({**BALL, "spindle_rpm": 40000, "feed_mm_min": 9000})
    cut = JobInputs.of(fast).cut_table["T1"]
    assert (cut.spindle_rpm, cut.feed) == (40000, 9000) and limited(JobInputs.of(fast)) == []


def test_links_of_thin_tools_give_no_thicker_chip_than_a_cutter_bears():
    thin = {**BALL, "diameter_mm": 0.6, "flute_length_mm": 1.8, "spindle_rpm": 18000}
    cut = JobInputs.of(setup(thin)).cut_table["T1"]
    assert cut.link_feed == pytest.approx(0.95 * 0.2 * 0.6 * 2 * 18000)
    assert JobInputs.of(setup({**thin, "diameter_mm": 1.0})).cut_table["T1"].link_feed == 5000


def test_no_depth_bends_a_tool_farther_than_the_proof_may_double():
    """Bearable depths of slender tools: the bend at the least chip stays below four times the limit."""
    seen = 0
    for diameter, neck in itertools.product((0.4, 0.6, 1.0, 2.0), (3.0, 8.0, 12.0)):
        tool = {**BALL, "diameter_mm": diameter, "flute_length_mm": 3.0 * diameter, "neck_diameter_mm": 0.9 * diameter,
                "neck_length_mm": 3.0 * diameter + neck, "stickout_mm": 3.0 * diameter + neck + 12.0}
        fine = JobInputs.of(setup(tool)).cut_table["T1"].finish
        model, full = fine.bending, 2.4 * diameter
        least = model.least_share(fine.feed) * fine.feed
        depth = fine.bearable(full, 0.06)
        bend = model.deflection(least, depth, 0.06)
        assert 0.0 < depth <= full and bend <= MAX_BENT_TIMES * model.limit * (1.0 + 1e-6)
        seen += model.deflection(least, full, 0.06) > MAX_BENT_TIMES * model.limit
        # and no shallower than that asks for
        assert depth >= full / 3.0 - 1e-9 or model.deflection(least, full / 3.0, 0.06) > MAX_BENT_TIMES * model.limit
        assert depth >= full / 3.0 - 1e-9 or bend == pytest.approx(MAX_BENT_TIMES * model.limit, rel=1e-3)
    assert seen > 2


def test_figures_for_coolant_are_told_of_where_there_is_none():
    own = {**FLAT, "spindle_rpm": 4000, "feed_mm_min": 300}
    assert dry(JobInputs.of(setup(BALL, own))) == []
    (told,) = dry(JobInputs.of(setup(BALL, own, machine={"coolant": "off"})))
    assert told.kind == "dry" and told.subjects == ("T1",) and "cuts dry" in told.message
    half = {**FLAT, "spindle_rpm": 4000}
    assert [c.subjects for c in dry(JobInputs.of(setup(half, machine={"coolant": "off"})))] == [("T2",)]


@pytest.mark.parametrize("seed", range(len(OVERRIDES)))
def test_no_figure_of_the_demo_tools_is_zero_or_above_a_limit(seed):
    jobs = list(varied(seed, demo_setup()))
    assert len(jobs) == len(MACHINES) * len(MATERIALS)
    assert not [f for job in jobs for f in faults(job)]


def test_the_sweep_notices_what_it_should(monkeypatch):
    """A check that cannot fail is none."""
    job = setup(BALL, machine={"max_rpm": 5000, "max_feed_mm_min": 100})
    cut = JobInputs.of(job).cut_table["T1"]
    for wrong in ({"feed": math.nan}, {"feed": 0.0}, {"plunge_feed": 100.2}, {"spindle_rpm": 5001}, {"spindle_rpm": 0}):
        monkeypatch.setattr(feeds_sweep, "cut_table", lambda _setup, wrong=wrong: {"T1": replace(cut, **wrong)})
        assert faults(job), wrong
    monkeypatch.setattr(feeds_sweep, "cut_table", lambda _setup: {"T1": replace(cut, finish=replace(cut, feed=101.0))})
    assert faults(job) == ["T1 finishing: feed F101 of 100"]


def test_layers_leave_a_share_of_the_deepest_or_lattice_steps_or_the_least_whichever_is_most():
    assert left_by_layers(0.7, 0.08) == 0.06
    assert left_by_layers(1.0, 0.15) == pytest.approx(0.075)
    assert left_by_layers(3.0, 0.15) == pytest.approx(0.12)


def test_a_finish_behind_layers_goes_faster_where_the_setup_gives_no_speed():
    def finish(*tools, **changes):
        return [c.finish.spindle_rpm for c in JobInputs.of(setup(*tools, **changes)).cut_table.values()]

    usual = math.floor(130e3 / (math.pi * 4.0))
    assert finish(FLAT) == [math.floor(1.4 * 130e3 / (math.pi * 4.0))]
    assert finish(FLAT, operations={"roughing": False}) == [usual]
    assert finish({**FLAT, "spindle_rpm": 3000}) == [3000]
    own = {"name": "C45", "cutting_speed_m_min": 130, "feed_per_tooth": [{"diameter_mm": 4, "feed_per_tooth_mm": 0.02}]}
    assert finish(FLAT, material=own) == [usual]
    thin = {"id": "T1", "kind": "ball", "diameter_mm": 0.5}  # layers leave 0.06 mm, more than a tenth of it
    assert finish(thin, machine={"max_rpm": 1e6}) == [math.floor(130e3 / (math.pi * 0.5))]


def test_a_slender_tool_takes_thinner_layers_with_chips_none_too_thin():
    """At the least chip it bends no more than at a fifth of its feed in the deepest layer, and removes no less."""
    slim = {"id": "T1", "kind": "ball", "diameter_mm": 1.0, "flutes": 2, "flute_length_mm": 3, "neck_diameter_mm": 0.9,
            "neck_length_mm": 13, "shank_diameter_mm": 4, "stickout_mm": 29}
    found = setup(slim, material="Ti-6Al-4V")
    cut = JobInputs.of(found).cut_table["T1"]
    full = cutting_data(found.material, found.tools[0], found.machine, 0.3).feed
    assert cut.bending is not None and cut.step_down < 0.3
    assert cut.feed / (2 * cut.spindle_rpm) == pytest.approx(0.002)
    worst = cut.bending.deflection(0.2 * full, 0.3, 0.5)
    assert worst > cut.bend.limit and cut.bend.deflection == pytest.approx(worst, rel=0.03)
    assert cut.step_down * cut.feed > 0.3 * 0.2 * full
    stout = JobInputs.of(setup({**slim, "neck_length_mm": 4, "stickout_mm": 12}, material="AlMgSi1 6082"))
    assert stout.cut_table["T1"].step_down == 0.3


def test_a_tool_that_bends_too_far_is_named_with_its_worst_step():
    far, near = DeflectionEstimate(0.4, 0.05, 0.2, 0.12), DeflectionEstimate(0.06, 0.05, 0.8, 0.05)
    steps = [replace(step(1, SLIM, "depth_layers"), bend=near), replace(step(2, SLIM, "depth_layers"), bend=far),
             replace(step(3, SLIM, "waterline"), bend=DeflectionEstimate(0.004, 0.005, 1.0, 0.004)),
             step(4, SLIM, "zigzag"),
             replace(step(5, SLIM, "waterline"), bend=DeflectionEstimate(0.02, 0.005, 1.0, 0.02, fixed=True))]
    told = bent(steps)
    assert [c.subjects for c in told] == [("T1", "S01", "S02"), ("T1", "S05")]
    assert told[0].sentence == ("tool T1 in S02 depth_layers and 1 other steps, roughing: its tip would bend "
                                "0.400 mm (limit 0.050 mm); the plan lowers its feed to 20 %, where it bends 0.120 mm; "
                                "a shorter or thicker tool keeps its feed")
    assert (told[0].measured, told[0].limit) == (0.4, 0.05) and "given by the setup" in told[1].remedy


def test_a_tool_that_does_not_cut_to_its_centre_is_told_of_where_it_goes_down_into_stock():
    asked = {"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 6.0, "center_cutting": False},
                       {"id": "T2", "kind": "flat", "diameter_mm": 4.0}]}
    wanted = parse_setup(json.dumps(asked))
    t1, t2 = tool_bodies(wanted)
    layers = [replace(step(k, t, "depth_layers"), operation="roughing") for k, t in ((1, t1), (2, t2))]
    (told,) = uncut_centres(JobInputs.of(wanted), layers)
    assert told.kind == "center_cutting" and told.subjects == ("T1",) and told.measured == 0.75
    assert "drill" in told.remedy and told.limit == 6.0
    assert not uncut_centres(JobInputs.of(wanted), [step(1, t1, "waterline"), layers[1]])
