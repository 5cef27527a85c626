"""The hook that checks commit subjects, and the script that installs it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.source_tree import ROOT

HOOK = ROOT / ".ci" / "hooks" / "commit-msg"
pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command in a folder, with no configuration of git but the folder's own."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("GIT_")}
    names = {f"GIT_{who}_{what}": value for who in ("AUTHOR", "COMMITTER")
             for what, value in (("NAME", "Test"), ("EMAIL", "test@example.org"))}
    own = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull, **names}
    return subprocess.run(words, cwd=folder, env=kept | own, capture_output=True, text=True, timeout=30)


def checked(folder: Path, message: str) -> subprocess.CompletedProcess[str]:
    (folder / "message").write_text(message, encoding="utf-8")
    return run(folder, str(HOOK), "message")


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A repository that holds the hook and its installer."""
    root = tmp_path / "clone"
    shutil.copytree(ROOT / ".ci" / "hooks", root / ".ci" / "hooks")
    shutil.copy2(ROOT / ".ci" / "install-hooks", root / ".ci")
    run(root, "git", "init", "-q")
    return root


def commit(folder: Path, subject: str) -> int:
    return run(folder, "git", "commit", "-q", "--allow-empty", "-m", subject).returncode


@pytest.mark.parametrize("message", [
    "zones: split a region at its narrowest gap",
    "toolpath/stock, verify: keep 0.1 mm\n\nThe body may be as long as it likes, " + "x" * 200,
    "docs: " + "ä" * 66,
    "\n# a comment first\nmake: run the checks",
    "Merge branch 'main' into a branch with quite a long name, longer than seventy-two characters",
    'Revert "zones: split a region at its narrowest gap, which has quite a long subject of its own"',
    "fixup! zones: split a region",
])
def test_a_subject_of_the_right_form_passes(tmp_path, message):
    result = checked(tmp_path, message)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize(("message", "reason"), [
    ("docs: " + "x" * 67, "73 characters"),
    ("docs: " + "ä" * 67, "73 characters"),
    ("Fix the thing", "module and a colon"),
    ("zones:no space", "module and a colon"),
    ("zones: ", "module and a colon"),
    (": nothing before", "module and a colon"),
    ("# only a comment\n", "module and a colon"),
    ("", "module and a colon"),
])
def test_any_other_subject_is_refused_with_the_reason(tmp_path, message, reason):
    result = checked(tmp_path, message)
    assert result.returncode == 1
    assert reason in result.stderr and "module: imperative summary" in result.stderr


def test_the_installed_hook_refuses_and_accepts_commits(clone):
    assert run(clone, ".ci/install-hooks").returncode == 0
    assert commit(clone, "no module here") == 1
    assert commit(clone, "zones: split a region") == 0


def test_a_commit_without_the_check_can_still_be_built_upon(clone):
    run(clone, ".ci/install-hooks")
    shutil.rmtree(clone / ".ci")
    assert commit(clone, "no module here") == 0


def test_installing_twice_changes_nothing_and_a_hook_of_ones_own_stays(clone):
    own = clone / ".git" / "hooks" / "commit-msg"
    own.parent.mkdir(exist_ok=True)
    own.write_text("#!/bin/sh\nexit 0\n")
    assert run(clone, ".ci/install-hooks").returncode == 0
    assert own.read_text() == "#!/bin/sh\nexit 0\n"


def test_another_folder_of_hooks_stays_as_it_is(clone):
    (clone / "mine").mkdir()
    run(clone, "git", "config", "core.hooksPath", "mine")
    assert run(clone, ".ci/install-hooks").returncode == 0
    assert not list((clone / "mine").iterdir()) and not (clone / ".git" / "hooks" / "commit-msg").exists()


def test_an_unpacked_archive_and_a_folder_of_another_repository_are_left_alone(clone, tmp_path):
    shutil.rmtree(clone / ".git")
    assert run(clone, ".ci/install-hooks").returncode == 0
    run(tmp_path, "git", "init", "-q")
    assert run(clone, ".ci/install-hooks").returncode == 0
    assert not (tmp_path / ".git" / "hooks" / "commit-msg").exists()


def test_a_folder_that_cannot_be_written_does_not_fail_the_set_up(clone):
    shutil.rmtree(clone / ".git" / "hooks", ignore_errors=True)
    (clone / ".git" / "hooks").write_text("no folder")
    result = run(clone, ".ci/install-hooks")
    assert (result.returncode, result.stderr) == (0, "")
