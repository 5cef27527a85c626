"""Runs one command in a child process that cannot harm its parent.

The child lives in its own process group, dies with its parent, and is watched: wall time, resident memory of the
whole group, signals. Whatever happens, nothing of it is left running when ``run_limited`` returns.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import math
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from functools import partial
from pathlib import Path

import psutil

from geometry.errors import ResourceError, error_from_dict

POLL, LONG_POLL = 0.02, 0.1  # s, of a child at work and of one that waits
EARLY = "early"  # name of what a child hands over before its result
FAMILY_EVERY = 0.25  # s between two searches for descendants: each reads the list of all processes of the machine
_PR_SET_PDEATHSIG = 1
GARBAGE = 100_000, 20, 20  # new containers between two searches for garbage, and searches of each age between the next
RESULT_VARIABLE = "ZONEMILL_CHILD_RESULT"
MEMORY_VARIABLE = "ZONEMILL_CHILD_MEMORY"
PARENT_VARIABLE = "ZONEMILL_CHILD_PARENT"
# Exit code of a child that wrote the description of an error instead of a result.
TYPED_ERROR = 3
# Address space also counts mapped memory that is never touched (libraries, thread arenas), so its limit is wider.
ADDRESS_ROOM = 4e9


def run_limited(command: Sequence[str], request: bytes | Future[bytes], *, time_limit: float, memory_limit: float,
                name: str = "reader", stop: threading.Event | None = None,
                early: Callable[[bytes], None] | None = None) -> bytes:
    """Run a command, feed it a request on stdin, and return the content of its result file.

    command      : arguments; the child finds the name of its result file in ``ZONEMILL_CHILD_RESULT``
    request      : bytes, stdin of the child; one to come, for a child that is started before and waits for it
    time_limit   : float, s of wall time, from the request on
    memory_limit : float, bytes resident in the child and its descendants together
    name         : first word of the error codes
    stop         : once set, the child is ended as if its time were over
    early        : called, by this thread, with what the child hands over by ``hand_over`` before it goes on

    Returns bytes the child wrote before it exited with 0.

    Raises
    ------
    CamError
        The typed error that the child described (exit code 3).
    ResourceError
        Code ``<name>_timeout``, ``<name>_memory`` or ``<name>_crashed``.
    """
    with tempfile.TemporaryDirectory(prefix="zonemill-") as folder:
        result = Path(folder, "result")
        log = Path(folder, "log")
        known = isinstance(request, bytes)
        Path(folder, "request").write_bytes(request if isinstance(request, bytes) else b"")
        environment = {**os.environ, RESULT_VARIABLE: str(result), MEMORY_VARIABLE: str(int(memory_limit)),
                       PARENT_VARIABLE: str(os.getpid()),
                       "PYTHONPATH": os.pathsep.join(filter(None, [str(Path(__file__).resolve().parent.parent),
                                                                  os.environ.get("PYTHONPATH", "")]))}
        with log.open("wb") as out, Path(folder, "request").open("rb") as stdin:
            child = subprocess.Popen(list(command), stdin=stdin if known else subprocess.PIPE, stdout=out,
                                     stderr=subprocess.STDOUT, start_new_session=True, env=environment)
            try:
                if not isinstance(request, bytes):
                    _hand_over(child, request, stop)
                _watch(child, time_limit, memory_limit, name, stop, partial(_take, result.with_name(EARLY), early))
            finally:
                _kill_group(child)
        return _outcome(child.returncode, result, log, memory_limit, name)


def collect_rarely() -> None:
    """Let Python look for cyclic garbage rarely: a process that computes one result makes much data and few cycles."""
    gc.set_threshold(*GARBAGE)


def guard_child() -> Path:
    """Path of the result file. Call this first in the child: it sets the limits and ends the child with its parent."""
    collect_rarely()
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    parent = os.environ.get(PARENT_VARIABLE)
    if parent and os.getppid() != int(parent):
        sys.exit(1)  # the parent died before the request above took effect
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    room = int(float(os.environ.get(MEMORY_VARIABLE, "0")) + ADDRESS_ROOM)
    resource.setrlimit(resource.RLIMIT_AS, (room, room))
    return Path(os.environ[RESULT_VARIABLE])


def hand_over(result: Path, data: bytes) -> None:
    """Hand a first result over to the parent, in a child that goes on; result : as ``guard_child`` gives it."""
    whole = result.with_name(f"{EARLY}.part")
    whole.write_bytes(data)
    whole.replace(result.with_name(EARLY))


def _take(handed: Path, early: Callable[[bytes], None] | None) -> None:
    if early is not None and handed.exists():
        data = handed.read_bytes()
        handed.unlink()
        early(data)


def _hand_over(child: subprocess.Popen[bytes], request: Future[bytes], stop: threading.Event | None) -> None:
    """Wait for a request and write it to a child; nothing where the child ends before, or ``stop`` is set."""
    while not (request.done() or child.poll() is not None or stop is not None and stop.is_set()):
        wait([request], timeout=LONG_POLL)
    with contextlib.suppress(BrokenPipeError), contextlib.closing(child.stdin) as pipe:  # type: ignore[type-var]
        if request.done() and not request.cancelled():
            pipe.write(request.result())  # type: ignore[union-attr]


def _watch(child: subprocess.Popen[bytes], time_limit: float, memory_limit: float, name: str,
           stop: threading.Event | None, take: Callable[[], None]) -> None:
    deadline = time.monotonic() + time_limit
    family, end = Family(child.pid), _End(child)
    while True:
        ended = end.within(POLL)
        take()
        if ended:
            return
        used = family.resident()
        if used > memory_limit:
            raise _memory_error(name, used, memory_limit)
        if time.monotonic() > deadline or (stop is not None and stop.is_set()):
            raise ResourceError(f"the {name} did not finish within {time_limit:g} s and was stopped",
                                code=f"{name}_timeout", measured=time_limit, limit=time_limit,
                                remedy="simplify the part, ask for a coarser chord, or raise the time limit")


class _End:
    """The end of a child: waited for by its descriptor where the system has them, which takes no processor time."""

    def __init__(self, child: subprocess.Popen[bytes]) -> None:
        self._child = child
        self._poll: select.poll | None = None
        with contextlib.suppress(AttributeError, OSError):
            self._descriptor = os.pidfd_open(child.pid)
            weakref.finalize(self, os.close, self._descriptor)
            self._poll = select.poll()
            self._poll.register(self._descriptor, select.POLLIN)

    def within(self, seconds: float) -> bool:
        """Whether it ends within some time, s."""
        if self._poll is not None:
            return bool(self._poll.poll(1e3 * seconds)) and self._child.poll() is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._child.wait(timeout=seconds)
        return self._child.returncode is not None


class Family:
    """A process and its descendants, for the memory that they take together.

    pid : of a process of this user that runs
    """

    def __init__(self, pid: int) -> None:
        self._first = psutil.Process(pid)
        self._all, self._looked = [self._first], -math.inf

    def resident(self) -> int:
        """Resident memory of all of them, bytes; 0 once the first has ended.

        A descendant counts ``FAMILY_EVERY`` s after it was born, or sooner.
        """
        now = time.monotonic()
        if now - self._looked >= FAMILY_EVERY:
            with contextlib.suppress(psutil.Error):
                self._all, self._looked = [self._first, *self._first.children(recursive=True)], now
        total = 0
        for process in self._all:
            try:
                total += process.memory_info().rss
            except psutil.Error:  # it ended between two looks
                if process is self._first:
                    return 0
        return total


def _kill_group(child: subprocess.Popen[bytes]) -> None:
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        pass  # the whole group is gone already
    child.wait()


def _outcome(code: int, result: Path, log: Path, memory_limit: float, program: str) -> bytes:
    written = result.read_bytes() if result.exists() else b""
    if code == 0 and written:
        return written
    if code == TYPED_ERROR and written:
        error = error_from_dict(json.loads(written))
        if error.code == "out_of_memory":
            raise _memory_error(program, memory_limit, memory_limit)
        raise error
    tail = log.read_bytes()[-2000:].decode("utf-8", "replace").strip()
    if "bad_alloc" in tail or "MemoryError" in tail:
        raise _memory_error(program, memory_limit, memory_limit)
    name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
    last = tail.splitlines()[-1] if tail else "it wrote no message"
    raise ResourceError(f"the {program} ended with {name} ({last})", code=f"{program}_crashed", measured=name,
                        remedy="the file causes a fault in the CAD kernel; export the part again, if possible "
                               "from another program or as another schema")


def _memory_error(name: str, used: float, limit: float) -> ResourceError:
    return ResourceError(f"the {name} needed more than {limit / 1e9:.2f} GB of memory and was stopped",
                         code=f"{name}_memory", measured=used, limit=limit,
                         remedy="simplify the part, ask for a coarser chord, or raise the memory limit")


def give_back_memory() -> None:
    """Give freed memory of this process back to the system, where its C library can (glibc).

    Arrays of up to 32 MB stay with the process once they are freed. A stage that follows needs others at other places.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
