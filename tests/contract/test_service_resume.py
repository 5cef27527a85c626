"""A worker is killed while it plans or when it has planned: the next attempt goes on there, and no file shows it."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from service.jobs.retention import GRACE_S, RetentionSweeper
from service.settings import Settings
from tests.contract.servers import free_port
from tests.contract.test_service_cluster import Cluster
from tests.step_files import write_step

ROOT = Path(__file__).resolve().parents[2]
FAKES = Path(__file__).parent / "fakes"
PATIENCE_S = 200.0
PLANNED = {"plans": 1, "steps": 0, "proofs": 0}
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05}, "stock": {"margin_mm": 0.5, "uncertainty_mm": 0.0}}
PLAIN = """
import sys
from pathlib import Path
from schemas.setup import canonical_json
from service import pipeline
from service.from_wire import parse_setup
folder = Path(sys.argv[1])
kept = canonical_json(parse_setup((folder / "setup.json").read_text())).decode()  # with all defaults, as a job keeps it
pipeline.plan(folder / "part.step", parse_setup(kept), folder / "out", lambda *_: None)
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Bytes of a block with one step, and its setup."""
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(16, 12, 4, centered=False).cut(
        cq.Workplane().box(8, 12, 2, centered=False).translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step").read_bytes(), SETUP


@pytest.fixture
def serve(tmp_path):
    """Start the embedded service with the chain that dies; returns the process and a client."""
    started, port = [], free_port()

    def start():
        environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{FAKES}", "ZONEMILL_JOB_TIME_LIMIT_S": "300"}
        command = [sys.executable, str(FAKES / "serve_fake.py"), str(tmp_path / "data"), "3", str(port), "dying_chain"]
        started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment, cwd=ROOT))
        return started[-1], httpx.Client(base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=20)

    yield start
    for process in started:
        process.kill()
        process.wait()


def until(ask, patience=PATIENCE_S):
    """What ``ask`` returns once it is anything; requests that are not answered are made again."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        try:
            if found := ask():
                return found
        except httpx.TransportError:
            pass
        time.sleep(0.1)
    raise TimeoutError


def ready(client):
    until(lambda: client.get("/readyz").status_code == 200)


def posted(client, post, small, kill, **fields):
    part, setup = small
    return post(client, part=part, setup={**setup, "labels": {"kill": kill}, **fields}).json()


def ended(client, job):
    def look():
        found = client.get(job["links"]["self"]).json()
        return found if found.get("state") not in ("queued", "running", None) else None

    return until(look)


def files_of(client, job):
    """Bytes of every file of a job, by name."""
    items = client.get(job["links"]["files"]).json()["items"]
    return {i["name"]: client.get(i["href"]).content for i in items}


def plain(small, kill, folder):
    """What the chain writes for that job where nothing happens; bytes by name."""
    part, setup = small
    (folder / "part.step").write_bytes(part)
    (folder / "setup.json").write_text(json.dumps({**setup, "labels": {"kill": kill}}))
    subprocess.run([sys.executable, "-c", PLAIN, folder], check=True, cwd=ROOT)
    return {p.name: p.read_bytes() for p in (folder / "out").iterdir()}


def what_was_done(data):
    return (data / "kept" / "done").read_text().split()


def nothing_is_kept(data):
    return not list(data.glob("kept/*/*"))


@pytest.mark.slow
def test_a_service_killed_in_a_proof_begins_the_next_attempt_with_it(serve, post, small, tmp_path):
    process, client = serve()
    ready(client)
    job = posted(client, post, small, "worker")
    process.wait(timeout=PATIENCE_S)
    data = tmp_path / "data"
    (kept,) = data.glob("kept/*/*/*")
    assert kept.name.startswith("plan-") and what_was_done(data) == ["planned"]
    _, client = serve()
    ready(client)
    found = ended(client, job)
    assert (found["state"], found["attempt"], found["resumed"]) == ("proved", 2, PLANNED)
    assert what_was_done(data) == ["planned", "proved"] and nothing_is_kept(data)
    with client.stream("GET", job["links"]["events"]) as stream:
        assert '"resumed":{"plans":1,"steps":0,"proofs":0}' in "".join(stream.iter_text())
    files = files_of(client, found)
    assert files == plain(small, "worker", tmp_path) and "program.linuxcnc.ngc" in files


