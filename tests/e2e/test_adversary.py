"""A shard of ``benchmarks/adversary``: harmful programs by mechanism are not called proved, good ones are not refused.

The generator states what does harm, on which line and how deep. A brute-force twin confirms its closed forms.
``ADVERSARY_SEEDS`` (FROM:TO) names another shard than the usual one.
"""

from __future__ import annotations

import os

import pytest

from benchmarks.adversary.adversary_parts import FLOOR, PARTS
from benchmarks.adversary.adversary_twin import removed_depth, stretches
from benchmarks.adversary.mechanisms import GOOD, HARMFUL
from benchmarks.adversary.run_adversary import case_of, judged

FIRST, LAST = map(int, os.environ.get("ADVERSARY_SEEDS", "0:56").split(":"))
ONE_WAY = ("pit level", "pit slope", "pit cylinder", "groove", "small ball", "rim pit", "edge notch", "wall cut",
           "side cut", "floor dip")
"""Mechanisms whose depth is that from the removed places to the surface."""


def test_a_seed_gives_the_same_case_and_mechanisms_use_all_parts():
    for seed, mechanism in ((3, "pit level"), (4, "needle"), (5, "split moves")):
        a, b = case_of(seed, mechanism), case_of(seed, mechanism)
        assert (a.text, a.setup, a.expected) == (b.text, b.setup, b.expected)
    names = ("any dialect", "pit level", "rib off", "floor dip", "pit cylinder", "wedge short")
    used = {case_of(seed, name).part for name in names for seed in range(16)}
    assert len(PARTS) == 10 and used == set(PARTS)


def test_every_mechanism_states_what_must_come_of_it():
    for name in HARMFUL:
        case = case_of(1, name)
        assert case.mechanism == name and not case.expected.good and case.expected.kinds
    for name in GOOD:
        case = case_of(1, name)
        assert case.mechanism == name and case.expected.good


@pytest.mark.parametrize("mechanism", ONE_WAY)
def test_closed_forms_are_those_of_the_twin(mechanism):
    case = case_of(11, mechanism)
    assert case.expected.depth is not None
    depth = min(case.expected.depth, 0.5 * FLOOR) if case.part == "floor" else case.expected.depth  # from either face
    assert removed_depth(case, case.expected.lines) == pytest.approx(depth, rel=0.01, abs=2e-4)


@pytest.mark.slow
@pytest.mark.timeout(900)  # that of the boss takes 160 s alone on two cores
@pytest.mark.parametrize("part", PARTS)
def test_the_right_programs_take_nothing_out_of_their_parts(part):
    cases = (case_of(s, "any dialect") for s in range(400))
    case = next(c for c in cases if c.part == part and c.dialect == "linuxcnc")
    bow = max(s.bow for s in stretches(case.text))  # by which chords of arcs round a boss cut in
    assert removed_depth(case) < 1e-4 + bow


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(FIRST, LAST))
def test_harm_is_found_and_good_programs_are_proved(seed):
    row = judged(seed, case_of(seed))
    assert row.right, row
