"""Back-pressure, deadlines and a full disk: what is refused, what waits, and that nothing accepted is lost."""

import shutil
import time
from collections import namedtuple

import pytest
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.jobs.attempt import HiddenText, WorkConfig
from tests.time_limits import in_time

Usage = namedtuple("Usage", "total used free")


def test_a_full_queue_is_429_and_says_when_to_come_again(make_client, post, bearer, finish):
    client = make_client(max_queued=4, max_queued_each=2)
    ada, bob, eve = (bearer(client, p) for p in ("ada", "bob", "eve"))
    first = post(client, "sleep", headers=ada, key="k0").json()
    finish(client, first, until=("queued",), headers=ada)
    queued = [post(client, "sleep", headers=ada, key=f"k{i}").json() for i in (1, 2)]
    answer = post(client, "sleep", headers=ada)
    assert answer.status_code == 429 and answer.json()["code"] == "your_queue_full"
    assert answer.json()["limit"] == 2 and 5 <= int(answer.headers["retry-after"]) <= 600
    assert post(client, "sleep", headers=ada, key="k2").json()["id"] == queued[1]["id"]  # a repeat is no new job
    assert [post(client, "", headers=bob).status_code for _ in range(3)] == [202, 202, 429]
    answer = post(client, "", headers=eve)
    assert answer.status_code == 429 and answer.json()["code"] == "queue_full"
    # refused before the body is looked at
    assert client.post("/v1/jobs", content=b"junk", headers=eve).status_code == 429
    assert client.delete(queued[1]["links"]["self"], headers=ada).status_code == 200
    assert post(client, "", headers=eve).status_code == 202


def test_a_job_that_cannot_end_in_time_is_stopped(make_client, post, finish):
    client = make_client()
    running = post(client, "sleep", deadline_s="1").json()
    waiting = post(client, "sleep", deadline_s="1.2").json()
    after = post(client, "", deadline_s=3600).json()
    assert running["deadline_at"] > running["created_at"] and running["started_at"] is None
    started = time.monotonic()
    for job in (running, waiting):
        job = finish(client, job)
        assert job["state"] == "failed" and job["error"]["code"] == "deadline_exceeded" and job["error"]["remedy"]
    after = finish(client, after)
    assert after["state"] == "proved" and after["started_at"] and in_time(time.monotonic() - started, 5)


def test_a_deadline_is_no_content(client, post):
    first = post(client, "", key="dl", deadline_s=100).json()
    again = post(client, "", key="dl", deadline_s=200).json()
    assert again["id"] == first["id"] and again["deadline_at"] == first["deadline_at"]


@pytest.mark.parametrize("given", ["0", "-5", "nan", "inf", "1e9", "soon", "", "1" * 30])
def test_a_deadline_that_is_none_is_refused(client, post, given):
    answer = post(client, "", deadline_s=given)
    assert answer.status_code == 422 and answer.json()["code"] == "bad_deadline"


def test_a_nearly_full_disk_refuses_new_jobs_and_starts_none(make_client, post, finish, monkeypatch):
    client = make_client(min_free_mb=100)
    busy = post(client, "sleep").json()
    finish(client, busy, until=("queued",))
    waiting = post(client, "").json()
    usage = shutil.disk_usage
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**9, 10**9 - 10**6, 10**6))
    answer = post(client, "")
    assert answer.status_code == 503 and answer.json()["code"] == "storage_full" and answer.headers["retry-after"]
    assert client.get("/readyz").status_code == 503
    client.delete(busy["links"]["self"])
    time.sleep(1.0)
    assert client.get(waiting["links"]["self"]).json()["state"] == "queued"
    monkeypatch.setattr(shutil, "disk_usage", usage)
    assert finish(client, waiting)["state"] == "proved"


def test_a_job_that_finds_the_disk_full_waits_for_another_attempt(make_client, post, finish):
    client = make_client(max_attempts=2)
    job = finish(client, post(client, "full").json())
    assert (job["state"], job["attempt"], job["error"]["code"]) == ("failed", 2, "storage_full")
    assert job["error"]["status"] == 503


def test_an_upload_that_finds_the_disk_full_is_no_bug(make_client, post, monkeypatch):
    client = make_client()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(client.app.state.engine.artifacts, "put_blob", full)
    answer = post(client, "")
    assert answer.status_code == 503 and answer.json()["code"] == "storage_full"


@pytest.mark.parametrize("error", [
    OperationalError("SELECT secret FROM t", {}, Exception("connection to db.internal failed")),
    PoolTimeoutError("QueuePool limit of db.internal")])
def test_a_database_that_is_away_is_503_and_tells_nothing_of_itself(make_client, monkeypatch, error):
    client = make_client()

    def away(*_args, **_named):
        raise error

    monkeypatch.setattr(client.app.state.engine.jobs, "page", away)
    answer = client.get("/v1/jobs")
    assert answer.status_code == 503 and answer.json()["code"] == "database_unavailable"
    assert "internal" not in answer.text and "SELECT" not in answer.text
    monkeypatch.setattr(client.app.state.engine.jobs, "running", away)
    answer = client.get("/readyz")
    assert answer.status_code == 503 and answer.json()["checks"]["database"] == "does not answer"


def test_the_password_of_the_database_does_not_show_in_the_arguments_of_a_task():
    from pickle import dumps, loads

    from service.jobs.supervisor import ProcessLimits

    url = "postgresql+psycopg://zonemill:hunter2@db/zonemill"
    given = WorkConfig(url, "/data", ProcessLimits(1, 1), 20.0).as_dict()
    assert "hunter2" not in repr(given) and "hunter2" not in repr(loads(dumps(given)))
    assert WorkConfig(**given).url == url and isinstance(given["url"], HiddenText)
