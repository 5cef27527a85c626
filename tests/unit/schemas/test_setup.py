"""SETUP.json: defaults, refusals with sentences, canonical form."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geometry.errors import SetupError
from schemas.materials import MATERIALS, find_material
from schemas.setup import Setup, canonical_json, content_hash, setup_sha256
from schemas.tools import BUILT_KINDS
from service.cutting_data import cutting_data, feed_per_tooth
from service.from_wire import (
    check_plannable,
    check_spindle_tool,
    face_numbers,
    machine_kinematics,
    parse_setup,
    rotary_limits,
    rotary_machine,
    tool_bodies,
)

TOOL = {"id": "T1", "kind": "ball", "diameter_mm": 3}
FIVE = {"kind": "5-axis", "kinematics": "table-table-AC"}
HOLDER = [{"diameter_mm": 20, "length_mm": 30}]


def setup(**fields):
    return {"tools": [TOOL], **fields}


def tool(**fields):
    return {"tools": [{**TOOL, **fields}]}


def test_only_tools_are_needed_and_defaults_are_those_of_the_design():
    found = Setup.model_validate(setup())
    assert found.placement.z_axis == [0, 0, 1] and found.access[0].work_offset == "G54"
    assert found.clearance_mm.model_dump() == {"neck": 0.05, "shank": 0.2, "holder": 1.0, "rapid": 1.0,
                                                "approach": 0.0}
    assert found.quality.model_dump() == {"scallop_height_mm": 0.01, "chordal_tolerance_mm": 0.002,
                                          "gouge_tolerance_mm": 0.01, "stock_allowance_mm": 0, "coverage_min": 0}
    assert (found.stock.kind, found.stock.margin_mm, found.stock.uncertainty_mm) == ("part_offset", 1, 0.5)
    assert found.machine.dialects == ["linuxcnc"] and found.material.name == "Ti-6Al-4V"
    assert found.operations.cut_direction == "climb" and found.labels == {}


def test_a_tool_that_leaves_lengths_out_is_straight():
    (body,) = tool_bodies(parse_setup(setup()))
    assert (body.corner_radius, body.flute_length, body.neck_diameter, body.neck_length, body.shank_diameter,
            body.stickout, body.number, body.kind) == (1.5, 9, 3, 9, 3, 30, 1, "ball")
    (body,) = tool_bodies(parse_setup(tool(stickout_mm=5, holder=HOLDER)))
    assert (body.flute_length, body.neck_length, body.holder[0].diameter_top) == (5, 5, 20)


@pytest.mark.parametrize(("given_setup", "words"), [
    ({}, "no tools"), ({"tools": []}, "no tools"),
    (tool(diameter_mm=-3), "equal to 0.01"), (tool(stickout_mm=-1), "greater than or equal to 0.001"),
    (tool(diameter_mm=1e-300), "greater than or equal to 0.01"),
    (setup(material={"name": "x", "cutting_speed_m_min": 1e-300, "feed_per_tooth": [
        {"diameter_mm": 1, "feed_per_tooth_mm": 0.01}]}), "greater than or equal to 0.1"),
    (tool(diameter_mm="3"), "valid number"), (tool(diameter_mm=True), "valid number"),
    (tool(diameter_in=0.1), "unknown field"), (setup(units="inch"), "unknown field"),
    (tool(flute_length_mm=30, neck_length_mm=10), "flute_length_mm <= neck_length_mm <= stickout_mm"),
    (tool(neck_length_mm=40, stickout_mm=20), "neck_length_mm 40 is longer than stickout_mm 20"),
    (tool(gauge_length_mm=20), "gauge_length_mm"),
    (tool(neck_diameter_mm=4, neck_length_mm=20), "a neck is relieved"),
    (tool(neck_diameter_mm=2.8), "without neck_length_mm"), (tool(holder=HOLDER), "needs stickout_mm"),
    (tool(flute_length_mm=1), "shorter than the corner radius"),
    (tool(corner_radius_mm=1), "half its diameter"), (tool(corner_radius_mm=2), "larger than half"),
    (tool(kind="flat", corner_radius_mm=1), "use kind bull"), (tool(kind="bull"), "use kind flat"),
    (tool(kind="barrel"), "needs profile_radius_mm"),
    (tool(kind="lollipop"), "'lens', 'barrel'"),
    (tool(point_angle_deg=118), "belongs to kinds drill, tap and chamfer"),
    (tool(kind="drill", tip_diameter_mm=1), "a drill has a point"),
    (tool(kind="drill", corner_radius_mm=1), "has corner_radius_mm 0"),
    (tool(kind="drill", point_angle_deg=181), "less than or equal to 180"),
    (tool(kind="drill", flute_length_mm=0.5), "shorter than the cone at its end, 0.901291 high"),
    (tool(kind="chamfer", tip_diameter_mm=3), "is not below diameter_mm 3"),
    (tool(kind="chamfer", point_angle_deg=180), "has no cone; use kind flat"),
    (tool(kind="tap", point_angle_deg=60), "the lead of a tap needs tip_diameter_mm"),
    (tool(kind="tap", tip_diameter_mm=2), "needs point_angle_deg"),
    (tool(kind="thread_mill", point_angle_deg=60), "belongs to kinds drill, tap and chamfer"),
    (tool(kind="drill", pitch_mm=1), "belongs to kinds tap and thread_mill"),
    (tool(number=0), "greater than or equal to 1"),
    (setup(quality={"scallop_height_mm": 1.5}), "radius 1.5 of the smallest tool T1"),
    (setup(quality={"scallop_height_mm": 0}), "greater than or equal to 0.0001"),
    (setup(quality={"scallop_height_mm": 1e-300}), "greater than or equal to 0.0001"),
    (setup(quality={"chordal_tolerance_mm": 1e-5}), "greater than or equal to 0.0001"),
    (setup(quality={"gouge_tolerance_mm": 1e-4}), "greater than or equal to 0.001"),
    (setup(placement={"origin_mm": [1e300, 0, 0]}), "less than or equal to 1000000"),
    (setup(placement={"origin_mm": [0, -1e7, 0]}), "greater than or equal to -1000000"),
    (setup(placement={"z_axis": [1e308, 1e308, 0], "x_axis": [0, 0, 1e308]}), "less than or equal to 1000000"),
    (setup(placement={"x_axis": [1e-7, 0, 0]}), "placement.x_axis has length 1e-07"),
    (setup(access=[{"direction": [0, 0, 1e-300]}]), "almost zero length"),
    (setup(fixtures=[{"box_mm": [[0, 0, 0], [1, 1, 1e7]]}]), "less than or equal to 1000000"),
    (setup(stock={"kind": "box", "box_mm": [[-1e308, 0, 0], [1, 1, 1]]}), "greater than or equal to -1000000"),
    (setup(machine={"max_feed_mm_min": 1e-300}), "greater than or equal to 0.1"),
    ({"tools": [[]]}, "a JSON object"),
    (setup(access=[{"id": "A1"}, {"id": "A2", "direction": [0, 0, 3]}]), "has the same direction as A1"),
    (setup(access=[{"id": "A1"}, {"id": "A1", "direction": [0, 0, -1]}]), "two accesses have the id A1"),
    (setup(access=[]), "at least 1"),
    (setup(machine={"kind": "5-axis"}), "machine.kinematics is needed"),
    (setup(machine={"kinematics": "table-table-AC"}), "5-axis machine"),
    (setup(machine={**FIVE, "rotary_deg": [[-30, 30], [10, 10]]}), "machine.rotary_deg of C: 10 is not below 10"),
    (setup(machine={**FIVE, "rotary_deg": [[-30, 30]]}), "at least 2"),
    (setup(machine={**FIVE, "pivots_mm": [[0, 0, 0]]}), "machine.pivots_mm has 1 points, table-table-AC takes 2"),
    (setup(machine={**FIVE, "kinematics": "head-head-BC", "pivots_mm": [[0, 1, 50]]}), "begins with [0, 0, distance"),
    (setup(machine={"rotary_rate_deg_min": 100}), "5-axis machine"),
    (setup(machine={"dialects": ["fagor"]}), "not built"),
    (setup(machine={"pivots_mm": [[0, 0, 0]]}), "5-axis machine"),
    (setup(stock={"step_file": "blank.step"}), "belongs to stock.kind 'step'"),
    (setup(stock={"kind": "step", "step_file": ""}), "at least 1 character"),
    (setup(stock={"cylinder_mm": {"bottom": 0, "diameter": 5, "height": 5}}), "belongs to stock.kind 'cylinder'"),
    (setup(stock={"kind": "cylinder", "cylinder_mm": {"bottom": 0, "diameter": 0, "height": 5}}), "greater than 0"),
    (setup(stock={"box_mm": [[0, 0, 0], [1, 1, 1]]}), "belongs to stock.kind 'box'"),
    (setup(stock={"kind": "box", "box_mm": [[0, 0, 0], [1, 0, 1]]}), "above the first"),
    (setup(fixtures=[{"box_mm": [[0, 0, 2], [1, 1, 1]]}]), "above the first"),
    (setup(placement={"z_axis": [0, 0, 0]}), "zero length"), (setup(placement={"x_axis": [0, 1, 1]}), "right angles"),
    (setup(operations={"roughing": False, "finishing": False}), "nothing to do"),
    (setup(operations={"faces": []}), "names no face"),
    (setup(operations={"roughing": False, "semi_finishing": True}), "needs operations.roughing"),
    (setup(operations={"lean": {"tilt_deg": 15}}), "set machine.kind '5-axis'"),
    (setup(operations={"lean": {"tilt_deg": 15}}, machine={**FIVE, "simultaneous": False}), "5-axis"),
    (setup(operations={"lean": {"tilt_deg": 61}}, machine=FIVE), "60"),
    (setup(operations={"faces": ["F1"], "exclude_faces": ["F1"]}), "F1"),
    (setup(operations={"faces": ["12"]}), "pattern"),
    (setup(material="cheese"), "Inconel 718"), (setup(material="lib:x"), "no entry 'x'"),
    (setup(labels={"a": "new\nline"}), "pattern"),
    ({"tools": [TOOL, TOOL]}, "unique"), ({"tools": [TOOL, {**TOOL, "id": "X", "number": 1}]}, "own number"),
])
def test_what_is_wrong_is_said(given_setup, words):
    with pytest.raises(SetupError) as caught:
        parse_setup(json.dumps(given_setup))
    assert any(words in p["problem"] for p in caught.value.measured), caught.value.measured
    assert caught.value.subjects and caught.value.remedy


def test_a_machine_of_five_axes_in_the_words_of_proof_and_writers():
    given_setup = parse_setup(setup(machine={**FIVE, "rotary_deg": [[-30, 120], [-360, 360]],
                                             "pivots_mm": [[0, 0, -50], [0, 0, -20]]}))
    found = machine_kinematics(given_setup.machine)
    assert (found.kind, found.pivots) == ("table-table-AC", ((0, 0, -50), (0, 0, -20)))
    np.testing.assert_allclose(rotary_limits(given_setup.machine), np.radians([[-30, 120], [-360, 360]]))
    written = rotary_machine(given_setup.machine)
    assert (written.kind, written.pivots, written.tcp) == (found.kind, found.pivots, True)
    assert machine_kinematics(parse_setup(setup(machine=FIVE)).machine).pivots is None
    plain = parse_setup(setup())
    assert machine_kinematics(plain.machine) is None and rotary_limits(plain.machine) is None
    assert rotary_machine(plain.machine) is None
    check_plannable(given_setup)
    check_plannable(plain)
    check_plannable(parse_setup(setup(machine={**FIVE, "rapid_motion": "dogleg",
                                               "pivots_mm": [[0, 0, -50], [0, 0, -20]]})))


@pytest.mark.parametrize(("machine", "access", "code", "subject"), [
    ({"rotary_deg": [[-30, 60], [-360, 360]]}, [{}, {"id": "A2", "direction": [1, 0, 0]}], "access_out_of_reach", "A2"),
    ({}, [{}, {"id": "A2", "direction": [1, 0, 1], "work_offset": "G55"}], "two_clampings", "A2"),
    ({"rotary_deg": [[10, 60], [-360, 360]]}, [{}], "no_rotary_zero", "machine.rotary_deg"),
    ({}, [{}, {"id": "A2", "direction": [0, 0.3, -1]}], "access_from_below", "A2"),
    ({"rapid_motion": "dogleg"}, [{}], "dogleg_rapids", "machine.pivots_mm"),
    ({"rapid_motion": "dogleg", "kinematics": "head-head-BC", "pivots_mm": [[0, 0, 90]]}, [{}], "dogleg_rapids",
     "machine.rapid_motion"),
    ({"kinematics": "head-head-BC", "tcp": False, "pivots_mm": [[0, 0, 90]]}, [{}], "no_gauge_length", "T1"),
    ({"tcp": False}, [{}], "no_pivots", "machine.pivots_mm")])
def test_what_a_machine_of_five_axes_cannot_do_is_said(machine, access, code, subject):
    with pytest.raises(SetupError) as caught:
        check_plannable(parse_setup(setup(machine={**FIVE, **machine}, access=access)))
    assert caught.value.code == code and subject in caught.value.subjects and caught.value.remedy


@pytest.mark.parametrize(("given", "cone", "flutes", "tip"), [
    ({"kind": "drill"}, 1.5 / math.tan(math.radians(59)), 9.0, 0.0),
    ({"kind": "drill", "point_angle_deg": 180}, 0.0, 9.0, 0.0),
    ({"kind": "chamfer", "tip_diameter_mm": 1}, 1.0, 1.0, 1.0),
    ({"kind": "tap"}, 0.0, 9.0, 0.0), ({"kind": "tap", "point_angle_deg": 90, "tip_diameter_mm": 2.4}, 0.3, 9.0, 2.4),
    ({"kind": "thread_mill", "flute_length_mm": 6, "neck_diameter_mm": 2, "neck_length_mm": 12}, 0.0, 6.0, 0.0)])
def test_tools_of_programs_to_be_verified_have_their_cone_and_are_not_planned(given, cone, flutes, tip):
    one = parse_setup({"tools": [{"id": "T1", "diameter_mm": 3, **given}], "quality": {"scallop_height_mm": 0.05}})
    body = tool_bodies(one)[0]
    assert body.kind == given["kind"] and body.tip_diameter == tip and body.corner_radius == 0.0
    assert (body.cone_height, body.flute_length) == pytest.approx((cone, flutes))
    assert canonical_json(parse_setup(canonical_json(one))) == canonical_json(one)
    with pytest.raises(SetupError, match=rf"T1 \({given['kind']}\)") as caught:
        check_plannable(one)
    assert caught.value.code == "verify_only_tool" and caught.value.limit == list(BUILT_KINDS)


def test_the_tool_in_the_spindle_is_one_of_the_setup():
    given_setup = parse_setup({"tools": [{**TOOL, "id": "T7"}, {**TOOL, "id": "T3"}]})
    check_spindle_tool(given_setup, 0)
    check_spindle_tool(given_setup, 7)
    with pytest.raises(SetupError, match="no tool T5 .* it has T3, T7") as caught:
        check_spindle_tool(given_setup, 5)
    assert caught.value.code == "no_such_tool"


def test_numbers_are_the_digits_of_the_id_where_unique_else_the_place():
    def numbers(*ids):
        return [t.number for t in parse_setup({"tools": [{**TOOL, "id": i} for i in ids]}).tools]

    assert numbers("T7", "T3") == [7, 3]
    assert numbers("A", "B") == [1, 2]
    assert numbers("T1a", "T1b", "T9") == [1, 2, 9]


def test_the_canonical_form_sees_meaning_only():
    plain = parse_setup(setup())
    written = parse_setup(setup(stock={"margin_mm": 1, "uncertainty_mm": 0.50}, material="ti6al4v", labels={}))
    assert canonical_json(plain) == canonical_json(written)
    again = parse_setup(canonical_json(plain))
    assert setup_sha256(again) == setup_sha256(plain)
    assert setup_sha256(parse_setup(setup(stock={"margin_mm": 2}))) != setup_sha256(plain)
    assert content_hash(b"a", plain) != content_hash(b"b", plain)


@given(st.permutations(["tools", "quality", "stock", "labels", "material"]))
def test_the_order_of_keys_does_not_count(order):
    whole = {**setup(), "quality": {"coverage_min": 0.5}, "stock": {}, "labels": {"b": "1", "a": "2"},
             "material": "C45"}
    assert setup_sha256(parse_setup({k: whole[k] for k in order})) == setup_sha256(parse_setup(whole))


@given(st.floats(0.1, 50), st.floats(0.05, 1), st.floats(1, 4), st.floats(1, 4))
def test_any_consistent_tool_is_taken_as_it_is(diameter, relief, neck, stickout):
    lengths = {"flute_length_mm": diameter, "neck_length_mm": neck * diameter,
               "stickout_mm": stickout * neck * diameter, "neck_diameter_mm": relief * diameter}
    (body,) = tool_bodies(parse_setup({**tool(diameter_mm=diameter, **lengths),
                                       "quality": {"scallop_height_mm": 0.01}}))
    assert (body.flute_length, body.neck_length, body.stickout, body.neck_diameter) == tuple(lengths.values())


def test_face_ids_become_numbers():
    assert face_numbers(["F12", "F3"]) == (12, 3)


def test_speeds_and_feeds_come_from_the_material_within_the_limits():
    found = parse_setup(setup(material="C45"))
    data = cutting_data(found.material, found.tools[0], found.machine)
    assert data.spindle_rpm == 13793 and data.limited_by == "material"  # 130 m/min on 3 mm
    assert data.feed == pytest.approx(13793 * 2 * 0.020)
    slow = parse_setup(setup(material="C45", machine={"max_rpm": 4000, "max_feed_mm_min": 100}))
    data = cutting_data(slow.material, slow.tools[0], slow.machine)
    assert (data.spindle_rpm, data.feed, data.limited_by) == (4000, 100, "machine")
    assert cutting_data(MATERIALS["AlMgSi1 6082"], found.tools[0], found.machine).limited_by == "default"
    points = MATERIALS["C45"].feed_per_tooth
    assert feed_per_tooth(points, 0.5) == pytest.approx(0.004) and feed_per_tooth(points, 40) == pytest.approx(0.2)
    assert feed_per_tooth(points, 4.5) == pytest.approx(0.029)
    assert find_material("EN AW-6082").name == "AlMgSi1 6082"
    assert {m.source for m in MATERIALS.values()} == {"shop practice, deliberately low"}


def test_a_setup_reads_back_with_what_it_states_only():
    """The child of a job gets the canonical JSON: a computed gauge length must not come back as a stated one."""
    for gauge, stated in ((None, False), (80.0, True)):
        setup = Setup.model_validate({"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 6, "flute_length_mm": 12,
                                                 "stickout_mm": 30, "gauge_length_mm": gauge}]})
        again = Setup.model_validate_json(canonical_json(setup))
        assert again.tools[0].gauge_given is stated
        assert again.tools[0].gauge_length_mm == (80.0 if stated else 30.0)
        assert canonical_json(again) == canonical_json(setup)
