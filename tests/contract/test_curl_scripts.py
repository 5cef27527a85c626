"""The scripts of examples/curl against a served instance that wants a key."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from service.api.server import background, settings_with
from service.jobs.api_keys import KeyStore
from tests.contract.test_service_input import STEP

SCRIPTS = Path(__file__).resolve().parents[2] / "examples" / "curl"

pytestmark = pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")


@pytest.fixture(scope="module")
def run(fake_path, tmp_path_factory):
    """Run a script with its arguments in a folder with a part and a setup; returns the finished process."""
    from service.jobs.database import connect, migrate

    folder = tmp_path_factory.mktemp("curl")
    settings = settings_with({"data_dir": folder / "data", "port": 0, "poll_s": 0.05, "workers": 1})
    migrate(settings.url)
    key, _ = KeyStore(connect(settings.url)).make("mes", ["submit", "read"])
    (folder / "part.step").write_bytes(STEP)
    tool = {"id": "T1", "kind": "ball", "diameter_mm": 3}
    (folder / "tool.json").write_text(json.dumps(tool))
    (folder / "setup.json").write_text(json.dumps({"tools": [tool], "labels": {"order": "4711"}}))
    (folder / "busy.json").write_text(json.dumps({"tools": [tool], "labels": {"do": "sleep"}}))
    (folder / "good.ngc").write_text("M2\n")
    (folder / "bad.ngc").write_text("(GOUGE)\nM2\n")
    (folder / "high.ngc").write_text("(HIGH)\nM2\n")
    with background(settings, "fake_chain") as url:
        def call(script, *words, code=0, **variables):
            environment = {**os.environ, "ZONEMILL_BASE": url, "ZONEMILL_KEY": key, **variables}
            (path,) = SCRIPTS.glob(f"{script:02d}-*.sh")
            got = subprocess.run([path, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True,
                                 timeout=60)
            assert got.returncode == code, (path.name, got.returncode, got.stdout, got.stderr)
            return (got.stdout + (got.stderr if code == 22 else "")).strip()

        call.folder = folder
        yield call


def test_there_are_ten_and_each_says_what_it_does():
    scripts = sorted(SCRIPTS.glob("[0-9]*.sh"))
    assert len(scripts) == 10 and all(os.access(p, os.X_OK) for p in scripts)
    page = (SCRIPTS / "README.md").read_text()
    for path in scripts:
        lines = path.read_text().splitlines()
        assert lines[0] == "#!/usr/bin/env bash" and lines[1].startswith("# ") and f"({path.name})" in page


def test_a_job_from_the_post_to_the_release(run):
    assert json.loads(run(1))["principal"] == "mes"
    job = run(2, "part.step", "setup.json")
    assert job.startswith("/v1/jobs/j") and run(2, "part.step", "setup.json") == job
    assert run(3, job) == "proved"
    files = run(4, job, "out").splitlines()
    assert "out/program.linuxcnc.ngc" in files
    assert (run.folder / "out" / "program.linuxcnc.ngc").read_text().startswith("%")
    whole = (run.folder / "out" / "report.json").read_bytes()
    (run.folder / "out" / "report.json").write_bytes(whole[:10])  # a download that broke off
    assert run(4, job, "out").splitlines() == files and (run.folder / "out" / "report.json").read_bytes() == whole
    assert run(5, job, "0.9").endswith("released") and run(5, job, "1.1", code=3).endswith("not released")
    (line,) = run(6, "order:4711").splitlines()
    assert line.split("\t")[:2] == [job.rsplit("/", 1)[1], "proved"] and run(6, "order:none") == ""


def test_a_job_is_cancelled_and_its_files_are_gone(run):
    job = run(2, "part.step", "busy.json", "once")
    assert run(7, job) == "cancelled"
    assert "result_expired" in run(4, job, "gone", code=22)


def test_a_dry_check_and_a_verification(run):
    assert set(json.loads(run(8, "part.step", "setup.json"))) >= {"zones", "remainder"}
    assert json.loads(run(9, "part.step", "setup.json", "good.ngc"))["state"] == "proved"
    assert json.loads(run(9, "part.step", "setup.json", "bad.ngc", code=3))["findings"]
    assert json.loads(run(9, "part.step", "setup.json", "high.ngc", code=3))["state"] == "clean"


def test_a_tool_of_the_library(run):
    assert run(10, "cutter", "tool.json") == "lib:cutter@1" == run(10, "cutter", "tool.json")


def test_without_a_key_the_answer_is_shown(run):
    assert "unauthorized" in run(1, code=22, ZONEMILL_KEY="")
