"""What is kept and what goes: by age, on demand, and what a crash left."""

import os
import time
from dataclasses import replace

import pytest

import service.jobs.engine as engine_module
from service.jobs.retention import GRACE_S, RetentionSweeper, SweepCounts
from service.settings import Settings
from tests.contract.test_service_input import STEP

DAY = 86400.0


def aged(client, job, days):
    """Make a job look as if it had ended days ago, its files with it."""
    from service.jobs.database import jobs

    engine = client.app.state.engine
    with engine.jobs.engine.begin() as c:
        c.execute(jobs.update().where(jobs.c.id == job["id"]).values(finished=time.time() - days * DAY))
    for path in engine.artifacts.stored():
        os.utime(path, (time.time() - 2 * GRACE_S,) * 2)


def stored(client):
    return {p.stem for p in client.app.state.engine.artifacts.stored()}


def sweep(client, **settings):
    engine = client.app.state.engine
    wanted = Settings(**{"data_dir": engine.settings.data_dir, **settings})
    return RetentionSweeper(wanted, engine.jobs, engine.artifacts).sweep()


def test_files_of_old_jobs_go_and_the_rest_of_them_stays(make_client, post, finish, setup_json):
    client = make_client()
    old = finish(client, post(client, setup=setup_json(labels={"order": "1"}), key="k").json())
    new = finish(client, post(client, setup=setup_json(quality={"scallop_height_mm": 0.02})).json())
    aged(client, old, days=31)
    assert sweep(client) == SweepCounts() and len(stored(client)) == 3  # nothing goes unless it is asked for
    assert sweep(client, retention_days=30) == SweepCounts(jobs=1, removed=1)
    assert sweep(client, retention_days=30) == SweepCounts()
    for document in ("report", "zones", "files"):
        answer = client.get(old["links"][document])
        assert answer.status_code == 410 and answer.json()["code"] == "result_expired"
        assert client.get(new["links"][document]).status_code == 200
    answer = client.get(f"{old['links']['files']}/program.linuxcnc.ngc")
    assert answer.status_code == 410
    after = client.get(old["links"]["self"]).json()
    assert after["expired_at"] and {**after, "expired_at": None} == {**old, "finished_at": after["finished_at"]}
    # the part is still there, for the other job came from it; and the key is free
    assert old["part_sha256"] in stored(client)
    again = post(client, setup=setup_json(labels={"order": "1"}), key="k").json()
    assert again["id"] != old["id"] and finish(client, again)["state"] == "proved"


def test_a_worker_that_does_not_see_the_uploads_takes_no_job_up(make_client, post, finish, monkeypatch, tmp_path):
    """Of a host whose share is not mounted each job failed at once, as a part that is no STEP file."""
    client = make_client(lease_s=0.3)
    engine, folder = client.app.state.engine, client.app.state.engine.work.data_dir
    elsewhere = tmp_path / "not mounted"
    monkeypatch.setattr(engine, "work", replace(engine.work, data_dir=str(elsewhere)))
    job = post(client, "").json()
    deadline = time.monotonic() + 120
    while engine.jobs.get(job["id"])["claims"] < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    row = engine.jobs.get(job["id"])
    assert row["claims"] >= 3 and row["attempt"] == 0 and row["state"] in ("queued", "running")
    monkeypatch.setattr(engine, "work", replace(engine.work, data_dir=folder))
    job = finish(client, job)
    assert job["state"] == "proved" and job["attempt"] >= 1  # a busy machine can lose so short a lease once more


def test_a_job_whose_uploads_are_gone_fails_by_name_and_is_not_claimed_for_ever(make_client, post, finish, monkeypatch):
    monkeypatch.setattr(engine_module, "MAX_UNSTARTED_CLAIMS", 1)
    client = make_client(lease_s=0.2)
    busy = post(client, "sleep").json()
    finish(client, busy, until=("queued",))
    job = post(client, "", part=STEP + b"\n").json()
    client.app.state.engine.artifacts.blob(job["part_sha256"]).unlink()
    client.delete(busy["links"]["self"])
    job = finish(client, job)
    assert (job["state"], job["attempt"], job["error"]["code"]) == ("failed", 0, "upload_lost")


