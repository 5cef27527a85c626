"""Plans in parts no larger than a control takes."""

from __future__ import annotations

import pytest

from geometry.errors import OutputError
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_splitting import parts_of
from output.gcode.program_writer import write_program
from tests.synthetic_plan import clamped, plan
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

ALL = [d(Switches()) for d in DIALECTS.values()]


def largest(work):
    return max(len(write_program(work, d)) for d in ALL)


@pytest.mark.parametrize("work", [plan(), clamped()], ids=["three axes", "five axes"])
@pytest.mark.parametrize("share", [0.99, 0.7, 0.5])
def test_parts_are_small_and_hold_all_steps_in_order(work, share):
    alone = max(largest(part) for part in parts_of(work, ALL, largest(work)))
    limit = max(int(share * largest(work)), int(1.01 * max(
        largest(type(work)(**{**work.__dict__, "steps": (s,)})) for s in work.steps)))
    parts = parts_of(work, ALL, limit)
    assert len(parts) > 1 and alone == largest(work)
    assert [s.id for p in parts for s in p.steps] == [s.id for s in work.steps]
    assert all(largest(p) <= limit for p in parts)
    assert [p.name for p in parts] == [f"demo part {k} of {len(parts)}" for k in range(1, len(parts) + 1)]
    for a, b in zip(parts, parts[1:], strict=False):  # where it can be, at a change of the tool
        tools = [s.tool for s in a.steps]
        assert a.steps[-1].tool != b.steps[0].tool or len({t.id for t in tools}) == 1


def test_every_part_is_a_program_of_its_own():
    work = clamped()
    machine = Kinematics(work.clamping.machine.kind, work.clamping.machine.pivots)
    whole = read_program(write_program(work, ALL[0]), kinematics=machine)
    parts = [read_program(write_program(p, ALL[0]), kinematics=machine)
             for p in parts_of(work, ALL, int(0.99 * largest(work)))]
    assert not any(p.remarks for p in parts)
    feeds = [p.end[p.kind == 1].tolist() for p in parts]
    assert [e for f in feeds for e in f] == whole.end[whole.kind == 1].tolist()


def test_what_fits_stays_one_and_a_step_too_large_is_named():
    work = plan()
    assert parts_of(work, ALL, largest(work)) == [work]
    with pytest.raises(OutputError) as refused:
        parts_of(work, ALL, 1000)
    assert refused.value.code == "program_too_large" and refused.value.limit == 1000
