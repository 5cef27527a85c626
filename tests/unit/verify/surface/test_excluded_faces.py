"""Faces that the setup does not let machine: found where a program brings them to size, and not on its way."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from tests.pocket_case import DEPTH, SETUP, TOOL, block, line_of, program, text
from verify.model import FindingKind, ScoredSamples
from verify.prove import prove

TOP, WALLS, FLOOR = 6, (7, 8, 9, 10), 11
HEAD = ["%", "G21 G90 G17 G94 G40 G49 G61 G54", "T1 M6", "S8000 M3", "G0 G43 H1 Z20"]
TAIL = ["G0 Z20", "M5", "M30", "%"]
WHY = "operations.exclude_faces names it"


def faced(height):
    """The top, with the flat of 4 mm, to a height."""
    rows = []
    for k, y in enumerate(np.arange(-15.0, 15.1, 3.0)):
        rows += [f"Y{y:.1f}", f"X{23 if k % 2 == 0 else -23}"]
    return [*HEAD, "G0 X-26 Y-15", f"G0 Z{height:.3f}", "G1 X-23 F800", *rows, *TAIL]


def run(lines, alone, setup=SETUP, part=None):
    part = part or block()
    samples = sample_surface(part.mesh, 3.0, seed=3)
    proof = prove([("p.ngc", text(lines))], part, (TOOL,), replace(setup, left_alone=dict.fromkeys(alone, WHY)),
                  ScoredSamples(samples, np.zeros(len(samples), np.int32)), [])
    return proof, [f for f in proof.findings if f.kind is FindingKind.EXCLUDED_FACE]


def test_a_face_that_is_left_alone_and_brought_to_size_is_found():
    proof, found = run(faced(0.0), [TOP])
    assert proof.counts == {"excluded_face": 1} and found[0].face == f"F{TOP}"
    worst = found[0]
    assert worst.depth == pytest.approx(0.5, abs=1e-6) and worst.limit == SETUP.gouge_tolerance
    assert worst.line >= faced(0.0).index("G1 X-23 F800") and WHY in worst.message
    assert sum(f.area for f in found) == pytest.approx(40 * 30 - 20 * 12, rel=0.02)
    assert not run(faced(0.0), [FLOOR])[1]


@pytest.mark.parametrize("height", [0.05, 0.4])
def test_stock_taken_off_on_the_way_is_no_finding(height):
    assert not run(faced(height), [TOP, FLOOR, *WALLS])[1]


@pytest.mark.slow
def test_what_is_cut_deeper_is_a_gouge():
    lines = faced(-0.1)
    one = lines.index("Y-12.0")
    proof, found = run([*lines[:one], *TAIL], [TOP])
    assert not found and set(proof.counts) == {"gouge"}


def test_a_blank_that_has_no_stock_there_is_not_cut():
    assert not run(faced(0.0), [TOP], replace(SETUP, margin=0.005))[1]


def test_a_tool_that_finishes_the_floor_may_touch_the_wall():
    assert not run(program(), WALLS)[1]


def test_a_tool_that_finishes_the_walls_may_touch_the_floor_beside_them_alone():
    """The floor is 12 mm wide, and a tool of 4 mm has no work in its middle."""
    _, found = run(program(), [FLOOR])
    assert {f.face for f in found} == {f"F{FLOOR}"}
    assert max(f.depth for f in found) == pytest.approx(0.5 - DEPTH)
    assert found[0].line > line_of(program(), f"(layer {DEPTH:.3f})")
    # the middle, farther from the walls than the tool is wide, and a little
    wide = 2.0 * TOOL.radius + 0.2 * TOOL.radius + 0.18
    assert sum(f.area for f in found) == pytest.approx((20 - 2 * wide) * (12 - 2 * wide), rel=0.1)


def test_the_rest_of_a_face_that_the_tool_goes_over_is_found():
    """The tool that finishes the walls faces the top too: it may touch places near their rims, and no others."""
    both = [*program()[:-4], *faced(0.0)[5:]]
    _, found = run(both, [TOP])
    assert {f.face for f in found} == {f"F{TOP}"} and 40 * 30 - 26 * 18 < found[0].area < 40 * 30 - 20 * 12


def test_a_narrow_pocket_beside_a_face_that_is_finished_is_found():
    """One tool faces the top and mills the pocket; the pocket was not to be machined."""
    _, found = run([*program()[:-4], *faced(0.0)[5:]], [*WALLS, FLOOR])
    depth = {f.face: f.depth for f in found}  # of walls, the way across the pocket
    assert depth == pytest.approx({"F7": 12.0, "F9": 12.0, "F8": 20.0, "F10": 20.0, f"F{FLOOR}": 0.5 - DEPTH}, rel=1e-6)


def test_all_faces_left_alone_are_found():
    both = [*program()[:-4], *faced(0.0)[5:]]
    _, all_ = run(both, [TOP, *WALLS, FLOOR])
    assert {f.face for f in all_} == {f"F{n}" for n in (TOP, *WALLS, FLOOR)}
