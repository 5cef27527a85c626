"""Runs one job in a child process and monitors it: progress, cancel, wall time, memory, signals.

No process of the child is left when ``supervise`` returns. The calling thread only waits; the child computes.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]

from geometry.child_process import Family
from geometry.errors import CancelledError, ResourceError, error_from_dict
from service.estimate.estimate import WAITING
from service.jobs.job_child import JobChild, start_child

# Address space includes mapped but unused memory (libraries, thread arenas), so its limit is larger.
ADDRESS_ROOM = 8_000_000_000


@dataclass(frozen=True)
class ProcessLimits:
    """Limits of one attempt.

    time_s       : wall time, s
    memory_bytes : resident memory of the child and its descendants together
    threads      : kernel threads
    poll_s       : interval between checks of the limits and of ``keep``, s
    preload      : whether the child may be forked from a process that has the planner loaded
    """

    time_s: float
    memory_bytes: int
    threads: int = 1
    poll_s: float = 0.2
    preload: bool = False


def supervise(request: dict[str, Any], limits: ProcessLimits, scratch: Path, *,
              on_progress: Callable[[str, float], None], on_resumed: Callable[[Mapping[str, int]], None],
              on_estimate: Callable[[Mapping[str, Any]], None], keep: Callable[[], bool]) -> str:
    """Run a job in a child process.

    request     : see ``service.jobs.job_process``; 'address_bytes' is filled in here
    scratch     : folder for temporary files of the child
    on_progress : called with stage and fraction, at most once per check
    on_resumed  : called with the number of checkpoints used, by kind
    on_estimate : called with what the job is expected to take, as ``service.estimate.job_estimate.Estimate.as_dict``
    keep        : called at every check; False kills the child

    The time for which the child waits for memory does not count for its limit of time.

    Returns the final state from the child.

    Raises
    ------
    CancelledError
        ``keep`` returned False.
    ResourceError
        Codes 'job_timeout', 'job_memory', 'job_crashed' (a signal of its own, such as SIGSEGV) and 'job_killed'
        (SIGKILL from outside).
    CamError
        The typed error from the child.
    """
    with tempfile.TemporaryDirectory(prefix="job-", dir=scratch) as folder:
        path, log = Path(folder, "request.json"), Path(folder, "log")
        path.write_text(json.dumps({**request, "address_bytes": limits.memory_bytes + ADDRESS_ROOM}))
        reading, writing = os.pipe()
        try:
            with log.open("wb") as out, closing_fd(writing):
                child = start_child(path, writing, out, limits.threads, limits.preload)
            try:
                final = _watch(child, _Lines(reading, on_progress, on_resumed, on_estimate), limits, keep)
            finally:
                kill_tree(child)
        finally:
            os.close(reading)
        return _outcome(child.wait(), final, log)


@contextmanager
def closing_fd(handle: int) -> Iterator[None]:
    """Close a file descriptor at the end, also where the child could not be started."""
    try:
        yield
    finally:
        os.close(handle)


def kill_tree(child: JobChild) -> None:
    """Kill a child with all its descendants, also those in sessions of their own, and wait for it."""
    try:
        family = psutil.Process(child.pid).children(recursive=True) if child.returncode is None else []
    except psutil.Error:
        family = []
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass  # the whole group has ended
    for process in family:
        try:
            process.kill()
        except psutil.Error:
            pass
    child.wait()


def _watch(child: JobChild, lines: _Lines, limits: ProcessLimits,
           keep: Callable[[], bool]) -> dict[str, Any]:
    """Monitor the child until it ends; returns its last message, {} when there was none."""
    looked = time.monotonic()
    deadline = looked + limits.time_s
    family = Family(child.pid)
    next_look = 0.0
    with selectors.DefaultSelector() as selector:
        selector.register(lines.reading, selectors.EVENT_READ)
        while True:
            open_still = True
            if selector.select(timeout=limits.poll_s):
                open_still = lines.feed()
            if not open_still or child.poll() is not None:
                while open_still and selector.select(timeout=0):
                    open_still = lines.feed()
                _await_exit(child)
                return lines.final
            now = time.monotonic()
            deadline, looked = deadline + (now - looked if lines.waits else 0.0), now
            if now >= next_look:
                next_look = now + limits.poll_s
                _check(family, limits, deadline, keep)


class _Lines:
    """Messages of the child, line by line, from the pipe ``reading``.

    final : its last message
    waits : whether it waits for memory
    """

    def __init__(self, reading: int, on_progress: Callable[[str, float], None],
                 on_resumed: Callable[[Mapping[str, int]], None],
                 on_estimate: Callable[[Mapping[str, Any]], None]) -> None:
        self.reading, self.on_progress, self.on_resumed, self.buffer = reading, on_progress, on_resumed, b""
        self.on_estimate, self.waits = on_estimate, False
        self.final: dict[str, Any] = {}
        os.set_blocking(reading, False)

    def feed(self) -> bool:
        """Read the available text and pass on the newest progress; False at the end of the pipe."""
        chunk = os.read(self.reading, 65536)
        *lines, self.buffer = (self.buffer + chunk).split(b"\n")
        progress = resumed = None
        for line in filter(None, lines):
            message = json.loads(line)
            if "stage" in message:
                progress = message
            elif "resumed" in message:
                resumed = message
            elif "estimate" in message:
                self.on_estimate(message["estimate"])
            else:
                self.final = message
        if resumed is not None:
            self.on_resumed(resumed["resumed"])
        if progress is not None:
            self.waits = progress["stage"] == WAITING
        if progress is not None and not self.final:
            self.on_progress(progress["stage"], progress["progress"])
        return chunk != b""


def _check(family: Family, limits: ProcessLimits, deadline: float, keep: Callable[[], bool]) -> None:
    if not keep():
        raise CancelledError("the job was cancelled")
    if time.monotonic() > deadline:
        raise ResourceError(f"the job did not finish within {limits.time_s:g} s and was stopped", code="job_timeout",
                            measured=limits.time_s, limit=limits.time_s,
                            remedy="allow a larger scallop height or fewer faces, or raise ZONEMILL_JOB_TIME_LIMIT_S")
    used = family.resident()
    if used > limits.memory_bytes:
        raise ResourceError(f"the job needed more than {limits.memory_bytes / 1e9:.2f} GB of memory and was stopped",
                            code="job_memory", measured=used, limit=limits.memory_bytes,
                            remedy="simplify the part or raise ZONEMILL_JOB_MEMORY_LIMIT_MB")


def _await_exit(child: JobChild) -> None:
    """Wait a moment for the interpreter to end, after it has closed the pipe."""
    try:
        child.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        pass  # its last message has arrived; kill_tree ends it


def _outcome(code: int, final: dict[str, Any], log: Path) -> str:
    if "state" in final:
        return str(final["state"])
    if "error" in final:
        raise error_from_dict(final["error"])
    with log.open("rb") as output:  # the log may have gigabytes
        output.seek(max(0, log.stat().st_size - 2000))
        tail = output.read().decode("utf-8", "replace").strip()
    if "MemoryError" in tail or "bad_alloc" in tail:
        raise ResourceError("the job ran out of memory", code="job_memory",
                            remedy="simplify the part, or use more memory and raise ZONEMILL_JOB_MEMORY_LIMIT_MB")
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    last = tail.splitlines()[-1] if tail else "no message"
    raise ResourceError(f"the process of the job died from {name} ({last})", measured=name,
                        code="job_killed" if code == -signal.SIGKILL else "job_crashed",
                        remedy="the same input fails again; please report this bug with part and setup")
