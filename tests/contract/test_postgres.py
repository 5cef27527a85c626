"""The same statements on PostgreSQL: what the unit tests ask of SQLite, where the two differ."""

import threading
import time
from dataclasses import replace

import pytest
import sqlalchemy as sa

from service.errors import KeyConflictError, NotFoundError, RateError
from service.jobs.api_keys import KeyStore
from service.jobs.database import connect, metadata, migrate
from service.jobs.job_store import JobStore, NewJob, Room
from service.jobs.library import LibraryStore


@pytest.fixture
def url(postgres):
    migrate(postgres)
    migrate(postgres)
    return postgres


@pytest.fixture
def store(url):
    return JobStore(connect(url))


def new(content="c", key=None, principal="p", **fields):
    return NewJob("plan", principal, content, "a" * 64, "b" * 64, "{}", fields.pop("labels", {}), idempotency_key=key,
                  **fields)


def together(work, *given):
    """Run work(x) for each x at the same time."""
    threads = [threading.Thread(target=work, args=(x,)) for x in given]
    for t in threads:
        t.start()
    for t in threads:
        t.join()


def test_the_migrations_make_the_tables_of_the_code(url):
    inspector = sa.inspect(connect(url))
    for table in metadata.tables.values():
        found = {c["name"]: c["nullable"] for c in inspector.get_columns(table.name)}
        assert found == {c.name: c.nullable for c in table.columns}
        assert {i["name"] for i in inspector.get_indexes(table.name)} >= {i.name for i in table.indexes}


def test_services_that_start_at_the_same_time_wait_for_each_other(postgres):
    failures = []

    def start(_):
        try:
            migrate(postgres)
        except Exception as error:
            failures.append(error)

    together(start, *range(4))
    assert not failures and JobStore(connect(postgres)).counts() == {}


def test_only_one_of_many_claims_a_job_and_its_webhook(store):
    ids = {store.create(new(webhook_url="https://x.example/"))[0]["id"] for _ in range(20)}
    claimed, called = [], []

    def work(owner):
        while row := store.claim(owner, 30, 3):
            claimed.append(row["id"])
            store.finish(row["id"], owner, "proved", artifact="f" * 64, summary={"complete": True})
            while hook := store.claim_webhook(30):
                called.append(hook["id"])

    together(work, "a", "b", "c", "d")
    assert sorted(claimed) == sorted(ids) and sorted(called) == sorted(ids)


def test_keys_room_and_deadlines(store):
    room = Room(total=5, each=3)
    first, fresh = store.create(new(key="k", deadline_s=-1.0, labels={"order": "1"}), room)
    assert fresh and store.create(new(key="k"), room) == (first, False)
    with pytest.raises(KeyConflictError):
        store.create(new("other", key="k"), room)
    outcomes = []

    def work(principal):
        for _ in range(4):
            try:
                outcomes.append(store.create(new(principal=principal), room)[0]["principal"])
            except RateError as error:
                outcomes.append(error.code)

    together(work, "p", "q")
    assert 5 <= store.counts()["queued"] <= 6 and {"queue_full", "your_queue_full"} & set(outcomes)
    with pytest.raises(RateError):
        store.check_room("p", None, room)
    store.check_room("p", "k", room)
    assert store.miss_deadlines() == 1 and store.get(first["id"])["state"] == "failed"
    assert [r["id"] for r in store.page("p", limit=5, labelled=[("order", "1")], since=0, until=time.time() + 1)] == [
        first["id"]]
    assert store.expire_before(time.time() + 1) == 1 and store.files_named() == {"a" * 64}
    again, fresh = store.create(replace(new(key="k"), principal="z"), None)
    assert fresh and again["deadline"] is None
    for job_id in ("", "j\x00", "j" * 41, "é"):
        with pytest.raises(NotFoundError):
            store.get(job_id)


def test_services_that_claim_at_the_same_time_take_no_more_than_there_are_slots(store):
    for k in range(12):
        store.create(new(key=f"k{k}"))
    for wanted in (2, 4, 6):
        together(lambda owner, slots=wanted: store.claim(owner, 30, 3, slots=slots), *"abcdefgh")
        assert store.running(30) == wanted


def test_the_library_and_the_keys(url):
    library, keys = LibraryStore(connect(url)), KeyStore(connect(url))
    versions = []
    together(lambda k: versions.append(library.put("ada", "tools", "a", {"x": k})[0].version), *range(6))
    assert sorted(versions) == [1, 2, 3, 4, 5, 6]
    library.put("", "tools", "a", {"x": "shared"})
    assert library.get("ada", "tools", "a").version == 6 and library.get("bob", "tools", "a").value == {"x": "shared"}
    assert [e.shared for e in library.all("ada", "tools")] == [False]
    assert not keys.any()
    text, row = keys.make("ada", ["read"])
    assert keys.identify(text).principal == "ada" and keys.is_live(row["id"])
    keys.revoke(row["id"])
    assert keys.any() and not keys.usable() and not keys.is_live(row["id"])
