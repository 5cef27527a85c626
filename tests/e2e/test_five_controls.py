"""One small job for all five controls: each program listed, read back, proved by itself, and none if one lies."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from geometry.errors import InternalError
from output.gcode.dialects import DIALECTS
from schemas.machine import DIALECT_ENDINGS
from service import pipeline
from service.cli import app
from service.delivery.result_files import clear_results
from service.from_wire import parse_setup
from service.stages import programs
from tests.step_files import write_step
from verify.gcode.dialects import DIALECTS as READ

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0},
         "operations": {"finishing": False}, "access": [{"work_offset": "G59.1"}],
         "machine": {"dialects": ["siemens", "linuxcnc", "fanuc", "haas", "heidenhain"]}}
NAMES = {d: f"program.{d}.{ending}" for d, ending in DIALECT_ENDINGS.items()}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def part(tmp_path_factory) -> Path:
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(cq.Workplane().box(8, 12, 2, centered=False)
                                                              .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


@pytest.fixture(scope="module")
def job(part, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return out, pipeline.plan(part, parse_setup(json.dumps(SETUP)), out, quiet)


def test_what_the_wire_names_is_written_and_read():
    assert {name: d.ending for name, d in DIALECTS.items()} == DIALECT_ENDINGS == {d: DIALECT_ENDINGS[d] for d in READ}


def test_all_five_are_delivered_and_listed(job):
    out, report = job
    assert report["state"] == "proved"
    listed = {f["dialect"]: f for f in report["files"] if f["kind"] == "program"}
    assert {d: f["name"] for d, f in listed.items()} == NAMES
    for f in listed.values():
        assert hashlib.sha256((out / f["name"]).read_bytes()).hexdigest() == f["sha256"]


def test_headers_say_what_the_report_says(job):
    """Hashes whole, and the figures of the proof, in every control's program and both forms of STEP-NC."""
    out, report = job
    for name in (*NAMES.values(), "job.stpnc", "job.arm.stpnc"):
        text = re.sub(r"[^a-z0-9.]", "", (out / name).read_text().lower().replace("pct", ""))
        told = [*report["inputs"].values(), f"coverage{100 * report['coverage']:.2f}",
                f"machiningtime{report['machining_time_s'] / 60:.1f}min",
                f"{report['proof']['samples']}samples", f"in{len(report['remainder'])}entriesofreport.json"]
        assert all(words in text for words in told), name
        assert "notmadeyet" not in text


def test_every_step_has_its_label_unless_the_setup_says_otherwise(part, job, tmp_path):
    out, report = job
    setup = {**SETUP, "machine": {**SETUP["machine"], "restart_points": False}}
    pipeline.plan(part, parse_setup(json.dumps(setup)), tmp_path, quiet)
    marks = {"siemens": r"^STEP_S\d+:", "heidenhain": r'^\d+ LBL "S\d+"'}
    for d, name in NAMES.items():
        mark = re.compile(marks.get(d, r"^N\d+$"), re.MULTILINE)
        assert len(mark.findall((out / name).read_text())) == len(report["steps"])
        assert not mark.findall((tmp_path / name).read_text())


@pytest.mark.parametrize("dialect", ["siemens", "heidenhain", "haas"])
def test_each_is_proved_by_the_command_line(dialect, part, job, tmp_path):
    """By its name alone for two of them; an .nc is a Haas's where the machine says so."""
    setup = {**SETUP, "machine": {"dialects": ["haas"]}} if dialect == "haas" else SETUP
    path = tmp_path / "setup.json"
    path.write_text(json.dumps(setup))
    got = CliRunner().invoke(app, ["verify", str(part), "--setup", str(path), "--program",
                                   str(job[0] / NAMES[dialect])])
    assert got.exit_code == 0, got.stdout
    assert json.loads(got.stdout)["coverage"] == pytest.approx(job[1]["coverage"], abs=1e-6)


def test_a_dialect_nobody_reads_is_refused(part, job, tmp_path):
    path = tmp_path / "setup.json"
    path.write_text(json.dumps(SETUP))
    got = CliRunner().invoke(app, ["verify", str(part), "--setup", str(path), "--dialect", "fagor", "--program",
                                   str(job[0] / NAMES["haas"]), "--json"])
    assert got.exit_code == 2 and "unknown_dialect" in got.stdout


def test_nothing_is_delivered_where_one_of_them_differs(part, tmp_path, monkeypatch):
    write = programs.write_program

    def lying(work, dialect):
        text = write(work, dialect)
        return text.replace("\nM8\n", "\nM9\n") if dialect.name == "haas" else text

    monkeypatch.setattr(programs, "write_program", lying)
    with pytest.raises(InternalError) as refused:
        pipeline.plan(part, parse_setup(json.dumps(SETUP)), tmp_path, quiet)
    assert refused.value.code == "programs_differ" and refused.value.subjects == (NAMES["siemens"], NAMES["haas"])
    assert not list(tmp_path.glob("program*")) and not list(tmp_path.glob("*.stpnc"))


@pytest.mark.parametrize("order", [["fanuc", "linuxcnc"], ["fanuc", "heidenhain", "haas"], ["fanuc"]], ids=str)
@pytest.mark.slow
def test_the_one_simulated_says_how_far_a_path_is_left(order, part, tmp_path):
    """In whatever order the machine names them; what it says is in the error bound."""
    report = pipeline.plan(part, parse_setup(json.dumps({**SETUP, "machine": {"dialects": order}})), tmp_path, quiet)
    assert report["state"] == "proved"
    assert sorted(f["dialect"] for f in report["files"] if f["kind"] == "program") == sorted(order)
    assert any("parameters of the machine" in note for note in report["proof"]["notes"])
    assert (report["proof"]["error_bound_mm"] > 0.0015) == (len(order) > 1)


@pytest.mark.slow
def test_a_program_too_large_for_its_control_is_parted_and_proved(part, tmp_path):
    """A step of 14 kB and two small ones for 16 kB: three programs, run one after the other on one blank."""
    machine = {"dialects": ["linuxcnc", "heidenhain"], "max_program_kb": 16, "arcs": False}
    setup = parse_setup(json.dumps({**SETUP, "operations": {}, "machine": machine}))
    report = pipeline.plan(part, setup, tmp_path, quiet)
    assert report["state"] == "proved" and report["coverage"] == 1.0
    names = [f["name"] for f in report["files"] if f["kind"] == "program"]
    ends = ("linuxcnc.ngc", "heidenhain.h")
    assert names == sorted(f"program{k}.{end}" for k in ("", ".part2", ".part3") for end in ends)
    assert all((tmp_path / n).stat().st_size <= 16_000 for n in names)
    steps = [s["id"] for s in report["steps"]]
    told = [s for n in names if n.endswith("ngc") for s in steps if f"({s} " in (tmp_path / n).read_text()]
    assert sorted(told) == steps


def test_programs_of_an_earlier_job_are_cleared(tmp_path):
    for name in (*NAMES.values(), "program.A2.fanuc.nc", "mine.nc"):
        (tmp_path / name).touch()
    clear_results(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["mine.nc"]
