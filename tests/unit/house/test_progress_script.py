"""What make shows of a long command: that it goes on, and everything it wrote if it fails."""

import os
import re
import subprocess
import sys

from tests.source_tree import ROOT

SCRIPT = ROOT / ".ci" / "progress.py"
PIP_LIKE = ("import time; print('Collecting a==1', flush=True); print('Collecting b==2', flush=True); "
            "time.sleep(1.5); print('Installing collected packages: a, b', flush=True)")


def run(*arguments, every="0.3"):
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, arguments)], capture_output=True, text=True,
                          env={**os.environ, "PROGRESS_EVERY_S": every}, timeout=60)


def test_a_long_command_shows_time_packages_and_its_latest_line(tmp_path):
    lock = tmp_path / "some.lock"
    lock.write_text("a==1\nb==2\nc==3\n")
    got = run("--of", lock, "installing some.lock", sys.executable, "-c", PIP_LIKE)
    lines = got.stderr.splitlines()
    assert got.returncode == 0 and got.stdout == ""
    assert lines[0] == "installing some.lock" and re.fullmatch(r"  done after \d+ s", lines[-1])
    assert any(re.fullmatch(r" +\d+ s  2 of 3  Collecting b==2", line) for line in lines)


def test_a_short_command_shows_label_and_end_alone():
    got = run("making a folder", sys.executable, "-c", "print('chatter')", every="30")
    assert len(got.stderr.splitlines()) == 2 and "chatter" not in got.stderr


def test_a_command_that_fails_shows_all_it_wrote_and_its_exit_code():
    got = run("failing", sys.executable, "-c", "import sys; print('one'); print('two', file=sys.stderr); sys.exit(4)")
    assert got.returncode == 4 and "failed with 4" in got.stderr
    assert {"one", "two"} <= set(got.stderr.splitlines())


def test_a_command_that_does_not_exist_is_named():
    got = run("starting", "no-such-program")
    assert got.returncode == 127 and "no-such-program: No such file or directory" in got.stderr


def test_every_command_of_setup_that_takes_long_is_shown():
    lines = [line.strip() for line in (ROOT / "Makefile").read_text().replace("\\\n", " ").splitlines()]
    slow = re.compile(r"\$\(INSTALL\) -|\bpip \$\(PIP_OPTIONS\) -|\bnpm --prefix|-m venv ")
    long = [line for line in lines if slow.search(line) and not re.match(r"\w+ =", line)]
    assert len(long) >= 10 and all("$(SHOW)" in line for line in long)
    assert not [line for line in lines if re.search(r"pip install -q|npm ci --loglevel=error", line)]
