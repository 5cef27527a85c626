"""The job table: guarded changes only."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

import service.jobs.artifacts
import service.jobs.database
from service.errors import KeyConflictError, NotFoundError, RateError
from service.jobs.artifacts import Artifacts, artifact_key
from service.jobs.database import connect, jobs, metadata, migrate
from service.jobs.job_store import JobStore, NewJob, Room
from service.jobs.library import LibraryStore


@pytest.fixture
def url(tmp_path):
    found = f"sqlite:///{tmp_path / 'jobs.db'}"
    migrate(found)
    migrate(found)  # a second time changes nothing
    return found


@pytest.fixture
def store(url):
    return JobStore(connect(url))


def new(content="c", key=None, principal="p"):
    return NewJob("plan", principal, content, "a" * 64, "b" * 64, "{}", {}, idempotency_key=key)


def test_the_migrations_make_the_tables_of_the_code(url):
    inspector = sa.inspect(connect(url))
    for table in metadata.tables.values():
        found = {c["name"]: (str(c["type"]), c["nullable"]) for c in inspector.get_columns(table.name)}
        assert found == {c.name: (str(c.type), c.nullable) for c in table.columns}
    with connect(url).connect() as c:
        assert c.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert c.exec_driver_sql("PRAGMA synchronous").scalar() == 2  # FULL


def test_jobs_of_the_first_schema_are_kept(tmp_path):
    url = f"sqlite:///{tmp_path / 'old.db'}"
    config = Config()
    config.set_main_option("script_location", str(Path(service.jobs.database.__file__).parent / "migrations"))
    row = {c.name: 0 if isinstance(c.type, sa.Integer | sa.Float) else "x" for c in jobs.columns if not c.nullable}
    with connect(url).connect() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        old = sa.Table("jobs", sa.MetaData(), autoload_with=connection)
        assert "spindle_tool" not in old.columns
        old_row = {k: v for k, v in row.items() if k in old.columns}
        connection.execute(old.insert().values(old_row))
        connection.execute(old.insert().values({**old_row, "id": "y", "labels_json": '{"order": "4711"}'}))
        shelf = sa.Table("library", sa.MetaData(), autoload_with=connection)
        connection.execute(shelf.insert().values(shelf="tools", name="a", entry_json='{"x": 1}'))
        connection.commit()
    migrate(url)
    assert JobStore(connect(url)).get("x")["spindle_tool"] == 0
    assert [r["id"] for r in JobStore(connect(url)).page("x", limit=5, labelled=[("order", "4711")])] == ["y"]
    kept = LibraryStore(connect(url)).get("anybody", "tools", "a")
    assert (kept.value, kept.version, kept.shared) == ({"x": 1}, 1, True)
    with connect(url).connect() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "0001")
        connection.commit()
        assert connection.exec_driver_sql("SELECT entry_json FROM library").scalar() == '{"x": 1}'
        command.upgrade(config, "head")


def test_a_key_names_one_job_per_principal(store):
    first, fresh = store.create(new(key="k"))
    assert fresh and store.create(new(key="k")) == (first, False)
    with pytest.raises(KeyConflictError):
        store.create(new("other", key="k"))
    assert store.create(new("other", key="k", principal="q"))[1]
    assert store.create(new())[0]["id"] != store.create(new())[0]["id"]


def test_there_is_room_for_so_many_and_no_more(store):
    room, made, refused = Room(total=12, each=8), [], []

    def work(principal):
        for k in range(6):
            try:
                made.append(store.create(new(f"{principal}{k}", principal=principal), room)[0]["principal"])
            except RateError as error:
                refused.append((error.code, error.limit))

    threads = [threading.Thread(target=work, args=(p,)) for p in ("a", "a", "b", "b")]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len(made) == 12 and max(made.count("a"), made.count("b")) <= 8
    assert set(refused) <= {("queue_full", 12), ("your_queue_full", 8)} and len(refused) == 12
    assert store.counts() == {"queued": 12}
    store.claim("o", 30, 3)
    assert store.create(new(principal="c"), room)[1]  # what runs waits no more


def test_a_repeat_is_answered_when_the_queue_is_full(store):
    room = Room(total=1, each=1)
    first, fresh = store.create(new(key="k"), room)
    store.check_room("p", "k", room)
    assert fresh and store.create(new(key="k"), room) == (first, False)
    with pytest.raises(KeyConflictError):
        store.create(new("other", key="k"), room)
    for key in (None, "l"):
        with pytest.raises(RateError, match="1 of your jobs"):
            store.check_room("p", key, room)
        with pytest.raises(RateError, match="1 of your jobs"):
            store.create(new(key=key), room)
    with pytest.raises(RateError, match="1 jobs are already waiting"):
        store.check_room("q", "k", room)


def test_a_job_that_missed_its_deadline_fails_whether_it_waits_or_runs(store):
    late, running, free = (store.create(replace(new(c), deadline_s=s))[0]["id"]
                           for c, s in (("a", -1.0), ("b", 1.0), ("c", None)))
    assert store.miss_deadlines() == 1
    assert store.claim("o", 30, 3)["id"] == running
    time.sleep(1.05)
    assert store.miss_deadlines() == 1 and not store.is_held(running, "o") and not store.finish(running, "o", "proved")
    for job in (late, running):
        assert store.get(job)["state"] == "failed" and "deadline_exceeded" in store.get(job)["error_json"]
    assert store.miss_deadlines() == 0 and store.get(free)["state"] == "queued"


def test_what_is_put_back_waits_again_and_keeps_its_attempts(store):
    job = store.create(new())[0]["id"]
    store.claim("o", 30, 3)
    assert store.start(job, 1, "w", 30, 3)
    assert not store.put_back(job, "x") and store.put_back(job, "w") and store.get(job)["state"] == "queued"
    assert store.claim("o", 30, 3)["attempt"] == 1


def test_how_long_jobs_run_is_told_by_those_that_ran(store):
    assert store.mean_run_s() is None
    for _ in range(3):
        job = store.create(new())[0]["id"]
        store.start(job, store.claim("p", 30, 3)["claims"], "o", 30, 3)
        time.sleep(0.02)
        store.finish(job, "o", "proved", artifact="a")
    store.cancel(store.create(new())[0]["id"])
    assert 0.015 < store.mean_run_s() < 1.0


def test_only_one_of_many_claims_a_job(store):
    ids = {store.create(new())[0]["id"] for _ in range(20)}
    got = []

    def work(owner):
        while row := store.claim(owner, 30, 3):
            got.append(row["id"])

    threads = [threading.Thread(target=work, args=(f"o{i}",)) for i in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert sorted(got) == sorted(ids)


def test_an_expired_lease_is_claimed_again_until_attempts_run_out(store):
    job = store.create(new())[0]["id"]
    for attempt in (1, 2, 3):
        assert store.claim("o", 30, 3)["claims"] == attempt
        assert store.start(job, attempt, "w", -1.0, 3) and store.get(job)["attempt"] == attempt
    assert store.claim("o", 30, 3) is None and not store.start(job, 3, "w", 30, 3)
    assert store.give_up(3, 30) == 1
    assert store.get(job)["state"] == "failed" and "attempts_exhausted" in store.get(job)["error_json"]


def test_a_claim_that_no_worker_takes_up_costs_no_attempt(store):
    job = store.create(new())[0]["id"]
    for _ in range(5):
        assert store.claim("o", -1.0, 3)["attempt"] == 0
    assert store.give_up(3, 30) == 0 and not store.start(job, 4, "late", 30, 3)
    assert store.start(job, 5, "worker-1", 30, 3) and store.get(job)["attempt"] == 1
    assert store.start(job, 5, "worker-2", 30, 3) and store.get(job)["attempt"] == 2  # the first died
    assert store.disown() == 1 and store.get(job)["attempt"] == 1
    store.claim("o", 30, 3)
    assert store.disown() == 1 and store.get(job)["attempt"] == 1


def test_a_lease_that_ran_out_while_nobody_could_renew_it_counts_for_longer(store):
    job = store.create(new())[0]["id"]
    store.claim("first", -1.0, 3)
    assert store.claim("second", 30, 3, lease_grace_s=60) is None and store.give_up(1, 30, lease_grace_s=60) == 0
    assert store.renew(job, "first", 30) and store.claim("second", 30, 3) is None
    assert store.renew(job, "first", -61) and store.claim("second", 30, 3, lease_grace_s=60)["claims"] == 2


def test_a_lease_that_ends_far_ahead_was_given_before_the_clock_was_set_back(store, monkeypatch):
    job = store.create(new())[0]["id"]
    true = time.time
    monkeypatch.setattr(time, "time", lambda: true() + 3600)
    assert store.claim("dead", 30, 3)["id"] == job
    monkeypatch.setattr(time, "time", true)
    assert store.claim("other", 30, 3, lease_grace_s=1e9) is None  # who lives can renew meanwhile
    assert store.running(30) == 0 and store.running(30, 1e9) == 1
    assert store.claim("other", 30, 3)["claims"] == 2


def test_no_more_are_claimed_than_there_are_slots(store):
    ids = [store.create(new(key=f"k{k}"))[0]["id"] for k in range(3)]
    assert [store.claim("o", 30, 3, slots=2) is not None for _ in range(3)] == [True, True, False]
    assert store.finish(ids[0], "o", "proved") and store.claim("o", 30, 3, slots=2)["id"] == ids[2]


def test_who_lost_the_job_can_no_longer_write(store):
    job = store.create(new())[0]["id"]
    store.claim("first", -1.0, 3)
    store.claim("second", 30, 3)
    assert not store.progress(job, "first", "x", 0.5) and not store.renew(job, "first", 30)
    assert not store.finish(job, "first", "proved")
    assert store.take_over(job, 2, "third", 30) and not store.take_over(job, 1, "late", 30)
    assert store.finish(job, "third", "proved") and not store.cancel(job)
    assert not store.finish(job, "third", "failed")


def test_cancel_takes_the_job_from_its_holder(store):
    job = store.create(new())[0]["id"]
    store.claim("o", 30, 3)
    assert store.is_held(job, "o") and store.cancel(job) and not store.is_held(job, "o")
    assert not store.finish(job, "o", "proved") and store.get(job)["state"] == "cancelled"
    assert store.counts() == {"cancelled": 1} and store.running() == 0
    with pytest.raises(NotFoundError):
        store.get(job, "somebody else")


def test_a_job_that_waits_without_an_attempt_left_fails_instead_of_waiting_for_ever(store):
    job = store.create(new())[0]["id"]
    store.claim("o", 30, 3)
    assert store.start(job, 1, "worker-1", 30, 3) and store.put_back(job, "worker-1")
    assert store.give_up(2, 30) == 0 and store.give_up(1, 30) == 1  # max_attempts was 3 and is 1 now
    assert "attempts_exhausted" in store.get(job)["error_json"]


def test_what_no_worker_has_begun_is_handed_back_and_the_rest_goes_on(store):
    begun, waiting, other = (store.create(new(key=f"k{k}"))[0]["id"] for k in range(3))
    assert [store.claim(o, 30, 3)["id"] for o in ("api-1", "api-1", "api-2")] == [begun, waiting, other]
    assert store.start(begun, 1, "worker-1", 30, 3)
    assert store.hand_back("api-1") == 1 and not store.start(waiting, 1, "worker-2", 30, 3)
    assert [store.get(j)["state"] for j in (begun, waiting, other)] == ["running", "queued", "running"]
    assert store.claim("api-2", 30, 3)["claims"] == 2 and store.get(waiting)["attempt"] == 0


def test_a_key_that_becomes_free_in_between_makes_a_new_job(store, monkeypatch):
    old, by_key = store.create(new(key="k"))[0]["id"], store._by_key

    def let_go_meanwhile(*given):
        monkeypatch.undo()
        assert store.cancel(old) and store.expire(old)
        return by_key(*given)

    monkeypatch.setattr(store, "_by_key", let_go_meanwhile)
    row, fresh = store.create(new(content="other", key="k"))
    assert fresh and row["id"] != old


def test_folders_that_are_made_for_a_file_are_flushed_too(tmp_path, monkeypatch):
    flushed, sync = [], service.files.sync_folder
    for module in (service.files, service.jobs.artifacts):
        monkeypatch.setattr(module, "sync_folder", lambda f: (flushed.append(f), sync(f)))
    files = Artifacts(tmp_path / "data")
    sha, _ = files.put_blob([b"abc"])
    assert flushed == [files.root, files.root / "blobs", files.root / "blobs" / sha[:2]]
    flushed.clear()
    files.put_blob([b"abc"])
    assert flushed == [files.root / "blobs" / sha[:2]]


def test_results_appear_whole_and_once(tmp_path):
    files = Artifacts(tmp_path)
    sha, size = files.put_blob([b"ab", b"c"])
    assert files.put_blob([b"abc"]) == (sha, 3) and size == 3 and files.blob(sha).read_bytes() == b"abc"
    key = artifact_key("plan", sha, "s")
    assert key != artifact_key("zones", sha, "s") and not files.result(key).exists()
    for text in ("first", "second"):
        space = files.workspace()
        (space / "f").write_text(text)
        files.commit(space, key)
    assert (files.result(key) / "f").read_text() == "first" and not list(files.tmp.iterdir())
    files.workspace()
    files.sweep()
    assert not list(files.tmp.iterdir())
