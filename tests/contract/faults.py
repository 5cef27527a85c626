"""A service of several processes that things happen to, and what a client sees meanwhile.

``Site`` keeps PostgreSQL, a Dask scheduler, two workers and two API processes running, each started again when it
ends, as docker-compose.yml has it; ``Alone`` does the same with the embedded service. ``Client`` posts and follows
jobs over whatever happens, as an MES would: it repeats what got no answer, with the same Idempotency-Key.
"""

from __future__ import annotations

import collections
import http.server
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import psutil

from service.jobs.job_child import JOB_MODULE
from tests.contract.servers import Postgres, free_port, until_open

ROOT = Path(__file__).resolve().parents[2]
FAKES = Path(__file__).parent / "fakes"
LEASE_S = 5.0
FINAL = ("proved", "unproved", "done", "failed", "cancelled")


class Kept:
    """A process that is started again a moment after it ended, until ``close``."""

    def __init__(self, start: Callable[[], subprocess.Popen[bytes]], pause_s: float = 0.3) -> None:
        self.start, self.pause_s, self.starts = start, pause_s, 1
        self.process, self.closing = start(), False
        self.thread = threading.Thread(target=self._keep, daemon=True)
        self.thread.start()

    def _keep(self) -> None:
        while not self.closing:
            self.process.wait()
            time.sleep(self.pause_s)
            if not self.closing:
                self.process, self.starts = self.start(), self.starts + 1

    def kill(self) -> None:
        """SIGKILL; it is started again."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def close(self) -> None:
        """End it for good."""
        self.closing = True
        self.process.kill()
        self.thread.join(timeout=10)
        self.process.kill()
        self.process.wait()


class Line:
    """The network between the API processes and the scheduler: a proxy that can be cut.

    cut(silent=False) ends every connection and refuses new ones; cut(silent=True) lets them stand and loses what is
    sent, as a cable does that is pulled.
    """

    def __init__(self, target: int) -> None:
        self.target, self.port = target, free_port()
        self.silent = False
        self.pairs: list[tuple[socket.socket, socket.socket]] = []
        self.listener: socket.socket | None = None
        self.mend()

    def mend(self) -> None:
        """Carry again; what stood through a silent cut is ended, as TCP would in the end."""
        if self.silent:
            self._drop()
        self.silent = False
        if self.listener is None:
            self.listener = socket.create_server(("127.0.0.1", self.port))
            threading.Thread(target=self._accept, args=(self.listener,), daemon=True).start()

    def cut(self, silent: bool) -> None:
        """Carry nothing any more."""
        self.silent = silent
        if not silent:
            assert self.listener is not None
            self.listener.shutdown(socket.SHUT_RDWR)
            self.listener.close()
            self.listener = None
            self._drop()

    def close(self) -> None:
        """Be gone."""
        if self.listener is not None:
            self.cut(silent=False)

    def _drop(self) -> None:
        for pair in self.pairs:
            for end in pair:
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
        self.pairs.clear()

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                near, _ = listener.accept()
            except OSError:
                return
            try:
                far = socket.create_connection(("127.0.0.1", self.target), 2)
                far.settimeout(None)
            except OSError:
                near.close()
                continue
            self.pairs.append((near, far))
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=self._carry, args=(a, b), daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket) -> None:
        try:
            while chunk := source.recv(65536):
                if not self.silent:
                    sink.sendall(chunk)
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Mailbox:
    """A receiver of webhooks that keeps (webhook-id, job, state) of each it got."""

    def __init__(self) -> None:
        self.got: list[tuple[str, str, str]] = []
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                job = json.loads(self.rfile.read(int(self.headers["content-length"])))["data"]
                outer.got.append((self.headers["webhook-id"], job["id"], job["state"]))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Take no more."""
        self.server.shutdown()
        self.server.server_close()


