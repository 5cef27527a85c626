"""Slopes that a sharp-cornered flat end goes round in steps: fine steps finish them, and a wrong offset is told."""

import json
import math

import pytest

from service.from_wire import parse_setup
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program
from tests.step_files import write_step

LEAN = math.tan(math.radians(10.0))
FLAT = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 6, "flute_length_mm": 12, "stickout_mm": 30}
SETUP = {"tools": [FLAT], "stock": {"kind": "box", "box_mm": [[-5, -4, 0], [5, 4, 3]], "uncertainty_mm": 0.0},
         "quality": {"scallop_height_mm": 0.02}}


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane("XY").rect(10, 8).extrude(3, taper=10)
    return read_job_part(write_step(shape, tmp_path_factory.mktemp("frustum") / "part.step"),
                         parse_setup(json.dumps(SETUP)), lambda _stage, _share: None)


def rounds(step, out=0.0, up=0.0):
    """Rounds about the frustum, ``step`` mm apart, ``out`` mm too far away and ``up`` mm too high."""
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001 Q0", "G54", "T1 M6", "G43 H1", "S6000 M3", "G0 X-20 Y-20", "Z20"]
    for k in range(1, round(3.5 / step) + 1):
        z = 3.0 - k * step
        x, y = 5.0 - z * LEAN + 3.0 + out, 4.0 - z * LEAN + 3.0 + out
        lines += [f"G1 X{-x:.5f} Y-20 F600", f"Z{z + up:.4f}", f"Y{y:.5f}", f"X{x:.5f}", f"Y{-y:.5f}", f"X{-x:.5f}"]
    return "\n".join([*lines, "G1 Y-20", "G0 Z40", "G53 G0 Z0", "M2", ""])


def proof_of(job, text):
    return proved_program(job, read_first(parse_setup(json.dumps(SETUP)), text, ending=".ngc"), lambda _s: None).report


def test_fine_steps_finish_the_slopes(job):
    report = proof_of(job, rounds(0.1))
    assert report["state"] == "proved" and report["coverage"] > 0.999
    assert report["asked"]["faces"] == ["F2", "F3", "F4", "F5"]


@pytest.mark.parametrize(("out", "up", "height"), [(0.3, 0.0, 0.3 * math.cos(math.radians(10.0))),
                                                   (0.0, 1.0, math.sin(math.radians(10.0)))])
def test_fine_steps_at_an_offset_leave_the_slopes(job, out, up, height):
    report = proof_of(job, rounds(0.1, out, up))
    assert report["state"] == "clean"
    highest = {f["face"]: max(g["depth"] for g in report["findings"] if g["face"] == f["face"])
               for f in report["findings"]}
    assert set(highest) >= {"F2", "F3", "F4", "F5"}
    steps = 0.1 * math.sin(math.radians(10.0))
    assert all(height - 0.005 <= highest[f] <= height + steps + 0.005 for f in ("F2", "F3", "F4", "F5"))


def test_coarse_steps_are_no_finish(job):
    report = proof_of(job, rounds(0.5, 0.3))
    assert report["state"] == "proved" and {"sharp corner"} <= {r["reason"] for r in report["remainder"]}
