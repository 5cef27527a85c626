"""Passes that run again: a spring pass is a note, a layer or a program pasted twice is a finding."""

import numpy as np
import pytest

from verify.checks.repeated_passes import repeats
from verify.findings import Source
from verify.model import FindingKind
from verify.moves import Moves

RING = [(0, 0), (9, 0), (10, 1), (10, 9), (9, 10), (1, 10), (0, 9), (0, 1), (-1, 0), (0, 0)]
LIFT = [(0, 0, 5, 0), (0, 0, 0, 1)]
"""Up in a rapid and down in a feed move: x, y, z, whether it feeds."""
ROWS = [(x, y, -1, 1) for y in range(20, 32, 2) for x in ((0, 30) if y % 4 else (30, 0))]


def ring(z=0):
    return [(x, y, z, 1) for x, y in RING]


def judged(places, cutting, finishing=()):
    """Places as above, one to a line; rows of moves that cut, and of those that leave finished ground."""
    points = np.array([(0, 0, 0), *(p[:3] for p in places)], dtype=np.float64)
    feed = np.array([bool(p[3]) for p in places])
    n = len(places)
    moves = Moves(points[:-1], points[1:], feed, np.zeros(n, np.int32))
    source = Source(("p",), np.zeros(n, np.int32), np.arange(1, n + 1, dtype=np.int32), np.ones(n, np.int32))
    cut, done = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    cut[list(cutting)], done[list(finishing)] = True, True
    return repeats(moves, cut, source, done)


@pytest.mark.parametrize("between", [[], LIFT], ids=["at once", "after a lift"])
def test_a_spring_pass_over_finished_ground_is_a_note(between):
    findings, notes = judged([*ROWS, (0, 0, 0, 1), *ring()[1:], *between, *ring()[1:]], range(22), range(13, 22))
    assert findings == [] and len(notes) == 1 and "over finished ground" in notes[0]
    first = 23 + len(between)
    assert f"lines {first} to {first + 8} repeat lines 14 to 22" in notes[0]


def test_a_pass_over_ground_that_is_not_finished_is_a_finding():
    """A layer that later lines cut deeper leaves no finished place."""
    places = [(50, 0, 0, 1)] * 9 + [*ROWS, (0, 20, 5, 0), *ROWS]
    findings, notes = judged(places, range(9 + len(ROWS)))
    (found,) = findings
    assert found.kind is FindingKind.PROGRAM and "remove no stock" in found.message and notes == []


def test_a_program_pasted_twice_is_a_finding_though_its_ground_is_finished():
    once = [(0, 0, 0, 1), *ring()[1:], *LIFT[:1], *ROWS, (0, 0, 5, 0)]
    findings, notes = judged([*once, *once], range(len(once)), range(len(once)))
    assert len(findings) == 2 and notes == []
    more = [(60, k, 0, 1) for k in range(10)]
    findings, notes = judged([*more, (0, 0, 5, 0), *once, *once], range(11 + len(once)), range(11 + len(once)))
    assert findings == [] and len(notes) == 2, "two passes of many, run again"


def test_a_program_of_one_ring_may_have_its_spring_pass():
    findings, notes = judged([(0, 0, 0, 1), *ring()[1:], *LIFT, *ring()[1:]], range(10), range(10))
    assert findings == [] and len(notes) == 1


def test_what_still_cuts_is_no_repeat():
    places = [*ring(), *LIFT, *ring()]
    assert judged(places, range(len(places)), range(10)) == ([], [])


def test_a_zone_of_several_levels_that_runs_again_is_a_finding():
    zone = [*ring(0)[1:], *ring(-2), *ring(-4)]
    places = [(0, 0, 0, 1), *zone, (0, 0, 5, 0), (60, 0, 0, 1), *[(60, k, 0, 1) for k in range(1, 10)], (0, 0, 5, 0),
              (0, 0, 0, 1), *zone]
    findings, notes = judged(places, range(len(zone) + 12), range(len(zone) + 12))
    assert len(findings) == 1 and notes == []
