"""Values of a report that another thread computes during the proof."""

import threading

import numba
import pytest

from service.report.computed_ahead import ComputedAhead


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    monkeypatch.setattr(numba, "get_num_threads", lambda: 2)


def where():
    return threading.current_thread().name.split("_")[0]


def test_another_thread_computes_what_is_asked_for_later():
    with ComputedAhead({"a": where, "b": where}) as ahead:
        ahead.begin()
        ahead._begun["b"].result(10.0)
        assert [ahead.value(name) for name in "ab"] == ["ahead", "ahead"]


def test_what_it_has_not_begun_is_computed_by_the_thread_that_asks():
    held = threading.Event()
    with ComputedAhead({"a": lambda: held.wait(10.0), "b": where}) as ahead:
        ahead.begin()
        assert ahead.value("b") == where() != "ahead"
        held.set()
        assert ahead.value("a")


@pytest.mark.parametrize("threads", [1, 2])
def test_without_a_beginning_or_a_second_thread_values_are_computed_when_asked_for(threads, monkeypatch):
    monkeypatch.setattr(numba, "get_num_threads", lambda: threads)
    with ComputedAhead({"a": where}) as ahead:
        if threads == 1:
            ahead.begin()
        assert ahead.value("a") == where() != "ahead"


def test_an_error_is_met_by_whoever_asks_and_the_rest_is_left_at_the_end():
    done = []
    held = threading.Event()
    calls = {"a": lambda: 1 / 0, "b": lambda: held.wait(10.0), "c": lambda: done.append(1)}
    with ComputedAhead(calls) as ahead:
        ahead.begin()
        with pytest.raises(ZeroDivisionError):
            ahead.value("a")
        threading.Timer(0.2, held.set).start()
    assert not done
