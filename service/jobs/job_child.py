"""Starts the process of a job: forked from a server that has the planner loaded, else a new interpreter."""

from __future__ import annotations

import atexit
import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO, Protocol

from service.jobs.fork_server import LOADED

ROOT = Path(__file__).resolve().parents[2]
JOB_MODULE, SERVER_MODULE = "service.jobs.job_process", "service.jobs.fork_server"
ANSWER_S = 5.0  # s, within which a server has forked a child
_SECRET = re.compile("^ZONEMILL_|PASSW|SECRET|TOKEN|CREDENTIAL|PRIVATE|_KEY$|_URL$", re.IGNORECASE)
THREAD_VARIABLES = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS")
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # matrices of three columns win nothing by more


class JobChild(Protocol):
    """A started process, with what ``subprocess.Popen`` has: ``wait`` raises ``subprocess.TimeoutExpired``."""

    @property
    def pid(self) -> int:
        """Process number; it is also that of its session."""

    @property
    def returncode(self) -> int | None:
        """Exit code, or minus the signal that ended it; None while it runs, as far as was seen."""

    def poll(self) -> int | None:
        """Look whether it has ended; returns ``returncode``."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; returns ``returncode``."""


class ForkedChild:
    """A child of a ``ForkServer``.

    pid    : process number
    status : file descriptor from which the server's word of its end is read
    """

    def __init__(self, pid: int, status: int) -> None:
        self.pid, self._status = pid, status
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """See ``JobChild``."""
        return self._look(0.0)

    def wait(self, timeout: float | None = None) -> int:
        """See ``JobChild``.

        Raises
        ------
        TimeoutExpired
            It still runs after ``timeout`` s.
        """
        code = self._look(timeout)
        if code is None:
            raise subprocess.TimeoutExpired(JOB_MODULE, timeout or 0.0)
        return code

    def _look(self, timeout: float | None) -> int | None:
        if self.returncode is None and (line := _line(self._status, timeout)) is not None:
            os.close(self._status)
            self.returncode = int(line) if line else -signal.SIGKILL  # the server has gone, and its children with it
        return self.returncode


class ForkServer:
    """This end of ``service.jobs.fork_server``.

    environment : of the server and of its children
    """

    def __init__(self, environment: dict[str, str]) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._lock, self.has_loaded = threading.Lock(), False
        with theirs:
            self._process = subprocess.Popen([sys.executable, "-m", SERVER_MODULE, str(theirs.fileno())],
                                             pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL,
                                             stdout=subprocess.DEVNULL, start_new_session=True, cwd=ROOT,
                                             env=environment)

    @property
    def pid(self) -> int:
        """Process number of the server."""
        return self._process.pid

    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def loaded(self, timeout: float = 0.0) -> bool:
        """Whether it can fork by now; waits for ``timeout`` s."""
        with self._lock:
            if not self.has_loaded and select.select([self._socket], [], [], timeout)[0]:
                self.has_loaded = self._socket.recv(len(LOADED)) == LOADED
            return self.has_loaded

    def start(self, request: Path, pipe: int, log: IO[bytes]) -> ForkedChild | None:
        """A child that runs a request of ``service.jobs.job_process``; None where the server cannot fork one.

        pipe : file descriptor, for the child's messages
        log  : for what it prints
        """
        if not self.alive() or not self.loaded():
            return None
        reading, writing = os.pipe()
        try:
            with self._lock:
                socket.send_fds(self._socket, [str(request).encode()], [pipe, log.fileno(), writing])
        except OSError:
            os.close(reading)
            return None
        finally:
            os.close(writing)
        pid = _line(reading, ANSWER_S)
        if pid and int(pid) > 0:
            return ForkedChild(int(pid), reading)
        os.close(reading)
        if pid is None:  # it hangs; a child that it forks later must not run the job a second time
            self.close()
        return None

    def close(self) -> None:
        """End the server and its children."""
        self._socket.close()
        self._process.kill()
        self._process.wait()


def _line(fd: int, timeout: float | None) -> bytes | None:
    """The next line of a pipe, b"" at its end; None where none came for ``timeout`` s."""
    if not select.select([fd], [], [], timeout)[0]:
        return None
    out = b""
    while (byte := os.read(fd, 1)) not in (b"", b"\n"):
        out += byte
    return out


_servers: dict[int, ForkServer] = {}
_servers_lock = threading.Lock()


def preload(threads: int) -> ForkServer:
    """The server whose children have that many kernel threads; it is started where none runs, and loads for seconds."""
    with _servers_lock:
        server = _servers.get(threads)
        if server is None or server.has_loaded and not server.alive():  # one that could not load would not again
            server = _servers[threads] = ForkServer(_environment(threads))
        return server


def close_servers() -> None:
    """End all servers of this process, and their children."""
    with _servers_lock:
        while _servers:
            _servers.popitem()[1].close()


atexit.register(close_servers)


def start_child(request: Path, pipe: int, log: IO[bytes], threads: int, preloaded: bool) -> JobChild:
    """Start ``service.jobs.job_process`` in a session of its own.

    request   : path of its request
    pipe      : file descriptor, for its messages
    log       : for what it prints
    threads   : kernel threads
    preloaded : whether it may be forked from a server; where that has not loaded yet, it is not

    Raises
    ------
    OSError
        No process can be started.
    """
    if preloaded and (child := preload(threads).start(request, pipe, log)) is not None:
        return child
    return subprocess.Popen([sys.executable, "-m", JOB_MODULE, str(request), str(pipe), str(os.getpid())],
                            pass_fds=(pipe,), stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                            start_new_session=True, cwd=ROOT, env=_environment(threads))


def _environment(threads: int) -> dict[str, str]:
    """Environment of a child, without settings and secrets of the service, since the child reads untrusted files."""
    kept = {k: v for k, v in os.environ.items() if not _SECRET.search(k)}
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return {**kept, "PYTHONPATH": path, **dict.fromkeys(THREAD_VARIABLES, str(threads)),
            **dict.fromkeys(ONE_THREAD, "1")}
