"""What is left behind where a child cannot be started."""

import os
import subprocess

import pytest

from service.jobs.supervisor import ProcessLimits, supervise


def test_a_child_that_cannot_be_started_leaves_no_open_file(tmp_path, monkeypatch):
    def full(*_, **__):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(subprocess, "Popen", full)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        with pytest.raises(BlockingIOError):
            supervise({}, ProcessLimits(1, 1), tmp_path, on_progress=lambda *_: None, on_resumed=lambda _: None,
                      keep=lambda: True)
    assert len(os.listdir("/proc/self/fd")) == before and not list(tmp_path.iterdir())
