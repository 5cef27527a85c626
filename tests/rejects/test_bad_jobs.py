"""Whole jobs that are wrong by themselves, at both doors: exit code, problem type, words, nothing left running.

What the reader says of each bad STEP file is in ``test_bad_step``, what the setup schema says in
``tests/unit/schemas/test_setup``; here the real chain runs behind the command line and behind HTTP.
"""

import json
import os
import subprocess
import sys
import time
import uuid
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import pytest
from fastapi.testclient import TestClient

from geometry.step_import.occ.loading import load_part
from geometry.step_import.reader import READER_MODULE
from service.api.app import create_app
from service.jobs.job_child import JOB_MODULE
from service.logs import configure
from service.settings import Settings
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

ROOT = Path(__file__).resolve().parents[2]
BALL = {"id": "T1", "kind": "ball", "diameter_mm": 3}
GOOD = {"tools": [BALL], "quality": {"scallop_height_mm": 0.05}}


@dataclass(frozen=True)
class Bad:
    """One bad job: its part, its setup, and what must be said. ``late``: found only once a job runs."""

    code: str
    slug: str
    words: str
    part: str = "box"
    setup: dict | str | None = None
    late: bool = False

# what is delivered of a job that is not proved
WITHOUT_PROGRAMS = {"report.json", "zones.json", "preview.png", "deviation.png", "sheet.html", "sheet.pdf",
                    "view.bin"}


def tools(*given, **fields):
    return {**GOOD, "tools": list(given), **fields}


