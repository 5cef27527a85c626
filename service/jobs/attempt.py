"""One job on a worker: start the attempt, use an existing result or make one, write the end into the database.

Dask runs ``run_job`` in a thread. Its arguments are plain data, so that any worker can run it again.
"""

from __future__ import annotations

import errno
import json
import shutil
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import structlog
from sqlalchemy.engine import RowMapping

from geometry.errors import CamError, CancelledError, InternalError, ResourceError
from service.jobs.artifacts import Artifacts, key_of
from service.jobs.database import AWAY, connect
from service.jobs.disk_space import STORAGE_FULL, check_writable, is_full, storage_full
from service.jobs.job_store import WORKER, JobStore
from service.jobs.supervisor import ProcessLimits, supervise
from service.logs import configure_once

log = structlog.get_logger(__name__)

PATIENCE_S = 120.0  # after that another attempt finds the existing result
OUT_OF_RESOURCES = frozenset((errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM))  # errors of a process start
RETRY_S = 1.0  # s between two tries to start a process

ending = threading.Event()
"""Set when the process of this worker must end: running attempts stop and do not count."""
under_way: set[str] = set()
"""Holders of the attempts that run in this process."""


@dataclass(frozen=True)
class WorkConfig:
    """Configuration of a worker; it is part of every task.

    url, data_dir : database and data folder, as the worker sees them
    chain         : module with ``plan``, ``zones_only`` and ``verify_program``
    max_attempts  : number of attempts after which a job fails that found the disk full
    memory_mb     : MB that the jobs of one machine may take together; None: all that it has
    memory_wait_s : s for which a job waits for memory that others take
    log_level, log_format : logging of a worker that is not configured otherwise
    """

    url: str
    data_dir: str
    limits: ProcessLimits
    lease_s: float
    chain: str = "service.pipeline"
    max_attempts: int = 3
    memory_mb: int | None = None
    memory_wait_s: float = 3600.0
    log_level: str = "info"
    log_format: str = "console"

    def as_dict(self) -> dict[str, Any]:
        """Plain data. Dask logs the arguments of failed tasks, and the URL contains a password, so it is hidden."""
        return {**asdict(self), "url": HiddenText(self.url)}


class HiddenText(str):
    """Text that does not appear in logs."""

    def __repr__(self) -> str:
        return "'(not shown)'"


def run_job(job_id: str, claim: int, data: dict[str, Any]) -> str:
    """Run one attempt of a claimed job to its end; returns the outcome, for the log only."""
    config = WorkConfig(**{**data, "limits": ProcessLimits(**data["limits"])})
    configure_once(config.log_level, config.log_format)
    store, owner = JobStore(connect(config.url)), f"{WORKER}{uuid.uuid4().hex}"
    artifacts = _data_folder(config, store.get(job_id))
    if artifacts is None:
        return "unfit"
    if not store.start(job_id, claim, owner, config.lease_s, config.max_attempts):
        return "superseded"
    under_way.add(owner)
    try:
        return _attempted(store, artifacts, config, owner, job_id)
    finally:
        under_way.discard(owner)


def _attempted(store: JobStore, artifacts: Artifacts, config: WorkConfig, owner: str, job_id: str) -> str:
    """Run a started attempt to its end; returns the outcome."""
    row, key, summary = store.get(job_id), None, None
    attempt = row["attempt"]
    failure: CamError | None = None
    try:
        state, key, summary = _Attempt(store, artifacts, config, row, owner).run()
    except CancelledError:
        if ending.is_set() and store.put_back(job_id, owner, counts=False):
            log.info("this worker ends; the job waits for another", job=job_id, attempt=attempt)
            return "put back"
        return "stopped"
    except CamError as error:
        failure = error
    except Exception as error:
        failure = storage_full() if is_full(error) else _bug(error, job_id, attempt)
    if failure is not None:
        log.warning("job failed", job=job_id, attempt=attempt, error=failure.as_dict())
        if failure.code == STORAGE_FULL:
            artifacts.drop_kept(key_of(row))  # checkpoints may fill the disk
        if failure.code == STORAGE_FULL and attempt < config.max_attempts:
            return "put back" if _record(lambda: store.put_back(job_id, owner), config.lease_s) else "superseded"
        state = "failed"
    ended = _record(lambda: store.finish(job_id, owner, state, artifact=key, error=failure, summary=summary),
                    config.lease_s)
    log.info("job ended", job=job_id, attempt=attempt, state=state, recorded=ended)
    return state if ended else "superseded"


def _data_folder(config: WorkConfig, row: RowMapping) -> Artifacts | None:
    """The data folder, if this worker can use it and it has the uploads of the job.

    Without this check every job would fail at once on a host whose share is not mounted. Such a worker takes no job;
    the
    claim expires and costs no attempt.
    """
    try:
        artifacts = Artifacts(Path(config.data_dir))
        check_writable(artifacts.tmp)
        lost = artifacts.missing(row)
    except OSError as error:
        log.error("this worker cannot write to the data folder", job=row["id"], error=str(error))
        return None
    if lost:
        log.error("this worker does not find the uploads of a job: check that its data folder is that of the service",
                  job=row["id"], data=config.data_dir, missing=lost)
    return None if lost else artifacts


