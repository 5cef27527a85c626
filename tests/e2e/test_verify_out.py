"""``zonemill verify --out`` on a block with a step: figures by face, deviation map, mesh of the machined part."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from geometry.stl import read_stl
from schemas.report import Report, Verification
from service.cli import app
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}
# one slot of 4 mm over the step, whose floor is at z = 2, in one pass along the foot of its wall
SLOT = ("G21 G90 G94 G17 G54 G61\nT1 M6\nG43 H1\nS3000 M3\nG0 Z30\nG0 X6 Y-4\nG1 Z{z} F300\nG1 Y16\nG0 Z30\nM5\nM30\n")


@pytest.fixture(scope="module")
def part(tmp_path_factory) -> Path:
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(cq.Workplane().box(8, 12, 2, centered=False)
                                                              .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


def verify(part, folder, text, *more):
    (folder / "setup.json").write_text(json.dumps(SETUP))
    (folder / "p.ngc").write_text(text)
    return CliRunner().invoke(app, ["verify", str(part), "--setup", str(folder / "setup.json"), "--program",
                                    str(folder / "p.ngc"), *more])


def floor_of(report):
    """The figures of the face of which half was cut, the step's floor."""
    half = [d for d in report["deviation"] if 0.2 < d["coverage"] < 0.8]
    assert len(half) == 1, report["deviation"]
    return half[0]


def test_figures_by_face_and_files(part, tmp_path):
    got = verify(part, tmp_path, SLOT.format(z=2), "--out", str(tmp_path / "out"), "--mesh-step", "0.1")
    report = json.loads(got.stdout)
    Verification.model_validate(report)
    # half of the floor is left undone, and the tool could cut it
    assert got.exit_code == 3 and report["state"] == "clean" and set(report["finding_counts"]) == {"stock_left"}
    assert json.loads((tmp_path / "out" / "report.json").read_text()) == report
    there = {p.name for p in (tmp_path / "out").iterdir()}
    assert there == {"report.json", "deviation.png", "machined.stl", "view.bin"}
    assert [f["name"] for f in report["files"]] == ["deviation.png", "machined.stl", "view.bin"]
    floor = floor_of(report)
    assert floor["area_mm2"] == pytest.approx(8 * 12, rel=0.01) and floor["coverage"] == pytest.approx(0.5, abs=0.01)
    assert floor["uncut_mm2"] == pytest.approx(8 * 12 / 2, rel=0.02) and floor["gouge_mm"] == 0
    assert floor["residual_mm"]["max"] == pytest.approx(0.5, abs=1e-3)
    area = sum(d["area_mm2"] for d in report["deviation"])
    good = sum(d["area_mm2"] * d["coverage"] for d in report["deviation"])
    assert good / area == pytest.approx(report["coverage"], abs=1e-4)


def test_the_mesh_is_what_the_program_leaves(part, tmp_path):
    got = verify(part, tmp_path, SLOT.format(z=2), "--out", str(tmp_path / "out"), "--mesh-step", "0.1")
    made = json.loads(got.stdout)["machined"]
    mesh = read_stl(tmp_path / "out" / "machined.stl")
    assert len(mesh.faces) == made["triangles"] and mesh.volume == pytest.approx(made["volume_mm3"], rel=5e-3)
    np.testing.assert_allclose(mesh.bounds, made["box_mm"], atol=1e-3)
    low = (np.abs(mesh.vertices[:, 0] - 6) < 1.5) & (np.abs(mesh.vertices[:, 1] - 6) < 5)
    on_top = mesh.vertices[low][mesh.vertices[low, 2] > 1.0]
    assert np.abs(on_top[:, 2] - 2.0).max() < 1e-3 and made["step_mm"] == 0.1 < made["error_mm"] < 0.2


