"""Clients in four languages, generated from openapi.yaml and compiled, each running a whole job: ``make clients``."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from service.api.server import background, settings_with
from service.jobs.api_keys import KeyStore
from tests.step_files import write_step

ROOT = Path(__file__).resolve().parents[2]
CLIENTS = ROOT / "examples" / "clients"
OAPI_CODEGEN = "github.com/oapi-codegen/oapi-codegen/v2/cmd/oapi-codegen@v2.8.2"

# What each wants on the machine, how it is generated and compiled, how it is run.
LANGUAGES = {
    "python": ([], [["mkdir", "-p", "../../../build/clients"],
                    [sys.executable, "-m", "openapi_python_client", "generate", "--path", "../../../openapi.yaml",
                     "--meta", "none", "--output-path", "../../../build/clients/zonemill_client", "--overwrite"]],
               [sys.executable, "run_job.py"]),
    "typescript": (["node", "npm"], [["npm", "ci", "--silent"], ["npm", "run", "--silent", "build"]],
                   ["node", "dist/run-job.js"]),
    "go": (["go"], [["mkdir", "-p", "zonemill"],
                    ["go", "run", OAPI_CODEGEN, "-config", "oapi.yaml", "../../../openapi.yaml"],
                    ["go", "vet", "."], ["go", "build", "-o", "run-job", "."]], ["./run-job"]),
    "java": (["java", "javac", "mvn"], [["mvn", "-q", "-B", "clean", "package"]],
             ["java", "-cp", "target/run-job-1.jar:target/libraries/*", "RunJob"]),
}

NO_NETWORK = "ENOTFOUND|EAI_AGAIN|ECONNREFUSED|ETIMEDOUT|dial tcp|Could not transfer|Unknown host|no such host"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """The service itself, which wants a key, and a part of one step."""
    from service.jobs.database import connect, migrate

    cq = pytest.importorskip("cadquery")
    folder = tmp_path_factory.mktemp("clients")
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(
        cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    part = write_step(shape, folder / "part.step")
    settings = settings_with({"data_dir": folder / "data", "port": 0, "workers": 1})
    migrate(settings.url)
    key, _ = KeyStore(connect(settings.url)).make("mes", ["submit", "read"])
    with background(settings) as url:
        yield url, key, part


def _run(words, folder, **variables):
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "NO_PROXY": "127.0.0.1",
                   "no_proxy": "127.0.0.1", "PYTHONPATH": str(ROOT / "build" / "clients"), **variables}
    return subprocess.run(list(map(str, words)), cwd=folder, env=environment, capture_output=True, text=True,
                          timeout=800)


def _build(language, folder):
    """Generate and compile; skips where the language or its packages are not to be had."""
    wanted, steps, _ = LANGUAGES[language]
    for program in wanted:
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    for step in steps:
        made = _run(step, folder)
        said = made.stdout + made.stderr
        if made.returncode and re.search(NO_NETWORK, said):
            pytest.skip(f"the packages for {language} cannot be had: {said.strip().splitlines()[0][:200]}")
        assert made.returncode == 0, said


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_generated_client_runs_a_whole_job(served, tmp_path, language):
    url, key, part = served
    folder = CLIENTS / language
    _build(language, folder)
    told = []
    for out in (tmp_path / "first", tmp_path / "again"):  # the second finds the job of the first
        out.mkdir()
        got = _run([*LANGUAGES[language][2], part, out], folder, ZONEMILL_BASE=url, ZONEMILL_KEY=key)
        assert got.returncode == 0, got.stdout + got.stderr
        told.append(got.stdout.strip().splitlines()[-1])
        assert (out / "program.linuxcnc.ngc").read_text().startswith("%")
    assert told[0] == told[1] and re.fullmatch(r"proved, coverage (1\.0000|0\.9\d{3}), 1 programs", told[0]), told
    found = httpx.get(f"{url}/v1/jobs", params={"label": f"client:{language}"}, trust_env=False,
                      headers={"Authorization": f"Bearer {key}"}).json()["items"]
    assert [job["state"] for job in found] == ["proved"]


def test_each_says_how_it_is_made():
    page = (CLIENTS / "README.md").read_text()
    for language in LANGUAGES:
        assert f"]({language})" in page
    locked = json.loads((CLIENTS / "typescript" / "package-lock.json").read_text())
    assert not [p for p in locked["packages"].values() if "resolved" in p]
