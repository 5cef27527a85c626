"""Programs that drill, tap and chamfer: a small plate made right, and the faults that shops fear."""

import json
import math
from dataclasses import replace
from functools import lru_cache

import pytest

from geometry.errors import SetupError
from schemas.report import Verification
from service.from_wire import check_plannable, parse_setup
from service.stages.job_inputs import JobInputs
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program
from tests.step_files import write_step

POINT = 1.5 / math.tan(math.radians(59.0))  # height of the point of the drill, 0.901 mm
LEAD = 0.4 / math.tan(math.radians(30.0))  # height of the lead of the tap, 0.693 mm
BARE = {"shank_diameter_mm": 3, "stickout_mm": 30}
SETUP = {
    "tools": [{"id": "T1", "kind": "drill", "diameter_mm": 3, "point_angle_deg": 118, "flute_length_mm": 20, **BARE},
              {"id": "T2", "kind": "chamfer", "diameter_mm": 6, "tip_diameter_mm": 1, "stickout_mm": 30},
              {"id": "T3", "kind": "tap", "diameter_mm": 4, "point_angle_deg": 60, "tip_diameter_mm": 3.2,
               "flute_length_mm": 12, "stickout_mm": 30},
              {"id": "T4", "kind": "drill", "diameter_mm": 3.3, "flute_length_mm": 20, "stickout_mm": 30}],
    "stock": {"kind": "box", "box_mm": [[-8, -6, -8], [8, 6, 0]], "uncertainty_mm": 0},
    "machine": {"kind": "3-axis", "dialects": ["linuxcnc"]}, "quality": {"scallop_height_mm": 0.02}}


def program(*, deep=-5.0 - POINT, through=-9.2, chamfer=-1.6, tapped=True, tapped_at=(4.0, -9.0), first=True, more=()):
    """A blind hole at X-4, a through hole at X0, a tapped one at X4, and the edge at X8 with a chamfer of 0.6 mm."""
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G64 P0.001", "T1 M6", "S3000 M3", "G0 X-4 Y0", "G43 H1 Z20", "G0 Z3"]
    lines += [f"G98 G83 X-4 Y0 Z{deep:.4f} R2 Q1.5 F150", f"G81 X0 Y0 Z{through:.4f} R2", "G80", *more, "G0 Z20"]
    lines += ["T4 M6", "S3000 M3", "G0 X4 Y0", "G43 H4 Z20", "G81 X4 Y0 Z-9.5 R2 F150", "G80"] if first else []
    if tapped:
        at, low = tapped_at
        lines += ["T3 M6", "S500 M3", f"G0 X{at} Y0", "G43 H3 Z20", "G0 Z2",
                  f"G84 X{at} Y0 Z{low} R2 F350", "G80", "G0 Z20"]
    lines += ["T2 M6", "S8000 M3", "G0 X9.5 Y-12", "G43 H2 Z20", f"G0 Z{chamfer}", "G1 Y12 F400", "G0 Z20"]
    return "\n".join([*lines, "M5", "M30", "%"]) + "\n"


@pytest.fixture(scope="module")
def verify(tmp_path_factory):
    """Verify a text, and the first tool with other fields, against the plate -> the report. The plate is read once."""
    import cadquery as cq

    plate = cq.Workplane("XY").box(16, 12, 8, centered=(True, True, False)).translate((0, 0, -8))
    plate = plate.faces(">X").edges(">Z").chamfer(0.6)
    for x, radius, depth in ((-4.0, 1.5, 5.0), (0.0, 1.5, 8.0), (4.0, 2.0, 8.0)):
        plate = plate.cut(cq.Workplane("XY").circle(radius).extrude(-depth).translate((x, 0, 0)))
    cone = cq.Solid.makeCone(0.0, 1.5, POINT, pnt=cq.Vector(-4, 0, -5.0 - POINT), dir=cq.Vector(0, 0, 1))
    path = write_step(plate.cut(cq.Workplane(cone)), tmp_path_factory.mktemp("drilled") / "plate.step")
    job = read_job_part(path, parse_setup(json.dumps(SETUP)), lambda _stage, _share: None)

    @lru_cache
    def report(text, **first):
        setup = parse_setup(json.dumps({**SETUP, "tools": [{**SETUP["tools"][0], **first}, *SETUP["tools"][1:]]}))
        mine = replace(job, inputs=JobInputs.of(setup))
        made = proved_program(mine, read_first(setup, text, ending=".ngc"), lambda _share: None).report
        Verification.model_validate(made)
        return made

    return report


