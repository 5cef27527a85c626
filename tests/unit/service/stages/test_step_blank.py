"""Blanks from STEP files: what of them planner and proof are given, and what is refused with which words."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from geometry.errors import CamError, PartError, SetupError, StepError
from geometry.mesh import TriangleMesh
from schemas.setup import canonical_json, content_hash
from service.cli import app
from service.commands.arguments import blank_file
from service.from_wire import parse_setup
from service.stages.blank_checks import check_against_part
from service.stages.blank_model import blank_of
from service.stages.job_part import load_blank
from service.stages.preparation import prepare
from tests.hand_parts import as_part, box_mesh, joined, terraces
from tests.step_files import write_step
from zones.reach.access_view import access_rotation

cq = pytest.importorskip("cadquery")

TOOL = {"id": "T1", "kind": "flat", "diameter_mm": 4}
PART = as_part(box_mesh([0.0, 0.0, 0.0], [8.0, 6.0, 4.0]))


def setup(**stock):
    return parse_setup({"tools": [TOOL], "stock": {"kind": "step", "step_file": "blank.step", **stock}})


def checked(mesh, part=PART, **stock):
    given = setup(**stock)
    check_against_part(given, part, blank_of(given, part, as_part(mesh)))


def refused(code, mesh, part=PART, **stock):
    with pytest.raises(SetupError) as caught:
        checked(mesh, part, **stock)
    assert caught.value.code == code and caught.value.remedy and caught.value.subjects
    return caught.value


def test_a_blank_that_holds_the_part_and_may_touch_it():
    checked(box_mesh([-1.0, -1.0, -1.0], [9.0, 7.0, 6.0]))
    checked(box_mesh([0.0, 0.0, 0.0], [8.0, 6.0, 6.0]))
    checked(box_mesh([0.0, 0.0, 0.0], [8.0, 6.0, 4.0]))  # larger by its uncertainty
    checked(box_mesh([0.005, 0.0, 0.0], [8.0, 6.0, 6.0]))


@pytest.mark.parametrize("shrink", [0.02, 0.6, 3.0])
def test_a_part_that_stands_out_is_named_with_the_place_and_how_far(shrink):
    found = refused("stock_misses_part", box_mesh([-1.0, -1.0, -1.0], [9.0, 7.0, 4.0 - shrink]), uncertainty_mm=5.0)
    assert found.measured == pytest.approx(shrink, abs=1e-6) and f"{shrink:.3f} mm" in found.message
    assert "4.000)" in found.subjects[1] and found.subjects[0] == "stock.step_file"


def test_a_hollow_of_the_blank_in_the_midst_of_the_part_is_found():
    hollow = terraces([-1.0, 3.0, 4.0, 9.0], [-1.0, 2.0, 3.0, 7.0], [[6, 6, 6], [6, 3.2, 6], [6, 6, 6]], base=-1.0)
    found = refused("stock_misses_part", hollow)
    assert found.measured == pytest.approx(0.5, abs=0.06) or found.measured == pytest.approx(0.8, abs=1e-3)


def test_a_blank_beside_the_part():
    found = refused("stock_misses_part", box_mesh([20.0, 0.0, 0.0], [30.0, 6.0, 4.0]))
    assert found.measured == pytest.approx(20.0)


def test_the_part_itself_is_no_blank():
    refused("no_stock", PART.mesh, uncertainty_mm=0.0)
    checked(PART.mesh, uncertainty_mm=0.1)


def test_an_allowance_that_the_blank_does_not_hold_is_refused_where_it_lacks():
    low = box_mesh([-1.0, -1.0, -1.0], [9.0, 7.0, 4.3])
    given = parse_setup({"tools": [TOOL], "quality": {"stock_allowance_mm": 0.5},
                         "stock": {"kind": "step", "uncertainty_mm": 0.1}})
    part = as_part(TriangleMesh(PART.mesh.vertices, PART.mesh.faces, np.ones(len(PART.mesh.faces), np.int32)))
    with pytest.raises(SetupError) as caught:
        check_against_part(given, part, blank_of(given, part, replace(as_part(low), chord=0.0)))
    assert caught.value.code == "allowance_beyond_stock" and caught.value.measured == pytest.approx(0.4, abs=1e-5)
    assert "4.000)" in caught.value.subjects[2]
    less = parse_setup({"tools": [TOOL], "quality": {"stock_allowance_mm": 0.4},
                        "stock": {"kind": "step", "uncertainty_mm": 0.1}})
    check_against_part(less, part, blank_of(less, part, as_part(low)))


def test_what_planner_and_proof_are_given():
    mesh = box_mesh([-1.0, -1.0, -2.0], [9.0, 7.0, 6.0])
    solid = replace(as_part(mesh), chord=0.002, deviation=0.003)
    blank = blank_of(setup(uncertainty_mm=0.25), PART, solid)
    assert blank.seat == -2.0 and blank.stands_alone and blank.beyond == pytest.approx(0.253)
    lying = access_rotation((1.0, 0.0, 0.0))
    assert np.allclose(blank.corners(lying), blank.proof_mesh(lying).bounds)
    assert np.allclose(np.ptp(blank.corners(lying), axis=0), [8.0, 8.0, 10.0])
    assert blank.proof_box(np.eye(3)) is None and blank.proof_cylinder(np.eye(3))[0] is None
    with pytest.raises(SetupError) as caught:
        blank_of(setup(), PART)
    assert caught.value.code == "no_stock_file"


def test_the_name_of_the_file_does_not_count_and_its_bytes_do():
    one, other = setup(), setup(step_file="elsewhere/other.stp")
    assert canonical_json(one) == canonical_json(other) == canonical_json(setup(step_file=None))
    assert canonical_json(one) != canonical_json(parse_setup({"tools": [TOOL]}))
    assert content_hash(b"p", one, b"s") == content_hash(b"p", other, b"s") != content_hash(b"p", one, b"t")
    assert content_hash(b"p", one) != content_hash(b"p", one, b"s")


def box(x, y, z, at=(0, 0, 0)):
    return cq.Workplane().box(x, y, z, centered=False).translate(at)


def test_files_that_are_no_one_closed_solid_keep_their_errors_and_say_that_the_blank_is_meant(tmp_path):
    two = write_step(box(3, 3, 3).add(box(3, 3, 3, (9, 0, 0))).combine(), tmp_path / "two.step")
    faces = box(3, 3, 3).faces("not >Z").vals()
    shell = write_step(cq.Shell.makeShell(faces), tmp_path / "open.step")
    wire = write_step(cq.Workplane().rect(4, 4).val(), tmp_path / "wire.step")
    text = tmp_path / "text.step"
    text.write_text("no STEP")
    for path, kind, code in ((two, PartError, "several_solids"), (shell, PartError, "open_shell"),
                             (wire, StepError, "no_solid"), (text, StepError, "not_step"),
                             (tmp_path / "none.step", StepError, "no_file")):
        with pytest.raises(CamError) as caught:
            load_blank(path, setup())
        found = caught.value
        assert type(found) is kind and found.code == code and found.message.startswith("the blank: ")
        assert found.subjects[0] == "stock.step_file" and found.remedy and "part.solid" not in found.remedy


def test_it_is_placed_as_the_part_is(tmp_path):
    path = write_step(box(3, 4, 5), tmp_path / "blank.step")
    given = parse_setup({"tools": [TOOL], "stock": {"kind": "step"},
                         "placement": {"origin_mm": [1, 0, 0], "z_axis": [1, 0, 0], "x_axis": [0, 1, 0]}})
    assert load_blank(path, given).bounds.tolist() == [[0, 0, -1], [4, 5, 2]]


def test_the_command_line_looks_from_the_folder_of_the_setup(tmp_path):
    (tmp_path / "blanks").mkdir()
    write_step(box(3, 4, 5), tmp_path / "blanks" / "b.step")
    assert blank_file(tmp_path / "s.json", setup(step_file="blanks/b.step")) == tmp_path / "blanks" / "b.step"
    assert blank_file(tmp_path / "s.json", parse_setup({"tools": [TOOL]})) is None
    for name, code in ((None, "no_stock_file"), ("blanks/none.step", "no_file")):
        with pytest.raises(CamError) as caught:
            blank_file(tmp_path / "s.json", setup(step_file=name))
        assert caught.value.code == code and caught.value.subjects[0] == "stock.step_file"


def test_a_blank_that_is_not_given_is_bad_input_of_library_and_command_line(tmp_path):
    part = write_step(box(8, 6, 4), tmp_path / "part.step")
    with pytest.raises(SetupError) as caught:
        prepare(part, setup(), lambda _stage, _share: None)
    assert caught.value.code == "no_stock_file"
    given: Path = tmp_path / "setup.json"
    given.write_text(json.dumps({"tools": [TOOL], "stock": {"kind": "step", "step_file": "none.step"}}))
    got = CliRunner().invoke(app, ["plan", str(part), "--setup", str(given), "--out", str(tmp_path / "out"), "--json"])
    assert got.exit_code == 2 and json.loads(got.stdout)["code"] == "no_file"


def test_several_lumps_far_apart_are_still_one_mesh_to_the_check():
    """A blank of two lumps, of which one holds the part: nothing of the other counts against it."""
    checked(joined(box_mesh([-1.0, -1.0, -1.0], [9.0, 7.0, 6.0]), box_mesh([20.0, 0.0, 0.0], [22.0, 2.0, 2.0])))
