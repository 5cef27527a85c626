"""Deletes the files of old jobs, and files in the data folder that no job needs.

Rows come first: a job that ended longer ago than ``retention_days`` keeps its row, labels and state, but no longer
names its files. Files come second: uploads and results that no row names are removed, and so are checkpoints for a
result that no job waits for. Jobs with the same content share files, so the end of one takes nothing from another.
Files written or used within ``GRACE_S`` stay, since their row may not be written yet.
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
class SweepCounts:
    """Counts of one round: expired jobs, removed files and folders, removed leftovers of crashes."""

    jobs: int = 0
    removed: int = 0
    leftovers: int = 0


class RetentionSweeper:
    """Cleans up periodically. Several services may do so at once, since a file is moved away before it is deleted."""

    def __init__(self, settings: Settings, jobs: JobStore, artifacts: Artifacts) -> None:
        self.settings, self.jobs, self.artifacts = settings, jobs, artifacts
        self._stop = threading.Event()
        self._clock = time.time() - time.monotonic()
        self._thread = threading.Thread(target=self._run, name="janitor", daemon=True)

    def start(self) -> None:
        """Begin; the first round comes after a tenth of the interval."""
        self._thread.start()

    def close(self) -> None:
        """Stop after the current file."""
        self._stop.set()
        self._thread.join(timeout=5)

    def sweep(self, grace_s: float = GRACE_S) -> SweepCounts:
        """One round."""
        now = time.time()
        days = self.settings.retention_days
        expired = self.jobs.expire_before(now - days * DAY_S) if days > 0 else 0
        # List the candidates before the rows: a row that appears between the two names a file that was used just now.
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
        done = SweepCounts(expired, removed, self.artifacts.sweep(now - left))
        if any((done.jobs, done.removed, done.leftovers)):
            log.info("swept", jobs=done.jobs, removed=done.removed, leftovers=done.leftovers)
        return done

    def _unkept(self, before: float) -> int:
        """Remove checkpoints from before a time, s, for results that no job waits for; returns their number."""
        candidates = list(self.artifacts.all_kept())
        wanted = {key_of(row) for row in self.jobs.unfinished()} if candidates else set()
        return sum(self.artifacts.remove(p, before) for p in candidates if p.name not in wanted)

    def _clock_was_set(self) -> bool:
        """Whether the time of day jumped since the last call.

        A file that is too old by a wrong clock may not be old. The operator has until the next round to correct the
        clock.
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
                log.exception("cleanup round failed")  # no database or disk: the next round tries again