def kinds(report):
    return report["finding_counts"]


@pytest.mark.parametrize("core", [2.5, None])
def test_a_drill_that_does_not_cut_to_its_centre_goes_into_no_solid(verify, core):
    """Its core is pressed as deep as the hole is, whatever is bored out beside it."""
    (told,) = [f for f in verify(program(), center_cutting=False, core_diameter_mm=core)["findings"]
               if f["kind"] == "plunge"]
    assert "lines 8 to 9" in told["message"] and told["depth"] == pytest.approx(8.0, abs=0.1)


def test_such_a_drill_opens_a_hole_that_stands(verify):
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G64 P0.001", "T4 M6", "S3000 M3", "G0 X4 Y0", "G43 H4 Z20",
             "G81 X4 Y0 Z-9.5 R2 F150", "G80", "G0 Z20", "T1 M6", "S3000 M3", "G0 X4 Y0", "G43 H1 Z20",
             "G81 X4 Y0 Z-9.2 R2 F150", "G80", "G0 Z20", "M5", "M30", "%"]
    assert "plunge" not in kinds(verify("\n".join(lines) + "\n", center_cutting=False, core_diameter_mm=2.5))


def test_a_right_program_is_proved(verify):
    report = verify(program())
    assert report["state"] == "proved", report["findings"]
    assert report["gouge_max_mm"] < 0.01


def test_a_drill_too_deep_is_a_gouge_as_deep_at_its_point(verify):
    found = [f for f in verify(program(deep=-5.3 - POINT))["findings"] if f["kind"] == "gouge"]
    assert found[0]["depth"] == pytest.approx(0.3, abs=1e-3)
    assert found[0]["point"] == pytest.approx([-4, 0, -5.3 - POINT], abs=1e-3)
    # along the normals of the cone it is 0.3 sin 59 degrees
    assert found[1]["depth"] == pytest.approx(0.3 * math.sin(math.radians(59.0)), abs=0.003)


@pytest.mark.slow
@pytest.mark.parametrize(("change", "high"), [
    *(({"deep": short - 5.0 - POINT}, short) for short in (0.04, 0.1, 0.3, 1.0, 2.0, 4.5)),
    # right through: the wall stands as high as the full diameter ends over the bottom
    *(({"through": -8.0 - POINT + short}, short) for short in (0.3, 1.0, 2.0, 5.0)),
    ({"through": -2.0}, 6.0 + POINT)])
def test_a_hole_that_is_not_deep_enough_is_stock_left_as_high_as_the_drill_is_short(verify, change, high):
    report = verify(program(**change))
    assert report["state"] == "clean" and kinds(report).keys() == {"stock_left"}
    found = [f["depth"] for f in report["findings"]]
    assert max(found) == pytest.approx(high, rel=0.01, abs=0.002), found


@pytest.mark.slow
def test_a_countersink_too_high_is_told_by_the_depth_it_misses(tmp_path):
    """A spot drill of 90 degrees leaves stock of one depth along its cone, at the rim as at the bottom."""
    import cadquery as cq

    block = cq.Workplane("XY").box(16, 16, 8, centered=(True, True, False)).translate((0, 0, -8))
    block = block.cut(cq.Workplane("XY").circle(1.5).extrude(-8))
    cone = cq.Solid.makeCone(1.5, 4.0, 2.5, pnt=cq.Vector(0, 0, -2.5), dir=cq.Vector(0, 0, 1))
    path = write_step(block.cut(cq.Workplane(cone)), tmp_path / "countersink.step")
    spot = {"id": "T5", "kind": "drill", "diameter_mm": 8, "point_angle_deg": 90, "flute_length_mm": 20,
            "shank_diameter_mm": 8, "stickout_mm": 30}
    setup = parse_setup(json.dumps(SETUP | {"tools": [*SETUP["tools"], spot], "stock": {
        "kind": "box", "box_mm": [[-8, -8, -8], [8, 8, 0]], "uncertainty_mm": 0}}))
    job = read_job_part(path, setup, lambda _stage, _share: None)
    for short in (0.0, 0.05, 0.1, 1.0):
        text = "\n".join(["%", "G21 G90 G17 G94 G40 G49 G54 G64 P0.001", "T1 M6", "S3000 M3", "G0 X0 Y0", "G43 H1 Z20",
                          "G98 G83 X0 Y0 Z-9.2 R2 Q1.5 F150", "G80", "T5 M6", "S1500 M3", "G0 X0 Y0", "G43 H5 Z20",
                          f"G82 X0 Y0 Z{short - 4.0:.3f} R2 P0.1 F80", "G80", "M5", "M30", "%"])
        report = proved_program(job, read_first(setup, text, ending=".ngc"), lambda _share: None).report
        found = [f["depth"] for f in report["findings"]]
        assert report["state"] == ("clean" if short else "proved"), report["findings"]
        assert found == ([pytest.approx(short, rel=0.03, abs=0.003)] if short else [])


