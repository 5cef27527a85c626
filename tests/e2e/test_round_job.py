"""A job with arcs: proved, the same on all five controls and in STEP-NC, and within its share of the tolerance."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from service import pipeline
from service.from_wire import parse_setup
from service.stages import programs
from tests.arc_plans import off
from tests.step_files import write_step
from toolpath.workingsteps import TrajectoryKind
from verify.gcode.reader import read_program

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

CHORDAL = 0.005
MANY = 20  # arcs
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 9, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0},
         "quality": {"scallop_height_mm": 0.05, "chordal_tolerance_mm": CHORDAL},
         "machine": {"arcs": True, "dialects": ["linuxcnc", "fanuc", "haas", "siemens", "heidenhain"]}}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    """The report, the folder, and the plan before arcs were put into it."""
    folder, seen = tmp_path_factory.mktemp("round"), []
    shape = cq.Workplane().box(11, 11, 2, centered=False).union(
        cq.Workplane().circle(3.0).workplane(offset=2.0).circle(2.6).loft(combine=True).translate((5.5, 5.5, 2)))

    def spied(work, tolerance):
        seen.append((work, tolerance))
        return fitted(work, tolerance)

    fitted, programs.fitted = programs.fitted, spied
    try:
        report = pipeline.plan(write_step(shape, folder / "round.step"), parse_setup(json.dumps(SETUP)), folder / "out",
                            lambda _stage, _share: None)
    finally:
        programs.fitted = fitted
    ((work, tolerance),) = seen
    assert tolerance == pytest.approx(0.5 * CHORDAL)
    return report, folder / "out", work


def test_it_is_proved_and_delivered(job):
    report, out, _ = job
    assert report["state"] == "proved" and len([f for f in report["files"] if f["kind"] == "program"]) == 5
    circles = [(out / name).read_text().count("=TRIMMED_CURVE(") for name in ("job.stpnc", "job.arm.stpnc")]
    assert circles[0] == circles[1] >= MANY
    arcs = {p.name: len(re.findall(r"^(?:\d+ )?(?:G[23]|CP?) [XI]", p.read_text(), re.MULTILINE))
            for p in out.glob("program.*")}
    assert len(arcs) == 5 and len(set(arcs.values())) == 1 and min(arcs.values()) >= MANY, arcs


def test_the_program_is_within_its_share_of_the_plan(job):
    """As the reader simulates it, with chords too fine to count: from the plan to it and back."""
    _, out, work = job
    p = read_program((out / "program.linuxcnc.ngc").read_text(), chord=1e-6)
    grid = 3.0 * 0.5e-4 * 2.0**0.5  # start and centre are rounded: the centre moves, and the radius by both
    most = 0.5 * CHORDAL + grid
    for step in work.steps:
        planned = [t.points for t in step.trajectories if t.motion is TrajectoryKind.CUT]
        mine = np.flatnonzero((p.tool == step.tool.number) & ~np.isnan(p.feed))
        ends = np.vstack([p.start[mine[:1]], p.end[mine]])
        assert off(np.vstack(planned)[::5], ends) <= most
    written = sum(len(t.points) - 1 for s in work.steps for t in s.trajectories)
    assert len(np.unique(p.line)) < written


def test_the_plan_keeps_the_other_half(job):
    _, _, work = job
    assert [s.chordal_tolerance for s in work.steps] == pytest.approx([0.5 * CHORDAL] * len(work.steps))
