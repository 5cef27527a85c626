"""The hole before a tap: its diameter may be that of the teeth or that of the hole, and pitches tell which."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from schemas.tools import Tool
from service.cutting_data import MATERIALS, cutting_words
from tests.pocket_case import SETUP, block, scored, text
from verify.checks.tap_holes import needed_hole, thread_rank
from verify.model import NcProgram, ScoredSamples
from verify.prove import prove

PART = block()
NOBODY = ScoredSamples(scored(PART).samples, np.zeros(len(scored(PART).zone), np.int32))


@pytest.mark.parametrize(("diameter", "pitch", "hole", "outer"), [
    (5.0, 0.8, 4.05, True), (4.2, 0.8, 3.99, False), (6.0, 1.0, 4.82, True), (5.0, 1.0, 4.75, False),
    (16.0, 2.0, 13.56, True), (14.0, 2.0, 13.3, False), (8.0, 1.0, 6.78, True), (6.35, 1.27, 4.876, True),
    (5.1, 1.27, 4.845, False), (1.0, 0.25, 0.715, True), (0.75, 0.25, 0.7125, False), (7.3, 0.9, 6.935, False)])
def test_diameter_and_pitch_tell_what_the_diameter_is(diameter, pitch, hole, outer):
    assert needed_hole(diameter, pitch) == (pytest.approx(hole, abs=6e-3), outer)


def test_usual_threads_are_known_to_a_fiftieth_of_their_pitch():
    assert thread_rank(5.0, 0.81) == 0 and thread_rank(5.0, 0.83) is None
    assert thread_rank(14.0, 2.0) == 1 and thread_rank(10.0, 1.0) == 1


def tapped(drill, diameter, feed, stated=None, pitch=None):
    """Plunges and assumptions of a tap behind a drill, 3 mm deep."""
    tools = (ToolBody("T1", 1, drill, 0.0, 20.0, drill, 20.0, drill, 40.0, named="drill", cone_height=0.3 * drill),
             ToolBody("T2", 2, diameter, 0.0, 12.0, diameter, 12.0, diameter, 40.0, named="tap"))
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54", "T1 M6", "S2000 M3", "G0 X12 Y12", "G43 H1 Z20", "G0 Z2",
             "G1 Z-6 F100", "G0 Z20", "T2 M6", "S500 M3", "G0 X12 Y12", "G43 H2 Z20", "G1 Z2 F2000",
             f"G84 X12 Y12 Z-3 R2 F{feed}", "G80", "G0 Z20", "M5", "M30", "%"]
    words = {2: cutting_words(MATERIALS["C45"], Tool(id="T2", kind="tap", diameter_mm=diameter, pitch_mm=pitch))}
    setup = replace(SETUP, cutting=words, tap_holes={} if stated is None else {2: stated})
    proof = prove([NcProgram("p", text(lines))], PART, tools, setup, NOBODY, (), threads=2)
    return ([f for f in proof.findings if f.kind == "plunge"],
            [a.value for a in proof.assumed if a.what == "tap_diameter"])


@pytest.mark.parametrize(("drill", "diameter", "feed", "harm"), [
    (4.2, 5.0, 400, False), (3.3, 5.0, 400, True),  # M5 by its outer diameter, and in the hole of M4
    (4.2, 4.2, 400, False), (3.3, 4.2, 400, True)])  # M5 by the diameter of its hole
def test_a_tap_in_the_hole_of_the_next_smaller_thread_is_found(drill, diameter, feed, harm):
    found, taken = tapped(drill, diameter, feed)
    assert [(f.line, round(f.depth, 1)) for f in found] == [(15, 3.5)] * harm
    assert not harm or f"the hole must be {4.05 if diameter == 5.0 else 3.99} mm wide" in found[0].message
    assert taken == ["T2: a thread of 5 mm, pitch 0.8 mm"] * (diameter == 5.0)


def test_the_hole_that_the_setup_states_counts():
    assert tapped(3.3, 4.0, 350, stated=3.3) == ([], []) and tapped(3.3, 4.2, 400, stated=3.3) == ([], [])
    assert tapped(3.0, 4.0, 350, stated=3.3)[0]
