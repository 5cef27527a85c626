"""Planted faults, the everyday share of ``benchmarks/faults/fault_table.py``: every kind, found where it is and as
deep.

Whether a fault is one, on which line and how deep, is said by the benchmark's brute-force twin, which takes its time:
every day the right pocket alone, faults and other parts in the slow set; dome and cone are for the benchmark.
"""

from __future__ import annotations

import pytest

from benchmarks.faults.fault_kinds import KINDS
from benchmarks.faults.fault_table import PARTS, clean, run, uncovered

SLOW = [pytest.param(part, marks=pytest.mark.slow) for part in PARTS if part != "pocket"]


@pytest.mark.parametrize("part", ["pocket", *SLOW])
def test_the_programs_that_faults_are_planted_into_are_clean(part):
    assert clean(part, 0) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k for k in KINDS if k != "shank touch"])  # the twin leaves stock over the part out
def test_a_planted_fault_is_found_on_its_line_and_as_deep(kind):
    o = run(kind, "pocket", 0)
    assert o.drawn and o.found and o.line and o.depth, o


@pytest.mark.slow
@pytest.mark.parametrize("part", ["walls", "house"])
def test_passes_left_out_cost_coverage(part):
    right, told = uncovered(part, 0)
    assert right, told