def test_a_window_of_the_mesh(part, tmp_path):
    window = "5,5,1.9,5.2,5.2,2.1"
    got = verify(part, tmp_path, SLOT.format(z=2), "--out", str(tmp_path / "out"), "--mesh-step", "0.004",
                 f"--mesh-box={window}")
    made = json.loads(got.stdout)["machined"]
    assert made["step_mm"] == 0.004 and made["volume_mm3"] == pytest.approx(0.2 * 0.2 * 0.1, rel=0.02)


def test_a_gouge_is_in_the_figures_and_the_words(part, tmp_path):
    got = verify(part, tmp_path, SLOT.format(z=1.9), "--out", str(tmp_path / "out"), "--mesh-step", "0")
    report = json.loads(got.stdout)
    assert got.exit_code == 3 and report["machined"] is None
    assert max(d["gouge_mm"] for d in report["deviation"]) == pytest.approx(0.1, abs=1e-3)
    depth, = re.findall(r"line 8: T1 cuts (0\.\d+) mm into the part", got.stderr)[:1]
    assert "unproved" in got.stderr and float(depth) == pytest.approx(0.1, abs=5e-4)
    assert "deviation.png" in got.stderr and "took" in got.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"report.json", "deviation.png", "view.bin"}


def test_nothing_is_written_without_a_folder(part, tmp_path):
    got = verify(part, tmp_path, SLOT.format(z=2))
    assert got.exit_code == 3 and {p.name for p in tmp_path.iterdir()} == {"p.ngc", "setup.json"}
    assert json.loads(got.stdout)["files"] == []


@pytest.mark.parametrize(("given", "code"), [
    (("--mesh-step", "0.001"), "bad_mesh_step"), (("--mesh-box", "1,2,3"), "bad_mesh_box"),
    (("--mesh-box", "0,0,0,1,1,x"), "bad_mesh_box"), (("--mesh-box", "90,0,0,91,1,1"), "bad_mesh_box"),
    (("--mesh-step", "0", "--mesh-box", "0,0,0,1,1,1"), "box_without_step"),
    (("--mesh-box", "4,4,2.5,5,5,2.9"), "nothing_stands")])
def test_a_mesh_that_cannot_be_made_is_refused(part, tmp_path, given, code):
    got = verify(part, tmp_path, SLOT.format(z=2), "--out", str(tmp_path / "out"), *given)
    assert got.exit_code == 2 and code in got.stderr and got.stdout == ""


def test_the_folder_of_a_plan_is_left_alone(part, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "program.linuxcnc.ngc").write_text("%\n%\n")
    got = verify(part, tmp_path, SLOT.format(z=2), "--out", str(out))
    assert got.exit_code == 2 and "out_holds_a_job" in got.stderr
    assert (out / "program.linuxcnc.ngc").read_text() == "%\n%\n"


def test_a_planned_job_has_a_mesh_when_it_is_asked_for(part, tmp_path):
    (tmp_path / "setup.json").write_text(json.dumps(SETUP))
    got = CliRunner().invoke(app, ["plan", str(part), "--setup", str(tmp_path / "setup.json"), "--out",
                                   str(tmp_path / "out"), "--mesh-step", "0.2"])
    report = json.loads(got.stdout)
    Report.model_validate(report)
    made = report["machined"]
    assert got.exit_code == 0 and (made["file"], made["access"]) == ("machined.stl", "A1")
    mesh = read_stl(tmp_path / "out" / "machined.stl")
    # the part is 16 x 12 x 4 mm less a step of 8 x 12 x 2; nothing machines its underside
    assert mesh.volume == pytest.approx(16 * 12 * 4 - 8 * 12 * 2 + 16 * 12 * 0.5, rel=0.06)
    assert made["file"] in {f["name"] for f in report["files"]}
    top = mesh.vertices[(mesh.vertices[:, 0] > 9) & (mesh.vertices[:, 0] < 15) & (mesh.vertices[:, 2] > 3.0)
                        & (np.abs(mesh.vertices[:, 1] - 6) < 5)]
    assert np.abs(top[:, 2] - 4.0).max() < 0.06
