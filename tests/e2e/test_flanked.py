"""A leaning, ruled wall on a machine that turns: its sides cut by the flank, and all of it proved."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from geometry.mesh import F64
from service import pipeline
from service.from_wire import parse_setup
from service.stages.job_inputs import JobInputs
from service.stages.preparation import prepare
from service.stages.programs import turning_of
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

TOOL = {"id": "T1", "kind": "bull", "corner_radius_mm": 1, "flutes": 3, "diameter_mm": 6, "flute_length_mm": 14,
        "neck_diameter_mm": 5.8, "neck_length_mm": 24, "shank_diameter_mm": 6, "stickout_mm": 40,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]],
           "orientations": "given"}
SETUP = {"tools": [TOOL], "quality": {"scallop_height_mm": 0.03, "chordal_tolerance_mm": 0.01},
         "material": "AlMgSi1 6082", "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.1}, "machine": MACHINE}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wall 7 high, 5 thick at the foot, its long sides leaning 9 and 15 degrees; the first twists a little."""
    base = cq.Workplane().box(24, 16, 3, centered=(True, True, False))
    low, high = [(-8, -2.5), (8, -2.5), (8, 2.5), (-8, 2.5)], [(-7.5, -1.4), (7.5, -1.1), (7.5, 0.6), (-7.5, 0.6)]
    wall = cq.Workplane().polyline(low).close().workplane(offset=7).polyline(high).close().loft(ruled=True)
    path = tmp_path_factory.mktemp("leaning") / "leaning.step"
    cq.exporters.export(base.union(wall.translate((0, 0, 3))), str(path))
    return path


@pytest.fixture(scope="module")
def job(part: Path) -> tuple[Path, dict[str, Any]]:
    """Folder and report of the job."""
    out = part.parent / "out"
    return out, pipeline.plan(part, parse_setup(json.dumps(SETUP)), out, quiet)


def test_leaning_walls_are_cut_by_the_flank_and_proved(job: tuple[Path, dict[str, Any]]) -> None:
    out, report = job
    assert report["state"] == "proved", report["findings"]
    flanked = [z for z in report["zones"] if z["strategy"] == "flank"]
    assert flanked and all(z["coverage"] > 0.99 for z in flanked)
    for zone in flanked:  # walked with all that follows, and held against levels alone
        (levels,) = [r for r in zone["rejected"] if r["strategy"] == "waterline"]
        assert "takes longer" in levels["reason"] and levels["value"] > levels["limit"]


def test_the_flank_lies_on_the_walls(job: tuple[Path, dict[str, Any]]) -> None:
    """Beside each long side the axis lies in it, 9 to 11 and 15 degrees off Z; the first twists, so there it turns."""
    axes, tips = cutting_axes(job[0])
    leans = np.degrees(np.arctan2(axes[:, 1], axes[:, 2]))
    for y, tops in ((-2.5, np.array([-1.4, -1.1])), (2.5, np.array([0.6, 0.6]))):
        wanted = np.degrees(np.arctan2(tops - y, 7.0))
        beside = (tips[:, 1] * np.sign(y) > 2.5) & (np.abs(tips[:, 0]) < 7.0) & (np.abs(leans) > 1.0)
        near = (leans > wanted.min() - 0.1) & (leans < wanted.max() + 0.1)
        assert (beside & near).sum() >= 2, (y, wanted, np.unique(leans[beside].round(2)))
        assert not np.ptp(wanted) or np.ptp(leans[beside & near]) > 0.8 * np.ptp(wanted)


def test_both_forms_of_stepnc_say_how_the_tool_leans(job: tuple[Path, dict[str, Any]]) -> None:
    aim, arm = ((job[0] / name).read_text() for name in ("job.stpnc", "job.arm.stpnc"))
    assert "'tool axis'" in aim and "flank" in aim and "flank" in arm


def cutting_axes(out: Path) -> tuple[F64, F64]:
    """Tool axes (n, 3) and tips (n, 3), mm, at the ends of the feed moves of the program."""
    p = read_program((out / "program.linuxcnc.ngc").read_text(), kinematics=Kinematics("table-table-AC", None))
    cuts = ~np.isnan(p.feed)
    return p.poses.end_axis[cuts], p.end[cuts]


def test_a_machine_that_only_indexes_is_given_no_pass_whose_axis_moves(part: Path) -> None:
    setup = parse_setup(json.dumps(SETUP | {"machine": {**MACHINE, "simultaneous": False}}))
    ready = prepare(part, setup, quiet)
    assert turning_of(ready, ready.views[0]) is None
    moving = replace(ready, inputs=JobInputs.of(parse_setup(json.dumps(SETUP))))
    assert turning_of(moving, ready.views[0]) is not None
