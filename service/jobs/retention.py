"""Lets go of the files of old jobs, and removes from the data folder what no job has any use for.

First rows: a job that ended longer ago than ``retention_days`` keeps its row, labels and state, and no longer names its
files. Then files: an upload or result that no row names is removed, and what attempts kept for a result that no job
waits for. Files are shared by content, so one job's end takes nothing from another. What was written or used within
``GRACE_S`` stays, for its row may be on its way.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import structlog

from service.jobs.artifacts import Artifacts, key_of
from service.jobs.job_store import JobStore
from service.settings import Settings

log = structlog.get_logger(__name__)

GRACE_S = 3600.0
LEFTOVER_S = 86400.0
DAY_S = 86400.0
CLOCK_STEP_S = 600.0


@dataclass(frozen=True)
class Swept:
    """What one round did: jobs let go of, files and folders removed, leftovers of crashes removed."""

    jobs: int = 0
    removed: int = 0
    leftovers: int = 0


class Janitor:
    """Cleans up once in a while; several services may do so side by side, for a file is moved away before it goes."""

    def __init__(self, settings: Settings, jobs: JobStore, artifacts: Artifacts) -> None:
        self.settings, self.jobs, self.artifacts = settings, jobs, artifacts
        self._stop = threading.Event()
        self._clock = time.time() - time.monotonic()
        self._thread = threading.Thread(target=self._run, name="janitor", daemon=True)

    def start(self) -> None:
        """Begin; the first round comes after a tenth of the interval."""
        self._thread.start()

    def close(self) -> None:
        """Stop after the file at hand."""
        self._stop.set()
        self._thread.join(timeout=5)

    def sweep(self, grace_s: float = GRACE_S) -> Swept:
        """One round."""
        now = time.time()
        days = self.settings.retention_days
        expired = self.jobs.expire_before(now - days * DAY_S) if days > 0 else 0
        # Candidates first and rows after: a row that came in between names a file that was written or used just now.
        candidates = [p for p in self.artifacts.stored() if p.stat().st_mtime < now - grace_s]
        named = self.jobs.files_named() if candidates else set()
        removed = 0
        for path in candidates:
            if self._stop.is_set():
                break
            if path.stem not in named:
                removed += self.artifacts.remove(path, now - grace_s)
        removed += self._unkept(now - grace_s)
        left = max(LEFTOVER_S, 4 * self.settings.job_time_limit_s)
        done = Swept(expired, removed, self.artifacts.sweep(now - left))
        if any((done.jobs, done.removed, done.leftovers)):
            log.info("swept", jobs=done.jobs, removed=done.removed, leftovers=done.leftovers)
        return done

    def _unkept(self, before: float) -> int:
        """Remove what attempts kept before a time, s, for a result that no job waits for any more; returns how many."""
        candidates = list(self.artifacts.all_kept())
        wanted = {key_of(row) for row in self.jobs.unfinished()} if candidates else set()
        return sum(self.artifacts.remove(p, before) for p in candidates if p.name not in wanted)

    def _clock_was_set(self) -> bool:
        """Whether the time of the day jumped since this was asked last.

        What is too old by a clock that is wrong may not be: who set it has until the next round to set it right.
        """
        clock = time.time() - time.monotonic()
        moved, self._clock = clock - self._clock, clock
        if abs(moved) > CLOCK_STEP_S:
            log.warning("the clock was set; nothing is swept in this round", by_s=round(moved))
        return abs(moved) > CLOCK_STEP_S

    def _run(self) -> None:
        pause = self.settings.sweep_every_s / 10
        while not self._stop.wait(timeout=pause):
            pause = self.settings.sweep_every_s
            try:
                if not self._clock_was_set():
                    self.sweep()
            except Exception:
                log.exception("janitor stumbled")  # database or disk away: the next round tries again
