"""Planted faults, the everyday share of ``benchmarks/fault_table.py``: every kind on every part, found where it is.

Whether a fault is a fault, on which line and how deep, is said by the benchmark's brute-force twin. Known gaps are
listed with what is missing; each must still be missed, so that closing one is noticed here.
"""

from __future__ import annotations

import pytest

from benchmarks.fault_kinds import KINDS
from benchmarks.fault_table import PARTS, clean, run, uncovered

SEEDS = (1, 2)
QUICK = ("pocket", "walls", "house")  # seconds of the whole lie in the twin, not in the proof
SLOW_KINDS = {"wrong tool", "holder touch", "shank touch", "missing retract"}
GAPS = {"duplicated zone": "runs of feed moves that take no stock are not told"}


@pytest.mark.parametrize("part", PARTS)
def test_the_programs_that_faults_are_planted_into_are_clean(part):
    assert clean(part, SEEDS[0]) == []


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in GAPS])
def test_a_planted_fault_is_found_on_its_line_and_as_deep(kind):
    for k, part in enumerate(PARTS):
        if kind in SLOW_KINDS and part not in QUICK:
            continue
        for seed in SEEDS if part in QUICK else SEEDS[:1]:
            o = run(kind, part, seed)
            assert not o.drawn or (o.found and o.line and o.depth), (k, o)


def test_most_draws_are_faults():
    """The table is no table of nothing: on the parts with arcs and walls every kind can be drawn."""
    assert all(run(kind, "walls", SEEDS[0]).drawn for kind in KINDS if kind not in SLOW_KINDS)


@pytest.mark.parametrize("part", ["walls", "house"])
def test_passes_left_out_cost_coverage(part):
    right, told = uncovered(part, SEEDS[0])
    assert right, told
