"""Memory: a job states what it will take, waits for others, and is refused where the machine has not that much."""

import time

import pytest

WAITING = "waiting for memory"


@pytest.fixture
def alone(tmp_path, monkeypatch):
    """A folder of temporary files of its own, so that no job of another test counts."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))


def test_a_job_states_its_estimate(alone, make_client, post, setup_json, finish):
    client = make_client()
    job = post(client, setup=setup_json(labels={"memory_mb": "120"})).json()
    assert job["estimate"] is None
    job = finish(client, job)
    assert job["state"] == "proved"
    share = {"what": "samples of the fake", "count": 7, "memory_mb": 120, "seconds": 1.5}
    assert job["estimate"] == {"memory_mb": 120, "seconds": 1.5, "basis": [share]}
    events = client.get(f"{job['links']['self']}/events").text
    assert '"estimate":{"memory_mb":120' in events


def test_a_job_above_the_memory_of_the_machine_is_refused(alone, make_client, post, setup_json, finish):
    client = make_client(memory_mb=400)
    job = finish(client, post(client, setup=setup_json(labels={"memory_mb": "401"})).json())
    assert job["state"] == "failed" and job["attempt"] == 1
    error = job["error"]
    assert error["type"] == "urn:zonemill:problem:too-large-job:machine_too_small" and error["status"] == 422
    assert (error["measured"], error["limit"], error["subjects"]) == (401, 400, ["samples of the fake"])
    assert "ZONEMILL_MEMORY_MB" in error["remedy"] and "400 MB" in error["detail"]
    assert job["estimate"]["memory_mb"] == 401


def asleep(client, job):
    """Wait until a job has begun."""
    while client.get(job["links"]["self"]).json()["stage"] != "asleep":
        time.sleep(0.05)


def test_the_second_job_waits_for_the_first_and_goes_on_when_there_is_room(alone, make_client, post, setup_json,
                                                                           finish):
    client = make_client(workers=2, memory_mb=1000, job_time_limit_s=120)
    first = post(client, setup=setup_json(labels={"memory_mb": "900", "do": "sleep"}), key="first").json()
    asleep(client, first)
    second = post(client, setup=setup_json(labels={"memory_mb": "900"}), key="second").json()
    while (stage := client.get(second["links"]["self"]).json()["stage"]) != WAITING:
        assert stage in ("queued", "starting")
        time.sleep(0.05)
    client.delete(first["links"]["self"])  # a job that is killed leaves its room too
    assert finish(client, second)["state"] == "proved"


def test_waiting_is_bounded(alone, make_client, post, setup_json, finish):
    client = make_client(workers=2, memory_mb=1000, memory_wait_s=2.0, job_time_limit_s=120)
    first = post(client, setup=setup_json(labels={"memory_mb": "900", "do": "sleep"}), key="first").json()
    asleep(client, first)
    second = finish(client, post(client, setup=setup_json(labels={"memory_mb": "900"}), key="second").json())
    assert second["state"] == "failed" and second["error"]["code"] == "memory_busy"
    assert "ZONEMILL_MEMORY_WAIT_S" in second["error"]["remedy"]
    client.delete(first["links"]["self"])
