"""Lets a job begin where the machine has the memory for it; a job waits for others, and one too large is refused.

Jobs of one machine know each other by files in one folder. Each file holds the estimate of a job and is locked by its
process, so a file without a lock is that of a process that died. One lock on the folder orders all decisions.

A job begins if the free memory covers what it will still take, what the running jobs will still take, and what the jobs
that have waited longer will take. So a large job is not passed for ever by small ones. A job beside which no other runs
begins in any case: then waiting would free nothing.
"""

from __future__ import annotations

import fcntl
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import psutil

from geometry.child_process import Family
from geometry.errors import CapacityError, ResourceError
from service.estimate.estimate import WAITING, Estimate
from service.estimate.machine_memory import MachineMemory, machine_memory

MB = 1_000_000
POLL_S = 1.0  # s between two looks of a job that waits


@dataclass(frozen=True)
class Other:
    """Another job of this machine.

    since   : s, time at which it came
    running : whether it has begun
    memory  : bytes, its estimate
    resident : bytes that its processes have now
    """

    since: float
    running: bool
    memory: int
    resident: int

    @property
    def ahead(self) -> int:
        """Bytes that it will still take, by its estimate."""
        return max(self.memory - self.resident, 0)


def may_begin(since: float, ahead: int, free: int, others: list[Other]) -> bool:
    """Whether a job may begin.

    since  : s, time at which it came
    ahead  : bytes that it will still take
    free   : bytes that are free on the machine
    others : the other jobs of the machine
    """
    first = [o for o in others if o.running or o.since < since]
    return not first or ahead + sum(o.ahead for o in first) <= free


def room_folder() -> Path:
    """The folder in which the jobs of this user and machine know each other."""
    return Path(tempfile.gettempdir()) / f"zonemill-room-{os.getuid()}"


class MemoryRoom:
    """The memory of this machine, shared by its jobs.

    cap_mb   : MB that jobs of this machine may take in all, where that is less than the machine has; None: all of it
    limit_mb : MB that one job may take; None: no limit of its own
    wait_s   : s for which a job waits for others at most
    folder   : in which the jobs know each other; None: ``room_folder``
    memory   : what the machine has
    """

    def __init__(self, cap_mb: int | None = None, limit_mb: int | None = None, wait_s: float = 3600.0,
                 folder: Path | None = None, memory: Callable[[], MachineMemory] = machine_memory) -> None:
        self.cap_mb, self.limit_mb, self.wait_s = cap_mb, limit_mb, wait_s
        self.folder, self.memory = folder or room_folder(), memory
        self._file: IO[str] | None = None
        self._since = 0.0

    def check(self, estimate: Estimate) -> None:
        """Refuse a job that the machine is too small for.

        Raises
        ------
        CapacityError
            machine_too_small: the estimate is above what the machine, ``cap_mb`` or ``limit_mb`` allow.
        """
        total = self.memory().total // MB
        limits = [(total, "this machine has", "use a machine with more memory")]
        if self.cap_mb is not None:
            limits.append((self.cap_mb, "ZONEMILL_MEMORY_MB allows", "raise ZONEMILL_MEMORY_MB"))
        if self.limit_mb is not None:
            limits.append((self.limit_mb, "ZONEMILL_JOB_MEMORY_LIMIT_MB allows one job",
                           "raise ZONEMILL_JOB_MEMORY_LIMIT_MB"))
        limit, has, remedy = min(limits)
        if estimate.memory_mb > limit:
            raise CapacityError(f"the job would take about {estimate.memory_mb} MB of memory, and {has} {limit} MB",
                                code="machine_too_small", subjects=(estimate.largest,), measured=estimate.memory_mb,
                                limit=limit, remedy=f"{remedy}; or name fewer faces in operations.faces, fewer small "
                                "tools, or a blank that stands closer to the part")

    def enter(self, estimate: Estimate, progress: Callable[[str, float], None]) -> None:
        """Wait until a job may begin, and count it as running until ``leave`` or the end of this process.

        progress : called with ``WAITING`` and the share 0, again and again, while the job waits

        Raises
        ------
        CapacityError
            As ``check``.
        ResourceError
            memory_busy: other jobs have left no room within ``wait_s``.
        """
        self.check(estimate)
        until = time.monotonic() + self.wait_s
        self._since = time.time()
        while not self._begun(estimate):
            if time.monotonic() > until:
                self.leave()
                raise ResourceError(f"other jobs of this machine have left no room for {estimate.memory_mb} MB of "
                                    f"memory within {self.wait_s:g} s", code="memory_busy",
                                    measured=estimate.memory_mb, limit=self.memory().free // MB,
                                    remedy="post the job again later, run fewer jobs at once (ZONEMILL_WORKERS), or "
                                    "raise ZONEMILL_MEMORY_WAIT_S")
            progress(WAITING, 0.0)
            time.sleep(POLL_S)

    def leave(self) -> None:
        """Count the job no longer."""
        if self._file is not None:
            Path(self._file.name).unlink(missing_ok=True)
            self._file.close()
            self._file = None

    def _begun(self, estimate: Estimate) -> bool:
        """Whether the job begins now. Where the folder cannot be used the jobs do not know each other, and it begins.
        """
        try:
            with self._alone():
                return self._decided(estimate.memory_mb * MB)
        except OSError:
            return True

    def _decided(self, memory: int) -> bool:
        """Decide whether the job begins, and write it down. memory : bytes, its estimate."""
        others = list(self._others())
        mine, free = Family(os.getpid()).resident(), self.memory().free
        if self.cap_mb is not None:
            free = min(free, self.cap_mb * MB - mine - sum(o.resident for o in others))
        begins = may_begin(self._since, max(memory - mine, 0), free, others)
        self._note(memory, running=begins)
        return begins

    def _note(self, memory: int, *, running: bool) -> None:
        """Write the own file; the folder must be locked."""
        if self._file is None:
            self._file = (self.folder / f"{os.getpid()}-{id(self)}.json").open("w")
            fcntl.flock(self._file, fcntl.LOCK_EX)
        self._file.seek(0)
        self._file.truncate()
        json.dump({"pid": os.getpid(), "since": self._since, "running": running, "memory": memory}, self._file)
        self._file.flush()

    def _others(self) -> Iterator[Other]:
        """The other jobs; files of processes that died are removed. The folder must be locked."""
        own = None if self._file is None else Path(self._file.name)
        for path in sorted(self.folder.glob("*.json")):
            if path == own:
                continue
            with path.open("r+") as file:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:  # locked: its process lives
                    known = json.load(file)
                else:
                    path.unlink(missing_ok=True)
                    continue
            try:
                resident = Family(known["pid"]).resident()
            except psutil.Error:  # it ended just now
                continue
            yield Other(known["since"], known["running"], known["memory"], resident)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold the lock of the folder; raises OSError where it cannot be used."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if self.folder.lstat().st_uid != os.getuid():  # of another user, in a folder that all may write to
            raise PermissionError(f"{self.folder} belongs to another user")
        with (self.folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield


__all__ = ["MemoryRoom", "Other", "may_begin", "room_folder"]
