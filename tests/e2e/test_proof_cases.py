"""Programs that were called proved and would do harm, and good ones that were refused (``../shared/cases/proof``)."""

import json
from pathlib import Path

import pytest

from geometry.errors import SetupError
from service.from_wire import parse_setup
from service.pipeline import plan
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases" / "proof"
pytestmark = [pytest.mark.slow,
              pytest.mark.skipif(not CASES.is_dir(), reason="the collection of cases (../shared/cases) is not here")]
HARMFUL = [  # program, part, kind of finding, its line, depth in mm or None
    ("01-empty-spindle-rapid.ngc", "plate", "collision", 71, None),
    ("03-stale-length-offset-rapid.ngc", "plate", "program", 71, None),
    ("05-no-path-mode-linuxcnc.ngc", "boss", "program", 9, None),
    ("07-fanuc-g92-then-g52-zero.nc", "plate", "program", 31, None),
    ("09-fanuc-diagonal-rapid.nc", "plate", "rapid", 28, 4.0),
    ("14-change-to-longer-tool-at-top.ngc", "plate", "collision", 72, None),
    ("15-stepnc-security-plane-in-part.stpnc", "plate", "rapid", 882, 61.5),
    ("17-g53-beyond-travel.ngc", "plate", "limit", 68, 99499.0),
    ("20-s1-f20000.ngc", "plate", "load", 13, 20000 / 3),
    ("24-slot-19-deep-in-titanium.ngc", "block", "load", 12, 5571.0),
    ("25-straight-drilling-paid-in-air.ngc", "plate", "plunge", 31, 4.5),
    ("30-rib-0.5x4x30-milled-off.ngc", "rib_0.5", "gouge", None, 4.0),
    ("32-knife-edge-shortened-0.7.ngc", "knife", "gouge", None, 0.7),
    ("39-thin-wall-rule-diluted.ngc", "thin_wall", "support", 118, 15.7),
    ("34-allowance-cut-away.ngc", "plate", "allowance", None, 0.3),
    ("36-shank-dragged-through-stock.ngc", "block", "rubbing", 17, 0.45),
    ("38-rapid-0.001-over-face-and-clamp.ngc", "plate", "rapid", 68, None),
]
GOOD = ["fa-01-g28-from-the-wall.ngc", "fa-03-spring-pass-after-a-lift.ngc", "fa-05-ramp-of-5-degrees.ngc",
        "fa-07-g28-xyz-at-the-end.nc", "fa-09-lift-0.003-aside.ngc"]


def verified(name, part, **more):
    program = CASES / name
    setup = parse_setup(json.loads(program.with_suffix(".json").read_text()) | more)
    dialect = "fanuc" if program.suffix == ".nc" else None
    job = read_job_part(CASES / f"{part}.step", setup, lambda _stage, _share: None)
    read = read_first(setup, program.read_text(), ending=program.suffix, dialect=dialect)
    return proved_program(job, read, lambda _share: None).report


@pytest.mark.parametrize(("name", "part", "kind", "line", "depth"), HARMFUL)
def test_harm_is_found(name, part, kind, line, depth):
    report = verified(name, part)
    found = [f for f in report["findings"] if f["kind"] == kind]
    assert report["state"] == "unproved" and found, json.dumps(report["finding_counts"])
    if line is not None:
        assert found[0]["line"] == line
    if depth is not None:
        assert max(f["depth"] for f in found) == pytest.approx(depth, abs=max(0.1 * depth, 0.005))


def test_a_program_that_exceeds_the_words_of_its_tool_is_proved_with_cautions():
    report = verified("23-feed-speed-life-of-tool-ignored.ngc", "plate")
    said = [w for w in report["warnings"] if w["kind"] == "tool_data"]
    assert report["state"] == "proved" and [w["limit"] for w in said] == [1000.0, 50.0, 10.0, 0.05]
    assert [w["measured"] for w in said[:2]] == [6000.0, 500.0] and all(w["measured"] > w["limit"] for w in said)


def test_a_plan_past_ten_times_a_limit_is_unproved(tmp_path):
    setup = parse_setup((CASES / "28-plan-s1.json").read_text())
    report = plan(CASES / "plate.step", setup, tmp_path, lambda _stage, _share: None)
    loads = [f for f in report["findings"] if f["kind"] == "load"]
    assert report["state"] == "unproved" and not list(tmp_path.glob("*.ngc"))
    assert [f["limit"] for f in loads] == [pytest.approx(1.6), 0.05, 0.02] and loads[1]["depth"] > 80


@pytest.mark.parametrize("name", GOOD)
def test_good_programs_are_proved(name):
    report = verified(name, "plate")
    assert report["state"] == "proved" and report["findings"] == []


def test_the_sense_of_rotary_axes_is_asked_for():
    """With the table counted as ISO 841 has it, the program gouges; nobody says how this table counts."""
    name = "12-iso-axes-default.nc"
    with pytest.raises(SetupError) as caught:
        verified(name, "block")
    assert caught.value.code == "rotary_sense_open" and caught.value.measured == ["A"]
    assert "machine.iso_axes" in caught.value.remedy


def test_faces_behind_a_stray_end_are_left():
    report = verified("45-stray-m2.ngc", "plate")
    assert report["state"] == "clean" and report["finding_counts"].keys() == {"stock_left"}
    assert max(f["depth"] for f in report["findings"]) == pytest.approx(4.0, abs=1e-3)
    assert any("40 lines from 29 to 70 stand behind it" in n for n in report["proof"]["notes"])


def taken(report, what):
    (entry,) = [a for a in report["proof"]["assumed"] if a["what"] == what]
    return entry["value"]


def test_a_rapid_keeps_its_clearance_over_a_clamp_and_a_finished_face():
    found = verified("38-rapid-0.001-over-face-and-clamp.ngc", "plate")["findings"]
    assert {f["line"] for f in found} == {68, 69, 71}
    assert all(f["near"] and f["depth"] == pytest.approx(0.001, abs=1e-6) and f["limit"] == 1.0 for f in found)


@pytest.mark.parametrize("table", [None, 0.0])
def test_a_program_that_mills_the_table(table):
    report = verified("40-milled-into-the-table.ngc", "plate", machine={"table_z_mm": table})
    if table is None:
        assert "deepest under the part 15.000 mm (program, line 68)" in taken(report, "table")
        return
    (found,) = [f for f in report["findings"] if f["kind"] == "collision"]
    assert found["line"] == 68 and found["depth"] == pytest.approx(15.0)


def test_no_holder_is_told_with_the_width_that_is_free():
    """The axis passes 4.1 mm beside the wall, 54 mm below its top."""
    value = taken(verified("42-no-holder-beside-a-60-mm-wall.ngc", "wall_60"), "holder")
    free = float(value.split("; ")[1].split(" mm of diameter are free 20 mm over the tip")[0])
    assert 8.2 - 0.75 <= free <= 8.2


def test_a_stated_nose_ends_the_assumption_above_the_holder():
    report = verified("40-milled-into-the-table.ngc", "plate", machine={"nose_diameter_mm": 88.9})
    assert not [a for a in report["proof"]["assumed"] if a["what"] == "above_holder"]
    assert "ends 49.5 mm above the top" in taken(verified("40-milled-into-the-table.ngc", "plate"), "above_holder")


def test_a_stated_change_position_ends_the_collision():
    report = verified("14-change-to-longer-tool-at-top.ngc", "plate", machine={"change_position": [300.0]})
    assert report["findings"] == []
