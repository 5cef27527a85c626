"""Loads on tools in their cuts: findings over what any cutter bears, cautions over what tool and material recommend."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.cutting_mechanics import bending_stress, compliance, cutting_force, cutting_forces, cutting_powers
from geometry.tool_body import ToolBody
from schemas.tools import Tool
from service.cutting_data import MATERIALS, cutting_words
from tests.pocket_case import SETUP, block, program, scored, text
from verify.kinematics import Kinematics
from verify.material.cutting_loads import _lengths
from verify.model import NcProgram, ScoredSamples
from verify.moves import Moves
from verify.prove import prove
from verify.tool_axes import ToolAxes

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))
MILL = ToolBody("T1", 1, 4.0, 0.0, 12.0, 4.0, 12.0, 4.0, 30.0)
WORDS = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="flat", diameter_mm=4.0, flutes=4))


def judged(lines, words=WORDS, tool=MILL, setup=SETUP, turn=None):
    head = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
    whole = NcProgram("p", text([*head, *lines, "G0 Z20", "M5", "M30", "%"]), turn)
    proof = prove([whole], PART, (tool,), replace(setup, cutting={1: words}), NOBODY, (), threads=2)
    return [f for f in proof.findings if f.kind == "load"], {c.kind: c for c in proof.cautions}


def slot(deep, feed, speed=8000):
    """A slot along X through the outside of the block, in from the side."""
    return [f"S{speed} M3", "G0 X-26 Y12", f"Z{0.5 - deep:.4f}", f"G1 X26 F{feed}"]


def test_a_sound_slot_has_neither_finding_nor_caution():
    assert judged(slot(0.4, 600), tool=replace(MILL, stickout=16.0)) == ([], {})


def test_a_feed_per_tooth_over_a_fifth_of_the_diameter_is_a_load():
    found, cautions = judged(slot(0.4, 6000, 100))
    assert [(f.line, f.limit) for f in found] == [(9, pytest.approx(0.8))] and found[0].depth == pytest.approx(15.0)
    assert "0.800 mm" in found[0].message and "chip_load" not in cautions
    found, cautions = judged(slot(0.2, 3000, 2000))  # 0.375 mm
    assert found == [] and cautions["chip_load"].measured == pytest.approx(0.375)
    assert cautions["chip_load"].limit == pytest.approx(WORDS.per_tooth) and cautions["chip_load"].line == 9


@pytest.mark.parametrize(("feed", "pitch", "a_turn"), [
    (400, None, None), (400, 0.8, None), (407, 0.8, None), (410, 0.8, 0.82), (390, 0.8, 0.78), (1300, None, 2.6),
    (19, None, 0.038), (21, None, None)])
def test_a_tap_goes_on_by_its_pitch(feed, pitch, a_turn):
    tap = replace(MILL, named="tap")
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="tap", diameter_mm=4.0, pitch_mm=pitch))
    found, cautions = judged(["S500 M3", "G0 X-26 Y12", "G0 X0 Y0", "Z2", f"G1 Z-3 F{feed}", "Z2"], words, tap)
    assert "chip_load" not in cautions
    assert [(f.line, f.depth) for f in found] == ([] if a_turn is None else [(10, pytest.approx(a_turn))])
    if found:
        assert ("its pitch is 0.8 mm" if pitch else "pitches of 0.04 to 2 mm") in found[0].message


def test_a_tap_comes_out_with_the_pitch_with_which_it_went_in():
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="tap", diameter_mm=4.0))
    for feed, line in ((400, None), (405, None), (625, 11)):
        found, _ = judged(["S500 M3", "G0 X0 Y0", "Z2", "G1 Z-3 F400", f"G1 Z-4 F{feed}", "Z2"], words,
                          replace(MILL, named="tap"))
        assert [f.line for f in found] == [] if line is None else [10]


@pytest.mark.parametrize(("feed", "harm"), [(95, False), (105, True)])
def test_a_drill_bears_a_tenth_of_its_diameter_in_a_turn(feed, harm):
    """4 mm with two lips: 0.4 mm in a turn."""
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="drill", diameter_mm=4.0))
    drill = replace(MILL, named="drill", tip_diameter=0.0, cone_height=1.2)
    found, _ = judged(["S250 M3", "G0 X0 Y0", "Z2", f"G1 Z-3 F{feed}", "G0 Z2"], words, drill)
    assert [(f.line, f.limit) for f in found] == [(9, pytest.approx(0.2))] * harm
    assert not harm or "any drill bears" in found[0].message


@pytest.mark.parametrize(("feed", "harm"), [(95, False), (105, True)])
def test_a_chamfer_mill_that_goes_straight_down_is_judged_as_a_drill(feed, harm):
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="chamfer", diameter_mm=4.0))
    mill = replace(MILL, named="chamfer", tip_diameter=0.0, cone_height=2.0)
    found, _ = judged(["S250 M3", "G0 X0 Y0", "Z2", f"G1 Z-1.5 F{feed}", "G0 Z2"], words, mill)
    assert [(f.line, f.limit) for f in found] == [(9, pytest.approx(0.2))] * harm
    assert judged(["S250 M3", "G0 X-26 Y12", "Z0", "G1 X26 F200"], words, mill)[0] == []


LARGE = ToolBody("T1", 1, 16.0, 0.0, 30.0, 16.0, 30.0, 16.0, 32.0)
TALL = replace(SETUP, margin=20.0, line_spacing=0.5)  # the blank goes up to Z20, X and Y 20 beyond the part


@pytest.mark.parametrize(("power", "feed", "harm", "told"), [
    (None, 1500, None, False), (20.0, 1500, None, False), (8.0, 1500, None, True), (5.0, 1500, 10.0, False)])
def test_a_cut_that_needs_more_power_than_the_machine_has(power, feed, harm, told):
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="flat", diameter_mm=16.0, flutes=4), power)
    found, cautions = judged(["S3000 M3", "G0 Z60", "X-52 Y2", "Z12", f"G1 X52 F{feed}"], words, LARGE, TALL)
    need = float(cutting_powers(WORDS.kc, WORDS.mc, np.array([feed / 12000.0]), np.array([8.0]), np.array([16.0]),
                                np.array([float(feed)]), LARGE)[0])
    assert 10.0 < need < 16.0 and ("power" in cautions) == told
    assert [(f.limit, f.depth) for f in found] == ([] if harm is None else [(harm, pytest.approx(need, rel=0.1))])


def test_no_machining_centre_has_the_power_torque_or_thrust():
    """A mill as wide as long bends little, so that the machine gives way first."""
    wide = replace(LARGE, diameter=40.0, neck_diameter=40.0, shank_diameter=40.0)
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="flat", diameter_mm=40.0, flutes=6))
    for speed, feed, unit in ((2000, 9000, "kW"), (100, 1600, "Nm"), (600, 300, "")):
        found, _ = judged([f"S{speed} M3", "G0 Z60", "X-70 Y0", "Z5", f"G1 X70 F{feed}"], words, wide, TALL)
        assert [f"{unit}; more than any" in f.message for f in found] == [True] * (unit != "")
    drill = replace(wide, named="drill", cone_height=12.0)
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="drill", diameter_mm=40.0, flutes=2))
    for feed, harm in ((1150, True), (100, False)):
        found, _ = judged(["S300 M3", "G0 Z60", "X0 Y0", "Z25", f"G1 Z5 F{feed}", "G0 Z25"], words, drill, TALL)
        assert [" N; more than any machine bears" in f.message for f in found] == [True] * harm


@pytest.mark.parametrize(("feed", "harm"), [(1.9, True), (0.4, False)])
def test_a_slender_drill_buckles(feed, harm):
    """1 mm, 60 mm long: it bears 68 N; 0.095 mm in a turn needs about 80."""
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="drill", diameter_mm=1.0))
    slim = ToolBody("T1", 1, 1.0, 0.0, 50.0, 1.0, 50.0, 1.0, 60.0, named="drill", cone_height=0.3)
    found, _ = judged(["S20 M3", "G0 X12 Y12", "Z2", f"G1 Z-3 F{feed}", "G0 Z2"], words, slim)
    assert [f.line for f in found] == [9] * harm
    assert not harm or "it buckles at" in found[0].message


def test_the_speed_of_a_tap_is_bounded_by_that_of_mills():
    """130 m/min in C45 are 10345 1/min at 4 mm."""
    words = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="tap", diameter_mm=4.0))
    for speed, harm, kinds in ((4000, False, []), (5000, False, ["cutting_speed"]), (10400, True, [])):
        found, cautions = judged([f"S{speed} M3", "G0 X0 Y0", "Z2", f"G1 Z-3 F{0.7 * speed:g}", "Z2"], words,
                                 replace(MILL, named="tap"))
        assert [f.limit for f in found] == [130.0] * harm and list(cautions) == kinds
        assert not harm or "more than any tap bears" in found[0].message


def test_a_speed_over_thirty_times_the_recommended_one_is_a_load():
    found, _ = judged(slot(0.4, 60000, 400000))
    assert [f.depth for f in found] == [pytest.approx(math.pi * 4.0 * 400.0)] and found[0].limit == 30.0 * 130.0
    found, cautions = judged(slot(0.4, 2000, 24000))
    assert found == [] and cautions["cutting_speed"].measured == pytest.approx(math.pi * 4.0 * 24.0)


def closed_form(deep, width, feed, speed, tool=MILL):
    force = cutting_force(WORDS.kc, WORDS.mc, feed / (speed * 4), deep, width, tool, 4)
    return *bending_stress(tool, force, deep), force * compliance(tool)


@pytest.mark.slow
@pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
def test_stress_and_deflection_of_a_slot_are_those_of_the_closed_form(turn):
    stress, strong, bend = closed_form(6.0, 4.0, 3000, 8000)
    assert stress > strong
    found, cautions = judged(slot(6.0, 3000), turn=turn)
    assert [f.depth for f in found] == [pytest.approx(stress, rel=0.1)] and found[0].limit == pytest.approx(strong)
    assert cautions["deflection"].measured == pytest.approx(bend, rel=0.1)
    assert cautions["depth_of_cut"].measured == pytest.approx(24.0, rel=0.1)
    stress, strong, bend = closed_form(1.0, 4.0, 600, 8000)
    assert stress < strong
    found, cautions = judged(slot(1.0, 600), turn=turn)
    assert found == [] and ("deflection" in cautions) == (bend > WORDS.bend)


@pytest.mark.slow
def test_a_load_does_not_depend_on_how_the_program_is_divided():
    pieces = [f"G1 X{-26 + 0.2 * k:.3f} F3000" for k in range(1, 261)]
    whole, parts = judged(slot(6.0, 3000))[0], judged([*slot(6.0, 3000)[:-1], *pieces])[0]
    assert parts[0].depth == pytest.approx(whole[0].depth, rel=0.1)
    shallow = ["G1 X-26 Y13.9 F3000", "X26", "X-26 Y13.9"]  # a long way in air and along the edge before and after
    assert judged([*slot(6.0, 3000)[:-1], *shallow, "Y12", "X26"])[0]


@pytest.mark.parametrize("last", [0.2, 0.4, 0.7])
def test_a_link_that_begins_where_a_cut_ends_does_not_count_at_its_feed(last):
    """The last piece of the cut and the first of the way back through air share a window."""
    cut = [*slot(3.0, 300)[:-1], "G1 X0 F300", f"X{last}"]
    assert judged([*cut, "X-26 F12000"])[0] == []
    (found,) = judged([*cut, f"X{last + 0.5} F12000"])[0]  # ahead it goes into stock
    assert "F12000" in found.message


def test_short_bursts_in_a_cut_count_at_their_feed():
    bursts = [f"G1 X{-26 + 0.2 * k:.3f} F{3000 if k % 2 else 60}" for k in range(1, 261)]
    assert closed_form(6.0, 4.0, 60, 8000)[0] < closed_form(6.0, 4.0, 60, 8000)[1]
    found, _ = judged([*slot(6.0, 3000)[:-1], *bursts])
    assert found and "F3000" in found[0].message


def test_a_tool_that_bends_ten_times_its_limit_is_a_load():
    slim = replace(MILL, stickout=60.0)
    for deep, harm in ((0.25, False), (0.6, True)):
        _, _, bend = closed_form(deep, 4.0, 600, 8000, slim)
        assert (bend > 0.5) == harm
        found, cautions = judged(slot(deep, 600), tool=slim)
        assert [(f.line, f.limit) for f in found] == [(9, 0.5)] * harm and "deflection" in cautions
        assert not harm or 0.9 * bend < found[0].depth <= bend * 1.001  # for the least width that the stock shows


def test_layers_of_a_slot_bend_no_more_than_each_of_them():
    """Lines of the stock on the very edge of the slot go with each pass, so none is told deeper than it is."""
    slim, two = replace(MILL, stickout=56.0), replace(WORDS, flutes=2)
    layers = ["G0 X-26 Y12", "Z0.5"]
    for k in range(1, 7):
        layers += [f"G1 Z{0.5 - 0.5 * k:.4f} F400", f"X{26 if k % 2 else -26} F300"]
    bend = cutting_force(two.kc, two.mc, 300 / (8000 * 2), 0.5, 4.0, slim, 2) * compliance(slim)
    assert 0.35 < bend < 0.48
    found, cautions = judged(layers, two, slim)
    assert found == [] and cautions["deflection"].measured == pytest.approx(bend, rel=0.12)
    assert "0.50 mm depth" in cautions["deflection"].message


def test_a_slot_of_a_tapered_mill_bends_it_as_its_section_and_its_cone_say():
    """1.5 mm deep with a flat of 2 mm and a side of 20 degrees: the mean width of the slot is that half way up."""
    cone = ToolBody("T1", 1, 2.0, 0.0, 6.0, 6.0, 6.0, 6.0, 45.0, taper=math.tan(math.radians(20.0)))
    width = 2.0 + 1.5 * cone.taper
    force = cutting_force(WORDS.kc, WORDS.mc, 600 / (8000 * 4), 1.5, width, cone, 4)
    bend = force * compliance(cone)
    _, cautions = judged(slot(1.5, 600), replace(WORDS, bend=0.5 * bend), cone)
    assert cautions["deflection"].measured == pytest.approx(bend, rel=0.08)
    assert "1.50 mm depth" in cautions["deflection"].message
    _, cautions = judged(slot(1.5, 1000, 30000), tool=cone)
    top = 2.0 * (1.0 + 1.5 * cone.taper)
    assert cautions["cutting_speed"].measured == pytest.approx(math.pi * top * 30.0, rel=1e-6)


def climbing(degrees):
    """Up through the full height of the block, from beside it."""
    rise = 6.0 * math.tan(math.radians(degrees))
    return ["G0 X-25 Y0", "Z-9", "G1 X-22.6 F3000", f"G1 X-16.6 Z{rise - 9.0:.4f}"]


@pytest.mark.parametrize("degrees", [44, 46, 65])
def test_a_tool_that_climbs_steeply_through_stock_is_a_load(degrees):
    found, _ = judged(climbing(degrees))
    assert [f.line for f in found] == [9] and found[0].depth > found[0].limit
    assert degrees == 65 or found[0].depth == pytest.approx(13400.0, rel=0.03)  # no step at 45 degrees


@pytest.mark.parametrize(("turn", "feed", "harm"), [("B20", 1000, True), ("B-20", 1000, True), ("B20", 20, False),
                                                    ("B-20", 5, False)])
def test_a_tool_that_swings_about_its_tip_has_the_feed_of_its_edge(turn, feed, harm):
    """One way the flank goes into the stock, the other way the rim of the end; the tip goes 0.01 mm."""
    setup = replace(SETUP, kinematics=Kinematics("table-table-BC"))
    lines = ["M428", "G0 X-26 Y-16", "Z-4", "G1 X0 F200", f"G1 X0.01 {turn} F{feed}", "G1 Y-40 F500", "G0 Z60", "B0",
             "M429"]
    found, _ = judged(lines, setup=setup)
    assert [(f.line, f.depth > f.limit, "its edge is fastest" in f.message) for f in found] == [(10, True, True)] * harm


def test_ways_of_places_of_a_tool_that_swings():
    start, end = np.array([[0.0, 0.0, 1.0]]), np.array([[math.sin(0.1), 0.0, math.cos(0.1)]])
    moves = Moves(np.zeros((1, 3)), np.array([[0.5, 0.0, 0.0]]), np.ones(1, np.bool_), np.zeros(1, np.int32),
                  ToolAxes.between(start, end))
    fast, middle = _lengths(moves, np.array([8.0]), [MILL])
    assert fast[0] == pytest.approx(math.hypot(0.5 + 8 * math.sin(0.1), 8 * (1 - math.cos(0.1))))
    assert middle[0] == pytest.approx(math.hypot(0.5 + 4 * math.sin(0.1), 4 * (1 - math.cos(0.1))))
    assert _lengths(moves, np.array([40.0]), [MILL])[1] < 1.2  # no more of it than the flutes
    fast, _ = _lengths(moves, np.array([0.0]), [MILL])
    assert fast[0] == pytest.approx(np.hypot(0.5, 0.2), rel=0.02)  # the rim of the end, 2 mm off the axis
    ball = replace(MILL, corner_radius=2.0)
    assert _lengths(moves, np.array([0.0]), [ball])[0][0] == pytest.approx(0.5)
    assert _lengths(replace(moves, axes=None), np.array([8.0]), [MILL])[0].tolist() == [0.5]


def test_a_narrow_finish_as_deep_as_the_slot_is_no_load():
    lines = ["G0 X-26 Y17.3", "Z-5.5", "G1 X26 F3000"]  # 0.2 mm of the side
    assert judged(lines)[0] == []


def test_what_the_tool_states_is_a_caution():
    words = replace(WORDS, rpm=5000.0, feed=300.0, plunge_feed=50.0, life=0.02, coolant=True)
    proof = prove([NcProgram("p", text(program()))], PART, (replace(MILL, stickout=30.0),),
                  replace(SETUP, cutting={1: words}), NOBODY, (), threads=2)
    data = [c for c in proof.cautions if c.kind == "tool_data"]
    assert [(c.limit, c.measured > c.limit, c.line > 0) for c in data] == [
        (limit, True, True) for limit in (5000.0, 300.0, 0.02)]
    assert data[0].measured == 8000.0 and not [f for f in proof.findings if f.kind == "load"]
    assert [c.kind for c in proof.cautions if c.kind == "coolant"] == ["coolant"]
    kept = replace(WORDS, rpm=8000.0, feed=5000.0, plunge_feed=5000.0, life=100.0, coolant=False)
    proof = prove([NcProgram("p", text(program()))], PART, (MILL,), replace(SETUP, cutting={1: kept}), NOBODY, ())
    assert not [c for c in proof.cautions if c.kind in ("tool_data", "coolant")]


def test_a_fresh_cutter_begins_a_new_life():
    words = replace(WORDS, life=0.14)
    one = ["G0 X-26 Y12", "Z0.1", "G1 X26 F600", "G0 Z20"]
    two = ["G0 X-26 Y-12", "Z0.1", "G1 X26 F600"]
    assert "tool_data" in judged([*one, *two], words)[1]
    assert "tool_data" not in judged([*one, "M5", "M0", "S8000 M3", *two], words)[1]


@pytest.mark.parametrize("wait, harm", [("G4 P1", True), ("G4 P0.05", False)])
def test_a_dwell_in_the_cut(wait, harm):
    lines = ["G0 X-26 Y12", "Z0.1", "G1 X0 F600", wait, "X26"]
    cautions = judged(lines)[1]
    assert ("dwell" in cautions) == harm
    if harm:
        assert cautions["dwell"].line == 9 and cautions["dwell"].measured == pytest.approx(8000 / 60)
    assert "dwell" not in judged(["G4 P1", "G0 X-26 Y12", "Z0.1", "G1 X26 F600", "X40", "G4 P1"])[1]


@pytest.mark.parametrize("stop", ["M0", "M1"])
def test_a_program_stop_in_the_cut(stop):
    cautions = judged(["G0 X-26 Y12", "Z0.1", "G1 X0 F600", stop, "X26"])[1]
    assert cautions["dwell"].line == 9 and "until the operator goes on" in cautions["dwell"].message
    assert "dwell" not in judged(["G0 X-26 Y12", "Z0.1", "G1 X26 F600", "X40", stop, "X41"])[1]


def test_a_plunge_that_is_too_fast():
    lines = ["G0 X-12 Y12", "Z1", "G1 Z0.2 F3000", "X26 F600"]
    assert judged(lines)[1]["plunge_feed"].line == 8
    assert "plunge_feed" not in judged(["G0 X-12 Y12", "Z1", "G1 Z0.2 F300", "X26 F600"])[1]


def test_many_forces_at_once_are_those_one_by_one():
    rng = np.random.default_rng(4)
    for corner in (0.0, 0.5, 2.0):
        tool = replace(MILL, corner_radius=corner)
        fz, a, ae = rng.uniform(0.001, 0.3, 200), rng.uniform(0.01, 10.0, 200), rng.uniform(0.01, 4.0, 200)
        want = [cutting_force(2640.0, 0.24, *row, tool, 4) for row in zip(fz, a, ae, strict=True)]
        np.testing.assert_allclose(cutting_forces(2640.0, 0.24, fz, a, ae, tool, 4), want, rtol=1e-12)
