"""What is left behind where a child cannot be started, and what counts for the limit of time."""

import os
import subprocess
import sys

import pytest

from service.estimate.estimate import WAITING
from service.jobs.supervisor import ProcessLimits, supervise


def test_a_child_that_cannot_be_started_leaves_no_open_file(tmp_path, monkeypatch):
    def full(*_, **__):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(subprocess, "Popen", full)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        with pytest.raises(BlockingIOError):
            supervise({}, ProcessLimits(1, 1), tmp_path, on_progress=lambda *_: None, on_resumed=lambda _: None,
                      on_estimate=lambda _: None, keep=lambda: True)
    assert len(os.listdir("/proc/self/fd")) == before and not list(tmp_path.iterdir())


def test_the_time_that_a_child_waits_for_memory_does_not_count(tmp_path, monkeypatch):
    code = f"""
import json, os, sys, time
def say(**message):
    os.write(int(sys.argv[2]), (json.dumps(message) + chr(10)).encode())
say(stage="{WAITING}", progress=0.0)
time.sleep(7.0)
say(stage="zones", progress=0.1)
say(estimate=dict(memory_mb=7, seconds=1.0, basis=[]))
say(state="proved")
"""
    start = subprocess.Popen

    def started(command, **given):
        return start([sys.executable, "-c", code, *command[command.index("service.jobs.job_process") + 1:]], **given)

    monkeypatch.setattr(subprocess, "Popen", started)
    stages, estimates = [], []
    state = supervise({}, ProcessLimits(5.0, 10**9), tmp_path, on_progress=lambda stage, _: stages.append(stage),
                      on_resumed=lambda _: None, on_estimate=estimates.append, keep=lambda: True)
    assert state == "proved" and WAITING in stages and [e["memory_mb"] for e in estimates] == [7]
