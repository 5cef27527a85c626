"""A hollow beside a post, finished by a ball that is asked to lean: led round the post, proved, and told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.mesh import F64
from service import pipeline
from service.from_wire import parse_setup
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

R, DEEP = 2.0, 60.0
TOOL = {"id": "T1", "kind": "ball", "diameter_mm": 2 * R, "flute_length_mm": 9, "neck_diameter_mm": 3.8,
        "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 40,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]],
           "orientations": "given"}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Folder and report: a block 14 x 10 with the hollow of a ball of radius 60 in its top, 4 high in the middle, and a
    post 12 high on its edge."""
    folder = tmp_path_factory.mktemp("led")
    hollow = cq.Workplane().sphere(DEEP).rotate((0, 0, 0), (1, 0, 0), 90).translate((0, 0, 4 + DEEP))  # no pole on it
    part = cq.Workplane().box(14, 10, 8, centered=(True, True, False)).cut(hollow)
    part = part.union(cq.Workplane().box(3, 3, 12, centered=(True, True, False)).translate((0, 3.5, 0)))
    cq.exporters.export(part, str(folder / "part.step"))
    faces = cq.importers.importStep(str(folder / "part.step")).faces().vals()
    inner = [f"F{k}" for k, f in enumerate(faces, 1) if np.all(np.abs(f.Center().toTuple()[:2]) < (6.5, 4.5))
             and f.Center().z > 3.0]  # the hollow and the post
    setup = {"tools": [TOOL], "quality": {"scallop_height_mm": 0.03, "chordal_tolerance_mm": 0.01},
             "material": "AlMgSi1 6082", "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.1}, "machine": MACHINE,
             "operations": {"lean": {"tilt_deg": 15}, "faces": inner}}
    return folder / "out", pipeline.plan(folder / "part.step", parse_setup(json.dumps(setup)), folder / "out", quiet)


def test_the_hollow_is_finished_leaning_and_proved(job: tuple[Path, dict[str, Any]]) -> None:
    report = job[1]
    assert report["state"] == "proved", report["findings"]
    zones = [z for z in report["zones"] if z["form"] == "shallow"]
    assert zones and all(z["strategy"] == "inclined_axis" and z["coverage"] > 0.99 for z in zones)
    assert report["gouge_max_mm"] <= 0.01
    assert not [w for w in report["warnings"] if w["kind"] == "upright"]
    own = [s for s in report["steps"] if s["id"] in {i for z in zones for i in z["steps"]}]
    upright = sum(s["cutting_length_mm"] for s in own if s["strategy"] != "inclined_axis")
    assert upright < 0.1 * sum(s["cutting_length_mm"] for s in own)  # what is left in the corners of the post


def test_what_was_walked_upright_was_not_asked_for(job: tuple[Path, dict[str, Any]]) -> None:
    (zone,) = [z for z in job[1]["zones"] if z["form"] == "shallow"]
    reasons = [r["reason"] for r in zone["rejected"] if r["strategy"] in ("zigzag", "spiral", "isoparametric")]
    assert any("tilt was requested" in r for r in reasons), reasons


def test_the_ball_leans_as_asked_where_it_cuts_the_hollow(job: tuple[Path, dict[str, Any]]) -> None:
    """On led moves its centre is R above the hollow, towards the middle of the sphere, and its axis 15 degrees off."""
    axes, tips = cutting_axes(job[0])
    centre = tips + R * axes
    normal = np.array([0.0, 0.0, 4.0 + DEEP]) - centre
    far = np.linalg.norm(normal, axis=1)
    lean = np.degrees(np.arccos(np.clip((normal * axes).sum(axis=1) / far, -1.0, 1.0)))
    led = (np.abs(far - (DEEP - R)) < 0.02) & (axes[:, 2] < 0.9999)
    assert led.sum() > 200
    assert np.percentile(np.abs(lean[led] - 15.0), 60) < 0.5
    assert np.percentile(lean[led], 2) > 5.0  # so its centre does not rub
    assert lean[led].max() < 15.0 + 45.0 + 1.0


def test_both_forms_of_stepnc_say_how_the_tool_leans(job: tuple[Path, dict[str, Any]]) -> None:
    aim, arm = ((job[0] / name).read_text() for name in ("job.stpnc", "job.arm.stpnc"))
    assert "'tool axis'" in aim and "finishing inclined_axis" in aim and "finishing inclined_axis" in arm


def cutting_axes(out: Path) -> tuple[F64, F64]:
    """Tool axes (n, 3) and tips (n, 3), mm, at the ends of the feed moves of the program."""
    p = read_program((out / "program.linuxcnc.ngc").read_text(), kinematics=Kinematics("table-table-AC", None))
    cuts = ~np.isnan(p.feed)
    return p.poses.end_axis[cuts], p.end[cuts]
