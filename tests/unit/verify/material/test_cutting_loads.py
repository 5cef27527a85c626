"""Loads on tools in their cuts: findings over what any cutter bears, cautions over what tool and material recommend."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.cutting_mechanics import bending_stress, compliance, cutting_force, cutting_forces
from geometry.tool_body import ToolBody
from schemas.tools import Tool
from service.cutting_data import MATERIALS, cutting_words
from tests.pocket_case import SETUP, block, program, scored, text
from verify.model import NcProgram, ScoredSamples
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))
MILL = ToolBody("T1", 1, 4.0, 0.0, 12.0, 4.0, 12.0, 4.0, 30.0)
WORDS = cutting_words(MATERIALS["C45"], Tool(id="T1", kind="flat", diameter_mm=4.0, flutes=4))


def judged(lines, words=WORDS, tool=MILL, setup=SETUP, turn=None):
    head = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
    whole = NcProgram("p", text([*head, *lines, "G0 Z20", "M5", "M30", "%"]), turn)
    proof = prove([whole], PART, (tool,), replace(setup, cutting={1: words}), NOBODY, (), threads=2)
    return [f for f in proof.findings if f.kind == "load"], {c.kind: c for c in proof.cautions}


def slot(deep, feed, speed=8000):
    """A slot along X through the outside of the block, in from the side."""
    return [f"S{speed} M3", "G0 X-26 Y12", f"Z{0.5 - deep:.4f}", f"G1 X26 F{feed}"]


def test_a_sound_slot_has_neither_finding_nor_caution():
    assert judged(slot(0.4, 600), tool=replace(MILL, stickout=16.0)) == ([], {})


def test_a_feed_per_tooth_over_a_fifth_of_the_diameter_is_a_load():
    found, cautions = judged(slot(0.4, 6000, 100))
    assert [(f.line, f.limit) for f in found] == [(9, pytest.approx(0.8))] and found[0].depth == pytest.approx(15.0)
    assert "0.800 mm" in found[0].message and "chip_load" not in cautions
    found, cautions = judged(slot(0.2, 3000, 2000))  # 0.375 mm
    assert found == [] and cautions["chip_load"].measured == pytest.approx(0.375)
    assert cautions["chip_load"].limit == pytest.approx(WORDS.per_tooth) and cautions["chip_load"].line == 9


def test_a_speed_over_thirty_times_the_recommended_one_is_a_load():
    found, _ = judged(slot(0.4, 60000, 400000))
    assert [f.depth for f in found] == [pytest.approx(math.pi * 4.0 * 400.0)] and found[0].limit == 30.0 * 130.0
    found, cautions = judged(slot(0.4, 2000, 24000))
    assert found == [] and cautions["cutting_speed"].measured == pytest.approx(math.pi * 4.0 * 24.0)


def closed_form(deep, width, feed, speed, tool=MILL):
    force = cutting_force(WORDS.kc, WORDS.mc, feed / (speed * 4), deep, width, tool, 4)
    return *bending_stress(tool, force, deep), force * compliance(tool)


@pytest.mark.slow
@pytest.mark.parametrize("turn", [None, np.eye(3)], ids=["lines", "field"])
def test_stress_and_deflection_of_a_slot_are_those_of_the_closed_form(turn):
    stress, strong, bend = closed_form(6.0, 4.0, 3000, 8000)
    assert stress > strong
    found, cautions = judged(slot(6.0, 3000), turn=turn)
    assert [f.depth for f in found] == [pytest.approx(stress, rel=0.1)] and found[0].limit == pytest.approx(strong)
    assert cautions["deflection"].measured == pytest.approx(bend, rel=0.1)
    assert cautions["depth_of_cut"].measured == pytest.approx(24.0, rel=0.1)
    stress, strong, bend = closed_form(1.0, 4.0, 600, 8000)
    assert stress < strong
    found, cautions = judged(slot(1.0, 600), turn=turn)
    assert found == [] and ("deflection" in cautions) == (bend > WORDS.bend)


@pytest.mark.slow
def test_a_load_does_not_depend_on_how_the_program_is_divided():
    pieces = [f"G1 X{-26 + 0.2 * k:.3f} F3000" for k in range(1, 261)]
    whole, parts = judged(slot(6.0, 3000))[0], judged([*slot(6.0, 3000)[:-1], *pieces])[0]
    assert parts[0].depth == pytest.approx(whole[0].depth, rel=0.1)
    shallow = ["G1 X-26 Y13.9 F3000", "X26", "X-26 Y13.9"]  # a long way in air and along the edge before and after
    assert judged([*slot(6.0, 3000)[:-1], *shallow, "Y12", "X26"])[0]


def test_a_narrow_finish_as_deep_as_the_slot_is_no_load():
    lines = ["G0 X-26 Y17.3", "Z-5.5", "G1 X26 F3000"]  # 0.2 mm of the side
    assert judged(lines)[0] == []


def test_what_the_tool_states_is_a_caution():
    words = replace(WORDS, rpm=5000.0, feed=300.0, plunge_feed=50.0, life=0.02, coolant=True)
    proof = prove([NcProgram("p", text(program()))], PART, (replace(MILL, stickout=30.0),),
                  replace(SETUP, cutting={1: words}), NOBODY, (), threads=2)
    data = [c for c in proof.cautions if c.kind == "tool_data"]
    assert [(c.limit, c.measured > c.limit, c.line > 0) for c in data] == [
        (limit, True, True) for limit in (5000.0, 300.0, 0.02)]
    assert data[0].measured == 8000.0 and not [f for f in proof.findings if f.kind == "load"]
    assert [c.kind for c in proof.cautions if c.kind == "coolant"] == ["coolant"]
    kept = replace(WORDS, rpm=8000.0, feed=5000.0, plunge_feed=5000.0, life=100.0, coolant=False)
    proof = prove([NcProgram("p", text(program()))], PART, (MILL,), replace(SETUP, cutting={1: kept}), NOBODY, ())
    assert not [c for c in proof.cautions if c.kind in ("tool_data", "coolant")]


def test_a_fresh_cutter_begins_a_new_life():
    words = replace(WORDS, life=0.14)
    one = ["G0 X-26 Y12", "Z0.1", "G1 X26 F600", "G0 Z20"]
    two = ["G0 X-26 Y-12", "Z0.1", "G1 X26 F600"]
    assert "tool_data" in judged([*one, *two], words)[1]
    assert "tool_data" not in judged([*one, "M5", "M0", "S8000 M3", *two], words)[1]


@pytest.mark.parametrize("wait, harm", [("G4 P1", True), ("G4 P0.05", False)])
def test_a_dwell_in_the_cut(wait, harm):
    lines = ["G0 X-26 Y12", "Z0.1", "G1 X0 F600", wait, "X26"]
    cautions = judged(lines)[1]
    assert ("dwell" in cautions) == harm
    if harm:
        assert cautions["dwell"].line == 9 and cautions["dwell"].measured == pytest.approx(8000 / 60)
    assert "dwell" not in judged(["G4 P1", "G0 X-26 Y12", "Z0.1", "G1 X26 F600", "X40", "G4 P1"])[1]


def test_a_plunge_that_is_too_fast():
    lines = ["G0 X-12 Y12", "Z1", "G1 Z0.2 F3000", "X26 F600"]
    assert judged(lines)[1]["plunge_feed"].line == 8
    assert "plunge_feed" not in judged(["G0 X-12 Y12", "Z1", "G1 Z0.2 F300", "X26 F600"])[1]


def test_many_forces_at_once_are_those_one_by_one():
    rng = np.random.default_rng(4)
    for corner in (0.0, 0.5, 2.0):
        tool = replace(MILL, corner_radius=corner)
        fz, a, ae = rng.uniform(0.001, 0.3, 200), rng.uniform(0.01, 10.0, 200), rng.uniform(0.01, 4.0, 200)
        want = [cutting_force(2640.0, 0.24, *row, tool, 4) for row in zip(fz, a, ae, strict=True)]
        np.testing.assert_allclose(cutting_forces(2640.0, 0.24, fz, a, ae, tool, 4), want, rtol=1e-12)