CASES = {
    "empty file": Bad("empty_file", "bad-step", "empty", "empty"),
    "text that is no STEP": Bad("not_step", "bad-step", "not a STEP file", "letter"),
    "truncated STEP": Bad("truncated_step", "bad-step", "END-ISO-10303-21", "cut"),
    "STEP without solids": Bad("no_solid", "bad-step", "no solid", "wire", late=True),
    "open shell": Bad("open_shell", "bad-part", "do not close", "open", late=True),
    "two separate solids": Bad("several_solids", "bad-part", "10 x 10 x 10", "two", late=True),
    "a part of 0.1 mm": Bad("part_too_small", "bad-part", "0.1", "dust", late=True),
    "a part of 20 m": Bad("part_too_large", "bad-part", "20", "ship", late=True),
    "no tools": Bad("bad_setup", "bad-setup", "no tools", setup=tools()),
    "a negative length": Bad("bad_setup", "bad-setup", "tools[0].stickout_mm",
                             setup=tools({**BALL, "stickout_mm": -4})),
    "inconsistent lengths": Bad("bad_setup", "bad-setup", "flute_length_mm <= neck_length_mm",
                                setup=tools({**BALL, "flute_length_mm": 30, "neck_length_mm": 10})),
    "an unknown field": Bad("bad_setup", "bad-setup", "coolant", setup=tools(BALL, coolant="flood")),
    "an unknown unit": Bad("bad_setup", "bad-setup", "diameter_in", setup=tools({**BALL, "diameter_in": 0.1})),
    "a unit of the whole": Bad("bad_setup", "bad-setup", "unit", setup=tools(BALL, unit="inch")),
    "a scallop larger than the tool": Bad("bad_setup", "bad-setup", "radius 1.5 of the smallest tool T1",
                                          setup=tools(BALL, quality={"scallop_height_mm": 2})),
    "a setup that is no JSON": Bad("setup_not_json", "bad-setup", "JSON", setup="{tools: ball}"),
    "a coordinate that is no number": Bad("bad_number", "bad-step", "NAN", "nan"),
    "a name that stands twice": Bad("repeated_key", "bad-setup", "tools", setup='{"tools": [], "tools": []}'),
    "an origin beyond all bounds": Bad("bad_setup", "bad-setup", "placement.origin_mm[0]",
                                       setup=tools(BALL, placement={"origin_mm": [1e300, 0, 0]})),
    "a blank without a margin": Bad("no_stock", "bad-setup", "margin_mm",
                                    setup=tools(BALL, stock={"margin_mm": 0, "uncertainty_mm": 0})),
    "an allowance beyond the blank": Bad("allowance_beyond_stock", "bad-setup", "stock_allowance_mm 5",
                                         setup={**GOOD, "quality": {"scallop_height_mm": 0.05,
                                                                    "stock_allowance_mm": 5}}),
    "a blank beside the part": Bad("stock_misses_part", "bad-setup", "-X", late=True, setup=tools(
        BALL, stock={"kind": "box", "box_mm": [[100, -50, -50], [200, 50, 50]]})),
    "a fixture in the part": Bad("fixture_in_part", "bad-setup", "fixtures[0]", late=True, setup=tools(
        BALL, fixtures=[{"box_mm": [[-1, -1, -1], [1, 1, 1]]}])),
    "a face that is not there": Bad("no_such_face", "bad-setup", "F99", late=True,
                                    setup=tools(BALL, operations={"faces": ["F99"]})),
}
LATE = [name for name, case in CASES.items() if case.late]
EARLY = [name for name, case in CASES.items() if not case.late]


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Name -> path of every part."""
    folder = tmp_path_factory.mktemp("parts")
    box = cq.Workplane().box(10, 20, 30)
    two = cq.Compound.makeCompound([cq.Solid.makeBox(10, 10, 10), cq.Solid.makeBox(5, 5, 5, cq.Vector(30, 0, 0))])
    shapes = {"box": box, "wire": cq.Workplane().circle(5).val(), "two": two,
              "open": cq.Shell.makeShell(box.faces().vals()[:-1]), "dust": cq.Workplane().box(0.1, 0.1, 0.1),
              "ship": cq.Workplane().box(20_000, 100, 100), "slot": slotted()}
    paths = {name: write_step(shape, folder / f"{name}.step") for name, shape in shapes.items()}
    paths["inch"] = write_step(box, folder / "inch.step", "INCH")
    whole = paths["box"].read_bytes()
    for name, data in (("empty", b""), ("letter", b"Dear machinist,\nplease mill this.\n"),
                       ("cut", whole[:len(whole) // 2]),
                       ("nan", whole.replace(b"CARTESIAN_POINT('',(0.,", b"CARTESIAN_POINT('',(NAN,", 1))):
        paths[name] = folder / f"{name}.step"
        paths[name].write_bytes(data)
    return paths


def slotted():
    """A block 20 x 20 x 8 with a slot 1 mm wide and 6 mm deep along x."""
    return cq.Workplane().box(20, 20, 8).faces(">Z").workplane().rect(30, 1.0).cutBlind(-6)


def setup_text(case):
    return case.setup if isinstance(case.setup, str) else json.dumps(case.setup or GOOD)


@pytest.fixture
def command(tmp_path):
    """Run ``zonemill plan`` in a process of its own; afterwards no process of its making may live."""
    mark = uuid.uuid4().hex

    def run(part, setup):
        (tmp_path / "setup.json").write_text(setup)
        out = tmp_path / "out"
        done = subprocess.run([sys.executable, "-m", "service.cli", "plan", str(part), "--setup",
                               str(tmp_path / "setup.json"), "--out", str(out), "--json"], cwd=ROOT, timeout=120,
                              capture_output=True, text=True, env={**os.environ, "ZONEMILL_TEST_RUN": mark})
        assert not alive(mark)
        return done, out

    return run


def alive(mark):
    """Processes that carry the mark in their environment."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("ZONEMILL_TEST_RUN") == mark and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process.cmdline())
        except (psutil.NoSuchProcess, psutil.AccessDenied, psutil.ZombieProcess):
            continue
    return found


def is_problem(body, case):
    assert body["code"] == case.code, body
    assert body["type"] == f"urn:zonemill:problem:{case.slug}:{case.code}" and body["status"] == 422
    assert case.words in json.dumps([body["detail"], body["subjects"], body["measured"], body["remedy"]]), body
    assert body["remedy"]


def refused_by_command(command, parts, name):
    case = CASES[name]
    done, out = command(parts[case.part], setup_text(case))
    assert done.returncode == 2, done.stderr
    is_problem(json.loads(done.stdout), case)
    assert "Traceback" not in done.stderr
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize("name", EARLY)
def test_the_command_refuses_before_it_computes(command, parts, name):
    refused_by_command(command, parts, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", LATE)
def test_the_command_refuses_what_the_part_shows(command, parts, name):
    refused_by_command(command, parts, name)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """The service with the real chain, in this process."""
    configure("error", "console")
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"), workers=1, child_threads=1, poll_s=0.05,
                        post_rate="10000/minute")
    with TestClient(create_app(settings), base_url="http://127.0.0.1", raise_server_exceptions=False) as found:
        yield found