def test_a_round_is_left_out_after_the_clock_was_set(make_client, monkeypatch):
    client = make_client()
    engine = client.app.state.engine
    janitor = RetentionSweeper(engine.settings, engine.jobs, engine.artifacts)
    assert not janitor._clock_was_set()
    true = time.time
    monkeypatch.setattr(time, "time", lambda: true() + 400 * DAY)
    assert janitor._clock_was_set() and not janitor._clock_was_set()  # the next round believes it
    monkeypatch.setattr(time, "time", true)
    assert janitor._clock_was_set()


def test_one_job_takes_nothing_from_another_with_the_same_content(make_client, post, finish):
    client = make_client()
    first, second = (finish(client, post(client, "").json()) for _ in range(2))
    aged(client, first, days=10)
    before = stored(client)
    assert sweep(client, retention_days=5).jobs == 1 and stored(client) == before
    assert client.get(first["links"]["report"]).status_code == 410
    assert client.get(second["links"]["report"]).status_code == 200
    assert client.delete(second["links"]["self"], params={"purge": True}).json()["expired_at"]
    aged(client, second, days=0)
    sweep(client)
    assert stored(client) == set()


def test_purge_cancels_and_lets_go_and_a_plain_delete_does_not(make_client, post, finish):
    client = make_client()
    done = finish(client, post(client, "").json())
    assert client.delete(done["links"]["self"]).json()["expired_at"] is None
    assert client.get(done["links"]["report"]).status_code == 200
    running = post(client, "sleep").json()
    finish(client, running, until=("queued",))
    gone = client.delete(running["links"]["self"], params={"purge": "true"}).json()
    assert gone["state"] == "cancelled" and gone["expired_at"]
    assert client.get(running["links"]["report"]).status_code == 410
    assert client.delete(done["links"]["self"], params={"purge": "true"}).json()["state"] == "proved"
    assert client.get(done["links"]["files"]).status_code == 410


def test_what_waits_or_runs_keeps_its_files_however_old(make_client, post, finish):
    client = make_client()
    busy = post(client, "sleep").json()
    waiting = post(client, "", part=STEP + b"\n").json()
    finish(client, busy, until=("queued",))
    for job in (busy, waiting):
        aged(client, job, days=100)
    assert sweep(client, retention_days=1) == SweepCounts() and len(stored(client)) == 2
    client.delete(busy["links"]["self"])
    assert finish(client, waiting)["state"] == "proved"


def test_uploads_that_led_to_no_job_and_leftovers_of_a_crash_go(make_client, post):
    client = make_client()
    files = client.app.state.engine.artifacts
    sha, _ = files.put_blob([b"nobody's"])
    assert sweep(client) == SweepCounts()  # its row may be on its way
    os.utime(files.blob(sha), (time.time() - GRACE_S - 60,) * 2)
    left, writing = files.workspace(), files.workspace()
    (left / "report.json").write_text("{")
    os.utime(left, (time.time() - 2 * DAY,) * 2)
    assert sweep(client) == SweepCounts(removed=1, leftovers=1)
    assert not left.exists() and writing.exists() and stored(client) == set()


def test_what_is_taken_up_meanwhile_stays(tmp_path):
    from service.jobs.artifacts import Artifacts

    files = Artifacts(tmp_path)
    space = files.workspace()
    (space / "f").write_text("x")
    files.commit(space, "ab" + "0" * 62)
    result, before = files.result("ab" + "0" * 62), time.time() - 10
    os.utime(result, (before - 100,) * 2)
    assert files.take(result.name) and not files.remove(result, before) and (result / "f").exists()
    os.utime(result, (before - 100,) * 2)
    assert files.remove(result, before) and not result.exists() and not files.remove(result, before)
    assert not files.take(result.name) and not list(files.tmp.iterdir())


def test_the_service_does_so_by_itself(make_client, post, finish):
    client = make_client(retention_days=1, sweep_every_s=0.5)
    job = finish(client, post(client, "").json())
    aged(client, job, days=2)
    deadline = time.monotonic() + 120
    while stored(client) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert stored(client) == set() and client.get(job["links"]["report"]).status_code == 410


@pytest.mark.parametrize("value", ["maybe", "2"])
def test_purge_is_true_or_false(client, post, value):
    job = post(client, "").json()
    assert client.delete(job["links"]["self"], params={"purge": value}).status_code == 422
