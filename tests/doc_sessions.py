"""A reader's shell: a folder like a checkout after make setup, in which commands of the pages run as written."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from tests.contract.servers import free_port
from tests.doc_pages import Command, simple
from tests.source_tree import ROOT

MADE = {".git", ".venv", ".venv-runtime", "build", "data", "dist", "out", "node_modules"}
"""What a checkout gets by use."""
PROGRAM = """#!/bin/sh
PYTHONPATH="{root}${{PYTHONPATH:+:$PYTHONPATH}}" exec {python} {words} "$@"
"""
PROGRAMS = {"python": "", "zonemill": "-m service.cli", "openapi-python-client": "-m openapi_python_client"}
"""Programs of ``.venv/bin`` as words of the interpreter: a worktree has no environment of its own."""
JOB = re.compile(r"\bj[0-9a-f]{32}\b")
PLACES = {"/srv/zonemill": "srv/zonemill", "mes.example.com": "mes.invalid"}
"""What a page names that is not of this machine, and what stands for it: a name that no name server knows."""
SHORTER = ((re.compile(r"--count \d+"), "--count 1"),)
"""How many of a kind a command makes; one is enough to see that it works."""


def make_checkout(folder: Path) -> Path:
    """A folder with the files of the checkout, an environment of programs and nothing that was made by use."""
    folder.mkdir(parents=True)
    for path in ROOT.iterdir():
        if path.name in MADE or path.name.endswith("_cache") or path.name == "__pycache__":
            continue
        if path.is_file():
            shutil.copy2(path, folder / path.name)
        elif path.name == "examples":
            shutil.copytree(path, folder / path.name, ignore=shutil.ignore_patterns("__pycache__", *MADE))
        else:
            (folder / path.name).symlink_to(path)
    programs = folder / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name, words in PROGRAMS.items():
        (programs / name).write_text(PROGRAM.format(root=ROOT, python=sys.executable, words=words))
        (programs / name).chmod(0o755)
    (folder / ".venv" / ".installed").touch()
    return folder


def environment(port: int) -> dict[str, str]:
    """Variables of a reader: no virtual environment is active, loopback needs no proxy, no browser opens."""
    own = {k: v for k, v in os.environ.items() if not k.startswith(("ZONEMILL_", "VIRTUAL_ENV", "MAKE"))}
    path = [p for p in own.get("PATH", os.defpath).split(os.pathsep) if not Path(p, "zonemill").exists()]
    return own | {"PATH": os.pathsep.join(path), "BROWSER": "true", "NO_PROXY": "127.0.0.1", "no_proxy": "127.0.0.1",
                  "ZONEMILL_PORT": str(port)}


class Shell:
    """One bash that keeps its folder and variables from command to command."""

    def __init__(self, folder: Path, logs: Path, variables: dict[str, str]) -> None:
        self.logs, self.count, self.folder = logs, 0, folder
        logs.mkdir(parents=True, exist_ok=True)
        self.process = subprocess.Popen(["bash", "--norc"], cwd=folder, env=variables, text=True, bufsize=1,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)

    def run(self, text: str) -> tuple[int, str]:
        """Run a command line; its exit code, and what it printed on both streams."""
        self.count += 1
        log = self.logs / f"{self.count}.log"
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(f"{{ {text}\n}} </dev/null >'{log}' 2>&1; printf '%s %s\\n' $? \"$PWD\"\n")
        code, _, folder = self.process.stdout.readline().rstrip("\n").partition(" ")
        assert code, f"the shell ended: {log.read_text(errors='replace') if log.exists() else ''}"
        self.folder = Path(folder)
        return int(code), log.read_text(encoding="utf-8", errors="replace")

    def close(self) -> None:
        """End it, with what it started."""
        end(self.process, signal.SIGKILL)


class Server:
    """A command that serves until Ctrl-C, with its address."""

    def __init__(self, text: str, folder: Path, log: Path, variables: dict[str, str]) -> None:
        self.text, self.log = text, log
        with log.open("w") as file:
            self.process = subprocess.Popen(["bash", "-c", text], cwd=folder, env=variables, stdin=subprocess.DEVNULL,
                                            stdout=file, stderr=subprocess.STDOUT, start_new_session=True)
        self.url = self._wait()

    def _wait(self) -> str:
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            said = self.log.read_text(errors="replace")
            found = re.search(r"http://127\.0\.0\.1:\d+", said)
            if found and answers(found[0]):
                return found[0]
            assert self.process.poll() is None, f"{self.text}\n{said}"
            time.sleep(0.1)
        raise AssertionError(f"{self.text} does not answer\n{self.log.read_text(errors='replace')}")

    def close(self) -> int:
        """Ctrl-C; its exit code."""
        end(self.process, signal.SIGINT)
        return self.process.returncode


def end(process: subprocess.Popen, how: signal.Signals) -> None:  # type: ignore[type-arg]
    """Send a signal to a process of a session of its own and to what it started; wait until it has ended."""
    if process.poll() is None:
        os.killpg(process.pid, how)
        try:
            process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def answers(url: str) -> bool:
    """Whether a server answers, be it with a refusal."""
    try:
        _open(url).close()
    except urllib.error.HTTPError:
        return True
    except OSError:
        return False
    return True


def _open(url: str, key: str = ""):  # type: ignore[no-untyped-def]
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {key}"} if key else {})
    return urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=30)


def compare(command: Command, said: str) -> None:
    """Hold a transcript against what came: its status, its keys, and whether it is a refusal."""
    refused = "urn:zonemill:problem"
    asks = any(part.program == "curl" or part.program.endswith(".sh") for part in simple(command.text))
    assert not asks or (refused in said) == (refused in command.output), f"{command}\n{said}"
    first = re.match(r"HTTP/1\.1 \d+", command.output)
    assert not first or first[0] in said, f"{command}\n{said}"
    gone = [k for k in re.findall(r'"(\w+)":', command.output) if f'"{k}":' not in said]
    assert not gone, f"{command}\nthe page shows {gone}, which did not come\n{said}"


class Session:
    """A page read from its top: commands run in one shell, and servers beside it.

    checkout : folder made by ``make_checkout``
    start    : folder in which the reader begins
    given    : folder with files that a reader brings along, by their names on the pages
    serve    : how a service is started that a command wants and the page has not started yet -> its address
    """

    def __init__(self, checkout: Path, start: Path, given: Path, serve: Callable[[], str] | None = None) -> None:
        self.checkout, self.given, self.serve = checkout, given, serve
        self.port = free_port()
        self.variables = environment(self.port)
        self.logs = checkout / "logs"
        self.shell = Shell(start, self.logs / "reader", self.variables)
        self.beside = Shell(checkout, self.logs / "service", self.variables)  # the shell in which services run
        for shell in (self.shell, self.beside):
            shell.run("true")
        self.server: Server | None = None
        self.address = ""
        self.jobs: dict[str, str] = {}

    def close(self) -> None:
        """End the shells and what runs."""
        if self.server:
            self.server.close()
        self.shell.close()
        self.beside.close()

    def expanded(self, text: str) -> str:
        """A command line with what stands for the reader's own: places, port, jobs, numbers."""
        for named, here in PLACES.items():
            text = text.replace(named, str(self.checkout / here) if here.startswith("srv") else here)
        for pattern, instead in SHORTER:
            text = pattern.sub(instead, text)
        text = text.replace("http://127.0.0.1:8000", self.address or f"http://127.0.0.1:{self.port}")
        text = re.sub(r"--port 8000\b", f"--port {self.port}", text)
        text = JOB.sub(lambda m: self.jobs.get(m[0], m[0]), text)
        # What is installed is there: make goes on as after make setup.
        text = re.sub(r"^make serve\b", f"make serve PORT={self.port}", text)
        return re.sub(r"^make (?=\w)", "make -o .venv/.installed -o page ", text)

    def run(self, command: Command, *, beside: bool = False) -> str:
        """Run a command as a reader would, ``beside`` in the shell of services; its output.

        Raises
        ------
        AssertionError
            It failed, or the service refused what the page says it takes.
        """
        shell = self.beside if beside else self.shell
        if "127.0.0.1:8000" in command.text or "./0" in command.text:
            self._serve()
        self._bring(command, shell.folder)
        if "/files" in command.text:
            for job in JOB.findall(command.text):
                self._wait(self.jobs[job])
        there = set(shell.folder.iterdir())
        code, said = shell.run(self.expanded(command.text))
        assert code == 0, f"{command}\nended with {code}\n{said}"
        documented, come = (list(dict.fromkeys(JOB.findall(text))) for text in (command.output, said))
        self.jobs |= dict(zip(documented, come, strict=False))
        compare(command, said)
        for path in set(shell.folder.iterdir()) - there:
            if path.is_file() and path.stat().st_size < 5000:
                assert b"urn:zonemill:problem" not in path.read_bytes(), f"{command}\n{path.name}: {path.read_text()}"
        return said

    def start(self, command: Command) -> None:
        """Start a command that serves until Ctrl-C in the shell of services, in place of the one before."""
        self.stop()
        self._bring(command, self.beside.folder)
        self.server = Server(self.expanded(command.text), self.checkout, self.logs / f"server-{command.line}.log",
                             self._exported())
        if "view" not in command.text:
            self.address = self.server.url

    def stop(self) -> None:
        """Ctrl-C to what serves. It ends with 0; make may end with a code of its own."""
        if self.server:
            code, text = self.server.close(), self.server.text
            said = self.server.log.read_text(errors="replace")
            known = code == 0 or text.startswith("make")
            assert known, f"{text} ended with {code}\n{said}"
            self.server = None

    def _exported(self) -> dict[str, str]:
        """Variables that commands of the shell of services have exported by now."""
        _, said = self.beside.run("env -0 | tr '\\0' '\\1'")
        return dict(line.split("=", 1) for line in said.strip("\1").split("\1") if "=" in line)

    def _serve(self) -> None:
        if not self.address and self.serve:
            self.address = self.serve()
        self.shell.run(f"export ZONEMILL_BASE={self.address}")

    def _bring(self, command: Command, folder: Path) -> None:
        """Put files that the reader has where the command looks for them."""
        for part in simple(command.text):
            for word in part.words[1:]:
                name = re.sub(r"^\w+=@|;.*$", "", word)
                if name and "/" not in name and (self.given / name).is_file() and not (folder / name).exists():
                    shutil.copy2(self.given / name, folder / name)

    def _wait(self, job: str) -> None:
        """Wait until a job has ended, as a reader does who follows its events."""
        key = self.shell.folder / "key"
        text = key.read_text().strip() if key.exists() else ""
        for _ in range(6000):
            with _open(f"{self.address}/v1/jobs/{job}", text) as answer:
                if not re.search(rb'"state":\s*"(queued|running)"', answer.read()):
                    return
            time.sleep(0.1)