@pytest.mark.slow
def test_a_child_killed_in_a_proof_is_started_again_with_it(serve, post, small, tmp_path):
    _, client = serve()
    ready(client)
    found = ended(client, posted(client, post, small, "child"))
    assert (found["state"], found["attempt"], found["resumed"]) == ("proved", 1, PLANNED)
    assert what_was_done(tmp_path / "data") == ["planned", "proved"] and nothing_is_kept(tmp_path / "data")
    calm = ended(client, posted(client, post, small, "nobody"))
    assert (calm["state"], calm["attempt"], calm["resumed"]) == ("proved", 1, None)


@pytest.mark.slow
def test_a_child_killed_in_a_plan_is_started_again_in_the_middle_of_it(serve, post, small, tmp_path):
    _, client = serve()
    ready(client)
    found = ended(client, posted(client, post, small, "child in a plan"))
    assert (found["state"], found["attempt"]) == ("proved", 1)
    assert found["resumed"]["plans"] == found["resumed"]["proofs"] == 0 and found["resumed"]["steps"] >= 1
    said, proved = what_was_done(tmp_path / "data")
    assert proved == "proved" and nothing_is_kept(tmp_path / "data")
    files = files_of(client, found)
    assert files == plain(small, "child in a plan", tmp_path) and "program.linuxcnc.ngc" in files
    assert int(said.partition(":")[2]) > 0


@pytest.mark.slow
def test_a_worker_of_a_cluster_goes_on_with_what_another_one_planned(postgres, fake_path, post, small, tmp_path):
    cluster = Cluster(postgres, tmp_path / "data")
    try:
        workers = [cluster.worker(), cluster.worker()]
        _, client = cluster.api("dying_chain")
        until(lambda: client.get("/readyz").status_code == 200)
        found = ended(client, posted(client, post, small, "worker"))
        assert sum(w.poll() is not None for w in workers) == 1
        assert (found["state"], found["attempt"], found["resumed"]) == ("proved", 2, PLANNED)
        assert what_was_done(tmp_path / "data") == ["planned", "proved"] and nothing_is_kept(tmp_path / "data")
        assert files_of(client, found) == plain(small, "worker", tmp_path)
    finally:
        cluster.close()


def test_what_is_kept_for_jobs_that_wait_stays_and_the_rest_goes(make_client, post, finish):
    from service.jobs.artifacts import key_of

    client = make_client()
    engine = client.app.state.engine
    busy = post(client, "sleep").json()
    finish(client, busy, until=("queued",))
    waiting = post(client, "nap").json()
    keys = [key_of(engine.jobs.get(j["id"])) for j in (busy, waiting)] + ["ab" + "0" * 62, "cd" + "0" * 62]
    for key in keys:
        folder = engine.artifacts.kept(key)
        folder.mkdir(parents=True)
        (folder / "plan-x").write_text("x")
        os.utime(folder, (time.time() - (0 if key.startswith("cd") else 2 * GRACE_S),) * 2)

    def sweep():
        done = RetentionSweeper(Settings(data_dir=engine.settings.data_dir), engine.jobs, engine.artifacts).sweep()
        return done.removed, {p.name for p in engine.artifacts.all_kept()}

    assert sweep() == (1, {keys[0], keys[1], keys[3]})  # nobody's goes, unless it is fresh
    client.delete(busy["links"]["self"])
    assert sweep() == (1, {keys[1], keys[3]})
    assert finish(client, waiting)["state"] == "proved"
    assert {p.name for p in engine.artifacts.all_kept()} == {keys[3]}  # the result is there
