"""Planted faults, the everyday share of ``benchmarks/fault_table.py``: every kind, found where it is and as deep.

Whether a fault is one, on which line and how deep, is said by the benchmark's brute-force twin. The dome and the cone,
whose proofs take seconds each, are for the benchmark.
"""

from __future__ import annotations

import pytest

from benchmarks.fault_kinds import KINDS
from benchmarks.fault_table import PARTS, clean, run, uncovered

SEEDS = {"pocket": (0, 1), "walls": (0, 1), "house": (0,)}
KNOWN = [k for k in KINDS if k != "duplicated zone"]  # feed moves that take no stock a second time are not told yet


@pytest.mark.parametrize("part", PARTS)
def test_the_programs_that_faults_are_planted_into_are_clean(part):
    assert clean(part, 0) == []


@pytest.mark.parametrize("kind", KNOWN)
def test_a_planted_fault_is_found_on_its_line_and_as_deep(kind):
    for part, seeds in SEEDS.items():
        for seed in seeds:
            o = run(kind, part, seed)
            assert o.drawn and o.found and o.line and o.depth, o


@pytest.mark.slow
@pytest.mark.parametrize("kind", KNOWN)
def test_a_fault_of_a_wave_is_found_on_its_line_and_as_deep(kind):
    o = run(kind, "wave", 0)
    assert o.drawn and o.found and o.line and o.depth, o


@pytest.mark.parametrize("part", ["walls", "house"])
def test_passes_left_out_cost_coverage(part):
    right, told = uncovered(part, 0)
    assert right, told
