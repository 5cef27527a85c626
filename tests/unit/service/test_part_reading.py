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


def test_where_passes_are_planned_the_same_process_reads_the_faces_behind_the_part(monkeypatch):
    go_on = Event()

    def both(path, then, *, flat, **given):
        then((path, given["chord"], flat))
        go_on.wait(10.0)
        raise PartError("killed", code="reader_crashed")

    monkeypatch.setattr(part_reading, "read_part_and_faces", both)
    with part_reading.PartReading(Path("p.step"), SETUP, planned=True) as reading:
        assert reading.part() == (Path("p.step"), part_reading.mesh_chord(SETUP.quality), False)
        go_on.set()
        assert reading.faces() is None  # whoever needs them reads them alone, and meets the error


def test_an_error_before_the_part_is_met_by_whoever_asks_for_it(monkeypatch):
    def fails(*_, **__):
        raise PartError("open", code="open_shell")

    monkeypatch.setattr(part_reading, "read_part_and_faces", fails)
    with part_reading.PartReading(Path("p.step"), SETUP, planned=True) as reading, pytest.raises(PartError):
        reading.part()