class Service:
    """What ``Site`` and ``Alone`` share: environment, data folder, clock, mailbox and the API processes."""

    def __init__(self, folder: Path, data: Path, attempts: int = 3, **variables: str) -> None:
        self.folder, self.data, self.attempts = folder, data, attempts
        self.mailbox, self.kept, self.apis, self.urls = Mailbox(), [], [], []
        self.clock = folder / "clock"
        self.environment = {
            **os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{FAKES}", "ZONEMILL_LEASE_S": str(LEASE_S),
            "ZONEMILL_WEBHOOK_SECRET": "s" * 40, "ZONEMILL_WEBHOOK_NETWORKS": '["127.0.0.0/8"]',
            "ZONEMILL_WEBHOOK_ORIGINS": f'["http://127.0.0.1:{self.mailbox.port}"]', "ZONEMILL_WEBHOOK_RETRY_S": "1",
            "ZONEMILL_POST_RATE": "10000/minute", "ZONEMILL_CHILD_THREADS": "1", "ZONEMILL_WORKERS": "2",
            "ZONEMILL_MIN_FREE_MB": "0", "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False", **variables}
        self.kept: list[Kept]
        self.apis: list[Kept]
        self.urls: list[str]

    def clocked(self) -> None:
        """Run everything under a clock that ``set_clock`` can set; wants a C compiler."""
        library = self.folder / "set_clock.so"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, FAKES / "set_clock.c", "-ldl"], check=True)
        self.set_clock(0)
        self.environment |= {"LD_PRELOAD": str(library), "CLOCK_FILE": str(self.clock)}

    def set_clock(self, ahead_s: int) -> None:
        """Set the clock of all processes, s ahead of the true time."""
        with self.clock.open("r+b" if self.clock.exists() else "wb") as out:
            out.write(ahead_s.to_bytes(8, sys.byteorder, signed=True))

    def process(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        """Start one; what it says goes into a log of the folder."""
        with (self.folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen([sys.executable, *words], stdout=log, stderr=log, cwd=ROOT, env=self.environment)

    def keep(self, name: str, *words: str) -> Kept:
        """Start one and keep it running."""
        self.kept.append(Kept(lambda: self.process(name, *words)))
        return self.kept[-1]

    def api(self, name: str) -> None:
        """Start an API process on a port that stays its own."""
        port = free_port()
        self.apis.append(self.keep(name, str(FAKES / "serve_fake.py"), str(self.data), str(self.attempts), str(port),
                                   "fault_chain"))
        self.urls.append(f"http://127.0.0.1:{port}")

    def children(self) -> list[psutil.Process]:
        """The processes that compute a job."""
        found = []
        for kept in self.kept:
            try:
                found += [p for p in psutil.Process(kept.process.pid).children(recursive=True)
                          if JOB_MODULE in p.cmdline()]
            except psutil.Error:
                pass
        return found

    def is_ready(self, slots: int = 2) -> bool:
        """Whether every API process says that it is ready and sees all workers."""
        try:
            for url in self.urls:
                if httpx.get(f"{url}/readyz", trust_env=False, timeout=5).status_code != 200:
                    return False
                if httpx.get(f"{url}/v1/capabilities", trust_env=False, timeout=5).json()["slots"] != slots:
                    return False
        except (httpx.HTTPError, KeyError):
            return False
        return True

    def until_ready(self, patience_s: float = 300.0) -> float:
        """Wait for it; returns how long that took, s."""
        began = time.monotonic()
        while not self.is_ready():
            assert time.monotonic() - began < patience_s, "the service does not come back; see the logs in its folder"
            time.sleep(0.1)
        return time.monotonic() - began

    def close(self) -> None:
        """End everything."""
        for kept in reversed(self.kept):
            kept.close()
        self.mailbox.close()


class Site(Service):
    """PostgreSQL, scheduler, two workers of one thread, two API processes, a line between these and the scheduler."""

    def __init__(self, folder: Path, data: Path, database: Postgres, clocked: bool = False, **variables: str) -> None:
        super().__init__(folder, data, **variables)
        if clocked:
            self.clocked()
        self.database, port = database, free_port()
        self.scheduler = self.keep("scheduler", "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", str(port),
                                   "--no-dashboard")
        until_open(port, self.scheduler.process)
        self.line = Line(port)
        self.environment |= {
            "ZONEMILL_DATABASE_URL": f"postgresql+psycopg://zonemill@127.0.0.1:{database.port}/postgres",
            "ZONEMILL_SCHEDULER": f"tcp://127.0.0.1:{self.line.port}"}
        self.workers = [self.keep(f"worker{k}", "-m", "dask", "worker", f"tcp://127.0.0.1:{port}", "--no-nanny",
                                  "--nthreads", "1", "--memory-limit", "0", "--no-dashboard", "--local-directory",
                                  str(folder)) for k in (1, 2)]
        for k in (1, 2):
            self.api(f"api{k}")

    def close(self) -> None:
        """End everything."""
        super().close()
        self.line.close()


class Alone(Service):
    """The embedded service: one process, SQLite, two jobs at a time."""

    def __init__(self, folder: Path, data: Path, **variables: str) -> None:
        super().__init__(folder, data, **variables)
        self.api("service")


class Client:
    """Posts a batch of jobs and follows them to their ends; what it sees is kept in ``seen``."""

    def __init__(self, service: Service, part: bytes, setup: dict[str, Any], batch: str) -> None:
        self.service, self.part, self.setup, self.batch = service, part, setup, batch
        self.http = httpx.Client(trust_env=False, timeout=10)
        self.jobs: dict[str, str] = {}  # key -> id
        self.seen: dict[str, list[tuple[float, dict[str, Any]]]] = collections.defaultdict(list)
        self.turn = 0

    def ask(self, method: str, path: str, patience_s: float = 300.0, **more: Any) -> httpx.Response:
        """One request, again and again, at one API process after the other, until somebody answers it."""
        until = time.monotonic() + patience_s
        while True:
            self.turn += 1
            url = self.service.urls[self.turn % len(self.service.urls)]
            try:
                answer = self.http.request(method, url + path, **more)
                if answer.status_code < 500 and answer.status_code != 429:
                    return answer
                assert answer.status_code in (429, 503), (answer.status_code, answer.text)
            except httpx.TransportError:
                pass
            assert time.monotonic() < until, f"nobody answers {method} {path}"
            time.sleep(0.2)

    def post(self, name: str, do: str) -> str:
        """Post a job, or find the one that was posted under this name; returns its id."""
        setup = {**self.setup, "labels": {"batch": self.batch, "name": name, **({"do": do} if do else {})}}
        key = f"{self.batch}-{name}"
        answer = self.ask("POST", "/v1/zones", headers={"Idempotency-Key": key},
                          files={"part": ("p.step", self.part), "setup": ("s.json", json.dumps(setup))},
                          data={"webhook_url": f"http://127.0.0.1:{self.service.mailbox.port}/{key}"})
        assert answer.status_code == 202, answer.text
        return self.jobs.setdefault(key, answer.json()["id"])

    def look(self) -> dict[str, dict[str, Any]]:
        """All jobs of the batch as they stand."""
        for job_id in self.jobs.values():
            job = self.ask("GET", f"/v1/jobs/{job_id}").json()
            last = self.seen[job_id][-1][1] if self.seen[job_id] else None
            if last is None or (last["state"], last["attempt"]) != (job["state"], job["attempt"]):
                self.seen[job_id].append((time.monotonic(), job))
        return {job_id: changes[-1][1] for job_id, changes in self.seen.items()}

    def until_running(self, count: int, patience_s: float = 300.0) -> list[str]:
        """Wait until so many run; returns their ids."""
        until = time.monotonic() + patience_s
        while True:
            running = [i for i, job in self.look().items() if job["state"] == "running"]
            if len(running) >= count:
                return running
            assert time.monotonic() < until, "the jobs do not start"
            time.sleep(0.1)

    def until_ended(self, patience_s: float) -> tuple[float, dict[str, float]]:
        """Wait until all have ended and the service is whole again; returns when it was, and when each had ended, s."""
        until, whole = time.monotonic() + patience_s, None
        while True:
            left = [i for i, job in self.look().items() if job["state"] not in FINAL]
            if whole is None and self.service.is_ready():
                whole = time.monotonic()
            if not left and whole is not None:
                return whole, {i: changes[-1][0] for i, changes in self.seen.items()}
            assert time.monotonic() < until, f"stuck, whole again: {whole}: {[self.seen[i] for i in left]}"
            time.sleep(0.2)

    def result(self, job_id: str) -> bytes:
        """The zones a job found."""
        answer = self.ask("GET", f"/v1/jobs/{job_id}/zones")
        assert answer.status_code == 200, answer.text
        return answer.content


def full_disk(folder: Path) -> Callable[[], None]:
    """Fill the file system of a folder to the last byte; returns what empties it again."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as out:
        block = bytes(1 << 20)
        while block:
            try:
                if out.write(block) < len(block):
                    block = block[: len(block) // 2]
            except OSError:
                block = block[: len(block) // 2]
    return filler.unlink


def small_disk(folder: Path, size_mb: int) -> bool:
    """Mount a file system of that size there; False where that is not permitted."""
    if os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    folder.mkdir(exist_ok=True)
    return subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_mb}m", "tmpfs", folder],
                          capture_output=True).returncode == 0


def waiting(rng: random.Random, low: float, high: float) -> None:
    """Sleep, so that a fault does not always hit the same moment of a job."""
    time.sleep(rng.uniform(low, high))
