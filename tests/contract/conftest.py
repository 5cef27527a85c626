"""The service with a chain that does what a label says, served in this process."""

import json
import runpy
import time
import uuid
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.api.app import create_app
from service.logs import configure
from service.settings import Settings
from tests.contract.servers import postgres_server

STEP = runpy.run_path(str(Path(__file__).parent / "fakes" / "step_text.py"))["STEP"]
HERE = "http://127.0.0.1:8000"  # without keys the service answers to the names of this machine only


@pytest.fixture(scope="module")
def fake_path():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).parent / "fakes"))
        configure("error", "console")
        yield


@pytest.fixture(scope="session")
def postgres_port():
    """Port of a PostgreSQL for all tests that want one."""
    with postgres_server() as server:
        yield server.port


@pytest.fixture
def postgres(postgres_port):
    """URL of an empty database of PostgreSQL."""
    import psycopg

    name = f"t{uuid.uuid4().hex}"
    with psycopg.connect(f"host=127.0.0.1 port={postgres_port} user=zonemill dbname=postgres", autocommit=True) as c:
        c.execute(f"CREATE DATABASE {name}")
    return f"postgresql+psycopg://zonemill@127.0.0.1:{postgres_port}/{name}"


@pytest.fixture
def make_client(fake_path, tmp_path):
    """Start the service with other settings; clients are closed at the end of the test."""
    opened = []

    def start(**settings):
        values = {"data_dir": tmp_path / "data", "workers": 1, "child_threads": 1, "poll_s": 0.05,
                  "job_time_limit_s": 20, "post_rate": "10000/minute", **settings}
        client = TestClient(create_app(Settings(**values), chain="fake_chain"), base_url=HERE,
                            raise_server_exceptions=False)
        client.__enter__()
        opened.append(client)
        return client

    yield start
    for client in opened:
        client.__exit__(None, None, None)


@pytest.fixture(scope="module")
def client(fake_path, tmp_path_factory):
    """One service for all tests of a module that need nothing special."""
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"), workers=1, child_threads=1, poll_s=0.05,
                        job_time_limit_s=20, job_memory_limit_mb=400, max_body_mb=2, post_rate="10000/minute")
    app = create_app(settings, chain="fake_chain")
    with TestClient(app, base_url=HERE, raise_server_exceptions=False) as found:
        yield found


@pytest.fixture
def bearer():
    """Headers of a new key: (client, principal, *scopes, days) -> headers."""

    def make(client, principal, *scopes, days=None):
        text, _ = client.app.state.engine.keys.make(principal, scopes or ("submit", "read"), days)
        return {"Authorization": f"Bearer {text}"}

    return make


@pytest.fixture
def setup_json():
    """A setup; the label "do" tells the fake chain what to do."""

    def make(do="", **fields):
        labels = {"do": do} if do else {}
        return {"tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3}], "labels": labels, **fields}

    return make


@pytest.fixture
def post(setup_json):
    """Post a job: (client, do, path, part, key, setup, program, spindle_tool, stock) -> response."""

    def send(client, do="", *, path="/v1/jobs", part=STEP, key=None, setup=None, program=None, headers=None,
             spindle_tool=None, stock=None, **fields):
        text = json.dumps(setup_json(do)) if setup is None else setup if isinstance(setup, str | bytes) else (
            json.dumps(setup))
        files = {"part": ("part.step", part, "model/step"), "setup": ("setup.json", text, "application/json")}
        if program is not None:
            files["program"] = ("x.ngc", program, "text/plain")
        if stock is not None:
            files["stock"] = ("blank.step", stock, "model/step")
        extra = {"Idempotency-Key": key} if key is not None else {}
        fields |= {} if spindle_tool is None else {"spindle_tool": spindle_tool}
        return client.post(path, files=files, data=fields, headers={**extra, **(headers or {})})

    return send


@pytest.fixture
def finish():
    """Wait for a job to end and return it."""

    def wait(client, job, patience=120.0, until=("queued", "running"), headers=None):
        deadline = time.monotonic() + patience
        while job["state"] in until and time.monotonic() < deadline:
            time.sleep(0.02)
            job = client.get(job["links"]["self"], headers=headers).json()
        return job

    return wait
