"""A part open above and below, cut from both sides: two programs, each proved, and what only the second one reaches."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from schemas.setup import Setup
from service import pipeline
from service.from_wire import parse_setup

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

BALL = {"kind": "ball", "flutes": 2, "shank_diameter_mm": 8, "stickout_mm": 26,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
TOOLS = [{"id": "T1", "diameter_mm": 5, "flute_length_mm": 8, "neck_diameter_mm": 4.6, "neck_length_mm": 10, **BALL},
         {"id": "T2", "diameter_mm": 3, "flute_length_mm": 8, "neck_diameter_mm": 2.8, "neck_length_mm": 18, **BALL}]
SETUP = {"tools": TOOLS, "access": [{"id": "A1"}, {"id": "A2", "direction": [0, 0, -1], "work_offset": "G55"}],
         "quality": {"scallop_height_mm": 0.05, "chordal_tolerance_mm": 0.005}, "material": "AlMgSi1 6082",
         "stock": {"margin_mm": 0.6, "uncertainty_mm": 0.1}}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rectangular frame 16 high, walls 2 thick, with a bar across at half height."""
    outer = cq.Workplane().box(26, 19, 16, centered=(True, True, False))
    part = outer.cut(cq.Workplane().box(22, 15, 16, centered=(True, True, False)))
    part = part.union(cq.Workplane().box(3, 16, 3, centered=(True, True, False)).translate((3, 0, 6.5)))
    path = tmp_path_factory.mktemp("frame") / "frame.step"
    cq.exporters.export(part, str(path))
    return path


@pytest.fixture(scope="module")
def job(frame: Path) -> tuple[Path, Setup, dict[str, Any]]:
    """Folder, setup and report of the job."""
    setup = parse_setup(json.dumps(SETUP))
    out = frame.parent / "out"
    return out, setup, pipeline.plan(frame, setup, out, quiet)


def test_both_programs_are_proved(job: tuple[Path, Setup, dict[str, Any]]) -> None:
    out, _, report = job
    assert report["state"] == "proved" and report["findings"] == []
    programs = {f["name"]: f["access"] for f in report["files"] if f["kind"] == "program"}
    assert programs == {"program.linuxcnc.ngc": "A1", "program.A2.linuxcnc.ngc": "A2"}
    assert "G55" in (out / "program.A2.linuxcnc.ngc").read_text() and (out / "job.A2.stpnc").exists()
    assert report["reach_coverage"] > 0.999


def test_each_access_has_its_zones_and_half_of_the_walls(job: tuple[Path, Setup, dict[str, Any]]) -> None:
    *_, report = job
    zones = report["zones"]
    assert {z["access"]: z["axis"] for z in zones} == {"A1": [0, 0, 1], "A2": [0, 0, -1]}
    under = [z for z in zones if z["region"] == "C1" and z["access"] == "A2"]
    assert under and all(z["coverage"] > 0.9 for z in under)
    assert [round(p["z_mm"], 1) for p in report["cutting_planes"] if p["tool"] is None] != []
    steps = [s["id"] for s in report["steps"]]
    assert len(set(steps)) == len(steps)
    assert report["connections"][0]["walls"] == ["W1", "W1"]


@pytest.mark.slow
def test_a_program_does_no_harm_along_its_own_access(frame: Path, job: tuple[Path, Setup, dict[str, Any]]) -> None:
    """Alone it leaves the half of the walls that the other program cuts."""
    out, setup, _ = job
    text = (out / "program.A2.linuxcnc.ngc").read_text()
    assert set(pipeline.verify_program(frame, setup, text, quiet, "A2")["finding_counts"]) <= {"stock_left"}
    assert pipeline.verify_program(frame, setup, text, quiet, "A1")["findings"] != []


def test_a_first_access_along_which_no_wall_stands_is_said(tmp_path: Path) -> None:
    part = cq.Workplane().box(30, 20, 3).union(cq.Workplane().box(26, 2, 12).translate((0, 0, 7)))
    path = tmp_path / "wall.step"
    cq.exporters.export(part, str(path))
    askew, upright = {"id": "A1", "direction": [0, 0.8, 0.6]}, {"id": "A2", "direction": [0, 0, 1]}
    for order, said in (([askew, upright], True), ([upright | {"id": "A1"}, askew | {"id": "A2"}], False)):
        order[1] = order[1] | {"work_offset": "G55"}
        report = pipeline.zones_only(path, parse_setup(json.dumps(SETUP | {"access": order})), quiet)
        assert any("name A2 first" in w for w in report["part"]["warnings"]) == said
        assert bool(report["walls"]) != said
