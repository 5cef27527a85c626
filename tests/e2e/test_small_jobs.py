"""What a job says as a whole, on a block with one step: nothing cut, roughing alone, an earlier job's files."""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from service import pipeline
from service.cli import app
from service.delivery.result_files import RESULT_FILES
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

ROOT = Path(__file__).parents[2]
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}


@pytest.fixture(scope="module")
def part(tmp_path_factory) -> Path:
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(cq.Workplane().box(8, 12, 2, centered=False)
                                                              .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


def run(command, part, folder, setup, *more):
    path = folder / "setup.json"
    path.write_text(json.dumps(setup))
    return CliRunner().invoke(app, [command, str(part), "--setup", str(path), *more])


AIR_ONLY = """G21 G90 G94 G17 G54 G61
T1 M6
G43 H1
S3000 M3
G0 Z30
G0 X40 Y40
G0 Z12
G1 X50 F300
G0 Z30
M5
M30
"""


@pytest.mark.parametrize("text", ["%\nM30\n%\n", AIR_ONLY], ids=["nothing", "air"])
def test_a_program_that_cuts_nothing_is_not_proved(part, tmp_path, text):
    program = tmp_path / "p.ngc"
    program.write_text(text)
    got = run("verify", part, tmp_path, SETUP, "--program", str(program))
    answer = json.loads(got.stdout)
    assert got.exit_code == 3 and answer["state"] == "clean" and answer["finding_counts"] == {"nothing_cut": 1}
    assert answer["coverage"] == 0.0


def test_verify_keeps_the_least_coverage_asked_for(part, tmp_path):
    program = tmp_path / "p.ngc"
    program.write_text("G21 G90 G94 G17 G54 G61\nT1 M6\nG43 H1\nS3000 M3\nG0 Z30\nG0 X-4 Y-4\nG0 Z6\nG1 Z4.2 F100\n"
                       "G1 X20 F300\nG1 Y3\nG1 X-4\nG0 Z30\nM5\nM30\n")
    free = json.loads(run("verify", part, tmp_path, SETUP, "--program", str(program)).stdout)
    assert "coverage" not in free["finding_counts"]
    asked = {**SETUP, "quality": {"scallop_height_mm": 0.05, "coverage_min": 0.9}}
    got = run("verify", part, tmp_path, asked, "--program", str(program))
    (found,) = [f for f in json.loads(got.stdout)["findings"] if f["kind"] == "coverage"]
    assert got.exit_code == 3 and found["limit"] == 0.9 and found["depth"] == free["coverage"] < 0.9


@pytest.mark.slow
def test_roughing_alone_is_proved_and_the_rest_is_named(part, tmp_path):
    got = run("plan", part, tmp_path, {**SETUP, "operations": {"finishing": False}}, "--out", str(tmp_path / "out"))
    report = json.loads(got.stdout)
    assert got.exit_code == 0 and report["state"] == "proved" and not report["complete"]
    assert {s["operation"] for s in report["steps"]} == {"roughing"}
    left = sum(x["area_mm2"] for x in report["remainder"] if x["reason"] == "pass")
    missing = (1.0 - report["reach_coverage"]) / report["reach_coverage"] * report["coverage"]
    assert left == pytest.approx(missing * report["machinable_area_mm2"], rel=0.02) and left > 100


@pytest.mark.slow
def test_threads_of_a_job_keep_out_of_the_threading_layer_of_numba(part, tmp_path):
    """The layer that numba has everywhere ends a process that two threads enter at once."""
    setup = tmp_path / "setup.json"
    setup.write_text(json.dumps(SETUP))
    command = [sys.executable, "-m", "service.cli", "plan", str(part), "--setup", str(setup), "--out", str(tmp_path)]
    env = {**os.environ, "NUMBA_THREADING_LAYER": "workqueue", "NUMBA_NUM_THREADS": "2"}
    done = subprocess.run(command, env=env, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and json.loads(done.stdout)["proposal"] is not None, done.stderr[-2000:]


@pytest.mark.slow
def test_a_zone_that_is_gone_over_again_is_proved_and_written_as_two_workingsteps(tmp_path):
    # nothing is roughed: the shank meets stock that a zone finished later takes away
    def box(x, y, z, at):
        return cq.Workplane().box(x, y, z, centered=False).translate(at)

    part = write_step(box(14, 8.5, 2, (0, 0, 0)).union(box(1.5, 5.5, 5, (3, 1.5, 2)))
                      .union(box(1.5, 5.5, 1.5, (6.5, 1.5, 2))), tmp_path / "walls.step")
    tool = {"id": "T1", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 3, "neck_diameter_mm": 2.85,
            "neck_length_mm": 3, "shank_diameter_mm": 4, "stickout_mm": 4,
            "holder": [{"diameter_mm": 12, "diameter_top_mm": 20, "length_mm": 8}]}
    setup = {"tools": [tool], "quality": {"scallop_height_mm": 0.03}, "operations": {"roughing": False},
             "stock": {"margin_mm": 0.3, "uncertainty_mm": 0}}
    got = run("plan", part, tmp_path, setup, "--out", str(tmp_path / "out"))
    report = json.loads(got.stdout)
    steps = {s["id"]: s for s in report["steps"]}
    (twice,) = [z for z in report["zones"] if len(z["steps"]) > 1]
    assert got.exit_code == 0 and report["state"] == "proved" and list(steps) == sorted(steps)
    assert twice["step"] == twice["steps"][0] and all(steps[i]["zone"] == twice["id"] for i in twice["steps"])
    total = sum(steps[i]["machining_time_s"] for i in twice["steps"])
    assert twice["machining_time_s"] == pytest.approx(total, abs=0.11)
    written = (tmp_path / "out" / "job.arm.stpnc").read_text()
    assert all(f"'{i} {twice['id']} " in written for i in twice["steps"])
    for name in ("job.stpnc", "job.arm.stpnc"):  # what is proved of the program is found of both forms of STEP-NC too
        again = run("verify", part, tmp_path, setup, "--program", str(tmp_path / "out" / name))
        found = json.loads(again.stdout)
        assert again.exit_code == 0 and not found["findings"]
        assert found["coverage"] == pytest.approx(report["coverage"], abs=2e-3)


@pytest.mark.parametrize("fault", ["unproved", "bad part", "bad setup"])
def test_no_program_of_an_earlier_job_stays_beside_a_later_answer(part, tmp_path, fault):
    out = tmp_path / "out"
    out.mkdir()
    for name in (*RESULT_FILES, "mine.txt"):
        (out / name).write_text("of another job")
    setup = dict(SETUP)
    if fault == "unproved":  # a ball leaves the inner corner
        setup["tools"] = [{**FLAT, "kind": "ball"}]
        setup["quality"] = {"scallop_height_mm": 0.05, "coverage_min": 1.0}
    if fault == "bad part":
        part = tmp_path / "bad.step"
        part.write_text("no STEP")
    if fault == "bad setup":
        setup["unit"] = "inch"
    got = run("plan", part, tmp_path, setup, "--out", str(out))
    assert got.exit_code == (3 if fault == "unproved" else 2), got.output
    kept = {p.name: p.read_text(errors="replace") for p in out.iterdir()}
    assert kept.pop("mine.txt") == "of another job"
    assert "of another job" not in kept.values()
    assert not {"program.linuxcnc.ngc", "job.stpnc", "job.arm.stpnc"} & set(kept)


def test_warm_plans_a_part_on_which_every_strategy_has_something_to_do(monkeypatch):
    jobs = []
    plan = pipeline.plan_and_prove

    def listening(*args):
        jobs.append(plan(*args))
        return jobs[-1]

    monkeypatch.setattr(pipeline, "plan_and_prove", listening)
    assert CliRunner().invoke(app, ["warm"]).exit_code == 0
    assert {s.strategy for s in jobs[0].plan.steps} == {
        "depth_layers", "planar_floor", "waterline", "zigzag", "isoparametric"}
    assert jobs[0].proof.findings == ()


def test_warm_fails_where_the_small_part_is_not_proved(monkeypatch):
    finding = SimpleNamespace(message="T1 cuts into the part")
    monkeypatch.setattr(pipeline, "prove_plan", lambda *_args: SimpleNamespace(findings=[finding]))
    got = CliRunner().invoke(app, ["warm", "--json"])
    assert got.exit_code == 1
    problem = json.loads(got.stdout)
    assert problem["code"] == "not_as_installed" and problem["subjects"] == ["T1 cuts into the part"]


@pytest.mark.slow
def test_a_bull_nose_finishes_rounds_that_go_over_into_a_level_plane(tmp_path):
    """Its tip is not given by a contact on the level edge; both strategies are tried there and one is proved."""
    shape = cq.Workplane().box(10, 8, 4, centered=False).edges("|Y and >Z").fillet(2)
    bull = {**FLAT, "kind": "bull", "corner_radius_mm": 0.5, "flute_length_mm": 12}
    setup = {**SETUP, "tools": [bull], "quality": {"scallop_height_mm": 0.02}}
    out = tmp_path / "out"
    got = run("plan", write_step(shape, tmp_path / "round.step"), tmp_path, setup, "--out", str(out))
    report = json.loads((out / "report.json").read_text())
    assert got.exit_code == 0 and report["state"] == "proved" and report["coverage"] == 1.0
    tried = [r for z in report["zones"] for r in z["rejected"] if r.get("strategy") == "isoparametric"]
    assert any("longer" in r["reason"] for r in tried) or any(z["strategy"] == "isoparametric" for z in report["zones"])


@pytest.mark.slow
def test_the_middle_of_a_hole_is_cut_away_before_it_comes_loose(tmp_path):
    part = write_step(cq.Workplane().box(24, 24, 3, centered=(True, True, False)).faces(">Z").workplane().hole(18.0),
                      tmp_path / "hole.step")
    box = {"kind": "box", "box_mm": [[-12, -12, 0], [12, 12, 3]], "uncertainty_mm": 0.0}
    got = run("plan", part, tmp_path, SETUP | {"stock": box}, "--out", str(tmp_path / "out"))
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert got.exit_code == 0 and report["state"] == "proved", got.stderr
    assert "loose_stock" not in {a["what"] for a in report["proof"]["assumed"]}
