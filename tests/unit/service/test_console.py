"""What the command line shows while it works."""

import re
import time

import pytest

from service.console import Progress


def wait_for(capsys, lines):
    """Lines on stderr, as soon as there are so many."""
    text = ""
    for _ in range(400):
        text += capsys.readouterr().err
        if len(text.splitlines()) >= lines:
            return text.splitlines()
        time.sleep(0.01)
    raise AssertionError(f"no {lines} lines, but {text!r}")


def test_a_long_stage_is_shown_again(capsys):
    progress = Progress(every_s=0.02)
    progress("plan", 0.3)
    try:
        lines = wait_for(capsys, 4)
    finally:
        progress.close()
    assert all(re.fullmatch(r" +\d+\.\d s   30 %  plan", line) for line in lines)


def test_a_stage_is_shown_once_where_it_is_short(capsys):
    progress = Progress(every_s=60.0)
    for stage, share in (("read", 0.0), ("read", 0.1), ("zones", 0.12), ("zones", 0.2)):
        progress(stage, share)
    progress.close()
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("s  ")[1].strip() for line in lines] == ["0 %  read", "12 %  zones"]


@pytest.mark.parametrize("used", [False, True])
def test_it_can_be_closed_twice(used, capsys):
    progress = Progress(every_s=60.0)
    if used:
        progress("read", 0.0)
    progress.close()
    progress.close()
    assert len(capsys.readouterr().err.splitlines()) == int(used)
