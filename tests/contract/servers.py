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
    deadline = time.monotonic() + 40
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


@contextmanager
def postgres_server() -> Iterator[int]:
    """A PostgreSQL whose superuser is zonemill; yields its port. Skips the test where there is none."""
    pytest.importorskip("psycopg", reason="psycopg is not installed")
    programs = _programs()
    if programs is None:
        pytest.skip("PostgreSQL is not installed")
    # PostgreSQL refuses to run as root, and nobody cannot enter pytest's folders.
    folder = Path(subprocess.check_output(["mktemp", "-d"], text=True).strip())
    user = "nobody" if os.geteuid() == 0 else None
    if user:
        shutil.chown(folder, user)
    port = free_port()
    made = subprocess.run([programs / "initdb", "-D", folder / "db", "-A", "trust", "-U", "zonemill", "--no-sync"],
                          user=user, capture_output=True, text=True, cwd=folder)
    assert made.returncode == 0, made.stderr
    server = subprocess.Popen([programs / "postgres", "-D", folder / "db", "-p", str(port), "-k", folder, "-h",
                               "127.0.0.1"], user=user, cwd=folder, stderr=subprocess.DEVNULL)
    try:
        until_open(port, server)
        time.sleep(1.0)
        yield port
    finally:
        server.send_signal(signal.SIGINT)  # fast shutdown: connections of the pool are dropped
        server.wait(timeout=20)
        shutil.rmtree(folder, ignore_errors=True)
