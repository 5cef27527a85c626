"""Hands queued jobs to Dask, no more than it has slots for. Only the database has the state of jobs.

Embedded, the cluster is a thread pool inside this process, and the data folder belongs to this process alone. With a
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

from geometry.errors import ResourceError, SetupError
from service.errors import RateError, UnavailableError
from service.jobs.api_keys import KeyStore
from service.jobs.artifacts import Artifacts
from service.jobs.attempt import WorkConfig, run_job
from service.jobs.database import AWAY, connect, migrate
from service.jobs.disk_space import check_free, check_writable
from service.jobs.job_child import close_servers, preload
from service.jobs.job_store import JobStore, NewJob, Room
from service.jobs.library import LibraryStore
from service.jobs.retention import RetentionSweeper
from service.jobs.supervisor import ProcessLimits
from service.jobs.webhooks import WebhookSender
from service.settings import Settings, is_loopback

log = structlog.get_logger(__name__)

SHORTEST_WAIT_S, LONGEST_WAIT_S = 5.0, 600.0
READY_EVERY_S, CHORES_EVERY_S = 1.0, 1.0
ENDLESS_GRACE_S = 1e9  # no lease counts as expired
STEP_S = 1.0  # a larger jump means that the clock was set
MAX_UNSTARTED_CLAIMS = 10  # claims without a start, after which the reason is checked
SCHEDULER_WAIT_S, SLOTS_KNOWN_S = 8.0, 10.0


class Engine:
    """Database, files and dispatcher of one service process.

    >>> engine = Engine(Settings())      # doctest: +SKIP
    >>> engine.start(); engine.close()   # doctest: +SKIP
    """

    def __init__(self, settings: Settings, chain: str = "service.pipeline") -> None:
        self.settings = settings
        self.owner = f"service-{uuid.uuid4().hex}"
        self.work = WorkConfig(
            settings.url, str(settings.data_dir.resolve()),
            ProcessLimits(settings.job_time_limit_s, settings.job_memory_limit_mb * 1_000_000, settings.threads,
                          settings.poll_s, settings.preload),
            settings.lease_s, chain, settings.max_attempts, settings.memory_mb, settings.memory_wait_s,
            settings.log_level, settings.log_format)
        self.room = Room(settings.max_queued, settings.max_queued_each)
        self._wake, self._stop = threading.Event(), threading.Event()
        self._lock: IO[str] | None = None
        self._courier: WebhookSender | None = None
        self._client: Any = None
        self._loop: Any = None
        self._cluster: Any = None
        self._thread: threading.Thread | None = None
        self._futures: dict[str, Any] = {}
        self._stumbled = -math.inf
        self._clock = time.time() - time.monotonic()
        self._slots, self._slots_at = 0, -math.inf
        self._ready: dict[str, str] = {}
        self._ready_at, self._ready_lock = -math.inf, threading.Lock()

    def start(self) -> None:
        """Open data folder and database, start the cluster and the dispatcher.

        Raises
        ------
        SetupError
            data_dir_in_use: another service uses this data folder; exposed_without_key: other machines can reach the
            address, and no key is required.
        UnavailableError
            The scheduler of the cluster does not answer.
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
                log.info("jobs of an earlier run continue", jobs=left)
        if embedded:
            self._look()
            if self.settings.preload:
                preload(self.settings.threads)
        self._thread = threading.Thread(target=self._dispatch, name="dispatcher", daemon=True)
        self._thread.start()
        if self.settings.webhooks_on:
            self._courier = WebhookSender(self.settings, self.jobs)
            self._courier.start()
        self.janitor = RetentionSweeper(self.settings, self.jobs, self.artifacts)
        self.janitor.start()

    def close(self) -> None:
        """Stop dispatching and end the embedded cluster; the next start continues its running jobs.

        Jobs of a real cluster continue. Another service can at once claim those that no worker has started.
        """
        self._stop.set()
        self._wake.set()
        if self._courier is not None:
            self._courier.close()
        self.janitor.close()
        if self._thread is not None:
            self._thread.join(timeout=10)
        try:
            if self._cluster is not None:
                self.jobs.disown()
            else:
                self.jobs.hand_back(self.owner)
        except AWAY:
            log.exception("the database does not answer; running jobs continue when their leases have expired")
        if self._cluster is not None:
            self._await_idle()
        for part in (self._client, self._cluster):
            if part is not None:
                part.close(timeout=10)
        if self._loop is not None:
            self._loop.stop(timeout=5)
        close_servers()
        if self._lock is not None:
            self._lock.close()
        log.info("engine closed")

    def _await_idle(self, patience_s: float = 5.0) -> None:
        """Wait until the worker threads have noticed the loss of their jobs and have killed the child processes."""
        deadline = time.monotonic() + patience_s
        while time.monotonic() < deadline and not all(f.done() for f in self._futures.values()):
            time.sleep(0.05)

    def wake(self) -> None:
        """Look for queued jobs now rather than in the next round."""
        self._wake.set()

    def check_room(self, principal: str, key: str | None) -> None:
        """Refuse a submission before its body is read.

        Raises
        ------
        RateError
            Too many jobs wait; the error says when to try again.
        UnavailableError
            storage_full: the disk is nearly full.
        """
        check_free(self.settings.data_dir, self.settings.min_free_mb)
        with self.with_retry_time():
            self.jobs.check_room(principal, key, self.room)

    def create(self, new: NewJob) -> tuple[RowMapping, bool]:
        """Queue a job; see ``JobStore.create``."""
        with self.with_retry_time():
            row, fresh = self.jobs.create(new, self.room)
        if fresh:
            self.wake()
        return row, fresh

    @contextmanager
    def with_retry_time(self) -> Iterator[None]:
        """Add to an error about a full queue the time until the next place is likely to be free: run time over slots.
        """
        try:
            yield
        except RateError as error:
            pace = (self.jobs.mean_run_s() or SHORTEST_WAIT_S) / max(1, self.capacity())
            error.retry_after_s = math.ceil(min(max(pace, SHORTEST_WAIT_S), LONGEST_WAIT_S))
            raise

    def ready(self) -> dict[str, str]:
        """State of each part of the engine: 'ok' or the reason.

        It is checked at most once a second, since anybody may ask. Details of a failure go into the log only, since
        they may
        contain hosts, users and paths.
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
        """Number of jobs that can run at once, as the dispatcher last saw; 0 when the scheduler has been silent."""
        return self._slots if time.monotonic() - self._slots_at < SLOTS_KNOWN_S else 0

    def _check_engine(self) -> None:
        if self._stop.is_set() or self._thread is None or not self._thread.is_alive():
            raise RuntimeError("the dispatcher has stopped")
        if self.capacity() == 0:
            raise RuntimeError("no worker is connected")

    def _check_exposure(self) -> None:
        """Refuse an address that other machines can reach while no key was ever made, unless the settings require keys.
        """
        if is_loopback(self.settings.host) or self.keys.usable():
            return
        if self.settings.auth == "keys":
            log.warning("there is no valid key, so every request is refused; create one with zonemill keys create")
            return
        if self._lock is not None:
            self._lock.close()
        raise SetupError(f"{self.settings.host} can be reached from other machines, and there is no valid key",
                         code="exposed_without_key", subjects=(self.settings.host,),
                         remedy="create a key with zonemill keys create, or listen on 127.0.0.1")

    def _lock_data_dir(self) -> None:
        self._lock = (self.settings.data_dir / "lock").open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise SetupError(f"another service uses the data folder {self.settings.data_dir}", code="data_dir_in_use",
                             remedy="stop the other service, or use another --data folder") from None

    def _open_client(self) -> None:
        """Connect to the scheduler, or start the embedded cluster.

        Raises
        ------
        OSError
            The scheduler does not answer.
        """
        import dask

        # Before the import, since distributed configures its logging by this key at import time.
        dask.config.set({"distributed.scheduler.allowed-failures": 2, "logging": {"distributed": "error"},
                         "distributed.worker.profile.enabled": False})  # it would run a hundred times a second
        from distributed import Client, LocalCluster
        from distributed.utils import LoopRunner

        if self.settings.scheduler is not None:
            if self._loop is None:  # one loop for all clients; otherwise each failed client would leave a thread
                self._loop = LoopRunner()
                self._loop.start()
            self._client = Client(self.settings.scheduler, set_as_default=False, timeout=SCHEDULER_WAIT_S,
                                  loop=self._loop.loop)
            self._tell_workers()
            return
        # Both dashboard addresses: without them Dask listens on 0.0.0.0.
        self._cluster = LocalCluster(processes=False, n_workers=1, threads_per_worker=self.settings.workers,
                                     memory_limit=0, dashboard_address="127.0.0.1:0",
                                     worker_dashboard_address="127.0.0.1:0")
        self._client = Client(self._cluster, set_as_default=False)

    def _tell_workers(self) -> None:
        """Register the shutdown plugin on the workers; workers of an older release may lack it."""
        from service.jobs.worker_shutdown import WorkerShutdown

        try:
            self._client.register_plugin(WorkerShutdown())
        except Exception as error:  # jobs run without it
            log.warning("the shutdown plugin could not be registered on the workers",
                        error=f"{type(error).__name__}: {error}")

    def _look(self) -> int:
        """Number of jobs that can run at once, from the scheduler.

        A client that lost its scheduler stops trying after a while. So a client without an answer is dropped, and the
        next call
        makes a new one. Its tasks write their results into the database themselves.

        Raises
        ------
        UnavailableError
            The scheduler does not answer.
        """
        try:
            if self._client is None:
                self._open_client()
            found = {"": self.settings.workers} if self._cluster is not None else self._client.sync(
                self._client.scheduler.ncores, callback_timeout=SCHEDULER_WAIT_S)
        except Exception as error:
            self._slots = 0
            if self.settings.scheduler is not None:
                self._drop_client()
            raise UnavailableError(f"the scheduler does not answer ({type(error).__name__})",
                                   code="scheduler_unavailable") from None
        self._slots, self._slots_at = sum(found.values()), time.monotonic()
        return self._slots

    def _drop_client(self) -> None:
        client, self._client = self._client, None
        self._futures.clear()
        if client is not None:
            threading.Thread(target=_close_quietly, args=(client,), name="closer", daemon=True).start()

    def _dispatch(self) -> None:
        idle, chores = "", 0.0
        while not self._stop.is_set():
            try:
                self._reap()
                if time.monotonic() >= chores:
                    chores = time.monotonic() + CHORES_EVERY_S
                    self.jobs.give_up(self.settings.max_attempts, self.settings.lease_s, self._lease_grace_s())
                    self.jobs.miss_deadlines()
                check_free(self.settings.data_dir, self.settings.min_free_mb)  # a job started now would fail
                while self._look() > self._running() and self._submit():
                    pass
                idle = ""
            except UnavailableError as error:
                if error.message != idle:  # logged once, since it may last for hours
                    log.warning("nothing is started", reason=error.message)
                idle = error.message
                self._stop.wait(timeout=1.0)
            except Exception:
                log.exception("dispatcher round failed")  # no database or scheduler: the next round tries again
                self._stumbled = time.monotonic()
            self._wake.wait(timeout=self.settings.poll_s)
            self._wake.clear()

    def _lease_grace_s(self) -> float:
        """Time, s, for which expired leases still count as valid.

        Holders cannot renew leases while the database does not answer, and leases are times of the day. For one lease
        after it
        answers again, and after the clock was set, no lease counts as expired, so that living holders can renew theirs.
        """
        clock = time.time() - time.monotonic()
        if abs(clock - self._clock) > STEP_S:
            log.warning("the clock was set", by_s=round(clock - self._clock, 1))
            self._clock, self._stumbled = clock, time.monotonic()
        return ENDLESS_GRACE_S if time.monotonic() - self._stumbled < self.settings.lease_s else 0.0

    def _running(self) -> int:
        return self.jobs.running(self.settings.lease_s, self._lease_grace_s())

    def _submit(self) -> bool:
        row = self.jobs.claim(self.owner, self.settings.lease_s, self.settings.max_attempts, self._lease_grace_s(),
                              self._slots)
        if row is None:
            return False
        if row["claims"] > MAX_UNSTARTED_CLAIMS and (lost := self.artifacts.missing(row)):
            error = ResourceError("the data folder has lost the uploads of the job", code="upload_lost",
                                  measured=lost, remedy="post the job again; the operator should check the disk")
            log.error("uploads are missing", job=row["id"], missing=lost)
            self.jobs.finish(row["id"], self.owner, "failed", error=error)
            return True
        key = f"{row['id']}-{row['claims']}"
        future = self._client.submit(run_job, row["id"], row["claims"], self.work.as_dict(), key=key, pure=False,
                                     retries=0)
        self._futures[key] = future
        future.add_done_callback(lambda _: self.wake())
        return True

    def _reap(self) -> None:
        for key, future in [(k, f) for k, f in self._futures.items() if f.done()]:
            del self._futures[key]
            if future.status != "error":
                continue
            job_id, _, claim = key.rpartition("-")
            if isinstance(future.exception(), AWAY):
                log.warning("the database did not answer; the job continues", job=job_id, claim=claim)
                continue  # its lease expires
            error = ResourceError(f"the workers that ran the job were lost ({type(future.exception()).__name__})",
                                  code="worker_lost", remedy="see the log of the workers")
            log.error("task lost", job=job_id, claim=claim, error=str(future.exception()))
            if self.jobs.take_over(job_id, int(claim), self.owner, self.settings.lease_s):
                self.jobs.finish(job_id, self.owner, "failed", error=error)


def _close_quietly(client: Any) -> None:
    try:
        client.close(timeout=10)
    except Exception as error:
        log.info("a client of the scheduler did not close properly", error=type(error).__name__)


def _outcome(name: str, check: Callable[[], Any], otherwise: str) -> str:
    try:
        check()
    except Exception as error:
        log.warning("not ready", check=name, error=f"{type(error).__name__}: {error}")
        return otherwise
    return "ok"