@pytest.fixture
def submit(client, parts):
    """Post a job and wait for its end; returns the answer, and the job where there is one."""

    def send(part, setup):
        answer = client.post("/v1/jobs", files={"part": ("part.step", parts[part].read_bytes(), "model/step"),
                                                "setup": ("setup.json", setup, "application/json")})
        if answer.status_code != 202:
            return answer, None
        job, deadline = answer.json(), time.monotonic() + 120
        while job["state"] in ("queued", "running") and time.monotonic() < deadline:
            time.sleep(0.05)
            job = client.get(job["links"]["self"]).json()
        assert not [p for p in psutil.Process().children(recursive=True) if JOB_MODULE in " ".join(p.cmdline())]
        return answer, job

    return send


@pytest.mark.parametrize("name", EARLY)
def test_the_service_refuses_at_the_door(client, submit, name):
    before = client.get("/v1/jobs?limit=200").json()["items"]
    answer, job = submit(CASES[name].part, setup_text(CASES[name]))
    assert job is None and answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    is_problem(answer.json(), CASES[name])
    assert client.get("/v1/jobs?limit=200").json()["items"] == before


@pytest.mark.parametrize("name", LATE)
def test_the_job_fails_with_the_problem(client, submit, name):
    _, job = submit(CASES[name].part, setup_text(CASES[name]))
    assert job["state"] == "failed"
    is_problem(job["error"], CASES[name])
    assert client.get(job["links"]["files"]).status_code == 409


def test_an_inch_part_is_read_in_millimetres(parts):
    """No error: the header says the unit. 10 x 20 x 30 mm written in inches come back as mm."""
    text = parts["inch"].read_text()
    assert "INCH" in text and "INCH" not in parts["box"].read_text()
    part = load_part(parts["inch"])
    assert np.ptp(part.bounds, axis=0) == pytest.approx([10, 20, 30], abs=1e-6) and part.unit == "inch"


def no_tool_fits(parts):
    """The slot alone is asked for, and the one tool is three times as wide."""
    part = load_part(parts["slot"])
    inside = [f.number for f in part.faces
              if np.abs(part.mesh.vertices[part.mesh.faces[part.mesh.face_ids == f.number], 1]).max() < 0.6]
    assert len(inside) == 3
    return {**GOOD, "operations": {"faces": [f"F{n}" for n in inside]}}


def says_what_would_fit(report):
    """Unproved, nothing cut, and a remainder that holds the whole area with a tool that is thinner than the slot."""
    assert report["state"] == "unproved" and report["coverage"] == 0 and report["steps"] == []
    (finding,) = [f for f in report["findings"] if f["kind"] == "nothing_cut"]
    assert 0 < finding["would_need"]["diameter_mm"] <= 1.0
    assert sum(r["area_mm2"] for r in report["remainder"]) == pytest.approx(report["machinable_area_mm2"], abs=0.05)
    assert report["machinable_area_mm2"] == pytest.approx(20 * (6 + 1 + 6), rel=0.01)
    gap = [r for r in report["remainder"] if r["would_need"].get("diameter_mm")]
    needs = [r["would_need"] for r in gap]  # 6 deep and what passes leave standing, in whole millimetres
    assert gap and all(n["diameter_mm"] <= 1.0 and n["neck_length_mm"] <= 7.0 for n in needs)


def test_a_job_in_which_no_tool_fits_is_unproved_and_says_what_would(client, submit, parts):
    _, job = submit("slot", json.dumps(no_tool_fits(parts)))
    assert job["state"] == "unproved"
    says_what_would_fit(client.get(job["links"]["report"]).json())
    names = {f["name"] for f in client.get(job["links"]["files"]).json()["items"]}
    assert names == WITHOUT_PROGRAMS


@pytest.mark.slow
def test_the_command_ends_with_3_where_no_tool_fits(command, parts):
    done, out = command(parts["slot"], json.dumps(no_tool_fits(parts)))
    assert done.returncode == 3, done.stderr
    says_what_would_fit(json.loads(done.stdout))
    assert {p.name for p in out.iterdir()} == WITHOUT_PROGRAMS


def test_no_process_outlives_the_jobs():
    """The reader runs in a child of a child; after all of the above none of them is left."""
    left = [p for p in psutil.Process().children(recursive=True)
            if any(word in " ".join(p.cmdline()) for word in (JOB_MODULE, READER_MODULE))]
    assert left == []
