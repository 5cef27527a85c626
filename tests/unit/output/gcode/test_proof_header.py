"""Figures of the proof come into headers after it, and nothing else changes."""

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InternalError
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_writer import write_program
from output.gcode.proof_header import AWAITED, LINES, WIDE, filled
from service.stages.programs import figures_of
from tests.synthetic_plan import clamped, plan
from verify.gcode.reader import read_program

JOBS = {"three axes": lambda: plan(), "restart": lambda: plan(restart=True), "five axes": lambda: clamped()}
REPORT = {"zones": [{"scallop_mm": {"p99": 0.01234}}, {"scallop_mm": {"p99": None}}], "coverage": 1.0,
          "reach_coverage": 0.99999, "gouge_max_mm": 0.00123, "remainder": [{"area_mm2": 12.25}, {"area_mm2": 0.5}],
          "time": {"in_cut_s": 5999.9}, "machining_time_s": 7200.0,
          "proof": {"error_bound_mm": 0.00212, "samples": 1234567}}


def control(name):
    return DIALECTS[name](Switches())


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("job", JOBS)
def test_nothing_but_comments_changes(job, dialect):
    work, d = replace(JOBS[job](), figures=AWAITED), control(dialect)
    text = write_program(work, d)
    done = filled(text, d, figures_of(REPORT))
    old, new = text.splitlines(), done.splitlines()
    assert len(old) == len(new) and len(done) <= len(text)
    changed = [(a, b) for a, b in zip(old, new, strict=True) if a != b]
    assert len(changed) == LINES
    mark = r"\d+ ; |; |\("
    assert all(re.match(mark, line) for pair in changed for line in pair)
    machine = work.clamping.machine.kind if work.clamping else None
    first, second = (read_program(t, dialect=dialect, **turning(machine)) for t in (text, done))
    for name in ("start", "end", "kind", "feed", "tool", "line", "speed", "coolant"):
        assert np.array_equal(getattr(first, name), getattr(second, name), equal_nan=name == "feed"), name
    assert first.remarks == second.remarks


def turning(kind):
    if kind is None:
        return {}
    from verify.kinematics import Kinematics

    pivots = clamped().clamping.machine.pivots
    return {"kinematics": Kinematics(kind, np.array(pivots)), "gauge_length": {1: 75.0, 2: 70.0}}


def test_what_is_said():
    told = figures_of(REPORT)
    assert len(told) == LINES and max(map(len, told)) <= WIDE
    said = " | ".join(told)
    for words in ("no findings", "100.00 %", "Gouge at most 0.0012 mm", "p99 at most 0.0123 mm", "1234567 samples",
                  "bound 0.0021 mm", "120.0 min, in cut 100.0 min", "12.75 mm2 in 2 entries"):
        assert words in said
    assert "no scallop to measure" in " ".join(figures_of({**REPORT, "zones": []}))


def test_large_figures_have_room():
    huge = {**REPORT, "machining_time_s": 9.99e7, "time": {"in_cut_s": 9.99e7}, "gouge_max_mm": 10.1234,
            "zones": [{"scallop_mm": {"p99": 10.1234}}], "proof": {"error_bound_mm": 10.1234, "samples": 10**12},
            "remainder": [{"area_mm2": 123456.789}] * 9999}
    for d in DIALECTS:
        filled(write_program(replace(plan(), figures=AWAITED), control(d)), control(d), figures_of(huge))


def test_labels_that_look_like_the_lines_kept_are_left_alone():
    work = replace(plan(), figures=AWAITED, labels={"order": AWAITED[0]}, name=AWAITED[1])
    for d in map(control, DIALECTS):
        text = write_program(work, d)
        assert len([1 for a, b in zip(text.splitlines(), filled(text, d, figures_of(REPORT)).splitlines(), strict=True)
                    if a != b]) == LINES


def test_no_room_is_an_error():
    d, told = control("linuxcnc"), figures_of(REPORT)
    text = write_program(replace(plan(), figures=AWAITED), d)
    for wrong in (told[1:], (*told[:-1], "x" * (WIDE + 1))):
        with pytest.raises(InternalError) as refused:
            filled(text, d, wrong)
        assert refused.value.code == "no_room"
    with pytest.raises(InternalError) as refused:
        filled(write_program(plan(), d), d, told)
    assert refused.value.code == "no_room"
