"""A job that is not proved gives no program away, by the command line, over HTTP or in a file; and says why."""

import json
import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from schemas.report import Report
from service.api.app import create_app
from service.cli import app
from service.settings import Settings
from service.stages import programs
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

FAKES = Path(__file__).resolve().parents[1] / "contract" / "fakes"
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}
PROGRAMS = ("program.linuxcnc.ngc", "job.stpnc", "job.arm.stpnc")


@pytest.fixture(scope="module")
def part(tmp_path_factory) -> Path:
    """A block of 16 x 12 x 4 mm with a step 2 mm deep."""
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(cq.Workplane().box(8, 12, 2, centered=False)
                                                              .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


def call(part, folder, *more, **changes):
    (folder / "setup.json").write_text(json.dumps({**SETUP, **changes}))
    return CliRunner().invoke(app, ["plan", str(part), "--setup", str(folder / "setup.json"), "--out",
                                    str(folder / "out"), *more])


def the_gouge(findings):
    """The planted finding: its kind, line and depth."""
    (found,) = [f for f in findings if f["kind"] == "gouge"]
    assert found["depth"] == pytest.approx(0.5, abs=0.01) and found["line"] > 50
    return found


def test_an_older_proved_program_is_gone_when_the_job_is_no_longer_proved(part, tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert call(part, tmp_path).exit_code == 0
    proved = (out / PROGRAMS[0]).read_text()
    (out / "program.A2.linuxcnc.ngc").write_text(proved)  # of an earlier job with two accesses
    (out / "job.A2.arm.stpnc").write_text("ISO-10303-21;\n")
    (out / "program.linuxcnc.ngc.part").write_text(proved)  # of one that was cut off while it wrote
    (out / "program.mine.txt").write_text("kept")
    monkeypatch.syspath_prepend(str(FAKES))
    monkeypatch.setattr(programs, "write_program", programs.write_program)
    import gouging_chain

    monkeypatch.setattr(programs, "write_program", gouging_chain.gouging)
    got = call(part, tmp_path)
    assert got.exit_code == 3
    report = json.loads(got.stdout)
    assert report["state"] == "unproved" and the_gouge(report["findings"])["program"] == PROGRAMS[0]
    left = {p.name for p in out.iterdir()}
    assert left == {"report.json", "zones.json", "preview.png", "deviation.png", "sheet.html", "sheet.pdf",
                    "view.bin", "program.mine.txt"}
    assert b"UNPROVED" in (out / "sheet.html").read_bytes()
    assert {f["name"] for f in report["files"]} == left - {"report.json", "program.mine.txt"}
    assert not [p for p in out.iterdir() if b"T1 M6" in p.read_bytes() or b"ISO-10303-21" in p.read_bytes()]


def test_over_http_the_answer_is_the_finding(part, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(FAKES))
    settings = Settings(data_dir=tmp_path / "data", workers=1, child_threads=1, poll_s=0.05, job_time_limit_s=120)
    with TestClient(create_app(settings, chain="gouging_chain"), base_url="http://127.0.0.1") as client:
        files = {"part": ("p.step", part.read_bytes(), "model/step"),
                 "setup": ("s.json", json.dumps(SETUP), "application/json")}
        job = client.post("/v1/jobs", files=files).json()
        deadline = time.monotonic() + 120
        while job["state"] in ("queued", "running") and time.monotonic() < deadline:
            time.sleep(0.1)
            job = client.get(job["links"]["self"]).json()
        assert job["state"] == "unproved", job
        report = client.get(job["links"]["report"]).json()
        found = the_gouge(report["findings"])
        Report.model_validate(report)
        assert max(d["gouge_mm"] for d in report["deviation"]) == pytest.approx(0.5, abs=0.01)
        assert report["machined"] is None
        listed = client.get(job["links"]["files"]).json()
        names = {f["name"] for f in listed["items"]}
        assert names == {"report.json", "zones.json", "preview.png", "deviation.png", "sheet.html", "sheet.pdf",
                         "view.bin"}
        assert "gouge" in listed["withheld"]
        for name in PROGRAMS:
            answer = client.get(f"{job['links']['files']}/{name}")
            assert answer.status_code == 409 and answer.json()["code"] == "program_withheld"
            assert answer.headers["content-type"].startswith("application/problem+json")
            assert the_gouge(answer.json()["measured"]) == found
            assert f'"line": {found["line"]}' in answer.json()["detail"]
    kept = [p for p in (tmp_path / "data").rglob("*") if p.is_file() and p.suffix not in (".bin",)]
    assert kept and not [p.name for p in kept if b"T1 M6" in p.read_bytes()]
