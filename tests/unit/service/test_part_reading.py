"""The part of a job is read while the process that plans it still imports."""

import json
import time
from pathlib import Path
from threading import Event

import pytest

import service.part_reading as part_reading
from geometry.errors import PartError
from service.from_wire import parse_setup

SETUP = parse_setup(json.dumps({"tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3}]}))


def test_it_begins_at_once_and_hands_over_what_was_read(monkeypatch):
    begun = Event()

    def read(path, **given):
        begun.set()
        return path, given["chord"]

    monkeypatch.setattr(part_reading, "read_part", read)
    with part_reading.PartReading(Path("p.step"), SETUP) as reading:
        assert begun.wait(10.0)
        assert reading.part() == (Path("p.step"), part_reading.mesh_chord(SETUP.quality))


def test_its_error_is_met_by_whoever_asks_for_the_part(monkeypatch):
    def fails(_path, **_given):
        raise PartError("open", code="open_shell")

    monkeypatch.setattr(part_reading, "read_part", fails)
    with part_reading.PartReading(Path("p.step"), SETUP) as reading, pytest.raises(PartError):
        reading.part()


def test_a_job_that_fails_earlier_stops_it(monkeypatch):
    stopped = []

    def slow(_path, *, stop, **_given):
        stopped.append(stop.wait(10.0))

    monkeypatch.setattr(part_reading, "read_part", slow)
    begun = time.monotonic()
    with pytest.raises(ZeroDivisionError), part_reading.PartReading(Path("p.step"), SETUP):
        raise ZeroDivisionError
    assert stopped == [True] and time.monotonic() - begun < 5.0
