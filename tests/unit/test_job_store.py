"""The job table: guarded changes only."""

import threading
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

import service.db
from service.artifacts import Artifacts, artifact_key
from service.db import connect, jobs, metadata, migrate
from service.errors import KeyConflictError, NotFoundError
from service.store import JobStore, LibraryStore, NewJob


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
    config.set_main_option("script_location", str(Path(service.db.__file__).parent / "migrations"))
    row = {c.name: 0 if isinstance(c.type, sa.Integer | sa.Float) else "x" for c in jobs.columns if not c.nullable}
    with connect(url).connect() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        old = sa.Table("jobs", sa.MetaData(), autoload_with=connection)
        assert "spindle_tool" not in old.columns
        connection.execute(old.insert().values({k: v for k, v in row.items() if k in old.columns}))
        connection.commit()
    migrate(url)
    assert JobStore(connect(url)).get("x")["spindle_tool"] == 0


def test_a_key_names_one_job_per_principal(store):
    first, fresh = store.create(new(key="k"))
    assert fresh and store.create(new(key="k")) == (first, False)
    with pytest.raises(KeyConflictError):
        store.create(new("other", key="k"))
    assert store.create(new("other", key="k", principal="q"))[1]
    assert store.create(new())[0]["id"] != store.create(new())[0]["id"]


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
        assert store.claim("o", -1.0, 3)["attempt"] == attempt
    assert store.claim("o", 30, 3) is None
    assert store.give_up(3) == 1
    assert store.get(job)["state"] == "failed" and "attempts_exhausted" in store.get(job)["error_json"]


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


def test_the_library_keeps_entries_by_shelf(url):
    shelf = LibraryStore(connect(url))
    assert shelf.put("tools", "a", {"x": 1}) and not shelf.put("tools", "a", {"x": 2})
    assert shelf.all()["tools"] == {"a": {"x": 2}} and shelf.get("tools", "a") == {"x": 2}
    shelf.delete("tools", "a")
    with pytest.raises(NotFoundError):
        shelf.delete("tools", "a")


def test_results_appear_whole_and_once(tmp_path):
    files = Artifacts(tmp_path)
    sha, size = files.put_blob([b"ab", b"c"])
    assert files.put_blob([b"abc"]) == (sha, 3) and size == 3 and files.blob(sha).read_bytes() == b"abc"
    key = artifact_key("plan", sha, "s")
    assert key != artifact_key("zones", sha, "s") and not files.has_result(key)
    for text in ("first", "second"):
        space = files.workspace()
        (space / "f").write_text(text)
        files.commit(space, key)
    assert (files.result(key) / "f").read_text() == "first" and not list(files.tmp.iterdir())
    files.workspace()
    files.sweep()
    assert not list(files.tmp.iterdir())
