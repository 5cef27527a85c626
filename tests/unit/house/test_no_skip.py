"""A skip that CI forbids is a failure, in a test as in a module."""

import os
import subprocess
import sys

import pytest

from tests.source_tree import ROOT

MODULE = 'import pytest\npytest.importorskip("no_such_module")\n\n\ndef test_nothing():\n    pass\n'
FUNCTION = ('import pytest\n\n\ndef test_one():\n    pytest.importorskip("no_such_module")\n\n\n'
            'def test_two():\n    pass\n\n\n@pytest.mark.skip(reason="no_such_module")\ndef test_three():\n    pass\n')


def run(folder, text, words):
    (folder / "test_it.py").write_text(text)
    env = {**os.environ, "ZONEMILL_NO_SKIP": words, "PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "tests.no_skip", "-p", "no:cacheprovider",
                           "--rootdir", str(folder), str(folder)], capture_output=True, text=True, env=env, cwd=folder)


@pytest.mark.parametrize("words", ["", "cadquery"])
def test_other_skips_stay_skips(tmp_path, words):
    got = run(tmp_path, FUNCTION, words)
    assert got.returncode == 0 and "1 passed, 2 skipped" in got.stdout


def test_a_forbidden_skip_of_a_test_fails(tmp_path):
    got = run(tmp_path, FUNCTION, "cadquery,no_such_module")
    assert got.returncode == 1 and "1 failed, 1 passed, 1 error" in got.stdout  # marks speak at set-up
    assert "ZONEMILL_NO_SKIP forbids it for no_such_module" in got.stdout


def test_a_forbidden_skip_of_a_module_fails(tmp_path):
    got = run(tmp_path, MODULE, "no_such_module")
    assert got.returncode != 0 and "1 error" in got.stdout and "ZONEMILL_NO_SKIP forbids it" in got.stdout
