"""STEP-NC of a proved program written in a process of its own: the same bytes, typed errors, nothing left behind."""

from __future__ import annotations

from dataclasses import replace

import pytest

from geometry.errors import InternalError, ResourceError
from service.delivery import stepnc_files as stepnc
from service.delivery.stepnc_files import stepnc_files, stepnc_under_way
from service.stages.access_plan import WrittenProgram
from tests.pocket_case import SETUP, block
from tests.synthetic_plan import BALL, line, plan, step, write_linuxcnc
from toolpath.workingsteps import TrajectoryKind


@pytest.fixture
def job():
    work = plan(step(1, BALL, "waterline"))
    return [WrittenProgram("A1", work, write_linuxcnc(work))], block(), [BALL], SETUP


@pytest.fixture
def apart(monkeypatch):
    """Every program counts as long, and there are two cores."""
    monkeypatch.setattr(stepnc, "LONG", 1)
    monkeypatch.setattr(stepnc.os, "cpu_count", lambda: 2)


def written(files):
    return {name: (kind, path.read_bytes()) for name, (kind, _, _, path) in files.items()}


def test_a_process_of_its_own_writes_the_same_bytes(job, apart, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    expected = written(stepnc_files(*job, here))
    with stepnc_under_way(*job, there) as files:
        found = files()
    assert written(found) == expected and len(expected) == 2
    assert all(path.parent == there for *_, path in found.values())


def test_short_programs_are_written_here(job, monkeypatch, tmp_path):
    monkeypatch.setattr(stepnc, "run_limited", None)
    with stepnc_under_way(*job, tmp_path) as files:
        assert not list(tmp_path.iterdir())
        assert len(files()) == 2


def test_what_nobody_waited_for_does_not_stay(job, apart, tmp_path):
    with stepnc_under_way(*job, tmp_path):
        pass
    assert not list(tmp_path.iterdir())
    with pytest.raises(ZeroDivisionError), stepnc_under_way(*job, tmp_path):
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_what_differs_from_the_program_is_no_file_there_either(job, apart, tmp_path):
    (program,), *rest = job
    moved = replace(program.work.steps[0], trajectories=(line(TrajectoryKind.CUT, (0, 0, 5), (1, 0, 5), feed=600.0),))
    with (pytest.raises(InternalError) as differs,
          stepnc_under_way([replace(program, work=plan(moved))], *rest, tmp_path) as files):
        files()
    assert differs.value.code == "stepnc_differs"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("code", ["stepnc_memory", "stepnc_timeout", "stepnc_crashed"])
def test_what_the_process_cannot_do_is_done_here(job, apart, monkeypatch, tmp_path, code):
    def fails(*_args, **_more):
        raise ResourceError("no room", code=code)

    monkeypatch.setattr(stepnc, "run_limited", fails)
    with stepnc_under_way(*job, tmp_path) as files:
        assert len(files()) == 2
    assert len(list(tmp_path.iterdir())) == 2
