"""The dispatcher between database and scheduler, without either."""

import time

import pytest

from service.errors import UnavailableError
from service.jobs.engine import ENDLESS_GRACE_S, Engine
from service.settings import Settings


class Scheduler:
    """A client whose scheduler answers with so many slots, or not at all."""

    def __init__(self, slots=None):
        self.slots, self.closed = slots, False
        self.scheduler = self

    def ncores(self):
        return {"worker": self.slots}

    def sync(self, ask, callback_timeout):
        if self.slots is None:
            raise TimeoutError(f"timed out after {callback_timeout} s")
        return ask()

    def close(self, timeout):
        self.closed = True


@pytest.fixture
def engine(tmp_path):
    return Engine(Settings(data_dir=tmp_path, scheduler="tcp://127.0.0.1:1", lease_s=5))


def test_a_client_that_gets_no_answer_is_thrown_away_and_the_next_look_makes_another(engine, monkeypatch):
    mute = engine._client = Scheduler()
    engine._slots, engine._slots_at = 2, time.monotonic()
    assert engine.capacity() == 2
    with pytest.raises(UnavailableError):
        engine._look()
    assert engine.capacity() == 0 and engine._client is None
    monkeypatch.setattr(engine, "_open_client", lambda: setattr(engine, "_client", Scheduler(3)))
    assert engine._look() == 3 == engine.capacity()
    deadline = time.monotonic() + 120
    while not mute.closed and time.monotonic() < deadline:
        time.sleep(0.01)
    assert mute.closed


def test_what_was_not_seen_for_a_while_is_not_told(engine):
    engine._slots, engine._slots_at = 2, time.monotonic() - 60
    assert engine.capacity() == 0


@pytest.mark.parametrize("by_s", [3600, -3600])
def test_for_a_lease_after_the_clock_was_set_no_lease_counts_as_run_out(engine, monkeypatch, by_s):
    clock, elapsed = time.time, time.monotonic
    assert engine._lease_grace_s() == 0.0
    monkeypatch.setattr(time, "time", lambda: clock() + by_s)
    assert engine._lease_grace_s() == ENDLESS_GRACE_S == engine._lease_grace_s()
    monkeypatch.setattr(time, "time", lambda: clock() + by_s + 6)
    monkeypatch.setattr(time, "monotonic", lambda: elapsed() + 6)
    assert engine._lease_grace_s() == 0.0
