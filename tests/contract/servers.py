"""Servers by others that tests start: PostgreSQL, on a port of loopback and in a folder of its own."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until_open(port: int, process: subprocess.Popen[bytes]) -> None:
    """Wait until a process listens; fails the test when it does not."""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return
        except OSError:
            time.sleep(0.1)
    pytest.fail(f"nothing listens on port {port}")


def _programs() -> Path | None:
    """Folder of PostgreSQL's server programs, None when it is not installed."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    return folders[-1] if folders else None


class Postgres:
    """A PostgreSQL whose superuser is zonemill, in a folder and on a port of its own."""

    def __init__(self, programs: Path) -> None:
        # PostgreSQL refuses to run as root, and nobody cannot enter pytest's folders.
        self.folder = Path(subprocess.check_output(["mktemp", "-d"], text=True).strip())
        self.user = "nobody" if os.geteuid() == 0 else None
        if self.user:
            shutil.chown(self.folder, self.user)
        self.programs, self.port = programs, free_port()
        made = subprocess.run([programs / "initdb", "-D", self.folder / "db", "-A", "trust", "-U", "zonemill"],
                              user=self.user, capture_output=True, text=True, cwd=self.folder)
        assert made.returncode == 0, made.stderr
        self.server: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Run it until ``stop``."""
        command = [self.programs / "postgres", "-D", self.folder / "db", "-p", str(self.port), "-k", self.folder,
                   "-h", "127.0.0.1"]
        self.server = subprocess.Popen(command, user=self.user, cwd=self.folder, stderr=subprocess.DEVNULL)
        until_open(self.port, self.server)
        time.sleep(1.0)

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """SIGINT: connections are dropped and all is written; SIGQUIT: at once, the next start has to recover."""
        assert self.server is not None
        self.server.send_signal(how)
        self.server.wait(timeout=20)


@contextmanager
def postgres_server() -> Iterator[Postgres]:
    """A PostgreSQL that runs. Skips the test where there is none."""
    pytest.importorskip("psycopg", reason="psycopg is not installed")
    programs = _programs()
    if programs is None:
        pytest.skip("PostgreSQL is not installed")
    found = Postgres(programs)
    found.start()
    try:
        yield found
    finally:
        found.stop()
        shutil.rmtree(found.folder, ignore_errors=True)
