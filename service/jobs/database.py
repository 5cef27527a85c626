"""Tables, connections and migrations. The database is the only source of the state of jobs."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Column, Float, Integer, String, Text
from sqlalchemy.engine import Engine
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.files import make_private

AWAY = (DBAPIError, PoolTimeoutError)
"""Errors while the database does not answer, or while all its connections are in use."""

# A silent server is given up after seconds; the defaults of the system are minutes to hours.
POSTGRES = {"connect_timeout": 10, "keepalives_idle": 5, "keepalives_interval": 3, "keepalives_count": 3,
            "tcp_user_timeout": 15_000}
MIGRATION_LOCK = 0x7A6F6E65  # our number of a PostgreSQL advisory lock

metadata = sa.MetaData()

jobs = sa.Table(
    "jobs", metadata,
    Column("id", String(40), primary_key=True),
    Column("kind", String(16), nullable=False),
    Column("principal", String(100), nullable=False),
    Column("idempotency_key", String(255), nullable=True),
    Column("content_sha256", String(64), nullable=False),
    Column("part_sha256", String(64), nullable=False),
    Column("setup_sha256", String(64), nullable=False),
    Column("program_sha256", String(64), nullable=True),
    Column("stock_sha256", String(64), nullable=True),
    Column("spindle_tool", Integer, nullable=False, server_default="0"),
    Column("setup_json", Text, nullable=False),
    Column("labels_json", Text, nullable=False),
    Column("state", String(16), nullable=False),
    Column("stage", String(200), nullable=False),
    Column("progress", Float, nullable=False),
    Column("event_seq", Integer, nullable=False),
    Column("attempt", Integer, nullable=False),
    Column("claims", Integer, nullable=False, server_default="0"),
    Column("lease_owner", String(80), nullable=True),
    Column("lease_until", Float, nullable=True),
    Column("artifact", String(64), nullable=True),
    Column("error_json", Text, nullable=True),
    Column("created", Float, nullable=False),
    Column("finished", Float, nullable=True),
    Column("started", Float, nullable=True),
    Column("deadline", Float, nullable=True),
    Column("webhook_url", String(2000), nullable=True),
    Column("webhook_state", String(16), nullable=True),
    Column("webhook_attempts", Integer, nullable=False, server_default="0"),
    Column("webhook_due", Float, nullable=True),
    Column("webhook_problem", String(200), nullable=True),
    Column("summary_json", Text, nullable=True),
    Column("expired", Float, nullable=True),
    Column("library_json", Text, nullable=True),
    Column("resumed_json", Text, nullable=True),
    Column("estimate_json", Text, nullable=True),
    sa.UniqueConstraint("principal", "idempotency_key", name="uq_jobs_key"),
    sa.Index("ix_jobs_state", "state", "lease_until"),
    sa.Index("ix_jobs_principal", "principal", "id"),
    sa.Index("ix_jobs_webhook", "webhook_state", "webhook_due"),
    sa.Index("ix_jobs_expiry", "expired", "finished"),
)

labels = sa.Table(
    "labels", metadata,
    Column("job_id", String(40), primary_key=True),
    Column("key", String(32), primary_key=True),
    Column("value", String(200), nullable=False),
    sa.Index("ix_labels_value", "key", "value", "job_id"),
)

entries = sa.Table(
    "entries", metadata,
    Column("owner", String(64), primary_key=True),
    Column("shelf", String(16), primary_key=True),
    Column("name", String(64), primary_key=True),
    Column("version", Integer, primary_key=True),
    Column("entry_json", Text, nullable=False),
    Column("created", Float, nullable=False),
    Column("deleted", Float, nullable=True),
)

api_keys = sa.Table(
    "api_keys", metadata,
    Column("id", String(16), primary_key=True),
    Column("principal", String(64), nullable=False),
    Column("scopes", String(64), nullable=False),
    Column("secret_sha256", String(64), nullable=False),
    Column("note", String(200), nullable=False),
    Column("created", Float, nullable=False),
    Column("expires", Float, nullable=True),
    Column("revoked", Float, nullable=True),
    Column("last_used", Float, nullable=True),
)


def connect(url: str) -> Engine:
    """An engine for a database URL; SQLite runs in WAL mode with full synchronisation.

    Its errors contain no values, since these are setups, webhooks and digests of keys, and errors are logged. There is
    one
    engine for each URL and process, since Dask tasks call this repeatedly.
    """
    return _connect(url)


@lru_cache(maxsize=16)
def _connect(url: str) -> Engine:
    if not url.startswith("sqlite"):
        target = sa.make_url(url)
        given = POSTGRES if target.drivername == "postgresql+psycopg" else {}
        options = {k: v for k, v in given.items() if k not in target.query}
        return sa.create_engine(url, pool_pre_ping=True, pool_size=10, max_overflow=20, hide_parameters=True,
                                connect_args=options)
    engine = sa.create_engine(url, hide_parameters=True, connect_args={"timeout": 30, "check_same_thread": False})
    sa.event.listen(engine, "connect", _pragmas)
    return engine


def _pragmas(connection: Any, _record: Any) -> None:
    cursor = connection.cursor()
    for pragma in ("journal_mode=WAL", "synchronous=FULL", "busy_timeout=30000", "foreign_keys=ON"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def migrate(url: str) -> None:
    """Bring the database to the newest schema (Alembic), and create it first where it does not exist."""
    from alembic import command
    from alembic.config import Config

    if url.startswith("sqlite:///"):
        make_private(Path(url.removeprefix("sqlite:///")).parent)
    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
    with connect(url).connect() as connection, _alone(connection):
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


@contextmanager
def _alone(connection: sa.Connection) -> Iterator[None]:
    """Only one process at a time migrates a database; others wait. ``zonemill keys`` does so too."""
    if connection.dialect.name != "postgresql":
        path = connection.engine.url.database
        with Path(f"{path}.migrating" if path else os.devnull).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield
        return
    connection.execute(sa.text("SELECT pg_advisory_lock(:n)"), {"n": MIGRATION_LOCK})
    connection.commit()
    try:
        yield
    finally:
        connection.rollback()
        connection.execute(sa.text("SELECT pg_advisory_unlock(:n)"), {"n": MIGRATION_LOCK})
        connection.commit()
