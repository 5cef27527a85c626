"""Hands queued jobs to Dask, never more than it has room for; holds nothing that the database does not know.

Embedded, the cluster is a thread pool inside this process and the data folder belongs to this process alone. With a
scheduler address it is a real cluster, and several services may share database and data folder.
"""

from __future__ import annotations

import fcntl
import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import IO, Any

import structlog
from sqlalchemy.engine import RowMapping
from sqlalchemy.exc import DBAPIError

from geometry.errors import ResourceError, SetupError
from service.artifacts import Artifacts
from service.db import connect, migrate
from service.errors import RateError, UnavailableError
from service.janitor import Janitor
from service.keys import KeyStore
from service.library import LibraryStore
from service.settings import Settings, is_loopback
from service.storage import check_free, check_writable
from service.store import JobStore, NewJob, Room
from service.supervisor import Limits
from service.webhooks import Courier
from service.work import WorkConfig, run_job

log = structlog.get_logger(__name__)

SHORTEST_WAIT_S, LONGEST_WAIT_S = 5.0, 600.0
READY_EVERY_S = 1.0
MERCY_S = 3600.0


class Engine:
    """Database, files and dispatcher of one service process.

    >>> engine = Engine(Settings())      # doctest: +SKIP
    >>> engine.start(); engine.close()   # doctest: +SKIP
    """

    def __init__(self, settings: Settings, chain: str = "service.chain") -> None:
        self.settings = settings
        self.owner = f"service-{uuid.uuid4().hex}"
        self.work = WorkConfig(
            settings.url, str(settings.data_dir.resolve()),
            Limits(settings.job_time_limit_s, settings.job_memory_limit_mb * 1_000_000, settings.threads,
                   settings.poll_s),
            settings.lease_s, chain, settings.max_attempts)
        self.room = Room(settings.max_queued, settings.max_queued_each)
        self._wake, self._stop = threading.Event(), threading.Event()
        self._lock: IO[str] | None = None
        self._courier: Courier | None = None
        self._client: Any = None
        self._cluster: Any = None
        self._thread: threading.Thread | None = None
        self._futures: dict[str, Any] = {}
        self._stumbled = -math.inf
        self._ready: dict[str, str] = {}
        self._ready_at, self._ready_lock = -math.inf, threading.Lock()

    def start(self) -> None:
        """Open data folder and database, start the cluster and the dispatcher.

        Raises
        ------
        SetupError
            Another service uses this data folder (code 'data_dir_in_use'), or the address can be reached from other
            machines and there is no key that would have to be shown (code 'exposed_without_key').
        """
        self.artifacts = Artifacts(self.settings.data_dir)
        embedded = self.settings.scheduler is None
        if embedded:
            self._lock_data_dir()
        migrate(self.settings.url)
        self.jobs = JobStore(connect(self.settings.url))
        self.library = LibraryStore(connect(self.settings.url))
        self.keys = KeyStore(connect(self.settings.url))
        self._check_exposure()
        if embedded:
            self.artifacts.sweep()
            if left := self.jobs.release():
                log.info("jobs of an earlier run taken up again", jobs=left)
        self._open_client()
        self._thread = threading.Thread(target=self._dispatch, name="dispatcher", daemon=True)
        self._thread.start()
        if self.settings.webhooks_on:
            self._courier = Courier(self.settings, self.jobs)
            self._courier.start()
        self.janitor = Janitor(self.settings, self.jobs, self.artifacts)
        self.janitor.start()

    def close(self) -> None:
        """Stop dispatching and end the embedded cluster; its running jobs are left to the next start."""
        self._stop.set()
        self._wake.set()
        if self._courier is not None:
            self._courier.close()
        self.janitor.close()
        if self._thread is not None:
            self._thread.join(timeout=10)
        if self._cluster is not None:
            try:
                self.jobs.disown()
            except DBAPIError:
                log.exception("the database is away; running jobs are taken up when their leases have run out")
            self._await_idle()
        for part in (self._client, self._cluster):
            if part is not None:
                part.close(timeout=10)
        if self._lock is not None:
            self._lock.close()
        log.info("engine closed")

    def _await_idle(self, patience_s: float = 5.0) -> None:
        """Wait until the worker threads have seen that their jobs were taken away and have killed the children."""
        deadline = time.monotonic() + patience_s
        while time.monotonic() < deadline and not all(f.done() for f in self._futures.values()):
            time.sleep(0.05)

    def wake(self) -> None:
        """Look for queued jobs now rather than at the next round."""
        self._wake.set()

    def check_room(self, principal: str, key: str | None) -> None:
        """Refuse a submission before its body is read.

        Raises
        ------
        RateError
            Too many jobs wait; it says when to come again.
        UnavailableError
            The disk is nearly full (code 'storage_full').
        """
        check_free(self.settings.data_dir, self.settings.min_free_mb)
        with self.told_when():
            self.jobs.check_room(principal, key, self.room)

    def create(self, new: NewJob) -> tuple[RowMapping, bool]:
        """Queue a job; see ``JobStore.create``."""
        with self.told_when():
            row, fresh = self.jobs.create(new, self.room)
        if fresh:
            self.wake()
        return row, fresh

    @contextmanager
    def told_when(self) -> Iterator[None]:
        """Say in an error about a full queue when the next place is likely to be free: a job's time over the slots."""
        try:
            yield
        except RateError as error:
            pace = (self.jobs.mean_run_s() or SHORTEST_WAIT_S) / max(1, self.capacity())
            error.retry_after_s = math.ceil(min(max(pace, SHORTEST_WAIT_S), LONGEST_WAIT_S))
            raise

    def ready(self) -> dict[str, str]:
        """What the engine needs, each 'ok' or why not; looked at once a second at most, for anybody may ask.

        What a failing part said goes into the log: it may name hosts, users and paths.
        """
        with self._ready_lock:
            if time.monotonic() - self._ready_at > READY_EVERY_S:
                settings = self.settings
                self._ready = {
                    "database": _outcome("database", self.jobs.running, "does not answer"),
                    "data_folder": _outcome("data folder", lambda: check_writable(self.artifacts.tmp),
                                            "cannot be written to"),
                    "disk_space": _outcome("disk", lambda: check_free(settings.data_dir, settings.min_free_mb),
                                           "nearly full"),
                    "engine": _outcome("engine", self._check_engine, "starts no jobs"),
                }
                self._ready_at = time.monotonic()
            return dict(self._ready)

    def capacity(self) -> int:
        """Jobs that can run at a time."""
        return sum(self._client.nthreads().values()) if self._client is not None else 0

    def _check_engine(self) -> None:
        if self._stop.is_set() or self._thread is None or not self._thread.is_alive():
            raise RuntimeError("the dispatcher has stopped")
        if self.capacity() == 0:
            raise RuntimeError("no worker is connected")

    def _check_exposure(self) -> None:
        """Refuse to be reached from elsewhere while no key was ever made, unless told that keys will come."""
        if is_loopback(self.settings.host) or self.keys.usable():
            return
        if self.settings.auth == "keys":
            log.warning("there is no usable key: nobody gets in; zonemill keys create makes one")
            return
        if self._lock is not None:
            self._lock.close()
        raise SetupError(f"{self.settings.host} can be reached from other machines, and no usable key was made",
                         code="exposed_without_key", subjects=(self.settings.host,),
                         remedy="make a key with zonemill keys create, or listen on 127.0.0.1")

    def _lock_data_dir(self) -> None:
        self._lock = (self.settings.data_dir / "lock").open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise SetupError(f"another service uses the data folder {self.settings.data_dir}", code="data_dir_in_use",
                             remedy="stop it, or give this one its own --data") from None

    def _open_client(self) -> None:
        import dask

        # Before the import: distributed sets up its own logging by this key when it is imported.
        dask.config.set({"distributed.scheduler.allowed-failures": 2, "logging": {"distributed": "error"}})
        from distributed import Client, LocalCluster

        if self.settings.scheduler is not None:
            self._client = Client(self.settings.scheduler, set_as_default=False)
            return
        # Both dashboard addresses: without them Dask listens on 0.0.0.0.
        self._cluster = LocalCluster(processes=False, n_workers=1, threads_per_worker=self.settings.workers,
                                     memory_limit=0, dashboard_address="127.0.0.1:0",
                                     worker_dashboard_address="127.0.0.1:0")
        self._client = Client(self._cluster, set_as_default=False)

    def _dispatch(self) -> None:
        while not self._stop.is_set():
            try:
                self._reap()
                self.jobs.give_up(self.settings.max_attempts, self._mercy_s())
                self.jobs.miss_deadlines()
                check_free(self.settings.data_dir, self.settings.min_free_mb)  # what waits is not started to fail
                while self.jobs.running() < self.capacity() and self._submit():
                    pass
            except UnavailableError as error:
                log.warning("nothing is started", reason=error.message)
                self._stop.wait(timeout=1.0)
            except Exception:
                log.exception("dispatcher stumbled")  # database or scheduler away: the next round tries again
                self._stumbled = time.monotonic()
            self._wake.wait(timeout=self.settings.poll_s)
            self._wake.clear()

    def _mercy_s(self) -> float:
        """Holders could not renew while the database was away: for one lease after that theirs count for longer."""
        away = time.monotonic() - self._stumbled < self.settings.lease_s
        return MERCY_S if away else 0.0

    def _submit(self) -> bool:
        row = self.jobs.claim(self.owner, self.settings.lease_s, self.settings.max_attempts, self._mercy_s())
        if row is None:
            return False
        key = f"{row['id']}-{row['attempt']}"
        future = self._client.submit(run_job, row["id"], row["attempt"], self.work.as_dict(), key=key, pure=False,
                                     retries=0)
        self._futures[key] = future
        future.add_done_callback(lambda _: self.wake())
        return True

    def _reap(self) -> None:
        for key, future in [(k, f) for k, f in self._futures.items() if f.done()]:
            del self._futures[key]
            if future.status != "error":
                continue
            job_id, _, attempt = key.rpartition("-")
            if isinstance(future.exception(), DBAPIError):
                log.warning("the database was away; the job is taken up again", job=job_id, attempt=attempt)
                continue  # its lease runs out
            error = ResourceError(f"the workers that ran the job were lost ({future.exception()!r})",
                                  code="worker_lost", remedy="look into the log of the workers")
            log.error("task lost", job=job_id, attempt=attempt, error=str(future.exception()))
            if self.jobs.take_over(job_id, int(attempt), self.owner, self.settings.lease_s):
                self.jobs.finish(job_id, self.owner, "failed", error=error)


def _outcome(name: str, check: Callable[[], Any], otherwise: str) -> str:
    try:
        check()
    except Exception as error:
        log.warning("not ready", check=name, error=f"{type(error).__name__}: {error}")
        return otherwise
    return "ok"
