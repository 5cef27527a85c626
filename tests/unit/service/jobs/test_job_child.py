"""Jobs that start from a process with the planner loaded."""

import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import psutil
import pytest

from geometry.errors import CamError, CancelledError, ResourceError
from service.jobs import fork_server, job_child
from service.jobs.supervisor import ProcessLimits, supervise

FAKES = Path(__file__).resolve().parents[3] / "contract" / "fakes"
LOADING_S = 300.0
SETUP = '{"tools": [{"id": "T1", "number": 1, "kind": "ball", "diameter_mm": 4, "flute_length_mm": 8, ' \
        '"stickout_mm": 30}], "labels": {"do": "%s"}}'


@pytest.fixture(scope="module")
def server():
    """A server that has loaded, whose children find the fake chain."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(FAKES))
        patch.setenv("ZONEMILL_WEBHOOK_SECRET", "0123456789")
        patch.setenv("DATABASE_PASSWORD", "0123456789")
        yield loaded()
        job_child.close_servers()


def loaded():
    server = job_child.preload(1)
    assert server.loaded(LOADING_S) and server.alive()
    return server


def run(folder, do="", keep=lambda: True, started=lambda: None, **limits):
    """Supervise a job of the fake chain; returns its state and the stages that were seen."""
    out, scratch = folder / "out", folder / "scratch"
    out.mkdir(exist_ok=True)
    scratch.mkdir(exist_ok=True)
    part = folder / "part.step"
    part.write_text("ISO-10303-21;\n")
    stages = []

    def progress(stage, _share):
        stages.append(stage)
        started()

    try:
        state = supervise({"kind": "plan", "part": str(part), "setup": SETUP % do, "program": None, "stock": None,
                           "spindle_tool": None, "out": str(out), "kept": str(folder / "kept"), "chain": "fake_chain"},
                          ProcessLimits(**{"time_s": 60.0, "memory_bytes": 2_000_000_000, "preload": True,
                                           "poll_s": 0.05, **limits}), scratch, on_progress=progress,
                          on_resumed=lambda _: None, on_estimate=lambda _: None, keep=keep)
    finally:
        assert not list(scratch.iterdir())
    return state, stages


def children(server):
    return psutil.Process(server.pid).children(recursive=True)


def gone(processes, within=10.0):
    """Whether all of them have ended, or end soon."""
    return not psutil.wait_procs(processes, timeout=within)[1]


def test_a_job_is_a_child_of_the_server_and_ends_as_another_does(server, tmp_path):
    seen = []
    state, stages = run(tmp_path, "short nap", started=lambda: seen.append([c.pid for c in children(server)]))
    assert state == "proved" and "asleep" in stages
    assert max(map(len, seen)) == 1 and (tmp_path / "out" / "report.json").exists()
    assert not children(server)


def test_several_jobs_run_side_by_side(server, tmp_path):
    """Each has its own pipes: the end of one is not the end of another."""
    states, most = [], []

    def one(name):
        folder = tmp_path / name
        folder.mkdir()
        states.append(run(folder, "short nap", started=lambda: most.append(len(children(server))))[0])

    threads = [threading.Thread(target=one, args=(f"job{k}",)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert states == ["proved"] * 3 and max(most) == 3


@pytest.mark.parametrize(("do", "code", "limits"), [
    ("segfault", "job_crashed", {}), ("killed", "job_killed", {}), ("bug", "bug", {}), ("open", "open_shell", {}),
    ("sleep", "job_timeout", {"time_s": 1.0}), ("memory", "job_memory", {"memory_bytes": 900_000_000})])
def test_a_failing_job_is_a_typed_error_and_the_server_serves_on(server, tmp_path, do, code, limits):
    with pytest.raises(CamError) as error:
        run(tmp_path, do, **limits)
    assert error.value.code == code and server.alive() and not children(server)
    assert run(tmp_path)[0] == "proved"


def test_a_cancelled_job_ends_at_once(server, tmp_path):
    asleep = threading.Event()
    with pytest.raises(CancelledError):
        run(tmp_path, "sleep", keep=lambda: not asleep.is_set(), started=asleep.set)
    assert server.alive() and not children(server)


def test_no_secret_of_the_service_reaches_server_or_child(server, tmp_path):
    with pytest.raises(CamError, match="PYTHONPATH") as error:
        run(tmp_path, "look about")
    assert "SECRET" not in error.value.message and "PASSWORD" not in error.value.message
    assert b"0123456789" not in Path(f"/proc/{server.pid}/environ").read_bytes()


def test_the_server_has_one_thread_when_all_kernels_are_loaded(server):
    """It loads kernels while it waits; then it uses no more of the processor."""
    process = psutil.Process(server.pid)
    until = time.monotonic() + LOADING_S
    while time.monotonic() < until:
        before = process.cpu_times().user
        time.sleep(0.5)
        if process.cpu_times().user == before:
            break
    assert process.num_threads() == 1


def test_a_server_that_is_killed_takes_its_job_along_and_another_one_starts(server, tmp_path):
    found = []

    def kill():
        if not found and (found_now := children(server)):
            found.extend(found_now)
            os.kill(server.pid, signal.SIGKILL)

    with pytest.raises(ResourceError) as error:
        run(tmp_path, "sleep", started=kill)
    assert error.value.code == "job_killed" and gone(found)
    assert run(tmp_path)[0] == "proved"  # of a new interpreter, while the next server loads
    assert loaded().pid != server.pid and run(tmp_path)[0] == "proved"


def test_server_and_job_end_with_the_process_that_asked(server, tmp_path):
    code = """
        import os, sys, threading, time
        sys.path.insert(0, "tests/unit/service/jobs")
        from test_job_child import Path, children, loaded, run
        server = loaded()
        threading.Thread(target=run, args=(Path(sys.argv[1]), "sleep"), daemon=True).start()
        while not (found := children(server)):
            time.sleep(0.02)
        print(server.pid, found[0].pid, flush=True)
        time.sleep(600)
    """
    with subprocess.Popen([sys.executable, "-c", textwrap.dedent(code), str(tmp_path)], stdout=subprocess.PIPE,
                          cwd=job_child.ROOT) as asked:
        processes = [psutil.Process(int(word)) for word in asked.stdout.readline().split()]
        assert len(processes) == 2
        asked.kill()
        asked.wait()
        assert gone(processes)


def test_a_server_that_cannot_fork_says_so_and_serves_on(monkeypatch):
    def full(_path, _fds):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(fork_server, "_fork", full)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    before = len(os.listdir("/proc/self/fd"))
    serving = threading.Thread(target=fork_server._serve, args=(theirs, None))
    serving.start()
    for _ in range(2):
        (pipe, pipe_end), (status, status_end) = os.pipe(), os.pipe()
        socket.send_fds(ours, [b"request"], [pipe_end, pipe_end, status_end])
        os.close(status_end)
        assert os.read(status, 10) == b"0\n" and os.read(status, 10) == b""
        for fd in (pipe, pipe_end, status):
            os.close(fd)
    ours.close()
    serving.join(10)
    theirs.close()
    assert not serving.is_alive() and len(os.listdir("/proc/self/fd")) == before - 2
