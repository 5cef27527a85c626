"""STEP-NC of a proved program written in a process of its own: the same bytes, typed errors, nothing left behind."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from geometry.errors import InternalError, ResourceError
from output.gcode.proof_header import AWAITED, LINES
from output.stepnc.part21 import with_proof
from service.delivery import stepnc_files as stepnc
from service.delivery.stepnc_files import StepncUnderWay, stepnc_files
from service.delivery.written_program import WrittenProgram
from tests.pocket_case import SETUP, block
from tests.synthetic_plan import BALL, line, plan, step, write_linuxcnc
from toolpath.workingsteps import TrajectoryKind

FIGURES = tuple(f"Figure {k} of the proof, it's {k} mm" for k in range(LINES))


@pytest.fixture
def job():
    work = replace(plan(step(1, BALL, "waterline")), figures=AWAITED)
    return [WrittenProgram("A1", work, write_linuxcnc(work))], block(), [BALL], SETUP


@pytest.fixture
def apart(monkeypatch):
    """Every program counts as long, and there are two cores."""
    monkeypatch.setattr(stepnc, "LONG", 1)
    monkeypatch.setattr(stepnc.os, "cpu_count", lambda: 2)


def delivered(job):
    return [replace(p, work=replace(p.work, figures=FIGURES)) for p in job[0]]


def written(files):
    return {name: (kind, path.read_bytes()) for name, (kind, _, _, path) in files.items()}


def test_a_process_of_its_own_writes_the_same_bytes(job, apart, tmp_path):
    """The figures of the proof are filled in afterwards, as if they had been known."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    expected = written(stepnc_files(delivered(job), *job[1:], here))
    with StepncUnderWay(there) as under_way:
        under_way.begin(*job)
        found = under_way.files(job[0], delivered(job), *job[1:])
    assert written(found) == expected and len(expected) == 2
    assert all(b"it''s 3 mm" in text and b"not made yet" not in text for _, text in expected.values())
    assert all(path.parent == there for *_, path in found.values())
    assert len(list(there.iterdir())) == 2


def test_short_programs_are_written_here(job, monkeypatch, tmp_path):
    monkeypatch.setattr(stepnc, "run_limited", None)
    with StepncUnderWay(tmp_path) as under_way:
        under_way.begin(*job)
        assert not list(tmp_path.iterdir())
        assert len(under_way.files(job[0], delivered(job), *job[1:])) == 2


@pytest.mark.parametrize("least", [1, 10**9])
def test_a_process_that_waits_takes_shorter_programs(job, monkeypatch, tmp_path, least):
    monkeypatch.setattr(stepnc, "SOON", 0.0)
    monkeypatch.setattr(stepnc, "LESS_LONG", least)
    monkeypatch.setattr(stepnc.os, "cpu_count", lambda: 2)
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    started, requests = threading.Event(), []
    run = stepnc.run_limited

    def noted(command, request, **more):
        started.set()
        requests.append(request)
        return run(command, request, **more)

    monkeypatch.setattr(stepnc, "run_limited", noted)
    with StepncUnderWay(there) as under_way:
        under_way.expect()
        assert started.wait(60.0)
        under_way.begin(*job)
        found = written(under_way.files(job[0], delivered(job), *job[1:]))
    assert found == written(stepnc_files(delivered(job), *job[1:], here))
    assert [request.done() for request in requests] == [least == 1]


def test_planning_that_ends_soon_starts_no_process(job, monkeypatch, tmp_path):
    monkeypatch.setattr(stepnc, "run_limited", None)
    monkeypatch.setattr(stepnc.os, "cpu_count", lambda: 2)
    with StepncUnderWay(tmp_path) as under_way:
        under_way.expect()
        under_way.begin(*job)
        assert len(under_way.files(job[0], delivered(job), *job[1:])) == 2


def test_what_nobody_took_does_not_stay(job, apart, tmp_path):
    with StepncUnderWay(tmp_path) as under_way:
        under_way.begin(*job)
    assert not list(tmp_path.iterdir())
    with pytest.raises(ZeroDivisionError), StepncUnderWay(tmp_path) as under_way:
        under_way.begin(*job)
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


def test_what_was_begun_for_an_earlier_plan_is_not_delivered(job, apart, tmp_path):
    (program,), *rest = job
    moved = replace(program.work.steps[0], trajectories=(line(TrajectoryKind.CUT, (0, 0, 5), (1, 0, 5), feed=600.0),))
    other = replace(plan(moved), figures=AWAITED)
    with StepncUnderWay(tmp_path) as under_way:
        under_way.begin(*job)
        under_way.begin([WrittenProgram("A1", other, write_linuxcnc(other))], *rest)
        found = written(under_way.files(job[0], delivered(job), *rest))
    assert found == written(stepnc_files(delivered(job), *rest, tmp_path))


def test_what_differs_from_the_program_is_no_file_there_either(job, apart, tmp_path):
    (program,), *rest = job
    moved = replace(program.work.steps[0], trajectories=(line(TrajectoryKind.CUT, (0, 0, 5), (1, 0, 5), feed=600.0),))
    wrong = [replace(program, work=replace(plan(moved), figures=AWAITED))]
    with pytest.raises(InternalError) as differs, StepncUnderWay(tmp_path) as under_way:
        under_way.begin(wrong, *rest)
        under_way.files(wrong, delivered(job), *rest)
    assert differs.value.code == "stepnc_differs"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("code", ["stepnc_memory", "stepnc_timeout", "stepnc_crashed"])
def test_what_the_process_cannot_do_is_done_here(job, apart, monkeypatch, tmp_path, code):
    def fails(*_args, **_more):
        raise ResourceError("no room", code=code)

    monkeypatch.setattr(stepnc, "run_limited", fails)
    with StepncUnderWay(tmp_path) as under_way:
        under_way.begin(*job)
        assert len(under_way.files(job[0], delivered(job), *job[1:])) == 2
    assert len(list(tmp_path.iterdir())) == 2


def test_a_header_without_room_for_the_figures_is_a_bug_not_a_file(job):
    with pytest.raises(InternalError, match="do not fit") as refusal:
        with_proof("FILE_DESCRIPTION(('zonemill'),'2;1');\n", FIGURES)
    assert refusal.value.code == "no_room"
