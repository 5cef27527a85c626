"""A bar between two walls on a machine that leans its table: one program, one further tool axis, all of it proved."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schemas.setup import Setup
from service import pipeline
from service.from_wire import parse_setup
from service.stages.preparation import prepare
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

BALL = {"id": "T1", "kind": "ball", "flutes": 2, "diameter_mm": 3, "flute_length_mm": 8, "neck_diameter_mm": 2.8,
        "neck_length_mm": 22, "shank_diameter_mm": 6, "stickout_mm": 34,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}
SETUP = {"tools": [BALL], "quality": {"scallop_height_mm": 0.1, "chordal_tolerance_mm": 0.01},
         "material": "AlMgSi1 6082", "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.1}, "machine": MACHINE}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two walls 2 thick, 11 high and 6 apart on a base, with a bar across at half height."""
    def box(x: float, y: float, z: float, at: tuple[float, float, float]) -> Any:
        return cq.Workplane().box(x, y, z, centered=(True, True, False)).translate(at)

    shape = box(18, 14, 2, (0, 0, 0)).union(box(14, 2, 11, (0, -4, 2))).union(box(14, 2, 11, (0, 4, 2)))
    shape = shape.union(box(3, 8, 2, (0, 0, 7)))
    path = tmp_path_factory.mktemp("bar") / "bar.step"
    cq.exporters.export(shape, str(path))
    return path


def planned(part: Path, name: str, **machine: object) -> tuple[Path, Setup, dict[str, Any]]:
    setup = parse_setup(json.dumps({**SETUP, "machine": {**MACHINE, **machine}}))
    out = part.parent / name
    return out, setup, pipeline.plan(part, setup, out, quiet)


@pytest.fixture(scope="module")
def job(part: Path) -> tuple[Path, Setup, dict[str, Any]]:
    """Folder, setup and report of the job."""
    return planned(part, "out")


def test_what_three_axes_leave_under_the_bar_is_cut_from_a_further_axis(
        part: Path, job: tuple[Path, Setup, dict[str, Any]]) -> None:
    _, _, report = job
    assert report["state"] == "proved" and report["findings"] == []
    found = [a for a in report["accesses"] if a["found"]]
    assert [a["id"] for a in report["accesses"]][:2] == ["A1", "I1"] and found
    assert all(a["axis"][2] >= 0.0 for a in found)
    under = [z for z in report["zones"] if z["access"] == "I1"]
    assert sum(z["proved_area_mm2"] for z in under) > 10.0
    assert all(z["coverage"] > 0.98 for z in report["zones"])
    _, _, upright = planned(part, "upright", orientations="given")
    assert upright["state"] == "proved" and [a["id"] for a in upright["accesses"]] == ["A1"]
    mine, theirs = (r["coverage"] * r["machinable_area_mm2"] for r in (report, upright))
    assert mine > theirs + 10.0


def test_one_program_in_the_setup_frame_and_one_of_each_stepnc(job: tuple[Path, Setup, dict[str, Any]]) -> None:
    out, _, report = job
    names = {f["name"] for f in report["files"] if f["kind"] in ("program", "stepnc", "stepnc-arm")}
    assert names == {"program.linuxcnc.ngc", "job.stpnc", "job.arm.stpnc"}
    machine = Kinematics("table-table-AC", None)
    p = read_program((out / "program.linuxcnc.ngc").read_text(), kinematics=machine)
    axes = {tuple(np.round(a, 4)) for a in p.poses.end_axis[~np.isnan(p.feed)].tolist()}
    wanted = {tuple(np.round(a["axis"], 4).tolist()) for a in report["accesses"]}
    assert axes == wanted
    assert "'tool axis'" in (out / "job.stpnc").read_text()


def test_samples_of_an_oblique_view_have_the_regions_they_had(part: Path) -> None:
    """What is labelled in the frame of a view is looked up in that of the first, where channels are drawn."""
    setup = parse_setup(json.dumps({**SETUP, "access": [{}, {"id": "A2", "direction": [0.4, -0.7, 0.5]}],
                                    "machine": {**MACHINE, "orientations": "given"}}))
    view = prepare(part, setup, quiet).views[1]
    again = view.label(view.samples)
    assert (again.names == view.labels.names).all()
    assert len(set(again.names.tolist())) > 3


@pytest.mark.slow
def test_a_level_tool_clears_the_table_and_an_upright_one_what_is_told_of_it(part: Path) -> None:
    """Level first and then upright; on a table that is known the upright tool ends above it."""
    for access, table in (([{"direction": [1, 0, 0]}, {"id": "A2"}], None), ([{}], 0.0)):
        setup = parse_setup(json.dumps({**SETUP, "access": access, "machine": {
            **MACHINE, "orientations": "given", "table_z_mm": table}}))
        report = pipeline.plan(part, setup, part.parent / "level", quiet)
        assert report["state"] == "proved", report["findings"]


@pytest.mark.slow
def test_programs_of_joints_are_proved_like_those_with_tool_centre_point_control(part: Path) -> None:
    out, setup, report = planned(part, "joints", tcp=False, pivots_mm=[[0, 0, -60], [0, 0, 0]])
    text = (out / "program.linuxcnc.ngc").read_text()
    assert report["state"] == "proved" and "M428" not in text
    again = pipeline.verify_program(part, setup, text, quiet)
    assert not again["findings"]
    elsewhere = {**MACHINE, "tcp": False, "pivots_mm": [[0, 0, -59], [0, 0, 0]]}
    moved = parse_setup(json.dumps({**SETUP, "machine": elsewhere}))
    assert pipeline.verify_program(part, moved, text, quiet)["finding_counts"].get("gouge", 0) > 0


@pytest.mark.slow
def test_turns_stay_clear_where_each_axis_moves_at_its_own_speed(part: Path) -> None:
    """The ball of the turns grows by what the joints may stray; that of straight rapids does not hold."""
    pivots = [[0, 0, -60], [0, 0, 0]]
    _, setup, report = planned(part, "dogleg", rapid_motion="dogleg", pivots_mm=pivots)
    assert report["state"] == "proved" and "rapid_path" not in {a["what"] for a in report["proof"]["assumed"]}
    straight, _, other = planned(part, "linear", rapid_motion="linear", pivots_mm=pivots)
    assert report["machining_time_s"] < 1.05 * other["machining_time_s"]
    text = (straight / "program.linuxcnc.ngc").read_text()
    again = pipeline.verify_program(part, setup, text, quiet)
    assert set(again["finding_counts"]) == {"rapid"} and max(f["limit"] for f in again["findings"]) > 2.0
