"""When a job begins: alone always, beside others where there is room, after those that came before it."""

import json
import threading

import pytest

from geometry.errors import CapacityError, ResourceError
from service.estimate import memory_room
from service.estimate.estimate import WAITING, Estimate, Share
from service.estimate.machine_memory import MachineMemory
from service.estimate.memory_room import MemoryRoom, Other, may_begin

GB = 1_000_000_000


def estimate(memory_mb):
    return Estimate(memory_mb, 10.0, (Share("program and libraries", 1, 500, 5.0),
                                      Share("samples of the proof", 1000, memory_mb - 500, 5.0)))


def room(folder, total=8 * GB, free=8 * GB, **given):
    return MemoryRoom(folder=folder, memory=lambda: MachineMemory(total, free), **given)


def silent(_stage, _share):
    pass


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(memory_room, "POLL_S", 0.01)


def test_alone_it_begins_whatever_is_free():
    assert may_begin(5.0, 4 * GB, 0, [])
    assert may_begin(5.0, 4 * GB, 0, [Other(6.0, False, GB, 0)])  # who came later does not count


def test_beside_others_what_they_will_still_take_is_not_free():
    running = Other(1.0, True, 3 * GB, 1 * GB)
    assert running.ahead == 2 * GB
    assert may_begin(5.0, 4 * GB, 6 * GB, [running])
    assert not may_begin(5.0, 4 * GB, 6 * GB - 1, [running])
    assert may_begin(5.0, 4 * GB, 4 * GB, [Other(1.0, True, 3 * GB, 4 * GB)])  # more than estimated: no debt


def test_a_large_job_that_waits_is_not_passed_by_small_ones():
    waits = Other(1.0, False, 6 * GB, 0)
    runs = Other(0.0, True, 3 * GB, 3 * GB)
    assert not may_begin(5.0, 1 * GB, 5 * GB, [runs, waits])
    assert may_begin(0.5, 1 * GB, 5 * GB, [runs, waits])  # it came first


@pytest.mark.parametrize(("given", "limit", "remedy"), [
    ({}, 8000, "a machine with more memory"),
    ({"cap_mb": 3000}, 3000, "raise ZONEMILL_MEMORY_MB;"),
    ({"cap_mb": 3000, "limit_mb": 2000}, 2000, "raise ZONEMILL_JOB_MEMORY_LIMIT_MB;")])
def test_a_job_that_the_machine_is_too_small_for_is_refused_with_words(tmp_path, given, limit, remedy):
    with pytest.raises(CapacityError) as refused:
        room(tmp_path, **given).enter(estimate(8001), silent)
    error = refused.value
    assert (error.code, error.measured, error.limit) == ("machine_too_small", 8001, limit)
    assert error.subjects == ("samples of the proof",) and remedy in error.remedy
    assert "8001 MB" in error.message and f"{limit} MB" in error.message
    room(tmp_path, **given).check(estimate(limit))


def test_the_second_waits_for_the_first_and_says_so(tmp_path, quick):
    first, second = room(tmp_path, cap_mb=3000), room(tmp_path, cap_mb=3000)
    first.enter(estimate(2900), silent)
    said, waits, begun = [], threading.Event(), threading.Event()

    def heard(stage, share):
        said.append((stage, share))
        waits.set()

    def enter():
        second.enter(estimate(2900), heard)
        begun.set()

    thread = threading.Thread(target=enter)
    thread.start()
    assert waits.wait(30) and not begun.is_set()
    first.leave()
    thread.join(30)
    assert begun.is_set() and set(said) == {(WAITING, 0.0)}
    second.leave()
    assert not list(tmp_path.glob("*.json"))


def test_two_that_fit_run_side_by_side(tmp_path):
    rooms = [room(tmp_path), room(tmp_path)]
    for one in rooms:
        one.enter(estimate(2000), lambda *_: pytest.fail("waits"))
    for one in rooms:
        one.leave()


def test_the_wait_is_bounded(tmp_path, quick):
    first, second = room(tmp_path, free=0), room(tmp_path, free=0, wait_s=0.05)
    first.enter(estimate(7900), silent)  # alone: nothing is free, and it begins
    with pytest.raises(ResourceError) as busy:
        second.enter(estimate(7900), silent)
    assert busy.value.code == "memory_busy" and busy.value.measured == 7900
    first.leave()
    assert not list(tmp_path.glob("*.json"))


def test_a_process_that_died_takes_no_room(tmp_path):
    tmp_path.joinpath("1-1.json").write_text(json.dumps({"pid": 1, "since": 0, "running": True, "memory": 8 * GB}))
    one = room(tmp_path, free=0)
    one.enter(estimate(7900), lambda *_: pytest.fail("waits"))
    assert len(list(tmp_path.glob("*.json"))) == 1
    one.leave()


def test_where_no_file_can_be_written_a_job_begins(tmp_path):
    (tmp_path / "file").write_text("")
    one = room(tmp_path / "file" / "folder", free=0)
    one.enter(estimate(2000), lambda *_: pytest.fail("waits"))
    one.leave()
