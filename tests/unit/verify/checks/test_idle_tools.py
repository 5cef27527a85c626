"""Tools that feed in air while others cut, and tools whose work a later tool takes off: wrong lengths, as a rule."""

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from tests.pocket_case import OTHER, SETUP, TOOL, block, program, text
from verify.model import Asked, FindingKind, ScoredSamples
from verify.prove import prove

TOP, FLOOR = 6, 11
DRILL = replace(TOOL, id="T3", number=3, named="drill", cone_height=1.2)
TAP = replace(TOOL, id="T4", number=4, named="tap")
HEAD, END = ["%", "G21 G90 G17 G94 G40 G49 G54 G61"], ["G0 Z40", "M5", "M30", "%"]


class Nothing:
    """A touch that reaches nothing: no stock is a finding."""

    def reaches(self, samples, tools, axes, lift, room):
        return np.zeros(len(samples), np.bool_)

    def edges(self, samples, tools, axes, lift):
        return np.zeros(len(samples), dtype=bool)

    def on_ways(self, samples, tools, axes, lift, stepped):
        return np.zeros(len(samples), dtype=bool)

    def reasons(self, samples, tools, axes):
        return np.full(len(samples), "corner", dtype=object)


def work(number, *lines, speed=8000):
    """Lines of one tool, between a change to it and a retract."""
    return [f"T{number} M6", f"S{speed} M3" if speed else "M5", f"G0 G43 H{number} Z40", *lines, "G0 Z40"]


def faced(height):
    """The whole top in rows of 5 mm."""
    rows = [f"X{25 * (-1) ** k} Y{y}\nX{-25 * (-1) ** k}" for k, y in enumerate((-15, -10, -5, 0, 5, 10, 15))]
    return [f"G0 X25 Y-22\nZ8\nG1 Z{height} F300", *rows]


def pocket(by):
    """The cuts of the pocket, ``by`` mm too high."""
    return [re.sub(r"Z(-?[\d.]+)", lambda m: f"Z{float(m[1]) + by:.4f}", line) for line in program(2.75)[5:-4]]


def findings(*lines, faces=None):
    part = block()
    samples = sample_surface(part.mesh, 20.0, seed=3, triangles=np.flatnonzero(part.mesh.face_ids >= 2))
    proof = prove([("a.ngc", text([*HEAD, *lines, *END]))], part, (TOOL, OTHER, DRILL, TAP), SETUP,
                  ScoredSamples(samples, np.zeros(len(samples), np.int32)), [],
                  asked=Asked(faces, Nothing()))
    return [f for f in proof.findings if f.kind is FindingKind.NOTHING_CUT], proof.work.faces


def test_a_mill_that_is_higher_than_its_pocket_is_deep_cuts_nothing():
    (found,), faces = findings(*work(2, *faced(0.0)), *work(1, *pocket(6.0)))
    assert faces == (TOP,) and found.line > 20
    assert re.fullmatch(r"T1: no feed move meets part or stock, lines \d+ to \d+: check the length of the tool",
                        found.message)


@pytest.mark.parametrize(("number", "lines", "told"), [
    (3, ["G98 G81 X0 Y0 Z2 R8 F100", "G80"], True),
    (3, ["G98 G81 X0 Y0 Z-3 R8 F100", "G80"], False),
    (1, ["G0 X0 Y0", "Z8", "G1 Z2 F100", "G0 Z9"], True),  # a plunge
    (1, ["G0 X0 Y0", "Z8", "G1 Z2 F100", "G0 X5"], False),  # it comes down, and does no more
    (1, ["G0 X0 Y0", "Z8", "G1 Z12 F100"], False),
    (1, ["G0 X-15 Y-12", "Z8", "G1 Z0 F100", "X15"], False),  # a spring pass over the top
    (1, ["G0 X-15 Y-12", "Z8", "G1 Z0.01 F100", "X15"], False),
    (1, ["G0 X-15 Y-12", "Z8", "G1 Z0.2 F100", "X15"], True),
    (1, ["G0 X-25 Y-17", "Z-3", "G1 X25 F100"], False),  # along a side that the blank has
    (4, ["G0 X0 Y0", "Z8", "G1 Z1 F100", "G0 Z8"], False),  # a tap within its radius of the stock
    (4, ["G0 X0 Y0", "Z8", "G1 Z3 F100", "G0 Z8"], True),
])
def test_only_a_tool_in_air_throughout_cuts_nothing(number, lines, told):
    found, _ = findings(*work(2, *faced(0.0)), *work(number, *lines), faces=frozenset())
    assert bool(found) is told and all(f.message.startswith(f"T{number}: ") for f in found)


@pytest.mark.parametrize(("shift", "told"), [("Z40", True), ("X200", True), ("Z5", False)])
def test_a_shift_that_takes_all_its_cuts_away_is_told(shift, told):
    """The faces that it misses are not worked on, so no stock is left on an asked face; 5 mm is a layer above."""
    found, _ = findings(*work(2, *faced(0.0)), f"G52 {shift}", *pocket(0.0), "G52 X0 Y0 Z0")
    assert not findings(*work(1, *faced(0.0)), *pocket(0.0))[0]
    assert bool(found) is told
    assert all("in these shifted or turned coordinates" in f.message and f.line > 20 for f in found)


def test_a_tool_that_stands_still_is_no_cutter():
    found, _ = findings(*work(2, *faced(0.0)), *work(1, "G0 X-15 Y-12", "Z8", "G1 Z2 F100", "X15", speed=0))
    assert not found


def test_a_finishing_tool_comes_near_the_stock_that_stood_before_it():
    """It runs 0.01 mm over the rough top, and is no tool in air though a later tool takes that off."""
    found, _ = findings(*work(2, *faced(0.3)), *work(1, "G0 X-15 Y-12", "Z8", "G1 Z0.31 F100", "X15"),
                        *work(2, *faced(0.0)))
    assert not found


def test_what_a_tool_cuts_too_high_is_worked_on_though_a_later_tool_faces_it_off():
    found, faces = findings(*work(1, *pocket(5.2)), *work(2, *faced(0.0)))
    assert not found and faces == (TOP, FLOOR)


def test_roughing_the_top_is_no_work_on_the_floor_of_the_pocket():
    assert findings(*work(1, *faced(0.25)), *work(2, *faced(0.0)))[1] == (TOP,)
