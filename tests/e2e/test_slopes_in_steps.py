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


def rounds(step, out=0.0, up=0.0, lowest=-0.5, left_out=(9.0, 9.0)):
    """Rounds about the frustum down to ``lowest``, ``step`` mm apart, ``out`` mm too far away, ``up`` mm too high.

    Those between the two heights ``left_out`` are missing.
    """
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001 Q0", "G54", "T1 M6", "G43 H1", "S6000 M3", "G0 X-20 Y-20", "Z20"]
    for k in range(1, round(3.5 / step) + 1):
        z = 3.0 - k * step
        if z < lowest - 1e-9:
            break
        if left_out[0] < z < left_out[1]:
            continue
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


def test_slopes_that_fine_steps_finish_in_part_are_asked_to_their_foot(job):
    """Steps end 1.5 mm over the foot, where the whole blank still stands."""
    report = proof_of(job, rounds(0.1, lowest=1.5))
    assert report["state"] == "clean"
    low = [f for f in report["findings"] if f["kind"] == "stock_left" and f["point"][2] < 1.5]
    assert low and {f["face"] for f in low} <= {"F2", "F3", "F4", "F5"}


@pytest.mark.parametrize(("left_out", "lowest", "high"), [((9.0, 9.0), -0.5, None), ((1.0, 2.2), -0.5, 1.2),
                                                         ((9.0, 9.0), 1.5, 1.5)])
def test_steps_left_out_are_told_though_the_steps_are_not_fine(job, left_out, lowest, high):
    """Steps of 0.15 leave stairs of 0.026, more than the scallop height, which are remainder where all are there."""
    report = proof_of(job, rounds(0.15, lowest=lowest, left_out=left_out))
    assert report["state"] == ("proved" if high is None else "clean")
    if high is not None:
        deepest = high * math.sin(math.radians(10.0))
        found = [f for f in report["findings"] if f["kind"] == "stock_left"]
        assert {f["face"] for f in found} >= {"F2", "F3", "F4", "F5"}
        assert 0.6 * deepest < max(f["depth"] for f in found) < deepest + 0.01


ROUND = {"tools": [dict(FLAT, diameter_mm=4)], "quality": {"scallop_height_mm": 0.01},
         "stock": {"kind": "box", "box_mm": [[0, 0, 0], [12, 8, 6]], "uncertainty_mm": 0.0}}


@pytest.mark.parametrize(("out", "up", "state"), [(0.0, 0.0, "proved"), (0.2, 0.0, "clean"), (0.0, 0.1, "clean")])
def test_an_offset_on_a_round_edge_is_told_though_it_differs_along_the_normal(tmp_path, out, up, state):
    """A quarter round of 2 mm in steps of 0.015: an offset aside leaves its cosine, one upwards its sine."""
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(12, 8, 6, centered=False).edges(">Y and >Z").fillet(2.0)
    setup = parse_setup(json.dumps(ROUND))
    job = read_job_part(write_step(shape, tmp_path / "part.step"), setup, lambda _stage, _share: None)
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001 Q0", "G54", "T1 M6", "G43 H1", "S6000 M3", "G0 X-8 Y16", "Z20"]
    for depth in (1.0, 2.0):
        lines += [f"G0 X-8 Y{10.0 + out}", f"Z{6.0 - depth + up}", "G1 X20 F400", "G0 Z20"]
    lines += ["G0 X-8 Y12", f"Z{6.0 + up}"]
    for k in range(1, 134):
        drop = 0.015 * k
        y = 6.0 + math.sqrt(4.0 - (2.0 - drop) ** 2) + 2.0 + out
        lines += [f"G1 Y{y:.5f} F400", f"Z{6.0 - drop + up:.4f}", f"X{20 if k % 2 else -8}"]
    lines += ["G0 Z40", "G53 G0 Z0", "M2"]
    read = read_first(setup, "\n".join(lines) + "\n", ending=".ngc")
    report = proved_program(job, read, lambda _s: None).report
    assert report["state"] == state, report["findings"][:2]
    if state == "clean":
        highest = max(f["depth"] for f in report["findings"])
        assert 0.7 * max(out, up) < highest < max(out, up) + 0.01