def summary_of(folder: Path) -> dict[str, Any] | None:
    """Figures of a report for a release gate; None where there is no report."""
    path = folder / "report.json"
    if not path.exists():
        return None
    report = json.loads(path.read_bytes())
    kept = {k: report.get(k) for k in ("complete", "coverage", "reach_coverage", "machining_time_s")}
    return {**kept, "findings": len(report.get("findings") or [])}


def _bug(error: Exception, job_id: str, attempt: int) -> InternalError:
    log.error("bug in the worker", job=job_id, attempt=attempt, exc_info=error)
    return InternalError(f"{type(error).__name__}: {error}", code="bug",
                         remedy="please report it with part and setup; the worker's log has the trace")


def _record(write: Callable[[], bool], patience_s: float) -> bool:
    """Write the end of a job, and repeat it while the database does not answer. A later claim finds the result."""
    until = time.monotonic() + max(patience_s, PATIENCE_S)
    while True:
        try:
            return write()
        except AWAY as error:
            if time.monotonic() > until:
                raise
            log.warning("the end of a job is not recorded yet", error=type(error).__name__)
            time.sleep(0.5)


class _Attempt:
    """One attempt: the child process, its heartbeat and its progress."""

    def __init__(self, store: JobStore, artifacts: Artifacts, config: WorkConfig, row: RowMapping,
                 owner: str) -> None:
        self.store, self.artifacts, self.config, self.row, self.owner = store, artifacts, config, row, owner
        self.renewed = time.monotonic()

    def run(self) -> tuple[str, str, dict[str, Any] | None]:
        """Final state, key of the result and its figures."""
        key = key_of(self.row)
        folder = self.artifacts.result(key)
        if not self.artifacts.take(key):
            self._make(key)
        self.artifacts.drop_kept(key)
        return (folder / "state").read_text().strip(), key, summary_of(folder)

    def _make(self, key: str) -> None:
        try:
            self._attempt(key)
        except ResourceError as error:
            if error.code != "job_killed":
                raise
            log.warning("job killed from outside, once more", job=self.row["id"])
            self._attempt(key)

    def _attempt(self, key: str) -> None:
        workspace = self.artifacts.workspace()
        program, stock = self.row["program_sha256"], self.row["stock_sha256"]
        request = {
            "kind": self.row["kind"], "part": str(self.artifacts.blob(self.row["part_sha256"])),
            "setup": self.row["setup_json"], "program": str(self.artifacts.blob(program)) if program else None,
            "stock": str(self.artifacts.blob(stock)) if stock else None,
            "spindle_tool": self.row["spindle_tool"], "out": str(workspace), "kept": str(self.artifacts.kept(key)),
            "chain": self.config.chain,
            "room": {"cap_mb": self.config.memory_mb, "limit_mb": self.config.limits.memory_bytes // 1_000_000,
                     "wait_s": self.config.memory_wait_s},
        }
        try:
            state = self._supervised(request)
            (workspace / "state").write_text(f"{state}\n")
            self.artifacts.commit(workspace, key)
        finally:
            shutil.rmtree(workspace, ignore_errors=True)

    def _supervised(self, request: dict[str, Any]) -> str:
        """Final state of a child process; where none can be started for lack of handles or processes, it tries again.
        """
        until = time.monotonic() + PATIENCE_S
        while True:
            try:
                return supervise(request, self.config.limits, self.artifacts.tmp, on_progress=self._progress,
                                 on_resumed=self._resumed, on_estimate=self._estimated, keep=self._keep)
            except OSError as error:
                if error.errno not in OUT_OF_RESOURCES:
                    raise
                if time.monotonic() > until:
                    raise ResourceError(f"the worker could not start a process for {PATIENCE_S:.0f} s "
                                        f"({error.strerror})", code="worker_exhausted", measured=error.strerror,
                                        remedy="post the job again; the operator should check the limits of open "
                                               "files, processes and memory") from None
                log.warning("no process can be started for a job, once more", job=self.row["id"], error=str(error))
            time.sleep(RETRY_S)
            if not self._keep():
                raise CancelledError("the job was cancelled")

    def _progress(self, stage: str, fraction: float) -> None:
        try:
            self.store.progress(self.row["id"], self.owner, stage, fraction)
        except AWAY as error:
            log.warning("progress not recorded", job=self.row["id"], error=type(error).__name__)

    def _resumed(self, taken: Mapping[str, int]) -> None:
        log.info("taken over from an attempt before", job=self.row["id"], attempt=self.row["attempt"], **taken)
        try:
            self.store.resumed(self.row["id"], self.owner, taken)
        except AWAY as error:
            log.warning("what was taken over is not recorded", job=self.row["id"], error=type(error).__name__)

    def _estimated(self, estimate: Mapping[str, Any]) -> None:
        log.info("estimate", job=self.row["id"], memory_mb=estimate["memory_mb"], seconds=estimate["seconds"])
        try:
            self.store.estimated(self.row["id"], self.owner, estimate)
        except AWAY as error:
            log.warning("the estimate is not recorded", job=self.row["id"], error=type(error).__name__)

    def _keep(self) -> bool:
        """Whether to continue; renews the lease in time. A database that does not answer is no reason to stop."""
        if ending.is_set():
            return False
        try:
            if time.monotonic() - self.renewed < self.config.lease_s / 4:
                return self.store.is_held(self.row["id"], self.owner)
            self.renewed = time.monotonic()
            return self.store.renew(self.row["id"], self.owner, self.config.lease_s)
        except AWAY as error:
            log.warning("database does not answer", job=self.row["id"], error=type(error).__name__)
            return True