@pytest.mark.slow
def test_a_tap_that_stays_short_leaves_as_much(verify):
    report = verify(program(tapped_at=(4.0, -6.0)))
    assert kinds(report).keys() == {"stock_left"}
    assert max(f["depth"] for f in report["findings"]) == pytest.approx(LEAD + 2.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("chamfer", "kind"), [(-1.5, "stock_left"), (-1.8, "gouge")])
def test_a_chamfer_too_high_or_too_low(verify, chamfer, kind):
    report = verify(program(chamfer=chamfer))
    assert kinds(report).keys() == {kind}
    depth = max(f["depth"] for f in report["findings"])
    assert depth == pytest.approx(abs(chamfer + 1.6) / math.sqrt(2.0), abs=0.002)


@pytest.mark.slow
def test_a_tap_without_its_hole_plunges(verify):
    report = verify(program(first=False))
    assert kinds(report) == {"plunge": 1} and report["findings"][0]["depth"] == pytest.approx(8.0, abs=1e-6)


@pytest.mark.slow
def test_a_thread_in_a_hole_drawn_before_it_is_a_gouge_with_a_note(verify):
    report = verify(program(tapped_at=(0.0, -1.0)))
    found = [f for f in report["findings"] if f["kind"] == "gouge"]
    assert max(f["depth"] for f in found) == pytest.approx(0.5, abs=0.01)
    assert any("T3 is a tap" in note and "diameter of that hole" in note for note in report["proof"]["notes"])


@pytest.mark.slow
def test_a_hole_that_is_not_tapped_is_remainder(verify):
    report = verify(program(tapped=False))
    assert report["state"] == "proved" and [e["reason"] for e in report["remainder"]] == ["corner"]


@pytest.mark.slow
def test_a_drill_goes_neither_sideways_nor_at_rapid_into_stock(verify):
    more = ("G0 X0 Y0", "G0 Z2", "G1 Z-3 F100", "G1 X1", "X0", "G0 Z2")
    words = {f["kind"]: f["message"] for f in verify(program(more=more))["findings"]}
    assert words["program"] == "T1 is a drill and cuts 1.000 mm sideways; it cuts along its axis only"
    more = ("G0 X-4 Y3.5", "G0 Z2", "G0 Z-1", "G0 Z2")
    assert "a rapid takes the cutting part into stock" in \
        next(f["message"] for f in verify(program(more=more))["findings"] if f["kind"] == "rapid")


@pytest.mark.slow
def test_a_tap_that_leaves_its_thread_at_rapid_is_found(verify):
    report = verify(program().replace("G84", "G81"))
    assert kinds(report) == {"program": 1}
    assert "T3 is a tap and leaves its thread at rapid" in report["findings"][0]["message"]


def test_jobs_refuse_such_tools_by_name():
    with pytest.raises(SetupError) as caught:
        check_plannable(parse_setup(json.dumps(SETUP)))
    assert caught.value.code == "verify_only_tool" and caught.value.subjects == ("T1", "T2", "T3", "T4")
    assert "T1 (drill), T2 (chamfer), T3 (tap), T4 (drill)" in caught.value.message
    assert "zonemill verify" in caught.value.remedy
